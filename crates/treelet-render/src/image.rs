//! Finished pictures: 8-bit sRGB, and their PNG encoding.

use crate::error::RenderError;
use crate::tonemap::ToneMap;
use rayon::prelude::*;

/// A picture of 8-bit sRGB pixels, rows from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    width: u32,
    height: u32,
    rgb: Vec<[u8; 3]>,
}

impl Image {
    /// A picture of one colour.
    ///
    /// # Errors
    /// If the size is not allowed (see [`check_size`]) or memory is refused.
    pub fn filled(width: u32, height: u32, color: [u8; 3]) -> Result<Self, RenderError> {
        let pixels = check_size(width, height)?;
        let mut rgb = Vec::new();
        let bytes = pixels as u64 * 3;
        rgb.try_reserve_exact(pixels)
            .map_err(|_| RenderError::OutOfMemory { bytes, what: "the picture" })?;
        rgb.resize(pixels, color);
        Ok(Self { width, height, rgb })
    }

    /// A picture of linear radiances, rows from the top, as a tone curve shows them.
    ///
    /// # Errors
    /// If the size is not allowed, is not that of `radiance`, or memory is refused.
    pub fn of_radiance(
        width: u32,
        height: u32,
        radiance: &[[f32; 3]],
        tone: &ToneMap,
    ) -> Result<Self, RenderError> {
        let mut image = Self::filled(width, height, [0; 3])?;
        if image.rgb.len() != radiance.len() {
            return Err(RenderError::ImageSize { width, height });
        }
        image.rgb.par_iter_mut().zip(radiance).for_each(|(pixel, &c)| *pixel = tone.rgb8(c));
        Ok(image)
    }

    /// Pixels in a row.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// All pixels, row by row from the top.
    pub fn pixels(&self) -> &[[u8; 3]] {
        &self.rgb
    }

    /// All pixels, to be written.
    pub fn pixels_mut(&mut self) -> &mut [[u8; 3]] {
        &mut self.rgb
    }

    /// Colours the pixel at column `x`, row `y`; outside the picture nothing happens.
    pub fn set(&mut self, x: u32, y: u32, color: [u8; 3]) {
        if x < self.width && y < self.height {
            self.rgb[y as usize * self.width as usize + x as usize] = color;
        }
    }

    /// Colours a rectangle; what is outside the picture is cut off.
    pub fn fill(&mut self, left: u32, top: u32, width: u32, height: u32, color: [u8; 3]) {
        for y in top..top.saturating_add(height).min(self.height) {
            for x in left..left.saturating_add(width).min(self.width) {
                self.set(x, y, color);
            }
        }
    }

    /// The picture as a PNG file, with the chunk that says it is sRGB.
    ///
    /// # Errors
    /// If the encoder refuses, which no picture that exists should cause.
    pub fn encode_png(&self) -> Result<Vec<u8>, RenderError> {
        let refused = |error: png::EncodingError| RenderError::Encoder {
            format: "PNG",
            reason: error.to_string(),
        };
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let mut writer = encoder.write_header().map_err(refused)?;
        writer.write_image_data(self.rgb.as_flattened()).map_err(refused)?;
        writer.finish().map_err(refused)?;
        Ok(bytes)
    }
}

/// The most pixels a picture may have.
pub const PIXELS_MAX: u64 = 1 << 31;

/// The number of pixels of a picture.
///
/// # Errors
/// If a side is 0 or there are more than [`PIXELS_MAX`] pixels.
pub fn check_size(width: u32, height: u32) -> Result<usize, RenderError> {
    let pixels = u64::from(width) * u64::from(height);
    let fits = (1..=PIXELS_MAX).contains(&pixels);
    match usize::try_from(pixels) {
        Ok(pixels) if fits => Ok(pixels),
        _ => Err(RenderError::ImageSize { width, height }),
    }
}

#[cfg(test)]
mod tests {
    use super::{Image, check_size};

    #[test]
    fn png_comes_back() {
        let mut image = Image::filled(3, 2, [1, 2, 3]).unwrap();
        image.set(2, 1, [200, 0, 255]);
        image.set(3, 0, [9; 3]);
        let file = image.encode_png().unwrap();
        let decoder = png::Decoder::new(std::io::Cursor::new(file));
        let mut reader = decoder.read_info().unwrap();
        assert!(reader.info().srgb.is_some());
        let mut back = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut back).unwrap();
        assert_eq!(back, image.pixels().as_flattened());
        assert_eq!(image.pixels()[5], [200, 0, 255]);
    }

    #[test]
    fn sizes_are_checked() {
        assert_eq!(check_size(1280, 720).unwrap(), 921_600);
        assert!(check_size(1 << 16, 1 << 15).is_ok());
        for (width, height) in [(0, 5), (5, 0), (1 << 16, (1 << 15) + 1), (u32::MAX, u32::MAX)] {
            let message = check_size(width, height).unwrap_err().to_string();
            assert!(message.contains(&width.to_string()), "{message}");
        }
    }
}
