//! `treelet inspect --bounds`: bounding volumes for this scene, tight against fast.
//!
//! Each volume is put around what nodes of the default tree hold: around leaves, and around inner
//! nodes of up to 4,096 triangles. Where there are many, 512 of each are taken, evenly spread over
//! the node array. Told are
//!
//! - *area*: surface area relative to that of the axis-aligned box, the mean over nodes. It is the
//!   chance that a line which meets the one meets the other;
//! - *false*: the share of rays that meet the volume and none of the triangles in it, over random
//!   lines, each triangle tested;
//! - *test*: nanoseconds a ray test, of rays against the same nodes' volumes, without the call and
//!   the loop around it;
//! - a *walk*: what diffuse rays test on their way to their closest hit, where nodes of up to 4,096
//!   triangles have this volume and those above boxes.

use serde::Serialize;
use std::hint::black_box;
use std::time::Instant;
use treelet::bounds::{Aabb, Dop14, Dop18, Dop26, Obb, Sphere, Volume};
use treelet::math::vec3;
use treelet::tree::{Kind, Tree};
use treelet::verify::Random;
use treelet::{Quality, Ray};
use treelet_bench::stats::median;

use super::flat::{Flat, stopped_or};
use super::walk::{self, Walked};
use crate::ending::{Ending, Failure};
use crate::input::Input;
use crate::progress::Line;
use crate::session::{Outcome, Session, say};

/// Inner nodes with more triangles are not looked at: brute force has its limits.
pub(super) const HELD_MOST: usize = 4096;
/// Nodes of either sort that are looked at.
const NODES: usize = 512;
/// Random lines for each node.
const LINES: usize = 256;
/// Rays that are timed against each node.
const TIMED_RAYS: usize = 64;
/// Rounds of timing, in which volumes take turns.
const ROUNDS: usize = 15;

/// The table of one scene.
#[derive(Serialize)]
struct Report {
    scene: String,
    triangles: u64,
    leaves: u64,
    inner: u64,
    /// Rays of the walk.
    rays: u64,
    bounds: Vec<VolumeReport>,
}

/// One volume.
#[derive(Serialize)]
struct VolumeReport {
    volume: &'static str,
    bytes: u64,
    test_ns: f64,
    leaves: Fitness,
    inner: Fitness,
    walk: Walked,
}

/// How well a volume fits nodes of one sort.
#[derive(Clone, Copy, Default, Serialize)]
struct Fitness {
    /// Surface area relative to the axis-aligned box's, the mean.
    area: f64,
    /// Of the rays that meet the volume, the share that meets nothing in it.
    false_positives: f64,
}

/// A node to be bounded: the corners of its triangles, and lines that may meet those.
struct Held {
    points: Vec<[f32; 3]>,
    lines: Vec<([f32; 3], [f32; 3])>,
    /// By line: whether it meets a triangle.
    met: Vec<bool>,
}

/// Measures every volume.
pub(super) fn run(input: &Input, session: &Session) -> Result<Outcome, Failure> {
    let line = Line::spinner("building");
    let flat = Flat::new(input)?;
    let tree = flat.tree(&Quality::default().into(), session)?;
    let held = walk::held(&tree);
    let leaves = sample(&tree, &held, true);
    let inner = sample(&tree, &held, false);
    let mut random = Random::new(0xB0);
    let mut hold = |nodes: &[usize]| -> Vec<Held> {
        nodes.iter().map(|&node| Held::new(&flat, &tree, node, &mut random)).collect()
    };
    line.set(0, "testing every triangle".into());
    let (leaves, inner) = (hold(&leaves), hold(&inner));
    let rays = walk::rays(&flat, input.up).map_err(|error| stopped_or(session, error))?;
    let subject = Subject { flat: &flat, tree: &tree, leaves: &leaves, inner: &inner, rays: &rays };

    let mut bounds = Vec::new();
    let mut timers = Vec::new();
    subject.measure::<Aabb>(&mut bounds, &mut timers, &line, session)?;
    subject.measure::<Sphere>(&mut bounds, &mut timers, &line, session)?;
    subject.measure::<Obb>(&mut bounds, &mut timers, &line, session)?;
    subject.measure::<Dop14>(&mut bounds, &mut timers, &line, session)?;
    subject.measure::<Dop18>(&mut bounds, &mut timers, &line, session)?;
    subject.measure::<Dop26>(&mut bounds, &mut timers, &line, session)?;
    line.set(0, "timing".into());
    for (volume, nanoseconds) in bounds.iter_mut().zip(in_turn(&timers)) {
        volume.test_ns = nanoseconds;
    }
    drop(timers);
    drop(line);
    let report = Report {
        scene: input.name.clone(),
        triangles: flat.triangles.len() as u64,
        leaves: leaves.len() as u64,
        inner: inner.len() as u64,
        rays: rays.len() as u64,
        bounds,
    };
    tell(&report);
    Outcome::new("inspect", &report, Ending::Done)
}

/// Some leaves or inner nodes, evenly spread.
fn sample(tree: &Tree, held: &[u32], leaves: bool) -> Vec<usize> {
    let fit = |&node: &usize| {
        let is_leaf = matches!(tree.nodes[node].kind(), Kind::Leaf { .. });
        is_leaf == leaves && held[node] as usize <= HELD_MOST
    };
    let all: Vec<usize> = (0..tree.nodes.len()).filter(fit).collect();
    let count = all.len().min(NODES);
    (0..count).map(|number| all[number * all.len() / count]).collect()
}

impl Held {
    fn new(flat: &Flat, tree: &Tree, node: usize, random: &mut Random) -> Self {
        let mut corners = Vec::new();
        let mut open = vec![node];
        while let Some(at) = open.pop() {
            match tree.nodes[at].kind() {
                Kind::Inner { left } => open.extend([left, left + 1]),
                Kind::Leaf { first, count } => {
                    let prims = &tree.prims[first..first + count];
                    corners.extend(prims.iter().map(|&p| flat.triangles.corners(p as usize)));
                }
            }
        }
        let points: Vec<[f32; 3]> = corners.iter().flatten().copied().collect();
        // Chords of a ball around all volumes: every line through it as likely as every other.
        let bounds = Sphere::of_points(&points).bounds().union(&Obb::of_points(&points).bounds());
        let (middle, radius) = (bounds.center(), 0.51 * bounds.diagonal() as f32);
        let mut tip = || {
            let tip = vec3::normalize(random.direction()).unwrap_or([1.0, 0.0, 0.0]);
            vec3::add(middle, vec3::scale(tip, radius))
        };
        let chords = (0..LINES).map(|_| (tip(), tip()));
        let lines: Vec<_> = chords.map(|(from, to)| (from, vec3::sub(to, from))).collect();
        let meets = |&(origin, direction): &([f32; 3], [f32; 3])| {
            corners.iter().any(|corners| walk::hit(corners, origin, direction).is_some())
        };
        let met = lines.iter().map(meets).collect();
        Self { points, lines, met }
    }

    fn reach(&self) -> Aabb {
        let start = Aabb::of_points(&self.points);
        self.lines.iter().fold(start, |reach, &(origin, direction)| {
            reach.union(&Aabb::of_points(&[origin, vec3::add(origin, direction)]))
        })
    }
}

/// What all volumes are measured on.
struct Subject<'a> {
    flat: &'a Flat,
    tree: &'a Tree,
    leaves: &'a [Held],
    inner: &'a [Held],
    rays: &'a [Ray],
}

/// Tests all pairs once; nanoseconds a test, the loop around it not counted.
type Timer<'a> = Box<dyn Fn() -> f64 + 'a>;

impl<'a> Subject<'a> {
    /// Everything about one volume; its timer, to be run in turn with the others'.
    fn measure<V: Volume + 'a>(
        &self,
        bounds: &mut Vec<VolumeReport>,
        timers: &mut Vec<Timer<'a>>,
        line: &Line,
        session: &Session,
    ) -> Result<(), Failure>
    where
        V::Ray: 'a,
    {
        line.set(0, format!("measuring {}", V::NAME));
        if session.cancel.is_cancelled() {
            return Err(Failure::Cancelled);
        }
        timers.push(timer::<V>(self.leaves.iter().chain(self.inner)));
        bounds.push(VolumeReport {
            volume: V::NAME,
            bytes: size_of::<V>() as u64,
            test_ns: f64::NAN,
            leaves: fitness::<V>(self.leaves),
            inner: fitness::<V>(self.inner),
            walk: walk::walk::<V>(self.flat, self.tree, self.rays),
        });
        Ok(())
    }
}

/// How well a volume fits.
fn fitness<V: Volume>(nodes: &[Held]) -> Fitness {
    let (mut areas, mut count) = (0.0, 0.0_f64);
    let (mut admitted, mut wrongly) = (0_u64, 0_u64);
    for held in nodes {
        let volume = V::of_points(&held.points);
        let aligned = Aabb::of_points(&held.points).half_area();
        if aligned > 0.0 {
            areas += volume.half_area() / aligned;
            count += 1.0;
        }
        let reach = held.reach();
        for (&(origin, direction), &met) in held.lines.iter().zip(&held.met) {
            let ray = V::ray(origin, direction, &reach);
            if !volume.interval(&ray).is_empty() {
                admitted += 1;
                wrongly += u64::from(!met);
            }
        }
    }
    Fitness {
        area: areas / count.max(1.0),
        false_positives: wrongly as f64 / admitted.max(1) as f64,
    }
}

/// A call of its own, so that the loop around it gains nothing that a walk would not.
#[inline(never)]
fn test<V: Volume>(volume: &V, ray: &V::Ray) -> bool {
    !volume.interval(ray).is_empty()
}

/// The same call with nothing in it.
#[inline(never)]
fn nothing<V: Volume>(volume: &V, ray: &V::Ray) -> bool {
    black_box((volume, ray));
    false
}

/// Times rays against volumes of nodes.
fn timer<'a, V: Volume + 'a>(nodes: impl Iterator<Item = &'a Held>) -> Timer<'a>
where
    V::Ray: 'a,
{
    let pairs: Vec<(V, Vec<V::Ray>)> = nodes
        .map(|held| {
            let reach = held.reach();
            let lines = held.lines.iter().take(TIMED_RAYS);
            let rays = lines.map(|&(origin, direction)| V::ray(origin, direction, &reach));
            (V::of_points(&held.points), rays.collect())
        })
        .collect();
    Box::new(move || {
        // A node at a time, and the median: what is interrupted falls out.
        let time = |test: fn(&V, &V::Ray) -> bool, (volume, rays): &(V, Vec<V::Ray>)| {
            let start = Instant::now();
            let admitted = rays.iter().filter(|&ray| test(volume, ray)).count();
            black_box(admitted);
            start.elapsed().as_secs_f64() / rays.len().max(1) as f64
        };
        let (test, nothing) = (black_box(test::<V>), black_box(nothing::<V>));
        let times = pairs.iter().map(|pair| time(test, pair) - time(nothing, pair));
        1e9 * median(&times.collect::<Vec<f64>>())
    })
}

/// The median time of each, the timers in turn.
fn in_turn(timers: &[Timer<'_>]) -> Vec<f64> {
    let mut times = vec![Vec::with_capacity(ROUNDS); timers.len()];
    for round in 0..ROUNDS {
        for number in 0..timers.len() {
            let at = (number + round) % timers.len();
            times[at].push(timers[at]());
        }
    }
    times.iter().map(|times| median(times)).collect()
}

/// Prints the table.
fn tell(report: &Report) {
    say(&format!(
        "\n  volumes around {} leaves and {} inner nodes of the default tree; walks of {} rays",
        report.leaves, report.inner, report.rays
    ));
    say("                         leaves          inner nodes     a ray's walk");
    say("  volume  bytes  test    area   false    area   false    boxes  volumes  triangles");
    for volume in &report.bounds {
        let share = |fitness: Fitness| {
            format!("{:>5.2}  {:>5.1}%", fitness.area, 100.0 * fitness.false_positives)
        };
        say(&format!(
            "  {:7} {:>5}  {:>4.1} ns  {}   {}   {:>5.1}  {:>7.1}  {:>9.2}",
            volume.volume,
            volume.bytes,
            volume.test_ns,
            share(volume.leaves),
            share(volume.inner),
            volume.walk.boxes,
            volume.walk.volumes,
            volume.walk.triangles,
        ));
    }
}
