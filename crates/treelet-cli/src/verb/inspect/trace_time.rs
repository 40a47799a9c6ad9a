//! How long rays take through each of several trees: one thread, one ray a call, the trees in turn.

use serde::{Deserialize, Serialize};
use treelet::{BuildOptions, Scene};
use treelet_bench::check;
use treelet_bench::crew::{Clock, Crew};
use treelet_bench::engine::{Built, Call, Engine as _, Triangles};
use treelet_bench::rays::{Kind, RaySource};
use treelet_bench::rivals::treelet::Treelet;
use treelet_bench::rounds::{self, Rounds, Work};
use treelet_bench::stats::{median, spread};

use super::flat::stopped_or;
use crate::ending::Failure;
use crate::progress::Line;
use crate::session::Session;

/// From the camera, near occlusion, and the diffuse rays that the paper measures.
const KINDS: [Kind; 3] = [Kind::Primary, Kind::Occlusion, Kind::Diffuse];

/// Rays of each kind.
const RAYS: usize = 1 << 17;

/// Rounds that count.
const ROUNDS: usize = 9;

/// How long rays of a kind take.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Times {
    pub(super) kind: String,
    /// A ray, the median of the rounds, by the processor's clock.
    pub(super) nanoseconds: f64,
    /// Largest less smallest, of the median.
    spread: f64,
}

impl Times {
    /// Of which the spread is not known.
    pub(super) fn new(kind: String, nanoseconds: f64) -> Self {
        Self { kind, nanoseconds, spread: 0.0 }
    }
}

/// By variant, then by kind; in each round each tree is traced for `seconds` at least.
pub(super) fn measure(
    triangles: &Triangles,
    up: usize,
    variants: &[&str],
    seconds: f64,
    line: &Line,
    session: &Session,
) -> Result<Vec<Vec<Times>>, Failure> {
    let mut built: Vec<Box<dyn Built>> = Vec::new();
    for variant in variants {
        line.set(0, format!("building {variant}"));
        if session.cancel.is_cancelled() {
            return Err(Failure::Cancelled);
        }
        built.push(Treelet.build(variant, triangles)?);
    }
    let mesh = treelet::Mesh::new(triangles.positions.clone(), triangles.indices.clone());
    let scene = Scene::builder().mesh(mesh).build(&BuildOptions::default());
    let scene = scene.map_err(|error| stopped_or(session, error))?;
    let source = RaySource::new(&scene, up, RAYS);
    let crew = Crew::new(1, Clock::Processor)?;

    let mut times = vec![Vec::new(); variants.len()];
    for kind in KINDS {
        line.set(0, format!("tracing {} rays", kind.name()));
        let rays = source.rays(kind);
        let question = kind.question();
        let works: Vec<_> =
            built.iter().map(|built| Work::new(&**built, Call::ONE, question, &rays, 1)).collect();
        // Wrong answers are not worth timing.
        let mut reference = None;
        for (work, variant) in works.iter().zip(variants) {
            work.trace(&crew, 1);
            let answers = work.answers();
            let expected = reference.get_or_insert_with(|| answers.clone());
            if let Some(ray) = check::first_bit_difference(expected, &answers) {
                let kind = kind.name();
                return Err(Failure::told(format!(
                    "{variant} answers {kind} ray {ray} otherwise than {}",
                    variants[0]
                )));
            }
        }
        let stop = || session.cancel.is_cancelled();
        let seconds = rounds::measure(&crew, &works, Rounds { count: ROUNDS, seconds }, &stop);
        if stop() {
            return Err(Failure::Cancelled);
        }
        for (times, seconds) in times.iter_mut().zip(seconds) {
            let nanoseconds = 1e9 * median(&seconds) / rays.len().max(1) as f64;
            times.push(Times {
                kind: kind.name().to_owned(),
                nanoseconds,
                spread: spread(&seconds),
            });
        }
    }
    Ok(times)
}
