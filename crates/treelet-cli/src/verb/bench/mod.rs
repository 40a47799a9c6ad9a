//! `treelet bench`: treelet and its rivals on the same triangles and the same rays.

mod animate;
mod figure;
mod flags;
mod motion;
mod page;
mod pages;
mod peaks;
mod steps;
mod subject;
mod twist;

pub(crate) use flags::Flags;

use treelet_bench::crew::Clock;
use treelet_bench::report::{EngineLine, Machine, Missing, Report};
use treelet_bench::rounds::Rounds;
use treelet_bench::run::{self, BenchError, Plan};
use treelet_bench::{marks, table};

use crate::ending::{Ending, Failure};
use crate::session::{Outcome, Session, say, warn};
use flags::{HugePages, engines, plan};
use steps::Steps;
use subject::subject;

/// Rays of each kind, unless somebody asks for more or fewer.
const RAYS: usize = 1 << 20;

/// Measures scene after scene.
pub(crate) fn run(flags: Flags, session: &Session) -> Result<Outcome, Failure> {
    if let Some(what) = &flags.peak_of {
        return peaks::here(what, &flags, session);
    }
    if flags.scenes.is_empty() {
        return page::of_entrants(&flags, session);
    }
    if flags.hugepages == HugePages::All {
        pages::allow()?;
    } else {
        pages::forbid();
    }
    if let Some(speed) = flags.moving {
        return motion::run(speed, &flags, session);
    }
    if let Some(frames) = flags.animate.animate {
        return animate::run(&flags, frames, session);
    }
    if let Some(frames) = flags.twist.twist {
        return twist::run(&flags, frames, session);
    }
    if let Some(seconds) = flags.twist.while_edited {
        return twist::read(&flags, seconds, session);
    }
    if flags.figure.figure {
        return figure::run(&flags, session);
    }
    if flags.figure.plot.is_some() {
        return Err(Failure::Usage(
            "--plot: a picture is of a figure or a clip; add --figure or --animate".into(),
        ));
    }
    if flags.page.report.is_some() {
        return Err(Failure::Usage("--report: the page is of a figure; add --figure".into()));
    }
    let plan = plan(&flags, session, RAYS, Rounds::default());
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
        for Missing { name, reason } in &result.left_out {
            warn(&format!("{}: {name} is left out: {reason}", result.scene.scene));
        }
        // A process that measures peaks is given triangles.
        let peaks = !flags.no_peaks && subject.placed.is_none();
        drop(subject);
        if peaks {
            peaks::measure(&mut result.builds, scene, &flags, session, &watcher)?;
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
        }
        .to_owned(),
        rounds: plan.rounds.count,
        seconds: plan.rounds.seconds,
    }
}
