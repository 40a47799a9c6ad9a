//! What a scene of `Quality::Auto` takes that nobody told how many rays are coming: really traced, with
//! all its improving, against the best point in hindsight.

use std::hint::black_box;
use std::time::Duration;

use treelet::scene::Pilot;
use treelet::{BuildOptions, Cancel, Context, Mesh, Quality, Ray, Scene, SceneError};

use super::choices::refused;
use super::data::{Choice, Point};
use super::envelope::{Curve, best_at};
use super::scene::Bench;
use super::watch::watched;
use crate::crew::Stopwatch;
use crate::engine::Question;
use crate::rays::Kind;
use crate::rivals::treelet as ours;
use crate::run::{BenchError, stop};

/// Rays between two calls of `improve`, some milliseconds.
const BATCH: usize = 1 << 14;

/// Traces for every number of rays of the plan, on one thread: more would have to share the rays out
/// between improvements, which is up to the caller. None on more.
pub(super) fn measure(
    bench: &Bench<'_>,
    kind: Kind,
    rays: &[Ray],
    pilot: Pilot<'_>,
    points: &[Point],
) -> Result<Vec<Choice>, BenchError> {
    let mut choices = Vec::new();
    if bench.crew.threads() > 1 {
        return Ok(choices);
    }
    let curves: Vec<Curve> = points.iter().map(Point::curve).collect();
    for &count in &bench.plan.auto {
        stop(bench.watcher)?;
        let (name, kind_name) = (&bench.subject.name, kind.name());
        bench.watcher.step(&format!("{name}: {count} {kind_name} rays, improving on the way"));
        let (ended, seconds) = watched(bench.watcher, Duration::MAX, |cancel| {
            bench.crew.install(|| {
                let watch = Stopwatch::start(bench.crew.clock());
                let ended = answer(bench, kind.question(), rays, pilot, count, cancel);
                (ended, watch.elapsed().as_secs_f64())
            })
        });
        stop(bench.watcher)?;
        let last = ended.map_err(|error| refused(bench, "auto", &error))?;
        let Some((best, best_s)) = best_at(&curves, count as f64) else { continue };
        choices.push(Choice {
            scene: name.clone(),
            kind: kind_name.to_owned(),
            rays: count,
            variant: "auto".to_owned(),
            predicted_s: None,
            measured_s: seconds,
            best_variant: points[best].variant.clone(),
            best_s,
            threads: 1,
            reason: format!("ended with {last}"),
        });
    }
    Ok(choices)
}

/// Builds, and answers `count` rays, one a call, improving the scene now and then; what it ended with.
fn answer(
    bench: &Bench<'_>,
    question: Question,
    rays: &[Ray],
    pilot: Pilot<'_>,
    count: u64,
    cancel: &Cancel,
) -> Result<String, SceneError> {
    let triangles = &bench.subject.triangles;
    let context = Context { cancel: cancel.clone(), progress: None };
    let mesh = Mesh::new(triangles.positions.clone(), triangles.indices.clone());
    let options = BuildOptions { quality: Quality::Auto, pilot, context, ..Default::default() };
    let mut scene = Scene::builder().mesh(mesh).build(&options)?;
    let mut batches = rays.chunks(BATCH).cycle();
    let mut left = count;
    while left > 0 {
        let Some(batch) = batches.next() else { break };
        let batch = &batch[..batch.len().min(usize::try_from(left).unwrap_or(usize::MAX))];
        let clock = Stopwatch::start(crate::crew::Clock::Wall);
        for ray in batch {
            match question {
                Question::Closest => _ = black_box(ours::closest(&scene, ray)),
                Question::Any => _ = black_box(ours::any(&scene, ray)),
            }
        }
        scene.note_traced(batch.len() as u64, clock.elapsed());
        left -= batch.len() as u64;
        if let Some(better) = scene.improve(Duration::MAX)? {
            scene = better;
        }
    }
    Ok(scene.report().choice.as_ref().map(|it| it.variant.clone()).unwrap_or_default())
}
