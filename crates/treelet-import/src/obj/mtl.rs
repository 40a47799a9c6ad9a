//! MTL, the material libraries of OBJ, to metallic-roughness factors.
//!
//! A Phong exponent `Ns` becomes the GGX width with the same highlight near its centre,
//! `alpha^2 = 2 / (Ns + 2)` (Walter et al., "Microfacet models for refraction through rough
//! surfaces", EGSR 2007). Glass is what says so: `illum` 4, 6, 7 or 9, or `d` below 1. The keys
//! `Pr`, `Pm`, `Ke` are Exocortex's extension for physically based materials.

use treelet_model::Material;

use crate::error::{Place, Result, quote};
use crate::source::Source;
use crate::text::{self, Lines, Words};

/// What a file says about a material, key by key.
#[derive(Debug, Default)]
struct Raw {
    name: String,
    diffuse: Option<[f32; 3]>,
    specular: Option<[f32; 3]>,
    emission: Option<[f32; 3]>,
    exponent: Option<f32>,
    ior: Option<f32>,
    dissolve: Option<f32>,
    illumination: Option<i64>,
    roughness: Option<f32>,
    metallic: Option<f32>,
    maps: Vec<(Slot, Map)>,
}

/// A material, and the pictures that it names.
#[derive(Debug)]
pub(super) struct Named {
    pub(super) material: Material,
    pub(super) maps: Vec<(Slot, Map)>,
}

/// What a picture is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Slot {
    BaseColor,
    Emission,
    Opacity,
    Normal,
}

/// A picture as a material names it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Map {
    pub(super) name: String,
    pub(super) scale: [f32; 2],
    pub(super) offset: [f32; 2],
    pub(super) is_clamped: bool,
}

/// Reads all materials of a library.
pub(super) fn read(source: &Source<'_>, materials: &mut Vec<Named>) -> Result<()> {
    source.whole(text::refuse_utf16(source.bytes))?;
    let mut raw: Option<Raw> = None;
    let mut lines = Lines::new(source.bytes);
    while let Some(line) = lines.next() {
        let mut words = Words(line);
        let Some(key) = words.next() else { continue };
        let place = Place::Line(lines.number);
        if key == b"newmtl" {
            if let Some(raw) = raw.take() {
                source.push(materials, raw.finish(), "materials")?;
            }
            let name = String::from_utf8_lossy(words.0.trim_ascii()).into_owned();
            raw = Some(Raw { name, ..Raw::default() });
            continue;
        }
        let Some(raw) = &mut raw else { continue };
        if let Some(slot) = slot(key) {
            if let Some(map) = map(words) {
                source.push(&mut raw.maps, (slot, map), "materials")?;
            }
            continue;
        }
        match key {
            b"Kd" => raw.diffuse = color(source, &place, key, words)?,
            b"Ks" => raw.specular = color(source, &place, key, words)?,
            b"Ke" => raw.emission = color(source, &place, key, words)?,
            b"Ns" => raw.exponent = Some(number(source, &place, key, words.next())?),
            b"Ni" => raw.ior = Some(number(source, &place, key, words.next())?),
            b"d" => {
                // `d -halo` fades toward the edges; its number means the same in the middle.
                let word = words.find(|word| *word != b"-halo");
                raw.dissolve = Some(number(source, &place, key, word)?);
            }
            b"Tr" => {
                let transparency = number(source, &place, key, words.next())?;
                raw.dissolve.get_or_insert(1.0 - transparency);
            }
            b"Pr" => raw.roughness = Some(number(source, &place, key, words.next())?),
            b"Pm" => raw.metallic = Some(number(source, &place, key, words.next())?),
            b"illum" => raw.illumination = words.next().and_then(text::integer),
            _ => {}
        }
    }
    if let Some(raw) = raw {
        source.push(materials, raw.finish(), "materials")?;
    }
    Ok(())
}

/// What the picture of a key is for; `None` for keys that are none or are not read.
fn slot(key: &[u8]) -> Option<Slot> {
    Some(match key {
        b"map_Kd" => Slot::BaseColor,
        b"map_Ke" => Slot::Emission,
        b"map_d" => Slot::Opacity,
        b"norm" | b"map_norm" => Slot::Normal,
        _ => return None,
    })
}

/// Reads a picture's options and, behind them, its name, which may have blanks in it.
fn map(mut words: Words<'_>) -> Option<Map> {
    let mut map = Map { name: String::new(), scale: [1.0; 2], offset: [0.0; 2], is_clamped: false };
    loop {
        let before = words.clone();
        let option = words.next()?;
        // How many words an option takes at most; those of `-o`, `-s` and `-t` may be fewer.
        let (most, numbers) = match option {
            b"-blendu" | b"-blendv" | b"-cc" | b"-clamp" | b"-imfchan" | b"-type" => (1, false),
            b"-bm" | b"-boost" | b"-texres" => (1, true),
            b"-mm" => (2, true),
            b"-o" | b"-s" | b"-t" => (3, true),
            _ => {
                map.name = String::from_utf8_lossy(before.0.trim_ascii()).into_owned();
                return Some(map);
            }
        };
        for i in 0..most {
            let ahead = words.clone();
            let word = words.next()?;
            let number = text::real(word).filter(|number| number.is_finite());
            match (option, number) {
                (_, None) if numbers => {
                    words = ahead;
                    break;
                }
                (b"-s", Some(number)) if i < 2 => map.scale[i] = number,
                (b"-o", Some(number)) if i < 2 => map.offset[i] = number,
                (b"-clamp", _) => map.is_clamped = word == b"on",
                _ => {}
            }
        }
    }
}

/// A number that belongs to `key`.
fn number(source: &Source<'_>, place: &Place, key: &[u8], word: Option<&[u8]>) -> Result<f32> {
    let what = || format!("the number of {}", quote(key));
    word.and_then(text::real)
        .ok_or_else(|| source.error(place.clone(), text::no_number(word, &what())))
}

/// Three numbers, or one for all; `None` for the spectral and XYZ forms.
fn color(
    source: &Source<'_>,
    place: &Place,
    key: &[u8],
    mut words: Words<'_>,
) -> Result<Option<[f32; 3]>> {
    let first = words.next();
    if matches!(first, Some(b"spectral" | b"xyz")) {
        return Ok(None);
    }
    let r = number(source, place, key, first)?;
    let Some(second) = words.next() else { return Ok(Some([r; 3])) };
    let g = number(source, place, key, Some(second))?;
    let b = number(source, place, key, words.next())?;
    Ok(Some([r, g, b]))
}

/// What is left of a dissolved surface counts as glass from here on.
const CLEAR: f32 = 0.99;

impl Raw {
    /// The nearest metallic-roughness material.
    fn finish(mut self) -> Named {
        let maps = std::mem::take(&mut self.maps);
        let mut material = self.material();
        if maps.iter().any(|(slot, _)| *slot == Slot::BaseColor) && self.diffuse.is_none() {
            material.base_color = [1.0; 3];
        }
        if maps.iter().any(|(slot, _)| *slot == Slot::Emission) && self.emission.is_none() {
            material.emission = [1.0; 3];
        }
        Named { material, maps }
    }

    fn material(&self) -> Material {
        let plain = Material::default();
        let unit = |x: f32| if x.is_finite() { x.clamp(0.0, 1.0) } else { 0.0 };
        let light = |x: f32| if x.is_finite() { x.max(0.0) } else { 0.0 };
        let diffuse = self.diffuse.map_or(plain.base_color, |color| color.map(unit));
        let specular = self.specular.unwrap_or_default().map(unit);
        let sum = |color: [f32; 3]| color[0] + color[1] + color[2];

        // A highlight says how smooth the surface is, unless `Pr` does.
        let shines = sum(specular) > 0.0;
        let from_exponent = self.exponent.filter(|_| shines).map(|exponent| {
            let alpha = libm::sqrtf(2.0 / (light(exponent) + 2.0));
            libm::sqrtf(alpha)
        });
        let illumination = self.illumination.unwrap_or(2);
        let mirror = matches!(illumination, 3 | 5 | 8).then_some(0.0);
        let roughness = self.roughness.or(from_exponent).or(mirror).unwrap_or(plain.roughness);

        // Black with a bright highlight is how MTL writes a mirror or metal.
        let looks_metal = matches!(illumination, 3 | 5) && sum(diffuse) < 0.1 * sum(specular);
        let metallic = self.metallic.unwrap_or(if looks_metal { 1.0 } else { 0.0 });

        let is_glass = matches!(illumination, 4 | 6 | 7 | 9);
        let left = unit(self.dissolve.unwrap_or(1.0));
        let transmission = match left {
            left if left < CLEAR => 1.0 - left,
            _ if is_glass => 1.0,
            _ => 0.0,
        };
        let base_color = match () {
            () if looks_metal => specular,
            // Glass with no colour of its own is clear, not black.
            () if transmission > 0.0 && sum(diffuse) == 0.0 => [1.0; 3],
            () => diffuse,
        };
        Material {
            name: self.name.clone(),
            base_color,
            metallic: unit(metallic),
            roughness: if transmission > 0.0 && self.roughness.is_none() && !shines {
                0.0
            } else {
                unit(roughness)
            },
            transmission,
            ior: self.ior.filter(|ior| ior.is_finite()).map_or(plain.ior, |ior| ior.max(1.0)),
            emission: self.emission.unwrap_or_default().map(light),
            ..plain
        }
    }
}
