//! The report as people read it: lines of text.

use std::fmt::Write as _;

use crate::engine::Api;
use crate::marks::{Mark, Standing};
use crate::rays::Kind;
use crate::report::{Build, Order, SceneLine, Trace};
use crate::rivals::treelet as ours;

/// What one scene gave, in tables.
pub fn scene(scene: &SceneLine, builds: &[Build], traces: &[Trace]) -> Vec<String> {
    let mut lines = vec![format!(
        "\n{}: {} triangles{}; {:.1} % of primary rays hit; {} rays as by brute force",
        scene.scene,
        scene.triangles,
        if scene.instances > 0 {
            format!(", {} instances", scene.instances)
        } else {
            String::new()
        },
        100.0 * scene.hit_rate,
        scene.rays_by_brute_force
    )];
    lines.extend(build_table(builds));
    for kind in Kind::ALL {
        for order in [Order::Given, Order::Shuffled] {
            let mut threads: Vec<usize> = traces.iter().map(|trace| trace.threads).collect();
            threads.dedup();
            for threads in threads {
                let group: Vec<&Trace> = traces
                    .iter()
                    .filter(|t| t.kind == kind && t.order == order && t.threads == threads)
                    .collect();
                lines.extend(trace_table(&group, kind, order, threads));
            }
        }
    }
    lines
}

/// Builds: how fast, how large.
fn build_table(builds: &[Build]) -> Vec<String> {
    let mut lines = vec![format!(
        "  {:26} {:>7} {:>8} {:>8} {:>10} {:>8}",
        "build", "threads", "Mtris/s", "B/tri", "of callers", "peak"
    )];
    for build in builds {
        let peak = build.peak_bytes_per_tri.map_or("-".to_owned(), |peak| format!("{peak:.1}"));
        lines.push(format!(
            "  {:26} {:>7} {:>8.2} {:>8.1} {:>10.1} {:>8}",
            format!("{} {}", build.engine, build.variant),
            build.threads,
            build.mtris_per_s,
            build.bytes_per_tri,
            build.shared_bytes_per_tri,
            peak,
        ));
    }
    lines
}

/// Traces of one kind: how fast, and each against the rivals' fastest with the same interface.
fn trace_table(group: &[&Trace], kind: Kind, order: Order, threads: usize) -> Vec<String> {
    let Some(first) = group.first() else { return Vec::new() };
    let mut title = format!("  {} x {}", kind.name(), first.rays);
    if order == Order::Shuffled {
        title += ", shuffled";
    }
    let _ = write!(title, ", {threads} thread{}", if threads == 1 { "" } else { "s" });
    let rival = |any_call: bool| {
        let theirs = group.iter().filter(|t| t.engine != ours::NAME);
        theirs
            .filter(|t| any_call || t.api == Api::One)
            .max_by(|a, b| a.mrays_per_s.total_cmp(&b.mrays_per_s))
    };
    let mut lines = vec![format!(
        "{title:42} {:>8} {:>7} {:>9} {:>9}  of the rivals' fastest such",
        "Mrays/s", "spread", "mism. ppm", "ids ppm"
    )];
    for trace in group {
        let mut line = format!(
            "    {:38} {:>8.2} {:>6.0}% {:>9.1} {:>9}",
            trace.label(),
            trace.mrays_per_s,
            100.0 * trace.spread,
            trace.mismatch_ppm,
            trace.ids_ppm.map_or("-".to_owned(), |ppm| format!("{ppm:.1}")),
        );
        if let Some(rival) = rival(trace.api == Api::Many) {
            let ratio = trace.ratio(rival);
            let _ = write!(line, "  {:.2} ({:.2}..{:.2})", ratio.median, ratio.low, ratio.high);
        }
        lines.push(line);
    }
    lines
}

/// The marks: what is asked, what was measured, over how many cells, and what lacks.
pub fn marks(marks: &[Mark]) -> Vec<String> {
    let longest = marks.iter().map(|mark| mark.what.len()).max().unwrap_or(0);
    let mut lines = vec![format!(
        "\n{:longest$} {:>5} {:>6} {:>13} {:>5} {:>6} {:>13} {:>5}  standing",
        "mark", "asked", "mean", "95 %", "asked", "worst", "95 %", "cells"
    )];
    for mark in marks {
        let interval =
            |ends: Option<[f64; 2]>| ends.map_or("-".into(), |[a, b]| format!("{a:.2}..{b:.2}"));
        let standing = match mark.standing {
            Standing::Met => "met",
            Standing::MetByInterval => "met by its interval only",
            Standing::NotMet => "NOT MET",
            Standing::NotMeasured => "not measured",
        };
        let place = mark.worst_scene.iter().map(|scene| format!(", worst in {scene}"));
        let lacking = mark.lacking.iter().map(|lacking| match mark.cells {
            0 => format!(": {lacking}"),
            _ => format!(" (somewhere {lacking})"),
        });
        lines.push(format!(
            "{:longest$} {:>5.2} {:>6} {:>13} {:>5} {:>6} {:>13} {:>5}  {standing}{}",
            mark.what,
            mark.mean_asked,
            number(mark.mean),
            interval(mark.interval),
            number(mark.worst_asked),
            number(mark.worst),
            interval(mark.worst_interval),
            mark.cells,
            place.chain(lacking).collect::<String>(),
        ));
    }
    lines
}

fn number(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.2}"))
}
