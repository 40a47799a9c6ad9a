//! Uniformly placed random triangles in a unit box: no structure for a builder to find.

use treelet::verify::Random;

use crate::engine::Triangles;

/// Length of two edges of each triangle, of the box's edge.
const EDGE: f32 = 1.0 / 1000.0;

/// Seed of the scene.
const SEED: u64 = 0x50;

/// `count` triangles; each corner stands alone.
pub(super) fn soup(count: u64) -> Triangles {
    let mut random = Random::new(SEED);
    let count = count as u32;
    let mut positions = Vec::with_capacity(3 * count as usize + 1);
    for _ in 0..count {
        let corner = [random.unit(), random.unit(), random.unit()];
        let mut beside = || {
            let d = random.direction();
            let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
            [0, 1, 2].map(|axis: usize| corner[axis] + EDGE * d[axis] / length)
        };
        positions.extend([corner, beside(), beside()]);
    }
    positions.push([0.0; 3]);
    let indices: Vec<_> = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Triangles { positions: positions.into(), indices: indices.into(), later: None }
}
