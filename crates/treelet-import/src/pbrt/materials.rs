//! Materials: pbrt's kinds in the model's vocabulary.
//!
//! A pbrt roughness `r` means the GGX width `sqrt(r)`, or `r` itself where the file says that it is
//! not to be remapped; the model's perceptual roughness is the root of that width.

use treelet_model::texture::ColorSpace;
use treelet_model::{AlphaMode, Material, Pixels};

use crate::error::{Place, Result};
use crate::source::Source;

use super::params::{Params, Values};
use super::scene::Scene;
use super::spectrum;
use super::textures::Tex;

impl Scene<'_, '_> {
    /// Adds a material; `None` for one that only bounds a medium.
    pub(super) fn add_material(
        &mut self,
        file: &Source<'_>,
        name: &str,
        kind: &str,
        params: &Params,
    ) -> Result<Option<usize>> {
        if matches!(kind, "" | "none" | "interface") {
            return Ok(None);
        }
        let mut material = match kind {
            "mix" => match self.mixed(params) {
                Some(material) => material,
                None => self.material(kind, params),
            },
            kind => self.material(kind, params),
        };
        name.clone_into(&mut material.name);
        if let Some(map) = params.string("normalmap") {
            let map = map.to_owned();
            if let Some(image) = self.image(file, &Place::Line(params.line), &map)? {
                material.normal_texture =
                    Some(treelet_model::Texture::new(image, ColorSpace::Linear));
            }
        }
        if params.find("displacement").is_some() || params.find("bumpmap").is_some() {
            self.notes.add("Displacement textures are not read");
        }
        let index = self.model.materials.len();
        file.push(&mut self.model.materials, material, "materials")?;
        Ok(Some(index))
    }

    fn material(&mut self, kind: &str, params: &Params) -> Material {
        let reflectance = |scene: &Self, names: [&str; 2], default: f32| {
            let other = scene.tex(params, names[1], Tex::Flat([default; 3]));
            scene.tex(params, names[0], other).parts()
        };
        let diffuse = |scene: &Self| reflectance(scene, ["reflectance", "Kd"], 0.5);
        match kind {
            "diffuse" | "matte" => {
                let (color, texture) = diffuse(self);
                Material { base_color_texture: texture, ..Material::diffuse(unit(color)) }
            }
            "coateddiffuse" | "plastic" | "substrate" | "uber" | "translucent" => {
                let (color, texture) = diffuse(self);
                let default = if kind == "coateddiffuse" { 0.0 } else { 0.1 };
                let roughness = self.roughness(params, "", default);
                let made =
                    Material::coated_diffuse(unit(color), roughness, self.ior(params, "eta"));
                Material { base_color_texture: texture, ..made }
            }
            "conductor" | "metal" => self.conductor(params, "", kind == "metal"),
            "mirror" => {
                let (color, texture) = reflectance(self, ["reflectance", "Kr"], 0.9);
                Material { base_color_texture: texture, ..Material::metal(unit(color), 0.0) }
            }
            "coatedconductor" => {
                let metal = self.conductor(params, "conductor.", false);
                let coat = self.roughness(params, "interface.", 0.0);
                Material { clear_coat: 1.0, clear_coat_roughness: coat, ..metal }
            }
            "dielectric" | "glass" => {
                let roughness = self.roughness(params, "", 0.0);
                Material::dielectric(self.ior(params, "eta"), roughness)
            }
            "thindielectric" => Material::thin_dielectric(self.ior(params, "eta")),
            "diffusetransmission" => {
                self.notes.add("What \"diffusetransmission\" lets through is not read");
                let (color, texture) = reflectance(self, ["reflectance", "Kr"], 0.25);
                let made = Material::diffuse(unit(color));
                Material { base_color_texture: texture, thin_walled: true, ..made }
            }
            "subsurface" => {
                self.notes.add("The material \"subsurface\" is read as \"coateddiffuse\"");
                let (color, texture) = diffuse(self);
                let roughness = self.roughness(params, "", 0.0);
                let made =
                    Material::coated_diffuse(unit(color), roughness, self.ior(params, "eta"));
                Material { base_color_texture: texture, ..made }
            }
            kind => {
                self.notes.add(format!("The material {kind:?} is not read; shown grey"));
                Material::diffuse([0.5; 3])
            }
        }
    }

    /// A metal by its index of refraction or its colour.
    fn conductor(&mut self, params: &Params, prefix: &str, is_old: bool) -> Material {
        let roughness = self.roughness(params, prefix, if is_old { 0.01 } else { 0.0 });
        if params.find("reflectance").is_some() {
            let (color, texture) = self.tex(params, "reflectance", Tex::Flat([0.5; 3])).parts();
            let made = Material::metal(unit(color), roughness);
            return Material { base_color_texture: texture, ..made };
        }
        // Copper, as pbrt has it, where nothing is said.
        let copper = spectrum::named_metal("metal-Cu").unwrap_or([[1.0; 3]; 2]);
        let mut index = |name: &str, part: usize| {
            let Some(param) = params.find(&format!("{prefix}{name}")) else { return copper[part] };
            if let Values::Strings(names) = &param.values {
                let name = names.first().map_or("", String::as_str);
                if let Some(metal) = spectrum::named_metal(name) {
                    return metal[part];
                }
                self.notes
                    .add(format!("The spectrum {name:?} is not known; copper takes its place"));
                return copper[part];
            }
            super::textures::color(param).unwrap_or(copper[part])
        };
        let (eta, k) = (index("eta", 0), index("k", 1));
        Material::conductor(eta, k, roughness)
    }

    /// The material of a mix with the larger share.
    fn mixed(&mut self, params: &Params) -> Option<Material> {
        let Values::Strings(names) = &params.find("materials")?.values else { return None };
        let amount = match self.tex(params, "amount", Tex::Flat([0.5; 3])) {
            Tex::Flat(amount) => amount[0],
            Tex::Image { .. } => 0.5,
        };
        let name = names.get(usize::from(amount > 0.5))?;
        let material = self.named_material(name)?;
        let material = self.model.materials.get(material)?.clone();
        self.notes.add("A mix of materials is read as the one with the larger share");
        Some(material)
    }

    /// Perceptual roughness.
    fn roughness(&mut self, params: &Params, prefix: &str, default: f32) -> f32 {
        let mut read = |name: &str, default: f32| match self.tex(
            params,
            &format!("{prefix}{name}"),
            Tex::Flat([default; 3]),
        ) {
            Tex::Flat(value) => value[0],
            Tex::Image { texture, scale } => {
                self.notes.add("Roughness textures are read by their mean");
                scale[0] * mean(&self.model.images[texture.image].pixels)
            }
        };
        let both = read("roughness", default);
        let roughness = 0.5 * (read("uroughness", both) + read("vroughness", both));
        let roughness = if roughness.is_finite() { roughness.clamp(0.0, 1.0) } else { default };
        let root = libm::sqrtf(roughness);
        if params.bool("remaproughness", true) { libm::sqrtf(root) } else { root }
    }

    fn ior(&mut self, params: &Params, name: &str) -> f32 {
        const USUAL: f32 = 1.5;
        let Some(param) = params.find(name) else { return USUAL };
        let ior = match &param.values {
            Values::Strings(names) => {
                let name = names.first().map_or("", String::as_str);
                let ior = spectrum::named_ior(name);
                if ior.is_none() {
                    self.notes
                        .add(format!("The spectrum {name:?} is not known; 1.5 takes its place"));
                }
                ior.unwrap_or(USUAL)
            }
            _ => super::textures::color(param).map_or(USUAL, |color| color[1]),
        };
        if ior > 0.0 { ior.clamp(1.0, 5.0) } else { USUAL }
    }

    /// The material of a shape: the current one, with what the shape emits and where it is.
    pub(super) fn shape_material(
        &mut self,
        file: &Source<'_>,
        params: &Params,
    ) -> Result<Option<usize>> {
        let emission = self.state.emission;
        // A surface that nothing meets is seen if it shines.
        let Some(base) = self.state.material.or(emission.map(|_| 0)) else {
            self.notes.add("Shapes that only bound a medium are left out");
            return Ok(None);
        };
        let alpha = self.tex(params, "alpha", Tex::Flat([1.0; 3]));
        if emission.is_none() && alpha == Tex::Flat([1.0; 3]) {
            return Ok(Some(base));
        }
        let key = format!("{base} {emission:?} {alpha:?}");
        if let Some(&known) = self.variants.get(&key) {
            return Ok(Some(known));
        }
        let mut material = self.model.materials.get(base).cloned().unwrap_or_default();
        if let Some((radiance, is_two_sided)) = emission {
            material.emission = radiance;
            material.one_sided_emission = !is_two_sided;
        }
        if alpha != Tex::Flat([1.0; 3]) {
            let (opacity, texture) = alpha.parts();
            material.alpha = AlphaMode::Blend;
            material.opacity = opacity[0].clamp(0.0, 1.0);
            material.opacity_texture = texture;
        }
        let index = self.model.materials.len();
        file.push(&mut self.model.materials, material, "materials")?;
        file.whole(file.budget.spend(key.len() as u64, "materials"))?;
        self.variants.insert(key, index);
        Ok(Some(index))
    }
}

/// Colours of surfaces lie between black and white.
fn unit(color: [f32; 3]) -> [f32; 3] {
    color.map(|channel| if channel.is_finite() { channel.clamp(0.0, 1.0) } else { 0.0 })
}

/// The mean of the red channel.
fn mean(pixels: &Pixels) -> f32 {
    let (sum, count) = match pixels {
        Pixels::Rgba8(pixels) => {
            let sum: u64 = pixels.iter().map(|pixel| u64::from(pixel[0])).sum();
            (sum as f64 / 255.0, pixels.len())
        }
        Pixels::Rgba32F(pixels) => {
            (pixels.iter().map(|pixel| f64::from(pixel[0])).sum(), pixels.len())
        }
    };
    (sum / count.max(1) as f64) as f32
}
