//! Opened instances: the same bits as unopened ones and as brute force, through every builder, layout and
//! instruction set, after edits too.

use treelet::scene::{Action, LayoutChoice};
use treelet::simd::Level;
use treelet::verify::{self, BruteForce, Random};
use treelet::{Affine, BuildOptions, Counters, Mesh, Quality, Ray, Scene, SceneBuilder, build};
use treelet_testkit::{Shape, awkward, closed};

const SEED: u64 = 0x09E4;

fn mesh(shape: &Shape) -> Mesh {
    Mesh::new(shape.positions.clone(), shape.triangles.clone())
}

/// A long thin tube of small triangles along x.
fn rod() -> Shape {
    let mut random = Random::new(SEED);
    let triangles: Vec<_> = (0..160)
        .map(|i| {
            let x = i as f32 * 0.25;
            [(); 3].map(|()| [x + random.between(0.0, 0.4), random.unit(), random.unit()])
        })
        .collect();
    Shape::soup(&triangles)
}

fn turned(random: &mut Random) -> Affine {
    let scales = [random.between(0.5, 2.0), random.between(-1.5, -0.5), random.between(0.2, 1.0)];
    let offset = [(); 3].map(|()| random.between(-15.0, 15.0));
    Affine::translation(offset)
        .then_from(&Affine::rotation(random.direction(), random.between(0.0, 6.3)))
        .then_from(&Affine::scaling(scales))
}

/// Stretched by up to a hundred between two rotations: what is hit inside is seen from outside a hundred times as far off.
fn uneven(random: &mut Random) -> Affine {
    let scales = [(); 3].map(|()| 0.1 * 10.0_f32.powi(random.below(3) as i32));
    turned(random)
        .then_from(&Affine::scaling(scales))
        .then_from(&Affine::rotation(random.direction(), random.between(0.0, 6.3)))
}

/// Rods, crossed, and something round among them; then all of that once more inside another level.
fn crossed(options: &BuildOptions<'_>) -> Scene {
    let mut random = Random::new(SEED);
    let only = |shape: &Shape| Scene::builder().mesh(mesh(shape)).build(options).unwrap();
    let objects = [only(&rod()), only(&closed::sphere(12, 6)), only(&rod())];
    let crowd = |count: usize, objects: &[Scene], random: &mut Random| {
        let add = |crowd: SceneBuilder, i: usize| {
            crowd.instance(&objects[i % objects.len()], turned(random))
        };
        (0..count).fold(Scene::builder().mesh(mesh(&awkward::coplanar_grid(3))), add)
    };
    let inner = crowd(20, &objects, &mut random).build(options).unwrap();
    let [rod, sphere, _] = objects;
    crowd(24, &[rod, inner, sphere], &mut random).build(options).unwrap()
}

fn same(scene: &Scene, reference: &Scene, rays: &[Ray], name: &str) {
    for ray in rays {
        assert_eq!(scene.closest(ray), reference.closest(ray), "{name}: {ray:?}");
        assert_eq!(scene.any(ray), reference.any(ray), "{name}: {ray:?}");
        assert_eq!(scene.all(ray), reference.all(ray), "{name}: {ray:?}");
        assert_eq!(scene.count(ray), reference.count(ray), "{name}: {ray:?}");
    }
}

#[test]
fn opened_and_unopened_are_the_same_bits_through_every_builder() {
    let closed = BuildOptions { open_instances: false, ..BuildOptions::default() };
    let reference = crossed(&closed);
    assert_eq!(reference.report().opened_instances, 0);
    let rays = verify::rays(&reference, 250, SEED);
    let brute = BruteForce::new(&reference);
    verify::check_many(&reference, &rays[..60], |ray| brute.all(ray)).unwrap();
    for &builder in build::ALL {
        let name = builder.info().name;
        let options = BuildOptions { builder: Some(builder), ..BuildOptions::default() };
        let scene = crossed(&options);
        let report = scene.report();
        assert_eq!(report.instances, 24, "{name}");
        assert!(report.opened_instances > 0, "{name}: nothing was opened");
        same(&scene, &reference, &rays, name);
    }
}

#[test]
fn every_layout_and_level_opens_alike() {
    let closed = BuildOptions { open_instances: false, ..BuildOptions::default() };
    let reference = crossed(&closed);
    let rays = verify::rays(&reference, 150, SEED + 1);
    for &level in Level::ALL.iter().filter(|level| level.is_available()) {
        for &layout in LayoutChoice::ALL {
            let options = BuildOptions { level, layout: Some(layout), ..BuildOptions::default() };
            let scene = crossed(&options);
            assert!(scene.report().opened_instances > 0);
            let name = format!("{} {}", layout.info().name, level.name());
            same(&scene, &reference, &rays, &name);
            let mut hits = vec![treelet::Hit::MISS; rays.len()];
            scene.closest_many(&rays, &mut hits).unwrap();
            for (ray, hit) in rays.iter().zip(hits) {
                assert_eq!(Some(hit).filter(|hit| hit.is_hit()), reference.closest(ray), "{name}");
            }
        }
    }
}

/// Rays at points of triangles of the largest of opened instances, from far and near: those whose hits lie at
/// the very edge of the boxes.
#[test]
fn nothing_is_lost_at_the_edges_of_parts() {
    let mut random = Random::new(SEED + 2);
    let plane = Mesh::new(
        [[0.0, 0.0, 0.0], [64.0, 0.0, 0.0], [64.0, 1.0, 0.0], [0.0, 1.0, 0.0]]
            .into_iter()
            .chain((0..65).flat_map(|i| [[i as f32, 0.0, 0.0], [i as f32, 1.0, 0.0]]))
            .collect::<Vec<_>>(),
        (0..64)
            .flat_map(|i| {
                let k = 4 + 2 * i;
                [[k, k + 2, k + 1], [k + 1, k + 2, k + 3]]
            })
            .collect::<Vec<_>>(),
    );
    let options = BuildOptions::default();
    let strip = Scene::builder().mesh(plane).build(&options).unwrap();
    for round in 0..12 {
        let maps: Vec<_> = (0..40).map(|_| uneven(&mut random)).collect();
        let add = |scene: SceneBuilder, map: &Affine| scene.instance(&strip, *map);
        let make = |open_instances| {
            let options = BuildOptions { open_instances, ..BuildOptions::default() };
            maps.iter().fold(Scene::builder(), add).build(&options).unwrap()
        };
        let (opened, unopened) = (make(true), make(false));
        assert!(opened.report().opened_instances > 0);
        for _ in 0..400 {
            // Where two parts may meet, seen along the strip and across it.
            let map = &maps[random.below(maps.len() as u64) as usize];
            let target = map.point([random.below(65) as f32, random.below(5) as f32 * 0.25, 0.0]);
            let distance = [0.5, 40.0, 3000.0][random.below(3) as usize];
            let way = random.direction();
            let origin = [0, 1, 2].map(|axis: usize| target[axis] - distance * way[axis]);
            let ray = Ray::new(origin, way);
            assert_eq!(opened.all(&ray), unopened.all(&ray), "round {round}: {ray:?}");
        }
    }
}

#[test]
fn opening_saves_visits() {
    let options = BuildOptions::default();
    let rod = Scene::builder().mesh(mesh(&rod())).build(&options).unwrap();
    let make = |open_instances| {
        let mut random = Random::new(SEED);
        let add = |scene: SceneBuilder, _| scene.instance(&rod, turned(&mut random));
        let options = BuildOptions { open_instances, ..BuildOptions::default() };
        (0..200).fold(Scene::builder(), add).build(&options).unwrap()
    };
    let [opened, unopened] = [make(true), make(false)];
    let count = |scene: &Scene| {
        let mut counters = Counters::default();
        for ray in verify::rays(&unopened, 400, SEED) {
            scene.closest_counted(&ray, &mut counters);
        }
        counters.instances
    };
    let [with, without] = [count(&opened), count(&unopened)];
    assert!(with * 10 < without * 9, "{with} instances entered with opening, {without} without");
}

#[test]
fn quick_builds_open_nothing() {
    for quality in [Quality::Fastest, Quality::Fast, Quality::Rays(1000)] {
        let scene = crossed(&BuildOptions { quality, ..BuildOptions::default() });
        assert_eq!(scene.report().opened_instances, 0, "{quality:?}");
    }
}

#[test]
fn edits_of_opened_scenes_are_as_built_anew() {
    let options = BuildOptions::default();
    let mut scene = crossed(&options);
    let mut random = Random::new(SEED + 3);
    let mut refitted = 0;
    for round in 0..24 {
        let mut edit = scene.edit();
        let at = random.below(24) as usize;
        let kind = round % 4;
        match kind {
            // One turns in place: its own box may stay where those of its parts do not.
            0 => edit
                .set_transform(
                    at,
                    scene
                        .world_from_object(scene_rank(&scene, at))
                        .unwrap()
                        .then_from(&Affine::rotation([1.0, 0.0, 0.0], 0.5)),
                )
                .unwrap(),
            1 => edit.set_transform(at, turned(&mut random)).unwrap(),
            2 => (0..24).for_each(|at| edit.set_transform(at, turned(&mut random)).unwrap()),
            // Another tree inside.
            _ => {
                let other = Scene::builder().mesh(mesh(&closed::sphere(9, 5))).build(&options);
                edit.set_scene(at, &other.unwrap()).unwrap();
            }
        }
        let commit = edit.commit(&options).unwrap();
        refitted += u32::from(commit.action == Action::Refitted);
        scene = commit.scene;
        let rays = verify::rays(&scene, 60, SEED + round);
        let brute = BruteForce::new(&scene);
        verify::check_many(&scene, &rays, |ray| brute.all(ray))
            .unwrap_or_else(|error| panic!("round {round}: {error}"));
    }
    assert!(refitted > 5, "{refitted} refits");
}

/// The first value of `Hit::inst` behind an instance.
fn scene_rank(scene: &Scene, at: usize) -> u64 {
    (1..scene.paths()).find(|&inst| scene.path(inst) == Some(vec![at])).unwrap()
}
