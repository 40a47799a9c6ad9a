//! The terrace: rings of stone slabs, a plinth in the middle, steps around.

use std::f32::consts::TAU;

use treelet::verify::Random;
use treelet_model::{Object, Part};

use super::palette::Palette;

use super::shape::{Shape, turn};

/// The height of the floor.
pub(super) const FLOOR: f32 = 0.32;
/// The height of the plinth's top.
pub(super) const PLINTH: f32 = 1.22;
/// Where the terrace ends.
pub(super) const RADIUS: f32 = 6.9;

/// Half the gap between two slabs.
const GAP: f32 = 0.012;
/// How far the edges of a slab are cut.
const BEVEL: f32 = 0.014;

/// A ring of slabs.
struct Course {
    inner: f32,
    outer: f32,
    top: f32,
    slabs: usize,
    material: Palette,
}

/// From the middle outward; the last two are steps.
const COURSES: [Course; 7] = [
    Course { inner: 1.40, outer: 1.85, top: FLOOR, slabs: 16, material: Palette::PaleStone },
    Course { inner: 1.85, outer: 3.05, top: FLOOR, slabs: 16, material: Palette::Basalt },
    Course { inner: 3.05, outer: 3.40, top: FLOOR, slabs: 40, material: Palette::PaleStone },
    Course { inner: 3.40, outer: 4.70, top: FLOOR, slabs: 24, material: Palette::Basalt },
    Course { inner: 4.70, outer: 5.90, top: FLOOR, slabs: 32, material: Palette::PaleStone },
    Course { inner: 5.90, outer: 6.40, top: 0.21, slabs: 36, material: Palette::DarkStone },
    Course { inner: 6.40, outer: 6.90, top: 0.10, slabs: 40, material: Palette::PaleStone },
];

/// The whole terrace, its middle at the origin.
pub(super) fn terrace() -> Object {
    let mut random = Random::new(71);
    let mut parts: Vec<Part> = Vec::new();
    for course in &COURSES {
        let mut ring = Shape::default();
        let start = random.unit();
        for slab in 0..course.slabs {
            let sector = TAU / course.slabs as f32;
            let from = start + slab as f32 * sector;
            // Laid by hand: no two tops are quite level.
            let top = course.top + random.between(-0.004, 0.004);
            add_slab(&mut ring, [course.inner, course.outer], [from, from + sector], top);
        }
        parts.push(ring.flat_part(course.material.index()));
    }
    // Earth shows through the gaps.
    let bed = [[0.0, -0.3], [6.86, -0.3], [6.86, -0.3], [6.86, 0.02], [6.86, 0.02], [0.0, 0.18]];
    parts.push(Shape::lathe(&bed, 96).smooth_part(Palette::Soil.index()));
    parts.push(plinth());
    Object { name: "terrace".into(), parts }
}

/// One slab: a piece of a ring with its upper edges cut, closed below.
fn add_slab(shape: &mut Shape, [inner, outer]: [f32; 2], [from, to]: [f32; 2], top: f32) {
    const ARCS: usize = 10;
    // A loop of corners at a height, `inset` from the slab's outline: out along one side of the
    // ring's sector, back along the other.
    let edge = |inset: f32, height: f32| {
        let (near, far) = (inner + GAP + inset, outer - GAP - inset);
        let at = |radius: f32, share: f32| {
            let slack = (GAP + inset) / radius;
            let angle = from + slack + (to - from - 2.0 * slack) * share;
            let (sin, cos) = turn(angle / TAU);
            [radius * cos, height, -radius * sin]
        };
        let share = |arc: usize| arc as f32 / ARCS as f32;
        let outside: Vec<_> = (0..=ARCS).map(|arc| at(far, share(arc))).collect();
        let inside: Vec<_> = (0..=ARCS).map(|arc| at(near, share(arc))).collect();
        (outside, inside)
    };
    let quad = |shape: &mut Shape, [a, b, c, d]: [[f32; 3]; 4]| {
        shape.push_triangle([a, b, c]);
        shape.push_triangle([a, c, d]);
    };
    let bottom = edge(0.0, -0.25);
    let shoulder = edge(0.0, top - BEVEL);
    let face = edge(BEVEL, top);
    // Sides and cut edges, around.
    for (low, high) in [(&bottom, &shoulder), (&shoulder, &face)] {
        let around = |(outside, inside): &(Vec<[f32; 3]>, Vec<[f32; 3]>)| {
            outside.iter().chain(inside.iter().rev()).copied().collect::<Vec<_>>()
        };
        let (low, high) = (around(low), around(high));
        for at in 0..low.len() {
            let next = (at + 1) % low.len();
            quad(shape, [low[at], low[next], high[next], high[at]]);
        }
    }
    // Top and bottom, from the inner to the outer arc.
    for arc in 0..ARCS {
        let (outside, inside) = &face;
        quad(shape, [inside[arc], outside[arc], outside[arc + 1], inside[arc + 1]]);
        let (outside, inside) = &bottom;
        quad(shape, [inside[arc], inside[arc + 1], outside[arc + 1], outside[arc]]);
    }
}

/// The turned stone under the sculpture.
fn plinth() -> Part {
    const P: f32 = PLINTH;
    let profile = [
        [0.0, 0.0],
        [1.36, 0.0],
        [1.36, 0.0],
        [1.36, 0.46],
        [1.35, 0.475],
        [1.33, 0.48],
        [1.33, 0.48],
        [1.12, 0.48],
        [1.12, 0.48],
        [1.12, 0.53],
        [1.10, 0.56],
        [1.03, 0.60],
        [0.98, 0.67],
        [0.96, 0.76],
        [0.955, 0.86],
        [0.965, 0.95],
        [1.00, 1.02],
        [1.06, 1.06],
        [1.12, 1.08],
        [1.12, 1.08],
        [1.14, 1.08],
        [1.14, 1.08],
        [1.14, P - 0.02],
        [1.135, P - 0.005],
        [1.12, P],
        [1.12, P],
        [0.0, P],
    ];
    Shape::lathe(&profile, 128).smooth_part(Palette::PaleStone.index())
}
