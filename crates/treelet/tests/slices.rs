//! Slices of rays: the same bits as single rays, for every length and order, at every level and in
//! every layout, whatever the rays around a ray are like.

use treelet::scene::LayoutChoice;
use treelet::simd::Level;
use treelet::verify::{self, Random};
use treelet::{Affine, BuildOptions, Hit, Mesh, Ray, Scene, SceneBuilder};
use treelet_testkit::{Shape, awkward, closed, rounds};

const SEED: u64 = 0x511CE;

/// Around the limits of vectors, of bundles and of what counts as many.
const LENGTHS: [usize; 12] = [0, 1, 2, 15, 16, 17, 63, 64, 65, 127, 1000, usize::MAX];

fn mesh(shape: &Shape) -> Mesh {
    Mesh::new(shape.positions.clone(), shape.triangles.clone())
}

/// Every instruction set that this processor has, with every layout.
fn walks() -> impl Iterator<Item = BuildOptions<'static>> {
    let levels = Level::ALL.iter().copied().filter(Level::is_available);
    levels.flat_map(|level| {
        LayoutChoice::ALL.iter().map(move |&layout| BuildOptions {
            level,
            layout: Some(layout),
            ..BuildOptions::default()
        })
    })
}

/// A number's bits, except that both zeros are one place.
fn bits(hit: &Hit) -> [u64; 6] {
    let Hit { t, u, v, prim, geom, inst } = *hit;
    let bits = |x: f32| u64::from((x + 0.0).to_bits());
    [bits(t), bits(u), bits(v), u64::from(prim), u64::from(geom), inst]
}

/// Asks about the rays in slices of each length and holds the answers against single rays.
fn check(name: &str, scene: &Scene, rays: &[Ray]) {
    let closest: Vec<_> = rays.iter().map(|r| scene.closest(r).unwrap_or(Hit::MISS)).collect();
    let any: Vec<_> = rays.iter().map(|ray| scene.any(ray)).collect();
    for length in LENGTHS {
        let length = length.min(rays.len());
        // What the answers held before must not matter.
        let mut hits = vec![Hit { t: -1.0, prim: 7, ..Hit::MISS }; rays.len()];
        let mut found: Vec<bool> = (0..rays.len()).map(|i| i % 2 == 0).collect();
        for start in (0..rays.len()).step_by(length.max(rays.len() / 8).max(1)) {
            let places = start..rays.len().min(start + length);
            scene.closest_many(&rays[places.clone()], &mut hits[places.clone()]).unwrap();
            scene.any_many(&rays[places.clone()], &mut found[places.clone()]).unwrap();
            for i in places {
                let context = || format!("{name}, {length} rays, ray {i}: {:?}", rays[i]);
                assert_eq!(bits(&hits[i]), bits(&closest[i]), "{}", context());
                assert_eq!(found[i], any[i], "{}", context());
            }
        }
    }
}

/// Neighbours from one origin, in tiles, as a camera sends them.
fn camera(scene: &Scene, from: [f32; 3], count: usize) -> Vec<Ray> {
    let bounds = scene.bounds();
    let at: [f32; 3] = std::array::from_fn(|a| 0.5 * (bounds.lo[a] + bounds.hi[a]) - from[a]);
    let size = at.iter().fold(1e-3_f32, |size, x| size.max(x.abs()));
    (0..count)
        .map(|i| {
            let [x, y] = [i % 8 + i / 64 % 4 * 8, i / 8 % 8 + i / 256 % 4 * 8];
            let across = |i: usize| (i as f32 / 16.0 - 1.0) * 0.6 * size;
            Ray::new(from, [at[0] + across(x), at[1] + across(y), at[2] - across(x)])
        })
        .collect()
}

/// Many rays end, or begin, within a bit of what they hit.
fn ending(scene: &Scene, ray: Ray, random: &mut Random) -> Ray {
    let Some(Hit { t, .. }) = scene.closest(&ray) else { return ray };
    match random.below(12) {
        0 => ray.up_to(t),
        1 | 2 => ray.up_to(t.next_down()),
        3 => ray.from(t),
        4 => ray.from(t.next_up()),
        _ => ray,
    }
}

/// Rays that go together, as packets want them: narrow bundles of neighbours, from one point or from
/// points near each other, one bundle a run or several in turn.
fn bundles(scene: &Scene, count: usize) -> Vec<Ray> {
    let mut random = Random::new(SEED);
    let bounds = scene.bounds();
    let inside = |random: &mut Random, wide: f32| -> [f32; 3] {
        std::array::from_fn(|a| {
            let middle = 0.5 * (bounds.lo[a] + bounds.hi[a]);
            middle + wide * random.between(-0.5, 0.5) * (bounds.hi[a] - bounds.lo[a])
        })
    };
    let mut rays = Vec::new();
    while rays.len() < count {
        let from = inside(&mut random, 3.0);
        let in_turn = 1 + random.below(4) as usize;
        let targets: [_; 4] = std::array::from_fn(|_| inside(&mut random, 1.0));
        let spread = [0.0, 1e-6, 1e-3, 0.02, 0.06][random.below(5) as usize];
        let starts = [0.0, 0.0, 1e-3, 0.03][random.below(4) as usize];
        let run = if random.below(4) == 0 { 100 } else { 256 };
        for i in 0..run {
            let target = targets[i % in_turn];
            let origin: [f32; 3] = std::array::from_fn(|a| {
                from[a] + starts * random.between(-0.5, 0.5) * (bounds.hi[a] - bounds.lo[a])
            });
            let to: [f32; 3] = std::array::from_fn(|a| target[a] - from[a]);
            let size = to.iter().fold(1e-3_f32, |size, x| size.max(x.abs()));
            let turned = to.map(|x| x + spread * size * random.between(-0.5, 0.5));
            rays.push(ending(scene, Ray::new(origin, turned), &mut random));
        }
    }
    rays
}

/// Rays of every kind, coherent and not, with limits, masks and defects.
fn mixed(scene: &Scene, count: usize) -> Vec<Ray> {
    let mut random = Random::new(SEED);
    let bounds = scene.bounds();
    let out = |share: f32| -> [f32; 3] {
        std::array::from_fn(|a| bounds.lo[a] + share * (bounds.hi[a] - bounds.lo[a]))
    };
    let mut rays = verify::rays(scene, count, SEED);
    rays.extend(camera(scene, out(1.7), count));
    rays.extend(camera(scene, out(0.4), count / 2));
    rays.extend(bundles(scene, 2 * count));
    for i in 0..rays.len() {
        let ray = &mut rays[i];
        match random.below(24) {
            0 => ray.t_max = random.unit(),
            1 => ray.t_min = -1.0,
            2 => (ray.t_min, ray.t_max) = (f32::NEG_INFINITY, 0.5),
            3 => ray.t_min = random.unit() * 0.5,
            4 => ray.mask = random.below(4) as u32,
            5 => ray.direction[random.below(3) as usize] = -0.0,
            6 => ray.direction[random.below(3) as usize] = 0.0,
            7 => ray.direction = ray.direction.map(|d| d * 1e20),
            _ => {}
        }
        // Invalid rays may stand anywhere.
        match random.below(60) {
            0 => ray.origin[1] = f32::NAN,
            1 => ray.direction = [0.0; 3],
            2 => ray.direction[2] = f32::INFINITY,
            3 => (ray.t_min, ray.t_max) = (1.0, 0.0),
            4 => ray.t_max = f32::NAN,
            _ => {}
        }
    }
    rays
}

fn shuffled(mut rays: Vec<Ray>) -> Vec<Ray> {
    let mut random = Random::new(SEED);
    for last in (1..rays.len()).rev() {
        rays.swap(last, random.below(last as u64 + 1) as usize);
    }
    rays
}

#[test]
fn slices_answer_like_single_rays_on_awkward_scenes() {
    for awkward in awkward::all(300) {
        for options in walks() {
            let scene = Scene::builder().mesh(mesh(&awkward.shape)).build(&options).unwrap();
            let name = format!("{}, {}, {:?}", awkward.name, options.level.name(), options.layout);
            let rays = mixed(&scene, rounds(500));
            check(&name, &scene, &rays);
            check(&format!("{name}, shuffled"), &scene, &shuffled(rays));
        }
    }
}

#[test]
fn slices_answer_like_single_rays_among_instances_and_masks() {
    for options in walks() {
        let make = |scene: SceneBuilder| scene.build(&options).unwrap();
        let sphere = make(Scene::builder().mesh(mesh(&closed::sphere(32, 16))));
        let soup = mesh(&awkward::random_triangles(400, 2.0, 0.3));
        let turned =
            Affine::translation([0.5, -0.2, 0.1]).then_from(&Affine::scaling([1.5, -0.5, 1.0]));
        let scene = make(
            Scene::builder()
                .mesh_masked(soup.clone(), 1)
                .mesh_masked(soup, 2)
                .instance(&sphere, turned)
                .instance_masked(&sphere, Affine::IDENTITY, 2)
                .instance(&sphere, Affine::IDENTITY),
        );
        let name = format!("instances, {}, {:?}", options.level.name(), options.layout);
        let rays = mixed(&scene, rounds(1000));
        check(&name, &scene, &rays);
        check(&format!("{name}, shuffled"), &scene, &shuffled(rays));
    }
}

/// More than a batch, and more than a task, of one class.
#[test]
fn long_slices_answer_like_single_rays() {
    let scene = Scene::builder()
        .mesh(mesh(&awkward::random_triangles(3000, 2.0, 0.2)))
        .build(&BuildOptions::default())
        .unwrap();
    let from = std::array::from_fn(|a| scene.bounds().lo[a] - 1.0);
    let mut rays: Vec<Ray> = camera(&scene, from, 70_000);
    rays.extend(verify::rays(&scene, 70_000, SEED));
    rays.extend(bundles(&scene, 70_000));
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut found = vec![false; rays.len()];
    scene.closest_many(&rays, &mut hits).unwrap();
    scene.any_many(&rays, &mut found).unwrap();
    for (i, ray) in rays.iter().enumerate() {
        let single = scene.closest(ray).unwrap_or(Hit::MISS);
        assert_eq!(bits(&hits[i]), bits(&single), "ray {i}: {ray:?}");
        assert_eq!(found[i], single.is_hit(), "ray {i}: {ray:?}");
    }
    let share = found.iter().filter(|&&found| found).count() as f32 / rays.len() as f32;
    assert!((0.1..0.95).contains(&share), "{share} of the rays hit something: that tests little");
}
