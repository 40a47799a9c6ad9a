//! `Quality::for_rays` and `Quality::Auto`: whatever they choose, the answers are the same, and they say why.

use core::sync::atomic::{AtomicUsize, Ordering};
use core::time::Duration;
use treelet::scene::Recipe;
use treelet::verify;
use treelet::{
    Affine, BuildOptions, Cancel, Context, Hit, Mesh, Pilot, Quality, Ray, Scene, SceneError,
};
use treelet_testkit::{Shape, awkward};

/// From none to no end.
const COUNTS: [u64; 5] = [0, 1, 10_000, 50_000_000, u64::MAX];

fn mesh(shape: &Shape) -> Mesh {
    Mesh::new(shape.positions.clone(), shape.triangles.clone())
}

fn soup(triangles: usize) -> Mesh {
    mesh(&awkward::random_triangles(triangles, 10.0, 0.5))
}

fn build(mesh: &Mesh, options: &BuildOptions<'_>) -> Result<Scene, SceneError> {
    Scene::builder().mesh(mesh.clone()).build(options)
}

fn agree(a: &Scene, b: &Scene, rays: &[Ray]) {
    for ray in rays {
        assert_eq!(a.closest(ray), b.closest(ray), "{ray:?}");
        assert_eq!(a.any(ray), b.any(ray), "{ray:?}");
        assert_eq!(a.count(ray), b.count(ray), "{ray:?}");
    }
}

#[test]
fn any_number_of_rays_gets_the_same_answers_and_a_reason() {
    let mesh = soup(1_000);
    let usual = build(&mesh, &BuildOptions::default()).unwrap();
    assert_eq!(usual.report().choice, None);
    let rays = verify::rays(&usual, 300, 1);
    let (closest, any) = rays.split_at(200);
    let mut variants = Vec::new();
    for (i, &n) in COUNTS.iter().enumerate() {
        let pilot = if i % 2 == 1 { Pilot::default() } else { Pilot { closest, any } };
        let options = BuildOptions { quality: Quality::for_rays(n), pilot, ..Default::default() };
        let scene = build(&mesh, &options).unwrap();
        agree(&usual, &scene, &rays);
        let report = scene.report();
        let choice = report.choice.as_ref().unwrap();
        assert_eq!(choice.rays, n);
        assert!(choice.choosing <= report.total_time && report.total_time <= choice.predicted);
        assert!(choice.reason.contains(&choice.variant), "{}", choice.reason);
        let recipe: Recipe = choice.variant.parse().unwrap();
        assert_eq!(recipe.options().plan().to_string(), report.plan);
        assert!(choice.candidates.iter().any(|each| each.variant == choice.variant));
        assert!(choice.candidates.iter().all(|each| each.variant.parse::<Recipe>().is_ok()));
        let measured = choice.candidates.iter().filter(|each| each.measured).count();
        assert_eq!(measured > 1, n > 1_000_000, "{choice:?}");
        variants.push(choice.variant.clone());
    }
    assert_eq!(variants[..2], ["fastest", "fastest"]);
}

#[test]
fn hardly_any_scene_is_a_scene_too() {
    for triangles in [0, 1, 2] {
        let mesh = soup(triangles);
        let usual = build(&mesh, &BuildOptions::default()).unwrap();
        let closest = &verify::rays(&usual, 20, 9);
        for quality in COUNTS.map(Quality::for_rays).into_iter().chain([Quality::Auto]) {
            let pilot = Pilot { closest, any: &[] };
            let options = BuildOptions { quality, pilot, ..Default::default() };
            let scene = build(&mesh, &options).unwrap();
            assert!(scene.report().choice.is_some());
            agree(&usual, &scene, &verify::rays(&usual, 50, 2));
        }
    }
    let scene =
        Scene::builder().build(&BuildOptions { quality: Quality::Auto, ..Default::default() });
    assert_eq!(scene.unwrap().bounds(), treelet::Aabb::EMPTY);
}

#[test]
fn what_is_named_is_not_chosen() {
    let recipe: Recipe = "hploc".parse().unwrap();
    for quality in [Quality::for_rays(1_000_000_000), Quality::Auto] {
        let scene = build(&soup(100), &BuildOptions { quality, ..recipe.options() }).unwrap();
        assert_eq!((scene.report().builder, &scene.report().choice), ("hploc", &None));
        assert_eq!(scene.improve(Duration::MAX).unwrap().map(|_| ()), None);
    }
}

/// Placed scenes choose for themselves; pilot rays are of the level that they are given to.
#[test]
fn instances_of_chosen_scenes() {
    let (mesh, usual) = (soup(300), BuildOptions::default());
    let both = [usual.clone(), BuildOptions { quality: Quality::for_rays(50_000_000), ..usual }];
    let [usual, chosen] = both.map(|options| {
        let object = build(&mesh, &options).unwrap();
        let place = |x: f32| Affine([[0.0, 1.0, 0.0, x], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, x]]);
        let scene =
            (0..5).fold(Scene::builder(), |scene, i| scene.instance(&object, place(i as f32)));
        scene.mesh(mesh.clone()).build(&options).unwrap()
    });
    agree(&usual, &chosen, &verify::rays(&usual, 200, 3));
}

/// Somebody stops it while another tree is tried: whichever tree that is.
#[test]
fn the_search_is_cancelled_at_any_step() {
    let mesh = soup(1_000);
    let closest = &verify::rays(&build(&mesh, &BuildOptions::default()).unwrap(), 20, 8);
    let run = |stop: usize| {
        let (cancel, calls) = (Cancel::new(), AtomicUsize::new(0));
        let watch = |_| {
            if calls.fetch_add(1, Ordering::Relaxed) == stop {
                cancel.cancel();
            }
        };
        let context = Context { cancel: cancel.clone(), progress: Some(&watch) };
        let (quality, pilot) = (Quality::for_rays(u64::MAX), Pilot { closest, any: &[] });
        let built = build(&mesh, &BuildOptions { quality, pilot, context, ..Default::default() });
        (built, calls.into_inner())
    };
    let (built, calls) = run(usize::MAX);
    assert!(built.is_ok() && calls > 5);
    for stop in (0..calls / 2).step_by(calls.div_ceil(4)) {
        let (built, _) = run(stop);
        assert!(built.is_err_and(|error| error.is_cancelled()), "{stop} of {calls}");
    }
}

#[test]
fn auto_improves_once_it_pays() {
    let mesh = soup(1_000);
    let closest = &verify::rays(&build(&mesh, &BuildOptions::default()).unwrap(), 20, 7);
    let pilot = Pilot { closest, any: &[] };
    let options = BuildOptions { quality: Quality::Auto, pilot, ..Default::default() };
    let first = build(&mesh, &options).unwrap();
    assert_eq!(first.report().choice.as_ref().unwrap().variant, "fastest");
    let rays = verify::rays(&first, 200, 4);

    // Nothing was asked; then next to nothing; then too little time is granted.
    assert!(first.improve(Duration::MAX).unwrap().is_none());
    let mut hits = vec![Hit::MISS; 1];
    first.closest_many(&rays[..1], &mut hits).unwrap();
    assert!(first.improve(Duration::MAX).unwrap().is_none());
    first.note_traced(1 << 40, Duration::from_secs(1 << 20));
    assert!(first.improve(Duration::ZERO).unwrap().is_none());

    // By and by everything is tried, and what is better kept.
    let (mut scene, mut steps, mut idle) = (first.clone(), 0, 0);
    while idle < 20 {
        scene.note_traced(1 << 40, Duration::from_secs(1 << 20));
        idle += 1;
        if let Some(better) = scene.improve(Duration::MAX).unwrap() {
            assert_ne!(scene.report().plan, better.report().plan);
            agree(&first, &better, &rays);
            (scene, steps, idle) = (better, steps + 1, 0);
        }
        assert!(steps < 20);
    }
    assert!(steps > 0);
}

/// The flag that the scene was built with stops its improvement.
#[test]
fn improvement_is_cancelled() {
    let context = Context::default();
    let cancel = context.cancel.clone();
    let options = BuildOptions { quality: Quality::Auto, context, ..Default::default() };
    let scene = build(&soup(1_000), &options).unwrap();
    scene.note_traced(1 << 40, Duration::from_secs(1 << 20));
    cancel.cancel();
    assert!(scene.improve(Duration::MAX).is_err_and(|error| error.is_cancelled()));
}
