//! Materials of glTF, by their factors.
//!
//! Textures are not read. A factor that scales a texture says little alone, so it is toned down to
//! what textures are on the average: half as bright, not metallic, not shining.

use treelet_model::Material;

use super::json::{self, Root};

/// What a texture that is not read multiplies the base colour by: most are of middle brightness.
const TEXTURE_MEAN: f32 = 0.5;

/// Nothing transparent bends light more; diamond has 2.42, germanium in the infrared 4.
const IOR_MAX: f32 = 5.0;

/// All materials of a file, and at the end the one that primitives have by default.
pub(super) fn read_all(root: &Root, warnings: &mut Vec<String>) -> Vec<Material> {
    let mut has_textures = false;
    let mut materials: Vec<Material> =
        root.materials.iter().map(|json| read(json, &mut has_textures)).collect();
    if has_textures {
        warnings.push(
            "Textures are not read; materials have their factors, toned down, alone.".to_owned(),
        );
    }
    // White and metallic by the letter of the specification; viewers show plain grey.
    materials.push(Material::default());
    materials
}

fn read(json: &json::Material, has_textures: &mut bool) -> Material {
    let unit = |x: f32| x.clamp(0.0, 1.0);
    let mut textured = |texture: &Option<_>| {
        *has_textures |= texture.is_some();
        texture.is_some()
    };
    let pbr = &json.pbr_metallic_roughness;
    let extensions = &json.extensions;

    // Base colour, metalness, roughness; the older specular-glossiness model by its nearest.
    let [r, g, b, _] = pbr.base_color_factor;
    let (mut base_color, mut metallic, mut roughness) =
        ([r, g, b], pbr.metallic_factor, pbr.roughness_factor);
    let mut colour_texture = textured(&pbr.base_color_texture);
    if textured(&pbr.metallic_roughness_texture) {
        metallic = 0.0;
    }
    if let Some(old) = &extensions.specular_glossiness {
        let [r, g, b, _] = old.diffuse_factor.unwrap_or([1.0; 4]);
        (base_color, metallic) = ([r, g, b], 0.0);
        roughness = 1.0 - old.glossiness_factor.unwrap_or(1.0);
        colour_texture = textured(&old.diffuse_texture);
    }
    if colour_texture {
        base_color = base_color.map(|channel| channel * TEXTURE_MEAN);
    }

    // Light that comes out or goes through.
    let strength = extensions.emissive_strength.as_ref().and_then(|e| e.emissive_strength);
    let strength = if textured(&json.emissive_texture) { 0.0 } else { strength.unwrap_or(1.0) };
    let emission = json.emissive_factor.map(|channel| (channel * strength).clamp(0.0, f32::MAX));
    let transmission = extensions.transmission.as_ref().map_or(0.0, |transmission| {
        let textured = textured(&transmission.transmission_texture);
        transmission.transmission_factor * if textured { TEXTURE_MEAN } else { 1.0 }
    });
    let ior = extensions.ior.as_ref().and_then(|ior| ior.ior).unwrap_or(1.5);
    Material {
        name: json.name.clone(),
        base_color: base_color.map(unit),
        metallic: unit(metallic),
        roughness: unit(roughness),
        transmission: unit(transmission),
        // An index of 0 stands for "infinite" in that extension; 1 and more are physical.
        ior: ior.clamp(1.0, IOR_MAX),
        emission,
        ..Material::default()
    }
}
