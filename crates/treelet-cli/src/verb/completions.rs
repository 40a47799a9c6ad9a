//! `treelet completions`: what a shell must know to complete the command, from its own definition.

use clap::{Args, CommandFactory as _};
use clap_complete::Shell;
use serde::Serialize;

use crate::arguments::Arguments;
use crate::ending::{Ending, Failure};
use crate::session::{Outcome, Session};

/// Print completions for a shell
#[derive(Debug, Args)]
#[command(after_help = "For bash: treelet completions bash > \
    ~/.local/share/bash-completion/completions/treelet")]
pub(crate) struct Flags {
    /// Which shell.
    #[arg(value_enum)]
    shell: Shell,
}

#[derive(Serialize)]
struct Report {
    shell: String,
    text: String,
}

/// Prints them.
pub(crate) fn run(flags: Flags, _: &Session) -> Result<Outcome, Failure> {
    let mut bytes = Vec::new();
    let mut command = Arguments::command();
    clap_complete::generate(flags.shell, &mut command, "treelet", &mut bytes);
    let text = String::from_utf8_lossy(&bytes).into_owned();
    let plain = text.trim_end().to_owned();
    Outcome::new("completions", &Report { shell: flags.shell.to_string(), text }, Ending::Done)
        .map(|outcome| outcome.with_text(plain))
}
