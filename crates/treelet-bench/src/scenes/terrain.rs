//! A fractal height field over the unit square: octaves of smooth value noise.
//!
//! Source: K. Musgrave, C. Kolb, R. Mace, "The Synthesis and Rendering of Eroded Fractal Terrains",
//! SIGGRAPH 1989, section 2, without the erosion.

use treelet::verify::Random;

use crate::engine::Triangles;

/// Seed of the scene.
const SEED: u64 = 0x7E;
/// Lattice cells along an edge in the first octave.
const FIRST_CELLS: u32 = 4;
/// Height of the first octave: with `GAIN`, slopes come out like those of mountains, 0.4 in the mean
/// square.
const FIRST_HEIGHT: f32 = 0.045;
/// Height of an octave, of the one before it: below 1/2, so that details are less steep.
const GAIN: f32 = 0.46;
/// Octaves: the last one has cells of about two grid cells at four million triangles.
const OCTAVES: u32 = 9;

/// About `count` triangles: two for each cell of a square grid.
pub(super) fn terrain(count: u64) -> Triangles {
    let cells = ((count as f64 / 2.0).sqrt().round() as u32).max(1);
    let octaves: Vec<Octave> = (0..OCTAVES).map(Octave::new).collect();

    // Heights on the grid, y up.
    let side = cells + 1;
    let at = |i: u32| i as f32 / cells as f32;
    let mut positions = Vec::with_capacity((side * side) as usize + 1);
    for z in (0..side).map(at) {
        for x in (0..side).map(at) {
            let height = octaves.iter().map(|octave| octave.height(x, z)).sum();
            positions.push([x, height, z]);
        }
    }
    positions.push([0.0; 3]);

    // Two triangles a cell, seen counter-clockwise from above.
    let mut indices = Vec::with_capacity(2 * (cells * cells) as usize);
    for z in 0..cells {
        for x in 0..cells {
            let corner = z * side + x;
            indices.push([corner, corner + side, corner + 1]);
            indices.push([corner + 1, corner + side, corner + side + 1]);
        }
    }
    Triangles { positions: positions.into(), indices: indices.into(), later: None }
}

/// Random heights on a lattice, smoothly joined.
struct Octave {
    cells: u32,
    heights: Vec<f32>,
}

impl Octave {
    fn new(number: u32) -> Self {
        let cells = FIRST_CELLS << number;
        let mut random = Random::new(SEED + u64::from(number));
        let scale = (0..number).fold(FIRST_HEIGHT, |height, _| height * GAIN);
        let side = cells + 1;
        let heights = (0..side * side).map(|_| random.between(-scale, scale)).collect();
        Self { cells, heights }
    }

    fn height(&self, x: f32, z: f32) -> f32 {
        let cell = |x: f32| {
            let scaled = x * self.cells as f32;
            let index = (scaled as u32).min(self.cells - 1);
            let f = scaled - index as f32;
            // The quintic whose first and second derivatives vanish at both ends.
            (index, f * f * f * (f * (f * 6.0 - 15.0) + 10.0))
        };
        let ((i, u), (j, v)) = (cell(x), cell(z));
        let lattice = |i: u32, j: u32| self.heights[(j * (self.cells + 1) + i) as usize];
        let row = |j: u32| lattice(i, j) * (1.0 - u) + lattice(i + 1, j) * u;
        row(j) * (1.0 - v) + row(j + 1) * v
    }
}
