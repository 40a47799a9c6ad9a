//! Instances: the same bits as brute force, the same places as flattened meshes, numbers in
//! depth-first order, and nothing that is nested too deeply or placed nowhere does harm.

use treelet::verify::{self, BruteForce, Random};
use treelet::{
    Affine, BuildOptions, Counters, Hit, Invalid, Mesh, Ray, Scene, SceneBuilder, SceneError,
};
use treelet::{build, scene::InstanceDefect};
use treelet_testkit::{Shape, awkward, closed};

const SEED: u64 = 0x1257;

fn mesh(shape: &Shape) -> Mesh {
    Mesh::new(shape.positions.clone(), shape.triangles.clone())
}

fn built(builder: SceneBuilder) -> Scene {
    builder.build(&BuildOptions::default()).unwrap()
}

fn of(shape: &Shape) -> Scene {
    built(Scene::builder().mesh(mesh(shape)))
}

fn shear() -> Affine {
    Affine([[1.0, 0.7, -0.2, 4.0], [0.0, 1.0, 1.5, -3.0], [0.1, 0.0, -1.0, 9.0]])
}

fn random_map(random: &mut Random, least: f32, most: f32) -> Affine {
    let scales = [(); 3].map(|()| {
        let size = least * (most / least).powf(random.unit());
        if random.below(2) == 0 { -size } else { size }
    });
    let offset = [(); 3].map(|()| random.between(-20.0, 20.0));
    Affine::translation(offset)
        .then_from(&Affine::rotation(random.direction(), random.between(0.0, 6.3)))
        .then_from(&Affine::scaling(scales))
        .then_from(&Affine::rotation(random.direction(), random.between(0.0, 6.3)))
}

/// A scene for every way in which instances can be awkward.
fn scenes(builder: &dyn build::Builder) -> Vec<(&'static str, Scene)> {
    let make = |scene: SceneBuilder| {
        scene.build(&BuildOptions { builder: Some(builder), ..BuildOptions::default() }).unwrap()
    };
    let only = |shape: &Shape| make(Scene::builder().mesh(mesh(shape)));
    let sphere = only(&closed::sphere(16, 8));
    let soup = only(&awkward::random_triangles(100, 2.0, 1.0));
    let flat = only(&awkward::coplanar_grid(6));
    let empty = only(&Shape::default());
    let far = Affine::translation(closed::far_away([0.0; 3]));
    let mut random = Random::new(SEED);

    let crowd = (0..60).fold(Scene::builder(), |crowd, i| {
        crowd.instance([&sphere, &soup, &flat][i % 3], random_map(&mut random, 0.3, 3.0))
    });
    let crowd = make(crowd);
    let mut nested = soup.clone();
    for level in 0..6 {
        let map = random_map(&mut random, 0.5, 2.0);
        let outer = Scene::builder().instance(&nested, map).instance(&sphere, Affine::IDENTITY);
        nested = make(if level % 2 == 0 { outer.mesh(mesh(&closed::cube())) } else { outer });
    }
    // Many paths to one mesh, and everything at the same place: every tie there is.
    let mut shared = only(&closed::cube());
    for _ in 0..4 {
        let twice = Scene::builder().instance(&shared, Affine::IDENTITY);
        shared = make(twice.instance(&shared, Affine::IDENTITY));
    }
    let wild = (0..30).fold(Scene::builder(), |wild, _| {
        wild.instance(&sphere, random_map(&mut random, 1e-3, 1e3))
    });
    let single = |scene: &Scene, map| make(Scene::builder().instance(scene, map));
    let masks = (0..32_u32).fold(Scene::builder(), |masks, bit| {
        masks.instance_masked(&soup, random_map(&mut random, 0.5, 2.0), 1 << bit)
    });
    vec![
        ("a crowd", crowd.clone()),
        (
            "a crowd and a mesh",
            make(Scene::builder().instance(&crowd, shear()).mesh(mesh(&closed::cube()))),
        ),
        ("six levels", nested),
        ("the same place sixteen times", shared),
        ("wild scales", make(wild)),
        ("identity", single(&soup, Affine::IDENTITY)),
        ("mirrored", single(&soup, Affine::scaling([-1.0, 1.0, 1.0]))),
        ("sheared", single(&soup, shear())),
        ("flattened", single(&sphere, Affine::scaling([1.0, 1e-5, 1.0]))),
        ("scaled by 1e-18", single(&soup, Affine::scaling([1e-18; 3]))),
        ("scaled by 1e17", single(&soup, Affine::scaling([1e17; 3]))),
        (
            "scaled by 1e17, then 1e-17",
            single(&single(&soup, Affine::scaling([1e17; 3])), Affine::scaling([1e-17; 3])),
        ),
        ("far away", single(&crowd, far)),
        (
            "empty inside",
            make(
                Scene::builder()
                    .instance(&empty, shear())
                    .instance(&soup, shear())
                    .instance(&single(&empty, shear()), far),
            ),
        ),
        ("nothing but empty", single(&single(&empty, shear()), far)),
        ("masks", make(masks)),
    ]
}

#[test]
fn every_builder_answers_like_brute_force() {
    for &builder in build::ALL {
        let name = builder.info().name;
        for (what, scene) in scenes(builder) {
            let brute = BruteForce::new(&scene);
            let mut rays = verify::rays(&scene, 300, SEED);
            let mut random = Random::new(SEED);
            rays.iter_mut().step_by(3).for_each(|ray| ray.mask = random.bits() as u32);
            if let Err(mismatch) = verify::check_many(&scene, &rays, |ray| brute.all(ray)) {
                panic!("{what}, {name}, seed {SEED:#x}: {mismatch}");
            }
            let hits: usize = rays.iter().map(|ray| brute.all(ray).len()).sum();
            assert!(hits > 20 || scene.bounds().is_empty(), "{what}: only {hits} hits");
        }
    }
}

/// Twice the largest ratio by which a map's parts stretch space, for error bounds.
fn row_sum(map: &Affine) -> f64 {
    let sum = |row: &[f32; 4]| row[..3].iter().map(|x| f64::from(x.abs())).sum::<f64>();
    map.0.iter().map(sum).fold(0.0, f64::max)
}

/// Which side of each edge of the transformed triangle the ray passes, in f64; the least distance
/// to an edge, as a share of the triangle's size; and `t`.
fn flat_meeting(corners: [[f64; 3]; 3], ray: &Ray) -> (bool, f64, f64) {
    let sub = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let (o, d) = (ray.origin.map(f64::from), ray.direction.map(f64::from));
    let [a, b, c] = corners.map(|corner| sub(corner, o));
    let volumes = [dot(d, cross(c, b)), dot(d, cross(a, c)), dot(d, cross(b, a))];
    let sum: f64 = volumes.iter().sum();
    let weights = volumes.map(|volume| volume / sum);
    let normal = cross(sub(b, a), sub(c, a));
    let (size, length) = (dot(normal, normal).sqrt(), dot(d, d).sqrt());
    // Seen from the side, `t` and the weights are worth less.
    let margin = weights.iter().map(|w| w.abs()).fold(f64::INFINITY, f64::min);
    let slant = dot(normal, d).abs() / (size * length);
    let inside = weights.iter().all(|&w| w >= 0.0);
    (inside, margin * slant, dot(normal, a) / dot(normal, d))
}

#[test]
fn flattened_meshes_are_hit_in_the_same_places() {
    let mut random = Random::new(SEED);
    let (mut sure_hits, mut sure_misses) = (0, 0);
    for round in 0..40 {
        let shape = awkward::random_triangles(30, 3.0, 2.0);
        let (inner, outer) = (random_map(&mut random, 0.3, 3.0), random_map(&mut random, 0.3, 3.0));
        let middle = built(Scene::builder().instance(&of(&shape), inner));
        let scene = built(Scene::builder().instance(&middle, outer));
        let image = |map: &Affine, p: [f64; 3]| -> [f64; 3] {
            let row = |r: [f32; 4]| {
                let [x, y, z, w] = r.map(f64::from);
                x * p[0] + y * p[1] + z * p[2] + w
            };
            map.0.map(row)
        };
        let flat: Vec<[[f64; 3]; 3]> = shape
            .triangles
            .iter()
            .map(|t| t.map(|v| shape.positions[v as usize].map(f64::from)))
            .map(|corners| corners.map(|p| image(&outer, image(&inner, p))))
            .collect();
        // Inverting and applying two maps: errors grow with the condition of each.
        let condition = |map: &Affine| row_sum(map) * row_sum(&map.inverse().unwrap());
        let reach = f64::from(scene.bounds().max_abs()) * 2.0;
        let epsilon = f64::from(f32::EPSILON) * 32.0 * condition(&inner) * condition(&outer);
        for ray in verify::rays(&scene, 500, SEED + round) {
            let ray = ray.from(f32::NEG_INFINITY).up_to(f32::INFINITY);
            let hits = scene.all(&ray);
            for (prim, &corners) in flat.iter().enumerate() {
                let (inside, margin, t) = flat_meeting(corners, &ray);
                let length = ray.direction.iter().fold(0.0, |l: f64, &x| l.max(f64::from(x.abs())));
                // Lengths relative to the triangle's: one of size 2 in a reach of up to hundreds.
                let size = (0..3)
                    .map(|i| {
                        (corners[0][i] - corners[1][i])
                            .abs()
                            .max((corners[0][i] - corners[2][i]).abs())
                    })
                    .fold(0.0, f64::max);
                let band = epsilon * reach / size;
                if margin < 10.0 * band || margin.is_nan() {
                    continue;
                }
                let hit = hits.iter().find(|hit| hit.prim as usize == prim);
                let place = || format!("round {round}, {ray:?}, prim {prim}, margin {margin}");
                assert_eq!(hit.is_some(), inside, "{}", place());
                if let Some(hit) = hit {
                    sure_hits += 1;
                    assert_eq!((hit.inst, hit.geom), (2, 0), "{}", place());
                    let off = (f64::from(hit.t) - t).abs() * length;
                    // A plane seen at a slant moves `t` by its error over the slant's sine; the
                    // margin is at most that sine.
                    let bound = epsilon * reach / margin;
                    assert!(off <= bound, "{}: t {} for {t}, off by {off}", place(), hit.t);
                } else {
                    sure_misses += 1;
                }
            }
        }
    }
    assert!(sure_hits > 5000 && sure_misses > 20_000, "{sure_hits} hits, {sure_misses} misses");
}

#[test]
fn ranks_are_depth_first() {
    let leaf = of(&closed::cube());
    let pair = built(Scene::builder().instance(&leaf, shear()).instance(&leaf, Affine::IDENTITY));
    let move_by = |x: f32| Affine::translation([x, 0.0, 0.0]);
    let top = built(
        Scene::builder()
            .instance(&leaf, move_by(1.0))
            .instance(&pair, move_by(2.0))
            .instance(&leaf, move_by(3.0))
            .instance(&pair, shear()),
    );
    let paths: [&[usize]; 9] = [&[], &[0], &[1], &[1, 0], &[1, 1], &[2], &[3], &[3, 0], &[3, 1]];
    assert_eq!(top.paths(), 9);
    for (inst, path) in paths.iter().enumerate() {
        assert_eq!(top.path(inst as u64).as_deref(), Some(*path), "rank {inst}");
    }
    for inst in [9, 10, u64::MAX] {
        assert_eq!((top.path(inst), top.world_from_object(inst)), (None, None));
    }
    assert_eq!(top.world_from_object(0), Some(Affine::IDENTITY));
    assert_eq!(top.world_from_object(3), Some(move_by(2.0).then_from(&shear())));
    assert_eq!(top.world_from_object(4), Some(move_by(2.0)));
    assert_eq!(top.world_from_object(8), Some(shear()));
    // Every rank that a ray reports is the rank of the path that leads to what it hit.
    for ray in verify::rays(&top, 2000, SEED) {
        for hit in top.all(&ray) {
            assert!([1, 3, 4, 5, 7, 8].contains(&hit.inst), "{hit:?}");
            let corners = top.corners(&hit).unwrap();
            let map = top.world_from_object(hit.inst).unwrap();
            let [a, b, c] = corners.map(|corner| map.point(corner));
            let w = 1.0 - hit.u - hit.v;
            for axis in 0..3 {
                let there = w * a[axis] + hit.u * b[axis] + hit.v * c[axis];
                let here = ray.at(hit.t)[axis];
                assert!((there - here).abs() < 1e-4, "{ray:?}, {hit:?}: {there} for {here}");
            }
        }
    }
}

#[test]
fn normals_stand_on_the_surface_and_point_out() {
    // A closed mesh with outward normals keeps them under any map, mirrored or not.
    let sphere = of(&closed::sphere(16, 8));
    let mut random = Random::new(SEED);
    let mut maps = vec![Affine::IDENTITY, Affine::scaling([-1.0, 1.0, 1.0]), shear()];
    maps.extend([1e-18, 1e-12, 1e12, 1e17].map(|s| Affine::scaling([s; 3])));
    maps.extend((0..30).map(|_| random_map(&mut random, 0.2, 5.0)));
    for map in maps {
        let scene = built(Scene::builder().instance(&sphere, map));
        let center = map.point([0.0; 3]);
        for _ in 0..100 {
            let target = map.point(random.direction().map(|x| x * 3.0));
            let ray = Ray::new(center, std::array::from_fn(|i| target[i] - center[i]));
            let hit = scene.closest(&ray).unwrap_or_else(|| panic!("{map:?}, {ray:?}"));
            let normal = scene.normal(&ray, &hit).unwrap_or_else(|| panic!("{map:?}, {hit:?}"));
            let dot = |a: [f32; 3], b: [f32; 3]| -> f64 {
                (0..3).map(|i| f64::from(a[i]) * f64::from(b[i])).sum()
            };
            assert!((dot(normal, normal) - 1.0).abs() < 1e-6, "{normal:?} is not of length 1");
            assert!(dot(normal, ray.direction) > 0.0, "{map:?}: {normal:?} points inward");
            let [a, b, _] = scene.corners(&hit).unwrap();
            let edge: [f32; 3] = map.vector(std::array::from_fn(|i| b[i] - a[i]));
            let slope = dot(normal, edge) / dot(edge, edge).sqrt();
            assert!(slope.abs() < 1e-5, "{map:?}: {normal:?} leans by {slope}");
        }
    }
    // A tiny triangle is not a degenerate one.
    let tiny = Mesh::new([[0.0; 3], [1e-30, 0.0, 0.0], [0.0, 1e-30, 0.0]], [[0, 1, 2]]);
    let scene = built(Scene::builder().mesh(tiny));
    let ray = Ray::new([2e-31, 2e-31, -1.0], [0.0, 0.0, 1.0]);
    let hit = Hit { t: 1.0, u: 0.2, v: 0.2, prim: 0, geom: 0, inst: 0 };
    assert_eq!(scene.normal(&ray, &hit), Some([0.0, 0.0, 1.0]));
    for stranger in
        [Hit { prim: 1, ..hit }, Hit { geom: 1, ..hit }, Hit { inst: 1, ..hit }, Hit::MISS]
    {
        assert_eq!((scene.normal(&ray, &stranger), scene.corners(&stranger)), (None, None));
    }
}

#[test]
fn maps_that_lead_nowhere_are_named_or_skipped() {
    let cube = of(&closed::cube());
    let entry = |row: usize, column: usize, value: f32| {
        let mut map = shear();
        map.0[row][column] = value;
        map
    };
    let bad = [
        entry(0, 1, f32::NAN),
        entry(2, 3, f32::INFINITY),
        entry(1, 0, f32::NEG_INFINITY),
        Affine([[0.0; 4]; 3]),
        Affine::scaling([1.0, 0.0, 1.0]),
        Affine([[1.0, 2.0, 3.0, 0.0], [2.0, 4.0, 6.0, 0.0], [0.0, 1.0, 0.0, 0.0]]),
        Affine::scaling([1e-45, 1.0, 1.0]),
        Affine::scaling([5e18; 3]),
        Affine::translation([0.0, -5e18, 0.0]),
        Affine::scaling([f32::MAX; 3]),
    ];
    let good = Affine::translation([5.0, 0.0, 0.0]);
    for (i, map) in bad.into_iter().enumerate() {
        let builder = Scene::builder().instance(&cube, good).instance(&cube, map);
        let builder = builder.instance(&cube, Affine::IDENTITY);
        let strict = BuildOptions { invalid: Invalid::Error, ..BuildOptions::default() };
        let error = builder.clone().build(&strict).unwrap_err();
        let SceneError::Instance { instance: 1, defect } = error else {
            panic!("map {i}, {map:?}: {error}");
        };
        match defect {
            InstanceDefect::NotFinite { .. } => assert!(i < 3, "map {i}: {defect}"),
            InstanceDefect::Singular { .. } => assert!((3..7).contains(&i), "map {i}: {defect}"),
            InstanceDefect::Scale { .. } => assert_eq!(i, 9, "{defect}"),
            InstanceDefect::TooFar { .. } => assert!([7, 8].contains(&i), "map {i}: {defect}"),
            _ => panic!("map {i}: {defect}"),
        }
        assert!(error.to_string().contains("instance 1"), "{error}");

        let scene = built(builder);
        let report = scene.report();
        assert_eq!((report.skipped.instances, report.instances), (1, 2), "map {i}");
        let Some((1, skipped)) = report.skipped.first_instance else { panic!("map {i}") };
        assert_eq!(skipped.to_string(), defect.to_string());
        // The third instance is still the third.
        let hit = scene.closest(&Ray::new([0.5, 0.4, -3.0], [0.0, 0.0, 1.0])).unwrap();
        assert_eq!(scene.path(hit.inst), Some(vec![2]), "map {i}");
    }
}

#[test]
fn what_is_empty_keeps_its_number_and_lies_nowhere() {
    let empty = built(Scene::builder());
    let cube = of(&closed::cube());
    let scene = built(
        Scene::builder()
            .instance(&empty, Affine::translation([4e18; 3]))
            .instance(&cube, Affine::IDENTITY)
            .instance(&empty, Affine::IDENTITY),
    );
    assert_eq!(scene.report().empty_instances, 2);
    // Conservative, so a rounding larger; the empty ones do not count.
    assert!(scene.bounds().contains(&cube.bounds()) && scene.bounds().diagonal() < 1.74);
    assert_eq!((scene.paths(), scene.instances()), (4, 3));
    let hit = scene.closest(&Ray::new([0.5, 0.4, -3.0], [0.0, 0.0, 1.0])).unwrap();
    assert_eq!((hit.inst, hit.t), (2, 3.0));
}

/// The depth to which scenes are nested below; recursion would need far more stack than there is.
const DEEP: usize = 100_000;

fn on_a_small_stack(work: impl FnOnce() + Send + 'static) {
    let thread = std::thread::Builder::new().stack_size(256 * 1024);
    thread.spawn(work).unwrap().join().unwrap();
}

#[test]
fn a_hundred_thousand_levels_build_answer_and_drop() {
    on_a_small_stack(|| {
        let mut scene = of(&closed::cube());
        for _ in 0..DEEP {
            scene = built(Scene::builder().instance(&scene, Affine::translation([0.5, 0.0, 0.0])));
        }
        assert_eq!(scene.paths(), DEEP as u64 + 1);
        let there = 0.5 * DEEP as f32 + 0.25;
        let ray = Ray::new([there, 0.5, -1.0], [0.0, 0.0, 1.0]);
        let hit = scene.closest(&ray).expect("the cube is there");
        assert_eq!((hit.inst, scene.count(&ray)), (DEEP as u64, 2));
        assert!(scene.any(&ray));
        assert_eq!(scene.path(hit.inst).unwrap().len(), DEEP);
        assert_eq!(scene.world_from_object(hit.inst).unwrap().0[0][3], 0.5 * DEEP as f32);
        assert_eq!(BruteForce::new(&scene).all(&ray).first(), Some(&hit));
        assert!(scene.trace_bytes() > 0);
        assert!(!format!("{scene:?}").is_empty());
        assert!(!format!("{:?}", Scene::builder().instance(&scene, shear())).is_empty());
        // Turned and scaled at each level: slack without end must not turn into an answer.
        let mut turned = of(&closed::cube());
        for _ in 0..1000 {
            let map = Affine::rotation([1.0, 1.0, 1.0], 0.5);
            turned = built(Scene::builder().instance(&turned, map));
        }
        for seed in 0..100 {
            let mut random = Random::new(seed);
            let away = random.direction().map(|x| x * 30.0);
            let ray = Ray::new([0.0; 3], away);
            let brute = BruteForce::new(&turned).all(&ray);
            verify::check(&turned, &ray, &brute).unwrap();
        }
    });
}

#[test]
fn too_many_paths_is_an_error() {
    let mut scene = of(&closed::cube());
    for level in 1..=64 {
        let twice = Scene::builder()
            .instance(&scene, Affine::IDENTITY)
            .instance(&scene, Affine::translation([1.0, 0.0, 0.0]));
        match twice.build(&BuildOptions::default()) {
            Ok(outer) => {
                assert_eq!(u128::from(outer.paths()), (1 << (level + 1)) - 1);
                scene = outer;
            }
            Err(error) => {
                assert_eq!((level, error), (64, SceneError::TooManyPaths));
                assert!(error.to_string().contains("2^64"), "{error}");
            }
        }
    }
    // The last rank there is leads to the last path.
    let last = scene.paths() - 1;
    assert_eq!((last, scene.path(last)), (u64::MAX - 1, Some(vec![1; 63])));
    assert_eq!(scene.path(u64::MAX), None);
    // 2^63 copies are told apart, and a picture of the scene in words is short.
    let text = format!("{scene:?}");
    assert!(text.len() < 10_000, "{} characters", text.len());
}

/// Culling must not suffer for a neighbour's matrix: a board among cubes costs its own visit only.
#[test]
fn one_thin_board_does_not_switch_culling_off() {
    let cube = of(&closed::cube());
    let crowd = || {
        (0..1000_u32).fold(Scene::builder(), |crowd, i| {
            let at = [i % 10, i / 10 % 10, i / 100].map(|c| 3.0 * c as f32);
            crowd.instance(&cube, Affine::translation(at))
        })
    };
    let mut random = Random::new(SEED);
    let rays: Vec<Ray> = (0..500)
        .map(|_| {
            let origin = [(); 3].map(|()| random.between(-20.0, 50.0));
            Ray::new(origin, random.direction())
        })
        .collect();
    let work = |scene: &Scene| {
        let mut counters = Counters::default();
        for ray in &rays {
            let _ = scene.closest_counted(ray, &mut counters);
        }
        counters.nodes + counters.instances
    };
    let plain = work(&built(crowd().instance(&cube, Affine::translation([10.0, 10.0, -2.0]))));
    for thickness in [1e-2, 1e-3, 1e-4] {
        let board = Affine::translation([-10.0, -10.0, -2.0])
            .then_from(&Affine::scaling([50.0, 50.0, thickness]));
        let with_board = work(&built(crowd().instance(&cube, board)));
        // The board itself is larger than all cubes: most rays enter it, and visit its one node.
        let own = 2 * rays.len() as u64;
        assert!(with_board < 2 * plain + own, "thickness {thickness}: {with_board}, {plain}");
    }
}
