//! Affine maps, named target first: `world_from_object` takes object points to the world.

use super::{rounding, vec3};

/// The map `p -> M p + b` as three rows of `[m0, m1, m2, b]`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(transparent)]
pub struct Affine(pub [[f32; 4]; 3]);

impl Default for Affine {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Affine {
    /// The map that leaves every point where it is.
    pub const IDENTITY: Self =
        Self([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);

    /// Moves by `offset`.
    pub const fn translation(offset: [f32; 3]) -> Self {
        let mut rows = Self::IDENTITY.0;
        rows[0][3] = offset[0];
        rows[1][3] = offset[1];
        rows[2][3] = offset[2];
        Self(rows)
    }

    /// Scales by a factor for each axis, about the origin.
    pub const fn scaling(factors: [f32; 3]) -> Self {
        let mut rows = Self::IDENTITY.0;
        rows[0][0] = factors[0];
        rows[1][1] = factors[1];
        rows[2][2] = factors[2];
        Self(rows)
    }

    /// Turns by `angle` radians about `axis` (any length but zero), right-handed, about the origin.
    pub fn rotation(axis: [f32; 3], angle: f32) -> Self {
        let [x, y, z] = vec3::normalize(axis).unwrap_or([0.0, 0.0, 1.0]).map(f64::from);
        let (sin, cos) = (libm::sin(f64::from(angle)), libm::cos(f64::from(angle)));
        let rest = 1.0 - cos;
        let linear = [
            [x * x * rest + cos, x * y * rest - z * sin, x * z * rest + y * sin],
            [y * x * rest + z * sin, y * y * rest + cos, y * z * rest - x * sin],
            [z * x * rest - y * sin, z * y * rest + x * sin, z * z * rest + cos],
        ];
        Self(linear.map(|[a, b, c]| [a as f32, b as f32, c as f32, 0.0]))
    }

    /// The map that first applies `inner`, then `self`: `(self * inner)(p) = self(inner(p))`.
    ///
    /// Computed in f64, rounded once.
    #[must_use]
    pub fn then_from(&self, inner: &Self) -> Self {
        let mut rows = [[0.0; 4]; 3];
        for (row, out) in rows.iter_mut().enumerate() {
            let outer = self.0[row].map(f64::from);
            for (column, entry) in out.iter_mut().enumerate() {
                let mut sum = if column == 3 { outer[3] } else { 0.0 };
                for k in 0..3 {
                    sum += outer[k] * f64::from(inner.0[k][column]);
                }
                *entry = sum as f32;
            }
        }
        Self(rows)
    }

    /// `M p + b`, in one written order: `((m0 p0 + m1 p1) + m2 p2) + b`, f32, unfused.
    #[inline(always)]
    pub fn point(&self, p: [f32; 3]) -> [f32; 3] {
        self.0.map(|[a, b, c, d]| a * p[0] + b * p[1] + c * p[2] + d)
    }

    /// `M v`, in one written order: `(m0 v0 + m1 v1) + m2 v2`, f32, unfused.
    #[inline(always)]
    pub fn vector(&self, v: [f32; 3]) -> [f32; 3] {
        self.0.map(|[a, b, c, _]| a * v[0] + b * v[1] + c * v[2])
    }

    /// `M^T n`: takes normals of the *target* space to the source space, so that
    /// `object_from_world.transposed_vector(n)` is the world normal of the object normal `n`.
    pub fn transposed_vector(&self, n: [f32; 3]) -> [f32; 3] {
        core::array::from_fn(|c| self.0[0][c] * n[0] + self.0[1][c] * n[1] + self.0[2][c] * n[2])
    }

    /// The map back, or `None` if there is none in f32: a singular matrix, an entry of either map
    /// that is not finite. Computed in f64, rounded once.
    pub fn inverse(&self) -> Option<Self> {
        let mut rows = [[0.0_f32; 4]; 3];
        for (&[a, b, c, d], row) in self.inverse_f64()?.iter().zip(&mut rows) {
            *row = [a as f32, b as f32, c as f32, d as f32];
        }
        let map = Self(rows);
        map.is_finite().then_some(map)
    }

    /// The map back in f64, by Cramer's rule; `None` if singular or not finite.
    #[inline]
    pub(crate) fn inverse_f64(&self) -> Option<[[f64; 4]; 3]> {
        let mut m = [[0.0_f64; 4]; 3];
        for (&[a, b, c, d], row) in self.0.iter().zip(&mut m) {
            *row = [f64::from(a), f64::from(b), f64::from(c), f64::from(d)];
        }
        let minor = |r0: usize, r1: usize, c0: usize, c1: usize| {
            m[r0][c0] * m[r1][c1] - m[r0][c1] * m[r1][c0]
        };
        let cofactor = [
            [minor(1, 2, 1, 2), minor(1, 2, 2, 0), minor(1, 2, 0, 1)],
            [minor(2, 0, 1, 2), minor(2, 0, 2, 0), minor(2, 0, 0, 1)],
            [minor(0, 1, 1, 2), minor(0, 1, 2, 0), minor(0, 1, 0, 1)],
        ];
        let det = m[0][0] * cofactor[0][0] + m[0][1] * cofactor[0][1] + m[0][2] * cofactor[0][2];
        let mut rows = [[0.0; 4]; 3];
        // Nine divisions took a tenth of the time in which an instance is placed.
        let scale = 1.0 / det;
        for row in 0..3 {
            for column in 0..3 {
                rows[row][column] = cofactor[column][row] * scale;
            }
            let [a, b, c, _] = rows[row];
            rows[row][3] = -(a * m[0][3] + b * m[1][3] + c * m[2][3]);
        }
        // Rank is judged relative to the rows' own sizes: scale 1e-15 is small, not singular.
        let length = |[a, b, c, _]: [f64; 4]| larger(larger(a.abs(), b.abs()), c.abs());
        let size = length(m[0]) * length(m[1]) * length(m[2]);
        let regular = det.abs() > size * RANK_EPSILON;
        let mut finite = true;
        for [a, b, c, d] in &rows {
            finite &= a.is_finite() & b.is_finite() & c.is_finite() & d.is_finite();
        }
        (regular & finite).then_some(rows)
    }

    /// Whether the map turns right-handed frames into left-handed ones.
    pub fn is_mirroring(&self) -> bool {
        let [x, y, z] = self.0.map(|[a, b, c, _]| [f64::from(a), f64::from(b), f64::from(c)]);
        let det = x[0] * (y[1] * z[2] - y[2] * z[1]) - x[1] * (y[0] * z[2] - y[2] * z[0])
            + x[2] * (y[0] * z[1] - y[1] * z[0]);
        det < 0.0
    }

    /// Whether every entry is finite.
    pub fn is_finite(&self) -> bool {
        let mut finite = true;
        for [a, b, c, d] in &self.0 {
            finite &= a.is_finite() & b.is_finite() & c.is_finite() & d.is_finite();
        }
        finite
    }
}

/// One instruction, where `f64::max` asks both whether they are numbers.
#[inline(always)]
pub(crate) fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// A determinant below this share of the product of its rows' sizes counts as zero. f64 computes
/// the determinant of f32 entries to about 1e-15 of that product, so 1e-12 is surely not noise.
const RANK_EPSILON: f64 = 1e-12;

/// An axis-aligned box `(lo, hi)` around the image of the box `(lo, hi)` under an f64 map,
/// rounded outward.
pub(crate) fn box_image(map: &[[f64; 4]; 3], lo: [f32; 3], hi: [f32; 3]) -> ([f32; 3], [f32; 3]) {
    let mut out = ([0.0; 3], [0.0; 3]);
    for (row, &[a, b, c, d]) in map.iter().enumerate() {
        let (mut low, mut high, mut size) = (d, d, d.abs());
        // Arvo's method: each entry adds its smaller product to one end, its larger to the other.
        for (axis, entry) in [a, b, c].into_iter().enumerate() {
            let (p, q) = (entry * f64::from(lo[axis]), entry * f64::from(hi[axis]));
            low += p.min(q);
            high += p.max(q);
            size += p.abs().max(q.abs());
        }
        // Six f64 roundings, each below 2^-53 of `size`.
        let slack = size * (8.0 * f64::EPSILON);
        out.0[row] = rounding::down(low - slack);
        out.1[row] = rounding::up(high + slack);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::Affine;

    #[test]
    fn inverse_undoes() {
        let map = Affine::translation([3.0, -4.0, 5.0])
            .then_from(&Affine::rotation([1.0, 2.0, 3.0], 0.7))
            .then_from(&Affine::scaling([2.0, -0.5, 7.0]));
        let back = map.inverse().unwrap();
        let p = back.point(map.point([0.3, 0.2, -0.9]));
        for (got, want) in p.into_iter().zip([0.3, 0.2, -0.9]) {
            assert!((got - want).abs() < 1e-6, "{p:?}");
        }
        assert!(map.is_mirroring() && !Affine::IDENTITY.is_mirroring());
    }

    #[test]
    fn singular_has_no_inverse_but_tiny_has() {
        assert_eq!(Affine::scaling([1.0, 0.0, 1.0]).inverse(), None);
        assert_eq!(Affine::scaling([1.0, f32::NAN, 1.0]).inverse(), None);
        let dependent = Affine([[1.0, 2.0, 3.0, 0.0], [2.0, 4.0, 6.0, 0.0], [0.0, 1.0, 0.0, 0.0]]);
        assert_eq!(dependent.inverse(), None);
        assert!(Affine::scaling([1e-15; 3]).inverse().is_some());
        assert!(Affine::scaling([1e-3, 1e3, 1.0]).inverse().is_some());
    }

    #[test]
    fn identity_is_exact() {
        let p = [1.1e-7, -3.3e8, 0.0];
        assert_eq!(Affine::IDENTITY.point(p), p);
        assert_eq!(Affine::IDENTITY.inverse(), Some(Affine::IDENTITY));
    }
}
