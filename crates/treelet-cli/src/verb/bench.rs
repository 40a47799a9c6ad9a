//! `treelet bench`: treelet and its rivals on the same triangles and the same rays.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::time::Instant;

use clap::{Args, ValueEnum};
use serde::Serialize;
use treelet::Cancel;
use treelet_bench::crew::{Clock, Crew};
use treelet_bench::engine::{Engine, EngineError};
use treelet_bench::rays::Kind;
use treelet_bench::report::{Build, EngineLine, Machine, Missing, Order, Report};
use treelet_bench::rivals::{self, embree};
use treelet_bench::rounds::Rounds;
use treelet_bench::run::{self, BenchError, Plan, Subject, Watcher};
use treelet_bench::scenes::{self, Generated};
use treelet_bench::{marks, peak, table};

use crate::ending::{Ending, Failure};
use crate::input::{Input, SceneFlags};
use crate::progress::Line;
use crate::session::{Outcome, Session, say, warn};
use crate::text;

/// Measure speed and memory, against rivals on the same rays
#[derive(Debug, Args)]
pub(crate) struct Flags {
    /// Scene files, or scenes that are made: `fractal-terrain[:N]`, `soup[:N]` with N triangles.
    #[arg(required = true, value_name = "SCENE")]
    scenes: Vec<PathBuf>,

    #[command(flatten)]
    scene_flags: SceneFlags,

    /// Rivals to measure against; one that is not there is skipped with a line that says so.
    #[arg(long, value_delimiter = ',', value_name = "NAME,..")]
    #[arg(value_parser = clap::builder::PossibleValuesParser::new(rivals::NAMES))]
    against: Vec<String>,

    /// Kinds of rays [default: all].
    #[arg(long, value_delimiter = ',', value_name = "KIND,..")]
    #[arg(value_parser = clap::builder::PossibleValuesParser::new(Kind::ALL.map(Kind::name)))]
    kinds: Vec<String>,

    /// Rays of each kind.
    #[arg(long, value_name = "N", default_value_t = 1 << 20)]
    #[arg(value_parser = clap::value_parser!(u64).range(1..=1 << 28))]
    rays: u64,

    /// Rounds in which every engine takes its turn; an interval of 95 % needs 6.
    #[arg(long, value_name = "N", default_value_t = 7)]
    #[arg(value_parser = clap::value_parser!(u64).range(1..=10_000))]
    rounds: u64,

    /// Seconds that each engine runs in a round, at least.
    #[arg(long, value_name = "S", default_value_t = 0.3, value_parser = seconds)]
    seconds: f64,

    /// Builders of treelet's to measure, perhaps with a layout or a level, such as "binned-sah avx2"
    /// [default: all builders].
    #[arg(long, value_delimiter = ',', value_name = "NAME,..")]
    builders: Vec<String>,

    /// Variants of the rivals to measure, such as "HIGH robust" [default: each rival's usual ones].
    #[arg(long, value_delimiter = ',', value_name = "NAME,..")]
    variants: Vec<String>,

    /// Orders of the rays [default: given].
    #[arg(long, value_enum, value_delimiter = ',', value_name = "ORDER,..")]
    order: Vec<OrderFlag>,

    /// Rays of a slice, for calls that take slices [default: all rays].
    #[arg(long, value_delimiter = ',', value_name = "N,..")]
    #[arg(value_parser = clap::value_parser!(u64).range(1..))]
    slice: Vec<u64>,

    /// Measure all that the marks need: both orders, long and short slices, peaks of memory, one
    /// thread and all.
    #[arg(long)]
    marks: bool,

    /// Measure the most memory that each build takes, in a process of its own.
    #[arg(long)]
    peaks: bool,

    /// What that process is told: measure one build's peak and print its bytes.
    #[arg(long, hide = true, value_name = "ENGINE/VARIANT")]
    peak_of: Option<String>,

    /// Transparent huge pages for every engine, or for none.
    #[arg(long, value_enum, default_value_t = HugePages::All)]
    hugepages: HugePages,

    /// The clock: the wall's, or processor time, steadier on a busy machine (one thread only).
    #[arg(long, value_enum, default_value_t = ClockFlag::Wall)]
    clock: ClockFlag,

    /// Embree's library, or a folder that it is in [default: $TREELET_EMBREE, or what `cargo xtask
    /// rivals` fetched].
    #[arg(long, value_name = "FILE")]
    embree: Option<PathBuf>,

    /// The instruction set that Embree is told to use [default: its own choice].
    #[arg(long, value_name = "NAME")]
    embree_isa: Option<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum OrderFlag {
    Given,
    Shuffled,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum HugePages {
    All,
    None,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ClockFlag {
    Wall,
    Processor,
}

/// Rays of a short slice, as the marks have it.
const SHORT_SLICE: usize = 1024;

fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse::<f64>().ok().filter(|seconds| (0.0..=3600.0).contains(seconds));
    seconds.ok_or_else(|| "give seconds in 0 ..= 3600".to_owned())
}

/// Measures scene after scene.
pub(crate) fn run(flags: Flags, session: &Session) -> Result<Outcome, Failure> {
    if let Some(what) = &flags.peak_of {
        return peak_here(what, &flags, session);
    }
    if flags.hugepages == HugePages::All {
        with_huge_pages()?;
    } else {
        without_huge_pages();
    }
    let plan = plan(&flags, session);
    let (mut engines, missing) = engines(&flags);
    for Missing { name, reason } in &missing {
        warn(&format!("{name} is left out: {reason}"));
    }

    let mut report = Report {
        machine: machine(&flags, &plan),
        engines: engines
            .iter()
            .map(|engine| EngineLine { name: engine.name().into(), version: engine.version() })
            .collect(),
        missing,
        scenes: Vec::new(),
        builds: Vec::new(),
        traces: Vec::new(),
        marks: Vec::new(),
    };
    for EngineLine { name, version } in &report.engines {
        say(&format!("{name} {version}"));
    }
    let watcher = Steps::new(session.cancel.clone());
    for scene in &flags.scenes {
        let subject = subject(scene, &flags, session)?;
        let mut result = run::scene(&subject, &mut engines, &plan, &watcher).map_err(failure)?;
        if flags.peaks || flags.marks {
            drop(subject);
            for build in &mut result.builds {
                watcher.step(&format!("peak of {} {}", build.engine, build.variant));
                build.peak_bytes_per_tri = peak_elsewhere(build, scene, &flags, session)?;
            }
        }
        watcher.clear();
        table::scene(&result.scene, &result.builds, &result.traces)
            .iter()
            .for_each(|line| say(line));
        report.scenes.push(result.scene);
        report.builds.extend(result.builds);
        report.traces.extend(result.traces);
    }
    report.marks = marks::marks(&report.scenes, &report.builds, &report.traces);
    table::marks(&report.marks).iter().for_each(|line| say(line));
    Outcome::new("bench", &report, Ending::Done)
}

/// A wrong answer is a failed check; anything else an error.
fn failure(error: BenchError) -> Failure {
    match error {
        BenchError::Cancelled => Failure::Cancelled,
        BenchError::NoVariant { .. } => Failure::Usage(error.to_string()),
        error => Failure::from(error),
    }
}

/// What the flags ask for.
fn plan(flags: &Flags, session: &Session) -> Plan {
    let all = usize::try_from(flags.rays).unwrap_or(usize::MAX);
    let mut orders: Vec<Order> = flags
        .order
        .iter()
        .map(|order| match order {
            OrderFlag::Given => Order::Given,
            OrderFlag::Shuffled => Order::Shuffled,
        })
        .collect();
    let mut slices: Vec<usize> =
        flags.slice.iter().map(|&n| usize::try_from(n).unwrap_or(usize::MAX)).collect();
    let mut threads = vec![session.threads];
    if session.threads > 1 && !session.threads_asked {
        threads.insert(0, 1);
    }
    if flags.marks {
        orders = vec![Order::Given, Order::Shuffled];
        slices = vec![all, SHORT_SLICE];
    }
    if orders.is_empty() {
        orders.push(Order::Given);
    }
    if slices.is_empty() {
        slices.push(all);
    }
    let kind = |kind: Kind| flags.kinds.is_empty() || flags.kinds.iter().any(|n| n == kind.name());
    Plan {
        kinds: Kind::ALL.into_iter().filter(|&it| kind(it)).collect(),
        orders,
        slices,
        threads,
        rays: all,
        rounds: Rounds {
            count: usize::try_from(flags.rounds).unwrap_or(usize::MAX),
            seconds: flags.seconds,
        },
        clock: match flags.clock {
            ClockFlag::Wall => Clock::Wall,
            ClockFlag::Processor => Clock::Processor,
        },
        builders: flags.builders.clone(),
        variants: flags.variants.clone(),
    }
}

/// How Embree is wanted.
fn wishes(flags: &Flags) -> embree::Wishes {
    embree::Wishes {
        library: flags.embree.clone(),
        isa: flags.embree_isa.clone(),
        huge_pages: flags.hugepages == HugePages::All,
    }
}

/// treelet, and the rivals that are there; and those that are not.
fn engines(flags: &Flags) -> (Vec<Box<dyn Engine>>, Vec<Missing>) {
    let wishes = wishes(flags);
    let mut engines: Vec<Box<dyn Engine>> = vec![Box::new(rivals::treelet::Treelet)];
    let mut missing = Vec::new();
    for name in &flags.against {
        match rivals::rival(name, &wishes) {
            Ok(engine) => engines.push(engine),
            Err(EngineError::Missing(reason) | EngineError::Refused(reason)) => {
                missing.push(Missing { name: name.clone(), reason });
            }
        }
    }
    (engines, missing)
}

fn machine(flags: &Flags, plan: &Plan) -> Machine {
    Machine {
        processor: Machine::processor_name(),
        processors: std::thread::available_parallelism().map_or(1, usize::from),
        system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        huge_pages: flags.hugepages == HugePages::All,
        huge_pages_system: Machine::huge_pages_setting(),
        clock: match plan.clock {
            Clock::Wall => "wall",
            Clock::Processor => "processor",
        },
        rounds: plan.rounds.count,
        seconds: plan.rounds.seconds,
    }
}

/// Reads a scene or makes one.
fn subject(scene: &PathBuf, flags: &Flags, session: &Session) -> Result<Subject, Failure> {
    if let Some(generated) = scene.to_str().and_then(Generated::parse) {
        let generated = generated.map_err(Failure::Usage)?;
        let start = Instant::now();
        let triangles = {
            let _line = Line::spinner("making triangles");
            generated.triangles()
        };
        let name = scene.display().to_string();
        let count = text::things(triangles.len() as u64, "triangle");
        say(&format!("{name}: {count}; ready in {}", text::time(start.elapsed())));
        return Ok(Subject { name, generated: true, triangles, up: Some(1) });
    }
    let input = Input::load(Some(scene), &flags.scene_flags, session)?;
    let triangles = scenes::flatten(&input.model)
        .map_err(|error| Failure::told(format!("{}: {error}", input.name)))?;
    let name = scene_name(scene);
    Ok(Subject { name, generated: false, triangles, up: Some(input.up) })
}

/// What `--peak-of` prints.
#[derive(Serialize)]
struct Peak {
    bytes: u64,
}

/// Measures the peak of one build, in this process.
fn peak_here(what: &str, flags: &Flags, session: &Session) -> Result<Outcome, Failure> {
    without_huge_pages();
    let (engine, variant) = what.split_once('/').unwrap_or((what, ""));
    let [scene] = flags.scenes.as_slice() else {
        return Err(Failure::Usage("--peak-of takes one scene".into()));
    };
    let subject = subject(scene, flags, session)?;
    let wishes = wishes(flags);
    let mut engine: Box<dyn Engine> = match engine {
        rivals::treelet::NAME => Box::new(rivals::treelet::Treelet),
        name => rivals::rival(name, &wishes)?,
    };
    let crew = Crew::new(session.threads, Clock::Wall)?;
    crew.at_large(|| engine.prepare(crew.threads()))?;
    let bytes = peak::of_build(&*engine, variant, &subject.triangles, &crew)?;
    Outcome::new("bench", &Peak { bytes }, Ending::Done)
}

/// Measures the peak of one build in a process of its own; bytes a triangle, the caller's arrays
/// included where the engine keeps them. `None`, with a warning, where that process fails.
fn peak_elsewhere(
    build: &Build,
    scene: &Path,
    flags: &Flags,
    session: &Session,
) -> Result<Option<f64>, Failure> {
    if session.cancel.is_cancelled() {
        return Err(Failure::Cancelled);
    }
    let mut command = Command::new(std::env::current_exe()?);
    command.env(peak::VARIABLE, peak::TUNABLES).arg("bench");
    command.args(flags.scene_flags.words().split_whitespace());
    command.args(["--json", "--hugepages", "none", "--threads", &build.threads.to_string()]);
    command.arg("--peak-of").arg(format!("{}/{}", build.engine, build.variant));
    if let Some(library) = &flags.embree {
        command.arg("--embree").arg(library);
    }
    if let Some(isa) = &flags.embree_isa {
        command.arg("--embree-isa").arg(isa);
    }
    command.arg("--").arg(scene);
    let output = command.output()?;
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
    let Some(bytes) = report["bytes"].as_f64().filter(|_| output.status.success()) else {
        let reason = report["error"].to_string();
        warn(&format!("no peak for {} {}: {reason}", build.engine, build.variant));
        return Ok(None);
    };
    Ok(Some(bytes / build.triangles as f64 + build.shared_bytes_per_tri))
}

/// The file's name without folders, wrapper and format.
fn scene_name(scene: &Path) -> String {
    let name = scene.file_name().unwrap_or_default().to_string_lossy();
    let name = name.trim_end_matches(".gz").trim_end_matches(".zst");
    name.rsplit_once('.').map_or(name, |(stem, _)| stem).to_owned()
}

/// The environment variable through which glibc is told to ask for huge pages.
const TUNABLES: &str = "GLIBC_TUNABLES";
/// What it is told.
const TUNABLE: &str = "glibc.malloc.hugetlb=1";

/// Starts the command anew with the tunable set, if it is not: glibc reads it only at the start.
#[cfg(target_os = "linux")]
fn with_huge_pages() -> Result<(), Failure> {
    use std::os::unix::process::CommandExt as _;
    let set = std::env::var(TUNABLES).unwrap_or_default();
    if set.contains("glibc.malloc.hugetlb") {
        return Ok(());
    }
    let set = if set.is_empty() { TUNABLE.to_owned() } else { format!("{set}:{TUNABLE}") };
    let program = std::env::current_exe()?;
    let mut words = std::env::args_os();
    words.next();
    // `exec` comes back only where it failed.
    let error = Command::new(program).args(words).env(TUNABLES, set).exec();
    Err(Failure::told(format!(
        "the command cannot start itself with {TUNABLES} set ({error}); set {TUNABLES}={TUNABLE} \
         yourself, or use --hugepages none"
    )))
}

#[cfg(not(target_os = "linux"))]
fn with_huge_pages() -> Result<(), Failure> {
    Ok(())
}

/// Forbids this program huge pages, whoever asks.
fn without_huge_pages() {
    if !treelet_bench::crew::forbid_huge_pages() {
        warn("huge pages cannot be forbidden here; engines that ask for them may get them");
    }
}

/// Shows what is being done.
struct Steps {
    cancel: Cancel,
    line: Mutex<Option<Line>>,
}

impl Steps {
    fn new(cancel: Cancel) -> Self {
        Self { cancel, line: Mutex::new(None) }
    }

    /// Removes the line.
    fn clear(&self) {
        if let Ok(mut line) = self.line.lock() {
            *line = None;
        }
    }
}

impl Watcher for Steps {
    fn step(&self, what: &str) {
        if let Ok(mut line) = self.line.lock() {
            line.get_or_insert_with(|| Line::spinner(what)).set(0, what.to_owned());
        }
    }

    fn stopped(&self) -> bool {
        self.cancel.is_cancelled()
    }
}

#[cfg(test)]
mod tests {
    use super::scene_name;

    #[test]
    fn scenes_are_named_after_their_files() {
        assert_eq!(scene_name("a/kitchen.ply.zst".as_ref()), "kitchen");
        assert_eq!(scene_name("kitchen.v2.glb".as_ref()), "kitchen.v2");
        assert_eq!(scene_name("plain".as_ref()), "plain");
    }
}
