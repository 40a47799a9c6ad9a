//! What stands about: lanterns, spheres on pedestals, old stones, a path.

use treelet::math::{Affine, vec3};
use treelet_model::Object;

use super::noise::fractal;
use super::palette::Palette;
use super::shape::Shape;

/// Where the middle of a sphere is above its pedestal's foot, and its radius.
const SPHERE: (f32, f32) = (1.05, 0.42);

/// A lantern: a slender iron post that carries a globe of light under a small roof.
pub(super) fn lantern() -> Object {
    let post = [
        [0.0, -0.2],
        [0.13, -0.2],
        [0.13, -0.2],
        [0.13, 0.05],
        [0.12, 0.08],
        [0.06, 0.11],
        [0.045, 0.20],
        [0.035, 0.9],
        [0.032, 1.50],
        [0.05, 1.54],
        [0.05, 1.57],
        [0.035, 1.60],
        [0.06, 1.66],
        [0.10, 1.69],
        [0.10, 1.69],
        [0.0, 1.69],
    ];
    let roof = [
        [0.0, 2.00],
        [0.17, 2.00],
        [0.17, 2.00],
        [0.18, 2.015],
        [0.12, 2.06],
        [0.05, 2.12],
        [0.02, 2.20],
        [0.018, 2.24],
        [0.0, 2.25],
    ];
    let mut iron = Shape::lathe(&post, 32);
    iron.append(&Shape::lathe(&roof, 32));
    // Four thin bars hold the roof.
    for bar in 0..4 {
        let (sin, cos) = super::shape::turn(bar as f32 / 4.0 + 0.125);
        let bar = [[0.0, 1.68], [0.008, 1.68], [0.008, 2.01], [0.0, 2.01]];
        let place = Affine::translation([0.16 * cos, 0.0, 0.16 * sin]);
        iron.append(&Shape::lathe(&bar, 6).placed(&place));
    }
    // Coarse, because every triangle of it is a light; smooth normals do not matter to a glow.
    let globe = Shape::ball(5).deformed(|p| vec3::add([0.0, 1.845, 0.0], vec3::scale(p, 0.135)));
    let parts =
        vec![iron.smooth_part(Palette::Iron.index()), globe.smooth_part(Palette::Glow.index())];
    Object { name: "lantern".into(), parts }
}

/// A sphere of some material on a pedestal of stone.
pub(super) fn sphere(material: Palette) -> Object {
    let pedestal = [
        [0.0, -0.05],
        [0.34, -0.05],
        [0.34, -0.05],
        [0.34, 0.08],
        [0.33, 0.09],
        [0.33, 0.09],
        [0.24, 0.09],
        [0.24, 0.09],
        [0.22, 0.13],
        [0.19, 0.30],
        [0.185, 0.40],
        [0.20, 0.52],
        [0.26, 0.58],
        [0.30, 0.60],
        [0.30, 0.60],
        [0.30, 0.65],
        [0.29, 0.66],
        [0.29, 0.66],
        // A shallow dish holds the sphere.
        [0.24, 0.66],
        [0.0, 0.615],
    ];
    let (height, radius) = SPHERE;
    let ball = Shape::ball(48).deformed(|p| vec3::add([0.0, height, 0.0], vec3::scale(p, radius)));
    let parts = vec![
        Shape::lathe(&pedestal, 64).smooth_part(Palette::DarkStone.index()),
        ball.smooth_part(material.index()),
    ];
    Object { name: "sphere".into(), parts }
}

/// An old standing stone, about 1 wide and 2.6 high, its foot in the ground.
pub(super) fn stone(seed: f32) -> Object {
    let shape = Shape::ball(40).deformed(|p| {
        // A box with soft edges: dividing by a high norm pushes the ball outward.
        let fourth = p.map(|x| x * x * x * x).iter().sum::<f32>();
        let boxy = vec3::scale(p, 1.0 / fourth.sqrt().sqrt());
        let rough = 1.0
            + 0.20 * fractal(vec3::add(vec3::scale(p, 1.7), [seed; 3]), 2)
            + 0.07 * fractal(vec3::add(vec3::scale(p, 7.0), [seed; 3]), 4);
        let narrow = 1.0 - 0.16 * p[1];
        let [x, y, z] = vec3::scale(boxy, rough);
        [0.52 * x * narrow, 1.45 * y + 0.95, 0.34 * z * narrow]
    });
    Object { name: "standing stone".into(), parts: vec![shape.smooth_part(Palette::Rock.index())] }
}

/// A flat stone of the path.
pub(super) fn flagstone(seed: f32) -> Object {
    let shape = Shape::ball(20).deformed(|p| {
        let rough = 1.0 + 0.35 * fractal([p[0] * 1.3 + seed, seed, p[2] * 1.3], 3);
        let flat = p[1] / (0.2 + 0.8 * p[1].abs());
        let bumps = 0.02 * fractal([p[0] * 5.0, seed, p[2] * 5.0], 3);
        [0.42 * p[0] * rough, 0.06 * flat + bumps, 0.34 * p[2] * rough]
    });
    Object { name: "flagstone".into(), parts: vec![shape.smooth_part(Palette::Rock.index())] }
}
