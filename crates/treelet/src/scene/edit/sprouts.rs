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
