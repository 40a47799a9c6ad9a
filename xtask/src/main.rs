//! The chores of this workspace, one a file. `cargo xtask test` runs every check that a change
//! must pass; continuous integration calls nothing else.

mod architecture;
mod counts;
mod formatting;
mod levels;
mod limits;
mod rivals;
mod setup;
mod size;
mod step;
mod test;

use std::path::PathBuf;
use std::process::ExitCode;

/// What `cargo xtask` prints when it does not understand.
const USAGE: &str = "\
usage: cargo xtask <chore>

  test           set up, then every check: formatting, lints, features, tests, docs, architecture
  architecture   only: who may know whom, where `unsafe` may stand, whether the map is true
  counts         only: instructions of the kernels under valgrind, against xtask/limits.toml;
                 `counts --bless` writes them there
  size           only: the size of the command as tests run it, likewise
  levels         only: tests at the instruction sets of other processors, NEON and WebAssembly's
  rivals         fetch what `treelet bench --against embree` needs";

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let done = match words.as_slice() {
        ["test"] => test::run(&root()),
        ["architecture"] => architecture::run(&root()),
        ["counts"] => counts::run(&root()),
        ["counts", "--bless"] => counts::bless(&root()),
        ["size"] => size::run(&root()),
        ["size", "--bless"] => size::bless(&root()),
        ["levels"] => levels::run(&root()),
        ["rivals"] => rivals::run(&root()),
        ["help" | "--help" | "-h"] => {
            eprintln!("{USAGE}");
            Ok(())
        }
        _ => {
            eprintln!("{USAGE}");
            return ExitCode::from(2);
        }
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(reason) => {
            eprintln!("xtask: {reason}");
            ExitCode::FAILURE
        }
    }
}

/// The repository's root: the parent of this crate's folder, wherever the command was called.
fn root() -> PathBuf {
    let here = std::env::var_os("CARGO_MANIFEST_DIR").map(PathBuf::from);
    let here = here.unwrap_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")));
    here.parent().map_or_else(|| here.clone(), PathBuf::from)
}
