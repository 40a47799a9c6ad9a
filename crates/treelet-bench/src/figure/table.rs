//! The figure in words: who wins where, how far ahead, the marks.

use super::data::{Figure, FigureMark, Panel, Point, YARDSTICK};
use super::envelope::{RAYS, best_at, rays_name, winners};
use super::marks::{PAPER_WINDOW, curves, leads};
use super::scene::is_ours;
use crate::rivals::embree;

/// Numbers of rays at which the share of the yardstick's tracing speed is told.
const SHARES_AT: [f64; 5] = [1e5, 1e6, 1e7, 1e8, 1e10];

/// The lines of one panel.
pub fn panel_lines(figure: &Figure, panel: &Panel) -> Vec<String> {
    let points = figure.points_of(panel);
    let ours: Vec<&Point> = points.iter().copied().filter(|point| is_ours(point)).collect();
    let mut lines = vec![String::new(), format!("  {}", panel.title())];
    lines.push(format!("    {:34} {:>17} {:>9} {:>9}", "wins", "rays", "build", "Mrays/s"));
    lines.extend(winner_lines(&ours));
    if ours.len() < points.len() {
        lines.push("    among all engines".to_owned());
        lines.extend(winner_lines(&points));
    }
    for (_, lead) in leads(figure, std::slice::from_ref(panel)) {
        let (factor, rays) = (lead.factor, rays_name(lead.rays));
        lines.push(format!(
            "    Embree's best takes {factor:.2} times as long at worst, at {rays} rays"
        ));
    }
    lines.extend(share_line(&points));
    for window in figure.windows.iter().filter(|window| {
        window.scene == panel.scene && window.kind == panel.kind && window.threads == panel.threads
    }) {
        let [from, to] = PAPER_WINDOW.map(rays_name);
        let wins = match (window.from, window.to) {
            (Some(from), Some(to)) => format!("wins {} to {}", rays_name(from), rays_name(to)),
            _ => "wins nowhere".to_owned(),
        };
        let variant = &window.variant;
        lines.push(format!(
            "    {variant} among the paper's builders {wins} (paper: {from} to {to})"
        ));
    }
    for choice in figure.choices_of(panel) {
        lines.push(format!(
            "    for {:>7} rays: {:26} {:>9.3} s, foretold {:>9.3} s; best {:26} {:>9.3} s ({:+.1} %)",
            rays_name(choice.rays as f64),
            choice.variant,
            choice.measured_s,
            choice.predicted_s.unwrap_or(f64::NAN),
            choice.best_variant,
            choice.best_s,
            100.0 * choice.regret()
        ));
    }
    lines
}

/// A line for each interval.
fn winner_lines(points: &[&Point]) -> Vec<String> {
    let line = |interval: super::envelope::Interval| {
        let point = points[interval.curve];
        format!(
            "    {:34} {:>7} .. {:>6} {:>7.3} s {:>9.3}",
            format!("{} {}", point.engine, point.variant),
            rays_name(interval.from),
            rays_name(interval.to),
            point.build_s,
            point.mrays_per_s
        )
    };
    winners(&curves(points, |_| true), &RAYS).into_iter().map(line).collect()
}

/// The paper's axis at some places: treelet's envelope, and Embree's.
fn share_line(points: &[&Point]) -> Option<String> {
    let yardstick = points.iter().find(|point| is_ours(point) && point.variant == YARDSTICK)?;
    let rate = 1e6 * yardstick.mrays_per_s;
    let of = |takes_part: &dyn Fn(&Point) -> bool| {
        let curves = curves(points, takes_part);
        let share = |rays: f64| Some(rays / best_at(&curves, rays)?.1 / rate);
        SHARES_AT.map(|rays| share(rays).map(|share| format!("{} {share:.2}", rays_name(rays))))
    };
    let told = |shares: [Option<String>; 5]| {
        let shares: Vec<String> = shares.into_iter().flatten().collect();
        (!shares.is_empty()).then(|| shares.join(", "))
    };
    let mut line = format!("    share of {YARDSTICK}'s tracing speed: {}", told(of(&is_ours))?);
    if let Some(theirs) = told(of(&|point| point.engine == embree::NAME)) {
        line += &format!("; Embree {theirs}");
    }
    Some(line)
}

/// The lines of the marks.
pub fn mark_lines(marks: &[FigureMark]) -> Vec<String> {
    let mut lines = vec![String::new(), "  marks".to_owned()];
    for mark in marks {
        let value = mark.value.map_or_else(|| "not measured".to_owned(), number);
        let asked = mark.asked.map_or_else(String::new, |asked| format!("asked {}", number(asked)));
        let met = match mark.met {
            Some(true) => "met",
            Some(false) => "NOT met",
            None => "",
        };
        let (what, cells, note) = (&mark.what, mark.cells, &mark.note);
        lines.push(format!("    {what:58} {value:>12} {asked:>10} {met:7} ({cells} cells) {note}"));
    }
    lines
}

/// Ratios with two digits, numbers of rays by name.
fn number(value: f64) -> String {
    if value >= 1e4 { rays_name(value) } else { format!("{value:.3}") }
}
