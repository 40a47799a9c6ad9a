//! What every answer is held against: rays that look for trouble, and brute force.

mod brute_force;
mod random;
mod rays;

pub use brute_force::BruteForce;
pub use random::Random;
pub use rays::{RayKind, rays};

use crate::geometry::Hit;
use crate::math::Ray;
use crate::scene::Scene;
use alloc::string::String;
use alloc::vec::Vec;

/// A question to which a scene gave another answer than the reference.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{query} of {ray:?}: expected {expected}, got {got}")]
pub struct Mismatch {
    /// The ray.
    pub ray: Ray,
    /// Which query: `closest`, `any`, `count` or `all`.
    pub query: &'static str,
    /// The reference's answer, in words.
    pub expected: String,
    /// The scene's answer, in words.
    pub got: String,
}

/// Asks the scene all four questions about the ray, and compares every bit with what follows from
/// `expected`, the ordered list of all hits.
///
/// # Errors
///
/// The first question that is answered differently.
pub fn check(scene: &Scene, ray: &Ray, expected: &[Hit]) -> Result<(), Mismatch> {
    use alloc::format;
    let differ = |query, expected, got| Err(Mismatch { ray: *ray, query, expected, got });
    let closest = scene.closest(ray);
    if !same(closest.as_ref(), expected.first()) {
        return differ("closest", format!("{:?}", expected.first()), format!("{closest:?}"));
    }
    let any = scene.any(ray);
    if any == expected.is_empty() {
        return differ("any", format!("{}", !any), format!("{any}"));
    }
    let count = scene.count(ray);
    if count != expected.len() as u64 {
        return differ("count", format!("{}", expected.len()), format!("{count}"));
    }
    let all = scene.all(ray);
    let equal = all.len() == expected.len()
        && all.iter().zip(expected).all(|(a, b)| same(Some(a), Some(b)));
    if !equal {
        return differ("all", format!("{expected:?}"), format!("{all:?}"));
    }
    Ok(())
}

/// Whether two answers have the same bits.
fn same(a: Option<&Hit>, b: Option<&Hit>) -> bool {
    let bits = |hit: &Hit| ([hit.t, hit.u, hit.v].map(f32::to_bits), hit.id());
    a.map(bits) == b.map(bits)
}

/// Checks many rays against a reference that lists all hits of a ray; returns the first mismatch in
/// the order of the rays.
///
/// The rays are shared out to all threads of the caller's rayon pool.
pub fn check_many(
    scene: &Scene,
    rays: &[Ray],
    reference: impl Fn(&Ray) -> Vec<Hit> + Sync + Send,
) -> Result<(), Mismatch> {
    /// Rays to a task: brute force takes long for each.
    const CHUNK: usize = 16;
    let chunks = crate::context::parallel::map_chunks(rays, CHUNK, |_, rays| {
        rays.iter().try_for_each(|ray| check(scene, ray, &reference(ray)))
    });
    chunks.into_iter().collect()
}
