//! Every Rust file of the repository is formatted.
//!
//! `cargo fmt` follows `mod` lines and so misses the modules that a `catalogue!` declares; here
//! `rustfmt` is given each file by name.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::architecture::rust_files;
use crate::step::announced;

/// The folders with Rust files.
const FOLDERS: [&str; 2] = ["crates", "xtask"];

/// The edition of the workspace, which `rustfmt` does not read from manifests.
const EDITION: &str = "2024";

/// Fails if a file is not formatted; `rustfmt` prints the differences.
pub(crate) fn run(root: &Path) -> Result<(), String> {
    let mut files: Vec<PathBuf> = Vec::new();
    for folder in FOLDERS {
        files.extend(rust_files(&root.join(folder))?);
    }
    let mut rustfmt = Command::new("rustfmt");
    rustfmt.current_dir(root).args(["--check", "--edition", EDITION]).args(&files);
    let shown = format!("rustfmt --check --edition {EDITION} <{} files>", files.len());
    announced(&mut rustfmt, &shown)
}

#[cfg(test)]
mod tests {
    /// A module that only a macro declares is looked at.
    #[test]
    fn an_unformatted_file_is_refused() {
        let root = std::env::temp_dir().join(format!("xtask-formatting-{}", std::process::id()));
        let file = |name: &str, text: &str| {
            let file = root.join(name);
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::write(file, text).unwrap();
        };
        file("crates/a/src/lib.rs", "hidden!(b);\n");
        file("crates/a/src/b.rs", "fn b() {}\n");
        file("xtask/main.rs", "fn main() {}\n");
        let good = super::run(&root);
        file("crates/a/src/b.rs", "fn  b( ) { }\n");
        let bad = super::run(&root);
        std::fs::remove_dir_all(&root).unwrap();
        assert_eq!(good, Ok(()));
        assert!(bad.is_err());
    }
}
