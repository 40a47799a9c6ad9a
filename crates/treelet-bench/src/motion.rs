//! What motion costs: the same scene moving and standing still, the same engine; and what temporal splits save.
//!
//! Every vertex moves along a straight line of its own, from where it is at time 0 to a random place within some
//! part of the scene's diagonal. The rays are those of the scene that stands, at random times, one a call on one
//! thread. Each round traces each kind of rays through everything in turn; ratios are medians of rounds.

use serde::Serialize;
use treelet::memory::Array;
use treelet::verify::Random;
use treelet::{Affine, BuildOptions, Counters, Mesh, Ray, Scene};

use crate::crew::{Clock, Stopwatch};
use crate::engine::{Answer, Built, Call, Engine, EngineError, Question, Triangles};
use crate::rays::{Kind, RaySource};
use crate::rivals::{embree, treelet as own};
use crate::run::Subject;
use crate::scenes;
use crate::stats::median;

/// How much is measured.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Kinds of rays.
    pub kinds: Vec<Kind>,
    /// Rays of each.
    pub rays: usize,
    /// Rounds in which everything takes its turn.
    pub rounds: usize,
    /// What they are timed with.
    pub clock: Clock,
}

/// A scene's result.
#[derive(Clone, Debug, Serialize)]
pub struct Moved {
    /// The scene.
    pub scene: String,
    /// One for each engine and kind.
    pub rows: Vec<Row>,
}

/// One engine, one kind of rays.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The engine.
    pub engine: String,
    /// What it built.
    pub variant: String,
    /// The rays.
    pub kind: &'static str,
    /// Million rays a second, standing still.
    pub still: f64,
    /// The same, moving.
    pub moving: f64,
    /// Speed moving over speed standing still: the median of the rounds.
    pub ratio: f64,
    /// Rays that this engine answers otherwise than the first does when all moves, of a million: other primitives, or none.
    pub mismatch_ppm: f64,
}

/// What the propeller showed.
#[derive(Clone, Debug, Serialize)]
pub struct Propeller {
    /// Triangles, and time steps.
    pub triangles: usize,
    /// Time steps of a turn.
    pub steps: usize,
    /// Segments of time with temporal splits.
    pub segments: usize,
    /// Million rays a second, with temporal splits and without.
    pub with: f64,
    /// The same without.
    pub without: f64,
    /// Speed with over without: the median of the rounds.
    pub ratio: f64,
    /// Nodes entered and triangles tested a ray, with and without.
    pub work: [[f64; 2]; 2],
    /// Bytes that queries read, with and without.
    pub bytes: [u64; 2],
    /// Seconds to build, with and without.
    pub build: [f64; 2],
}

/// Which variants are measured: what users get, and the rival's best.
fn variants(engine: &dyn Engine) -> Vec<String> {
    match engine.name() {
        own::NAME => vec![own::default_variant().to_owned(), "best".to_owned()],
        embree::NAME => vec!["MEDIUM".to_owned(), "HIGH".to_owned()],
        _ => Vec::new(),
    }
}

/// An engine's name, its variant, and what it built: the scene that stands, and the one that moves.
type Both = (String, String, [Box<dyn Built>; 2]);

/// Measures a scene; engines that know nothing of motion are not asked.
///
/// # Errors
///
/// An engine refuses.
pub fn moved(
    subject: &Subject,
    speed: f32,
    engines: &mut [Box<dyn Engine>],
    plan: &Plan,
) -> Result<Moved, EngineError> {
    let still = &subject.triangles;
    let moving = in_motion(still, speed);
    let source = own::scene(own::default_variant(), still)?;
    let up = subject.up.unwrap_or(1);
    let rays = RaySource::new(&source, up, plan.rays);
    let mut built: Vec<Both> = Vec::new();
    for engine in engines {
        engine.prepare(1)?;
        for variant in variants(&**engine) {
            let both = [engine.build(&variant, still)?, engine.build(&variant, &moving)?];
            built.push((engine.name().to_owned(), variant, both));
        }
    }

    let mut rows = Vec::new();
    for &kind in &plan.kinds {
        let mut random = Random::new(0x71ED);
        let timed = |ray: Ray| ray.at_time(random.unit());
        let rays: Vec<Ray> = rays.rays(kind).into_iter().map(timed).collect();
        let question = kind.question();
        let mut passes: Vec<_> = built
            .iter()
            .map(|(.., both)| {
                [&both[0], &both[1]].map(|built| built.pass(Call::ONE, question, &rays))
            })
            .collect();
        let mut times = vec![[Vec::new(), Vec::new()]; passes.len()];
        for round in 0..=plan.rounds {
            for (passes, times) in passes.iter_mut().zip(&mut times) {
                for (pass, times) in passes.iter_mut().zip(times) {
                    let clock = Stopwatch::start(plan.clock);
                    pass.trace();
                    // The first round warms up.
                    if round > 0 {
                        times.push(clock.elapsed().as_secs_f64());
                    }
                }
            }
        }
        let answers: Vec<Vec<Answer>> = passes
            .iter()
            .map(|[_, moving]| {
                let mut answers = Vec::new();
                moving.answers(&mut answers);
                answers
            })
            .collect();
        for (((engine, variant, _), [still, moving]), found) in
            built.iter().zip(&times).zip(&answers)
        {
            let speed = |times: &[f64]| rays.len() as f64 / median(times) / 1e6;
            let ratios: Vec<f64> = still.iter().zip(moving).map(|(s, m)| s / m).collect();
            let differ = |(a, b): &(&Answer, &Answer)| match question {
                Question::Closest => a.prim != b.prim && (a.t - b.t).abs() > 1e-4 * a.t.abs(),
                Question::Any => a.is_hit() != b.is_hit(),
            };
            let wrong = answers[0].iter().zip(found).filter(differ).count();
            rows.push(Row {
                engine: engine.clone(),
                variant: variant.clone(),
                kind: kind.name(),
                still: speed(still),
                moving: speed(moving),
                ratio: median(&ratios),
                mismatch_ppm: wrong as f64 * 1e6 / rays.len().max(1) as f64,
            });
        }
    }
    Ok(Moved { scene: subject.name.clone(), rows })
}

/// The same triangles, every vertex on its way.
fn in_motion(still: &Triangles, speed: f32) -> Triangles {
    let far = speed * scenes::bounds(still).diagonal() as f32;
    let mut random = Random::new(0x5EED);
    let mut moved = |p: &[f32; 3]| {
        let direction = random.direction();
        let length = far * random.unit();
        [0, 1, 2].map(|axis: usize| p[axis] + length * direction[axis])
    };
    let later: Vec<_> = still.positions.iter().map(&mut moved).collect();
    Triangles { later: Some(later.into()), ..still.clone() }
}

/// Measures a propeller that turns once.
///
/// # Errors
///
/// The scene cannot be built.
pub fn propeller(plan: &Plan) -> Result<Propeller, EngineError> {
    /// Steps of the turn: 11 degrees each.
    const STEPS: usize = 33;
    let mesh = blades(STEPS);
    let triangles = mesh.triangles().len();
    let build = |temporal_splits| {
        let clock = Stopwatch::start(plan.clock);
        let options = BuildOptions { temporal_splits, ..BuildOptions::default() };
        let scene = Scene::builder().mesh(mesh.clone()).build(&options);
        let scene = scene.map_err(|error| EngineError::Refused(error.to_string()))?;
        Ok::<_, EngineError>((scene, clock.elapsed().as_secs_f64()))
    };
    let (with, with_time) = build(true)?;
    let (without, without_time) = build(false)?;

    // Rays through the disc that it sweeps, from in front and from the side.
    let mut random = Random::new(0x9809);
    let rays: Vec<Ray> = (0..plan.rays)
        .map(|i| {
            let to = [random.between(-1.0, 1.0), random.between(-1.0, 1.0), 0.0];
            let from = match i % 2 {
                0 => [0.3 * to[0], 0.3 * to[1], 3.0],
                _ => [3.0, random.between(-1.0, 1.0), random.between(-0.5, 0.5)],
            };
            let direction = [0, 1, 2].map(|axis: usize| to[axis] - from[axis]);
            Ray::new(from, direction).at_time(random.unit())
        })
        .collect();
    let mut times = [Vec::new(), Vec::new()];
    for round in 0..=plan.rounds {
        for (scene, times) in [&with, &without].into_iter().zip(&mut times) {
            let clock = Stopwatch::start(plan.clock);
            let hits = rays.iter().filter(|ray| own::closest(scene, ray).is_hit()).count();
            std::hint::black_box(hits);
            if round > 0 {
                times.push(clock.elapsed().as_secs_f64());
            }
        }
    }
    let work = [&with, &without].map(|scene| {
        let mut counters = Counters::default();
        for ray in &rays {
            let _ = scene.closest_counted(ray, &mut counters);
        }
        [counters.nodes, counters.triangles].map(|count| count as f64 / rays.len().max(1) as f64)
    });
    let ratios: Vec<f64> = times[1].iter().zip(&times[0]).map(|(b, a)| b / a).collect();
    let speed = |times: &[f64]| rays.len() as f64 / median(times) / 1e6;
    Ok(Propeller {
        triangles,
        steps: STEPS,
        segments: with.segments().next().map_or(0, |(_, segments)| segments),
        with: speed(&times[0]),
        without: speed(&times[1]),
        ratio: median(&ratios),
        work,
        bytes: [with.trace_bytes(), without.trace_bytes()],
        build: [with_time, without_time],
    })
}

/// Three twisted blades around the z axis, of unit length, that turn once.
fn blades(steps: usize) -> Mesh {
    const ALONG: u32 = 120;
    const ACROSS: u32 = 30;
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for blade in 0..3 {
        let turn = Affine::rotation([0.0, 0.0, 1.0], blade as f32 * (core::f32::consts::TAU / 3.0));
        let first = positions.len() as u32;
        for i in 0..=ALONG {
            for j in 0..=ACROSS {
                let (x, y) =
                    (0.05 + 0.95 * i as f32 / ALONG as f32, j as f32 / ACROSS as f32 - 0.5);
                let twist = Affine::rotation([1.0, 0.0, 0.0], 0.9 - 0.6 * x);
                let thin = 0.02 * (0.25 - y * y);
                positions.push(turn.point(twist.point([x, 0.2 * y, thin])));
            }
        }
        for i in 0..ALONG {
            for j in 0..ACROSS {
                let at = |i: u32, j: u32| first + i * (ACROSS + 1) + j;
                triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
    }
    let at = |step: usize| -> Array<[f32; 3]> {
        let angle = core::f32::consts::TAU * step as f32 / (steps - 1) as f32;
        let turn = Affine::rotation([0.0, 0.0, 1.0], angle);
        positions.iter().map(|&p| turn.point(p)).collect::<Vec<_>>().into()
    };
    Mesh::moving((0..steps).map(at), triangles)
}

impl Moved {
    /// As a table.
    pub fn lines(&self) -> Vec<String> {
        let head = format!("{}: one ray a call, one thread, million rays a second", self.scene);
        let row = |row: &Row| {
            format!(
                "  {:<10} {:<8} {:<8} still {:7.3}  moving {:7.3}  ratio {:.3}  ({:.0} ppm differ)",
                row.kind,
                row.engine,
                row.variant,
                row.still,
                row.moving,
                row.ratio,
                row.mismatch_ppm
            )
        };
        std::iter::once(head).chain(self.rows.iter().map(row)).collect()
    }
}

impl Propeller {
    /// In words.
    pub fn lines(&self) -> Vec<String> {
        let Self { triangles, steps, segments, with, without, ratio, work, bytes, build } = self;
        vec![
            format!("propeller: {triangles} triangles, {steps} steps, one turn"),
            format!(
                "  temporal splits: {segments} segments, {with:.3} million rays a second, {:.1} nodes and {:.1} \
                 triangles a ray, {} bytes, built in {:.3} s",
                work[0][0], work[0][1], bytes[0], build[0]
            ),
            format!(
                "  none: {without:.3} million rays a second, {:.1} nodes and {:.1} triangles a ray, {} bytes, \
                 built in {:.3} s",
                work[1][0], work[1][1], bytes[1], build[1]
            ),
            format!("  ratio {ratio:.2}"),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::{Clock, Plan, propeller};

    #[test]
    fn temporal_splits_pay_for_a_propeller() {
        let propeller =
            propeller(&Plan { kinds: Vec::new(), rays: 500, rounds: 1, clock: Clock::Wall })
                .unwrap();
        let [[with, _], [without, _]] = propeller.work;
        assert!(2.0 * with < without, "{propeller:?}");
        assert!(propeller.segments > 8, "{propeller:?}");
    }
}
