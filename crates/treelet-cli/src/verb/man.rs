//! `treelet man`: the manual page of the command or of a verb, from its own definition.

use clap::{Args, Command, CommandFactory as _};
use clap_mangen::Man;
use serde::Serialize;

use crate::arguments::Arguments;
use crate::ending::{Ending, Failure};
use crate::session::{Outcome, Session};

/// Print the manual page, of the command or of a verb
#[derive(Debug, Args)]
#[command(after_help = "To read it: treelet man render | man -l -")]
pub(crate) struct Flags {
    /// A verb, as `treelet list` names them [default: the page of the command].
    verb: Option<String>,
}

#[derive(Serialize)]
struct Report {
    page: String,
    text: String,
}

/// Prints it.
pub(crate) fn run(flags: Flags, _: &Session) -> Result<Outcome, Failure> {
    let mut command = Arguments::command();
    command.build();
    let (page, command) = match &flags.verb {
        None => ("treelet".to_owned(), command),
        Some(verb) => (format!("treelet-{verb}"), of_verb(&command, verb)?),
    };
    let mut bytes = Vec::new();
    Man::new(command).title(page.clone()).render(&mut bytes)?;
    let text = String::from_utf8_lossy(&bytes).into_owned();
    let plain = text.trim_end().to_owned();
    Outcome::new("man", &Report { page, text }, Ending::Done)
        .map(|outcome| outcome.with_text(plain))
}

fn of_verb(command: &Command, verb: &str) -> Result<Command, Failure> {
    let found = command.get_subcommands().find(|known| known.get_name() == verb);
    let found = found.ok_or_else(|| {
        Failure::Usage(format!("man {verb}: there is no such verb; `treelet list` names them"))
    })?;
    Ok(found.clone().display_name(format!("treelet-{verb}")))
}
