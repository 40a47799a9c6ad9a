//! What the caller allows an import to do.

use std::fmt;
use std::sync::Arc;

use treelet::context::{Cancel, Progress};

/// How to read a scene.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// How much a file may cost.
    pub limits: Limits,
    /// Whether a scene may name files outside its own folder. Addresses on a network are never
    /// opened.
    pub allow_outside: bool,
    /// Looked at every few milliseconds; once raised, the import ends with
    /// [`crate::Fault::Cancelled`].
    pub cancel: Cancel,
    /// Which scene of a file of several is read, by name or by number from 0; `None` for the one
    /// that the file shows.
    pub scene: Option<String>,
    /// Is told how far reading is.
    pub progress: Option<Watch>,
}

impl Options {
    /// Tells the watcher, if there is one.
    pub(crate) fn tell(&self, progress: Progress) {
        if let Some(Watch(watch)) = &self.progress {
            watch(progress);
        }
    }
}

/// Is told how far reading is, in bytes of the scene file, a few hundred times for a large one.
#[derive(Clone)]
pub struct Watch(Arc<dyn Fn(Progress) + Send + Sync>);

impl Watch {
    /// Calls `watch` from the thread that reads.
    pub fn new(watch: impl Fn(Progress) + Send + Sync + 'static) -> Self {
        Self(Arc::new(watch))
    }
}

impl fmt::Debug for Watch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Watch")
    }
}

/// How much one file, with all that it names, may cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes read, unpacked and made into arrays, together. Room counts when it is reserved, and
    /// what of it stays empty is not given back: a file counts 512 KiB beyond its size, what is
    /// unpacked and what grows while it is read up to twice its size and 512 KiB more. Of a large
    /// binary PLY or STL only the arrays count, as its bytes pass by.
    pub max_bytes: u64,
    /// How many times its packed size a compressed file may unpack to, and how many times its
    /// unpacked size the arrays made of it may take. It does not bind below 64 MiB, where no bomb
    /// hurts.
    pub max_ratio: u64,
}

impl Default for Limits {
    /// 8 GiB, and a ratio of 256. Meshes pack to a half or a tenth; the most regular height grid
    /// tried packed to a seventh.
    fn default() -> Self {
        Self { max_bytes: 8 << 30, max_ratio: 256 }
    }
}

/// Up to here nobody minds a ratio.
pub(crate) const HARMLESS_BYTES: u64 = 64 << 20;
