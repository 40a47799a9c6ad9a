//! `cargo xtask levels`: the library's tests at the instruction sets of other processors. NEON runs
//! in an emulator, WebAssembly's `simd128` in node.
//!
//! Rust's own toolchain comes with the standard library of the machine at hand only. Debian has its
//! source (`rust-web-src`) and a compiler of the same version, with which it is built here; nothing
//! is downloaded but crates. The emulator is slow, so tests repeat things less often
//! (`TREELET_TEST_SHARE`), and what does not depend on the instruction set is left out.

mod machines;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use crate::step::{announced, output};
use machines::{MACHINES, Machine, Need, TOOLCHAIN};

/// Tests every machine; fails if one cannot be tested.
pub(crate) fn run(root: &Path) -> Result<(), String> {
    let mut lacking = Vec::new();
    for machine in MACHINES {
        match missing(machine) {
            Some(reason) => lacking.push(reason),
            None => test(root, machine)?,
        }
    }
    if lacking.is_empty() { Ok(()) } else { Err(lacking.join("; ")) }
}

/// Tests the machines for which everything is installed, and says what the others lack.
pub(crate) fn run_where_possible(root: &Path) -> Result<(), String> {
    for machine in MACHINES {
        match missing(machine) {
            Some(reason) => eprintln!("  SKIPPED: {reason}"),
            None => test(root, machine)?,
        }
    }
    Ok(())
}

/// What to install for a machine, in one line.
fn missing(machine: &Machine) -> Option<String> {
    let needs = TOOLCHAIN.iter().chain(machine.needs);
    let packages: Vec<&str> =
        needs.filter(|need| !is_there(need)).map(|need| need.package).collect();
    (!packages.is_empty()).then(|| {
        format!("{} is not tested: install the packages {}", machine.name, packages.join(", "))
    })
}

/// Whether a file exists or a program is on the path.
fn is_there(need: &Need) -> bool {
    let folders = std::env::var_os("PATH").unwrap_or_default();
    // Joined to an absolute file, a folder makes no difference.
    std::env::split_paths(&folders).any(|folder| folder.join(need.file).exists())
}

/// Builds the standard library and the tests once, then runs them.
fn test(root: &Path, machine: &Machine) -> Result<(), String> {
    let version = output(Command::new(machines::RUSTC).arg("--version"))?;
    eprintln!("  {}: {version}", machine.name);
    let cargo = || cargo(root, machine);
    let targets = machine.tests.iter().flat_map(|tests| tests.target);
    timed("built", || {
        let mut command = cargo()?;
        command.args(targets).arg("--no-run");
        let shown = format!("cargo test --target {} --no-run", machine.triple);
        announced(&mut command, &shown)
    })?;
    for tests in machine.tests {
        timed("passed", || {
            let mut command = cargo()?;
            command.args(tests.target).arg("--").args(tests.filter);
            command.env("TREELET_TEST_SHARE", tests.share);
            let shown = [tests.target, tests.filter].concat().join(" ");
            let shown = format!(
                "TREELET_TEST_SHARE={} cargo test --target {} {shown}",
                tests.share, machine.triple
            );
            announced(&mut command, &shown)
        })?;
    }
    Ok(())
}

/// Says how long it took.
fn timed(what: &str, work: impl FnOnce() -> Result<(), String>) -> Result<(), String> {
    let started = Instant::now();
    work()?;
    eprintln!("  {what} in {:.1} s", started.elapsed().as_secs_f64());
    Ok(())
}

/// Debian's `cargo test` of the library for a machine.
fn cargo(root: &Path, machine: &Machine) -> Result<Command, String> {
    let mut command = Command::new(machines::CARGO);
    command.current_dir(root);
    // What rustup and the cargo that runs us set is about another toolchain.
    for (name, _) in std::env::vars_os() {
        let name = name.to_string_lossy();
        if name.starts_with("CARGO_PKG_") || name.starts_with("RUSTUP_") || name == "CARGO" {
            command.env_remove(&*name);
        }
    }
    command.env_remove("CARGO_MANIFEST_DIR").env_remove("CARGO_MANIFEST_PATH");
    // A folder of its own: another compiler's build scripts and macros are there.
    command.env("CARGO_TARGET_DIR", crate::rivals::target(root).join("levels"));
    command.env("RUSTC", machines::RUSTC).env("RUSTDOC", machines::RUSTDOC);
    // `-Z build-std` asks for it.
    command.env("RUSTC_BOOTSTRAP", "1");

    let variable = |what: &str| {
        let triple = machine.triple.to_uppercase().replace('-', "_");
        format!("CARGO_TARGET_{triple}_{what}")
    };
    let linker = match machine.linker {
        Some(linker) => PathBuf::from(linker),
        None => rust_lld()?,
    };
    command.env(variable("LINKER"), linker);
    command.env(variable("RUNNER"), machine.runner);
    command.env(variable("RUSTFLAGS"), machine.flags);
    command.args(["test", "--locked", "--package=treelet", "--profile=checked", "--target"]);
    command.arg(machine.triple).args(machine.options);
    Ok(command)
}

/// The linker that comes with the toolchain that compiled us.
fn rust_lld() -> Result<PathBuf, String> {
    let sysroot = output(Command::new("rustc").args(["--print", "sysroot"]))?;
    let about = output(Command::new("rustc").arg("-vV"))?;
    let host = about.lines().find_map(|line| line.strip_prefix("host: "));
    let host = host.ok_or("`rustc -vV` names no host")?;
    let linker = Path::new(&sysroot).join("lib/rustlib").join(host).join("bin/rust-lld");
    if linker.exists() {
        return Ok(linker);
    }
    Err(format!("{} is missing; rustup's toolchains come with it", linker.display()))
}
