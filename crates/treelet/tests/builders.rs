//! Builders: one tree for any number of threads, no input that hurts, a way to stop and to watch.

use std::sync::Arc;
use std::sync::Mutex;
use std::time::{Duration, Instant};
use treelet::bounds::Aabb;
use treelet::build::{self, BinnedSah, BuildError, Builder, Hploc, Lbvh};
use treelet::build::{ObjectMedian, SpatialMedian, SweepSah};
use treelet::context::Progress;
use treelet::memory::Array;
use treelet::tree::validate::Inside;
use treelet::tree::{DEPTH_MAX, Kind, Node, SahConstants, Tree, TreeError};
use treelet::verify::Random;
use treelet::{BuildOptions, Cancel, Context, Mesh, Scene};
use treelet_testkit::{Shape, awkward, closed};

const SEED: u64 = 0xB111D;

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

fn pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap()
}

fn plain(builder: &dyn Builder, bounds: &[Aabb]) -> Tree {
    builder.build(bounds, &Context::default()).unwrap()
}

/// As many of the boxes as a builder does in a second. Exact clustering takes 25 microseconds a box
/// here, and ten times that where sizes differ most.
fn share<'a>(builder: &dyn Builder, bounds: &'a [Aabb]) -> &'a [Aabb] {
    let most = if builder.info().name == "agglomerative" { 8_000 } else { bounds.len() };
    &bounds[..bounds.len().min(most)]
}

/// Equal bit for bit, zeros' signs included.
fn same(a: &Tree, b: &Tree) -> bool {
    let bits = |node: &Node| {
        let Aabb { lo, hi } = node.bounds;
        (lo.map(f32::to_bits), hi.map(f32::to_bits), node.first, node.count)
    };
    a.prims == b.prims && a.nodes.iter().map(bits).eq(b.nodes.iter().map(bits))
}

#[test]
fn the_same_tree_for_any_number_of_threads() {
    // Below 16,384 primitives a build is one task: only larger ones tell.
    let scenes = [
        ("400,000 random boxes", random_boxes(400_000)),
        ("a grid", boxes(&awkward::coplanar_grid(200))),
        ("equal boxes", vec![random_boxes(1)[0]; 60_000]),
        ("lopsided boxes", lopsided(60_000)),
    ];
    let pools = [1, 2, 7].map(pool);
    for (name, bounds) in &scenes {
        for &builder in build::ALL {
            let bounds = share(builder, bounds);
            let [one, two, seven] =
                pools.each_ref().map(|pool| pool.install(|| plain(builder, bounds)));
            let who = builder.info().name;
            assert!(same(&one, &two), "{name}, {who}: 2 threads make another tree than 1");
            assert!(same(&one, &seven), "{name}, {who}: 7 threads make another tree than 1");
            one.validate(bounds).unwrap_or_else(|error| panic!("{name}, {who}: {error}"));
        }
    }
}

#[test]
fn a_million_equal_triangles_are_no_trouble() {
    for &builder in build::ALL {
        let name = builder.info().name;
        // A million for the default's builder; a quarter of that tells as much of the others.
        let (count, levels) = if name == "binned-sah" { (1_000_000, 18) } else { (250_000, 16) };
        let bounds = vec![Aabb { lo: [0.0; 3], hi: [1.0, 1.0, 0.0] }; count];
        let tree = plain(builder, &bounds);
        let stats = tree.stats();
        // Halving: 2^levels leaves of up to four. Clustering joins unequal heights now and then.
        let most = levels + if name == "aac" { 6 } else { 4 };
        assert!(stats.depth <= most || name == "sweep-sah", "{name}: {stats:?}");
        tree.validate(&bounds).unwrap_or_else(|error| panic!("{name}: {error}"));
    }
}

/// Boxes that pull every cut to one side: each is as far again as the one before.
fn lopsided(count: usize) -> Vec<Aabb> {
    (0..count)
        .map(|i| {
            let x = 2.0_f32.powi((i % 180) as i32 - 120);
            Aabb { lo: [x, 0.0, 0.0], hi: [x * 1.25, x, x * 0.5] }
        })
        .collect()
}

#[test]
fn depth_is_bounded_for_every_option() {
    let builders: Vec<Box<dyn Builder>> = vec![
        Box::new(SpatialMedian { leaf_max: 1 }),
        Box::new(ObjectMedian { leaf_max: 1 }),
        Box::new(Lbvh { leaf_max: 1, ..Lbvh::DEFAULT }),
        Box::new(Hploc { leaf_max: 1 }),
        Box::new(SweepSah { leaf_max: 1, visit_cost: 0.0 }),
        Box::new(BinnedSah { leaf_max: 1, visit_cost: 0.0, bins: 2, block: 1 }),
        Box::new(BinnedSah { leaf_max: 64, visit_cost: 1000.0, bins: 32, block: 64 }),
    ];
    let mut deepest = 0;
    for (name, bounds) in [
        ("180", lopsided(180)),
        ("3,000", lopsided(3_000)),
        ("50,000", lopsided(50_000)),
        ("equal", vec![lopsided(3)[2]; 5_000]),
    ] {
        for builder in &builders {
            let tree = plain(&**builder, &bounds);
            let stats = tree.stats();
            deepest = deepest.max(stats.depth);
            assert!(stats.depth <= DEPTH_MAX, "{name}, {}: {stats:?}", builder.info().name);
            tree.validate(&bounds).unwrap();
        }
    }
    assert!(deepest > 60, "lopsided boxes must make deep trees; the deepest has {deepest}");
}

#[test]
fn options_out_of_range_are_named() {
    let check = |builder: &dyn Builder, name: &str, bad: f64| {
        let error = builder.build(&random_boxes(10), &Context::default()).unwrap_err();
        let BuildError::Option { option, value, allowed } = error else { panic!("{error}") };
        assert_eq!(option, name);
        assert!(value == bad || value.is_nan() && bad.is_nan(), "{value} for {bad}");
        assert!(error.to_string().contains(allowed), "{error}");
    };
    for leaf_max in [0, 65, u32::MAX] {
        let bad = f64::from(leaf_max);
        check(&SpatialMedian { leaf_max }, "leaf_max", bad);
        check(&ObjectMedian { leaf_max }, "leaf_max", bad);
        check(&Lbvh { leaf_max, ..Lbvh::DEFAULT }, "leaf_max", bad);
        check(&Hploc { leaf_max }, "leaf_max", bad);
        check(&SweepSah { leaf_max, ..SweepSah::DEFAULT }, "leaf_max", bad);
        check(&BinnedSah { leaf_max, ..BinnedSah::DEFAULT }, "leaf_max", bad);
    }
    for bins in [0, 1, 33, u32::MAX] {
        check(&BinnedSah { bins, ..BinnedSah::DEFAULT }, "bins", f64::from(bins));
    }
    for block in [0, 65, u32::MAX] {
        check(&BinnedSah { block, ..BinnedSah::DEFAULT }, "block", f64::from(block));
    }
    for visit_cost in [-1.0, f32::NAN, f32::INFINITY, 1000.1, -f32::MIN_POSITIVE] {
        let bad = f64::from(visit_cost);
        check(&SweepSah { visit_cost, ..SweepSah::DEFAULT }, "visit_cost", bad);
        check(&BinnedSah { visit_cost, ..BinnedSah::DEFAULT }, "visit_cost", bad);
    }
    // The ends of the ranges, on a scene where they matter.
    let bounds = random_boxes(500);
    for leaf_max in [1, 2, 64] {
        for visit_cost in [0.0, 1000.0] {
            let sweep = plain(&SweepSah { leaf_max, visit_cost }, &bounds);
            let binned = plain(&BinnedSah { leaf_max, visit_cost, bins: 2, block: 1 }, &bounds);
            for tree in [sweep, binned] {
                tree.validate(&bounds).unwrap();
                assert!(tree.stats().leaf_max <= leaf_max);
            }
        }
    }
}

#[test]
fn catalogue_names_are_unique_and_found() {
    for builder in build::ALL {
        let info = builder.info();
        assert_eq!(build::by_name(info.name).unwrap().info(), info);
        assert!(!info.summary.is_empty() && !info.source.is_empty());
        assert_eq!(build::ALL.iter().filter(|other| other.info().name == info.name).count(), 1);
    }
    assert!(build::by_name("no-such-builder").is_none());
}

#[test]
fn small_stacks_are_enough() {
    const STACK: usize = 64 * 1024;
    let small = rayon::ThreadPoolBuilder::new().num_threads(2).stack_size(STACK).build().unwrap();
    for bounds in [lopsided(50_000), random_boxes(50_000), vec![lopsided(1)[0]; 50_000]] {
        let work = || {
            for &builder in build::ALL {
                let bounds = share(builder, &bounds);
                small.install(|| plain(builder, bounds)).validate(bounds).unwrap();
            }
        };
        std::thread::scope(|scope| {
            let thread = std::thread::Builder::new().stack_size(STACK);
            thread.spawn_scoped(scope, work).unwrap().join().unwrap();
        });
    }
}

/// Meshes on which the heuristic tells builders apart.
fn telling_meshes() -> [(&'static str, Vec<Aabb>); 3] {
    [
        ("sphere", boxes(&closed::sphere(128, 64))),
        ("random", random_boxes(20_000)),
        ("star", boxes(&closed::random_star(96, 48, 1))),
    ]
}

#[test]
fn sweep_beats_binned_beats_medians() {
    // The price of leaves that the sweep and `SahConstants` have: each primitive by itself.
    let binned = BinnedSah { block: 1, ..BinnedSah::DEFAULT };
    for (name, bounds) in telling_meshes() {
        let cost = |builder| plain(builder, &bounds).sah(&SahConstants::default());
        let [sweep, binned] = [&SweepSah::DEFAULT as &dyn Builder, &binned].map(cost);
        let medians = [&ObjectMedian::DEFAULT as &dyn Builder, &SpatialMedian::DEFAULT].map(cost);
        // Both are greedy, so the finer choice may lose a little in the end.
        assert!(sweep <= binned * 1.01, "{name}: sweep {sweep}, binned {binned}");
        assert!(medians.iter().all(|median| binned < *median), "{name}: {binned}, {medians:?}");
    }
}

#[test]
fn leaves_are_filled_when_that_costs_nothing() {
    for (name, bounds) in telling_meshes() {
        let measure = |block: u32| {
            let tree = plain(&BinnedSah { block, ..BinnedSah::DEFAULT }, &bounds);
            let root = tree.bounds().half_area();
            let price = |node: &Node| match node.kind() {
                Kind::Inner { .. } => 1.0,
                Kind::Leaf { count, .. } => count.div_ceil(4) as f64,
            };
            let cost: f64 =
                tree.nodes.iter().map(|node| price(node) * node.bounds.half_area() / root).sum();
            (cost, tree.stats().leaf_mean())
        };
        let [(single, few), (block, many)] = [1, 4].map(measure);
        assert!(block < single, "{name}: {block} in blocks of four, {single} one by one");
        assert!(many > 3.5 && few < 3.0, "{name}: {many} and {few} in a leaf");
    }
}

#[test]
fn progress_rises_to_its_end() {
    let bounds = random_boxes(200_000);
    for &builder in build::ALL {
        let bounds = share(builder, &bounds);
        for threads in [1, 3] {
            let told: Mutex<Vec<Progress>> = Mutex::new(Vec::new());
            let watch = |progress: Progress| told.lock().unwrap().push(progress);
            let context = Context { progress: Some(&watch), ..Context::default() };
            pool(threads).install(|| builder.build(bounds, &context)).unwrap();
            let told = told.into_inner().unwrap();
            let name = builder.info().name;
            let mut stages: Vec<&str> = told.iter().map(|progress| progress.stage).collect();
            stages.dedup();
            let distinct = stages.iter().filter(|stage| **stage == stages[0]).count();
            assert_eq!(distinct, 1, "{name}: a stage comes back: {stages:?}");
            for stage in stages {
                let of = told.iter().filter(|progress| progress.stage == stage);
                let (done, totals): (Vec<u64>, Vec<u64>) = of.map(|p| (p.done, p.total)).unzip();
                assert!(totals.iter().all(|total| *total == totals[0]), "{name}, {stage}");
                assert_eq!(done.first(), Some(&0), "{name}, {stage}");
                assert_eq!(done.iter().max(), totals.first(), "{name}, {stage} ends");
                if threads == 1 {
                    assert!(done.is_sorted(), "{name}, {stage}: {done:?}");
                }
            }
            assert!((10..2000).contains(&told.len()), "{name}: told {} times", told.len());
        }
    }
}

/// Two million triangles whose array tells who still holds it.
fn large_mesh() -> (Arc<Vec<[f32; 3]>>, Mesh) {
    let mut random = Random::new(SEED);
    let mut bumpy = awkward::coplanar_grid(1000);
    bumpy.positions.iter_mut().for_each(|p| p[2] = random.unit() * 0.01);
    let positions = Arc::new(bumpy.positions);
    let mesh = Mesh::new(Array::shared(positions.clone()), bumpy.triangles);
    (positions, mesh)
}

/// How late an answer to a cancel may come on a machine that is busy with other tests. On an idle
/// one it is some 10 ms; a build that did not listen would take a second or more.
const LATE: Duration = Duration::from_millis(200);

/// Where the machine is so busy that it comes later still, it may take this part of what a whole build then takes.
const LATE_SHARE: u32 = 5;

/// How often a build that stopped too late is tried again.
const ATTEMPTS: usize = 4;

#[test]
fn a_build_stops_soon_after_it_is_told_to() {
    let (positions, mesh) = large_mesh();
    let mut random = Random::new(SEED);
    for &builder in build::ALL {
        let name = builder.info().name;
        let (mut stopped, mut worst) = (0, Duration::ZERO);
        for latest_ms in [30.0, 200.0, 600.0, 1500.0] {
            let moment = Duration::from_secs_f32(random.unit() * latest_ms / 1000.0);
            // Whatever else runs on the machine only makes it longer.
            let late = (0..ATTEMPTS)
                .map(|_| stopped_after(builder, &mesh, moment))
                .find(|late| late.is_none_or(|late| late < LATE));
            // A build may be done before it is told.
            let late = late.unwrap_or_else(|| late_when_busy(builder, &mesh, moment));
            stopped += usize::from(late.is_some());
            worst = worst.max(late.unwrap_or_default());
            // Who is told to stop lets go of everything.
            assert_eq!(Arc::strong_count(&positions), 2, "{name}: somebody keeps the mesh");
        }
        eprintln!("{name}: {stopped} stopped, after {worst:?} at most");
        assert!(stopped > 0, "{name}: no build was stopped");
    }
}

/// What `stopped_after` says where every attempt was late: it is held against a whole build on the machine as it is.
fn late_when_busy(builder: &dyn Builder, mesh: &Mesh, moment: Duration) -> Option<Duration> {
    let clock = Instant::now();
    let options = BuildOptions { builder: Some(builder), ..BuildOptions::default() };
    Scene::builder().mesh(mesh.clone()).build(&options).unwrap();
    let bound = LATE.max(clock.elapsed() / LATE_SHARE);
    let late = stopped_after(builder, mesh, moment);
    let (name, after) = (builder.info().name, late.unwrap_or_default());
    assert!(after < bound, "{name}, seed {SEED:#x}: stopped after {after:?}, not {bound:?}");
    late
}

/// How long a build goes on that is told to stop after `moment`; `None` if it was done before.
fn stopped_after(builder: &dyn Builder, mesh: &Mesh, moment: Duration) -> Option<Duration> {
    let cancel = Cancel::new();
    let context = Context { cancel: cancel.clone(), progress: None };
    let options = BuildOptions { builder: Some(builder), context, ..BuildOptions::default() };
    let (asked, (answer, end)) = std::thread::scope(|scope| {
        let other = scope.spawn(|| {
            std::thread::sleep(moment);
            let asked = Instant::now();
            cancel.cancel();
            asked
        });
        let answer = Scene::builder().mesh(mesh.clone()).build(&options);
        let end = Instant::now();
        (other.join().unwrap(), (answer, end))
    });
    let error = answer.map(drop).err()?;
    assert!(error.is_cancelled(), "{}: {error}", builder.info().name);
    Some(end.saturating_duration_since(asked))
}

#[test]
fn a_watcher_may_stop_the_build() {
    let bounds = random_boxes(200_000);
    for &builder in build::ALL {
        let bounds = share(builder, &bounds);
        for share in [0.0, 0.3, 0.7] {
            let cancel = Cancel::new();
            let watch = |progress: Progress| {
                if progress.stage == "build"
                    && progress.done as f64 >= share * progress.total as f64
                {
                    cancel.cancel();
                }
            };
            let context = Context { cancel: cancel.clone(), progress: Some(&watch) };
            let answer = builder.build(bounds, &context);
            assert!(
                matches!(answer, Err(BuildError::Cancelled(_))),
                "{} at {share}",
                builder.info().name
            );
        }
        let cancel = Cancel::new();
        cancel.cancel();
        let context = Context { cancel, progress: None };
        let answer = builder.build(bounds, &context);
        assert!(matches!(answer, Err(BuildError::Cancelled(_))), "cancelled before it began");
        // The same builder is as good as before.
        plain(builder, bounds).validate(bounds).unwrap();
    }
}

#[test]
fn validation_catches_every_corruption() {
    let bounds = random_boxes(200);
    let tree = plain(&ObjectMedian::DEFAULT, &bounds);
    tree.validate(&bounds).unwrap();
    let inner = |nth: usize| {
        let mut all = (0..tree.nodes.len())
            .filter(|&node| matches!(tree.nodes[node].kind(), Kind::Inner { .. }));
        all.nth(nth).unwrap()
    };
    let leaf = (0..tree.nodes.len())
        .find(|&node| matches!(tree.nodes[node].kind(), Kind::Leaf { count: 2.., .. }))
        .unwrap();
    let broken = |spoil: &dyn Fn(&mut Tree)| {
        let mut bad = tree.clone();
        spoil(&mut bad);
        bad.validate(&bounds).expect_err("the tree is broken")
    };

    // Links.
    let node = inner(3);
    for left in [node as u32, 0, tree.nodes.len() as u32 - 1, u32::MAX] {
        let error = broken(&|bad| bad.nodes[node].first = left);
        assert!(matches!(error, TreeError::Child { node: named, .. } if named == node), "{error}");
    }
    let error = broken(&|bad| bad.nodes[inner(2)].first = bad.nodes[inner(4)].first);
    assert!(matches!(error, TreeError::Parents { .. }), "{error}");
    let error = broken(&|bad| bad.nodes.push(bad.nodes[leaf]));
    assert!(matches!(error, TreeError::Parents { parents: 0, .. }), "{error}");

    // Lists.
    let error = broken(&|bad| bad.nodes[leaf].first = u32::MAX);
    assert!(matches!(error, TreeError::Range { node, .. } if node == leaf), "{error}");
    let error = broken(&|bad| bad.nodes[leaf].count -= 1);
    assert!(matches!(error, TreeError::Entry { leaves: 0, .. }), "{error}");
    let error = broken(&|bad| bad.nodes[leaf].count += 1);
    assert!(
        matches!(error, TreeError::Entry { leaves: 2, .. } | TreeError::Range { .. }),
        "{error}"
    );
    let error = broken(&|bad| bad.prims[5] = bad.prims[6]);
    assert!(matches!(error, TreeError::Primitive { .. }), "{error}");
    let error = broken(&|bad| bad.prims[5] = 200);
    assert!(matches!(error, TreeError::Primitive { prim: 200, .. }), "{error}");
    let error = broken(&|bad| bad.prims.push(0));
    assert!(matches!(error, TreeError::Entry { leaves: 0, .. }), "{error}");
    assert!(tree.validate(&bounds[..199]).is_err() && tree.validate(&random_boxes(201)).is_err());
    assert!(Tree::default().validate(&bounds).is_err() && tree.validate(&[]).is_err());
    assert_eq!(Tree::default().validate(&[]), Ok(()));

    // Boxes, by a single bit on every side.
    for node in [0, inner(3), leaf] {
        for axis in 0..3 {
            let lo = broken(&|bad| {
                let lo = &mut bad.nodes[node].bounds.lo[axis];
                *lo = lo.next_up();
            });
            let hi = broken(&|bad| {
                let hi = &mut bad.nodes[node].bounds.hi[axis];
                *hi = hi.next_down();
            });
            let nan = broken(&|bad| bad.nodes[node].bounds.lo[axis] = f32::NAN);
            for error in [lo, hi, nan] {
                let TreeError::Containment { node: named, inside } = error else {
                    panic!("{error}");
                };
                let at = if named == node { node } else { tree.parent(node) };
                assert_eq!(named, at, "{error}");
                let of_leaf = matches!(tree.nodes[named].kind(), Kind::Leaf { .. });
                assert_eq!(matches!(inside, Inside::Primitive(_)), of_leaf, "{error}");
            }
        }
    }

    // Depth: a path as long as it may be, and one node longer.
    for (levels, fine) in [(DEPTH_MAX as usize - 1, true), (DEPTH_MAX as usize, false)] {
        let bounds = vec![bounds[0]; levels + 1];
        let mut chain = Tree { nodes: Vec::new(), prims: (0..=levels as u32).collect() };
        chain.nodes.push(Node::leaf(bounds[0], 0, 1));
        for level in 0..levels {
            let at = chain.nodes.len() - 1;
            chain.nodes[at] = Node::inner(bounds[0], at + 1);
            // The left child ends here, the right one goes on.
            chain.nodes.push(Node::leaf(bounds[0], level, 1));
            chain.nodes.push(Node::leaf(bounds[0], level + 1, 1));
        }
        let answer = chain.validate(&bounds);
        assert_eq!(answer.is_ok(), fine, "{levels} levels: {answer:?}");
        assert!(fine || matches!(answer, Err(TreeError::Depth { .. })), "{answer:?}");
    }
}

/// What the test needs to know of a tree.
trait Parents {
    fn parent(&self, node: usize) -> usize;
}

impl Parents for Tree {
    fn parent(&self, node: usize) -> usize {
        let is_parent = |candidate: &usize| match self.nodes[*candidate].kind() {
            Kind::Inner { left } => left == node || left + 1 == node,
            Kind::Leaf { .. } => false,
        };
        (0..self.nodes.len()).find(is_parent).unwrap_or(0)
    }
}
