//! What a walk walks: one level of a scene, with the levels that its instances lead to.

use super::moving::MovingMesh;
use super::placements::Instances;
use super::slack::Slack;
use crate::bounds::{Aabb, Cover};
use crate::geometry::shape::Local;
use crate::geometry::{Meeting, Mesh, Shape};
use crate::layout::compact::Compact;
use crate::layout::packing::Packing;
use crate::layout::wide::{Child, Plain, Wide};
use crate::simd::Checked;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// The packed tree of a level.
#[derive(Debug)]
pub(crate) enum Layout {
    Wide8(Wide<8>),
    Wide16(Wide<16>),
    Compact(Wide<16, Compact>),
}

/// The layout as the walk of one packing and width sees it.
pub(crate) trait Get<K: Packing<W>, const W: usize> {
    /// `None` if the layout is another one.
    fn get(&self) -> Option<&Wide<W, K>>;
}

macro_rules! get {
    ($($name:ident: $packing:ident $width:literal)*) => {
        $(impl Get<$packing, $width> for Layout {
            #[inline(always)]
            fn get(&self) -> Option<&Wide<$width, $packing>> {
                if let Self::$name(wide) = self { Some(wide) } else { None }
            }
        })*
    };
}

get! { Wide8: Plain 8 Wide16: Plain 16 Compact: Compact 16 }

impl Layout {
    /// A bit for each layout.
    pub(crate) fn bit(&self) -> u8 {
        match self {
            Self::Wide8(_) => 1,
            Self::Wide16(_) => 2,
            Self::Compact(_) => 4,
        }
    }

    /// Whether a walk can go from one to the other.
    pub(crate) fn is_as(&self, other: &Self) -> bool {
        core::mem::discriminant(self) == core::mem::discriminant(other)
    }

    /// Where a walk begins.
    pub(crate) fn root(&self) -> Child {
        match self {
            Self::Wide8(wide) => wide.root,
            Self::Wide16(wide) => wide.root,
            Self::Compact(wide) => wide.root,
        }
    }

    /// The children of a node and their boxes; none of a leaf.
    pub(crate) fn below(&self, child: Child) -> Vec<(Child, Aabb)> {
        match self {
            Self::Wide8(wide) => wide.below(child),
            Self::Wide16(wide) => wide.below(child),
            Self::Compact(wide) => wide.below(child),
        }
    }

    /// Bytes that walks read.
    pub(crate) fn bytes(&self) -> usize {
        match self {
            Self::Wide8(wide) => wide.bytes(),
            Self::Wide16(wide) => wide.bytes(),
            Self::Compact(wide) => wide.bytes(),
        }
    }
}

/// A mesh of a level, or primitives of another kind.
#[derive(Clone, Debug)]
pub(crate) struct Geometry {
    pub(crate) shape: Shape,
    pub(crate) mask: u32,
}

impl Geometry {
    pub(crate) fn mesh(&self) -> Option<&Mesh> {
        self.shape.mesh()
    }
}

/// The geometry and the primitive in it that an id names, by the first id of each geometry.
#[inline]
pub(crate) fn name(first_ids: &[u32], id: u32) -> (u32, u32) {
    let geom = match first_ids {
        [] | [_] => 0,
        firsts => firsts.partition_point(|&first| first <= id).saturating_sub(1),
    };
    (geom as u32, id - first_ids.get(geom).copied().unwrap_or(0))
}

/// One level: a tree whose leaves hold triangles, an instance, or a primitive of another kind.
pub(crate) struct Structure {
    /// The instructions that walk it.
    pub(crate) level: Checked,
    pub(crate) geometries: Vec<Geometry>,
    /// For each geometry, the id of its first primitive: ids number the primitives of all of them.
    pub(crate) first_ids: Vec<u32>,
    /// Whether there are triangles only.
    pub(crate) flat: bool,
    /// Whether every ray sees all geometries.
    pub(crate) unmasked: bool,
    /// In the caller's order.
    pub(crate) instances: Instances,
    /// The meshes that move, in the order of their ids.
    pub(crate) moving: Vec<MovingMesh>,
    /// Whether anything moves, here or in an instance.
    pub(crate) moves: bool,
    pub(crate) layout: Layout,
    /// Where instances move, perhaps a tree for each of equal parts of the time, a power of two of them, to be walked
    /// instead.
    pub(crate) spans: Vec<Layout>,
    /// Around everything.
    pub(crate) bounds: Aabb,
    /// The length of its diagonal.
    pub(crate) diagonal: f32,
    /// A few boxes that together contain everything.
    pub(crate) cover: Cover,
    /// Contains everything, and the images of the reaches of all instances.
    pub(crate) reach: Aabb,
    /// `reach` alone, to be transformed.
    pub(crate) reach_cover: Cover,
    /// `reach` as lanes: `x, y, z, z` of both corners.
    pub(crate) reach_lanes: [[f32; 4]; 2],
    /// Whether rays may be [`Ordinary`](crate::geometry::triangle::Ordinary) here.
    pub(crate) ordinary: bool,
    pub(crate) slack: Slack,
    /// Whether a primitive, here or in an instance, lies in several leaves.
    pub(crate) repeats: bool,
    /// Instance paths, this level's empty path included.
    pub(crate) paths: u64,
    /// Around the meshes.
    pub(crate) around_meshes: Aabb,
}

impl Structure {
    /// The geometry and the primitive in it that an id names.
    #[inline]
    pub(crate) fn name(&self, id: u32) -> (u32, u32) {
        name(&self.first_ids, id)
    }

    /// Whether a ray with this mask sees the primitive.
    #[inline(always)]
    pub(crate) fn sees(&self, id: u32, mask: u32) -> bool {
        (self.unmasked && mask != 0) || self.sees_geometry(id, mask)
    }

    #[cold]
    #[inline(never)]
    fn sees_geometry(&self, id: u32, mask: u32) -> bool {
        let (geom, _) = self.name(id);
        self.geometries[geom as usize].mask & mask != 0
    }

    /// The tree for rays of a time.
    #[inline(always)]
    pub(crate) fn layout_at(&self, time: f32) -> &Layout {
        if self.spans.is_empty() { &self.layout } else { self.span_at(time) }
    }

    #[inline(never)]
    fn span_at(&self, time: f32) -> &Layout {
        // What is below 0, and no number, becomes 0; beyond 1, the last.
        let span = (time * self.spans.len() as f32) as usize;
        self.spans.get(span).or(self.spans.last()).unwrap_or(&self.layout)
    }

    /// The mesh that moves whose first primitive has this id: leaves hold it as a whole.
    #[inline(always)]
    pub(crate) fn moving(&self, id: u32) -> Option<&MovingMesh> {
        let at = self.moving.binary_search_by_key(&id, |mesh| mesh.first_id).ok()?;
        self.moving.get(at)
    }

    /// Where a ray first meets a primitive that is no triangle.
    pub(crate) fn meet(&self, id: u32, local: &Local<'_>) -> Option<Meeting> {
        let (geom, prim) = self.name(id);
        self.geometries.get(geom as usize)?.shape.meet(prim as usize, local)
    }
}

/// Numbers only: levels inside may be nested too deeply, and too many, to be written out.
impl core::fmt::Debug for Structure {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Structure")
            .field("geometries", &self.geometries.len())
            .field("bytes", &self.layout.bytes())
            .field("instances", &self.instances.len())
            .field("paths", &self.paths)
            .field("bounds", &self.bounds)
            .finish()
    }
}

/// Frees level by level: scenes may be nested more deeply than the machine's stack is.
impl Drop for Structure {
    fn drop(&mut self) {
        let mut pending = Vec::new();
        core::mem::take(&mut self.instances).into_structures(&mut pending);
        while let Some(structure) = pending.pop() {
            if let Some(mut structure) = Arc::into_inner(structure) {
                core::mem::take(&mut structure.instances).into_structures(&mut pending);
            }
        }
    }
}
