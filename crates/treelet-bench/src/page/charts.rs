//! From points to diagrams: which curves, whose names, which strips, and what they say in words.

use super::chart::{Chart, Dot, Line, Span, Strip};
use super::look::{Look, Looks};
use super::names::Names;
use super::numbers;
use crate::figure::data::{Figure, Panel, Point, YARDSTICK};
use crate::figure::envelope::{Curve, Interval, RAYS, axis, winners};
use crate::rivals::treelet as ours;

/// The two forms of the figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    /// Rays a second.
    Speed,
    /// As a share of the yardstick's tracing speed.
    Share,
}

impl Form {
    pub(super) const ALL: [Self; 2] = [Self::Speed, Self::Share];

    /// For the style sheet and the script.
    pub(super) fn key(self) -> &'static str {
        match self {
            Self::Speed => "speed",
            Self::Share => "share",
        }
    }

    /// What the upright axis counts.
    pub(super) fn unit(self, names: &Names) -> String {
        match self {
            Self::Speed => "million rays a second, construction included".to_owned(),
            Self::Share => {
                let yardstick = names.ours(YARDSTICK);
                format!("share of the speed of tracing {yardstick}, construction included")
            }
        }
    }
}

/// What charts are drawn from.
pub(super) struct Source<'a> {
    pub(super) figure: &'a Figure,
    pub(super) names: &'a Names,
    pub(super) looks: &'a Looks,
}

/// The intervals of some points: of ours alone, or of all.
pub(super) fn intervals(points: &[&Point]) -> Vec<Interval> {
    let curves: Vec<Curve> = points.iter().map(|point| point.curve()).collect();
    winners(&curves, &RAYS)
}

/// The points of ours.
pub(super) fn of_ours<'a>(points: &[&'a Point]) -> Vec<&'a Point> {
    points.iter().copied().filter(|point| point.engine == ours::NAME).collect()
}

impl Source<'_> {
    pub(super) fn name(&self, point: &Point) -> String {
        self.names.full(&point.engine, &point.variant)
    }

    /// The diagram of a panel; `None` in the form of shares where the yardstick was not measured.
    pub(super) fn chart(&self, panel: &Panel, form: Form, id: &str) -> Option<Chart> {
        let points = self.figure.points_of(panel);
        let unit = match form {
            Form::Speed => 1e6,
            Form::Share => yardstick(&points)?.curve().rays_per_s,
        };
        let winners = intervals(&of_ours(&points));
        let home = of_ours(&points);
        let wins = |point: &Point| {
            winners.iter().any(|interval| std::ptr::eq(home[interval.curve], point))
        };
        let line = |point: &&Point| {
            let look = self.looks.of(point);
            let named = wins(point) || point.variant == YARDSTICK || look_is_rival(look);
            let curve = point.curve();
            let places = axis().into_iter().map(|rays| (rays, curve.effective(rays) / unit));
            Line { name: self.name(point), look, named, places: places.collect() }
        };
        Some(Chart {
            id: id.to_owned(),
            title: format!("{}: {}", panel.title(), form.unit(self.names)),
            words: self.words(&points),
            unit: form.unit(self.names),
            lines: points.iter().map(line).collect(),
            dots: self.dots(panel, unit),
            strips: self.strips(&points),
        })
    }

    /// The choices of a panel as dots.
    fn dots(&self, panel: &Panel, unit: f64) -> Vec<Dot> {
        let choices = self.figure.choices_of(panel).into_iter();
        choices
            .map(|choice| {
                let rays = choice.rays as f64;
                Dot {
                    rays,
                    value: rays / choice.measured_s / unit,
                    look: self.looks.of_named(ours::NAME, &choice.variant),
                    words: format!(
                        "for {} rays {} was chosen: {} against {} at best",
                        numbers::rays(rays),
                        self.names.ours(&choice.variant),
                        numbers::time(choice.measured_s),
                        numbers::time(choice.best_s)
                    ),
                }
            })
            .collect()
    }

    /// Who wins among all; and among ours, where others win anywhere.
    fn strips(&self, points: &[&Point]) -> Vec<Strip> {
        let home = of_ours(points);
        let strip = |name: String, points: &[&Point]| {
            let spans = intervals(points).into_iter().map(|interval| {
                let point = points[interval.curve];
                let (name, look) = (self.name(point), self.looks.of(point));
                Span { rays: interval.from..interval.to, name, look }
            });
            Strip { name, spans: spans.collect() }
        };
        let mut strips = Vec::new();
        let ours_wins = |interval: &Interval| points[interval.curve].engine == ours::NAME;
        if !home.is_empty() && !intervals(points).iter().all(ours_wins) {
            strips.push(strip(format!("best of {}", self.names.engine(ours::NAME)), &home));
        }
        strips.push(strip("fastest of all".into(), points));
        strips
    }

    /// Who wins where, in a sentence.
    pub(super) fn words(&self, points: &[&Point]) -> String {
        let parts: Vec<String> = intervals(points)
            .into_iter()
            .map(|interval| {
                let name = self.name(points[interval.curve]);
                format!("{name} up to {} rays", numbers::rays(interval.to))
            })
            .collect();
        format!("Fastest, construction included: {}.", parts.join(", then "))
    }

    /// Shares of the yardstick, as geometric means over all panels with `threads` threads that have
    /// one: the variants that are in each of them. `None` if there are fewer than two panels.
    pub(super) fn mean_chart(&self, id: &str) -> Option<Chart> {
        let panels = self.figure.panels();
        let mut measured = Vec::new();
        for panel in &panels {
            let points = self.figure.points_of(panel);
            if let Some(yardstick) = yardstick(&points) {
                measured.push((yardstick.curve().rays_per_s, points));
            }
        }
        let (_, first) = measured.first()?;
        if measured.len() < 2 {
            return None;
        }
        let mut lines: Vec<(&Point, Line)> = Vec::new();
        for point in first {
            let same =
                |other: &&&Point| other.engine == point.engine && other.variant == point.variant;
            let curves: Option<Vec<(f64, Curve)>> = measured
                .iter()
                .map(|(unit, points)| Some((*unit, points.iter().find(same)?.curve())))
                .collect();
            let Some(curves) = curves else { continue };
            let mean = |rays: f64| {
                let shares = curves.iter().map(|(unit, curve)| curve.effective(rays) / unit);
                numbers::geometric_mean(shares).unwrap_or(0.0)
            };
            let places = axis().into_iter().map(|rays| (rays, mean(rays))).collect();
            let look = self.looks.of(point);
            lines.push((point, Line { name: self.name(point), look, named: false, places }));
        }
        Some(self.finish_mean(id, lines, measured.len()))
    }

    /// Names the curves that win somewhere, and adds the strips.
    fn finish_mean(&self, id: &str, mut lines: Vec<(&Point, Line)>, panels: usize) -> Chart {
        let home: Vec<bool> = lines.iter().map(|(point, _)| point.engine == ours::NAME).collect();
        let among_ours = leaders(&lines, &|index| home[index]);
        let among_all = leaders(&lines, &|_| true);
        for (index, (point, line)) in lines.iter_mut().enumerate() {
            let wins = among_ours.iter().any(|span| span.0 == index);
            line.named = wins || point.variant == YARDSTICK || look_is_rival(line.look);
        }
        let strip = |name: &str, leaders: &[(usize, f64, f64)]| Strip {
            name: name.to_owned(),
            spans: leaders
                .iter()
                .map(|&(index, from, to)| {
                    let line = &lines[index].1;
                    Span { rays: from..to, name: line.name.clone(), look: line.look }
                })
                .collect(),
        };
        let mut strips = Vec::new();
        if among_ours != among_all {
            strips.push(strip(&format!("best of {}", self.names.engine(ours::NAME)), &among_ours));
        }
        strips.push(strip("fastest of all", &among_all));
        let parts = among_all.iter().map(|&(index, _, to)| {
            format!("{} up to {} rays", lines[index].1.name, numbers::rays(to))
        });
        let words = format!("Fastest on the mean: {}.", parts.collect::<Vec<_>>().join(", then "));
        Chart {
            id: id.to_owned(),
            title: format!("Geometric mean over {panels} diagrams of scenes and kinds of rays"),
            words,
            unit: Form::Share.unit(self.names),
            lines: lines.into_iter().map(|(_, line)| line).collect(),
            dots: Vec::new(),
            strips,
        }
    }
}

/// The point whose tracing speed is the measure of shares.
pub(super) fn yardstick<'a>(points: &[&'a Point]) -> Option<&'a Point> {
    let ours = |point: &&&Point| point.engine == ours::NAME && point.variant == YARDSTICK;
    points.iter().find(ours).copied()
}

fn look_is_rival(look: Look) -> bool {
    matches!(look, Look::Rival(_))
}

/// Who is highest from where to where, by the places of the lines: means have no exact crossings.
fn leaders(lines: &[(&Point, Line)], counts: &dyn Fn(usize) -> bool) -> Vec<(usize, f64, f64)> {
    let axis = axis();
    let mut spans: Vec<(usize, f64, f64)> = Vec::new();
    for (place, &rays) in axis.iter().enumerate() {
        let among = (0..lines.len()).filter(|&index| counts(index));
        let value = |index: usize| lines[index].1.places[place].1;
        let Some(best) = among.max_by(|&a, &b| value(a).total_cmp(&value(b)).then(b.cmp(&a)))
        else {
            continue;
        };
        match spans.last_mut() {
            Some((last, _, to)) if *last == best => *to = rays,
            last => {
                // Half-way between two places, since nothing is known of what lies between.
                let from = if place == 0 { rays } else { (rays * axis[place - 1]).sqrt() };
                if let Some((_, _, to)) = last {
                    *to = from;
                }
                spans.push((best, from, rays));
            }
        }
    }
    spans
}
