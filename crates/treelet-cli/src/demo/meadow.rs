//! What grows on the ground: tufts of grass, and flowers.

use treelet::math::vec3;
use treelet::verify::Random;
use treelet_model::Object;

use super::palette::Palette;

use super::shape::{Ring, Shape, across, turn};

/// A tuft of bent blades, about `size` high.
pub(super) fn tuft(seed: u64, blades: usize, size: f32, material: Palette) -> Object {
    let mut random = Random::new(seed);
    let mut shape = Shape::default();
    for _ in 0..blades {
        let (sin, cos) = turn(random.unit());
        let far = 0.45 * size * random.unit().sqrt();
        let foot = [far * cos, -0.03, far * sin];
        let height = size * random.between(0.55, 1.0);
        // Outer blades lean outward, all of them a little with the wind.
        let lean = [0.5 * far * cos + 0.12 * size, 0.0, 0.5 * far * sin + 0.05 * size];
        let lean = vec3::add(
            lean,
            [random.between(-0.2, 0.2) * size, 0.0, random.between(-0.2, 0.2) * size],
        );
        blade(&mut shape, foot, height, lean, random.between(0.010, 0.018), random.unit());
    }
    Object { name: "grass".into(), parts: vec![shape.flat_part(material.index())] }
}

/// A blade of three segments that narrows to a point.
fn blade(shape: &mut Shape, foot: [f32; 3], height: f32, lean: [f32; 3], width: f32, facing: f32) {
    const SEGMENTS: usize = 3;
    let (sin, cos) = turn(facing);
    let side = [cos, 0.0, sin];
    let edge = |segment: usize, sign: f32| {
        let t = segment as f32 / SEGMENTS as f32;
        // A parabola: upright at the foot, leaning ever more.
        let spine = vec3::add(foot, vec3::scale(lean, t * t));
        let spine = vec3::add(spine, [0.0, height * t * (1.0 - 0.18 * t), 0.0]);
        vec3::add(spine, vec3::scale(side, sign * 0.5 * width * (1.0 - t)))
    };
    for segment in 0..SEGMENTS {
        let (a, b) = (edge(segment, -1.0), edge(segment, 1.0));
        let (c, d) = (edge(segment + 1, 1.0), edge(segment + 1, -1.0));
        shape.push_triangle([a, b, c]);
        if segment + 1 < SEGMENTS {
            shape.push_triangle([a, c, d]);
        }
    }
}

/// A few flowers on thin stalks.
pub(super) fn flowers(seed: u64, count: usize, petals: Palette) -> Object {
    let mut random = Random::new(seed);
    let mut stalks = Shape::default();
    let mut heads = Shape::default();
    let mut hearts = Shape::default();
    for _ in 0..count {
        let (sin, cos) = turn(random.unit());
        let far = 0.28 * random.unit().sqrt();
        let foot = [far * cos, -0.03, far * sin];
        let height = random.between(0.22, 0.42);
        let top =
            vec3::add(foot, [random.between(-0.05, 0.09), height, random.between(-0.06, 0.06)]);
        stalks.append(&Shape::tube(
            &[Ring { center: foot, radius: 0.005 }, Ring { center: top, radius: 0.003 }],
            4,
        ));
        let facing = [random.between(-0.5, 0.5), 1.0, random.between(-0.2, 0.8)];
        let facing = vec3::normalize(facing).unwrap_or([0.0, 1.0, 0.0]);
        head(&mut heads, top, facing, random.between(0.030, 0.045), random.unit());
        let heart = Shape::ball(3).deformed(|p| vec3::add(top, vec3::scale(p, 0.010)));
        hearts.append(&heart);
    }
    let parts = vec![
        stalks.flat_part(Palette::Grass.index()),
        heads.flat_part(petals.index()),
        hearts.smooth_part(Palette::AmberLight.index()),
    ];
    Object { name: "flowers".into(), parts }
}

/// Seven petals around `center`, each of two triangles.
fn head(shape: &mut Shape, center: [f32; 3], facing: [f32; 3], size: f32, start: f32) {
    const PETALS: usize = 7;
    let right = across([1.0, 0.0, 0.0], facing);
    let front = vec3::cross(facing, right);
    let at = |share: f32, far: f32, raised: f32| {
        let (sin, cos) = turn(start + share / PETALS as f32);
        let flat = vec3::add(vec3::scale(right, far * cos), vec3::scale(front, far * sin));
        vec3::add(vec3::add(center, flat), vec3::scale(facing, raised))
    };
    for petal in 0..PETALS {
        let share = petal as f32;
        let base = at(share, 0.0, 0.0);
        let tip = at(share, size, 0.25 * size);
        let [left, right] = [-0.42, 0.42].map(|aside| at(share + aside, 0.72 * size, 0.30 * size));
        shape.push_triangle([base, left, tip]);
        shape.push_triangle([base, tip, right]);
    }
}
