//! The sculpture: strands of gold, copper and blued steel, twisted into a rope that is tied into a trefoil.
//!
//! The rope follows the torus knot (2, 3); each strand winds around the rope's middle in a frame
//! given by the torus itself, so that the strands close after one round.

use std::f32::consts::TAU;

use treelet::math::vec3;
use treelet_model::Object;

use super::palette::Palette;
use super::shape::{Edges, Shape, across};

/// The strands' turns around the middle of the rope in one round.
const TWISTS: f32 = 9.0;
/// Quads along a strand and around it.
const CELLS: (usize, usize) = (1800, 36);

/// The knot about the origin, facing +z, as wide as `size`.
pub(super) fn knot(size: f32) -> Object {
    let metals = [Palette::Gold, Palette::Copper, Palette::BluedSteel];
    let strand = |index: usize, metal: Palette| {
        let phase = index as f32 / metals.len() as f32;
        let point = |u: f32, v: f32| surface(u, v, phase).map(|x| 0.5 * size * x);
        Shape::sheet(CELLS.1, CELLS.0, Edges::Sewn, |u, v| point(v, u)).smooth_part(metal.index())
    };
    let parts = metals.into_iter().enumerate().map(|(index, metal)| strand(index, metal));
    Object { name: "trefoil of three strands".into(), parts: parts.collect() }
}

/// A point of a strand: `u` along the knot, `v` around the strand.
fn surface(u: f32, v: f32, phase: f32) -> [f32; 3] {
    const ROPE: f32 = 0.112;
    const STRAND: f32 = 0.097;
    let strand = |u: f32| {
        let (frame, center) = (frame(u), middle(u));
        let (sin, cos) = libm::sincosf(TAU * (TWISTS * u + phase));
        vec3::add(center, blend(frame, ROPE * cos, ROPE * sin))
    };
    let center = strand(u);
    let ahead = vec3::sub(strand(u + 0.5 / CELLS.0 as f32), strand(u - 0.5 / CELLS.0 as f32));
    let along = vec3::normalize(ahead).unwrap_or([0.0, 0.0, 1.0]);
    // The strand's own frame turns with the strand, so it closes too.
    let (sin, cos) = libm::sincosf(TAU * (TWISTS * u + phase));
    let out = across(blend(frame(u), cos, sin), along);
    let side = vec3::cross(along, out);
    let (sin, cos) = libm::sincosf(TAU * v);
    vec3::add(center, blend([out, side], STRAND * cos, STRAND * sin))
}

/// The middle of the rope: a trefoil that fits into a circle of radius about 1.
fn middle(u: f32) -> [f32; 3] {
    const RING: f32 = 0.56;
    const TUBE: f32 = 0.25;
    let (sin2, cos2) = libm::sincosf(TAU * 2.0 * u + 0.25 * TAU);
    let (sin3, cos3) = libm::sincosf(TAU * 3.0 * u);
    let far = RING + TUBE * cos3;
    [far * cos2, far * sin2, 1.15 * TUBE * sin3]
}

/// Two unit vectors across the rope at `u`, the first pointing away from the torus's core.
fn frame(u: f32) -> [[f32; 3]; 2] {
    const STEP: f32 = 1e-3;
    let along = vec3::normalize(vec3::sub(middle(u + STEP), middle(u - STEP)));
    let along = along.unwrap_or([0.0, 0.0, 1.0]);
    let (sin2, cos2) = libm::sincosf(TAU * 2.0 * u + 0.25 * TAU);
    let (sin3, cos3) = libm::sincosf(TAU * 3.0 * u);
    let first = across([cos3 * cos2, cos3 * sin2, sin3], along);
    [first, vec3::cross(along, first)]
}

/// `x` of the first vector and `y` of the second.
fn blend(frame: [[f32; 3]; 2], x: f32, y: f32) -> [f32; 3] {
    vec3::add(vec3::scale(frame[0], x), vec3::scale(frame[1], y))
}
