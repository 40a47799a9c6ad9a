//! Work for a program that counts instructions: `cargo xtask counts` runs this under valgrind and
//! holds the counts against committed limits, so that no kernel gets slower unseen.
//!
//! A line on stdout names each piece of work, with the rays or triangles in it, in the order in
//! which [`measured`] is entered; the counter is switched on there and nowhere else. Everything is
//! made from fixed seeds, on one thread.

#![allow(clippy::print_stdout, reason = "what is counted is told there")]

use std::hint::black_box;

use treelet::scene::LayoutChoice;
use treelet::simd::Level;
use treelet::{BuildOptions, Hit, Mesh, Quality, Ray, Scene};
use treelet_testkit::{Noise, Shape, awkward, closed};

/// Rays of each sort: more than the slices that are answered ray by ray.
const RAYS: usize = 2048;

/// The instruction sets whose kernels are counted, valgrind knows no newer ones; and layouts, where
/// it is not the usual one.
const KERNELS: [(&str, Option<LayoutChoice>); 4] =
    [("scalar", None), ("sse42", None), ("avx2", None), ("avx2", Some(LayoutChoice::Compact))];

/// What is built.
const BUILDS: [Quality; 2] = [Quality::Fast, Quality::Default];

fn main() {
    let shape = room();
    let rays = [("camera", camera()), ("random", random())];
    for (level, layout) in KERNELS {
        let Some(level) = Level::by_name(level).filter(Level::is_available) else {
            eprintln!("{level}: not on this processor");
            continue;
        };
        let scene = scene(&shape, &BuildOptions { level, layout, ..Default::default() });
        let layout = if layout.is_some() { " compact" } else { "" };
        for (sort, rays) in &rays {
            trace(&scene, rays, &format!("{sort} {}{layout}", level.name()));
        }
    }
    for quality in BUILDS {
        println!("build {} {}", quality.name(), shape.triangles.len());
        let options = BuildOptions { quality, ..Default::default() };
        measured(&mut || drop(black_box(scene(&shape, &options))));
    }
}

/// Instructions count from here until it returns.
#[inline(never)]
fn measured(work: &mut dyn FnMut()) {
    work();
    told();
}

/// The counter writes down what it has when this returns, and begins anew.
#[inline(never)]
fn told() {
    black_box(());
}

/// A closed room around the origin, 24,320 triangles, and 8,000 small ones in it.
fn room() -> Shape {
    let dented = |[x, y, z]: [f32; 3]| [x, y, z].map(|c| c * (1.0 + x * y * z));
    let mut room = closed::sphere(128, 96).mapped(dented);
    let clutter = awkward::random_triangles(8000, 0.6, 0.02);
    let first = room.positions.len() as u32;
    room.positions.extend(clutter.positions);
    room.triangles.extend(clutter.triangles.iter().map(|triangle| triangle.map(|v| first + v)));
    room
}

/// A scene of one mesh.
fn scene(shape: &Shape, options: &BuildOptions<'_>) -> Scene {
    let mesh = Mesh::new(shape.positions.clone(), shape.triangles.clone());
    Scene::builder().mesh(mesh).build(options).expect("a sound mesh")
}

/// A square of rays from a point near the middle, as a camera sends them.
fn camera() -> Vec<Ray> {
    let side = (RAYS as f32).sqrt() as usize;
    let at = |x: usize| x as f32 / side as f32 - 0.5;
    let ray = |i| Ray::new([0.02, 0.01, 0.03], [at(i % side), at(i / side), 0.7]);
    (0..RAYS).map(ray).collect()
}

/// Rays from everywhere to everywhere.
fn random() -> Vec<Ray> {
    let mut noise = Noise::new(2);
    (0..RAYS).map(|_| Ray::new(noise.point(-0.6, 0.6), noise.point(-1.0, 1.0))).collect()
}

/// Both questions, one ray a call and all in a slice.
fn trace(scene: &Scene, rays: &[Ray], name: &str) {
    let count = rays.len();
    let mut hits = vec![Hit::MISS; count];
    let mut answers = vec![false; count];

    println!("closest single {name} {count}");
    measured(&mut || {
        for (ray, hit) in rays.iter().zip(&mut hits) {
            *hit = scene.closest(ray).unwrap_or(Hit::MISS);
        }
    });
    black_box(&hits);

    println!("closest slice {name} {count}");
    measured(&mut || scene.closest_many(rays, &mut hits).expect("as many hits as rays"));
    black_box(&hits);

    println!("any single {name} {count}");
    measured(&mut || {
        for (ray, answer) in rays.iter().zip(&mut answers) {
            *answer = scene.any(ray);
        }
    });
    black_box(&answers);

    println!("any slice {name} {count}");
    measured(&mut || scene.any_many(rays, &mut answers).expect("as many answers as rays"));
    black_box(&answers);
}
