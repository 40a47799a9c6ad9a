//! What moves: at every time the same bits as brute force, from every builder, instruction set and layout, with
//! temporal splits and without; no leaks; and what is wrong with a step is named.

use treelet::bounds::Aabb;
use treelet::geometry::Defect;
use treelet::memory::Array;
use treelet::scene::{InstanceDefect, LayoutChoice, Reason, SEGMENTS_MAX};
use treelet::simd::Level;
use treelet::verify::{self, BruteForce, Random};
use treelet::{
    Affine, BuildOptions, Hit, Invalid, Mesh, Quality, Ray, Scene, SceneBuilder, SceneError, build,
};
use treelet_testkit::{Noise, Shape, awkward, closed, rounds};

const SEED: u64 = 0x0710;

/// A shape at several steps.
fn moving(shape: &Shape, steps: usize, map: impl Fn(usize, usize, [f32; 3]) -> [f32; 3]) -> Mesh {
    let at = |step: usize| -> Array<[f32; 3]> {
        let moved = shape.positions.iter().enumerate().map(|(vertex, &p)| map(step, vertex, p));
        moved.collect::<Vec<_>>().into()
    };
    Mesh::moving((0..steps).map(at), shape.triangles.clone())
}

fn mesh(shape: &Shape) -> Mesh {
    Mesh::new(shape.positions.clone(), shape.triangles.clone())
}

/// A shape that turns by `angle` about the z axis through a point, in so many steps.
fn turning(shape: &Shape, steps: usize, angle: f32, about: [f32; 3]) -> Mesh {
    moving(shape, steps, |step, _, p| {
        let part = angle * step as f32 / (steps - 1) as f32;
        let map = Affine::translation(about)
            .then_from(&Affine::rotation([0.0, 0.0, 1.0], part))
            .then_from(&Affine::translation(about.map(|x| -x)));
        map.point(p)
    })
}

/// Every vertex on a way of its own.
fn jittered(shape: &Shape, steps: usize, far: f32, seed: u64) -> Mesh {
    let mut noise = Noise::new(seed);
    let offsets: Vec<[f32; 3]> =
        (0..steps * shape.positions.len()).map(|_| noise.point(-far, far)).collect();
    moving(shape, steps, |step, vertex, p| {
        let by = offsets[step * shape.positions.len() + vertex];
        [p[0] + by[0], p[1] + by[1], p[2] + by[2]]
    })
}

/// Blades around the z axis.
fn propeller() -> Shape {
    let mut noise = Noise::new(3);
    let mut blades = Vec::new();
    for blade in 0..3 {
        let turn = Affine::rotation([0.0, 0.0, 1.0], blade as f32 * 2.1);
        for i in 0..60 {
            let x = 0.1 + i as f32 / 20.0;
            let y = noise.between(-0.1, 0.1);
            let corners = [[x, y - 0.05, 0.0], [x + 0.08, y, 0.02], [x, y + 0.05, 0.01]];
            blades.push(corners.map(|p| turn.point(p)));
        }
    }
    Shape::soup(&blades)
}

/// The scenes, each as described by a builder.
fn scenes(options: &BuildOptions<'_>) -> Vec<(&'static str, Scene)> {
    let make = |scene: SceneBuilder| scene.build(options).unwrap();
    let soup = awkward::random_triangles(60, 2.0, 1.0);
    let sphere = closed::sphere(12, 6);
    let far = sphere.clone().mapped(closed::far_away);
    let inner = make(Scene::builder().mesh(jittered(&soup, 3, 0.5, 1)).mesh(mesh(&sphere)));
    let standing = make(Scene::builder().mesh(mesh(&soup)));
    let turn = |angle: f32, at: [f32; 3], scale: [f32; 3]| {
        Affine::translation(at)
            .then_from(&Affine::rotation([0.3, 1.0, -0.4], angle))
            .then_from(&Affine::scaling(scale))
    };
    let way = [
        turn(0.0, [0.0; 3], [1.0, 2.0, 0.5]),
        turn(3.0, [3.0, 1.0, 0.0], [1.5, 1.0, 0.1]),
        turn(4.0, [3.0, -2.0, 5.0], [0.5, 1.0, 1.0]),
        turn(4.0, [-3.0, -2.0, 5.0], [0.5, 1.0, 1.0]),
    ];
    let mirrored = way.map(|map| map.then_from(&Affine::scaling([-1.0, 1.0, 1.0])));
    let nested = make(
        Scene::builder().instance_moving(&inner, &way[..2]).instance(&standing, Affine::IDENTITY),
    );
    let masks = (0..8_u32).fold(Scene::builder(), |masks, bit| {
        let scene = masks.mesh_masked(jittered(&soup, 2, 1.0, u64::from(bit)), 1 << (4 * bit));
        scene.instance_moving_masked(&standing, &way, 2 << (4 * bit))
    });
    let wild = moving(&soup, 4, |step, _, p| p.map(|x| x * [1.0, 1e4, 1e-3, 1e9][step]));
    vec![
        ("jitter", make(Scene::builder().mesh(jittered(&soup, 2, 0.3, 5)))),
        ("one triangle", {
            let one = Shape { triangles: soup.triangles[..1].to_vec(), ..soup.clone() };
            make(Scene::builder().mesh(jittered(&one, 5, 1.0, 6)))
        }),
        ("propeller", make(Scene::builder().mesh(turning(&propeller(), 17, 6.0, [0.0; 3])))),
        (
            "far away",
            make(Scene::builder().mesh(turning(&far, 5, 1.0, closed::far_away([0.0; 3])))),
        ),
        ("wild", make(Scene::builder().mesh(wild))),
        ("beside others", {
            let some = Scene::builder().mesh(mesh(&sphere)).mesh(jittered(&soup, 3, 0.5, 7));
            make(some.instance(&standing, way[1]).mesh(turning(&sphere, 3, 1.0, [2.0, 0.0, 0.0])))
        }),
        ("a moving instance", make(Scene::builder().instance_moving(&standing, &way))),
        ("mirrored", make(Scene::builder().instance_moving(&standing, &mirrored))),
        ("nested", make(Scene::builder().instance_moving(&nested, &way).mesh(mesh(&sphere)))),
        ("masks", make(masks)),
    ]
}

/// Rays for a scene, at times that look for trouble.
fn rays(scene: &Scene, count: usize, seed: u64) -> Vec<Ray> {
    let mut random = Random::new(seed);
    let mut rays = verify::rays(scene, count, seed);
    // Toward places where something is at some time.
    let Aabb { lo, hi } = scene.bounds();
    for i in 0..count {
        let mut at = |axis: usize| random.between(lo[axis], hi[axis]);
        let (from, to) = ([at(0), at(1), at(2)], [at(0), at(1), at(2)]);
        let direction = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
        let ray = Ray::new(from, direction);
        if ray.is_valid() {
            rays.push(if i % 3 == 0 { ray.up_to(1.0) } else { ray });
        }
    }
    for (i, ray) in rays.iter_mut().enumerate() {
        ray.time = match i % 8 {
            0 => 0.0,
            1 => 1.0,
            2 => [0.25, 0.5, 0.75, 1.0 / 3.0, 2.0 / 3.0][random.below(5) as usize],
            3 => 1.0_f32.next_down(),
            4 => [-1.0, 2.0, f32::INFINITY, -0.0][random.below(4) as usize],
            _ => random.unit(),
        };
        if i % 5 == 0 {
            ray.mask = random.bits() as u32;
        }
    }
    rays
}

fn hold(name: &str, scene: &Scene, rays: &[Ray]) {
    let brute = BruteForce::new(scene);
    if let Err(mismatch) = verify::check_many(scene, rays, |ray| brute.all(ray)) {
        panic!("{name}: {mismatch}");
    }
    // Slices, too.
    let mut hits = vec![Hit::MISS; rays.len()];
    scene.closest_many(rays, &mut hits).unwrap();
    let mut found = vec![false; rays.len()];
    scene.any_many(rays, &mut found).unwrap();
    for ((ray, hit), found) in rays.iter().zip(&hits).zip(&found) {
        let single = scene.closest(ray);
        assert_eq!(single.unwrap_or(Hit::MISS), *hit, "{name}: {ray:?}");
        assert_eq!(single.is_some(), *found, "{name}: {ray:?}");
    }
}

#[test]
fn every_builder_answers_like_brute_force() {
    for &builder in build::ALL {
        let options = BuildOptions { builder: Some(builder), ..BuildOptions::default() };
        for (name, scene) in scenes(&options) {
            let rays = rays(&scene, rounds(60), SEED);
            hold(&format!("{name}, {}", builder.info().name), &scene, &rays);
        }
    }
}

#[test]
fn every_level_and_layout_answers_like_brute_force() {
    for level in Level::ALL.iter().copied().filter(Level::is_available) {
        for &layout in LayoutChoice::ALL {
            let layout = Some(layout);
            let options = BuildOptions { level, layout, ..BuildOptions::default() };
            for (name, scene) in scenes(&options) {
                assert!(scene.is_moving());
                let rays = rays(&scene, rounds(100), SEED);
                hold(&format!("{name}, {}, {layout:?}", level.name()), &scene, &rays);
            }
        }
    }
}

#[test]
fn hits_are_met_at_other_times_than_the_first() {
    let mut later = 0;
    for (_, scene) in scenes(&BuildOptions::default()) {
        for ray in rays(&scene, 100, SEED) {
            later += usize::from(scene.closest(&ray) != scene.closest(&ray.at_time(0.0)));
        }
    }
    assert!(later > 300, "{later} rays differ from what they meet at time 0");
}
