//! Committing an edit: what of the old snapshot stays, what is refitted, what is built anew.
//!
//! Cost: O(blocks of instances + meshes), and what changed: one reverse sweep of the tree where vertices
//! moved, a copy of it and the way up from a few instances, or a build.

use super::{Action, Commit, DECAY_MAX, Edit, Reason, Update};
use crate::bounds::Aabb;
use crate::context::clock::Stopwatch;
use crate::context::{Cancel, parallel};
use crate::geometry::mesh::COORDINATE_MAX;
use crate::geometry::{Mesh, Shape};
use crate::layout::compact::pack::pack;
use crate::layout::lower::Packed;
use crate::layout::refit::{self, Content, Refitted, refit};
use crate::layout::wide::Wide;
use crate::scene::assemble::{COVER_MAX, Level};
use crate::scene::builder::{BuildOptions, Placed, SceneBuilder};
use crate::scene::place::{Part, Placements, place_instances};
use crate::scene::report::BuildReport;
use crate::scene::{Scene, SceneError, assemble};
use crate::trace::placements::{BLOCK, Block, Instances};
use crate::trace::slack::{Near, Slack};
use crate::trace::structure::{Geometry, Layout, Price, Structure};
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Triangles whose box is found by one task.
const CHUNK: usize = 16_384;

impl Edit {
    /// Makes the new snapshot. `options` say how a tree is built if one has to be; instructions and
    /// layout stay what they were unless it is.
    ///
    /// # Errors
    ///
    /// As [`SceneBuilder::build`]; the old snapshot stays what it is.
    pub fn commit(self, options: &BuildOptions<'_>) -> Result<Commit, SceneError> {
        let watch = Stopwatch::start();
        let done = |scene, action, reason, decay| {
            Ok(Commit { scene, action, reason, decay, time: watch.elapsed() })
        };
        if self.geometries.is_empty() && self.instances.is_empty() {
            return done(self.before, Action::Kept, Reason::Unchanged, 1.0);
        }
        let reason = match self.update {
            Update::Rebuild => Reason::Asked,
            Update::Auto | Update::Refit => match self.refit(options)? {
                Err(reason) => reason,
                Ok((scene, decay)) if self.update == Update::Refit || decay <= DECAY_MAX => {
                    return done(scene, Action::Refitted, Reason::Same, decay);
                }
                Ok(_) => Reason::Decayed,
            },
        };
        done(assemble::assemble(self.description(), options)?, Action::Rebuilt, reason, 1.0)
    }

    /// Everything as it is to be.
    fn description(&self) -> SceneBuilder {
        let before = &self.before.structure;
        let placed = |at: usize| match (self.instances.get(&at), before.instances.get(at)) {
            (Some(placed), _) => Some(placed.clone()),
            (None, before) => before.map(Placed::again),
        };
        let instances = (0..self.counts[1]).filter_map(placed).collect();
        SceneBuilder { geometries: self.geometries(), instances }
    }

    /// Meshes and other shapes as they are to be.
    fn geometries(&self) -> Vec<Geometry> {
        let before = &self.before.structure.geometries;
        let geometry = |geom: usize| self.geometries.get(&geom).or(before.get(geom)).cloned();
        (0..self.counts[0]).filter_map(geometry).collect()
    }

    /// The instances as they are to be: blocks without a change stay.
    fn parts(&self) -> Vec<Part> {
        let blocks = self.before.structure.instances.blocks.iter().enumerate();
        let part = |(index, block): (usize, &Arc<Block>)| {
            let first = index * BLOCK;
            let mut changes = self.instances.range(first..first + block.items.len()).peekable();
            if changes.peek().is_none() {
                return Part::Kept(Arc::clone(block));
            }
            let mut placed: Vec<_> = block.items.iter().map(Placed::again).collect();
            changes.for_each(|(at, change)| placed[at - first] = change.clone());
            Part::New(placed)
        };
        blocks.map(part).collect()
    }

    /// Whether primitives are elsewhere; or why the tree
    /// cannot stay.
    fn reshaped(&self) -> Result<bool, Reason> {
        let before = &self.before.structure;
        if self.counts != [before.geometries.len(), before.instances.len()] {
            return Err(Reason::Different);
        }
        let moves = |it: &Geometry| it.mesh().is_some_and(Mesh::is_moving);
        let is_moving = self.geometries.values().any(moves);
        if is_moving || !before.moving.is_empty() {
            return Err(Reason::Moving);
        }
        let mut reshaped = false;
        for (&geom, Geometry { shape, .. }) in &self.geometries {
            let old = &before.geometries[geom].shape;
            if old.kind() != shape.kind() || old.len() != shape.len() {
                return Err(Reason::Different);
            }
            if old.is_same(shape) {
                continue;
            }
            reshaped = true;
            // Triangles are looked at where they are fetched.
            if shape.mesh().is_none() && has_defects(shape) {
                return Err(Reason::Unfit);
            }
        }
        let skipped = &self.before.report.skipped;
        if reshaped && skipped.triangles + skipped.others > 0 {
            return Err(Reason::Unfit);
        }
        Ok(reshaped)
    }

    /// The scene with the tree that it has, and how much dearer that has become; or why not.
    fn refit(
        &self,
        options: &BuildOptions<'_>,
    ) -> Result<Result<(Scene, f64), Reason>, SceneError> {
        let before = &*self.before.structure;
        let reshaped = match self.reshaped() {
            Err(reason) => return Ok(Err(reason)),
            Ok(reshaped) => reshaped,
        };

        // Place the instances; without any, nobody asks where the meshes are before it is known.
        let geometries = self.geometries();
        let alone = before.instances.is_empty();
        let around_meshes = match (reshaped, alone) {
            (false, _) => before.around_meshes,
            (true, true) => Aabb::EMPTY,
            (true, false) => bounds_of(&geometries),
        };
        let mut report = BuildReport::default();
        let mut placements = place_instances(self.parts(), around_meshes, options, &mut report)?;
        let moved = match moved(&before.instances, &placements.instances, &before.layout)? {
            Err(reason) => return Ok(Err(reason)),
            Ok(moved) => moved,
        };

        // Mend the boxes: all of them, or those that few instances are in.
        let single = |number: usize| match number.checked_sub(placements.instances.len()) {
            None => placements.instances.at(number).bounds(),
            Some(id) => {
                let (geom, prim) = before.name(id as u32);
                geometries[geom as usize].shape.bounds(prim as usize)
            }
        };
        let price = before.price.unwrap_or_else(|| price(&before.layout, &before.bounds));
        let few = !reshaped && moved.len() < before.instances.len() / 8 + 2;
        let touched = if few {
            let moved = |at: usize| moved.binary_search(&at).is_ok();
            touched(&before.layout, (before.bounds, price.areas), moved, single)?
        } else {
            None
        };
        let swept = if touched.is_some() {
            touched
        } else {
            let fetch = |ids: &[u32], packed: &mut [Packed]| {
                Moved { geometries: &geometries, before }.fetch(ids, packed)
            };
            let content = Content { triangles: &fetch, instance: &single };
            sweep(&before.layout, &content, &options.context.cancel)?
        };
        let Some(swept) = swept else { return Ok(Err(Reason::Unfit)) };
        if alone && reshaped {
            placements = place_instances(Vec::new(), swept.bounds, options, &mut report)?;
        }

        let repeats = placements.instances.blocks.iter().any(|block| block.repeats);
        let decay = refit::price(swept.areas, &swept.bounds) / price.built;
        let level = Level {
            level: before.level,
            geometries,
            first_ids: before.first_ids.clone(),
            placements,
            layout: swept.layout,
            bounds: swept.bounds,
            cover: swept.cover,
            repeats: before.repeats || repeats,
            around_meshes: if alone { swept.bounds } else { around_meshes },
        };
        let mut structure = level.structure();
        structure.price = Some(Price { built: price.built, areas: swept.areas });
        let report = Arc::clone(&self.before.report);
        Ok(Ok((Scene { structure: Arc::new(structure), report, auto: None }, decay)))
    }
}

/// Which instances have another box, in rising order; or why the tree cannot stay.
fn moved(
    before: &Instances,
    after: &Instances,
    layout: &Layout,
) -> Result<Result<Vec<usize>, Reason>, SceneError> {
    let mut moved = Vec::new();
    for (index, (old, new)) in before.blocks.iter().zip(&after.blocks).enumerate() {
        if Arc::ptr_eq(old, new) {
            continue;
        }
        for (at, (old, new)) in old.items.iter().zip(&new.items).enumerate() {
            let instance = index * BLOCK + at;
            if !new.structure.layout.is_as(layout) {
                return Err(SceneError::MixedLayouts { instance });
            }
            let [old, new] = [old.bounds(), new.bounds()];
            if old.is_empty() != new.is_empty() {
                return Ok(Err(Reason::Different));
            }
            if old != new {
                moved.push(instance);
            }
        }
    }
    Ok(Ok(moved))
}

/// A scene of nothing that can be placed into this one.
pub(super) fn nothing_like(like: &Structure) -> Arc<Structure> {
    let bounds = Aabb::EMPTY;
    let layout = match like.layout {
        Layout::Wide8(_) => Layout::Wide8(Wide::nothing()),
        Layout::Wide16(_) => Layout::Wide16(Wide::nothing()),
        Layout::Compact(_) => Layout::Compact(Wide::nothing()),
    };
    let placements = Placements {
        instances: Instances::default(),
        reach: bounds,
        slack: Slack::new(Near::of(&bounds), 0.0),
        paths: 1,
    };
    let level = Level {
        level: like.level,
        geometries: Vec::new(),
        first_ids: Vec::new(),
        placements,
        layout,
        bounds,
        cover: Vec::new(),
        repeats: false,
        around_meshes: bounds,
    };
    Arc::new(level.structure())
}

/// A layout with new boxes, and what follows from them.
struct Swept {
    layout: Layout,
    bounds: Aabb,
    cover: Vec<Aabb>,
    areas: f64,
}

impl Swept {
    fn new<const W: usize>(refitted: Refitted<W>, layout: impl Fn(Wide<W>) -> Layout) -> Self {
        let cover = refitted.cover(COVER_MAX);
        let Refitted { wide, bounds, areas } = refitted;
        Self { layout: layout(wide), bounds, cover, areas }
    }
}

/// All boxes anew; `None` if a triangle is not fit.
fn sweep(
    layout: &Layout,
    content: &Content<
        '_,
        impl Fn(&[u32], &mut [Packed]) -> bool + Sync,
        impl Fn(usize) -> Aabb + Sync,
    >,
    cancel: &Cancel,
) -> Result<Option<Swept>, SceneError> {
    Ok(match layout {
        Layout::Wide8(wide) => {
            refit(wide, content, cancel)?.map(|it| Swept::new(it, Layout::Wide8))
        }
        Layout::Wide16(wide) => {
            refit(wide, content, cancel)?.map(|it| Swept::new(it, Layout::Wide16))
        }
        Layout::Compact(wide) => match refit(wide, content, cancel)? {
            None => None,
            Some(it) => {
                let packed = Layout::Compact(pack(&it.wide, cancel)?);
                let cover = it.cover(COVER_MAX);
                Some(Swept { layout: packed, bounds: it.bounds, cover, areas: it.areas })
            }
        },
    })
}

/// The boxes of a few instances anew, and those that they are in; `None` where a layout cannot.
fn touched(
    layout: &Layout,
    tree: (Aabb, f64),
    moved: impl Fn(usize) -> bool,
    instance: impl Fn(usize) -> Aabb,
) -> Result<Option<Swept>, SceneError> {
    Ok(match layout {
        Layout::Wide8(wide) => {
            Some(Swept::new(refit::touch(wide, tree, moved, instance)?, Layout::Wide8))
        }
        Layout::Wide16(wide) => {
            Some(Swept::new(refit::touch(wide, tree, moved, instance)?, Layout::Wide16))
        }
        Layout::Compact(_) => None,
    })
}

/// What a tree costs that is as it was built.
fn price(layout: &Layout, bounds: &Aabb) -> Price {
    let areas = match layout {
        Layout::Wide8(wide) => refit::areas(wide),
        Layout::Wide16(wide) => refit::areas(wide),
        Layout::Compact(wide) => refit::areas(wide),
    };
    Price { built: refit::price(areas, bounds), areas }
}

/// Where triangles are now.
struct Moved<'a> {
    geometries: &'a [Geometry],
    before: &'a Structure,
}

impl Moved<'_> {
    /// All numbers of vertices first, then all vertices: loads that do not wait for each other.
    /// Whether all triangles are fit for a scene.
    fn fetch(&self, ids: &[u32], packed: &mut [Packed]) -> bool {
        if let [Geometry { shape: Shape::Mesh(mesh), .. }] = self.geometries {
            return fetch_of(mesh, ids, packed);
        }
        let mut fit = true;
        for (&id, packed) in ids.iter().zip(packed) {
            let (geom, prim) = self.before.name(id);
            let Shape::Mesh(mesh) = &self.geometries[geom as usize].shape else { return false };
            fit &= mesh.defect(prim as usize).is_none();
            *packed = Packed { corners: mesh.corners(prim as usize).unwrap_or_default(), id };
        }
        fit
    }
}

/// Triangles of the only mesh.
fn fetch_of(mesh: &Mesh, ids: &[u32], packed: &mut [Packed]) -> bool {
    let (positions, triangles) = (mesh.positions(), mesh.triangles());
    for (&id, packed) in ids.iter().zip(&mut *packed) {
        let [a, b, c] = triangles[id as usize];
        *packed = Packed { corners: [[0.0; 3]; 3], id };
        packed.corners[0] = [a, b, c].map(f32::from_bits);
    }
    let mut fit = true;
    for packed in packed {
        let [a, b, c] = packed.corners[0].map(f32::to_bits);
        let corner = |at: u32| positions.get(at as usize).copied().unwrap_or([f32::NAN; 3]);
        packed.corners = [corner(a), corner(b), corner(c)];
        fit &= packed.corners.iter().flatten().all(|x| x.abs() <= COORDINATE_MAX);
    }
    fit
}

/// Whether a primitive is not fit for a scene.
fn has_defects(shape: &Shape) -> bool {
    let chunks = (0..shape.len()).step_by(CHUNK).collect();
    let found = parallel::map(chunks, |first: usize| {
        (first..shape.len().min(first + CHUNK)).any(|prim| shape.defect(prim).is_some())
    });
    found.contains(&true)
}

/// Around all primitives that are fit for a scene.
fn bounds_of(geometries: &[Geometry]) -> Aabb {
    let mut all = Aabb::EMPTY;
    for Geometry { shape, .. } in geometries {
        let chunks = (0..shape.len()).step_by(CHUNK).collect();
        let chunks = parallel::map(chunks, |first: usize| {
            let chunk = first..shape.len().min(first + CHUNK);
            let sound = chunk.filter(|&prim| shape.defect(prim).is_none());
            sound.fold(Aabb::EMPTY, |all, prim| all.union(&shape.bounds(prim)))
        });
        all = chunks.iter().fold(all, |all, chunk| all.union(chunk));
    }
    all
}
