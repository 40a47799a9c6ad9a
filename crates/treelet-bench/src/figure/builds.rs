//! Building one variant, timed, and what its tree is worth.

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use treelet::build::{BuildError, Info};
use treelet::optimize::Optimizer;
use treelet::tree::{SahConstants, Tree, lines};
use treelet::{Cancel, Context, Mesh};

use super::plan::FigurePlan;
use super::watch::watched;
use crate::crew::{Crew, Stopwatch};
use crate::engine::{Built, Engine, EngineError};
use crate::rivals::treelet as ours;
use crate::run::builds::timed_build;
use crate::run::{BenchError, Subject, Watcher, stop};

/// A build that takes longer than this is left out.
pub(super) const LIMIT: Duration = Duration::from_secs(120);

/// How often to build.
struct Often {
    /// Builds at least, but for slow ones.
    least: usize,
    /// Builds at most.
    most: usize,
    /// Seconds of building after which no more than `least` follow.
    enough: f64,
    /// A build of more seconds than that is the only one.
    slow: f64,
}

const THOROUGH: Often = Often { least: 3, most: 7, enough: 3.0, slow: 4.0 };
const QUICK: Often = Often { least: 2, most: 3, enough: 0.3, slow: 0.8 };

/// Points from which end-point overlap is measured: good to about half a percent, quickly to two.
const POINTS: u32 = 1 << 18;
const POINTS_QUICK: u32 = 1 << 14;

/// Lines that leaf count variability is measured with in a quick run.
const LINES_QUICK: u32 = 1 << 13;

/// What a tree is worth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Measures {
    pub(super) sah: Option<f64>,
    pub(super) epo: Option<f64>,
    pub(super) lcv: Option<f64>,
}

/// A variant that stands.
pub(super) struct Made {
    pub(super) built: Box<dyn Built>,
    /// Of each build.
    pub(super) seconds: Vec<f64>,
    pub(super) measures: Measures,
}

/// What came of a variant.
pub(super) enum Outcome {
    Made(Made),
    /// Why there is nothing.
    LeftOut(String),
}

/// Builds a variant as often as the plan says and measures its tree.
pub(super) fn make(
    subject: &Subject,
    engine: &dyn Engine,
    variant: &str,
    plan: &FigurePlan,
    crew: &Crew,
    watcher: &dyn Watcher,
) -> Result<Outcome, BenchError> {
    let often = if plan.quick { QUICK } else { THOROUGH };
    let keep = Keep::new(crew);
    let (mut seconds, mut last) = (Vec::new(), None);
    while often.again(&seconds) {
        stop(watcher)?;
        let (name, threads) = (engine.name(), crew.threads());
        let number = seconds.len() + 1;
        watcher.step(&format!(
            "{}: building {name} {variant}, {threads} threads, build {number}",
            subject.name
        ));
        // The old one goes first, so that two never stand side by side. Only the first copies its tree.
        drop(last.take());
        let kept = (number == 1).then_some(&keep);
        let (built, taken) = once(subject, engine, variant, kept, crew, watcher);
        match built {
            Ok(built) if taken <= LIMIT.as_secs_f64() => last = Some(built),
            Err(_) if watcher.stopped() => return Err(BenchError::Cancelled),
            Err(error) if taken <= LIMIT.as_secs_f64() => {
                return Ok(Outcome::LeftOut(error.to_string()));
            }
            _ => return Ok(Outcome::LeftOut(format!("builds longer than {} s", LIMIT.as_secs()))),
        }
        seconds.push(taken);
    }
    let Some(built) = last else { return Ok(Outcome::LeftOut("builds nothing".into())) };
    let measures = match keep.take() {
        Some(tree) => {
            watcher.step(&format!("{}: measuring the tree of {variant}", subject.name));
            measure(&tree, subject, plan, watcher)?
        }
        None => Measures::default(),
    };
    Ok(Outcome::Made(Made { built, seconds, measures }))
}

/// Builds a variant whose times are known, to trace it.
pub(super) fn again(
    subject: &Subject,
    engine: &dyn Engine,
    variant: &str,
    crew: &Crew,
    watcher: &dyn Watcher,
) -> Result<Box<dyn Built>, BenchError> {
    stop(watcher)?;
    watcher.step(&format!("{}: building {} {variant} again", subject.name, engine.name()));
    let (built, _) = once(subject, engine, variant, None, crew, watcher);
    if watcher.stopped() {
        return Err(BenchError::Cancelled);
    }
    built.map_err(|error| crate::run::engine_error(subject, engine.name(), variant, error))
}

type Once = (Result<Box<dyn Built>, EngineError>, f64);

/// Builds once; treelet can be stopped while it does.
fn once(
    subject: &Subject,
    engine: &dyn Engine,
    variant: &str,
    keep: Option<&Keep<'_>>,
    crew: &Crew,
    watcher: &dyn Watcher,
) -> Once {
    let triangles = &subject.triangles;
    if engine.name() != ours::NAME {
        return timed_build(engine, variant, subject, crew);
    }
    let last: Vec<&dyn Optimizer> = keep.iter().map(|keep| *keep as &dyn Optimizer).collect();
    let (scene, taken) = watched(watcher, LIMIT, |cancel| {
        let context = Context { cancel: cancel.clone(), progress: None };
        crew.install(|| {
            let watch = Stopwatch::start(crew.clock());
            let scene = ours::scene_with(variant, triangles, &last, context);
            (scene, watch.elapsed().as_secs_f64())
        })
    });
    let copying = keep.map_or(0.0, Keep::seconds);
    (scene.map(|scene| ours::built(scene, triangles)), taken - copying)
}

/// What a tree is worth, by all measures.
fn measure(
    tree: &Tree,
    subject: &Subject,
    plan: &FigurePlan,
    watcher: &dyn Watcher,
) -> Result<Measures, BenchError> {
    let constants = SahConstants::default();
    let triangles = &subject.triangles;
    let mesh = Mesh::new(triangles.positions.clone(), triangles.indices.clone());
    let (points, lines) =
        if plan.quick { (POINTS_QUICK, LINES_QUICK) } else { (POINTS, lines::LINES) };
    let measured = watched(watcher, Duration::MAX, |cancel: &Cancel| {
        let epo = tree.epo_sampled(&mesh, &constants, points, cancel)?;
        let stats = tree.line_stats(&constants, lines, cancel)?;
        Ok::<_, treelet::Cancelled>((epo.value, stats.lcv))
    });
    let (epo, lcv) = measured.map_err(|_| BenchError::Cancelled)?;
    let finite = |value: f64| value.is_finite().then_some(value);
    Ok(Measures { sah: finite(tree.sah(&constants)), epo: finite(epo), lcv: finite(lcv) })
}

impl Often {
    /// Whether another build follows these.
    fn again(&self, seconds: &[f64]) -> bool {
        if seconds.iter().any(|&each| each > self.slow) {
            return false;
        }
        let enough = seconds.iter().sum::<f64>() > self.enough;
        seconds.len() < if enough { self.least } else { self.most }
    }
}

/// The last of a build's optimisers: changes nothing, keeps a copy of the tree, and notes how long that
/// took.
struct Keep<'a> {
    crew: &'a Crew,
    kept: Mutex<Option<(Tree, f64)>>,
}

impl<'a> Keep<'a> {
    fn new(crew: &'a Crew) -> Self {
        Self { crew, kept: Mutex::new(None) }
    }

    fn take(&self) -> Option<Tree> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.take().map(|(tree, _)| tree)
    }

    /// Seconds that copying took.
    fn seconds(&self) -> f64 {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.as_ref().map_or(0.0, |(_, seconds)| *seconds)
    }
}

impl Optimizer for Keep<'_> {
    fn info(&self) -> Info {
        Info { name: "keep", summary: "changes nothing", source: "the bench" }
    }

    fn optimize(&self, tree: Tree, _: &Context<'_>) -> Result<Tree, BuildError> {
        let watch = Stopwatch::start(self.crew.clock());
        let copy = tree.clone();
        let seconds = watch.elapsed().as_secs_f64();
        *self.kept.lock().unwrap_or_else(PoisonError::into_inner) = Some((copy, seconds));
        Ok(tree)
    }
}
