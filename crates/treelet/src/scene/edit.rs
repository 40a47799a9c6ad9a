//! Edits: what moved, what came and went, committed as a new snapshot that shares what stayed.
//!
//! The old snapshot goes on answering; whoever traces it is never waited for and never waits. What a
//! commit does to the tree does not show in answers, only in their price: where the triangles and
//! instances are the same ones, the tree is kept and its boxes follow (`layout/refit.rs`); it is built
//! anew where that is not so, or where the boxes have grown so much that it pays.

use super::assemble::{COVER_MAX, Level};
use super::builder::{BuildOptions, LayoutChoice, Placed, SceneBuilder};
use super::place::place_instances;
use super::report::BuildReport;
use super::{Scene, SceneError, assemble};
use crate::bounds::Aabb;
use crate::context::clock::Stopwatch;
use crate::context::{Cancel, parallel};
use crate::geometry::Mesh;
use crate::geometry::mesh::COORDINATE_MAX;
use crate::layout::compact::pack::pack;
use crate::layout::lower::Packed;
use crate::layout::refit::{self, Content, refit};
use crate::math::Affine;
use crate::memory::Array;
use crate::trace::structure::{Geometry, Layout, Structure};
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
    description: SceneBuilder,
    /// Instances that are to become empty.
    removed: Vec<usize>,
    changed: bool,
    /// What the commit may do to the tree.
    pub update: Update,
}

impl Scene {
    /// Begins an edit. Cost: O(meshes + instances).
    pub fn edit(&self) -> Edit {
        let level = &*self.structure;
        let meshes = level.geometries.iter().map(|it| (it.mesh.clone(), it.mask)).collect();
        let placed = level.instances.iter().map(|it| Placed {
            structure: Arc::clone(&it.structure),
            world_from_object: it.world_from_object,
            mask: it.mask,
        });
        let description = SceneBuilder { meshes, instances: placed.collect() };
        Edit {
            before: self.clone(),
            description,
            removed: Vec::new(),
            changed: false,
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
        self.changed = true;
        self.description.meshes.push((mesh, u32::MAX));
        self.description.meshes.len() - 1
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
        self.removed.retain(|&removed| removed != instance);
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

    /// Takes an instance away; its number stays unused. `Hit::inst` counts paths, and those of later
    /// instances move up.
    ///
    /// # Errors
    ///
    /// There is no such instance.
    pub fn remove_instance(&mut self, instance: usize) -> Result<(), EditError> {
        self.instance(instance)?;
        self.removed.push(instance);
        Ok(())
    }

    /// Places a scene that every ray sees; returns the instance's number.
    pub fn add_instance(&mut self, scene: &Scene, world_from_object: Affine) -> usize {
        self.changed = true;
        let structure = Arc::clone(&scene.structure);
        self.description.instances.push(Placed { structure, world_from_object, mask: u32::MAX });
        self.description.instances.len() - 1
    }

    fn mesh(&mut self, geom: usize) -> Result<&mut (Mesh, u32), EditError> {
        self.changed = true;
        let meshes = self.description.meshes.len();
        self.description.meshes.get_mut(geom).ok_or(EditError::NoMesh { geom, meshes })
    }

    fn instance(&mut self, instance: usize) -> Result<&mut Placed, EditError> {
        self.changed = true;
        let instances = self.description.instances.len();
        let placed = self.description.instances.get_mut(instance);
        placed.ok_or(EditError::NoInstance { instance, instances })
    }

    /// Makes the new snapshot. `options` say how a tree is built if one has to be; instructions and
    /// layout stay what they were unless it is.
    ///
    /// # Errors
    ///
    /// As [`SceneBuilder::build`]; the old snapshot stays what it is.
    pub fn commit(mut self, options: &BuildOptions<'_>) -> Result<Commit, SceneError> {
        let watch = Stopwatch::start();
        let done = |scene, action, reason, decay| {
            Ok(Commit { scene, action, reason, decay, time: watch.elapsed() })
        };
        if !self.changed {
            return done(self.before, Action::Kept, Reason::Unchanged, 1.0);
        }
        self.empty_removed(options)?;
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
        done(assemble::assemble(self.description, options)?, Action::Rebuilt, reason, 1.0)
    }

    /// Puts an empty scene where an instance was removed.
    fn empty_removed(&mut self, options: &BuildOptions<'_>) -> Result<(), SceneError> {
        if self.removed.is_empty() {
            return Ok(());
        }
        let layout = Some(match self.before.structure.layout {
            Layout::Wide8(_) => LayoutChoice::Wide8,
            Layout::Wide16(_) => LayoutChoice::Wide16,
            Layout::Compact(_) => LayoutChoice::Compact,
        });
        let empty = Scene::builder().build(&BuildOptions { layout, ..options.clone() })?;
        for &instance in &self.removed {
            if let Some(placed) = self.description.instances.get_mut(instance) {
                placed.structure = Arc::clone(&empty.structure);
            }
        }
        Ok(())
    }

    /// The scene with the tree that it has, and how much dearer that has become; or why not.
    fn refit(
        &self,
        options: &BuildOptions<'_>,
    ) -> Result<Result<(Scene, f64), Reason>, SceneError> {
        let before = &*self.before.structure;
        let Self { description, .. } = self;

        // The same triangles must be in the tree, and the same instances.
        let triangles = |mesh: &Mesh| mesh.triangles().len();
        let meshes = before.geometries.iter().map(|it| triangles(&it.mesh));
        if !meshes.eq(description.meshes.iter().map(|(mesh, _)| triangles(mesh)))
            || before.instances.len() != description.instances.len()
        {
            return Ok(Err(Reason::Different));
        }
        if self.before.report.skipped.triangles > 0 {
            return Ok(Err(Reason::Unfit));
        }
        // Without instances nobody asks where the meshes are before their boxes are known.
        let alone = description.instances.is_empty();
        let around = if alone { Aabb::EMPTY } else { bounds_of(&description.meshes) };
        let mut report = BuildReport::default();
        let mut placements =
            place_instances(description.instances.clone(), around, options, &mut report)?;
        let emptiness = |at: usize| before.instances[at].bounds.is_empty();
        let new = placements.instances.iter().enumerate();
        if new.clone().any(|(at, instance)| instance.bounds.is_empty() != emptiness(at)) {
            return Ok(Err(Reason::Different));
        }
        let mixed = new.clone().find(|(_, it)| !it.structure.layout.is_as(&before.layout));
        if let Some((instance, _)) = mixed {
            return Err(SceneError::MixedLayouts { instance });
        }

        // Sweep.
        let meshes: Vec<&Mesh> = description.meshes.iter().map(|(mesh, _)| mesh).collect();
        let moved = Moved { meshes: &meshes, before };
        let instances = &placements.instances;
        let instance = |at: usize| instances[before.leaf_instances[at] as usize].bounds;
        let fetch = |ids: &[u32], packed: &mut [Packed]| moved.fetch(ids, packed);
        let content = Content { triangles: &fetch, instance: &instance };
        let Some(swept) = sweep(&before.layout, &content, &options.context.cancel)? else {
            return Ok(Err(Reason::Unfit));
        };
        if alone {
            placements = place_instances(Vec::new(), swept.bounds, options, &mut report)?;
        }

        let repeats = placements.instances.iter().any(|it| it.structure.repeats);
        let built = before.built_price.unwrap_or_else(|| price(&before.layout));
        let geometry = |(mesh, mask): &(Mesh, u32)| Geometry { mesh: mesh.clone(), mask: *mask };
        let level = Level {
            level: before.level,
            geometries: description.meshes.iter().map(geometry).collect(),
            first_ids: before.first_ids.clone(),
            placements,
            layout: swept.layout,
            bounds: swept.bounds,
            cover: swept.cover,
            leaf_instances: before.leaf_instances.clone(),
            repeats: before.repeats || repeats,
        };
        let mut structure = level.structure();
        structure.built_price = Some(built);
        let report = Arc::clone(&self.before.report);
        Ok(Ok((Scene { structure: Arc::new(structure), report }, swept.price / built)))
    }
}

/// A layout with new boxes, and what follows from them.
struct Swept {
    layout: Layout,
    bounds: Aabb,
    cover: Vec<Aabb>,
    price: f64,
}

fn sweep(
    layout: &Layout,
    content: &Content<
        '_,
        impl Fn(&[u32], &mut [Packed]) -> bool + Sync,
        impl Fn(usize) -> Aabb + Sync,
    >,
    cancel: &Cancel,
) -> Result<Option<Swept>, SceneError> {
    let swept = |layout, cover, bounds, price| Some(Swept { layout, bounds, cover, price });
    Ok(match layout {
        Layout::Wide8(wide) => refit(wide, content, cancel)?.and_then(|it| {
            let cover = it.cover(COVER_MAX);
            swept(Layout::Wide8(it.wide), cover, it.bounds, it.price)
        }),
        Layout::Wide16(wide) => refit(wide, content, cancel)?.and_then(|it| {
            let cover = it.cover(COVER_MAX);
            swept(Layout::Wide16(it.wide), cover, it.bounds, it.price)
        }),
        Layout::Compact(wide) => match refit(wide, content, cancel)? {
            None => None,
            Some(it) => {
                let packed = Layout::Compact(pack(&it.wide, cancel)?);
                swept(packed, it.cover(COVER_MAX), it.bounds, it.price)
            }
        },
    })
}

/// What a line pays in a layout.
fn price(layout: &Layout) -> f64 {
    match layout {
        Layout::Wide8(wide) => refit::price(wide),
        Layout::Wide16(wide) => refit::price(wide),
        Layout::Compact(wide) => refit::price(wide),
    }
}

/// Where triangles are now.
struct Moved<'a> {
    meshes: &'a [&'a Mesh],
    before: &'a Structure,
}

impl Moved<'_> {
    /// All numbers of vertices first, then all vertices: loads that do not wait for each other.
    /// Whether all triangles are fit for a scene.
    fn fetch(&self, ids: &[u32], packed: &mut [Packed]) -> bool {
        if let [mesh] = self.meshes {
            return fetch_of(mesh, ids, packed);
        }
        let mut fit = true;
        for (&id, packed) in ids.iter().zip(packed) {
            let (geom, prim) = self.before.name(id);
            let mesh = self.meshes[geom as usize];
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
fn bounds_of(meshes: &[(Mesh, u32)]) -> Aabb {
    let of_chunk = |mesh: &Mesh, first: usize, count: usize| {
        let sound = (first..first + count).filter(|&prim| mesh.defect(prim).is_none());
        let corners = sound.filter_map(|prim| mesh.corners(prim));
        corners.fold(Aabb::EMPTY, |all, corners| all.union(&Aabb::of_points(&corners)))
    };
    let mut all = Aabb::EMPTY;
    for (mesh, _) in meshes {
        let chunks = parallel::map_chunks(mesh.triangles(), CHUNK, |first, triangles| {
            of_chunk(mesh, first, triangles.len())
        });
        all = chunks.iter().fold(all, |all, chunk| all.union(chunk));
    }
    all
}
