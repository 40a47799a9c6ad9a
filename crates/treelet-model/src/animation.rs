//! Motion as a file tells it. Kept for whoever will play it; nothing does yet.

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
    /// Index of the node in the file.
    pub node: usize,
    /// Names of the nodes from the root to this one, with `/` between; unnamed ones as `#index`.
    pub path: String,
    /// What of the node changes.
    pub property: Property,
    /// What lies between keys.
    pub interpolation: Interpolation,
    /// Seconds of the keys, rising.
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
