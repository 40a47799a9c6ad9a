//! `treelet render`: a picture of a scene, better with every pass.

mod apng;
mod cameras;
pub(super) mod clip;
mod files;
mod flags;
mod frames;
mod light;
mod passes;
mod report;
mod video;

use std::time::{Duration, Instant};

use treelet::BuildOptions;
use treelet::math::Affine;
use treelet_model::light::Projection;
use treelet_model::{Camera, Environment, PlacedModel};
use treelet_render::{Film, RenderError, Renderer, denoise};

pub(crate) use flags::Flags;

use crate::camera;
use crate::choice::ChoiceReport;
use crate::ending::{Ending, Failure};
use crate::input::{self, Input};
use crate::output::Output;
use crate::session::{Outcome, Session, say, warn};
use crate::text;
use files::Picture;
use light::LightChoice;
use passes::{Goal, Made};
use report::{Differences, Report, Seconds};

/// Reads, builds, renders, writes.
pub(crate) fn run(flags: Flags, session: &Session) -> Result<Outcome, Failure> {
    if flags.cameras {
        return cameras::list(Input::load(flags.scene.as_ref(), &flags.scene_flags, session)?);
    }

    if flags.frames.is_some() || flags.video.is_some() {
        return frames::run(&flags, session);
    }

    // Check what can be checked before time is spent.
    let output = Output::prepare(&flags.output)?;
    let layers = files::layer_files(&flags)?;
    let raw = flags.denoise.then(|| Output::prepare(&files::beside(&flags.output, "raw")));
    let raw = raw.transpose()?;
    let outputs = std::iter::once(&output).chain(layers.iter().map(|(_, output)| output));
    files::keep_inputs(&flags, outputs.chain(&raw))?;
    let reference = flags.compare.as_ref().map(|file| files::read_reference(file, &flags));
    let reference = reference.transpose()?;

    // Read the scene and build its tree.
    let mut input = Input::load(flags.scene.as_ref(), &flags.scene_flags, session)?;
    add_environment(&flags, &mut input)?;
    clip::tell(&input.model);
    let optimizers = flags.tree.optimizers();
    let estimate = flags.rays(session.threads);
    let options = flags.tree.options(optimizers.as_deref(), estimate);
    let options = BuildOptions { invalid: flags.invalid.into(), ..options };
    let quality = options.plan().quality.name();
    let Grown { placed, time: build_time, builder, made_by, choice } =
        grow(&input, &options, session)?;

    // Make passes until the goal or Ctrl-C.
    let camera = cameras::choose(&flags, &input, &placed)?;
    if flags.light == LightChoice::Headlamp {
        input.model.lights.push(light::headlamp(&camera, &placed));
    }
    let goal = Goal::new(flags.spp, flags.time, flags.noise);
    let settings = flags.settings(input.up);
    let job = Job { flags: &flags, input: &input, placed: &placed, goal, session };
    let done = match flags.turntable {
        Some(frames) => job.circle(&camera, frames)?,
        None => job.picture(&camera, &output, raw.as_ref())?,
    };
    let renderer = Renderer::new(&input.model, &placed, &camera, settings)?;
    let (layers, missing) = files::write_layers(&renderer, layers, session)?;
    let cancelled = session.cancel.is_cancelled();
    let errors = match (&flags.compare, &reference) {
        (Some(file), Some(reference)) => {
            treelet_render::compare::errors(&done.film.means()?, reference)
                .map(|errors| Differences::new(file.display().to_string(), &errors))
        }
        _ => None,
    };

    // Tell.
    let (skipped_triangles, skipped_instances) = input::skipped(&placed);
    let Done { film, made, frames } = done;
    let complaint = light::complaint(&input.model, &film)?;
    complaint.iter().for_each(|complaint| warn(complaint));
    input.model.warnings.extend(complaint);
    let noise = film.noise();
    let report = Report {
        scene: input.name,
        output: flags.output.display().to_string(),
        width: settings.width,
        height: settings.height,
        passes: film.passes(),
        cancelled,
        camera: camera::words(&camera),
        up: ["x", "y", "z"][input.up],
        seed: flags.seed,
        bounces: flags.bounces,
        exposure: flags.exposure,
        clamp: flags.clamp,
        softened: flags.soften,
        denoised: flags.denoise,
        noise: noise.is_finite().then_some(noise),
        samples: film.samples(),
        threads: session.threads,
        quality,
        builder,
        plan: made_by,
        choice,
        triangles_stored: input.model.triangles_stored(),
        triangles_placed: input.model.triangles_placed(),
        placements: input.model.placements.len() as u64,
        skipped_triangles,
        skipped_instances,
        rays: made.stats.rays,
        rays_per_second: made.stats.rays as f64 / made.time.as_secs_f64().max(1e-9),
        query_share: made.query_share(),
        seconds: Seconds {
            read: input.time.as_secs_f64(),
            build: build_time.as_secs_f64(),
            render: made.time.as_secs_f64(),
        },
        aov: layers,
        aov_missing: missing,
        frames,
        errors,
        warnings: input.model.warnings,
    };
    report::tell(&report, &made, &goal);
    Outcome::new("render", &report, if cancelled { Ending::Cancelled } else { Ending::Done })
}

/// What rays are traced against, and what was said of it.
struct Grown {
    placed: PlacedModel,
    time: Duration,
    /// Of the largest tree.
    builder: &'static str,
    made_by: String,
    choice: Option<ChoiceReport>,
}

/// Builds the trees, and tells how.
fn grow(input: &Input, options: &BuildOptions<'_>, session: &Session) -> Result<Grown, Failure> {
    let building = Instant::now();
    let placed = input.build(options, session)?;
    let time = building.elapsed();
    input::warn_of_skipped(&placed);
    let choice = ChoiceReport::of(&placed);
    let largest = placed.reports().max_by_key(|report| report.triangles);
    let (builder, made_by) = match largest {
        Some(report) => (report.builder, report.plan.clone()),
        None => (options.plan().builder.info().name, options.plan().to_string()),
    };
    say(&format!("{made_by} tree built in {}", text::time(time)));
    choice.iter().for_each(ChoiceReport::tell);
    Ok(Grown { placed, time, builder, made_by, choice })
}

/// The picture of --env takes the place of the scene's sky.
fn add_environment(flags: &Flags, input: &mut Input) -> Result<(), Failure> {
    let Some(file) = &flags.env else { return Ok(()) };
    // Environments have y up; for another axis they are turned.
    let world_from_environment = match input.up {
        2 => Affine([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0]]),
        _ => Affine::IDENTITY,
    };
    input.model.environment = Some(Environment {
        image: input.model.images.len(),
        projection: Projection::LatLong,
        world_from_environment,
        scale: [1.0; 3],
    });
    input.model.images.push(files::read_picture(file)?);
    Ok(())
}

/// What all pictures of a run share.
struct Job<'a> {
    flags: &'a Flags,
    input: &'a Input,
    placed: &'a PlacedModel,
    goal: Goal,
    session: &'a Session,
}

/// Pictures that were made.
struct Done {
    /// The last one.
    film: Film,
    /// What all of them took.
    made: Made,
    /// The files of a turntable.
    frames: Vec<String>,
}

impl Job<'_> {
    /// Renders and writes one picture.
    fn picture(
        &self,
        camera: &Camera,
        output: &Output,
        raw: Option<&Output>,
    ) -> Result<Done, Failure> {
        let settings = self.flags.settings(self.input.up);
        let renderer = Renderer::new(&self.input.model, self.placed, camera, settings)?;
        let mut film = renderer.film()?;
        let picture = Picture::new(output, self.flags.exposure);
        let made =
            passes::make_passes(&renderer, &mut film, &self.goal, Some(&picture), self.session)?;
        let mut means = film.means()?;
        if raw.is_some() || picture.has_layers() {
            match renderer.layers(&self.session.cancel) {
                // After Ctrl-C the picture as it is must do.
                Err(RenderError::Cancelled) => {}
                layers => {
                    let layers = layers?;
                    if let Some(raw) = raw {
                        Picture::new(raw, self.flags.exposure).write(&film)?;
                        means = denoise(&film, &layers)?;
                    }
                    picture.write_means(&film, &means, Some(&layers))?;
                }
            }
        }
        if let Some(protocol) = self.flags.show {
            let (width, height) = (film.width(), film.height());
            let image = treelet_render::Image::of_radiance(width, height, &means, picture.tone())?;
            crate::show::draw(&image, protocol)?;
        }
        Ok(Done { film, made, frames: Vec::new() })
    }

    /// Renders pictures on a circle around the scene.
    fn circle(&self, camera: &Camera, frames: u32) -> Result<Done, Failure> {
        let job = Job { goal: self.goal.of_frames(frames), ..*self };
        let mut total = Made::default();
        let (mut names, mut last) = (Vec::new(), None);
        for frame in 0..frames {
            let share = frame as f32 / frames as f32;
            let camera = cameras::turned(camera, self.placed, self.input.up, share);
            let file = files::beside(&self.flags.output, &format!("{frame:03}"));
            let output = Output::prepare(&file)?;
            let raw = self.flags.denoise.then(|| Output::prepare(&files::beside(&file, "raw")));
            let done = match job.picture(&camera, &output, raw.transpose()?.as_ref()) {
                // Pictures that are there are kept.
                Err(Failure::Cancelled) if last.is_some() => break,
                done => done?,
            };
            total.stats = total.stats.and(done.made.stats);
            total.time += done.made.time;
            names.push(file.display().to_string());
            last = Some(done.film);
            if self.session.cancel.is_cancelled() {
                break;
            }
        }
        let film = last.ok_or(Failure::Cancelled)?;
        Ok(Done { film, made: total, frames: names })
    }
}
