//! Closed meshes: from inside, every ray must hit.

use crate::{Noise, Shape};

/// The unit cube from 0 to 1, 12 triangles, 8 shared vertices.
pub fn cube() -> Shape {
    let positions = (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2 & 1].map(|bit| bit as f32)).collect();
    let quads =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Shape { positions, triangles }
}

/// A unit sphere around the origin of `around * (rings - 1) * 2` triangles with shared vertices,
/// one vertex at each pole.
pub fn sphere(around: u32, rings: u32) -> Shape {
    star(around, rings, |_| 1.0)
}

/// A closed mesh that sees its whole inside from the origin: radii between 0.3 and 1 at random.
pub fn random_star(around: u32, rings: u32, seed: u64) -> Shape {
    let mut noise = Noise::new(seed);
    let radii: Vec<f32> = (0..=around * rings).map(|_| noise.between(0.3, 1.0)).collect();
    star(around, rings, |vertex| radii[vertex])
}

/// Where a famous test of leaks puts its mesh: a place at which an f32 resolves 1/64 to 1/32.
pub fn far_away(p: [f32; 3]) -> [f32; 3] {
    [p[0] + 148_376.0, p[1] + 1_234.0, p[2] - 223_423.0]
}

fn star(around: u32, rings: u32, radius: impl Fn(usize) -> f32) -> Shape {
    let mut positions: Vec<[f32; 3]> = vec![[0.0, 0.0, 1.0]];
    for ring in 1..rings {
        let polar = core::f32::consts::PI * ring as f32 / rings as f32;
        for step in 0..around {
            let turn = core::f32::consts::TAU * step as f32 / around as f32;
            let (sin, cos) = (libm::sinf(polar), libm::cosf(polar));
            positions.push([sin * libm::cosf(turn), sin * libm::sinf(turn), cos]);
        }
    }
    positions.push([0.0, 0.0, -1.0]);
    for (vertex, position) in positions.iter_mut().enumerate() {
        *position = position.map(|x| x * radius(vertex));
    }

    let south = positions.len() as u32 - 1;
    let at = |ring: u32, step: u32| 1 + (ring - 1) * around + step % around;
    let mut triangles = Vec::new();
    for step in 0..around {
        triangles.push([0, at(1, step), at(1, step + 1)]);
        for ring in 1..rings - 1 {
            let (a, b) = (at(ring, step), at(ring, step + 1));
            let (c, d) = (at(ring + 1, step), at(ring + 1, step + 1));
            triangles.push([a, c, d]);
            triangles.push([a, d, b]);
        }
        triangles.push([at(rings - 1, step), south, at(rings - 1, step + 1)]);
    }
    Shape { positions, triangles }
}
