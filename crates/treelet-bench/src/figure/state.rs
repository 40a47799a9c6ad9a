//! What an interrupted run leaves behind: a file of finished pieces, one JSON line each.
//!
//! A line is written in one go and flushed to the disk, so that a run that is killed loses the piece
//! it was at and no other; half a line at the end is cut off by the next run. The first line holds the
//! settings: times taken with others do not belong into the same figure.

use std::fs::{File, OpenOptions};
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::builds::Measures;
use super::data::Choice;
use super::plan::{FigurePlan, Settings};
use crate::engine::{Engine, Triangles};

/// Why a run cannot go on from a file, or cannot write to it.
#[derive(Debug, thiserror::Error)]
pub enum StateError {
    /// The file system said no.
    #[error("{}: {error}; choose another file with --resume", .file.display())]
    Refused {
        /// The file.
        file: PathBuf,
        /// What it said.
        error: io::Error,
    },
    /// Some other file.
    #[error(
        "{}: line {line} is no piece of a figure ({error}); choose another file with --resume, or \
         remove it",
        .file.display()
    )]
    Line {
        /// The file.
        file: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong with it.
        error: String,
    },
    /// Begun with other settings.
    #[error(
        "{}: was begun with {setting} {old}, this run has {new}; give the same flags, or remove \
         the file to begin anew",
        .file.display()
    )]
    Setting {
        /// The file.
        file: PathBuf,
        /// Which one.
        setting: String,
        /// As the file has it.
        old: String,
        /// As this run has it.
        new: String,
    },
}

/// A finished piece.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Piece {
    /// The first line.
    Settings(Value),
    /// A scene that was begun.
    Scene(SceneKey),
    /// A variant that was built and measured, or why not.
    Build(BuildPiece),
    /// A kind of rays through everything.
    Traces(TracePiece),
    /// What the library chose for a kind of rays.
    Choices(ChoicePiece),
}

/// What makes a scene the same.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct SceneKey {
    pub(super) scene: String,
    pub(super) triangles: u64,
    /// Of vertices and indices.
    pub(super) checksum: String,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct BuildPiece {
    pub(super) scene: String,
    pub(super) threads: usize,
    pub(super) engine: String,
    pub(super) variant: String,
    /// Of each build; none if it was left out.
    pub(super) seconds: Vec<f64>,
    pub(super) measures: Measures,
    /// Why it was left out.
    pub(super) left_out: Option<String>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct TracePiece {
    pub(super) scene: String,
    pub(super) threads: usize,
    pub(super) kind: String,
    pub(super) cells: Vec<Cell>,
}

/// One variant's speed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Cell {
    pub(super) engine: String,
    pub(super) variant: String,
    pub(super) mrays_per_s: f64,
    pub(super) mismatch_ppm: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct ChoicePiece {
    pub(super) scene: String,
    pub(super) threads: usize,
    pub(super) kind: String,
    pub(super) choices: Vec<Choice>,
    pub(super) auto: Vec<Choice>,
}

/// How every file begins.
const BEGIN: &[u8] = b"{\"settings\":";

/// The finished pieces, in memory and perhaps in a file.
#[derive(Debug, Default)]
pub struct State {
    file: Option<(PathBuf, File)>,
    pieces: Vec<Piece>,
}

impl State {
    /// Goes on with the pieces in `file`, or begins it; `None` keeps them in memory only.
    ///
    /// # Errors
    ///
    /// The file cannot be read or written, is something else, or was begun with other settings.
    pub fn open(
        file: Option<&Path>,
        plan: &FigurePlan,
        engines: &[Box<dyn Engine>],
    ) -> Result<Self, StateError> {
        let Some(path) = file else { return Ok(Self::default()) };
        let refused = |error| StateError::Refused { file: path.to_owned(), error };
        let mut open = OpenOptions::new();
        let mut file =
            open.read(true).write(true).create(true).truncate(false).open(path).map_err(refused)?;
        let mut text = Vec::new();
        file.read_to_end(&mut text).map_err(refused)?;

        // Cut off what a killed run left of a line.
        let whole = text.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1);
        let mut pieces = parse(path, &text[..whole])?;
        if pieces.is_empty() && !text.starts_with(BEGIN) && !BEGIN.starts_with(&text) {
            let error = "it does not begin with the settings of a run".to_owned();
            return Err(StateError::Line { file: path.to_owned(), line: 1, error });
        }
        file.set_len(whole as u64).map_err(refused)?;
        file.seek(SeekFrom::End(0)).map_err(refused)?;

        // Compare the settings, or begin with them.
        let settings = value(&plan.settings(engines));
        if let Some(Piece::Settings(old)) = pieces.first() {
            compare(path, old, &settings)?;
            pieces.remove(0);
            return Ok(Self { file: Some((path.to_owned(), file)), pieces });
        }
        let mut state = Self { file: Some((path.to_owned(), file)), pieces };
        state.add(Piece::Settings(settings))?;
        state.pieces.clear();
        Ok(state)
    }

    /// How many pieces there are.
    pub fn pieces(&self) -> usize {
        self.pieces.len()
    }

    /// Adds a piece that is finished.
    pub(super) fn add(&mut self, piece: Piece) -> Result<(), StateError> {
        if let Some((path, file)) = &mut self.file {
            // Pieces are strings and numbers: they always have a text.
            let mut line = serde_json::to_string(&piece).unwrap_or_default();
            line.push('\n');
            let written = file.write_all(line.as_bytes()).and_then(|()| file.sync_data());
            written.map_err(|error| StateError::Refused { file: path.clone(), error })?;
        }
        self.pieces.push(piece);
        Ok(())
    }

    /// Notes a scene; an error if another one of that name was begun.
    pub(super) fn begin(&mut self, key: SceneKey) -> Result<(), StateError> {
        let same_name = |piece: &Piece| match piece {
            Piece::Scene(old) if old.scene == key.scene => Some(old.clone()),
            _ => None,
        };
        match self.pieces.iter().find_map(same_name) {
            None => self.add(Piece::Scene(key)),
            Some(old) if old == key => Ok(()),
            Some(old) => {
                let told =
                    |key: &SceneKey| format!("{} triangles ({})", key.triangles, key.checksum);
                Err(StateError::Setting {
                    file: self.file.as_ref().map(|(path, _)| path.clone()).unwrap_or_default(),
                    setting: format!("a scene `{}` of", key.scene),
                    old: told(&old),
                    new: told(&key),
                })
            }
        }
    }

    /// The build of a variant, if it is finished.
    pub(super) fn build(
        &self,
        scene: &str,
        threads: usize,
        engine: &str,
        variant: &str,
    ) -> Option<&BuildPiece> {
        self.pieces.iter().find_map(|piece| match piece {
            Piece::Build(build)
                if build.scene == scene
                    && build.threads == threads
                    && build.engine == engine
                    && build.variant == variant =>
            {
                Some(build)
            }
            _ => None,
        })
    }

    /// The traces of a kind, if they are finished.
    pub(super) fn traces(&self, scene: &str, threads: usize, kind: &str) -> Option<&TracePiece> {
        self.pieces.iter().find_map(|piece| match piece {
            Piece::Traces(it) if it.scene == scene && it.threads == threads && it.kind == kind => {
                Some(it)
            }
            _ => None,
        })
    }

    /// The choices for a kind, if they are finished.
    pub(super) fn choices(&self, scene: &str, threads: usize, kind: &str) -> Option<&ChoicePiece> {
        self.pieces.iter().find_map(|piece| match piece {
            Piece::Choices(it) if it.scene == scene && it.threads == threads && it.kind == kind => {
                Some(it)
            }
            _ => None,
        })
    }
}

impl SceneKey {
    /// The key of these triangles.
    pub(super) fn of(scene: &str, triangles: &Triangles) -> Self {
        let positions = triangles.positions.iter().flatten().map(|x| u64::from(x.to_bits()));
        let indices = triangles.indices.iter().flatten().map(|&i| u64::from(i));
        // FNV-1a, a word at a time.
        let mixed = positions
            .chain(indices)
            .fold(0xcbf2_9ce4_8422_2325, |hash: u64, word| (hash ^ word).wrapping_mul(FNV_PRIME));
        let checksum = format!("{mixed:016x}");
        Self { scene: scene.to_owned(), triangles: triangles.len() as u64, checksum }
    }
}

/// Of G. Fowler, L. C. Noll, K.-P. Vo and D. Eastlake, "The FNV Non-Cryptographic Hash Algorithm".
const FNV_PRIME: u64 = 0x0100_0000_01b3;

/// The pieces in a text of whole lines.
fn parse(path: &Path, text: &[u8]) -> Result<Vec<Piece>, StateError> {
    let mut pieces = Vec::new();
    for (index, line) in text.split(|&byte| byte == b'\n').enumerate() {
        if line.is_empty() {
            continue;
        }
        let wrong =
            |error: String| StateError::Line { file: path.to_owned(), line: index + 1, error };
        let piece: Piece =
            serde_json::from_slice(line).map_err(|error| wrong(error.to_string()))?;
        if pieces.is_empty() != matches!(piece, Piece::Settings(_)) {
            return Err(wrong("the settings of a run are the first line, and only that".into()));
        }
        pieces.push(piece);
    }
    Ok(pieces)
}

/// The settings as the file has them.
fn value(settings: &Settings) -> Value {
    serde_json::to_value(settings).unwrap_or_default()
}

/// The first setting that differs.
fn compare(path: &Path, old: &Value, new: &Value) -> Result<(), StateError> {
    let keys = new.as_object().into_iter().flatten().map(|(key, _)| key);
    match keys.into_iter().find(|key| old[key.as_str()] != new[key.as_str()]) {
        None => Ok(()),
        Some(key) => Err(StateError::Setting {
            file: path.to_owned(),
            setting: key.replace('_', " "),
            old: old[key.as_str()].to_string(),
            new: new[key.as_str()].to_string(),
        }),
    }
}
