//! Rotations in refits: a mesh flies to pieces, step by step, and its tree is mended while its boxes follow.

use treelet::scene::{Action, LayoutChoice, Policy};
use treelet::verify::{self, BruteForce, Random};
use treelet::{BuildOptions, Hit, Mesh, Ray, Scene};
use treelet_testkit::{Shape, awkward};

const SEED: u64 = 0xB0857;

/// A soup in which every triangle has vertices of its own.
fn soup(count: usize) -> Shape {
    let mut soup = awkward::random_triangles(count, 2.0, 0.05);
    let corners = |triangle: &[u32; 3]| triangle.map(|at| soup.positions[at as usize]);
    soup.positions = soup.triangles.iter().flat_map(corners).collect();
    soup.triangles = (0..count as u32).map(|prim| [3 * prim, 3 * prim + 1, 3 * prim + 2]).collect();
    soup
}

/// Each triangle goes with its octant, `far` along a way of its own.
fn burst(rest: &Shape, far: f32) -> Vec<[f32; 3]> {
    let mut random = Random::new(SEED);
    let ways = [(); 8].map(|()| random.direction());
    let count = rest.positions.len() as f32;
    let middle = [0, 1, 2].map(|axis| rest.positions.iter().map(|p| p[axis]).sum::<f32>() / count);
    let flown = |triangle: &[[f32; 3]]| {
        let beyond = |axis: usize| usize::from(triangle[0][axis] > middle[axis]);
        let way = ways[beyond(0) + 2 * beyond(1) + 4 * beyond(2)];
        [0, 1, 2].map(|corner| [0, 1, 2].map(|axis| triangle[corner][axis] + far * way[axis]))
    };
    rest.positions.chunks(3).flat_map(flown).collect()
}

fn answers(scene: &Scene, rays: &[Ray]) -> Vec<(Option<[u64; 6]>, bool, u64)> {
    let bits = |hit: Hit| {
        let [t, u, v] = [hit.t, hit.u, hit.v].map(|x| u64::from(x.to_bits()));
        [t, u, v, u64::from(hit.prim), u64::from(hit.geom), hit.inst]
    };
    let answer = |ray| (scene.closest(ray).map(bits), scene.any(ray), scene.count(ray));
    rays.iter().map(answer).collect()
}

fn refitted(scene: &Scene, positions: Vec<[f32; 3]>, options: &BuildOptions<'_>) -> (Scene, f64) {
    let mut edit = scene.edit();
    edit.set_positions(0, positions).unwrap();
    edit.policy = Policy::Refit;
    let commit = edit.commit(options).unwrap();
    assert_eq!(commit.action, Action::Refitted);
    (commit.scene, commit.decay)
}

#[test]
fn worn_trees_are_mended_while_they_are_refitted() {
    let rest = soup(6000);
    let mesh = |positions| Mesh::new(positions, rest.triangles.clone());
    for layout in LayoutChoice::ALL {
        let options = BuildOptions { layout: Some(*layout), ..BuildOptions::default() };
        let built = Scene::builder().mesh(mesh(rest.positions.clone())).build(&options).unwrap();

        // Step by step, and at once: a tree that was not worn yet is not rotated.
        let (mut scene, mut decay) = (built.clone(), 1.0);
        let steps = 24;
        for step in 1..=steps {
            let positions = burst(&rest, 10.0 * step as f32 / steps as f32);
            (scene, decay) = refitted(&scene, positions.clone(), &options);
            if step % 8 > 0 {
                continue;
            }
            let fresh = Scene::builder().mesh(mesh(positions)).build(&options).unwrap();
            let rays = verify::rays(&fresh, 60, SEED + step);
            assert_eq!(scene.bounds(), fresh.bounds());
            assert_eq!(answers(&scene, &rays), answers(&fresh, &rays), "{layout:?}, step {step}");
            let brute = BruteForce::new(&scene);
            for ray in rays.iter().step_by(20) {
                let checked = verify::check(&scene, ray, &brute.all(ray));
                checked.unwrap_or_else(|error| panic!("{layout:?}, step {step}: {error}"));
            }
        }
        let (_, at_once) = refitted(&built, burst(&rest, 10.0), &options);
        assert!(decay < 0.8 * at_once, "{layout:?}: {decay:.2} of {at_once:.2}");

        // What it costs is what a survey of it finds: repairing goes on from there.
        let mut edit = scene.edit();
        edit.set_positions(0, burst(&rest, 10.0)).unwrap();
        edit.policy = Policy::Repair;
        let repaired = edit.commit(&options).unwrap();
        let fresh = Scene::builder().mesh(mesh(burst(&rest, 10.0))).build(&options).unwrap();
        let rays = verify::rays(&fresh, 60, SEED);
        assert_eq!(answers(&repaired.scene, &rays), answers(&fresh, &rays), "{layout:?}");
    }
}

/// So many nodes that they are swept in pieces: the tree is the same whoever sweeps them, and what waits for other pieces is
/// rotated, too.
#[test]
fn rotations_do_not_depend_on_the_number_of_threads() {
    let rest = soup(30_000);
    let options = BuildOptions { layout: Some(LayoutChoice::Wide8), ..BuildOptions::default() };
    let mesh = |positions| Mesh::new(positions, rest.triangles.clone());
    let built = Scene::builder().mesh(mesh(rest.positions.clone())).build(&options).unwrap();
    let play = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let (mut scene, mut decays) = (built.clone(), Vec::new());
            for step in 1..=6 {
                let positions = burst(&rest, step as f32);
                let (next, decay) = refitted(&scene, positions, &options);
                scene = next;
                decays.push(decay.to_bits());
            }
            (scene, decays)
        })
    };
    let [(one, decays), (three, same)] = [1, 3].map(play);
    assert_eq!(decays, same);
    let fresh = Scene::builder().mesh(mesh(burst(&rest, 6.0))).build(&options).unwrap();
    let rays = verify::rays(&fresh, 60, SEED);
    let told = answers(&fresh, &rays);
    assert_eq!((&answers(&one, &rays), &answers(&three, &rays)), (&told, &told));
}
