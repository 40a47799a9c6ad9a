//! The materials of a model with their textures, made ready to be asked at points.

use crate::bsdf::{Albedos, Bsdf, Factors, Lobes, Tables};
use crate::color;
use crate::error::RenderError;
use crate::surface::{PartPoint, Surface, Surfaces};
use crate::texture::Sampler2;
use treelet::math::vec3;
use treelet_model::{AlphaMode, Material, Model, Texture};

/// The least roughness of mirror lobes that a regularised path meets: a width of 0.3.
const BROAD_ROUGHNESS: f32 = 0.547_722_6;

/// All materials.
#[derive(Clone, Debug)]
pub(crate) struct Materials<'a> {
    all: Vec<Prepared<'a>>,
    /// Whether any has holes.
    pub(crate) any_alpha: bool,
}

/// One material.
#[derive(Clone, Debug)]
struct Prepared<'a> {
    material: &'a Material,
    /// As it is, and as a regularised path meets it; without textures.
    surfaces: [(Tables, Lobes); 2],
    factors: Factors,
    /// Whether no texture changes the factors.
    plain: bool,
    emissive: bool,
    unlit: bool,
    base_color: Option<Sampler2<'a>>,
    metallic_roughness: Option<Sampler2<'a>>,
    normal: Option<Sampler2<'a>>,
    emission: Option<Sampler2<'a>>,
    transmission: Option<Sampler2<'a>>,
    clear_coat: Option<Sampler2<'a>>,
    clear_coat_roughness: Option<Sampler2<'a>>,
    opacity: Option<Sampler2<'a>>,
}

impl<'a> Materials<'a> {
    /// Checks and prepares the materials of a model.
    pub(crate) fn new(model: &'a Model, regularize: bool) -> Result<Self, RenderError> {
        let mut albedos = Albedos::default();
        let mut all = Vec::with_capacity(model.materials.len());
        for (index, material) in model.materials.iter().enumerate() {
            check(index, material)?;
            all.push(Prepared::new(index, material, model, regularize, &mut albedos)?);
        }
        let any_alpha = all.iter().any(|one| one.material.alpha != AlphaMode::Opaque);
        Ok(Self { all, any_alpha })
    }

    /// The material's scattering at a point, for a viewer on the outside or the inside; `room` is for
    /// numbers that are the point's own.
    #[inline]
    pub(crate) fn bsdf<'b>(
        &'b self,
        surfaces: &Surfaces<'_>,
        on: &PartPoint,
        outside: bool,
        regular: bool,
        room: &'b mut Option<Lobes>,
    ) -> Bsdf<'b> {
        let one = &self.all[on.material as usize];
        let (tables, lobes) = &one.surfaces[usize::from(regular)];
        if one.plain && !on.colored {
            return Bsdf::new(tables, lobes, outside);
        }
        let lobes = room.insert(Lobes::new(tables, &one.factors_at(surfaces, on)));
        Bsdf::new(tables, lobes, outside)
    }

    /// What the material's surface emits at a point toward a side; black for most.
    #[inline]
    pub(crate) fn emission(
        &self,
        surfaces: &Surfaces<'_>,
        on: &PartPoint,
        outside: bool,
    ) -> [f32; 3] {
        let one = &self.all[on.material as usize];
        if !one.emissive || one.material.one_sided_emission && !outside {
            return [0.0; 3];
        }
        match &one.emission {
            None => one.material.emission,
            Some(texture) => {
                let [r, g, b, _] = texture.at(surfaces.uv(on, texture.uv_set));
                color::mul(one.material.emission, [r, g, b])
            }
        }
    }

    /// The mean luminance of what a material emits, over both sides.
    pub(crate) fn mean_emission(&self, material: u32) -> f64 {
        let one = &self.all[material as usize];
        let mean = one.emission.as_ref().map_or([1.0; 3], Sampler2::mean);
        let both = f64::from(color::luminance(color::mul(one.material.emission, mean)));
        if one.material.one_sided_emission { 0.5 * both } else { both }
    }

    /// Whether a material is shown as it is, and lights nothing.
    #[inline]
    pub(crate) fn unlit(&self, material: u32) -> bool {
        self.all[material as usize].unlit
    }

    /// Whether a material has holes or lets light pass by chance.
    #[inline]
    pub(crate) fn has_alpha(&self, material: u32) -> bool {
        self.all[material as usize].material.alpha != AlphaMode::Opaque
    }

    /// Whether there is surface at a point, for a number that decides where there is a share.
    pub(crate) fn is_there(
        &self,
        surfaces: &Surfaces<'_>,
        on: &PartPoint,
        chance: impl Fn() -> f32,
    ) -> bool {
        let one = &self.all[on.material as usize];
        let opacity = || {
            let mut alpha = one.material.opacity;
            if let Some(texture) = &one.base_color {
                alpha *= texture.at(surfaces.uv(on, texture.uv_set))[3];
            }
            if let Some(texture) = &one.opacity {
                alpha *= texture.at(surfaces.uv(on, texture.uv_set))[0];
            }
            if on.colored {
                alpha *= surfaces.color(on)[3];
            }
            alpha
        };
        match one.material.alpha {
            AlphaMode::Opaque => true,
            AlphaMode::Mask { cutoff } => opacity() >= cutoff,
            AlphaMode::Blend => chance() < opacity(),
        }
    }

    /// The base colour at a point.
    pub(crate) fn base_color(&self, surfaces: &Surfaces<'_>, on: &PartPoint) -> [f32; 3] {
        self.all[on.material as usize].factors_at(surfaces, on).base_color
    }

    /// The shading normal with the material's normal texture; on the side of the old one.
    #[inline]
    pub(crate) fn shading_normal(&self, surfaces: &Surfaces<'_>, surface: &Surface) -> [f32; 3] {
        let one = &self.all[surface.on.material as usize];
        let Some(texture) = &one.normal else { return surface.shading };
        let [x, y, z, _] = texture.at(surfaces.uv(&surface.on, texture.uv_set));
        let scale = one.material.normal_scale;
        let bent = [(2.0 * x - 1.0) * scale, (2.0 * y - 1.0) * scale, 2.0 * z - 1.0];
        let normal = surface.shading;
        let tangents = surfaces.tangents(surface, texture.uv_set);
        let Some([tangent, bitangent]) = tangents else { return normal };
        let along = vec3::add(vec3::scale(tangent, bent[0]), vec3::scale(bitangent, bent[1]));
        let normal = vec3::normalize(vec3::add(along, vec3::scale(normal, bent[2].max(0.0))));
        normal.unwrap_or(surface.shading)
    }
}

impl<'a> Prepared<'a> {
    fn new(
        index: usize,
        material: &'a Material,
        model: &'a Model,
        regularize: bool,
        albedos: &mut Albedos,
    ) -> Result<Self, RenderError> {
        let plain = Tables::new(material, 0.0, albedos);
        let broad = if regularize {
            Tables::new(material, BROAD_ROUGHNESS, albedos)
        } else {
            plain.clone()
        };
        let owner = || format!("material {index} ({:?})", material.name);
        let texture = |texture: &Option<Texture>| {
            texture.as_ref().map(|t| Sampler2::new(t, &model.images, &owner)).transpose()
        };
        let specular = vec3::scale(material.specular_color, material.specular);
        let factors = Factors {
            base_color: material.base_color,
            metallic: material.metallic,
            roughness: material.roughness,
            transmission: material.transmission,
            specular,
            clear_coat: material.clear_coat,
            clear_coat_roughness: material.clear_coat_roughness,
            thin_walled: material.thin_walled,
        };
        let [of_plain, of_broad] = [&plain, &broad].map(|tables| Lobes::new(tables, &factors));
        let mut out = Self {
            material,
            surfaces: [(plain, of_plain), (broad, of_broad)],
            factors,
            plain: true,
            emissive: material.is_emissive(),
            unlit: material.unlit,
            base_color: texture(&material.base_color_texture)?,
            metallic_roughness: texture(&material.metallic_roughness_texture)?,
            normal: texture(&material.normal_texture)?,
            emission: texture(&material.emission_texture)?,
            transmission: texture(&material.transmission_texture)?,
            clear_coat: texture(&material.clear_coat_texture)?,
            clear_coat_roughness: texture(&material.clear_coat_roughness_texture)?,
            opacity: texture(&material.opacity_texture)?,
        };
        out.plain = out.base_color.is_none()
            && out.metallic_roughness.is_none()
            && out.transmission.is_none()
            && out.clear_coat.is_none()
            && out.clear_coat_roughness.is_none();
        Ok(out)
    }

    /// The factors, textures multiplied in.
    fn factors_at(&self, surfaces: &Surfaces<'_>, on: &PartPoint) -> Factors {
        let mut factors = self.factors;
        let at = |texture: &Sampler2<'_>| texture.at(surfaces.uv(on, texture.uv_set));
        if let Some(texture) = &self.base_color {
            let [r, g, b, _] = at(texture);
            factors.base_color = color::mul(factors.base_color, [r, g, b]);
        }
        if on.colored {
            let [r, g, b, _] = surfaces.color(on);
            factors.base_color = color::mul(factors.base_color, [r, g, b]);
        }
        if let Some(texture) = &self.metallic_roughness {
            let [_, roughness, metallic, _] = at(texture);
            factors.roughness *= roughness;
            factors.metallic *= metallic;
        }
        if let Some(texture) = &self.transmission {
            factors.transmission *= at(texture)[0];
        }
        if let Some(texture) = &self.clear_coat {
            factors.clear_coat *= at(texture)[0];
        }
        if let Some(texture) = &self.clear_coat_roughness {
            factors.clear_coat_roughness *= at(texture)[1];
        }
        factors
    }
}

/// Names the first factor of a material that cannot be.
fn check(index: usize, material: &Material) -> Result<(), RenderError> {
    let [r, g, b] = material.base_color;
    let [er, eg, eb] = material.emission;
    let [sr, sg, sb] = material.specular_color;
    let cutoff = match material.alpha {
        AlphaMode::Mask { cutoff } => cutoff,
        AlphaMode::Opaque | AlphaMode::Blend => 0.0,
    };
    let factors = [
        ("base_color[0]", r),
        ("base_color[1]", g),
        ("base_color[2]", b),
        ("emission[0]", er),
        ("emission[1]", eg),
        ("emission[2]", eb),
        ("metallic", material.metallic),
        ("roughness", material.roughness),
        ("transmission", material.transmission),
        ("ior", material.ior),
        ("specular", material.specular),
        ("specular_color[0]", sr),
        ("specular_color[1]", sg),
        ("specular_color[2]", sb),
        ("clear_coat", material.clear_coat),
        ("clear_coat_roughness", material.clear_coat_roughness),
        ("opacity", material.opacity),
        ("the alpha cutoff", cutoff),
        ("normal_scale", material.normal_scale.abs()),
    ];
    match factors.into_iter().find(|(_, value)| !(value.is_finite() && *value >= 0.0)) {
        None => Ok(()),
        Some((factor, value)) => {
            let name = material.name.clone();
            Err(RenderError::MaterialFactor { material: index, name, factor, value })
        }
    }
}
