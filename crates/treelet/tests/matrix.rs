//! Every builder, every awkward scene, every query: the same bits as brute force.

use treelet::bounds::Aabb;
use treelet::build::{self, BinnedSah, Builder};
use treelet::scene::LayoutChoice;
use treelet::simd::Level;
use treelet::verify::{self, BruteForce};
use treelet::{BuildOptions, Context, Mesh, Scene};
use treelet_testkit::{Shape, awkward};

const SEED: u64 = 0x7EE1E7;

fn mesh(shape: &Shape) -> Mesh {
    Mesh::new(shape.positions.clone(), shape.triangles.clone())
}

fn build(shape: &Shape, builder: &dyn Builder) -> Scene {
    build_for(shape, builder, Level::best(), None)
}

fn build_for(
    shape: &Shape,
    builder: &dyn Builder,
    level: Level,
    layout: Option<LayoutChoice>,
) -> Scene {
    let options = BuildOptions { builder: Some(builder), level, layout, ..BuildOptions::default() };
    Scene::builder().mesh(mesh(shape)).build(&options).expect("awkward scenes build")
}

/// Every instruction set that this processor has, with every layout.
fn walks() -> impl Iterator<Item = (Level, LayoutChoice)> {
    let levels = Level::ALL.iter().copied().filter(Level::is_available);
    levels.flat_map(|level| LayoutChoice::ALL.iter().map(move |&layout| (level, layout)))
}

#[test]
fn every_level_and_layout_answers_like_brute_force() {
    for scene in awkward::all(1000) {
        for (level, layout) in walks() {
            let built = build_for(&scene.shape, &BinnedSah::DEFAULT, level, Some(layout));
            let brute = BruteForce::new(&built);
            let rays = verify::rays(&built, 600, SEED);
            if let Err(mismatch) = verify::check_many(&built, &rays, |ray| brute.all(ray)) {
                let name = level.name();
                panic!("{}, {name}, {layout:?}, seed {SEED:#x}: {mismatch}", scene.name);
            }
        }
    }
}

#[test]
fn every_builder_answers_like_brute_force() {
    for scene in awkward::all(1000) {
        for &builder in build::ALL {
            let built = build(&scene.shape, builder);
            let brute = BruteForce::new(&built);
            let rays = verify::rays(&built, 600, SEED);
            let name = builder.info().name;
            if let Err(mismatch) = verify::check_many(&built, &rays, |ray| brute.all(ray)) {
                panic!("{}, {name}, seed {SEED:#x}: {mismatch}", scene.name);
            }
            assert_eq!(built.report().skipped.triangles, scene.invalid, "{}, {name}", scene.name);
        }
    }
}

#[test]
fn every_tree_is_valid() {
    for scene in awkward::all(100_000) {
        let mesh = mesh(&scene.shape);
        let bounds: Vec<Aabb> = (0..mesh.triangles().len())
            .filter(|&prim| mesh.defect(prim).is_none())
            .map(|prim| Aabb::of_points(&mesh.corners(prim).unwrap()))
            .collect();
        for builder in build::ALL {
            let name = builder.info().name;
            let tree = builder.build(&bounds, &Context::default()).unwrap();
            if let Err(error) = tree.validate(&bounds) {
                panic!("{}, {name}: {error}", scene.name);
            }
            let stats = tree.stats();
            assert!(stats.leaf_max <= 4, "{}, {name}: {stats:?}", scene.name);
        }
    }
}

/// The whole pile, with fewer rays: each meets all of it or nothing.
#[test]
fn a_hundred_thousand_equal_triangles_are_answered() {
    let pile =
        awkward::all(100_000).into_iter().find(|scene| scene.shape.triangles.len() == 100_000);
    let pile = pile.expect("a pile of 100,000 is on the list");
    for &builder in build::ALL {
        let built = build(&pile.shape, builder);
        let brute = BruteForce::new(&built);
        let rays = verify::rays(&built, 30, SEED);
        let hits: u64 = rays.iter().map(|ray| built.count(ray)).sum();
        assert!(hits >= 500_000, "{hits} hits test little");
        if let Err(mismatch) = verify::check_many(&built, &rays, |ray| brute.all(ray)) {
            panic!("{}, seed {SEED:#x}: {:?}", builder.info().name, mismatch.ray);
        }
    }
}
