//! An instance that moves: where it is at a moment.
//!
//! Its box is sampled a power of two times a step; between two samples every plane moves along a line. What is
//! inside turns and stretches: seen along an axis, a corner of a box of it is at `T + R S x`, with `T` and `y = S x`
//! linear and `R` turning by `w` radians a step, so its second derivative is at most `w^2 |y| + 2 w |y'|`, and over
//! `1 / n` of a step it leaves its chord by at most an eighth of that over `n^2`. The samples are widened by so much, and by
//! what evaluating them rounds (`layout::moving`), so the box of each moment contains what is inside, and, as the culling
//! lemma asks, it is one and the same for walks and brute force; trees hold the box around all of them.
//!
//! The map of a moment is computed where a ray enters, in f64, and rounded once: about 0.2 us.

use super::placements::{Columns, Instance};
use crate::bounds::Aabb;
use crate::layout::moving::{box_between, widened_way};
use crate::math::affine::box_image;
use crate::math::pose::{Moment, Path, invert};
use crate::math::{Affine, rounding};
use alloc::vec::Vec;

/// Samples of a way, at most.
const SAMPLES_MAX: usize = 4096;

/// Samples of a step, at most.
const PARTS_MAX: usize = 64;

/// Chords may be left by this share of the largest edge of what is inside, before there are more of them.
const LEFT_MAX: f64 = 1.0 / 64.0;

/// Where an instance is at which moment.
#[derive(Debug)]
pub(crate) struct Motion {
    pub(crate) path: Path,
    /// Samples of a step.
    parts: usize,
    /// Around what is inside, for all steps.
    boxes: Vec<Aabb>,
}

impl Motion {
    /// Of what is inside `cover`, a few boxes.
    pub(crate) fn new(path: Path, cover: &[Aabb]) -> Self {
        let last = path.steps() - 1;
        let edge = |path: &Path| {
            let sample = images(path, 0.0, cover).extent();
            f64::from(sample[0].max(sample[1]).max(sample[2]).max(0.0))
        };
        let (edge, most) = (edge(&path), PARTS_MAX.min((SAMPLES_MAX / last.max(1)).max(1)));
        let mut parts = 1;
        while parts < most
            && (0..last).any(|step| left(&path, step, parts, cover) > LEFT_MAX * edge)
        {
            parts *= 2;
        }
        let by = (0..last).map(|step| left(&path, step, parts, cover)).fold(0.0, f64::max);
        let boxes = (0..=last * parts).map(|sample| {
            let bounds = images(&path, sample as f32 / parts as f32, cover);
            widened_way(&widened(&bounds, by))
        });
        let boxes = boxes.collect();
        Self { path, parts, boxes }
    }

    /// The same, with boxes wider by so much.
    pub(crate) fn widened(&self, by: f32) -> Self {
        let boxes = self.boxes.iter().map(|bounds| widened_way(&bounds.widened(by))).collect();
        Self { path: self.path.clone(), parts: self.parts, boxes }
    }

    /// Around it at all times.
    pub(crate) fn around(&self) -> Aabb {
        let all = self.boxes.iter().fold(Aabb::EMPTY, |all, bounds| all.union(bounds));
        widened_way(&all)
    }

    /// Around it from one time to another, both in `0 ..= 1`: planes move along lines between the samples, so the ends and the
    /// samples between them are all that matters.
    pub(crate) fn during(&self, [from, to]: [f32; 2]) -> Aabb {
        let place = |time: f32| Moment::new(time, self.path.steps()).place * self.parts as f32;
        let inner = place(from) as usize + 1..=place(to) as usize;
        let ends = self.bounds(from).union(&self.bounds(to));
        let samples = inner.filter_map(|sample| self.boxes.get(sample));
        widened_way(&samples.fold(ends, |all, bounds| all.union(bounds)))
    }

    /// Around it at a time.
    pub(crate) fn bounds(&self, time: f32) -> Aabb {
        let place = Moment::new(time, self.path.steps()).place * self.parts as f32;
        let Moment { step, next, along, .. } = Moment::at(place, self.boxes.len());
        box_between(&self.boxes[step], &self.boxes[next], along)
    }

    /// The map to the level outside at a time.
    pub(crate) fn world_from_object(&self, time: f32) -> Affine {
        let rows = self.path.at(Moment::new(time, self.path.steps()));
        Affine(rows.map(|row| row.map(|entry| entry as f32)))
    }

    /// The map that rays of a time go through; `None` if f32 has none.
    #[inline(never)]
    pub(crate) fn columns(&self, time: f32) -> Option<Columns> {
        let rows = invert(&self.path.at(Moment::new(time, self.path.steps())))?;
        let map = Affine(rows.map(|row| row.map(|entry| entry as f32)));
        map.is_finite().then(|| Instance::columns(&map))
    }
}

/// Around the images of some boxes at a moment.
fn images(path: &Path, place: f32, cover: &[Aabb]) -> Aabb {
    let map = path.at(Moment::at(place, path.steps()));
    cover.iter().filter(|bounds| !bounds.is_empty()).fold(Aabb::EMPTY, |all, bounds| {
        let (lo, hi) = box_image(&map, bounds.lo, bounds.hi);
        all.union(&Aabb { lo, hi })
    })
}

/// By how much chords over a part of a step may be left: see the module's head.
fn left(path: &Path, step: usize, parts: usize, cover: &[Aabb]) -> f64 {
    /// For what these few f64 operations round.
    const MARGIN: f64 = 1.01;
    let angle = path.angle(step);
    if angle == 0.0 {
        return 0.0;
    }
    let (mut far, mut change) = (0.0_f64, 0.0_f64);
    for bounds in cover.iter().filter(|bounds| !bounds.is_empty()) {
        for corner in 0..8 {
            let pick =
                |axis: usize| if corner >> axis & 1 == 0 { bounds.lo } else { bounds.hi }[axis];
            let p = [0, 1, 2].map(|axis: usize| f64::from(pick(axis)));
            let (a, b) = (path.stretched(step, p), path.stretched(step + 1, p));
            let length = |v: [f64; 3]| libm::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
            far = far.max(length(a)).max(length(b));
            change = change.max(length([b[0] - a[0], b[1] - a[1], b[2] - a[2]]));
        }
    }
    let bend = angle * angle * far + 2.0 * angle * change;
    MARGIN * bend / (8.0 * (parts * parts) as f64)
}

/// Wider by so much, rounded outward.
fn widened(bounds: &Aabb, by: f64) -> Aabb {
    if bounds.is_empty() {
        return *bounds;
    }
    Aabb {
        lo: bounds.lo.map(|x| rounding::down(f64::from(x) - by)),
        hi: bounds.hi.map(|x| rounding::up(f64::from(x) + by)),
    }
}

#[cfg(test)]
mod tests {
    use super::Motion;
    use crate::bounds::Aabb;
    use crate::math::Affine;
    use crate::math::pose::{Moment, Path};
    use alloc::vec::Vec;

    /// Numbers without a pattern (`verify`, which has better ones, stands below this folder).
    struct Random(u64);

    impl Random {
        fn between(&mut self, low: f32, high: f32) -> f32 {
            self.0 = self.0.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(0x1405_7B7E_F767_814F);
            low + (high - low) * ((self.0 >> 40) as f32 / (1 << 24) as f32)
        }

        fn vector(&mut self, size: f32) -> [f32; 3] {
            [(); 3].map(|()| self.between(-size, size))
        }
    }

    #[test]
    fn boxes_contain_what_turns_inside() {
        let mut random = Random(0x0B0E);
        for round in 0..300 {
            let steps = 2 + round % 3;
            let maps: Vec<Affine> = (0..steps)
                .map(|_| {
                    let scales = [(); 3].map(|()| random.between(0.05, 3.0));
                    Affine::translation(random.vector(5.0))
                        .then_from(&Affine::rotation(random.vector(1.0), random.between(-3.1, 3.1)))
                        .then_from(&Affine::scaling(scales))
                })
                .collect();
            let path = Path::new(&maps).unwrap();
            // Near the axis, and far from it.
            let center = random.vector([1.0, 50.0][round % 2]);
            let edge = random.between(0.01, 2.0);
            let cover = [Aabb { lo: center, hi: center.map(|x| x + edge) }];
            let motion = Motion::new(path.clone(), &cover);
            for _ in 0..64 {
                let time = random.between(0.0, 1.0);
                let map = path.at(Moment::new(time, steps));
                let bounds = motion.bounds(time);
                assert!(motion.around().contains(&bounds), "{time}");
                let span = (time * 8.0) as usize as f32;
                let during = motion.during([span / 8.0, (span + 1.0) / 8.0]);
                assert!(during.contains(&bounds), "{time} {during:?} {bounds:?}");
                for corner in 0..8 {
                    let p = [0, 1, 2].map(|axis: usize| {
                        let Aabb { lo, hi } = cover[0];
                        f64::from(if corner >> axis & 1 == 0 { lo } else { hi }[axis])
                    });
                    for (axis, [a, b, c, d]) in map.into_iter().enumerate() {
                        let at = a * p[0] + b * p[1] + c * p[2] + d;
                        let (lo, hi) = (f64::from(bounds.lo[axis]), f64::from(bounds.hi[axis]));
                        assert!(lo <= at && at <= hi, "{round} {time}: {lo} {at} {hi}");
                    }
                }
            }
        }
    }
}
