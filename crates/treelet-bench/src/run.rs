//! One scene through every engine: build, check, trace in turn.

use treelet::Ray;
use treelet::verify::BruteForce;

use crate::check;
use crate::crew::{Clock, Crew, CrewError, Stopwatch};
use crate::engine::{Answer, Built, Call, Engine, EngineError, Threading, Triangles};
use crate::rays::{self, Kind, RaySource};
use crate::report::{Build, Order, SceneLine, Trace};
use crate::rivals::treelet as ours;
use crate::rounds::{Rounds, Work, measure};
use crate::scenes;
use crate::stats::{median, spread};

/// What is measured.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Which rays.
    pub kinds: Vec<Kind>,
    /// In which orders.
    pub orders: Vec<Order>,
    /// How long slices are; longer ones hold all the rays.
    pub slices: Vec<usize>,
    /// With how many threads, one after the other.
    pub threads: Vec<usize>,
    /// How many rays of each kind.
    pub rays: usize,
    /// How often and how long.
    pub rounds: Rounds,
    /// The clock.
    pub clock: Clock,
    /// treelet's variants; all of them if there is none.
    pub builders: Vec<String>,
    /// The rivals' variants; each rival's usual ones if there is none.
    pub variants: Vec<String>,
}

/// Something to measure.
#[derive(Clone, Debug)]
pub struct Subject {
    /// As the report names it.
    pub name: String,
    /// Whether the bench made it.
    pub generated: bool,
    /// Its triangles.
    pub triangles: Triangles,
    /// The axis that points up; `None` guesses.
    pub up: Option<usize>,
}

/// What one scene gave.
#[derive(Clone, Debug)]
pub struct SceneResult {
    /// The scene.
    pub scene: SceneLine,
    /// Its builds.
    pub builds: Vec<Build>,
    /// Its traces.
    pub traces: Vec<Trace>,
}

/// Why a bench ends without a result.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// No threads.
    #[error(transparent)]
    Crew(#[from] CrewError),
    /// An engine that was there does not build.
    #[error("{engine} {variant} on {scene}: {error}")]
    Engine {
        /// Its name.
        engine: String,
        /// What it was to build.
        variant: String,
        /// Of what.
        scene: String,
        /// What it says.
        error: EngineError,
    },
    /// treelet is wrong: what it is fast at does not matter then.
    #[error("{scene}, {kind} rays: treelet is not what brute force says: {mismatch}")]
    BruteForce {
        /// The scene.
        scene: String,
        /// The kind of rays.
        kind: &'static str,
        /// The first difference.
        mismatch: Box<treelet::verify::Mismatch>,
    },
    /// treelet is not the same everywhere.
    #[error(
        "{scene}, {kind} rays: treelet {variant} answers ray {ray} with other bits than {reference}"
    )]
    Bits {
        /// The scene.
        scene: String,
        /// The kind of rays.
        kind: &'static str,
        /// What was asked.
        variant: String,
        /// What it was compared with.
        reference: String,
        /// The first ray that differs.
        ray: usize,
    },
    /// A variant that no engine has.
    #[error("no engine here has a variant `{name}`; there are: {known}")]
    NoVariant {
        /// As asked for.
        name: String,
        /// What there is.
        known: String,
    },
    /// Somebody pressed Ctrl-C.
    #[error("cancelled")]
    Cancelled,
}

/// Whom a bench tells what it does, and who may stop it.
pub trait Watcher: Sync {
    /// A step begins.
    fn step(&self, what: &str);
    /// Whether to stop.
    fn stopped(&self) -> bool;
}

/// Seconds of building after which a variant has been built often enough, from the third build on.
const BUILD_SECONDS: f64 = 12.0;
/// Builds of a variant before that counts.
const BUILDS_LEAST: usize = 3;

/// A built variant, and whose it is.
struct Contender {
    engine: String,
    variant: String,
    calls: Vec<Call>,
    built: Box<dyn Built>,
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
    check_variants(engines, plan)?;

    // What treelet sees is what all the rays are made of.
    watcher.step("checking");
    let reference = ours::scene(ours::default_variant(), &subject.triangles)
        .map_err(|error| engine_error(subject, ours::NAME, ours::default_variant(), error))?;
    let up = subject.up.unwrap_or_else(|| rays::guess_up(&scenes::bounds(&subject.triangles)));
    let source = RaySource::new(&reference, &subject.triangles, up, plan.rays);
    let mut scene = SceneLine {
        scene: subject.name.clone(),
        generated: subject.generated,
        triangles: subject.triangles.len() as u64,
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
    drop(brute);
    drop(reference);

    let mut result = SceneResult { scene, builds: Vec::new(), traces: Vec::new() };
    for &threads in &plan.threads {
        let crew = Crew::new(threads, plan.clock)?;
        let contenders = build(subject, engines, plan, &crew, watcher, &mut result.builds)?;
        for &kind in &plan.kinds {
            for &order in &plan.orders {
                let mut rays = source.rays(kind);
                if order == Order::Shuffled {
                    rays::shuffle(&mut rays);
                }
                stop(watcher)?;
                watcher.step(&format!("{} rays, {}, {threads} threads", kind.name(), order.name()));
                let group = Group { subject, plan, crew: &crew, kind, order, rays: &rays };
                result.traces.extend(group.trace(&contenders, watcher)?);
            }
        }
    }
    Ok(result)
}

fn stop(watcher: &dyn Watcher) -> Result<(), BenchError> {
    if watcher.stopped() { Err(BenchError::Cancelled) } else { Ok(()) }
}

fn engine_error(subject: &Subject, engine: &str, variant: &str, error: EngineError) -> BenchError {
    BenchError::Engine {
        engine: engine.to_owned(),
        variant: variant.to_owned(),
        scene: subject.name.clone(),
        error,
    }
}

/// Which of an engine's variants are measured.
fn chosen(engine: &dyn Engine, plan: &Plan) -> Vec<String> {
    let asked = if engine.name() == ours::NAME { &plan.builders } else { &plan.variants };
    if asked.is_empty() {
        return engine.usual_variants();
    }
    let is_asked = |variant: &String| asked.iter().any(|name| name.eq_ignore_ascii_case(variant));
    engine.variants().into_iter().filter(is_asked).collect()
}

/// Every variant that was asked for must be one that some engine has.
fn check_variants(engines: &[Box<dyn Engine>], plan: &Plan) -> Result<(), BenchError> {
    for (ours_or_theirs, asked) in [(true, &plan.builders), (false, &plan.variants)] {
        let known = || {
            let side = engines.iter().filter(|e| (e.name() == ours::NAME) == ours_or_theirs);
            side.flat_map(|engine| engine.variants())
        };
        for name in asked {
            // Without rivals there is nothing to choose from, and nothing to complain about.
            if known().next().is_some() && !known().any(|it| it.eq_ignore_ascii_case(name)) {
                let known = known().collect::<Vec<_>>().join(", ");
                return Err(BenchError::NoVariant { name: name.clone(), known });
            }
        }
    }
    Ok(())
}

/// Builds every variant several times, in turn; keeps the last of each.
fn build(
    subject: &Subject,
    engines: &mut [Box<dyn Engine>],
    plan: &Plan,
    crew: &Crew,
    watcher: &dyn Watcher,
    builds: &mut Vec<Build>,
) -> Result<Vec<Contender>, BenchError> {
    let threads = crew.threads();
    for engine in engines.iter_mut() {
        let name = engine.name();
        let prepared = crew.at_large(|| engine.prepare(threads));
        prepared.map_err(|error| engine_error(subject, name, "", error))?;
    }
    let entries: Vec<(&dyn Engine, String)> = engines
        .iter()
        .map(|engine| &**engine)
        .flat_map(|engine| chosen(engine, plan).into_iter().map(move |variant| (engine, variant)))
        .collect();

    // In turn, the start moving on, as for rays.
    let mut last: Vec<Option<Box<dyn Built>>> = entries.iter().map(|_| None).collect();
    let mut seconds: Vec<Vec<f64>> = vec![Vec::new(); entries.len()];
    for round in 0..plan.rounds.count.max(1) {
        for place in 0..entries.len() {
            let index = (place + round) % entries.len();
            let (engine, variant) = &entries[index];
            let done = &mut seconds[index];
            if done.len() >= BUILDS_LEAST && done.iter().sum::<f64>() > BUILD_SECONDS {
                continue;
            }
            stop(watcher)?;
            watcher.step(&format!("building {} {variant}, {threads} threads", engine.name()));
            // The old one goes first, so that two never stand side by side.
            last[index] = None;
            let (built, time) = timed_build(*engine, variant, &subject.triangles, crew);
            let built = built.map_err(|e| engine_error(subject, engine.name(), variant, e))?;
            last[index] = Some(built);
            done.push(time);
        }
    }

    // Tell what came out.
    let triangles = subject.triangles.len() as f64;
    let mut contenders = Vec::new();
    for (((engine, variant), built), seconds) in entries.into_iter().zip(last).zip(seconds) {
        let Some(built) = built else { continue };
        let bytes = built.bytes();
        builds.push(Build {
            scene: subject.name.clone(),
            engine: engine.name().to_owned(),
            variant: variant.clone(),
            threads,
            triangles: subject.triangles.len() as u64,
            mtris_per_s: triangles / median(&seconds) * 1e-6,
            bytes_per_tri: bytes.total() as f64 / triangles,
            peak_bytes_per_tri: None,
            shared_bytes_per_tri: bytes.shared as f64 / triangles,
            seconds,
        });
        let mut calls = built.calls();
        if plan.variants.is_empty() {
            calls.retain(|&call| engine.is_usual(&variant, call));
        }
        let engine = engine.name().to_owned();
        contenders.push(Contender { engine, variant, calls, built });
    }
    Ok(contenders)
}

/// Builds once, on the threads that the engine wants.
fn timed_build(
    engine: &dyn Engine,
    variant: &str,
    triangles: &Triangles,
    crew: &Crew,
) -> (Result<Box<dyn Built>, EngineError>, f64) {
    let work = || {
        let watch = Stopwatch::start(crew.clock());
        let built = engine.build(variant, triangles);
        (built, watch.elapsed().as_secs_f64())
    };
    match engine.threading() {
        Threading::Callers => crew.install(work),
        Threading::Own => crew.at_large(work),
    }
}

/// Rays of one kind in one order, for all contenders.
struct Group<'a> {
    subject: &'a Subject,
    plan: &'a Plan,
    crew: &'a Crew,
    kind: Kind,
    order: Order,
    rays: &'a [Ray],
}

/// A contender, a way to hand it the rays, and the rays handed.
struct Cell<'a> {
    contender: &'a Contender,
    call: Call,
    width: usize,
    work: Work<'a>,
}

impl Group<'_> {
    /// Checks every answer, then measures all in turn.
    fn trace(
        &self,
        contenders: &[Contender],
        watcher: &dyn Watcher,
    ) -> Result<Vec<Trace>, BenchError> {
        let cells = self.cells(contenders);
        if self.rays.is_empty() {
            return Ok(Vec::new());
        }

        // The first of treelet's cells is what all others are compared with.
        let mut reference: Option<(String, Vec<Answer>)> = None;
        let mut differences = Vec::new();
        for cell in &cells {
            cell.work.trace(self.crew, 1);
            let answers = cell.work.answers();
            let label = format!("{} /{}", cell.contender.variant, cell.width);
            let (first, expected) =
                reference.get_or_insert_with(|| (label.clone(), answers.clone()));
            if cell.contender.engine == ours::NAME
                && let Some(ray) = check::first_bit_difference(expected, &answers)
            {
                return Err(BenchError::Bits {
                    scene: self.subject.name.clone(),
                    kind: self.kind.name(),
                    variant: label,
                    reference: first.clone(),
                    ray,
                });
            }
            differences.push(check::compare(expected, &answers));
        }

        let (cells, works): (Vec<_>, Vec<_>) = cells
            .into_iter()
            .map(|cell| ((cell.contender, cell.call, cell.width), cell.work))
            .unzip();
        let stopped = || watcher.stopped();
        let seconds = measure(self.crew, &works, self.plan.rounds, &stopped);
        stop(watcher)?;
        let rays = self.rays.len() as f64;
        let lines = cells.into_iter().zip(differences).zip(seconds);
        Ok(lines
            .map(|(((contender, call, width), difference), seconds)| Trace {
                scene: self.subject.name.clone(),
                engine: contender.engine.clone(),
                variant: contender.variant.clone(),
                kind: self.kind,
                api: call.api,
                width,
                threads: self.crew.threads(),
                rays: self.rays.len() as u64,
                mrays_per_s: rays / median(&seconds) * 1e-6,
                spread: spread(&seconds),
                mismatch_ppm: difference.mismatch_ppm,
                ids_ppm: match self.kind.question() {
                    crate::engine::Question::Closest => Some(difference.ids_ppm),
                    crate::engine::Question::Any => None,
                },
                order: self.order,
                coherent: call.coherent,
                seconds,
            })
            .collect())
    }

    /// Every contender in every way that suits these rays.
    fn cells<'a>(&'a self, contenders: &'a [Contender]) -> Vec<Cell<'a>> {
        let mut cells = Vec::new();
        let question = self.kind.question();
        for contender in contenders {
            for &call in &contender.calls {
                // The hint is for rays that are what it says. On kitchen_bitterli it made Embree's
                // packets of 16 2.6 times as fast for primary rays and 1.05 for shadow rays, but
                // 0.70 for occlusion, 0.55 for diffuse and 0.33 for random ones.
                let coherent = matches!(self.kind, Kind::Primary | Kind::Shadow);
                if call.coherent && !(coherent && self.order == Order::Given) {
                    continue;
                }
                let widths = if call.width == Call::SLICE {
                    let mut widths: Vec<_> =
                        self.plan.slices.iter().map(|&slice| slice.min(self.rays.len())).collect();
                    widths.dedup();
                    widths
                } else {
                    vec![call.width]
                };
                for width in widths {
                    let work = Work::new(&*contender.built, call, question, self.rays, width);
                    cells.push(Cell { contender, call, width, work });
                }
            }
        }
        cells
    }
}
