//! Where passes are summed.
//!
//! A pass is one sample of every pixel, or of those that are still too noisy. It is computed beside
//! the sums and added only when it is whole, in f32 and in the order of passes: the film after `n`
//! passes is the same bits whatever was cancelled or resumed on the way, and for any number of
//! threads.

use crate::color;
use crate::error::RenderError;
use crate::image::{Image, check_size};
use crate::tonemap::ToneMap;

/// Pixels along the side of a tile, which is sampled on or left as a whole.
pub const TILE: u32 = 16;

/// A tile is left alone only after so many samples: estimates of noise from fewer are mostly luck.
pub const SAMPLES_LEAST: u32 = 16;

/// Luminance below which noise is no longer measured relative to it: an eighth of a grey card, where
/// the tone curve hides it.
const DARK: f32 = 0.18 / 8.0;

/// The sums of all whole passes so far: 32 bytes a pixel.
#[derive(Clone, Debug)]
pub struct Film {
    width: u32,
    height: u32,
    passes: u32,
    sums: Vec<[f32; 3]>,
    /// Sums of squared luminances, for the noise.
    squares: Vec<f32>,
    /// Samples of each pixel.
    counts: Vec<u32>,
    /// The pass that is being computed; negative luminance of the first channel marks what is left
    /// out. Meaningless between calls.
    pub(crate) pending: Vec<[f32; 3]>,
}

/// What [`Film::pending`] holds for a pixel without a sample.
pub(crate) const NO_SAMPLE: [f32; 3] = [-1.0; 3];

impl Film {
    /// A black film of no passes.
    ///
    /// # Errors
    /// If the size is not allowed or memory is refused.
    pub fn new(width: u32, height: u32) -> Result<Self, RenderError> {
        let pixels = check_size(width, height)?;
        Ok(Self {
            width,
            height,
            passes: 0,
            sums: plane(pixels, [0.0; 3])?,
            squares: plane(pixels, 0.0)?,
            counts: plane(pixels, 0)?,
            pending: plane(pixels, [0.0; 3])?,
        })
    }

    /// Pixels in a row.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Whole passes: the most samples that a pixel has.
    pub fn passes(&self) -> u32 {
        self.passes
    }

    /// Samples of all pixels together.
    pub fn samples(&self) -> u64 {
        self.counts.iter().map(|&count| u64::from(count)).sum()
    }

    /// The sum of each pixel's samples, linear Rec. 709, row by row from the top.
    pub fn sums(&self) -> &[[f32; 3]] {
        &self.sums
    }

    /// The mean radiance of the pixel at column `x`, row `y`; black before the first pass and
    /// outside the film.
    pub fn mean(&self, x: u32, y: u32) -> [f32; 3] {
        let inside = x < self.width && y < self.height && self.passes > 0;
        let index = y as usize * self.width as usize + x as usize;
        if inside { self.mean_at(index) } else { [0.0; 3] }
    }

    /// The mean radiance of every pixel, row by row from the top.
    ///
    /// # Errors
    /// If memory is refused.
    pub fn means(&self) -> Result<Vec<[f32; 3]>, RenderError> {
        let mut means = plane(self.sums.len(), [0.0; 3])?;
        means.iter_mut().enumerate().for_each(|(index, mean)| *mean = self.mean_at(index));
        Ok(means)
    }

    fn mean_at(&self, index: usize) -> [f32; 3] {
        let count = self.counts[index].max(1) as f32;
        self.sums[index].map(|sum| sum / count)
    }

    /// How many samples a pixel has, by its index; what its next sample is numbered.
    pub(crate) fn count_at(&self, index: usize) -> u32 {
        self.counts[index]
    }

    /// The picture so far.
    ///
    /// # Errors
    /// If memory is refused.
    pub fn to_image(&self, tone: &ToneMap) -> Result<Image, RenderError> {
        Image::of_radiance(self.width, self.height, &self.means()?, tone)
    }

    /// The noise of the picture: the root mean square, over pixels, of the standard error of a
    /// pixel's luminance over that luminance (in the dark, over an eighth of a grey card).
    ///
    /// Estimated from the spread of samples, as if they were independent; Sobol points do better,
    /// so the true error is a little less. Infinite before the second pass.
    pub fn noise(&self) -> f64 {
        let squares = (0..self.sums.len()).map(|index| f64::from(self.error_sq(index)));
        (squares.sum::<f64>() / self.sums.len() as f64).sqrt()
    }

    /// Which tiles are to be sampled on, row by row: those noisier than `limit` or with too few
    /// samples, and their neighbours, so that one that is clean by luck next to noise is not left
    /// behind. Once there is none, every tile is below the limit, and so is the picture.
    ///
    /// Means of the noise around a tile were tried: a clean tile between noisy ones that had been
    /// left was sampled for ever.
    pub(crate) fn noisy_tiles(&self, limit: f32) -> Vec<bool> {
        let (columns, rows) = (self.width.div_ceil(TILE), self.height.div_ceil(TILE));
        let mut sums = vec![[0.0_f64; 2]; (columns * rows) as usize];
        let mut noisy = vec![false; sums.len()];
        for index in 0..self.sums.len() {
            let (x, y) = (index as u32 % self.width, index as u32 / self.width);
            let tile = (y / TILE * columns + x / TILE) as usize;
            sums[tile][0] += f64::from(self.error_sq(index));
            sums[tile][1] += 1.0;
            noisy[tile] |= self.counts[index] < SAMPLES_LEAST;
        }
        for (noisy, [sum, pixels]) in noisy.iter_mut().zip(sums) {
            let noise = (sum / pixels).sqrt();
            // NaN is noise, too.
            *noisy |= noise > f64::from(limit) || noise.is_nan();
        }
        let around = |tile: u32| {
            let (column, row) = (tile % columns, tile / columns);
            let across = column.saturating_sub(1)..=(column + 1).min(columns - 1);
            let mut down = row.saturating_sub(1)..=(row + 1).min(rows - 1);
            down.any(|y| across.clone().any(|x| noisy[(y * columns + x) as usize]))
        };
        (0..columns * rows).map(around).collect()
    }

    /// The squared relative standard error of a pixel.
    fn error_sq(&self, index: usize) -> f32 {
        let count = self.counts[index] as f32;
        if count < 2.0 {
            return f32::INFINITY;
        }
        let mean = color::luminance(self.mean_at(index));
        let variance = (self.squares[index] / count - mean * mean).max(0.0) / (count - 1.0);
        let shown = mean.max(DARK);
        variance / (shown * shown)
    }

    /// The variance of the mean of a pixel's luminance.
    pub(crate) fn variance_at(&self, index: usize) -> f32 {
        let mean = color::luminance(self.mean_at(index)).max(DARK);
        let error_sq = self.error_sq(index);
        if error_sq.is_finite() { error_sq * mean * mean } else { mean * mean }
    }

    /// Adds the pending pass.
    pub(crate) fn commit(&mut self) {
        for index in 0..self.sums.len() {
            let sample = self.pending[index];
            if sample == NO_SAMPLE {
                continue;
            }
            (0..3).for_each(|c| self.sums[index][c] += sample[c]);
            // Squares of the greatest radiance leave f32; noise is infinite there.
            let luminance = color::luminance(sample);
            self.squares[index] += luminance * luminance;
            self.counts[index] += 1;
        }
        self.passes += 1;
    }
}

/// A plane of pixels.
pub(crate) fn plane<T: Clone>(pixels: usize, value: T) -> Result<Vec<T>, RenderError> {
    let mut plane = Vec::new();
    let bytes = (pixels as u64).saturating_mul(size_of::<T>() as u64);
    plane
        .try_reserve_exact(pixels)
        .map_err(|_| RenderError::OutOfMemory { bytes, what: "a plane of the picture" })?;
    plane.resize(pixels, value);
    Ok(plane)
}
