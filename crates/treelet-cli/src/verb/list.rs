//! `treelet list`: what there is to choose from, straight from the catalogues.

use clap::Args;
use serde::Serialize;
use treelet::Quality;
use treelet::build::{Info, Presplit};

use crate::ending::{Ending, Failure};
use crate::session::{Outcome, Session, say};

/// List builders, optimisers, quality levels, layouts, importers and verbs
#[derive(Debug, Args)]
pub(crate) struct Flags {}

#[derive(Serialize)]
struct Report {
    prepasses: Vec<Entry>,
    builders: Vec<Entry>,
    optimizers: Vec<Entry>,
    qualities: Vec<Level>,
    layouts: Vec<Entry>,
    importers: Vec<Importer>,
    verbs: Vec<Verb>,
}

#[derive(Serialize)]
struct Entry {
    name: &'static str,
    summary: &'static str,
    source: &'static str,
}

#[derive(Serialize)]
struct Level {
    name: &'static str,
    summary: &'static str,
    plan: String,
}

#[derive(Serialize)]
struct Importer {
    name: &'static str,
    extensions: Vec<&'static str>,
    summary: &'static str,
}

#[derive(Serialize)]
struct Verb {
    name: String,
    summary: String,
}

impl From<Info> for Entry {
    fn from(Info { name, summary, source }: Info) -> Self {
        Self { name, summary, source }
    }
}

/// Reads the catalogues and prints them.
pub(crate) fn run(_: Flags, _: &Session) -> Result<Outcome, Failure> {
    let importer = |importer: &&dyn treelet_import::Importer| {
        let info = importer.info();
        let extensions = info.extensions.to_vec();
        Importer { name: info.name, extensions, summary: info.summary }
    };
    let level = |quality: &Quality| Level {
        name: quality.name(),
        summary: quality.summary(),
        plan: quality.plan().to_string(),
    };
    let verb = |(name, summary)| Verb { name, summary };
    let report = Report {
        prepasses: vec![Presplit::INFO.into()],
        builders: treelet::build::ALL.iter().map(|builder| builder.info().into()).collect(),
        optimizers: treelet::optimize::ALL.iter().map(|each| each.info().into()).collect(),
        qualities: Quality::ALL.iter().map(level).collect(),
        layouts: treelet::layout::ALL.iter().map(|&info| info.into()).collect(),
        importers: treelet_import::ALL.iter().map(importer).collect(),
        verbs: super::summaries().into_iter().map(verb).collect(),
    };
    tell(&report);
    Outcome::new("list", &report, Ending::Done)
}

/// Prints the lists for people.
fn tell(report: &Report) {
    let entry =
        |entry: &Entry| say(&format!("  {:16} {} ({})", entry.name, entry.summary, entry.source));
    say("before a builder, as in `presplit+hploc`");
    report.prepasses.iter().for_each(entry);
    say("builders");
    report.builders.iter().for_each(entry);
    say("optimisers");
    report.optimizers.iter().for_each(entry);
    say("quality levels");
    for level in &report.qualities {
        say(&format!("  {:16} {}: {}", level.name, level.summary, level.plan));
    }
    say("layouts");
    report.layouts.iter().for_each(entry);
    say("importers");
    for importer in &report.importers {
        let extensions = importer.extensions.join(", ");
        say(&format!("  {:16} {} ({extensions})", importer.name, importer.summary));
    }
    say("verbs");
    for verb in &report.verbs {
        say(&format!("  {:16} {}", verb.name, verb.summary));
    }
}
