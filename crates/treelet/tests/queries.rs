//! The four questions: closed intervals, masks, slices, rays that are none, and what is counted.

use treelet::verify::{self, Random};
use treelet::{Affine, BuildOptions, Counters, Hit, Mesh, Ray, Scene};
use treelet_testkit::{Shape, awkward, closed};

const SEED: u64 = 0xA5C;

fn mesh(shape: &Shape) -> Mesh {
    Mesh::new(shape.positions.clone(), shape.triangles.clone())
}

fn scene(shape: &Shape) -> Scene {
    Scene::builder().mesh(mesh(shape)).build(&BuildOptions::default()).unwrap()
}

/// Random triangles, and instances of them: every kind of leaf.
fn mixed() -> Scene {
    let inner = scene(&awkward::random_triangles(300, 3.0, 1.0));
    let turned = Affine::rotation([1.0, 2.0, -1.0], 1.0);
    let builder = Scene::builder()
        .mesh(mesh(&awkward::random_triangles(500, 6.0, 1.5)))
        .mesh(mesh(&closed::sphere(24, 12)))
        .instance(&inner, turned)
        .instance(&inner, Affine::scaling([0.5, -2.0, 1.0]).then_from(&turned));
    builder.build(&BuildOptions::default()).unwrap()
}

fn bits(hit: &Hit) -> ([u32; 3], (u64, u32, u32)) {
    ([hit.t, hit.u, hit.v].map(f32::to_bits), hit.id())
}

/// All four questions agree with each other; returns the list.
fn ask(scene: &Scene, ray: &Ray) -> Vec<Hit> {
    let all = scene.all(ray);
    assert!(
        all.is_sorted_by(|a, b| a.cmp_along_ray(b).is_lt()),
        "order or twins, {ray:?}: {all:?}"
    );
    assert_eq!(scene.closest(ray).as_ref().map(bits), all.first().map(bits), "{ray:?}");
    assert_eq!(scene.any(ray), !all.is_empty(), "{ray:?}");
    assert_eq!(scene.count(ray), all.len() as u64, "{ray:?}");
    all
}

#[test]
fn intervals_are_closed_to_the_last_bit() {
    let scene = mixed();
    let mut tried = 0;
    for ray in verify::rays(&scene, 3000, SEED) {
        let ray = ray.from(f32::NEG_INFINITY).up_to(f32::INFINITY);
        let all = ask(&scene, &ray);
        for hit in all.iter().filter(|hit| hit.t.abs() > f32::MIN_POSITIVE) {
            tried += 1;
            let t = hit.t;
            let at = |ray: Ray| ask(&scene, &ray).iter().any(|found| bits(found) == bits(hit));
            assert!(at(ray.from(t).up_to(t)), "an interval of one point, {ray:?}, {hit:?}");
            assert!(at(ray.up_to(t)), "t_max is the hit, {ray:?}, {hit:?}");
            assert!(at(ray.from(t)), "t_min is the hit, {ray:?}, {hit:?}");
            assert!(!at(ray.up_to(t.next_down())), "t_max is just before, {ray:?}, {hit:?}");
            assert!(!at(ray.from(t.next_up())), "t_min is just behind, {ray:?}, {hit:?}");
        }
        // Cutting the interval cuts the list, and nothing else.
        let cut = Ray { t_min: -0.5, t_max: 0.75, ..ray };
        let inside = all.iter().filter(|hit| -0.5 <= hit.t && hit.t <= 0.75).map(bits);
        assert!(inside.eq(ask(&scene, &cut).iter().map(bits)), "{cut:?}");
    }
    assert!(tried > 5000, "only {tried} hits");
}

#[test]
fn negative_t_is_behind_the_origin() {
    let cube = scene(&closed::cube());
    let ray = Ray::new([0.5, 0.25, 0.5], [2.0, 0.0, -0.0]);
    assert_eq!(cube.closest(&ray).unwrap().t, 0.25);
    assert_eq!(cube.closest(&ray.from(-1.0)).unwrap().t, -0.25);
    assert_eq!(cube.closest(&ray.from(-1.0).up_to(-0.125)).unwrap().t, -0.25);
    assert_eq!(cube.closest(&ray.from(-0.125).up_to(0.125)), None);
    assert_eq!(cube.count(&ray.from(f32::NEG_INFINITY)), 2);
}

#[test]
fn of_equal_t_the_smallest_id_wins() {
    // The same triangle in two meshes, each twice, and in two instances.
    let twice = Mesh::new([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[1, 2, 0], [1, 2, 0]]);
    let plain = Scene::builder().mesh(twice.clone()).mesh(twice.clone());
    let inner = plain.clone().build(&BuildOptions::default()).unwrap();
    let placed = plain.instance(&inner, Affine::IDENTITY).instance(&inner, Affine::IDENTITY);
    let scene = placed.build(&BuildOptions::default()).unwrap();
    let ray = Ray::new([0.25, 0.25, 3.0], [0.0, 0.0, -1.0]);
    let expected: Vec<_> = (0..3_u64)
        .flat_map(|inst| (0..2).flat_map(move |geom| (0..2).map(move |prim| (inst, geom, prim))))
        .collect();
    let ids: Vec<_> = ask(&scene, &ray).iter().map(Hit::id).collect();
    assert_eq!(ids, expected);
}

#[test]
fn where_t_underflows_every_hit_is_a_tie() {
    // A scene so small and directions so long that every `t`, and every box's entry, is zero:
    // pruning must let boxes pass that begin exactly at the closest hit so far.
    let tiny = awkward::random_triangles(2000, 1e-18, 3e-19);
    let scene = scene(&tiny);
    let mut random = Random::new(SEED);
    let mut hits = 0;
    for _ in 0..2000 {
        let origin = [(); 3].map(|()| random.between(-2e-18, 2e-18));
        let long = random.direction().map(|x| x * 2.0_f32.powi(119));
        let all = ask(&scene, &Ray::new(origin, long));
        assert!(all.iter().all(|hit| hit.t == 0.0));
        hits += all.len();
    }
    assert!(hits > 5000, "only {hits} hits");
}

#[test]
fn slices_answer_like_single_calls() {
    let scene = mixed();
    let many = verify::rays(&scene, 100_000, SEED);
    for length in [0, 1, 7, 1023, 1024, 1025, 100_000] {
        let rays = &many[..length];
        let mut hits = vec![Hit { t: -7.0, ..Hit::MISS }; length];
        scene.closest_many(rays, &mut hits).unwrap();
        let mut any = vec![false; length];
        scene.any_many(rays, &mut any).unwrap();
        let mut counts = vec![u64::MAX; length];
        scene.count_many(rays, &mut counts).unwrap();
        let lists = scene.all_many(rays);
        assert_eq!((lists.len(), lists.is_empty()), (length, length == 0));
        assert_eq!(lists.get(length), None);
        for (i, ray) in rays.iter().enumerate() {
            let closest = scene.closest(ray).unwrap_or(Hit::MISS);
            assert_eq!(bits(&hits[i]), bits(&closest), "ray {i} of {length}");
            assert_eq!(any[i], closest.is_hit(), "ray {i} of {length}");
            let list = lists.get(i).unwrap();
            assert_eq!(list.len() as u64, counts[i], "ray {i} of {length}");
            assert_eq!(list.first().map(bits), scene.closest(ray).as_ref().map(bits), "ray {i}");
            if length < 2000 {
                assert!(list.iter().map(bits).eq(scene.all(ray).iter().map(bits)), "ray {i}");
            }
        }
        assert_eq!(lists.hits().len() as u64, counts.iter().sum::<u64>());
    }
}

#[test]
fn slices_of_different_lengths_write_nothing() {
    let scene = mixed();
    let rays = verify::rays(&scene, 1500, SEED);
    let mark = Hit { t: 12.5, u: 1.0, v: 2.0, prim: 3, geom: 4, inst: 5 };
    for room in [0, 1, 1499, 1501, 4000] {
        let mut hits = vec![mark; room];
        let wrong = scene.closest_many(&rays, &mut hits).unwrap_err();
        assert_eq!((wrong.rays, wrong.answers), (1500, room));
        assert!(hits.iter().all(|hit| *hit == mark), "written to with room for {room}");
        let mut any = vec![true; room];
        assert!(scene.any_many(&rays[..0], &mut any).is_err() || room == 0);
        assert!(scene.any_many(&rays, &mut any).is_err() && any.iter().all(|&x| x));
        let mut counts = vec![99; room];
        assert!(scene.count_many(&rays, &mut counts).is_err() && counts.iter().all(|&x| x == 99));
    }
}

#[test]
fn masks_hide_meshes_and_instances() {
    let sphere = mesh(&closed::sphere(16, 8));
    let inner = Scene::builder().mesh_masked(sphere.clone(), 0b0110);
    let inner = inner.build(&BuildOptions::default()).unwrap();
    let scene = Scene::builder()
        .mesh_masked(sphere.clone(), 0b0001)
        .mesh_masked(sphere.clone(), 0)
        .mesh_masked(sphere, u32::MAX)
        .instance_masked(&inner, Affine::IDENTITY, 0b0010)
        .instance_masked(&inner, Affine::IDENTITY, 0b1100)
        .instance_masked(&inner, Affine::IDENTITY, 0)
        .build(&BuildOptions::default())
        .unwrap();
    // Every mask on the way must have a bit in common with the ray's, not all the same one.
    let masks: [(u64, u32, [u32; 2]); 4] = [
        (0, 0, [0b0001; 2]),
        (0, 2, [u32::MAX; 2]),
        (1, 0, [0b0010, 0b0110]),
        (2, 0, [0b1100, 0b0110]),
    ];
    let mut random = Random::new(SEED);
    for mask in (0..16).chain([1 << 31, u32::MAX]) {
        for _ in 0..50 {
            let ray = Ray { mask, ..Ray::new([0.1, 0.0, 0.0], random.direction()) };
            let mut seen: Vec<_> =
                ask(&scene, &ray).iter().map(|hit| (hit.inst, hit.geom)).collect();
            seen.sort_unstable();
            seen.dedup();
            let expected: Vec<_> = masks
                .iter()
                .filter(|(_, _, on_the_way)| on_the_way.iter().all(|visible| visible & mask != 0))
                .map(|&(inst, geom, _)| (inst, geom))
                .collect();
            assert_eq!(seen, expected, "mask {mask:#b}, {ray:?}");
        }
    }
}

#[test]
fn what_is_no_ray_costs_nothing() {
    let scene = mixed();
    let good = Ray::new([0.0; 3], [1.0, 0.25, -0.5]);
    let mut wrong = vec![
        Ray { direction: [0.0, -0.0, 0.0], ..good },
        Ray { direction: [1e-37, 0.0, 0.0], ..good },
        Ray { direction: [1e-45; 3], ..good },
        Ray { direction: [f32::MAX, 1.0, 1.0], ..good },
        Ray { direction: [2e36, 1.0, f32::NAN], ..good },
        good.from(1.0).up_to(1.0_f32.next_down()),
        good.from(f32::NAN),
        good.up_to(f32::NAN),
        good.up_to(-1.0),
        good.up_to(f32::NEG_INFINITY),
    ];
    for value in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for axis in 0..3 {
            let (mut origin, mut direction) = (good.origin, good.direction);
            origin[axis] = value;
            direction[axis] = value;
            wrong.extend([Ray { origin, ..good }, Ray { direction, ..good }]);
            wrong.push(Ray { origin, direction, ..good });
        }
    }
    for ray in &wrong {
        assert!(!ray.is_valid(), "{ray:?}");
        assert!(ask(&scene, ray).is_empty(), "{ray:?}");
        let mut counters = Counters::default();
        assert_eq!(scene.closest_counted(ray, &mut counters), None);
        assert!(!scene.any_counted(ray, &mut counters));
        assert_eq!(counters, Counters::default(), "work for {ray:?}");
    }
    let mut hits = vec![Hit { prim: 0, ..Hit::MISS }; wrong.len()];
    scene.closest_many(&wrong, &mut hits).unwrap();
    assert!(hits.iter().all(|hit| bits(hit) == bits(&Hit::MISS)));
}

#[test]
fn finite_rays_from_anywhere_end() {
    let scene = mixed();
    let mut random = Random::new(SEED);
    for power in (-149..=127).step_by(4) {
        let far = 2.0_f32.powi(power);
        for _ in 0..50 {
            let origin = [(); 3].map(|()| random.between(-1.0, 1.0) * far);
            ask(&scene, &Ray::new(origin, random.direction()));
            ask(&scene, &Ray::new(origin, origin.map(|x| -x)));
        }
    }
}

#[test]
fn counters_tell_the_work() {
    let scene = scene(&awkward::random_triangles(20_000, 10.0, 0.5));
    let (mut near, mut through, mut shadow) =
        (Counters::default(), Counters::default(), Counters::default());
    let mut hits = 0_u64;
    for ray in verify::rays(&scene, 2000, SEED).iter().filter(|ray| ray.is_valid()) {
        let mut counters = Counters::default();
        let hit = scene.closest_counted(ray, &mut counters);
        assert_eq!(hit, scene.closest(ray), "counting changes nothing");
        if hit.is_some() {
            hits += 1;
            assert!(counters.nodes > 0 && counters.leaves > 0 && counters.triangles > 0);
        }
        // All children of each node are entered, culled, or culled later on the stack.
        let children = 16 * counters.nodes;
        let known = (counters.nodes - 1) + counters.leaves;
        assert!(counters.culled_by_box + counters.culled_by_t + known <= children, "{counters:?}");
        assert_eq!(counters.instances, 0);
        near += counters;
        scene.any_counted(ray, &mut shadow);
        if let Some(hit) = hit {
            let mut short = Counters::default();
            scene.closest_counted(&ray.up_to(hit.t), &mut short);
            assert!(short.nodes <= counters.nodes, "knowing the hit saves work: {ray:?}");
        }
        // A ray that nothing shortens: every mesh is hidden from it.
        let mut all = Counters::default();
        let masked = Ray { mask: 0, ..*ray };
        assert_eq!(scene.closest_counted(&masked, &mut all), None);
        assert!(counters.nodes <= all.nodes, "pruning never adds nodes: {ray:?}");
        through += all;
    }
    assert!(hits > 500, "only {hits} hits");
    assert!(near.nodes * 3 < through.nodes * 2, "pruned {near:?}, unpruned {through:?}");
    assert!(shadow.nodes <= near.nodes, "a shadow ray stops early: {shadow:?}, {near:?}");
    assert!(near.triangles < 200 * 2000, "{near:?}");
    assert!(near.culled_by_t > 0 && near.culled_by_box > near.culled_by_t);
}
