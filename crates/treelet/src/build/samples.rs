//! Boxes for tests of builders.

use crate::bounds::Aabb;
use alloc::vec::Vec;

/// Boxes with an edge of up to `size` in the unit cube, on a grid of `steps` to the unit so that some are
/// equal. Another `count` gives other boxes.
pub(super) fn random_boxes(count: usize, size: f32, steps: f32) -> Vec<Aabb> {
    let mut state = count as u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        ((state >> 8) as f32 / 16_777_216.0 * steps).trunc() / steps
    };
    let mut one = || {
        let lo = [(); 3].map(|()| random());
        Aabb { lo, hi: lo.map(|x| x + size * random()) }
    };
    (0..count).map(|_| one()).collect()
}
