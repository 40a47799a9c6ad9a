//! What a ray would test if nodes had other bounds: a counting walk over the binary tree.

use serde::Serialize;
use treelet::bounds::{Aabb, Volume};
use treelet::math::vec3;
use treelet::tree::{Kind, Tree};
use treelet::{BuildOptions, Ray, Scene, SceneError};
use treelet_bench::rays::{Kind as RayKind, RaySource};

use super::bounds::HELD_MOST;
use super::flat::Flat;

/// Rays of a walk.
const RAYS: usize = 1 << 13;

/// What a ray tests, on average.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(super) struct Walked {
    /// Axis-aligned boxes of nodes near the root.
    pub(super) boxes: f64,
    /// Volumes of nodes with at most 4,096 triangles.
    pub(super) volumes: f64,
    /// Leaves entered.
    pub(super) leaves: f64,
    /// Triangles tested.
    pub(super) triangles: f64,
}

/// Diffuse rays, as the bench makes them.
pub(super) fn rays(flat: &Flat, up: usize) -> Result<Vec<Ray>, SceneError> {
    let scene = Scene::builder().mesh(flat.mesh.clone()).build(&BuildOptions::default())?;
    Ok(RaySource::new(&scene, up, RAYS).rays(RayKind::Diffuse))
}

/// By node: how many primitives it holds.
pub(super) fn held(tree: &Tree) -> Vec<u32> {
    let mut held = vec![0; tree.nodes.len()];
    for (at, node) in tree.nodes.iter().enumerate().rev() {
        held[at] = match node.kind() {
            Kind::Inner { left } => held[left] + held[left + 1],
            Kind::Leaf { count, .. } => count as u32,
        };
    }
    held
}

/// Walks every ray to its closest hit, the nearer child first, and counts.
pub(super) fn walk<V: Volume>(flat: &Flat, tree: &Tree, rays: &[Ray]) -> Walked {
    let volumes = volumes::<V>(flat, tree);
    let mut reach =
        rays.iter().fold(tree.bounds(), |reach, ray| reach.union(&Aabb::of_points(&[ray.origin])));
    for volume in volumes.iter().flatten() {
        reach = reach.union(&volume.bounds());
    }
    let mut walked = Walked::default();
    for ray in rays {
        let line = (
            V::ray(ray.origin, ray.direction, &reach),
            <Aabb as Volume>::ray(ray.origin, ray.direction, &reach),
        );
        let mut closest = f64::from(ray.t_max);
        // Where a node is entered, if it is before the closest hit.
        let entry = |node: usize, closest: f64, walked: &mut Walked| {
            let interval = match &volumes[node] {
                Some(volume) => {
                    walked.volumes += 1.0;
                    volume.interval(&line.0)
                }
                None => {
                    walked.boxes += 1.0;
                    line.1.interval(&tree.nodes[node].bounds)
                }
            };
            let entry = interval.entry.max(ray.t_min);
            let enters = entry <= interval.exit && f64::from(entry) <= closest;
            enters.then_some(f64::from(entry))
        };
        let mut open: Vec<(f64, usize)> = Vec::new();
        open.extend(entry(0, closest, &mut walked).map(|t| (t, 0)));
        while let Some((t, node)) = open.pop() {
            if t > closest {
                continue;
            }
            match tree.nodes[node].kind() {
                Kind::Inner { left } => {
                    let mut next: Vec<(f64, usize)> = [left, left + 1]
                        .into_iter()
                        .filter_map(|child| Some((entry(child, closest, &mut walked)?, child)))
                        .collect();
                    next.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
                    open.extend(next);
                }
                Kind::Leaf { first, count } => {
                    walked.leaves += 1.0;
                    walked.triangles += count as f64;
                    for &prim in &tree.prims[first..first + count] {
                        let corners = flat.triangles.corners(prim as usize);
                        let t = hit(&corners, ray.origin, ray.direction);
                        let t = t.filter(|&t| t >= f64::from(ray.t_min));
                        closest = t.map_or(closest, |t| t.min(closest));
                    }
                }
            }
        }
    }
    let share = 1.0 / rays.len().max(1) as f64;
    Walked {
        boxes: walked.boxes * share,
        volumes: walked.volumes * share,
        leaves: walked.leaves * share,
        triangles: walked.triangles * share,
    }
}

/// By node: the volume around its triangles, if it holds few enough.
fn volumes<V: Volume>(flat: &Flat, tree: &Tree) -> Vec<Option<V>> {
    let held = held(tree);
    let mut volumes = vec![None; tree.nodes.len()];
    let mut points: Vec<[f32; 3]> = Vec::new();
    let mut open: Vec<usize> = Vec::new();
    for node in (0..tree.nodes.len()).filter(|&node| held[node] as usize <= HELD_MOST) {
        points.clear();
        open.push(node);
        while let Some(at) = open.pop() {
            match tree.nodes[at].kind() {
                Kind::Inner { left } => open.extend([left, left + 1]),
                Kind::Leaf { first, count } => {
                    let prims = &tree.prims[first..first + count];
                    points.extend(prims.iter().flat_map(|&p| flat.triangles.corners(p as usize)));
                }
            }
        }
        volumes[node] = Some(V::of_points(&points));
    }
    volumes
}

/// Where a line meets a triangle, in f64: good enough to count with.
///
/// Source: T. Moller and B. Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", JGT 2(1),
/// 1997.
pub(super) fn hit(corners: &[[f32; 3]; 3], origin: [f32; 3], direction: [f32; 3]) -> Option<f64> {
    let [a, b, c] = corners.map(|corner| vec3::sub(corner, origin).map(f64::from));
    let direction = direction.map(f64::from);
    let minus = |p: [f64; 3], q: [f64; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
    let cross = |p: [f64; 3], q: [f64; 3]| {
        [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]
    };
    let dot = |p: [f64; 3], q: [f64; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    let (e, f) = (minus(b, a), minus(c, a));
    let p = cross(direction, f);
    let det = dot(e, p);
    if det == 0.0 {
        return None;
    }
    let s = [-a[0], -a[1], -a[2]];
    let u = dot(s, p) / det;
    let q = cross(s, e);
    let v = dot(direction, q) / det;
    let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
    inside.then(|| dot(f, q) / det)
}
