//! What the caller allows an import to do.

use std::fmt;
use std::sync::Arc;

/// How to read a scene.
#[derive(Clone, Default)]
pub struct Options {
    /// How much a file may cost.
    pub limits: Limits,
    /// Whether a scene may name files outside its own folder. Addresses on a network are never
    /// opened.
    pub allow_outside: bool,
    /// Asked every few milliseconds; `true` ends the import with [`crate::Fault::Cancelled`].
    pub cancelled: Option<Arc<dyn Fn() -> bool + Send + Sync>>,
}

impl fmt::Debug for Options {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { limits, allow_outside, cancelled } = self;
        f.debug_struct("Options")
            .field("limits", limits)
            .field("allow_outside", allow_outside)
            .field("cancelled", &cancelled.as_ref().map(|_| "fn"))
            .finish()
    }
}

/// How much one file, with all that it names, may cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes read, unpacked and made into arrays, together.
    pub max_bytes: u64,
    /// How many times its packed size a compressed file may unpack to. It does not bind below
    /// 64 MiB, where no bomb hurts.
    pub max_ratio: u64,
}

impl Default for Limits {
    /// 8 GiB, and a ratio of 256. Meshes pack to a half or a tenth; the most regular height grid
    /// tried packed to a seventh.
    fn default() -> Self {
        Self { max_bytes: 8 << 30, max_ratio: 256 }
    }
}
