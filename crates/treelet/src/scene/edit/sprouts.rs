//! What comes into a tree: each shape with a tree of its own, as the options say it is built.

use super::mend::standing;
use super::{Edit, Policy};
use crate::scene::builder::{BuildOptions, LayoutChoice, SceneBuilder};
use crate::scene::report::Skipped;
use crate::scene::upkeep::Standing;
use crate::scene::{Quality, Scene, SceneError, assemble};
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
            let alone = SceneBuilder { geometries, ..SceneBuilder::default() };
            let scene =
                assemble::assemble(alone, &options).map_err(|error| error.of_shape(geom))?;
            let standing = standing(&scene);
            Ok(Sprout { geom, scene, standing })
        };
        came.iter().map(sprout).collect()
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

    /// The meshes that move and are what they were, for whoever builds everything else anew.
    pub(super) fn known(&self) -> Vec<(usize, MovingMesh)> {
        if self.policy == Policy::Rebuild {
            return Vec::new();
        }
        let before = &self.before.structure;
        let is_same = |mesh: &&MovingMesh| {
            let now = self.geometries.get(&mesh.geom);
            now.is_none_or(|it| it.shape.is_same(&before.geometries[mesh.geom].shape))
        };
        before.moving.iter().filter(is_same).map(|mesh| (mesh.geom, mesh.clone())).collect()
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
