//! The list of awkward scenes.

use crate::{Noise, Shape, closed};

/// A scene with a name.
#[derive(Clone, Debug)]
pub struct Awkward {
    /// What is awkward about it.
    pub name: &'static str,
    /// The scene.
    pub shape: Shape,
    /// How many of its triangles are unfit for any scene.
    pub invalid: u64,
}

/// Every awkward scene of moderate size: each has at most some thousand triangles, but for the pile
/// of `pile` equal ones.
pub fn all(pile: usize) -> Vec<Awkward> {
    let ok = |name, shape| Awkward { name, shape, invalid: 0 };
    vec![
        ok("empty", Shape::default()),
        ok(
            "vertices without triangles",
            Shape { positions: vec![[f32::NAN; 3]; 3], ..Shape::default() },
        ),
        ok("one triangle", Shape::soup(&[UNIT])),
        ok("two triangles back to back", Shape::soup(&[UNIT, [UNIT[0], UNIT[2], UNIT[1]]])),
        ok("five triangles", random_triangles(5, 1.0, 0.5)),
        ok("a pile of the same triangle", Shape::soup(&vec![UNIT; pile])),
        ok("all centroids equal", concentric(1000)),
        ok("coplanar grid", coplanar_grid(24)),
        ok("coplanar grid, doubled and shuffled", doubled(coplanar_grid(12))),
        ok("needle slivers", needles(1000)),
        ok("collinear and repeated corners", degenerate()),
        ok("near 1e18", random_triangles(300, 1.0e18, 1.0e17)),
        ok("near 1e-18", random_triangles(300, 1.0e-18, 1.0e-19)),
        ok("near 1e-38", random_triangles(300, 1.0e-38, 1.0e-38)),
        ok("scales from 1e-6 to 1e6", mixed_scales(500)),
        Awkward { name: "one vertex NaN", shape: with_vertex(f32::NAN), invalid: 1 },
        Awkward { name: "one vertex infinite", shape: with_vertex(f32::INFINITY), invalid: 1 },
        Awkward { name: "one vertex at 1e30", shape: with_vertex(1.0e30), invalid: 1 },
        Awkward { name: "an index past the end", shape: with_bad_index(), invalid: 1 },
        ok("far from the origin", closed::sphere(12, 8).mapped(closed::far_away)),
        ok("a line of ever larger triangles", chain(200)),
        ok("axis-aligned cubes", cubes(6)),
        ok("random triangles", random_triangles(2000, 10.0, 1.0)),
    ]
}

const UNIT: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

/// `count` triangles around random centers.
pub fn random_triangles(count: usize, spread: f32, size: f32) -> Shape {
    let mut noise = Noise::new(count as u64);
    let triangles: Vec<_> = (0..count)
        .map(|_| {
            let center = noise.point(-spread, spread);
            [(); 3].map(|()| {
                let offset = noise.point(-size, size);
                [center[0] + offset[0], center[1] + offset[1], center[2] + offset[2]]
            })
        })
        .collect();
    Shape::soup(&triangles)
}

/// Triangles of many sizes whose boxes all have the same center.
fn concentric(count: usize) -> Shape {
    let mut noise = Noise::new(3);
    let triangles: Vec<_> = (0..count)
        .map(|_| {
            // A diagonal of a box around the origin, and a point inside the box.
            let a = noise.point(0.0, 1.0);
            let s = noise.between(-1.0, 1.0);
            [a, a.map(|x| -x), [a[0] * s, -a[1] * s, a[2] * s]]
        })
        .collect();
    Shape::soup(&triangles)
}

/// A flat square of `2 n^2` triangles in the plane `z = 0.1`, sharing vertices.
pub fn coplanar_grid(n: u32) -> Shape {
    let at = |x: u32, y: u32| y * (n + 1) + x;
    let mut shape = Shape::default();
    for y in 0..=n {
        for x in 0..=n {
            shape.positions.push([x as f32 / n as f32, y as f32 / n as f32, 0.1]);
        }
    }
    for y in 0..n {
        for x in 0..n {
            shape.triangles.push([at(x, y), at(x + 1, y), at(x + 1, y + 1)]);
            shape.triangles.push([at(x, y), at(x + 1, y + 1), at(x, y + 1)]);
        }
    }
    shape
}

/// Every triangle twice, the second time in another order, so that ties are everywhere.
fn doubled(mut shape: Shape) -> Shape {
    let mut again: Vec<_> = shape.triangles.iter().map(|&[a, b, c]| [b, c, a]).collect();
    again.reverse();
    shape.triangles.extend(again);
    shape
}

/// Triangles a million times longer than wide, in all directions.
fn needles(count: usize) -> Shape {
    let mut noise = Noise::new(4);
    let triangles: Vec<_> = (0..count)
        .map(|_| {
            let a = noise.point(-1.0, 1.0);
            let b = noise.point(-1.0, 1.0);
            let near = noise.point(-1.0e-6, 1.0e-6);
            [a, b, [b[0] + near[0], b[1] + near[1], b[2] + near[2]]]
        })
        .collect();
    Shape::soup(&triangles)
}

/// Points, lines and repeated corners among a few good triangles.
fn degenerate() -> Shape {
    let p = [0.5, 0.25, 0.125];
    let line = [[0.0; 3], [1.0, 2.0, 3.0], [0.5, 1.0, 1.5]];
    let diagonal = [[0.0; 3], [1.0; 3], [0.3, 0.3, 0.3]];
    let axis = [[0.0; 3], [1.0, 0.0, 0.0], [0.25, 0.0, 0.0]];
    Shape::soup(&[UNIT, [p, p, p], [UNIT[0], UNIT[0], UNIT[1]], line, diagonal, axis, UNIT])
}

fn mixed_scales(count: usize) -> Shape {
    let mut noise = Noise::new(5);
    let mut triangles = Vec::new();
    for i in 0..count {
        let scale = 10.0_f32.powi(i as i32 % 13 - 6);
        triangles.push([(); 3].map(|()| noise.point(-scale, scale)));
    }
    Shape::soup(&triangles)
}

fn with_vertex(value: f32) -> Shape {
    let mut shape = random_triangles(50, 2.0, 1.0);
    shape.positions[3 * 20 + 1][1] = value;
    shape
}

fn with_bad_index() -> Shape {
    let mut shape = random_triangles(50, 2.0, 1.0);
    shape.triangles[17][2] = 150;
    shape
}

/// Each triangle twice as large and twice as far as the one before it would overflow; a factor of
/// 1.2 gives spatial medians a long, lopsided tree.
fn chain(count: usize) -> Shape {
    let triangles: Vec<_> = (0..count)
        .map(|i| {
            let s = 1.2_f32.powi(i as i32);
            [[s, 0.0, 0.0], [s, s * 0.1, 0.0], [s, 0.0, s * 0.1]]
        })
        .collect();
    Shape::soup(&triangles)
}

/// `n^3` unit cubes on an integer lattice, faces touching: every ray along an axis is in a face.
fn cubes(n: u32) -> Shape {
    let mut shape = Shape::default();
    for i in 0..n * n * n {
        let at = [i % n, i / n % n, i / (n * n)].map(|c| c as f32);
        let cube = closed::cube().mapped(|p| [p[0] + at[0], p[1] + at[1], p[2] + at[2]]);
        let first = shape.positions.len() as u32;
        shape.positions.extend(cube.positions);
        shape.triangles.extend(cube.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    shape
}
