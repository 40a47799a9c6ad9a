//! Brute force behind the scene's names, until the real scene is there. To be deleted.
#![allow(missing_docs, reason = "temporary")]
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use treelet::math::vec3;
use treelet::{Hit, Ray};
use treelet_model::Model;

#[derive(Clone, Debug, Default)]
pub struct Cancel(Arc<AtomicBool>);
impl Cancel {
    pub fn new() -> Self {
        Self::default()
    }
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed)
    }
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
#[derive(Clone, Copy, Debug, Default)]
pub struct Counters {
    pub nodes: u64,
    pub triangles: u64,
}
#[derive(Clone, Debug)]
pub struct Scene {
    model: Model,
}
#[derive(Clone, Debug)]
pub struct PlacedModel {
    pub scene: Scene,
}
#[derive(Clone, Debug, Default)]
pub struct BuildOptions;
impl PlacedModel {
    pub fn build(model: &Model, _: &BuildOptions) -> Result<Self, String> {
        Ok(Self { scene: Scene { model: model.clone() } })
    }
    pub fn placement(&self, hit: &Hit) -> usize {
        hit.inst as usize
    }
}
impl Scene {
    pub fn bounds(&self) -> treelet::bounds::Aabb {
        let mut b = treelet::bounds::Aabb::EMPTY;
        for pl in &self.model.placements {
            for part in &self.model.objects[pl.object].parts {
                for p in part.mesh.positions() {
                    let q = pl.world_from_object.point(*p);
                    b = b.union(&treelet::bounds::Aabb { lo: q, hi: q });
                }
            }
        }
        b
    }
    pub fn closest_counted(&self, ray: &Ray, c: &mut Counters) -> Option<Hit> {
        c.nodes += 1;
        c.triangles += 3;
        self.closest(ray)
    }
    pub fn any(&self, ray: &Ray) -> bool {
        self.closest(ray).is_some()
    }
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        for (inst, pl) in self.model.placements.iter().enumerate() {
            let inv = pl.world_from_object.inverse()?;
            let r =
                Ray { origin: inv.point(ray.origin), direction: inv.vector(ray.direction), ..*ray };
            for (geom, part) in self.model.objects[pl.object].parts.iter().enumerate() {
                for prim in 0..part.mesh.triangles().len() {
                    let [a, b, c] = part.mesh.corners(prim)?;
                    let (e1, e2) = (vec3::sub(b, a), vec3::sub(c, a));
                    let p = vec3::cross(r.direction, e2);
                    let det = vec3::dot(e1, p);
                    let s = vec3::sub(r.origin, a);
                    let u = vec3::dot(s, p) / det;
                    let q = vec3::cross(s, e1);
                    let v = vec3::dot(r.direction, q) / det;
                    let t = vec3::dot(e2, q) / det;
                    if u >= 0.0
                        && v >= 0.0
                        && u + v <= 1.0
                        && t >= r.t_min
                        && t <= best.map_or(r.t_max, |h| h.t)
                    {
                        best = Some(Hit {
                            t,
                            u,
                            v,
                            prim: prim as u32,
                            geom: geom as u32,
                            inst: inst as u64,
                        });
                    }
                }
            }
        }
        best
    }
}
