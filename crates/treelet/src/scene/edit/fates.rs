//! What became of the shapes of a level, and what their primitives are called now.

use super::fetch::has_defects;
use super::{Edit, Reason};
use crate::geometry::Shape;
use crate::trace::placements::Instances;
use crate::trace::structure::{Geometry, name};
use alloc::vec::Vec;

/// Where more than this share of what a level holds comes and goes, all of it is built anew.
pub(super) const FEW: f64 = 0.25;

/// What became of the shapes.
#[derive(Default)]
pub(super) struct Fates {
    /// Whether primitives are elsewhere, under the same names.
    pub(super) reshaped: bool,
    /// Shapes whose primitives leave the tree, in rising order.
    pub(super) gone: Vec<usize>,
    /// Shapes whose primitives come into it, in rising order; the same one may do both.
    pub(super) came: Vec<usize>,
    /// Primitives that come or go.
    pub(super) changed: usize,
}

impl Fates {
    /// Whether anything is not what or where it was.
    pub(super) fn are_any(&self) -> bool {
        self.reshaped || !self.gone.is_empty() || !self.came.is_empty()
    }
}

/// Whether a shape is one entry of a leaf, whatever it has inside.
fn moves(shape: &Shape) -> bool {
    shape.mesh().is_some_and(|mesh| mesh.is_moving())
}

/// How many entries it is.
fn entries(shape: &Shape) -> usize {
    if moves(shape) { shape.len().min(1) } else { shape.len() }
}

impl Edit {
    /// What becomes of the shapes; or why the tree cannot stay.
    pub(super) fn fates(&self) -> Result<Fates, Reason> {
        let before = &self.before.structure;
        let mut fates = Fates::default();
        for (&geom, Geometry { shape, .. }) in &self.geometries {
            let nothing = Shape::Mesh(crate::geometry::Mesh::default());
            let old = before.geometries.get(geom).map_or(&nothing, |it| &it.shape);
            if old.is_same(shape) {
                continue;
            }
            let moves = moves(old) || moves(shape);
            if !moves && old.kind() == shape.kind() && old.len() == shape.len() {
                fates.reshaped = true;
                // Triangles are looked at where they are fetched.
                if shape.mesh().is_none() && has_defects(shape) {
                    return Err(Reason::Unfit);
                }
                continue;
            }
            fates.gone.extend((!old.is_empty()).then_some(geom));
            fates.came.extend((!shape.is_empty()).then_some(geom));
            fates.changed += entries(old) + entries(shape);
        }
        let skipped = &self.before.report.skipped;
        if fates.reshaped && skipped.triangles + skipped.others > 0 {
            return Err(Reason::Unfit);
        }
        Ok(fates)
    }

    /// Whether so many entries of the level are few.
    pub(super) fn are_few(&self, changed: usize) -> bool {
        let before = &self.before.structure;
        let held: usize = before.geometries.iter().map(|it| entries(&it.shape)).sum();
        changed as f64 <= FEW * (held + before.instances.len()) as f64
    }
}

/// What is called otherwise now.
pub(super) struct Names<'a> {
    /// For each geometry, the id of its first primitive: before and now.
    pub(super) first_ids: [&'a [u32]; 2],
    pub(super) gone: &'a [usize],
    pub(super) instances: [&'a Instances; 2],
    /// Instances that were nowhere before.
    pub(super) came: &'a [usize],
}

impl Names<'_> {
    /// Ids below this one stay.
    pub(super) fn still(&self) -> u32 {
        let first = self.gone.first().and_then(|&geom| self.first_ids[0].get(geom));
        first.copied().unwrap_or(u32::MAX)
    }

    /// The id of a primitive; `None` if its shape went. `still` is [`Self::still`].
    #[inline(always)]
    pub(super) fn id(&self, id: u32, still: u32) -> Option<u32> {
        if id < still { Some(id) } else { self.later_id(id) }
    }

    fn later_id(&self, id: u32) -> Option<u32> {
        let (geom, prim) = name(self.first_ids[0], id);
        let geom = geom as usize;
        let stays = self.gone.binary_search(&geom).is_err();
        self.first_ids[1].get(geom).filter(|_| stays).map(|first| first + prim)
    }

    /// The number of an instance, a part of one, or what is numbered after them.
    pub(super) fn single(&self, number: usize) -> Option<usize> {
        let [before, after] = self.instances;
        if number < before.len() {
            // What came back has a new leaf.
            return self.came.binary_search(&number).is_err().then_some(number);
        }
        match number.checked_sub(before.entries()) {
            None => Some(number - before.len() + after.len()),
            Some(id) => self.later_id(id as u32).map(|id| after.entries() + id as usize),
        }
    }
}
