//! Building every variant, timed, in turn.

use super::{BenchError, Plan, Subject, Watcher, engine_error, stop};
use crate::crew::{Crew, Stopwatch};
use crate::engine::{Built, Call, Engine, EngineError, NO_INSTANCES, Threading};
use crate::report::{Build, Missing};
use crate::rounds::turns;
use crate::stats::median;

/// Seconds of building after which a variant has been built often enough, from the third build on.
const BUILD_SECONDS: f64 = 12.0;
/// Builds of a variant before that counts.
const BUILDS_LEAST: usize = 3;

/// A built variant, and whose it is.
pub(crate) struct Contender {
    pub(crate) engine: String,
    pub(crate) variant: String,
    pub(crate) calls: Vec<Call>,
    pub(crate) built: Box<dyn Built>,
}

/// What building gave.
#[derive(Default)]
pub(super) struct Builds {
    /// The last tree of each variant.
    pub(super) contenders: Vec<Contender>,
    /// How fast and how large.
    pub(super) lines: Vec<Build>,
    /// Engines that do not work on that many threads.
    pub(super) left_out: Vec<Missing>,
}

/// A variant that is being built.
struct Entry<'a> {
    engine: &'a dyn Engine,
    variant: String,
    /// What the last build gave.
    built: Option<Box<dyn Built>>,
    /// How long each took.
    seconds: Vec<f64>,
}

/// Builds every variant several times, in turn; keeps the last of each.
pub(super) fn build(
    subject: &Subject,
    engines: &mut [Box<dyn Engine>],
    plan: &Plan,
    crew: &Crew,
    watcher: &dyn Watcher,
) -> Result<Builds, BenchError> {
    let mut builds = Builds::default();
    let mut entries: Vec<Entry<'_>> = Vec::new();
    for engine in engines {
        if subject.placed.is_some() && !engine.has_instances() {
            let (name, reason) = (engine.name().to_owned(), NO_INSTANCES.to_owned());
            builds.left_out.push(Missing { name, reason });
            continue;
        }
        match crew.at_large(|| engine.prepare(crew.threads())) {
            Ok(()) => {}
            Err(EngineError::Missing(reason)) => {
                builds.left_out.push(Missing { name: engine.name().to_owned(), reason });
                continue;
            }
            Err(error) => return Err(engine_error(subject, engine.name(), "", error)),
        }
        let engine = &**engine;
        let entry = |variant| Entry { engine, variant, built: None, seconds: Vec::new() };
        entries.extend(plan.variants_of(engine).into_iter().map(entry));
    }

    for round in 0..plan.rounds.count.max(1) {
        for index in turns(round, entries.len()) {
            stop(watcher)?;
            entries[index].build_again(subject, crew, watcher)?;
        }
    }

    for entry in entries {
        let Some(built) = entry.built else { continue };
        let Entry { engine, variant, seconds, .. } = entry;
        builds.lines.push(line(subject, engine, &variant, crew.threads(), &*built, seconds));
        let mut calls = built.calls();
        calls.retain(|&call| plan.takes(engine, &variant, call));
        let engine = engine.name().to_owned();
        builds.contenders.push(Contender { engine, variant, calls, built });
    }
    Ok(builds)
}

impl Entry<'_> {
    /// Builds once more, unless that was done often enough.
    fn build_again(
        &mut self,
        subject: &Subject,
        crew: &Crew,
        watcher: &dyn Watcher,
    ) -> Result<(), BenchError> {
        let spent: f64 = self.seconds.iter().sum();
        if self.seconds.len() >= BUILDS_LEAST && spent > BUILD_SECONDS {
            return Ok(());
        }
        let (engine, variant) = (self.engine, &self.variant);
        let threads = crew.threads();
        watcher.step(&format!("building {} {variant}, {threads} threads", engine.name()));
        // The old one goes first, so that two never stand side by side.
        self.built = None;
        let (built, time) = timed_build(engine, variant, subject, crew);
        let built = built.map_err(|e| engine_error(subject, engine.name(), variant, e))?;
        self.built = Some(built);
        self.seconds.push(time);
        Ok(())
    }
}

/// What is told about a variant.
fn line(
    subject: &Subject,
    engine: &dyn Engine,
    variant: &str,
    threads: usize,
    built: &dyn Built,
    seconds: Vec<f64>,
) -> Build {
    let triangles = subject.stored() as f64;
    let bytes = built.bytes();
    Build {
        scene: subject.name.clone(),
        engine: engine.name().to_owned(),
        variant: variant.to_owned(),
        threads,
        triangles: subject.stored() as u64,
        mtris_per_s: triangles / median(&seconds) * 1e-6,
        bytes_per_tri: bytes.total() as f64 / triangles,
        peak_bytes_per_tri: None,
        shared_bytes_per_tri: bytes.shared as f64 / triangles,
        seconds,
    }
}

/// Builds once, on the threads that the engine wants.
pub(crate) fn timed_build(
    engine: &dyn Engine,
    variant: &str,
    subject: &Subject,
    crew: &Crew,
) -> (Result<Box<dyn Built>, EngineError>, f64) {
    let work = || {
        let watch = Stopwatch::start(crew.clock());
        let built = subject.build(engine, variant);
        (built, watch.elapsed().as_secs_f64())
    };
    match engine.threading() {
        Threading::Callers => crew.install(work),
        Threading::Own => crew.at_large(work),
    }
}
