//! The ray of every query.

/// A ray: the points `origin + t * direction` for `t_min <= t <= t_max`, both ends included.
///
/// `t` is measured in lengths of `direction`, which need not be normalised. A ray that cannot hit
/// anything is answered as a miss at once: a component that is NaN, an origin or direction that is
/// infinite, a zero direction, a time that is NaN, a direction whose largest component is outside
/// `2^-100 ..= 2^120`, or `t_min > t_max`. See [`Ray::is_valid`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Ray {
    /// Where `t` is 0.
    pub origin: [f32; 3],
    /// The least `t` that counts; may be negative.
    pub t_min: f32,
    /// Any length but zero.
    pub direction: [f32; 3],
    /// The greatest `t` that counts; may be infinite.
    pub t_max: f32,
    /// The moment, in `0 ..= 1`, at which moving geometry is met; what lies outside counts as the nearer end.
    pub time: f32,
    /// Met are the meshes and instances whose mask has a bit in common with this one.
    pub mask: u32,
}

/// The least length of the longest component of a direction.
///
/// Components from 2^-128 down count as zero in the slab test. At 2^-28 of the longest component
/// that moves no point by more than `u R / 16` (`geometry::triangle` has the terms); at 2^-8 rays
/// leaked.
pub(crate) const SHORTEST: f32 = f32::from_bits(27 << 23);
/// The greatest: beyond, the reciprocal of the longest component is no normal f32.
pub(crate) const LONGEST: f32 = f32::from_bits(247 << 23);

impl Ray {
    /// The ray from `origin` along `direction`, for `t` from 0 to infinity, seen by every mask.
    pub const fn new(origin: [f32; 3], direction: [f32; 3]) -> Self {
        Self { origin, t_min: 0.0, direction, t_max: f32::INFINITY, time: 0.0, mask: u32::MAX }
    }

    /// The same ray, ending at `t_max`.
    pub const fn up_to(self, t_max: f32) -> Self {
        Self { t_max, ..self }
    }

    /// The same ray, starting at `t_min`.
    pub const fn from(self, t_min: f32) -> Self {
        Self { t_min, ..self }
    }

    /// The same ray, at a moment in `0 ..= 1`.
    pub const fn at_time(self, time: f32) -> Self {
        Self { time, ..self }
    }

    /// `origin + t * direction`.
    pub fn at(&self, t: f32) -> [f32; 3] {
        core::array::from_fn(|axis| self.origin[axis] + t * self.direction[axis])
    }

    /// Whether the ray can hit anything at all; one that cannot is answered as a miss.
    #[inline(always)]
    pub fn is_valid(&self) -> bool {
        let [x, y, z] = [self.direction[0], self.direction[1], self.direction[2]];
        let [x, y, z] = [x.abs(), y.abs(), z.abs()];
        let [a, b, c] = [self.origin[0].abs(), self.origin[1].abs(), self.origin[2].abs()];
        // Comparisons with NaN are false, so all ask for what is good; `&` since no branch pays.
        (x <= LONGEST)
            & (y <= LONGEST)
            & (z <= LONGEST)
            & ((x >= SHORTEST) | (y >= SHORTEST) | (z >= SHORTEST))
            & (a < f32::INFINITY)
            & (b < f32::INFINITY)
            & (c < f32::INFINITY)
            & (self.t_min <= self.t_max)
            & !self.time.is_nan()
    }
}

#[cfg(test)]
mod tests {
    use super::Ray;

    #[test]
    fn validity() {
        let good = Ray::new([0.0; 3], [0.0, -0.0, 1.0]);
        assert!(good.is_valid());
        assert!(good.from(-5.0).is_valid());
        assert!(good.up_to(0.0).is_valid(), "a closed interval of one point");
        assert!(Ray::new([0.0; 3], [2f32.powi(-100), 0.0, 0.0]).is_valid());
        assert!(Ray::new([0.0; 3], [2f32.powi(120); 3]).is_valid());
        assert!(!Ray::new([0.0; 3], [2f32.powi(-101), 0.0, 0.0]).is_valid());
        assert!(!Ray::new([0.0; 3], [2f32.powi(121), 0.0, 0.0]).is_valid());
        assert!(!Ray::new([0.0; 3], [0.0; 3]).is_valid());
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for axis in 0..3 {
                let mut ray = good;
                ray.origin[axis] = bad;
                assert!(!ray.is_valid(), "origin {bad} on axis {axis}");
                let mut ray = good;
                ray.direction[axis] = bad;
                assert!(!ray.is_valid(), "direction {bad} on axis {axis}");
            }
        }
        assert!(!good.up_to(f32::NAN).is_valid());
        assert!(!good.from(f32::NAN).is_valid());
        assert!(!good.from(1.0).up_to(0.5).is_valid());
        assert!(!good.at_time(f32::NAN).is_valid());
        assert!(good.at_time(f32::INFINITY).is_valid(), "clamped");
    }
}
