//! A camera that sees something, chosen by looking.

use std::collections::BTreeSet;

use treelet::math::vec3;
use treelet::verify::Random;
use treelet::{Aabb, Ray, Scene};

/// Pixels along the edge of a tile.
const TILE: usize = 16;
/// Pixels along the edge of the picture that a million rays fill.
const SIDE: usize = 1024;
/// Half the width of the picture at distance 1: 60 degrees across.
const HALF_WIDTH: f32 = 0.577_350_3;
/// Rays along the edge of a trial picture.
const TRIAL: usize = 48;
/// A view is too near when its median hit is nearer than this part of the diagonal.
const NEAR: f32 = 0.04;

/// Where rays start, and their frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Where it stands.
    pub from: [f32; 3],
    /// What it looks at.
    pub at: [f32; 3],
    right: [f32; 3],
    up: [f32; 3],
    forward: [f32; 3],
}

impl Camera {
    /// A camera at `from` that looks at `at`; `up` is the axis that points up.
    fn new(from: [f32; 3], at: [f32; 3], up: usize) -> Option<Self> {
        let forward = vec3::normalize(vec3::sub(at, from))?;
        let mut sky = [0.0; 3];
        sky[up] = 1.0;
        let right = vec3::normalize(vec3::cross(forward, sky))?;
        Some(Self { from, at, right, up: vec3::cross(right, forward), forward })
    }

    /// Of some views from inside and outside, the one that sees most different triangles over most
    /// of its picture, and not only what is right before it. Sky counts twice: rays into it are cheap.
    pub fn choose(scene: &Scene, up: usize) -> Self {
        let views = candidates(&scene.bounds(), up);
        let mut best = (f64::NEG_INFINITY, None);
        for view in views {
            let worth = view.worth(scene);
            if worth > best.0 {
                best = (worth, Some(view));
            }
        }
        // There are always candidates; a point for a scene leaves none, and nothing to see.
        best.1.unwrap_or(Self {
            from: [0.0; 3],
            at: [0.0, 0.0, -1.0],
            right: [1.0, 0.0, 0.0],
            up: [0.0, 1.0, 0.0],
            forward: [0.0, 0.0, -1.0],
        })
    }

    /// How much it sees.
    fn worth(&self, scene: &Scene) -> f64 {
        let rays = (0..TRIAL * TRIAL).map(|i| self.ray(i % TRIAL, i / TRIAL, TRIAL));
        let hits: Vec<_> = rays.filter_map(|ray| scene.closest(&ray)).collect();
        if hits.is_empty() {
            return 0.0;
        }
        let mut distances: Vec<f32> = hits.iter().map(|hit| hit.t).collect();
        distances.sort_unstable_by(f32::total_cmp);
        let extent = scene.bounds().extent();
        let near = distances[distances.len() / 2] < NEAR * vec3::dot(extent, extent).sqrt();
        let seen: BTreeSet<u32> = hits.iter().map(|hit| hit.prim).collect();
        let all = (TRIAL * TRIAL) as f64;
        let seen_of_all = hits.len() as f64 / all;
        let worth = seen_of_all * seen_of_all * (0.1 + seen.len() as f64 / all);
        if near { 0.1 * worth } else { worth }
    }

    /// The ray through the middle of a pixel of a square picture.
    fn ray(&self, x: usize, y: usize, side: usize) -> Ray {
        let at = |i: usize| ((2 * i + 1) as f32 / side as f32 - 1.0) * HALF_WIDTH;
        let across = vec3::add(vec3::scale(self.right, at(x)), vec3::scale(self.up, -at(y)));
        let direction = vec3::add(self.forward, across);
        Ray::new(self.from, vec3::normalize(direction).unwrap_or(self.forward))
    }

    /// `count` rays: the picture in tiles of 16 by 16 pixels, the pixels of a tile along a Z-order
    /// curve, so that 8 and 16 consecutive rays are neighbours too. Fewer rays than pixels are whole
    /// tiles, spread over the picture.
    pub fn tiled(&self, count: usize) -> Vec<Ray> {
        let mut side = SIDE;
        while side * side < count {
            side *= 2;
        }
        let across = side / TILE;
        let wanted = count.div_ceil(TILE * TILE);
        let mut rays = Vec::with_capacity(wanted * TILE * TILE);
        let mut random = Random::new(0xCA);
        for number in 0..wanted {
            // One of the tiles of its share, at random: every so many would be all in one column.
            let share = |number: usize| number * across * across / wanted;
            let (from, to) = (share(number), share(number + 1));
            let tile = from + random.below((to - from) as u64) as usize;
            let (left, top) = (tile % across * TILE, tile / across * TILE);
            rays.extend(
                (0..TILE * TILE).map(|pixel| {
                    self.ray(left + even_bits(pixel), top + even_bits(pixel >> 1), side)
                }),
            );
        }
        rays.truncate(count);
        rays
    }
}

/// Bits 0, 2, 4 and 6, put together.
fn even_bits(bits: usize) -> usize {
    (0..4).map(|bit| (bits >> (2 * bit) & 1) << bit).sum()
}

/// Views from inside and outside, in eight directions.
fn candidates(bounds: &Aabb, up: usize) -> Vec<Camera> {
    // `side` and `depth` are the level axes.
    let (side, depth) = (0, 3 - up);
    let (lo, extent) = (bounds.lo, bounds.extent());
    let at = |x: f32, height: f32, z: f32| {
        let mut point = [0.0; 3];
        for (axis, share) in [(side, x), (up, height.min(1.0)), (depth, z)] {
            point[axis] = lo[axis] + share * extent[axis];
        }
        // Above a flat box, its own height is no measure.
        let rise = extent[up].max(0.4 * extent[side].max(extent[depth]));
        point[up] += (height - 1.0).max(0.0) * rise;
        point
    };
    /// Eight level directions.
    const AROUND: [(f32, f32); 8] = [
        (1.0, 0.0),
        (0.7, 0.7),
        (0.0, 1.0),
        (-0.7, 0.7),
        (-1.0, 0.0),
        (-0.7, -0.7),
        (0.0, -1.0),
        (0.7, -0.7),
    ];
    let mut views = Vec::new();
    for (x, z) in AROUND {
        let around =
            |distance: f32, height: f32| at(0.5 + distance * x, height, 0.5 + distance * z);
        // From inside, half-way up and near the ground: from the middle, and from the wall behind.
        views.push((at(0.5, 0.5, 0.5), around(1.0, 0.4)));
        views.push((around(-0.42, 0.5), around(0.5, 0.35)));
        views.push((at(0.5, 0.15, 0.5), around(1.0, 0.12)));
        views.push((around(-0.42, 0.2), around(0.5, 0.1)));
        // From outside: low and high.
        views.push((around(-1.3, 0.7), at(0.5, 0.5, 0.5)));
        views.push((around(-0.75, 1.8), at(0.5, 0.3, 0.5)));
    }
    views.into_iter().filter_map(|(from, at)| Camera::new(from, at, up)).collect()
}

#[cfg(test)]
mod tests {
    use super::Camera;
    use std::collections::BTreeSet;

    #[test]
    fn a_million_rays_are_every_pixel_once_in_tiles() {
        let camera = Camera::new([0.0; 3], [0.0, 0.0, 1.0], 1).unwrap();
        let rays = camera.tiled(1 << 20);
        let directions: BTreeSet<_> =
            rays.iter().map(|ray| ray.direction.map(f32::to_bits)).collect();
        assert_eq!((rays.len(), directions.len()), (1 << 20, 1 << 20));
        // Fewer rays are tiles of the same picture, all over it, and no more than asked for.
        let few = camera.tiled(16_000);
        assert_eq!(few.len(), 16_000);
        assert!(few.iter().all(|ray| directions.contains(&ray.direction.map(f32::to_bits))));
        for axis in [0, 1] {
            let side = few.iter().filter(|ray| ray.direction[axis] > 0.0).count();
            assert!((6_000..10_000).contains(&side), "{side} of 16000 on one side");
        }
    }
}
