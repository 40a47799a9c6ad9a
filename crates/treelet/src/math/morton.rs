//! Morton codes: points numbered along a curve that stays in a cell before it goes to the next one.
//!
//! Source: G. M. Morton, "A computer oriented geodetic data base", IBM, 1966. Differs from it: the
//! axes do not take turns. Each bit halves the cell along its longest edge, as M. Vinkler, J. Bittner
//! and V. Havran do for the sizes of primitives in "Extended Morton Codes for High Performance
//! Bounding Volume Hierarchy Construction", HPG 2017; so a flat scene spends no bit on its thickness,
//! and cells are never longer than twice their width.
//!
//! A code has 63 bits in two words. The first one is looked up in tables of 12 KiB: six loads a
//! point, about 2 ns. The second one is for the few points that share the first.

use alloc::boxed::Box;

/// Most bits of the first word of a code.
pub const COARSE_BITS_MAX: u32 = 3 * AXIS_COARSE_BITS;
/// Bits of a code.
pub const CODE_BITS: u32 = 63;

/// Cells along an axis are numbered by this many bits: what adding to an f32 can round to.
const AXIS_BITS: u32 = 23;
/// The first word looks at no more than the upper two bytes of a cell's number.
const AXIS_COARSE_BITS: u32 = 16;

/// `2^23`: numbers from here to its double are whole, and their low bits count.
const ROUNDER: f32 = 8_388_608.0;
/// The last cell along an axis.
const CELL_MAX: f32 = ROUNDER - 1.0;

/// How many values a byte of a cell's number has.
const BYTE: usize = 256;

/// How points in a box map to codes.
#[derive(Clone, Debug)]
pub struct Curve {
    origin: [f32; 3],
    scale: [f32; 3],
    /// Bits of the second word.
    fine_bits: u32,
    /// `[axis][byte of the cell's number, the uppermost first][its value]`.
    coarse: Box<[[[u64; BYTE]; 2]; 3]>,
    fine: Box<[[[u64; BYTE]; 3]; 3]>,
}

impl Curve {
    /// The curve through a box, empty or of any size, with codes whose first word has `coarse_bits`
    /// of all [`CODE_BITS`], at most [`COARSE_BITS_MAX`].
    pub fn new(lo: [f32; 3], hi: [f32; 3], coarse_bits: u32) -> Self {
        debug_assert!(coarse_bits <= COARSE_BITS_MAX);
        let extent: [f64; 3] =
            core::array::from_fn(|axis| (f64::from(hi[axis]) - f64::from(lo[axis])).max(0.0));
        // An axis without extent gets scale 0; one that is too short for f32 gets few cells.
        let scale = extent.map(|e| {
            let cells = f64::from(CELL_MAX) / e;
            if e > 0.0 { cells.min(f64::from(f32::MAX)) as f32 } else { 0.0 }
        });
        let mut curve = Self {
            origin: lo,
            scale,
            fine_bits: CODE_BITS - coarse_bits,
            coarse: Box::new([[[0; BYTE]; 2]; 3]),
            fine: Box::new([[[0; BYTE]; 3]; 3]),
        };
        curve.deal(extent);
        curve
    }

    /// Deals the bits of the code to the axes, from the top: the longest edge of a cell is halved.
    fn deal(&mut self, mut edges: [f64; 3]) {
        let mut used = [0; 3];
        for place in (0..CODE_BITS).rev() {
            let most = if place >= self.fine_bits { AXIS_COARSE_BITS } else { AXIS_BITS };
            let mut axis = None;
            for candidate in 0..3 {
                let longer = axis.is_none_or(|axis: usize| edges[candidate] > edges[axis]);
                if used[candidate] < most && edges[candidate] > 0.0 && longer {
                    axis = Some(candidate);
                }
            }
            // Without an edge that can still be halved, the rest of the word stays zero.
            let Some(axis) = axis else { continue };
            used[axis] += 1;
            edges[axis] *= 0.5;
            let bit = AXIS_BITS - used[axis];
            if place >= self.fine_bits {
                mark(&mut self.coarse[axis], bit, place - self.fine_bits);
            } else {
                mark(&mut self.fine[axis], bit, place);
            }
        }
    }

    /// The cell of a point in the box, by axis. NaN lands in the last cell.
    #[inline(always)]
    pub fn cell(&self, point: [f32; 3]) -> [u32; 3] {
        let along = |axis: usize| {
            let x = (point[axis] - self.origin[axis]) * self.scale[axis];
            // Written as a comparison: one instruction, and NaN fails it.
            let x = if x < CELL_MAX { x } else { CELL_MAX };
            (x + ROUNDER).to_bits() & ((1 << AXIS_BITS) - 1)
        };
        [along(0), along(1), along(2)]
    }

    /// The first word of a cell's code.
    #[inline(always)]
    pub fn coarse(&self, cell: [u32; 3]) -> u64 {
        let along = |axis: usize| {
            let [upper, middle, _] = bytes(cell[axis]);
            self.coarse[axis][0][upper] | self.coarse[axis][1][middle]
        };
        along(0) | along(1) | along(2)
    }

    /// The second word of a cell's code.
    #[inline]
    pub fn fine(&self, cell: [u32; 3]) -> u64 {
        let along = |axis: usize| {
            let [upper, middle, lower] = bytes(cell[axis]);
            let table = &self.fine[axis];
            table[0][upper] | table[1][middle] | table[2][lower]
        };
        along(0) | along(1) | along(2)
    }
}

/// A cell's number, left-aligned to 24 bits, in bytes from the top.
#[inline(always)]
fn bytes(number: u32) -> [usize; 3] {
    let byte = |shift: u32| (number << 1 >> shift) as usize & (BYTE - 1);
    [byte(16), byte(8), byte(0)]
}

/// Sends bit `from` of a cell's number to bit `to` of the code.
fn mark(tables: &mut [[u64; BYTE]], from: u32, to: u32) {
    // Numbers are left-aligned to 24 bits.
    let from = from + 1;
    let table = &mut tables[2 - (from / 8) as usize];
    for (value, code) in table.iter_mut().enumerate() {
        *code |= (value as u64 >> (from % 8) & 1) << to;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn code(curve: &Curve, point: [f32; 3]) -> u64 {
        let cell = curve.cell(point);
        curve.coarse(cell) << curve.fine_bits | curve.fine(cell)
    }

    /// The code bit by bit: halve the longest edge of the cell, say on which side the point lies.
    fn naive(edges: [f64; 3], cell: [u32; 3]) -> u64 {
        let (mut edges, mut used, mut code) = (edges, [0_u32; 3], 0);
        for place in (0..63).rev() {
            let most = if place >= 30 { 16 } else { 23 };
            let open = (0..3).filter(|&axis| used[axis] < most && edges[axis] > 0.0);
            let Some(axis) = open.rev().max_by(|&a, &b| edges[a].total_cmp(&edges[b])) else {
                continue;
            };
            used[axis] += 1;
            edges[axis] /= 2.0;
            code |= u64::from(cell[axis] >> (23 - used[axis]) & 1) << place;
        }
        code
    }

    #[test]
    fn tables_agree_with_halving_bit_by_bit() {
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / 16_777_216.0
        };
        let extents: [[f32; 3]; 7] = [
            [1.0, 1.0, 1.0],
            [1000.0, 1.0, 30.0],
            [0.0, 5.0, 0.25],
            [0.0, 0.0, 1.0e-20],
            [3.0e9, 1.0, 1.0],
            [1.0e-30, 1.0e-30, 1.0e30],
            [0.0; 3],
        ];
        for extent in extents {
            let curve = Curve::new([0.0; 3], extent, 33);
            for _ in 0..300 {
                let point = extent.map(|e| e * random());
                let expected = naive(extent.map(f64::from), curve.cell(point));
                assert_eq!(code(&curve, point), expected, "{point:?} in {extent:?}");
            }
        }
    }

    #[test]
    fn corners_are_first_and_last() {
        let (lo, hi) = ([-3.0, 10.0, 0.5], [5.0, 18.0, 8.5]);
        let curve = Curve::new(lo, hi, 40);
        assert_eq!(code(&curve, lo), 0);
        assert_eq!(code(&curve, hi), (1 << 63) - 1);
    }

    #[test]
    fn any_box_and_any_point_has_a_code() {
        let boxes = [
            ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]),
            ([f32::MIN; 3], [f32::MAX; 3]),
            ([0.0; 3], [f32::from_bits(1); 3]),
        ];
        for (lo, hi) in boxes {
            let curve = Curve::new(lo, hi, 40);
            for x in [0.0, f32::MAX, f32::MIN, f32::from_bits(1), f32::NAN] {
                assert!(
                    curve.cell([x; 3]).iter().all(|&cell| cell < 1 << 23),
                    "{x} in {lo:?}, {hi:?}"
                );
            }
            assert!(code(&curve, lo) < 1 << 63);
        }
    }
}
