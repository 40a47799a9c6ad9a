//! What moves: at every time the same bits as brute force, from every builder, instruction set and layout, with
//! temporal splits and without; no leaks; and what is wrong with a step is named.

use treelet::bounds::Aabb;
use treelet::geometry::Defect;
use treelet::memory::Array;
use treelet::scene::{Action, InstanceDefect, LayoutChoice, Policy, Reason, SEGMENTS_MAX};
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

/// From inside a closed mesh, every ray of every time meets it: bent, turned, far away, in an instance that moves.
#[test]
fn closed_meshes_that_move_do_not_leak() {
    let sphere = closed::random_star(24, 12, 5);
    let (inside, beside) = ([0.0; 3], [3.0, -1.0, 2.0]);
    let far = closed::far_away;
    let still = Scene::builder().mesh(mesh(&sphere)).build(&BuildOptions::default()).unwrap();
    let turned = |angle: f32| Affine::rotation([1.0, 0.2, 0.4], angle);
    let map = |angle: f32, [x, y, z]: [f32; 3]| {
        Affine::translation(beside).then_from(&turned(angle)).then_from(&Affine::scaling([x, y, z]))
    };
    let thin = [map(0.0, [1.0, 0.01, 1.0]), map(3.0, [1.0, 1.0, 0.02]), map(5.0, [1.0; 3])];
    let grown = |step: usize, p: [f32; 3]| p.map(|x| x * [1.0, 1.7, 0.6, 1.3, 1.0][step]);
    let cases: [(&str, SceneBuilder, [f32; 3]); 4] = [
        ("bent", Scene::builder().mesh(moving(&sphere, 5, |step, _, p| grown(step, p))), inside),
        ("turned", Scene::builder().mesh(turning(&sphere, 9, 5.0, [0.0; 3])), inside),
        (
            "far away",
            Scene::builder().mesh(moving(&sphere, 3, |step, _, p| far(grown(step, p)))),
            far([0.0; 3]),
        ),
        ("an instance", Scene::builder().instance_moving(&still, &thin), beside),
    ];
    for (name, scene, origin) in cases {
        let scene = scene.build(&BuildOptions::default()).unwrap();
        let mut random = Random::new(SEED);
        for i in 0..rounds(40_000) {
            let time = if i % 4 == 0 { (i % 33) as f32 / 32.0 } else { random.unit() };
            let mut ray = Ray::new(origin, random.direction()).at_time(time);
            if i % 2 == 0 && name != "an instance" {
                // Through a vertex or an edge, exactly as it is then.
                let mesh = scene.shapes().next().and_then(treelet::geometry::Shape::mesh).unwrap();
                let prim = random.below(mesh.triangles().len() as u64) as usize;
                let [a, b, _] = mesh.corners_at(prim, time).unwrap();
                let part = [0.0, 0.5, random.unit()][i % 3];
                let target = [0, 1, 2].map(|k| a[k] + part * (b[k] - a[k]));
                ray.direction = [0, 1, 2].map(|k: usize| target[k] - origin[k]);
            }
            assert!(scene.closest(&ray).is_some(), "{name}: {ray:?} leaks");
            assert!(scene.any(&ray), "{name}: {ray:?} leaks");
        }
    }
}

/// A mesh at a step is the mesh that does not move, to the bit; so is an instance.
#[test]
fn steps_are_met_exactly() {
    let soup = awkward::random_triangles(80, 2.0, 1.0);
    let moves = jittered(&soup, 5, 0.7, 9);
    let options = BuildOptions::default();
    let scene = Scene::builder().mesh(moves.clone()).build(&options).unwrap();
    for step in 0..5 {
        let still = moves.with_positions(moves.positions_at_step(step).to_vec());
        assert!(!still.is_moving());
        let still = Scene::builder().mesh(still).build(&options).unwrap();
        for ray in verify::rays(&still, 400, SEED) {
            let ray = ray.at_time(step as f32 / 4.0);
            let (moving, still) = (scene.closest(&ray), still.closest(&ray));
            assert_eq!(moving.map(|hit| hit.prim), still.map(|hit| hit.prim), "{ray:?}");
            let far = |hit: Option<Hit>| hit.map_or(0.0, |hit| hit.t);
            // The two scenes' slacks differ, and so does what `t` is clamped into.
            assert!((far(moving) - far(still)).abs() <= 1e-5 * far(still).abs(), "{ray:?}");
        }
    }
}

#[test]
fn temporal_splits_change_no_bit_and_pay() {
    let turned = turning(&propeller(), 17, 6.0, [0.0; 3]);
    let built = |temporal_splits| {
        let options = BuildOptions { temporal_splits, ..BuildOptions::default() };
        let others = Scene::builder().mesh(mesh(&closed::cube()));
        others.mesh(turned.clone()).build(&options).unwrap()
    };
    let (with, without) = (built(true), built(false));
    assert_eq!(without.segments().collect::<Vec<_>>(), [(1, 1)]);
    let segments = with.segments().next().unwrap().1;
    assert!((8..=SEGMENTS_MAX).contains(&segments), "{segments} segments");
    let mut work = [treelet::Counters::default(); 2];
    for ray in rays(&with, rounds(2000), SEED) {
        let hits = [with.closest(&ray), without.closest(&ray)];
        assert_eq!(format!("{:?}", hits[0]), format!("{:?}", hits[1]), "{ray:?}");
        with.closest_counted(&ray, &mut work[0]);
        without.closest_counted(&ray, &mut work[1]);
    }
    let [with, without] = work.map(|work| work.triangles + work.nodes);
    assert!(4 * with < without, "{with} tests with temporal splits, {without} without");
}

/// Boxes that cull nothing they should not: rays that graze triangles which fly far.
#[test]
fn rays_that_graze_what_flies_are_not_lost() {
    let mut noise = Noise::new(SEED);
    for far in [1.0, 1e3, 1e7] {
        let soup = awkward::random_triangles(200, 1.0, 0.05 * far);
        let flights: Vec<[f32; 3]> = (0..3 * 600).map(|_| noise.point(-far, far)).collect();
        let flies = moving(&soup, 3, |step, vertex, p| {
            let by = flights[600 * step + vertex / 3 * 3];
            [p[0] + by[0], p[1] + by[1], p[2] + by[2]]
        });
        for temporal_splits in [false, true] {
            let options = BuildOptions { temporal_splits, ..BuildOptions::default() };
            let scene = Scene::builder().mesh(flies.clone()).build(&options).unwrap();
            let brute = BruteForce::new(&scene);
            let mut met = 0;
            for prim in 0..200 {
                for _ in 0..4 {
                    let time = noise.unit();
                    let corners = flies.corners_at(prim, time).unwrap();
                    let [a, b] = [corners[prim % 3], corners[(prim + 1) % 3]];
                    // Along an axis, through a corner or the middle of an edge: the box's own faces.
                    let axis = prim % 3;
                    let part = [0.0, 0.5][prim % 2];
                    let target = [0, 1, 2].map(|k| a[k] + part * (b[k] - a[k]));
                    let (mut from, mut direction) = (target, [0.0; 3]);
                    from[axis] -= far;
                    direction[axis] = 1.0;
                    let ray = Ray::new(from, direction).at_time(time);
                    let all = brute.all(&ray);
                    met += usize::from(!all.is_empty());
                    if let Err(mismatch) = verify::check(&scene, &ray, &all) {
                        panic!("flights of {far}: {mismatch}");
                    }
                }
            }
            assert!(met > 100, "{met} rays met something");
        }
    }
}

/// An object that turns keeps its distance from the axis: what a lerp of matrices gets wrong.
#[test]
fn instances_turn_rigidly() {
    let sphere = closed::sphere(16, 8).mapped(|p| [p[0] * 0.1 + 2.0, p[1] * 0.1, p[2] * 0.1]);
    let sphere = Scene::builder().mesh(mesh(&sphere)).build(&BuildOptions::default()).unwrap();
    let turn = |angle: f32| Affine::rotation([0.0, 0.0, 1.0], angle);
    let steps = [turn(0.0), turn(3.0)];
    let scene = Scene::builder().instance_moving(&sphere, &steps);
    let scene = scene.build(&BuildOptions::default()).unwrap();
    for i in 0..=64 {
        let time = i as f32 / 64.0;
        let direction = turn(3.0 * time).vector([1.0, 0.0, 0.0]);
        let ray = Ray::new([0.0; 3], direction).at_time(time);
        let hit = scene.closest(&ray).expect("it is there");
        assert!((hit.t - 1.9).abs() < 0.01, "{hit:?}");
        let map = scene.world_from_object_at(hit.inst, time).unwrap();
        let center = map.point([2.0, 0.0, 0.0]);
        let expected = direction.map(|x| 2.0 * x);
        assert!((0..3).all(|k| (center[k] - expected[k]).abs() < 1e-5), "{center:?}");
        let normal = scene.normal(&ray, &hit).unwrap();
        let along: f32 = (0..3).map(|k| normal[k] * direction[k]).sum();
        assert!(along.abs() > 0.8, "{normal:?} {direction:?}");
    }
}

#[test]
fn what_is_wrong_with_a_step_is_named() {
    let cube = closed::cube();
    let strict = BuildOptions { invalid: Invalid::Error, ..BuildOptions::default() };
    let build = |scene: SceneBuilder, options: &BuildOptions<'_>| scene.build(options);

    // Steps of unequal length.
    let short = cube.positions[..7].to_vec();
    let steps: [Array<[f32; 3]>; 3] =
        [cube.positions.clone().into(), cube.positions.clone().into(), short.into()];
    let uneven = Mesh::moving(steps, cube.triangles.clone());
    for options in [&strict, &BuildOptions::default()] {
        let error = build(Scene::builder().mesh(uneven.clone()), options).unwrap_err();
        assert_eq!(error, SceneError::Steps { geom: 0, step: 2, vertices: 7, first: 8 });
    }

    // A vertex that is no number in one step.
    let bad = moving(
        &cube,
        3,
        |step, vertex, p| {
            if (step, vertex) == (1, 7) { [f32::NAN, 0.0, 0.0] } else { p }
        },
    );
    let error = build(Scene::builder().mesh(bad.clone()), &strict).unwrap_err();
    let SceneError::Triangle {
        geom: 0,
        defect: Defect::BadVertexAt { step: 1, vertex: 7, .. },
        ..
    } = error
    else {
        panic!("{error}");
    };
    assert!(error.to_string().contains("time step 1"), "{error}");
    let scene = build(Scene::builder().mesh(bad), &BuildOptions::default()).unwrap();
    let touching = cube.triangles.iter().filter(|triangle| triangle.contains(&7)).count();
    assert_eq!(scene.report().skipped.bad_vertex, touching as u64);
    assert_eq!(scene.report().triangles, 12 - touching as u64);

    // Maps.
    let inner = build(Scene::builder().mesh(mesh(&cube)), &strict).unwrap();
    let flat = Affine::scaling([1.0, 1.0, 0.0]);
    let mirror = Affine::scaling([-1.0, 1.0, 1.0]);
    let not_finite = Affine::translation([f32::INFINITY, 0.0, 0.0]);
    let far = Affine::translation([1e19, 0.0, 0.0]);
    let wrong = |map: Affine| {
        let scene = Scene::builder().instance_moving(&inner, &[Affine::IDENTITY, map]);
        assert_eq!(
            build(scene.clone(), &BuildOptions::default()).unwrap().report().skipped.instances,
            1
        );
        match build(scene, &strict).unwrap_err() {
            SceneError::Instance { instance: 0, defect } => defect,
            other => panic!("{other}"),
        }
    };
    assert_eq!(wrong(flat), InstanceDefect::Step { step: 1, rows: flat.0 });
    assert_eq!(wrong(not_finite), InstanceDefect::Step { step: 1, rows: not_finite.0 });
    assert_eq!(wrong(mirror), InstanceDefect::Mirrored { step: 1 });
    assert!(matches!(wrong(far), InstanceDefect::TooFar { .. }));

    // Rays without a time, one by one and in slices.
    let scene = build(Scene::builder().mesh(mesh(&cube)), &strict).unwrap();
    let ray = Ray::new([0.3, 0.4, -1.0], [0.0, 0.0, 1.0]);
    let mut rays = vec![ray; 512];
    rays.iter_mut().skip(100).step_by(7).for_each(|ray| ray.time = f32::NAN);
    assert!(scene.closest(&rays[99]).is_some() && scene.closest(&rays[100]).is_none());
    let mut hits = vec![Hit { t: 0.0, ..Hit::MISS }; 512];
    scene.closest_many(&rays, &mut hits).unwrap();
    let mut found = vec![false; 512];
    scene.any_many(&rays, &mut found).unwrap();
    for ((ray, hit), found) in rays.iter().zip(&hits).zip(&found) {
        assert_eq!((hit.is_hit(), *found), (!ray.time.is_nan(), !ray.time.is_nan()));
    }
}

/// Odd numbers of steps, no step at all, nothing in a mesh, everything in one place.
#[test]
fn odd_motion_is_answered() {
    let cube = closed::cube();
    let nothing: [Array<[f32; 3]>; 0] = [];
    let single = moving(&cube, 1, |_, _, p| p);
    assert!(!single.is_moving());
    let still = moving(&cube, 40, |_, _, p| p);
    let point = moving(&cube, 3, |step, _, _| [step as f32; 3]);
    let through = moving(&cube, 2, |step, _, p| p.map(|x| if step == 0 { x } else { -x }));
    let huge = moving(&cube, 3, |step, _, p| p.map(|x| x * [1e18, -4e18, 1e-30][step]));
    let inner = Scene::builder().mesh(single.clone()).build(&BuildOptions::default()).unwrap();
    let empty = Scene::builder().build(&BuildOptions::default()).unwrap();
    let spin: Vec<Affine> = (0..50)
        .map(|i| Affine::rotation([1.0, 0.0, 0.0], i as f32).then_from(&Affine::scaling([1e-6; 3])))
        .collect();
    let half = [0.0, core::f32::consts::PI].map(|turn| Affine::rotation([0.0, 1.0, 0.0], turn));
    for scene in [
        Scene::builder().mesh(Mesh::moving(nothing, cube.triangles.clone())),
        Scene::builder().mesh(Mesh::moving([Array::default(), Array::default()], Vec::new())),
        Scene::builder().mesh(single),
        Scene::builder().mesh(still),
        Scene::builder().mesh(point),
        Scene::builder().mesh(through),
        Scene::builder().mesh(huge),
        Scene::builder().instance_moving(&inner, &[]),
        Scene::builder().instance_moving(&inner, &half),
        Scene::builder().instance_moving(&inner, &spin),
        Scene::builder().instance_moving(&empty, &half),
    ] {
        let options = BuildOptions { quality: Quality::Auto, ..BuildOptions::default() };
        let auto = scene.clone().build(&options).unwrap();
        hold("auto", &auto, &rays(&auto, 100, SEED));
        let scene = scene.build(&BuildOptions::default()).unwrap();
        hold("odd", &scene, &rays(&scene, 200, SEED));
    }
}

/// Edits of scenes with motion: instances and meshes keep moving, the tree stays where only what stands still is elsewhere.
#[test]
fn edits_keep_what_moves() {
    let soup = awkward::random_triangles(50, 2.0, 0.5);
    let options = BuildOptions::default();
    let inner = Scene::builder().mesh(jittered(&soup, 3, 0.2, 1)).build(&options).unwrap();
    let way = [Affine::IDENTITY, Affine::rotation([0.0, 1.0, 0.0], 2.0)];
    let scene = (0..20).fold(Scene::builder(), |scene, i| {
        let at = Affine::translation([3.0 * i as f32, 0.0, 0.0]);
        scene.instance_moving(&inner, &way.map(|map| at.then_from(&map)))
    });
    let scene = scene.build(&options).unwrap();
    let mut edit = scene.edit();
    edit.set_transform(3, Affine::translation([9.0, 1.0, 0.0])).unwrap();
    edit.set_instance_mask(5, 1).unwrap();
    let after = edit.commit(&options).unwrap().scene;
    hold("moved", &after, &rays(&after, 300, SEED));

    let meshes = Scene::builder().mesh(jittered(&soup, 3, 0.2, 2)).mesh(mesh(&soup));
    let meshes = meshes.build(&options).unwrap();
    let mut edit = meshes.edit();
    edit.set_positions(1, soup.clone().mapped(|p| [p[0] + 1.0, p[1], p[2]]).positions).unwrap();
    let commit = edit.commit(&options).unwrap();
    assert_eq!(commit.reason, Reason::Same);
    hold("bent", &commit.scene, &rays(&commit.scene, 300, SEED));
    let mut edit = commit.scene.edit();
    edit.set_shape(1, turning(&soup, 4, 1.0, [0.0; 3])).unwrap();
    let commit = edit.commit(&options).unwrap();
    assert_eq!(commit.reason, Reason::Different);
    assert_eq!(commit.scene.segments().len(), 2);
    hold("turned", &commit.scene, &rays(&commit.scene, 300, SEED));
}

/// Instances that fly: trees for parts of the time change no bit, and pay.
#[test]
fn trees_for_parts_of_the_time_change_no_bit_and_pay() {
    let soup = Scene::builder().mesh(mesh(&closed::sphere(8, 4)));
    for &layout in LayoutChoice::ALL {
        let options = BuildOptions { layout: Some(layout), ..BuildOptions::default() };
        let inner = soup.clone().build(&options).unwrap();
        let mut noise = Noise::new(SEED);
        let crowd = (0..150).fold(Scene::builder(), |crowd, _| {
            let [from, to] = [noise.point(-60.0, 60.0), noise.point(-60.0, 60.0)];
            let turned = |at: [f32; 3], angle: f32| {
                Affine::translation(at).then_from(&Affine::rotation([0.1, 1.0, 0.2], angle))
            };
            crowd.instance_moving(&inner, &[turned(from, 0.0), turned(to, 3.0), turned(from, 1.0)])
        });
        let built = |temporal_splits| {
            crowd.clone().build(&BuildOptions { temporal_splits, ..options.clone() }).unwrap()
        };
        let (with, without) = (built(true), built(false));
        assert_eq!(without.spans(), 1);
        assert!((4..=SEGMENTS_MAX).contains(&with.spans()), "{} spans", with.spans());
        let mut work = [treelet::Counters::default(); 2];
        let rays = rays(&with, rounds(500), SEED);
        for ray in &rays {
            let hits = [with.closest(ray), without.closest(ray)];
            assert_eq!(format!("{:?}", hits[0]), format!("{:?}", hits[1]), "{ray:?}");
            with.closest_counted(ray, &mut work[0]);
            without.closest_counted(ray, &mut work[1]);
        }
        hold("crowd", &with, &rays);
        // Edited, they keep their trees.
        let mut edit = with.edit();
        edit.policy = Policy::Refit;
        let ways = [[-60.0; 3], [0.0; 3], [60.0; 3]].map(Affine::translation);
        edit.set_motion(3, &ways).unwrap();
        edit.remove_instance(5).unwrap();
        edit.set_transform(7, ways[1]).unwrap();
        for step in 0..2 {
            let commit = edit.commit(&options).unwrap();
            assert_ne!(commit.action, Action::Rebuilt, "{commit}");
            assert_eq!(commit.scene.spans(), with.spans());
            let rays = self::rays(&commit.scene, rounds(200), SEED + step);
            hold("crowd, edited", &commit.scene, &rays);
            edit = commit.scene.edit();
            edit.policy = Policy::Refit;
            edit.add_instance_moving(&inner, &ways[1..]);
        }
        let [with, without] = work.map(|work| work.nodes);
        assert!(
            2 * with < without,
            "{with} nodes with trees for parts of the time, {without} without"
        );
    }
}
