//! obvhs 0.4: compressed 8-wide trees over PLOC with reinsertion.
//!
//! Set up as its examples do for speed: triangles in the tree's order, prepared for tracing. In
//! earlier measurements its 8-wide layout beat its binary one on all but primary rays, and `slow`
//! was the best of its presets on interiors.

use std::time::Duration;

use obvhs::BvhBuildParams;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::RayHit;
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;
use treelet::Ray;

use super::singles::Singles;
use crate::engine::{Answer, Built, Bytes, Call, Engine, EngineError, Pass, Question, Triangles};

/// The engine.
#[derive(Debug)]
pub(super) struct Obvhs;

/// The name in reports.
pub(super) const NAME: &str = "obvhs";

/// A preset by name.
type Preset = (&'static str, fn() -> BvhBuildParams);

/// Its presets.
const PRESETS: [Preset; 4] = [
    ("fastest", BvhBuildParams::fastest_build),
    ("medium", BvhBuildParams::medium_build),
    ("slow", BvhBuildParams::slow_build),
    ("very_slow", BvhBuildParams::very_slow_build),
];

impl Engine for Obvhs {
    fn name(&self) -> &'static str {
        NAME
    }

    fn version(&self) -> String {
        "0.4, 8-wide compressed".to_owned()
    }

    fn variants(&self) -> Vec<String> {
        PRESETS.iter().map(|(name, _)| (*name).to_owned()).collect()
    }

    fn usual_variants(&self) -> Vec<String> {
        PRESETS[..3].iter().map(|(name, _)| (*name).to_owned()).collect()
    }

    fn build(&self, variant: &str, triangles: &Triangles) -> Result<Box<dyn Built>, EngineError> {
        let preset = PRESETS.iter().find(|(name, _)| *name == variant);
        let (_, preset) = preset
            .ok_or_else(|| EngineError::Missing(format!("obvhs has no preset `{variant}`")))?;
        let theirs: Vec<Triangle> = (0..triangles.len())
            .map(|prim| {
                let [v0, v1, v2] = triangles.corners(prim).map(Into::into);
                Triangle { v0, v1, v2 }
            })
            .collect();
        let tree = build_cwbvh_from_tris(&theirs, preset(), &mut Duration::default());
        let in_order = tree.primitive_indices.iter();
        let prepared = in_order.map(|&prim| RtTriangle::from(&theirs[prim as usize])).collect();
        Ok(Box::new(Tree { tree, prepared }))
    }
}

struct Tree {
    tree: CwBvh,
    /// In the tree's order.
    prepared: Vec<RtTriangle>,
}

impl Built for Tree {
    fn bytes(&self) -> Bytes {
        let own = size_of_val(&*self.tree.nodes)
            + size_of_val(&*self.tree.primitive_indices)
            + size_of_val(&*self.prepared);
        Bytes { own: own as u64, shared: 0 }
    }

    fn calls(&self) -> Vec<Call> {
        vec![Call::ONE]
    }

    fn pass<'a>(&'a self, _: Call, question: Question, rays: &'a [Ray]) -> Box<dyn Pass + 'a> {
        let ray =
            |r: &Ray| obvhs::ray::Ray::new(r.origin.into(), r.direction.into(), r.t_min, r.t_max);
        let rays: Vec<obvhs::ray::Ray> = rays.iter().map(ray).collect();
        match question {
            Question::Closest => Box::new(Singles::new(rays, |ray| {
                let mut hit = RayHit::none();
                let prepared = |ray: &obvhs::ray::Ray, id: usize| self.prepared[id].intersect(ray);
                if self.tree.ray_traverse(*ray, &mut hit, prepared) {
                    let prim = self.tree.primitive_indices[hit.primitive_id as usize];
                    Answer::hit(hit.t, prim)
                } else {
                    Answer::MISS
                }
            })),
            Question::Any => Box::new(Singles::new(rays, |ray| {
                let prepared = |ray: &obvhs::ray::Ray, id: usize| self.prepared[id].intersect(ray);
                Answer::any(!self.tree.ray_traverse_miss(*ray, prepared))
            })),
        }
    }
}
