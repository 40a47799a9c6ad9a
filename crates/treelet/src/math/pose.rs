//! Moments between time steps, and maps between maps.
//!
//! Steps are equally spaced over times `0 ..= 1`; between two of them vertices move along straight lines. Maps are
//! taken apart first: `M = T R S`, a translation, a rotation and a symmetric stretch; translation and stretch are
//! interpolated linearly, rotations as quaternions at constant speed along the shorter arc. So nothing shrinks
//! while it turns. A stretch between two definite ones of the same sign is definite: no map between is singular.
//!
//! Sources: K. Shoemake, "Animating Rotation with Quaternion Curves", SIGGRAPH 1985; K. Shoemake, T. Duff,
//! "Matrix Animation and Polar Decomposition", Graphics Interface 1992; the iteration is N. Higham's, "Computing
//! the Polar Decomposition, with Applications", SIAM J. Sci. Stat. Comput. 7(4), 1986. All in f64, unfused, with
//! `libm`.

use super::Affine;
use alloc::vec::Vec;

/// A moment among equally spaced steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Moment {
    /// How many steps, with fractions, have passed: `time (steps - 1)`, rounded once.
    pub(crate) place: f32,
    /// The last step that has been reached.
    pub(crate) step: usize,
    /// The one after; itself at the end.
    pub(crate) next: usize,
    /// How far from the one to the other, below 1; exact.
    pub(crate) along: f32,
}

impl Moment {
    /// The moment of a time, which is clamped to `0 ..= 1`, among at least one step.
    #[inline]
    pub(crate) fn new(time: f32, steps: usize) -> Self {
        let last = steps - 1;
        // Comparisons with NaN are false: such rays are answered elsewhere.
        let time = if time > 0.0 { time } else { 0.0 };
        let time = if time < 1.0 { time } else { 1.0 };
        Self::at(time * last as f32, steps)
    }

    /// The moment after so many steps, which must not be below 0.
    #[inline]
    pub(crate) fn at(place: f32, steps: usize) -> Self {
        let last = steps - 1;
        let step = (place as usize).min(last);
        let along = if step == last { 0.0 } else { place - step as f32 };
        Self { place, step, next: (step + 1).min(last), along }
    }
}

/// A coordinate between two steps: `a + along (b - a)`, f32, unfused. At its step that is `a` (of a zero the sign may
/// change).
#[inline(always)]
pub(crate) fn between(a: f32, b: f32, along: f32) -> f32 {
    a + along * (b - a)
}

/// An affine map in f64: three rows of `[m0, m1, m2, b]`.
pub(crate) type Rows = [[f64; 4]; 3];
type Linear = [[f64; 3]; 3];

/// A map taken apart.
#[derive(Clone, Copy, Debug)]
struct Pose {
    translation: [f64; 3],
    /// `w, x, y, z`.
    turn: [f64; 4],
    /// Symmetric; negative definite for maps that mirror.
    stretch: Linear,
}

/// The way of an object: its maps at two or more steps.
#[derive(Clone, Debug)]
pub(crate) struct Path {
    maps: Vec<Affine>,
    poses: Vec<Pose>,
}

/// Why maps make no path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum PathDefect {
    /// The map of this step is singular or not finite.
    Singular(usize),
    /// This step mirrors where the one before does not, or the other way round.
    Mirrored(usize),
}

impl Path {
    /// The way through at least one map.
    pub(crate) fn new(maps: &[Affine]) -> Result<Self, PathDefect> {
        let mut poses: Vec<Pose> = Vec::with_capacity(maps.len());
        for (step, map) in maps.iter().enumerate() {
            let mut pose = Pose::of(map).ok_or(PathDefect::Singular(step))?;
            if let Some(before) = poses.last() {
                if (before.stretch[0][0] < 0.0) != (pose.stretch[0][0] < 0.0) {
                    return Err(PathDefect::Mirrored(step));
                }
                // Both signs are the same rotation; the shorter arc leads to one of them.
                if dot(before.turn, pose.turn) < 0.0 {
                    pose.turn = pose.turn.map(|x| -x);
                }
            }
            poses.push(pose);
        }
        Ok(Self { maps: maps.to_vec(), poses })
    }

    pub(crate) fn steps(&self) -> usize {
        self.maps.len()
    }

    /// As the caller gave them.
    pub(crate) fn maps(&self) -> &[Affine] {
        &self.maps
    }

    /// The map of a moment; at a step, the caller's.
    pub(crate) fn at(&self, moment: Moment) -> Rows {
        if moment.along == 0.0 {
            return self.maps[moment.step].0.map(|row| row.map(f64::from));
        }
        let (a, b) = (&self.poses[moment.step], &self.poses[moment.next]);
        let along = f64::from(moment.along);
        let mix = |a: f64, b: f64| (1.0 - along) * a + along * b;
        let turn = linear(arc(a.turn, b.turn, along));
        let stretch: Linear = [0, 1, 2]
            .map(|i: usize| [0, 1, 2].map(|j: usize| mix(a.stretch[i][j], b.stretch[i][j])));
        let m = product(&turn, &stretch);
        let at = |i: usize| mix(a.translation[i], b.translation[i]);
        [0, 1, 2].map(|i: usize| [m[i][0], m[i][1], m[i][2], at(i)])
    }

    /// The angle by which the object turns from a step to the next, in radians.
    pub(crate) fn angle(&self, step: usize) -> f64 {
        match (self.poses.get(step), self.poses.get(step + 1)) {
            (Some(a), Some(b)) => 2.0 * half_angle(a.turn, b.turn),
            _ => 0.0,
        }
    }

    /// A point after the stretch of a step.
    pub(crate) fn stretched(&self, step: usize, p: [f64; 3]) -> [f64; 3] {
        self.poses[step].stretch.map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2])
    }

    /// Bounds on the largest and from below on the smallest stretch in any direction at any time: the
    /// largest Frobenius norm of a step, and one over that of its inverse. (The smallest stretch of a mean is
    /// at least the smaller of both, the largest at most the larger.)
    pub(crate) fn stretches(&self) -> (f64, f64) {
        let mut all = (0.0_f64, f64::INFINITY);
        for pose in &self.poses {
            let back = inverse(&pose.stretch).unwrap_or_default();
            all = (all.0.max(frobenius(&pose.stretch)), all.1.min(1.0 / frobenius(&back)));
        }
        all
    }
}

impl Pose {
    /// `None` for a map that is singular or not finite.
    fn of(map: &Affine) -> Option<Self> {
        // Asks for what is singular, relative to the rows' own sizes.
        map.inverse_f64()?;
        let m = map.0.map(|[a, b, c, _]| [f64::from(a), f64::from(b), f64::from(c)]);
        let sign = if map.is_mirroring() { -1.0 } else { 1.0 };
        let turn = rotation(m.map(|row| row.map(|x| sign * x)))?;
        // `S = R^T M`, symmetric but for rounding.
        let s = product(&transposed(&turn), &m);
        let stretch = [0, 1, 2].map(|i: usize| [0, 1, 2].map(|j: usize| 0.5 * (s[i][j] + s[j][i])));
        let translation = map.0.map(|row| f64::from(row[3]));
        Some(Self { translation, turn: quaternion(&turn), stretch })
    }
}

/// The rotation nearest to a map that does not mirror: the mean of the map and its inverse transposed, again and
/// again, each scaled to the size of the other.
fn rotation(mut m: Linear) -> Option<Linear> {
    /// Quadratic convergence from any scale that f32 maps have: about 10 are needed.
    const ROUNDS: usize = 64;
    const CLOSE: f64 = 4e-15;
    for _ in 0..ROUNDS {
        let back = transposed(&inverse(&m)?);
        let scale = libm::sqrt(frobenius(&back) / frobenius(&m));
        let mut change = 0.0_f64;
        for i in 0..3 {
            for j in 0..3 {
                let new = 0.5 * (scale * m[i][j] + back[i][j] / scale);
                change = change.max((new - m[i][j]).abs());
                m[i][j] = new;
            }
        }
        if change <= CLOSE {
            break;
        }
    }
    m.iter().flatten().all(|x| x.is_finite()).then_some(m)
}

/// The unit quaternion of a rotation: from the largest of its four components, so that none is a difference of
/// near numbers.
fn quaternion(r: &Linear) -> [f64; 4] {
    let (x, y, z) = (r[0][0], r[1][1], r[2][2]);
    let squares = [1.0 + x + y + z, 1.0 + x - y - z, 1.0 - x + y - z, 1.0 - x - y + z];
    let largest = (1..4).fold(0, |best, at| if squares[at] > squares[best] { at } else { best });
    let (wx, wy, wz) = (r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]);
    let (xy, xz, yz) = (r[0][1] + r[1][0], r[0][2] + r[2][0], r[1][2] + r[2][1]);
    let q = match largest {
        0 => [squares[0], wx, wy, wz],
        1 => [wx, squares[1], xy, xz],
        2 => [wy, xy, squares[2], yz],
        _ => [wz, xz, yz, squares[3]],
    };
    let length = libm::sqrt(dot(q, q));
    q.map(|x| x / length)
}

/// The rotation of a unit quaternion.
fn linear([w, x, y, z]: [f64; 4]) -> Linear {
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// The angle between two quaternions of one hemisphere.
fn half_angle(a: [f64; 4], b: [f64; 4]) -> f64 {
    libm::acos(dot(a, b).clamp(0.0, 1.0))
}

/// The quaternion between two, at constant speed.
fn arc(a: [f64; 4], b: [f64; 4], along: f64) -> [f64; 4] {
    /// Below this angle the chord is the arc to 1e-13 of it.
    const STRAIGHT: f64 = 1e-6;
    let angle = half_angle(a, b);
    let (of_a, of_b) = if angle < STRAIGHT {
        (1.0 - along, along)
    } else {
        (libm::sin((1.0 - along) * angle), libm::sin(along * angle))
    };
    let q = [0, 1, 2, 3].map(|i: usize| of_a * a[i] + of_b * b[i]);
    let length = libm::sqrt(dot(q, q));
    q.map(|x| x / length)
}

fn dot(a: [f64; 4], b: [f64; 4]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
}

fn transposed(m: &Linear) -> Linear {
    [0, 1, 2].map(|i: usize| [m[0][i], m[1][i], m[2][i]])
}

fn product(a: &Linear, b: &Linear) -> Linear {
    let entry = |i: usize, j: usize| a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
    [0, 1, 2].map(|i: usize| [entry(i, 0), entry(i, 1), entry(i, 2)])
}

fn frobenius(m: &Linear) -> f64 {
    libm::sqrt(m.iter().flatten().map(|x| x * x).sum())
}

/// By Cramer's rule; `None` if it is not finite.
fn inverse(m: &Linear) -> Option<Linear> {
    let map = invert(&m.map(|[a, b, c]| [a, b, c, 0.0]))?;
    Some(map.map(|[a, b, c, _]| [a, b, c]))
}

/// The map back, by Cramer's rule; `None` if it is not finite.
pub(crate) fn invert(m: &Rows) -> Option<Rows> {
    let minor =
        |r0: usize, r1: usize, c0: usize, c1: usize| m[r0][c0] * m[r1][c1] - m[r0][c1] * m[r1][c0];
    let cofactor = [
        [minor(1, 2, 1, 2), minor(1, 2, 2, 0), minor(1, 2, 0, 1)],
        [minor(2, 0, 1, 2), minor(2, 0, 2, 0), minor(2, 0, 0, 1)],
        [minor(0, 1, 1, 2), minor(0, 1, 2, 0), minor(0, 1, 0, 1)],
    ];
    let det = m[0][0] * cofactor[0][0] + m[0][1] * cofactor[0][1] + m[0][2] * cofactor[0][2];
    let row = |row: usize| {
        let [a, b, c] = [0, 1, 2].map(|column: usize| cofactor[column][row] / det);
        [a, b, c, -(a * m[0][3] + b * m[1][3] + c * m[2][3])]
    };
    let rows = [row(0), row(1), row(2)];
    rows.iter().flatten().all(|entry| entry.is_finite()).then_some(rows)
}

#[cfg(test)]
mod tests {
    use super::{Moment, Path, PathDefect, invert};
    use crate::math::Affine;

    fn place(time: f32, steps: usize) -> (usize, usize, f32) {
        let Moment { step, next, along, .. } = Moment::new(time, steps);
        (step, next, along)
    }

    #[test]
    fn moments_are_clamped_and_exact_at_steps() {
        assert_eq!(place(-3.0, 5), (0, 1, 0.0));
        assert_eq!(place(0.25, 5), (1, 2, 0.0));
        assert_eq!(place(0.3125, 5), (1, 2, 0.25));
        assert_eq!(place(1.0, 5), (4, 4, 0.0));
        assert_eq!(place(f32::INFINITY, 2), (1, 1, 0.0));
        assert_eq!(place(0.7, 1), (0, 0, 0.0));
    }

    #[test]
    fn a_turning_object_keeps_its_size_and_its_speed() {
        let stretch = Affine::scaling([2.0, -0.5, 3.0]);
        let turned = |angle: f32| {
            Affine::translation([angle, 0.0, 1.0])
                .then_from(&Affine::rotation([1.0, 2.0, -0.5], angle))
                .then_from(&stretch)
        };
        let path = Path::new(&[turned(0.2), turned(2.2)]).unwrap();
        assert!((path.angle(0) - 2.0).abs() < 1e-6, "{}", path.angle(0));
        for along in [0.0, 0.25, 0.5, 0.875] {
            let map = path.at(Moment::at(along, 2));
            let expected = turned(0.2 + 2.0 * along);
            for (row, expected) in map.iter().zip(&expected.0) {
                for (a, b) in row.iter().zip(expected) {
                    assert!((a - f64::from(*b)).abs() < 1e-6, "{along}: {map:?} {expected:?}");
                }
            }
            let back = invert(&map).unwrap();
            assert!(back.iter().flatten().all(|x| x.is_finite()));
        }
        // Half of `-0.5` mirrors, and so must all steps.
        assert_eq!(
            Path::new(&[turned(0.0), Affine::IDENTITY]).unwrap_err(),
            PathDefect::Mirrored(1)
        );
        let flat = Affine::scaling([1.0, 0.0, 1.0]);
        assert_eq!(Path::new(&[Affine::IDENTITY, flat]).unwrap_err(), PathDefect::Singular(1));
    }

    #[test]
    fn stretches_bound_what_happens_between() {
        let a =
            Affine::rotation([0.0, 1.0, 0.3], 0.4).then_from(&Affine::scaling([1e-3, 1.0, 40.0]));
        let b =
            Affine::scaling([2.0, 1e-2, 0.5]).then_from(&Affine::rotation([1.0, 0.0, 0.0], 2.9));
        let path = Path::new(&[a, b]).unwrap();
        let (most, least) = path.stretches();
        for i in 0..64 {
            let map = path.at(Moment::at(i as f32 / 64.0, 2));
            let back = invert(&map).unwrap();
            for row in map {
                assert!(row[..3].iter().map(|x| x * x).sum::<f64>() <= most * most * 1.000_001);
            }
            for row in back {
                let length = row[..3].iter().map(|x| x * x).sum::<f64>();
                assert!(length * least * least <= 1.000_001, "{length} {least}");
            }
        }
    }
}
