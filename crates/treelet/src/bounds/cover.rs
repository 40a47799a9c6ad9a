//! A few boxes that together contain something: transformed, they leave a tighter box than one does.
//!
//! To place a million instances takes the images of up to 32 boxes each, so they lie side by side, four in a vector: 9
//! instructions a box, where one at a time in f64 ([`box_image`]) took 120 ns each.
//!
//! # How far f32 is off
//!
//! A face of the image of a box is `a x + b y + c z + d`, where `a, b, c, d` are a row of the map and `x, y, z` are those of
//! the box's faces that make it least or greatest, which the signs of `a, b, c` say. Let `u = 2^-24` and
//! `S = |a| X + |b| Y + |c| Z + |d|`, where `X, Y, Z` are the largest absolute coordinates of all boxes. To round the row's
//! entries and the products costs `2 u S` at most, three sums `3 u S`, and to move the face outward at last `u S`: less
//! than `8 u S`, of which the computed `S` may lack a few `u`. An entry or a product that underflows is off by less than the least
//! normal number times a coordinate, or than that number itself. Of four lanes and of all boxes the least is taken before `d`
//! is added: rounding is monotone.

use super::Aabb;
use crate::math::affine::box_image;
use crate::simd::f4::F4;
use alloc::vec::Vec;

/// Derived above: `8 u`.
const SLACK: f32 = 4.0 * f32::EPSILON;

/// Sums below this do not overflow, nor does what they are made of.
const SIZE_MAX: f32 = (1_u128 << 100) as f32;

/// Boxes side by side: of each axis the lower faces, then the upper ones.
type Four = [[F4; 2]; 3];

/// See the head of the module.
#[derive(Debug)]
pub(crate) struct Cover {
    boxes: Vec<Aabb>,
    /// The same; the last ones stand there again where there are fewer than four.
    fours: Vec<Four>,
    /// The largest absolute coordinates.
    most: [f32; 3],
    /// What underflow may cost.
    tiny: f32,
}

impl Cover {
    /// Boxes that are not empty.
    pub(crate) fn new(boxes: Vec<Aabb>) -> Self {
        let fours = boxes.chunks(4).map(|four| {
            let face = |of: &dyn Fn(&Aabb) -> f32| {
                let at = |lane: usize| of(&four[lane.min(four.len() - 1)]);
                F4::new(at(0), at(1), at(2), at(3))
            };
            let axis = |axis: usize| [face(&|it| it.lo[axis]), face(&|it| it.hi[axis])];
            [axis(0), axis(1), axis(2)]
        });
        let fours = fours.collect();
        let far = |axis: usize| {
            boxes.iter().fold(0.0_f32, |far, it| far.max(it.lo[axis].abs()).max(it.hi[axis].abs()))
        };
        let most = [far(0), far(1), far(2)];
        let tiny = (most[0] + most[1] + most[2] + 1.0) * f32::MIN_POSITIVE;
        Self { boxes, fours, most, tiny }
    }

    pub(crate) fn boxes(&self) -> &[Aabb] {
        &self.boxes
    }

    /// A box around the images of all of them under a map; `None` where f32 cannot say.
    #[inline]
    pub(crate) fn image(&self, map: &[[f64; 4]; 3]) -> Option<Aabb> {
        let mut all = Aabb::EMPTY;
        let [x, y, z] = self.most;
        for (axis, &[a, b, c, d]) in map.iter().enumerate() {
            let (a, b, c, d) = (a as f32, b as f32, c as f32, d as f32);
            let size = a.abs() * x + b.abs() * y + c.abs() * z + d.abs();
            // Not for NaN.
            if size < SIZE_MAX {
                let [low, high] = self.extent([a, b, c]);
                let slack = size * SLACK + self.tiny;
                all.lo[axis] = low + d - slack;
                all.hi[axis] = high + d + slack;
            } else {
                return None;
            }
        }
        Some(all)
    }

    /// The least and the greatest that a linear form takes in the boxes, rounded to nearest.
    #[inline(always)]
    fn extent(&self, [a, b, c]: [f32; 3]) -> [f32; 2] {
        let (mut low, mut high) = (F4::splat(f32::INFINITY), F4::splat(f32::NEG_INFINITY));
        let side = |entry: f32| usize::from(entry < 0.0);
        let (i, j, k) = (side(a), side(b), side(c));
        let (a, b, c) = (F4::splat(a), F4::splat(b), F4::splat(c));
        for [x, y, z] in &self.fours {
            low = a.mul(x[i]).add(b.mul(y[j])).add(c.mul(z[k])).min(low);
            high = a.mul(x[1 - i]).add(b.mul(y[1 - j])).add(c.mul(z[1 - k])).max(high);
        }
        let ([e, f, g, h], [p, q, r, s]) = (low.to_array(), high.to_array());
        [e.min(f).min(g.min(h)), p.max(q).max(r.max(s))]
    }

    /// The same in f64, whatever the map.
    pub(crate) fn image_f64(&self, map: &[[f64; 4]; 3]) -> Aabb {
        self.boxes.iter().fold(Aabb::EMPTY, |all, bounds| {
            let (lo, hi) = box_image(map, bounds.lo, bounds.hi);
            all.union(&Aabb { lo, hi })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{Aabb, Cover};
    use alloc::vec::Vec;

    /// Boxes of all sizes under maps of all sizes: corners' images, in f64, are inside, and faces are
    /// not farther out than the head of the module says.
    #[test]
    fn images_hold_the_images_of_corners_and_little_more() {
        let mut state = 7_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1_u32 << 24)
        };
        for round in 0..2000 {
            let scale = libm::exp2(60.0 * random() - 40.0);
            let turn = if round % 3 == 0 { 1e-39 } else { libm::exp2(40.0 * random() - 20.0) };
            let count = 1 + round % 9;
            let boxes: Vec<Aabb> = (0..count)
                .map(|_| {
                    let lo = [(); 3].map(|()| (scale * (random() - 0.5)) as f32);
                    Aabb { lo, hi: lo.map(|x| x + (scale * random() * 0.1) as f32) }
                })
                .collect();
            let map = [(); 3].map(|()| {
                [(); 4].map(|()| turn * (random() - 0.5) * if random() < 0.1 { 0.0 } else { 1.0 })
            });
            let cover = Cover::new(boxes.clone());
            let image = cover.image(&map).expect("these sizes are usual ones");
            for (axis, [a, b, c, d]) in map.iter().enumerate() {
                let corner = |it: &Aabb, at: usize| {
                    let side = |axis: usize| [it.lo, it.hi][at >> axis & 1][axis];
                    let [x, y, z] = [side(0), side(1), side(2)].map(f64::from);
                    a * x + b * y + c * z + d
                };
                let all = || boxes.iter().flat_map(|it| (0..8).map(|at| corner(it, at)));
                let (low, high) =
                    (all().fold(f64::INFINITY, f64::min), all().fold(-f64::INFINITY, f64::max));
                let [lo, hi] = [image.lo[axis], image.hi[axis]].map(f64::from);
                assert!(lo <= low && high <= hi, "round {round}: {lo} {low} {high} {hi}");
                let size = (a.abs() + b.abs() + c.abs()) * 0.6 * scale + d.abs();
                let most = 16.0 * f64::from(f32::EPSILON) * size
                    + 4.0 * (1.0 + 2.0 * scale) * f64::from(f32::MIN_POSITIVE);
                assert!(
                    low - lo <= most && hi - high <= most,
                    "round {round}: {lo} {low} {high} {hi}"
                );
            }
        }
    }

    #[test]
    fn what_f32_cannot_say_is_not_said() {
        let cover = Cover::new(alloc::vec![Aabb { lo: [-1e18; 3], hi: [1e18; 3] }]);
        let row = [1e24, -1e24, 0.0, 0.0];
        assert!(cover.image(&[row; 3]).is_none());
        let image = cover.image_f64(&[row; 3]);
        assert!(image.hi[0] > f32::MAX / 1e30 && image.lo == image.hi.map(|x| -x));
        assert!(cover.image(&[[f64::NAN; 4]; 3]).is_none());
    }
}
