//! Triangle meshes.

use crate::bounds::Aabb;
use crate::math::pose::{Moment, between};
use crate::memory::Array;
use alloc::sync::Arc;
use alloc::vec::Vec;

/// Coordinates beyond `±2^62` (about 4.6e18) are treated like NaN: products of three differences
/// would leave f32.
pub const COORDINATE_MAX: f32 = 4_611_686_018_427_387_904.0;

/// A triangle mesh: vertex positions and, for each triangle, three indices into them.
///
/// Cheap to clone: the arrays are shared. Nothing is checked here; building a scene checks.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    positions: Array<[f32; 3]>,
    triangles: Array<[u32; 3]>,
    /// Vertex positions at the later time steps, if the mesh moves.
    later: Option<Arc<[Array<[f32; 3]>]>>,
}

impl Mesh {
    /// A mesh over the given arrays: a `Vec` moves in without a copy, an [`Array`] is shared.
    pub fn new(
        positions: impl Into<Array<[f32; 3]>>,
        triangles: impl Into<Array<[u32; 3]>>,
    ) -> Self {
        Self { positions: positions.into(), triangles: triangles.into(), later: None }
    }

    /// A mesh whose vertices move: their positions at time steps that are equally spaced over times
    /// `0 ..= 1`, along straight lines between. A ray meets it as it is at [`Ray::time`](crate::Ray::time).
    ///
    /// One step is a mesh that does not move, none is a mesh without vertices. All steps need as many vertices:
    /// building a scene checks.
    ///
    /// ```
    /// use treelet::{BuildOptions, Mesh, Ray, Scene};
    ///
    /// let start = vec![[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
    /// let end = vec![[0.0, 0.0, 3.0], [1.0, 0.0, 3.0], [0.0, 1.0, 3.0]];
    /// let mesh = Mesh::moving([start.into(), end.into()], vec![[0, 1, 2]]);
    /// let scene = Scene::builder().mesh(mesh).build(&BuildOptions::default())?;
    /// let ray = Ray::new([0.25, 0.25, 0.0], [0.0, 0.0, 1.0]);
    /// assert_eq!(scene.closest(&ray.at_time(0.25)).unwrap().t, 1.5);
    /// # Ok::<(), treelet::SceneError>(())
    /// ```
    pub fn moving(
        steps: impl IntoIterator<Item = Array<[f32; 3]>>,
        triangles: impl Into<Array<[u32; 3]>>,
    ) -> Self {
        let mut steps = steps.into_iter();
        let positions = steps.next().unwrap_or_default();
        let later: Vec<_> = steps.collect();
        let later = (!later.is_empty()).then(|| later.into());
        Self { positions, triangles: triangles.into(), later }
    }

    /// The same triangles over other positions, as of a mesh that bends: the indices are shared. It does not
    /// move with time.
    #[must_use]
    pub fn with_positions(&self, positions: impl Into<Array<[f32; 3]>>) -> Self {
        Self { positions: positions.into(), triangles: self.triangles.clone(), later: None }
    }

    /// How many time steps there are: 1 for a mesh that does not move.
    pub fn steps(&self) -> usize {
        1 + self.later.as_deref().map_or(0, <[_]>::len)
    }

    /// Whether it has more than one time step.
    pub fn is_moving(&self) -> bool {
        self.later.is_some()
    }

    /// Vertex positions at a time step; nothing if there is no such step.
    pub fn positions_at_step(&self, step: usize) -> &[[f32; 3]] {
        match (step.checked_sub(1), &self.later) {
            (None, _) => &self.positions,
            (Some(later), Some(steps)) => steps.get(later).map_or(&[], |positions| positions),
            (Some(_), None) => &[],
        }
    }

    /// The first time step that has another number of vertices than the first, and how many.
    pub(crate) fn uneven_step(&self) -> Option<(usize, usize)> {
        let uneven = |&step: &usize| self.positions_at_step(step).len() != self.positions.len();
        let step = (1..self.steps()).find(uneven)?;
        Some((step, self.positions_at_step(step).len()))
    }

    /// The corners of triangle `prim` at a time in `0 ..= 1`, or `None` if it or a vertex of it does not exist.
    /// Exact at time steps; between, `a + along (b - a)` in f32.
    pub fn corners_at(&self, prim: usize, time: f32) -> Option<[[f32; 3]; 3]> {
        self.corners_of(prim, Moment::new(time, self.steps()))
    }

    /// The same at a moment among the mesh's steps.
    pub(crate) fn corners_of(&self, prim: usize, moment: Moment) -> Option<[[f32; 3]; 3]> {
        let corners = *self.triangles.get(prim)?;
        let (before, after) =
            (self.positions_at_step(moment.step), self.positions_at_step(moment.next));
        let corner = |vertex: u32| {
            let (a, b) = (before.get(vertex as usize)?, after.get(vertex as usize)?);
            Some([0, 1, 2].map(|axis: usize| between(a[axis], b[axis], moment.along)))
        };
        Some([corner(corners[0])?, corner(corners[1])?, corner(corners[2])?])
    }

    /// Vertex positions; those of the first time step, if the mesh moves.
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// Vertex indices of each triangle.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The three corners of triangle `prim`, or `None` if it or a vertex of it does not exist; those of the first
    /// time step, if the mesh moves.
    pub fn corners(&self, prim: usize) -> Option<[[f32; 3]; 3]> {
        let [a, b, c] = *self.triangles.get(prim)?;
        let positions = self.positions();
        Some([
            *positions.get(a as usize)?,
            *positions.get(b as usize)?,
            *positions.get(c as usize)?,
        ])
    }

    /// Whether both are the same arrays in memory, not merely equal.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        let as_late = match (&self.later, &other.later) {
            (Some(a), Some(b)) => a.len() == b.len() && a.iter().zip(&**b).all(|(a, b)| a.same(b)),
            (a, b) => a.is_none() && b.is_none(),
        };
        as_late && self.positions.same(&other.positions) && self.triangles.same(&other.triangles)
    }

    /// What is wrong with triangle `prim`, if anything.
    pub fn defect(&self, prim: usize) -> Option<Defect> {
        let corners = self.triangles[prim];
        let first = corners.into_iter().find_map(|vertex| position_defect(&self.positions, vertex));
        if first.is_some() || !self.is_moving() { first } else { self.defect_in_later(prim) }
    }

    /// The same of the later steps of a mesh that moves.
    fn defect_in_later(&self, prim: usize) -> Option<Defect> {
        for step in 1..self.steps() {
            for vertex in self.triangles[prim] {
                match position_defect(self.positions_at_step(step), vertex) {
                    Some(Defect::BadVertex { vertex, position }) => {
                        return Some(Defect::BadVertexAt { step, vertex, position });
                    }
                    None => {}
                    other => return other,
                }
            }
        }
        None
    }

    /// The box around the triangles that have no [`Mesh::defect`], at all time steps.
    pub fn bounds(&self) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        for prim in (0..self.triangles.len()).filter(|&prim| self.defect(prim).is_none()) {
            for step in 0..self.steps() {
                let corners = self.corners_of(prim, Moment::at(step as f32, self.steps()));
                bounds = bounds.union(&Aabb::of_points(&corners.unwrap_or_default()));
            }
        }
        bounds
    }
}

/// What is wrong with a vertex, if anything.
pub(super) fn position_defect(positions: &[[f32; 3]], vertex: u32) -> Option<Defect> {
    let Some(&position) = positions.get(vertex as usize) else {
        return Some(Defect::IndexOutOfRange { vertex, vertices: positions.len() });
    };
    let near = position.iter().all(|x| x.abs() <= COORDINATE_MAX);
    (!near).then_some(Defect::BadVertex { vertex, position })
}

/// What makes a primitive unfit for a scene.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Defect {
    /// The primitive names a vertex that is not there.
    #[error("vertex index {vertex} is past the mesh's {vertices} vertices")]
    IndexOutOfRange {
        /// The index.
        vertex: u32,
        /// How many vertices the mesh has.
        vertices: usize,
    },
    /// A vertex is NaN, infinite or beyond [`COORDINATE_MAX`].
    #[error("vertex {vertex} at {position:?} is not finite or lies beyond ±2^62")]
    BadVertex {
        /// Index of the vertex.
        vertex: u32,
        /// Its position.
        position: [f32; 3],
    },
    /// The same at a later time step.
    #[error(
        "vertex {vertex} at {position:?}, in time step {step}, is not finite or lies beyond ±2^62"
    )]
    BadVertexAt {
        /// The time step.
        step: usize,
        /// Index of the vertex.
        vertex: u32,
        /// Its position.
        position: [f32; 3],
    },
    /// A center or a radius is NaN or infinite, or the radius is negative.
    #[error("the ball at {center:?} with radius {radius} is not finite, or negative")]
    BadRadius {
        /// Its center.
        center: [f32; 3],
        /// Its radius.
        radius: f32,
    },
    /// A normal is NaN, infinite or zero.
    #[error("the normal {normal:?} is zero or not finite")]
    BadNormal {
        /// The normal.
        normal: [f32; 3],
    },
    /// A box is NaN, ends before it begins, or reaches beyond [`COORDINATE_MAX`].
    #[error("the box {lo:?} .. {hi:?} is empty, not finite or lies partly beyond ±2^62")]
    BadBox {
        /// Its least corner.
        lo: [f32; 3],
        /// Its greatest corner.
        hi: [f32; 3],
    },
}
