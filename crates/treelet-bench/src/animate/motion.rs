//! A mesh that moves as it is told: it twists about an axis, then bursts into pieces that fly apart.
//!
//! The pieces are the cells of a grid: triangles whose centres share a cell. Vertices are made one a piece beforehand, so
//! that the triangles are the same ones throughout, and none is stretched between two pieces.

use std::collections::HashMap;

use treelet::Aabb;
use treelet::math::vec3;
use treelet::verify::Random;

use crate::engine::Triangles;
use crate::scenes;

/// Cells of the grid along the longest side of the box.
const CELLS: f32 = 24.0;
/// The whole twist, from one end of the axis to the other, in radians.
const TWIST: f32 = 3.0;
/// How far a piece flies, of its distance from the centre, on average.
const FLIGHT: f32 = 1.5;
/// How far a piece turns, in radians, at most.
const SPIN: f32 = 3.0;
const SEED: u64 = 0xB0057;

/// A mesh in pieces, at rest.
pub struct Moving {
    /// Its triangles; the vertices are where they rest.
    pub rest: Triangles,
    bounds: Aabb,
    /// The axis that it twists about.
    axis: usize,
    /// The piece of each vertex.
    piece_of: Vec<u32>,
    pieces: Vec<Piece>,
}

/// What flies by itself.
#[derive(Clone, Copy)]
struct Piece {
    centre: [f32; 3],
    flight: [f32; 3],
    /// It spins about this unit vector, so many radians in all.
    about: [f32; 3],
    spin: f32,
}

impl Moving {
    /// Cuts a mesh into pieces.
    pub fn new(triangles: &Triangles) -> Self {
        let bounds = scenes::bounds(triangles);
        let extent = bounds.extent();
        let axis = (0..3).fold(0, |a, b| if extent[b] > extent[a] { b } else { a });
        let cell = (extent[axis] / CELLS).max(f32::MIN_POSITIVE);

        // Give each piece vertices of its own.
        let mut numbers = HashMap::new();
        let mut vertices = HashMap::new();
        let (mut positions, mut piece_of, mut sums) = (Vec::new(), Vec::new(), Vec::new());
        let mut indices = Vec::with_capacity(triangles.len());
        for (prim, corners) in triangles.indices.iter().enumerate() {
            let [a, b, c] = triangles.corners(prim);
            let centre = vec3::scale(vec3::add(vec3::add(a, b), c), 1.0 / 3.0);
            let place =
                [0, 1, 2].map(|axis: usize| ((centre[axis] - bounds.lo[axis]) / cell) as i32);
            let next = sums.len() as u32;
            let piece = *numbers.entry(place).or_insert(next);
            if piece == next {
                sums.push(([0.0_f64; 3], 0_u32));
            }
            let (sum, count) = &mut sums[piece as usize];
            (0..3).for_each(|axis| sum[axis] += f64::from(centre[axis]));
            *count += 1;
            indices.push(corners.map(|corner| {
                *vertices.entry((corner, piece)).or_insert_with(|| {
                    positions.push(triangles.positions[corner as usize]);
                    piece_of.push(piece);
                    positions.len() as u32 - 1
                })
            }));
        }

        // Send each its own way, away from the middle.
        let mut random = Random::new(SEED);
        let middle = vec3::scale(vec3::add(bounds.lo, bounds.hi), 0.5);
        let piece = |(sum, count): ([f64; 3], u32)| {
            let centre = sum.map(|x| (x / f64::from(count)) as f32);
            let away = vec3::sub(centre, middle);
            let aside = vec3::scale(random.direction(), 0.3 * vec3::dot(away, away).sqrt());
            let flight = vec3::add(vec3::scale(away, FLIGHT * random.between(0.2, 1.8)), aside);
            let about = vec3::normalize(random.direction()).unwrap_or([0.0, 0.0, 1.0]);
            Piece { centre, flight, about, spin: random.between(-SPIN, SPIN) }
        };
        let pieces = sums.into_iter().map(piece).collect();
        let rest = Triangles { positions: positions.into(), indices: indices.into(), later: None };
        Self { rest, bounds, axis, piece_of, pieces }
    }

    /// How many pieces.
    pub fn pieces(&self) -> usize {
        self.pieces.len()
    }

    /// Where the vertices are after so much of the clip: it twists in the first half of 0 ..= 1, and bursts in the
    /// second.
    pub fn at(&self, share: f32) -> Vec<[f32; 3]> {
        if share <= 0.0 {
            return self.rest.positions.to_vec();
        }
        let twist = TWIST * (2.0 * share).min(1.0);
        let burst = (2.0 * share - 1.0).max(0.0);
        let turns: Vec<_> =
            self.pieces.iter().map(|it| rotation(it.about, it.spin * burst)).collect();
        let vertices = self.rest.positions.iter().zip(&self.piece_of);
        let moved = vertices.map(|(&position, &piece)| {
            let Piece { centre, flight, .. } = self.pieces[piece as usize];
            let turned = apply(&turns[piece as usize], vec3::sub(position, centre));
            let flown = vec3::add(vec3::add(centre, turned), vec3::scale(flight, burst));
            // Everything is twisted as it was when it burst: pieces by where they came from.
            self.twisted(if burst > 0.0 { flown } else { position }, position, twist)
        });
        moved.collect()
    }

    /// Turned about the axis, the more the farther up `from` is.
    fn twisted(&self, position: [f32; 3], from: [f32; 3], twist: f32) -> [f32; 3] {
        let (up, [right, ahead]) = (self.axis, [(self.axis + 1) % 3, (self.axis + 2) % 3]);
        let middle = |axis: usize| 0.5 * (self.bounds.lo[axis] + self.bounds.hi[axis]);
        let extent = self.bounds.extent()[up].max(f32::MIN_POSITIVE);
        let angle = twist * (from[up] - self.bounds.lo[up]) / extent;
        let (sin, cos) = (libm::sinf(angle), libm::cosf(angle));
        let [x, y] = [position[right] - middle(right), position[ahead] - middle(ahead)];
        let mut turned = position;
        turned[right] = middle(right) + cos * x - sin * y;
        turned[ahead] = middle(ahead) + sin * x + cos * y;
        turned
    }
}

/// The rotation about a unit vector (Rodrigues).
fn rotation([x, y, z]: [f32; 3], angle: f32) -> [[f32; 3]; 3] {
    let (sin, cos) = (libm::sinf(angle), libm::cosf(angle));
    let rest = 1.0 - cos;
    [
        [cos + x * x * rest, x * y * rest - z * sin, x * z * rest + y * sin],
        [y * x * rest + z * sin, cos + y * y * rest, y * z * rest - x * sin],
        [z * x * rest - y * sin, z * y * rest + x * sin, cos + z * z * rest],
    ]
}

fn apply(rows: &[[f32; 3]; 3], vector: [f32; 3]) -> [f32; 3] {
    rows.map(|row| vec3::dot(row, vector))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::Generated;

    #[test]
    fn pieces_keep_their_triangles_and_begin_at_rest() {
        let triangles = Generated::Terrain(5_000).triangles();
        let moving = Moving::new(&triangles);
        assert!(moving.pieces() > 100, "{}", moving.pieces());
        for prim in 0..triangles.len() {
            assert_eq!(moving.rest.corners(prim), triangles.corners(prim));
        }
        assert_eq!(moving.at(0.0), moving.rest.positions.to_vec());
        let extent = |positions: &[[f32; 3]]| Aabb::of_points(positions).extent();
        let [rest, burst] = [&moving.at(0.0), &moving.at(1.0)].map(|it| extent(it));
        assert!(burst[0] > 1.5 * rest[0] && burst[0] < 9.0 * rest[0], "{rest:?} {burst:?}");
    }
}
