//! Which rays go together: seen from a few of a run, then of each of them, 16 at a time.
//!
//! A ray joins the first of a few leaders whose class it has, and whose slopes against the longest
//! axis are near its own; a ray that finds none leads the next bundle.

use super::super::record::{Class, RAYS};
use super::group::GROUP;
use crate::math::{Ray, ray};
use crate::memory::{OutOfMemory, try_with_capacity};
use crate::simd::{Floats, RayColumns, Simd};
use alloc::vec::Vec;

/// Slopes that differ by at most this are near.
const NEAR: f32 = 0.08;

/// Bundles of a run, at most: lights, say, or octants that meet.
pub(super) const LEADERS: usize = 8;

/// Smaller bundles gain nothing from packets.
const SMALL: usize = 8;

/// Rays looked at of a run.
const SAMPLES: usize = 16;

/// 16 rows of rays.
pub(super) const ROWS: usize = GROUP / RAYS;

/// The direction of a ray: its class, and its slopes.
#[derive(Clone, Copy)]
struct Bearing {
    class: Class,
    slopes: [f32; 2],
}

impl Bearing {
    /// Of a valid ray.
    #[inline(always)]
    fn of(ray: &Ray) -> Self {
        let class = Class::of(ray);
        let [x, y, z] = class.axes().map(|axis| ray.direction[usize::from(axis.min(2))]);
        let along = 1.0 / z;
        Self { class, slopes: [x * along, y * along] }
    }

    #[inline(always)]
    fn is_near(&self, other: &Self) -> bool {
        let [x, y] = [self.slopes[0] - other.slopes[0], self.slopes[1] - other.slopes[1]];
        self.class == other.class && x.abs() <= NEAR && y.abs() <= NEAR
    }
}

/// Whether the rays of a run seem to go together: few directions, and starts that are mostly nearer
/// to each other than `near`.
#[inline(always)]
pub(super) fn seem_coherent(rays: &[Ray], near: f32, bundles: usize) -> bool {
    let step = (rays.len() / SAMPLES).max(1);
    let mut leaders: [Option<Bearing>; LEADERS] = [None; LEADERS];
    let leaders = &mut leaders[..bundles.min(LEADERS)];
    let mut last: Option<&Ray> = None;
    let (mut far, mut seen) = (0, 0);
    for ray in rays.iter().step_by(step).filter(|ray| ray.is_valid()) {
        seen += 1;
        let bearing = Bearing::of(ray);
        let mut met = false;
        for leader in &mut *leaders {
            met = leader.get_or_insert(bearing).is_near(&bearing);
            if met {
                break;
            }
        }
        if !met {
            return false;
        }
        if let Some(last) = last {
            let apart = |axis: usize| (ray.origin[axis] - last.origin[axis]).abs() > near;
            far += usize::from(apart(0) || apart(1) || apart(2));
        }
        last = Some(ray);
    }
    seen > 4 && far * 4 <= seen
}

/// The bearings of 16 rays.
#[derive(Clone, Copy)]
struct Bearings {
    class: [f32; RAYS],
    slopes: [[f32; RAYS]; 2],
}

/// 16 rays side by side, and their bearings.
#[derive(Clone, Copy)]
pub(super) struct Row {
    pub(super) rays: RayColumns,
    bearings: Bearings,
}

impl Row {
    const EMPTY: Self = Self {
        rays: [[0.0; RAYS]; 8],
        bearings: Bearings { class: [0.0; RAYS], slopes: [[0.0; RAYS]; 2] },
    };
}

/// The places of a run's rays, sorted into bundles. Kept from run to run: clearing it would take
/// longer than some of the sorting.
pub(super) struct Bundles {
    /// [`ROWS`] once a run was sorted.
    rows: Vec<Row>,
    places: [u32; GROUP + RAYS],
    /// Where bundles begin and end.
    bundles: [(u32, u32); LEADERS],
    pub(super) len: usize,
    /// Rays in bundles.
    pub(super) bundled: usize,
    /// The valid rays that are in none.
    rest: [u32; ROWS],
}

impl Bundles {
    /// Room for a run.
    pub(super) fn new() -> Result<Self, OutOfMemory> {
        Ok(Self {
            rows: try_with_capacity(ROWS, "rays side by side")?,
            places: [0; GROUP + RAYS],
            bundles: [(0, 0); LEADERS],
            len: 0,
            bundled: 0,
            rest: [0; ROWS],
        })
    }

    /// Sorts the rays of a run, [`GROUP`] at most.
    #[inline(always)]
    pub(super) fn sort<S: Simd>(&mut self, simd: S, rays: &[Ray]) {
        (self.len, self.bundled, self.rest) = (0, 0, [0; ROWS]);
        self.rows.resize(ROWS, Row::EMPTY);
        for ((rays, row), rest) in rays.chunks(RAYS).zip(&mut self.rows).zip(&mut self.rest) {
            *rest = look(simd, rays, row);
        }
        let rows = rays.len().div_ceil(RAYS).min(ROWS);
        let mut tried = [0_u32; ROWS];
        let mut row = 0;
        while self.len < LEADERS {
            // The first ray that is in no bundle leads the next.
            while row < rows && self.rest[row] & !tried[row] == 0 {
                row += 1;
            }
            if row == rows {
                break;
            }
            let lane = (self.rest[row] & !tried[row]).trailing_zeros() as usize % RAYS;
            self.join(simd, row, lane, rows, &mut tried);
        }
    }

    /// Puts the rays that go with one of them into a bundle.
    #[inline(always)]
    fn join<S: Simd>(
        &mut self,
        simd: S,
        row: usize,
        lane: usize,
        rows: usize,
        tried: &mut [u32; ROWS],
    ) {
        let splat = |x: f32| S::F16::splat(simd, x);
        let load = |lanes: &[f32; RAYS]| S::F16::load(simd, lanes);
        let leader = &self.rows[row].bearings;
        let class = splat(leader.class[lane]);
        let (x, y) = (splat(leader.slopes[0][lane]), splat(leader.slopes[1][lane]));
        let (low, high) = (splat(-NEAR), splat(NEAR));
        let mut near = [0_u32; ROWS];
        let mut count = 0;
        for at in 0..rows {
            let bearings = &self.rows[at].bearings;
            let other = load(&bearings.class);
            let dx = load(&bearings.slopes[0]).sub(x);
            let dy = load(&bearings.slopes[1]).sub(y);
            let same = class.le(other) & other.le(class);
            let near_x = low.le(dx) & dx.le(high);
            let near_y = low.le(dy) & dy.le(high);
            near[at] = self.rest[at] & same & near_x & near_y;
            count += near[at].count_ones() as usize;
        }
        if count < SMALL {
            for at in 0..rows {
                tried[at] |= near[at];
            }
            tried[row] |= 1 << lane;
            return;
        }
        let start = self.bundled;
        for at in 0..rows {
            let mut ids = [0; RAYS];
            for lane in 0..RAYS {
                ids[lane] = (at * RAYS + lane) as u32;
            }
            let ids = simd.compress(near[at], &ids);
            if let Some(places) = self.places[self.bundled..].first_chunk_mut() {
                *places = ids;
            }
            self.bundled += near[at].count_ones() as usize;
            self.rest[at] &= !near[at];
        }
        self.bundles[self.len % LEADERS] = (start as u32, self.bundled as u32);
        self.len += 1;
    }

    /// The rays side by side, if all of the run, of that length, are one bundle: places are in order.
    #[inline(always)]
    pub(super) fn whole(&self, len: usize) -> Option<&[Row]> {
        (self.len == 1 && self.bundled == len).then_some(&self.rows)
    }

    /// The places of the valid rays that are in no bundle.
    #[inline(always)]
    pub(super) fn rest(&self) -> impl Iterator<Item = usize> {
        (0..GROUP).filter(|place| self.rest[place / RAYS] >> (place % RAYS) & 1 != 0)
    }

    /// The places of the rays of a bundle.
    #[inline(always)]
    pub(super) fn places(&self, bundle: usize) -> &[u32] {
        let (start, end) = self.bundles[bundle % LEADERS];
        &self.places[start as usize..end as usize]
    }
}

/// Looks at up to 16 rays; says which are valid.
#[inline(always)]
fn look<S: Simd>(simd: S, rays: &[Ray], row: &mut Row) -> u32 {
    let mut borrowed = [&rays[0]; RAYS];
    for lane in 1..RAYS {
        borrowed[lane] = &rays[lane.min(rays.len() - 1)];
    }
    row.rays = simd.rays(&borrowed);
    let (columns, out) = (&row.rays, &mut row.bearings);
    let column = |i: usize| S::F16::load(simd, &columns[i]);
    let splat = |x: f32| S::F16::splat(simd, x);

    // What `Ray::is_valid` says.
    let [low, high] = [splat(-ray::LONGEST), splat(ray::LONGEST)];
    let [back, ahead] = [splat(-ray::SHORTEST), splat(ray::SHORTEST)];
    let infinite = splat(f32::INFINITY);
    let negative = splat(f32::NEG_INFINITY);
    let mut valid = column(3).le(column(7));
    let mut long = 0;
    for axis in 0..3 {
        let (origin, direction) = (column(axis), column(4 + axis));
        valid &= negative.lt(origin) & origin.lt(infinite);
        valid &= low.le(direction) & direction.le(high);
        long |= direction.le(back) | ahead.le(direction);
    }
    valid &= long;

    let [.., x, y, z, _] = columns;
    for lane in 0..RAYS {
        // What `Class::of` and `longest_axis` say.
        let (x, y, z) = (x[lane], y[lane], z[lane]);
        let sign = |x: f32| x.to_bits() >> 31;
        let signs = sign(x) | sign(y) << 1 | sign(z) << 2;
        let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
        let z_longest = (az >= ax) & (az > ay);
        let y_longest = !z_longest & (ax < ay);
        let along = if z_longest {
            z
        } else if y_longest {
            y
        } else {
            x
        };
        let first = if z_longest {
            x
        } else if y_longest {
            z
        } else {
            y
        };
        let second = if z_longest {
            y
        } else if y_longest {
            x
        } else {
            z
        };
        let axis: u32 = if z_longest {
            16
        } else if y_longest {
            8
        } else {
            0
        };
        let reciprocal = 1.0 / along;
        out.class[lane] = (signs | axis) as i32 as f32;
        out.slopes[0][lane] = first * reciprocal;
        out.slopes[1][lane] = second * reciprocal;
    }
    valid & ((1 << rays.len()) - 1)
}
