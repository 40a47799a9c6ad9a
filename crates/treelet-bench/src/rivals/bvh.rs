//! The crate bvh 0.13: a binary tree over the caller's shapes.
//!
//! The crate gives the shapes whose boxes a ray meets, the nearer first but for some; the triangle
//! test is the caller's, because its own sees front faces only. A shape whose box begins beyond the
//! closest hit is skipped; stopping there would be wrong, as the order is not exact.

use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::{BHShape, BoundingHierarchy};
use bvh::bvh::Bvh;
use nalgebra::{Point3, Vector3};
use treelet::Ray;

use super::singles::Singles;
use crate::engine::{Answer, Built, Bytes, Call, Engine, EngineError, Pass, Question, Triangles};

/// The engine.
#[derive(Debug)]
pub(super) struct BvhCrate;

/// The name in reports.
pub(super) const NAME: &str = "bvh";

/// Its one variant.
const VARIANT: &str = "Bvh";

impl Engine for BvhCrate {
    fn name(&self) -> &'static str {
        NAME
    }

    fn version(&self) -> String {
        "0.13".to_owned()
    }

    fn variants(&self) -> Vec<String> {
        vec![VARIANT.to_owned()]
    }

    fn build(&self, _: &str, triangles: &Triangles) -> Result<Box<dyn Built>, EngineError> {
        let mut shapes: Vec<Shape> = (0..triangles.len())
            .map(|prim| {
                let [a, b, c] = triangles.corners(prim).map(Point3::from);
                Shape { corner: a, edges: [b - a, c - a], prim: prim as u32, node: 0 }
            })
            .collect();
        let tree = Bvh::build_par(&mut shapes);
        Ok(Box::new(Tree { tree, shapes }))
    }
}

struct Shape {
    corner: Point3<f32>,
    edges: [Vector3<f32>; 2],
    prim: u32,
    node: usize,
}

impl Bounded<f32, 3> for Shape {
    fn aabb(&self) -> Aabb<f32, 3> {
        let [b, c] = self.edges.map(|edge| self.corner + edge);
        Aabb::empty().grow(&self.corner).grow(&b).grow(&c)
    }
}

impl BHShape<f32, 3> for Shape {
    fn set_bh_node_index(&mut self, index: usize) {
        self.node = index;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

impl Shape {
    /// The `t` of a hit in `0 ..= t_max`, from either side.
    ///
    /// Source: T. Moeller, B. Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", Journal
    /// of Graphics Tools 2(1), 1997.
    fn hit(&self, origin: &Point3<f32>, direction: &Vector3<f32>, t_max: f32) -> Option<f32> {
        let [e1, e2] = &self.edges;
        let p = direction.cross(e2);
        let scale = 1.0 / e1.dot(&p);
        let s = origin - self.corner;
        let u = s.dot(&p) * scale;
        let q = s.cross(e1);
        let v = direction.dot(&q) * scale;
        let t = e2.dot(&q) * scale;
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0 && t <= t_max).then_some(t)
    }
}

struct Tree {
    tree: Bvh<f32, 3>,
    shapes: Vec<Shape>,
}

/// A ray, twice: the crate normalises the direction, so its distances are not our `t`.
struct OwnRay {
    ray: bvh::ray::Ray<f32, 3>,
    direction: Vector3<f32>,
    length: f32,
    t_max: f32,
}

impl Built for Tree {
    fn bytes(&self) -> Bytes {
        let own = size_of_val(&*self.tree.nodes) + size_of_val(&*self.shapes);
        Bytes { own: own as u64, shared: 0 }
    }

    fn calls(&self) -> Vec<Call> {
        vec![Call::ONE]
    }

    fn pass<'a>(&'a self, _: Call, question: Question, rays: &'a [Ray]) -> Box<dyn Pass + 'a> {
        let ray = |r: &Ray| {
            let direction = Vector3::from(r.direction);
            let ray = bvh::ray::Ray::new(Point3::from(r.origin), direction);
            OwnRay { ray, direction, length: direction.norm(), t_max: r.t_max }
        };
        let rays: Vec<OwnRay> = rays.iter().map(ray).collect();
        match question {
            Question::Closest => Box::new(Singles::new(rays, |ray| {
                let mut best = Answer::MISS;
                let mut t_max = ray.t_max;
                for shape in self.tree.nearest_traverse_iterator(&ray.ray, &self.shapes) {
                    let entry = ray.ray.intersection_slice_for_aabb(&shape.aabb());
                    if entry.is_some_and(|(entry, _)| entry > t_max * ray.length) {
                        continue;
                    }
                    if let Some(t) = shape.hit(&ray.ray.origin, &ray.direction, t_max) {
                        t_max = t;
                        best = Answer::hit(t, shape.prim);
                    }
                }
                best
            })),
            Question::Any => Box::new(Singles::new(rays, |ray| {
                let mut met = self.tree.traverse_iterator(&ray.ray, &self.shapes);
                let hit =
                    |shape: &Shape| shape.hit(&ray.ray.origin, &ray.direction, ray.t_max).is_some();
                Answer::any(met.any(hit))
            })),
        }
    }
}
