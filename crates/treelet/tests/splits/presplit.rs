//! Pieces made before the build: as many as allowed, where area is wasted, and one again in a leaf.

use super::{SEED, Triangles, agree, hold_every_point, mesh, rays_at_faces, scene, scenes, shards};
use std::sync::Mutex;
use treelet::bounds::Aabb;
use treelet::build::{self, BuildError, Builder, Hploc, Presplit, SceneGraph, SweepSah};
use treelet::tree::{Kind, SahConstants, Tree};
use treelet::{Affine, BuildOptions, Cancel, Context, Scene};

/// One piece a leaf, as many as there may be.
const EAGER: Presplit<'static> = Presplit { builder: &Hploc { leaf_max: 1 }, budget: 4.0 };

fn extra(tree: &Tree, triangles: &Triangles) -> usize {
    tree.prims.len() - triangles.0.len()
}

#[test]
fn trees_hold_every_part_of_every_triangle() {
    let mut pieces = 0;
    for (name, shape) in scenes() {
        let triangles = Triangles::of(&shape);
        let bounds = triangles.bounds();
        for builder in [EAGER, Presplit::before(&SceneGraph::DEFAULT)] {
            let tree = triangles.tree(&builder);
            let who = builder.builder.info().name;
            tree.validate_pieces(&bounds).unwrap_or_else(|e| panic!("{name}, {who}: {e}"));
            let most = f64::from(builder.budget) * bounds.len() as f64;
            let extra = extra(&tree, &triangles);
            assert!(extra as f64 <= most, "{name}, {who}: {extra} extra pieces");
            pieces += extra;
            hold_every_point(&name, &triangles, &tree);
        }
    }
    assert!(pieces > 10_000, "only {pieces} pieces");
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
    }
    assert!(hits > 10_000, "only {hits} hits");
}

#[test]
fn every_builder_makes_a_better_tree_of_pieces() {
    let triangles = Triangles::of(&shards(6_000, 7));
    let bounds = triangles.bounds();
    for (builder, presplit) in build::ALL.iter().zip(build::PRESPLIT) {
        let name = builder.info().name;
        let [whole, pieces] = [*builder, presplit].map(|builder| triangles.tree(builder));
        pieces.validate_pieces(&bounds).unwrap_or_else(|error| panic!("{name}: {error}"));
        // All but what is one again in a leaf: most of it where neighbours in the file share one. A
        // builder that cuts by itself makes more.
        let share = extra(&pieces, &triangles) as f64 / bounds.len() as f64;
        let least = if name == "scene-graph" { 0.05 } else { 0.2 };
        let most = f64::from(presplit.budget) + f64::from(u8::from(name == "sbvh"));
        assert!((least..=most).contains(&share), "{name}: {share} extra pieces a triangle");
        for node in &pieces.nodes {
            if let Kind::Leaf { first, count } = node.kind() {
                let mut prims = pieces.prims[first..first + count].to_vec();
                prims.sort_unstable();
                prims.dedup();
                assert_eq!(prims.len(), count, "{name}: a primitive is twice in a leaf");
            }
        }
        let [whole, pieces] = [whole, pieces].map(|tree| tree.sah(&SahConstants::default()));
        // Who only counts gains nothing by more pieces; whose own splits have it already, little.
        let most = match name {
            "scene-graph" => 1.2,
            "sbvh" => 1.05,
            _ => 0.9,
        };
        eprintln!("{name}: {share} extra pieces a triangle, SAH from {whole} to {pieces}");
        assert!(pieces < most * whole, "{name}: {whole} becomes {pieces}");
    }
}

/// One slanted triangle among many in axis-aligned planes, which no cut makes smaller.
#[test]
fn cuts_go_where_area_is_wasted() {
    let mut triangles = Triangles::of(&treelet_testkit::awkward::coplanar_grid(20));
    let flat = triangles.0.len();
    let around = triangles.bounds().iter().fold(Aabb::EMPTY, |all, b| all.union(b));
    let Aabb { lo: [x, y, z], hi: [to_x, to_y, _] } = around;
    triangles.0.push([[x, y, z], [to_x, to_y, z + (to_x - x)], [to_x, y, z]]);
    let tree = triangles.tree(&Presplit { budget: 0.02, ..EAGER });
    let extra = extra(&tree, &triangles);
    let slanted = tree.prims.iter().filter(|&&prim| prim as usize == flat).count();
    assert!(slanted == extra + 1 && extra >= 10, "{slanted} pieces of it, {extra} extra ones");
}

#[test]
fn the_same_tree_for_any_number_of_threads() {
    let triangles = Triangles::of(&shards(60_000, 6));
    let trees = [1, 2, 7].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| triangles.tree(&Presplit::before(&Hploc::DEFAULT)))
    });
    assert!(extra(&trees[0], &triangles) > 12_000, "{} entries", trees[0].prims.len());
    assert_eq!(trees[0], trees[1], "2 threads");
    assert_eq!(trees[0], trees[2], "7 threads");
}

/// A needle wastes nearly all of its box, a triangle in an axis-aligned plane half of it: of boxes
/// with the same area the needle's is cut more often.
#[test]
fn what_no_cut_can_save_does_not_count() {
    let d = (1.0_f32 / 3.0).sqrt();
    let flat = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let needle = [[0.0; 3], [d; 3], [d, d, d * 0.999]];
    let triangles = Triangles(vec![flat, needle]);
    let tree = triangles.tree(&EAGER);
    let pieces = [0, 1].map(|prim| tree.prims.iter().filter(|&&other| other == prim).count());
    assert_eq!(pieces, [4, 6]);
}

/// Along a row of small instances lies a long one: whatever cuts triangles would cut it, were it not
/// told that instances stay whole.
#[test]
fn instances_are_not_cut() {
    let inner = scene(&shards(50, 9), &EAGER);
    let row = |description: treelet::SceneBuilder| {
        (0..30).fold(description, |row, i| {
            let size = if i == 0 { [80.0, 0.1, 0.1] } else { [0.1; 3] };
            let place = Affine::translation([i as f32 * 20.0 - 300.0, 0.0, 0.0]);
            let place = if i == 0 { Affine::IDENTITY } else { place };
            row.instance(&inner, place.then_from(&Affine::scaling(size)))
        })
    };
    for builder in [&EAGER as &dyn Builder, &super::EAGER] {
        // Nor opened, which is something else.
        let open_instances = false;
        let options = BuildOptions { builder: Some(builder), open_instances, ..Default::default() };
        let name = builder.info().name;
        let built = row(Scene::builder()).build(&options).unwrap();
        assert_eq!(built.report().tree.prims, 30, "{name}");
        let mixed = row(Scene::builder().mesh(mesh(&shards(200, 10)))).build(&options).unwrap();
        assert!(mixed.report().tree.prims > 230, "{name}: nothing is cut");
    }
}

#[test]
fn names_compose() {
    for builder in build::ALL {
        let name = format!("presplit+{}", builder.info().name);
        let found = build::by_name(&name).unwrap_or_else(|| panic!("there is no {name}"));
        assert_eq!(found.info(), Presplit::INFO);
        assert_eq!(found.inner().unwrap().info(), builder.info());
    }
    for name in ["presplit", "presplit+", "presplit+presplit", "hploc+presplit", "presplit+x"] {
        assert!(build::by_name(name).is_none(), "{name}");
    }
    let options = BuildOptions { builder: build::by_name("presplit+hploc"), ..Default::default() };
    assert_eq!(options.plan().to_string(), "presplit+hploc");
}

#[test]
fn budgets_are_checked_and_kept() {
    let triangles = Triangles::of(&shards(3_000, 8));
    let entries = [0.0, 0.1, 1.0, 4.0].map(|budget| {
        let tree = triangles.tree(&Presplit { budget, ..EAGER });
        assert!(extra(&tree, &triangles) as f64 <= f64::from(budget) * 3_000.0);
        extra(&tree, &triangles)
    });
    assert!(entries[0] == 0 && entries.is_sorted() && entries[3] > 10_000, "{entries:?}");
    for budget in [-0.1, 4.1, f32::NAN] {
        let builder = Presplit { budget, ..EAGER };
        let error = builder.build(&[], &Context::default()).unwrap_err();
        assert!(matches!(error, BuildError::Option { option: "budget", .. }), "{error}");
    }
    // Without a geometry to ask nothing is cut.
    let plain = EAGER.build(&triangles.bounds(), &Context::default()).unwrap();
    plain.validate(&triangles.bounds()).unwrap();
}

#[test]
fn cutting_can_be_watched_and_stopped() {
    let triangles = Triangles::of(&shards(60_000, 11));
    let bounds = triangles.bounds();
    for stop_at in [0, 1, 60_000, 100_000] {
        let (cancel, seen) = (Cancel::new(), Mutex::new(Vec::new()));
        let watch = |progress: treelet::context::Progress| {
            seen.lock().unwrap().push(progress.stage);
            if progress.stage == "presplit" && progress.done >= stop_at {
                cancel.cancel();
            }
        };
        let context = Context { cancel: cancel.clone(), progress: Some(&watch) };
        let builder = Presplit::before(&SweepSah::DEFAULT);
        let answer = builder.build_clipped(&bounds, &triangles, &context);
        assert!(matches!(answer, Err(BuildError::Cancelled(_))), "at {stop_at}, {SEED}");
        let seen = seen.into_inner().unwrap();
        assert!(seen.iter().all(|stage| *stage == "presplit"), "at {stop_at}: {seen:?}");
    }
}
