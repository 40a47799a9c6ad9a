//! Frame after frame, every way to keep up in turn.

use std::time::Duration;

use serde::Serialize;
use treelet::{Hit, Ray, Scene};

use crate::crew::Crew;
use crate::run::Watcher;

/// A scene that is up to date.
pub struct Frame {
    /// What rays are traced against.
    pub scene: Scene,
    /// What was done, in a word: `built`, `kept`, `refitted`, `repaired` or `rebuilt`.
    pub did: &'static str,
}

/// A way to keep up. It keeps what it needs from frame to frame; all that it does in a frame is timed.
pub struct Way<'a> {
    /// As reports call it.
    pub name: String,
    /// Brings the scene up to date with a frame: 0, then 1, and so on.
    pub update: Box<dyn FnMut(usize) -> Result<Frame, WayError> + Send + 'a>,
}

/// Why a scene could not be brought up to date.
pub type WayError = Box<dyn std::error::Error + Send + Sync>;

/// What is played.
pub struct Clip<'a> {
    /// How many frames.
    pub frames: usize,
    /// Gets ready what all ways need for a frame; not timed.
    pub begin: Box<dyn FnMut(usize) -> Result<(), WayError> + 'a>,
    /// The rays of a frame, made of a scene that is up to date; not timed.
    pub rays: Box<RaysOf<'a>>,
    /// Times that each scene traces the rays of a frame; the shortest counts.
    pub repeats: usize,
}

/// Makes the rays of a frame.
pub type RaysOf<'a> = dyn FnMut(&Scene, usize) -> Vec<Ray> + Send + 'a;

/// How a clip went.
#[derive(Clone, Debug, Serialize)]
pub struct Play {
    /// The ways' names.
    pub ways: Vec<String>,
    /// Rays of a frame.
    pub rays: usize,
    /// Frame after frame, way after way.
    pub moments: Vec<Moment>,
}

/// One way in one frame.
#[derive(Clone, Debug, Serialize)]
pub struct Moment {
    /// Which frame.
    pub frame: usize,
    /// Which way.
    pub way: usize,
    /// What it did.
    pub did: String,
    /// Seconds until the scene was up to date.
    pub update: f64,
    /// Seconds to trace the frame's rays.
    pub trace: f64,
}

/// Why a clip was not played to its end.
#[derive(Debug, thiserror::Error)]
pub enum AnimateError {
    /// A scene could not be built or updated.
    #[error("frame {frame}, {way}: {error}")]
    Scene {
        /// Which frame.
        frame: usize,
        /// Which way.
        way: String,
        /// Why.
        #[source]
        error: WayError,
    },
    /// The scene could not be put into the frame's pose.
    #[error("frame {frame}: {error}")]
    Pose {
        /// Which frame.
        frame: usize,
        /// Why.
        #[source]
        error: WayError,
    },
    /// Two ways answer differently: one of them is wrong.
    #[error("frame {frame}: {way} answers ray {ray} with other bits than {reference}")]
    Bits {
        /// Which frame.
        frame: usize,
        /// Which way.
        way: String,
        /// What it was compared with.
        reference: String,
        /// The first ray that differs.
        ray: usize,
    },
    /// No thread to commit on.
    #[error("no thread to commit on: {0}")]
    Pool(String),
    /// Somebody pressed Ctrl-C.
    #[error("cancelled")]
    Cancelled,
}

/// Plays the clip on the crew's threads; who begins changes from frame to frame. `told` hears of every frame.
///
/// # Errors
///
/// A scene cannot be built, ways answer differently, or it was stopped.
pub fn compare(
    mut clip: Clip<'_>,
    ways: &mut [Way<'_>],
    crew: &Crew,
    watcher: &dyn Watcher,
    mut told: impl FnMut(&Play, usize),
) -> Result<Play, AnimateError> {
    let names = ways.iter().map(|way| way.name.clone()).collect();
    let mut play = Play { ways: names, rays: 0, moments: Vec::new() };
    for frame in 0..clip.frames {
        if watcher.stopped() {
            return Err(AnimateError::Cancelled);
        }
        watcher.step(&format!("frame {frame} of {}", clip.frames));
        (clip.begin)(frame).map_err(|error| AnimateError::Pose { frame, error })?;
        let first = play.moments.len();
        let mut scenes = Vec::with_capacity(ways.len());
        for (at, way) in ways.iter_mut().enumerate() {
            let (made, update) = timed(crew, || (way.update)(frame));
            let made =
                made.map_err(|error| AnimateError::Scene { frame, way: way.name.clone(), error })?;
            let (did, update) = (made.did.to_owned(), update.as_secs_f64());
            play.moments.push(Moment { frame, way: at, did, update, trace: f64::INFINITY });
            scenes.push(made.scene);
        }
        let Some(scene) = scenes.first() else { break };
        let rays = crew.install(|| (clip.rays)(scene, frame));
        play.rays = rays.len();
        trace(&rays, &scenes, clip.repeats, crew, &mut play, first)?;
        told(&play, frame);
    }
    Ok(play)
}

/// Traces the rays through each scene, and compares the answers.
fn trace(
    rays: &[Ray],
    scenes: &[Scene],
    repeats: usize,
    crew: &Crew,
    play: &mut Play,
    first: usize,
) -> Result<(), AnimateError> {
    let mut reference = vec![Hit::MISS; rays.len()];
    let mut hits = reference.clone();
    for repeat in 0..repeats.max(1) {
        for turn in 0..scenes.len() {
            let at = (turn + repeat + first) % scenes.len();
            // Slices of one length are never refused.
            let took = crew.time_shared(|| {
                let _ = scenes[at].closest_many(rays, &mut hits);
            });
            let moment = &mut play.moments[first + at];
            moment.trace = moment.trace.min(took.as_secs_f64());
            if turn == 0 && repeat == 0 {
                reference.copy_from_slice(&hits);
            }
            let differs = hits.iter().zip(&reference).position(|(a, b)| !same(a, b));
            if let Some(ray) = differs {
                let way = play.ways[at].clone();
                let reference = play.ways[first % scenes.len()].clone();
                return Err(AnimateError::Bits { frame: moment.frame, way, reference, ray });
            }
        }
    }
    Ok(())
}

pub(super) fn same(a: &Hit, b: &Hit) -> bool {
    let bits = |hit: &Hit| [hit.t, hit.u, hit.v].map(f32::to_bits);
    bits(a) == bits(b) && (a.inst, a.geom, a.prim) == (b.inst, b.geom, b.prim)
}

/// What `work` makes, and how long it takes.
fn timed<R: Send>(crew: &Crew, work: impl FnOnce() -> R + Send) -> (R, Duration) {
    let mut made = None;
    let took = crew.time_shared(|| made = Some(work()));
    match made {
        Some(made) => (made, took),
        None => unreachable!("the crew runs what it is given"),
    }
}
