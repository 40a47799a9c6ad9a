//! The map in ARCHITECTURE.md shows the folders that exist, all of them and no others.
//!
//! The map is the first code block that has a line `crates/`. Each line names one path below the
//! less indented line above it, then says what it is; names that end in `/` are folders, names
//! with a dot are files, and several may share a line.

use super::Problem;

/// Checks the page; `folders` must be on the map, and `exists` answers for what is on it.
pub(crate) fn check(
    file: &str,
    page: &str,
    folders: &[String],
    exists: impl Fn(&str) -> bool,
) -> Vec<Problem> {
    let problem = |line: usize, what: String| Problem { file: file.to_owned(), line, what };
    let Some((first_line, block)) = block(page) else {
        return vec![problem(1, "no code block has a line `crates/`; the map is missing".into())];
    };
    let named = paths(&block, first_line);
    let unreal = named
        .iter()
        .filter(|(path, _)| !exists(path))
        .map(|(path, line)| problem(*line, format!("`{path}` is on the map but does not exist")));
    let unnamed = folders
        .iter()
        .filter(|folder| !named.iter().any(|(path, _)| path == *folder))
        .map(|folder| problem(first_line, format!("`{folder}/` exists but is not on the map")));
    unreal.chain(unnamed).collect()
}

/// The map's lines and the number of its first.
fn block(page: &str) -> Option<(usize, Vec<&str>)> {
    let mut block: Option<(usize, Vec<&str>)> = None;
    for (index, line) in page.lines().enumerate() {
        if !line.trim_start().starts_with("```") {
            if let Some((_, lines)) = &mut block {
                lines.push(line);
            }
            continue;
        }
        // A fence: the block that ends here may be the map, else one begins.
        match block.take() {
            Some(map) if is_map(&map.1) => return Some(map),
            Some(_) => {}
            None => block = Some((index + 2, Vec::new())),
        }
    }
    block.filter(|(_, lines)| is_map(lines))
}

/// Whether a code block is the map.
fn is_map(lines: &[&str]) -> bool {
    lines.iter().any(|line| line.split_whitespace().next() == Some("crates/"))
}

/// Each path of the map without its closing `/`, with its line.
fn paths(block: &[&str], first_line: usize) -> Vec<(String, usize)> {
    let mut found = Vec::new();
    // The folders that enclose the current line: how far each is indented, and its path.
    let mut above: Vec<(usize, String)> = Vec::new();
    for (index, line) in block.iter().enumerate() {
        let indent = line.len() - line.trim_start().len();
        let names = line.split_whitespace().take_while(|word| is_name(word));
        let names: Vec<&str> = names.collect();
        if names.is_empty() {
            continue;
        }
        above.retain(|(other, _)| *other < indent);
        let parent = above.last().map(|(_, path)| format!("{path}/")).unwrap_or_default();
        for name in names {
            let path = format!("{parent}{}", name.trim_end_matches('/'));
            if name.ends_with('/') {
                above.retain(|(other, _)| *other < indent);
                above.push((indent, path.clone()));
            }
            found.push((path, first_line + index));
        }
    }
    found
}

/// Whether a word of the map names a path rather than tells about one.
fn is_name(word: &str) -> bool {
    let plain = |c: char| c.is_alphanumeric() || "-_./".contains(c);
    let file = |word: &str| word.split_once('.').is_some_and(|(_, end)| end.len() > 1);
    word.chars().all(plain) && (word.ends_with('/') || file(word))
}

#[cfg(test)]
mod tests {
    use super::check;

    const PAGE: &str = "\
# Map

```rust
let x = 1;
```

```text
crates/
  treelet/      the library
    src/
      lib.rs    names
      math/     vectors, see lib.rs
  other/        more
fuzz/  xtask/
.ci/run         one line.
```
";

    fn problems(folders: &[&str], real: &[&str]) -> Vec<String> {
        let folders: Vec<String> = folders.iter().map(|folder| (*folder).to_owned()).collect();
        let found = check("A.md", PAGE, &folders, |path| real.contains(&path));
        found.iter().map(|problem| format!("{}: {}", problem.line, problem.what)).collect()
    }

    const REAL: [&str; 9] = [
        "crates",
        "crates/treelet",
        "crates/treelet/src",
        "crates/treelet/src/lib.rs",
        "crates/treelet/src/math",
        "crates/other",
        "fuzz",
        "xtask",
        ".ci/run",
    ];

    #[test]
    fn a_true_map_is_fine() {
        assert_eq!(problems(&["crates/treelet/src/math", "crates/other"], &REAL), [""; 0]);
    }

    #[test]
    fn what_is_not_there_is_refused() {
        let real = REAL.map(|path| if path == "crates/treelet/src/math" { "" } else { path });
        let what = "12: `crates/treelet/src/math` is on the map but does not exist";
        assert_eq!(problems(&[], &real), [what]);
        let real = REAL.map(|path| if path == "xtask" { "" } else { path });
        assert_eq!(problems(&[], &real), ["14: `xtask` is on the map but does not exist"]);
    }

    #[test]
    fn what_is_not_named_is_refused() {
        let what = "8: `crates/treelet/src/tree/` exists but is not on the map";
        assert_eq!(problems(&["crates/treelet/src/tree"], &REAL), [what]);
    }

    #[test]
    fn a_page_without_a_map_is_refused() {
        assert_eq!(check("A.md", "# Nothing\n```\nx\n```\n", &[], |_| true).len(), 1);
    }
}
