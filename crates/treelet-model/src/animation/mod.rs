//! Motion: clips, the nodes that they move, and what hangs on those: placements, cameras, lights, and
//! meshes that bend with skins and morph targets.
//!
//! After the Khronos Group's "glTF 2.0 Specification", version 2.0.1, sections 3.7.2, 3.7.3 and 3.11.
//! All of it is plain data beside the model ([`Rig`], [`Animation`]); [`crate::Model::pose`] puts the
//! model into the pose of a time and tells what that changed. A pose follows from the clip and the
//! time alone, never from the pose before, so frames can be made in any order.
//!
//! Transforms are composed in f64 and rounded once; there are no other sines than those of `libm`.

mod deform;
mod pose;
mod rig;
mod sample;
pub mod transform;

pub use pose::{Changes, PoseError};
pub use rig::{Deformer, Influences, Joint, Local, Mount, Node, Rig, Shape, Skin, Target};

/// A clip: channels that play together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Animation {
    /// As the file names it; may be empty.
    pub name: String,
    /// What moves.
    pub channels: Vec<Channel>,
}

/// One property of one node over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Index of the node in the file, and in [`Rig::nodes`].
    pub node: usize,
    /// Names of the nodes from the root to this one, with `/` between; unnamed ones as `#index`.
    pub path: String,
    /// What of the node changes.
    pub property: Property,
    /// What lies between keys.
    pub interpolation: Interpolation,
    /// Seconds of the keys; none is before the one before it.
    pub times: Vec<f32>,
    /// The values of all keys, one key after the other. A key has [`Property::components`] numbers,
    /// three times as many (in-tangent, value, out-tangent) for [`Interpolation::CubicSpline`].
    pub values: Vec<f32>,
}

/// What a channel changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Property {
    /// Three numbers, in the parent's space.
    Translation,
    /// A unit quaternion: x, y, z, w.
    Rotation,
    /// Three factors.
    Scale,
    /// One number a morph target.
    MorphWeights {
        /// How many targets there are.
        targets: usize,
    },
}

impl Property {
    /// How many numbers a value has.
    pub fn components(self) -> usize {
        match self {
            Self::Translation | Self::Scale => 3,
            Self::Rotation => 4,
            Self::MorphWeights { targets } => targets,
        }
    }
}

/// What lies between two keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// The earlier key.
    Step,
    /// The straight line; the great arc for rotations.
    #[default]
    Linear,
    /// The cubic Hermite spline through values and tangents.
    CubicSpline,
}
