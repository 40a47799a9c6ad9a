//! A clip as a picture: what every frame takes in every way, as SVG.
//!
//! Whole lines are updates and rays together, thin ones the rays alone; a dot stands where trees are built anew.

use std::fmt::Write as _;

use super::{Play, sums};
use crate::figure::{COLORS, STYLE, escaped};

/// The picture, and the frame in it, in pixels.
const WIDTH: f64 = 830.0;
const HEIGHT: f64 = 400.0;
const LEFT: f64 = 66.0;
const RIGHT: f64 = 640.0;
const TOP: f64 = 62.0;
const BOTTOM: f64 = 346.0;
/// Between two names.
const LINE: f64 = 34.0;
/// Lines of the grid, about.
const GRID: f64 = 5.0;

/// A picture of a clip; the title says what it is.
pub fn svg(play: &Play, title: &str) -> String {
    let frames = play.moments.iter().map(|it| it.frame + 1).max().unwrap_or(1);
    let most = play.moments.iter().map(|it| it.update + it.trace).fold(0.0, f64::max);
    let scale = Scale { frames, most: if most > 0.0 { most } else { 1.0 } };
    let mut svg = head(title);
    scale.grid(&mut svg);
    let sums = sums(play);
    for (way, sum) in sums.iter().enumerate() {
        let color = COLORS[way % COLORS.len()];
        let of = || play.moments.iter().filter(|moment| moment.way == way);
        let line = |seconds: fn(f64, f64) -> f64| {
            let point = |it: &super::Moment| scale.point(it.frame, seconds(it.update, it.trace));
            of().map(point).map(|(x, y)| format!("{x:.1},{y:.1}")).collect::<Vec<_>>().join(" ")
        };
        for (points, width) in [(line(|_, trace| trace), 0.7), (line(|a, b| a + b), 2.2)] {
            let _ = writeln!(
                svg,
                "<polyline fill=\"none\" stroke=\"{color}\" stroke-width=\"{width}\" \
                 stroke-linejoin=\"round\" points=\"{points}\"/>"
            );
        }
        // Everywhere anew is no news.
        let anew = || of().filter(|it| it.did == "rebuilt");
        if anew().count() < frames / 2 {
            for (x, y) in anew().map(|it| scale.point(it.frame, it.update + it.trace)) {
                let _ =
                    writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"{color}\"/>");
            }
        }
        let y = TOP + 12.0 + LINE * way as f64;
        let _ = writeln!(
            svg,
            "<text x=\"{x}\" y=\"{y:.1}\" fill=\"{color}\" font-weight=\"600\">{name}</text>\
             <text class=\"soft\" x=\"{x}\" y=\"{:.1}\">{:.3} + {:.3} s ({:.2})</text>",
            y + 15.0,
            sum.update,
            sum.trace,
            sum.total_ratio,
            x = RIGHT + 16.0,
            name = escaped(&sum.way),
        );
    }
    svg + "</svg>\n"
}

/// Title, ground, style.
fn head(title: &str) -> String {
    let title = escaped(title);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" \
         font-family=\"system-ui, -apple-system, 'Segoe UI', Helvetica, Arial, sans-serif\" \
         font-size=\"12.5\" role=\"img\" aria-label=\"Milliseconds of every frame: {title}\">\n\
         <style>{STYLE}</style>\n\
         <rect class=\"ground\" x=\"0.5\" y=\"0.5\" width=\"{}\" height=\"{}\" rx=\"6\"/>\n\
         <text class=\"word\" x=\"{LEFT}\" y=\"26\" font-size=\"15\" font-weight=\"600\">Milliseconds \
         of every frame, update and rays</text>\n\
         <text class=\"soft\" x=\"{LEFT}\" y=\"44\">{title}; in brackets the total, of the first\'s</text>\n",
        WIDTH - 1.0,
        HEIGHT - 1.0
    )
}

struct Scale {
    frames: usize,
    /// Seconds at the top.
    most: f64,
}

impl Scale {
    /// Where a frame and its seconds are.
    fn point(&self, frame: usize, seconds: f64) -> (f64, f64) {
        let across = frame as f64 / (self.frames.max(2) - 1) as f64;
        (LEFT + (RIGHT - LEFT) * across, BOTTOM - (BOTTOM - TOP) * seconds / self.most)
    }

    /// Lines and numbers of both axes.
    fn grid(&self, svg: &mut String) {
        let step = round_step(1e3 * self.most / GRID);
        let lines = (1e3 * self.most / step) as usize;
        for at in (0..=lines).map(|line| line as f64 * step) {
            let (_, y) = self.point(0, 1e-3 * at);
            let _ = writeln!(
                svg,
                "<line class=\"grid\" x1=\"{LEFT}\" x2=\"{RIGHT}\" y1=\"{y:.1}\" y2=\"{y:.1}\"/>\
                 <text class=\"soft\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                LEFT - 8.0,
                y + 4.0,
                (1e6 * at).round() / 1e6
            );
        }
        for (frame, anchor) in [(0, "start"), (self.frames - 1, "end")] {
            let (x, _) = self.point(frame, 0.0);
            let _ = writeln!(
                svg,
                "<text class=\"soft\" x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\">frame {frame}</text>",
                BOTTOM + 20.0
            );
        }
    }
}

/// 1, 2 or 5 times a power of ten, not below `least`; powers below a millionth are all one.
fn round_step(least: f64) -> f64 {
    let mut power = 1e-6;
    loop {
        for digit in [1.0, 2.0, 5.0] {
            if digit * power >= least || power > 1e12 {
                return digit * power;
            }
        }
        power *= 10.0;
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Moment, Play};
    use super::{round_step, svg};

    #[test]
    fn every_way_has_its_lines_and_news_a_dot() {
        let moment = |frame: usize, way: usize| {
            let did = if way == 1 && frame == 3 { "rebuilt" } else { "refitted" };
            Moment { frame, way, did: did.into(), update: 0.25, trace: 0.5 }
        };
        let moments = (0..8).flat_map(|frame| (0..2).map(move |way| moment(frame, way)));
        let ways = vec!["a<b".into(), "other".into()];
        let play = Play { ways, rays: 9, moments: moments.collect() };
        let svg = svg(&play, "hill & dale");
        assert_eq!(svg.matches("<polyline").count(), 4);
        assert_eq!(svg.matches("<circle").count(), 1);
        assert!(
            svg.contains("a&lt;b") && svg.contains("hill &amp; dale") && svg.contains("frame 7")
        );
        assert!(svg.contains(">600<") && !svg.contains(">800<"), "{svg}");
    }

    #[test]
    fn steps_are_round() {
        assert_eq!([0.15, 0.2, 3.0, 70.0].map(round_step), [0.2, 0.2, 5.0, 100.0]);
        assert!(round_step(f64::INFINITY).is_finite());
    }
}
