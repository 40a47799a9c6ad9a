//! The map in ARCHITECTURE.md shows the folders that exist, all of them and no others, and the
//! library's in the order in which they may know each other.
//!
//! The map is the table below the heading `## The map`; the first cell of a row names paths from
//! the root of the repository, each between backquotes.

use super::Problem;

/// The heading of the map.
const HEADING: &str = "## The map";

/// What the page is held against.
pub(crate) struct Facts<'a> {
    /// The folders that must be on the map.
    pub(crate) folders: &'a [String],
    /// Where the library's folders lie, and their order.
    pub(crate) library: (&'a str, &'a [&'a str]),
    /// Whether a path exists.
    pub(crate) exists: &'a dyn Fn(&str) -> bool,
}

/// Checks the page.
pub(crate) fn check(file: &str, page: &str, facts: &Facts<'_>) -> Vec<Problem> {
    let problem = |line: usize, what: String| Problem { file: file.to_owned(), line, what };
    let Some(heading) = page.lines().position(|line| line.trim_end() == HEADING) else {
        return vec![problem(1, format!("the heading `{HEADING}` and its table are missing"))];
    };
    let named = named(page, heading);
    let mut problems = Vec::new();
    for &(path, line) in &named {
        if !(facts.exists)(path) {
            problems.push(problem(line, format!("`{path}` is on the map but does not exist")));
        }
    }
    for folder in facts.folders {
        if named.iter().all(|(path, _)| path != folder) {
            problems.push(problem(heading + 1, format!("`{folder}` exists but is not on the map")));
        }
    }
    problems.extend(disorder(&named, facts.library).map(|(path, line)| {
        problem(line, format!("`{path}` stands too low on the map: what stands below knows it"))
    }));
    problems
}

/// The paths of the map, with their lines.
fn named(page: &str, heading: usize) -> Vec<(&str, usize)> {
    let rows = page.lines().enumerate().skip(heading + 1);
    let rows = rows.take_while(|(_, line)| !line.starts_with("## "));
    let cells =
        rows.filter_map(|(at, line)| Some((at, line.strip_prefix('|')?.split('|').next()?)));
    // Between backquotes is every second piece.
    let pieces =
        cells.flat_map(|(at, cell)| cell.split('`').skip(1).step_by(2).map(move |p| (p, at)));
    pieces.map(|(path, at)| (path.trim_end_matches('/'), at + 1)).collect()
}

/// The first folder of the library that comes after one which belongs below it.
fn disorder<'a>(
    named: &[(&'a str, usize)],
    (library, order): (&str, &[&str]),
) -> Option<(&'a str, usize)> {
    let rank = |path: &str| {
        let folder = path.strip_prefix(library)?.strip_prefix('/')?;
        order.iter().position(|name| *name == folder)
    };
    let ranks = named.iter().filter_map(|&(path, line)| Some((rank(path)?, path, line)));
    let ranks: Vec<_> = ranks.collect();
    let wrong = ranks.windows(2).find(|pair| pair[1].0 < pair[0].0)?;
    Some((wrong[1].1, wrong[1].2))
}

#[cfg(test)]
mod tests {
    use super::{Facts, check};

    const PAGE: &str = "\
# House

`src/elsewhere` is not on the map.

## The map

| where | what |
|---|---|
| `src/math` | vectors, see `lib.rs` |
| `src/tree/`, `src/build` | trees |
| `xtask` | chores |

## More

| `src/nothing` | no map |
";
    const REAL: [&str; 4] = ["src/math", "src/tree", "src/build", "xtask"];

    fn problems(page: &str, folders: &[&str], real: &[&str], order: &[&str]) -> Vec<String> {
        let folders: Vec<String> = folders.iter().map(|folder| (*folder).to_owned()).collect();
        let exists = |path: &str| real.contains(&path);
        let facts = Facts { folders: &folders, library: ("src", order), exists: &exists };
        let found = check("A.md", page, &facts);
        found.iter().map(|problem| format!("{}: {}", problem.line, problem.what)).collect()
    }

    #[test]
    fn a_true_map_is_fine() {
        assert_eq!(problems(PAGE, &REAL, &REAL, &["math", "simd", "tree", "build"]), [""; 0]);
    }

    #[test]
    fn what_is_not_there_is_refused() {
        let what = "9: `src/math` is on the map but does not exist";
        assert_eq!(problems(PAGE, &[], &REAL[1..], &[]), [what]);
        let what = "11: `xtask` is on the map but does not exist";
        assert_eq!(problems(PAGE, &[], &REAL[..3], &[]), [what]);
    }

    #[test]
    fn what_is_not_named_is_refused() {
        let what = "6: `src/elsewhere` exists but is not on the map";
        assert_eq!(problems(PAGE, &["src/elsewhere"], &REAL, &[]), [what]);
    }

    #[test]
    fn a_wrong_order_is_refused() {
        let what = "10: `src/build` stands too low on the map: what stands below knows it";
        assert_eq!(problems(PAGE, &[], &REAL, &["math", "build", "tree"]), [what]);
    }

    #[test]
    fn a_page_without_a_map_is_refused() {
        assert_eq!(problems("# House\n| `src/math` |\n", &[], &REAL, &[]).len(), 1);
    }
}
