//! The ground: a level clearing, meadows that roll, hills around.

use treelet_model::Part;

use super::noise::{fractal, step};
use super::palette::Palette;
use super::shape::{Edges, Shape};

/// How far the ground reaches to each side.
const REACH: f32 = 420.0;
/// Quads along each side.
const CELLS: usize = 360;

/// The height of the ground.
pub(super) fn height(x: f32, z: f32) -> f32 {
    let far = (x * x + z * z).sqrt();
    // Nothing moves in the clearing, meadows swell outside it, hills stand behind.
    let meadow = 1.1 * step(6.5, 30.0, far) * fractal([x * 0.045, 3.7, z * 0.045], 4);
    let tuft = 0.10 * step(6.2, 10.0, far) * fractal([x * 0.45, 9.1, z * 0.45], 3);
    let rise = step(35.0, 260.0, far);
    let hills = rise * (26.0 + 46.0 * fractal([x * 0.011 + 5.3, 1.2, z * 0.011], 5));
    // The view to the front stays open: the camera looks along -z.
    let back = 0.35 + 0.65 * step(60.0, -120.0, z);
    meadow + tuft + hills * back
}

/// The ground as a mesh, finer near the middle.
pub(super) fn ground() -> Part {
    let spread = |t: f32| {
        let s = 2.0 * t - 1.0;
        // A blend of line and cube: cells of 0.6 m in the middle, of 6 m at the rim.
        REACH * (0.13 * s + 0.87 * s * s * s)
    };
    let point = |u: f32, v: f32| {
        let (x, z) = (spread(u), -spread(v));
        [x, height(x, z), z]
    };
    Shape::sheet(CELLS, CELLS, Edges::Open, point).smooth_part(Palette::Meadow.index())
}
