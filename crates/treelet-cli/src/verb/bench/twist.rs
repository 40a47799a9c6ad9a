//! `treelet bench --twist`: a mesh that twists and bursts, and what keeping up with it takes.

use clap::Args;
use serde::Serialize;
use treelet::scene::Policy;
use treelet_bench::animate::{self, AnimateError, Load, Motion, Play, Reading, Sum, Wish};
use treelet_bench::crew::Crew;

use super::flags::{Flags, plan};
use super::steps::Steps;
use super::subject::subject;
use crate::ending::{Ending, Failure};
use crate::session::{Outcome, Session, say};
use treelet_bench::rounds::Rounds;

/// Diffuse rays of a frame, unless somebody asks for more or fewer.
const RAYS: usize = 2_000_000;
/// Times that a frame's rays are traced through each scene, unless somebody asks for more or fewer.
const REPEATS: Rounds = Rounds { count: 1, seconds: 0.0 };

/// Commits a second while rays are traced.
const PACE: f64 = 100.0;

/// The motion.
#[derive(Debug, Args)]
pub(super) struct TwistFlags {
    /// Let the mesh twist, then burst, over N frames, and keep up with it in several ways: a fresh default build
    /// every frame, refitting only, and edits under policies. Each frame traces --rays diffuse rays [default: 2000000],
    /// --rounds times [default: 1], on --threads threads.
    #[arg(long, value_name = "N", num_args = 0..=1, default_missing_value = "100")]
    #[arg(conflicts_with_all = ["order", "slice", "peak_of", "figure", "builders", "variants", "against"])]
    #[arg(value_parser = clap::value_parser!(u64).range(1..=100_000))]
    pub(super) twist: Option<u64>,

    /// Trace rays for S seconds while somebody commits a pose of the twisting mesh a hundred times a second, and as long
    /// while nobody does: whether any answer is wrong, and how long batches take. One thread commits, the others of
    /// --threads trace, at least one.
    #[arg(long, value_name = "S", num_args = 0..=1, default_missing_value = "60")]
    #[arg(conflicts_with_all = ["twist", "order", "slice", "peak_of", "figure", "builders", "variants", "against"])]
    #[arg(value_parser = clap::value_parser!(u64).range(1..=100_000))]
    pub(super) while_edited: Option<u64>,
}

/// One scene's clip.
#[derive(Serialize)]
struct Played {
    scene: String,
    triangles: usize,
    threads: usize,
    sums: Vec<Sum>,
    play: Play,
}

#[derive(Serialize)]
struct Report {
    clips: Vec<Played>,
}

/// Plays scene after scene.
pub(super) fn run(flags: &Flags, frames: u64, session: &Session) -> Result<Outcome, Failure> {
    let plan = plan(flags, session, RAYS, REPEATS);
    let motion = Motion { frames: frames as usize, rays: plan.rays, repeats: plan.rounds.count };
    let edits = |name: &str, policy| (name.to_owned(), Wish::Edits(policy));
    let wishes = [
        ("fresh".to_owned(), Wish::Fresh),
        edits("refit", Policy::Refit),
        edits("auto", Policy::Auto),
        edits("rays", Policy::Rays(motion.rays as u64)),
        edits("repair", Policy::Repair),
    ];
    let crew =
        Crew::new(session.threads, plan.clock).map_err(|error| Failure::told(error.to_string()))?;
    let watcher = Steps::new(session.cancel.clone());
    let mut clips = Vec::new();
    for scene in &flags.scenes {
        let subject = subject(scene, flags, session)?;
        let told = |play: &Play, frame| say(&animate::frame_line(play, frame));
        let play =
            animate::play(&subject, &motion, &wishes, &crew, &watcher, told).map_err(failure)?;
        watcher.clear();
        let sums = animate::sums(&play);
        let triangles = subject.triangles.len();
        say(&format!("{}: {triangles} triangles, {} rays a frame", subject.name, play.rays));
        sums.iter().for_each(|sum| say(&animate::sum_line(sum)));
        clips.push(Played { scene: subject.name, triangles, threads: crew.threads(), sums, play });
    }
    Outcome::new("bench", &Report { clips }, Ending::Done)
}

#[derive(Serialize)]
struct Readings {
    readings: Vec<Read>,
}

/// One scene, read while it was edited.
#[derive(Serialize)]
struct Read {
    scene: String,
    triangles: usize,
    #[serde(flatten)]
    reading: Reading,
}

/// Reads scene after scene while it is edited.
pub(super) fn read(flags: &Flags, seconds: u64, session: &Session) -> Result<Outcome, Failure> {
    let readers = session.threads.saturating_sub(1).max(1);
    let load = Load { seconds: seconds as f64, pace: PACE, readers, policy: Policy::Refit };
    let watcher = Steps::new(session.cancel.clone());
    let mut readings = Vec::new();
    for scene in &flags.scenes {
        let subject = subject(scene, flags, session)?;
        let reading = animate::read(&subject, &load, &watcher).map_err(failure)?;
        watcher.clear();
        reading.lines().iter().for_each(|line| say(line));
        let triangles = subject.triangles.len();
        readings.push(Read { scene: subject.name, triangles, reading });
    }
    let right = readings.iter().all(|it| it.reading.wrong == 0);
    let ending = if right { Ending::Done } else { Ending::CheckFailed };
    Outcome::new("bench", &Readings { readings }, ending)
}

/// Why a clip ended early.
pub(super) fn failure(error: AnimateError) -> Failure {
    match error {
        AnimateError::Cancelled => Failure::Cancelled,
        error => Failure::told(error.to_string()),
    }
}
