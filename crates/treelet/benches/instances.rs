//! Scenes that repeat: `cargo bench -p treelet --bench instances [-- THREADS] [WORDS]`, two threads without a number; of what is
//! measured, with words only what has one of them in its name.
//!
//! Builds the level above a million instances of trees that stand, then moves one of 50,000 and commits. Printed are
//! medians over the rounds with their quartiles, on the clock on the wall. What is taken down beforehand is not in them: who
//! calls `instance` and `set_transform`, what becomes of the scene before. An instance that moves makes a small step.

#![allow(clippy::print_stdout, reason = "that is what it is for")]

use std::time::{Duration, Instant};
use treelet::scene::Action;
use treelet::{Affine, BuildOptions, Mesh, Quality, Scene};
use treelet_testkit::{Noise, Shape, closed};

/// What is placed for a build.
const CROWD: usize = 1_000_000;
const BUILDS: usize = 7;

/// What is placed where one moves.
const VILLAGE: usize = 50_000;
const MOVES: usize = 201;
/// Scenes are built anew as often, to be moved in for the first time.
const FIRST: usize = 9;

fn main() {
    let words: Vec<String> = std::env::args().collect();
    if !words.iter().any(|word| word == "--bench") {
        // A test run: that it runs is enough.
        return;
    }
    let threads = words.iter().find_map(|word| word.parse().ok()).unwrap_or(2);
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().unwrap();
    let built = |mesh: Mesh| vec![Scene::builder().mesh(mesh).build(&options()).unwrap()];
    let triangle = || Mesh::new([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.3]], [[0, 1, 2]]);

    println!("{CROWD} instances, {threads} threads");
    let one = built(triangle());
    for quality in [Quality::Fastest, Quality::Fast, Quality::Default] {
        build(&format!("of a triangle, {}", quality.name()), &one, quality);
    }
    let ball = built(ball());
    build("of a ball of 1280 triangles, fastest", &ball, Quality::Fastest);
    let many: Vec<Scene> = (0..1000).flat_map(|_| built(triangle())).collect();
    build("of 1000 triangles in turn, fastest", &many, Quality::Fastest);

    println!("one of {VILLAGE} moves");
    for (what, objects) in [("a triangle", &one), ("a ball", &ball)] {
        moves(what, objects);
    }
}

/// A ball of 1280 triangles.
fn ball() -> Mesh {
    let Shape { positions, triangles } = closed::sphere(40, 17);
    Mesh::new(positions, triangles)
}

fn options() -> BuildOptions<'static> {
    BuildOptions::default()
}

/// Somewhere in a box, turned somehow.
fn place(noise: &mut Noise) -> Affine {
    let turned = Affine::rotation([0.6, 0.8, 0.0], noise.between(0.0, 6.0));
    Affine::translation(noise.point(0.0, 100.0)).then_from(&turned)
}

/// A level of instances of these in turn, and the times that its caller and its build took.
fn crowd(objects: &[Scene], places: &[Affine], quality: Quality) -> (Scene, [Duration; 2]) {
    let start = Instant::now();
    let mut level = Scene::builder();
    for (place, object) in places.iter().zip(objects.iter().cycle()) {
        level = level.instance(object, *place);
    }
    let described = start.elapsed();
    let start = Instant::now();
    let scene = level.build(&BuildOptions { quality, ..options() }).unwrap();
    (scene, [described, start.elapsed()])
}

/// Whether it was asked for.
fn is_wanted(what: &str) -> bool {
    let mut words = std::env::args()
        .skip(1)
        .filter(|word| !word.starts_with('-') && word.parse::<usize>().is_err());
    let first = words.next();
    first.is_none_or(|first| what.contains(&first) || words.any(|word| what.contains(&word)))
}

fn build(what: &str, objects: &[Scene], quality: Quality) {
    if !is_wanted(what) {
        return;
    }
    let mut noise = Noise::new(1);
    let places: Vec<Affine> = (0..CROWD).map(|_| place(&mut noise)).collect();
    let mut trees = Vec::new();
    let (described, built) = (0..BUILDS)
        .map(|_| {
            let (scene, [described, built]) = crowd(objects, &places, quality);
            trees.push(scene.report().tree_time);
            (described, built)
        })
        .unzip();
    let [low, median, high] = quartiles(built);
    println!(
        "  {what}: {:.2} M/s, {median:.1} ms ({low:.1} to {high:.1}), its tree {:.1}; described in {:.1}",
        CROWD as f64 / 1e3 / median,
        quartiles(trees)[1],
        quartiles(described)[1]
    );
}

fn moves(what: &str, objects: &[Scene]) {
    if !is_wanted(&format!("one of many, {what}, moves")) {
        return;
    }
    let mut noise = Noise::new(2);
    let places: Vec<Affine> = (0..VILLAGE).map(|_| place(&mut noise)).collect();
    let village = || crowd(objects, &places, Quality::Default).0;
    let mut commit = |scene: &Scene, spare: Option<Scene>| {
        let mut edit = scene.edit();
        if let Some(spare) = spare {
            edit.reuse(spare);
        }
        let instance = noise.between(0.0, VILLAGE as f32) as usize;
        let step = Affine::translation(noise.point(-0.5, 0.5));
        edit.set_transform(instance, step.then_from(&places[instance])).unwrap();
        let start = Instant::now();
        let commit = edit.commit(&options()).unwrap();
        let time = start.elapsed();
        assert_eq!(commit.action, Action::Refitted);
        (commit.scene, time)
    };
    let tell = |how: &str, times| {
        let [low, median, high] = quartiles(times);
        println!("  {what}, {how}: {median:.3} ms ({low:.3} to {high:.3})");
    };
    tell(
        "the first commit after a build",
        (0..FIRST).map(|_| commit(&village(), None).1).collect(),
    );
    let mut scene = village();
    let mut next = |reuse: bool, before: &mut Option<Scene>| {
        let (after, time) = commit(&scene, before.take().filter(|_| reuse));
        *before = Some(std::mem::replace(&mut scene, after));
        time
    };
    let mut before = None;
    tell("later ones", (0..MOVES).map(|_| next(false, &mut before)).collect());
    tell("later ones, snapshots reused", (0..MOVES).map(|_| next(true, &mut before)).collect());
}

/// In milliseconds: the lower quartile, the median, the upper quartile.
fn quartiles(mut times: Vec<Duration>) -> [f64; 3] {
    times.sort_unstable();
    [1, 2, 3].map(|quarter| 1e3 * times[quarter * (times.len() - 1) / 4].as_secs_f64())
}
