//! Readers of a snapshot never wait for whoever commits the next one, and never see a part of it.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::thread;
use std::time::Duration;

use treelet::context::Progress;
use treelet::scene::{Action, Policy};
use treelet::verify;
use treelet::{BuildOptions, Context, Hit, Mesh, Ray, Scene};
use treelet_testkit::closed;

/// Nothing here takes nearly as long; what does has lost.
const PATIENCE: Duration = Duration::from_secs(60);

/// A sphere that is so much larger than at first.
fn positions(size: f32) -> Vec<[f32; 3]> {
    closed::sphere(60, 40).positions.iter().map(|p| p.map(|x| x * size)).collect()
}

fn answers(scene: &Scene, rays: &[Ray]) -> Vec<Option<(u32, u32)>> {
    let bits = |hit: Hit| (hit.t.to_bits(), hit.prim);
    rays.iter().map(|ray| scene.closest(ray).map(bits)).collect()
}

/// The commit stops in the middle of its build, for as long as the readers like: they trace all their rays meanwhile.
#[test]
fn readers_go_on_while_a_commit_is_held_open() {
    let shape = closed::sphere(60, 40);
    let mesh = Mesh::new(positions(1.0), shape.triangles);
    let scene = Scene::builder().mesh(mesh).build(&BuildOptions::default()).unwrap();
    let rays = verify::rays(&scene, 300, 0x5EAD);
    let before = answers(&scene, &rays);
    for policy in [Policy::Rebuild, Policy::Repair] {
        let (inside, is_inside) = mpsc::channel();
        let (leave, may_leave) = mpsc::channel::<()>();
        let gate = Mutex::new((inside, may_leave));
        let held = AtomicBool::new(false);
        // The build reports its progress, and the first report waits.
        let hold = |_: Progress| {
            if !held.swap(true, Ordering::Relaxed) {
                let gate = gate.lock().unwrap();
                gate.0.send(()).unwrap();
                gate.1.recv_timeout(PATIENCE).unwrap();
            }
        };
        let mut edit = scene.edit();
        edit.policy = policy;
        edit.set_positions(0, positions(2.0)).unwrap();
        let after = thread::scope(|scope| {
            let hold = &hold;
            let commit = scope.spawn(move || {
                // On threads of its own: what waits here is the commit, not the pool of the readers.
                let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
                let context = Context { progress: Some(hold), ..Context::default() };
                let options = BuildOptions { context, ..BuildOptions::default() };
                pool.install(|| edit.commit(&options)).unwrap()
            });
            is_inside.recv_timeout(PATIENCE).unwrap();
            let readers: Vec<_> = (0..2).map(|_| scope.spawn(|| answers(&scene, &rays))).collect();
            for reader in readers {
                assert_eq!(reader.join().unwrap(), before, "{policy:?}");
            }
            let mut hits = vec![Hit::MISS; rays.len()];
            scene.closest_many(&rays, &mut hits).unwrap();
            assert!(!commit.is_finished(), "{policy:?}");
            leave.send(()).unwrap();
            commit.join().unwrap()
        });
        assert!(matches!(after.action, Action::Rebuilt | Action::Repaired), "{after}");
        let mesh = Mesh::new(positions(2.0), closed::sphere(60, 40).triangles);
        let fresh = Scene::builder().mesh(mesh).build(&BuildOptions::default()).unwrap();
        assert_eq!(answers(&after.scene, &rays), answers(&fresh, &rays));
        assert_ne!(answers(&after.scene, &rays), before);
        assert_eq!(answers(&scene, &rays), before);
    }
}

/// While somebody commits shape after shape, each reader sees one whole shape at a time.
#[test]
fn readers_see_whole_snapshots() {
    const SHAPES: usize = 6;
    const COMMITS: usize = 40;
    let triangles = closed::sphere(60, 40).triangles;
    let size = |index: usize| 1.0 + 0.2 * (index % SHAPES) as f32;
    let options = BuildOptions::default();
    let fresh: Vec<_> = (0..SHAPES)
        .map(|index| {
            let mesh = Mesh::new(positions(size(index)), triangles.clone());
            Scene::builder().mesh(mesh).build(&options).unwrap()
        })
        .collect();
    let rays = verify::rays(&fresh[0], 60, 0x5EAD);
    let expected: Vec<_> = fresh.iter().map(|scene| answers(scene, &rays)).collect();
    assert_ne!(expected[0], expected[1]);

    // The lock is the test's own, around the choice of a snapshot.
    let latest = Mutex::new(Arc::new((0, fresh[0].clone())));
    let (done, batches) = (AtomicBool::new(false), AtomicUsize::new(0));
    thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while !done.load(Ordering::Relaxed) {
                    let snapshot = Arc::clone(&latest.lock().unwrap());
                    let (index, scene) = &*snapshot;
                    assert_eq!(answers(scene, &rays), expected[index % SHAPES], "shape {index}");
                    batches.fetch_add(1, Ordering::Relaxed);
                }
            });
        }
        let mut scene = fresh[0].clone();
        for index in 1..=COMMITS {
            let mut edit = scene.edit();
            edit.policy =
                [Policy::Refit, Policy::Repair, Policy::Rebuild, Policy::Rays(60)][index % 4];
            edit.set_positions(0, positions(size(index))).unwrap();
            scene = edit.commit(&options).unwrap().scene;
            *latest.lock().unwrap() = Arc::new((index, scene.clone()));
        }
        done.store(true, Ordering::Relaxed);
    });
    assert!(batches.load(Ordering::Relaxed) > 0);
}
