//! Rays traced while somebody else commits: whether any answer is wrong, and what it does to the slowest batches.
//!
//! One thread commits, at a steady pace and on a pool of its own, the poses of a mesh that twists, round and round. The others
//! trace the newest snapshot, batch after batch. Spells with commits and spells without take turns, so that what the
//! machine does besides falls on both.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde::Serialize;
use treelet::scene::Policy;
use treelet::{BuildOptions, Hit, Mesh, Ray, Scene, SceneError};

use super::AnimateError;
use super::motion::Moving;
use crate::rays::{self, Kind, RaySource};
use crate::run::{Subject, Watcher};
use crate::scenes;

/// Poses that are committed in turn, and how far of the clip they go.
const POSES: usize = 8;
const SHARE: f32 = 0.2;
/// Batches that are traced in turn, and rays of each.
const BATCHES: usize = 64;
const BATCH: usize = 1024;
/// Seconds of a spell.
const SPELL: f64 = 2.5;

/// What is to be done.
#[derive(Clone, Copy, Debug)]
pub struct Load {
    /// Seconds with commits, and as many without.
    pub seconds: f64,
    /// Commits a second.
    pub pace: f64,
    /// Threads that trace; one more commits.
    pub readers: usize,
    /// What the commits may do.
    pub policy: Policy,
}

/// What was seen.
#[derive(Clone, Debug, Serialize)]
pub struct Reading {
    /// Batches traced while somebody committed, and while nobody did.
    pub batches: [usize; 2],
    /// Batches with an answer that a fresh build does not give.
    pub wrong: usize,
    /// Commits made.
    pub commits: usize,
    /// By the action's name.
    pub refitted: usize,
    /// By the action's name.
    pub repaired: usize,
    /// Milliseconds of a commit: the median, and the longest.
    pub commit_ms: [f64; 2],
    /// Milliseconds of a batch: the median, and that of one in a thousand, with commits and without.
    pub median_ms: [f64; 2],
    /// See above.
    pub p999_ms: [f64; 2],
}

/// A pose, with its number.
type Slot = Mutex<Arc<(usize, Scene)>>;

/// What one reader saw.
#[derive(Default)]
struct Seen {
    /// Milliseconds, with commits and without.
    times: [Vec<f64>; 2],
    wrong: usize,
}

/// Traces and commits.
///
/// # Errors
///
/// A scene cannot be built or edited, or it was stopped.
pub fn read(
    subject: &Subject,
    load: &Load,
    watcher: &dyn Watcher,
) -> Result<Reading, AnimateError> {
    watcher.step("building every pose");
    let moving = Moving::new(&subject.triangles);
    let indices = moving.rest.indices.clone();
    let poses: Vec<Vec<[f32; 3]>> =
        (0..POSES).map(|pose| moving.at(SHARE * pose as f32 / POSES as f32)).collect();
    let scene = |frame: usize, error: SceneError| AnimateError::Scene {
        frame,
        way: "fresh".to_owned(),
        error: Box::new(error),
    };
    let fresh = poses.iter().enumerate().map(|(pose, positions)| {
        let mesh = Mesh::new(positions.clone(), indices.clone());
        Scene::builder().mesh(mesh).build(&BuildOptions::default()).map_err(|e| scene(pose, e))
    });
    let fresh = fresh.collect::<Result<Vec<_>, _>>()?;

    // What a fresh build answers.
    let up = subject.up.unwrap_or_else(|| rays::guess_up(&scenes::bounds(&subject.triangles)));
    let source = RaySource::new(&fresh[0], up, BATCHES * BATCH);
    let rays = source.rays(Kind::Diffuse);
    let told: Vec<Vec<Hit>> = fresh.iter().map(|scene| answer(scene, &rays)).collect();

    watcher.step("tracing, with commits and without");
    let slot: Slot = Mutex::new(Arc::new((0, fresh[0].clone())));
    let [done, busy] = [(); 2].map(|()| AtomicBool::new(false));
    std::thread::scope(|scope| {
        let readers: Vec<_> = (0..load.readers)
            .map(|_| scope.spawn(|| follow(&slot, &rays, &told, [&done, &busy])))
            .collect();
        let committed = commit(load, &slot, &poses, &busy, watcher);
        done.store(true, Ordering::Relaxed);
        let mut seen = Seen::default();
        for reader in readers {
            let Ok(one) = reader.join() else { continue };
            seen.wrong += one.wrong;
            for (all, times) in seen.times.iter_mut().zip(one.times) {
                all.extend(times);
            }
        }
        Ok(sum(seen, &committed?))
    })
}

fn answer(scene: &Scene, rays: &[Ray]) -> Vec<Hit> {
    rays.iter().map(|ray| scene.closest(ray).unwrap_or(Hit::MISS)).collect()
}

/// Traces the newest snapshot until all is done.
fn follow(slot: &Slot, rays: &[Ray], told: &[Vec<Hit>], flags: [&AtomicBool; 2]) -> Seen {
    let [done, busy] = flags;
    let mut seen = Seen::default();
    let mut hits = vec![Hit::MISS; BATCH];
    for at in (0..rays.len() / BATCH).cycle() {
        if done.load(Ordering::Relaxed) {
            break;
        }
        let spell = busy.load(Ordering::Relaxed);
        // The lock is the program's, around the choice of a snapshot; the library has none.
        let snapshot = Arc::clone(&slot.lock().unwrap_or_else(PoisonError::into_inner));
        let (pose, scene) = &*snapshot;
        let rays = &rays[at * BATCH..][..BATCH];
        let start = Instant::now();
        for (ray, hit) in rays.iter().zip(&mut hits) {
            *hit = scene.closest(ray).unwrap_or(Hit::MISS);
        }
        let took = 1e3 * start.elapsed().as_secs_f64();
        if spell == busy.load(Ordering::Relaxed) {
            seen.times[usize::from(!spell)].push(took);
        }
        let told = &told[*pose][at * BATCH..][..BATCH];
        seen.wrong += usize::from(!hits.iter().zip(told).all(|(a, b)| super::compare::same(a, b)));
    }
    seen
}

/// What was committed: milliseconds and the action's name.
type Committed = Vec<(f64, &'static str)>;

/// Commits pose after pose in every other spell.
fn commit(
    load: &Load,
    slot: &Slot,
    poses: &[Vec<[f32; 3]>],
    busy: &AtomicBool,
    watcher: &dyn Watcher,
) -> Result<Committed, AnimateError> {
    let mut committed = Committed::new();
    let mut scene = slot.lock().unwrap_or_else(PoisonError::into_inner).1.clone();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let pool = pool.map_err(|error| AnimateError::Pool(error.to_string()))?;
    let begin = Instant::now();
    for frame in 1.. {
        let now = begin.elapsed().as_secs_f64();
        if now > 2.0 * load.seconds {
            break;
        }
        if watcher.stopped() {
            return Err(AnimateError::Cancelled);
        }
        let spell = (now / SPELL) as u64 % 2 == 1;
        busy.store(spell, Ordering::Relaxed);
        let next = Instant::now() + Duration::from_secs_f64(1.0 / load.pace);
        if spell {
            let pose = frame % poses.len();
            let mut edit = scene.edit();
            edit.policy = load.policy;
            // The scene has that one mesh.
            let _ = edit.set_positions(0, poses[pose].clone());
            let commit = pool.install(|| edit.commit(&BuildOptions::default()));
            let way = || "commits".to_owned();
            let commit = commit.map_err(|error| AnimateError::Scene {
                frame,
                way: way(),
                error: Box::new(error),
            })?;
            let milliseconds = 1e3 * commit.time.as_secs_f64();
            committed.push((milliseconds, commit.action.name()));
            scene = commit.scene;
            let newest = Arc::new((pose, scene.clone()));
            *slot.lock().unwrap_or_else(PoisonError::into_inner) = newest;
        }
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
    }
    Ok(committed)
}

fn sum(mut seen: Seen, committed: &Committed) -> Reading {
    let at = |sorted: &[f64], share: f64| {
        let index = (share * sorted.len() as f64) as usize;
        sorted.get(index.min(sorted.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
    };
    seen.times.iter_mut().for_each(|times| times.sort_by(f64::total_cmp));
    let mut times: Vec<f64> = committed.iter().map(|(time, _)| *time).collect();
    times.sort_by(f64::total_cmp);
    let count = |word: &str| committed.iter().filter(|(_, did)| *did == word).count();
    Reading {
        batches: seen.times.each_ref().map(Vec::len),
        wrong: seen.wrong,
        commits: committed.len(),
        refitted: count("refitted"),
        repaired: count("repaired"),
        commit_ms: [at(&times, 0.5), at(&times, 1.0)],
        median_ms: seen.times.each_ref().map(|times| at(times, 0.5)),
        p999_ms: seen.times.each_ref().map(|times| at(times, 0.999)),
    }
}

impl Reading {
    /// Lines for people.
    pub fn lines(&self) -> Vec<String> {
        let line = |at: usize, what: &str| {
            let (median, worst) = (self.median_ms[at], self.p999_ms[at]);
            format!(
                "{what} commits: {} batches of {BATCH} rays, {median:.3} ms (median), {worst:.3} ms (p99.9)",
                self.batches[at]
            )
        };
        vec![
            format!(
                "{} commits ({} refitted, {} repaired), {:.2} ms (median), {:.2} ms (longest)",
                self.commits, self.refitted, self.repaired, self.commit_ms[0], self.commit_ms[1]
            ),
            line(0, "with"),
            line(1, "without"),
            format!(
                "{} batches with a wrong answer; p99.9 with commits over without: {:.2}",
                self.wrong,
                self.p999_ms[0] / self.p999_ms[1]
            ),
        ]
    }
}
