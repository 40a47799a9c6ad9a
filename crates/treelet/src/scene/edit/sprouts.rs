//! What comes into a tree: each shape with a tree of its own, as the options say it is built.

use super::fetch::has_defects;
use super::mend::standing;
use super::{DECAY_MAX, Edit, Policy};
use crate::scene::builder::{BuildOptions, LayoutChoice, SceneBuilder};
use crate::scene::report::Skipped;
use crate::scene::upkeep::Standing;
use crate::scene::{Quality, Scene, SceneError, assemble, moving};
use crate::trace::moving::MovingMesh;
use crate::trace::structure::{Geometry, Layout};
use alloc::vec::Vec;

/// A shape that came, as a scene of it alone.
pub(super) struct Sprout {
    pub(super) geom: usize,
    pub(super) scene: Scene,
    pub(super) standing: Standing,
}

impl Edit {
    /// Builds over the shapes that came.
    pub(super) fn sprouts(
        &self,
        came: &[usize],
        options: &BuildOptions<'_>,
    ) -> Result<Vec<Sprout>, SceneError> {
        // As wide as the tree that they come into; packed nodes are unpacked where they are changed.
        let layout = match self.before.structure.layout {
            Layout::Wide8(_) => LayoutChoice::Wide8,
            Layout::Wide16(_) | Layout::Compact(_) => LayoutChoice::Wide16,
        };
        // What is small is not worth a search.
        let quality = match options.quality {
            Quality::Rays(_) | Quality::Auto => Quality::Default,
            quality => quality,
        };
        let options = BuildOptions { layout: Some(layout), quality, ..options.clone() };
        let sprout = |&geom: &usize| {
            let geometries = self.geometries.get(&geom).into_iter().cloned().collect();
            let known = self.remade(geom, &options)?.into_iter().map(|mesh| (0, mesh)).collect();
            let alone = SceneBuilder { geometries, known, ..SceneBuilder::default() };
            let scene =
                assemble::assemble(alone, &options).map_err(|error| error.of_shape(geom))?;
            let standing = standing(&scene);
            Ok(Sprout { geom, scene, standing })
        };
        came.iter().map(sprout).collect()
    }

    /// The trees of a mesh that goes other ways in as many time steps: around those, if they have not decayed too much.
    fn remade(
        &self,
        geom: usize,
        options: &BuildOptions<'_>,
    ) -> Result<Option<MovingMesh>, SceneError> {
        let before = &self.before.structure;
        let old = before.moving.iter().find(|mesh| mesh.geom == geom);
        let new = self.geometries.get(&geom).and_then(Geometry::mesh);
        let (Some(old), Some(mesh)) = (old, new) else { return Ok(None) };
        let was = &before.geometries[geom].shape;
        let is_alike = was
            .mesh()
            .is_some_and(|was| was.triangles() == mesh.triangles() && was.steps() == mesh.steps());
        // What was left out has no leaf, and what is unfit must not have one.
        if !is_alike || mesh.uneven_step().is_some() {
            return Ok(None);
        }
        let shape = &self.geometries[&geom].shape;
        if has_defects(was) || has_defects(shape) {
            return Ok(None);
        }
        let (mesh, decay) = moving::refit(old, mesh, &options.context.cancel)?;
        let is_good = self.policy == Policy::Refit || decay <= DECAY_MAX;
        Ok(is_good.then_some(mesh))
    }

    /// The meshes that move, with the trees that they had or that came.
    pub(super) fn moving(
        &self,
        gone: &[usize],
        sprouts: &[Sprout],
        (geometries, first_ids): (&[Geometry], &[u32]),
    ) -> Vec<MovingMesh> {
        let stays = |mesh: &&MovingMesh| gone.binary_search(&mesh.geom).is_err();
        let stay = self.before.structure.moving.iter().filter(stays).cloned();
        let come = sprouts.iter().flat_map(|sprout| {
            let moving = sprout.scene.structure.moving.iter();
            moving.map(|mesh| MovingMesh { geom: sprout.geom, ..mesh.clone() })
        });
        let named = |mesh: MovingMesh| {
            let (first_id, mask) = (first_ids[mesh.geom], geometries[mesh.geom].mask);
            MovingMesh { first_id, mask, ..mesh }
        };
        let mut all: Vec<_> = stay.chain(come).map(named).collect();
        all.sort_unstable_by_key(|mesh| mesh.geom);
        all
    }

    /// The meshes that move and are what they were, or nearly, for whoever builds everything else anew.
    pub(super) fn known(
        &self,
        options: &BuildOptions<'_>,
    ) -> Result<Vec<(usize, MovingMesh)>, SceneError> {
        let before = &self.before.structure;
        let mut known = Vec::new();
        if self.policy == Policy::Rebuild {
            return Ok(known);
        }
        for mesh in &before.moving {
            let (geom, was) = (mesh.geom, &before.geometries[mesh.geom].shape);
            let is_same = self.geometries.get(&geom).is_none_or(|it| it.shape.is_same(was));
            let mesh = if is_same { Some(mesh.clone()) } else { self.remade(geom, options)? };
            known.extend(mesh.map(|mesh| (geom, mesh)));
        }
        Ok(known)
    }
}

impl Sprout {
    /// What was left out of it.
    pub(super) fn skipped(&self) -> Skipped {
        let mut skipped = self.scene.report.skipped.clone();
        let firsts = skipped.first_triangle.iter_mut().chain(&mut skipped.first_other);
        firsts.for_each(|(geom, ..)| *geom = self.geom);
        skipped
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Mesh;
    use crate::memory::Array;
    use alloc::sync::Arc;

    fn soup(triangles: u32, at: f32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
        let corner = |at: f32, i: u32| [at + (i % 17) as f32, (i % 5) as f32, (i / 17) as f32];
        let positions = (0..3 * triangles).map(|i| corner(at, i)).collect();
        (positions, (0..triangles).map(|prim| [0, 1, 2].map(|i| 3 * prim + i)).collect())
    }

    fn moving(triangles: u32, far: f32) -> Mesh {
        let (still, prims) = soup(triangles, 0.0);
        let steps: [Array<[f32; 3]>; 2] = [still.into(), soup(triangles, far).0.into()];
        Mesh::moving(steps, prims)
    }

    /// Whatever comes and goes beside them, and whatever they are numbered then; also where all else is built anew, but not
    /// where that was asked for.
    #[test]
    fn meshes_that_move_and_did_not_change_keep_their_trees() {
        let options = BuildOptions::default();
        let (positions, prims) = soup(100, 20.0);
        let scene = Scene::builder()
            .mesh(Mesh::new(positions.clone(), prims))
            .mesh(Mesh::new(positions[..3].to_vec(), [[0, 1, 2]]))
            .mesh(moving(30, 3.0))
            .mesh(moving(20, 1.0))
            .build(&options)
            .unwrap();
        let trees = |scene: &Scene| -> Vec<_> {
            scene.structure.moving.iter().map(|mesh| Arc::clone(&mesh.trees)).collect()
        };
        let before = trees(&scene);
        let kept = |edit: Edit, kept: [bool; 2]| {
            let commit = edit.commit(&options).unwrap();
            let after = trees(&commit.scene);
            let same = [0, 1].map(|at: usize| Arc::ptr_eq(&before[at], &after[at]));
            assert_eq!(same, kept, "{commit}");
            commit.action
        };
        use crate::scene::Action::{Rebuilt, Refitted};
        let edited = |change: &dyn Fn(&mut Edit)| {
            let mut edit = scene.edit();
            change(&mut edit);
            edit
        };
        // A triangle goes, which all others are numbered after.
        let edit = edited(&|edit| edit.remove_shape(1).unwrap());
        assert_eq!(kept(edit, [true; 2]), Refitted);
        let edit = edited(&|edit| edit.set_positions(0, positions.clone()).unwrap());
        assert_eq!(kept(edit, [true; 2]), Refitted);
        let edit = edited(&|edit| edit.set_shape(2, moving(30, 4.0)).unwrap());
        assert_eq!(kept(edit, [false, true]), Refitted);
        let edit = edited(&|edit| edit.set_shape(2, moving(31, 3.0)).unwrap());
        assert_eq!(kept(edit, [false, true]), Refitted);
        let edit = edited(&|edit| edit.set_mask(3, 2).unwrap());
        assert_eq!(kept(edit, [true; 2]), Refitted);
        let edit = edited(&|edit| edit.remove_shape(0).unwrap());
        assert_eq!(kept(edit, [true; 2]), Rebuilt);
        let edit = edited(&|edit| {
            edit.remove_shape(1).unwrap();
            edit.policy = Policy::Rebuild;
        });
        assert_eq!(kept(edit, [false; 2]), Rebuilt);
    }
}
