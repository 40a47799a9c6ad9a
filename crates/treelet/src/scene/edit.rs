//! Edits: what moved, what came and went, committed as a new snapshot that shares what stayed.
//!
//! The old snapshot goes on answering; whoever traces it is never waited for and never waits. What a
//! commit does to the tree does not show in answers, only in their price: where the triangles and
//! instances are the same ones, the tree is kept and its boxes follow (`layout/refit.rs`); it is built
//! anew where that is not so, or where the boxes have grown so much that it pays.

use super::assemble::{COVER_MAX, Level};
use super::builder::{BuildOptions, Placed, SceneBuilder};
use super::place::{Part, Placements, place_instances};
use super::report::BuildReport;
use super::{Scene, SceneError, assemble};
use crate::bounds::Aabb;
use crate::context::clock::Stopwatch;
use crate::context::{Cancel, parallel};
use crate::geometry::Mesh;
use crate::geometry::mesh::COORDINATE_MAX;
use crate::layout::compact::pack::pack;
use crate::layout::lower::Packed;
use crate::layout::refit::{self, Content, Refitted, refit};
use crate::layout::wide::Wide;
use crate::math::Affine;
use crate::memory::Array;
use crate::trace::placements::{BLOCK, Block, Instances};
use crate::trace::slack::{Near, Slack};
use crate::trace::structure::{Geometry, Layout, Price, Structure};
use alloc::collections::BTreeMap;
use alloc::collections::btree_map::Entry;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::time::Duration;

/// A tree whose boxes cost this many times what they cost when it was built is built anew.
///
/// C. Lauterbach, S.-E. Yoon, D. Manocha, D. Tuft, "RT-DEFORM: Interactive Ray Tracing of Dynamic
/// Scenes using BVHs", IEEE Symposium on Interactive Ray Tracing, 2006, rebuild where boxes have
/// grown by 40 %.
pub const DECAY_MAX: f64 = 1.4;

/// Triangles whose box is found by one task.
const CHUNK: usize = 16_384;

/// What a commit may do to a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Update {
    /// Refit where that is possible and the tree stays good enough ([`DECAY_MAX`]), else rebuild.
    #[default]
    Auto,
    /// Refit wherever that is possible.
    Refit,
    /// Rebuild.
    Rebuild,
}

/// What a commit did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Nothing had changed.
    Kept,
    /// The tree stayed, its boxes followed.
    Refitted,
    /// There is a new tree.
    Rebuilt,
}

/// Why it did that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reason {
    /// There was nothing to do.
    Unchanged,
    /// It was asked for.
    Asked,
    /// The same triangles and instances are in the tree, and it is good enough.
    Same,
    /// A mesh has more or fewer triangles, an instance became or ceased to be empty, or something
    /// was added.
    Different,
    /// A triangle is not fit for a scene, or one that was not was left out.
    Unfit,
    /// The boxes had grown too much.
    Decayed,
}

impl core::fmt::Display for Reason {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Unchanged => "nothing changed",
            Self::Asked => "as asked",
            Self::Same => "the same triangles and instances, in boxes that are still good",
            Self::Different => "other triangles or instances than before",
            Self::Unfit => "triangles that are, or were, not fit for a scene",
            Self::Decayed => "the boxes had grown too much",
        })
    }
}

/// A new snapshot, and what was done for it.
#[derive(Clone, Debug)]
pub struct Commit {
    /// The scene after the edit. Its report is of the last build; refitting does not change it.
    pub scene: Scene,
    /// What was done to the tree.
    pub action: Action,
    /// Why.
    pub reason: Reason,
    /// What a long random line pays in the tree, over what it paid when the tree was built: 1 for a
    /// new one.
    pub decay: f64,
    /// How long the commit took; zero where there is no clock.
    pub time: Duration,
}

/// What an edit names that is not there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EditError {
    /// No such mesh.
    #[error("there is no mesh {geom}: the scene has {meshes}")]
    NoMesh {
        /// What was asked for.
        geom: usize,
        /// How many there are.
        meshes: usize,
    },
    /// No such instance.
    #[error("there is no instance {instance}: the scene has {instances}")]
    NoInstance {
        /// What was asked for.
        instance: usize,
        /// How many there are.
        instances: usize,
    },
}

/// Changes to a scene, gathered until they are committed.
///
/// Numbers stay: what is removed leaves its number unused, what is added gets the next one.
///
/// ```
/// use treelet::{Affine, BuildOptions, Mesh, Ray, Scene};
///
/// let mesh = Mesh::new([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0, 1, 2]]);
/// let scene = Scene::builder().mesh(mesh).build(&BuildOptions::default())?;
/// let mut edit = scene.edit();
/// edit.set_positions(0, vec![[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0]])?;
/// let moved = edit.commit(&BuildOptions::default())?.scene;
/// let ray = Ray::new([0.25, 0.25, -1.0], [0.0, 0.0, 1.0]);
/// assert_eq!(moved.closest(&ray).unwrap().t, 6.0);
/// assert_eq!(scene.closest(&ray).unwrap().t, 1.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Edit {
    before: Scene,
    /// Meshes that are others now, or new.
    meshes: BTreeMap<usize, (Mesh, u32)>,
    /// Instances that are others now, or new.
    instances: BTreeMap<usize, Placed>,
    /// How many there are, the new ones included.
    counts: [usize; 2],
    /// What the commit may do to the tree.
    pub update: Update,
}

impl Scene {
    /// Begins an edit. Costs nothing: only what changes is written down.
    pub fn edit(&self) -> Edit {
        Edit {
            before: self.clone(),
            meshes: BTreeMap::new(),
            instances: BTreeMap::new(),
            counts: [self.structure.geometries.len(), self.structure.instances.len()],
            update: Update::default(),
        }
    }
}

impl Edit {
    /// Moves the vertices of a mesh; its triangles stay.
    ///
    /// # Errors
    ///
    /// There is no such mesh.
    pub fn set_positions(
        &mut self,
        geom: usize,
        positions: impl Into<Array<[f32; 3]>>,
    ) -> Result<(), EditError> {
        let (mesh, _) = self.mesh(geom)?;
        *mesh = mesh.with_positions(positions);
        Ok(())
    }

    /// Puts another mesh in the place of one.
    ///
    /// # Errors
    ///
    /// There is no such mesh.
    pub fn set_mesh(&mut self, geom: usize, mesh: Mesh) -> Result<(), EditError> {
        self.mesh(geom)?.0 = mesh;
        Ok(())
    }

    /// Which rays see a mesh: those whose mask has a bit in common with `mask`.
    ///
    /// # Errors
    ///
    /// There is no such mesh.
    pub fn set_mesh_mask(&mut self, geom: usize, mask: u32) -> Result<(), EditError> {
        self.mesh(geom)?.1 = mask;
        Ok(())
    }

    /// Takes a mesh away; its number stays unused.
    ///
    /// # Errors
    ///
    /// There is no such mesh.
    pub fn remove_mesh(&mut self, geom: usize) -> Result<(), EditError> {
        self.set_mesh(geom, Mesh::default())
    }

    /// Adds a mesh that every ray sees; returns its `geom`.
    pub fn add_mesh(&mut self, mesh: Mesh) -> usize {
        let geom = self.counts[0];
        self.counts[0] += 1;
        self.meshes.insert(geom, (mesh, u32::MAX));
        geom
    }

    /// Moves an instance.
    ///
    /// # Errors
    ///
    /// There is no such instance. What is wrong with the map is said by [`Edit::commit`].
    pub fn set_transform(
        &mut self,
        instance: usize,
        world_from_object: Affine,
    ) -> Result<(), EditError> {
        self.instance(instance)?.world_from_object = world_from_object;
        Ok(())
    }

    /// Places another scene where an instance is: the new snapshot of an edited one, say.
    ///
    /// # Errors
    ///
    /// There is no such instance.
    pub fn set_scene(&mut self, instance: usize, scene: &Scene) -> Result<(), EditError> {
        self.instance(instance)?.structure = Arc::clone(&scene.structure);
        Ok(())
    }

    /// Which rays see an instance.
    ///
    /// # Errors
    ///
    /// There is no such instance.
    pub fn set_instance_mask(&mut self, instance: usize, mask: u32) -> Result<(), EditError> {
        self.instance(instance)?.mask = mask;
        Ok(())
    }

    /// Takes an instance away: it holds nothing from then on, until it is given a scene. `Hit::inst`
    /// counts paths, and those of later instances move up.
    ///
    /// # Errors
    ///
    /// There is no such instance.
    pub fn remove_instance(&mut self, instance: usize) -> Result<(), EditError> {
        let nothing = nothing_like(&self.before.structure);
        self.instance(instance)?.structure = nothing;
        Ok(())
    }

    /// Places a scene that every ray sees; returns the instance's number.
    pub fn add_instance(&mut self, scene: &Scene, world_from_object: Affine) -> usize {
        let instance = self.counts[1];
        self.counts[1] += 1;
        let structure = Arc::clone(&scene.structure);
        let placed = Placed { structure, world_from_object, mask: u32::MAX };
        self.instances.insert(instance, placed);
        instance
    }

    /// What is to be said of a mesh.
    fn mesh(&mut self, geom: usize) -> Result<&mut (Mesh, u32), EditError> {
        let missing = EditError::NoMesh { geom, meshes: self.counts[0] };
        match self.meshes.entry(geom) {
            Entry::Occupied(entry) => Ok(entry.into_mut()),
            Entry::Vacant(entry) => {
                let before = self.before.structure.geometries.get(geom).ok_or(missing)?;
                Ok(entry.insert((before.mesh.clone(), before.mask)))
            }
        }
    }

    /// What is to be said of an instance.
    fn instance(&mut self, instance: usize) -> Result<&mut Placed, EditError> {
        let missing = EditError::NoInstance { instance, instances: self.counts[1] };
        match self.instances.entry(instance) {
            Entry::Occupied(entry) => Ok(entry.into_mut()),
            Entry::Vacant(entry) => {
                let before = self.before.structure.instances.get(instance).ok_or(missing)?;
                Ok(entry.insert(Placed::again(before)))
            }
        }
    }

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
        if self.meshes.is_empty() && self.instances.is_empty() {
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
        let meshes = self.geometries().into_iter().map(|it| (it.mesh, it.mask)).collect();
        SceneBuilder { meshes, instances }
    }

    /// The meshes as they are to be.
    fn geometries(&self) -> Vec<Geometry> {
        let before = &self.before.structure.geometries;
        let mesh = |geom: usize| match (self.meshes.get(&geom), before.get(geom)) {
            (Some((mesh, mask)), _) => Some(Geometry { mesh: mesh.clone(), mask: *mask }),
            (None, before) => before.cloned(),
        };
        (0..self.counts[0]).filter_map(mesh).collect()
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

    /// Whether the vertices of a mesh are elsewhere, or it has other triangles; or why the tree
    /// cannot stay.
    fn reshaped(&self) -> Result<bool, Reason> {
        let before = &self.before.structure;
        if self.counts != [before.geometries.len(), before.instances.len()] {
            return Err(Reason::Different);
        }
        let mut reshaped = false;
        for (&geom, (mesh, _)) in &self.meshes {
            let old = &before.geometries[geom].mesh;
            if old.triangles().len() != mesh.triangles().len() {
                return Err(Reason::Different);
            }
            reshaped |= !old.is_same(mesh);
        }
        if reshaped && self.before.report.skipped.triangles > 0 {
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
        let instance =
            |at: usize| placements.instances.at(before.leaf_instances[at] as usize).bounds;
        let price = before.price.unwrap_or_else(|| price(&before.layout, &before.bounds));
        let few = !reshaped && moved.len() < before.instances.len() / 8 + 2;
        let touched = if few {
            let moved = |at: usize| moved.binary_search(&before.leaf_instances[at]).is_ok();
            touched(&before.layout, (before.bounds, price.areas), moved, instance)?
        } else {
            None
        };
        let swept = if touched.is_some() {
            touched
        } else {
            let fetch = |ids: &[u32], packed: &mut [Packed]| {
                Moved { geometries: &geometries, before }.fetch(ids, packed)
            };
            let content = Content { triangles: &fetch, instance: &instance };
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
            leaf_instances: before.leaf_instances.clone(),
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
) -> Result<Result<Vec<u32>, Reason>, SceneError> {
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
            if old.bounds.is_empty() != new.bounds.is_empty() {
                return Ok(Err(Reason::Different));
            }
            if old.bounds != new.bounds {
                moved.push(instance as u32);
            }
        }
    }
    Ok(Ok(moved))
}

/// A scene of nothing that can be placed into this one.
fn nothing_like(like: &Structure) -> Arc<Structure> {
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
        leaf_instances: Vec::new(),
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
        if let [Geometry { mesh, .. }] = self.geometries {
            return fetch_of(mesh, ids, packed);
        }
        let mut fit = true;
        for (&id, packed) in ids.iter().zip(packed) {
            let (geom, prim) = self.before.name(id);
            let mesh = &self.geometries[geom as usize].mesh;
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

/// Around all triangles that are fit for a scene.
fn bounds_of(geometries: &[Geometry]) -> Aabb {
    let of_chunk = |mesh: &Mesh, first: usize, count: usize| {
        let sound = (first..first + count).filter(|&prim| mesh.defect(prim).is_none());
        let corners = sound.filter_map(|prim| mesh.corners(prim));
        corners.fold(Aabb::EMPTY, |all, corners| all.union(&Aabb::of_points(&corners)))
    };
    let mut all = Aabb::EMPTY;
    for Geometry { mesh, .. } in geometries {
        let chunks = parallel::map_chunks(mesh.triangles(), CHUNK, |first, triangles| {
            of_chunk(mesh, first, triangles.len())
        });
        all = chunks.iter().fold(all, |all, chunk| all.union(chunk));
    }
    all
}
