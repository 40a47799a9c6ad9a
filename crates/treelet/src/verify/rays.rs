//! Rays that look for trouble: aimed at what scenes get wrong.

use super::Random;
use crate::bounds::Aabb;
use crate::math::{Ray, vec3};
use crate::scene::Scene;
use alloc::vec::Vec;

/// What a ray is aimed at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RayKind {
    /// Through the scene's box, anyhow.
    Random,
    /// Exactly at a vertex.
    Vertex,
    /// At a point of an edge.
    Edge,
    /// Along an axis, the other components zeros of either sign, through a vertex's coordinates: so
    /// inside the faces of boxes.
    AxisParallel,
    /// In the plane of a triangle, along an edge of it.
    Grazing,
    /// From a point of a triangle, `t` starting at 0.
    Surface,
}

impl RayKind {
    /// All kinds, in the order in which [`rays`] takes turns.
    pub const ALL: [Self; 6] =
        [Self::Random, Self::Vertex, Self::Edge, Self::AxisParallel, Self::Grazing, Self::Surface];
}

/// `count` rays through the scene, all kinds in turn; the same for the same scene and seed.
///
/// Every fifth ray ends, or starts, near what it is aimed at.
pub fn rays(scene: &Scene, count: usize, seed: u64) -> Vec<Ray> {
    let mut random = Random::new(seed);
    let targets = Targets::new(scene);
    (0..count)
        .map(|i| {
            let kind = RayKind::ALL[i % RayKind::ALL.len()];
            let ray = long_enough(targets.aim(kind, &mut random));
            match i % 5 {
                3 => ray.up_to(random.between(0.0, 2.0)),
                4 => ray.from(random.between(-2.0, 2.0)),
                _ => ray,
            }
        })
        .collect()
}

/// The same ray with a direction that is no shorter than rays may be, for tiny scenes.
fn long_enough(ray: Ray) -> Ray {
    /// Powers of two: scaling by them rounds nothing.
    const SHORT: f32 = 1.0 / (1_u64 << 60) as f32;
    const STRETCH: f32 = (1_u128 << 90) as f32;
    let short = vec3::max_abs(ray.direction) < SHORT;
    Ray { direction: ray.direction.map(|d| if short { d * STRETCH } else { d }), ..ray }
}

/// Where a scene's triangles are.
struct Targets<'a> {
    scene: &'a Scene,
    /// Origins come from here: half as wide again as the scene on every side.
    around: Aabb,
}

/// Picks of a random instance path that may hold no triangle before a random ray is taken instead.
const TRIES: usize = 32;

impl<'a> Targets<'a> {
    fn new(scene: &'a Scene) -> Self {
        let bounds = scene.bounds();
        let bounds = if bounds.is_empty() { Aabb { lo: [-1.0; 3], hi: [1.0; 3] } } else { bounds };
        let extent = bounds.extent();
        let widest = vec3::max_abs(extent).max(f32::MIN_POSITIVE);
        // A flat scene is looked at from outside its plane, too.
        let margin = extent.map(|e| 0.5 * e.max(0.1 * widest));
        let around = Aabb { lo: vec3::sub(bounds.lo, margin), hi: vec3::add(bounds.hi, margin) };
        Self { scene, around }
    }

    fn point(&self, random: &mut Random) -> [f32; 3] {
        core::array::from_fn(|axis| random.between(self.around.lo[axis], self.around.hi[axis]))
    }

    /// The corners of a random triangle, in the scene's space.
    fn triangle(&self, random: &mut Random) -> Option<[[f32; 3]; 3]> {
        (0..TRIES).find_map(|_| {
            let inst = random.below(self.scene.paths());
            let (geom, prim) = (random.bits(), random.bits());
            let corners = self.scene.pick_triangle(inst, geom, prim)?;
            let map = self.scene.world_from_object(inst)?;
            let corners = corners.map(|corner| map.point(corner));
            corners.iter().all(|&corner| vec3::is_finite(corner)).then_some(corners)
        })
    }

    fn aim(&self, kind: RayKind, random: &mut Random) -> Ray {
        let anyhow = |random: &mut Random| {
            let origin = self.point(random);
            Ray::new(origin, vec3::sub(self.point(random), origin))
        };
        let Some(corners) = self.triangle(random) else { return anyhow(random) };
        let corner = corners[random.below(3) as usize];
        let next = corners[random.below(3) as usize];
        let on_edge = vec3::add(corner, vec3::scale(vec3::sub(next, corner), random.unit()));
        match kind {
            RayKind::Random => anyhow(random),
            RayKind::Vertex => self.toward(corner, random),
            RayKind::Edge => self.toward(on_edge, random),
            RayKind::AxisParallel => self.along_axis(corner, random),
            RayKind::Grazing => {
                let along = vec3::sub(next, corner);
                let back = vec3::scale(along, random.between(0.0, 4.0));
                Ray::new(vec3::sub(on_edge, back), along)
            }
            RayKind::Surface => Ray::new(inside(&corners, random), random.direction()),
        }
    }

    fn toward(&self, target: [f32; 3], random: &mut Random) -> Ray {
        let origin = self.point(random);
        Ray::new(origin, vec3::sub(target, origin))
    }

    fn along_axis(&self, target: [f32; 3], random: &mut Random) -> Ray {
        let axis = random.below(3) as usize;
        let forward = random.below(2) == 0;
        let mut origin = target;
        origin[axis] = if forward { self.around.lo[axis] } else { self.around.hi[axis] };
        let direction = core::array::from_fn(|a| match (a == axis, forward) {
            (true, true) => 1.0,
            (true, false) => -1.0,
            (false, _) => [0.0, -0.0][random.below(2) as usize],
        });
        Ray::new(origin, direction)
    }
}

fn inside(corners: &[[f32; 3]; 3], random: &mut Random) -> [f32; 3] {
    let (mut u, mut v) = (random.unit(), random.unit());
    if u + v > 1.0 {
        (u, v) = (1.0 - u, 1.0 - v);
    }
    let [a, b, c] = corners;
    core::array::from_fn(|axis| a[axis] * (1.0 - u - v) + b[axis] * u + c[axis] * v)
}
