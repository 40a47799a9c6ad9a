//! Edits: what moved, what came and went, committed as a new snapshot that shares what stayed.
//!
//! The old snapshot goes on answering; whoever traces it is never waited for and never waits. What a
//! commit does to the tree does not show in answers, only in their price: where most triangles and instances are the same ones, the
//! tree is kept: its boxes follow (`layout/refit/`), what went leaves it and what came is put into it (`layout/exchange/`), or what has
//! decayed of it is built anew (`layout/repair.rs`); all of it is built anew where that is not so, or where the boxes have grown so much
//! that it pays.

mod changes;
mod commit;
mod fates;
mod fetch;
mod follow;
mod ledger;
mod mend;
mod nothing;
mod said;
mod spans;
mod sprouts;

use super::Scene;
use super::builder::Placed;
use crate::geometry::{Mesh, Shape};
use crate::math::Affine;
use crate::memory::Array;
use crate::trace::structure::Geometry;
use alloc::collections::BTreeMap;
use alloc::collections::btree_map::Entry;
use alloc::sync::Arc;
use core::time::Duration;
pub(super) use ledger::Ledger;
use nothing::nothing_like;
pub use said::{Action, Commit, Parts, Reason};

/// A tree whose boxes cost this many times what they cost when it was built is built anew.
///
/// C. Lauterbach, S.-E. Yoon, D. Manocha, D. Tuft, "RT-DEFORM: Interactive Ray Tracing of Dynamic
/// Scenes using BVHs", IEEE Symposium on Interactive Ray Tracing, 2006, rebuild where boxes have
/// grown by 40 %.
pub const DECAY_MAX: f64 = 1.4;

/// A repaired tree that costs more than this is built anew after all, where nothing else is asked for: half of what
/// [`DECAY_MAX`] allows.
const WORTH_KEEPING: f64 = 1.2;

/// What a commit may do to a tree. No policy changes an answer.
///
/// A tree whose leaves hold most of the triangles and instances that it held can be *refitted*: it stays, its boxes follow, what came is
/// put where it costs least. It can also be *repaired*: small subtrees whose boxes are as good as when they were built stay, everything else is built anew
/// around them, in a fraction of the time of a build. Where that is not so, it is rebuilt whatever the policy.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Policy {
    /// Refit while the tree stays good enough ([`DECAY_MAX`]); then repair, and rebuild where that does not help.
    #[default]
    Auto,
    /// Refit.
    Refit,
    /// Refit and repair.
    Repair,
    /// Rebuild.
    Rebuild,
    /// About so many rays are traced between one commit and the next: mend the tree when what rays lost for want of it has come to what
    /// mending costs, so that the total time of commits and rays is least. What commits and rays take is measured: rays in slices are
    /// timed, single ones are told by [`Scene::note_traced`]. What is chosen depends on the clock, answers do not.
    Rays(u64),
    /// A commit may take so long: the best tree that, by what earlier ones took, can be had in that time. A refit is made however
    /// long it takes.
    Budget(Duration),
}

/// What an edit names that is not there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EditError {
    /// No such mesh or other shape.
    #[error("there is no mesh or shape {geom}: the scene has {geometries}")]
    NoGeometry {
        /// What was asked for.
        geom: usize,
        /// How many there are.
        geometries: usize,
    },
    /// Vertices were to be moved of what has none.
    #[error("shape {geom} is made of {kind}s, not triangles; use `set_shape`")]
    NoMesh {
        /// What was asked for.
        geom: usize,
        /// What it is made of.
        kind: &'static str,
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
    /// Meshes and other shapes that are others now, or new.
    geometries: BTreeMap<usize, Geometry>,
    /// Instances that are others now, or new.
    instances: BTreeMap<usize, Placed>,
    /// How many there are, the new ones included.
    counts: [usize; 2],
    /// A snapshot that nobody needs any more, perhaps.
    spare: Option<Scene>,
    /// What the commit may do to the tree.
    pub policy: Policy,
}

impl Scene {
    /// Begins an edit. Costs nothing: only what changes is written down.
    pub fn edit(&self) -> Edit {
        Edit {
            before: self.clone(),
            geometries: BTreeMap::new(),
            instances: BTreeMap::new(),
            counts: [self.structure.geometries.len(), self.structure.instances.len()],
            spare: None,
            policy: Policy::default(),
        }
    }
}

impl Edit {
    /// Hands over a snapshot that is not needed any more, the one before the one that is edited, say: if nobody else has it, a
    /// refit writes over its memory instead of asking the system for as much again, which is a tenth of the time of a refit.
    pub fn reuse(&mut self, old: Scene) {
        self.spare = Some(old);
    }

    /// Moves the vertices of a mesh; its triangles stay.
    ///
    /// # Errors
    ///
    /// There is no such mesh, or it is no mesh.
    pub fn set_positions(
        &mut self,
        geom: usize,
        positions: impl Into<Array<[f32; 3]>>,
    ) -> Result<(), EditError> {
        let geometry = self.geometry(geom)?;
        let kind = geometry.shape.kind();
        let mesh = geometry.mesh().ok_or(EditError::NoMesh { geom, kind })?;
        geometry.shape = mesh.with_positions(positions).into();
        Ok(())
    }

    /// Puts another mesh, or primitives of another kind, in the place of one.
    ///
    /// # Errors
    ///
    /// There is no such mesh or shape.
    pub fn set_shape(&mut self, geom: usize, shape: impl Into<Shape>) -> Result<(), EditError> {
        self.geometry(geom)?.shape = shape.into();
        Ok(())
    }

    /// Which rays see a mesh or a shape: those whose mask has a bit in common with `mask`.
    ///
    /// # Errors
    ///
    /// There is no such mesh or shape.
    pub fn set_mask(&mut self, geom: usize, mask: u32) -> Result<(), EditError> {
        self.geometry(geom)?.mask = mask;
        Ok(())
    }

    /// Takes a mesh or a shape away; its number stays unused.
    ///
    /// # Errors
    ///
    /// There is no such mesh or shape.
    pub fn remove_shape(&mut self, geom: usize) -> Result<(), EditError> {
        self.set_shape(geom, Mesh::default())
    }

    /// Adds a mesh, or primitives of another kind, that every ray sees; returns its `geom`.
    pub fn add_shape(&mut self, shape: impl Into<Shape>) -> usize {
        let geom = self.counts[0];
        self.counts[0] += 1;
        self.geometries.insert(geom, Geometry { shape: shape.into(), mask: u32::MAX });
        geom
    }

    /// Moves an instance, which is there at all times then.
    ///
    /// # Errors
    ///
    /// There is no such instance. What is wrong with the map is said by [`Edit::commit`].
    pub fn set_transform(
        &mut self,
        instance: usize,
        world_from_object: Affine,
    ) -> Result<(), EditError> {
        let placed = self.instance(instance)?;
        placed.world_from_object = world_from_object;
        placed.steps = None;
        Ok(())
    }

    /// Moves an instance, which is elsewhere at other times then: its maps at time steps, as
    /// [`SceneBuilder::instance_moving`](super::SceneBuilder::instance_moving) takes them.
    ///
    /// # Errors
    ///
    /// There is no such instance. What is wrong with a step is said by [`Edit::commit`].
    pub fn set_motion(&mut self, instance: usize, steps: &[Affine]) -> Result<(), EditError> {
        let placed = self.instance(instance)?;
        (placed.world_from_object, placed.steps) = Placed::way(steps);
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
        self.add_instance_moving(scene, &[world_from_object])
    }

    /// Places a scene that moves, see [`Edit::set_motion`], and that every ray sees; returns the instance's number.
    pub fn add_instance_moving(&mut self, scene: &Scene, steps: &[Affine]) -> usize {
        let instance = self.counts[1];
        self.counts[1] += 1;
        let structure = Arc::clone(&scene.structure);
        let (world_from_object, steps) = Placed::way(steps);
        let placed = Placed { structure, world_from_object, mask: u32::MAX, steps };
        self.instances.insert(instance, placed);
        instance
    }

    /// What is to be said of a mesh or a shape.
    fn geometry(&mut self, geom: usize) -> Result<&mut Geometry, EditError> {
        let missing = EditError::NoGeometry { geom, geometries: self.counts[0] };
        match self.geometries.entry(geom) {
            Entry::Occupied(entry) => Ok(entry.into_mut()),
            Entry::Vacant(entry) => {
                let before = self.before.structure.geometries.get(geom).ok_or(missing)?;
                Ok(entry.insert(before.clone()))
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
}
