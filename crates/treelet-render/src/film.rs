//! Where passes are summed.
//!
//! A pass is one sample of every pixel. It is computed beside the sums and added only when it is
//! whole, in f32 and in the order of passes: the film after `n` passes is the same bits whatever
//! was cancelled or resumed on the way, and for any number of threads.

use crate::error::RenderError;
use crate::image::{Image, check_size};
use crate::tonemap::ToneMap;

/// The sums of all whole passes so far.
#[derive(Clone, Debug)]
pub struct Film {
    width: u32,
    height: u32,
    passes: u32,
    sums: Vec<[f32; 3]>,
    /// The pass that is being computed; meaningless between calls.
    pub(crate) pending: Vec<[f32; 3]>,
}

impl Film {
    /// A black film of no passes: 24 bytes a pixel.
    ///
    /// # Errors
    /// If the size is not allowed or memory is refused.
    pub fn new(width: u32, height: u32) -> Result<Self, RenderError> {
        let pixels = check_size(width, height)?;
        let bytes = pixels as u64 * size_of::<[f32; 3]>() as u64;
        let plane = || {
            let mut plane = Vec::new();
            plane
                .try_reserve_exact(pixels)
                .map_err(|_| RenderError::OutOfMemory { bytes, what: "the film" })?;
            plane.resize(pixels, [0.0; 3]);
            Ok(plane)
        };
        Ok(Self { width, height, passes: 0, sums: plane()?, pending: plane()? })
    }

    /// Pixels in a row.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Whole passes, which is samples a pixel.
    pub fn passes(&self) -> u32 {
        self.passes
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
        if inside { self.sums[index].map(|sum| sum / self.passes as f32) } else { [0.0; 3] }
    }

    /// The picture so far.
    ///
    /// # Errors
    /// If memory is refused.
    pub fn to_image(&self, tone: &ToneMap) -> Result<Image, RenderError> {
        let mut image = Image::filled(self.width, self.height, [0; 3])?;
        let passes = self.passes.max(1) as f32;
        for (pixel, sum) in image.pixels_mut().iter_mut().zip(&self.sums) {
            *pixel = tone.rgb8(sum.map(|c| c / passes));
        }
        Ok(image)
    }

    /// Adds the pending pass.
    pub(crate) fn commit(&mut self) {
        for (sum, sample) in self.sums.iter_mut().zip(&self.pending) {
            for c in 0..3 {
                sum[c] += sample[c];
            }
        }
        self.passes += 1;
    }
}
