//! Pictures that surfaces and skies are covered with, and how they are looked up.

use treelet::memory::Array;

/// A decoded picture. Rows run from the top; the first pixel is at texture coordinate (0, 0).
///
/// Pixels are shared, so that a copy costs nothing. [`Image::decode`] reads files of the usual
/// formats.
#[derive(Clone, Debug)]
pub struct Image {
    /// As the file names it; may be empty.
    pub name: String,
    /// Pixels in a row, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// `width * height` pixels, row by row.
    pub pixels: Pixels,
}

/// The pixels of an [`Image`]: red, green, blue, alpha. Alpha is not multiplied in; where a file
/// has none, it is 1.
#[derive(Clone, Debug)]
pub enum Pixels {
    /// 8 bits a channel; the [`Texture`] says in which colour space.
    Rgba8(Array<[u8; 4]>),
    /// Linear Rec. 709, any finite number.
    Rgba32F(Array<[f32; 4]>),
}

impl Pixels {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Rgba8(pixels) => pixels.len(),
            Self::Rgba32F(pixels) => pixels.len(),
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A use of an image: which, and how coordinates lead to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Texture {
    /// Index into [`crate::Model::images`].
    pub image: usize,
    /// Which of [`crate::Part::uvs`] it is looked up with; a part without that set sees the
    /// texture at (0, 0).
    pub uv_set: usize,
    /// How 8-bit colours are stored; alpha is always linear, and so are f32 pixels.
    pub color_space: ColorSpace,
    /// What lies outside `0 .. 1`, along u and along v.
    pub wrap: [Wrap; 2],
    /// What lies between pixels.
    pub filter: Filtering,
    /// Applied to coordinates first.
    pub transform: UvTransform,
}

impl Texture {
    /// An image over coordinate set 0: repeating, linear between pixels.
    pub fn new(image: usize, color_space: ColorSpace) -> Self {
        Self {
            image,
            uv_set: 0,
            color_space,
            wrap: [Wrap::Repeat; 2],
            filter: Filtering::Linear,
            transform: UvTransform::default(),
        }
    }
}

/// How 8-bit colours are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColorSpace {
    /// By the transfer function of sRGB (IEC 61966-2-1): colours for the eye.
    Srgb,
    /// As they are: normals, roughness and other numbers.
    Linear,
}

/// What a texture shows outside `0 .. 1`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The same again.
    #[default]
    Repeat,
    /// Its mirror image, then the same again.
    Mirror,
    /// The pixel at its edge.
    Clamp,
    /// Black without alpha.
    Black,
}

/// What a texture shows between the middles of pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filtering {
    /// The nearest pixel.
    Nearest,
    /// The four pixels around, bilinearly.
    #[default]
    Linear,
}

/// An affine map of texture coordinates: scaled, then turned, then moved, as
/// `KHR_texture_transform` has it: `uv' = offset + R (scale * uv)` with
/// `R = [[cos, sin], [-sin, cos]]` of `rotation`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UvTransform {
    /// Added last.
    pub offset: [f32; 2],
    /// Radians.
    pub rotation: f32,
    /// Multiplied first.
    pub scale: [f32; 2],
}

impl Default for UvTransform {
    /// Nothing changes.
    fn default() -> Self {
        Self { offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2] }
    }
}
