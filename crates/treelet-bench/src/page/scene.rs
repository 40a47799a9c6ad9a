//! One scene: how it looks, the figure for each kind of ray, what rays meet in its trees, the curve
//! through it, and its tables.

use std::fmt::Write as _;

use maud::{Markup, html};

use super::charts::{Form, Source};
use super::data::{CurveDrawing, HeatMaps, Page, ScenePage};
use super::{numbers, picture, tables};
use crate::figure::data::Panel;
use crate::rivals::treelet as ours;

/// A scene's part of the page; `number` is its place.
pub(super) fn section(page: &Page, source: &Source<'_>, scene: &str, number: usize) -> Markup {
    let panels = page.figure.panels();
    let panels: Vec<&Panel> = panels.iter().filter(|panel| panel.scene == scene).collect();
    let scene_page = page.scenes.iter().find(|drawn| drawn.scene == scene);
    html! {
        section.scene id={ "scene-" (number) } data-scene=(scene) {
            h2 { (scene) }
            (facts(page, scene, scene_page))
            @for (place, panel) in panels.iter().enumerate() {
                (figures(source, panel, &format!("f{number}-{place}")))
            }
            @if let Some(drawn) = scene_page {
                @if let Some(heat) = &drawn.heat { (heat_maps(source, heat)) }
                @if let Some(curve) = &drawn.curve { (curve_drawing(curve, scene, number)) }
            }
            h3 { "Trees and numbers" }
            (tables::trees(source, scene, scene_page))
            (tables::choices(source, &panels))
            (tables::windows(source, scene))
            @if !panels.is_empty() { (tables::points(source, scene, &panels)) }
        }
    }
}

/// The picture of the scene, and how large it is.
fn facts(page: &Page, scene: &str, scene_page: Option<&ScenePage>) -> Markup {
    let of_points = page.figure.points.iter().find(|point| point.scene == scene);
    let triangles = scene_page.map(|drawn| drawn.triangles).filter(|&triangles| triangles > 0);
    let triangles = triangles.or_else(|| of_points?.triangles);
    let look = scene_page.and_then(|drawn| drawn.look.as_ref());
    html! {
        @if let Some(look) = look {
            figure.look {
                (picture(look, &format!("{scene}, shaded as if made of clay")))
                figcaption {
                    "As the camera of the primary rays sees it"
                    @if let Some(triangles) = triangles { ": " (numbers::count(triangles)) " triangles" }
                    "."
                }
            }
        } @else if let Some(triangles) = triangles {
            p { (numbers::count(triangles)) " triangles." }
        }
    }
}

/// Both forms of the figure for a kind of ray.
fn figures(source: &Source<'_>, panel: &Panel, id: &str) -> Markup {
    let points = source.figure.points_of(panel);
    let threads = match panel.threads {
        1 => "one thread".to_owned(),
        threads => format!("{threads} threads"),
    };
    html! {
        div.kind data-kind=(panel.kind) {
            h3 { (capital(&panel.kind)) " rays" span.aside { ", " (threads) } }
            @for form in Form::ALL {
                @if let Some(chart) = source.chart(panel, form, &format!("{id}-{}", form.key())) {
                    figure.wide data-form=(form.key()) {
                        (chart.svg())
                        figcaption {
                            @match form {
                                Form::Speed => {
                                    (source.words(&points))
                                    @if !chart.dots.is_empty() {
                                        " Rings are what is chosen when only the number of rays is told."
                                    }
                                }
                                Form::Share => {
                                    "The same as shares of "
                                    (source.names.ours(crate::figure::data::YARDSTICK))
                                    "\u{2019}s own tracing speed, which is 1."
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn capital(word: &str) -> String {
    let mut letters = word.chars();
    let first = letters.next().map(char::to_uppercase);
    first.into_iter().flatten().chain(letters).collect()
}

/// Heat maps side by side, and their scale.
fn heat_maps(source: &Source<'_>, heat: &HeatMaps) -> Markup {
    let stops = heat.ramp.iter().map(|[r, g, b]| format!("rgb({r} {g} {b})"));
    let ramp = format!("linear-gradient(to right,{})", stops.collect::<Vec<_>>().join(","));
    html! {
        h3 { "What a ray meets" }
        div.heat {
            @for map in &heat.maps {
                @let name = source.names.variant(ours::NAME, &map.variant);
                figure {
                    (picture(&map.picture, &format!(
                        "Heat map of {name}: {} nodes a ray on the mean, {} at most",
                        numbers::short(map.mean), numbers::count(map.max)
                    )))
                    figcaption {
                        b { (name) } ": " (numbers::short(map.mean)) " nodes a ray on the mean, "
                        (numbers::count(map.max)) " at most"
                    }
                }
            }
        }
        div.scale {
            span { "0" }
            span.ramp style={ "background-image:" (ramp) } {}
            span { (numbers::count(heat.end)) " nodes" }
        }
        p.caption {
            "Nodes of the wide tree that the ray through a pixel enters before it knows its first hit: one "
            "scale for all, from dark for few to light for many."
        }
    }
}

/// How wide the drawing of a curve is, and the most and the least that it is high.
const CURVE_WIDTH: f64 = 1040.0;
const CURVE_HEIGHT: std::ops::RangeInclusive<f64> = 160.0..=620.0;
/// Colours along it.
const CURVE_PIECES: usize = 16;
/// Room around it.
const CURVE_EDGE: f64 = 8.0;

/// The Morton curve, and the boxes of the tree's first levels.
fn curve_drawing(curve: &CurveDrawing, scene: &str, number: usize) -> Markup {
    let [across, up] = curve.extent;
    let ratio = if across > 0.0 && up > 0.0 { up / across } else { 1.0 };
    // Tall scenes are drawn narrower rather than squeezed; flat ones are stretched to be seen.
    let height = (ratio * CURVE_WIDTH).clamp(*CURVE_HEIGHT.start(), *CURVE_HEIGHT.end());
    let width = (height / ratio).clamp(0.25 * CURVE_WIDTH, CURVE_WIDTH);
    let left = 0.5 * (CURVE_WIDTH - width);
    let place = |[x, y]: [f32; 2]| {
        (left + f64::from(x) * width, CURVE_EDGE + (1.0 - f64::from(y)) * height)
    };
    let piece = |points: &[[f32; 2]]| {
        let mut path = String::new();
        for (index, &point) in points.iter().enumerate() {
            let (x, y) = place(point);
            let letter = if index == 0 { 'M' } else { 'L' };
            // Writing into a string does not fail.
            let _ = write!(path, "{letter}{x:.1} {y:.1}");
        }
        path
    };
    // Pieces begin where the one before ended, each in a colour further along.
    let length = curve.path.len().div_ceil(CURVE_PIECES).max(1);
    let pieces = (0..curve.path.len()).step_by(length).map(|from| {
        let to = (from + length + 1).min(curve.path.len());
        (piece(&curve.path[from..to]), 100 * from / curve.path.len())
    });
    let [first, second] = curve.axes;
    let words = format!(
        "{} of {} triangles' centres of {scene}, joined in Morton order, with the boxes of the first \
         levels of the tree that halves the curve",
        numbers::count(curve.path.len() as u64),
        numbers::count(curve.of)
    );
    html! {
        h3 { "The curve through it" }
        figure.wide {
            svg.morton role="img" aria-labelledby={ "m" (number) }
                viewBox=(format!("0 0 {CURVE_WIDTH} {:.0}", height + 2.0 * CURVE_EDGE)) {
                title id={ "m" (number) } { (words) }
                @for (path, percent) in pieces {
                    path.walk d=(path) style={ "--at:" (percent) "%" } {}
                }
                @for node in &curve.boxes {
                    @let (x0, y1) = place(node.lo);
                    @let (x1, y0) = place(node.hi);
                    rect class={ "level l" (node.level) } x=(format!("{x0:.1}")) y=(format!("{y0:.1}"))
                        width=(format!("{:.1}", x1 - x0)) height=(format!("{:.1}", y1 - y0)) {
                        title { "level " (node.level) }
                    }
                }
            }
            figcaption {
                "The Morton curve visits triangles so that neighbours on it are neighbours in space, mostly; "
                "a tree falls out of it by halving its cells. Here " (numbers::count(curve.path.len() as u64))
                " of " (numbers::count(curve.of)) " centres in its order, seen along the shortest axis ("
                (first) " to the right, " (second) " up), from orange where it begins to blue where it "
                "ends, and the boxes of that tree\u{2019}s levels 1 to 4, the first drawn boldest. Long "
                "jumps of the line are where the tree cuts."
            }
        }
    }
}
