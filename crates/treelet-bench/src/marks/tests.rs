//! The whole table over numbers that are made up.

use super::{Mark, SHORT_SLICE, Standing, marks};
use crate::engine::Api;
use crate::rays::Kind;
use crate::report::{Build, Order, SceneLine, Trace};
use crate::rivals::treelet::LOOP;

const SCENE: &str = "hill";
const RAYS: usize = 65_536;

fn scene() -> SceneLine {
    SceneLine {
        scene: SCENE.into(),
        generated: true,
        triangles: 100,
        instances: 0,
        camera_from: [0.0; 3],
        camera_at: [1.0; 3],
        hit_rate: 1.0,
        rays_by_brute_force: 1,
    }
}

fn build(engine: &str, variant: &str, seconds: f64) -> Build {
    Build {
        scene: SCENE.into(),
        engine: engine.into(),
        variant: variant.into(),
        threads: 1,
        triangles: 100,
        mtris_per_s: 1e-4 / seconds,
        bytes_per_tri: 70.0,
        peak_bytes_per_tri: Some(130.0),
        shared_bytes_per_tri: 18.0,
        seconds: vec![seconds; 7],
    }
}

/// Traces of every kind in an order.
fn traces(engine: &str, variant: &str, width: usize, order: Order, mrays_per_s: f64) -> Vec<Trace> {
    let trace = |kind| Trace {
        scene: SCENE.into(),
        engine: engine.into(),
        variant: variant.into(),
        kind,
        api: if width == 1 { Api::One } else { Api::Many },
        width,
        threads: 1,
        rays: RAYS as u64,
        mrays_per_s,
        spread: 0.0,
        mismatch_ppm: 0.0,
        ids_ppm: None,
        order,
        coherent: false,
        seconds: vec![1.0 / mrays_per_s; 7],
    };
    Kind::ALL.map(trace).to_vec()
}

/// What a run with everything in it gives.
fn measured() -> (Vec<Build>, Vec<Trace>) {
    use Order::{Given, Shuffled};
    let builds = [
        build("treelet", "fast", 1.0),
        build("treelet", "default", 4.0),
        build("treelet", "best", 9.0),
        build("treelet", "default compact", 5.0),
        build("embree", "LOW", 2.0),
        build("embree", "MEDIUM", 4.0),
        build("embree", "HIGH", 9.0),
    ];
    let traces = [
        traces("treelet", "fast", 1, Given, 2.0),
        traces("treelet", "default", 1, Given, 3.0),
        traces("treelet", "default", LOOP, Given, 3.2),
        traces("treelet", "default compact", 1, Given, 2.7),
        traces("treelet", "best", 1, Given, 4.0),
        traces("treelet", "best", RAYS, Given, 9.0),
        traces("treelet", "best", SHORT_SLICE, Given, 6.0),
        traces("treelet", "best", RAYS, Shuffled, 8.0),
        traces("embree", "LOW", 1, Given, 1.0),
        traces("embree", "MEDIUM", 1, Given, 2.0),
        traces("embree", "HIGH", 1, Given, 2.0),
        traces("embree", "HIGH", 8, Given, 5.0),
        traces("embree", "HIGH", 16, Given, 3.0),
        traces("embree", "HIGH", 1, Shuffled, 4.0),
        traces("embree", "HIGH", 8, Shuffled, 2.0),
    ];
    (builds.to_vec(), traces.concat())
}

fn all(builds: &[Build], traces: &[Trace]) -> Vec<Mark> {
    marks(&[scene()], builds, traces)
}

/// The one mark whose words begin so.
fn find<'a>(marks: &'a [Mark], begin: &str) -> &'a Mark {
    let found: Vec<_> = marks.iter().filter(|mark| mark.what.starts_with(begin)).collect();
    assert_eq!(found.len(), 1, "{begin}");
    found[0]
}

#[test]
fn a_whole_run_judges_every_mark() {
    let (builds, traces) = measured();
    let marks = all(&builds, &traces);
    assert!(marks.iter().all(|mark| mark.standing != Standing::NotMeasured), "{marks:#?}");
    assert_eq!(marks.len(), 2 * 5 + 3 * 5 + 1 + 3 + 4 + 2 + 2);
    for (begin, mean) in [
        ("single diffuse, default / Embree MEDIUM", 1.5),
        ("single diffuse, best / Embree HIGH", 2.0),
        // The best of one ray, eight and sixteen.
        ("slices of 65536 shadow", 1.8),
        ("shuffled slices of 65536 shadow", 2.0),
        ("slices of 1024 shadow", 1.2),
        ("slices of 65536 random, generated scenes", 1.8),
        ("build, default / Embree MEDIUM", 1.0),
        ("build, fast / Embree LOW", 2.0),
        ("  if: single rays through that tree, fast / Embree LOW", 2.0),
        ("bytes a triangle that walks read, default compact", 52.0),
        ("peak of a build above its result, bytes a triangle, fast", 60.0),
        ("single rays, default compact / default", 0.9),
        ("single-ray call", 3.0 / 3.2),
    ] {
        let mark = find(&marks, begin);
        assert!((mark.mean.unwrap() - mean).abs() < 1e-9, "{mark:?}");
        let small = mark.what.starts_with("bytes") || mark.what.starts_with("peak");
        let reached = if small { mean <= mark.mean_asked } else { mean >= mark.mean_asked };
        assert_eq!(mark.standing == Standing::Met, reached, "{mark:?}");
    }
}

#[test]
fn scenes_with_instances_have_marks_of_their_own() {
    let (builds, traces) = measured();
    let instanced = SceneLine { instances: 9, ..scene() };
    let marks = marks(&[instanced], &builds, &traces);
    let mark = find(&marks, "instances: single diffuse, default / Embree MEDIUM");
    assert_eq!((mark.mean, mark.standing), (Some(1.5), Standing::Met));
    let mark = find(&marks, "single diffuse, default / Embree MEDIUM");
    assert_eq!((mark.cells, mark.standing), (0, Standing::NotMeasured));
    assert!(all(&builds, &traces).iter().all(|mark| !mark.what.starts_with("instances")));
}

#[test]
fn a_fast_build_counts_only_if_rays_through_it_are_not_slower() {
    let (builds, mut traces) = measured();
    let of_low = |trace: &&mut Trace| trace.variant == "LOW";
    traces.iter_mut().filter(of_low).for_each(|trace| trace.seconds = vec![0.1; 7]);
    let marks = all(&builds, &traces);
    let mark = find(&marks, "build, fast");
    assert_eq!((mark.mean, mark.standing), (Some(2.0), Standing::NotMet));
}

#[test]
fn what_lacks_is_said() {
    let (builds, mut traces) = measured();
    traces.retain(|t| t.width == 1 || t.engine == "treelet");
    traces.retain(|t| t.kind != Kind::Primary);
    let marks = all(&builds, &traces);
    let mark = find(&marks, "slices of 65536 diffuse");
    assert_eq!(mark.standing, Standing::NotMeasured);
    assert_eq!(mark.lacking.as_deref(), Some("no packets of diffuse rays of embree HIGH"));
    let mark = find(&marks, "single primary, default");
    assert_eq!(mark.lacking.as_deref(), Some("no single primary rays of treelet default"));
    // The other kinds still count.
    assert_eq!(find(&marks, "single-ray call").cells, 4);
}
