//! Following: the tree stays, around what moved, without what went, with what came.

use super::changes::{Changes, changes};
use super::fates::{Fates, Names};
use super::fetch::{Places, bounds_of};
use super::ledger::Ledger;
use super::mend::{Mended, Sprig, exchanged, standing, sweep, touched};
use super::sprouts::Sprout;
use super::{Edit, Parts, Reason};
use crate::bounds::Aabb;
use crate::layout::exchange::Stay;
use crate::layout::refit;
use crate::scene::builder::{BuildOptions, Placed};
use crate::scene::gather::first_ids;
use crate::scene::place::{self, Part, Placements, place_instances};
use crate::scene::report::{BuildReport, Skipped};
use crate::scene::upkeep::Standing;
use crate::scene::{Scene, SceneError};
use crate::trace::moving::MovingMesh;
use crate::trace::placements::{BLOCK, Block};
use crate::trace::structure::{Geometry, Layout};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::mem;

/// What followed, on its way to a scene.
pub(super) struct Followed {
    pub(super) geometries: Vec<Geometry>,
    pub(super) first_ids: Vec<u32>,
    pub(super) moving: Vec<MovingMesh>,
    pub(super) placements: Placements,
    /// `None` where the meshes are all there is.
    pub(super) around_meshes: Option<Aabb>,
    pub(super) mended: Mended,
    pub(super) standing: Standing,
    /// What came and went.
    pub(super) parts: Parts,
    /// The instances that came.
    pub(super) came: Vec<usize>,
    /// Whether of what came, something lies in several leaves.
    pub(super) repeats: bool,
    /// What was left out of what came.
    pub(super) skipped: Skipped,
}

impl Followed {
    /// How much dearer the tree is than when it was built.
    pub(super) fn decay(&self) -> f64 {
        self.mended.areas().price() / self.standing.built
    }
}

impl Edit {
    /// The tree around what is there now; or why it cannot stay.
    pub(super) fn follow(
        &mut self,
        ledger: &Ledger,
        options: &BuildOptions<'_>,
    ) -> Result<Result<Followed, Reason>, SceneError> {
        let spare = self.spare.take();
        let before = &*self.before.structure;
        let fates = match self.fates() {
            Err(reason) => return Ok(Err(reason)),
            Ok(fates) if !self.are_few(fates.changed) => return Ok(Err(Reason::Different)),
            Ok(fates) => fates,
        };
        let geometries = self.geometries();
        let first_ids = first_ids(&geometries)?;
        let sprouts = self.sprouts(&fates.came, options)?;
        let moving = self.moving(&fates.gone, &sprouts, (&geometries, &first_ids));

        // Place the instances.
        let alone = self.counts[1] == 0;
        let around_meshes = self.around_meshes(&fates, &sprouts, (&geometries, &moving));
        let mut report = BuildReport::default();
        let mut placements = place_instances(self.parts(), around_meshes, options, &mut report)?;
        let Some(instances) = mem::take(&mut placements.instances).opened_as(&before.instances)
        else {
            return Ok(Err(Reason::Different));
        };
        placements.instances = instances;
        let changes = changes(&before.instances, &placements.instances, &before.layout)?;
        if !self.are_few(fates.changed + changes.came.len()) {
            return Ok(Err(Reason::Different));
        }

        // Mend the tree.
        let known = self.before.upkeep.standing.clone();
        let mut standing = known.unwrap_or_else(|| standing(&self.before));
        let instances = &placements.instances;
        let (geoms, firsts) = (&geometries[..], &first_ids[..]);
        let places = Places { geometries: geoms, first_ids: firsts, moving: &moving, instances };
        let mended = if self.exchanges(&fates, &changes) {
            self.exchange((&fates, &changes, &sprouts), &places, &mut standing, options)?
        } else {
            let is_worn = ledger.is_worn(standing.areas.price() / standing.built);
            self.refit((&fates, &changes), &places, (&mut standing, is_worn), spare, options)?
        };
        let mended = match mended {
            Err(reason) => return Ok(Err(reason)),
            Ok(mended) => mended,
        };
        if alone && fates.are_any() {
            placements = place_instances(Vec::new(), mended.bounds(), options, &mut report)?;
        }
        let mut skipped = Skipped::default();
        sprouts.iter().for_each(|sprout| skipped.add(&sprout.skipped()));
        let parts = Parts {
            added: (fates.came.len() + changes.came.len()) as u64,
            removed: fates.gone.len() as u64 + changes.gone,
            ..Parts::default()
        };
        Ok(Ok(Followed {
            around_meshes: (!alone).then_some(around_meshes),
            repeats: sprouts.iter().any(|sprout| sprout.scene.structure.repeats),
            geometries,
            first_ids,
            moving,
            placements,
            mended,
            standing,
            parts,
            came: changes.came,
            skipped,
        }))
    }

    /// Around everything but the instances; without any, nobody asks before it is known from the tree.
    fn around_meshes(
        &self,
        fates: &Fates,
        sprouts: &[Sprout],
        (geometries, moving): (&[Geometry], &[MovingMesh]),
    ) -> Aabb {
        let before = self.before.structure.around_meshes;
        match self.counts[1] == 0 {
            true if fates.are_any() => Aabb::EMPTY,
            false if fates.reshaped || !fates.gone.is_empty() => bounds_of(geometries, moving),
            _ => sprouts
                .iter()
                .fold(before, |all, sprout| all.union(&sprout.scene.structure.around_meshes)),
        }
    }

    /// Whether there is more to do than to mend boxes: leaves that come or are called otherwise. One that went is an empty box
    /// where only a few boxes are mended; elsewhere it leaves.
    fn exchanges(&self, fates: &Fates, changes: &Changes) -> bool {
        let before = &self.before.structure;
        let is_packed = matches!(before.layout, Layout::Compact(_));
        !fates.gone.is_empty()
            || !fates.came.is_empty()
            || !changes.came.is_empty()
            || self.counts[1] != before.instances.len()
            || (changes.gone > 0 && (fates.reshaped || is_packed))
    }

    /// The tree without what went and with what came.
    fn exchange(
        &self,
        (fates, changes, sprouts): (&Fates, &Changes, &[Sprout]),
        places: &Places<'_>,
        standing: &mut Standing,
        options: &BuildOptions<'_>,
    ) -> Result<Result<Mended, Reason>, SceneError> {
        let before = &*self.before.structure;
        // A tree of one leaf has no node to put another one into.
        if !before.layout.root().is_inner() {
            return Ok(Err(Reason::Different));
        }
        let names = Names {
            first_ids: [&before.first_ids, places.first_ids],
            gone: &fates.gone,
            instances: [&before.instances, places.instances],
            came: &changes.came,
        };
        let still = names.still();
        let stay =
            Stay { triangle: &|id| names.id(id, still), single: &|number| names.single(number) };
        let entries = places.instances.entries();
        let singles = changes.came.iter().map(|&at| Sprig::Single(at, places.single(at)));
        let trees = sprouts.iter().map(|sprout| {
            let first_id = places.first_ids[sprout.geom];
            Sprig::Tree { sprout, first_id, first_number: entries + first_id as usize }
        });
        let sprigs: Vec<_> = trees.chain(singles).collect();

        let content = places.content();
        let ids: usize = places.geometries.iter().map(|it| it.shape.len()).sum();
        let exchanged = exchanged(
            &before.layout,
            &stay,
            &content,
            (&sprigs, entries + ids),
            &standing.prices,
            &options.context.cancel,
        )?;
        Ok(exchanged.map(|(mended, prices)| {
            standing.prices = Arc::new(prices);
            mended
        }))
    }

    /// The tree with all boxes anew, or those that few instances are in.
    fn refit(
        &self,
        (fates, changes): (&Fates, &Changes),
        places: &Places<'_>,
        (standing, is_worn): (&mut Standing, bool),
        spare: Option<Scene>,
        options: &BuildOptions<'_>,
    ) -> Result<Result<Mended, Reason>, SceneError> {
        let before = &*self.before.structure;
        let single = |number: usize| places.single(number);
        let instances = places.instances;
        let few = changes.gone > 0 || changes.moved.len() < before.instances.len() / 8 + 2;
        if !fates.reshaped && few {
            let numbers = changes.moved.iter().flat_map(|&at| instances.numbers(at));
            let was = |number| before.instances.bounds(number);
            let moved = numbers.map(|number| refit::Moved { number, was: was(number) });
            let mut moved: Vec<_> = moved.filter(|it| !it.was.is_empty()).collect();
            moved.sort_unstable_by_key(|it| it.number);
            let tree = (before.bounds, standing.areas, &*standing.triangles);
            if let Some(mended) = touched(&before.layout, tree, &moved, single)? {
                return Ok(Ok(mended));
            }
        }
        let content = places.content();
        let spare = spare.and_then(|spare| Arc::into_inner(spare.structure));
        standing.sweeps = standing.sweeps.wrapping_add(1);
        let worn = is_worn.then_some(standing.sweeps);
        let swept = sweep(&before.layout, &content, worn, spare, &options.context.cancel)?;
        Ok(swept.ok_or(Reason::Unfit))
    }

    /// Meshes and other shapes as they are to be.
    pub(super) fn geometries(&self) -> Vec<Geometry> {
        let before = &self.before.structure.geometries;
        let geometry = |geom: usize| self.geometries.get(&geom).or(before.get(geom)).cloned();
        (0..self.counts[0]).filter_map(geometry).collect()
    }

    /// The instances as they are to be: blocks without a change stay.
    fn parts(&self) -> Vec<Part> {
        let blocks = self.before.structure.instances.blocks.iter().enumerate();
        let part = |(index, block): (usize, &Arc<Block>)| {
            // What was added fills the last block.
            let first = index * BLOCK;
            let mut changes = self.instances.range(first..first + BLOCK).peekable();
            if changes.peek().is_none() {
                return Part::Kept(Arc::clone(block));
            }
            let mut placed: Vec<_> = block.items.iter().map(Placed::again).collect();
            for (at, change) in changes {
                match placed.get_mut(at - first) {
                    Some(placed) => *placed = change.clone(),
                    None => placed.push(change.clone()),
                }
            }
            Part::New(placed.into_iter().collect())
        };
        let mut parts: Vec<_> = blocks.map(part).collect();
        let added = self.instances.range(parts.len() * BLOCK..);
        parts.extend(place::parts(added.map(|(_, placed)| placed.clone()).collect()));
        parts
    }
}

#[cfg(test)]
mod tests {
    use super::super::Policy;
    use super::*;
    use crate::geometry::Mesh;
    use crate::scene::LayoutChoice;

    /// A few triangles in a row, or many on a grid.
    fn row(triangles: u32, at: [f32; 3], size: f32) -> Mesh {
        let corner = |i: u32| {
            let (prim, corner) = (i / 3, i % 3);
            let along = [prim % 20, prim / 20, 0].map(|x| x as f32);
            let off = [corner == 1, corner == 2, corner > 0].map(|it| if it { size } else { 0.0 });
            [0, 1, 2].map(|axis: usize| at[axis] + along[axis] + off[axis])
        };
        let prims = (0..triangles).map(|prim| [0, 1, 2].map(|i| 3 * prim + i));
        Mesh::new((0..3 * triangles).map(corner).collect::<Vec<_>>(), prims.collect::<Vec<_>>())
    }

    /// What is kept of areas from commit to commit is what is found when the tree is looked at.
    #[test]
    fn areas_are_those_of_the_tree() {
        for &layout in LayoutChoice::ALL {
            let options = BuildOptions { layout: Some(layout), ..BuildOptions::default() };
            let mut scene = Scene::builder().mesh(row(300, [0.0; 3], 0.9)).build(&options).unwrap();
            for step in 0..30_u32 {
                let mut edit = scene.edit();
                edit.policy = Policy::Refit;
                let at = [(7 * step % 19) as f32, (5 * step % 13) as f32, 0.1 * step as f32];
                edit.add_shape(row(1 + step % 7, at, 0.3));
                if step > 4 && step % 3 == 0 {
                    edit.remove_shape(step as usize - 3).unwrap();
                }
                scene = edit.commit(&options).unwrap().scene;
                // Packed boxes are wider than those that were kept in mind.
                let kept = scene.upkeep.standing.as_ref().unwrap();
                let (found, most) = (standing(&scene), 1e-4);
                let near = |a: f64, b: f64| (a - b).abs() <= most * b;
                assert!(near(kept.areas.prims, found.areas.prims), "{layout:?}, step {step}");
                if layout != LayoutChoice::Compact {
                    assert!(near(kept.areas.boxes, found.areas.boxes), "{layout:?}, step {step}");
                }
                assert_eq!(kept.prices.len(), found.prices.len());
                for (kept, found) in kept.triangles.iter().zip(&*found.triangles) {
                    let (kept, found) = (f64::from(*kept), f64::from(*found));
                    assert!(
                        (kept - found).abs() <= 1e-3,
                        "{layout:?}, step {step}: {kept} {found}"
                    );
                }
            }
        }
    }
}
