//! Materials of glTF.

use treelet_model::texture::ColorSpace::{Linear, Srgb};
use treelet_model::{AlphaMode, Material, Texture};

use crate::error::Result;
use crate::source::Source;

use super::accessor::Accessors;
use super::json::{self, Root, TextureInfo};
use super::textures::Textures;

/// Nothing transparent bends light more; diamond has 2.42, germanium in the infrared 4.
const IOR_MAX: f32 = 5.0;

/// All materials of a file, and at the end the one that primitives have by default.
pub(super) fn read_all(
    accessors: &Accessors<'_, '_>,
    textures: &mut Textures,
) -> Result<Vec<Material>> {
    let mut reader = Reader { accessors, textures };
    let mut materials = accessors.source.vec(accessors.root.materials.len() + 1, "materials")?;
    for json in &accessors.root.materials {
        materials.push(reader.read(json)?);
    }
    // White and metallic by the letter of the specification; viewers show plain grey.
    materials.push(Material::default());
    Ok(materials)
}

struct Reader<'r, 's, 'a> {
    accessors: &'r Accessors<'s, 'a>,
    textures: &'r mut Textures,
}

impl Reader<'_, '_, '_> {
    fn texture(
        &mut self,
        info: Option<&TextureInfo>,
        space: treelet_model::texture::ColorSpace,
    ) -> Result<Option<Texture>> {
        let Accessors { source, root, views } = *self.accessors;
        let (source, root): (&Source<'_>, &Root) = (source, root);
        self.textures.read(source, root, views, info, space)
    }

    fn read(&mut self, json: &json::Material) -> Result<Material> {
        let unit = |x: f32| x.clamp(0.0, 1.0);
        let pbr = &json.pbr_metallic_roughness;
        let extensions = &json.extensions;

        // Base colour, metalness, roughness; the older specular-glossiness model by its nearest.
        let [r, g, b, mut opacity] = pbr.base_color_factor;
        let (mut base_color, mut metallic, mut roughness) =
            ([r, g, b], pbr.metallic_factor, pbr.roughness_factor);
        let mut base_info = pbr.base_color_texture.as_ref();
        let mut rough_info = pbr.metallic_roughness_texture.as_ref();
        if let Some(old) = &extensions.specular_glossiness {
            let [r, g, b, a] = old.diffuse_factor.unwrap_or([1.0; 4]);
            (base_color, metallic, opacity) = ([r, g, b], 0.0, a);
            roughness = 1.0 - old.glossiness_factor.unwrap_or(1.0);
            (base_info, rough_info) = (old.diffuse_texture.as_ref(), None);
        }

        // Light that comes out or goes through.
        let strength = extensions.emissive_strength.as_ref().and_then(|e| e.emissive_strength);
        let strength = strength.unwrap_or(1.0);
        let emission_texture = self.texture(json.emissive_texture.as_ref(), Srgb)?;
        // A picture that is missing would make all of the surface glow.
        let is_dark = json.emissive_texture.is_some() && emission_texture.is_none();
        let emission = json
            .emissive_factor
            .map(|channel| if is_dark { 0.0 } else { (channel * strength).clamp(0.0, f32::MAX) });
        let transmission = extensions.transmission.as_ref();
        let ior = extensions.ior.as_ref().and_then(|ior| ior.ior).unwrap_or(1.5);
        let is_solid =
            extensions.volume.as_ref().is_some_and(|volume| volume.thickness_factor > 0.0);
        let factor =
            transmission.map_or(0.0, |transmission| unit(transmission.transmission_factor));

        let specular = extensions.specular.as_ref();
        let tint = specular.and_then(|specular| specular.specular_color_factor);
        let coat = extensions.clear_coat.as_ref();
        let normal = json.normal_texture.as_ref();
        Ok(Material {
            name: json.name.clone(),
            base_color: base_color.map(unit),
            base_color_texture: self.texture(base_info, Srgb)?,
            metallic: unit(metallic),
            roughness: unit(roughness),
            metallic_roughness_texture: self.texture(rough_info, Linear)?,
            normal_texture: self.texture(normal, Linear)?,
            normal_scale: normal.and_then(|normal| normal.scale).unwrap_or(1.0),
            emission,
            emission_texture,
            one_sided_emission: false,
            // An index of 0 stands for "infinite" in that extension; 1 and more are physical.
            ior: ior.clamp(1.0, IOR_MAX),
            transmission: factor,
            transmission_texture: self
                .texture(transmission.and_then(|t| t.transmission_texture.as_ref()), Linear)?,
            specular: specular.and_then(|s| s.specular_factor).map_or(1.0, unit),
            specular_color: tint.map_or([1.0; 3], |tint| tint.map(|c| c.clamp(0.0, f32::MAX))),
            clear_coat: coat.map_or(0.0, |coat| unit(coat.clearcoat_factor)),
            clear_coat_texture: self
                .texture(coat.and_then(|coat| coat.clearcoat_texture.as_ref()), Linear)?,
            clear_coat_roughness: coat.map_or(0.0, |coat| unit(coat.clearcoat_roughness_factor)),
            clear_coat_roughness_texture: self
                .texture(coat.and_then(|coat| coat.clearcoat_roughness_texture.as_ref()), Linear)?,
            // Without a volume, what lets light through is a sheet.
            thin_walled: factor > 0.0 && !is_solid,
            alpha: match json.alpha_mode.as_str() {
                "MASK" => AlphaMode::Mask { cutoff: json.alpha_cutoff.unwrap_or(0.5) },
                "BLEND" => AlphaMode::Blend,
                _ => AlphaMode::Opaque,
            },
            opacity: unit(opacity),
            opacity_texture: None,
            double_sided: json.double_sided,
            unlit: extensions.unlit.is_some(),
        })
    }
}
