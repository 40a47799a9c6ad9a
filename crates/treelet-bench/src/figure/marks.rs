//! How far treelet is from what it has set itself: geometric means over scenes and kinds of rays.

use super::data::{Figure, FigureMark, Panel, Point, Window, YARDSTICK};
use super::envelope::{Curve, Lead, RAYS, lead, window};
use crate::rivals::{embree, treelet as ours};
use crate::stats::median;

/// Smaller scenes do not count: on them everybody is done at once.
const TRIANGLES_LEAST: u64 = 80_000;

/// The builders that Karras and Aila 2013 compare, besides `trbvh`.
pub const PAPER_CONTENDERS: [&str; 5] = ["lbvh", "hlbvh", "ploc", "sbvh", "sweep-sah"];

/// Where the paper's builder wins, on the graphics processor of its day.
pub const PAPER_WINDOW: [f64; 2] = [7e6, 6e10];

/// The paper's builder, without and with its splitting.
const PAPER_BUILDERS: [&str; 2] = ["trbvh", "presplit+trbvh"];

/// A quotient of two variants of one panel.
struct Row {
    what: &'static str,
    above: (&'static str, &'static str),
    below: (&'static str, &'static str),
    asked: Option<f64>,
}

const fn row(
    what: &'static str,
    above: &'static str,
    below: (&'static str, &'static str),
    asked: Option<f64>,
) -> Row {
    Row { what, above: (ours::NAME, above), below, asked }
}

const SBVH: (&str, &str) = (ours::NAME, "sbvh");
const BINNED: (&str, &str) = (ours::NAME, "binned-sah");
const SWEEP: (&str, &str) = (ours::NAME, YARDSTICK);
const EMBREE_HIGH: (&str, &str) = (embree::NAME, "HIGH");

/// Quotients of tracing speed.
const TRACING: [Row; 10] = [
    row("tracing, presplit+trbvh / sbvh (paper: 0.91)", "presplit+trbvh", SBVH, Some(0.90)),
    row("tracing, lbvh / sbvh (paper: about 0.5)", "lbvh", SBVH, None),
    row("tracing, hlbvh / sbvh (paper: about 0.5)", "hlbvh", SBVH, None),
    row("tracing, trbvh / sweep-sah (paper: 0.96)", "trbvh", SWEEP, None),
    row("tracing, best / sweep-sah", "best", SWEEP, Some(1.30)),
    row("tracing, best / Embree HIGH", "best", EMBREE_HIGH, Some(1.25)),
    row("tracing, fast / binned-sah", "fast", BINNED, Some(1.0)),
    row("tracing, hploc / binned-sah", "hploc", BINNED, None),
    row("tracing, hploc+top-reinsertion / binned-sah", "hploc+top-reinsertion", BINNED, Some(1.0)),
    row("tracing, hploc+reinsertion / binned-sah", "hploc+reinsertion", BINNED, Some(1.0)),
];

/// Quotients of building speed.
const BUILDING: [Row; 4] = [
    row("build rate, fast / binned-sah", "fast", BINNED, Some(2.0)),
    row("build rate, hploc / binned-sah", "hploc", BINNED, None),
    row(
        "build rate, hploc+top-reinsertion / binned-sah",
        "hploc+top-reinsertion",
        BINNED,
        Some(2.0),
    ),
    row("build rate, hploc+reinsertion / binned-sah", "hploc+reinsertion", BINNED, None),
];

/// A quotient somewhere.
struct Cell {
    place: String,
    value: f64,
}

/// All marks, of the panels with the fewest threads over scenes of at least 80,000 triangles.
pub fn marks(figure: &Figure) -> Vec<FigureMark> {
    let panels = counting(figure);
    let mut marks = Vec::new();
    for row in &TRACING {
        let cells =
            cells(figure, &panels, row, |above, below| above.mrays_per_s / below.mrays_per_s);
        marks.push(mean(row.what, row.asked, &cells));
    }
    // Builds know of no kind of rays: a scene counts once.
    let mut scenes = panels.clone();
    scenes.dedup_by(|a, b| a.scene == b.scene);
    for row in &BUILDING {
        let cells = cells(figure, &scenes, row, |above, below| below.build_s / above.build_s);
        marks.push(mean(row.what, row.asked, &cells));
    }
    envelope_marks(figure, &panels, &mut marks);
    window_marks(figure, &panels, &mut marks);
    choice_marks(figure, &panels, &mut marks);
    marks
}

/// The panels that count.
fn counting(figure: &Figure) -> Vec<Panel> {
    let panels = figure.panels();
    let fewest = panels.iter().map(|panel| panel.threads).min();
    let large = |panel: &Panel| {
        let points = figure.points_of(panel);
        points.iter().any(|point| point.triangles.is_some_and(|count| count >= TRIANGLES_LEAST))
    };
    let counts = |panel: &Panel| Some(panel.threads) == fewest && large(panel);
    panels.into_iter().filter(counts).collect()
}

/// The quotients of a row, where both variants have a point.
fn cells(
    figure: &Figure,
    panels: &[Panel],
    row: &Row,
    quotient: impl Fn(&Point, &Point) -> f64,
) -> Vec<Cell> {
    let mut cells = Vec::new();
    for panel in panels {
        let points = figure.points_of(panel);
        let find = |(engine, variant): (&str, &str)| {
            points.iter().find(|point| point.engine == engine && point.variant == variant)
        };
        if let (Some(above), Some(below)) = (find(row.above), find(row.below)) {
            cells.push(Cell { place: panel.title(), value: quotient(above, below) });
        }
    }
    cells
}

/// Treelet's envelope against Embree's: the worst place of each panel.
pub(super) fn leads(figure: &Figure, panels: &[Panel]) -> Vec<(String, Lead)> {
    let lead_of = |panel: &Panel| {
        let of = |engine: &str| curves(&figure.points_of(panel), |it| it.engine == engine);
        let lead = lead(&of(ours::NAME), &of(embree::NAME), &RAYS)?;
        Some((panel.title(), lead))
    };
    panels.iter().filter_map(lead_of).collect()
}

fn envelope_marks(figure: &Figure, panels: &[Panel], marks: &mut Vec<FigureMark>) {
    let leads = leads(figure, panels);
    let worst = leads.iter().min_by(|a, b| a.1.factor.total_cmp(&b.1.factor));
    let note = worst.map_or_else(
        || "no points of Embree's".to_owned(),
        |(place, lead)| format!("{place}, at {} rays", super::envelope::rays_name(lead.rays)),
    );
    marks.push(mark(
        "envelope against Embree's best, worst place",
        worst.map(|(_, lead)| lead.factor),
        Some(1.0),
        Ask::AtLeast,
        leads.len(),
        note,
    ));
    let cells: Vec<_> =
        leads.into_iter().map(|(place, lead)| Cell { place, value: lead.factor }).collect();
    marks.push(mean("envelope against Embree's best, mean of the worst places", None, &cells));
}

/// Where the paper's builder wins among the paper's contenders, in every panel.
pub fn windows(figure: &Figure) -> Vec<Window> {
    let panels = figure.panels();
    let mut windows = Vec::new();
    for panel in &panels {
        for builder in PAPER_BUILDERS {
            let points = figure.points_of(panel);
            let takes_part = |name: &str| name == builder || PAPER_CONTENDERS.contains(&name);
            let points: Vec<&Point> = points
                .into_iter()
                .filter(|it| it.engine == ours::NAME && takes_part(&it.variant))
                .collect();
            let Some(own) = points.iter().position(|it| it.variant == builder) else { continue };
            let curves = curves(&points, |_| true);
            let range = window(&curves, own, &RAYS);
            windows.push(Window {
                scene: panel.scene.clone(),
                kind: panel.kind.clone(),
                threads: panel.threads,
                variant: builder.to_owned(),
                from: range.as_ref().map(|range| range.start),
                to: range.as_ref().map(|range| range.end),
            });
        }
    }
    windows
}

fn window_marks(figure: &Figure, panels: &[Panel], marks: &mut Vec<FigureMark>) {
    let windows = windows(figure);
    for builder in PAPER_BUILDERS {
        let counts = |it: &&Window| {
            let here = |panel: &Panel| {
                panel.scene == it.scene && panel.kind == it.kind && panel.threads == it.threads
            };
            it.variant == builder && panels.iter().any(here)
        };
        let here: Vec<_> = windows.iter().filter(counts).collect();
        let ends = |end: fn(&Window) -> Option<f64>| -> Vec<Cell> {
            let value = |it: &&Window| Some(Cell { place: it.scene.clone(), value: end(it)? });
            here.iter().filter_map(value).collect()
        };
        let (from, to) = (ends(|it| it.from), ends(|it| it.to));
        let note = format!("wins somewhere in {} of {} panels", from.len(), here.len());
        let whats = [
            (format!("{builder} wins from (rays; paper: 7 M)"), from),
            (format!("{builder} wins to (rays; paper: 60 G)"), to),
        ];
        for (what, cells) in whats {
            marks.push(FigureMark { note: note.clone(), ..mean(&what, None, &cells) });
        }
    }
}

fn choice_marks(figure: &Figure, panels: &[Panel], marks: &mut Vec<FigureMark>) {
    let of = |choices: &[super::data::Choice]| -> Vec<super::data::Choice> {
        let counts = |it: &&super::data::Choice| panels.iter().any(|panel| panel.holds_choice(it));
        choices.iter().filter(counts).cloned().collect()
    };
    let (choices, auto) = (of(&figure.choices), of(&figure.auto));
    let place = |it: &super::data::Choice| {
        let rays = super::envelope::rays_name(it.rays as f64);
        format!("{}, {} rays, {rays}, {} for {}", it.scene, it.kind, it.variant, it.best_variant)
    };
    let regrets: Vec<f64> = choices.iter().map(super::data::Choice::regret).collect();
    let worst = choices.iter().max_by(|a, b| a.regret().total_cmp(&b.regret()));
    let errors: Vec<f64> = choices.iter().filter_map(super::data::Choice::error).collect();
    let middle = |values: &[f64]| (!values.is_empty()).then(|| median(values));
    let count = choices.len();
    let mut add = |what: &str, value, asked, cells, note| {
        marks.push(mark(what, value, Some(asked), Ask::AtMost, cells, note));
    };
    add("for_rays, regret, median", middle(&regrets), 0.05, count, String::new());
    let note = worst.map(place).unwrap_or_default();
    add("for_rays, regret, worst", worst.map(|it| it.regret()), 0.25, count, note);
    add(
        "for_rays, error of the foretold time, median",
        middle(&errors),
        0.15,
        count,
        String::new(),
    );
    let worst = auto.iter().max_by(|a, b| a.regret().total_cmp(&b.regret()));
    let note = worst.map(place).unwrap_or_default();
    add(
        "auto, times the best in hindsight, worst",
        worst.map(|it| 1.0 + it.regret()),
        2.2,
        auto.len(),
        note,
    );
}

/// Which side of what is asked is good.
#[derive(Clone, Copy, PartialEq)]
enum Ask {
    AtLeast,
    AtMost,
}

fn mark(
    what: &str,
    value: Option<f64>,
    asked: Option<f64>,
    ask: Ask,
    cells: usize,
    note: String,
) -> FigureMark {
    let met = value.zip(asked).map(|(value, asked)| match ask {
        Ask::AtLeast => value >= asked,
        Ask::AtMost => value <= asked,
    });
    FigureMark { what: what.to_owned(), value, asked, met, cells, note }
}

/// A geometric mean that must reach what is asked.
fn mean(what: &str, asked: Option<f64>, cells: &[Cell]) -> FigureMark {
    let logs: f64 = cells.iter().map(|cell| cell.value.ln()).sum();
    let value = (!cells.is_empty()).then(|| (logs / cells.len() as f64).exp());
    let worst = cells.iter().min_by(|a, b| a.value.total_cmp(&b.value));
    let note = worst.map_or_else(
        || "no scene of at least 80,000 triangles with both".to_owned(),
        |cell| format!("worst {:.2}: {}", cell.value, cell.place),
    );
    mark(what, value, asked, Ask::AtLeast, cells.len(), note)
}

/// The lines of some of the points.
pub(super) fn curves(points: &[&Point], takes_part: impl Fn(&Point) -> bool) -> Vec<Curve> {
    points.iter().filter(|point| takes_part(point)).map(|point| point.curve()).collect()
}

#[cfg(test)]
mod tests {
    use super::super::data::{Choice, Figure, Point};
    use super::{marks, windows};

    fn point(scene: &str, engine: &str, variant: &str, build_s: f64, mrays_per_s: f64) -> Point {
        let triangles = Some(if scene == "small" { 79_999 } else { 80_000 });
        Point { triangles, ..Point::of(scene, engine, variant, build_s, mrays_per_s) }
    }

    fn choice(rays: u64, predicted_s: f64, measured_s: f64, best_s: f64) -> Choice {
        Choice {
            scene: "a".into(),
            kind: "diffuse".into(),
            rays,
            variant: "x".into(),
            predicted_s: Some(predicted_s),
            measured_s,
            best_variant: "y".into(),
            best_s,
            threads: 1,
            reason: String::new(),
        }
    }

    /// Two scenes that count and one that does not.
    fn figure() -> Figure {
        let mut points = Vec::new();
        for (scene, factor) in [("a", 1.0), ("b", 4.0), ("small", 1000.0)] {
            points.push(point(scene, "treelet", "lbvh", 0.1, 1.0));
            points.push(point(scene, "treelet", "sbvh", 9.1, 2.0));
            points.push(point(scene, "treelet", "trbvh", 1.1, 1.5));
            points.push(point(scene, "treelet", "best", 20.0, 2.2 * factor));
            points.push(point(scene, "embree", "HIGH", 10.0, 2.0));
        }
        let choices =
            vec![choice(1, 1.0, 1.0, 1.0), choice(2, 1.5, 1.0, 0.8), choice(3, 2.2, 2.0, 2.0)];
        Figure { points, choices, ..Figure::default() }
    }

    #[test]
    fn means_are_over_large_scenes_and_worst_places_are_named() {
        let marks = marks(&figure());
        let mark = |what: &str| marks.iter().find(|mark| mark.what.starts_with(what)).unwrap();
        let lbvh = mark("tracing, lbvh / sbvh");
        assert_eq!((lbvh.value, lbvh.met, lbvh.cells), (Some(0.5), None, 2));
        // The mean of 1.1 and 4.4.
        let best = mark("tracing, best / Embree HIGH");
        assert!((best.value.unwrap() - 2.2).abs() < 1e-12 && best.met == Some(true), "{best:?}");
        assert!(best.note.starts_with("worst 1.10: a"), "{best:?}");
        let splits = mark("tracing, presplit+trbvh / sbvh");
        assert_eq!((splits.value, splits.met, splits.cells), (None, None, 0));
        let envelope = mark("envelope against Embree's best, worst");
        assert_eq!(envelope.cells, 2);
        assert!(envelope.met == Some(true) && envelope.note.starts_with("a, diffuse"));
        assert_eq!(mark("for_rays, regret, median").value, Some(0.0));
        let worst = mark("for_rays, regret, worst");
        assert!((worst.value.unwrap() - 0.25).abs() < 1e-12 && worst.note.contains("x for y"));
        let error = mark("for_rays, error");
        assert!((error.value.unwrap() - 0.1).abs() < 1e-12 && error.met == Some(true));
    }

    #[test]
    fn the_papers_window_is_among_the_papers_builders() {
        // `best` would end it; it is none of the paper's.
        let windows = windows(&figure());
        assert_eq!(windows.len(), 3, "each scene, without splitting");
        let near = |a: Option<f64>, b: f64| (a.unwrap() / b - 1.0).abs() < 1e-9;
        // 0.1 + n / 1e6 = 1.1 + n / 1.5e6; 1.1 + n / 1.5e6 = 9.1 + n / 2e6.
        assert!(near(windows[0].from, 3e6) && near(windows[0].to, 4.8e7), "{:?}", windows[0]);
    }
}
