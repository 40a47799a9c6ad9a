//! The figure as SVG: curves over the number of rays, labelled where they end, and below the axis
//! strips that say who wins where.
//!
//! After T. Karras, T. Aila, "Fast Parallel Construction of High-Quality Bounding Volume Hierarchies",
//! High-Performance Graphics 2013. Differs from theirs: curves carry their names instead of a legend,
//! and only those that matter carry any.

use std::fmt::Write as _;
use std::ops::Range;

use maud::{Markup, html};

use super::look::Look;
use super::numbers;
use crate::figure::envelope::RAYS;

/// The drawing, in its own units; labels stand in the right margin.
const WIDTH: f64 = 1040.0;
const LEFT: f64 = 48.0;
const RIGHT: f64 = 812.0;
const TOP: f64 = 30.0;
const BOTTOM: f64 = 366.0;
/// Where names of curves begin, and the least distance from one to the next.
const NAMES: f64 = RIGHT + 26.0;
const NAME_GAP: f64 = 15.5;
/// Where the first strip begins, how high strips are, and how far apart.
const STRIPS: f64 = BOTTOM + 46.0;
const STRIP_HEIGHT: f64 = 20.0;
const STRIP_GAP: f64 = 26.0;
/// How wide a letter of a strip's label is, at most.
const LETTER: f64 = 7.6;
/// Most letters of a name at a curve's end.
const LETTERS: usize = 29;
/// Room above the highest curve.
const HEADROOM: f64 = 1.06;

/// A diagram.
pub(super) struct Chart {
    /// Unique on the page.
    pub(super) id: String,
    /// What it shows, for those who do not see it.
    pub(super) title: String,
    /// What it says, for them.
    pub(super) words: String,
    /// What the upright axis counts.
    pub(super) unit: String,
    pub(super) lines: Vec<Line>,
    pub(super) dots: Vec<Dot>,
    pub(super) strips: Vec<Strip>,
}

/// A curve.
pub(super) struct Line {
    pub(super) name: String,
    pub(super) look: Look,
    /// Whether its name is written at its end.
    pub(super) named: bool,
    /// Numbers of rays, and what comes of them.
    pub(super) places: Vec<(f64, f64)>,
}

/// A mark on a curve.
pub(super) struct Dot {
    pub(super) rays: f64,
    pub(super) value: f64,
    pub(super) look: Look,
    /// What it stands for.
    pub(super) words: String,
}

/// Who wins where.
pub(super) struct Strip {
    /// Among whom.
    pub(super) name: String,
    pub(super) spans: Vec<Span>,
}

/// An interval of a strip.
pub(super) struct Span {
    pub(super) rays: Range<f64>,
    pub(super) name: String,
    pub(super) look: Look,
}

/// Where so many rays are on the level axis.
fn across(rays: f64) -> f64 {
    let share = (rays / RAYS.start).log10() / (RAYS.end / RAYS.start).log10();
    LEFT + share.clamp(0.0, 1.0) * (RIGHT - LEFT)
}

impl Chart {
    /// The drawing.
    pub(super) fn svg(&self) -> Markup {
        let values = self.lines.iter().flat_map(|line| &line.places).map(|place| place.1);
        let top = values.chain(self.dots.iter().map(|dot| dot.value)).fold(0.0, f64::max);
        let top = if top > 0.0 { top * HEADROOM } else { 1.0 };
        let height = STRIPS + self.strips.len() as f64 * STRIP_GAP + 4.0;
        let up = |value: f64| BOTTOM - (value / top).clamp(0.0, 1.0) * (BOTTOM - TOP);
        html! {
            svg.chart viewBox=(format!("0 0 {WIDTH} {height:.0}")) role="img"
                aria-labelledby={ (self.id) "-t " (self.id) "-d" }
                data-frame=(format!("{LEFT} {RIGHT} {TOP} {BOTTOM} {top}"))
                data-rays=(format!("{} {}", RAYS.start, RAYS.end)) {
                title id={ (self.id) "-t" } { (self.title) }
                desc id={ (self.id) "-d" } { (self.words) }
                (self.axes(top, &up))
                (self.curves(&up))
                @for dot in &self.dots {
                    circle class={ "dot " (dot.look.class()) } r="5.5"
                        cx=(format!("{:.1}", across(dot.rays))) cy=(format!("{:.1}", up(dot.value))) {
                        title { (dot.words) }
                    }
                }
                (self.names(&up))
                @for (row, strip) in self.strips.iter().enumerate() { (draw_strip(strip, row)) }
            }
        }
    }

    /// Ticks, grid and what they count.
    fn axes(&self, top: f64, up: &dyn Fn(f64) -> f64) -> Markup {
        let ticks = numbers::ticks(top);
        let step = ticks.get(1).copied().unwrap_or(1.0);
        let decades = RAYS.start.log10().round() as u32..=RAYS.end.log10().round() as u32;
        html! {
            g.grid {
                @for &tick in &ticks {
                    line x1=(LEFT) x2=(RIGHT) y1=(format!("{:.1}", up(tick)))
                        y2=(format!("{:.1}", up(tick))) {}
                    text.tick x=(LEFT - 8.0) y=(format!("{:.1}", up(tick) + 4.0)) text-anchor="end" {
                        (numbers::tick(tick, step))
                    }
                }
                @for power in decades {
                    @let x = format!("{:.1}", across(10f64.powf(f64::from(power))));
                    line.decade x1=(x) x2=(x) y1=(BOTTOM) y2=(BOTTOM + 5.0) {}
                    text.tick x=(x) y=(BOTTOM + 20.0) text-anchor="middle" {
                        "10" (numbers::superscript(power))
                    }
                    text.tick x=(x) y=(BOTTOM + 34.0) text-anchor="middle" {
                        @match power { 6 => "1 million", 9 => "1 billion", 12 => "rays", _ => "" }
                    }
                }
            }
            text.unit x=(LEFT - 40.0) y=(TOP - 14.0) { (self.unit) }
        }
    }

    /// The curves, the grey ones below.
    fn curves(&self, up: &dyn Fn(f64) -> f64) -> Markup {
        let rank = |line: &&Line| match line.look {
            Look::Plain => 0,
            Look::Rival(_) => 1,
            Look::Color(_) => 2,
        };
        let mut lines: Vec<&Line> = self.lines.iter().collect();
        lines.sort_by_key(rank);
        let path = |line: &Line| {
            let mut path = String::new();
            for (index, &(rays, value)) in line.places.iter().enumerate() {
                let letter = if index == 0 { 'M' } else { 'L' };
                // Writing into a string does not fail.
                let _ = write!(path, "{letter}{:.1} {:.1}", across(rays), up(value));
            }
            path
        };
        html! {
            @for line in lines {
                path class={ "curve " (line.look.class()) @if line.named { " named" } }
                    d=(path(line)) data-name=(line.name) { title { (line.name) } }
            }
        }
    }

    /// Names at the ends of curves, moved apart where they would meet.
    fn names(&self, up: &dyn Fn(f64) -> f64) -> Markup {
        let named = self.lines.iter().filter(|line| line.named);
        let mut ends: Vec<(&Line, f64)> =
            named.filter_map(|line| Some((line, up(line.places.last()?.1)))).collect();
        ends.sort_by(|a, b| a.1.total_cmp(&b.1));
        let places = spread(&ends.iter().map(|end| end.1).collect::<Vec<_>>());
        html! {
            @for ((line, end), place) in ends.into_iter().zip(places) {
                path class={ "lead " (line.look.class()) } d=(format!(
                    "M{RIGHT} {end:.1}L{:.1} {place:.1}L{:.1} {place:.1}", RIGHT + 14.0, NAMES - 4.0
                )) {}
                text class={ "name " (line.look.class()) } x=(NAMES) y=(format!("{:.1}", place + 4.0)) {
                    (cut(&line.name))
                }
            }
        }
    }
}

/// A name that fits beside the drawing; hovering tells all of it.
fn cut(name: &str) -> String {
    if name.chars().count() <= LETTERS {
        return name.to_owned();
    }
    name.chars().take(LETTERS - 1).chain(['\u{2026}']).collect()
}

/// Places near `ends`, which rise, at least [`NAME_GAP`] apart and inside the drawing where they fit.
fn spread(ends: &[f64]) -> Vec<f64> {
    let mut places: Vec<f64> = Vec::with_capacity(ends.len());
    // Push down what is too close to its neighbour above, then back up what left the drawing.
    for &end in ends {
        let least = places.last().map_or(TOP, |last| last + NAME_GAP);
        places.push(end.max(least));
    }
    let mut most = BOTTOM;
    for place in places.iter_mut().rev() {
        *place = place.min(most);
        most = *place - NAME_GAP;
    }
    places
}

/// A strip: boxes with names where they fit.
fn draw_strip(strip: &Strip, row: usize) -> Markup {
    let top = STRIPS + row as f64 * STRIP_GAP;
    html! {
        g.strip {
            @for span in &strip.spans {
                @let (left, right) = (across(span.rays.start), across(span.rays.end));
                @let fits = span.name.chars().count() as f64 * LETTER + 8.0 <= right - left;
                rect class={ "span " (span.look.class()) } x=(format!("{left:.1}")) y=(top)
                    width=(format!("{:.1}", (right - left - 1.0).max(1.0))) height=(STRIP_HEIGHT) {
                    title {
                        (span.name) ": " (numbers::rays(span.rays.start)) " to "
                        (numbers::rays(span.rays.end)) " rays"
                    }
                }
                @if fits {
                    text class={ "in " (span.look.class()) } text-anchor="middle"
                        x=(format!("{:.1}", 0.5 * (left + right))) y=(top + 14.0) { (span.name) }
                }
            }
            text.tick x=(NAMES) y=(top + 14.0) { (strip.name) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{BOTTOM, NAME_GAP, TOP, across, spread};

    #[test]
    fn names_keep_apart_and_inside() {
        for ends in [vec![], vec![40.0; 8], vec![TOP, 100.0, 101.0, BOTTOM, BOTTOM]] {
            let places = spread(&ends);
            assert_eq!(places.len(), ends.len());
            assert!(
                places.windows(2).all(|pair| pair[1] - pair[0] >= NAME_GAP - 1e-9),
                "{places:?}"
            );
            assert!(places.iter().all(|place| (TOP..=BOTTOM).contains(place)), "{places:?}");
        }
    }

    #[test]
    fn the_axis_ends_at_its_ends() {
        assert_eq!(
            [1e3, 1e4, 1e8, 1e12, f64::INFINITY].map(across),
            [48.0, 48.0, 430.0, 812.0, 812.0]
        );
    }
}
