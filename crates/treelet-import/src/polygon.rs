//! Polygons to triangles, by ear clipping.
//!
//! Meisters, "Polygons have ears", American Mathematical Monthly 82(6), 1975. The polygon is looked
//! at along the axis closest to its normal (Newell's method), which changes no coordinate and so
//! rounds nothing; orientations are taken in f64. Strictly convex polygons become fans at once.
//! Other polygons lose ear after ear; what a corner may not contain are the reflex corners only.
//! Where a polygon crosses itself or has no area there may be no ear: a flat corner goes first, then
//! a convex one, then any. Whatever comes in, `n` corners give `n - 2` triangles.
//!
//! Cost: linear for convex polygons, corners times reflex corners otherwise. A crafted file could
//! make that hours, so the tests of one file are counted and end in an error; this is also why
//! a library for it did not fit.

use treelet::context::Cancel;
use treelet::math::vec3;

use crate::error::Fault;

/// So many point tests are done for a file before it is refused: 10 to 30 s of work. A comb or a
/// star of 50,000 corners stays within them, one of 100,000 does not.
const TESTS_MAX: u64 = 1 << 31;

/// Splits polygons, one after another, with the same memory.
#[derive(Debug)]
pub(crate) struct Splitter {
    cancel: Cancel,
    tests_left: u64,
    points: Vec<[f64; 2]>,
    next: Vec<u32>,
    previous: Vec<u32>,
    is_reflex: Vec<bool>,
    reflex: Vec<u32>,
    /// About how many of `reflex` are reflex no more.
    stale: usize,
    triangles: Vec<[u32; 3]>,
}

impl Splitter {
    pub(crate) fn new(cancel: &Cancel) -> Self {
        Self {
            cancel: cancel.clone(),
            tests_left: TESTS_MAX,
            points: Vec::new(),
            next: Vec::new(),
            previous: Vec::new(),
            is_reflex: Vec::new(),
            reflex: Vec::new(),
            stale: 0,
            triangles: Vec::new(),
        }
    }

    /// The triangles of a polygon, as indices into `corners`: two fewer than it has corners.
    ///
    /// Fails if the file's polygons take too long or the caller's flag is raised.
    pub(crate) fn split(&mut self, corners: &[[f32; 3]]) -> Result<&[[u32; 3]], Fault> {
        self.triangles.clear();
        if corners.len() < 3 {
            return Ok(&self.triangles);
        }
        if corners.len() == 3 || !self.project(corners) || self.is_strictly_convex() {
            let corners = corners.len() as u32;
            self.triangles.extend((2..corners).map(|i| [0, i - 1, i]));
        } else {
            self.clip_ears()?;
        }
        Ok(&self.triangles)
    }

    /// Lays the polygon into a plane, counter-clockwise. `false` if it has no normal.
    fn project(&mut self, corners: &[[f32; 3]]) -> bool {
        let normal = newell_normal(corners);
        let size = normal.map(f64::abs);
        let axis = (0..3).fold(0, |best, axis| if size[axis] > size[best] { axis } else { best });
        if !normal.iter().all(|x| x.is_finite()) || size[axis] == 0.0 {
            return false;
        }
        let (mut u, mut v) = ((axis + 1) % 3, (axis + 2) % 3);
        if normal[axis] < 0.0 {
            (u, v) = (v, u);
        }
        self.points.clear();
        self.points.extend(corners.iter().map(|p| [f64::from(p[u]), f64::from(p[v])]));
        true
    }

    /// Whether each corner turns left and the whole turns once.
    fn is_strictly_convex(&self) -> bool {
        let n = self.points.len();
        let at = |i: usize| self.points[i % n];
        let turns_left = (0..n).all(|i| turn(at(i), at(i + 1), at(i + 2)) > 0.0);
        // Going round once, x changes its direction twice; a star changes it more often.
        let rises = |i: usize| {
            at(i + 1)[0] > at(i)[0] || at(i + 1)[0] == at(i)[0] && at(i + 1)[1] > at(i)[1]
        };
        let reversals = (0..n).filter(|&i| rises(i) != rises(i + 1)).count();
        turns_left && reversals <= 2
    }

    /// Cuts corners off until a triangle is left.
    fn clip_ears(&mut self) -> Result<(), Fault> {
        let n = self.points.len();
        self.next.clear();
        self.previous.clear();
        self.next.extend((0..n).map(|i| ((i + 1) % n) as u32));
        self.previous.extend((0..n).map(|i| ((i + n - 1) % n) as u32));
        self.is_reflex.clear();
        self.is_reflex.extend((0..n).map(|_| false));
        for i in 0..n {
            self.is_reflex[i] = self.turn_at(i) <= 0.0;
        }
        self.reflex.clear();
        self.stale = 0;
        self.reflex.extend((0..n as u32).filter(|&i| self.is_reflex[i as usize]));

        let (mut at, mut left, mut refused) = (0, n, 0);
        while left > 3 {
            // Find an ear; after a round without one, settle for less.
            if refused < left && !self.is_ear(at)? {
                refused += 1;
                at = self.next[at] as usize;
                continue;
            }
            if refused >= left {
                at = self.least_bad(at, left);
            }
            // Cut it off, and look at its neighbours anew.
            let (before, after) = (self.previous[at] as usize, self.next[at] as usize);
            self.triangles.push([before as u32, at as u32, after as u32]);
            self.next[before] = after as u32;
            self.previous[after] = before as u32;
            self.stale += usize::from(self.is_reflex[at]);
            self.is_reflex[at] = false;
            for corner in [before, after] {
                // A reflex corner may become convex; in a crossing polygon also the reverse, and
                // then it may be listed twice, which does no harm.
                let was = self.is_reflex[corner];
                let is = self.turn_at(corner) <= 0.0;
                self.is_reflex[corner] = is;
                if is && !was {
                    self.reflex.push(corner as u32);
                }
                self.stale += usize::from(was && !is);
            }
            (left, refused) = (left - 1, 0);
            // Leave out the next corner, so that ears do not become a fan of slivers.
            at = self.next[after] as usize;
        }
        self.triangles.push([self.previous[at], at as u32, self.next[at]]);
        Ok(())
    }

    /// Whether a corner is convex and free of reflex corners.
    fn is_ear(&mut self, at: usize) -> Result<bool, Fault> {
        self.cancel.check()?;
        if self.is_reflex[at] {
            self.count_tests(1)?;
            return Ok(false);
        }
        // Forget corners that are reflex no more, once they are the greater part.
        if self.stale * 2 > self.reflex.len() {
            let is_reflex = &self.is_reflex;
            self.reflex.retain(|&i| is_reflex[i as usize]);
            self.stale = 0;
        }
        let (before, after) = (self.previous[at] as usize, self.next[at] as usize);
        let [a, b, c] = [before, at, after].map(|i| self.points[i]);
        let blocked = self.reflex.iter().position(|&i| {
            let p = self.points[i as usize];
            let is_corner = p == a || p == b || p == c;
            self.is_reflex[i as usize]
                && !is_corner
                && turn(a, b, p) >= 0.0
                && turn(b, c, p) >= 0.0
                && turn(c, a, p) >= 0.0
        });
        self.count_tests(blocked.unwrap_or(self.reflex.len()) as u64 + 1)?;
        Ok(blocked.is_none())
    }

    fn count_tests(&mut self, tests: u64) -> Result<(), Fault> {
        let Some(tests_left) = self.tests_left.checked_sub(tests) else {
            let found =
                format!("a polygon of {} corners takes too long to split", self.points.len());
            return Err(Fault::broken(found, "triangulate the mesh before you export it"));
        };
        self.tests_left = tests_left;
        Ok(())
    }

    /// What to cut off a polygon without ears: a corner without area, else a convex one, else any.
    fn least_bad(&self, start: usize, left: usize) -> usize {
        let mut convex = None;
        let mut at = start;
        for _ in 0..left {
            let turn = self.turn_at(at);
            if turn == 0.0 {
                return at;
            }
            if turn > 0.0 && convex.is_none() {
                convex = Some(at);
            }
            at = self.next[at] as usize;
        }
        convex.unwrap_or(start)
    }

    fn turn_at(&self, at: usize) -> f64 {
        let point = |i: u32| self.points[i as usize];
        turn(point(self.previous[at]), self.points[at], point(self.next[at]))
    }
}

/// Twice the signed area of a triangle: above zero for a turn to the left.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Twice the area vector of a polygon, taken from its first corner so that distance from the
/// origin costs no digits.
fn newell_normal(corners: &[[f32; 3]]) -> [f64; 3] {
    let origin = corners[0].map(f64::from);
    let relative = |p: [f32; 3]| core::array::from_fn(|k| f64::from(p[k]) - origin[k]);
    let mut normal = [0.0; 3];
    for pair in corners.windows(2) {
        let (p, q): ([f64; 3], [f64; 3]) = (relative(pair[0]), relative(pair[1]));
        for k in 0..3 {
            let (u, v) = ((k + 1) % 3, (k + 2) % 3);
            normal[k] += p[u] * q[v] - p[v] * q[u];
        }
    }
    normal
}

/// Whether a quad may be split along the diagonal from corner 0 to corner 2, as most are.
///
/// Both halves must point the same way; decided in f32, and strictly, so that doubtful quads take
/// the long way.
#[inline]
pub(crate) fn quad_splits_at_0(q: [[f32; 3]; 4]) -> bool {
    let diagonal = vec3::sub(q[2], q[0]);
    let one = vec3::cross(vec3::sub(q[1], q[0]), diagonal);
    let other = vec3::cross(diagonal, vec3::sub(q[3], q[0]));
    vec3::dot(one, other) > 0.0
}

#[cfg(test)]
mod tests {
    use super::Splitter;
    use treelet::context::Cancel;

    fn splitter() -> Splitter {
        Splitter::new(&Cancel::new())
    }

    /// The area of the triangles, and that of the polygon, both signed, in the xy plane.
    fn areas(corners: &[[f32; 3]], triangles: &[[u32; 3]]) -> (f64, f64, f64) {
        let area = |a: [f32; 3], b: [f32; 3], c: [f32; 3]| {
            let [a, b, c] = [a, b, c].map(|p| p.map(f64::from));
            0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
        };
        let each = triangles.iter().map(|t| {
            let [a, b, c] = t.map(|i| corners[i as usize]);
            area(a, b, c)
        });
        let (mut sum, mut absolute) = (0.0, 0.0);
        each.for_each(|a| (sum, absolute) = (sum + a, absolute + a.abs()));
        let whole = (2..corners.len()).map(|i| area(corners[0], corners[i - 1], corners[i])).sum();
        (sum, absolute, whole)
    }

    fn check(corners: &[[f32; 3]]) {
        let mut splitter = splitter();
        let triangles = splitter.split(corners).unwrap();
        assert_eq!(triangles.len(), corners.len() - 2, "{corners:?}");
        let (sum, absolute, whole) = areas(corners, triangles);
        // Same area, and nothing counted twice: no triangle is turned over.
        assert!((sum - whole).abs() <= 1e-6 * absolute, "{corners:?} {triangles:?}");
        assert!((sum.abs() - absolute).abs() <= 1e-6 * absolute, "{corners:?} {triangles:?}");
    }

    #[test]
    fn concave_polygons_keep_their_area() {
        let arrow = [[0.0, 0.0, 0.0], [4.0, 2.0, 0.0], [0.0, 4.0, 0.0], [1.0, 2.0, 0.0]];
        for start in 0..4 {
            let mut turned = arrow;
            turned.rotate_left(start);
            check(&turned);
            turned.reverse();
            check(&turned);
        }
        // A comb, and a square with a collinear corner on each edge.
        let mut comb = vec![[0.0, 0.0, 0.0]];
        for tooth in 0..40 {
            let x = tooth as f32;
            comb.extend([[x + 0.5, -9.0, 0.0], [x + 1.0, 0.0, 0.0]]);
        }
        comb.extend([[40.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
        check(&comb);
        let side = [[0, 0], [1, 0], [2, 0], [2, 1], [2, 2], [1, 2], [0, 2], [0, 1]];
        let square = side.map(|[x, y]| [x as f32, y as f32, 0.0]);
        check(&square);
        let mut splitter = splitter();
        let flat = splitter.split(&square).unwrap().iter().filter(|t| {
            let (sum, ..) = areas(&square, &[**t]);
            sum == 0.0
        });
        assert_eq!(flat.count(), 0, "no triangle needs to be flat");
    }

    #[test]
    fn random_star_shapes_keep_their_area() {
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f32 / (1 << 24) as f32
        };
        for n in 3..200 {
            let corners: Vec<_> = (0..n)
                .map(|i| {
                    let angle = i as f32 / n as f32 * core::f32::consts::TAU;
                    let radius = 0.1 + random();
                    [radius * libm::cosf(angle), radius * libm::sinf(angle), 0.0]
                })
                .collect();
            check(&corners);
        }
    }

    #[test]
    fn senseless_polygons_still_give_triangles() {
        let nan = [f32::NAN; 3];
        let star: Vec<_> = (0..5)
            .map(|i| (i * 2) as f32 * 1.2566)
            .map(|a| [libm::cosf(a), libm::sinf(a), 0.0])
            .collect();
        let line: Vec<_> = (0..9).map(|i| [i as f32, 0.0, 0.0]).collect();
        let bow =
            vec![[0.0; 3], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.5, 3.0, 0.0]];
        let huge = vec![[f32::MAX; 3], [-f32::MAX, 0.0, 0.0], [0.0, f32::MAX, 0.0], [1.0; 3]];
        for corners in [vec![[1.0; 3]; 7], vec![nan; 5], star, line, bow, huge] {
            let count = splitter().split(&corners).unwrap().len();
            assert_eq!(count, corners.len() - 2, "{corners:?}");
        }
        let mut one_nan = vec![[0.0; 3], [1.0, 0.0, 0.0], nan, [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(splitter().split(&one_nan).unwrap().len(), 3);
        one_nan.truncate(2);
        assert!(splitter().split(&one_nan).is_ok_and(<[_]>::is_empty));
    }

    #[test]
    fn work_is_bounded() {
        let mut splitter = splitter();
        splitter.tests_left = 10;
        let zigzag: Vec<_> = (0..50).map(|i| [i as f32, (i * i % 7) as f32, 0.0]).collect();
        let error = splitter.split(&zigzag).unwrap_err().to_string();
        assert!(error.starts_with("a polygon of 50 corners takes too long"), "{error}");

        let cancel = Cancel::new();
        let mut splitter = Splitter::new(&cancel);
        assert!(splitter.split(&zigzag).is_ok());
        cancel.cancel();
        assert_eq!(splitter.split(&zigzag).unwrap_err().to_string(), "reading was cancelled");
    }
}
