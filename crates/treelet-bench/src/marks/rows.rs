//! The marks, in the order of the table that set them: treelet watertight, Embree not robust.

use super::cells::{Facts, Found, Group, Length};
use super::sum::{Asked, mark, on_condition};
use super::{Mark, SHORT_SLICE};
use crate::rays::Kind;
use crate::report::Order;
use crate::rivals::embree::NAME as EMBREE;
use crate::rivals::treelet as ours;
use crate::stats::Ratio;

/// treelet's variant that is made to be traced.
const BEST: &str = "best";
/// treelet's variant that is made to be built.
const FAST: &str = "fast";
/// What stands for treelet's compact layout where none was measured.
const COMPACT: &str = "default compact";

/// About rays: one at a time, then in slices.
pub(super) fn tracing(facts: &Facts<'_>, threads: usize, marks: &mut Vec<Mark>) {
    let with = with(threads);
    let best = best(facts);
    let in_order = |scene, kind, order| Group { scene, kind, order, threads };

    // One ray at a time, each kind.
    for (variant, rival) in [(ours::default_variant(), "MEDIUM"), (best, "HIGH")] {
        for kind in Kind::ALL {
            let cells = facts.per_scene(|scene| {
                let group = in_order(&scene.scene, kind, Order::Given);
                let ours = facts.single(group, ours::NAME, variant)?;
                Ok(ours.ratio(facts.single(group, EMBREE, rival)?))
            });
            let what = format!("single {}, {variant} / Embree {rival}, {with}", kind.name());
            marks.push(mark(what, cells, Asked::at_least(1.25, 1.0)));
        }
    }

    // Slices, each kind; long ones in both orders, and short ones.
    let against_high = |scene, kind, order, length| -> Found {
        let group = in_order(scene, kind, order);
        Ok(facts.slices(group, best, length)?.ratio(facts.fastest(group, "HIGH")?))
    };
    let longest = facts.longest_slice().unwrap_or_default();
    let rivals = format!("{best} / best of Embree HIGH, {with}");
    for (name, order, length, asked) in [
        (format!("slices of {longest}"), Order::Given, Length::Longest, 1.4),
        (format!("shuffled slices of {longest}"), Order::Shuffled, Length::Longest, 1.5),
        (format!("slices of {SHORT_SLICE}"), Order::Given, Length::Of(SHORT_SLICE), 1.15),
    ] {
        for kind in Kind::ALL {
            let cells = facts.per_scene(|scene| against_high(&scene.scene, kind, order, length));
            let what = format!("{name} {}, {rivals}", kind.name());
            marks.push(mark(what, cells, Asked::at_least(asked, 1.0)));
        }
    }

    // Slices of random rays where there is no structure to find.
    let cells = facts.per_generated_scene(|scene| {
        against_high(&scene.scene, Kind::Random, Order::Given, Length::Longest)
    });
    let what = format!("slices of {longest} random, generated scenes, {rivals}");
    marks.push(mark(what, cells, Asked::at_least(1.6, 1.4)));
}

/// About rays through instances: each kind, one ray at a time.
pub(super) fn instances(facts: &Facts<'_>, threads: usize, marks: &mut Vec<Mark>) {
    let (default, with) = (ours::default_variant(), with(threads));
    for kind in Kind::ALL {
        let cells = facts.per_instanced_scene(|scene| {
            let group = Group { scene: &scene.scene, kind, order: Order::Given, threads };
            let ours = facts.single(group, ours::NAME, default)?;
            Ok(ours.ratio(facts.single(group, EMBREE, "MEDIUM")?))
        });
        let kind = kind.name();
        let what = format!("instances: single {kind}, {default} / Embree MEDIUM, {with}");
        marks.push(mark(what, cells, Asked::mean_at_least(1.25)));
    }
}

/// About building.
pub(super) fn building(facts: &Facts<'_>, threads: usize, marks: &mut Vec<Mark>) {
    let with = with(threads);
    let builds = |variant: &str, rival: &str| {
        let cells = facts.per_scene(|scene| {
            let ours = facts.build(&scene.scene, ours::NAME, variant, threads)?;
            Ok(ours.ratio(facts.build(&scene.scene, EMBREE, rival, threads)?))
        });
        let what = format!("build, {variant} / Embree {rival}, {with}");
        mark(what, cells, Asked::at_least(1.5, 1.0))
    };
    marks.push(builds(ours::default_variant(), "MEDIUM"));

    // A fast build counts if rays through its tree are not slower.
    let cells = facts.per_kind(|scene, kind| {
        let group = Group { scene, kind, order: Order::Given, threads };
        let ours = facts.single(group, ours::NAME, FAST)?;
        Ok(ours.ratio(facts.single(group, EMBREE, "LOW")?))
    });
    let what = format!("  if: single rays through that tree, {FAST} / Embree LOW, {with}");
    let condition = mark(what, cells, Asked::mean_at_least(1.0));
    marks.push(on_condition(builds(FAST, "LOW"), &condition));
    marks.push(condition);
}

/// About memory. It does not depend on threads, so the fewest stand for all.
pub(super) fn memory(facts: &Facts<'_>, marks: &mut Vec<Mark>) {
    let threads = facts.builds.iter().map(|build| build.threads).min().unwrap_or(1);
    let exact = |value: f64| Ratio { median: value, low: value, high: value };
    let build = |scene, variant| facts.build(scene, ours::NAME, variant, threads);
    let compact = facts.variant(ours::is_compact).unwrap_or(COMPACT);

    for (variant, asked) in [
        (ours::default_variant(), Asked::at_most(60.0, Some(75.0))),
        (compact, Asked::at_most(30.0, Some(40.0))),
    ] {
        let cells = facts.per_scene(|scene| {
            let build = build(&scene.scene, variant)?;
            Ok(exact(build.bytes_per_tri - build.shared_bytes_per_tri))
        });
        let what = format!("bytes a triangle that walks read, {variant}");
        marks.push(mark(what, cells, asked));
        let cells = facts.per_scene(|scene| Ok(exact(build(&scene.scene, variant)?.bytes_per_tri)));
        let what = format!("  with the caller's arrays, which the scene keeps, {variant}");
        marks.push(mark(what, cells, asked));
    }

    for (variant, asked) in [(ours::default_variant(), 96.0), (FAST, 64.0)] {
        let cells = facts.per_scene(|scene| {
            let build = build(&scene.scene, variant)?;
            let peak = build.peak_bytes_per_tri;
            let peak = peak.ok_or_else(|| format!("no peak of treelet {variant}"))?;
            // Nothing at all above the result has no logarithm.
            Ok(exact((peak - build.bytes_per_tri).max(0.1)))
        });
        let what = format!("peak of a build above its result, bytes a triangle, {variant}");
        marks.push(mark(what, cells, Asked::at_most(asked, None)));
    }
}

/// treelet against itself, one thread.
pub(super) fn own_costs(facts: &Facts<'_>, marks: &mut Vec<Mark>) {
    let default = ours::default_variant();
    let group = |scene, kind| Group { scene, kind, order: Order::Given, threads: 1 };

    let compact = facts.variant(ours::is_compact).unwrap_or(COMPACT);
    let cells = facts.per_kind(|scene, kind| {
        let compact = facts.single(group(scene, kind), ours::NAME, compact)?;
        Ok(compact.ratio(facts.single(group(scene, kind), ours::NAME, default)?))
    });
    let what = format!("single rays, {compact} / {default}, 1 thread");
    marks.push(mark(what, cells, Asked::at_least(0.85, 0.7)));

    let cells = facts.per_kind(|scene, kind| {
        let call = facts.single(group(scene, kind), ours::NAME, default)?;
        let inlined = facts.slices(group(scene, kind), default, Length::Of(ours::LOOP))?;
        Ok(call.ratio(inlined))
    });
    let what = format!("single-ray call / the library's own loop, {default}, 1 thread");
    marks.push(mark(what, cells, Asked::mean_at_least(0.97)));
}

/// The variant that stands for treelet's best build: the default one where nothing better was
/// measured.
fn best(facts: &Facts<'_>) -> &'static str {
    let names = [BEST, "high", ours::default_variant()];
    names.into_iter().find(|&name| facts.variant(|it| it == name).is_some()).unwrap_or(BEST)
}

fn with(threads: usize) -> String {
    if threads == 1 { "1 thread".to_owned() } else { format!("{threads} threads") }
}
