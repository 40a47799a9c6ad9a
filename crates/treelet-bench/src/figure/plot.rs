//! The figure as a picture: effective speed as a share of `sweep-sah`'s own tracing speed, over the number
//! of rays, as SVG.
//!
//! Those of treelet's lines that win somewhere have colours and names, Embree's are dashed, all others
//! thin and grey. A strip under the axis shows who wins where. The picture has a ground of its own, light or
//! dark as the reader's system is, so that it can be read on any page.

use std::fmt::Write as _;

use super::data::{Figure, Panel, Point, YARDSTICK};
use super::envelope::axis;
use super::scene::is_ours;
use crate::rivals::treelet as ours;

/// The picture, and the frame in it, in pixels.
const WIDTH: f64 = 830.0;
const HEIGHT: f64 = 460.0;
const LEFT: f64 = 58.0;
const RIGHT: f64 = 626.0;
const TOP: f64 = 58.0;
const BOTTOM: f64 = 384.0;
/// The strip of winners.
const STRIP: f64 = 7.0;
/// Between two names.
const LINE: f64 = 16.0;

/// The decades of the axis.
const DECADES: [&str; 9] = ["10 k", "100 k", "1 M", "10 M", "100 M", "1 G", "10 G", "100 G", "1 T"];

/// Colours that differ also to those who see few, and can be read on white and on black: after P. Tol,
/// "Colour Schemes", SRON technical note 09-002, darker where white asks for it.
pub(crate) const COLORS: [&str; 8] =
    ["#3b7dc4", "#dd4f66", "#2a9245", "#a67c00", "#0094b3", "#c2528b", "#8a63d2", "#a0623a"];

/// Light and dark.
pub(crate) const STYLE: &str = "\
    .ground{fill:#ffffff;stroke:#d8dee4}.word{fill:#24292f}.soft{fill:#6e7781}\
    .grid{stroke:#d8dee4}.other{stroke:#b4bcc4}.rival{stroke:#57606a}.rivalname{fill:#57606a}\
    @media(prefers-color-scheme:dark){.ground{fill:#0d1117;stroke:#30363d}.word{fill:#e6edf3}\
    .soft{fill:#8d96a0}.grid{stroke:#30363d}.other{stroke:#444c56}.rival{stroke:#adb5bd}\
    .rivalname{fill:#adb5bd}}";

/// One variant's line: its share at every place of the axis.
struct Share {
    engine: String,
    variant: String,
    shares: Vec<f64>,
}

/// One panel; `None` where it has no `sweep-sah` to measure by.
pub fn panel_svg(figure: &Figure, panel: &Panel) -> Option<String> {
    draw(figure, std::slice::from_ref(panel), &panel.title())
}

/// The geometric mean over all panels with the fewest threads, of the variants that each has; `None` where
/// a panel has no `sweep-sah`, or none is there.
pub fn mean_svg(figure: &Figure) -> Option<String> {
    let mut panels = figure.panels();
    let fewest = panels.iter().map(|panel| panel.threads).min()?;
    panels.retain(|panel| panel.threads == fewest);
    let count = |of: fn(&Panel) -> &str| {
        let mut names: Vec<&str> = panels.iter().map(of).collect();
        names.sort_unstable();
        names.dedup();
        names.len()
    };
    let (scenes, kinds) = (count(|it| &it.scene), count(|it| &it.kind));
    let threads = if fewest == 1 { "1 thread".to_owned() } else { format!("{fewest} threads") };
    let title = format!("geometric mean over {scenes} scenes and {kinds} kinds of rays, {threads}");
    draw(figure, &panels, &title)
}

fn draw(figure: &Figure, panels: &[Panel], title: &str) -> Option<String> {
    let lines = shares(figure, panels)?;
    let winners = strip(&lines);
    let mut order: Vec<usize> = Vec::new();
    for &winner in &winners {
        if !order.contains(&winner) {
            order.push(winner);
        }
    }
    let most = lines.iter().flat_map(|line| &line.shares).fold(1.0_f64, |a, &b| a.max(b));
    let mut svg = head(title);
    frame(&mut svg, most);
    // Draw what matters last.
    let place = |index: usize| order.iter().position(|&winner| winner == index);
    for (index, line) in lines.iter().enumerate() {
        if place(index).is_none() && line.engine == ours::NAME {
            polyline(&mut svg, line, most, "class=\"other\" stroke-width=\"1\"");
        }
    }
    for line in lines.iter().filter(|line| line.engine != ours::NAME) {
        let style = "class=\"rival\" stroke-width=\"1.6\" stroke-dasharray=\"6 4\"";
        polyline(&mut svg, line, most, style);
    }
    for (number, &index) in order.iter().enumerate().rev() {
        let color = COLORS[number % COLORS.len()];
        let style = format!("stroke=\"{color}\" stroke-width=\"2.6\"");
        polyline(&mut svg, &lines[index], most, &style);
    }
    draw_strip(&mut svg, &winners, &order);
    names(&mut svg, &lines, &order, most);
    chosen(&mut svg, figure, panels, most);
    Some(svg + "</svg>\n")
}

/// Every variant that all panels have.
fn shares(figure: &Figure, panels: &[Panel]) -> Option<Vec<Share>> {
    let all: Vec<Vec<&Point>> = panels.iter().map(|panel| figure.points_of(panel)).collect();
    let mut lines = Vec::new();
    for first in all.first()? {
        let mut logs = vec![0.0; axis().len()];
        let mut everywhere = true;
        for points in &all {
            let same = |it: &&&Point| it.engine == first.engine && it.variant == first.variant;
            let Some(point) = points.iter().find(same) else {
                everywhere = false;
                break;
            };
            let rate = yardstick(points)?;
            let curve = point.curve();
            for (log, rays) in logs.iter_mut().zip(axis()) {
                *log += (curve.effective(rays) / rate).ln();
            }
        }
        if everywhere {
            let shares = logs.iter().map(|log| (log / all.len() as f64).exp()).collect();
            let (engine, variant) = (first.engine.clone(), first.variant.clone());
            lines.push(Share { engine, variant, shares });
        }
    }
    Some(lines)
}

/// `sweep-sah`'s own tracing speed, in rays a second.
fn yardstick(points: &[&Point]) -> Option<f64> {
    let is_it = |point: &&&Point| is_ours(point) && point.variant == YARDSTICK;
    points.iter().find(is_it).map(|point| 1e6 * point.mrays_per_s)
}

/// Which of treelet's lines is the highest at every place of the axis.
fn strip(lines: &[Share]) -> Vec<usize> {
    let highest = |place: usize| {
        let share = |index: &usize| lines[*index].shares[place];
        let ours = (0..lines.len()).filter(|&index| lines[index].engine == ours::NAME);
        ours.max_by(|a, b| share(a).total_cmp(&share(b)))
    };
    (0..axis().len()).filter_map(highest).collect()
}

/// Title, ground, style.
fn head(title: &str) -> String {
    let title = escaped(title);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" \
         font-family=\"system-ui, -apple-system, 'Segoe UI', Helvetica, Arial, sans-serif\" \
         font-size=\"12.5\" role=\"img\" aria-label=\"Effective speed over the number of rays: \
         {title}\">\n<style>{STYLE}</style>\n\
         <rect class=\"ground\" x=\"0.5\" y=\"0.5\" width=\"{}\" height=\"{}\" rx=\"6\"/>\n\
         <text class=\"word\" x=\"{LEFT}\" y=\"26\" font-size=\"15\" font-weight=\"600\">Rays a second, \
         the build included, beside {YARDSTICK}'s tracing alone</text>\n\
         <text class=\"soft\" x=\"{LEFT}\" y=\"44\">{title}</text>\n",
        WIDTH - 1.0,
        HEIGHT - 1.0
    )
}

/// Lines and numbers of both axes.
fn frame(svg: &mut String, most: f64) {
    let quarters = (4.0 * most).floor() as u32;
    for quarter in 0..=quarters {
        let share = 0.25 * f64::from(quarter);
        let at = y(share, most);
        let _ = writeln!(
            svg,
            "<line class=\"grid\" x1=\"{LEFT}\" x2=\"{RIGHT}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/>\
             <text class=\"soft\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{:.0} %</text>",
            LEFT - 8.0,
            at + 4.0,
            100.0 * share
        );
    }
    for (index, name) in DECADES.iter().enumerate() {
        let at = LEFT + (RIGHT - LEFT) * index as f64 / (DECADES.len() - 1) as f64;
        let _ = writeln!(
            svg,
            "<text class=\"soft\" x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{name}</text>",
            BOTTOM + STRIP + 20.0
        );
    }
    let _ = writeln!(
        svg,
        "<text class=\"word\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">rays that are traced</text>",
        0.5 * (LEFT + RIGHT),
        BOTTOM + STRIP + 42.0
    );
}

fn polyline(svg: &mut String, line: &Share, most: f64, style: &str) {
    let points: Vec<String> = line
        .shares
        .iter()
        .enumerate()
        .map(|(place, &share)| format!("{:.1},{:.1}", x(place), y(share, most)))
        .collect();
    let _ = writeln!(
        svg,
        "<polyline {style} fill=\"none\" stroke-linejoin=\"round\" points=\"{}\">\
         <title>{}</title></polyline>",
        points.join(" "),
        escaped(&label(line))
    );
}

/// Who wins where, as a strip on the axis.
fn draw_strip(svg: &mut String, winners: &[usize], order: &[usize]) {
    let mut from = 0;
    while from < winners.len() {
        let run = winners[from..].iter().take_while(|&&it| it == winners[from]).count();
        let number = order.iter().position(|&it| it == winners[from]).unwrap_or(0);
        // A winner reaches half way to its neighbours' places.
        let left = if from == 0 { LEFT } else { 0.5 * (x(from - 1) + x(from)) };
        let end = from + run;
        let right = if end == winners.len() { RIGHT } else { 0.5 * (x(end - 1) + x(end)) };
        let _ = writeln!(
            svg,
            "<rect x=\"{left:.1}\" y=\"{BOTTOM}\" width=\"{:.1}\" height=\"{STRIP}\" fill=\"{}\"/>",
            right - left,
            COLORS[number % COLORS.len()]
        );
        from = end;
    }
}

/// Names at the right, each at the end of its line, moved apart where they would meet.
fn names(svg: &mut String, lines: &[Share], order: &[usize], most: f64) {
    let end = |index: usize| y(lines[index].shares.last().copied().unwrap_or(0.0), most);
    let rivals = (0..lines.len()).filter(|&index| lines[index].engine != ours::NAME);
    let mut named: Vec<(usize, f64)> =
        order.iter().copied().chain(rivals).map(|index| (index, end(index))).collect();
    named.sort_by(|a, b| a.1.total_cmp(&b.1));
    for next in 1..named.len() {
        named[next].1 = named[next].1.max(named[next - 1].1 + LINE);
    }
    // Where the last ones went below the frame, push them up again.
    let mut lowest = BOTTOM;
    for place in named.iter_mut().rev() {
        place.1 = place.1.min(lowest);
        lowest = place.1 - LINE;
    }
    for (index, at) in named {
        let number = order.iter().position(|&winner| winner == index);
        let style = match number {
            Some(number) => {
                format!("fill=\"{}\" font-weight=\"600\"", COLORS[number % COLORS.len()])
            }
            None => "class=\"rivalname\"".to_owned(),
        };
        let from = end(index);
        let _ = writeln!(
            svg,
            "<line class=\"grid\" x1=\"{:.1}\" y1=\"{from:.1}\" x2=\"{:.1}\" y2=\"{at:.1}\"/>\
             <text {style} x=\"{:.1}\" y=\"{:.1}\">{}</text>",
            RIGHT + 2.0,
            RIGHT + 12.0,
            RIGHT + 15.0,
            at + 4.0,
            escaped(&label(&lines[index]))
        );
    }
}

/// What the library reaches when it is told the number of rays, as dots.
fn chosen(svg: &mut String, figure: &Figure, panels: &[Panel], most: f64) {
    let mut counts: Vec<u64> = figure.choices.iter().map(|choice| choice.rays).collect();
    counts.sort_unstable();
    counts.dedup();
    let mut drawn = false;
    for rays in counts {
        let mut logs = Vec::new();
        for panel in panels {
            let choices = figure.choices_of(panel);
            let Some(choice) = choices.iter().find(|choice| choice.rays == rays) else { continue };
            let Some(rate) = yardstick(&figure.points_of(panel)) else { continue };
            logs.push((rays as f64 / choice.measured_s / rate).ln());
        }
        if logs.len() < panels.len() {
            continue;
        }
        let share = (logs.iter().sum::<f64>() / logs.len() as f64).exp();
        let decades = (rays as f64 / 1e4).log10();
        let at = LEFT + (RIGHT - LEFT) * decades / (DECADES.len() - 1) as f64;
        let _ = writeln!(
            svg,
            "<circle class=\"word\" cx=\"{at:.1}\" cy=\"{:.1}\" r=\"3.2\"/>",
            y(share, most)
        );
        drawn = true;
    }
    if drawn {
        let _ = writeln!(
            svg,
            "<circle class=\"word\" cx=\"{:.1}\" cy=\"40\" r=\"3.2\"/>\
             <text class=\"word\" x=\"{:.1}\" y=\"44\">for_rays(n)</text>",
            RIGHT - 82.0,
            RIGHT - 74.0
        );
    }
}

/// The engine is named where it is another one.
fn label(line: &Share) -> String {
    if line.engine == ours::NAME {
        line.variant.clone()
    } else {
        format!("{} {}", line.engine, line.variant)
    }
}

/// The pixel of a place of the axis.
fn x(place: usize) -> f64 {
    LEFT + (RIGHT - LEFT) * place as f64 / (axis().len() - 1) as f64
}

/// The pixel of a share.
fn y(share: f64, most: f64) -> f64 {
    BOTTOM - (BOTTOM - TOP) * share / (1.04 * most)
}

/// As text and as an attribute of XML.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::super::data::{Figure, Point};
    use super::{mean_svg, panel_svg};

    fn figure(variants: &[(&str, &str, f64, f64)]) -> Figure {
        let point = |&(engine, variant, build_s, mrays_per_s): &(&str, &str, f64, f64)| {
            Point::of("a<b", engine, variant, build_s, mrays_per_s)
        };
        Figure { points: variants.iter().map(point).collect(), ..Figure::default() }
    }

    #[test]
    fn winners_have_colours_and_names() {
        let figure = figure(&[
            ("treelet", "lbvh", 0.1, 1.0),
            ("treelet", "sweep-sah", 2.0, 2.0),
            ("treelet", "never", 3.0, 1.0),
            ("embree", "HIGH", 1.0, 1.9),
        ]);
        let svg = panel_svg(&figure, &figure.panels()[0]).unwrap();
        assert_eq!(svg.matches("<polyline").count(), 4);
        assert_eq!(svg.matches("class=\"other\"").count(), 1);
        assert_eq!(svg.matches("stroke-dasharray").count(), 1);
        // Names at the ends: of two winners and of the rival; and a title for every line.
        for (word, times) in [("lbvh<", 2), ("sweep-sah<", 2), ("never<", 1), ("embree HIGH<", 2)] {
            assert_eq!(svg.matches(&format!(">{word}")).count(), times, "{word}");
        }
        assert!(svg.contains("a&lt;b") && !svg.contains("a<b"));
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        assert_eq!(mean_svg(&figure).unwrap().matches("<polyline").count(), 4);
    }

    #[test]
    fn without_the_yardstick_nothing_is_drawn() {
        assert_eq!(mean_svg(&figure(&[("treelet", "lbvh", 0.1, 1.0)])), None);
        assert_eq!(mean_svg(&Figure::default()), None);
    }
}
