//! A quick guess of what a noisy picture will become, for people in a hurry.
//!
//! The edge-avoiding a-trous wavelet of H. Dammertz, D. Sewtz, J. Hanika, H. Lensch, "Edge-Avoiding
//! A-Trous Wavelet Transform for fast Global Illumination Filtering", HPG 2010: five passes of a 5 x
//! 5 B-spline whose holes double, each neighbour weighed by how alike its guides are. The albedo is
//! divided out before and multiplied in after, so that textures stay sharp, and differences of light
//! count relative to the noise that the film knows of (C. Schied et al., "Spatiotemporal
//! Variance-Guided Filtering", HPG 2017), so that what is clean stays as it is. Differs from them:
//! one picture, no time; outliers are brought down to their neighbours first.
//!
//! It blurs: what mirrors show and soft shadows under much noise lose their detail. Half a second
//! for a picture of a megapixel on two cores.

use crate::color;
use crate::error::RenderError;
use crate::film::{Film, plane};
use crate::layers::Layers;
use rayon::prelude::*;
use treelet::math::vec3;

/// Passes; the last reaches 32 pixels.
const PASSES: u32 = 5;
/// The B-spline, by distance.
const SPLINE: [f32; 3] = [3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0];
/// Albedo that light is divided by is at least this.
const ALBEDO_LEAST: f32 = 0.02;
/// How fast weights fall with the angle between normals: the power of its cosine.
const NORMAL_POWER: i32 = 5;
/// Relative steps of depth a pixel that still count as one surface.
const DEPTH_STEP: f32 = 0.02;
/// Squared differences of albedo that count as an edge.
const ALBEDO_EDGE: f32 = 0.01;
/// How many standard errors apart light may be and still be one.
const LIGHT_ERRORS: f32 = 4.0;
/// A pixel brighter than this many times the second brightest around it is an outlier.
const OUTLIER: f32 = 1.5;

/// Light without albedo, and the variance of its luminance.
#[derive(Clone, Copy, Default)]
struct Pixel {
    light: [f32; 3],
    variance: f32,
}

/// A smoothed picture: linear radiances, rows from the top.
///
/// # Errors
/// If the layers have another size than the film, or memory is refused.
pub fn denoise(film: &Film, layers: &Layers) -> Result<Vec<[f32; 3]>, RenderError> {
    let (width, height) = (film.width() as usize, film.height() as usize);
    let pixels = width * height;
    let fits = [layers.albedo.len(), layers.normal.len(), layers.depth.len()] == [pixels; 3];
    if !fits {
        let film = [film.width(), film.height()];
        return Err(RenderError::FilmSize { film, renderer: [layers.depth.len() as u32, 1] });
    }

    // Divide the albedo out.
    let albedo = |index: usize| layers.albedo[index].map(|c| c.max(ALBEDO_LEAST));
    let mut noisy = plane(pixels, Pixel::default())?;
    noisy.par_iter_mut().enumerate().for_each(|(index, pixel)| {
        let (mean, albedo) =
            (film.mean(index_x(index, width), index_y(index, width)), albedo(index));
        let dim = color::luminance(albedo).max(ALBEDO_LEAST);
        pixel.light = core::array::from_fn(|c| mean[c] / albedo[c]);
        pixel.variance = film.variance_at(index) / (dim * dim);
    });

    // Bring outliers down, then smooth.
    let mut now = plane(pixels, Pixel::default())?;
    now.par_iter_mut().enumerate().for_each(|(index, pixel)| {
        *pixel = tamed(&noisy, width, height, index);
    });
    let mut next = noisy;
    for pass in 0..PASSES {
        let step = 1_isize << pass;
        next.par_iter_mut().enumerate().for_each(|(index, pixel)| {
            *pixel = smoothed(&now, layers, width, height, index, step);
        });
        core::mem::swap(&mut now, &mut next);
    }

    let mut out = plane(pixels, [0.0; 3])?;
    out.par_iter_mut().enumerate().for_each(|(index, pixel)| {
        *pixel = color::mul(now[index].light, albedo(index));
    });
    Ok(out)
}

fn index_x(index: usize, width: usize) -> u32 {
    (index % width) as u32
}

fn index_y(index: usize, width: usize) -> u32 {
    (index / width) as u32
}

/// A pixel, no brighter than its neighbourhood explains.
fn tamed(pixels: &[Pixel], width: usize, height: usize, index: usize) -> Pixel {
    let (mut first, mut second) = (0.0_f32, 0.0_f32);
    for (near, _, _) in neighbours(width, height, index, 1, 1).filter(|&(near, ..)| near != index) {
        let luminance = color::luminance(pixels[near].light);
        if luminance > first {
            (first, second) = (luminance, first);
        } else {
            second = second.max(luminance);
        }
    }
    let Pixel { light, variance } = pixels[index];
    let luminance = color::luminance(light);
    let most = OUTLIER * second;
    if luminance <= most || most <= 0.0 || !luminance.is_finite() {
        return Pixel { light, variance };
    }
    let scale = most / luminance;
    Pixel { light: vec3::scale(light, scale), variance: variance * scale * scale }
}

/// One pass at one pixel.
fn smoothed(
    pixels: &[Pixel],
    layers: &Layers,
    width: usize,
    height: usize,
    index: usize,
    step: isize,
) -> Pixel {
    let center = &pixels[index];
    let (normal, depth, albedo) = (layers.normal[index], layers.depth[index], layers.albedo[index]);
    let luminance = color::luminance(center.light);
    let error = LIGHT_ERRORS * around(pixels, width, height, index).sqrt() + 1e-6;
    let (mut sum, mut variance, mut total) = ([0.0; 3], 0.0, 0.0);
    for (near, dx, dy) in neighbours(width, height, index, 2, step) {
        let other = &pixels[near];
        let spline = SPLINE[dx.unsigned_abs()] * SPLINE[dy.unsigned_abs()];
        let weight = if near == index {
            spline
        } else {
            let reach = (step * (dx.abs() + dy.abs())) as f32;
            let light = (color::luminance(other.light) - luminance).abs() / error;
            spline
                * alike_normals(normal, layers.normal[near])
                * alike_depths(depth, layers.depth[near], reach)
                * alike_albedos(albedo, layers.albedo[near])
                * libm::expf(-light)
        };
        sum = vec3::add(sum, vec3::scale(other.light, weight));
        variance += weight * weight * other.variance;
        total += weight;
    }
    Pixel { light: vec3::scale(sum, 1.0 / total), variance: variance / (total * total) }
}

/// The variance around a pixel: single estimates are as noisy as what they estimate.
fn around(pixels: &[Pixel], width: usize, height: usize, index: usize) -> f32 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (near, _, _) in neighbours(width, height, index, 1, 1) {
        sum += pixels[near].variance;
        count += 1.0;
    }
    sum / count
}

fn alike_normals(a: [f32; 3], b: [f32; 3]) -> f32 {
    let (long_a, long_b) = (vec3::dot(a, a), vec3::dot(b, b));
    // The sky has none.
    if long_a == 0.0 || long_b == 0.0 {
        return f32::from(u8::from(long_a == long_b));
    }
    let cos = (vec3::dot(a, b) / (long_a * long_b).sqrt()).max(0.0);
    (0..NORMAL_POWER).fold(1.0, |power, _| power * cos * cos)
}

fn alike_depths(a: f32, b: f32, reach: f32) -> f32 {
    if a == b {
        return 1.0;
    }
    if !(a.is_finite() && b.is_finite()) {
        return 0.0;
    }
    libm::expf(-(a - b).abs() / (DEPTH_STEP * reach * a.min(b)).max(f32::MIN_POSITIVE))
}

fn alike_albedos(a: [f32; 3], b: [f32; 3]) -> f32 {
    let apart = vec3::sub(a, b);
    libm::expf(-vec3::dot(apart, apart) / ALBEDO_EDGE)
}

/// The square of pixels around one, `step` apart, with their offsets in steps.
fn neighbours(
    width: usize,
    height: usize,
    index: usize,
    reach: isize,
    step: isize,
) -> impl Iterator<Item = (usize, isize, isize)> {
    let (x, y) = ((index % width) as isize, (index / width) as isize);
    let (width, height) = (width as isize, height as isize);
    (-reach..=reach).flat_map(move |dy| {
        (-reach..=reach).filter_map(move |dx| {
            let (column, row) = (x + dx * step, y + dy * step);
            let inside = (0..width).contains(&column) && (0..height).contains(&row);
            inside.then(|| ((row * width + column) as usize, dx, dy))
        })
    })
}
