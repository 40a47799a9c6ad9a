//! parry3d 0.31: a collision library's triangle mesh, with its default (binned) tree.
//!
//! It has no any-hit query; whether there is a hit is asked as for the closest.

use parry3d::math::Vector;
use parry3d::query::Ray as TheirRay;
use parry3d::shape::{CompositeShapeRef, TriMesh};
use treelet::Ray;

use super::singles::Singles;
use crate::engine::{Answer, Built, Bytes, Call, Engine, EngineError, Pass, Question, Triangles};

/// The engine.
#[derive(Debug)]
pub(super) struct Parry;

/// The name in reports.
pub(super) const NAME: &str = "parry";

/// Its one variant.
const VARIANT: &str = "TriMesh";

impl Engine for Parry {
    fn name(&self) -> &'static str {
        NAME
    }

    fn version(&self) -> String {
        "parry3d 0.31".to_owned()
    }

    fn variants(&self) -> Vec<String> {
        vec![VARIANT.to_owned()]
    }

    fn build(&self, _: &str, triangles: &Triangles) -> Result<Box<dyn Built>, EngineError> {
        let vertices = triangles.positions.iter().map(|&p| vector(p)).collect();
        let mesh = TriMesh::new(vertices, triangles.indices.to_vec());
        let mesh = mesh.map_err(|error| EngineError::Refused(format!("parry3d: {error}")))?;
        Ok(Box::new(Mesh(mesh)))
    }
}

fn vector([x, y, z]: [f32; 3]) -> Vector {
    Vector::new(x, y, z)
}

struct Mesh(TriMesh);

impl Built for Mesh {
    fn bytes(&self) -> Bytes {
        Bytes { own: self.0.total_memory_size() as u64, shared: 0 }
    }

    fn calls(&self) -> Vec<Call> {
        vec![Call::ONE]
    }

    fn pass<'a>(&'a self, _: Call, question: Question, rays: &'a [Ray]) -> Box<dyn Pass + 'a> {
        let ray = |r: &Ray| {
            let ray = TheirRay::new(vector(r.origin), vector(r.direction));
            (ray, r.t_max.min(f32::MAX))
        };
        let rays: Vec<(TheirRay, f32)> = rays.iter().map(ray).collect();
        Box::new(Singles::new(rays, move |(ray, t_max)| {
            match (CompositeShapeRef(&self.0).cast_local_ray(ray, *t_max, true), question) {
                (None, _) => Answer::MISS,
                (Some(_), Question::Any) => Answer::any(true),
                (Some((prim, t)), Question::Closest) => Answer::hit(t, prim),
            }
        }))
    }
}
