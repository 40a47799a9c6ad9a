//! What a walk walks: one level of a scene, with the levels that its instances lead to.

use super::slack::Slack;
use crate::bounds::Aabb;
use crate::geometry::Mesh;
use crate::layout::binary::Binary;
use crate::math::Affine;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// A triangle as leaves store it: corners and names, 44 bytes.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(crate) struct PackedTriangle {
    pub(crate) corners: [[f32; 3]; 3],
    pub(crate) geom: u32,
    pub(crate) prim: u32,
}

/// Another level, placed into this one.
#[derive(Debug)]
pub(crate) struct Instance {
    /// What is placed.
    pub(crate) structure: Arc<Structure>,
    /// As the caller gave it.
    pub(crate) world_from_object: Affine,
    /// As rays are transformed.
    pub(crate) object_from_world: Affine,
    /// Around what is placed, in this level's space, widened as `slack` says; empty if there is
    /// nothing in it.
    pub(crate) bounds: Aabb,
    /// What this instance adds to the rank of the path that leads to this level.
    pub(crate) rank: u64,
    pub(crate) mask: u32,
}

/// A mesh of a level.
#[derive(Debug)]
pub(crate) struct Geometry {
    pub(crate) mesh: Mesh,
    pub(crate) mask: u32,
}

/// One level: a tree whose leaves hold triangles and instances.
pub(crate) struct Structure {
    pub(crate) geometries: Vec<Geometry>,
    /// In the caller's order.
    pub(crate) instances: Vec<Instance>,
    pub(crate) layout: Binary,
    /// In the order of the leaves.
    pub(crate) triangles: Vec<PackedTriangle>,
    /// Indices of instances, in the order of the leaves.
    pub(crate) leaf_instances: Vec<u32>,
    /// A few boxes that together contain everything: tighter than one when they are transformed.
    pub(crate) cover: Vec<Aabb>,
    /// Contains everything, and the images of the reaches of all instances.
    pub(crate) reach: Aabb,
    pub(crate) slack: Slack,
    /// Whether a primitive, here or in an instance, lies in several leaves.
    pub(crate) repeats: bool,
    /// Instance paths, this level's empty path included.
    pub(crate) paths: u64,
}

/// Numbers only: levels inside may be nested too deeply, and too many, to be written out.
impl core::fmt::Debug for Structure {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Structure")
            .field("geometries", &self.geometries.len())
            .field("triangles", &self.triangles.len())
            .field("instances", &self.instances.len())
            .field("paths", &self.paths)
            .field("bounds", &self.layout.bounds)
            .finish()
    }
}

/// Frees level by level: scenes may be nested more deeply than the machine's stack is.
impl Drop for Structure {
    fn drop(&mut self) {
        let mut pending: Vec<_> = self.instances.drain(..).map(|i| i.structure).collect();
        while let Some(structure) = pending.pop() {
            if let Some(mut structure) = Arc::into_inner(structure) {
                pending.extend(structure.instances.drain(..).map(|i| i.structure));
            }
        }
    }
}
