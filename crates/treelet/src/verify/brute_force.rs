//! The definition of every answer: test each primitive, visit no tree, look at no box but the
//! primitive's own and those of the instances on the way to it, all as they are at the ray's time.
//!
//! Cost: about 2 ns a triangle and ray on one core. Blocks of triangles are sheared and tested side
//! by side, written so that the compiler can use SIMD; whatever that does not certainly reject goes
//! through the one function that decides, [`TriangleRay::hit`].
//!
//! [`TriangleRay::hit`]: crate::geometry::TriangleRay::hit

use crate::bounds::Interval;
use crate::geometry::{Hit, Meeting, TriangleRay};
use crate::math::Ray;
use crate::scene::Scene;
use crate::simd::Scalar;
use crate::trace::prepared::Prepared;
use crate::trace::structure::{Geometry, Structure};
use alloc::collections::BTreeMap;
use alloc::vec::Vec;

/// Triangles to a block.
const LANES: usize = 16;

/// A scene without its trees.
pub struct BruteForce<'a> {
    scene: &'a Scene,
    /// By address of a level: its primitives, straight from its geometries.
    levels: BTreeMap<usize, Content>,
}

/// What is on a level.
struct Content {
    triangles: Vec<Block>,
    /// `(geom, prim)` of what is no triangle, or moves.
    others: Vec<(u32, u32)>,
}

/// Some triangles of one level, side by side.
struct Block {
    /// `[corner][axis][lane]`; unused lanes repeat the last triangle.
    corners: [[[f32; LANES]; 3]; 3],
    /// `(geom, prim)` of the lanes in use.
    names: Vec<(u32, u32)>,
}

impl core::fmt::Debug for BruteForce<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("BruteForce").field("levels", &self.levels.len()).finish()
    }
}

impl<'a> BruteForce<'a> {
    /// Gathers every triangle without defect of every level. Copies them: 44 bytes each.
    pub fn new(scene: &'a Scene) -> Self {
        let levels = scene.levels();
        let levels = levels.iter().map(|level| (address(level), Content::new(level))).collect();
        Self { scene, levels }
    }

    /// Triangle tests that one ray costs at most; `u64::MAX` if more.
    pub fn tests_per_ray(&self) -> u64 {
        // Levels are met once for every path that leads to them. What a level costs is known once
        // everything inside it is: it stays on the stack until then.
        let mut costs: BTreeMap<usize, u64> = BTreeMap::new();
        let mut open = alloc::vec![self.scene.structure()];
        while let Some(&level) = open.last() {
            let inner = level.instances.iter().map(|instance| &*instance.structure);
            let waiting = open.len();
            open.extend(inner.clone().filter(|inner| !costs.contains_key(&address(inner))));
            if open.len() > waiting {
                continue;
            }
            let own = self.levels[&address(level)].len();
            let inside = inner.map(|inner| costs[&address(inner)]);
            let cost = inside.fold(own, u64::saturating_add);
            costs.insert(address(level), cost);
            open.pop();
        }
        costs[&address(self.scene.structure())]
    }

    /// Every hit of the ray, ordered by `(t, inst, geom, prim)`: what `Scene::all` must give.
    pub fn all(&self, ray: &Ray) -> Vec<Hit> {
        let mut hits = Vec::new();
        let structure = self.scene.structure();
        let prepared = Prepared::new(Scalar, ray, structure).filter(|_| ray.is_valid());
        let mut open: Vec<_> =
            prepared.into_iter().map(|prepared| (structure, prepared, 0_u64)).collect();
        while let Some((level, prepared, inst)) = open.pop() {
            self.test_level(level, &prepared, ray, inst, &mut hits);
            for instance in level.instances.iter() {
                if instance.mask & ray.mask == 0 || instance.bounds().is_empty() {
                    continue;
                }
                let bounds = match &instance.motion {
                    None => instance.bounds(),
                    Some(motion) => motion.bounds(ray.time),
                };
                let clip = prepared.slab.interval(&bounds).intersection(&prepared.clip);
                if clip.is_empty() {
                    continue;
                }
                let inner = &*instance.structure;
                let columns = match &instance.motion {
                    None => Some(instance.columns),
                    Some(motion) => motion.columns(ray.time),
                };
                let Some(columns) = columns else { continue };
                let mut entered = Prepared::BLANK;
                if prepared.enter(Scalar, &columns, inner, &mut entered) {
                    entered.clip = clip;
                    open.push((inner, entered, inst + instance.rank));
                }
            }
        }
        hits.sort_unstable_by(Hit::cmp_along_ray);
        hits
    }

    fn test_level(
        &self,
        level: &Structure,
        prepared: &Prepared,
        ray: &Ray,
        inst: u64,
        hits: &mut Vec<Hit>,
    ) {
        let range = Interval { entry: ray.t_min, exit: ray.t_max };
        for &(geom, prim) in &self.levels[&address(level)].others {
            let Geometry { shape, mask } = &level.geometries[geom as usize];
            if mask & ray.mask == 0 {
                continue;
            }
            if let Some(Meeting { t, u, v }) = shape.meet(prim as usize, &prepared.local(ray)) {
                hits.push(Hit { t, u, v, prim, geom, inst });
            }
        }
        for block in &self.levels[&address(level)].triangles {
            let undecided = block.undecided(&prepared.triangle);
            for (lane, &(geom, prim)) in block.names.iter().enumerate() {
                if !undecided[lane] || level.geometries[geom as usize].mask & ray.mask == 0 {
                    continue;
                }
                let corners = block.triangle(lane);
                let Prepared { triangle, slab, clip, .. } = prepared;
                if let Some(meeting) = triangle.hit(&corners, slab, clip, &range) {
                    let (t, u, v) = (meeting.t, meeting.u, meeting.v);
                    hits.push(Hit { t, u, v, prim, geom, inst });
                }
            }
        }
    }
}

/// What tells levels apart.
fn address(level: &Structure) -> usize {
    core::ptr::from_ref(level) as usize
}

/// A triangle and its `(geom, prim)`.
struct Named {
    corners: [[f32; 3]; 3],
    name: (u32, u32),
}

impl Content {
    fn new(level: &Structure) -> Self {
        let (mut triangles, mut others) = (Vec::new(), Vec::new());
        for (Geometry { shape, .. }, geom) in level.geometries.iter().zip(0..) {
            for prim in (0..shape.len()).filter(|&prim| shape.defect(prim).is_none()) {
                let name = (geom, prim as u32);
                match shape.mesh() {
                    Some(mesh) if !mesh.is_moving() => {
                        triangles.extend(mesh.corners(prim).map(|corners| Named { corners, name }));
                    }
                    _ => others.push(name),
                }
            }
        }
        Self { triangles: triangles.chunks(LANES).map(Block::new).collect(), others }
    }

    /// Tests that a ray costs.
    fn len(&self) -> u64 {
        let triangles: usize = self.triangles.iter().map(|block| block.names.len()).sum();
        (triangles + self.others.len()) as u64
    }
}

impl Block {
    /// Of at least one triangle.
    fn new(triangles: &[Named]) -> Self {
        let lane = |lane: usize| triangles[lane.min(triangles.len() - 1)].corners;
        Self {
            corners: core::array::from_fn(|corner| {
                core::array::from_fn(|axis| core::array::from_fn(|l| lane(l)[corner][axis]))
            }),
            names: triangles.iter().map(|triangle| triangle.name).collect(),
        }
    }

    fn triangle(&self, lane: usize) -> [[f32; 3]; 3] {
        self.corners.map(|corner| corner.map(|axis| axis[lane]))
    }

    /// Which lanes the f32 edge functions do not certainly reject: the same sums, in the same
    /// order, as [`TriangleRay::hit`] makes.
    fn undecided(&self, ray: &TriangleRay) -> [bool; LANES] {
        let [a, b, c] = [0, 1, 2].map(|corner| self.shear(corner, ray));
        core::array::from_fn(|l| {
            let u = c.0[l] * b.1[l] - c.1[l] * b.0[l];
            let v = a.0[l] * c.1[l] - a.1[l] * c.0[l];
            let w = b.0[l] * a.1[l] - b.1[l] * a.0[l];
            let negative = (u < 0.0) | (v < 0.0) | (w < 0.0);
            let positive = (u > 0.0) | (v > 0.0) | (w > 0.0);
            !(negative & positive)
        })
    }

    fn shear(&self, corner: usize, ray: &TriangleRay) -> ([f32; LANES], [f32; LANES]) {
        let ([x, y, z], origin, shear) = ray.parts();
        let corner = &self.corners[corner];
        let moved_z: [f32; LANES] = corner[z].map(|c| c - origin[2]);
        let sheared = |axis: usize, origin: f32, share: f32| {
            core::array::from_fn(|l| (corner[axis][l] - origin) - share * moved_z[l])
        };
        (sheared(x, origin[0], shear[0]), sheared(y, origin[1], shear[1]))
    }
}
