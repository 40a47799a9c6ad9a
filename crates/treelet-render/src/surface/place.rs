//! A placement, and how far a ray must step off what stands there.
//!
//! # Leaving a surface
//!
//! In the spirit of M. Pharr, W. Jakob, G. Humphreys, "Physically Based Rendering", section 6.8, and
//! of C. Wächter, N. Binder, "A Fast and Robust Method for Avoiding Self-Intersection", Ray Tracing
//! Gems, 2019, but derived for this tracer. Let `u = 2^-24`, `M p + b` the map of the placement,
//! `|.|` taken entry by entry, `e` the longest side of the triangle's box in object space.
//!
//! The hit point is `v0 + u (v1 - v0) + v (v2 - v0)`, through the map, in f64, rounded once. However
//! wrong `u` and `v` are, that is a point of the plane; so the world point is off it by `u |p|`.
//! What the next ray sees of that plane is less exact:
//!
//! - its origin goes through the inverse map, whose entries are rounded: three products, three
//!   sums, rounded entries, `5 u |M^-1| (|p| + |b|)`, which in the world is `|M|` times that;
//! - the triangle test moves and shears the corners, whose distance from the origin is about `e`:
//!   `6 u e` (see the library's triangle test), in the world `|M|` times that;
//! - adding the offset rounds once more: `u |p|`.
//!
//! With `A = |M| |M^-1|`, which is at least the identity, all of it is below
//! `7 u A (|p| + |b|) + 6 u |M| e`; `OFFSET` takes 16 for both. The offset along the normal `n` is
//! the part of that box of errors that `n` sees: the sum of `|n|` times it over the axes. At one
//! metre from the origin it is a micrometre.

use treelet::math::Affine;

/// The offset in units of `2^-24` of the sizes above; see the module head.
const OFFSET: f32 = 16.0 * (f32::EPSILON / 2.0);

/// A placement and what it does to normals and errors.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlaceRecord {
    pub(super) first_part: usize,
    pub(super) parts: usize,
    pub(super) world_from_object: Affine,
    pub(super) object_from_world: Affine,
    /// Whether the map is the identity, as for most scenes of one mesh: half the work is saved.
    pub(super) unmoved: bool,
    /// `|M| |M^-1|`.
    spread: [[f32; 3]; 3],
}

impl PlaceRecord {
    pub(super) fn new(first_part: usize, parts: usize, world_from_object: Affine) -> Self {
        // A singular map places nothing that a ray could hit.
        let object_from_world = world_from_object.inverse().unwrap_or_default();
        let (m, inverse) = (world_from_object.0, object_from_world.0);
        let spread = core::array::from_fn(|row| {
            core::array::from_fn(|column| {
                (0..3).map(|k| m[row][k].abs() * inverse[k][column].abs()).sum()
            })
        });
        let unmoved = world_from_object == Affine::IDENTITY;
        Self { first_part, parts, world_from_object, object_from_world, unmoved, spread }
    }

    /// The distance that a ray must start from a point; derived in the module head.
    #[inline]
    pub(super) fn offset(&self, point: [f32; 3], normal: [f32; 3], side: f32) -> f32 {
        if self.unmoved {
            let axis = |k: usize| normal[k].abs() * (side + point[k].abs());
            return OFFSET * (axis(0) + axis(1) + axis(2));
        }
        let m = self.world_from_object.0;
        let mut sum = 0.0;
        for row in 0..3 {
            let mut error = (m[row][0].abs() + m[row][1].abs() + m[row][2].abs()) * side;
            for k in 0..3 {
                error += self.spread[row][k] * (point[k].abs() + m[k][3].abs());
            }
            sum += normal[row].abs() * error;
        }
        OFFSET * sum
    }
}
