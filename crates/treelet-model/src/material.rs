//! Factor-only metallic-roughness materials, after the glTF 2.0 core model, with emission and
//! transmission.

/// What a surface is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// As the file names it; may be empty.
    pub name: String,
    /// Diffuse albedo of a dielectric, reflectance at normal incidence of a metal; `0 ..= 1`.
    pub base_color: [f32; 3],
    /// 0: dielectric, 1: metal.
    pub metallic: f32,
    /// Perceptual roughness, `0 ..= 1`; the GGX width is its square.
    pub roughness: f32,
    /// The share of light that a dielectric lets through instead of scattering it, `0 ..= 1`.
    pub transmission: f32,
    /// Index of refraction of a dielectric, at least 1.
    pub ior: f32,
    /// Radiance that the surface emits on both sides.
    pub emission: [f32; 3],
}

impl Default for Material {
    /// A light grey diffuse surface.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: [0.7; 3],
            metallic: 0.0,
            roughness: 1.0,
            transmission: 0.0,
            ior: 1.5,
            emission: [0.0; 3],
        }
    }
}

impl Material {
    /// Whether the surface is a light.
    pub fn is_emissive(&self) -> bool {
        self.emission.iter().any(|&channel| channel > 0.0)
    }
}
