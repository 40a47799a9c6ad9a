//! Edits: whatever was changed, and whatever a commit made of it, the scene answers as one that was
//! built from nothing, bit for bit; and the snapshot before it answers as it did.

use treelet::geometry::Spheres;
use treelet::scene::{Action, EditError, LayoutChoice, Policy, Reason};
use treelet::verify::{self, BruteForce, Random};
use treelet::{Affine, BuildOptions, Hit, Mesh, Ray, Scene, SceneBuilder, build};
use treelet_testkit::{Shape, awkward, closed};

const SEED: u64 = 0xED17;

fn mesh(shape: &Shape) -> Mesh {
    Mesh::new(shape.positions.clone(), shape.triangles.clone())
}

fn options(layout: LayoutChoice) -> BuildOptions<'static> {
    BuildOptions { layout: Some(layout), ..BuildOptions::default() }
}

/// What the scene should hold, told anew.
#[derive(Clone, Default)]
struct Told {
    meshes: Vec<(Mesh, u32)>,
    instances: Vec<(Scene, Affine, u32)>,
    /// After the meshes.
    balls: Vec<Spheres>,
}

impl Told {
    fn build(&self, options: &BuildOptions<'_>) -> Scene {
        let meshes = self.meshes.iter().cloned();
        let scene = meshes.fold(Scene::builder(), |s, (mesh, mask)| s.mesh_masked(mesh, mask));
        let scene = self.balls.iter().fold(scene, |scene, balls| scene.shape(balls.clone()));
        let instances = self.instances.iter();
        let scene: SceneBuilder = instances
            .fold(scene, |scene, (inner, map, mask)| scene.instance_masked(inner, *map, *mask));
        scene.build(options).unwrap()
    }
}

fn answers(scene: &Scene, rays: &[Ray]) -> Vec<(Option<[u64; 6]>, bool, u64)> {
    let bits = |hit: Hit| {
        let [t, u, v] = [hit.t, hit.u, hit.v].map(|x| u64::from(x.to_bits()));
        [t, u, v, u64::from(hit.prim), u64::from(hit.geom), hit.inst]
    };
    rays.iter()
        .map(|ray| (scene.closest(ray).map(bits), scene.any(ray), scene.count(ray)))
        .collect()
}

fn check(what: &str, edited: &Scene, told: &Told, options: &BuildOptions<'_>, random: &mut Random) {
    let fresh = told.build(options);
    assert_eq!(edited.bounds(), fresh.bounds(), "{what}");
    assert_eq!(edited.paths(), fresh.paths(), "{what}");
    let rays = verify::rays(&fresh, 60, random.bits());
    assert_eq!(answers(edited, &rays), answers(&fresh, &rays), "{what}, seed {SEED:#x}");
    if told.meshes.iter().any(|(mesh, _)| mesh.triangles().len() > 10_000) {
        return;
    }
    let brute = BruteForce::new(edited);
    for ray in rays.iter().step_by(4) {
        verify::check(edited, ray, &brute.all(ray)).unwrap_or_else(|e| panic!("{what}: {e}"));
    }
}

fn map(random: &mut Random) -> Affine {
    let scale = [(); 3].map(|()| random.between(0.4, 2.0));
    Affine::translation([(); 3].map(|()| random.between(-9.0, 9.0)))
        .then_from(&Affine::rotation(random.direction(), random.between(0.0, 6.3)))
        .then_from(&Affine::scaling(scale))
}

/// Every builder, each in turn with each layout, through a dozen random edits of meshes and
/// instances, under each policy.
#[test]
fn edits_in_any_order_answer_like_a_fresh_build() {
    let mut random = Random::new(SEED);
    for (at, builder) in build::ALL.iter().enumerate() {
        let layout = LayoutChoice::ALL[at % LayoutChoice::ALL.len()];
        let options = BuildOptions { builder: Some(*builder), ..options(layout) };
        let name = builder.info().name;
        let shapes = [
            closed::sphere(14, 9),
            awkward::random_triangles(90, 3.0, 1.0),
            awkward::coplanar_grid(5),
        ];
        let object = |shape: &Shape| Scene::builder().mesh(mesh(shape)).build(&options).unwrap();
        let objects = [object(&closed::cube()), object(&shapes[1]), object(&Shape::default())];
        let mut told = Told::default();
        told.meshes.extend(shapes.iter().map(|shape| (mesh(shape), u32::MAX)));
        for index in 0..7 {
            told.instances.push((objects[index % 2].clone(), map(&mut random), u32::MAX));
        }
        let mut scene = told.build(&options);
        for step in 0..12 {
            let mut edit = scene.edit();
            edit.policy = match step % 6 {
                0 => Policy::Refit,
                1 => Policy::Auto,
                2 => Policy::Repair,
                3 => Policy::Rays(1 << random.below(40)),
                4 => Policy::Budget(core::time::Duration::from_micros(random.below(2000))),
                _ => Policy::Rebuild,
            };
            let kind = random.below(8);
            let geom = random.below(told.meshes.len() as u64) as usize;
            let instance = random.below(told.instances.len() as u64) as usize;
            match kind {
                0 | 1 => {
                    let size = if kind == 0 { 0.1 } else { 30.0 };
                    let moved = told.meshes[geom].0.positions().iter();
                    let mut jitter = |x: f32| x + size * random.between(-1.0, 1.0);
                    let moved: Vec<_> =
                        moved.map(|p| [jitter(p[0]), jitter(p[1]), jitter(p[2])]).collect();
                    edit.set_positions(geom, moved.clone()).unwrap();
                    told.meshes[geom].0 = told.meshes[geom].0.with_positions(moved);
                }
                2 => {
                    let map = map(&mut random);
                    edit.set_transform(instance, map).unwrap();
                    told.instances[instance].1 = map;
                }
                3 => {
                    let mask = 1 << random.below(3);
                    edit.set_instance_mask(instance, mask).unwrap();
                    edit.set_mask(geom, mask).unwrap();
                    (told.instances[instance].2, told.meshes[geom].1) = (mask, mask);
                }
                4 => {
                    let object = &objects[random.below(3) as usize];
                    edit.set_scene(instance, object).unwrap();
                    told.instances[instance].0 = object.clone();
                }
                5 => {
                    edit.remove_instance(instance).unwrap();
                    told.instances[instance].0 = objects[2].clone();
                    edit.remove_shape(geom).unwrap();
                    told.meshes[geom].0 = Mesh::default();
                }
                6 => {
                    let map = map(&mut random);
                    assert_eq!(edit.add_instance(&objects[1], map), told.instances.len());
                    told.instances.push((objects[1].clone(), map, u32::MAX));
                }
                _ => {
                    assert_eq!(edit.add_shape(mesh(&shapes[0])), told.meshes.len());
                    told.meshes.push((mesh(&shapes[0]), u32::MAX));
                }
            }
            let commit = edit.commit(&options).unwrap();
            let what = format!("{name}, step {step}, edit {kind}, {:?}", commit.action);
            check(&what, &commit.scene, &told, &options, &mut random);
            scene = commit.scene;
        }
    }
}

/// Many nodes: chunks of them, and those that wait for other chunks.
#[test]
fn large_trees_are_refitted_as_they_would_be_built() {
    let shape = closed::random_star(150, 100, 7);
    for (layout, builder) in LayoutChoice::ALL.iter().zip(["default", "presplit+hploc", "sbvh"]) {
        let recipe: treelet::scene::Recipe = builder.parse().unwrap();
        let options = BuildOptions { layout: Some(*layout), ..recipe.options() };
        let mut told = Told::default();
        told.meshes.push((mesh(&shape), u32::MAX));
        let scene = told.build(&options);
        let twist = |p: &[f32; 3]| {
            let (sin, cos) = (0.02 * p[2]).sin_cos();
            [cos * p[0] - sin * p[1], sin * p[0] + cos * p[1], 1.1 * p[2]]
        };
        let moved: Vec<_> = shape.positions.iter().map(twist).collect();
        let mut edit = scene.edit();
        edit.set_positions(0, moved.clone()).unwrap();
        // What splits saved is lost with them.
        edit.policy = if builder == "default" { Policy::Auto } else { Policy::Refit };
        let commit = edit.commit(&options).unwrap();
        assert_eq!((commit.action, commit.reason), (Action::Refitted, Reason::Same), "{builder}");
        let most = if builder == "default" { 1.3 } else { 3.0 };
        assert!((0.9..most).contains(&commit.decay), "{builder}: {}", commit.decay);
        told.meshes[0].0 = told.meshes[0].0.with_positions(moved);
        check(builder, &commit.scene, &told, &options, &mut Random::new(SEED));
        // And back: nothing is lost by the way there, and the old snapshot never noticed.
        let rays = verify::rays(&scene, 200, SEED);
        let before = answers(&scene, &rays);
        let mut edit = commit.scene.edit();
        edit.set_positions(0, shape.positions.clone()).unwrap();
        edit.policy = Policy::Refit;
        let back = edit.commit(&options).unwrap();
        assert_eq!(answers(&back.scene, &rays), before);
        if builder == "default" {
            assert!((back.decay - 1.0).abs() < 1e-6, "{builder}: {}", back.decay);
        }
        assert_ne!(answers(&commit.scene, &rays), before);
        assert_eq!(answers(&scene, &rays), before);
    }
}

/// Several blocks of instances, of which all but one are shared with the snapshot before; now and
/// then one goes far away, which changes what is near for all.
#[test]
fn one_of_many_moves() {
    let mut random = Random::new(SEED);
    for layout in [LayoutChoice::Wide8, LayoutChoice::Wide16] {
        let options = options(layout);
        let cube = Scene::builder().mesh(mesh(&closed::cube())).build(&options).unwrap();
        let pair = Scene::builder()
            .instance(&cube, Affine::IDENTITY)
            .instance(&cube, map(&mut random))
            .build(&options)
            .unwrap();
        let mut told = Told::default();
        told.meshes.push((mesh(&closed::sphere(9, 5)), u32::MAX));
        for index in 0..600 {
            told.instances.push(([&cube, &pair][index % 2].clone(), map(&mut random), u32::MAX));
        }
        let mut scene = told.build(&options);
        for step in 0..6 {
            let instance = random.below(600) as usize;
            let to = match step % 3 {
                0 => map(&mut random),
                1 => Affine::translation([500.0, 0.0, 3.0]),
                _ => Affine::scaling([0.01; 3]),
            };
            told.instances[instance].1 = to;
            let mut edit = scene.edit();
            edit.policy = Policy::Refit;
            edit.set_transform(instance, to).unwrap();
            if step == 4 {
                // A scene with more paths: the ranks of all that follow move up.
                edit.set_scene(10, &pair).unwrap();
                told.instances[10].0 = pair.clone();
            }
            let commit = edit.commit(&options).unwrap();
            assert_eq!(commit.action, Action::Refitted);
            check("one of many", &commit.scene, &told, &options, &mut random);
            scene = commit.scene;
        }
    }
}

#[test]
fn a_commit_says_what_it_did_and_why() {
    let options = options(LayoutChoice::Wide8);
    let shape = closed::sphere(40, 20);
    let scene = Scene::builder().mesh(mesh(&shape)).build(&options).unwrap();
    let commit = |positions: Option<Vec<[f32; 3]>>, policy: Policy| {
        let mut edit = scene.edit();
        edit.policy = policy;
        if let Some(positions) = positions {
            edit.set_positions(0, positions).unwrap();
        }
        edit.commit(&options).unwrap()
    };
    let done = |commit: &treelet::scene::Commit| (commit.action, commit.reason);
    assert_eq!(done(&commit(None, Policy::Auto)), (Action::Kept, Reason::Unchanged));
    let same = Some(shape.positions.clone());
    assert_eq!(done(&commit(same.clone(), Policy::Rebuild)), (Action::Rebuilt, Reason::Asked));
    let refitted = commit(same, Policy::Auto);
    assert_eq!(done(&refitted), (Action::Refitted, Reason::Same));
    assert!((refitted.decay - 1.0).abs() < 1e-6, "{}", refitted.decay);

    // Triangles that change places with distant ones: boxes overlap everywhere, and nothing can stay in its subtree.
    let apart = awkward::random_triangles(3000, 3.0, 0.05);
    let mut order: Vec<usize> = (0..apart.triangles.len()).collect();
    let mut random = Random::new(SEED);
    for at in (1..order.len()).rev() {
        order.swap(at, random.below(at as u64 + 1) as usize);
    }
    let corners = |prim: &usize| apart.triangles[*prim].map(|at| apart.positions[at as usize]);
    let shuffled: Vec<_> = order.iter().flat_map(corners).collect();
    let prims: Vec<_> =
        (0..order.len() as u32).map(|prim| [0, 1, 2].map(|i| 3 * prim + i)).collect();
    let still: Vec<_> = (0..order.len()).flat_map(|prim| corners(&prim)).collect();
    let apart = Scene::builder().mesh(Mesh::new(still, prims)).build(&options).unwrap();
    let shuffle = |policy: Policy| {
        let mut edit = apart.edit();
        edit.policy = policy;
        edit.set_positions(0, shuffled.clone()).unwrap();
        edit.commit(&options).unwrap()
    };
    assert_eq!(done(&shuffle(Policy::Auto)), (Action::Rebuilt, Reason::Decayed));
    let kept = shuffle(Policy::Refit);
    assert_eq!(done(&kept), (Action::Refitted, Reason::Same));
    assert!(kept.decay > 2.0, "{}", kept.decay);

    // A vertex that is nowhere takes its triangles with it.
    let mut broken = shape.positions.clone();
    broken[7][1] = f32::NAN;
    let without = commit(Some(broken), Policy::Refit);
    assert_eq!(done(&without), (Action::Rebuilt, Reason::Unfit));
    assert!(without.scene.report().skipped.triangles > 0);

    let mut edit = scene.edit();
    let missing = EditError::NoGeometry { geom: 1, geometries: 1 };
    assert_eq!(edit.set_positions(1, shape.positions.clone()), Err(missing));
    assert_eq!(missing.to_string(), "there is no mesh or shape 1: the scene has 1");
    let missing = EditError::NoInstance { instance: 0, instances: 0 };
    assert_eq!(edit.set_transform(0, Affine::IDENTITY), Err(missing));
    assert_eq!(edit.remove_instance(0), Err(missing));
}

#[test]
fn nothing_at_all_can_be_edited() {
    let options = options(LayoutChoice::Wide16);
    let nothing = Scene::builder().build(&options).unwrap();
    let mut edit = nothing.edit();
    edit.add_shape(mesh(&closed::cube()));
    let cube = edit.commit(&options).unwrap().scene;
    assert!(cube.any(&Ray::new([0.1, 0.2, -9.0], [0.0, 0.0, 1.0])));
    let mut edit = cube.edit();
    edit.remove_shape(0).unwrap();
    let empty = edit.commit(&options).unwrap().scene;
    assert!(empty.bounds().is_empty());
    let mut edit = empty.edit();
    edit.set_positions(0, vec![]).unwrap();
    let commit = edit.commit(&options).unwrap();
    assert_eq!(commit.action, Action::Refitted);
    assert!(commit.scene.bounds().is_empty());
}

/// Instances come and go, a few at a time: the tree takes them in and leaves them out, spheres and parts of opened
/// instances are numbered after them, and meshes move in between.
#[test]
fn a_few_come_and_go() {
    let mut random = Random::new(SEED);
    for layout in [LayoutChoice::Wide8, LayoutChoice::Wide16] {
        let options = options(layout);
        let object = |shape: &Shape| Scene::builder().mesh(mesh(shape)).build(&options).unwrap();
        let cube = object(&closed::cube());
        let rod: Vec<_> = awkward::random_triangles(200, 20.0, 0.3).positions;
        let rod: Vec<_> = rod.iter().map(|p| [p[0], 0.02 * p[1], 0.02 * p[2]]).collect();
        let all: Vec<_> = (0..200).map(|prim| [3 * prim, 3 * prim + 1, 3 * prim + 2]).collect();
        let rod = Scene::builder().mesh(Mesh::new(rod, all)).build(&options).unwrap();
        let balls = Spheres::new([[0.0, 0.0, 4.0, 1.0], [3.0, 1.0, 0.0, 0.5]]);
        let mut told = Told { balls: vec![balls.clone()], ..Told::default() };
        told.meshes.push((mesh(&closed::sphere(9, 5)), u32::MAX));
        for index in 0..300 {
            told.instances.push(([&cube, &rod][index % 2].clone(), map(&mut random), u32::MAX));
        }
        let among = Scene::builder().shape(balls).instance(&cube, Affine::IDENTITY);
        let among = among.build(&options).unwrap();
        told.instances.push((among.clone(), Affine::IDENTITY, u32::MAX));
        let mut scene = told.build(&options);
        assert!(scene.report().opened_instances > 0);
        for step in 0..14 {
            let mut edit = scene.edit();
            edit.policy = if step == 9 { Policy::Repair } else { Policy::Refit };
            let added = 1 + random.below(3);
            for _ in 0..added {
                let (new, map) = ([&cube, &rod, &among][step % 3], map(&mut random));
                assert_eq!(edit.add_instance(new, map), told.instances.len());
                told.instances.push((new.clone(), map, u32::MAX));
            }
            let gone = 20 * step + random.below(20) as usize;
            edit.remove_instance(gone).unwrap();
            told.instances[gone].0 = object(&Shape::default());
            let commit = edit.commit(&options).unwrap();
            assert_ne!(commit.action, Action::Rebuilt, "{commit}");
            assert_eq!((commit.parts.added, commit.parts.removed), (added, 1), "{commit}");
            check(&format!("{layout:?}, step {step}"), &commit.scene, &told, &options, &mut random);
            scene = commit.scene;
            if step % 4 == 3 {
                // All boxes anew, of a tree that others were put into.
                let size = random.between(0.5, 2.0);
                let old = told.meshes[0].0.positions();
                let moved: Vec<_> = old.iter().map(|p| p.map(|x| x * size)).collect();
                let mut edit = scene.edit();
                edit.policy = Policy::Refit;
                edit.set_positions(0, moved.clone()).unwrap();
                told.meshes[0].0 = told.meshes[0].0.with_positions(moved);
                let commit = edit.commit(&options).unwrap();
                assert_eq!(commit.action, Action::Refitted);
                check("all boxes", &commit.scene, &told, &options, &mut random);
                scene = commit.scene;
            }
        }
        // The tree is not much worse than a new one.
        let fresh = told.build(&options);
        let mut work = [treelet::Counters::default(); 2];
        for ray in verify::rays(&fresh, 200, SEED) {
            scene.closest_counted(&ray, &mut work[0]);
            fresh.closest_counted(&ray, &mut work[1]);
        }
        let [grown, fresh] = work.map(|work| work.nodes as f64);
        assert!(grown < 1.5 * fresh, "{grown} nodes, {fresh} in a new tree");
        // What was taken out and comes back is put in anew: its leaf is an empty box.
        let mut back = scene.edit();
        back.remove_instance(22).unwrap();
        let without = back.commit(&options).unwrap().scene;
        let mut back = without.edit();
        back.set_scene(22, &cube).unwrap();
        told.instances[22].0 = cube.clone();
        back.policy = Policy::Refit;
        let back = back.commit(&options).unwrap();
        assert_eq!((back.action, back.reason), (Action::Refitted, Reason::Few));
        check("back", &back.scene, &told, &options, &mut random);
        // It is there once.
        let [x, y, z] = told.instances[22].1.point([0.0; 3]);
        let through = [Ray::new([x, y, z - 50.0], [0.0, 0.0, 1.0])];
        assert_eq!(answers(&back.scene, &through), answers(&told.build(&options), &through));
    }
}
