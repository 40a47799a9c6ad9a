//! The crates know each other one way: the library knows none of ours, the command knows all.

use toml::de::{DeTable, DeValue};

use super::Problem;

/// Each crate of the workspace and those of ours that it may depend on. The test kit is open to
/// every crate's tests and to nothing else.
const MAY_KNOW: &[(&str, &[&str])] = &[
    ("treelet-testkit", &[]),
    ("treelet", &[]),
    ("treelet-model", &["treelet"]),
    ("treelet-import", &["treelet", "treelet-model"]),
    ("treelet-render", &["treelet", "treelet-model"]),
    ("treelet-bench", &["treelet", "treelet-model"]),
    (
        "treelet-cli",
        &["treelet", "treelet-model", "treelet-import", "treelet-render", "treelet-bench"],
    ),
    ("xtask", &[]),
];

/// The crate that only tests may use.
const TESTKIT: &str = "treelet-testkit";

/// The three tables of dependencies.
const TABLES: [&str; 3] = ["dependencies", "build-dependencies", "dev-dependencies"];

/// A dependency as the manifest writes it.
struct Dependency {
    name: String,
    line: usize,
    for_tests: bool,
}

/// Checks one manifest; `workspace` is the root's, where a dependency may have another name.
pub(crate) fn check(file: &str, manifest: &str, workspace: &str) -> Vec<Problem> {
    let problem = |line: usize, what: String| Problem { file: file.to_owned(), line, what };
    let manifest = match DeTable::parse(manifest) {
        Ok(table) => Parsed { text: manifest, table: table.into_inner() },
        Err(error) => return vec![problem(1, format!("not readable: {}", error.message()))],
    };
    let workspace = match DeTable::parse(workspace) {
        Ok(table) => Parsed { text: workspace, table: table.into_inner() },
        Err(error) => return vec![problem(1, format!("root manifest: {}", error.message()))],
    };
    let name = string(&manifest.table, &["package", "name"]).unwrap_or_default();
    let Some((_, allowed)) = MAY_KNOW.iter().find(|(known, _)| *known == name) else {
        let what = format!("`{name}` has no place in the list of xtask's crates.rs");
        return vec![problem(1, what)];
    };
    let ours =
        |dependency: &Dependency| MAY_KNOW.iter().any(|(known, _)| *known == dependency.name);
    let fine = |dependency: &Dependency| {
        allowed.contains(&dependency.name.as_str())
            || (dependency.for_tests && dependency.name == TESTKIT && name != TESTKIT)
    };
    manifest
        .dependencies(&workspace)
        .into_iter()
        .filter(|dependency| ours(dependency) && !fine(dependency))
        .map(|dependency| {
            problem(dependency.line, format!("`{name}` must not know `{}`", dependency.name))
        })
        .collect()
}

/// A manifest and its text.
struct Parsed<'a> {
    text: &'a str,
    table: DeTable<'a>,
}

impl Parsed<'_> {
    /// Every dependency: the plain tables and those of each `target`.
    fn dependencies(&self, workspace: &Parsed<'_>) -> Vec<Dependency> {
        let mut places = vec![&self.table];
        let targets = self.table.get("target").and_then(|target| target.get_ref().as_table());
        let targets = targets.into_iter().flat_map(|targets| targets.values());
        places.extend(targets.filter_map(|target| target.get_ref().as_table()));
        let mut found = Vec::new();
        for place in places {
            for kind in TABLES {
                let table = place.get(kind).and_then(|table| table.get_ref().as_table());
                for (key, value) in table.into_iter().flatten() {
                    found.push(Dependency {
                        name: real_name(key.get_ref(), value.get_ref(), workspace),
                        line: 1 + self.text[..key.span().start].matches('\n').count(),
                        for_tests: kind == "dev-dependencies",
                    });
                }
            }
        }
        found
    }
}

/// The package behind a key: `package = ".."` here or in the workspace's table, else the key.
fn real_name(key: &str, value: &DeValue<'_>, workspace: &Parsed<'_>) -> String {
    let here = value.as_table().and_then(|table| string(table, &["package"]));
    let shared = || string(&workspace.table, &["workspace", "dependencies", key, "package"]);
    here.or_else(shared).unwrap_or_else(|| key.to_owned())
}

/// The string at a path of keys.
fn string(table: &DeTable<'_>, path: &[&str]) -> Option<String> {
    let (last, tables) = path.split_last()?;
    let mut table = table;
    for key in tables {
        table = table.get(*key)?.get_ref().as_table()?;
    }
    table.get(*last)?.get_ref().as_str().map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::check;

    const WORKSPACE: &str = "[workspace.dependencies]\nalias = { package = \"treelet-render\" }\n";

    fn problems(package: &str, rest: &str) -> Vec<String> {
        let manifest = format!("[package]\nname = \"{package}\"\n{rest}");
        let found = check("Cargo.toml", &manifest, WORKSPACE);
        found.iter().map(|problem| format!("{}: {}", problem.line, problem.what)).collect()
    }

    #[test]
    fn the_right_way_is_fine() {
        let rest = "[dependencies]\ntreelet.workspace = true\nserde = \"1\"\n";
        assert_eq!(problems("treelet-model", rest), [""; 0]);
        assert_eq!(problems("treelet", "[dev-dependencies]\ntreelet-testkit = \"0\""), [""; 0]);
    }

    #[test]
    fn the_wrong_way_is_refused_with_its_line() {
        let rest = "[dependencies]\nlibm = \"0\"\ntreelet-model.workspace = true";
        assert_eq!(problems("treelet", rest), ["5: `treelet` must not know `treelet-model`"]);
        let rest = "[dependencies]\ntreelet-import = { path = \"x\" }";
        let what = "4: `treelet-render` must not know `treelet-import`";
        assert_eq!(problems("treelet-render", rest), [what]);
    }

    #[test]
    fn the_test_kit_is_for_tests() {
        let rest = "[dependencies]\ntreelet-testkit = \"0\"";
        assert_eq!(problems("treelet", rest), ["4: `treelet` must not know `treelet-testkit`"]);
        assert_eq!(problems("treelet-cli", rest).len(), 1);
        assert_eq!(problems("treelet-testkit", "[dev-dependencies]\ntreelet = \"0\"").len(), 1);
    }

    #[test]
    fn other_names_and_targets_do_not_hide_a_crate() {
        let rest = "[dependencies]\nalias.workspace = true";
        assert_eq!(problems("treelet", rest), ["4: `treelet` must not know `treelet-render`"]);
        let rest = "[build-dependencies]\nx = { package = \"treelet-cli\", path = \"y\" }";
        assert_eq!(problems("treelet-model", rest).len(), 1);
        let rest = "[target.'cfg(unix)'.dependencies]\ntreelet-cli = \"0\"";
        assert_eq!(problems("treelet-model", rest).len(), 1);
    }

    #[test]
    fn an_unknown_crate_is_refused() {
        assert_eq!(problems("treelet-new", "").len(), 1);
        assert_eq!(check("Cargo.toml", "[package", "").len(), 1);
    }
}
