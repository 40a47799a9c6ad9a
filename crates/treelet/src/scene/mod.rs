//! Scenes: meshes and placed scenes, built once, asked from any thread.

mod assemble;
mod builder;
mod choice;
mod edit;
mod error;
mod gather;
mod improve;
mod moving;
mod open;
mod place;
mod quality;
mod recipe;
mod report;
mod slices;
mod travel;
mod upkeep;

pub use builder::{BuildOptions, Invalid, LayoutChoice, SceneBuilder};
pub use choice::{Candidate, Choice, Pilot};
pub use edit::{Action, Commit, DECAY_MAX, Edit, EditError, Parts, Policy, Reason};
pub use error::{InstanceDefect, SceneError, WrongLength};
pub use moving::SEGMENTS_MAX;
pub use quality::{Plan, Quality};
pub use recipe::{Recipe, RecipeError};
pub use report::{BuildReport, Skipped};
pub use slices::HitLists;

use crate::bounds::Aabb;
use crate::geometry::{Hit, Shape, shape};
use crate::math::{Affine, Ray};
use crate::query;
use crate::trace::Counters;
use crate::trace::structure::Structure;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// An immutable snapshot of geometry that answers rays.
///
/// Cheap to clone, `Send + Sync`; queries never lock. A scene holds meshes and other shapes, numbered as `geom`, and
/// instances of other scenes, nested to any depth.
///
/// Every answer is a pure function of the geometry and the ray: no builder, no number of threads
/// changes a bit of it. Of hits at the very same `t`, the smallest `(inst, geom, prim)` is the
/// answer.
///
/// ```
/// use treelet::{BuildOptions, Mesh, Ray, Scene};
///
/// let mesh = Mesh::new([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0, 1, 2]]);
/// let scene = Scene::builder().mesh(mesh).build(&BuildOptions::default())?;
/// let hit = scene.closest(&Ray::new([0.25, 0.25, -3.0], [0.0, 0.0, 2.0])).unwrap();
/// assert_eq!((hit.t, hit.prim), (1.5, 0));
/// # Ok::<(), treelet::SceneError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Scene {
    structure: Arc<Structure>,
    report: Arc<BuildReport>,
    /// What a scene of [`Quality::Auto`] remembers.
    auto: Option<Arc<improve::Auto>>,
    /// What keeping it up goes by.
    upkeep: Arc<upkeep::Upkeep>,
}

impl Scene {
    /// An empty description, to be filled and built.
    pub fn builder() -> SceneBuilder {
        SceneBuilder::default()
    }

    /// The hit that the ray meets first.
    ///
    /// `t` lies in `t_min ..= t_max`. An invalid ray (see [`Ray::is_valid`]) meets nothing.
    /// Cost: O(log n) for usual scenes.
    ///
    /// Source of the walk: T. Kay and J. Kajiya, "Ray Tracing Complex Scenes", SIGGRAPH 1986, with
    /// both child boxes tested at their parent.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        query::closest::closest(&self.structure, ray)
    }

    /// [`Scene::closest`], adding what the walk did to `counters`.
    pub fn closest_counted(&self, ray: &Ray, counters: &mut Counters) -> Option<Hit> {
        query::closest::counted(&self.structure, ray, counters)
    }

    /// Whether the ray meets anything: the cheaper question for shadows.
    pub fn any(&self, ray: &Ray) -> bool {
        query::any::any(&self.structure, ray)
    }

    /// [`Scene::any`], adding what the walk did to `counters`.
    pub fn any_counted(&self, ray: &Ray, counters: &mut Counters) -> bool {
        query::any::counted(&self.structure, ray, counters)
    }

    /// The first hit of the ray that `accept` accepts: what alpha cut-outs ask.
    ///
    /// `accept` must be a pure function of the hit; how often and in which order it is asked is not
    /// promised. The answer is the first of [`Scene::all`] that it accepts. Costs a call for each
    /// hit that is looked at, and the walk goes on past those that are refused.
    ///
    /// ```
    /// use treelet::{BuildOptions, Mesh, Ray, Scene};
    ///
    /// let mesh = Mesh::new(
    ///     [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]],
    ///     [[0, 1, 2], [3, 4, 5]],
    /// );
    /// let scene = Scene::builder().mesh(mesh).build(&BuildOptions::default())?;
    /// let ray = Ray::new([0.25, 0.25, -3.0], [0.0, 0.0, 1.0]);
    /// let hit = scene.closest_filtered(&ray, |hit| hit.prim != 0).unwrap();
    /// assert_eq!((hit.prim, hit.t), (1, 4.0));
    /// assert!(!scene.any_filtered(&ray, |hit| hit.prim > 1));
    /// # Ok::<(), treelet::SceneError>(())
    /// ```
    pub fn closest_filtered(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> Option<Hit> {
        query::filtered::closest(&self.structure, ray, &accept)
    }

    /// Whether the ray meets anything that `accept` accepts: shadows of alpha cut-outs. See
    /// [`Scene::closest_filtered`].
    pub fn any_filtered(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> bool {
        query::filtered::any(&self.structure, ray, &accept)
    }

    /// How many triangles, and primitives of other kinds, the ray meets: the length of [`Scene::all`].
    pub fn count(&self, ray: &Ray) -> u64 {
        query::count::count(&self.structure, ray)
    }

    /// Every primitive that the ray meets, once, ordered by `t`, then by id.
    ///
    /// The first one is [`Scene::closest`]. A ray through an edge or a corner meets every triangle
    /// that has it.
    pub fn all(&self, ray: &Ray) -> Vec<Hit> {
        let mut hits = Vec::new();
        query::all::all(&self.structure, ray, &mut hits);
        hits
    }

    /// The box around everything, in the scene's own space; empty if nothing is in it.
    ///
    /// Exact for meshes, conservative for instances.
    pub fn bounds(&self) -> Aabb {
        self.structure.bounds
    }

    /// What building this scene found and made; scenes inside instances have their own.
    pub fn report(&self) -> &BuildReport {
        &self.report
    }

    /// Meshes and other shapes, in the order of `geom`.
    pub fn shapes(&self) -> impl ExactSizeIterator<Item = &Shape> {
        self.structure.geometries.iter().map(|geometry| &geometry.shape)
    }

    /// Whether both are the same snapshot, not merely equal.
    pub fn is_same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.structure, &other.structure)
    }

    /// Whether anything in this scene moves with time: meshes, instances, or what is in those.
    pub fn is_moving(&self) -> bool {
        self.structure.moves
    }

    /// Parts of the time for which this scene has trees of its own, where instances move; 1 if it has one for all.
    pub fn spans(&self) -> usize {
        self.structure.spans.len().max(1)
    }

    /// Segments of time, and so trees, of each mesh that moves, with its `geom`.
    pub fn segments(&self) -> impl ExactSizeIterator<Item = (usize, usize)> {
        self.structure.moving.iter().map(|mesh| (mesh.geom, mesh.segments()))
    }

    /// How many instances are directly in this scene.
    pub fn instances(&self) -> usize {
        self.structure.instances.len()
    }

    /// How many values `Hit::inst` can take: this scene's own level and all paths into instances.
    pub fn paths(&self) -> u64 {
        self.structure.paths
    }

    /// The instances on the way to `inst`, outermost first, as indices in the order in which each
    /// level was built; empty for this scene's own meshes. `None` if there is no such path.
    pub fn path(&self, inst: u64) -> Option<Vec<usize>> {
        let mut path = Vec::new();
        self.descend(inst, 0.0, |index, _| path.push(index))?;
        Some(path)
    }

    /// The map from the innermost object of `inst` to this scene: the product of the instances' own
    /// maps, in f64, rounded once a level. `None` if there is no such path. At time 0: see
    /// [`Scene::world_from_object_at`].
    pub fn world_from_object(&self, inst: u64) -> Option<Affine> {
        self.world_from_object_at(inst, 0.0)
    }

    /// The same at a time in `0 ..= 1`.
    pub fn world_from_object_at(&self, inst: u64, time: f32) -> Option<Affine> {
        let mut map = Affine::IDENTITY;
        self.descend(inst, time, |_, world_from_object| map = map.then_from(world_from_object))?;
        Some(map)
    }

    /// The corners of the triangle that was hit, in the space of its object; `None` if the hit is
    /// not one of this scene, or no triangle was hit. At time 0: see [`Scene::corners_at`].
    pub fn corners(&self, hit: &Hit) -> Option<[[f32; 3]; 3]> {
        self.corners_at(hit, 0.0)
    }

    /// The same at a time in `0 ..= 1`.
    pub fn corners_at(&self, hit: &Hit, time: f32) -> Option<[[f32; 3]; 3]> {
        let level = self.descend(hit.inst, time, |_, _| ())?;
        level.geometries.get(hit.geom as usize)?.mesh()?.corners_at(hit.prim as usize, time)
    }

    /// The unit normal of what `ray` hit, in this scene's space: of a triangle or a quad it points to the side
    /// from which the corners run counter-clockwise, of a disc where its own does, of a sphere or a curve outward. `None` if the
    /// hit is not one of this scene, or there is no normal: a degenerate triangle has none.
    pub fn normal(&self, ray: &Ray, hit: &Hit) -> Option<[f32; 3]> {
        let level = self.descend(hit.inst, ray.time, |_, _| ())?;
        let shape = &level.geometries.get(hit.geom as usize)?.shape;
        let map = self.world_from_object_at(hit.inst, ray.time)?;
        let inverse = map.inverse_f64()?;
        // The point, in the space of the object.
        let world =
            shape::along(shape::wide(ray.origin), f64::from(hit.t), shape::wide(ray.direction));
        let point = inverse.map(|[x, y, z, w]| shape::dot([x, y, z], world) + w);
        let upright = shape.upright(hit.prim as usize, [hit.u, hit.v], point, ray.time)?;
        // What stands on a surface goes through the transposed inverse.
        let column = |axis: usize| inverse.map(|row| row[axis]);
        let normal = [0, 1, 2].map(|axis| shape::dot(column(axis), upright));
        let length = libm::sqrt(shape::dot(normal, normal));
        (length > 0.0 && length.is_finite()).then(|| normal.map(|x| (x / length) as f32))
    }

    /// Bytes that queries read: nodes, packed triangles, instances; this level and, once each, the
    /// levels inside.
    pub fn trace_bytes(&self) -> u64 {
        self.levels().iter().map(|level| assemble::level_bytes(level)).sum()
    }

    /// This level and every level inside, each once.
    pub(crate) fn levels(&self) -> Vec<&Structure> {
        let mut levels: Vec<&Structure> = alloc::vec![&*self.structure];
        let mut seen = alloc::collections::BTreeSet::new();
        let mut at = 0;
        while at < levels.len() {
            let level = levels[at];
            for instance in level.instances.iter() {
                if seen.insert(Arc::as_ptr(&instance.structure)) {
                    levels.push(&instance.structure);
                }
            }
            at += 1;
        }
        levels
    }

    /// A triangle on the level of `inst`, chosen by two random numbers, or one across the box of another
    /// primitive; `None` if the level has none.
    pub(crate) fn pick_triangle(&self, inst: u64, geom: u64, prim: u64) -> Option<[[f32; 3]; 3]> {
        let level = self.descend(inst, 0.0, |_, _| ())?;
        let geom = geom.checked_rem(level.geometries.len() as u64)?;
        let shape = &level.geometries[geom as usize].shape;
        let prim = prim.checked_rem(shape.len() as u64)? as usize;
        if shape.defect(prim).is_some() {
            return None;
        }
        let Some(mesh) = shape.mesh() else {
            let Aabb { lo, hi } = shape.bounds(prim);
            return Some([lo, [hi[0], lo[1], hi[2]], hi]);
        };
        mesh.corners(prim)
    }

    pub(crate) fn structure(&self) -> &Structure {
        &self.structure
    }

    /// Walks down to the level of `inst`, showing each instance on the way, with its map of a
    /// time.
    fn descend(
        &self,
        inst: u64,
        time: f32,
        mut show: impl FnMut(usize, &Affine),
    ) -> Option<&Structure> {
        let mut level = &*self.structure;
        if inst >= level.paths {
            return None;
        }
        let mut rest = inst;
        while rest > 0 {
            // Ranks rise, the first being 1: the last instance whose rank is not above `rest`.
            let (index, instance) = level.instances.of_rank(rest)?;
            match &instance.motion {
                None => show(index, &instance.world_from_object),
                Some(motion) => show(index, &motion.world_from_object(time)),
            }
            rest -= instance.rank;
            level = &instance.structure;
        }
        Some(level)
    }
}
