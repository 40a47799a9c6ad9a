//! `treelet bench --animate`: the clip of an animated file, and what keeping up with it takes.

use clap::Args;
use serde::Serialize;
use treelet::scene::Policy;
use treelet_bench::animate::{self, Animated, Motion, Play, Sum, Wish};
use treelet_bench::crew::Crew;
use treelet_bench::rounds::Rounds;

use super::flags::{Flags, plan};
use super::steps::Steps;
use super::subject::scene_name;
use super::twist::failure;
use crate::ending::{Ending, Failure};
use crate::input::Input;
use crate::output::Output;
use crate::session::{Outcome, Session, say};
use crate::text;
use crate::verb::render::clip;

/// Diffuse rays of a frame, unless somebody asks for more or fewer.
const RAYS: usize = 1 << 18;
/// Times that a frame's rays are traced through each scene, unless somebody asks for more or fewer.
const REPEATS: Rounds = Rounds { count: 3, seconds: 0.0 };

/// The clip.
#[derive(Debug, Args)]
pub(super) struct AnimateFlags {
    /// Play the clip of an animated scene in N frames, and keep up with it in several ways: refitting only,
    /// rebuilding only, edits under the usual policy and under that for so many rays. Each frame traces --rays diffuse rays [default: 262144],
    /// the fastest of --rounds times counts [default: 3], on --threads threads.
    #[arg(long, value_name = "N", num_args = 0..=1, default_missing_value = "100")]
    #[arg(conflicts_with_all = [
        "order", "slice", "peak_of", "figure", "builders", "variants", "against", "twist"
    ])]
    #[arg(value_parser = clap::value_parser!(u64).range(1..=100_000))]
    pub(super) animate: Option<u64>,

    /// With --animate: the clip, by its name or number [default: the first].
    #[arg(long, value_name = "NAME", requires = "animate")]
    clip: Option<String>,
}

/// One scene's clip.
#[derive(Serialize)]
struct Played {
    scene: String,
    clip: String,
    seconds: f64,
    triangles: u64,
    instances: usize,
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
    let plot = flags.figure.plot.as_deref().map(Output::prepare).transpose()?;
    if plot.is_some() && flags.scenes.len() > 1 {
        return Err(Failure::Usage("--plot draws one clip: name one scene".into()));
    }
    let plan = plan(flags, session, RAYS, REPEATS);
    let motion = Motion { frames: frames as usize, rays: plan.rays, repeats: plan.rounds.count };
    let edits = |name: &str, policy| (name.to_owned(), Wish::Edits(policy));
    let wishes = [
        edits("rebuild only", Policy::Rebuild),
        edits("refit only", Policy::Refit),
        edits("auto", Policy::Auto),
        edits("rays", Policy::Rays(motion.rays as u64)),
    ];
    let crew = Crew::new(session.threads, plan.clock)?;
    let watcher = Steps::new(session.cancel.clone());
    let mut clips = Vec::new();
    for scene in &flags.scenes {
        let input = Input::load(Some(scene), &flags.scene_flags, session)?;
        let (name, model) = (scene_name(scene), input.model);
        let clip = clip::choose(&model, flags.animate.clip.as_deref())?;
        let called = clip::name(&model.animations[clip], clip);
        let seconds = model.animations[clip].duration();
        let (triangles, instances) = (model.triangles_stored(), model.placements.len());
        let animated = Animated { model, clip, up: Some(input.up) };
        let told = |play: &Play, frame| say(&animate::frame_line(play, frame));
        let play = animate::play_clip(animated, &motion, &wishes, &crew, &watcher, told);
        watcher.clear();
        let play = play.map_err(failure)?;
        let title = format!(
            "{name}, clip {called}: {}, {} in {frames} frames, {} rays a frame, {}",
            text::things(triangles, "triangle"),
            text::things(instances as u64, "instance"),
            play.rays,
            text::things(crew.threads() as u64, "thread"),
        );
        say(&title);
        let sums = animate::sums(&play);
        sums.iter().for_each(|sum| say(&animate::sum_line(sum)));
        if let Some(plot) = &plot {
            plot.replace(animate::svg(&play, &title).as_bytes())?;
            say(&format!("{} written", plot.path().display()));
        }
        let (clip, threads) = (called, crew.threads());
        clips.push(Played {
            scene: name,
            clip,
            seconds,
            triangles,
            instances,
            threads,
            sums,
            play,
        });
    }
    Outcome::new("bench", &Report { clips }, Ending::Done)
}
