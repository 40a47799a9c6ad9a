//! `treelet render`: a picture of a scene, better with every pass.

use std::path::PathBuf;
use std::str::FromStr;
use std::time::{Duration, Instant};

use clap::Args;
use clap::builder::{PathBufValueParser, RangedU64ValueParser, TypedValueParser as _};
use serde::Serialize;
use treelet::BuildOptions;
use treelet_model::{Camera, PlacedModel};
use treelet_render::{Film, RenderError, Renderer, Settings, ToneMap};

use crate::camera::{self, CameraWords};
use crate::ending::{Ending, Failure};
use crate::input::{self, Input, InvalidFlag, SceneFlags};
use crate::output::Output;
use crate::progress::Line;
use crate::session::{Outcome, Session, say};
use crate::text;
use crate::tree_flags::TreeFlags;

/// Seconds of passes where neither --spp nor --time is given: with reading, building and writing,
/// the whole job stays under a minute on two cores.
const TIME: Duration = Duration::from_secs(35);

/// The longest --time, half a minute short of 32 years; a `Duration` holds it.
const LONGEST: f64 = 1e9;

/// The picture so far is written this often.
const WRITE_EVERY: Duration = Duration::from_secs(3);

/// Render a picture of a scene, or of the built-in one
#[derive(Debug, Args)]
pub(crate) struct Flags {
    /// A scene file: glTF, OBJ, PLY or STL, also as .gz or .zst [default: the built-in scene].
    scene: Option<PathBuf>,

    /// The picture to write, as PNG; its name ends in .png.
    #[arg(short, long, default_value = "treelet.png", value_name = "FILE.png", value_parser = PathBufValueParser::new().try_map(png_file))]
    output: PathBuf,

    /// Width and height in pixels.
    #[arg(long, default_value = "960x540", value_name = "WxH")]
    size: Size,

    /// Passes, each a sample a pixel.
    #[arg(long, value_name = "N", conflicts_with = "time", value_parser = RangedU64ValueParser::<u32>::new().range(1..))]
    spp: Option<u32>,

    /// Seconds to spend on passes; at least one is made [default: 35].
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    time: Option<Duration>,

    /// How often light may be scattered on its way.
    #[arg(long, value_name = "N", default_value_t = Settings::default().max_bounces)]
    bounces: u32,

    #[command(flatten)]
    tree: TreeFlags,

    /// Where the camera stands, what it looks at, and the degrees from the top to the bottom edge:
    /// from=x,y,z at=x,y,z fov=40 [default: the scene's first camera, or one that sees it all].
    #[arg(long, value_name = "from=x,y,z at=x,y,z fov=D", allow_hyphen_values = true)]
    camera: Option<CameraWords>,

    /// Another seed, another noise.
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,

    /// Brighter or darker, in stops: 1 doubles, -1 halves.
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_negative_numbers = true, value_parser = stops)]
    exposure: f32,

    /// Neither cut fireflies off nor soften caustics: noisier, and right in the end.
    #[arg(long)]
    exact: bool,

    /// More pictures of what rays found and did, beside the first: normal, depth, visits, tests.
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = aov_names())]
    aov: Vec<String>,

    /// What to do with triangles and instances that cannot be used.
    #[arg(long, value_enum, default_value_t = InvalidFlag::Skip)]
    invalid: InvalidFlag,

    #[command(flatten)]
    scene_flags: SceneFlags,
}

#[derive(Serialize)]
struct Report {
    scene: String,
    output: String,
    width: u32,
    height: u32,
    /// Whole passes in the picture: it equals that of `--spp passes`.
    passes: u32,
    cancelled: bool,
    camera: String,
    up: &'static str,
    seed: u64,
    bounces: u32,
    exposure: f32,
    /// Whether fireflies were kept and caustics left hard.
    exact: bool,
    threads: usize,
    quality: &'static str,
    builder: &'static str,
    plan: String,
    triangles_stored: u64,
    triangles_placed: u64,
    placements: u64,
    skipped_triangles: u64,
    skipped_instances: u64,
    rays: u64,
    rays_per_second: f64,
    seconds: Seconds,
    aov: Vec<Layer>,
    /// Layers that were wanted and, after Ctrl-C, not made.
    aov_missing: Vec<String>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct Seconds {
    read: f64,
    build: f64,
    render: f64,
}

/// A picture beside the picture.
#[derive(Serialize)]
struct Layer {
    name: String,
    file: String,
}

/// Width and height of a picture.
#[derive(Clone, Copy, Debug)]
struct Size {
    width: u32,
    height: u32,
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parse = |text: &str| text.parse().ok().filter(|&side| side > 0);
        let sides = text.split_once('x').and_then(|(width, height)| {
            Some(Self { width: parse(width)?, height: parse(height)? })
        });
        let size = sides.ok_or("two whole numbers above 0 are needed, as in 1280x720")?;
        treelet_render::image::check_size(size.width, size.height).map_err(|e| e.to_string())?;
        Ok(size)
    }
}

/// The name of a picture; other formats are not written, so other names would lie.
fn png_file(file: PathBuf) -> Result<PathBuf, &'static str> {
    let png = file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
    if png { Ok(file) } else { Err("pictures are PNG: a name that ends in .png is needed") }
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().filter(|&time: &f64| time > 0.0 && time <= LONGEST);
    let seconds = seconds.and_then(|time| Duration::try_from_secs_f64(time).ok());
    seconds.ok_or_else(|| "a number of seconds above 0 and up to 1e9 is needed".into())
}

fn stops(text: &str) -> Result<f32, String> {
    let stops = text.parse().ok().filter(|stops| (-30.0..=30.0).contains(stops));
    stops.ok_or_else(|| "a number of stops from -30 to 30 is needed".into())
}

/// How many passes to make.
#[derive(Clone, Copy, Debug)]
enum Goal {
    Passes(u32),
    Time(Duration),
}

/// Reads, builds, renders, writes.
pub(crate) fn run(flags: Flags, session: &Session) -> Result<Outcome, Failure> {
    // Check what can be checked before time is spent.
    let output = Output::prepare(&flags.output)?;
    let layers = layer_files(&flags)?;
    keep_scene(&flags, &output, &layers)?;

    // Read the scene and build its tree.
    let input = Input::load(flags.scene.as_ref(), &flags.scene_flags, session)?;
    let optimizers = flags.tree.optimizers();
    let options = flags.tree.options(optimizers.as_deref());
    let options = BuildOptions { invalid: flags.invalid.into(), ..options };
    let plan = options.plan();
    let building = Instant::now();
    let placed = input.build(&options, session)?;
    let build_time = building.elapsed();
    input::warn_of_skipped(&placed);
    say(&format!("{plan} tree built in {}", text::time(build_time)));

    // Make passes until the goal or Ctrl-C.
    let camera = choose_camera(&flags, &input, &placed)?;
    let settings = Settings {
        width: flags.size.width,
        height: flags.size.height,
        max_bounces: flags.bounces,
        seed: flags.seed,
        up: input.up,
        ..if flags.exact { Settings::exact() } else { Settings::default() }
    };
    let renderer = Renderer::new(&input.model, &placed, &camera, settings)?;
    let goal = match flags.spp {
        Some(passes) => Goal::Passes(passes),
        None => Goal::Time(flags.time.unwrap_or(TIME)),
    };
    let mut film = renderer.film()?;
    let picture = Picture { output: &output, tone: tone_map(flags.exposure) };
    let made = make_passes(&renderer, &mut film, goal, &picture, session)?;
    let (layers, missing) = write_layers(&renderer, layers, session)?;
    let cancelled = session.cancel.is_cancelled();

    // Tell.
    let (skipped_triangles, skipped_instances) = input::skipped(&placed);
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
        exact: flags.exact,
        threads: session.threads,
        quality: plan.quality.name(),
        builder: plan.builder.info().name,
        plan: plan.to_string(),
        triangles_stored: input.model.triangles_stored(),
        triangles_placed: input.model.triangles_placed(),
        placements: input.model.placements.len() as u64,
        skipped_triangles,
        skipped_instances,
        rays: made.rays,
        rays_per_second: made.rays as f64 / made.time.as_secs_f64().max(1e-9),
        seconds: Seconds {
            read: input.time.as_secs_f64(),
            build: build_time.as_secs_f64(),
            render: made.time.as_secs_f64(),
        },
        aov: layers,
        aov_missing: missing,
        warnings: input.model.warnings,
    };
    tell(&report, &made, goal);
    Outcome::new("render", &report, if cancelled { Ending::Cancelled } else { Ending::Done })
}

/// The camera of the command line, of the file, or one that sees everything.
fn choose_camera(flags: &Flags, input: &Input, placed: &PlacedModel) -> Result<Camera, Failure> {
    if let Some(words) = &flags.camera {
        let camera = words.camera(input.up);
        return camera.ok_or_else(|| Failure::Usage("--camera: the numbers are too large".into()));
    }
    let aspect = flags.size.width as f32 / flags.size.height as f32;
    let framing = || Camera::framing(&placed.scene.bounds(), input.up, aspect);
    Ok(input.model.cameras.first().cloned().unwrap_or_else(framing))
}

/// Where the film goes, and how it is shown.
struct Picture<'a> {
    output: &'a Output,
    tone: ToneMap,
}

impl Picture<'_> {
    /// Replaces the file by the film as it is now, whole.
    fn write(&self, film: &Film) -> Result<(), Failure> {
        Ok(self.output.replace(&film.to_image(&self.tone)?.encode_png()?)?)
    }
}

/// The usual curve, so many stops brighter.
fn tone_map(stops: f32) -> ToneMap {
    ToneMap { exposure: ToneMap::default().exposure * libm::exp2f(stops) }
}

/// What the passes took.
struct Made {
    rays: u64,
    time: Duration,
}

/// Adds passes to the film, and writes the picture after the first, every few seconds, and at the
/// end. Ctrl-C discards the pass under way.
fn make_passes(
    renderer: &Renderer<'_>,
    film: &mut Film,
    goal: Goal,
    picture: &Picture<'_>,
    session: &Session,
) -> Result<Made, Failure> {
    let line = match goal {
        Goal::Passes(passes) => Line::bar(passes.into(), "first pass"),
        Goal::Time(time) => Line::bar(time.as_millis() as u64, "first pass"),
    };
    let start = Instant::now();
    let mut made = Made { rays: 0, time: Duration::ZERO };
    let (mut written, mut write_time) = (0, start);
    loop {
        match renderer.pass(film, &session.cancel) {
            Ok(stats) => made.rays += stats.rays,
            Err(RenderError::Cancelled) if film.passes() == 0 => return Err(Failure::Cancelled),
            Err(RenderError::Cancelled) => break,
            Err(error) => return Err(error.into()),
        }
        made.time = start.elapsed();
        if written == 0 || write_time.elapsed() >= WRITE_EVERY {
            picture.write(film)?;
            if written == 0 {
                line.say(&format!("first pass in {}", picture.output.path().display()));
            }
            (written, write_time) = (film.passes(), Instant::now());
        }
        let rate = format!("pass {}, {}rays/s", film.passes(), text::rate(made.rays, made.time));
        let done = match goal {
            Goal::Passes(passes) => {
                line.set(film.passes().into(), rate);
                film.passes() >= passes
            }
            Goal::Time(time) => {
                line.set(made.time.as_millis() as u64, rate);
                // Another pass is begun if it can be expected to end in time.
                made.time + made.time / film.passes() > time
            }
        };
        if done {
            break;
        }
    }
    if written != film.passes() {
        picture.write(film)?;
    }
    Ok(made)
}

/// The files of the layers that are wanted, each checked.
fn layer_files(flags: &Flags) -> Result<Vec<(String, Output)>, Failure> {
    let mut layers: Vec<(String, Output)> = Vec::new();
    for name in &flags.aov {
        if layers.iter().all(|(other, _)| other != name) {
            // `treelet.png` has `treelet.normal.png` beside it.
            let file = flags.output.with_extension(format!("{name}.png"));
            layers.push((name.clone(), Output::prepare(&file)?));
        }
    }
    Ok(layers)
}

/// Refuses to write over the scene.
fn keep_scene(flags: &Flags, output: &Output, layers: &[(String, Output)]) -> Result<(), Failure> {
    // A scene that is not there is told when it is read.
    let Some(scene) = flags.scene.as_ref().and_then(|scene| scene.canonicalize().ok()) else {
        return Ok(());
    };
    let mut outputs = std::iter::once(output).chain(layers.iter().map(|(_, output)| output));
    match outputs.find(|output| output.path().canonicalize().is_ok_and(|file| file == scene)) {
        None => Ok(()),
        Some(output) => Err(Failure::Usage(format!(
            "{}: is the scene, which would be written over; choose another name with -o",
            output.path().display()
        ))),
    }
}

/// What was done, in a few lines, and how to get more.
fn tell(report: &Report, made: &Made, goal: Goal) {
    let Report { output, width, height, passes, .. } = report;
    say(&format!(
        "{output}: {width}x{height}, {}, {} in {} ({}rays/s)",
        text::things((*passes).into(), "pass"),
        text::things(made.rays, "ray"),
        text::time(made.time),
        text::rate(made.rays, made.time)
    ));
    for layer in &report.aov {
        say(&format!("{}: {}", layer.file, layer.name));
    }
    if report.cancelled {
        say(&format!("cancelled; the picture is that of --spp {passes}"));
        if !report.aov_missing.is_empty() {
            say(&format!("not made: --aov {}", report.aov_missing.join(",")));
        }
    } else if let Goal::Time(_) = goal {
        if !report.exact {
            say("fireflies are cut off and caustics softened; --exact does neither");
        }
        say(&format!(
            "the same picture: --spp {passes}; a cleaner one: --spp {}",
            passes.saturating_mul(4)
        ));
    }
}

/// The names that `--aov` takes.
fn aov_names() -> clap::builder::PossibleValuesParser {
    clap::builder::PossibleValuesParser::new(treelet_render::aov::ALL.iter().map(|info| info.name))
}

/// Renders and writes the layers; the names of those for which Ctrl-C left no time come second.
fn write_layers(
    renderer: &Renderer<'_>,
    layers: Vec<(String, Output)>,
    session: &Session,
) -> Result<(Vec<Layer>, Vec<String>), Failure> {
    let (mut written, mut missing) = (Vec::new(), Vec::new());
    for (name, output) in layers {
        let Some(aov) = treelet_render::Aov::by_name(&name) else { continue };
        if session.cancel.is_cancelled() {
            missing.push(name);
            continue;
        }
        let image = match renderer.aov(aov, &session.cancel) {
            // The picture is there, so what is missing is told, not mourned.
            Err(RenderError::Cancelled) => {
                missing.push(name);
                continue;
            }
            image => image?,
        };
        output.replace(&image.encode_png()?)?;
        written.push(Layer { name, file: output.path().display().to_string() });
    }
    Ok((written, missing))
}
