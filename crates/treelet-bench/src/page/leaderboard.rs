//! Who is fastest on the whole.
//!
//! Nobody knows how many rays somebody else will trace, so an entrant is judged four times: with its
//! build and 10^6, 10^8 and 10^10 rays (a preview, a picture, a film's shot), and at pure tracing. In
//! each diagram each of the four counts as a share of the fastest entrant's speed; a score is the
//! geometric mean of all of them. A geometric mean of shares ranks as the geometric mean of the speeds
//! does: no scene, no kind of ray weighs more because it is slow or fast, and nobody gains from whom
//! else is compared.

use std::collections::BTreeSet;

use super::numbers::geometric_mean;
use crate::figure::data::{Figure, Panel, Point};
use crate::figure::envelope::{Curve, best_at};

/// Numbers of rays that are judged; infinity is pure tracing.
pub(super) const JUDGED: [f64; 4] = [1e6, 1e8, 1e10, f64::INFINITY];

/// Somebody's place.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Row {
    pub(super) engine: String,
    /// `None` is the engine with its best variant each time.
    pub(super) variant: Option<String>,
    /// The score: 1 is the fastest each time.
    pub(super) score: f64,
    /// The score of each of [`JUDGED`].
    pub(super) parts: [f64; 4],
}

/// Rays a second, construction included; at infinity, of tracing alone.
fn speed(curves: &[Curve], rays: f64) -> Option<f64> {
    if rays.is_finite() {
        best_at(curves, rays).map(|(_, seconds)| rays / seconds)
    } else {
        curves.iter().map(|curve| curve.rays_per_s).max_by(f64::total_cmp)
    }
}

/// A competitor: some curves in each of the diagrams that it took part in.
struct Competitor {
    engine: String,
    variant: Option<String>,
    /// By diagram.
    curves: Vec<Vec<Curve>>,
}

/// Every variant by itself, over these diagrams; only those that are in all of them.
pub(super) fn variants(figure: &Figure, panels: &[Panel]) -> Vec<Row> {
    let names: BTreeSet<(&str, &str)> = points(figure, panels)
        .map(|point| (point.engine.as_str(), point.variant.as_str()))
        .collect();
    let competitors = names.into_iter().map(|(engine, variant)| Competitor {
        engine: engine.to_owned(),
        variant: Some(variant.to_owned()),
        curves: curves(figure, panels, &|point| point.engine == engine && point.variant == variant),
    });
    rank(competitors.collect(), panels.len())
}

/// Every engine with its best variant each time.
pub(super) fn engines(figure: &Figure, panels: &[Panel]) -> Vec<Row> {
    let names: BTreeSet<&str> = points(figure, panels).map(|point| point.engine.as_str()).collect();
    let competitors = names.into_iter().map(|engine| Competitor {
        engine: engine.to_owned(),
        variant: None,
        curves: curves(figure, panels, &|point| point.engine == engine),
    });
    rank(competitors.collect(), panels.len())
}

fn points<'a>(figure: &'a Figure, panels: &'a [Panel]) -> impl Iterator<Item = &'a Point> {
    figure.points.iter().filter(|point| panels.iter().any(|panel| panel.holds(point)))
}

fn curves(figure: &Figure, panels: &[Panel], is: &dyn Fn(&Point) -> bool) -> Vec<Vec<Curve>> {
    let of = |panel: &Panel| {
        figure.points_of(panel).into_iter().filter(|point| is(point)).map(Point::curve).collect()
    };
    panels.iter().map(of).collect()
}

/// Scores of those that are in every diagram, the best first.
fn rank(mut competitors: Vec<Competitor>, panels: usize) -> Vec<Row> {
    competitors.retain(|competitor| competitor.curves.iter().all(|curves| !curves.is_empty()));
    let fastest = |panel: usize, rays: f64| {
        let speeds = competitors.iter().filter_map(|other| speed(&other.curves[panel], rays));
        speeds.fold(0.0, f64::max)
    };
    let mut rows = Vec::new();
    for Competitor { engine, variant, curves } in &competitors {
        let mut parts = [0.0; 4];
        for (part, rays) in parts.iter_mut().zip(JUDGED) {
            let shares = (0..panels)
                .filter_map(|panel| Some(speed(&curves[panel], rays)? / fastest(panel, rays)));
            *part = geometric_mean(shares).unwrap_or(0.0);
        }
        let score = geometric_mean(parts.into_iter()).unwrap_or(0.0);
        rows.push(Row { engine: engine.clone(), variant: variant.clone(), score, parts });
    }
    let name = |row: &Row| (row.engine.clone(), row.variant.clone());
    rows.sort_by(|a, b| b.score.total_cmp(&a.score).then_with(|| name(a).cmp(&name(b))));
    rows
}

#[cfg(test)]
mod tests {
    use super::{engines, variants};
    use crate::figure::data::{Figure, Point};

    fn figure(points: &[(&str, &str, &str, f64, f64)]) -> Figure {
        let point = |&(scene, engine, variant, build_s, mrays_per_s): &_| {
            Point::of(scene, engine, variant, build_s, mrays_per_s)
        };
        Figure { points: points.iter().map(point).collect(), ..Figure::default() }
    }

    #[test]
    fn scores_are_shares_of_the_fastest() {
        // Without a build, all four parts are the ratio of the tracing speeds.
        let figure = figure(&[("s", "e", "slow", 0.0, 2.0), ("s", "e", "fast", 0.0, 8.0)]);
        let rows = variants(&figure, &figure.panels());
        let variants: Vec<_> = rows.iter().filter_map(|row| row.variant.as_deref()).collect();
        assert_eq!(variants, ["fast", "slow"]);
        assert!((rows[0].score - 1.0).abs() < 1e-12 && (rows[1].score - 0.25).abs() < 1e-12);
    }

    #[test]
    fn only_those_that_ran_everywhere_are_ranked() {
        let figure = figure(&[
            ("s", "e", "both", 1.0, 2.0),
            ("t", "e", "both", 1.0, 2.0),
            ("s", "f", "one", 1.0, 99.0),
        ]);
        let rows = variants(&figure, &figure.panels());
        assert_eq!(rows.len(), 1);
        // Those that did not take part set no pace, either.
        assert_eq!(rows[0].score, 1.0);
        assert_eq!(variants(&figure, &figure.panels()[..1]).len(), 2);
    }

    #[test]
    fn engines_choose_their_best_variant_each_time() {
        let figure = figure(&[
            ("s", "e", "quick", 0.0, 1.0),
            ("s", "e", "good", 1e3, 100.0),
            ("s", "f", "good", 1e3, 100.0),
        ]);
        let rows = engines(&figure, &figure.panels());
        assert_eq!((rows[0].engine.as_str(), rows[0].score), ("e", 1.0));
        assert!(rows[1].parts[0] < 0.01 && rows[1].parts[3] == 1.0, "{rows:?}");
    }
}
