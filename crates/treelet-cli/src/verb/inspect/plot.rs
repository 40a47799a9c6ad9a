//! Predicted against measured times as an SVG picture: a panel for each model, a dot for each tree
//! and kind of ray, a colour for each scene.

use std::fmt::Write as _;

use super::fit::Fit;

/// The edge of a panel, and what is around it, in pixels.
const PANEL: f64 = 270.0;
const MARGIN: f64 = 50.0;
/// Height of a line of the legend.
const LINE: f64 = 18.0;

/// Times relative to the fastest tree of a scene and kind, from here to there.
const RANGE: [f64; 2] = [0.7, 6.0];
const TICKS: [f64; 5] = [0.7, 1.0, 2.0, 4.0, 6.0];

/// Colours that differ also to those who see few: P. Tol, "Colour Schemes", SRON technical note
/// 09-002, and three greys.
const COLORS: [&str; 10] = [
    "#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377", "#000000", "#999999",
    "#774411", "#117755",
];

/// The picture.
pub(super) fn svg(fits: &[Fit]) -> String {
    let mut models: Vec<&str> = Vec::new();
    let mut scenes: Vec<&str> = Vec::new();
    for fit in fits {
        if !models.contains(&fit.model) {
            models.push(fit.model);
        }
        if !scenes.contains(&fit.scene.as_str()) {
            scenes.push(&fit.scene);
        }
    }
    let width = MARGIN + models.len() as f64 * (PANEL + MARGIN);
    let legend = 2.0 * MARGIN + PANEL;
    let rows = scenes.len().div_ceil(4) as f64;
    let height = legend + LINE * rows + 10.0;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
         font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    for (index, model) in models.iter().enumerate() {
        let left = MARGIN + index as f64 * (PANEL + MARGIN);
        frame(&mut svg, left, model);
        for fit in fits.iter().filter(|fit| fit.model == *model) {
            let scene = scenes.iter().position(|scene| *scene == fit.scene).unwrap_or(0);
            dots(&mut svg, left, fit, COLORS[scene % COLORS.len()]);
        }
    }
    for (index, scene) in scenes.iter().enumerate() {
        let x = MARGIN + (index % 4) as f64 * (width - 2.0 * MARGIN) / 4.0;
        let y = legend + LINE * (index / 4) as f64;
        let color = COLORS[index % COLORS.len()];
        let name = scene.replace('&', "&amp;").replace('<', "&lt;");
        let _ = writeln!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"{:.1}\" r=\"4\" fill=\"{color}\"/>\
             <text x=\"{:.1}\" y=\"{y:.1}\">{name}</text>",
            y - 4.0,
            x + 9.0
        );
    }
    svg + "</svg>\n"
}

/// Axes, their numbers, the line where predictions are right.
fn frame(svg: &mut String, left: f64, model: &str) {
    let (top, bottom) = (MARGIN, MARGIN + PANEL);
    let _ = writeln!(
        svg,
        "<rect x=\"{left}\" y=\"{top}\" width=\"{PANEL}\" height=\"{PANEL}\" fill=\"none\" \
         stroke=\"#888\"/>\n<line x1=\"{left}\" y1=\"{bottom}\" x2=\"{}\" y2=\"{top}\" \
         stroke=\"#bbb\"/>\n<text x=\"{}\" y=\"{}\" text-anchor=\"middle\" font-size=\"14\">{model}\
         </text>\n<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">predicted</text>",
        left + PANEL,
        left + 0.5 * PANEL,
        top - 12.0,
        left + 0.5 * PANEL,
        bottom + 32.0
    );
    let middle = top + 0.5 * PANEL;
    let _ = writeln!(
        svg,
        "<text x=\"{0}\" y=\"{middle}\" text-anchor=\"middle\" \
         transform=\"rotate(-90 {0} {middle})\">measured</text>",
        left - 30.0
    );
    for tick in TICKS {
        let at = PANEL * share(tick);
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"#555\">{tick}</text>\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"#555\">{tick}</text>",
            left + at,
            bottom + 15.0,
            left - 5.0,
            bottom - at + 4.0
        );
    }
}

/// The trees of one scene and kind.
fn dots(svg: &mut String, left: f64, fit: &Fit, color: &str) {
    let fastest = fit.points.iter().map(|point| point.measured).fold(f64::INFINITY, f64::min);
    for point in &fit.points {
        let x = left + PANEL * share(point.predicted / fastest);
        let y = MARGIN + PANEL * (1.0 - share(point.measured / fastest));
        let _ = writeln!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"{color}\" fill-opacity=\"0.6\">\
             <title>{} {} {}</title></circle>",
            fit.scene.replace('&', "&amp;").replace('<', "&lt;"),
            fit.kind,
            point.variant
        );
    }
}

/// Where a ratio is along an axis, from 0 to 1; those beyond an end are drawn at it.
fn share(ratio: f64) -> f64 {
    let [least, most] = RANGE;
    let ratio = if ratio.is_nan() { most } else { ratio.clamp(least, most) };
    libm::log(ratio / least) / libm::log(most / least)
}

#[cfg(test)]
mod tests {
    use super::{super::fit, PANEL, share, svg};

    #[test]
    fn every_tree_is_a_dot_in_every_panel() {
        let row = |variant: &str, sah, epo, nanoseconds| fit::Row {
            scene: "a<b".into(),
            kind: "diffuse".into(),
            variant: variant.into(),
            measures: [sah, epo, 1.0],
            nanoseconds,
        };
        let rows =
            [row("p", 10.0, 1.0, 100.0), row("q", 20.0, 3.0, 210.0), row("r", 15.0, 9.0, 300.0)];
        let svg = svg(&fit::fits(&rows));
        assert_eq!(svg.matches("<title>").count(), 9);
        assert!(svg.contains("a&lt;b") && !svg.contains("a<b") && svg.ends_with("</svg>\n"));
        assert_eq!(svg.matches("SAH+EPO+LCV").count(), 1);
    }

    #[test]
    fn axes_end_at_their_ends() {
        assert_eq!(
            [0.7, 6.0, 99.0, f64::NAN].map(|ratio| PANEL * share(ratio)),
            [0.0, PANEL, PANEL, PANEL]
        );
    }
}
