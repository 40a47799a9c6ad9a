//! Pictures of a scene from the bench's own camera: shaded as if of clay, and the nodes that rays
//! enter in trees that differ.

use libm::{cosf, powf, sinf};
use rayon::prelude::*;
use treelet::math::vec3;
use treelet::verify::Random;
use treelet::{Counters, Ray, Scene};
use treelet_bench::engine::Triangles;
use treelet_bench::page::{HeatMap, HeatMaps, Picture};
use treelet_render::{HEAT, Image, RenderError, heat_color};

use crate::ending::Failure;
use crate::session::Session;

/// Trees that show what trees can differ in, from the quickest to build to the slowest.
pub(super) const CONTRAST: [&str; 3] = ["lbvh", "default", "best"];

/// Pixels of a picture.
const WIDTH: u32 = 480;
const HEIGHT: u32 = 320;
/// Half the width of the picture at distance 1, that of the bench's camera: 60 degrees across.
const HALF_WIDTH: f32 = 0.577_350_3;
/// Rays through a pixel of the shaded picture, along each side.
const SIDE: u32 = 2;
/// Rays from each point that see how open it is.
const OPEN: u32 = 16;
/// Strata of height are visited with this stride around, so that neighbours differ in both; prime to
/// [`OPEN`].
const STRIDE: u32 = 7;
/// How far they look, and how far off the surface they start, of the scene's diagonal.
const REACH: f32 = 0.12;
const OFFSET: f32 = 1e-4;
/// Light on a surface that is seen from the side, of that seen from the front.
const SIDE_LIGHT: f32 = 0.45;
/// What stands behind everything, and clay in full light; linear.
const SKY: [f32; 3] = [0.80, 0.84, 0.88];
const CLAY: [f32; 3] = [0.82, 0.79, 0.74];
/// The exponent of sRGB's curve, nearly.
const GAMMA: f32 = 1.0 / 2.2;
/// The share of pixels that stay within the scale of the heat maps.
const WITHIN: f64 = 0.995;

/// Where pictures are taken from.
pub(super) struct View {
    from: [f32; 3],
    forward: [f32; 3],
    right: [f32; 3],
    down: [f32; 3],
}

impl View {
    /// From `from` towards `at`; `up` is the axis that points up.
    pub(super) fn new(from: [f32; 3], at: [f32; 3], up: usize) -> Self {
        let mut sky = [0.0; 3];
        sky[up] = 1.0;
        let mut aside = [0.0; 3];
        aside[(up + 1) % 3] = 1.0;
        let forward = vec3::normalize(vec3::sub(at, from)).unwrap_or(aside);
        let right = vec3::normalize(vec3::cross(forward, sky));
        let right = right.or_else(|| vec3::normalize(vec3::cross(forward, aside))).unwrap_or(aside);
        Self { from, forward, right, down: vec3::cross(forward, right) }
    }

    /// The ray through a place of the picture, in pixels.
    fn ray(&self, x: f32, y: f32) -> Ray {
        let scale = 2.0 * HALF_WIDTH / WIDTH as f32;
        let right = vec3::scale(self.right, (x - 0.5 * WIDTH as f32) * scale);
        let down = vec3::scale(self.down, (y - 0.5 * HEIGHT as f32) * scale);
        let direction = vec3::add(self.forward, vec3::add(right, down));
        Ray::new(self.from, vec3::normalize(direction).unwrap_or(self.forward))
    }

    /// The scene as if of clay, lit from where it is open and from the camera.
    pub(super) fn shaded(
        &self,
        scene: &Scene,
        triangles: &Triangles,
        session: &Session,
    ) -> Result<Picture, Failure> {
        let pixels = each_pixel(session, |x, y| {
            let mut sum = [0.0; 3];
            let mut random = Random::new(u64::from(y * WIDTH + x));
            for place in 0..SIDE * SIDE {
                let step = |i: u32| (i as f32 + 0.5) / SIDE as f32;
                let (dx, dy) = (step(place % SIDE), step(place / SIDE));
                let ray = self.ray(x as f32 + dx, y as f32 + dy);
                sum = vec3::add(sum, shade(scene, triangles, &ray, &mut random));
            }
            sum.map(|c| (255.0 * powf(c / (SIDE * SIDE) as f32, GAMMA) + 0.5) as u8)
        })?;
        Ok(png(&pixels)?)
    }

    /// How many nodes the ray through the middle of each pixel enters.
    pub(super) fn visits(&self, scene: &Scene, session: &Session) -> Result<Vec<u64>, Failure> {
        each_pixel(session, |x, y| {
            let mut counters = Counters::default();
            scene.closest_counted(&self.ray(x as f32 + 0.5, y as f32 + 0.5), &mut counters);
            counters.nodes
        })
    }
}

/// The light that comes back along a ray.
fn shade(scene: &Scene, triangles: &Triangles, ray: &Ray, random: &mut Random) -> [f32; 3] {
    let Some(hit) = scene.closest(ray) else { return SKY };
    let [a, b, c] = triangles.corners(hit.prim as usize);
    let normal = vec3::normalize(vec3::cross(vec3::sub(b, a), vec3::sub(c, a)));
    // What has no area has no normal; it faces whoever sees it.
    let normal = normal.unwrap_or(vec3::scale(ray.direction, -1.0));
    let facing = -vec3::dot(normal, ray.direction);
    let normal = if facing < 0.0 { vec3::scale(normal, -1.0) } else { normal };

    // Count the directions, in strata around the normal, in which nothing is near.
    let diagonal = scene.bounds().diagonal() as f32;
    let start = vec3::add(ray.at(hit.t), vec3::scale(normal, OFFSET * diagonal));
    let turn = random.unit();
    let mut open = 0;
    for number in 0..OPEN {
        let along = core::f32::consts::TAU * (turn + number as f32 / OPEN as f32);
        let height = ((number * STRIDE % OPEN) as f32 + random.unit()) / OPEN as f32;
        let height = 2.0 * height - 1.0;
        let radius = (1.0 - height * height).max(0.0).sqrt();
        let offset = around(normal, radius * cosf(along), radius * sinf(along));
        // A point of the unit sphere around the normal's tip: a cosine distribution.
        let direction = vec3::add(vec3::scale(normal, 1.0 + height), offset);
        let Some(direction) = vec3::normalize(direction) else { continue };
        open += u32::from(!scene.any(&Ray::new(start, direction).up_to(REACH * diagonal)));
    }
    let open = open as f32 / OPEN as f32;
    vec3::scale(CLAY, open * (SIDE_LIGHT + (1.0 - SIDE_LIGHT) * facing.abs()))
}

/// A vector in the plane across a unit vector.
fn around(normal: [f32; 3], x: f32, y: f32) -> [f32; 3] {
    let least = if normal[0].abs() < 0.6 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let tangent = vec3::normalize(vec3::cross(normal, least)).unwrap_or([0.0; 3]);
    let bitangent = vec3::cross(normal, tangent);
    vec3::add(vec3::scale(tangent, x), vec3::scale(bitangent, y))
}

/// Something for each pixel, rows in parallel.
fn each_pixel<T: Send>(
    session: &Session,
    pixel: impl Fn(u32, u32) -> T + Sync,
) -> Result<Vec<T>, Failure> {
    let row = |y: u32| {
        if session.cancel.is_cancelled() {
            return Err(Failure::Cancelled);
        }
        Ok((0..WIDTH).map(|x| pixel(x, y)).collect::<Vec<T>>())
    };
    let rows: Result<Vec<Vec<T>>, Failure> = (0..HEIGHT).into_par_iter().map(row).collect();
    Ok(rows?.into_iter().flatten().collect())
}

/// Maps of one scale, which ends at a round number that nearly all pixels of all maps stay below.
pub(super) fn heat_maps(maps: Vec<(String, Vec<u64>)>) -> Result<HeatMaps, RenderError> {
    let mut all: Vec<u64> = maps.iter().flat_map(|map| &map.1).copied().collect();
    all.sort_unstable();
    let within = all.get((all.len() as f64 * WITHIN) as usize).copied().unwrap_or(1);
    let end = round_up(within);
    let mut painted = Vec::new();
    for (variant, visits) in maps {
        let sum: u64 = visits.iter().sum();
        let max = visits.iter().copied().max().unwrap_or(0);
        let pixels: Vec<[u8; 3]> =
            visits.iter().map(|&visits| heat_color(visits as f32 / end as f32)).collect();
        painted.push(HeatMap {
            variant,
            mean: sum as f64 / visits.len().max(1) as f64,
            max,
            picture: png(&pixels)?,
        });
    }
    Ok(HeatMaps { maps: painted, end, ramp: HEAT.map(|c| c.map(|c| c as u8)).to_vec() })
}

/// The least multiple of 10, or of 100 above 200, that is not below `x`.
fn round_up(x: u64) -> u64 {
    let step = if x > 200 { 100 } else { 10 };
    x.max(1).next_multiple_of(step)
}

/// The pixels, row by row, as a PNG file.
fn png(pixels: &[[u8; 3]]) -> Result<Picture, RenderError> {
    let mut image = Image::filled(WIDTH, HEIGHT, [0; 3])?;
    for (to, from) in image.pixels_mut().iter_mut().zip(pixels) {
        *to = *from;
    }
    Ok(Picture { png: image.encode_png()?, width: WIDTH, height: HEIGHT })
}

#[cfg(test)]
mod tests {
    use super::{HEIGHT, View, WIDTH, around, round_up};
    use treelet::math::vec3;

    #[test]
    fn the_middle_looks_where_the_camera_does_and_up_is_up() {
        for up in 0..3 {
            let mut at = [3.0, 2.0, 1.0];
            at[up] = 0.5;
            let view = View::new([0.0; 3], at, up);
            let middle = view.ray(0.5 * WIDTH as f32, 0.5 * HEIGHT as f32);
            let forward = vec3::normalize(at).unwrap();
            assert!(vec3::dot(middle.direction, forward) > 0.999_99);
            assert!(view.ray(0.0, 0.0).direction[up] > middle.direction[up], "up {up}");
            // Straight up works, too.
            let mut above = [0.0; 3];
            above[up] = 1.0;
            let direction = View::new([0.0; 3], above, up).ray(0.0, 0.0).direction;
            assert!(vec3::is_finite(direction) && direction[up] > 0.5);
        }
    }

    #[test]
    fn scales_end_at_round_numbers() {
        assert_eq!([0, 1, 10, 11, 200, 201, 1000].map(round_up), [10, 10, 10, 20, 200, 300, 1000]);
        let across = around([0.0, 0.0, 1.0], 0.6, 0.8);
        assert!(across[2] == 0.0 && (vec3::dot(across, across) - 1.0).abs() < 1e-6);
    }
}
