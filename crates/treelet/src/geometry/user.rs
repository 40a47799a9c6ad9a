//! Primitives of the caller's own: boxes, and code that says where a ray meets what is inside.

use super::shape::Local;
use super::triangle::Meeting;
use crate::bounds::Aabb;
use crate::math::Ray;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::fmt;

/// What a scene asks of primitives that it knows nothing of.
///
/// All answers must be pure functions of what is given: how often, in which order and from which thread they are asked
/// is not promised.
pub trait Primitives: Send + Sync {
    /// How many there are. Asked once.
    fn len(&self) -> usize;

    /// Whether there is none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The box around a primitive. Asked once.
    fn bounds(&self, prim: usize) -> Aabb;

    /// Where the ray, in the space of the primitives, first meets one of them within `t_min ..= t_max`. What lies
    /// elsewhere, or outside the primitive's box, is discarded: the tree must not show.
    fn hit(&self, prim: usize, ray: &Ray) -> Option<Meeting>;

    /// A vector that stands on the surface of a primitive at a point of it, of any length; where
    /// [`Scene::normal`](crate::Scene::normal) comes from.
    fn normal(&self, _prim: usize, _point: [f32; 3]) -> Option<[f32; 3]> {
        None
    }
}

/// Primitives that the caller's own code answers for.
///
/// ```
/// use treelet::geometry::{Meeting, Primitives, User};
/// use treelet::{Aabb, BuildOptions, Ray, Scene};
///
/// /// Cubes of side 1 that only rays along z meet.
/// struct Posts(Vec<[f32; 3]>);
///
/// impl Primitives for Posts {
///     fn len(&self) -> usize {
///         self.0.len()
///     }
///     fn bounds(&self, prim: usize) -> Aabb {
///         let lo = self.0[prim];
///         Aabb { lo, hi: lo.map(|x| x + 1.0) }
///     }
///     fn hit(&self, prim: usize, ray: &Ray) -> Option<Meeting> {
///         let t = (self.0[prim][2] - ray.origin[2]) / ray.direction[2];
///         (ray.direction[0] == 0.0).then_some(Meeting { t, u: 0.0, v: 0.0 })
///     }
/// }
///
/// let posts = User::new(Posts(vec![[0.0; 3], [5.0, 0.0, 0.0]]));
/// let scene = Scene::builder().shape(posts).build(&BuildOptions::default())?;
/// let hit = scene.closest(&Ray::new([5.5, 0.5, -2.0], [0.0, 0.0, 1.0])).unwrap();
/// assert_eq!((hit.prim, hit.t), (1, 2.0));
/// # Ok::<(), treelet::SceneError>(())
/// ```
#[derive(Clone)]
pub struct User {
    primitives: Arc<dyn Primitives>,
    bounds: Arc<[Aabb]>,
}

impl User {
    /// Asks for all boxes, and keeps them: 24 bytes each.
    pub fn new(primitives: impl Primitives + 'static) -> Self {
        let bounds = (0..primitives.len()).map(|prim| primitives.bounds(prim)).collect::<Vec<_>>();
        Self { primitives: Arc::new(primitives), bounds: bounds.into() }
    }

    pub(super) fn len(&self) -> usize {
        self.bounds.len()
    }

    pub(super) fn is_same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.bounds, &other.bounds)
    }

    pub(super) fn bounds(&self, prim: usize) -> Option<Aabb> {
        self.bounds.get(prim).copied()
    }

    pub(super) fn meet(&self, prim: usize, local: &Local<'_>) -> Option<Meeting> {
        let bounds = self.bounds.get(prim)?;
        local.accept(self.primitives.hit(prim, &local.ray)?, bounds)
    }

    pub(super) fn upright(&self, prim: usize, point: [f64; 3]) -> Option<[f64; 3]> {
        let normal = self.primitives.normal(prim, point.map(|x| x as f32))?;
        Some(normal.map(f64::from))
    }
}

impl fmt::Debug for User {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("User").field("len", &self.len()).finish_non_exhaustive()
    }
}
