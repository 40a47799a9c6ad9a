//! What can be wrong with a scene file: which file, where in it, what, and what to do about it.

use std::fmt;
use std::io;
use std::path::PathBuf;

use treelet::context::Cancelled;
use treelet::memory::OutOfMemory;

/// A scene that could not be read.
///
/// Its text names the file, the place in it, what was found there and what helps.
#[derive(Debug, thiserror::Error)]
#[error("{}: {place}{fault}", .file.display())]
pub struct ImportError {
    /// The file at fault: the scene itself or a file that it names.
    pub file: PathBuf,
    /// Where in the file.
    pub place: Place,
    /// What is wrong there.
    pub fault: Fault,
}

/// The result of reading a scene.
pub type Result<T> = std::result::Result<T, ImportError>;

/// A place in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// The file as a whole.
    File,
    /// A line of a text file, from 1.
    Line(u64),
    /// An offset into a binary file, unpacked, from 0.
    Byte(u64),
    /// A named part of the file, such as `node 3 "wheel"`.
    Element(String),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File => Ok(()),
            Self::Line(line) => write!(f, "line {line}: "),
            Self::Byte(byte) => write!(f, "byte {byte}: "),
            Self::Element(name) => write!(f, "{name}: "),
        }
    }
}

/// What is wrong at a place of a file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// The file system said no.
    #[error("cannot be read ({0}); check the path and that you may read it")]
    Read(#[from] io::Error),
    /// Neither content nor name belongs to a format of the catalogue.
    #[error("is in no format that treelet knows; it reads {formats}")]
    UnknownFormat {
        /// The formats it could have been in, with their extensions.
        formats: String,
    },
    /// The file breaks the rules of its format.
    #[error("{found}; {remedy}")]
    Broken {
        /// What stands there.
        found: String,
        /// What to do about it.
        remedy: String,
    },
    /// The file is sound, but treelet cannot read this in it.
    #[error("{uses}, which treelet does not read yet; {remedy}")]
    Unsupported {
        /// What the file uses.
        uses: String,
        /// How to convert it.
        remedy: String,
    },
    /// The file names another one that lies outside the scene's folder.
    #[error(
        "names the file {target:?}, which is not below the scene's folder; move it there, \
         or allow paths that leave the folder if you trust the scene"
    )]
    Outside {
        /// The path as the file spells it.
        target: String,
    },
    /// The file names an address on a network.
    #[error(
        "names the address {target:?}; treelet never opens one: download it beside the scene \
         and name it as a file"
    )]
    Url {
        /// The address as the file spells it.
        target: String,
    },
    /// The file names another one, and there are only bytes, no folder.
    #[error("needs the file {target:?}, but was read from memory; read it from its folder")]
    NoFolder {
        /// The path as the file spells it.
        target: String,
    },
    /// The scene is larger than the caller allows.
    #[error("{what} would take {needed} bytes, {limit} are left; raise `Limits::max_bytes`")]
    TooBig {
        /// What the bytes are for.
        what: &'static str,
        /// How many bytes it would take.
        needed: u64,
        /// How many the limit leaves.
        limit: u64,
    },
    /// The file unpacks to suspiciously many bytes.
    #[error(
        "unpacks to more than {ratio} times its {packed} bytes, like a compression bomb; \
         unpack it yourself or raise `Limits::max_ratio`"
    )]
    Bomb {
        /// Size of the compressed bytes.
        packed: u64,
        /// The limit that was passed.
        ratio: u64,
    },
    /// The file makes suspiciously much out of few bytes.
    #[error(
        "{what} and all before would take more than {ratio} times the file's bytes, which a file \
         that names the same bytes over and over does; raise `Limits::max_ratio` if you trust it"
    )]
    Repeats {
        /// What the bytes are for.
        what: &'static str,
        /// The limit that was passed.
        ratio: u64,
    },
    /// The machine has no room.
    #[error(transparent)]
    OutOfMemory(#[from] OutOfMemory),
    /// The caller's flag was raised.
    #[error("reading was cancelled")]
    Cancelled(#[from] Cancelled),
}

impl Fault {
    /// Something that breaks the rules of the format.
    pub(crate) fn broken(found: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Broken { found: found.into(), remedy: remedy.into() }
    }

    /// Something that is right but beyond us.
    pub(crate) fn unsupported(uses: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Unsupported { uses: uses.into(), remedy: remedy.into() }
    }
}

/// What to do about a file that stops too early or lies about its size.
pub(crate) const DAMAGED: &str = "the file is damaged or cut short: copy or export it again";

/// A number of things and what is said of them, in the words for one or for several.
pub(crate) fn counted(count: u64, one: &str, several: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { several })
}

/// At most so many bytes of a file are quoted in a message.
const QUOTE_MAX: usize = 40;

/// Text of a file as a message shows it: cut to a readable length.
pub(crate) fn clip(text: &str) -> String {
    match text.char_indices().nth(CLIP_MAX) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}

/// At most so many characters of a path are shown.
const CLIP_MAX: usize = 200;

/// Bytes of a file as a message shows them: quoted, escaped, cut to a readable length.
pub(crate) fn quote(bytes: &[u8]) -> String {
    let shown = &bytes[..bytes.len().min(QUOTE_MAX)];
    let dots = if shown.len() < bytes.len() { "..." } else { "" };
    format!("{:?}{dots}", String::from_utf8_lossy(shown))
}
