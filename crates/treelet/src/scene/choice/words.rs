//! The reason, in words.

use super::model::Model;
use alloc::format;
use alloc::string::String;

/// Why `best` was chosen, in a sentence.
pub(super) fn reason(model: &Model, best: usize, rays: u64) -> String {
    let name = |at: usize| model.entries[at].contender.name;
    let (count, nth) = (count(rays as f64), name(best));
    if rays == 0 {
        return format!("no rays are to come, and `{nth}` is built soonest");
    }
    let (build, spent) = (model.build(best), model.rays(best));
    // What a cheaper build would have come to, and, where there is none, what a dearer one would.
    let total = |at: usize| model.build(at) + model.rays(at);
    let others = (0..model.entries.len()).filter(|&at| at != best);
    let cheaper = others.clone().filter(|&at| model.build(at) < build);
    let cheaper = cheaper.min_by(|&a, &b| model.build(a).total_cmp(&model.build(b)));
    if let Some(other) = cheaper {
        let ray = time(model.ray(other));
        let (slow, more) = (time(model.rays(other)), time(build - model.build(other)));
        let fast = model.ray(other) / model.ray(best);
        return format!(
            "{count} rays at {ray} each would take {slow} on `{}`; `{nth}` takes {more} more to build and traces {fast:.2} times as fast",
            name(other)
        );
    }
    let dearer = others.min_by(|&a, &b| total(a).total_cmp(&total(b)));
    let Some(other) = dearer else { return format!("`{nth}` is all there is") };
    let (more, saved) = (time(model.build(other) - build), time(spent - model.rays(other)));
    let (spent, ray) = (time(spent), time(model.ray(best)));
    format!(
        "{count} rays at {ray} each take {spent} on `{nth}`, which is built soonest; `{}` would take {more} more to build and save {saved}",
        name(other)
    )
}

/// `12,000`, `3.5e7`.
fn count(rays: f64) -> String {
    if rays < 1e6 { format!("{rays:.0}") } else { format!("{rays:.3e}").replace(".000e", "e") }
}

/// With a unit.
fn time(seconds: f64) -> String {
    let seconds = seconds.max(0.0);
    let (value, unit) = match seconds {
        s if s >= 1.0 => (s, "s"),
        s if s >= 1e-3 => (s * 1e3, "ms"),
        s if s >= 1e-6 => (s * 1e6, "µs"),
        s => (s * 1e9, "ns"),
    };
    if value >= 100.0 || value == 0.0 {
        format!("{value:.0} {unit}")
    } else {
        format!("{value:.1} {unit}")
    }
}
