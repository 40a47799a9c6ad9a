//! What comes and goes: shapes of every kind, meshes that move and instances enter a tree and leave it, in any order,
//! and the scene answers as one that was built from nothing, bit for bit.

use treelet::geometry::{
    Curves, Defect, Disc, Discs, Meeting, Primitives, Quads, Shape, Spheres, User,
};
use treelet::memory::Array;
use treelet::scene::{
    Action, EditError, InstanceDefect, LayoutChoice, Parts, Policy, Reason, Recipe,
};
use treelet::verify::{self, BruteForce, Random};
use treelet::{
    Aabb, Affine, BuildOptions, Counters, Hit, Invalid, Mesh, Ray, Scene, SceneBuilder, SceneError,
};
use treelet_testkit::{awkward, closed};

const SEED: u64 = 0xE8C4;

/// What the scene should hold, told anew.
#[derive(Clone, Default)]
struct Told {
    shapes: Vec<(Shape, u32)>,
    instances: Vec<(Scene, Vec<Affine>, u32)>,
}

impl Told {
    fn build(&self, options: &BuildOptions<'_>) -> Scene {
        let shapes = self.shapes.iter();
        let scene = shapes.fold(Scene::builder(), |scene, (shape, mask)| {
            scene.shape_masked(shape.clone(), *mask)
        });
        let instances = self.instances.iter();
        let scene: SceneBuilder = instances.fold(scene, |scene, (inner, steps, mask)| {
            scene.instance_moving_masked(inner, steps, *mask)
        });
        scene.build(options).unwrap()
    }
}

fn answers(scene: &Scene, rays: &[Ray]) -> Vec<(Option<[u64; 6]>, bool, u64)> {
    let bits = |hit: Hit| {
        let [t, u, v] = [hit.t, hit.u, hit.v].map(|x| u64::from(x.to_bits()));
        [t, u, v, u64::from(hit.prim), u64::from(hit.geom), hit.inst]
    };
    let answer = |ray| (scene.closest(ray).map(bits), scene.any(ray), scene.count(ray));
    rays.iter().map(answer).collect()
}

fn rays(scene: &Scene, random: &mut Random) -> Vec<Ray> {
    let rays = verify::rays(scene, 60, random.bits()).into_iter();
    rays.map(|ray| ray.at_time(random.between(0.0, 1.0))).collect()
}

fn check(what: &str, edited: &Scene, told: &Told, options: &BuildOptions<'_>, random: &mut Random) {
    let fresh = told.build(options);
    // Boxes of parts of an instance are together smaller than its own.
    if [edited, &fresh].iter().all(|scene| scene.report().opened_instances == 0) {
        assert_eq!(edited.bounds(), fresh.bounds(), "{what}");
    }
    assert_eq!(edited.paths(), fresh.paths(), "{what}");
    assert_eq!(edited.is_moving(), fresh.is_moving(), "{what}");
    let rays = rays(&fresh, random);
    assert_eq!(answers(edited, &rays), answers(&fresh, &rays), "{what}, seed {SEED:#x}");
    let brute = BruteForce::new(edited);
    for ray in rays.iter().step_by(6) {
        verify::check(edited, ray, &brute.all(ray)).unwrap_or_else(|e| panic!("{what}: {e}"));
    }
}

fn point(random: &mut Random) -> [f32; 3] {
    [(); 3].map(|()| random.between(-4.0, 4.0))
}

fn balls(count: u64, random: &mut Random) -> Vec<[f32; 4]> {
    let ball = |random: &mut Random| {
        let [x, y, z] = point(random);
        [x, y, z, random.between(0.05, 0.7)]
    };
    (0..count).map(|_| ball(random)).collect()
}

/// Boxes of the caller's own.
struct Boxes(Vec<[f32; 4]>);

impl Primitives for Boxes {
    fn len(&self) -> usize {
        self.0.len()
    }

    fn bounds(&self, prim: usize) -> Aabb {
        let [x, y, z, r] = self.0[prim];
        Aabb { lo: [x - r, y - r, z - r], hi: [x + r, y + r, z + r] }
    }

    fn hit(&self, prim: usize, ray: &Ray) -> Option<Meeting> {
        // The plane through the middle.
        let [x, y, z, r] = self.0[prim];
        let t = (z - ray.origin[2]) / ray.direction[2];
        let off = |axis: usize, at: f32| (ray.origin[axis] + t * ray.direction[axis] - at).abs();
        let inside = off(0, x) < r && off(1, y) < r && ray.t_min <= t && t <= ray.t_max;
        inside.then_some(Meeting { t, u: 0.5, v: 0.25 })
    }
}

fn triangles(count: u64, size: f32, random: &mut Random) -> Mesh {
    let corners: Vec<[f32; 3]> = (0..count)
        .flat_map(|_| {
            let at = point(random);
            [(); 3].map(|()| at.map(|x| x + random.between(-size, size)))
        })
        .collect();
    let prims: Vec<_> =
        (0..count as u32).map(|prim| [3 * prim, 3 * prim + 1, 3 * prim + 2]).collect();
    Mesh::new(corners, prims)
}

/// The same, each vertex on its way.
fn moving(mesh: &Mesh, steps: usize, random: &mut Random) -> Mesh {
    let step = |_| -> Array<[f32; 3]> {
        let mut off = |x: &f32| x + random.between(-0.5, 0.5);
        mesh.positions().iter().map(|p| [off(&p[0]), p[1], p[2] + 0.1]).collect::<Vec<_>>().into()
    };
    Mesh::moving((0..steps).map(step).collect::<Vec<_>>(), mesh.triangles().to_vec())
}

/// Something small, of any kind.
fn small(random: &mut Random) -> Shape {
    let count = random.below(9);
    match random.below(8) {
        0 => Spheres::new(balls(count, random)).into(),
        1 => {
            let disc = |[x, y, z, radius]: [f32; 4]| Disc {
                center: [x, y, z],
                radius,
                normal: [0.3, 0.1, 1.0],
            };
            Discs::new(balls(count, random).into_iter().map(disc).collect::<Vec<_>>()).into()
        }
        2 => {
            let segments: Vec<u32> = (0..count as u32).collect();
            Curves::new(balls(count + 1, random), segments).into()
        }
        3 => {
            let corners = |[x, y, z, r]: [f32; 4]| {
                [[x, y, z], [x + r, y, z], [x + r, y + r, z], [x, y + r, z - r]]
            };
            let corners: Vec<_> = balls(count, random).into_iter().flat_map(corners).collect();
            let quads: Vec<_> =
                (0..count as u32).map(|at| [0, 1, 2, 3].map(|i| 4 * at + i)).collect();
            Quads::new(corners, quads).into()
        }
        4 => User::new(Boxes(balls(count, random))).into(),
        5 => moving(&triangles(count, 0.5, random), 2 + random.below(2) as usize, random).into(),
        _ => triangles(4 * count, 0.5, random).into(),
    }
}

fn map(random: &mut Random) -> Affine {
    let scale = [(); 3].map(|()| random.between(0.4, 1.5));
    Affine::translation([(); 3].map(|()| random.between(-5.0, 5.0)))
        .then_from(&Affine::rotation(random.direction(), random.between(0.0, 6.3)))
        .then_from(&Affine::scaling(scale))
}

/// One random change, told as it is made.
fn change(
    edit: &mut treelet::scene::Edit,
    told: &mut Told,
    objects: &[Scene],
    random: &mut Random,
) -> &'static str {
    let geom = random.below(told.shapes.len() as u64) as usize;
    let instance = random.below(told.instances.len() as u64) as usize;
    let object = &objects[random.below(objects.len() as u64) as usize];
    match random.below(12) {
        0 | 1 => {
            let shape = small(random);
            assert_eq!(edit.add_shape(shape.clone()), told.shapes.len());
            told.shapes.push((shape, u32::MAX));
            "comes"
        }
        // The first one is what all others are small beside.
        2 if geom > 0 => {
            edit.remove_shape(geom).unwrap();
            told.shapes[geom].0 = Mesh::default().into();
            "goes"
        }
        3 if geom > 0 => {
            let shape = small(random);
            edit.set_shape(geom, shape.clone()).unwrap();
            told.shapes[geom].0 = shape;
            "becomes another"
        }
        4 => {
            let mask = 1 << random.below(3);
            edit.set_mask(geom, mask).unwrap();
            edit.set_instance_mask(instance, mask).unwrap();
            (told.shapes[geom].1, told.instances[instance].2) = (mask, mask);
            "masked"
        }
        5 => {
            let Some(mesh) = told.shapes[geom].0.mesh() else { return "nothing" };
            let by = random.between(-0.3, 0.3);
            let moved: Vec<_> = mesh.positions().iter().map(|p| p.map(|x| x + by)).collect();
            let bent = mesh.with_positions(moved.clone());
            edit.set_positions(geom, moved).unwrap();
            told.shapes[geom].0 = bent.into();
            "bent"
        }
        6 => {
            let map = map(random);
            assert_eq!(edit.add_instance(object, map), told.instances.len());
            told.instances.push((object.clone(), vec![map], u32::MAX));
            "placed"
        }
        7 => {
            edit.remove_instance(instance).unwrap();
            told.instances[instance].0 = objects[0].clone();
            "taken away"
        }
        8 => {
            edit.set_scene(instance, object).unwrap();
            told.instances[instance].0 = object.clone();
            "given another"
        }
        9 => {
            let steps = [map(random), map(random)];
            edit.set_motion(instance, &steps).unwrap();
            told.instances[instance].1 = steps.to_vec();
            "set in motion"
        }
        10 => {
            let Some(mesh) = told.shapes[geom].0.mesh().filter(|it| it.is_moving()) else {
                return "nothing";
            };
            let other = moving(mesh, mesh.steps(), random);
            edit.set_shape(geom, other.clone()).unwrap();
            told.shapes[geom].0 = other.into();
            "goes another way"
        }
        _ => {
            let map = map(random);
            edit.set_transform(instance, map).unwrap();
            told.instances[instance].1 = vec![map];
            "moved"
        }
    }
}

/// Every layout, with builders that split triangles and others, through edits of one to three changes each, under each policy.
#[test]
fn whatever_comes_and_goes_the_answers_are_those_of_a_fresh_build() {
    let mut random = Random::new(SEED);
    let random = &mut random;
    let (mut kept, mut exchanged) = (0, 0);
    for (at, name) in ["default", "presplit+hploc", "sbvh", "fastest"].into_iter().enumerate() {
        for &layout in LayoutChoice::ALL {
            let recipe: Recipe = name.parse().unwrap();
            let options = BuildOptions { layout: Some(layout), ..recipe.options() };
            let object = |mesh: Mesh| Scene::builder().mesh(mesh).build(&options).unwrap();
            let objects = [
                object(Mesh::default()),
                object(triangles(9, 1.0, random)),
                object(moving(&triangles(5, 1.0, random), 2, random)),
            ];
            let mut told = Told::default();
            told.shapes.push((triangles(220, 0.6, random).into(), u32::MAX));
            (0..6).for_each(|_| told.shapes.push((small(random), u32::MAX)));
            for which in [1, 2, 1] {
                let map = map(random);
                told.instances.push((objects[which].clone(), vec![map], u32::MAX));
            }
            let mut scene = told.build(&options);
            for step in 0..14 {
                let mut edit = scene.edit();
                edit.policy = match (step + at) % 7 {
                    0..=2 => Policy::Refit,
                    3 => Policy::Auto,
                    4 => Policy::Repair,
                    5 => Policy::Rays(1 << random.below(30)),
                    _ => Policy::Budget(core::time::Duration::from_micros(random.below(2000))),
                };
                let changes = 1 + random.below(3);
                let what: Vec<_> =
                    (0..changes).map(|_| change(&mut edit, &mut told, &objects, random)).collect();
                let commit = edit.commit(&options).unwrap();
                let what = format!("{name}, {layout:?}, step {step}: {what:?}; {commit}");
                check(&what, &commit.scene, &told, &options, random);
                kept += u32::from(commit.action != Action::Rebuilt);
                exchanged += u32::from(commit.parts.added + commit.parts.removed > 0);
                scene = commit.scene;
            }
        }
    }
    // Of 168.
    assert!(
        kept > 120 && exchanged > 80,
        "{kept} kept, {exchanged} of them with what came or went"
    );
}

/// Many triangles, and something small beside them.
fn pair(options: &BuildOptions<'_>) -> Told {
    let shapes = [closed::sphere(60, 30), awkward::random_triangles(40, 0.4, 0.2)];
    let mesh = |shape: &treelet_testkit::Shape| {
        Mesh::new(shape.positions.clone(), shape.triangles.clone()).into()
    };
    let cube = closed::cube();
    let cube = Mesh::new(cube.positions, cube.triangles);
    let object = Scene::builder().mesh(cube).build(options).unwrap();
    let instances = vec![(object, vec![Affine::translation([4.0, 0.0, 0.0])], u32::MAX)];
    Told { shapes: shapes.iter().map(|shape| (mesh(shape), u32::MAX)).collect(), instances }
}

#[test]
fn a_commit_says_what_came_and_went_and_the_tree_stays_good() {
    let mut random = Random::new(SEED);
    for &layout in LayoutChoice::ALL {
        let options = BuildOptions { layout: Some(layout), ..BuildOptions::default() };
        let mut told = pair(&options);
        let mut scene = told.build(&options);
        let few = |added, removed| (Reason::Few, Parts { added, removed, ..Parts::default() });
        let said = |commit: &treelet::scene::Commit| (commit.reason, commit.parts);
        for step in 0..20 {
            // Another number of triangles: some go, others come.
            let new = triangles(30 + step, 0.2, &mut random);
            let mut edit = scene.edit();
            edit.set_shape(1, new.clone()).unwrap();
            edit.policy = Policy::Refit;
            let commit = edit.commit(&options).unwrap();
            assert_eq!((commit.action, said(&commit)), (Action::Refitted, few(1, 1)), "{commit}");
            told.shapes[1].0 = new.into();
            scene = commit.scene;
        }
        check("twenty times another", &scene, &told, &options, &mut random);
        // Nodes that hold nothing any more are not kept, and boxes did not grow.
        let fresh = told.build(&options);
        let most = fresh.trace_bytes() + fresh.trace_bytes() / 10;
        assert!(scene.trace_bytes() < most, "{} of {most}", scene.trace_bytes());
        let mut work = [Counters::default(); 2];
        for ray in verify::rays(&fresh, 400, SEED) {
            scene.closest_counted(&ray, &mut work[0]);
            fresh.closest_counted(&ray, &mut work[1]);
        }
        let [grown, new] = work.map(|work| work.nodes as f64);
        assert!(grown < 1.5 * new, "{layout:?}: {grown} nodes, {new} in a new tree");

        // Nothing, something, and most of it.
        let mut edit = scene.edit();
        edit.remove_shape(1).unwrap();
        let commit = edit.commit(&options).unwrap();
        assert_eq!(said(&commit), few(0, 1), "{commit}");
        let text = commit.to_string();
        assert!(text.contains("0 added and 1 removed"), "{text}");
        let mut edit = commit.scene.edit();
        edit.set_shape(1, Spheres::new(balls(3, &mut random))).unwrap();
        edit.policy = Policy::Refit;
        let commit = edit.commit(&options).unwrap();
        assert_eq!(said(&commit), few(1, 0), "{commit}");
        let mut edit = commit.scene.edit();
        edit.set_shape(1, triangles(2000, 0.5, &mut random)).unwrap();
        let commit = edit.commit(&options).unwrap();
        assert_eq!((commit.action, commit.reason), (Action::Rebuilt, Reason::Different));
        let mut edit = scene.edit();
        edit.remove_shape(1).unwrap();
        edit.policy = Policy::Rebuild;
        let commit = edit.commit(&options).unwrap();
        assert_eq!((commit.action, commit.reason), (Action::Rebuilt, Reason::Asked));
    }
}

#[test]
fn what_is_wrong_with_what_came_is_named() {
    let options = BuildOptions::default();
    let strict = BuildOptions { invalid: Invalid::Error, ..BuildOptions::default() };
    let told = pair(&options);
    let scene = told.build(&options);
    let wrong = |change: &dyn Fn(&mut treelet::scene::Edit)| {
        let mut edit = scene.edit();
        change(&mut edit);
        edit.commit(&strict).unwrap_err()
    };
    let positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, f32::NAN, 0.0], [0.0, 1.0, 0.0]];
    let broken = Mesh::new(positions.clone(), [[0, 1, 3], [0, 1, 2]]);
    let error = wrong(&|edit| {
        edit.add_shape(broken.clone());
    });
    let SceneError::Triangle { geom: 2, prim: 1, defect: Defect::BadVertex { vertex: 2, .. } } =
        error
    else {
        panic!("{error}")
    };
    let error = wrong(&|edit| edit.set_shape(1, Spheres::new([[0.0, 0.0, 0.0, -1.0]])).unwrap());
    assert!(matches!(error, SceneError::Primitive { geom: 1, prim: 0, .. }), "{error}");
    let steps: [Array<[f32; 3]>; 2] = [positions.clone().into(), positions[..3].to_vec().into()];
    let uneven = Mesh::moving(steps, [[0, 1, 3]]);
    let error = wrong(&|edit| edit.set_shape(1, uneven.clone()).unwrap());
    assert_eq!(error, SceneError::Steps { geom: 1, step: 1, vertices: 3, first: 4 });
    let mirror = Affine::scaling([-1.0, 1.0, 1.0]);
    let error = wrong(&|edit| edit.set_motion(0, &[Affine::IDENTITY, mirror]).unwrap());
    let defect = InstanceDefect::Mirrored { step: 1 };
    assert_eq!(error, SceneError::Instance { instance: 0, defect });
    let flat = Affine::scaling([1.0, 0.0, 1.0]);
    let error = wrong(&|edit| {
        edit.add_instance_moving(&scene, &[Affine::IDENTITY, flat]);
    });
    let defect = InstanceDefect::Step { step: 1, rows: flat.0 };
    assert_eq!(error, SceneError::Instance { instance: 1, defect });
    let missing = EditError::NoInstance { instance: 7, instances: 1 };
    assert_eq!(scene.edit().set_motion(7, &[mirror]), Err(missing));

    // What was left out is counted, and looked at again when it is elsewhere.
    let mut random = Random::new(SEED);
    let mut edit = scene.edit();
    edit.add_shape(broken.clone());
    let commit = edit.commit(&options).unwrap();
    assert_eq!(commit.reason, Reason::Few);
    let skipped = &commit.scene.report().skipped;
    assert_eq!((skipped.triangles, skipped.first_triangle.map(|it| it.0)), (1, Some(2)));
    let mut edit = commit.scene.edit();
    let mended: Vec<_> =
        positions.iter().map(|p| p.map(|x| if x.is_nan() { 2.0 } else { x })).collect();
    edit.set_positions(2, mended.clone()).unwrap();
    let commit = edit.commit(&options).unwrap();
    assert_eq!((commit.action, commit.reason), (Action::Rebuilt, Reason::Unfit));
    let mut told = told;
    told.shapes.push((broken.with_positions(mended).into(), u32::MAX));
    check("mended", &commit.scene, &told, &options, &mut random);
}

/// The way of an instance that cannot be used, or holds nothing for now, is not forgotten and not taken for another.
#[test]
fn ways_are_kept_by_who_is_nowhere() {
    let mut random = Random::new(SEED);
    let options = BuildOptions::default();
    let mut told = pair(&options);
    let cube = told.instances[0].0.clone();
    let nothing = Scene::builder().build(&options).unwrap();
    let way = [Affine::IDENTITY, Affine::translation([0.0, 5.0, 0.0])];
    let mirrored = [Affine::IDENTITY, Affine::scaling([-1.0, 1.0, 1.0])];
    told.instances.push((nothing, way.to_vec(), u32::MAX));
    told.instances.push((cube.clone(), mirrored.to_vec(), u32::MAX));
    let scene = told.build(&options);
    let mut edit = scene.edit();
    edit.set_scene(1, &cube).unwrap();
    told.instances[1].0 = cube.clone();
    let commit = edit.commit(&options).unwrap();
    assert_eq!((commit.reason, commit.parts.added), (Reason::Few, 1), "{commit}");
    check("given something", &commit.scene, &told, &options, &mut random);
    let ray = Ray::new([0.0, 5.0, -9.0], [0.0, 0.0, 1.0]);
    assert!(commit.scene.any(&ray.at_time(1.0)) && !commit.scene.any(&ray));
    let mut edit = commit.scene.edit();
    edit.set_motion(2, &way).unwrap();
    told.instances[2].1 = way.to_vec();
    let commit = edit.commit(&options).unwrap();
    assert_eq!((commit.reason, commit.parts.added), (Reason::Few, 1), "{commit}");
    check("set right", &commit.scene, &told, &options, &mut random);
}
