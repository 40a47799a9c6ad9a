//! One scene, measured: every variant built, every kind of rays through all of them in turn, what the
//! library chooses. Pieces that an earlier run finished are taken from its file.

use treelet::Ray;

use super::builds::{self, Outcome};
use super::choices;
use super::data::{Choice, Point};
use super::plan::FigurePlan;
use super::state::{BuildPiece, Cell, Piece, SceneKey, State, TracePiece};
use crate::crew::Crew;
use crate::engine::{Call, Engine, EngineError};
use crate::rays::{Kind, RaySource};
use crate::report::{Missing, Order};
use crate::rivals::treelet as ours;
use crate::run::builds::Contender;
use crate::run::traces::Group;
use crate::run::{self, BenchError, Subject, Watcher, stop};
use crate::stats::median;

/// What one scene gave.
#[derive(Clone, Debug, Default)]
pub struct SceneFigure {
    /// Its points.
    pub points: Vec<Point>,
    /// The library's choices for so many rays.
    pub choices: Vec<Choice>,
    /// What it did for an unknown number.
    pub auto: Vec<Choice>,
    /// Variants without points, and why.
    pub left_out: Vec<Missing>,
}

/// A scene on some number of threads.
pub(super) struct Bench<'a> {
    pub(super) subject: &'a Subject,
    pub(super) plan: &'a FigurePlan,
    pub(super) crew: &'a Crew,
    pub(super) watcher: &'a dyn Watcher,
}

/// Measures one scene. `engines` begins with treelet.
///
/// # Errors
///
/// treelet's answers are wrong, the file of pieces cannot be written, too few processors, or it was
/// stopped.
pub fn scene(
    subject: &Subject,
    engines: &mut [Box<dyn Engine>],
    plan: &FigurePlan,
    state: &mut State,
    watcher: &dyn Watcher,
) -> Result<SceneFigure, BenchError> {
    plan.base.check_variants(engines)?;
    state.begin(SceneKey::of(&subject.name, &subject.triangles))?;
    let mut figure = SceneFigure::default();
    let mut source: Option<RaySource> = None;
    for &threads in &plan.base.threads {
        let crew = Crew::new(threads, plan.base.clock)?;
        let bench = Bench { subject, plan, crew: &crew, watcher };
        let mut contenders = bench.build(engines, state, &mut figure)?;
        for &kind in &plan.base.kinds {
            if bench.is_finished(kind, state) {
                continue;
            }
            // The rays are made when they are needed, and treelet is held against brute force first.
            if source.is_none() {
                watcher.step(&format!("{}: checking", subject.name));
                source = Some(run::checked(subject, &plan.base, watcher)?.0);
            }
            let Some(source) = &source else { continue };
            let (rays, pilot) = plan.parted(&source.rays(kind));
            if rays.is_empty() {
                let reason = format!("{}: the camera sees nothing", subject.name);
                let name = format!("{} rays", kind.name());
                figure.left_out.push(Missing { name, reason });
                continue;
            }
            bench.trace(kind, &rays, engines, &mut contenders, state)?;
            choices::add(&bench, kind, &rays, &pilot, state)?;
        }
        bench.gather(engines, state, &mut figure);
    }
    Ok(figure)
}

impl Bench<'_> {
    /// Whether a kind of rays has been traced and chosen for.
    fn is_finished(&self, kind: Kind, state: &State) -> bool {
        let (scene, threads) = (&self.subject.name, self.crew.threads());
        state.traces(scene, threads, kind.name()).is_some()
            && state.choices(scene, threads, kind.name()).is_some()
    }

    /// Builds every variant that is not finished yet; those that stand.
    fn build(
        &self,
        engines: &mut [Box<dyn Engine>],
        state: &mut State,
        figure: &mut SceneFigure,
    ) -> Result<Vec<Contender>, BenchError> {
        let (scene, threads) = (&self.subject.name, self.crew.threads());
        let mut contenders = Vec::new();
        for engine in engines {
            match self.crew.at_large(|| engine.prepare(threads)) {
                Ok(()) => {}
                Err(EngineError::Missing(reason) | EngineError::Refused(reason)) => {
                    figure.left_out.push(Missing { name: engine.name().to_owned(), reason });
                    continue;
                }
            }
            for variant in self.plan.variants_of(&**engine) {
                if state.build(scene, threads, engine.name(), &variant).is_none() {
                    contenders.extend(self.build_one(&**engine, &variant, state)?);
                }
            }
        }
        Ok(contenders)
    }

    /// Builds one variant and notes it.
    fn build_one(
        &self,
        engine: &dyn Engine,
        variant: &str,
        state: &mut State,
    ) -> Result<Option<Contender>, BenchError> {
        let Self { subject, plan, crew, watcher } = *self;
        let mut piece = BuildPiece {
            scene: subject.name.clone(),
            threads: crew.threads(),
            engine: engine.name().to_owned(),
            variant: variant.to_owned(),
            seconds: Vec::new(),
            measures: builds::Measures::default(),
            left_out: None,
        };
        let contender = match builds::make(subject, engine, variant, plan, crew, watcher)? {
            Outcome::Made(made) => {
                piece.seconds = made.seconds;
                piece.measures = made.measures;
                Some(contender(engine, variant, made.built))
            }
            Outcome::LeftOut(reason) => {
                piece.left_out = Some(reason);
                None
            }
        };
        state.add(Piece::Build(piece))?;
        Ok(contender)
    }

    /// Sends rays through everything that stands, each in turn, unless that was done.
    fn trace(
        &self,
        kind: Kind,
        rays: &[Ray],
        engines: &[Box<dyn Engine>],
        contenders: &mut Vec<Contender>,
        state: &mut State,
    ) -> Result<(), BenchError> {
        let (scene, threads) = (&self.subject.name, self.crew.threads());
        if state.traces(scene, threads, kind.name()).is_some() {
            return Ok(());
        }
        // Build again what an earlier run has built and only measured.
        for engine in engines {
            for variant in self.plan.variants_of(&**engine) {
                let done = state.build(scene, threads, engine.name(), &variant);
                let stands = |it: &Contender| it.engine == engine.name() && it.variant == variant;
                if done.is_some_and(|it| it.left_out.is_none()) && !contenders.iter().any(stands) {
                    let built =
                        builds::again(self.subject, &**engine, &variant, self.crew, self.watcher)?;
                    contenders.push(contender(&**engine, &variant, built));
                }
            }
        }
        self.watcher.step(&format!("{scene}: {} rays, {threads} threads", kind.name()));
        let cells = self.speeds(kind, rays, contenders)?;
        let kind = kind.name().to_owned();
        state.add(Piece::Traces(TracePiece { scene: scene.clone(), threads, kind, cells }))?;
        Ok(())
    }

    /// How fast rays go through each contender: answers checked, then timed in turn.
    pub(super) fn speeds(
        &self,
        kind: Kind,
        rays: &[Ray],
        contenders: &[Contender],
    ) -> Result<Vec<Cell>, BenchError> {
        let Self { subject, plan, crew, watcher } = *self;
        stop(watcher)?;
        let group = Group { subject, plan: &plan.base, crew, kind, order: Order::Given, rays };
        let traces = group.trace(contenders, watcher)?;
        let cell = |trace: crate::report::Trace| Cell {
            engine: trace.engine,
            variant: trace.variant,
            mrays_per_s: trace.mrays_per_s,
            mismatch_ppm: trace.mismatch_ppm,
        };
        Ok(traces.into_iter().map(cell).collect())
    }

    /// The points of a kind, in the order in which they were traced.
    pub(super) fn points(&self, kind: Kind, state: &State) -> Vec<Point> {
        let (scene, threads) = (&self.subject.name, self.crew.threads());
        let Some(traces) = state.traces(scene, threads, kind.name()) else { return Vec::new() };
        let mut points = Vec::new();
        for cell in &traces.cells {
            let build = state.build(scene, threads, &cell.engine, &cell.variant);
            let Some(build) = build.filter(|build| !build.seconds.is_empty()) else { continue };
            points.push(Point {
                scene: scene.clone(),
                engine: cell.engine.clone(),
                variant: cell.variant.clone(),
                kind: kind.name().to_owned(),
                threads,
                build_s: median(&build.seconds),
                mrays_per_s: cell.mrays_per_s,
                sah: build.measures.sah,
                epo: build.measures.epo,
                lcv: build.measures.lcv,
                triangles: Some(self.subject.triangles.len() as u64),
                mismatch_ppm: Some(cell.mismatch_ppm),
            });
        }
        points
    }

    /// Puts all pieces of this scene and these threads into the figure.
    fn gather(&self, engines: &[Box<dyn Engine>], state: &State, figure: &mut SceneFigure) {
        let (scene, threads) = (&self.subject.name, self.crew.threads());
        for &kind in &self.plan.base.kinds {
            figure.points.extend(self.points(kind, state));
            if let Some(piece) = state.choices(scene, threads, kind.name()) {
                figure.choices.extend(piece.choices.iter().cloned());
                figure.auto.extend(piece.auto.iter().cloned());
            }
        }
        for engine in engines {
            for variant in self.plan.variants_of(&**engine) {
                let build = state.build(scene, threads, engine.name(), &variant);
                if let Some(reason) = build.and_then(|build| build.left_out.as_ref()) {
                    let name = format!("{} {variant}", engine.name());
                    let reason = format!("{scene}, {threads} threads: {reason}");
                    figure.left_out.push(Missing { name, reason });
                }
            }
        }
    }
}

/// Something built, asked one ray a call.
pub(super) fn contender(
    engine: &dyn Engine,
    variant: &str,
    built: Box<dyn crate::engine::Built>,
) -> Contender {
    let (engine, variant) = (engine.name().to_owned(), variant.to_owned());
    Contender { engine, variant, calls: vec![Call::ONE], built }
}

/// Whether a point is one of treelet's.
pub(super) fn is_ours(point: &Point) -> bool {
    point.engine == ours::NAME
}
