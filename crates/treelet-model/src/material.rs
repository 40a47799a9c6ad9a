//! Materials: one vocabulary for all formats, the metallic-roughness model of glTF 2.0 with its
//! common extensions. What other formats say is put into it by the constructors below.

use crate::texture::Texture;

/// What a surface is made of. Each texture is multiplied with the number beside it.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// As the file names it; may be empty.
    pub name: String,
    /// Diffuse albedo of a dielectric, reflectance at normal incidence of a metal; `0 ..= 1`.
    pub base_color: [f32; 3],
    /// Its red, green and blue; its alpha is multiplied with `opacity`.
    pub base_color_texture: Option<Texture>,
    /// 0: dielectric, 1: metal.
    pub metallic: f32,
    /// Perceptual roughness, `0 ..= 1`; the GGX width is its square.
    pub roughness: f32,
    /// Green: roughness, blue: metallic.
    pub metallic_roughness_texture: Option<Texture>,
    /// Tangent-space normals, `0 ..= 1` for `-1 ..= 1`, green up in the picture, against +v, as in glTF.
    pub normal_texture: Option<Texture>,
    /// Multiplied with the normal texture's first two components.
    pub normal_scale: f32,
    /// Radiance that the surface emits, the strength of any extension multiplied in.
    pub emission: [f32; 3],
    /// Red, green, blue.
    pub emission_texture: Option<Texture>,
    /// Whether only the side from which corners turn left emits; otherwise both do.
    pub one_sided_emission: bool,
    /// Index of refraction of a dielectric, at least 1.
    pub ior: f32,
    /// The share of light that a dielectric lets through instead of scattering it, `0 ..= 1`.
    pub transmission: f32,
    /// Red.
    pub transmission_texture: Option<Texture>,
    /// Factor on a dielectric's reflection at normal incidence, `0 ..= 1`.
    pub specular: f32,
    /// Tint of a dielectric's reflection at normal incidence, `0 ..`.
    pub specular_color: [f32; 3],
    /// The share of the surface that has a clear coat, `0 ..= 1`.
    pub clear_coat: f32,
    /// Red.
    pub clear_coat_texture: Option<Texture>,
    /// Perceptual roughness of the coat, `0 ..= 1`.
    pub clear_coat_roughness: f32,
    /// Green.
    pub clear_coat_roughness_texture: Option<Texture>,
    /// Whether the surface is a sheet in itself, like a leaf or a pane: light that is let through
    /// is not bent. Otherwise it bounds a solid.
    pub thin_walled: bool,
    /// What the alpha below means.
    pub alpha: AlphaMode,
    /// Alpha, `0 ..= 1`; multiplied with that of the base colour's texture and the next.
    pub opacity: f32,
    /// Red: alpha by itself, for formats that keep it apart from the colour.
    pub opacity_texture: Option<Texture>,
    /// Whether the file wants back faces to be seen. Kept; the renderer shows all back faces.
    pub double_sided: bool,
    /// Whether the base colour is shown as it is, neither lit nor lighting anything.
    pub unlit: bool,
}

/// What alpha means.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Nothing: the surface is whole.
    #[default]
    Opaque,
    /// There is surface where alpha is at least the cutoff, elsewhere a hole.
    Mask {
        /// Usually 0.5.
        cutoff: f32,
    },
    /// Alpha is the share of light that meets the surface; the rest passes straight on.
    Blend,
}

impl Default for Material {
    /// A light grey diffuse surface.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: [0.7; 3],
            base_color_texture: None,
            metallic: 0.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            emission: [0.0; 3],
            emission_texture: None,
            one_sided_emission: false,
            ior: 1.5,
            transmission: 0.0,
            transmission_texture: None,
            specular: 1.0,
            specular_color: [1.0; 3],
            clear_coat: 0.0,
            clear_coat_texture: None,
            clear_coat_roughness: 0.0,
            clear_coat_roughness_texture: None,
            thin_walled: false,
            alpha: AlphaMode::Opaque,
            opacity: 1.0,
            opacity_texture: None,
            double_sided: false,
            unlit: false,
        }
    }
}

impl Material {
    /// Purely diffuse: no reflection on top.
    pub fn diffuse(reflectance: [f32; 3]) -> Self {
        Self { base_color: reflectance, specular: 0.0, ..Self::default() }
    }

    /// Diffuse under a dielectric interface of the given perceptual roughness.
    pub fn coated_diffuse(reflectance: [f32; 3], roughness: f32, ior: f32) -> Self {
        Self { base_color: reflectance, roughness, ior, ..Self::default() }
    }

    /// A metal of the given reflectance at normal incidence.
    pub fn metal(reflectance: [f32; 3], roughness: f32) -> Self {
        Self { base_color: reflectance, metallic: 1.0, roughness, ..Self::default() }
    }

    /// A metal of the complex index of refraction `eta + i k`, by channel: its reflectance at
    /// normal incidence, `((eta - 1)^2 + k^2) / ((eta + 1)^2 + k^2)`.
    pub fn conductor(eta: [f32; 3], k: [f32; 3], roughness: f32) -> Self {
        let reflectance = core::array::from_fn(|c| {
            let (below, above) = (eta[c] - 1.0, eta[c] + 1.0);
            let reflected = (below * below + k[c] * k[c]) / (above * above + k[c] * k[c]);
            if reflected.is_finite() { reflected.clamp(0.0, 1.0) } else { 1.0 }
        });
        Self::metal(reflectance, roughness)
    }

    /// Clear glass: reflects and refracts, smoothly at roughness 0.
    pub fn dielectric(ior: f32, roughness: f32) -> Self {
        Self { base_color: [1.0; 3], ior, roughness, transmission: 1.0, ..Self::default() }
    }

    /// A pane of clear glass that is a single sheet.
    pub fn thin_dielectric(ior: f32) -> Self {
        Self { thin_walled: true, ..Self::dielectric(ior, 0.0) }
    }

    /// Whether the surface is a light.
    pub fn is_emissive(&self) -> bool {
        self.emission.iter().any(|&channel| channel > 0.0)
    }

    /// All its textures.
    pub fn textures(&self) -> impl Iterator<Item = &Texture> {
        [
            &self.base_color_texture,
            &self.metallic_roughness_texture,
            &self.normal_texture,
            &self.emission_texture,
            &self.transmission_texture,
            &self.clear_coat_texture,
            &self.clear_coat_roughness_texture,
            &self.opacity_texture,
        ]
        .into_iter()
        .flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::Material;

    #[test]
    fn conductors_reflect_what_tables_say() {
        // Gold at 650, 550, 450 nm: eta 0.156 0.424 1.383, k 3.80 2.47 1.91 (P. Johnson, R. Christy,
        // "Optical Constants of the Noble Metals", 1972, interpolated) reflects 0.96, 0.80, 0.41.
        let gold = Material::conductor([0.156, 0.424, 1.383], [3.80, 2.47, 1.91], 0.1);
        for (got, want) in gold.base_color.into_iter().zip([0.96, 0.80, 0.41]) {
            assert!((got - want).abs() < 0.01, "{got} instead of {want}");
        }
        assert_eq!(Material::conductor([f32::NAN; 3], [1.0; 3], 0.0).base_color, [1.0; 3]);
    }
}
