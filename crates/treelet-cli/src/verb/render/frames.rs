//! `treelet render --frames`: a clip, a picture a frame, whose trees follow what moves.
//!
//! What moves as a whole moves its instance: objects keep their trees. What bends, and the tree of instances,
//! is refitted or built anew, as the library decides. Each frame is the picture that its pose alone gives, whichever frames came before.

use std::time::{Duration, Instant};

use serde::Serialize;
use treelet::scene::Action;
use treelet::{BuildOptions, Invalid};
use treelet_model::{Camera, Changes, LightKind, PlacedModel, Updated};
use treelet_render::{Film, Image, Layers, RenderError, Renderer, denoise};

use super::cameras::{self, Choice};
use super::clip::{self, FrameRange};
use super::files::{self, Picture};
use super::flags::Flags;
use super::light::{self, LightChoice};
use super::passes::{self, Goal, Made};
use super::video::Video;
use crate::ending::{Ending, Failure};
use crate::input::{self, Input};
use crate::output::Output;
use crate::session::{Outcome, Session, say, warn};
use crate::text;

/// Poses in which a clip is measured, for a camera that sees all of it.
const POSES_MEASURED: u32 = 32;

/// The stops and the sizes are as for one picture; what is different is told here.
#[derive(Serialize)]
struct Report {
    scene: String,
    clip: String,
    clip_seconds: f64,
    fps: f64,
    width: u32,
    height: u32,
    seed: u64,
    threads: usize,
    plan: String,
    cancelled: bool,
    /// The files of the frames; none if only a video was asked for.
    frames: Vec<String>,
    video: Option<String>,
    /// What each frame took.
    poses: Vec<FrameReport>,
    warnings: Vec<String>,
}

/// What a frame changed, and what it took.
#[derive(Serialize)]
struct FrameReport {
    frame: u32,
    /// Seconds into the clip.
    time: f64,
    instances_moved: u64,
    meshes_deformed: u64,
    triangles_deformed: u64,
    tree: Tree,
    objects_refitted: u64,
    objects_repaired: u64,
    objects_rebuilt: u64,
    passes: u32,
    rays: u64,
    seconds: Seconds,
}

/// What became of the trees.
#[derive(Clone, Copy, Serialize)]
#[serde(rename_all = "lowercase")]
enum Tree {
    /// All of them are new.
    Built,
    /// Nothing changed that they depend on.
    Kept,
    /// They followed what moved.
    Refitted,
    /// They did, and what had decayed of them is new.
    Repaired,
    /// Some of them are new.
    Rebuilt,
}

impl Tree {
    /// What an update comes to.
    fn of(updated: &Updated, keeps_geometry: bool) -> Self {
        match updated.placements {
            _ if keeps_geometry => Self::Kept,
            _ if updated.rebuilt > 0 => Self::Rebuilt,
            Some(Action::Rebuilt) => Self::Rebuilt,
            _ if updated.repaired > 0 => Self::Repaired,
            Some(Action::Repaired) => Self::Repaired,
            _ => Self::Refitted,
        }
    }
}

#[derive(Serialize)]
struct Seconds {
    pose: f64,
    build: f64,
    /// Of `render`, what rays took.
    trace: f64,
    render: f64,
}

/// Plays the clip.
pub(super) fn run(flags: &Flags, session: &Session) -> Result<Outcome, Failure> {
    // Check what can be checked before time is spent.
    let fps = flags.fps.unwrap_or(clip::FPS);
    let keeps_frames = flags.video.is_none() || clip::has_place(&flags.output);
    let range = flags.frames.unwrap_or(FrameRange::WHOLE);
    let first = clip::frame_file(&flags.output, range.numbers(0.0, fps).start);
    let first = keeps_frames.then(|| Output::prepare(&first)).transpose()?;
    files::keep_inputs(flags, first.iter())?;
    let size = [flags.size.width, flags.size.height];
    let mut video = match &flags.video {
        Some(file) => Some(Video::begin(file, size, fps)?),
        None => None,
    };
    files::keep_inputs(flags, video.iter().map(Video::output))?;

    // Read the scene.
    let mut input = Input::load(flags.scene.as_ref(), &flags.scene_flags, session)?;
    super::add_environment(flags, &mut input)?;
    let clip = clip::choose(&input.model, flags.clip.as_deref())?;
    let seconds = input.model.animations[clip].duration();
    let numbers = range.numbers(seconds, fps);
    let name = clip::name(&input.model.animations[clip], clip);
    say(&format!(
        "clip {name}, {seconds:.3} s: {} at {fps} a second",
        text::things(numbers.len() as u64, "frame")
    ));

    // Make frame after frame.
    let optimizers = flags.tree.optimizers();
    let options = flags.tree.options(optimizers.as_deref(), flags.rays(session.threads));
    let options = BuildOptions { invalid: Invalid::from(flags.invalid), ..options };
    let view = view(flags, &mut input, clip)?;
    let goal = Goal::new(flags.spp, flags.time, flags.noise).of_frames(numbers.len() as u32);
    let mut stage =
        Stage { flags, session, options, goal, view, clip, fps, placed: None, headlamp: None };
    let (mut reports, mut names) = (Vec::new(), Vec::new());
    for number in numbers {
        let file = clip::frame_file(&flags.output, number);
        let output = keeps_frames.then(|| Output::prepare(&file)).transpose()?;
        files::keep_inputs(flags, output.iter())?;
        let made = stage.frame(&mut input, number, output.as_ref(), video.as_mut());
        let report = match made {
            // Frames that are there are kept, and so is a video of them.
            Err(Failure::Cancelled) if !reports.is_empty() => break,
            made => made?,
        };
        tell(&report, input.model.objects.len());
        names.extend(output.map(|_| file.display().to_string()));
        reports.push(report);
    }
    let file = video.as_ref().map(|video| video.output().path().display().to_string());
    if let Some(video) = video {
        video.finish()?;
    }

    // Tell.
    let cancelled = session.cancel.is_cancelled();
    let count = text::things(reports.len() as u64, "frame");
    match (&file, names.first(), names.last()) {
        (Some(file), ..) => say(&format!("{count} in {file}")),
        (_, Some(first), Some(last)) => say(&format!("{count}: {first} to {last}")),
        _ => {}
    }
    if cancelled {
        say("cancelled; the frames that are there are whole");
    }
    let report = Report {
        scene: input.name,
        clip: name,
        clip_seconds: seconds,
        fps,
        width: flags.size.width,
        height: flags.size.height,
        seed: flags.seed,
        threads: session.threads,
        plan: stage.options.plan().to_string(),
        cancelled,
        frames: names,
        video: file,
        poses: reports,
        warnings: input.model.warnings,
    };
    Outcome::new("render", &report, if cancelled { Ending::Cancelled } else { Ending::Done })
}

/// The camera of all frames; one that nobody named sees all of the clip, whichever frames are made.
fn view(flags: &Flags, input: &mut Input, clip: usize) -> Result<Choice, Failure> {
    Ok(match cameras::choice(flags, input)? {
        Choice::Framing => {
            let bounds = input.model.clip_bounds(clip, POSES_MEASURED)?;
            Choice::Still(cameras::framing(flags, input, &bounds))
        }
        named => named,
    })
}

/// What goes on from frame to frame.
struct Stage<'a> {
    flags: &'a Flags,
    session: &'a Session,
    options: BuildOptions<'a>,
    goal: Goal,
    view: Choice,
    clip: usize,
    fps: f64,
    /// The trees of the frame before.
    placed: Option<PlacedModel>,
    /// The place of the headlamp in the list of lights.
    headlamp: Option<usize>,
}

impl Stage<'_> {
    /// Poses, builds, renders, writes. A frame that Ctrl-C meets is not written.
    fn frame(
        &mut self,
        input: &mut Input,
        number: u32,
        output: Option<&Output>,
        video: Option<&mut Video>,
    ) -> Result<FrameReport, Failure> {
        // Pose.
        let posing = Instant::now();
        let time = input.model.animations[self.clip].wrapped(f64::from(number) / self.fps);
        let changes = input.model.pose(Some(self.clip), time)?;
        let pose_time = posing.elapsed();

        // Build what changed; for the first frame, everything.
        let building = Instant::now();
        let (placed, tree) = match &self.placed {
            None => (input.build(&self.options, self.session)?, Tree::Built),
            Some(before) => {
                let placed = input.update(before, &changes, &self.options, self.session)?;
                let tree = Tree::of(&placed.update(), changes.keeps_geometry());
                (placed, tree)
            }
        };
        let build_time = building.elapsed();
        let is_first = self.placed.is_none();
        let changes = if is_first { Changes::default() } else { changes };
        if is_first {
            input::warn_of_skipped(&placed);
        }

        // Render.
        let camera = match &self.view {
            Choice::OfScene(camera) => input.model.cameras[*camera].clone(),
            Choice::Still(camera) => camera.clone(),
            Choice::Framing => cameras::framing(self.flags, input, &placed.scene.bounds()),
        };
        self.light(input, &camera, &placed);
        let rendering = Instant::now();
        let shot = self.shoot(input, &placed, &camera)?;
        let render_time = rendering.elapsed();
        if is_first {
            let complaint = light::complaint(&input.model, &shot.film)?;
            complaint.iter().for_each(|complaint| warn(complaint));
            input.model.warnings.extend(complaint);
        }
        let updated = placed.update();
        self.placed = Some(placed);

        self.write(&shot, output, video)?;
        let Shot { film, made, .. } = shot;
        let times = [pose_time, build_time, render_time];
        Ok(report(number, time, &changes, (tree, updated), &film, &made, times))
    }

    /// Puts the headlamp where the camera stands, as bright in all frames as in the first.
    fn light(&mut self, input: &mut Input, camera: &Camera, placed: &PlacedModel) {
        if self.flags.light != LightChoice::Headlamp {
            return;
        }
        let lights = &mut input.model.lights;
        let lamp = *self.headlamp.get_or_insert_with(|| {
            lights.push(light::headlamp(camera, placed));
            lights.len() - 1
        });
        if let LightKind::Point { position, .. } = &mut lights[lamp].kind {
            *position = camera.position();
        }
    }

    /// Makes the passes of a frame.
    fn shoot(&self, input: &Input, placed: &PlacedModel, camera: &Camera) -> Result<Shot, Failure> {
        let settings = self.flags.settings(input.up);
        let renderer = Renderer::new(&input.model, placed, camera, settings)?;
        let mut film = renderer.film()?;
        let made = passes::make_passes(&renderer, &mut film, &self.goal, None, self.session)?;
        if made.is_cut_short {
            return Err(Failure::Cancelled);
        }
        let is_exr = Picture::is_layered(&self.flags.output);
        let layers = match self.flags.denoise || is_exr {
            true => Some(renderer.layers(&self.session.cancel).map_err(|error| match error {
                RenderError::Cancelled => Failure::Cancelled,
                error => error.into(),
            })?),
            false => None,
        };
        let means = match &layers {
            Some(layers) if self.flags.denoise => denoise(&film, layers)?,
            _ => film.means()?,
        };
        Ok(Shot { film, means, layers, made })
    }

    /// Writes a frame to its file, into the video, or both.
    fn write(
        &self,
        shot: &Shot,
        output: Option<&Output>,
        video: Option<&mut Video>,
    ) -> Result<(), Failure> {
        let Shot { film, means, layers, .. } = shot;
        if let Some(output) = output {
            let picture = Picture::new(output, self.flags.exposure);
            picture.write_means(film, means, layers.as_ref())?;
        }
        if let Some(video) = video {
            let tone = files::tone(self.flags.exposure);
            video.push(&Image::of_radiance(film.width(), film.height(), means, &tone)?)?;
        }
        Ok(())
    }
}

/// A frame that was made.
struct Shot {
    film: Film,
    /// What is shown of it, smoothed perhaps.
    means: Vec<[f32; 3]>,
    layers: Option<Layers>,
    made: Made,
}

fn report(
    frame: u32,
    time: f64,
    changes: &Changes,
    (tree, updated): (Tree, Updated),
    film: &Film,
    made: &Made,
    [pose, build, render]: [Duration; 3],
) -> FrameReport {
    FrameReport {
        frame,
        time,
        instances_moved: changes.placements,
        meshes_deformed: changes.parts,
        triangles_deformed: changes.triangles,
        tree,
        objects_refitted: updated.refitted,
        objects_repaired: updated.repaired,
        objects_rebuilt: updated.rebuilt,
        passes: film.passes(),
        rays: made.stats.rays,
        seconds: Seconds {
            pose: pose.as_secs_f64(),
            build: build.as_secs_f64(),
            trace: made.time.as_secs_f64() * made.query_share(),
            render: render.as_secs_f64(),
        },
    }
}

/// A frame's line.
fn tell(report: &FrameReport, objects: usize) {
    let FrameReport { frame, time, seconds, .. } = report;
    let mut moved = format!("{} moved", text::things(report.instances_moved, "instance"));
    if report.meshes_deformed > 0 {
        let meshes = text::things(report.meshes_deformed, "mesh");
        let triangles = text::things(report.triangles_deformed, "triangle");
        moved += &format!(", {meshes} deformed ({triangles})");
    }
    if matches!(report.tree, Tree::Built) {
        moved = "all is new".to_owned();
    }
    let tree = match report.tree {
        Tree::Built => "built".to_owned(),
        Tree::Kept => "kept".to_owned(),
        Tree::Refitted if report.objects_refitted == 0 => "instances refitted".to_owned(),
        Tree::Refitted => format!("{} of {objects} refitted", report.objects_refitted),
        Tree::Repaired if report.objects_repaired == 0 => "instances repaired".to_owned(),
        Tree::Repaired => {
            let (refitted, repaired) = (report.objects_refitted, report.objects_repaired);
            format!("{refitted} of {objects} refitted, {repaired} repaired")
        }
        Tree::Rebuilt if report.objects_rebuilt == 0 => "instances rebuilt".to_owned(),
        Tree::Rebuilt => {
            let (refitted, rebuilt) = (report.objects_refitted, report.objects_rebuilt);
            format!("{refitted} of {objects} refitted, {rebuilt} rebuilt")
        }
    };
    let ms = |seconds: f64| text::time(Duration::from_secs_f64(seconds));
    say(&format!(
        "frame {frame} at {time:.3} s: {moved}; tree: {tree}; pose {}, build {}, trace {} of {}",
        ms(seconds.pose),
        ms(seconds.build),
        ms(seconds.trace),
        ms(seconds.render)
    ));
}
