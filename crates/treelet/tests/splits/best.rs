//! The best quality level cuts triangles where that makes a much cheaper tree, and nowhere else.

use super::{Triangles, long_sphere, shards};
use treelet::scene::Plan;
use treelet::tree::{SahConstants, Tree};
use treelet::{Context, Quality};
use treelet_testkit::Shape;

fn built(plan: &Plan<'_>, triangles: &Triangles) -> Tree {
    plan.build(&triangles.bounds(), triangles, &Context::default()).unwrap()
}

#[test]
fn the_cheaper_tree_is_taken() {
    let best = Quality::Best.plan();
    let cost = |tree: &Tree| tree.sah(&SahConstants::default());
    let scenes: [(&str, Shape, bool); 3] = [
        ("shards", shards(6_000, 13), true),
        ("long sphere", long_sphere(), false),
        (
            "a heap of small ones",
            treelet_testkit::awkward::random_triangles(6_000, 10.0, 0.1),
            false,
        ),
    ];
    for (name, shape, is_cut) in scenes {
        let triangles = Triangles::of(&shape);
        let whole = built(&Plan { rival: None, ..best }, &triangles);
        let cut = built(&Plan { builder: best.rival.unwrap(), rival: None, ..best }, &triangles);
        let share = cost(&cut) / cost(&whole);
        assert_eq!(share < Plan::RIVAL_SHARE, is_cut, "{name}: {share}");
        let tree = built(&best, &triangles);
        assert!(tree == if is_cut { cut } else { whole }, "{name}: neither or the dearer");
        assert_eq!(tree.prims.len() > triangles.0.len(), is_cut, "{name}");
        tree.validate_pieces(&triangles.bounds()).unwrap_or_else(|e| panic!("{name}: {e}"));
    }
}

#[test]
fn a_builder_that_was_asked_for_has_no_rival() {
    let asked = |name: &str| name.parse::<treelet::scene::Recipe>().unwrap();
    let plan = |name: &str| asked(name).options().plan().to_string();
    assert_eq!(plan("best"), "binned-sah or sbvh + reinsertion");
    assert_eq!(plan("best+rotations"), "binned-sah or sbvh + reinsertion + rotations");
    let lbvh = asked("lbvh");
    let options = treelet::BuildOptions { quality: Quality::Best, ..lbvh.options() };
    assert_eq!(options.plan().to_string(), "lbvh");
}

#[test]
fn the_same_tree_for_any_number_of_threads() {
    let triangles = Triangles::of(&shards(20_000, 14));
    let best = Quality::Best.plan();
    let trees = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| built(&best, &triangles))
    });
    assert!(trees[0].prims.len() > 20_000 && trees[0] == trees[1]);
}
