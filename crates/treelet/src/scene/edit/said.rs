//! What a commit did, why, and to what.

#[cfg(doc)]
use super::Edit;
use crate::scene::Scene;
use core::time::Duration;

/// What a commit did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Nothing had changed.
    Kept,
    /// The tree stayed, its boxes followed.
    Refitted,
    /// So did they, and what had decayed is new: see [`Commit::parts`].
    Repaired,
    /// There is a new tree.
    Rebuilt,
}

impl Action {
    /// What became of the tree, in a word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Kept => "kept",
            Self::Refitted => "refitted",
            Self::Repaired => "repaired",
            Self::Rebuilt => "rebuilt",
        }
    }
}

impl core::fmt::Display for Action {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.name())
    }
}

/// Why it did that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reason {
    /// There was nothing to do.
    Unchanged,
    /// It was asked for.
    Asked,
    /// The same triangles and instances are in the tree, and it is good enough, or mending it would not have paid yet.
    Same,
    /// A few meshes, other shapes or instances came or went, which the tree took in or left out. A shape with another number of
    /// primitives does both, and so does a mesh that moves with other time steps.
    Few,
    /// More than a quarter of what the level holds came or went; or an instance that is opened holds something else.
    Different,
    /// A triangle is not fit for a scene, or one that was not was left out.
    Unfit,
    /// The boxes had grown too much, or for so long that mending pays.
    Decayed,
}

impl core::fmt::Display for Reason {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Unchanged => "nothing changed",
            Self::Asked => "as asked",
            Self::Same => "the same triangles and instances, in boxes that are still good enough",
            Self::Few => "a few meshes, shapes or instances came or went",
            Self::Different => "other triangles or instances than before",
            Self::Unfit => "triangles that are, or were, not fit for a scene",
            Self::Decayed => "the boxes had grown too much",
        })
    }
}

/// What became of the parts of a tree that was refitted or repaired; zero for any other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Parts {
    /// Subtrees and instances that stayed as they were, under a new tree.
    pub kept: u64,
    /// Triangles that were taken out of decayed subtrees, and built over one by one.
    pub loose: u64,
    /// Instances, meshes and other shapes that were put into the tree as it is.
    pub added: u64,
    /// Instances, meshes and other shapes that were taken out of it.
    pub removed: u64,
}

/// A new snapshot, and what was done for it.
#[derive(Clone, Debug)]
pub struct Commit {
    /// The scene after the edit. Its report is of the last build, and of what was left out of shapes that came since.
    pub scene: Scene,
    /// What was done to the tree.
    pub action: Action,
    /// Why.
    pub reason: Reason,
    /// Boxes that a long random line meets in the tree, for each triangle or instance whose own box it meets, over what that
    /// was when the tree was built: 1 for a new one.
    pub decay: f64,
    /// What a repair left as it was, and what not.
    pub parts: Parts,
    /// How long the commit took; zero where there is no clock.
    pub time: Duration,
}

/// What it did, and why, in a sentence.
impl core::fmt::Display for Commit {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}: {}", self.action, self.reason)?;
        let Parts { kept, loose, added, removed } = self.parts;
        if added + removed > 0 {
            write!(f, ", {added} added and {removed} removed")?;
        }
        match self.action {
            Action::Repaired => write!(
                f,
                "; a new tree over {kept} parts that stayed and {loose} triangles, {:.2} times as dear as when all was built",
                self.decay
            ),
            Action::Refitted => write!(f, "; {:.2} times as dear as when it was built", self.decay),
            Action::Kept | Action::Rebuilt => Ok(()),
        }
    }
}
