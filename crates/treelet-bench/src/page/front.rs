//! What stands at the top and at the end of the page: what it is about, what came out, how it was
//! measured, on which machine, by which commands.

use maud::{Markup, html};

use super::charts::{Source, of_ours, yardstick};
use super::data::Page;
use super::numbers::{self, geometric_mean, median};
use super::{scenes, tables};
use crate::figure::data::{Panel, Point, YARDSTICK};
use crate::figure::envelope::{Curve, Lead, RAYS, lead};
use crate::rivals::treelet as ours;

/// The scenes in a few words.
pub(super) fn subject(page: &Page) -> String {
    match scenes(page).as_slice() {
        [] => "no scenes".to_owned(),
        [only] => only.clone(),
        [first, second] => format!("{first} and {second}"),
        several => format!("{} scenes", several.len()),
    }
}

/// The title, what the page is about, and the way to its parts.
pub(super) fn header(page: &Page) -> Markup {
    let scenes = scenes(page);
    html! {
        header.masthead {
            p.kicker { "Ray tracing, construction included" }
            h1 { "Which tree for how many rays?" }
            p.lede {
                "A tree that is built in a blink traces slowly; one that traces fast takes its time to "
                "build. Which one is done first depends on how many rays are coming. Measured on "
                b { (subject(page)) } "."
            }
            nav aria-label="Parts of this page" {
                a href="#glance" { "At a glance" }
                a href="#standings" { "Standings" }
                @for (number, scene) in scenes.iter().enumerate() {
                    a href={ "#scene-" (number) } { (scene) }
                }
                a href="#method" { "How it was measured" }
            }
        }
    }
}

/// What came out, in sentences.
pub(super) fn glance(page: &Page, source: &Source<'_>) -> Markup {
    let findings = findings(page, source);
    html! {
        section #glance {
            h2 { "At a glance" }
            @if findings.is_empty() {
                p { "Points of one entrant only: there is nothing to compare." }
            } @else {
                dl.findings {
                    @for (number, words) in findings {
                        div { dt { (number) } dd { (words) } }
                    }
                }
            }
        }
    }
}

/// A number each, and what it says.
fn findings(page: &Page, source: &Source<'_>) -> Vec<(String, String)> {
    let panels = page.figure.panels();
    let mut findings = Vec::new();
    let home = source.names.engine(ours::NAME);
    for engine in rivals(page) {
        if let Some((lead, panel)) = worst_lead(page, &panels, &engine) {
            let engine = source.names.engine(&engine);
            findings.push((
                format!("{}\u{d7}", numbers::short(lead.factor)),
                format!(
                    "the speed of {engine}, each with its best tree, where {home} does worst: {} rays, {}",
                    numbers::rays(lead.rays),
                    panel.title()
                ),
            ));
        }
    }
    if let Some(gain) = tracing_gain(page, &panels) {
        findings.push((
            format!("{}\u{d7}", numbers::short(gain)),
            format!(
                "the tracing speed of {}, by the fastest tree of each diagram; geometric mean",
                source.names.ours(YARDSTICK)
            ),
        ));
    }
    let regrets: Vec<f64> = page.figure.choices.iter().map(|choice| choice.regret()).collect();
    let worst = regrets.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if let Some(middle) = median(regrets) {
        findings.push((
            numbers::percent(middle),
            format!(
                "more time than the best tree in hindsight, where only the number of rays was told: \
                 the median of {} choices; the worst took {} more",
                page.figure.choices.len(),
                numbers::percent(worst)
            ),
        ));
    }
    let errors: Vec<f64> = page.figure.choices.iter().filter_map(|choice| choice.error()).collect();
    if let Some(middle) = median(errors) {
        let words = "between the foretold time and the measured one, choosing included; the median";
        findings.push((numbers::percent(middle), words.to_owned()));
    }
    findings
}

/// Engines other than ours, in the points' order.
fn rivals(page: &Page) -> Vec<String> {
    let mut rivals: Vec<String> = Vec::new();
    for point in page.figure.points.iter().filter(|point| point.engine != ours::NAME) {
        if !rivals.contains(&point.engine) {
            rivals.push(point.engine.clone());
        }
    }
    rivals
}

fn curves<'a>(points: impl Iterator<Item = &'a Point>) -> Vec<Curve> {
    points.map(Point::curve).collect()
}

/// Where our envelope does worst against a rival's, over all diagrams.
fn worst_lead<'a>(page: &Page, panels: &'a [Panel], engine: &str) -> Option<(Lead, &'a Panel)> {
    let mut worst: Option<(Lead, &Panel)> = None;
    for panel in panels {
        let points = page.figure.points_of(panel);
        let theirs = curves(points.iter().copied().filter(|point| point.engine == engine));
        let ours = curves(of_ours(&points).into_iter());
        if let Some(lead) = lead(&ours, &theirs, &RAYS)
            && worst.is_none_or(|(worst, _)| lead.factor < worst.factor)
        {
            worst = Some((lead, panel));
        }
    }
    worst
}

/// How many times as fast as the yardstick our fastest tree is traced: the mean over the diagrams.
fn tracing_gain(page: &Page, panels: &[Panel]) -> Option<f64> {
    let gain = |panel: &Panel| {
        let points = page.figure.points_of(panel);
        let unit = yardstick(&points)?.mrays_per_s;
        let fastest =
            of_ours(&points).into_iter().map(|point| point.mrays_per_s).fold(0.0, f64::max);
        Some(fastest / unit)
    };
    geometric_mean(panels.iter().filter_map(gain))
}

/// The figure over all scenes and kinds, where there are several.
pub(super) fn mean_figure(source: &Source<'_>) -> Markup {
    let Some(chart) = source.mean_chart("mean") else { return html! {} };
    html! {
        section #figure {
            h2 { "The whole figure" }
            figure.wide {
                (chart.svg())
                figcaption {
                    (chart.title) ". One curve a way to build: how many rays a second are answered when "
                    "so many are traced and the build is counted, as a share of the speed at which "
                    (source.names.ours(YARDSTICK)) " is traced without its build. "
                    (chart.words)
                }
            }
        }
    }
}

/// How it was measured, the machine, the commands.
pub(super) fn method(page: &Page, source: &Source<'_>) -> Markup {
    html! {
        section #method {
            h2 { "How it was measured" }
            (method_in_words(page, source))
            (tables::marks(page, source))
            (tables::facts(page, source))
            (tables::left_out(page, source))
            @if !page.commands.is_empty() {
                h3 { "Command lines" }
                pre.commands tabindex="0" {
                    @for command in &page.commands { code { (source.names.text(command)) "\n" } }
                }
            }
        }
    }
}

/// How it was measured, in plain words.
fn method_in_words(page: &Page, source: &Source<'_>) -> Markup {
    html! {
        div.prose {
            p {
                "Every entrant gets the same triangles and the same rays. A build is timed from the "
                "caller\u{2019}s arrays until the first ray can be asked; quick builds are made several "
                "times, and the median counts. Rays are asked one a call, in rounds in which the entrants take turns, "
                "so that whatever else the machine does hits all of them; the median of the rounds "
                "counts. Answers are compared before anything is timed."
            }
            p {
                "From these two numbers, build time " i { "B" } " and tracing speed " i { "R" }
                ", every curve follows: after " i { "n" } " rays " i { "B + n/R" }
                " seconds are gone, so " i { "n / (B + n/R)" } " rays a second were answered, the "
                "build included. The curve that is highest wins; where two cross is computed, not "
                "read off. Far right the builds no longer count and tracing speed is all that is left."
            }
            p {
                b { "SAH" } ", the surface area heuristic, is what a random ray should cost, counted "
                "in node visits and triangle tests; " b { "EPO" } ", end-point overlap, is the cost of "
                "boxes that hold surface which is not theirs; " b { "LCV" } ", leaf count variability, "
                "is how much the number of leaves differs from line to line. Lower is better for all "
                "three. (T. Aila, T. Karras, S. Laine, \u{201c}On Quality Metrics of Bounding Volume "
                "Hierarchies\u{201d}, High-Performance Graphics 2013; the figure itself is that of "
                "T. Karras and T. Aila, \u{201c}Fast Parallel Construction of High-Quality Bounding "
                "Volume Hierarchies\u{201d}, at the same conference.)"
            }
            @if !page.entrants.is_empty() {
                p {
                    "Entrants from files were measured by whoever wrote the files, perhaps on another "
                    "machine: " @for (i, file) in page.entrants.iter().enumerate() {
                        @if i > 0 { ", " } code { (source.names.text(file)) }
                    } "."
                }
            }
        }
    }
}
