//! What can be wrong with a scene or a call.

use crate::build::BuildError;
use crate::context::Cancelled;
use crate::geometry::Defect;
use crate::memory::OutOfMemory;
use crate::simd::Level;

/// Why there is no scene.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A triangle names a vertex that is missing, not finite or too far away.
    #[error("mesh {geom}, triangle {prim}: {defect}; mend the mesh, or build with `Invalid::Skip`")]
    Triangle {
        /// Which mesh of the scene.
        geom: usize,
        /// Which triangle of it.
        prim: usize,
        /// What is wrong.
        defect: Defect,
    },
    /// The time steps of a mesh differ in their numbers of vertices.
    #[error(
        "mesh {geom}: time step {step} has {vertices} vertices, the first has {first}; give every step as many"
    )]
    Steps {
        /// Which mesh of the scene.
        geom: usize,
        /// The first step that differs.
        step: usize,
        /// How many vertices it has.
        vertices: usize,
        /// How many the first step has.
        first: usize,
    },
    /// A primitive that is no triangle is not finite, or too far away.
    #[error("geometry {geom}, {kind} {prim}: {defect}; mend it, or build with `Invalid::Skip`")]
    Primitive {
        /// Which geometry of the scene.
        geom: usize,
        /// What its primitives are.
        kind: &'static str,
        /// Which of them.
        prim: usize,
        /// What is wrong.
        defect: Defect,
    },
    /// An instance's map is singular, not finite, extreme, or puts it too far away.
    #[error("instance {instance}: {defect}; mend the transform, or build with `Invalid::Skip`")]
    Instance {
        /// Which instance of the scene.
        instance: usize,
        /// What is wrong.
        defect: InstanceDefect,
    },
    /// Instances multiply to more paths than `Hit::inst` can name.
    #[error("the instances of instances make more than 2^64 paths; flatten some levels")]
    TooManyPaths,
    /// The chosen instructions are not there.
    #[error("this processor has no {}; choose a level that `Level::is_available`", level.name())]
    Level {
        /// What was asked for.
        level: Level,
    },
    /// A scene was placed into one of another layout, which one walk cannot enter.
    #[error(
        "instance {instance} is of a scene with another layout; build both with the same `layout`"
    )]
    MixedLayouts {
        /// Which instance of the scene.
        instance: usize,
    },
    /// No tree could be built.
    #[error(transparent)]
    Build(#[from] BuildError),
}

impl From<Cancelled> for SceneError {
    fn from(cancelled: Cancelled) -> Self {
        Self::Build(cancelled.into())
    }
}

impl From<OutOfMemory> for SceneError {
    fn from(error: OutOfMemory) -> Self {
        Self::Build(error.into())
    }
}

impl SceneError {
    /// Whether the build was stopped by its caller.
    pub fn is_cancelled(&self) -> bool {
        matches!(self, Self::Build(BuildError::Cancelled(_)))
    }

    /// What was wrong with a shape that was built alone, as that of its number.
    pub(super) fn of_shape(mut self, number: usize) -> Self {
        if let Self::Triangle { geom, .. }
        | Self::Steps { geom, .. }
        | Self::Primitive { geom, .. } = &mut self
        {
            *geom = number;
        }
        self
    }
}

/// What makes an instance unfit for a scene.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InstanceDefect {
    /// No map leads back from the world to the object.
    #[error("the matrix {rows:?} is singular or has no inverse in f32")]
    Singular {
        /// The matrix.
        rows: [[f32; 4]; 3],
    },
    /// An entry is NaN or infinite.
    #[error("the matrix {rows:?} has an entry that is not finite")]
    NotFinite {
        /// The matrix.
        rows: [[f32; 4]; 3],
    },
    /// The map lengthens or shortens too much.
    #[error("the matrix {rows:?} scales by more than 2^80, or less than 2^-80")]
    Scale {
        /// The matrix.
        rows: [[f32; 4]; 3],
    },
    /// The map of a time step cannot be used.
    #[error(
        "time step {step}: the matrix {rows:?} is singular, not finite, or scales by more than 2^80"
    )]
    Step {
        /// Which step.
        step: usize,
        /// The matrix.
        rows: [[f32; 4]; 3],
    },
    /// Between two time steps lies a map that is singular.
    #[error("time step {step} mirrors, the one before does not, or the other way round")]
    Mirrored {
        /// The later one.
        step: usize,
    },
    /// Part of the placed object lies beyond `±2^62`.
    #[error("its box {lo:?} .. {hi:?} lies partly beyond ±2^62")]
    TooFar {
        /// Least corner of its box.
        lo: [f32; 3],
        /// Greatest corner.
        hi: [f32; 3],
    },
}

/// Two slices that belong together differ in length; nothing was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{rays} rays but room for {answers} answers; the two must be equal")]
pub struct WrongLength {
    /// Length of the rays.
    pub rays: usize,
    /// Length of the answers.
    pub answers: usize,
}
