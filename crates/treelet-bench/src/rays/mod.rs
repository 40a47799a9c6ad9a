//! The rays that every engine is given: five kinds, as a renderer sends them.
//!
//! Primary rays come from one camera, in tiles; the three kinds of secondary rays start at what the
//! primary rays hit, in the same order, a little off the surface on the side it was seen from;
//! random rays know of no camera. All from fixed seeds, without platform maths.

mod camera;

pub use camera::Camera;

use treelet::math::vec3;
use treelet::verify::Random;
use treelet::{Aabb, Hit, Ray, Scene};

use crate::engine::Question;

/// A kind of ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// From the camera, in tiles; closest.
    Primary,
    /// Cosine hemisphere, of finite length; any.
    Occlusion,
    /// Cosine hemisphere, endless; closest.
    Diffuse,
    /// To points on lights; any.
    Shadow,
    /// Through two random points of the scene's box; closest.
    Random,
}

impl Kind {
    /// All kinds, in the order of reports.
    pub const ALL: [Self; 5] =
        [Self::Primary, Self::Occlusion, Self::Diffuse, Self::Shadow, Self::Random];

    /// As users write it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Occlusion => "occlusion",
            Self::Diffuse => "diffuse",
            Self::Shadow => "shadow",
            Self::Random => "random",
        }
    }

    /// The kind of that name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// What is asked about its rays.
    pub const fn question(self) -> Question {
        match self {
            Self::Primary | Self::Diffuse | Self::Random => Question::Closest,
            Self::Occlusion | Self::Shadow => Question::Any,
        }
    }
}

/// How far off the surface secondary rays start, of the scene's diagonal.
const OFFSET: f32 = 1e-4;
/// Length of occlusion rays, of the scene's diagonal.
const REACH: f32 = 0.1;
/// Square lights, level, in the upper part of the box.
const LIGHTS: u64 = 4;
/// Edge of a light, of the scene's diagonal.
const LIGHT_EDGE: f32 = 0.02;
/// Shadow rays stop short of the light by this part of their length.
const SHORT_OF_LIGHT: f32 = 1e-3;

/// Makes the rays of one scene.
pub struct RaySource {
    bounds: Aabb,
    up: usize,
    primary: Vec<Ray>,
    /// Where secondary rays start, and the normal on that side, in the order of the primary rays.
    starts: Vec<([f32; 3], [f32; 3])>,
    /// Where and how the camera stands.
    pub camera: Camera,
    /// The part of primary rays that hit something.
    pub hit_rate: f64,
}

impl RaySource {
    /// Chooses a camera and sends `count` rays from it. `up` is the axis that points up.
    pub fn new(scene: &Scene, up: usize, count: usize) -> Self {
        let bounds = scene.bounds();
        let camera = Camera::choose(scene, up);
        let rays = camera.tiled(count);
        let mut hits = vec![Hit::MISS; rays.len()];
        // The slices have one length, so nothing is refused.
        let _ = scene.closest_many(&rays, &mut hits);
        let found = hits.iter().filter(|hit| hit.is_hit()).count();
        let hit_rate = found as f64 / rays.len().max(1) as f64;
        let offset = OFFSET * diagonal(&bounds);
        let starts = rays.iter().zip(&hits).filter_map(|(ray, hit)| start(scene, ray, hit, offset));
        let starts = starts.collect();
        Self { bounds, up, primary: rays, starts, camera, hit_rate }
    }

    /// As many rays of that kind as there are primary rays.
    pub fn rays(&self, kind: Kind) -> Vec<Ray> {
        let mut random = Random::new(0xBE5 + kind as u64);
        match kind {
            Kind::Primary => self.primary.clone(),
            Kind::Random => self.primary.iter().map(|_| self.through_box(&mut random)).collect(),
            Kind::Shadow => {
                let lights = self.lights(&mut random);
                self.secondary(|start, _| self.to_light(start, &lights, &mut random))
            }
            Kind::Occlusion => {
                let reach = REACH * diagonal(&self.bounds);
                let ray = |start, normal| Ray::new(start, cosine(normal, &mut random)).up_to(reach);
                self.secondary(ray)
            }
            Kind::Diffuse => {
                self.secondary(|start, normal| Ray::new(start, cosine(normal, &mut random)))
            }
        }
    }

    /// A ray for each start, the starts in the order of the primary rays, round and round.
    fn secondary(&self, mut ray: impl FnMut([f32; 3], [f32; 3]) -> Ray) -> Vec<Ray> {
        let count = self.primary.len();
        self.starts.iter().cycle().take(count).map(|&(start, normal)| ray(start, normal)).collect()
    }

    /// A ray from one random point of the box through another.
    fn through_box(&self, random: &mut Random) -> Ray {
        loop {
            let (from, to) = (self.inside(random), self.inside(random));
            if let Some(direction) = vec3::normalize(vec3::sub(to, from)) {
                return Ray::new(from, direction);
            }
        }
    }

    /// A random point of the box.
    fn inside(&self, random: &mut Random) -> [f32; 3] {
        let Aabb { lo, hi } = self.bounds;
        [0, 1, 2].map(|axis: usize| random.between(lo[axis], hi[axis]))
    }

    /// The first corners of the lights: in the upper third of the box, clear of its walls.
    fn lights(&self, random: &mut Random) -> Vec<[f32; 3]> {
        let Aabb { lo, hi } = self.bounds;
        let mut between = |axis: usize, from: f32, to: f32| {
            let share = random.between(from, to);
            lo[axis] * (1.0 - share) + hi[axis] * share
        };
        let light = |_| {
            [0, 1, 2].map(|axis: usize| {
                let (from, to) = if axis == self.up { (0.7, 0.95) } else { (0.2, 0.8) };
                between(axis, from, to)
            })
        };
        (0..LIGHTS).map(light).collect()
    }

    /// A ray to a random point of a random light; `t` is 1 there.
    fn to_light(&self, start: [f32; 3], lights: &[[f32; 3]], random: &mut Random) -> Ray {
        let edge = LIGHT_EDGE * diagonal(&self.bounds);
        let mut target = lights[random.below(lights.len() as u64) as usize];
        for axis in (0..3).filter(|&axis| axis != self.up) {
            target[axis] += edge * random.unit();
        }
        Ray::new(start, vec3::sub(target, start)).up_to(1.0 - SHORT_OF_LIGHT)
    }
}

/// Where a secondary ray starts, `offset` off the surface, and the normal on that side; `None` for a miss or
/// a triangle without a normal.
fn start(scene: &Scene, ray: &Ray, hit: &Hit, offset: f32) -> Option<([f32; 3], [f32; 3])> {
    if !hit.is_hit() {
        return None;
    }
    let world_from_object = scene.world_from_object(hit.inst)?;
    let [a, b, c] = scene.corners(hit)?.map(|corner| world_from_object.point(corner));
    let normal = vec3::normalize(vec3::cross(vec3::sub(b, a), vec3::sub(c, a)))?;
    let side = if vec3::dot(normal, ray.direction) > 0.0 { -1.0 } else { 1.0 };
    let normal = vec3::scale(normal, side);
    Some((vec3::add(ray.at(hit.t), vec3::scale(normal, offset)), normal))
}

/// The length of a box's diagonal.
fn diagonal(bounds: &Aabb) -> f32 {
    let extent = bounds.extent();
    vec3::dot(extent, extent).sqrt()
}

/// A direction about `normal`, likelier the nearer: a point of the unit sphere around its tip.
fn cosine(normal: [f32; 3], random: &mut Random) -> [f32; 3] {
    loop {
        let tip = vec3::normalize(random.direction());
        let sum = tip.map(|tip| vec3::add(normal, tip));
        if let Some(direction) = sum.and_then(vec3::normalize) {
            return direction;
        }
    }
}

/// The same rays in an order that has nothing to do with where they are.
pub fn shuffle(rays: &mut [Ray]) {
    let mut random = Random::new(0x5F);
    for last in (1..rays.len()).rev() {
        rays.swap(last, random.below(last as u64 + 1) as usize);
    }
}

/// The axis that points up in a box of unknown origin: the clearly shorter of y and z.
pub fn guess_up(bounds: &Aabb) -> usize {
    /// How much shorter z must be than y.
    const CLEARLY: f32 = 0.9;
    let [_, y, z] = bounds.extent();
    if z < CLEARLY * y { 2 } else { 1 }
}
