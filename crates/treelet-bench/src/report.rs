//! What a bench found, in the form that `--json` prints.

use serde::{Deserialize, Serialize};

use crate::engine::Api;
use crate::rays::Kind;
use crate::stats::Ratio;

/// Everything.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Where and how it was measured.
    pub machine: Machine,
    /// The engines that took part.
    pub engines: Vec<EngineLine>,
    /// Those that were asked for and are not there, with what would bring them.
    pub missing: Vec<Missing>,
    /// The scenes, with their cameras.
    pub scenes: Vec<SceneLine>,
    /// Builds, one for each scene, engine, variant and number of threads.
    pub builds: Vec<Build>,
    /// Traces, one for each scene, engine, variant, kind, order, call and number of threads.
    pub traces: Vec<Trace>,
    /// The marks that the measured cells allow to judge.
    pub marks: Vec<crate::marks::Mark>,
}

/// Where and how it was measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    /// The processor's name.
    pub processor: String,
    /// How many of them the program may use.
    pub processors: usize,
    /// `linux x86_64`.
    pub system: String,
    /// Whether every engine had transparent huge pages, or none.
    pub huge_pages: bool,
    /// What the system says about them: `always`, `madvise` or `never`; `unknown` where it does not.
    pub huge_pages_system: String,
    /// `wall`, or `processor`: with one thread, time that the processor spent.
    pub clock: String,
    /// Rounds that count.
    pub rounds: usize,
    /// Seconds of a cell in a round, at least.
    pub seconds: f64,
}

/// An engine that took part.
#[derive(Clone, Debug, Serialize)]
pub struct EngineLine {
    /// Its name.
    pub name: String,
    /// Its version, and what else decides its speed.
    pub version: String,
}

/// An engine that did not.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Missing {
    /// Its name.
    pub name: String,
    /// Why, and what would bring it.
    pub reason: String,
}

/// A scene.
#[derive(Clone, Debug, Serialize)]
pub struct SceneLine {
    /// The file's name, or that of a generated scene.
    pub scene: String,
    /// Whether the bench made it.
    pub generated: bool,
    /// Triangles that are stored: all, where instances were copied.
    pub triangles: u64,
    /// Instances that engines have; 0 where triangles were copied.
    pub instances: u64,
    /// Where primary rays start.
    pub camera_from: [f32; 3],
    /// What the camera looks at.
    pub camera_at: [f32; 3],
    /// The part of primary rays that hit something.
    pub hit_rate: f64,
    /// Rays of this scene that were compared with brute force, bit for bit.
    pub rays_by_brute_force: u64,
}

/// A build.
#[derive(Clone, Debug, Serialize)]
pub struct Build {
    /// The scene's name.
    pub scene: String,
    /// The engine's name.
    pub engine: String,
    /// A builder or a quality level.
    pub variant: String,
    /// Threads that built.
    pub threads: usize,
    /// Triangles of the scene.
    pub triangles: u64,
    /// Millions of triangles a second, from the caller's arrays to ready-to-trace: the median.
    pub mtris_per_s: f64,
    /// All that tracing needs, the caller's arrays included where the engine keeps them.
    pub bytes_per_tri: f64,
    /// The most that was there during the build, counted like `bytes_per_tri`; null if it was not
    /// measured.
    pub peak_bytes_per_tri: Option<f64>,
    /// Of `bytes_per_tri`: the caller's arrays.
    pub shared_bytes_per_tri: f64,
    /// Seconds of each build.
    #[serde(skip)]
    pub seconds: Vec<f64>,
}

/// A trace.
#[derive(Clone, Debug, Serialize)]
pub struct Trace {
    /// The scene's name.
    pub scene: String,
    /// The engine's name.
    pub engine: String,
    /// A builder or a quality level.
    pub variant: String,
    /// The kind of rays.
    #[serde(serialize_with = "kind_name")]
    pub kind: Kind,
    /// One ray a call, or several.
    pub api: Api,
    /// Rays a call: 1, a packet's, a slice's.
    pub width: usize,
    /// Threads that traced.
    pub threads: usize,
    /// Rays in all.
    pub rays: u64,
    /// Millions of rays a second: the median.
    pub mrays_per_s: f64,
    /// Largest less smallest, of the median.
    pub spread: f64,
    /// Hit against miss or another `t` than treelet's, in a million rays.
    pub mismatch_ppm: f64,
    /// The same `t`, another triangle or instance; null where no triangle was asked for.
    pub ids_ppm: Option<f64>,
    /// `given` or `shuffled`.
    pub order: Order,
    /// Whether the engine was told that the rays are coherent.
    pub coherent: bool,
    /// Seconds of each round.
    #[serde(skip)]
    pub seconds: Vec<f64>,
}

/// The order of the rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Order {
    /// As they were made: neighbours are neighbours.
    Given,
    /// At random.
    Shuffled,
}

impl Order {
    /// As users write it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Given => "given",
            Self::Shuffled => "shuffled",
        }
    }
}

fn kind_name<S: serde::Serializer>(kind: &Kind, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(kind.name())
}

impl Trace {
    /// How many times as fast as `other` this is.
    pub fn ratio(&self, other: &Self) -> Ratio {
        Ratio::of_pairs(&other.seconds, &self.seconds)
    }

    /// The engine, the variant and how it takes rays, in a few words.
    pub fn label(&self) -> String {
        let width = match (self.api, self.width) {
            (Api::One, _) => "1".to_owned(),
            (Api::Many, width) if self.engine == crate::rivals::treelet::NAME => {
                format!("slice {width}")
            }
            (Api::Many, width) => width.to_string(),
        };
        let hint = if self.coherent { " coherent" } else { "" };
        format!("{} {} /{width}{hint}", self.engine, self.variant)
    }
}

impl Build {
    /// How many times as fast as `other` this is.
    pub fn ratio(&self, other: &Self) -> Ratio {
        let pairs = self.seconds.len().min(other.seconds.len());
        Ratio::of_pairs(&other.seconds[..pairs], &self.seconds[..pairs])
    }
}

impl Machine {
    /// The processor's name, as the system tells it.
    pub fn processor_name() -> String {
        let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let name = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
        name.map_or_else(|| "unknown".to_owned(), |(_, name)| name.trim().to_owned())
    }

    /// The system's setting for transparent huge pages: the word in brackets.
    pub fn huge_pages_setting() -> String {
        let file = "/sys/kernel/mm/transparent_hugepage/enabled";
        let text = std::fs::read_to_string(file).unwrap_or_default();
        let chosen = text.split_once('[').and_then(|(_, rest)| rest.split_once(']'));
        chosen.map_or_else(|| "unknown".to_owned(), |(word, _)| word.to_owned())
    }
}
