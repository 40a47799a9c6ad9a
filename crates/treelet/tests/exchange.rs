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
    match random.below(11) {
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
                    0 | 1 | 2 => Policy::Refit,
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
