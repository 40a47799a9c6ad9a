//! Looking textures up: wrapped, nearest or bilinear, decoded to linear numbers.
//!
//! Rows of an image run from the top, and the first pixel covers the square from (0, 0) to
//! `(1 / width, 1 / height)`. There are no smaller copies of an image: a pixel filter over many
//! samples does what they would do.

use crate::error::RenderError;
use crate::tonemap::linear8;
use std::sync::OnceLock;
use treelet_model::texture::{ColorSpace, Filtering, Wrap};
use treelet_model::{Image, Pixels, Texture};

/// A texture, prepared for lookups.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sampler2<'a> {
    image: &'a Image,
    srgb: bool,
    wrap: [Wrap; 2],
    linear: bool,
    /// Takes coordinates to pixels, a row a coordinate.
    pixel_from_uv: [[f32; 3]; 2],
    pub(crate) uv_set: usize,
}

impl<'a> Sampler2<'a> {
    /// Checks the reference and the numbers of a texture.
    pub(crate) fn new(
        texture: &Texture,
        images: &'a [Image],
        owner: &dyn Fn() -> String,
    ) -> Result<Self, RenderError> {
        let index = texture.image;
        let Some(image) = images.get(index) else {
            let owner = owner();
            return Err(RenderError::NoSuchImage { owner, image: index, images: images.len() });
        };
        check_image(index, image)?;
        let (sin, cos) = libm::sincosf(texture.transform.rotation);
        let ([sx, sy], [ox, oy]) = (texture.transform.scale, texture.transform.offset);
        let (w, h) = (image.width as f32, image.height as f32);
        let pixel_from_uv =
            [[w * cos * sx, w * sin * sy, w * ox], [-h * sin * sx, h * cos * sy, h * oy]];
        if !pixel_from_uv.as_flattened().iter().all(|entry| entry.is_finite()) {
            return Err(RenderError::TextureTransform { owner: owner() });
        }
        Ok(Self {
            image,
            srgb: texture.color_space == ColorSpace::Srgb,
            wrap: texture.wrap,
            linear: texture.filter == Filtering::Linear,
            pixel_from_uv,
            uv_set: texture.uv_set,
        })
    }

    /// The texture at coordinates; red, green, blue, alpha.
    pub(crate) fn at(&self, [u, v]: [f32; 2]) -> [f32; 4] {
        let [x, y] = self.pixel_from_uv.map(|row| row[0] * u + row[1] * v + row[2]);
        if !(x.is_finite() && y.is_finite()) {
            return [0.0; 4];
        }
        if !self.linear {
            return self.pixel(wide_floor(x), wide_floor(y));
        }
        let (x, y) = (x - 0.5, y - 0.5);
        let (left, top) = (wide_floor(x), wide_floor(y));
        let (fx, fy) = (x - left as f32, y - top as f32);
        let upper = mix(self.pixel(left, top), self.pixel(left + 1, top), fx);
        let lower = mix(self.pixel(left, top + 1), self.pixel(left + 1, top + 1), fx);
        mix(upper, lower, fy)
    }

    /// The mean of the texture, from at most about four thousand pixels.
    pub(crate) fn mean(&self) -> [f32; 3] {
        const SIDE: u32 = 64;
        let steps = |side: u32| (side.min(SIDE), f64::from(side) / f64::from(side.min(SIDE)));
        let ((columns, dx), (rows, dy)) = (steps(self.image.width), steps(self.image.height));
        let mut sum = [0.0_f64; 3];
        for row in 0..rows {
            for column in 0..columns {
                let x = ((f64::from(column) + 0.5) * dx) as i64;
                let y = ((f64::from(row) + 0.5) * dy) as i64;
                let pixel = self.pixel(x, y);
                (0..3).for_each(|c| sum[c] += f64::from(pixel[c]));
            }
        }
        sum.map(|sum| (sum / (f64::from(columns) * f64::from(rows))) as f32)
    }

    /// A pixel of the endless plane that wrapping makes.
    #[inline]
    pub(crate) fn pixel(&self, x: i64, y: i64) -> [f32; 4] {
        let column = wrapped(x, self.image.width, self.wrap[0]);
        let row = wrapped(y, self.image.height, self.wrap[1]);
        let (Some(column), Some(row)) = (column, row) else { return [0.0; 4] };
        let index = row * self.image.width as usize + column;
        match &self.image.pixels {
            Pixels::Rgba8(pixels) => decoded(pixels[index], self.srgb),
            Pixels::Rgba32F(pixels) => pixels[index],
        }
    }
}

/// Refuses an image whose pixels are not as many as it says.
pub(crate) fn check_image(index: usize, image: &Image) -> Result<(), RenderError> {
    let expected = u64::from(image.width) * u64::from(image.height);
    let found = image.pixels.len() as u64;
    if expected == 0 || expected != found {
        let name = image.name.clone();
        return Err(RenderError::ImagePixels { image: index, name, expected, found });
    }
    Ok(())
}

/// A pixel of 8 bits a channel, linear.
#[inline]
pub(crate) fn decoded([r, g, b, a]: [u8; 4], srgb: bool) -> [f32; 4] {
    let alpha = f32::from(a) * (1.0 / 255.0);
    if !srgb {
        return [f32::from(r) / 255.0, f32::from(g) / 255.0, f32::from(b) / 255.0, alpha];
    }
    let table = srgb_table();
    [table[usize::from(r)], table[usize::from(g)], table[usize::from(b)], alpha]
}

fn srgb_table() -> &'static [f32; 256] {
    static TABLE: OnceLock<[f32; 256]> = OnceLock::new();
    TABLE.get_or_init(|| core::array::from_fn(|code| linear8(code as u8)))
}

#[inline]
fn wide_floor(x: f32) -> i64 {
    // Beyond 2^62 pixels nobody can tell which one it is.
    const MOST: f32 = 4_611_686_018_427_387_904.0;
    libm::floorf(x).clamp(-MOST, MOST) as i64
}

/// The pixel of a row or column that a place in the endless plane shows.
#[inline]
fn wrapped(x: i64, side: u32, wrap: Wrap) -> Option<usize> {
    let side = i64::from(side);
    let inside = match wrap {
        Wrap::Repeat => x.rem_euclid(side),
        Wrap::Mirror => {
            let place = x.rem_euclid(2 * side);
            if place < side { place } else { 2 * side - 1 - place }
        }
        Wrap::Clamp => x.clamp(0, side - 1),
        Wrap::Black if (0..side).contains(&x) => x,
        Wrap::Black => return None,
    };
    usize::try_from(inside).ok()
}

#[inline]
fn mix(a: [f32; 4], b: [f32; 4], s: f32) -> [f32; 4] {
    core::array::from_fn(|c| (1.0 - s) * a[c] + s * b[c])
}

#[cfg(test)]
mod tests {
    use super::Sampler2;
    use treelet_model::texture::{ColorSpace, Filtering, UvTransform, Wrap};
    use treelet_model::{Image, Pixels, Texture};

    /// Two by two: black, red above green, blue.
    fn image() -> Image {
        let pixels = [[0, 0, 0, 255], [255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 0]];
        let pixels = Pixels::Rgba8(pixels.into());
        Image { name: String::new(), width: 2, height: 2, pixels }
    }

    fn at(texture: &Texture, uv: [f32; 2]) -> [f32; 4] {
        let images = [image()];
        Sampler2::new(texture, &images, &String::new).unwrap().at(uv)
    }

    #[test]
    fn wraps_each_in_its_way() {
        let plain = Texture { filter: Filtering::Nearest, ..Texture::new(0, ColorSpace::Linear) };
        let red = [1.0, 0.0, 0.0, 1.0];
        let black = [0.0, 0.0, 0.0, 1.0];
        assert_eq!(at(&plain, [0.75, 0.25]), red);
        for (wrap, right, left) in [
            (Wrap::Repeat, black, red),
            (Wrap::Mirror, red, black),
            (Wrap::Clamp, red, black),
            (Wrap::Black, [0.0; 4], [0.0; 4]),
        ] {
            let texture = Texture { wrap: [wrap; 2], ..plain };
            assert_eq!(at(&texture, [1.1, 0.25]), right, "{wrap:?}");
            assert_eq!(at(&texture, [-0.1, 0.25]), left, "{wrap:?}");
        }
        let far = at(&plain, [3e30, -3e30]);
        assert!(far.iter().all(|c| c.is_finite()));
    }

    #[test]
    fn bilinear_meets_pixels_at_their_middle() {
        let texture = Texture::new(0, ColorSpace::Linear);
        assert_eq!(at(&texture, [0.75, 0.25]), [1.0, 0.0, 0.0, 1.0]);
        assert_eq!(at(&texture, [0.5, 0.25]), [0.5, 0.0, 0.0, 1.0]);
        assert_eq!(at(&texture, [0.5, 0.5]), [0.25, 0.25, 0.25, 0.75]);
        // At the seam the other end comes in.
        assert_eq!(at(&texture, [0.0, 0.25]), [0.5, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn transforms_as_gltf_says() {
        let plain = Texture { filter: Filtering::Nearest, ..Texture::new(0, ColorSpace::Linear) };
        let transform = UvTransform { offset: [0.5, 0.0], ..UvTransform::default() };
        assert_eq!(at(&Texture { transform, ..plain }, [0.25, 0.25])[0], 1.0);
        let transform = UvTransform { scale: [2.0, 1.0], ..UvTransform::default() };
        assert_eq!(at(&Texture { transform, ..plain }, [0.3, 0.25])[0], 1.0);
        // A quarter turn: (u, v) becomes (v, -u).
        let rotation = core::f32::consts::FRAC_PI_2;
        let transform = UvTransform { rotation, ..UvTransform::default() };
        let turned = Texture { transform, ..plain };
        assert_eq!(at(&turned, [0.75, 0.75]), [1.0, 0.0, 0.0, 1.0]);
        assert_eq!(at(&turned, [0.25, 0.75]), [0.0, 0.0, 1.0, 0.0]);
    }

    #[test]
    fn srgb_is_decoded_and_means_are_means() {
        let grey = Image {
            name: String::new(),
            width: 1,
            height: 1,
            pixels: Pixels::Rgba8([[188, 188, 188, 128]].into()),
        };
        let images = [grey, image()];
        let texture = Texture::new(0, ColorSpace::Srgb);
        let got = Sampler2::new(&texture, &images, &String::new).unwrap().at([0.3, 0.9]);
        assert!((got[0] - 0.5).abs() < 0.01 && (got[3] - 0.5).abs() < 0.01, "{got:?}");
        let texture = Texture::new(1, ColorSpace::Linear);
        let mean = Sampler2::new(&texture, &images, &String::new).unwrap().mean();
        assert_eq!(mean, [0.25; 3]);
        let texture = Texture::new(2, ColorSpace::Linear);
        assert!(Sampler2::new(&texture, &images, &String::new).is_err());
    }
}
