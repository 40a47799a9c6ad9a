//! What a material needs beside its numbers at a point.

use super::albedo::{Albedos, Lobe, Rows};
use super::{fresnel, ggx, glass};
use treelet_model::Material;

/// Diamond has 2.4; beyond this the coat is a mirror.
const IOR_MAX: f32 = 100.0;
/// The clear coat's index of refraction, as glTF fixes it.
pub(super) const CLEAR_IOR: f32 = 1.5;

/// Albedos of a material's lobes.
#[derive(Clone, Debug)]
pub(crate) struct Tables {
    pub(super) ior: f32,
    /// Metal, coat and clear coat are not smoother than this.
    pub(super) roughness_min: f32,
    pub(super) mirror: Rows,
    pub(super) coat: Rows,
    pub(super) clear: Rows,
    /// Seen from outside and from inside; made for rough glass only.
    pub(super) glass: Option<[Rows; 2]>,
    /// Of a pane: one mirror blurs both lobes.
    pub(super) pane: Option<Rows>,
    /// What of multiple bounces goes through, from outside and from inside, by roughness.
    through: Vec<[f32; 2]>,
    /// The same for panes.
    pub(super) pane_through: f32,
}

impl Tables {
    /// The tables of a material whose metal and coat are not smoother than `roughness_min`.
    pub(crate) fn new(material: &Material, roughness_min: f32, albedos: &mut Albedos) -> Self {
        let unit = |x: f32| x.clamp(0.0, 1.0);
        let ior = material.ior.clamp(1.0, IOR_MAX);
        // Without a texture one roughness is enough.
        let textured = material.metallic_roughness_texture.is_some();
        let plain = (!textured).then(|| unit(material.roughness));
        let roughness = plain.map(|roughness| roughness.max(roughness_min));
        let clear_textured = material.clear_coat_roughness_texture.is_some();
        let clear = unit(material.clear_coat_roughness).max(roughness_min);
        let clear = (!clear_textured).then_some(clear);

        let lets_through = material.transmission > 0.0;
        let rough = plain.is_none_or(|roughness| roughness * roughness > ggx::ALPHA_MIN);
        let solid = lets_through && rough && !material.thin_walled;
        let glass = solid.then(|| {
            [Lobe::GlassOutside, Lobe::GlassInside].map(|lobe| albedos.rows(lobe, plain, ior))
        });
        let through = glass.as_ref().map_or(Vec::new(), |[outside, inside]| {
            // By the mean over roughness: the identity must hold at each roughness, so one share
            // is found for each.
            (0..=THROUGH_STEPS)
                .map(|step| {
                    let roughness = step as f32 / THROUGH_STEPS as f32;
                    let mean = [outside.mean(roughness), inside.mean(roughness)];
                    glass::share_through(mean, ior)
                })
                .collect()
        });
        let pane = (lets_through && rough && material.thin_walled)
            .then(|| albedos.rows(Lobe::Mirror, plain, ior));
        Self {
            ior,
            roughness_min,
            mirror: albedos.rows(Lobe::Mirror, roughness, ior),
            coat: albedos.rows(Lobe::Coat, roughness, ior),
            clear: albedos.rows(Lobe::Coat, clear, CLEAR_IOR),
            glass,
            pane,
            through,
            pane_through: 1.0 - glass::thin_reflectance(fresnel::COS_DIFFUSE, ior),
        }
    }

    /// The share of multiple bounces that goes through.
    pub(super) fn through(&self, roughness: f32, outside: bool) -> f32 {
        let place = roughness * THROUGH_STEPS as f32;
        let step = (place as usize).min(THROUGH_STEPS - 1);
        let side = usize::from(!outside);
        match self.through.get(step..step + 2) {
            Some(pair) => {
                let rest = place - step as f32;
                (1.0 - rest) * pair[0][side] + rest * pair[1][side]
            }
            None => 0.0,
        }
    }
}

/// Steps of roughness.
const THROUGH_STEPS: usize = 16;
