//! A folder of the library names only folders above it.
//!
//! Looked at are the paths that start with `crate` or `super`, in `use` and elsewhere, groups
//! included. A name that `lib.rs` re-exports counts as its folder. A glob over the whole crate is
//! refused, as it hides what is used.

use super::Problem;
use super::source::{Source, Token};

/// The order, from the ground up. A new folder is written here and in ARCHITECTURE.md.
const ORDER: &[&str] = &[
    "context", "memory", "math", "simd", "bounds", "geometry", "tree", "build", "optimize",
    "layout", "trace", "query", "scene", "file", "verify",
];

/// A path in the source, as `["crate", "tree", "Node"]`, and where its last name stands.
#[derive(Debug, PartialEq)]
struct Path {
    names: Vec<String>,
    line: usize,
}

/// Checks the files of the library; `folder` is where they lie, with paths from the same root.
pub(crate) fn check(folder: &str, files: &[(String, Source)]) -> Vec<Problem> {
    let inside = |file: &str| {
        let path = file.strip_prefix(folder)?.strip_prefix('/')?.strip_suffix(".rs")?;
        Some(path.split('/').map(str::to_owned).collect::<Vec<_>>())
    };
    let exports: Vec<(String, String)> = files
        .iter()
        .filter(|(file, _)| inside(file).is_some_and(|path| path == ["lib"]))
        .flat_map(|(_, source)| exports(source))
        .collect();
    let mut problems = Vec::new();
    for (file, source) in files {
        let Some(mut module) = inside(file) else { continue };
        if module == ["lib"] {
            continue;
        }
        if module.last().is_some_and(|name| name == "mod") {
            module.pop();
        }
        let problem = |line: usize, what: String| Problem { file: file.clone(), line, what };
        let Some(own) = rank(&module[0]) else {
            let what = format!("`{}` has no place in the order of xtask's layers.rs", module[0]);
            problems.push(problem(1, what));
            continue;
        };
        for path in paths(source, &module) {
            let Some(name) = path.names.first() else { continue };
            let exported = exports.iter().find(|(short, _)| short == name);
            let target = exported.map_or(name, |(_, folder)| folder);
            match rank(target) {
                Some(other) if other <= own => {}
                Some(_) => problems.push(problem(
                    path.line,
                    format!("`{}` must not know `{target}`, which stands below it", module[0]),
                )),
                None => problems.push(problem(
                    path.line,
                    format!("`crate::{name}` is neither a folder nor a re-export of lib.rs"),
                )),
            }
        }
    }
    // One line may name the same folder many times.
    problems.sort();
    problems.dedup();
    problems
}

/// The place of a folder in the order.
fn rank(folder: &str) -> Option<usize> {
    ORDER.iter().position(|name| *name == folder)
}

/// What lib.rs re-exports: the name and the folder it comes from.
fn exports(source: &Source) -> Vec<(String, String)> {
    let mut exports = Vec::new();
    for at in 0..source.tokens.len() {
        if source.text(at) != "pub" || source.text(at + 1) != "use" {
            continue;
        }
        let mut found = Vec::new();
        tree(source, at + 2, &[], &mut found);
        for path in found {
            let names: Vec<_> =
                path.names.iter().filter(|n| *n != "crate" && *n != "self").collect();
            if let [folder, .., name] = names.as_slice() {
                exports.push(((*name).clone(), (*folder).clone()));
            }
        }
    }
    exports
}

/// The paths of a file of module `module` that start at the crate's root, tests left out.
fn paths(source: &Source, module: &[String]) -> Vec<Path> {
    let skip = source.under_test();
    let mut paths = Vec::new();
    // Inline modules deepen what `super` means: where each of them ends.
    let mut inline: Vec<(String, usize)> = Vec::new();
    for at in 0..source.tokens.len() {
        inline.retain(|(_, end)| at < *end);
        let previous = if at == 0 { "" } else { source.text(at - 1) };
        if source.text(at) == "mod" && source.text(at + 2) == "{" {
            inline.push((source.text(at + 1).to_owned(), source.closing(at + 2)));
        }
        let starts = matches!(source.text(at), "crate" | "super" | "self")
            && source.text(at + 1) == "::"
            && !matches!(previous, "::" | "$");
        if !starts || skip[at] {
            continue;
        }
        let mut found = Vec::new();
        tree(source, at, &[], &mut found);
        let here: Vec<String> =
            module.iter().chain(inline.iter().map(|(name, _)| name)).cloned().collect();
        paths.extend(found.into_iter().map(|path| absolute(&here, path)));
    }
    paths
}

/// Follows `a::b::{c, d::*}` from token `at`; one path for each leaf. Returns the token after it.
fn tree(source: &Source, mut at: usize, prefix: &[String], found: &mut Vec<Path>) -> usize {
    let mut names = prefix.to_vec();
    let line = |at: usize| source.tokens.get(at).map_or(0, |token: &Token| token.line);
    loop {
        match source.text(at) {
            "{" => {
                let end = source.closing(at);
                at += 1;
                while at + 1 < end {
                    at = tree(source, at, &names, found).max(at + 1);
                    if source.text(at) == "," {
                        at += 1;
                    }
                }
                return end;
            }
            word if word == "*" || is_word(word) => {
                names.push(word.to_owned());
                at += 1;
            }
            _ => return at,
        }
        if source.text(at) != "::" {
            let path = Path { names, line: line(at - 1) };
            // `a as b` is known as b: the last name is what matters to those who re-export.
            let renamed = source.text(at) == "as" && is_word(source.text(at + 1));
            if renamed && source.text(at + 1) != "_" {
                let names = path.names.iter().cloned().chain([source.text(at + 1).to_owned()]);
                found.push(Path { names: names.collect(), line: path.line });
            } else {
                found.push(path);
            }
            return if renamed { at + 2 } else { at };
        }
        at += 1;
    }
}

/// Whether a token can be a name in a path.
fn is_word(text: &str) -> bool {
    text.chars().next().is_some_and(|c| c.is_alphabetic() || c == '_')
}

/// The path from the crate's root, without the word `crate`.
fn absolute(module: &[String], path: Path) -> Path {
    let mut names: Vec<String> = match path.names.first().map(String::as_str) {
        Some("crate") => Vec::new(),
        _ => module.to_vec(),
    };
    for name in path.names {
        match name.as_str() {
            "crate" | "self" => {}
            "super" => {
                names.pop();
            }
            _ => names.push(name),
        }
    }
    Path { names, line: path.line }
}

#[cfg(test)]
mod tests {
    use super::{Source, check};

    /// The problems of one file beside a small lib.rs, as `line: what`.
    fn problems(file: &str, text: &str) -> Vec<String> {
        let lib =
            "mod scene; pub use geometry::{Hit, mesh::Mesh as Triangles}; pub use scene::Scene;";
        let files = [
            ("src/lib.rs".to_owned(), Source::parse(lib)),
            (format!("src/{file}"), Source::parse(text)),
        ];
        let found = check("src", &files);
        found.iter().map(|problem| format!("{}: {}", problem.line, problem.what)).collect()
    }

    /// Asserts that the only problem is the knowledge of `target`, in line `line`.
    fn refused(file: &str, text: &str, line: usize, target: &str) {
        let found = problems(file, text);
        let start = format!("{line}: ");
        let end = format!("must not know `{target}`, which stands below it");
        let right =
            matches!(found.as_slice(), [one] if one.starts_with(&start) && one.ends_with(&end));
        assert!(right, "{text:?} in {file} gave {found:?}");
    }

    #[test]
    fn looking_up_is_fine() {
        let text =
            "use crate::math::{vec3, Affine};\nuse super::node::Node;\nfn f() -> crate::Hit {}";
        assert_eq!(problems("tree/validate.rs", text), [""; 0]);
        assert_eq!(problems("tree/deep/mod.rs", "use super::super::bounds::Aabb;"), [""; 0]);
        assert_eq!(problems("verify/mod.rs", "use crate::{scene, query::closest};"), [""; 0]);
    }

    #[test]
    fn looking_down_is_refused() {
        refused("math/mod.rs", "\nuse crate::tree::Node;", 2, "tree");
        refused(
            "math/ray.rs",
            "use crate::memory;\nuse crate::{memory::Array,\n bounds::Aabb};",
            3,
            "bounds",
        );
        refused("build/mod.rs", "fn f(x: &crate::scene::Scene) {}", 1, "scene");
        refused("bounds/aabb.rs", "use super::super::geometry::Mesh;", 1, "geometry");
        refused("bounds/mod.rs", "use super::geometry::Mesh;", 1, "geometry");
        refused("tree/mod.rs", "pub(in crate::trace) struct X;", 1, "trace");
        refused(
            "tree/mod.rs",
            "use crate::{math::{vec3, ray::*}, trace::{self, walk}};",
            1,
            "trace",
        )
    }

    #[test]
    fn a_re_export_counts_as_its_folder() {
        refused("math/ray.rs", "use crate::Hit;", 1, "geometry");
        refused("math/ray.rs", "use crate::Triangles;", 1, "geometry");
        refused("query/any.rs", "use crate::Scene;", 1, "scene");
        assert_eq!(problems("math/ray.rs", "use crate::Unknown;").len(), 1);
        assert_eq!(problems("math/ray.rs", "use crate::*;").len(), 1);
    }

    #[test]
    fn inline_modules_deepen_super() {
        let text = "mod a { mod b { use super::super::x; } use super::super::geometry; }";
        refused("bounds/mod.rs", text, 1, "geometry");
    }

    #[test]
    fn tests_comments_and_macros_are_exempt() {
        let text = "//! See crate::verify.\n#[cfg(test)]\nmod tests { use crate::verify::rays; }";
        assert_eq!(problems("math/mod.rs", text), [""; 0]);
        assert_eq!(
            problems("math/mod.rs", "macro_rules! m { () => { $crate::scene::X } }"),
            [""; 0]
        );
    }

    #[test]
    fn a_folder_without_a_place_is_refused() {
        assert_eq!(problems("misc/mod.rs", "").len(), 1);
        assert_eq!(problems("helpers.rs", "").len(), 1);
    }
}
