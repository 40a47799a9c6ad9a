//! Primitives in several leaves: the same bits as brute force, no leaks, nothing lost, nothing
//! counted twice.

mod presplit;

use treelet::bounds::Aabb;
use treelet::build::{BinnedSah, BuildError, Builder, Clip, Sbvh};
use treelet::geometry::clip::{clipped_bounds, least_half_area};
use treelet::tree::{DEPTH_MAX, Kind, SahConstants, Tree, TreeError};
use treelet::verify::{self, BruteForce, Random};
use treelet::{Affine, BuildOptions, Context, Hit, Mesh, Quality, Ray, Scene};
use treelet_testkit::{Shape, awkward, closed};

const SEED: u64 = 0x5B117;

/// Splits whatever it can.
const EAGER: Sbvh = Sbvh {
    leaf_max: 1,
    bins: 32,
    visit_cost: 0.0,
    block: 1,
    overlap_min: 0.0,
    node_overlap_min: 0.0,
    advantage: 1.0,
    budget: 4.0,
    clips: 1_000_000,
};

type Corners = [[f32; 3]; 3];

struct Triangles(Vec<Corners>);

impl Clip for Triangles {
    fn clip(&self, prim: u32, region: &Aabb) -> Aabb {
        clipped_bounds(&self.0[prim as usize], region)
    }

    fn least_half_area(&self, prim: u32) -> Option<f64> {
        Some(least_half_area(&self.0[prim as usize]))
    }
}

impl Triangles {
    fn of(shape: &Shape) -> Self {
        let mesh = mesh(shape);
        let fit = (0..mesh.triangles().len()).filter(|&prim| mesh.defect(prim).is_none());
        Self(fit.map(|prim| mesh.corners(prim).unwrap()).collect())
    }

    fn bounds(&self) -> Vec<Aabb> {
        self.0.iter().map(|corners| Aabb::of_points(corners)).collect()
    }

    fn tree(&self, builder: &dyn Builder) -> Tree {
        builder.build_clipped(&self.bounds(), self, &Context::default()).unwrap()
    }
}

fn mesh(shape: &Shape) -> Mesh {
    Mesh::new(shape.positions.clone(), shape.triangles.clone())
}

fn scene(shape: &Shape, builder: &dyn Builder) -> Scene {
    let options = BuildOptions { builder: Some(builder), ..BuildOptions::default() };
    Scene::builder().mesh(mesh(shape)).build(&options).unwrap()
}

/// Long slanted triangles among small ones: what splits are for.
fn shards(count: usize, seed: u64) -> Shape {
    let mut random = Random::new(seed);
    let triangles: Vec<Corners> = (0..count)
        .map(|i| {
            let [size, width] = if i % 4 == 0 { [8.0, 0.05] } else { [0.5, 0.5] };
            let at = [(); 3].map(|()| random.between(-5.0, 5.0));
            let along = random.direction().map(|x| x * size);
            let across = random.direction().map(|x| x * width);
            let tip: [f32; 3] = std::array::from_fn(|k| at[k] + along[k]);
            [at, tip, std::array::from_fn(|k| at[k] + across[k])]
        })
        .collect();
    Shape::soup(&triangles)
}

/// Eight slanted triangles across a sphere's inside would open it; so a sphere of few, long ones.
fn long_sphere() -> Shape {
    let turn = Affine::rotation([1.0, 2.0, 3.0], 0.7);
    closed::sphere(96, 6).mapped(|p| turn.point(p))
}

fn scenes() -> Vec<(String, Shape)> {
    let mut scenes: Vec<(String, Shape)> =
        awkward::all(500).into_iter().map(|each| (each.name.to_owned(), each.shape)).collect();
    scenes.push(("shards".into(), shards(1_500, 1)));
    scenes.push(("far shards".into(), shards(400, 2).mapped(closed::far_away)));
    scenes.push(("long sphere".into(), long_sphere()));
    for scale in [1e-30_f32, 1e-17, 1e-12, 1e15] {
        let scaled = shards(300, 3).mapped(|p| p.map(|x| x * scale));
        scenes.push((format!("shards scaled by {scale}"), scaled));
    }
    scenes
}

#[test]
fn trees_hold_every_part_of_every_triangle() {
    let mut pieces = 0;
    for (name, shape) in scenes() {
        let triangles = Triangles::of(&shape);
        let bounds = triangles.bounds();
        for builder in [Sbvh::DEFAULT, EAGER, Sbvh { budget: 0.1, ..EAGER }] {
            let tree = triangles.tree(&builder);
            tree.validate_pieces(&bounds).unwrap_or_else(|e| panic!("{name}, {builder:?}: {e}"));
            let extra = tree.prims.len() - bounds.len();
            let most = f64::from(builder.budget) * bounds.len() as f64;
            assert!(extra as f64 <= most, "{name}, {builder:?}: {extra} extra references");
            pieces += extra;
            hold_every_point(&name, &triangles, &tree);
            if extra == 0 {
                tree.validate(&bounds).unwrap();
            }
        }
        // Without a geometry to ask nothing is cut.
        let plain = EAGER.build(&bounds, &Context::default()).unwrap();
        plain.validate(&bounds).unwrap_or_else(|e| panic!("{name}, no clip: {e}"));
    }
    assert!(pieces > 10_000, "only {pieces} pieces");
}

/// Points of each triangle that was cut lie in one of its leaves, as exactly as f64 can tell.
fn hold_every_point(name: &str, triangles: &Triangles, tree: &Tree) {
    let mut leaves = vec![Vec::new(); triangles.0.len()];
    for node in &tree.nodes {
        if let Kind::Leaf { first, count } = node.kind() {
            tree.prims[first..first + count]
                .iter()
                .for_each(|&prim| leaves[prim as usize].push(node.bounds));
        }
    }
    let mut random = Random::new(SEED);
    for (corners, leaves) in triangles.0.iter().zip(&leaves) {
        let slop = 2.0_f64.powi(-48) * f64::from(Aabb::of_points(corners).max_abs());
        for _ in 0..if leaves.len() > 1 { 30 } else { 1 } {
            let (mut v, mut w) = (f64::from(random.unit()), f64::from(random.unit()));
            if v + w > 1.0 {
                (v, w) = (1.0 - v, 1.0 - w);
            }
            let [a, b, c] = corners.map(|corner| corner.map(f64::from));
            let inside = |leaf: &Aabb| {
                (0..3).all(|i| {
                    let p = a[i] + v * (b[i] - a[i]) + w * (c[i] - a[i]);
                    f64::from(leaf.lo[i]) <= p + slop && p - slop <= f64::from(leaf.hi[i])
                })
            };
            assert!(leaves.iter().any(inside), "{name}: a point of {corners:?} is in no leaf");
        }
    }
}

/// Rays at the faces, edges and corners of leaves that hold parts of triangles.
fn rays_at_faces(tree: &Tree, count: usize, map: &Affine) -> Vec<Ray> {
    let mut random = Random::new(SEED);
    let leaves: Vec<Aabb> = tree
        .nodes
        .iter()
        .filter(|node| matches!(node.kind(), Kind::Leaf { .. }))
        .map(|node| node.bounds)
        .collect();
    let around = tree.bounds();
    (0..count)
        .map(|i| {
            let leaf = leaves[random.below(leaves.len() as u64) as usize];
            let mut within = |b: &Aabb| -> [f32; 3] {
                std::array::from_fn(|k| random.between(b.lo[k], b.hi[k]))
            };
            let (mut target, mut origin) = (within(&leaf), within(&around));
            // On one, two or three faces, or a step beside them.
            for axis in 0..3 {
                match random.below(6) {
                    0 => target[axis] = leaf.lo[axis],
                    1 => target[axis] = leaf.hi[axis],
                    2 => target[axis] = leaf.hi[axis].next_up(),
                    _ => {}
                }
                // In the plane of a face.
                if random.below(8) == 0 {
                    origin[axis] = target[axis];
                }
            }
            // From far away.
            let far = [1.0, 1.0, 30.0, 1e4][i % 4];
            let origin: [f32; 3] =
                std::array::from_fn(|k| target[k] + (origin[k] - target[k]) * far);
            let (origin, target) = (map.point(origin), map.point(target));
            let direction: [f32; 3] = std::array::from_fn(|k| target[k] - origin[k]);
            // Directions of scaled scenes may be too short to be rays.
            let short = direction.iter().all(|d| d.abs() < 2.0_f32.powi(-90));
            Ray::new(origin, direction.map(|d| if short { d * 2.0_f32.powi(90) } else { d }))
        })
        .collect()
}

fn agree(name: &str, built: &Scene, rays: &[Ray]) {
    let brute = BruteForce::new(built);
    if let Err(mismatch) = verify::check_many(built, rays, |ray| brute.all(ray)) {
        panic!("{name}, seed {SEED:#x}: {mismatch}");
    }
}

#[test]
fn answers_are_those_of_brute_force() {
    let mut hits = 0;
    for (name, shape) in scenes() {
        let built = scene(&shape, &EAGER);
        let tree = Triangles::of(&shape).tree(&EAGER);
        if tree.nodes.is_empty() {
            continue;
        }
        let rays = rays_at_faces(&tree, 1_500, &Affine::IDENTITY);
        hits += rays.iter().map(|ray| built.count(ray)).sum::<u64>();
        agree(&name, &built, &rays);
        agree(&name, &built, &verify::rays(&built, 600, SEED));
    }
    assert!(hits > 10_000, "only {hits} hits");
}

#[test]
fn answers_through_instances_are_those_of_brute_force() {
    let awry = Affine::translation([31.0, -7.5, 260.0])
        .then_from(&Affine::rotation([3.0, -1.0, 2.0], 2.1))
        .then_from(&Affine::scaling([0.3, -4.0, 25.0]));
    let far = Affine::translation(closed::far_away([0.0; 3]));
    for (name, shape) in [("shards", shards(800, 4)), ("long sphere", long_sphere())] {
        let inner = scene(&shape, &EAGER);
        let tree = Triangles::of(&shape).tree(&EAGER);
        for (map_name, map) in [("awry", awry), ("far", far)] {
            // Twice, so that trees over instances have something to hold, beside shards of its own.
            let twice = Scene::builder()
                .mesh(mesh(&shards(50, 5)))
                .instance(&inner, map)
                .instance(&inner, Affine::translation([3.0, 0.0, 0.0]).then_from(&map));
            let options = BuildOptions { builder: Some(&EAGER), ..BuildOptions::default() };
            let outer = twice.build(&options).unwrap();
            let name = format!("{name}, {map_name}");
            agree(&name, &outer, &rays_at_faces(&tree, 2_000, &map));
            agree(&name, &outer, &verify::rays(&outer, 600, SEED));
        }
    }
}

/// From inside a closed mesh every ray hits, wherever it is aimed.
#[test]
fn no_ray_slips_between_pieces() {
    for (name, shape) in [
        ("long sphere", long_sphere()),
        ("sphere", closed::sphere(64, 32)),
        ("star", closed::random_star(48, 24, 5)),
        ("far sphere", closed::sphere(64, 8).mapped(closed::far_away)),
    ] {
        let center = if name == "far sphere" { closed::far_away([0.0; 3]) } else { [0.0; 3] };
        let built = scene(&shape, &EAGER);
        assert!(built.report().tree.prims > built.report().triangles, "{name} is not split");
        let tree = Triangles::of(&shape).tree(&EAGER);
        let mut random = Random::new(SEED);
        let rays: Vec<Ray> = rays_at_faces(&tree, 200_000, &Affine::IDENTITY)
            .iter()
            .map(|ray| {
                let target = ray.at(1.0);
                let origin: [f32; 3] =
                    std::array::from_fn(|k| center[k] + random.between(-0.02, 0.02));
                Ray::new(origin, std::array::from_fn(|k| target[k] - origin[k]))
            })
            .filter(Ray::is_valid)
            .collect();
        let mut hits = vec![Hit::MISS; rays.len()];
        built.closest_many(&rays, &mut hits).unwrap();
        let leaks = rays.iter().zip(&hits).filter(|(_, hit)| !hit.is_hit());
        let leaks: Vec<&Ray> = leaks.map(|(ray, _)| ray).collect();
        assert!(leaks.is_empty(), "{name}: {} leaks, the first {:?}", leaks.len(), leaks[0]);
    }
}

#[test]
fn the_same_tree_for_any_number_of_threads() {
    let shape = shards(60_000, 6);
    let triangles = Triangles::of(&shape);
    let trees = [1, 2, 7].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| triangles.tree(&Sbvh { overlap_min: 0.0, ..Sbvh::DEFAULT }))
    });
    assert!(trees[0].prims.len() > 61_000, "{} entries", trees[0].prims.len());
    assert_eq!(trees[0], trees[1], "2 threads");
    assert_eq!(trees[0], trees[2], "7 threads");
}

#[test]
fn pieces_cost_no_more_than_they_may() {
    let triangles = Triangles::of(&shards(20_000, 8));
    let entries = |clips: u32| triangles.tree(&Sbvh { clips, ..EAGER }).prims.len();
    let [none, few, many] = [0, 10, EAGER.clips].map(entries);
    assert!(none == 20_000 && none < few && few < many, "{none}, {few}, {many} entries");
}

#[test]
fn splits_pay_where_triangles_are_long() {
    let triangles = Triangles::of(&shards(20_000, 7));
    let sah = |tree: &Tree| tree.sah(&SahConstants::default());
    let whole = sah(&triangles.tree(&BinnedSah::DEFAULT));
    let split = sah(&triangles.tree(&Sbvh::DEFAULT));
    assert!(split < 0.8 * whole, "{whole} falls to {split} only");
    let tree = triangles.tree(&EAGER);
    assert!(tree.stats().depth <= DEPTH_MAX);
}

#[test]
fn lost_parts_are_noticed() {
    let triangles = Triangles::of(&shards(300, 8));
    let bounds = triangles.bounds();
    let tree = triangles.tree(&EAGER);
    tree.validate_pieces(&bounds).unwrap();
    assert!(matches!(tree.validate(&bounds), Err(TreeError::Primitive { times: 2.., .. })));
    // A leaf that holds another primitive's part instead of its own.
    let mut bad = tree.clone();
    let last = bad.prims.len() - 1;
    bad.prims[last] = bad.prims[0];
    let error = bad.validate_pieces(&bounds).unwrap_err();
    assert!(matches!(error, TreeError::Part { .. } | TreeError::Primitive { .. }), "{error}");
    // A primitive too few.
    let error = tree.validate_pieces(&bounds[..299]).unwrap_err();
    assert!(matches!(error, TreeError::Primitive { prim: 299, .. }), "{error}");
}

#[test]
fn every_quality_answers_like_brute_force() {
    for (name, shape) in scenes() {
        let mut work = Vec::new();
        for quality in Quality::ALL {
            let options = BuildOptions { quality, ..BuildOptions::default() };
            let built = Scene::builder().mesh(mesh(&shape)).build(&options).unwrap();
            let rays = verify::rays(&built, 120, SEED);
            agree(&format!("{name}, {}", quality.name()), &built, &rays);
            assert_eq!(built.report().plan, quality.plan().to_string());
            work.push(built.report().tree.sah);
        }
        if name == "shards" {
            assert!(work[4] < work[3] && work[3] < work[2], "best, high, default: {work:?}");
        }
    }
}

#[test]
fn options_out_of_range_are_named() {
    let default = Sbvh::DEFAULT;
    let bad: [(Sbvh, &str); 10] = [
        (Sbvh { leaf_max: 65, ..default }, "leaf_max"),
        (Sbvh { bins: 33, ..default }, "bins"),
        (Sbvh { bins: 1, ..default }, "bins"),
        (Sbvh { visit_cost: -1.0, ..default }, "visit_cost"),
        (Sbvh { block: 0, ..default }, "block"),
        (Sbvh { overlap_min: f32::NAN, ..default }, "overlap_min"),
        (Sbvh { node_overlap_min: 1.5, ..default }, "node_overlap_min"),
        (Sbvh { advantage: -0.5, ..default }, "advantage"),
        (Sbvh { budget: 4.5, ..default }, "budget"),
        (Sbvh { clips: 2_000_000, ..default }, "clips"),
    ];
    for (builder, name) in bad {
        let error = builder.build(&[], &Context::default()).unwrap_err();
        assert!(matches!(error, BuildError::Option { option, .. } if option == name), "{error}");
    }
}

#[test]
fn leaves_are_filled_where_that_costs_nothing() {
    let triangles = Triangles::of(&shards(5_000, 12));
    let filled = |block| triangles.tree(&Sbvh { block, ..Sbvh::DEFAULT }).stats().leaf_mean();
    let [one, four] = [1, 4].map(filled);
    assert!(four > 1.2 * one, "{one} triangles a leaf by single tests, {four} by blocks");
}
