//! The flags, and the plan that they ask for.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use treelet_bench::crew::Clock;
use treelet_bench::engine::{Engine, EngineError};
use treelet_bench::marks::SHORT_SLICE;
use treelet_bench::rays::Kind;
use treelet_bench::report::{Missing, Order};
use treelet_bench::rivals::{self, embree};
use treelet_bench::rounds::Rounds;
use treelet_bench::run::Plan;

use super::animate::AnimateFlags;
use super::figure::FigureFlags;
use super::page::PageFlags;
use super::twist::TwistFlags;
use crate::input::SceneFlags;
use crate::session::Session;

/// Measure speed and memory, against rivals on the same rays
#[derive(Debug, Args)]
pub(crate) struct Flags {
    /// Scene files, or scenes that are made: `fractal-terrain[:N]`, `soup[:N]` with N triangles.
    #[arg(required_unless_present = "entrant", value_name = "SCENE")]
    pub(super) scenes: Vec<PathBuf>,

    #[command(flatten)]
    pub(super) scene_flags: SceneFlags,

    #[command(flatten)]
    pub(super) page: PageFlags,

    /// Rivals to measure against; one that is not there is skipped with a line that says so.
    #[arg(long, value_delimiter = ',', value_name = "NAME,..")]
    #[arg(value_parser = clap::builder::PossibleValuesParser::new(rivals::NAMES))]
    against: Vec<String>,

    /// Copy the triangles of instances, for rivals that have none; otherwise scenes in which something is
    /// placed more than once are measured with their instances. Figures always copy them.
    #[arg(long)]
    pub(super) flatten: bool,

    /// Kinds of rays [default: all].
    #[arg(long, value_delimiter = ',', value_name = "KIND,..")]
    #[arg(value_parser = clap::builder::PossibleValuesParser::new(Kind::ALL.map(Kind::name)))]
    pub(super) kinds: Vec<String>,

    /// Rays of each kind [default: 1048576; of a figure 131072, of a quick one 32768].
    #[arg(long, value_name = "N")]
    #[arg(value_parser = clap::value_parser!(u64).range(1..=1 << 28))]
    rays: Option<u64>,

    /// Rounds in which every engine takes its turn; an interval of 95 % needs 6 [default: 7; of a quick
    /// figure 3].
    #[arg(long, value_name = "N")]
    #[arg(value_parser = clap::value_parser!(u64).range(1..=10_000))]
    rounds: Option<u64>,

    /// Seconds that each engine runs in a round, at least [default: 0.3; of a figure 0.1, of a quick one
    /// 0.02].
    #[arg(long, value_name = "S", value_parser = seconds)]
    seconds: Option<f64>,

    /// Quality levels or builders of treelet's to measure, perhaps with a layout or an instruction
    /// set, such as "binned-sah avx2" [default: those that the marks need].
    #[arg(long, value_delimiter = ',', value_name = "NAME,..")]
    builders: Vec<String>,

    /// Variants of the rivals to measure, such as "HIGH robust" [default: each rival's usual ones].
    #[arg(long, value_delimiter = ',', value_name = "NAME,..")]
    variants: Vec<String>,

    /// Orders of the rays [default: both].
    #[arg(long, value_enum, value_delimiter = ',', value_name = "ORDER,..")]
    order: Vec<OrderFlag>,

    /// Rays of a slice, for calls that take slices; only the longest is shuffled
    /// [default: all rays, and 1024].
    #[arg(long, value_delimiter = ',', value_name = "N,..")]
    #[arg(value_parser = clap::value_parser!(u64).range(1..))]
    slice: Vec<u64>,

    /// Measure what motion costs, one ray a call on one thread: every vertex on a straight way of its own, at most this part
    /// of the scene's diagonal long, against the same scene standing still; and a propeller that turns once, with
    /// temporal splits against without.
    #[arg(long, value_name = "SPEED", value_parser = speed)]
    #[arg(conflicts_with_all = ["figure", "order", "slice", "peak_of"])]
    pub(super) moving: Option<f32>,

    #[command(flatten)]
    pub(super) figure: FigureFlags,

    #[command(flatten)]
    pub(super) twist: TwistFlags,

    #[command(flatten)]
    pub(super) animate: AnimateFlags,

    /// Do not measure the most memory that each build takes, which needs a process of its own.
    #[arg(long)]
    pub(super) no_peaks: bool,

    /// Measure one build's peak and print its bytes: what such a process is told.
    #[arg(long, hide = true, value_name = "ENGINE/VARIANT")]
    pub(super) peak_of: Option<String>,

    /// Transparent huge pages for every engine, or for none.
    #[arg(long, value_enum, default_value_t = HugePages::All)]
    pub(super) hugepages: HugePages,

    /// The clock: the wall's, or processor time, steadier on a busy machine (one thread only).
    #[arg(long, value_enum, default_value_t = ClockFlag::Wall)]
    clock: ClockFlag,

    /// Embree's library, or a folder that it is in [default: $TREELET_EMBREE, or what `cargo xtask
    /// rivals` fetched].
    #[arg(long, value_name = "FILE")]
    pub(super) embree: Option<PathBuf>,

    /// The instruction set that Embree is told to use [default: its own choice].
    #[arg(long, value_name = "NAME")]
    pub(super) embree_isa: Option<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum OrderFlag {
    Given,
    Shuffled,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum HugePages {
    All,
    None,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ClockFlag {
    Wall,
    Processor,
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse::<f64>().ok().filter(|seconds| (0.0..=3600.0).contains(seconds));
    seconds.ok_or_else(|| "give seconds in 0 ..= 3600".to_owned())
}

fn speed(text: &str) -> Result<f32, String> {
    let speed = text.parse::<f32>().ok().filter(|speed| (0.0..=1.0).contains(speed));
    speed.ok_or_else(|| "give a part of the scene's diagonal in 0 ..= 1".to_owned())
}

/// What the flags ask for; `rays` and `rounds` where they do not say.
pub(super) fn plan(flags: &Flags, session: &Session, rays: usize, rounds: Rounds) -> Plan {
    let whole = |count: u64| usize::try_from(count).unwrap_or(usize::MAX);
    let all = flags.rays.map_or(rays, whole);
    let order = |order: &OrderFlag| match order {
        OrderFlag::Given => Order::Given,
        OrderFlag::Shuffled => Order::Shuffled,
    };
    let slice = |&length: &u64| usize::try_from(length).unwrap_or(usize::MAX);
    let kind = |kind: Kind| flags.kinds.is_empty() || flags.kinds.iter().any(|n| n == kind.name());
    Plan {
        kinds: Kind::ALL.into_iter().filter(|&it| kind(it)).collect(),
        orders: either(
            flags.order.iter().map(order).collect(),
            vec![Order::Given, Order::Shuffled],
        ),
        slices: either(flags.slice.iter().map(slice).collect(), vec![all, SHORT_SLICE]),
        threads: either(
            session.threads_asked.clone(),
            if session.threads > 1 { vec![1, session.threads] } else { vec![1] },
        ),
        rays: all,
        rounds: Rounds {
            count: flags.rounds.map_or(rounds.count, whole),
            seconds: flags.seconds.unwrap_or(rounds.seconds),
        },
        clock: match flags.clock {
            ClockFlag::Wall => Clock::Wall,
            ClockFlag::Processor => Clock::Processor,
        },
        builders: flags.builders.clone(),
        variants: flags.variants.clone(),
    }
}

/// What was asked for, or else what is usual.
fn either<T>(asked: Vec<T>, usual: Vec<T>) -> Vec<T> {
    if asked.is_empty() { usual } else { asked }
}

/// How Embree is wanted.
pub(super) fn wishes(flags: &Flags) -> embree::Wishes {
    embree::Wishes {
        library: flags.embree.clone(),
        isa: flags.embree_isa.clone(),
        huge_pages: flags.hugepages == HugePages::All,
    }
}

/// treelet, and the rivals that are there; and those that are not.
pub(super) fn engines(flags: &Flags) -> (Vec<Box<dyn Engine>>, Vec<Missing>) {
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
