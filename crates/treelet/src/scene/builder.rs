//! Describing a scene and building it.

use super::assemble;
use super::{Pilot, Plan, Quality, Scene, SceneError};
use crate::bounds::Aabb;
use crate::build::{Builder, Info};
use crate::context::Context;
use crate::geometry::{Mesh, Shape};
use crate::layout::{compact, wide};
use crate::math::Affine;
use crate::optimize::Optimizer;
use crate::simd::Level;
use crate::trace::moving::MovingMesh;
use crate::trace::placements::{BLOCK, Instance};
use crate::trace::structure::{Geometry, Structure};
use alloc::sync::Arc;
use alloc::vec::Vec;

/// What to do with triangles and instances that cannot be used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Invalid {
    /// Stop with an error that names the first one.
    Error,
    /// Leave them out, and count them in the report. Numbers of the others stay as they are.
    #[default]
    Skip,
}

/// A packed form: one of [`crate::layout::ALL`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LayoutChoice {
    /// [`crate::layout::wide::INFO_8`].
    Wide8,
    /// [`crate::layout::wide::INFO_16`].
    Wide16,
    /// [`crate::layout::compact::INFO`]: half the bytes, for scenes that outgrow the cache.
    Compact,
}

impl LayoutChoice {
    /// Every layout, in the catalogue's order.
    pub const ALL: &[Self] = &[Self::Wide8, Self::Wide16, Self::Compact];

    /// The catalogue's entry.
    pub fn info(self) -> &'static Info {
        match self {
            Self::Wide8 => &wide::INFO_8,
            Self::Wide16 => &wide::INFO_16,
            Self::Compact => &compact::INFO,
        }
    }

    /// 16 children fill the vectors of AVX-512, 8 those of AVX2; with narrower vectors (SSE4.2, NEON,
    /// `simd128`), fewer boxes that are tested in vain count for more than fewer visits.
    pub fn best_for(level: Level) -> Self {
        match level {
            #[cfg(target_arch = "x86_64")]
            Level::Avx512 => Self::Wide16,
            _ => Self::Wide8,
        }
    }
}

/// How a scene is built.
#[derive(Clone)]
pub struct BuildOptions<'a> {
    /// How much time to spend on a tree that is traced faster. Answers do not change. [`Quality::Rays`] and
    /// [`Quality::Auto`] choose only where neither builder nor optimisers are given.
    pub quality: Quality,
    /// Makes the tree instead of the quality's own builder: one of [`crate::build::ALL`], or one
    /// with other options. No optimiser runs after it but those asked for here.
    pub builder: Option<&'a dyn Builder>,
    /// Improve the tree instead of the quality's own optimisers, one after the other: of
    /// [`crate::optimize::ALL`], or with other options.
    pub optimizers: Option<&'a [&'a dyn Optimizer]>,
    /// What to do with input that cannot be used.
    pub invalid: Invalid,
    /// The instructions that walk the scene; the best that this processor has by default. All give
    /// the same answers.
    pub level: Level,
    /// The packed form of the tree; by default what is best for `level`. A scene and those placed
    /// into it must agree.
    pub layout: Option<LayoutChoice>,
    /// Whether meshes that move, and scenes of nothing but instances of which some move, may have several trees, each for a
    /// part of the time, where that makes rays cheaper: at most [`SEGMENTS_MAX`](super::SEGMENTS_MAX) for each.
    pub temporal_splits: bool,
    /// Whether large instances may be opened: the tree then holds several boxes in place of one that is mostly
    /// empty, at most twice as many as there are instances in all. Answers do not change. Quick builds never do it.
    pub open_instances: bool,
    /// Some of the rays to come: for [`Quality::Rays`] and [`Quality::Auto`], which otherwise make their own.
    pub pilot: Pilot<'a>,
    /// Cancels and watches the build.
    pub context: Context<'a>,
}

impl<'a> BuildOptions<'a> {
    /// What the options come to.
    pub fn plan(&self) -> Plan<'a> {
        Plan::new(self)
    }
}

impl Default for BuildOptions<'_> {
    fn default() -> Self {
        Self {
            quality: Quality::default(),
            builder: None,
            optimizers: None,
            invalid: Invalid::default(),
            level: Level::best(),
            layout: None,
            temporal_splits: true,
            open_instances: true,
            pilot: Pilot::default(),
            context: Context::default(),
        }
    }
}

/// A scene to be: geometries and instances in the order in which hits will number them.
#[derive(Clone, Debug, Default)]
pub struct SceneBuilder {
    pub(super) geometries: Vec<Geometry>,
    pub(super) instances: Crowd,
    /// Meshes that move and have trees already, by the number of the geometry.
    pub(super) known: Vec<(usize, MovingMesh)>,
}

/// What is to be placed, in blocks as the scene will have them, so that nothing moves once more.
#[derive(Clone, Debug, Default)]
pub(super) struct Crowd {
    /// All but the last are full.
    pub(super) blocks: Vec<Draft>,
}

/// A block of instances that nobody has placed yet: written down where they stay, since what they are copied
/// to costs as much as what is done to them.
#[derive(Clone, Debug, Default)]
pub(super) struct Draft {
    pub(super) items: Vec<Instance>,
    /// Those that move, in rising order, with the maps of all time steps.
    pub(super) steps: Vec<(usize, Arc<[Affine]>)>,
}

impl Draft {
    #[inline]
    fn push(&mut self, placed: Placed) {
        let Placed { structure, world_from_object, mask, steps } = placed;
        if let Some(steps) = steps {
            self.steps.push((self.items.len(), steps));
        }
        self.items.push(Instance {
            columns: [[0.0; 4]; 4],
            corners: Instance::corners(&Aabb::EMPTY),
            structure,
            rank: 0,
            mask,
            motion: None,
            world_from_object,
        });
    }
}

impl FromIterator<Placed> for Draft {
    fn from_iter<I: IntoIterator<Item = Placed>>(placed: I) -> Self {
        let placed = placed.into_iter();
        let items = Vec::with_capacity(placed.size_hint().0.min(BLOCK));
        let mut draft = Self { items, steps: Vec::new() };
        placed.for_each(|placed| draft.push(placed));
        draft
    }
}

impl Crowd {
    pub(super) fn len(&self) -> usize {
        let last = self.blocks.last().map_or(0, |block| block.items.len());
        self.blocks.len().saturating_sub(1) * BLOCK + last
    }

    #[inline]
    pub(super) fn push(&mut self, placed: Placed) {
        match self.blocks.last_mut() {
            Some(block) if block.items.len() < BLOCK => block.push(placed),
            _ => self.push_block(placed),
        }
    }

    /// After a full block the next will be as full.
    #[cold]
    fn push_block(&mut self, placed: Placed) {
        let room = if self.blocks.is_empty() { 1 } else { BLOCK };
        let mut block = Draft { items: Vec::with_capacity(room), steps: Vec::new() };
        block.push(placed);
        self.blocks.push(block);
    }
}

impl FromIterator<Placed> for Crowd {
    fn from_iter<I: IntoIterator<Item = Placed>>(placed: I) -> Self {
        let mut crowd = Self::default();
        placed.into_iter().for_each(|placed| crowd.push(placed));
        crowd
    }
}

/// A scene to be placed.
#[derive(Clone, Debug)]
pub(super) struct Placed {
    pub(super) structure: Arc<Structure>,
    pub(super) world_from_object: Affine,
    pub(super) mask: u32,
    /// The maps of all time steps, if it moves.
    pub(super) steps: Option<Arc<[Affine]>>,
}

impl Placed {
    /// The map of the first time step, and those of all if there are several.
    pub(super) fn way(steps: &[Affine]) -> (Affine, Option<Arc<[Affine]>>) {
        let first = steps.first().copied().unwrap_or_default();
        (first, (steps.len() > 1).then(|| steps.into()))
    }
}

impl SceneBuilder {
    /// Adds a mesh that every ray sees; its `geom` is the number of meshes and other shapes before it.
    #[must_use]
    pub fn mesh(self, mesh: Mesh) -> Self {
        self.mesh_masked(mesh, u32::MAX)
    }

    /// Adds a mesh that is met by rays whose mask has a bit in common with `mask`.
    #[must_use]
    pub fn mesh_masked(self, mesh: Mesh, mask: u32) -> Self {
        self.shape_masked(mesh, mask)
    }

    /// Adds primitives of any kind, which every ray sees; numbered as meshes are.
    ///
    /// ```
    /// use treelet::geometry::Spheres;
    /// use treelet::{BuildOptions, Ray, Scene};
    ///
    /// let spheres = Spheres::new([[0.0, 0.0, 5.0, 1.0], [0.0, 0.0, 9.0, 2.0]]);
    /// let scene = Scene::builder().shape(spheres).build(&BuildOptions::default())?;
    /// let ray = Ray::new([0.0; 3], [0.0, 0.0, 1.0]);
    /// let hits: Vec<_> = scene.all(&ray).iter().map(|hit| (hit.t, hit.prim)).collect();
    /// assert_eq!(hits, [(4.0, 0), (7.0, 1)]);
    /// # Ok::<(), treelet::SceneError>(())
    /// ```
    #[must_use]
    pub fn shape(self, shape: impl Into<Shape>) -> Self {
        self.shape_masked(shape, u32::MAX)
    }

    /// Adds primitives of any kind that are met by rays whose mask has a bit in common with `mask`.
    #[must_use]
    pub fn shape_masked(mut self, shape: impl Into<Shape>, mask: u32) -> Self {
        self.geometries.push(Geometry { shape: shape.into(), mask });
        self
    }

    /// Places a scene into this one; it is shared, not copied. Mirrored and non-uniformly scaled
    /// maps are fine; a singular one, one that f32 cannot invert, or one that scales by more than
    /// `2^80` either way is invalid input. A ray whose direction, seen from inside, leaves the range
    /// of [`crate::Ray::is_valid`] meets nothing there: none of unit length does.
    #[must_use]
    pub fn instance(self, scene: &Scene, world_from_object: Affine) -> Self {
        self.instance_masked(scene, world_from_object, u32::MAX)
    }

    /// Places a scene that is met by rays whose mask has a bit in common with `mask`.
    #[must_use]
    pub fn instance_masked(mut self, scene: &Scene, world_from_object: Affine, mask: u32) -> Self {
        let structure = Arc::clone(&scene.structure);
        self.instances.push(Placed { structure, world_from_object, mask, steps: None });
        self
    }

    /// Places a scene that moves: its maps at time steps that are equally spaced over times `0 ..= 1`. Between two
    /// steps, translation and stretch change linearly, and rotations turn at constant speed along the shorter
    /// way, so that nothing shrinks while it turns: an object that turns by more than half a turn needs steps between.
    /// One step does not move; none is the identity. No step may mirror unless all do.
    ///
    /// ```
    /// use treelet::{Affine, BuildOptions, Mesh, Ray, Scene};
    ///
    /// let mesh = Mesh::new([[1.0, -0.1, -0.1], [1.0, 0.1, -0.1], [1.0, 0.0, 0.2]], [[0, 1, 2]]);
    /// let blade = Scene::builder().mesh(mesh).build(&BuildOptions::default())?;
    /// let turn = |angle| Affine::rotation([0.0, 0.0, 1.0], angle);
    /// let quarter = core::f32::consts::FRAC_PI_2;
    /// let scene = Scene::builder()
    ///     .instance_moving(&blade, &[turn(0.0), turn(quarter)])
    ///     .build(&BuildOptions::default())?;
    /// // Half way, it is half turned, and as far from the axis as before.
    /// let ray = Ray::new([0.0; 3], [0.5_f32.sqrt(), 0.5_f32.sqrt(), 0.0]);
    /// assert!((scene.closest(&ray.at_time(0.5)).unwrap().t - 1.0).abs() < 1e-6);
    /// assert!(scene.closest(&ray).is_none());
    /// # Ok::<(), treelet::SceneError>(())
    /// ```
    #[must_use]
    pub fn instance_moving(self, scene: &Scene, steps: &[Affine]) -> Self {
        self.instance_moving_masked(scene, steps, u32::MAX)
    }

    /// The same, met by rays whose mask has a bit in common with `mask`.
    #[must_use]
    pub fn instance_moving_masked(mut self, scene: &Scene, steps: &[Affine], mask: u32) -> Self {
        let structure = Arc::clone(&scene.structure);
        let (world_from_object, steps) = Placed::way(steps);
        self.instances.push(Placed { structure, world_from_object, mask, steps });
        self
    }

    /// Builds the scene on the caller's rayon pool. Nothing at all makes a scene that is never hit.
    ///
    /// # Errors
    ///
    /// Invalid input where [`Invalid::Error`] is chosen, a builder's option out of range, more than
    /// 2^29 - 8 primitives on this level, more than 2^64 paths, cancellation, memory.
    pub fn build(self, options: &BuildOptions<'_>) -> Result<Scene, SceneError> {
        assemble::assemble(self, options)
    }
}
