//! One scene through every engine: build, check, trace in turn.

pub(crate) mod builds;
mod error;
mod plan;
pub(crate) mod traces;

pub use error::BenchError;
pub use plan::{Plan, Subject, Watcher};

use treelet::verify::BruteForce;

use crate::check;
use crate::crew::Crew;
use crate::engine::{Engine, EngineError};
use crate::rays::{self, RaySource};
use crate::report::{Build, Missing, Order, SceneLine, Trace};
use crate::rivals::treelet as ours;
use builds::Contender;
use traces::Group;

/// What one scene gave.
#[derive(Clone, Debug)]
pub struct SceneResult {
    /// The scene.
    pub scene: SceneLine,
    /// Its builds.
    pub builds: Vec<Build>,
    /// Its traces.
    pub traces: Vec<Trace>,
    /// Engines that did not take part with some number of threads, and why.
    pub left_out: Vec<Missing>,
}

/// Measures one scene. `engines` begins with treelet.
///
/// # Errors
///
/// treelet's answers are wrong, an engine refuses, too few processors, or it was stopped.
pub fn scene(
    subject: &Subject,
    engines: &mut [Box<dyn Engine>],
    plan: &Plan,
    watcher: &dyn Watcher,
) -> Result<SceneResult, BenchError> {
    plan.check_variants(engines)?;
    watcher.step("checking");
    let (source, scene) = checked(subject, plan, watcher)?;
    let mut result =
        SceneResult { scene, builds: Vec::new(), traces: Vec::new(), left_out: Vec::new() };
    for &threads in &plan.threads {
        let crew = Crew::new(threads, plan.clock)?;
        let builds = builds::build(subject, engines, plan, &crew, watcher)?;
        result.builds.extend(builds.lines);
        result.left_out.extend(builds.left_out);
        trace(subject, plan, &crew, &source, &builds.contenders, watcher, &mut result.traces)?;
    }
    Ok(result)
}

/// The rays, made of what treelet sees; and that it sees what brute force does.
pub(crate) fn checked(
    subject: &Subject,
    plan: &Plan,
    watcher: &dyn Watcher,
) -> Result<(RaySource, SceneLine), BenchError> {
    let reference = match &subject.placed {
        Some(placed) => ours::placed_scene(ours::default_variant(), placed),
        None => ours::scene(ours::default_variant(), &subject.triangles),
    };
    let reference = reference
        .map_err(|error| engine_error(subject, ours::NAME, ours::default_variant(), error))?;
    let up = subject.up.unwrap_or_else(|| rays::guess_up(&reference.bounds()));
    let source = RaySource::new(&reference, up, plan.rays);
    let mut scene = SceneLine {
        scene: subject.name.clone(),
        generated: subject.generated,
        triangles: subject.stored() as u64,
        instances: reference.instances() as u64,
        camera_from: source.camera.from,
        camera_at: source.camera.at,
        hit_rate: source.hit_rate,
        rays_by_brute_force: 0,
    };
    let brute = BruteForce::new(&reference);
    for &kind in &plan.kinds {
        stop(watcher)?;
        let checked = check::brute_force(&reference, &brute, &source.rays(kind));
        scene.rays_by_brute_force += checked.map_err(|mismatch| BenchError::BruteForce {
            scene: subject.name.clone(),
            kind: kind.name(),
            mismatch,
        })? as u64;
    }
    Ok((source, scene))
}

/// Every kind of ray in every order through what was built.
fn trace(
    subject: &Subject,
    plan: &Plan,
    crew: &Crew,
    source: &RaySource,
    contenders: &[Contender],
    watcher: &dyn Watcher,
    traces: &mut Vec<Trace>,
) -> Result<(), BenchError> {
    for &kind in &plan.kinds {
        for &order in &plan.orders {
            let mut rays = source.rays(kind);
            if order == Order::Shuffled {
                rays::shuffle(&mut rays);
            }
            stop(watcher)?;
            let (kind_name, threads) = (kind.name(), crew.threads());
            watcher.step(&format!("{kind_name} rays, {}, {threads} threads", order.name()));
            let group = Group { subject, plan, crew, kind, order, rays: &rays };
            traces.extend(group.trace(contenders, watcher)?);
        }
    }
    Ok(())
}

pub(crate) fn stop(watcher: &dyn Watcher) -> Result<(), BenchError> {
    if watcher.stopped() { Err(BenchError::Cancelled) } else { Ok(()) }
}

pub(crate) fn engine_error(
    subject: &Subject,
    engine: &str,
    variant: &str,
    error: EngineError,
) -> BenchError {
    BenchError::Engine {
        engine: engine.to_owned(),
        variant: variant.to_owned(),
        scene: subject.name.clone(),
        error,
    }
}
