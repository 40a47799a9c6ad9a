//! Builders that join from below, against each other.

use treelet::Context;
use treelet::bounds::Aabb;
use treelet::build::{Aac, Agglomerative, Builder, Hlbvh, Hploc, Lbvh, Ploc};
use treelet::tree::Tree;
use treelet_testkit::{Shape, awkward, closed};

fn boxes(shape: &Shape) -> Vec<Aabb> {
    let corner = |index: u32| shape.positions[index as usize];
    shape.triangles.iter().map(|triangle| Aabb::of_points(&triangle.map(corner))).collect()
}

/// Meshes on which the heuristic tells builders apart.
fn telling_meshes() -> Vec<(&'static str, Vec<Aabb>)> {
    let mut room = boxes(&closed::sphere(96, 48));
    // Small things among large ones.
    room.extend(boxes(&awkward::random_triangles(200, 3.0, 3.0)));
    vec![
        ("sphere", boxes(&closed::sphere(128, 64))),
        ("random", boxes(&awkward::random_triangles(20_000, 10.0, 0.1))),
        ("star", boxes(&closed::random_star(96, 48, 1))),
        ("room", room),
    ]
}

fn build(builder: &dyn Builder, bounds: &[Aabb]) -> Tree {
    let tree = builder.build(bounds, &Context::default()).unwrap();
    tree.validate(bounds).unwrap();
    tree
}

fn sah(builder: &dyn Builder, bounds: &[Aabb]) -> f64 {
    build(builder, bounds).stats().sah
}

/// The paper's claim: little is lost by clustering few at a time.
#[test]
fn approximate_clustering_is_about_as_good_as_exact_clustering() {
    for (name, bounds) in telling_meshes() {
        let exact = sah(&Agglomerative::DEFAULT, &bounds);
        for (aac, most) in [(Aac::HQ, 1.08), (Aac::FAST, 1.2), (Aac::DEFAULT, 1.2)] {
            let cost = sah(&aac, &bounds);
            assert!(cost < most * exact, "{name}: {cost} by {aac:?}, {exact} exactly");
        }
    }
}

/// On surfaces. (Among boxes strewn at random the curve is the best of them.)
#[test]
fn joining_by_area_beats_cutting_the_curve() {
    for (name, bounds) in telling_meshes() {
        let curve = sah(&Lbvh::DEFAULT, &bounds);
        let builders: [(&dyn Builder, f64); 5] = match name {
            "sphere" | "star" => [
                (&Hlbvh::DEFAULT, 0.95),
                (&Ploc::DEFAULT, 0.95),
                (&Hploc::DEFAULT, 0.99),
                (&Aac::DEFAULT, 0.99),
                (&Agglomerative::DEFAULT, 0.94),
            ],
            "room" => [
                (&Hlbvh::DEFAULT, 1.01),
                (&Ploc::DEFAULT, 0.88),
                (&Hploc::DEFAULT, 0.94),
                (&Aac::DEFAULT, 0.94),
                (&Agglomerative::DEFAULT, 0.88),
            ],
            _ => continue,
        };
        for (builder, most) in builders {
            let cost = sah(builder, &bounds);
            let who = builder.info().name;
            assert!(cost < most * curve, "{name}: {cost} by {who}, {curve} by the curve");
        }
    }
}

/// What is not in the catalogue: it is the same for any number of threads.
#[test]
fn options_do_not_let_threads_show() {
    let bounds = boxes(&awkward::random_triangles(60_000, 10.0, 0.1));
    let builders: [&dyn Builder; 5] = [
        &Aac::HQ,
        &Aac::FAST,
        &Lbvh { leaf_max: 1, code_bits: 30 },
        &Hlbvh { leaf_max: 1, cluster_bits: 21 },
        &Ploc { leaf_max: 7, radius: 5 },
    ];
    let pools = [1, 2, 7]
        .map(|threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap());
    for (nth, builder) in builders.into_iter().enumerate() {
        let [one, two, seven] =
            pools.each_ref().map(|pool| pool.install(|| build(builder, &bounds)));
        assert_eq!(one, two, "{nth}: 2 threads make another tree than 1");
        assert_eq!(one, seven, "{nth}: 7 threads make another tree than 1");
    }
}

/// `cargo test --release -p treelet --test bottom_up -- --ignored --nocapture`
#[test]
#[ignore = "prints rates, from boxes to tree; tests nothing"]
fn rates() {
    let bounds = boxes(&awkward::random_triangles(2_000_000, 10.0, 0.1));
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let builders: [(&str, &dyn Builder); 9] = [
        ("lbvh, 63 bits", &Lbvh::DEFAULT),
        ("lbvh, 30 bits", &Lbvh { code_bits: 30, ..Lbvh::DEFAULT }),
        ("lbvh, 63 bits, leaves of one", &Lbvh { leaf_max: 1, ..Lbvh::DEFAULT }),
        ("lbvh, 30 bits, leaves of one", &Lbvh { leaf_max: 1, code_bits: 30 }),
        ("hlbvh", &Hlbvh::DEFAULT),
        ("ploc", &Ploc::DEFAULT),
        ("hploc", &Hploc::DEFAULT),
        ("aac", &Aac::DEFAULT),
        ("aac, from primitives", &Aac::HQ),
    ];
    for (name, builder) in builders {
        let mut seconds: Vec<f64> = (0..7)
            .map(|_| {
                let start = std::time::Instant::now();
                one.install(|| builder.build(&bounds, &Context::default())).unwrap();
                start.elapsed().as_secs_f64()
            })
            .collect();
        seconds.sort_by(f64::total_cmp);
        let rate = bounds.len() as f64 / seconds[3] / 1.0e6;
        eprintln!("{name:30} {rate:6.2} M triangles/s on one thread");
    }
}
