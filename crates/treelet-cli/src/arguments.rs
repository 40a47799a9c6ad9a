//! The words of the command line, and the parsers that several verbs share.

use std::ffi::{OsStr, OsString};
use std::num::NonZeroUsize;

use clap::Parser;
use clap::builder::{PossibleValue, StringValueParser, TypedValueParser};
use treelet::scene::Recipe;

use crate::verb::Verb;

/// Ray tracing of triangle scenes: pictures, and what their trees are worth.
#[derive(Debug, Parser)]
#[command(name = "treelet", version, max_term_width = 100)]
#[command(after_help = "Exit codes: 0 done, 1 error, 2 usage, 3 a check failed, 130 cancelled. \
    Messages go to stderr; NO_COLOR is obeyed.")]
pub(crate) struct Arguments {
    /// Print one JSON object on stdout.
    #[arg(long, global = true)]
    pub(crate) json: bool,

    /// Threads to work with [default: one for each core]; `bench` takes several numbers, such as 1,2.
    #[arg(long, global = true, value_name = "N", value_delimiter = ',')]
    pub(crate) threads: Vec<NonZeroUsize>,

    #[command(subcommand)]
    pub(crate) verb: Verb,
}

/// The words, with those of `--camera from=.. at=.. fov=..` joined into one argument.
///
/// The flag takes as many words as look like its own, so that a scene may follow it.
pub(crate) fn joined(words: impl IntoIterator<Item = OsString>) -> Vec<OsString> {
    let mut joined: Vec<OsString> = Vec::new();
    let mut camera: Option<OsString> = None;
    for word in words {
        let own = crate::camera::KEYS.iter().any(|key| {
            word.to_str().is_some_and(|word| {
                word.strip_prefix(key).is_some_and(|rest| rest.starts_with('='))
            })
        });
        match &mut camera {
            Some(value) if own => {
                if !value.is_empty() {
                    value.push(" ");
                }
                value.push(&word);
                continue;
            }
            Some(_) => joined.extend(camera.take().filter(|value| !value.is_empty())),
            None => {}
        }
        // `--camera=from=..` is `--camera` and the first of its words.
        let value = word.to_str().and_then(|word| word.strip_prefix("--camera="));
        if let Some(value) = value.filter(|value| !value.is_empty()) {
            camera = Some(value.into());
            joined.push("--camera".into());
            continue;
        }
        if word == "--camera" {
            camera = Some(OsString::new());
        }
        joined.push(word);
    }
    joined.extend(camera.filter(|value| !value.is_empty()));
    joined
}

/// Accepts builders and quality levels, with optimisers after them; lists the builders.
#[derive(Clone, Debug)]
pub(crate) struct RecipeParser;

impl TypedValueParser for RecipeParser {
    type Value = Recipe;

    fn parse_ref(
        &self,
        command: &clap::Command,
        argument: Option<&clap::Arg>,
        value: &OsStr,
    ) -> Result<Recipe, clap::Error> {
        let parser = StringValueParser::new().try_map(|name| name.parse::<Recipe>());
        parser.parse_ref(command, argument, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        let names = treelet::build::ALL.iter().map(|builder| builder.info().name);
        Some(Box::new(names.map(PossibleValue::new)))
    }
}

/// What was asked for, or else every builder of the catalogue.
pub(crate) fn recipes(asked: Vec<Recipe>) -> Vec<Recipe> {
    if !asked.is_empty() {
        return asked;
    }
    let names = treelet::build::ALL.iter().map(|builder| builder.info().name);
    names.filter_map(|name| name.parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::joined;

    fn words(line: &str) -> Vec<String> {
        let words = joined(line.split('|').map(Into::into));
        words.into_iter().map(|word| word.into_string().unwrap()).collect()
    }

    #[test]
    fn camera_words_are_joined() {
        assert_eq!(
            words("render|--camera|from=0,0,1|at=0,0,0|fov=40|scene.ply|--json"),
            ["render", "--camera", "from=0,0,1 at=0,0,0 fov=40", "scene.ply", "--json"]
        );
        assert_eq!(words("--camera|from=1 at=2|x"), ["--camera", "from=1 at=2", "x"]);
        assert_eq!(words("--camera|at=1"), ["--camera", "at=1"]);
        assert_eq!(
            words("render|--camera=from=0,0,1|at=0,0,0|scene.ply"),
            ["render", "--camera", "from=0,0,1 at=0,0,0", "scene.ply"]
        );
        assert_eq!(words("--camera=from=1 at=2|x"), ["--camera", "from=1 at=2", "x"]);
        assert_eq!(words("--camera=|x"), ["--camera=", "x"]);
        assert_eq!(words("--camera|--json"), ["--camera", "--json"]);
        assert_eq!(words("at=1|x"), ["at=1", "x"]);
    }

    #[test]
    fn the_command_line_is_consistent() {
        use clap::CommandFactory as _;
        super::Arguments::command().debug_assert();
    }
}
