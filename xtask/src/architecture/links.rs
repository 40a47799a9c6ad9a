//! The papers' links and pictures lead to files that exist.
//!
//! A link is `[words](target)`, a picture `![words](target)`, as Markdown has them. Targets with a
//! scheme and those inside the same page are not followed; what stands in a block of code or
//! between backquotes is no link.

use super::Problem;

/// Checks one page; `exists` is asked for paths from the page's folder.
pub(crate) fn check(file: &str, page: &str, exists: &dyn Fn(&str) -> bool) -> Vec<Problem> {
    let mut problems = Vec::new();
    let mut code = false;
    for (at, line) in page.lines().enumerate() {
        if line.trim_start().starts_with("```") {
            code = !code;
        } else if !code {
            for target in targets(line).into_iter().filter(|target| !exists(target)) {
                let what = format!("the link leads to `{target}`, which does not exist");
                problems.push(Problem { file: file.to_owned(), line: at + 1, what });
            }
        }
    }
    problems
}

/// The paths that a line links to.
fn targets(line: &str) -> Vec<String> {
    // Between backquotes is every second piece.
    let words: Vec<&str> = line.split('`').step_by(2).collect();
    let words = words.join("`");
    let links = words.split("](").skip(1).filter_map(|link| link.split_once(')'));
    let paths = links.filter_map(|(target, _)| {
        // A title may follow the target, and a heading the path.
        let target = target.split_whitespace().next()?;
        let path = target.split('#').next()?;
        let elsewhere = path.is_empty() || path.contains("://") || path.starts_with("mailto:");
        (!elsewhere).then(|| path.to_owned())
    });
    paths.collect()
}

#[cfg(test)]
mod tests {
    use super::check;

    #[test]
    fn links_lead_somewhere() {
        let page = "\
# House
![a picture](docs/a.png) and [the map](MAP.md#rooms), [here](#below), [there](https://x.y/z).
Not a link: `[a](none.md)`. Twice: [b](gone.md \"title\") [c](LICENSE)
```
[d](none.md)
```
[`e`](lost.md)
";
        let real = ["MAP.md", "LICENSE"];
        let problems = check("A.md", page, &|path| real.contains(&path));
        let found: Vec<_> = problems.iter().map(ToString::to_string).collect();
        assert_eq!(
            found,
            [
                "A.md:2: the link leads to `docs/a.png`, which does not exist",
                "A.md:3: the link leads to `gone.md`, which does not exist",
                "A.md:7: the link leads to `lost.md`, which does not exist",
            ]
        );
    }
}
