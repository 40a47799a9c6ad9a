//! `cargo xtask counts`: instructions a ray and a triangle, counted under valgrind, which does not
//! care how busy the machine is.
//!
//! `crates/treelet/benches/counts.rs` does the work; callgrind counts inside of its function
//! `measured` only, and writes a file each time that `told` returns, which that calls last. The crate `gungraun` wraps the
//! same; it is not used, because its runner is a second program that must be installed by `cargo
//! install` in the very version of the crate, which takes longer than the step itself.
//!
//! The library is compiled without its feature `rayon`, so that all is counted on one thread.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::limits::{Measured, Table};
use crate::rivals::target;
use crate::step::{cargo_command, output};

/// What is let pass: a copy of another length, a library with another `memcpy`. Walks count the same
/// to the instruction every time; no longer culling what waits behind a hit made them 1.0 to 2.4 %
/// dearer here.
const LIMITS: Table =
    Table { name: "counts", tolerance: 0.01, bless: "cargo xtask counts --bless" };

/// The function that is counted, as callgrind knows it, and the one after which it writes a file.
const COUNTED: [&str; 2] = ["counts::measured*", "counts::told*"];

/// Counts, and holds the counts against the limits.
pub(crate) fn run(root: &Path) -> Result<(), String> {
    LIMITS.check(root, &count(root)?)
}

/// Counts, and makes the counts the limits.
pub(crate) fn bless(root: &Path) -> Result<(), String> {
    LIMITS.write(root, &count(root)?)
}

/// [`run`] where there is valgrind.
pub(crate) fn run_where_possible(root: &Path) -> Result<(), String> {
    if is_there() {
        return run(root);
    }
    eprintln!("  SKIPPED: instructions are not counted: install the package valgrind");
    Ok(())
}

fn is_there() -> bool {
    let mut command = Command::new("valgrind");
    command.arg("--version").stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}

/// Instructions a ray or triangle of each piece of work.
fn count(root: &Path) -> Result<Measured, String> {
    let program = program(root)?;

    // Count, from an empty folder.
    let folder = target(root).join("counts");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut valgrind = Command::new("valgrind");
    valgrind.args(["--quiet", "--tool=callgrind"]);
    let [measured, told] = COUNTED;
    valgrind.arg(format!("--toggle-collect={measured}")).arg(format!("--dump-after={told}"));
    valgrind.arg(format!("--callgrind-out-file={}", folder.join("out").display()));
    eprintln!("  $ valgrind --tool=callgrind {}", program.display());
    let lines = output(valgrind.arg(&program))?;

    // One file a line, numbered from 1.
    let mut measured = Measured::new();
    for (line, number) in lines.lines().zip(1..) {
        let (name, per) = line.rsplit_once(' ').ok_or_else(|| format!("`{line}` has no number"))?;
        let per: f64 = per.parse().map_err(|_| format!("`{line}` ends with no number"))?;
        let file = folder.join(format!("out.{number}"));
        let text = fs::read_to_string(&file).unwrap_or_default();
        let told = || format!("callgrind left no total for `{name}` in {}", file.display());
        let total = total(&text).ok_or_else(told)?;
        measured.insert(name.to_owned(), total as f64 / per);
    }
    Ok(measured)
}

/// The instructions of one of callgrind's files.
fn total(text: &str) -> Option<u64> {
    let rest = text.lines().find_map(|line| line.strip_prefix("totals: "))?;
    rest.split_whitespace().next()?.parse().ok().filter(|&total| total > 0)
}

/// Builds the program that is counted; where it is.
fn program(root: &Path) -> Result<PathBuf, String> {
    // Alone and with its own features, or the workspace's would be united with them.
    let words = ["build", "--release", "--package=treelet", "--no-default-features"];
    let mut cargo = cargo_command(root);
    cargo.args(words).args(["--features=std", "--bench=counts"]);
    cargo.arg("--message-format=json-render-diagnostics");
    eprintln!("  $ cargo {} --features=std --bench=counts", words.join(" "));
    let messages = output(&mut cargo)?;
    executable(&messages).ok_or_else(|| "cargo names no program".to_owned())
}

/// The last program that cargo's messages name.
fn executable(messages: &str) -> Option<PathBuf> {
    let (_, rest) = messages.rsplit_once("\"executable\":\"")?;
    rest.split_once('"').map(|(path, _)| PathBuf::from(path))
}

#[cfg(test)]
mod tests {
    use super::{executable, total};

    #[test]
    fn totals_are_read_and_none_is_no_total() {
        let file = "events: Ir\nfn=(1)\n16 400\n\ntotals: 415\n";
        assert_eq!(total(file), Some(415));
        assert_eq!(total("totals: 0\n"), None, "the function was not found");
        assert_eq!(total("events: Ir\n"), None);
    }

    #[test]
    fn the_program_is_the_one_that_cargo_names() {
        let messages = "{\"executable\":null}\n{\"executable\":\"/a/counts-1\",\"fresh\":true}\n{}";
        assert_eq!(executable(messages), Some("/a/counts-1".into()));
        assert_eq!(executable("{\"executable\":null}"), None);
    }
}
