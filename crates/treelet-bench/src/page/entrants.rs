//! Other entrants: results of other engines or machines, from files of the same form that
//! `bench --figure --json` prints.
//!
//! Read by hand rather than derived, so that an error can say which field of which entry is wrong.

use serde_json::Value;

use crate::figure::data::{Choice, Figure, Point};

/// The form that is understood.
const SCHEMA: u64 = 1;

/// Why an entrant's file cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EntrantError {
    /// It is not JSON.
    #[error("{file}: is not JSON ({error}); give what `bench --figure --json` prints")]
    NotJson {
        /// The file.
        file: String,
        /// What the parser says.
        error: String,
    },
    /// Something is missing or wrong.
    #[error("{file}: {place} {wrong}")]
    Field {
        /// The file.
        file: String,
        /// The field, as `points[3].build_s`.
        place: String,
        /// What is wrong with it, and what it should be.
        wrong: String,
    },
}

/// Reads the figure in `text`, the content of `file`.
///
/// # Errors
///
/// The text is not JSON, of another schema, or a field is missing or holds what no measurement gives.
pub fn read(text: &str, file: &str) -> Result<Figure, EntrantError> {
    let value: Value = serde_json::from_str(text).map_err(|error| EntrantError::NotJson {
        file: file.to_owned(),
        error: error.to_string(),
    })?;
    let whole = Entry { file, place: String::new(), value: &value };
    if whole.get("schema").as_u64() != Some(SCHEMA) {
        return Err(whole.wrong("schema", "must be 1"));
    }
    if !whole.get("points").is_array() {
        return Err(whole.wrong("points", "must be a list"));
    }
    let points = whole.list("points")?.iter().map(point).collect::<Result<Vec<_>, _>>()?;
    if points.is_empty() {
        return Err(whole.wrong("points", "is empty; an entrant needs at least one point"));
    }
    let choices = whole.list("choices")?.iter().map(choice).collect::<Result<Vec<_>, _>>()?;
    // What else treelet's own files hold serves the page but is not asked of anybody.
    let extras: Figure = serde_json::from_value(value.clone()).unwrap_or_default();
    Ok(Figure { points, choices, ..extras })
}

/// Adds an entrant's points to `figure`; `name`, the file's without its extension, tells apart what
/// would otherwise be the same engine twice. Choices come along only where there are none yet for
/// that scene and kind.
pub fn join(figure: &mut Figure, entrant: Figure, name: &str) {
    let same = |a: &Point, b: &Point| {
        (&a.scene, &a.kind, a.threads, &a.engine, &a.variant)
            == (&b.scene, &b.kind, b.threads, &b.engine, &b.variant)
    };
    let twice = |engine: &str| {
        let theirs = entrant.points.iter().filter(|point| point.engine == engine);
        theirs.clone().any(|theirs| figure.points.iter().any(|ours| same(ours, theirs)))
    };
    let mut points = Vec::new();
    for point in &entrant.points {
        let engine = if twice(&point.engine) {
            format!("{}@{name}", point.engine)
        } else {
            point.engine.clone()
        };
        points.push(Point { engine, ..point.clone() });
    }
    let new = |choice: &Choice| {
        !figure.choices.iter().any(|known| {
            (&known.scene, &known.kind, known.threads)
                == (&choice.scene, &choice.kind, choice.threads)
        })
    };
    let choices: Vec<Choice> =
        entrant.choices.iter().filter(|choice| new(choice)).cloned().collect();
    figure.choices.extend(choices);
    // An entrant that is the whole page brings its machine, too.
    if figure.points.is_empty() {
        figure.machine = entrant.machine;
        figure.marks = entrant.marks;
        figure.auto = entrant.auto;
        figure.windows = entrant.windows;
        figure.left_out = entrant.left_out;
    }
    for engine in entrant.engines {
        if !figure.engines.contains(&engine) {
            figure.engines.push(engine);
        }
    }
    figure.points.extend(points);
}

/// A JSON object, and where it stands.
struct Entry<'a> {
    file: &'a str,
    place: String,
    value: &'a Value,
}

impl<'a> Entry<'a> {
    fn get(&self, field: &str) -> &'a Value {
        self.value.get(field).unwrap_or(&Value::Null)
    }

    fn wrong(&self, field: &str, wrong: &str) -> EntrantError {
        let dot = if self.place.is_empty() { "" } else { "." };
        let found = match self.value.get(field) {
            None => "is missing; it ".to_owned(),
            Some(Value::Array(_) | Value::Object(_)) => String::new(),
            Some(found) => format!("is {found}; it "),
        };
        EntrantError::Field {
            file: self.file.to_owned(),
            place: format!("{}{dot}{field}", self.place),
            wrong: format!("{found}{wrong}"),
        }
    }

    /// The entries of a list; none where there is no such field.
    fn list(&self, field: &str) -> Result<Vec<Self>, EntrantError> {
        let entries = match self.get(field) {
            Value::Array(entries) => entries.as_slice(),
            Value::Null => &[],
            _ => return Err(self.wrong(field, "must be a list")),
        };
        let entry = |(index, value)| {
            let place = format!("{field}[{index}]");
            Self { file: self.file, place, value }
        };
        Ok(entries.iter().enumerate().map(entry).collect())
    }

    fn text(&self, field: &str) -> Result<String, EntrantError> {
        let text = self.get(field).as_str().filter(|text| !text.trim().is_empty());
        text.map(str::to_owned).ok_or_else(|| self.wrong(field, "must be a text that is not empty"))
    }

    /// A finite number of at least 0; above 0 if that is wanted.
    fn number(&self, field: &str, above_zero: bool) -> Result<f64, EntrantError> {
        let fits = |x: &f64| x.is_finite() && (*x > 0.0 || !above_zero && *x == 0.0);
        let asked =
            if above_zero { "must be a number above 0" } else { "must be a number, 0 or more" };
        self.get(field).as_f64().filter(fits).ok_or_else(|| self.wrong(field, asked))
    }

    /// A number, or nothing where it is null or missing.
    fn perhaps(&self, field: &str) -> Result<Option<f64>, EntrantError> {
        if self.get(field).is_null() { Ok(None) } else { self.number(field, false).map(Some) }
    }

    fn count(&self, field: &str) -> Result<u64, EntrantError> {
        let count = self.get(field).as_u64();
        count.ok_or_else(|| self.wrong(field, "must be a whole number, 0 or more"))
    }

    /// A number of threads; `usual` where it is missing.
    fn threads(&self, usual: Option<usize>) -> Result<usize, EntrantError> {
        if let (Value::Null, Some(usual)) = (self.get("threads"), usual) {
            return Ok(usual);
        }
        let threads = self.get("threads").as_u64().and_then(|n| usize::try_from(n).ok());
        let threads = threads.filter(|&threads| threads > 0);
        threads.ok_or_else(|| self.wrong("threads", "must be a whole number of at least 1"))
    }
}

fn point(entry: &Entry<'_>) -> Result<Point, EntrantError> {
    Ok(Point {
        scene: entry.text("scene")?,
        engine: entry.text("engine")?,
        variant: entry.text("variant")?,
        kind: entry.text("kind")?,
        threads: entry.threads(None)?,
        build_s: entry.number("build_s", false)?,
        mrays_per_s: entry.number("mrays_per_s", true)?,
        sah: entry.perhaps("sah")?,
        epo: entry.perhaps("epo")?,
        lcv: entry.perhaps("lcv")?,
        triangles: entry.get("triangles").as_u64(),
        mismatch_ppm: entry.perhaps("mismatch_ppm")?,
    })
}

fn choice(entry: &Entry<'_>) -> Result<Choice, EntrantError> {
    Ok(Choice {
        scene: entry.text("scene")?,
        kind: entry.text("kind")?,
        rays: entry.count("rays")?,
        variant: entry.text("variant")?,
        predicted_s: entry.perhaps("predicted_s")?,
        measured_s: entry.number("measured_s", true)?,
        best_variant: entry.text("best_variant")?,
        best_s: entry.number("best_s", true)?,
        threads: entry.threads(Some(1))?,
        reason: entry.get("reason").as_str().unwrap_or_default().to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::{join, read};
    use crate::figure::data::Figure;

    const POINT: &str = r#"{"scene":"s","engine":"e","variant":"v","kind":"diffuse","threads":1,
        "build_s":0.5,"mrays_per_s":2.0,"sah":null}"#;

    fn file(points: &str) -> String {
        format!(r#"{{"schema":1,"points":[{points}]}}"#)
    }

    #[test]
    fn errors_name_the_file_and_the_field() {
        let wrong = |from: &str, to: &str| {
            let text = file(&format!("{POINT},{}", POINT.replace(from, to)));
            read(&text, "other.json").unwrap_err().to_string()
        };
        for (from, to, expected) in [
            ("\"scene\":\"s\"", "\"scene\":\" \"", "points[1].scene is \" \"; it must be a text"),
            ("\"kind\":\"diffuse\",", "", "points[1].kind is missing; it must be a text"),
            ("\"threads\":1", "\"threads\":0", "points[1].threads is 0; it must be a whole number"),
            ("0.5", "-1", "points[1].build_s is -1; it must be a number, 0 or more"),
            ("2.0", "0", "points[1].mrays_per_s is 0; it must be a number above 0"),
            ("\"sah\":null", "\"sah\":\"x\"", "points[1].sah is \"x\"; it must be a number"),
        ] {
            let error = wrong(from, to);
            assert!(error.starts_with("other.json: ") && error.contains(expected), "{error}");
        }
        for (text, expected) in [
            ("", "x: is not JSON"),
            ("{}", "x: schema is missing"),
            (r#"{"schema":2,"points":[]}"#, "x: schema is 2; it must be 1"),
            (r#"{"schema":1}"#, "x: points is missing"),
            (r#"{"schema":1,"points":[]}"#, "x: points is empty"),
            (r#"{"schema":1,"points":[7]}"#, "x: points[0].scene is missing"),
            ("[]", "x: schema is missing"),
        ] {
            let error = read(text, "x").unwrap_err().to_string();
            assert!(error.starts_with(expected), "{error}");
        }
        let choices = format!(r#"{{"schema":1,"points":[{POINT}],"choices":[{{"scene":"s"}}]}}"#);
        let error = read(&choices, "x").unwrap_err().to_string();
        assert!(error.starts_with("x: choices[0].kind is missing"), "{error}");
    }

    #[test]
    fn the_same_engine_twice_is_told_apart() {
        let entrant = read(&file(POINT), "other.json").unwrap();
        let mut figure = Figure::default();
        join(&mut figure, entrant.clone(), "first");
        join(&mut figure, entrant, "second");
        let engines: Vec<_> = figure.points.iter().map(|point| point.engine.as_str()).collect();
        assert_eq!(engines, ["e", "e@second"]);
    }
}
