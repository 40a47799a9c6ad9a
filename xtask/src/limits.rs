//! Numbers that must not grow unseen: the table of them in `xtask/limits.toml`, read, compared with
//! what was measured, and written anew by `--bless`.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use toml::de::{DeTable, DeValue};

use crate::step::output;

/// What was measured, by name.
pub(crate) type Measured = BTreeMap<String, f64>;

/// A table of the file.
pub(crate) struct Table {
    /// As it stands in brackets.
    pub(crate) name: &'static str,
    /// How much more than the limit is let pass, of the limit; as much less asks for a new limit.
    pub(crate) tolerance: f64,
    /// What writes it anew.
    pub(crate) bless: &'static str,
}

/// The file's text above its tables.
const HEAD: &str = "\
# What must not grow unseen. Each table belongs to the compiler that it names: another one makes
# other numbers, and is not held against these. The command above a table writes it anew.
";

/// The entry of a table that is no limit.
const COMPILER: &str = "compiler";

impl Table {
    /// Holds what was measured against the limits, a line each; the error names all that passes.
    pub(crate) fn check(&self, root: &Path, measured: &Measured) -> Result<(), String> {
        let tables = read(&file(root))?;
        let limits = tables.get(self.name).cloned().unwrap_or_default();
        let compiler = compiler()?;
        if limits.compiler != compiler {
            for (name, value) in measured {
                eprintln!("  {name:40} {value:>12.1}");
            }
            eprintln!("  SKIPPED: limits are those of '{}', this is {compiler}", limits.compiler);
            return Ok(());
        }
        let mut wrong = Vec::new();
        for (name, &value) in measured {
            let limit = limits.values.get(name).copied();
            let verdict = self.verdict(value, limit);
            let told = limit.map_or("none".to_owned(), |limit| format!("{limit:.1}"));
            eprintln!("  {name:40} {value:>12.1}  limit {told:>12}  {}", verdict.word());
            if verdict.is_wrong() {
                wrong.push(name.as_str());
            }
        }
        for name in limits.values.keys().filter(|name| !measured.contains_key(*name)) {
            eprintln!("  {name:40} not measured here");
        }
        if wrong.is_empty() {
            return Ok(());
        }
        let wrong = wrong.join(", ");
        Err(format!(
            "over the limit: {wrong}; if that is meant, `{}` writes new limits",
            self.bless
        ))
    }

    /// Writes what was measured as the new limits; other tables stay.
    pub(crate) fn write(&self, root: &Path, measured: &Measured) -> Result<(), String> {
        let file = file(root);
        let mut tables = read(&file)?;
        let limits = Limits { compiler: compiler()?, values: measured.clone() };
        tables.insert(self.name.to_owned(), limits);
        let told = |error: std::io::Error| format!("{}: {error}", file.display());
        fs::write(&file, text(&tables)).map_err(told)?;
        eprintln!("  {} written", file.display());
        Ok(())
    }

    fn verdict(&self, value: f64, limit: Option<f64>) -> Verdict {
        match limit {
            None => Verdict::New,
            Some(limit) if value > limit * (1.0 + self.tolerance) => Verdict::Over(value / limit),
            Some(limit) if value < limit * (1.0 - self.tolerance) => Verdict::Under(value / limit),
            Some(_) => Verdict::Within,
        }
    }
}

/// How a number stands to its limit.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Verdict {
    /// There is no limit.
    New,
    Within,
    /// By that factor.
    Over(f64),
    Under(f64),
}

impl Verdict {
    fn is_wrong(self) -> bool {
        matches!(self, Self::New | Self::Over(_))
    }

    fn word(self) -> String {
        let percent = |factor: f64| format!("{:+.1} %", 100.0 * (factor - 1.0));
        match self {
            Self::New => "HAS NO LIMIT".to_owned(),
            Self::Within => "as ever".to_owned(),
            Self::Over(factor) => format!("OVER, {}", percent(factor)),
            Self::Under(factor) => format!("less, {}: worth a new limit", percent(factor)),
        }
    }
}

fn file(root: &Path) -> PathBuf {
    root.join("xtask").join("limits.toml")
}

/// A table's compiler and limits.
#[derive(Clone, Debug, Default, PartialEq)]
struct Limits {
    compiler: String,
    values: Measured,
}

/// Every table; none where there is no file.
fn read(file: &Path) -> Result<BTreeMap<String, Limits>, String> {
    let text = fs::read_to_string(file).unwrap_or_default();
    let told = |what: &dyn Display| format!("{}: {what}", file.display());
    let whole = DeTable::parse(&text).map_err(|error| told(&error))?;
    let mut tables = BTreeMap::new();
    for (name, table) in whole.get_ref() {
        let name = name.get_ref();
        let table = table.get_ref().as_table();
        let table = table.ok_or_else(|| told(&format!("{name} stands outside of the tables")))?;
        let mut limits = Limits::default();
        for (key, value) in table {
            let key = key.get_ref();
            let wrong = || told(&format!("{key} of {name} is no number"));
            match value.get_ref() {
                DeValue::String(compiler) if key == COMPILER => {
                    limits.compiler = compiler.to_string();
                }
                DeValue::Float(value) => {
                    let value = value.as_str().parse().map_err(|_| wrong())?;
                    limits.values.insert(key.to_string(), value);
                }
                _ => return Err(wrong()),
            }
        }
        tables.insert(name.to_string(), limits);
    }
    Ok(tables)
}

/// The file's text.
fn text(tables: &BTreeMap<String, Limits>) -> String {
    let mut text = HEAD.to_owned();
    for (name, Limits { compiler, values }) in tables {
        text += &format!("\n# cargo xtask {name} --bless\n[{name}]\n");
        text += &format!("{COMPILER} = \"{compiler}\"\n");
        for (key, value) in values {
            text += &format!("\"{key}\" = {value:.1}\n");
        }
    }
    text
}

/// The compiler's name and version, without its date.
fn compiler() -> Result<String, String> {
    let version = output(Command::new("rustc").arg("--version"))?;
    Ok(version.split(" (").next().unwrap_or_default().to_owned())
}

#[cfg(test)]
mod tests {
    use super::{Measured, Table, Verdict, compiler, read, text};
    use std::fs;

    const TABLE: Table = Table { name: "counts", tolerance: 0.02, bless: "do so" };

    fn measured(pairs: &[(&str, f64)]) -> Measured {
        pairs.iter().map(|&(name, value)| (name.to_owned(), value)).collect()
    }

    #[test]
    fn more_than_the_tolerance_is_over_and_as_much_less_is_told() {
        let verdict = |value| TABLE.verdict(value, Some(100.0));
        assert_eq!(verdict(101.9), Verdict::Within);
        assert_eq!(verdict(98.1), Verdict::Within);
        assert_eq!(verdict(103.0), Verdict::Over(1.03));
        assert_eq!(verdict(90.0), Verdict::Under(0.9));
        assert!(TABLE.verdict(1.0, None).is_wrong(), "what has no limit is not guarded");
    }

    #[test]
    fn what_is_written_is_read_and_held() {
        let root = std::env::temp_dir().join(format!("xtask-limits-{}", std::process::id()));
        fs::create_dir_all(root.join("xtask")).unwrap();
        let usual = measured(&[("a b", 10.04), ("c", 2.0)]);
        TABLE.write(&root, &usual).unwrap();
        Table { name: "size", ..TABLE }.write(&root, &measured(&[("d", 1.0)])).unwrap();
        let tables = read(&root.join("xtask/limits.toml")).unwrap();
        let more = TABLE.check(&root, &measured(&[("a b", 10.1), ("c", 2.1)]));
        let same = TABLE.check(&root, &usual);
        let fewer = TABLE.check(&root, &measured(&[("c", 1.0)]));
        let stranger = TABLE.check(&root, &measured(&[("e", 1.0)]));
        fs::remove_dir_all(&root).unwrap();

        let words = text(&tables);
        let compiler = compiler().unwrap();
        let counts = format!("[counts]\ncompiler = \"{compiler}\"\n\"a b\" = 10.0\n");
        assert!(words.contains(&counts), "{words}");
        assert!(words.contains("[size]"), "{words}");
        assert_eq!((same, fewer), (Ok(()), Ok(())));
        let error = more.unwrap_err();
        assert!(error.contains("limit: c;") && error.contains("do so"), "{error}");
        assert!(stranger.unwrap_err().contains("limit: e;"));
    }
}
