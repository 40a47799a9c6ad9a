//! The `treelet` command: pictures of scenes, and what their trees are worth.
//!
//! One verb a file in `verb/`; `demo/` is the scene that is there when no file is given. People
//! read stderr; `--json` puts exactly one object on stdout.

mod arguments;
mod camera;
mod choice;
mod demo;
mod duplicates;
mod ending;
mod input;
mod output;
mod progress;
mod ray_text;
mod session;
mod show;
mod text;
mod tree_flags;
mod verb;

use std::process::ExitCode;

use clap::Parser as _;

fn main() -> ExitCode {
    let words = arguments::joined(std::env::args_os());
    match arguments::Arguments::try_parse_from(&words) {
        Ok(arguments) => session::run(arguments),
        Err(message) => session::refuse(&words, &message),
    }
}
