//! What the caller allows an import to do.

use treelet::context::Cancel;

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
}

/// How much one file, with all that it names, may cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes read, unpacked and made into arrays, together. Room counts when it is reserved, and
    /// what of it stays empty is not given back: a file counts 512 KiB beyond its size, what is
    /// unpacked and what grows while it is read up to twice its size and 512 KiB more.
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
