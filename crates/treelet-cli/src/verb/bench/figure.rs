//! `treelet bench --figure`: rays a second against how many are traced, construction included.

use std::path::PathBuf;

use clap::Args;
use treelet_bench::figure::data::Figure;
use treelet_bench::figure::{self, FigurePlan, SceneFigure, State};
use treelet_bench::report::Missing;
use treelet_bench::rounds::Rounds;
use treelet_bench::run::Plan;

use super::flags::{Flags, engines};
use super::page::Report;
use super::steps::Steps;
use super::subject::subject;
use super::{failure, machine};
use crate::ending::{Ending, Failure};
use crate::output::Output;
use crate::session::{Outcome, Session, say, warn};

/// Rays of each kind and rounds of a figure, unless somebody asks for others.
const USUAL: (usize, Rounds) = (1 << 17, Rounds { count: 7, seconds: 0.1 });
/// The same for `--quick`.
const QUICK: (usize, Rounds) = (1 << 15, Rounds { count: 3, seconds: 0.02 });

/// The figure.
#[derive(Debug, Args)]
pub(super) struct FigureFlags {
    /// Measure, for 10^4 to 10^12 rays, which builder is best, its build included: every builder,
    /// every quality level and some compositions, and the rivals of --against; primary, occlusion and
    /// diffuse rays, one ray a call, on one thread unless --threads says otherwise.
    #[arg(long, conflicts_with_all = ["order", "slice", "peak_of"])]
    pub(super) figure: bool,

    /// With --figure: in minutes, with fewer rays, builds and rounds.
    #[arg(long, requires = "figure")]
    quick: bool,

    /// With --figure: note every finished piece in FILE, and go on where it ends.
    #[arg(long, value_name = "FILE", requires = "figure")]
    resume: Option<PathBuf>,

    /// With --figure or --animate: draw it into an SVG file; of a figure the geometric mean where there are several.
    #[arg(long, value_name = "FILE")]
    pub(super) plot: Option<PathBuf>,
}

/// Measures scene after scene.
pub(super) fn run(flags: &Flags, session: &Session) -> Result<Outcome, Failure> {
    let figure_flags = &flags.figure;
    let plot = figure_flags.plot.as_deref().map(Output::prepare).transpose()?;
    let report = Report::prepare(&flags.page)?;
    let plan = FigurePlan::new(base(flags, session), figure_flags.quick);
    let (mut engines, missing) = engines(flags);
    missing.iter().for_each(|it| warn(&format!("{} is left out: {}", it.name, it.reason)));
    let mut state =
        State::open(figure_flags.resume.as_deref(), &plan, &engines).map_err(Failure::from)?;
    if state.pieces() > 0 {
        say(&format!("going on after {} pieces", state.pieces()));
    }
    let mut figure = Figure {
        machine: Some(machine(flags, &plan.base)),
        engines: engines.iter().map(|it| format!("{} {}", it.name(), it.version())).collect(),
        left_out: missing,
        command: std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect(),
        ..Figure::default()
    };
    figure.engines.iter().for_each(|engine| say(engine));

    let watcher = Steps::new(session.cancel.clone());
    let mut names: Vec<String> = Vec::new();
    for scene in &flags.scenes {
        let subject = subject(scene, flags, session)?;
        if names.contains(&subject.name) {
            let name = &subject.name;
            return Err(Failure::Usage(format!("two scenes are named `{name}`: rename a file")));
        }
        names.push(subject.name.clone());
        let free = treelet_bench::peak::free_memory().unwrap_or(u64::MAX);
        if let Some(reason) = plan.too_large(&engines, subject.triangles.len(), free) {
            warn(&format!("{} is left out: {reason}", subject.name));
            figure.left_out.push(Missing { name: subject.name, reason });
            continue;
        }
        let result = figure::scene(&subject, &mut engines, &plan, &mut state, &watcher);
        watcher.clear();
        let SceneFigure { points, choices, auto, left_out } = result.map_err(failure)?;
        left_out.iter().for_each(|it| warn(&format!("{} is left out: {}", it.name, it.reason)));
        figure.points.extend(points);
        figure.choices.extend(choices);
        figure.auto.extend(auto);
        figure.left_out.extend(left_out);
        figure.windows = figure::windows(&figure);
        for panel in figure.panels().iter().filter(|panel| panel.scene == subject.name) {
            figure::panel_lines(&figure, panel).iter().for_each(|line| say(line));
        }
    }
    figure.marks = figure::marks(&figure);
    figure::mark_lines(&figure.marks).iter().for_each(|line| say(line));
    if let Some(plot) = plot {
        draw(&figure, &plot)?;
    }
    if let Some(report) = report {
        report.write(&figure, flags, session)?;
    }
    Outcome::new("bench", &figure, Ending::Done)
}

/// The flags' plan with what is usual for figures.
fn base(flags: &Flags, session: &Session) -> Plan {
    let (rays, rounds) = if flags.figure.quick { QUICK } else { USUAL };
    let mut plan = super::flags::plan(flags, session, rays, rounds);
    if flags.kinds.is_empty() {
        plan.kinds = figure::KINDS.to_vec();
    }
    if session.threads_asked.is_empty() {
        plan.threads = vec![1];
    }
    plan
}

/// Draws the only panel, or the mean of all.
fn draw(figure: &Figure, plot: &Output) -> Result<(), Failure> {
    let svg = match figure.panels().as_slice() {
        [panel] => figure::panel_svg(figure, panel),
        _ => figure::mean_svg(figure),
    };
    let Some(svg) = svg else {
        return Err(Failure::told(
            "nothing can be drawn: the axis is the speed of sweep-sah, which is not among the builders; \
             add it to --builders",
        ));
    };
    plot.replace(svg.as_bytes())?;
    say(&format!("{} written", plot.path().display()));
    Ok(())
}
