//! `cargo xtask test`: every check that a change must pass, stopping at the first that fails.
//!
//! All steps use the profile `checked`, release with assertions: rays are a hundred times cheaper
//! than unoptimised, and procedural macros, dependencies and their metadata are built once for all
//! steps.

use std::path::Path;

use crate::rivals::target;
use crate::step::{Steps, cargo, cargo_has, cargo_with};
use crate::{architecture, counts, formatting, levels, setup, size};

/// The profile of every step, as Cargo's options name it.
const PROFILE: &str = "--profile=checked";

/// Warnings are errors in the API documentation too.
const DOC_FLAGS: &[(&str, &str)] = &[("RUSTDOCFLAGS", "-D warnings")];

/// Runs every check.
pub(crate) fn run(root: &Path) -> Result<(), String> {
    let mut steps = Steps::new(13);
    steps.run("set-up", || setup::run(root))?;
    // The checks that need no compiling come first.
    steps.run("architecture", || architecture::run(root))?;
    steps.run("formatting", || formatting::run(root))?;
    steps.run("lints", || {
        let lints = ["clippy", "--workspace", "--all-targets", PROFILE, "--", "-D", "warnings"];
        cargo(root, &lints)
    })?;
    steps.run("the library without default features", || check(root, "--no-default-features"))?;
    steps.run("the library with all features", || check(root, "--all-features"))?;
    // Apart, so that the record tells what compiling takes.
    steps.run("tests, compiled", || tests(root, &["--no-run"]))?;
    steps.run("tests", || tests(root, &[]))?;
    steps.run("documentation tests", || cargo(root, &["test", "--workspace", PROFILE, "--doc"]))?;
    steps.run("documentation", || {
        cargo_with(root, &["doc", "--workspace", "--no-deps", PROFILE], DOC_FLAGS)
    })?;
    steps.run("size of the command", || size::run_where_possible(root))?;
    steps.run("instructions of the kernels", || counts::run_where_possible(root))?;
    steps.run("tests at other instruction sets", || levels::run_where_possible(root))?;
    steps.finish(&target(root).join("steps.csv"));
    Ok(())
}

/// Compiles the library alone under another set of features.
fn check(root: &Path, features: &str) -> Result<(), String> {
    cargo(root, &["check", "--package", "treelet", PROFILE, features])
}

/// The tests of every crate, by nextest where it is installed, with more arguments.
fn tests(root: &Path, more: &[&str]) -> Result<(), String> {
    let words: &[&str] = if cargo_has(root, "nextest") {
        &["nextest", "run", "--workspace", "--cargo-profile=checked"]
    } else {
        eprintln!("  cargo-nextest is not installed; `cargo test` does the same, one crate a time");
        &["test", "--workspace", PROFILE, "--lib", "--bins", "--tests"]
    };
    cargo(root, &[words, more].concat())
}
