//! Unsafe code stands only behind the wall: three folders of the library, and the one of the bench
//! that calls a rival's C interface.

use super::Problem;
use super::source::Source;

/// The folders that may hold `unsafe`.
const WALL: [&str; 4] = [
    "crates/treelet/src/simd/",
    "crates/treelet/src/memory/",
    "crates/treelet/src/file/",
    "crates/treelet-bench/src/rivals/embree/",
];

/// Checks one file, given from the repository's root. Tests are not exempt.
pub(crate) fn check(file: &str, source: &Source) -> Vec<Problem> {
    if WALL.iter().any(|folder| file.starts_with(folder)) {
        return Vec::new();
    }
    let unsafe_words = source.tokens.iter().filter(|token| token.text == "unsafe");
    unsafe_words
        .map(|token| Problem {
            file: file.to_owned(),
            line: token.line,
            what: "`unsafe` stands only in simd/, memory/ and file/ of the library, and where the \
                   bench calls Embree"
                .into(),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{Source, check};

    #[test]
    fn unsafe_outside_the_wall_is_refused() {
        let source = Source::parse("//! unsafe\nfn f() {\n  unsafe { g() }\n}\n// \"unsafe\"");
        let lines = |file: &str| {
            check(file, &source).iter().map(|problem| problem.line).collect::<Vec<_>>()
        };
        assert_eq!(lines("crates/treelet/src/trace/single.rs"), [3]);
        assert_eq!(lines("crates/treelet-render/src/simd/mod.rs"), [3]);
        assert_eq!(lines("crates/treelet-bench/src/rivals/mod.rs"), [3]);
        assert_eq!(lines("crates/treelet-bench/src/rivals/embree/mod.rs"), [0; 0]);
        assert_eq!(lines("crates/treelet/src/simd/avx2/slab.rs"), [0; 0]);
        assert_eq!(lines("crates/treelet/src/simdless.rs"), [3]);
    }
}
