//! Who is fastest on the whole, and scene by scene.

use maud::{Markup, html};

use super::charts::Source;
use super::data::Page;
use super::leaderboard::{self, JUDGED, Row};
use super::{numbers, scenes};
use crate::figure::data::Panel;
use crate::rivals::treelet as ours;

/// Places that are shown of each scene.
const OF_SCENE: usize = 6;

/// The leaderboards.
pub(super) fn section(page: &Page, source: &Source<'_>) -> Markup {
    let panels = page.figure.panels();
    let engines = leaderboard::engines(&page.figure, &panels);
    let variants = leaderboard::variants(&page.figure, &panels);
    let scenes = scenes(page);
    html! {
        section #standings {
            h2 { "Standings" }
            p.prose {
                "Nobody knows how many rays others will trace, so each entrant is judged four times: with "
                "its build and 10⁶, 10⁸ and 10¹⁰ rays, and at tracing alone. Each time its speed "
                "counts as a share of the fastest entrant\u{2019}s; a score is the geometric mean of all "
                "shares, over every scene and every kind of ray. Only who ran everywhere is ranked."
            }
            @if engines.len() > 1 {
                (board(source, "Engines, each with its best tree for each number of rays", &engines))
            }
            (board(source, "Every way to build, for all numbers of rays alike", &variants))
            @if scenes.len() > 1 {
                h3 { "Scene by scene" }
                div.boards {
                    @for scene in &scenes {
                        @let of_scene = panels.iter().filter(|panel| panel.scene == *scene);
                        @let of_scene: Vec<Panel> = of_scene.cloned().collect();
                        @let rows = leaderboard::variants(&page.figure, &of_scene);
                        (short_board(source, scene, &rows))
                    }
                }
            }
        }
    }
}

fn board(source: &Source<'_>, caption: &str, rows: &[Row]) -> Markup {
    html! {
        div.scroll tabindex="0" role="group" aria-label=(caption) {
            table.board {
                caption { (caption) }
                thead { tr {
                    th scope="col" { "#" }
                    th scope="col" { "entrant" }
                    th scope="col" colspan="2" { "score" }
                    @for rays in JUDGED {
                        th.n scope="col" {
                            @if rays.is_finite() { (numbers::rays(rays)) " rays" } @else { "tracing alone" }
                        }
                    }
                } }
                tbody {
                    @for (place, row) in rows.iter().enumerate() {
                        tr {
                            td.n { (place + 1) }
                            th scope="row" { (swatch(source, row)) (name(source, row)) }
                            td.n { (numbers::percent(row.score)) }
                            td.bar { (bar(row.score)) }
                            @for part in row.parts { td.n { (numbers::percent(part)) } }
                        }
                    }
                }
            }
        }
    }
}

fn short_board(source: &Source<'_>, scene: &str, rows: &[Row]) -> Markup {
    html! {
        table.board.short {
            caption { (scene) }
            thead.quiet { tr {
                th scope="col" { "entrant" }
                th.n scope="col" { "score" }
                th scope="col" { span.unseen { "bar" } }
            } }
            tbody {
                @for row in rows.iter().take(OF_SCENE) {
                    tr {
                        th scope="row" { (swatch(source, row)) (name(source, row)) }
                        td.n { (numbers::percent(row.score)) }
                        td.bar { (bar(row.score)) }
                    }
                }
            }
        }
    }
}

/// The score as a length.
fn bar(score: f64) -> Markup {
    let width = format!("{:.1}", 100.0 * score.clamp(0.0, 1.0));
    html! {
        svg viewBox="0 0 100 8" preserveAspectRatio="none" aria-hidden="true" {
            rect.track width="100" height="8" {}
            rect.value width=(width) height="8" {}
        }
    }
}

/// The colour of a variant's curve.
fn swatch(source: &Source<'_>, row: &Row) -> Markup {
    let look = row.variant.as_ref().map(|variant| source.looks.of_named(&row.engine, variant));
    html! { @if let Some(look) = look { span.swatch.(look.class()) aria-hidden="true" {} } }
}

fn name(source: &Source<'_>, row: &Row) -> String {
    match &row.variant {
        Some(variant) => source.names.full(&row.engine, variant),
        None if row.engine == ours::NAME => source.names.engine(ours::NAME),
        None => source.names.engine(&row.engine),
    }
}
