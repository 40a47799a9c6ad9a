//! The words of `treelet render`, and what they may be.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use clap::builder::{PathBufValueParser, RangedU64ValueParser, TypedValueParser as _};
use clap::{Args, ValueEnum};
use treelet_render::Settings;

use super::clip::FrameRange;
use super::light::LightChoice;
use super::passes::TIME;
use crate::camera::CameraChoice;
use crate::input::{InvalidFlag, SceneFlags};
use crate::show::Protocol;
use crate::tree_flags::TreeFlags;

/// The longest --time, half a minute short of 32 years; a `Duration` holds it.
const LONGEST: f64 = 1e9;

/// Rays that a path asks each time that light is scattered: where it goes on, and whether a light is seen.
const RAYS_A_SCATTERING: f64 = 2.0;

/// How often light is taken to be scattered where more often is allowed: an estimate.
const SCATTERINGS: f64 = 3.0;

/// Rays that a thread asks in a second, shading included, about.
const RAYS_A_SECOND: f64 = 1e6;

/// Render a picture of a scene, or of the built-in one
#[derive(Debug, Args)]
pub(crate) struct Flags {
    /// A scene file: glTF, OBJ, PLY, STL, OFF or pbrt, also as .gz or .zst [default: the built-in scene].
    pub(super) scene: Option<PathBuf>,

    /// The picture to write: .png, or with all its light .hdr, or with layers too .exr.
    #[arg(short, long, default_value = "treelet.png", value_name = "FILE", value_parser = PathBufValueParser::new().try_map(picture_file))]
    pub(super) output: PathBuf,

    /// Width and height in pixels.
    #[arg(long, default_value = "960x540", value_name = "WxH")]
    pub(super) size: Size,

    /// Passes, each a sample a pixel.
    #[arg(long, value_name = "N", conflicts_with = "time", value_parser = RangedU64ValueParser::<u32>::new().range(1..))]
    pub(super) spp: Option<u32>,

    /// Seconds to spend on passes; at least one is made [default: 35].
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub(super) time: Option<Duration>,

    /// Sample on only where the picture is noisier than so many percent, and stop when nothing is;
    /// --spp or --time bound it.
    #[arg(long, value_name = "PERCENT", value_parser = percent)]
    pub(super) noise: Option<f32>,

    /// How often light may be scattered on its way.
    #[arg(long, value_name = "N", default_value_t = Settings::default().max_bounces)]
    pub(super) bounces: u32,

    #[command(flatten)]
    pub(super) tree: TreeFlags,

    /// A camera of the scene by its name, or where it stands, what it looks at, and the degrees from
    /// the top to the bottom edge: from=x,y,z at=x,y,z fov=40, and with a lens lens=RADIUS
    /// focus=DISTANCE, or orthographic height=H [default: the scene's first camera, or one that sees
    /// it all].
    #[arg(long, value_name = "NAME | from=x,y,z at=x,y,z fov=D", allow_hyphen_values = true)]
    pub(super) camera: Option<CameraChoice>,

    /// List the scene's cameras, and render nothing.
    #[arg(long)]
    pub(super) cameras: bool,

    /// So many pictures on a circle around the middle of the scene: FILE.000.png and so on.
    #[arg(long, value_name = "N", conflicts_with_all = ["cameras", "aov", "compare"], value_parser = RangedU64ValueParser::<u32>::new().range(1..=9999))]
    pub(super) turntable: Option<u32>,

    /// Play a clip, a picture a frame: `0..120` is 120 frames, `0..=120` one more, `7` that one alone,
    /// `..` the whole clip once. Frame N shows the time N / fps; past its end a clip begins anew. `#`s
    /// in the name of -o stand for the number, as in out.####.png.
    #[arg(long, value_name = "A..B", conflicts_with_all = ["cameras", "turntable", "aov", "compare", "show"])]
    pub(super) frames: Option<FrameRange>,

    /// Frames a second [default: 24].
    #[arg(long, value_name = "N", value_parser = frame_rate)]
    pub(super) fps: Option<f64>,

    /// The clip to play, by its name or by its number, from 1 [default: the first].
    #[arg(long, value_name = "NAME | N")]
    pub(super) clip: Option<String>,

    /// Make the frames a video: of any kind that ffmpeg writes, or an animated .png; without ffmpeg it
    /// is an animated .png. The frames are kept, too, if -o has `#`s [default --frames: ..].
    #[arg(long, value_name = "FILE", conflicts_with_all = ["cameras", "turntable", "aov", "compare", "show"])]
    pub(super) video: Option<PathBuf>,

    /// A picture of all that is far away, as light and background: .hdr, .exr or another picture, in
    /// longitude and latitude.
    #[arg(long, value_name = "FILE")]
    pub(super) env: Option<PathBuf>,

    /// What lights the scene: its own lights, or the sky; or beside them a lamp where the camera
    /// stands.
    #[arg(long, value_enum, default_value_t)]
    pub(super) light: LightChoice,

    /// Another seed, another noise.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(super) seed: u64,

    /// Brighter or darker, in stops: 1 doubles, -1 halves.
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, allow_negative_numbers = true, value_parser = stops)]
    pub(super) exposure: f32,

    /// Cut light off that one path brings indirectly, above so many times white: fewer fireflies,
    /// and a little too dark.
    #[arg(long, value_name = "WHITES", value_parser = clamp)]
    pub(super) clamp: Option<f32>,

    /// Soften caustics: shiny surfaces count as less shiny to light that was scattered before.
    #[arg(long)]
    pub(super) soften: bool,

    /// Smooth the picture, guided by colours and normals of what is seen; the picture as it is lies
    /// beside it, as FILE.raw.png.
    #[arg(long)]
    pub(super) denoise: bool,

    /// Print how far the picture is from a reference, an .exr or .hdr of the same size.
    #[arg(long, value_name = "FILE")]
    pub(super) compare: Option<PathBuf>,

    /// Draw the picture in the terminal, in the way it understands or in the one that is named.
    #[arg(long, value_name = "HOW", num_args = 0..=1, require_equals = true, default_missing_value = "auto", value_enum)]
    pub(super) show: Option<Protocol>,

    /// More pictures of what rays found and did, beside the first: normal, depth, visits, tests ...
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = aov_names())]
    pub(super) aov: Vec<String>,

    /// What to do with triangles and instances that cannot be used.
    #[arg(long, value_enum, default_value_t = InvalidFlag::Skip)]
    pub(super) invalid: InvalidFlag,

    #[command(flatten)]
    pub(super) scene_flags: SceneFlags,
}

impl Flags {
    /// About how many rays the picture will ask.
    pub(super) fn rays(&self, threads: usize) -> u64 {
        let frames = f64::from(self.turntable.unwrap_or(1));
        let pixels = f64::from(self.size.width) * f64::from(self.size.height);
        let path = RAYS_A_SCATTERING * f64::from(self.bounces.saturating_add(1)).min(SCATTERINGS);
        let passes = self.spp.map(|spp| frames * pixels * path * f64::from(spp));
        let time = self.time.unwrap_or(TIME).as_secs_f64();
        passes.unwrap_or(frames * time * threads as f64 * RAYS_A_SECOND) as u64
    }

    /// The renderer's settings, for a scene with that axis up.
    pub(super) fn settings(&self, up: usize) -> Settings {
        Settings {
            width: self.size.width,
            height: self.size.height,
            max_bounces: self.bounces,
            seed: self.seed,
            up,
            clamp_indirect: self.clamp.unwrap_or(f32::INFINITY),
            regularize: self.soften,
            ..Settings::default()
        }
    }
}

/// Width and height of a picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Size {
    pub(super) width: u32,
    pub(super) height: u32,
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

/// What a picture is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    Png,
    Exr,
    Hdr,
}

impl Format {
    /// What a name ends in.
    pub(super) fn of(file: &Path) -> Option<Self> {
        let extension = file.extension()?.to_str()?;
        Self::from_str(extension, true).ok()
    }
}

/// The name of a picture; other formats are not written, so other names would lie.
fn picture_file(file: PathBuf) -> Result<PathBuf, &'static str> {
    if Format::of(&file).is_some() {
        Ok(file)
    } else {
        Err("pictures are PNG, EXR or HDR: a name that ends in .png, .exr or .hdr is needed")
    }
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().filter(|&time: &f64| time > 0.0 && time <= LONGEST);
    let seconds = seconds.and_then(|time| Duration::try_from_secs_f64(time).ok());
    seconds.ok_or_else(|| "a number of seconds above 0 and up to 1e9 is needed".into())
}

/// The slowest and the fastest clip, frames a second.
const RATES: std::ops::RangeInclusive<f64> = 0.01..=1000.0;

fn frame_rate(text: &str) -> Result<f64, String> {
    let rate = text.parse().ok().filter(|rate| RATES.contains(rate));
    rate.ok_or_else(|| "a number of frames a second from 0.01 to 1000 is needed".into())
}

fn stops(text: &str) -> Result<f32, String> {
    let stops = text.parse().ok().filter(|stops| (-30.0..=30.0).contains(stops));
    stops.ok_or_else(|| "a number of stops from -30 to 30 is needed".into())
}

/// The share of 1 that so many percent are.
fn percent(text: &str) -> Result<f32, String> {
    let percent = text.trim_end_matches('%').parse().ok();
    let share = percent.filter(|percent: &f32| (0.01..=100.0).contains(percent));
    let share = share.map(|percent| percent / 100.0);
    share.ok_or_else(|| "a number of percent from 0.01 to 100 is needed".into())
}

fn clamp(text: &str) -> Result<f32, String> {
    let whites = text.parse().ok().filter(|&whites: &f32| whites > 0.0 && whites.is_finite());
    whites.ok_or_else(|| "a number above 0 is needed, as in --clamp 4".into())
}

/// The names that `--aov` takes.
fn aov_names() -> clap::builder::PossibleValuesParser {
    clap::builder::PossibleValuesParser::new(treelet_render::aov::ALL.iter().map(|info| info.name))
}
