//! Which tree is best for how many rays: lines of total time, their lower envelope, its corners.
//!
//! A variant that builds in B seconds and traces R rays a second has spent `B + n / R` seconds after n
//! rays, a line over n, and answered `n / (B + n / R)` rays a second, its build included: the effective
//! speed of T. Karras, T. Aila, "Fast Parallel Construction of High-Quality Bounding Volume
//! Hierarchies", High-Performance Graphics 2013. The lowest line wins. All crossings are exact.

use std::ops::Range;

/// The numbers of rays that are looked at: the paper's axis, and what treelet's users are below it.
pub const RAYS: Range<f64> = 1e4..1e12;

/// Places on the axis a decade.
const PLACES: u32 = 8;

/// A variant's line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Curve {
    /// Seconds before the first ray.
    pub build_s: f64,
    /// Rays a second after that.
    pub rays_per_s: f64,
}

/// Numbers of rays for which one line is the lowest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Whose, by its place in the list.
    pub curve: usize,
    /// From so many rays,
    pub from: f64,
    /// to so many.
    pub to: f64,
}

/// How one envelope compares with another where it does worst.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lead {
    /// The other's time over the first's: above 1, the first is ahead everywhere.
    pub factor: f64,
    /// At so many rays.
    pub rays: f64,
}

/// Numbers of rays for drawing and for tables: several a decade over [`RAYS`], ends included.
pub fn axis() -> Vec<f64> {
    let decades = (RAYS.end / RAYS.start).log10().round();
    let steps = decades as u32 * PLACES;
    (0..=steps).map(|step| RAYS.start * 10f64.powf(f64::from(step) / f64::from(PLACES))).collect()
}

impl Curve {
    /// Seconds for the build and `rays` rays.
    pub fn total(&self, rays: f64) -> f64 {
        self.build_s + rays / self.rays_per_s
    }

    /// Rays a second, the build included.
    pub fn effective(&self, rays: f64) -> f64 {
        rays / self.total(rays)
    }

    /// How many rays it takes until `slower`, which is built sooner, has spent as much time; `None` if
    /// that is never, or was before the first ray.
    pub fn overtakes(&self, slower: &Self) -> Option<f64> {
        let gained = 1.0 / slower.rays_per_s - 1.0 / self.rays_per_s;
        let rays = (self.build_s - slower.build_s) / gained;
        (gained > 0.0 && rays >= 0.0).then_some(rays)
    }
}

/// Who wins where within `within`, in the order of the rays: the lower envelope of the lines. Of equal
/// lines, the first in the list. None where there is no curve.
pub fn winners(curves: &[Curve], within: &Range<f64>) -> Vec<Interval> {
    let mut intervals: Vec<Interval> = Vec::new();
    let mut from = within.start;
    let Some(mut best) = lowest(curves, from) else { return intervals };
    while from < within.end {
        // Find the line that overtakes the best one first; of several at once, the fastest.
        let overtaking = (0..curves.len()).filter_map(|other| {
            let at = curves[other].overtakes(&curves[best])?.max(from);
            Some((at, -curves[other].rays_per_s, other))
        });
        let by_place = |a: &(f64, f64, usize), b: &(f64, f64, usize)| {
            a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2))
        };
        let next = overtaking.min_by(by_place).filter(|next| next.0 < within.end);
        let to = next.map_or(within.end, |next| next.0);
        if to > from {
            intervals.push(Interval { curve: best, from, to });
        }
        (from, best) = (to, next.map_or(best, |next| next.2));
    }
    intervals
}

/// The lowest line at so many rays; of equal ones the fastest, then the first.
fn lowest(curves: &[Curve], rays: f64) -> Option<usize> {
    let key = |index: &usize| (curves[*index].total(rays), -curves[*index].rays_per_s);
    (0..curves.len()).min_by(|a, b| {
        let (a, b) = (key(a), key(b));
        a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))
    })
}

/// Which curve takes the least time for so many rays, and how long; `None` where there is none.
pub fn best_at(curves: &[Curve], rays: f64) -> Option<(usize, f64)> {
    lowest(curves, rays).map(|index| (index, curves[index].total(rays)))
}

/// Where `curve` wins among all of `curves`; `None` if it does nowhere.
pub fn window(curves: &[Curve], curve: usize, within: &Range<f64>) -> Option<Range<f64>> {
    let of = |interval: &Interval| interval.curve == curve;
    // A line is on the envelope once at most: the envelope is concave.
    winners(curves, within).into_iter().find(of).map(|interval| interval.from..interval.to)
}

/// Where the best of `ours` does worst against the best of `theirs`; `None` where one has no curve.
pub fn lead(ours: &[Curve], theirs: &[Curve], within: &Range<f64>) -> Option<Lead> {
    // Between the corners of both envelopes each is one line, and a quotient of two lines rises or
    // falls throughout: its least value is at a corner or at an end.
    let corners = winners(ours, within).into_iter().chain(winners(theirs, within));
    let places = corners.flat_map(|interval| [interval.from, interval.to]);
    let mut worst: Option<Lead> = None;
    for rays in places {
        let factor = best_at(theirs, rays)?.1 / best_at(ours, rays)?.1;
        if worst.is_none_or(|worst| factor < worst.factor) {
            worst = Some(Lead { factor, rays });
        }
    }
    worst
}

/// Numbers of rays by name: `7.0 M`.
pub fn rays_name(rays: f64) -> String {
    let units = [(1e12, " T"), (1e9, " G"), (1e6, " M"), (1e3, " k")];
    let (unit, name) = units.into_iter().find(|(unit, _)| rays >= *unit).unwrap_or((1.0, ""));
    let number = rays / unit;
    if number < 9.95 { format!("{number:.1}{name}") } else { format!("{number:.0}{name}") }
}

#[cfg(test)]
mod tests {
    use super::{Curve, Interval, RAYS, Range, axis, best_at, lead, rays_name, window, winners};

    fn curve(build_s: f64, rays_per_s: f64) -> Curve {
        Curve { build_s, rays_per_s }
    }

    /// Quick, usual, slow, and one that never wins: crossings at 2e6 and 2.8e7 rays by hand.
    fn curves() -> [Curve; 4] {
        [curve(9.0, 4e6), curve(1.0, 1e6), curve(5.5, 1.5e6), curve(2.0, 2e6)]
    }

    #[test]
    fn effective_speed_counts_the_build() {
        assert_eq!(curve(1.0, 1e6).effective(3e6), 750_000.0);
        let axis = axis();
        assert_eq!((axis.len(), axis[0]), (65, 1e4));
        assert!((axis[64] / 1e12 - 1.0).abs() < 1e-12 && axis[32] == 1e8);
    }

    #[test]
    fn winners_meet_where_their_totals_are_equal() {
        let expected = [(1, 1e4, 2e6), (3, 2e6, 2.8e7), (0, 2.8e7, 1e12)];
        let expected = expected.map(|(curve, from, to)| Interval { curve, from, to });
        let found = winners(&curves(), &RAYS);
        assert_eq!(found.len(), 3, "{found:?}");
        for (found, expected) in found.iter().zip(expected) {
            assert_eq!(found.curve, expected.curve);
            let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-9;
            assert!(near(found.from, expected.from) && near(found.to, expected.to), "{found:?}");
        }
        let at = |rays| best_at(&curves(), rays).unwrap().0;
        for interval in found {
            assert_eq!(at(interval.from * 1.001), interval.curve);
            assert_eq!(at(interval.to * 0.999), interval.curve);
        }
    }

    /// Against the plain definition, on lines from a fixed sequence.
    #[test]
    fn winners_are_the_lowest_everywhere() {
        let mut state = 1_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f64 / f64::from(1 << 24)
        };
        for _ in 0..200 {
            let curves: Vec<_> = (0..12)
                .map(|_| curve(10f64.powf(3.0 * next() - 2.0), 10f64.powf(5.0 + 2.0 * next())))
                .collect();
            let found = winners(&curves, &RAYS);
            assert_eq!((found[0].from, found.last().unwrap().to), (RAYS.start, RAYS.end));
            assert!(found.windows(2).all(|pair| pair[0].to == pair[1].from));
            for interval in &found {
                for share in [0.0, 0.3, 0.7, 1.0] {
                    let rays = interval.from + share * (interval.to - interval.from);
                    let lowest = curves.iter().map(|c| c.total(rays)).fold(f64::MAX, f64::min);
                    let total = curves[interval.curve].total(rays);
                    assert!(total <= lowest * (1.0 + 1e-9), "{rays}: {total} {lowest}");
                }
            }
        }
    }

    #[test]
    fn equal_lines_and_nothing_at_all() {
        let twice = [curve(1.0, 1e6); 2];
        assert_eq!(winners(&twice, &RAYS), [Interval { curve: 0, from: 1e4, to: 1e12 }]);
        assert_eq!(winners(&[], &RAYS), []);
        assert_eq!(lead(&[], &twice, &RAYS), None);
        assert_eq!(lead(&twice, &[], &RAYS), None);
        // Same build: the faster one wins from the start.
        let same_build = [curve(1.0, 1e6), curve(1.0, 2e6)];
        assert_eq!(winners(&same_build, &RAYS)[0].curve, 1);
        let free = [curve(0.0, 1e6), curve(0.0, 2e6)];
        assert_eq!(winners(&free, &(0.0..1e6)), [Interval { curve: 1, from: 0.0, to: 1e6 }]);
    }

    #[test]
    fn windows_are_intervals_of_one_curve() {
        let Range { start, end } = window(&curves(), 3, &RAYS).unwrap();
        assert!((start - 2e6).abs() < 1.0 && (end - 2.8e7).abs() < 10.0, "{start} {end}");
        assert_eq!(window(&curves(), 2, &RAYS), None);
    }

    #[test]
    fn the_worst_place_is_at_a_corner_or_an_end() {
        // Twice as fast in everything: 2 everywhere.
        let half = curves().map(|c| curve(2.0 * c.build_s, 0.5 * c.rays_per_s));
        let found = lead(&curves(), &half, &RAYS).unwrap();
        assert!((found.factor - 2.0).abs() < 1e-12, "{found:?}");
        // Slower to build, faster to trace: worst at the left end.
        let found = lead(&[curve(2.0, 2e6)], &[curve(1.0, 1e6)], &RAYS).unwrap();
        assert_eq!(found.rays, 1e4);
        assert!((found.factor - 1.01 / 2.005).abs() < 1e-12, "{found:?}");
        // Quicker to build, slower to trace: worst at the right end.
        let found = lead(&[curve(1.0, 1e6)], &[curve(2.0, 2e6)], &RAYS).unwrap();
        assert!(found.rays == 1e12 && (found.factor - 0.5).abs() < 1e-5, "{found:?}");
        // Ahead at both ends, behind where its two lines cross.
        let ours = [curve(1.0, 1e6), curve(11.0, 1e8)];
        let found = lead(&ours, &[curve(1.5, 4e6)], &RAYS).unwrap();
        let crossing = 10.0 / (1e-6 - 1e-8);
        assert!((found.rays / crossing - 1.0).abs() < 1e-9 && found.factor < 1.0, "{found:?}");
    }

    #[test]
    fn numbers_of_rays_have_short_names() {
        let names = [999.0, 1e4, 7.2e6, 6e10, 1e12].map(rays_name);
        assert_eq!(names, ["999", "10 k", "7.2 M", "60 G", "1.0 T"]);
    }
}
