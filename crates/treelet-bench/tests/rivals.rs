//! The rivals from the crate registry see what treelet sees.
#![cfg(feature = "rivals")]

use treelet_bench::crew::Clock;
use treelet_bench::engine::Engine;
use treelet_bench::rays::Kind;
use treelet_bench::report::Order;
use treelet_bench::rivals::{embree::Wishes, rival, treelet::Treelet};
use treelet_bench::rounds::Rounds;
use treelet_bench::run::{self, Plan, SceneResult, Subject, Watcher};
use treelet_bench::scenes::Generated;

struct Nobody;

impl Watcher for Nobody {
    fn step(&self, _: &str) {}
    fn stopped(&self) -> bool {
        false
    }
}

fn measure(name: &str, threads: usize) -> SceneResult {
    let triangles = Generated::Terrain(5_000).triangles();
    let subject =
        Subject { name: "hill".into(), generated: true, triangles, placed: None, up: Some(1) };
    let rival = rival(name, &Wishes::default()).unwrap();
    let mut engines: Vec<Box<dyn Engine>> = vec![Box::new(Treelet), rival];
    let plan = Plan {
        kinds: Kind::ALL.to_vec(),
        orders: vec![Order::Given],
        slices: vec![8192],
        threads: vec![threads],
        rays: 8192,
        rounds: Rounds { count: 2, seconds: 0.0 },
        clock: Clock::Wall,
        builders: vec!["default".into()],
        variants: Vec::new(),
    };
    run::scene(&subject, &mut engines, &plan, &Nobody).unwrap()
}

/// A few rays graze an edge or meet a corner, and may be seen otherwise.
const GRAZING_PPM: f64 = 2_000.0;

#[test]
fn every_rival_answers_nearly_as_treelet_does() {
    for name in ["obvhs", "bvh", "parry", "tinybvh"] {
        let result = measure(name, 1);
        assert!(result.left_out.is_empty());
        let theirs: Vec<_> = result.traces.iter().filter(|t| t.engine == name).collect();
        assert!(theirs.len() >= Kind::ALL.len(), "{name}");
        for trace in theirs {
            assert!(trace.mismatch_ppm <= GRAZING_PPM, "{}: {}", trace.label(), trace.mismatch_ppm);
            assert!(trace.ids_ppm.unwrap_or(0.0) <= GRAZING_PPM, "{}", trace.label());
        }
    }
}

#[test]
fn what_keeps_to_one_thread_is_left_out_with_more() {
    if std::thread::available_parallelism().is_ok_and(|there| there.get() < 2) {
        return;
    }
    let result = measure("tinybvh", 2);
    assert_eq!(result.left_out[0].name, "tinybvh");
    assert!(result.traces.iter().all(|trace| trace.engine == "treelet"));
    assert!(!result.traces.is_empty());
}
