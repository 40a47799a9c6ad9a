//! What the library chooses for so many rays, by the clock, against the best point in hindsight.

use std::time::Duration;

use treelet::scene::{Pilot, SceneError};
use treelet::{BuildOptions, Context, Mesh, Quality, Ray, Scene};

use super::auto;
use super::data::{Choice, Point};
use super::envelope::{Curve, best_at};
use super::scene::{Bench, contender, is_ours};
use super::state::{ChoicePiece, Piece, State};
use super::watch::watched;
use crate::crew::Stopwatch;
use crate::engine::{EngineError, Question};
use crate::rays::Kind;
use crate::rivals::treelet::{self as ours, Treelet};
use crate::run::{BenchError, engine_error, stop};

/// Choices and builds that take less than this are made three times, and the middle one counts.
const SHORT: f64 = 0.5;

/// One choice, made.
struct Made {
    seconds: f64,
    scene: Scene,
}

/// Lets the library choose for every number of rays of the plan.
pub(super) fn add(
    bench: &Bench<'_>,
    kind: Kind,
    rays: &[Ray],
    pilot: &[Ray],
    state: &mut State,
) -> Result<(), BenchError> {
    let points: Vec<Point> = bench.points(kind, state).into_iter().filter(is_ours).collect();
    let curves: Vec<Curve> = points.iter().map(Point::curve).collect();
    let pilot = match kind.question() {
        Question::Closest => Pilot { closest: pilot, any: &[] },
        Question::Any => Pilot { closest: &[], any: pilot },
    };
    let mut choices = Vec::new();
    // What a machine is asked but once is not part of any choice.
    if let Some(&least) = bench.plan.choices.first() {
        drop(choose(bench, least, pilot)?);
    }
    for &count in &bench.plan.choices {
        let (scene, kind_name) = (&bench.subject.name, kind.name());
        bench.watcher.step(&format!("{scene}: choosing for {count} {kind_name} rays"));
        let Made { seconds, scene } = middle(bench, count, pilot)?;
        let Some(choice) = scene.report().choice.clone() else { continue };
        let Some((best, best_s)) = best_at(&curves, count as f64) else { continue };
        let rate = rate(bench, kind, rays, &points, &choice.variant, scene)?;
        choices.push(Choice {
            scene: bench.subject.name.clone(),
            kind: kind.name().to_owned(),
            rays: count,
            variant: choice.variant,
            predicted_s: Some(choice.predicted.as_secs_f64()),
            measured_s: seconds + count as f64 / rate,
            best_variant: points[best].variant.clone(),
            best_s,
            threads: bench.crew.threads(),
            reason: choice.reason,
        });
    }
    let (scene, threads) = (bench.subject.name.clone(), bench.crew.threads());
    let auto = auto::measure(bench, kind, rays, pilot, &points)?;
    let kind_name = kind.name().to_owned();
    let piece = ChoicePiece { scene, threads, kind: kind_name, choices, auto };
    state.add(Piece::Choices(piece))?;
    Ok(())
}

/// The middle one of three, by time, or the only one where it takes long.
fn middle(bench: &Bench<'_>, count: u64, pilot: Pilot<'_>) -> Result<Made, BenchError> {
    let first = choose(bench, count, pilot)?;
    if first.seconds > SHORT {
        return Ok(first);
    }
    let mut made = vec![first, choose(bench, count, pilot)?, choose(bench, count, pilot)?];
    made.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
    Ok(made.swap_remove(1))
}

/// Lets the library choose and build once.
fn choose(bench: &Bench<'_>, count: u64, pilot: Pilot<'_>) -> Result<Made, BenchError> {
    let Bench { subject, crew, watcher, .. } = *bench;
    stop(watcher)?;
    let triangles = &subject.triangles;
    let (scene, seconds): (Result<Scene, SceneError>, f64) =
        watched(watcher, Duration::MAX, |cancel| {
            let context = Context { cancel: cancel.clone(), progress: None };
            crew.install(|| {
                let watch = Stopwatch::start(crew.clock());
                let mesh = Mesh::new(triangles.positions.clone(), triangles.indices.clone());
                let quality = Quality::for_rays(count);
                let options = BuildOptions { quality, pilot, context, ..Default::default() };
                let scene = Scene::builder().mesh(mesh).build(&options);
                (scene, watch.elapsed().as_secs_f64())
            })
        });
    stop(watcher)?;
    let scene = scene.map_err(|error| refused(bench, "for_rays", &error))?;
    Ok(Made { seconds, scene })
}

/// treelet could not build.
pub(super) fn refused(bench: &Bench<'_>, variant: &str, error: &SceneError) -> BenchError {
    let error = EngineError::Refused(error.to_string());
    engine_error(bench.subject, ours::NAME, variant, error)
}

/// Rays a second through what was chosen: as measured in turn with all others, or else now.
fn rate(
    bench: &Bench<'_>,
    kind: Kind,
    rays: &[Ray],
    points: &[Point],
    variant: &str,
    scene: Scene,
) -> Result<f64, BenchError> {
    if let Some(point) = points.iter().find(|point| point.variant == variant) {
        return Ok(1e6 * point.mrays_per_s);
    }
    let built = ours::built(scene, &bench.subject.triangles);
    let cells = bench.speeds(kind, rays, &[contender(&Treelet, variant, built)])?;
    Ok(cells.first().map_or(f64::NAN, |cell| 1e6 * cell.mrays_per_s))
}
