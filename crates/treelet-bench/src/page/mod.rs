//! The page of `bench --report`: the figure, the trees behind it, and who is fastest, in one HTML file
//! that needs nothing else: style, script and pictures are inside, nothing is fetched.
//!
//! The page is read without its script too, and on paper; the script only narrows what is shown and
//! reads values off the curves. Everything that comes from a file passes through `maud`, which
//! escapes it. Data comes in as [`Page`]; nothing here measures, reads or writes.

mod chart;
mod charts;
mod data;
pub mod entrants;
mod front;
mod leaderboard;
mod look;
mod names;
mod numbers;
mod scene;
mod standings;
mod tables;
#[cfg(test)]
mod tests;

pub use data::{CurveDrawing, HeatMap, HeatMaps, LevelBox, Page, Picture, ScenePage, TreeLine};

pub use numbers::count;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use charts::Source;
use look::Looks;
use names::Names;

/// How the page looks; colours of both light and dark, and of paper.
const STYLE: &str = include_str!("style.css");
/// What hovering and choosing do.
const SCRIPT: &str = include_str!("script.js");

/// The page as the text of an HTML file.
pub fn render(page: &Page) -> String {
    let names = Names::new(page);
    let looks = Looks::new(&page.figure);
    let source = Source { figure: &page.figure, names: &names, looks: &looks };
    let title = format!("Which tree for how many rays? {}", front::subject(page));
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                (front::header(page))
                main {
                    (front::glance(page, &source))
                    (front::mean_figure(&source))
                    (standings::section(page, &source))
                    @for (number, name) in scenes(page).iter().enumerate() {
                        (scene::section(page, &source, name, number))
                    }
                    (front::method(page, &source))
                }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    }
    .into_string()
}

/// The scenes: those with pictures first, then others that have points.
fn scenes(page: &Page) -> Vec<String> {
    let with_pictures = page.scenes.iter().map(|scene| &scene.scene);
    let mut scenes: Vec<String> = Vec::new();
    for name in with_pictures.chain(page.figure.points.iter().map(|point| &point.scene)) {
        if !scenes.contains(name) {
            scenes.push(name.clone());
        }
    }
    scenes
}

/// A picture as part of the page; `words` for those who do not see it.
fn picture(picture: &Picture, words: &str) -> Markup {
    use base64::Engine as _;
    let data = base64::engine::general_purpose::STANDARD.encode(&picture.png);
    html! {
        img src={ "data:image/png;base64," (data) } alt=(words)
            width=(picture.width) height=(picture.height);
    }
}
