//! What kinds of primitives and filters cost: `cargo bench -p treelet --bench kinds`.
//!
//! Two ways at a time take turns over the same rays, one thread, single rays; printed are the medians, in million rays
//! a second, and the ratio of what was named second to the first with its quartiles over the rounds.

#![allow(clippy::print_stdout, reason = "that is what it is for")]

use std::hint::black_box;
use std::time::Instant;
use treelet::geometry::{Curves, Meeting, Primitives, Quads, Spheres, User};
use treelet::{Aabb, BuildOptions, Hit, Mesh, Ray, Scene};
use treelet_testkit::Noise;

/// Rays of a round.
const RAYS: usize = 16_384;
const ROUNDS: usize = 15;

/// Cells of the side of a landscape.
const SIDE: u32 = 700;

fn main() {
    if !std::env::args().any(|word| word == "--bench") {
        // A test run: that it runs is enough.
        return;
    }
    let mut noise = Noise::new(1);

    let land = landscape(&mut noise);
    let halves = land.quads().iter().flat_map(|&[a, b, c, d]| [[a, b, d], [c, d, b]]);
    let mesh = Mesh::new(land.positions(), halves.collect::<Vec<_>>());
    let built = |scene: treelet::SceneBuilder| scene.build(&BuildOptions::default()).unwrap();
    let mesh = built(Scene::builder().mesh(mesh));
    let rays = rays(&mesh, &mut noise);
    println!("a landscape of {} triangles", mesh.report().triangles);
    compare("closest", "with a filter that accepts all", &rays, &closest(&mesh), &|ray| {
        mesh.closest_filtered(ray, |hit| hit.prim != u32::MAX)
    });
    let any = |hit: bool| hit.then_some(Hit::MISS);
    compare("any", "with a filter that accepts all", &rays, &|ray| any(mesh.any(ray)), &|ray| {
        any(mesh.any_filtered(ray, |hit| hit.prim != u32::MAX))
    });

    let quads = built(Scene::builder().shape(land));
    compare("a mesh", "as quads", &rays, &closest(&mesh), &closest(&quads));

    let balls: Vec<[f32; 4]> = (0..1_000_000)
        .map(|_| {
            let [x, y, z] = noise.point(-10.0, 10.0);
            [x, y, z, noise.between(0.02, 0.06)]
        })
        .collect();
    let spheres = built(Scene::builder().shape(Spheres::new(balls.clone())));
    let rays = self::rays(&spheres, &mut noise);
    println!("{} spheres", balls.len());
    let own = built(Scene::builder().shape(User::new(Balls(balls.clone()))));
    compare("built in", "as user primitives", &rays, &closest(&spheres), &closest(&own));
    let strands = (0..balls.len() as u32).step_by(2).collect::<Vec<_>>();
    let mut ends = balls.clone();
    for pair in ends.chunks_exact_mut(2) {
        let [x, y, z, _] = pair[0];
        pair[1] = [x + 0.05, y + 0.05, z, 0.01];
    }
    let curves = built(Scene::builder().shape(Curves::new(ends, strands)));
    compare("spheres", "half as many curve segments", &rays, &closest(&spheres), &closest(&curves));
}

/// Hills of two sizes.
fn landscape(noise: &mut Noise) -> Quads {
    let row = SIDE + 1;
    let place = |at: u32| {
        let [x, y] = [at % row, at / row].map(|k| k as f32 / SIDE as f32);
        let hills = (9.0 * x).sin() * (7.0 * y).cos() + 0.3 * (41.0 * x + 23.0 * y).sin();
        [20.0 * x, 20.0 * y, hills + noise.between(-0.01, 0.01)]
    };
    let positions: Vec<_> = (0..row * row).map(place).collect();
    let corner = |at: u32| at / SIDE * row + at % SIDE;
    let quads = (0..SIDE * SIDE).map(corner).map(|at| [at, at + 1, at + row + 1, at + row]);
    Quads::new(positions, quads.collect::<Vec<_>>())
}

/// Between random points of a scene's box.
fn rays(scene: &Scene, noise: &mut Noise) -> Vec<Ray> {
    let Aabb { lo, hi } = scene.bounds();
    let mut point = || [0, 1, 2].map(|axis: usize| noise.between(lo[axis], hi[axis]));
    let mut ray = |_| {
        let (from, to) = (point(), point());
        Ray::new(from, [0, 1, 2].map(|axis: usize| to[axis] - from[axis]))
    };
    (0..RAYS).map(&mut ray).collect()
}

fn closest(scene: &Scene) -> impl Fn(&Ray) -> Option<Hit> {
    move |ray| scene.closest(ray)
}

fn compare(
    first: &str,
    second: &str,
    rays: &[Ray],
    a: &dyn Fn(&Ray) -> Option<Hit>,
    b: &dyn Fn(&Ray) -> Option<Hit>,
) {
    let time = |answer: &dyn Fn(&Ray) -> Option<Hit>| {
        let start = Instant::now();
        let hits = rays.iter().filter(|ray| black_box(answer(ray)).is_some()).count();
        (start.elapsed().as_secs_f64(), hits)
    };
    let rounds: Vec<_> = (0..ROUNDS).map(|_| (time(a), time(b))).collect();
    let mut ratios: Vec<f64> = rounds.iter().map(|((a, _), (b, _))| a / b).collect();
    ratios.sort_by(f64::total_cmp);
    let median = |of: &dyn Fn(usize) -> f64| {
        let mut all: Vec<f64> = (0..ROUNDS).map(of).collect();
        all.sort_by(f64::total_cmp);
        rays.len() as f64 / all[ROUNDS / 2] / 1e6
    };
    let [a, b] = [median(&|at| rounds[at].0.0), median(&|at| rounds[at].1.0)];
    let ((_, hits), (_, others)) = rounds[0];
    println!(
        "  {first} {a:.2}, {second} {b:.2}: {:.2} ({:.2} to {:.2}); hits {hits}, {others}",
        ratios[ROUNDS / 2],
        ratios[ROUNDS / 4],
        ratios[3 * ROUNDS / 4]
    );
}

/// Spheres as a caller would write them.
struct Balls(Vec<[f32; 4]>);

impl Primitives for Balls {
    fn len(&self) -> usize {
        self.0.len()
    }

    fn bounds(&self, prim: usize) -> Aabb {
        let [x, y, z, r] = self.0[prim];
        let grown = r * 1.0001 + 1e-5;
        Aabb { lo: [x - grown, y - grown, z - grown], hi: [x + grown, y + grown, z + grown] }
    }

    fn hit(&self, prim: usize, ray: &Ray) -> Option<Meeting> {
        let [x, y, z, r] = self.0[prim];
        let o = [ray.origin[0] - x, ray.origin[1] - y, ray.origin[2] - z];
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (a, b) = (dot(ray.direction, ray.direction), dot(o, ray.direction));
        let rest = b * b - a * (dot(o, o) - r * r);
        if rest < 0.0 {
            return None;
        }
        let root = rest.sqrt();
        let within = |t: &f32| ray.t_min <= *t && *t <= ray.t_max;
        let t = [(-b - root) / a, (-b + root) / a].into_iter().find(within)?;
        Some(Meeting { t, u: 0.0, v: 0.0 })
    }
}
