//! Peaks of memory, each measured in a process of its own.

use std::path::Path;
use std::process::Command;

use serde::Serialize;
use treelet_bench::crew::{Clock, Crew};
use treelet_bench::engine::Engine;
use treelet_bench::report::Build;
use treelet_bench::run::Watcher as _;
use treelet_bench::{peak, rivals};

use super::flags::{Flags, wishes};
use super::pages;
use super::steps::Steps;
use super::subject::subject;
use crate::ending::{Ending, Failure};
use crate::session::{Outcome, Session, warn};

/// Measures the peaks of a scene's builds, with the fewest threads that they were built with: more
/// change little.
pub(super) fn measure(
    builds: &mut [Build],
    scene: &Path,
    flags: &Flags,
    session: &Session,
    steps: &Steps,
) -> Result<(), Failure> {
    let fewest = builds.iter().map(|build| build.threads).min();
    for build in builds.iter_mut().filter(|build| Some(build.threads) == fewest) {
        steps.step(&format!("peak of {} {}", build.engine, build.variant));
        build.peak_bytes_per_tri = elsewhere(build, scene, flags, session)?;
    }
    Ok(())
}

/// What `--peak-of` prints.
#[derive(Serialize)]
struct Peak {
    bytes: u64,
}

/// Measures the peak of one build, in this process.
pub(super) fn here(what: &str, flags: &Flags, session: &Session) -> Result<Outcome, Failure> {
    pages::forbid();
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
fn elsewhere(
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
