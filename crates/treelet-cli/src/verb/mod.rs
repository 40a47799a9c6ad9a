//! The verbs, one a file. A new one is a file here and a line in the catalogue below; the command
//! line, the help and `treelet list` read the catalogue.

use clap::{CommandFactory as _, Subcommand};

use crate::arguments::Arguments;
use crate::ending::Failure;
use crate::session::{Outcome, Session};

macro_rules! catalogue {
    ($($module:ident $name:literal $variant:ident),* $(,)?) => {
        $(mod $module;)*

        /// A verb with its flags; the text of the help stands at the flags' type.
        #[derive(Debug, Subcommand)]
        pub(crate) enum Verb {
            $(#[command(name = $name)] $variant($module::Flags),)*
        }

        /// The verb that a word names, if it names one.
        pub(crate) fn known(word: &str) -> Option<&'static str> {
            [$($name),*].into_iter().find(|name| *name == word)
        }

        impl Verb {
            /// As users write it.
            pub(crate) fn name(&self) -> &'static str {
                match self {
                    $(Self::$variant(_) => $name,)*
                }
            }

            /// Whether it measures with one number of threads after the other.
            pub(crate) fn takes_several_thread_counts(&self) -> bool {
                matches!(self, Self::Bench(_))
            }

            /// Does what the verb says.
            pub(crate) fn run(self, session: &Session) -> Result<Outcome, Failure> {
                match self {
                    $(Self::$variant(flags) => $module::run(flags, session),)*
                }
            }
        }
    };
}

catalogue! {
    render "render" Render,
    inspect "inspect" Inspect,
    verify "verify" Verify,
    bench "bench" Bench,
    list "list" List,
    completions "completions" Completions,
    man "man" Man,
}

/// Name and summary of every verb, in the catalogue's order.
fn summaries() -> Vec<(String, String)> {
    let command = Arguments::command();
    let verbs = command.get_subcommands();
    let about = |verb: &clap::Command| verb.get_about().map(ToString::to_string);
    verbs.map(|verb| (verb.get_name().to_owned(), about(verb).unwrap_or_default())).collect()
}
