//! Picture files to [`Image`]s: PNG, JPEG, BMP, TGA with 8 bits a channel, Radiance HDR and OpenEXR
//! with floating point.
//!
//! Decoders are those of the `image` crate, without C. Their allocations are limited, a size that a
//! header claims is checked before anything is reserved for it.

use std::io::Cursor;

use image::{DynamicImage, ImageDecoder as _, ImageFormat, ImageReader, Limits};
use treelet::memory::Array;

use crate::texture::{Image, Pixels};

/// The most pixels along a side of a picture.
pub const SIDE_MAX: u32 = 1 << 16;

/// Why a picture could not be decoded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ImageError {
    /// Neither its bytes nor its name say what it is, or it is a format nobody here knows.
    #[error("{name}: is no PNG, JPEG, BMP, TGA, HDR or EXR picture; convert it to one of them")]
    Format {
        /// The picture's name.
        name: String,
    },
    /// More than the caller allows.
    #[error(
        "{name}: {width} x {height} pixels need {bytes} bytes, {limit} are left; make it smaller"
    )]
    TooBig {
        /// The picture's name.
        name: String,
        /// Pixels in a row, as its header says.
        width: u32,
        /// Rows, as its header says.
        height: u32,
        /// What they take.
        bytes: u64,
        /// What they may take.
        limit: u64,
    },
    /// The decoder stopped.
    #[error("{name}: cannot be decoded ({reason}); open it elsewhere and save it anew")]
    Broken {
        /// The picture's name.
        name: String,
        /// What the decoder says.
        reason: String,
    },
}

impl Image {
    /// Decodes a file's bytes. Its format is told from the bytes, and by the extension of `name`
    /// where they do not say. At most `limit` bytes are used for pixels.
    ///
    /// Numbers that are not finite become 0.
    ///
    /// # Errors
    /// If the format is unknown, the picture too large or its bytes wrong.
    pub fn decode(bytes: &[u8], name: &str, limit: u64) -> Result<Self, ImageError> {
        let named = || name.to_owned();
        let broken = |error: image::ImageError| ImageError::Broken {
            name: named(),
            reason: error.to_string(),
        };

        // Tell the format.
        let guessed = image::guess_format(bytes).ok();
        let format = guessed.or_else(|| ImageFormat::from_path(name).ok());
        let known = format.filter(ImageFormat::reading_enabled);
        let format = known.ok_or_else(|| ImageError::Format { name: named() })?;

        // Check the size before reserving anything for it.
        let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
        let mut limits = Limits::default();
        limits.max_image_width = Some(SIDE_MAX);
        limits.max_image_height = Some(SIDE_MAX);
        // Decoders may hold rows and blocks beside the pixels.
        limits.max_alloc = Some(limit.saturating_mul(2));
        reader.limits(limits);
        let decoder = reader.into_decoder().map_err(broken)?;
        let (width, height) = decoder.dimensions();
        let float = matches!(format, ImageFormat::Hdr | ImageFormat::OpenExr);
        let pixel = if float { size_of::<[f32; 4]>() } else { size_of::<[u8; 4]>() };
        let needed = u64::from(width).saturating_mul(u64::from(height));
        let needed = needed.saturating_mul(pixel as u64);
        if needed > limit {
            return Err(ImageError::TooBig { name: named(), width, height, bytes: needed, limit });
        }

        // Decode, and bring to four channels.
        let decoded = DynamicImage::from_decoder(decoder).map_err(broken)?;
        let (width, height) = (decoded.width(), decoded.height());
        if width == 0 || height == 0 {
            let reason = "it has no pixels".to_owned();
            return Err(ImageError::Broken { name: named(), reason });
        }
        let pixels = if float {
            let numbers = decoded.into_rgba32f().into_raw();
            let finite = |c: f32| if c.is_finite() { c } else { 0.0 };
            let pixels = numbers.as_chunks::<4>().0.iter().map(|pixel| pixel.map(finite));
            Pixels::Rgba32F(Array::from(pixels.collect::<Vec<_>>()))
        } else {
            let numbers = decoded.into_rgba8().into_raw();
            Pixels::Rgba8(Array::from(numbers.as_chunks::<4>().0.to_vec()))
        };
        Ok(Self { name: named(), width, height, pixels })
    }
}

#[cfg(test)]
mod tests {
    use super::ImageError;
    use crate::texture::{Image, Pixels};
    use std::io::Cursor;

    /// Two pixels, red and a half-transparent green, in a format.
    fn encoded(format: image::ImageFormat) -> Vec<u8> {
        let mut bytes = Vec::new();
        let rgba = image::RgbaImage::from_raw(2, 1, vec![255, 0, 0, 255, 0, 255, 0, 128]).unwrap();
        let picture = image::DynamicImage::from(rgba);
        let picture = match format {
            image::ImageFormat::OpenExr => picture.into_rgba32f().into(),
            image::ImageFormat::Hdr => picture.into_rgb32f().into(),
            image::ImageFormat::Jpeg => picture.into_rgb8().into(),
            _ => picture,
        };
        picture.write_to(&mut Cursor::new(&mut bytes), format).unwrap();
        bytes
    }

    #[test]
    fn formats_come_back() {
        use image::ImageFormat::{Bmp, Hdr, Jpeg, OpenExr, Png, Tga};
        for format in [Png, Jpeg, Bmp, Tga, Hdr, OpenExr] {
            let name = format!("two.{}", format.extensions_str()[0]);
            let image = Image::decode(&encoded(format), &name, 1000).unwrap();
            assert_eq!((image.width, image.height, image.pixels.len()), (2, 1, 2), "{format:?}");
            match image.pixels {
                Pixels::Rgba8(pixels) => {
                    assert!(!matches!(format, Hdr | OpenExr) && pixels[0][3] == 255)
                }
                Pixels::Rgba32F(pixels) => {
                    assert!(matches!(format, Hdr | OpenExr));
                    assert!((pixels[0][0] - 1.0).abs() < 0.01, "{format:?}: {pixels:?}");
                    assert!(pixels[1][0].abs() < 0.01 && pixels[0][3] == 1.0, "{format:?}");
                }
            }
        }
        let Pixels::Rgba8(png) = Image::decode(&encoded(Png), "x", 8).unwrap().pixels else {
            panic!("8 bits");
        };
        assert_eq!(*png, [[255, 0, 0, 255], [0, 255, 0, 128]]);
    }

    #[test]
    fn what_cannot_be_decoded_is_named() {
        let png = encoded(image::ImageFormat::Png);
        let error = Image::decode(&png, "a.png", 7).unwrap_err();
        assert!(matches!(error, ImageError::TooBig { bytes: 8, limit: 7, .. }), "{error}");
        let error = Image::decode(&png[..png.len() / 2], "a.png", 1000).unwrap_err();
        assert!(matches!(error, ImageError::Broken { .. }), "{error}");
        for (bytes, name) in
            [(&b"junk"[..], "a.xyz"), (b"", "a"), (b"\xABKTX 20\xBB\r\n\x1A\n", "b")]
        {
            let error = Image::decode(bytes, name, 1000).unwrap_err();
            assert!(matches!(error, ImageError::Format { .. }), "{error}");
        }
    }
}
