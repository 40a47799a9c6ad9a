//! Repair and its policies: whatever a commit made of the tree, the scene answers as one that was built from nothing,
//! bit for bit.

use treelet::scene::{Action, LayoutChoice, Policy, Recipe};
use treelet::verify::{self, BruteForce, Random};
use treelet::{Affine, BuildOptions, Hit, Mesh, Ray, Scene};
use treelet_testkit::{Shape, awkward, closed};

const SEED: u64 = 0x4E9A12;

fn mesh(shape: &Shape) -> Mesh {
    Mesh::new(shape.positions.clone(), shape.triangles.clone())
}

fn answers(scene: &Scene, rays: &[Ray]) -> Vec<(Option<[u64; 6]>, bool, u64)> {
    let bits = |hit: Hit| {
        let [t, u, v] = [hit.t, hit.u, hit.v].map(|x| u64::from(x.to_bits()));
        [t, u, v, u64::from(hit.prim), u64::from(hit.geom), hit.inst]
    };
    let answer = |ray| (scene.closest(ray).map(bits), scene.any(ray), scene.count(ray));
    rays.iter().map(answer).collect()
}

/// A share of the vertices, from `from` on, goes elsewhere.
fn stir(shape: &Shape, from: f32, size: f32, random: &mut Random) -> Vec<[f32; 3]> {
    let first = (from * shape.positions.len() as f32) as usize;
    let stirred = |(at, p): (usize, &[f32; 3])| {
        let by = if at < first { 0.0 } else { size };
        p.map(|x| x + by * random.between(-1.0, 1.0))
    };
    shape.positions.iter().enumerate().map(stirred).collect()
}

/// Through every layout, and builders with and without splits: shapes of which some part is stirred again and again, with
/// instances beside them.
#[test]
fn repaired_trees_answer_like_fresh_ones() {
    let mut random = Random::new(SEED);
    let shape = closed::random_star(60, 40, 7);
    let trees = LayoutChoice::ALL.iter().zip(["default", "presplit+hploc", "sbvh"]);
    for (layout, builder) in trees {
        let recipe: Recipe = builder.parse().unwrap();
        let options = BuildOptions { layout: Some(*layout), ..recipe.options() };
        let cube = Scene::builder().mesh(mesh(&closed::cube())).build(&options).unwrap();
        let fresh = |positions: &[[f32; 3]], maps: &[Affine]| {
            let mesh = Mesh::new(positions.to_vec(), shape.triangles.clone());
            let scene = Scene::builder().mesh(mesh);
            let scene = maps.iter().fold(scene, |scene, map| scene.instance(&cube, *map));
            scene.build(&options).unwrap()
        };
        let mut maps = vec![Affine::scaling([0.2; 3]); 40];
        let mut scene = fresh(&shape.positions, &maps);
        let mut repaired = 0;
        for step in 0..5 {
            let positions = stir(&shape, 0.8, [0.02, 0.3, 9.0][step % 3], &mut random);
            maps[step] = Affine::translation([(); 3].map(|()| random.between(-2.0, 2.0)));
            let mut edit = scene.edit();
            edit.set_positions(0, positions.clone()).unwrap();
            edit.set_transform(step, maps[step]).unwrap();
            edit.policy = [Policy::Repair, Policy::Refit][step % 2];
            let commit = edit.commit(&options).unwrap();
            repaired += u32::from(commit.action == Action::Repaired);
            let what = format!("{builder}, step {step}, {commit}, seed {SEED:#x}");
            let told = fresh(&positions, &maps);
            assert_eq!(commit.scene.bounds(), told.bounds(), "{what}");
            let rays = verify::rays(&told, 80, random.bits());
            assert_eq!(answers(&commit.scene, &rays), answers(&told, &rays), "{what}");
            let brute = BruteForce::new(&commit.scene);
            for ray in rays.iter().step_by(20) {
                let checked = verify::check(&commit.scene, ray, &brute.all(ray));
                checked.unwrap_or_else(|error| panic!("{what}: {error}"));
            }
            scene = commit.scene;
        }
        assert!(repaired >= 1, "{builder}");
    }
}

/// Triangles that share no vertices; the last of them change places, each as it is.
fn mixed(soup: &Shape, still: usize) -> Vec<[f32; 3]> {
    let corners = |prim: usize| soup.triangles[prim].map(|at| soup.positions[at as usize]);
    let count = soup.triangles.len();
    let from =
        |prim: usize| if prim < still { prim } else { still + (prim * 1009) % (count - still) };
    (0..count).flat_map(|prim| corners(from(prim))).collect()
}

/// What did not move stays, what did is built over triangle by triangle, and boxes are as good as new.
#[test]
fn a_repair_keeps_what_is_good() {
    let options = BuildOptions::default();
    let soup = awkward::random_triangles(20_000, 3.0, 0.02);
    let prims: Vec<_> = (0..20_000).map(|prim| [0, 1, 2].map(|i| 3 * prim + i)).collect();
    let scene = Scene::builder().mesh(Mesh::new(mixed(&soup, 20_000 - 1), prims));
    let scene = scene.build(&options).unwrap();
    let commit = |still: usize, policy: Policy| {
        let mut edit = scene.edit();
        edit.set_positions(0, mixed(&soup, still)).unwrap();
        edit.policy = policy;
        edit.commit(&options).unwrap()
    };
    let same = commit(19_999, Policy::Repair);
    assert_eq!(same.action, Action::Repaired);
    assert!(same.parts.loose < 1000 && (0.9..1.1).contains(&same.decay), "{same}");

    // One triangle of a hundred.
    let [refitted, repaired] = [Policy::Refit, Policy::Repair].map(|policy| commit(19_800, policy));
    assert_eq!(repaired.action, Action::Repaired);
    assert!((200..9_900).contains(&repaired.parts.loose), "{repaired}");
    assert!(
        repaired.decay < 1.2 && refitted.decay > 1.3 * repaired.decay,
        "{repaired}, {refitted}"
    );
    let rays = verify::rays(&scene, 200, SEED);
    assert_eq!(answers(&refitted.scene, &rays), answers(&repaired.scene, &rays));

    // All of them: nothing can stay.
    assert_eq!(commit(0, Policy::Repair).action, Action::Rebuilt);
}
