//! The scene that a verb works on: a file, or the built-in one.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};
use treelet::bounds::Aabb;
use treelet::{BuildOptions, Context};
use treelet_import::Fault;
use treelet_model::{Changes, Model, PlaceError, PlacedModel};

use crate::ending::Failure;
use crate::progress::{Line, Stages};
use crate::session::{Session, say, warn};
use crate::text;

/// The flags that belong to a scene.
#[derive(Debug, Args)]
pub(crate) struct SceneFlags {
    /// Let the scene name files outside its own folder.
    #[arg(long)]
    pub(crate) allow_outside: bool,

    /// Bytes that reading may take in all, files and arrays together [default: 8 GiB].
    #[arg(long, value_name = "N")]
    pub(crate) max_bytes: Option<u64>,

    /// How many times its size a file may unpack to, or be made into [default: 256].
    #[arg(long, value_name = "N")]
    pub(crate) max_ratio: Option<u64>,

    /// Which scene of a file of several, counted from 0 [default: the one that it shows].
    #[arg(long, value_name = "N")]
    pub(crate) scene_number: Option<u64>,

    /// The axis that points up [default: y for glTF and OBJ, z for STL, for PLY the shorter of y
    /// and z].
    #[arg(long, value_enum)]
    pub(crate) up: Option<Up>,
}

/// An axis that may point up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Up {
    Y,
    Z,
}

impl Up {
    /// 1 or 2.
    pub(crate) fn axis(self) -> usize {
        match self {
            Self::Y => 1,
            Self::Z => 2,
        }
    }

    /// A guess for a file of that format and size.
    ///
    /// glTF says y; OBJ has no rule but a habit. STL comes from workshops, where z is up. PLY comes
    /// from everywhere: scenes are wider than they are tall, so the clearly shorter of y and z is up.
    fn guess(format: &str, bounds: &Aabb) -> Self {
        /// How much shorter z must be than y before it counts as clearly shorter.
        const CLEARLY: f32 = 0.9;
        let [_, y, z] = bounds.extent();
        match format {
            "STL" | "stl" => Self::Z,
            "PLY" | "ply" if z < CLEARLY * y => Self::Z,
            _ => Self::Y,
        }
    }
}

/// A scene that was read.
pub(crate) struct Input {
    /// The file's name, or `demo`.
    pub(crate) name: String,
    pub(crate) model: Model,
    pub(crate) up: usize,
    /// How long reading took.
    pub(crate) time: Duration,
}

impl SceneFlags {
    /// What the importer is told.
    fn options(&self, session: &Session) -> treelet_import::Options {
        let usual = treelet_import::Limits::default();
        treelet_import::Options {
            allow_outside: self.allow_outside,
            limits: treelet_import::Limits {
                max_bytes: self.max_bytes.unwrap_or(usual.max_bytes),
                max_ratio: self.max_ratio.unwrap_or(usual.max_ratio),
            },
            cancel: session.cancel.clone(),
            scene: self.scene_number.map(|number| number.to_string()),
            progress: None,
        }
    }

    /// The words that make a scene be read in the same way, each after a space.
    pub(crate) fn words(&self) -> String {
        let mut words = String::new();
        if self.allow_outside {
            words += " --allow-outside";
        }
        let numbers = [
            ("--max-bytes", self.max_bytes),
            ("--max-ratio", self.max_ratio),
            ("--scene-number", self.scene_number),
        ];
        for (flag, number) in numbers {
            if let Some(number) = number {
                words += &format!(" {flag} {number}");
            }
        }
        words
    }
}

/// The flag that lets a scene be read in spite of a fault.
fn flag_against(fault: &Fault) -> Option<&'static str> {
    match fault {
        Fault::Outside { .. } => Some("--allow-outside"),
        Fault::TooBig { .. } => Some("--max-bytes"),
        Fault::Bomb { .. } | Fault::Repeats { .. } => Some("--max-ratio"),
        _ => None,
    }
}

impl Input {
    /// Reads the scene, or makes the built-in one.
    pub(crate) fn load(
        scene: Option<&PathBuf>,
        flags: &SceneFlags,
        session: &Session,
    ) -> Result<Self, Failure> {
        let start = Instant::now();
        let (name, model) = match scene {
            None => ("demo".to_owned(), crate::demo::demo()),
            Some(file) => {
                let line = Line::spinner("reading");
                let progress = Some(line.reader());
                let options = treelet_import::Options { progress, ..flags.options(session) };
                let model = treelet_import::load(file, &options);
                drop(line);
                let model = model.map_err(|error| match &error.fault {
                    Fault::Cancelled(_) => Failure::Cancelled,
                    fault => {
                        let flag = flag_against(fault);
                        Failure::with_flag(error, flag)
                    }
                })?;
                (file.display().to_string(), model)
            }
        };
        let time = start.elapsed();
        for warning in &model.warnings {
            warn(warning);
        }
        let up = flags.up.unwrap_or_else(|| guess_up(scene, &model)).axis();
        let input = Self { name, model, up, time };
        say(&input.summary());
        Ok(input)
    }

    /// Builds what rays are traced against.
    pub(crate) fn build(
        &self,
        options: &BuildOptions<'_>,
        session: &Session,
    ) -> Result<PlacedModel, Failure> {
        self.build_by(options, session, |options| PlacedModel::build(&self.model, options))
    }

    /// Builds what changed since an earlier build.
    pub(crate) fn update(
        &self,
        placed: &PlacedModel,
        changes: &Changes,
        options: &BuildOptions<'_>,
        session: &Session,
    ) -> Result<PlacedModel, Failure> {
        self.build_by(options, session, |options| placed.updated(&self.model, changes, options))
    }

    /// Builds, watched and so that it can be stopped.
    fn build_by(
        &self,
        options: &BuildOptions<'_>,
        session: &Session,
        build: impl FnOnce(&BuildOptions<'_>) -> Result<PlacedModel, PlaceError>,
    ) -> Result<PlacedModel, Failure> {
        let stages = Stages::new("building");
        let watch = |progress| stages.watch(progress);
        let context = Context { cancel: session.cancel.clone(), progress: Some(&watch) };
        let options = BuildOptions { context, ..options.clone() };
        build(&options).map_err(|error: PlaceError| {
            if error.is_cancelled() { Failure::Cancelled } else { Failure::from(error) }
        })
    }

    /// What was read, in a line.
    fn summary(&self) -> String {
        let stored = self.model.triangles_stored();
        let placed = self.model.triangles_placed();
        let placements = self.model.placements.len() as u64;
        let mut line = format!("{}: {}", self.name, text::things(stored, "triangle"));
        if placed != stored {
            line += &format!(
                ", seen as {} in {} instances",
                text::count(placed),
                text::count(placements)
            );
        }
        line + &format!("; ready in {}", text::time(self.time))
    }
}

/// What the file says, or the guess from its extension below any wrapper.
fn guess_up(scene: Option<&PathBuf>, model: &Model) -> Up {
    match model.up {
        Some(1) => return Up::Y,
        Some(2) => return Up::Z,
        _ => {}
    }
    let Some(file) = scene else { return Up::Y };
    let name = file.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let inner = name.trim_end_matches(".gz").trim_end_matches(".zst");
    let format = inner.rsplit('.').next().unwrap_or_default();
    let parts = model.objects.iter().flat_map(|object| &object.parts);
    let bounds = parts.fold(Aabb::EMPTY, |bounds, part| bounds.union(&part.mesh.bounds()));
    Up::guess(format, &bounds)
}

/// What to do with input that cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum InvalidFlag {
    /// Stop and name the first offender.
    Error,
    /// Leave it out and count it.
    Skip,
}

impl From<InvalidFlag> for treelet::Invalid {
    fn from(flag: InvalidFlag) -> Self {
        match flag {
            InvalidFlag::Error => Self::Error,
            InvalidFlag::Skip => Self::Skip,
        }
    }
}

/// Tells what a build left out.
pub(crate) fn warn_of_skipped(placed: &PlacedModel) {
    let (triangles, instances) = skipped(placed);
    if triangles > 0 {
        let first = placed.reports().find_map(|report| report.skipped.first_triangle);
        let first = first.map_or(String::new(), |(mesh, triangle, defect)| {
            format!(", the first being triangle {triangle} of a mesh {mesh}: {defect}")
        });
        warn(&format!("{} left out{first}", text::things(triangles, "triangle")));
    }
    if instances > 0 {
        let first = placed.reports().find_map(|report| report.skipped.first_instance);
        let first = first.map_or(String::new(), |(instance, defect)| {
            format!(", the first being instance {instance}: {defect}")
        });
        warn(&format!("{} left out{first}", text::things(instances, "instance")));
    }
}

/// Triangles and instances that a build left out.
pub(crate) fn skipped(placed: &PlacedModel) -> (u64, u64) {
    placed.reports().fold((0, 0), |(triangles, instances), report| {
        (triangles + report.skipped.triangles, instances + report.skipped.instances)
    })
}

#[cfg(test)]
mod tests {
    use super::Up;
    use treelet::bounds::Aabb;

    #[test]
    fn up_is_guessed_by_format_and_shape() {
        let flat_in_z = Aabb { lo: [0.0; 3], hi: [9.0, 8.0, 3.0] };
        let flat_in_y = Aabb { lo: [0.0; 3], hi: [9.0, 3.0, 8.0] };
        assert_eq!(Up::guess("ply", &flat_in_z), Up::Z);
        assert_eq!(Up::guess("ply", &flat_in_y), Up::Y);
        assert_eq!(Up::guess("ply", &Aabb::EMPTY), Up::Y);
        assert_eq!(Up::guess("stl", &flat_in_y), Up::Z);
        assert_eq!(Up::guess("glb", &flat_in_z), Up::Y);
        assert_eq!(Up::guess("obj", &flat_in_z), Up::Y);
    }
}
