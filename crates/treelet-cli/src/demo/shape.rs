//! Triangle meshes under construction: surfaces swept, turned and joined, with smooth normals.

use std::collections::BTreeMap;

use treelet::Mesh;
use treelet::math::{Affine, vec3};
use treelet_model::Part;

/// Vertices, their normals and the triangles between them; outsides turn counter-clockwise.
#[derive(Clone, Debug, Default)]
pub(super) struct Shape {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

/// A place on the spine of a tube.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ring {
    pub(super) center: [f32; 3],
    pub(super) radius: f32,
}

/// What becomes of the edges of a sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Edges {
    /// They stay open.
    Open,
    /// Each is sewn to the opposite one: a torus.
    Sewn,
}

impl Shape {
    /// A sheet of `columns` x `rows` quads; `point(u, v)` gives its points, both in `0 ..= 1`.
    ///
    /// The outside is where `d/du x d/dv` points.
    pub(super) fn sheet(
        columns: usize,
        rows: usize,
        edges: Edges,
        point: impl Fn(f32, f32) -> [f32; 3],
    ) -> Self {
        let width = columns + usize::from(edges == Edges::Open);
        let height = rows + usize::from(edges == Edges::Open);
        let mut shape = Self::default();
        for row in 0..height {
            for column in 0..width {
                let (u, v) = (column as f32 / columns as f32, row as f32 / rows as f32);
                shape.positions.push(point(u, v));
            }
        }
        let index = |column: usize, row: usize| ((row % height) * width + column % width) as u32;
        for row in 0..rows {
            for column in 0..columns {
                let (a, b) = (index(column, row), index(column + 1, row));
                let (c, d) = (index(column + 1, row + 1), index(column, row + 1));
                shape.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        shape.smoothed()
    }

    /// A profile of `[radius, height]` points turned about the y axis, bottom first.
    ///
    /// A radius of 0 is a single vertex, so a profile from axis to axis is closed. A point given
    /// twice is a crease: the surfaces on its two sides meet there with their own normals.
    pub(super) fn lathe(profile: &[[f32; 2]], sides: usize) -> Self {
        let mut whole = Self::default();
        // A crease is where two neighbours are equal; each side keeps its own copy of the place.
        for run in profile.chunk_by(|a, b| a != b) {
            whole.append(&Self::turned(run, sides));
        }
        whole
    }

    /// One smooth run of [`Shape::lathe`].
    fn turned(profile: &[[f32; 2]], sides: usize) -> Self {
        let mut shape = Self::default();
        let mut rings = Vec::new();
        for &[radius, height] in profile {
            let first = shape.positions.len() as u32;
            let count = if radius > 0.0 { sides } else { 1 };
            for side in 0..count {
                let (sin, cos) = turn(side as f32 / sides as f32);
                shape.positions.push([radius * cos, height, -radius * sin]);
            }
            rings.push((first, count as u32));
        }
        for pair in rings.windows(2) {
            shape.join(pair[0], pair[1]);
        }
        shape.smoothed()
    }

    /// Triangles between two rings of vertices, each `(first, count)`, where 1 is a point.
    fn join(&mut self, (low, low_count): (u32, u32), (high, high_count): (u32, u32)) {
        for side in 0..low_count.max(high_count) {
            let at = |first: u32, count: u32, side: u32| first + side % count;
            let (a, b) = (at(low, low_count, side), at(low, low_count, side + 1));
            let (c, d) = (at(high, high_count, side + 1), at(high, high_count, side));
            if low_count > 1 {
                self.triangles.push([a, b, if high_count > 1 { c } else { d }]);
            }
            if high_count > 1 {
                self.triangles.push([a, c, d]);
            }
        }
    }

    /// A round tube along `spine`, closed by a cone at each end.
    pub(super) fn tube(spine: &[Ring], sides: usize) -> Self {
        let mut shape = Self::default();
        let (Some(first), Some(last)) = (spine.first(), spine.last()) else { return shape };
        shape.positions.push(first.center);
        let mut rings = vec![(0, 1)];
        let mut normal = [0.0, 0.0, 1.0];
        for (index, ring) in spine.iter().enumerate() {
            // Carry the frame along, turning it as little as possible.
            let before = spine[index.saturating_sub(1)].center;
            let after = spine[(index + 1).min(spine.len() - 1)].center;
            let tangent = vec3::normalize(vec3::sub(after, before)).unwrap_or([0.0, 1.0, 0.0]);
            normal = across(normal, tangent);
            let side_axis = vec3::cross(tangent, normal);
            let start = shape.positions.len() as u32;
            for side in 0..sides {
                let (sin, cos) = turn(side as f32 / sides as f32);
                let out = vec3::add(vec3::scale(normal, cos), vec3::scale(side_axis, sin));
                shape.positions.push(vec3::add(ring.center, vec3::scale(out, ring.radius)));
            }
            rings.push((start, sides as u32));
        }
        rings.push((shape.positions.len() as u32, 1));
        shape.positions.push(last.center);
        for pair in rings.windows(2) {
            shape.join(pair[0], pair[1]);
        }
        shape.smoothed()
    }

    /// A ball of radius 1: an octahedron, each edge cut into `cuts` pieces, pushed outward.
    pub(super) fn ball(cuts: i32) -> Self {
        let mut shape = Self::default();
        let mut known = BTreeMap::new();
        for octant in 0..8 {
            let sign = [0, 1, 2].map(|axis| if octant >> axis & 1 == 0 { 1 } else { -1 });
            let mut vertex = |i: i32, j: i32| {
                // Lattice points of the octahedron: faces share those of their common edges.
                let lattice = [sign[0] * i, sign[1] * j, sign[2] * (cuts - i - j)];
                *known.entry(lattice).or_insert_with(|| {
                    let position = vec3::normalize(lattice.map(|x| x as f32));
                    shape.positions.push(position.unwrap_or([0.0, 1.0, 0.0]));
                    shape.positions.len() as u32 - 1
                })
            };
            let mut face = Vec::new();
            for i in 0..cuts {
                for j in 0..cuts - i {
                    face.push([vertex(i, j), vertex(i + 1, j), vertex(i, j + 1)]);
                    if i + j + 2 <= cuts {
                        face.push([vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)]);
                    }
                }
            }
            // An odd number of mirrored axes turns the triangles inside out.
            let mirrored = sign[0] * sign[1] * sign[2] < 0;
            let turned = |[a, b, c]: [u32; 3]| if mirrored { [a, c, b] } else { [a, b, c] };
            shape.triangles.extend(face.into_iter().map(turned));
        }
        shape.smoothed()
    }

    /// Adds one flat triangle with its own vertices.
    pub(super) fn push_triangle(&mut self, corners: [[f32; 3]; 3]) {
        let first = self.positions.len() as u32;
        let [a, b, c] = corners;
        let normal = vec3::cross(vec3::sub(b, a), vec3::sub(c, a));
        let normal = vec3::normalize(normal).unwrap_or([0.0, 1.0, 0.0]);
        self.positions.extend(corners);
        self.normals.extend([normal; 3]);
        self.triangles.push([first, first + 1, first + 2]);
    }

    /// Adds a copy of `other`.
    pub(super) fn append(&mut self, other: &Self) {
        let first = self.positions.len() as u32;
        self.positions.extend_from_slice(&other.positions);
        self.normals.extend_from_slice(&other.normals);
        let moved = |triangle: &[u32; 3]| triangle.map(|vertex| vertex + first);
        self.triangles.extend(other.triangles.iter().map(moved));
    }

    /// The shape under a rotation, a uniform scale and a move.
    #[must_use]
    pub(super) fn placed(mut self, map: &Affine) -> Self {
        for position in &mut self.positions {
            *position = map.point(*position);
        }
        for normal in &mut self.normals {
            *normal = vec3::normalize(map.vector(*normal)).unwrap_or(*normal);
        }
        self
    }

    /// The shape with every point moved, its normals anew.
    #[must_use]
    pub(super) fn deformed(mut self, move_point: impl Fn([f32; 3]) -> [f32; 3]) -> Self {
        for position in &mut self.positions {
            *position = move_point(*position);
        }
        self.smoothed()
    }

    /// Gives each vertex the mean normal of its triangles, weighted by their area.
    #[must_use]
    fn smoothed(mut self) -> Self {
        let mut sums = vec![[0.0; 3]; self.positions.len()];
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|vertex| self.positions[vertex as usize]);
            let normal = vec3::cross(vec3::sub(b, a), vec3::sub(c, a));
            for vertex in triangle {
                let sum = &mut sums[*vertex as usize];
                *sum = vec3::add(*sum, normal);
            }
        }
        let unit = |sum: [f32; 3]| vec3::normalize(sum).unwrap_or([0.0, 1.0, 0.0]);
        self.normals = sums.into_iter().map(unit).collect();
        self
    }

    /// The finished part with smooth normals.
    pub(super) fn smooth_part(self, material: usize) -> Part {
        let normals = Some(self.normals.into());
        Part { normals, ..Part::new(Mesh::new(self.positions, self.triangles), material) }
    }

    /// The finished part, shaded flat.
    pub(super) fn flat_part(self, material: usize) -> Part {
        Part::new(Mesh::new(self.positions, self.triangles), material)
    }
}

/// Sine and cosine of a share of a full turn.
pub(super) fn turn(share: f32) -> (f32, f32) {
    libm::sincosf(share * std::f32::consts::TAU)
}

/// A unit vector across `along` (a unit vector), as near to `wanted` as can be.
pub(super) fn across(wanted: [f32; 3], along: [f32; 3]) -> [f32; 3] {
    let spare = if along[0].abs() < 0.5 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let flat = |v: [f32; 3]| {
        let rest = vec3::sub(v, vec3::scale(along, vec3::dot(v, along)));
        (vec3::max_abs(rest) > 1e-3).then(|| vec3::normalize(rest)).flatten()
    };
    flat(wanted).or_else(|| flat(spare)).unwrap_or([0.0, 0.0, 1.0])
}
