//! The rules of the house that a program can check. Each rule is a function from text to
//! problems, with tests that show it can fail; this file reads the tree and prints.
//!
//! Exempt everywhere: comments (doc comments included) and string literals. Exempt from the order
//! of the folders only: what stands under `#[cfg(test)]`.

mod crates;
mod layers;
mod links;
mod map;
mod source;
mod wall;

use std::fmt;
use std::path::{Path, PathBuf};

/// The folder whose folders have an order.
const LIBRARY: &str = "crates/treelet/src";

/// The pages at the root whose links are followed.
const PAPERS: [&str; 3] = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md"];

/// One broken rule, where it is broken.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Problem {
    /// The file, from the repository's root.
    pub(crate) file: String,
    /// The line, from 1.
    pub(crate) line: usize,
    /// What is wrong and what would be right.
    pub(crate) what: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: {}", self.file, self.line, self.what)
    }
}

/// Checks the tree under `root`, prints every problem, fails if there is one.
pub(crate) fn run(root: &Path) -> Result<(), String> {
    let problems = check(root)?;
    for problem in &problems {
        eprintln!("{problem}");
    }
    match problems.len() {
        0 => Ok(()),
        1 => Err("the architecture has 1 problem".into()),
        count => Err(format!("the architecture has {count} problems")),
    }
}

/// Every problem of the tree under `root`, in a fixed order.
pub(crate) fn check(root: &Path) -> Result<Vec<Problem>, String> {
    let mut problems = Vec::new();

    // The library's folders know only those above them.
    let library = root.join(LIBRARY);
    let mut modules = Vec::new();
    for file in rust_files(&library)? {
        modules.push((relative(root, &file), source::Source::parse(&read(&file)?)));
    }
    problems.extend(layers::check(LIBRARY, &modules));

    // The crates know only those below them.
    let workspace = read(&root.join("Cargo.toml"))?;
    for manifest in manifests(root)? {
        let name = relative(root, &manifest);
        problems.extend(crates::check(&name, &read(&manifest)?, &workspace));
    }

    // Unsafe code stays behind the wall.
    for folder in ["crates", "xtask"] {
        for file in rust_files(&root.join(folder))? {
            let source = source::Source::parse(&read(&file)?);
            problems.extend(wall::check(&relative(root, &file), &source));
        }
    }

    // The map shows what exists.
    let page = root.join("ARCHITECTURE.md");
    if page.is_file() {
        let folders: Vec<String> =
            ["crates", LIBRARY].into_iter().flat_map(|folder| folders(root, folder)).collect();
        let exists = |path: &str| root.join(path).exists();
        let library = (LIBRARY, layers::ORDER);
        let facts = map::Facts { folders: &folders, library, exists: &exists };
        problems.extend(map::check("ARCHITECTURE.md", &read(&page)?, &facts));
    } else {
        let what = "the page with the map of the repository is missing".to_owned();
        problems.push(Problem { file: "ARCHITECTURE.md".into(), line: 1, what });
    }

    // The papers lead to what exists.
    for paper in PAPERS {
        if let Ok(page) = read(&root.join(paper)) {
            problems.extend(links::check(paper, &page, &|path| root.join(path).exists()));
        }
    }

    problems.sort();
    Ok(problems)
}

/// The manifests of all crates.
fn manifests(root: &Path) -> Result<Vec<PathBuf>, String> {
    let mut manifests = vec![root.join("xtask/Cargo.toml")];
    for entry in entries(&root.join("crates"))? {
        let manifest = entry.join("Cargo.toml");
        if manifest.exists() {
            manifests.push(manifest);
        }
    }
    Ok(manifests)
}

/// The folders directly in `folder`, as paths from the root; none if it is not there.
fn folders(root: &Path, folder: &str) -> Vec<String> {
    let entries = entries(&root.join(folder)).unwrap_or_default();
    entries.iter().filter(|entry| entry.is_dir()).map(|entry| relative(root, entry)).collect()
}

/// Every `.rs` file under `folder`, sorted; build outputs and hidden folders are left out.
pub(crate) fn rust_files(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in entries(&folder)? {
            let name = entry.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if entry.is_dir() && name != "target" && !name.starts_with('.') {
                folders.push(entry);
            } else if name.ends_with(".rs") {
                files.push(entry);
            }
        }
    }
    files.sort();
    Ok(files)
}

/// What a folder holds, sorted.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let failed = |error| format!("{}: {error}", folder.display());
    let mut entries = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        entries.push(entry.map_err(failed)?.path());
    }
    entries.sort();
    Ok(entries)
}

/// A file's text.
fn read(file: &Path) -> Result<String, String> {
    std::fs::read_to_string(file).map_err(|error| format!("{}: {error}", file.display()))
}

/// A path from the root, with `/`.
fn relative(root: &Path, path: &Path) -> String {
    let path = path.strip_prefix(root).unwrap_or(path);
    let parts: Vec<_> = path.components().map(|part| part.as_os_str().to_string_lossy()).collect();
    parts.join("/")
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    /// The repository keeps its own rules: this is also what `cargo xtask architecture` says.
    #[test]
    fn this_repository_is_in_order() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        let problems = super::check(root).unwrap();
        let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
        assert!(lines.is_empty(), "{}", lines.join("\n"));
    }

    /// The page is not optional.
    #[test]
    fn a_missing_map_is_a_problem() {
        let root = std::env::temp_dir().join(format!("xtask-map-{}", std::process::id()));
        for folder in [super::LIBRARY, "xtask"] {
            std::fs::create_dir_all(root.join(folder)).unwrap();
        }
        for manifest in ["Cargo.toml", "xtask/Cargo.toml"] {
            std::fs::write(root.join(manifest), "[workspace.dependencies]\n").unwrap();
        }
        let problems = super::check(&root);
        std::fs::remove_dir_all(&root).unwrap();
        let problems = problems.unwrap();
        let missing = |problem: &super::Problem| problem.what.contains("map") && problem.line == 1;
        assert!(problems.iter().any(missing), "{problems:?}");
    }
}
