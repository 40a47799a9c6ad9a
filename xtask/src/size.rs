//! `cargo xtask size`: how large the command is, and how much of that is kernels of each
//! instruction set, so that neither grows unseen.
//!
//! It looks at the program that the tests run, which is there anyway: release with assertions.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::limits::{Measured, Table};
use crate::rivals::target;
use crate::step::output;

/// What is let pass: ordinary work on the command.
const LIMITS: Table = Table { name: "size", tolerance: 0.05, bless: "cargo xtask size --bless" };

/// Bytes of a kilobyte.
const KILO: f64 = 1e3;

/// The modules in `simd/` that functions of an instruction set are compiled in. Scalar code is part
/// of whatever calls it.
const LEVELS: [&str; 3] = ["sse42", "avx2", "avx512"];

/// Measures, and holds the sizes against the limits.
pub(crate) fn run(root: &Path) -> Result<(), String> {
    LIMITS.check(root, &measure(&program(root)?)?)
}

/// Measures, and makes the sizes the limits.
pub(crate) fn bless(root: &Path) -> Result<(), String> {
    LIMITS.write(root, &measure(&program(root)?)?)
}

/// [`run`] where there are the binutils, on the system that has limits.
pub(crate) fn run_where_possible(root: &Path) -> Result<(), String> {
    if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        eprintln!("  SKIPPED: the limits are those of Linux on x86-64");
        return Ok(());
    }
    let there = |program: &str| {
        let mut command = Command::new(program);
        command.arg("--version").stdout(Stdio::null()).stderr(Stdio::null());
        command.status().is_ok_and(|status| status.success())
    };
    if there("size") && there("nm") {
        return run(root);
    }
    eprintln!("  SKIPPED: the command's size is not looked at: install the package binutils");
    Ok(())
}

/// The command as the tests built it.
fn program(root: &Path) -> Result<PathBuf, String> {
    let program = target(root).join("checked").join("treelet");
    if program.exists() {
        return Ok(program);
    }
    Err(format!("{} is not there; the tests build it", program.display()))
}

/// Sizes in kilobytes.
fn measure(program: &Path) -> Result<Measured, String> {
    let sections = output(Command::new("size").arg("-A").arg(program))?;
    let symbols =
        output(Command::new("nm").args(["-S", "-t", "d", "--defined-only"]).arg(program))?;
    let mut measured = Measured::new();
    let code = section(&sections, ".text").ok_or("`size -A` tells no .text")?;
    let all = section(&sections, "Total").ok_or("`size -A` tells no total")?;
    measured.insert("kB of code".to_owned(), code / KILO);
    measured.insert("kB in all".to_owned(), all / KILO);
    for level in LEVELS {
        let bytes = kernels(&symbols, level);
        if bytes == 0 {
            return Err(format!("no function of {level} is known by its symbol any more"));
        }
        measured.insert(format!("kB of kernels, {level}"), bytes as f64 / KILO);
    }
    Ok(measured)
}

/// The size of a section, of what `size -A` prints.
fn section(lines: &str, name: &str) -> Option<f64> {
    let words = lines.lines().map(|line| line.split_whitespace().collect::<Vec<_>>());
    let found = words.into_iter().find(|words| words.first() == Some(&name))?;
    found.get(1)?.parse().ok()
}

/// The size of an instruction set's functions, of what `nm -S` prints.
fn kernels(lines: &str, level: &str) -> u64 {
    // As a path, each part with its length before it, or within a type's name.
    let signs = [format!("simd{}{level}", level.len()), format!("simd..{level}.")];
    let size = |line: &str| {
        let [_, size, _, symbol] = line.split_whitespace().collect::<Vec<_>>()[..] else {
            return None;
        };
        let ours = symbol.contains("treelet") && signs.iter().any(|sign| symbol.contains(sign));
        ours.then(|| size.parse::<u64>().ok()).flatten()
    };
    lines.lines().filter_map(size).sum()
}

#[cfg(test)]
mod tests {
    use super::{kernels, section};

    #[test]
    fn sections_and_symbols_are_summed() {
        let sections = "treelet  :\nsection  size  addr\n.text  1500  64\nTotal  2500\n";
        assert_eq!(section(sections, ".text"), Some(1500.0));
        assert_eq!(section(sections, "Total"), Some(2500.0));
        assert_eq!(section(sections, ".data"), None);
        let symbols = "10 30 t _ZN7treelet4simd4avx23runE\n40 5 T _ZN7treelet4simd6avx5123runE\n\
                       50 7 t _ZN6memchr4avx2E\n60 t _ZN7treelet4simd4avx2E\n\
                       70 9 T _ZN70_$LT$treelet..simd..avx512..Avx512$u20$as$GT$4callE\n";
        assert_eq!(kernels(symbols, "avx2"), 30);
        assert_eq!(kernels(symbols, "avx512"), 14);
        assert_eq!(kernels(symbols, "sse42"), 0);
    }
}
