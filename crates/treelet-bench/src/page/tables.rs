//! Tables: points, trees, choices, marks, the machine.

use maud::{Markup, html};

use super::charts::Source;
use super::data::{Page, ScenePage, TreeLine};
use super::numbers;
use crate::figure::data::{Choice, Panel, Point};
use crate::rivals::treelet as ours;

/// What stands where nothing is known.
const NOTHING: &str = "\u{2013}";

fn perhaps(number: Option<f64>) -> String {
    number.map_or_else(|| NOTHING.to_owned(), numbers::short)
}

/// A table that may be wider than the window.
fn wide(caption: &str, table: Markup) -> Markup {
    html! { div.scroll tabindex="0" role="group" aria-label=(caption) { table { caption { (caption) } (table) } } }
}

/// What every builder made of a scene.
pub(super) fn trees(source: &Source<'_>, scene: &str, scene_page: Option<&ScenePage>) -> Markup {
    let rows = tree_rows(source, scene, scene_page);
    // Entrants' files know nothing of nodes and leaves.
    let known = rows.iter().any(|row| row.2.is_some());
    let columns = ["nodes", "leaves", "depth", "per leaf", "most", "memory"];
    let table = html! {
        thead { tr {
            th scope="col" { "way to build" }
            @for column in ["build", "SAH", "EPO", "LCV"] { th.n scope="col" { (column) } }
            @if known { @for column in columns { th.n scope="col" { (column) } } }
        } }
        tbody {
            @for (variant, point, tree) in rows {
                @let of = |f: &dyn Fn(&TreeLine) -> String| tree.map_or_else(|| NOTHING.to_owned(), f);
                @let measure = |f: &dyn Fn(&Point) -> Option<f64>| perhaps(point.and_then(f));
                tr {
                    th scope="row" {
                        span.swatch.(source.looks.of_named(ours::NAME, &variant).class()) aria-hidden="true" {}
                        (source.names.ours(&variant))
                    }
                    td.n { (point.map_or_else(|| NOTHING.to_owned(), |point| numbers::time(point.build_s))) }
                    td.n { (measure(&|point| point.sah)) }
                    td.n { (measure(&|point| point.epo)) }
                    td.n { (measure(&|point| point.lcv)) }
                    @if known {
                    td.n { (of(&|tree| numbers::count(tree.nodes))) }
                    td.n { (of(&|tree| numbers::count(tree.leaves))) }
                    td.n { (of(&|tree| tree.depth.to_string())) }
                    td.n { (of(&|tree| numbers::short(tree.leaf_mean))) }
                    td.n { (of(&|tree| tree.leaf_max.to_string())) }
                    td.n { (of(&|tree| numbers::bytes(tree.bytes))) }
                    }
                }
            }
        }
    };
    wide("The trees, from the quickest to build to the slowest", table)
}

type TreeRow<'a> = (String, Option<&'a Point>, Option<&'a TreeLine>);

/// Our variants of a scene, with one of their points (all kinds share a tree) and their statistics.
fn tree_rows<'a>(
    source: &Source<'a>,
    scene: &str,
    scene_page: Option<&'a ScenePage>,
) -> Vec<TreeRow<'a>> {
    let trees = scene_page.map_or(&[][..], |scene| &scene.trees);
    let tree = |variant: &str| trees.iter().find(|tree| tree.variant == variant);
    let mut rows: Vec<TreeRow<'a>> = Vec::new();
    for point in &source.figure.points {
        let known = rows.iter().any(|row| row.0 == point.variant);
        if point.scene == scene && point.engine == ours::NAME && !known {
            rows.push((point.variant.clone(), Some(point), tree(&point.variant)));
        }
    }
    for tree in trees {
        if !rows.iter().any(|row| row.0 == tree.variant) {
            rows.push((tree.variant.clone(), None, Some(tree)));
        }
    }
    let time = |row: &TreeRow<'_>| row.1.map_or(f64::INFINITY, |point| point.build_s);
    rows.sort_by(|a, b| time(a).total_cmp(&time(b)));
    rows
}

/// One point of each variant of each engine on a scene, the quickest to build first.
fn point_rows<'a>(source: &Source<'a>, scene: &str) -> Vec<&'a Point> {
    let mut rows: Vec<&Point> = Vec::new();
    for point in source.figure.points.iter().filter(|point| point.scene == scene) {
        let same = |row: &&Point| {
            (&row.engine, &row.variant, row.threads)
                == (&point.engine, &point.variant, point.threads)
        };
        if !rows.iter().any(same) {
            rows.push(point);
        }
    }
    rows.sort_by(|a, b| a.build_s.total_cmp(&b.build_s));
    rows
}

/// The tracing speed of a row's variant at a kind of rays, and whether it is the fastest.
fn speed(source: &Source<'_>, row: &Point, kind: &str) -> Option<(f64, bool)> {
    let panel = Panel { scene: row.scene.clone(), kind: kind.to_owned(), threads: row.threads };
    let points = source.figure.points_of(&panel);
    let fastest = points.iter().map(|point| point.mrays_per_s).fold(0.0, f64::max);
    let same = |point: &&&Point| (&point.engine, &point.variant) == (&row.engine, &row.variant);
    points.iter().find(same).map(|point| (point.mrays_per_s, point.mrays_per_s == fastest))
}

/// Every point of a scene: build time and tracing speed by kind.
pub(super) fn points(source: &Source<'_>, scene: &str, panels: &[&Panel]) -> Markup {
    let rows = point_rows(source, scene);
    let several = panels.iter().any(|panel| panel.threads != panels[0].threads);
    let mut kinds: Vec<&str> = Vec::new();
    for panel in panels {
        if !kinds.contains(&panel.kind.as_str()) {
            kinds.push(&panel.kind);
        }
    }
    let table = html! {
        thead { tr {
            th scope="col" { "engine" }
            th scope="col" { "way to build" }
            @if several { th.n scope="col" { "threads" } }
            th.n scope="col" { "build" }
            @for kind in &kinds { th.n scope="col" { (kind) ", Mrays/s" } }
        } }
        tbody {
            @for row in rows {
                tr {
                    td { (source.names.engine(&row.engine)) }
                    th scope="row" {
                        span.swatch.(source.looks.of(row).class()) aria-hidden="true" {}
                        (source.names.variant(&row.engine, &row.variant))
                    }
                    @if several { td.n { (row.threads) } }
                    td.n { (numbers::time(row.build_s)) }
                    @for kind in &kinds {
                        @match speed(source, row, kind) {
                            Some((mrays, true)) => { td.n { b { (numbers::short(mrays)) } } }
                            Some((mrays, false)) => { td.n { (numbers::short(mrays)) } }
                            None => { td.n { (NOTHING) } }
                        }
                    }
                }
            }
        }
    };
    wide("Every point: seconds to build and tracing speed, the fastest in bold", table)
}

/// What the library chose on a scene, told the number of rays, and what it did without.
pub(super) fn choices(source: &Source<'_>, panels: &[&Panel]) -> Markup {
    let of = |choices: &[Choice]| -> Vec<(Panel, Vec<Choice>)> {
        let of_panel = |panel: &&Panel| {
            let held = choices.iter().filter(|choice| panel.holds_choice(choice));
            ((*panel).clone(), held.cloned().collect())
        };
        panels.iter().map(of_panel).collect()
    };
    html! {
        (choice_table(
            source,
            "What is chosen when only the number of rays is told, choosing and building counted",
            &of(&source.figure.choices),
        ))
        (choice_table(
            source,
            "What comes of starting cheaply and improving while tracing, when nothing is told",
            &of(&source.figure.auto),
        ))
    }
}

/// Choices by panel; nothing if there are none.
fn choice_table(source: &Source<'_>, caption: &str, panels: &[(Panel, Vec<Choice>)]) -> Markup {
    if panels.iter().all(|(_, choices)| choices.is_empty()) {
        return html! {};
    }
    let table = html! {
        thead { tr {
            th.n scope="col" { "rays" }
            th scope="col" { "chosen" }
            th.n scope="col" { "took" }
            th.n scope="col" { "foretold" }
            th.n scope="col" { "off by" }
            th scope="col" { "best in hindsight" }
            th.n scope="col" { "takes" }
            th.n scope="col" { "regret" }
        } }
        @for (panel, choices) in panels {
            @if !choices.is_empty() {
                tbody {
                    tr.group { th scope="rowgroup" colspan="8" {
                        (panel.kind) " rays" @if panel.threads > 1 { ", " (panel.threads) " threads" }
                    } }
                    @for choice in choices { (choice_row(source, choice)) }
                }
            }
        }
    };
    wide(caption, table)
}

fn choice_row(source: &Source<'_>, choice: &Choice) -> Markup {
    let nothing = || NOTHING.to_owned();
    html! {
        tr {
            th.n scope="row" { (numbers::rays(choice.rays as f64)) }
            td {
                span.swatch.(source.looks.of_named(ours::NAME, &choice.variant).class())
                    aria-hidden="true" {}
                (source.names.ours(&choice.variant))
            }
            td.n { (numbers::time(choice.measured_s)) }
            td.n { (choice.predicted_s.map_or_else(nothing, numbers::time)) }
            td.n { (choice.error().map_or_else(nothing, numbers::percent)) }
            td { (source.names.ours(&choice.best_variant)) }
            td.n { (numbers::time(choice.best_s)) }
            td.n { (numbers::percent(choice.regret())) }
        }
    }
}

/// Where the paper's own builder wins, beside where it won in the paper.
pub(super) fn windows(source: &Source<'_>, scene: &str) -> Markup {
    let mut windows =
        source.figure.windows.iter().filter(|window| window.scene == scene).peekable();
    // The method's name is an engine's, too.
    if windows.peek().is_none() || source.names.hidden() {
        return html! {};
    }
    let table = html! {
        thead { tr {
            th scope="col" { "way to build" }
            th scope="col" { "rays" }
            th.n scope="col" { "from" }
            th.n scope="col" { "to" }
        } }
        tbody {
            @for window in windows {
                @let end = |rays: Option<f64>| rays.map_or_else(|| NOTHING.to_owned(), numbers::rays);
                tr {
                    th scope="row" { (source.names.ours(&window.variant)) }
                    td { (window.kind) @if window.threads > 1 { ", " (window.threads) " threads" } }
                    td.n { (end(window.from)) }
                    td.n { (end(window.to)) }
                }
            }
        }
    };
    let caption = "Where treelet restructuring is fastest among the builders that its paper compared; \
                   there it was from 7 million to 60 billion rays";
    wide(caption, table)
}

/// Marks that the bench sets itself; they speak of engines by name, so nothing where names are hidden.
pub(super) fn marks(page: &Page, source: &Source<'_>) -> Markup {
    if page.figure.marks.is_empty() || source.names.hidden() {
        return html! {};
    }
    let table = html! {
        thead { tr {
            th scope="col" { "mark" }
            th.n scope="col" { "measured" }
            th.n scope="col" { "asked" }
            th scope="col" { "met" }
            th.n scope="col" { "cells" }
            th scope="col" { "note" }
        } }
        tbody {
            @for mark in &page.figure.marks {
                tr {
                    th scope="row" { (mark.what) }
                    td.n { (perhaps(mark.value)) }
                    td.n { (perhaps(mark.asked)) }
                    td { (match mark.met { Some(true) => "yes", Some(false) => "no", None => NOTHING }) }
                    td.n { (mark.cells) }
                    td.note { (mark.note) }
                }
            }
        }
    };
    wide("What treelet asks of itself", table)
}

/// The machine and the settings.
pub(super) fn facts(page: &Page, source: &Source<'_>) -> Markup {
    let mut facts: Vec<(String, String)> = Vec::new();
    let mut fact = |name: &str, value: String| facts.push((name.to_owned(), value));
    if let Some(machine) = &page.figure.machine {
        let pages = if machine.huge_pages { "for every engine" } else { "for none" };
        fact("processor", format!("{}, {} usable", machine.processor, machine.processors));
        fact("system", machine.system.clone());
        fact("huge pages", format!("{pages} (the system says {})", machine.huge_pages_system));
        fact("clock", machine.clock.to_string());
        fact("rounds", format!("{} of at least {} s each", machine.rounds, machine.seconds));
    }
    if !source.names.hidden() && !page.figure.engines.is_empty() {
        fact("engines", page.figure.engines.join(", "));
    }
    facts.extend(page.facts.iter().cloned());
    if facts.is_empty() {
        return html! {};
    }
    html! {
        table.facts {
            caption { "The machine and the settings" }
            tbody {
                @for (name, value) in facts {
                    tr { th scope="row" { (name) } td { (source.names.text(&value)) } }
                }
            }
        }
    }
}

/// Who has no points, and why; that names engines, so nothing where names are hidden.
pub(super) fn left_out(page: &Page, source: &Source<'_>) -> Markup {
    if page.figure.left_out.is_empty() || source.names.hidden() {
        return html! {};
    }
    html! {
        table.facts {
            caption { "Left out" }
            tbody {
                @for missing in &page.figure.left_out {
                    tr {
                        th scope="row" { (missing.name) }
                        td { (missing.reason) }
                    }
                }
            }
        }
    }
}
