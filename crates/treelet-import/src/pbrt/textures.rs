//! Textures: colours and pictures, and what of the others can be made of these.

use std::collections::HashMap;
use std::path::PathBuf;

use treelet_model::texture::{ColorSpace, Filtering, UvTransform, Wrap};
use treelet_model::{Image, Pixels, Texture};

use crate::error::{Place, Result};
use crate::picture;
use crate::source::Source;

use super::params::{Param, Params, Values};
use super::scene::Scene;
use super::spectrum;

/// What a texture is for us.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Tex {
    Flat([f32; 3]),
    Image { texture: Texture, scale: [f32; 3] },
}

impl Tex {
    /// The factor, and the picture it is multiplied with.
    pub(super) fn parts(self) -> ([f32; 3], Option<Texture>) {
        match self {
            Self::Flat(color) => (color, None),
            Self::Image { texture, scale } => (scale, Some(texture)),
        }
    }

    fn scaled(self, by: [f32; 3]) -> Self {
        let times = |a: [f32; 3]| [a[0] * by[0], a[1] * by[1], a[2] * by[2]];
        match self {
            Self::Flat(color) => Self::Flat(times(color)),
            Self::Image { texture, scale } => Self::Image { texture, scale: times(scale) },
        }
    }
}

/// The named textures of a file, and the pictures that it names.
#[derive(Debug, Default)]
pub(super) struct Textures {
    floats: HashMap<String, Tex>,
    spectra: HashMap<String, Tex>,
    images: HashMap<PathBuf, Option<usize>>,
}

impl Scene<'_, '_> {
    /// Defines a texture.
    pub(super) fn texture(
        &mut self,
        file: &Source<'_>,
        name: String,
        is_float: bool,
        class: &str,
        params: &Params,
    ) -> Result<()> {
        let one = Tex::Flat([1.0; 3]);
        let zero = Tex::Flat([0.0; 3]);
        let texture = match class {
            "constant" => self.tex(params, "value", one),
            "imagemap" => self.image_map(file, is_float, params)?,
            "scale" => {
                let a = self.tex(params, "tex", self.tex(params, "tex1", one));
                let b = self.tex(params, "scale", self.tex(params, "tex2", one));
                match (a, b) {
                    (a, Tex::Flat(b)) => a.scaled(b),
                    (Tex::Flat(a), b) => b.scaled(a),
                    (a, _) => {
                        self.notes.add("Of two pictures multiplied only the first is read");
                        a
                    }
                }
            }
            "mix" => {
                let (a, b) = (self.tex(params, "tex1", zero), self.tex(params, "tex2", one));
                self.mix(a, b, self.tex(params, "amount", Tex::Flat([0.5; 3])))
            }
            "checkerboard" => {
                let (a, b) = (self.tex(params, "tex1", one), self.tex(params, "tex2", zero));
                match (a, b) {
                    (Tex::Flat(a), Tex::Flat(b)) => self.checkerboard(file, a, b, params)?,
                    (a, _) => {
                        self.notes.add("A checkerboard of pictures is read as its first");
                        a
                    }
                }
            }
            class => {
                self.notes.add(format!("The texture class {class:?} is not read; shown grey"));
                Tex::Flat([0.5; 3])
            }
        };
        file.whole(file.budget.spend(256 + name.len() as u64, "textures"))?;
        let table = if is_float { &mut self.textures.floats } else { &mut self.textures.spectra };
        table.insert(name, texture);
        Ok(())
    }

    /// A parameter that may be a texture, a colour or a number.
    pub(super) fn tex(&self, params: &Params, name: &str, default: Tex) -> Tex {
        let Some(param) = params.find(name) else { return default };
        if param.kind == "texture" {
            let Values::Strings(names) = &param.values else { return default };
            let Some(name) = names.first() else { return default };
            let Textures { floats, spectra, .. } = &self.textures;
            return spectra.get(name).or_else(|| floats.get(name)).copied().unwrap_or(default);
        }
        color(param).map_or(default, Tex::Flat)
    }

    /// A light's colour; white if it says nothing that is known.
    pub(super) fn light_color(&mut self, params: &Params, name: &str) -> [f32; 3] {
        let Some(param) = params.find(name) else { return [1.0; 3] };
        if let Some(color) = color(param) {
            return color;
        }
        self.notes.add("A spectrum in a file or of an unknown name is read as white");
        [1.0; 3]
    }

    fn mix(&mut self, a: Tex, b: Tex, amount: Tex) -> Tex {
        let amount = match amount {
            Tex::Flat(amount) => amount[0],
            Tex::Image { .. } => {
                self.notes.add("A mix by a picture is read as one half of each");
                0.5
            }
        };
        match (a, b) {
            (Tex::Flat(a), Tex::Flat(b)) => {
                Tex::Flat([0, 1, 2].map(|c: usize| a[c] * (1.0 - amount) + b[c] * amount))
            }
            (a, b) => {
                self.notes.add("A mix with a picture is read as the larger share alone");
                if amount > 0.5 { b } else { a }
            }
        }
    }

    /// Two by two pixels that repeat.
    fn checkerboard(
        &mut self,
        file: &Source<'_>,
        a: [f32; 3],
        b: [f32; 3],
        params: &Params,
    ) -> Result<Tex> {
        if params.float("dimension", 2.0) != 2.0 {
            self.notes.add("A checkerboard in space is read as its mean");
            return Ok(Tex::Flat([0, 1, 2].map(|c: usize| 0.5 * (a[c] + b[c]))));
        }
        let pixel = |[r, g, b]: [f32; 3]| [r, g, b, 1.0];
        let pixels = [pixel(a), pixel(b), pixel(b), pixel(a)];
        let name = "checkerboard".to_owned();
        let pixels = Pixels::Rgba32F(pixels.into());
        let image = self.model.images.len();
        file.push(&mut self.model.images, Image { name, width: 2, height: 2, pixels }, "textures")?;
        let mut texture = Texture::new(image, ColorSpace::Linear);
        texture.filter = Filtering::Nearest;
        // A pair of squares is one copy of the picture.
        let [u, v, du, dv] = uv_mapping(params);
        texture.transform = UvTransform {
            offset: [0.5 * du, 0.5 * (v + dv)],
            rotation: 0.0,
            scale: [0.5 * u, -0.5 * v],
        };
        Ok(Tex::Image { texture, scale: [1.0; 3] })
    }

    fn image_map(&mut self, file: &Source<'_>, is_float: bool, params: &Params) -> Result<Tex> {
        let scale = params.float("scale", 1.0);
        let Some(name) = params.string("filename") else {
            self.notes.add("A picture without a file name is shown grey");
            return Ok(Tex::Flat([0.5; 3]));
        };
        let name = name.to_owned();
        let Some(image) = self.image(file, &Place::Line(params.line), &name)? else {
            return Ok(Tex::Flat([0.5; 3]));
        };
        if params.bool("invert", false) {
            self.notes.add("Pictures are not inverted");
        }
        if !matches!(params.string("mapping"), None | Some("uv")) {
            self.notes.add("Pictures that are not mapped by \"uv\" are mapped by it");
        }
        let encoding = params.string("encoding").unwrap_or("sRGB");
        let space = if encoding == "linear" { ColorSpace::Linear } else { ColorSpace::Srgb };
        let mut texture = Texture::new(image, space);
        let wrap = match params.string("wrap") {
            Some("black") => Wrap::Black,
            Some("clamp") => Wrap::Clamp,
            _ => Wrap::Repeat,
        };
        texture.wrap = [wrap; 2];
        if params.string("filter") == Some("point") {
            texture.filter = Filtering::Nearest;
        }
        // pbrt counts v from the bottom, the model from the top; parts have it turned over.
        let [u, v, du, dv] = uv_mapping(params);
        texture.transform =
            UvTransform { offset: [du, 1.0 - v - dv], rotation: 0.0, scale: [u, v] };
        let _ = is_float;
        Ok(Tex::Image { texture, scale: [scale; 3] })
    }

    /// Reads a picture, once; one that is not there or cannot be decoded is a warning.
    pub(super) fn image(
        &mut self,
        file: &Source<'_>,
        place: &Place,
        name: &str,
    ) -> Result<Option<usize>> {
        let side = match self.main.find(place, name) {
            Ok(side) => side,
            Err(error) => {
                self.notes.add(format!("A picture is missing: {}", error.fault));
                return Ok(None);
            }
        };
        if let Some(&image) = self.textures.images.get(&side.real) {
            return Ok(image);
        }
        let bytes = self.main.read_side(&side)?;
        let image = match picture::decode(file, &bytes, name)? {
            Ok(image) => {
                file.push(&mut self.model.images, image, "pictures")?;
                Some(self.model.images.len() - 1)
            }
            Err(reason) => {
                self.notes.add(format!("A picture is left out: {reason}"));
                None
            }
        };
        self.textures.images.insert(side.real, image);
        Ok(image)
    }
}

/// The factors on u and v, and what is added to them.
fn uv_mapping(params: &Params) -> [f32; 4] {
    let float = |name, default| params.float(name, default);
    [float("uscale", 1.0), float("vscale", 1.0), float("udelta", 0.0), float("vdelta", 0.0)]
}

/// The colour that a parameter gives; `None` if it is in a file or has an unknown name.
pub(super) fn color(param: &Param) -> Option<[f32; 3]> {
    let finite = |color: [f32; 3]| color.iter().all(|x| x.is_finite()).then_some(color);
    match (&param.values, param.kind.as_str()) {
        (Values::Numbers(numbers), "blackbody") => {
            // Version 3 gives a second number, a factor.
            let factor = numbers.get(1).copied().unwrap_or(1.0);
            finite(spectrum::blackbody(*numbers.first()?).map(|channel| channel * factor))
        }
        (Values::Numbers(numbers), "spectrum") => {
            let (samples, _) = numbers.as_chunks();
            match samples {
                [] => finite([*numbers.first()?; 3]),
                samples => Some(spectrum::sampled(samples)),
            }
        }
        (Values::Numbers(numbers), _) => match numbers[..] {
            [one] => finite([one; 3]),
            [r, g, b, ..] => finite([r, g, b]),
            _ => None,
        },
        (Values::Integers(integers), _) => Some([*integers.first()? as f32; 3]),
        (Values::Strings(names), "spectrum") => spectrum::named_light(names.first()?),
        _ => None,
    }
}
