//! Lights that are no surface, and the picture of what is far away.
//!
//! Units go together: a radiance of 1 is what [`crate::Material::emission`] of 1 sends, whatever
//! the file calls it (glTF: candela a square metre). A point light of intensity `I` gives the
//! irradiance `I / d^2` at distance `d`; a sheet that scatters all light shows irradiance `E` as
//! radiance `E / pi`. Lengths are the file's. Area lights are parts with an emissive material.

use treelet::math::Affine;

/// A light without a surface, in the world.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// As the file names it; may be empty.
    pub name: String,
    /// What it is.
    pub kind: LightKind,
}

/// The kinds of lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Shines alike in all directions.
    Point {
        /// Where it is.
        position: [f32; 3],
        /// Radiant intensity: power a steradian (glTF: candela).
        intensity: [f32; 3],
    },
    /// Shines in a cone: fully inside `inner_angle`, not at all outside `outer_angle`.
    Spot {
        /// Where it is.
        position: [f32; 3],
        /// Unit vector of the cone's axis, away from the light.
        direction: [f32; 3],
        /// Radiant intensity along the axis (glTF: candela).
        intensity: [f32; 3],
        /// Radians from the axis, `0 ..= outer_angle`.
        inner_angle: f32,
        /// Radians from the axis, above 0, at most pi.
        outer_angle: f32,
        /// How the cone's edge fades.
        falloff: SpotFalloff,
    },
    /// Comes from so far away that its rays are parallel.
    Directional {
        /// Unit vector along the light's rays, away from the light.
        direction: [f32; 3],
        /// On a surface that faces the light (glTF: lux).
        irradiance: [f32; 3],
    },
}

/// How a spot fades between its two angles: by `x = (cos a - cos outer) / (cos inner - cos outer)`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SpotFalloff {
    /// `x^2`: glTF's recommendation.
    #[default]
    Square,
    /// `x^2 (3 - 2 x)`: pbrt's.
    Smooth,
}

/// A picture of all that is far away.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// Index into [`crate::Model::images`]; its pixels are radiance (8-bit ones are sRGB).
    pub image: usize,
    /// How directions lead to pixels.
    pub projection: Projection,
    /// Turns the environment's own directions to the world's; a rotation or mirror image.
    pub world_from_environment: Affine,
    /// Multiplied with each pixel.
    pub scale: [f32; 3],
}

/// How a picture covers the sphere of directions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Projection {
    /// Longitude and latitude. The top row is +y, the middle of the picture -z, and +x is in the
    /// middle of its right half.
    #[default]
    LatLong,
    /// The equal-area octahedron of P. Clarberg, "Fast Equal-Area Mapping of the (Hemi)Sphere
    /// using SIMD", 2008, as pbrt v4 stores it: square, +z in the middle, -z at the corners, +x to
    /// the right, +y down.
    EqualAreaOctahedral,
}
