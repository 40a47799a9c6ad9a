//! Radix sort of 64-bit entries by some of their bits: least significant digit first, stable.
//!
//! A key and the number it belongs to share an entry, so that both move in one store. Own code
//! instead of a library's because a build must be cancellable within milliseconds, which a
//! comparison sort in one call is not.
//!
//! One pass that counts all digits, and one a digit of up to 11 bits; digits in which all entries
//! agree are skipped. 8 bytes an entry of scratch.

use crate::context::{Cancelled, Stage};
use core::ops::Range;

/// Bits that order like the (never NaN) float: -0 sorts just below 0.
#[inline(always)]
pub(super) fn ordered_bits(x: f32) -> u32 {
    let bits = x.to_bits();
    let negative = (bits as i32 >> 31) as u32;
    bits ^ (negative | 1 << 31)
}

/// Widest digit: the places of 2,048 of them fit a first-level cache.
const DIGIT_BITS_MAX: u32 = 11;
const CHUNK: usize = 65_536;

/// Sorts by the given bits; entries that agree in them keep their order. `spare` is as long.
pub(super) fn sort(
    items: &mut [u64],
    spare: &mut [u64],
    bits: Range<u32>,
    stage: &Stage<'_>,
) -> Result<(), Cancelled> {
    debug_assert!(items.len() == spare.len() && u32::try_from(items.len()).is_ok());
    let digits = bits.len().div_ceil(DIGIT_BITS_MAX as usize);
    if digits == 0 || items.len() < 2 {
        return Ok(());
    }
    let width = bits.len().div_ceil(digits);
    let mask = (1 << width) - 1;
    let below_end = u64::MAX >> (u64::BITS - bits.end);

    // Count every digit in one pass.
    let mut starts = alloc::vec![0_u32; digits << width];
    for chunk in items.chunks(CHUNK) {
        stage.check()?;
        for &item in chunk {
            let mut rest = (item & below_end) >> bits.start;
            for starts in starts.chunks_exact_mut(1 << width) {
                starts[rest as usize & mask] += 1;
                rest >>= width;
            }
        }
    }

    // Turn counts into places, and move, digit by digit.
    let (mut from, mut to) = (&mut *items, &mut *spare);
    let mut in_spare = false;
    for (pass, starts) in starts.chunks_exact_mut(1 << width).enumerate() {
        let shift = bits.start + (pass * width) as u32;
        let digit = |item: u64| ((item & below_end) >> shift) as usize & mask;
        // A pass in which all agree would move nothing.
        if starts[digit(from[0])] as usize == from.len() {
            continue;
        }
        let mut next = 0;
        for start in starts.iter_mut() {
            next += core::mem::replace(start, next);
        }
        for chunk in from.chunks(CHUNK) {
            stage.check()?;
            for &item in chunk {
                let place = &mut starts[digit(item)];
                to[*place as usize] = item;
                *place += 1;
            }
        }
        core::mem::swap(&mut from, &mut to);
        in_spare = !in_spare;
    }
    if in_spare {
        items.copy_from_slice(spare);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::context::Context;
    use alloc::vec::Vec;

    #[test]
    fn sorts_like_the_floats_and_keeps_ties_in_order() {
        let context = Context::default();
        let stage = Stage::new(&context, "test", 0);
        let floats = [3.5, -1.0, 0.0, 1e-40, -1e30, 3.5, 7e9, -1e-40, -1.0, f32::MAX, f32::MIN];
        let key = |x: f32| u64::from(ordered_bits(x)) << 32;
        let mut items: Vec<u64> = floats.iter().zip(0..).map(|(&x, id)| key(x) | id).collect();
        let mut spare = alloc::vec![0; items.len()];
        sort(&mut items, &mut spare, 32..64, &stage).unwrap();
        let ids: Vec<u32> = items.iter().map(|&item| item as u32).collect();
        let mut expected: Vec<u32> = (0..floats.len() as u32).collect();
        expected.sort_by(|&a, &b| floats[a as usize].total_cmp(&floats[b as usize]));
        assert_eq!(ids, expected);
    }

    #[test]
    fn sorts_by_exactly_the_bits_it_is_given() {
        let context = Context::default();
        let stage = Stage::new(&context, "test", 0);
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            state ^ state >> 29
        };
        for bits in [0..64, 31..64, 31..56, 7..8, 5..16, 5..17, 63..64, 9..9] {
            let mut items: Vec<u64> = (0..1000).map(|_| random()).collect();
            let mut expected = items.clone();
            let low = |item: u64| if bits.end < 64 { item & ((1 << bits.end) - 1) } else { item };
            expected.sort_by_key(|&item| low(item).checked_shr(bits.start).unwrap_or(0));
            if bits.is_empty() {
                expected.clone_from(&items);
            }
            let mut spare = alloc::vec![0; items.len()];
            sort(&mut items, &mut spare, bits.clone(), &stage).unwrap();
            assert!(items == expected, "bits {bits:?}");
        }
    }
}
