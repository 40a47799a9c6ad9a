//! Optimisers: never dearer, one tree for any number of threads, no input that hurts, a way to stop
//! and to watch.

use std::sync::Mutex;
use std::time::{Duration, Instant};
use treelet::bounds::Aabb;
use treelet::build::{self, BinnedSah, BuildError, Builder, ObjectMedian, SweepSah};
use treelet::context::Progress;
use treelet::optimize::{self, Optimizer, Reinsertion, TopReinsertion};
use treelet::tree::{DEPTH_MAX, Kind, SahConstants, Tree};
use treelet::{Cancel, Context, Mesh};
use treelet_testkit::{Shape, awkward, closed};

fn boxes(shape: &Shape) -> Vec<Aabb> {
    let mesh = Mesh::new(shape.positions.clone(), shape.triangles.clone());
    (0..mesh.triangles().len())
        .filter(|&prim| mesh.defect(prim).is_none())
        .map(|prim| Aabb::of_points(&mesh.corners(prim).unwrap()))
        .collect()
}

fn random_boxes(count: usize) -> Vec<Aabb> {
    boxes(&awkward::random_triangles(count, 10.0, 0.1))
}

/// Boxes that make deep trees: each is as far again as the one before.
fn lopsided(count: usize) -> Vec<Aabb> {
    (0..count)
        .map(|i| {
            let x = 2.0_f32.powi((i % 180) as i32 - 120);
            Aabb { lo: [x, 0.0, 0.0], hi: [x * 1.25, x, x * 0.5] }
        })
        .collect()
}

fn pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap()
}

fn plain(builder: &dyn Builder, bounds: &[Aabb]) -> Tree {
    builder.build(bounds, &Context::default()).unwrap()
}

fn optimized(optimizer: &dyn Optimizer, tree: &Tree) -> Tree {
    optimizer.optimize(tree.clone(), &Context::default()).unwrap()
}

fn sah(tree: &Tree) -> f64 {
    tree.sah(&SahConstants::default())
}

/// Every primitive below a node is a range of the list: what layouts rely on to merge leaves.
fn subtrees_are_ranges(tree: &Tree) -> bool {
    let mut next = 0;
    let mut open = vec![0];
    while let Some(node) = open.pop() {
        match tree.nodes[node].kind() {
            Kind::Inner { left } => open.extend([left + 1, left]),
            Kind::Leaf { first, count } => {
                if first != next {
                    return false;
                }
                next += count;
            }
        }
    }
    next == tree.prims.len()
}

#[test]
fn every_tree_gets_no_dearer_and_stays_whole() {
    let awkward = awkward::all(1_000).into_iter();
    let mut scenes: Vec<_> =
        awkward.map(|scene| (scene.name.to_string(), boxes(&scene.shape))).collect();
    scenes.push(("sphere".into(), boxes(&closed::sphere(64, 32))));
    scenes.push(("random".into(), random_boxes(5_000)));
    scenes.push(("lopsided".into(), lopsided(3_000)));
    scenes.push(("equal".into(), vec![lopsided(3)[2]; 5_000]));
    let mut better = 0;
    for (name, bounds) in &scenes {
        for &builder in build::ALL {
            let tree = plain(builder, bounds);
            for &optimizer in optimize::ALL {
                let who = format!("{name}, {}, {}", builder.info().name, optimizer.info().name);
                let improved = optimized(optimizer, &tree);
                improved.validate(bounds).unwrap_or_else(|error| panic!("{who}: {error}"));
                let (before, after) = (sah(&tree), sah(&improved));
                assert!(after <= before * (1.0 + 1e-12), "{who}: {before} rises to {after}");
                better += usize::from(after < before * 0.99);
                assert!(bounds.is_empty() || subtrees_are_ranges(&improved), "{who}");
            }
        }
    }
    assert!(better > 10, "only {better} trees were improved");
}

#[test]
fn depth_stays_bounded() {
    let mut deepest = 0;
    let all = Reinsertion { share: 1.0, rounds: 20, gain_min: 0.0 };
    for bounds in [lopsided(180), lopsided(3_000), lopsided(30_000)] {
        for leaf_max in [1, 4] {
            let tree = plain(&SweepSah { leaf_max, visit_cost: 0.0 }, &bounds);
            let improved = optimized(&all, &tree);
            improved.validate(&bounds).unwrap();
            deepest = deepest.max(improved.stats().depth);
        }
    }
    assert!(60 < deepest && deepest <= DEPTH_MAX, "the deepest has {deepest}");
}

/// Large things among small ones are what there is to win, and they are all near the root.
#[test]
fn the_top_alone_is_worth_most_of_it() {
    let mut bounds = random_boxes(60_000);
    let walls = awkward::random_triangles(300, 10.0, 8.0);
    bounds.extend(boxes(&walls));
    let tree = plain(&BinnedSah::DEFAULT, &bounds);
    let top = optimized(&TopReinsertion::DEFAULT, &tree);
    let all = optimized(&Reinsertion::DEFAULT, &tree);
    let [before, top, all] = [&tree, &top, &all].map(sah);
    let share = (before - top) / (before - all);
    assert!(all < 0.95 * before && share > 0.8, "{before} falls to {top}, to {all} at most");
    // A larger top is no worse, and one of everything as good as no top.
    let whole = TopReinsertion { top: 1_000_000, reinsertion: Reinsertion::DEFAULT };
    let whole = sah(&optimized(&whole, &tree));
    assert!((whole - all).abs() < 0.01 * all, "{whole}, {all}");
}

#[test]
fn the_same_tree_for_any_number_of_threads() {
    let pools = [1, 2, 7].map(pool);
    let bounds = random_boxes(100_000);
    let tree = plain(&ObjectMedian { leaf_max: 1 }, &bounds);
    for &optimizer in optimize::ALL {
        let [one, two, seven] =
            pools.each_ref().map(|pool| pool.install(|| optimized(optimizer, &tree)));
        assert_eq!(one, two, "{}: 2 threads", optimizer.info().name);
        assert_eq!(one, seven, "{}: 7 threads", optimizer.info().name);
        assert!(sah(&one) < sah(&tree), "{} to {}", sah(&tree), sah(&one));
    }
}

#[test]
fn names_are_unique_and_found_and_options_are_checked() {
    for optimizer in optimize::ALL {
        let info = optimizer.info();
        assert_eq!(optimize::by_name(info.name).unwrap().info(), info);
        assert_eq!(optimize::ALL.iter().filter(|other| other.info().name == info.name).count(), 1);
    }
    assert!(optimize::by_name("no-such-optimizer").is_none());
    let bounds = random_boxes(100);
    let tree = plain(&SweepSah::DEFAULT, &bounds);
    let default = Reinsertion::DEFAULT;
    for (bad, name) in [
        (Reinsertion { share: -0.1, ..default }, "share"),
        (Reinsertion { share: f32::NAN, ..default }, "share"),
        (Reinsertion { rounds: 10_001, ..default }, "rounds"),
        (Reinsertion { gain_min: 1.5, ..default }, "gain_min"),
    ] {
        let error = bad.optimize(tree.clone(), &Context::default()).unwrap_err();
        assert!(matches!(error, BuildError::Option { option, .. } if option == name), "{error}");
    }
    let nothing = Reinsertion { share: 0.0, rounds: 0, gain_min: 0.0 };
    assert_eq!(sah(&optimized(&nothing, &tree)), sah(&tree));
    assert_eq!(optimized(&default, &Tree::default()), Tree::default());
}

#[test]
fn small_stacks_are_enough() {
    let bounds = lopsided(50_000);
    let tree = plain(&BinnedSah::DEFAULT, &bounds);
    let work = || optimize::ALL.iter().for_each(|&optimizer| drop(optimized(optimizer, &tree)));
    let small = rayon::ThreadPoolBuilder::new().num_threads(2).stack_size(64 * 1024);
    small.build().unwrap().install(work);
}

#[test]
fn progress_rises_to_its_end() {
    let bounds = random_boxes(100_000);
    let tree = plain(&SweepSah { leaf_max: 1, ..SweepSah::DEFAULT }, &bounds);
    for &optimizer in optimize::ALL {
        let told: Mutex<Vec<Progress>> = Mutex::new(Vec::new());
        let watch = |progress: Progress| told.lock().unwrap().push(progress);
        let context = Context { progress: Some(&watch), ..Context::default() };
        optimizer.optimize(tree.clone(), &context).unwrap();
        let told = told.into_inner().unwrap();
        let done: Vec<u64> = told.iter().map(|progress| progress.done).collect();
        assert!(done.is_sorted() && done[0] == 0, "{done:?}");
        assert_eq!(done.last(), Some(&told[0].total), "{done:?}");
        assert!(told.iter().all(|progress| progress.total == told[0].total));
    }
}

/// How late an answer to a cancel may come on a machine that is busy with other tests.
const LATE: Duration = Duration::from_millis(200);

#[test]
fn an_optimizer_stops_soon_after_it_is_told_to() {
    let bounds = boxes(&awkward::coplanar_grid(700));
    let tree = plain(&BinnedSah { leaf_max: 1, ..BinnedSah::DEFAULT }, &bounds);
    let all = Reinsertion { share: 1.0, rounds: 100, gain_min: 0.0 };
    let mut stopped = 0;
    for after_ms in [0, 20, 60, 150, 300, 500] {
        let cancel = Cancel::new();
        let context = Context { cancel: cancel.clone(), progress: None };
        // Copied before the clock runs: fresh pages take long on a busy machine.
        let copy = tree.clone();
        let (asked, answer, end) = std::thread::scope(|scope| {
            let other = scope.spawn(|| {
                std::thread::sleep(Duration::from_millis(after_ms));
                let asked = Instant::now();
                cancel.cancel();
                asked
            });
            let answer = all.optimize(copy, &context);
            let end = Instant::now();
            (other.join().unwrap(), answer, end)
        });
        if let Err(error) = answer {
            assert!(matches!(error, BuildError::Cancelled(_)), "{error}");
            let late = end.saturating_duration_since(asked);
            eprintln!("told after {after_ms} ms, stopped {late:?} later");
            assert!(late < LATE, "told after {after_ms} ms, stopped {late:?} later");
            stopped += 1;
        }
    }
    assert!(stopped > 2, "only {stopped} were stopped");
}
