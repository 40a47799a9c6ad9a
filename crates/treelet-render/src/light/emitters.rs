//! Lights that are somewhere: emissive triangles, points and spots, as one numbered list.

use super::tree::{Leaf, LightTree};
use crate::color;
use crate::error::RenderError;
use crate::material::Materials;
use crate::surface::{Place, Surfaces};
use std::collections::BTreeMap;
use treelet::math::vec3;
use treelet_model::LightKind;
use treelet_model::light::SpotFalloff;

/// One light of the list.
#[derive(Clone, Copy, Debug)]
pub(super) enum Emitter {
    Triangle(Place),
    Point(PointLight),
}

/// A point or a spot.
#[derive(Clone, Copy, Debug)]
pub(super) struct PointLight {
    pub(super) position: [f32; 3],
    intensity: [f32; 3],
    cone: Option<Cone>,
}

#[derive(Clone, Copy, Debug)]
struct Cone {
    direction: [f32; 3],
    cos_inner: f32,
    cos_outer: f32,
    falloff: SpotFalloff,
}

impl PointLight {
    /// A point or spot of a model; `None` for lights that are nowhere.
    fn new(kind: &LightKind) -> Option<Self> {
        match *kind {
            LightKind::Point { position, intensity } => {
                Some(Self { position, intensity, cone: None })
            }
            LightKind::Spot {
                position,
                direction,
                intensity,
                inner_angle,
                outer_angle,
                falloff,
            } => {
                let direction = vec3::normalize(direction)?;
                let cos_outer = libm::cosf(outer_angle);
                let cos_inner = libm::cosf(inner_angle.min(outer_angle));
                let cone = Some(Cone { direction, cos_inner, cos_outer, falloff });
                Some(Self { position, intensity, cone })
            }
            LightKind::Directional { .. } => None,
        }
    }

    /// Radiant intensity toward `direction`, away from the light.
    pub(super) fn toward(&self, direction: [f32; 3]) -> [f32; 3] {
        let Some(cone) = &self.cone else { return self.intensity };
        let cos = vec3::dot(direction, cone.direction);
        let fade = if cos >= cone.cos_inner {
            1.0
        } else if cos <= cone.cos_outer {
            0.0
        } else {
            let x = (cos - cone.cos_outer) / (cone.cos_inner - cone.cos_outer);
            match cone.falloff {
                SpotFalloff::Square => x * x,
                SpotFalloff::Smooth => x * x * (3.0 - 2.0 * x),
            }
        };
        vec3::scale(self.intensity, fade)
    }
}

/// All of them.
#[derive(Clone, Debug)]
pub(super) struct Emitters {
    pub(super) list: Vec<Emitter>,
    pub(super) tree: LightTree,
    /// By placement and part: the number of its first triangle.
    first: BTreeMap<(u32, u32), u32>,
}

impl Emitters {
    /// Collects what shines; `None` if nothing does.
    pub(super) fn new(
        surfaces: &Surfaces<'_>,
        materials: &Materials<'_>,
        lights: &[treelet_model::Light],
    ) -> Result<Option<Self>, RenderError> {
        // All room at once: a lamp of many triangles that is placed often is refused, not begun.
        let emissive = |placement: usize| {
            let parts = surfaces.materials(placement).enumerate();
            parts.filter(|&(_, material)| materials.mean_emission(material) > 0.0)
        };
        let count = (0..surfaces.placements())
            .flat_map(|placement| emissive(placement).map(move |(geom, _)| (placement, geom)))
            .map(|(placement, geom)| surfaces.triangles(placement, geom) as u64)
            .fold(lights.len() as u64, u64::saturating_add);
        let bytes = count.saturating_mul((size_of::<Emitter>() + size_of::<Leaf>()) as u64);
        let refused = || RenderError::OutOfMemory { bytes, what: "the list of lights" };
        let Ok(room) = u32::try_from(count) else { return Err(refused()) };
        let (mut list, mut leaves) = (Vec::new(), Vec::new());
        list.try_reserve_exact(room as usize).map_err(|_| refused())?;
        leaves.try_reserve_exact(room as usize).map_err(|_| refused())?;

        // Triangles: a sheet of radiance L and area A brings about L A / d^2.
        let mut first = BTreeMap::new();
        for placement in 0..surfaces.placements() {
            for (geom, material) in emissive(placement) {
                let luminance = materials.mean_emission(material);
                let (placement, geom) = (placement as u32, geom as u32);
                first.insert((placement, geom), list.len() as u32);
                for prim in 0..surfaces.triangles(placement as usize, geom as usize) {
                    let place = Place { placement, geom, prim: prim as u32 };
                    leaves.extend(leaf(surfaces, place, list.len() as u32, luminance));
                    list.push(Emitter::Triangle(place));
                }
            }
        }

        // Points and spots.
        for light in lights {
            if let Some(point) = PointLight::new(&light.kind) {
                let power = f64::from(color::luminance(point.intensity));
                let position = point.position.map(f64::from);
                if power > 0.0 {
                    let index = list.len() as u32;
                    leaves.push(Leaf { index, position, radius_sq: 0.0, power });
                    list.push(Emitter::Point(point));
                }
            }
        }
        let tree = LightTree::new(leaves, list.len())?;
        Ok(tree.map(|tree| Self { list, tree, first }))
    }

    /// The number of a triangle.
    pub(super) fn number(&self, at: Place) -> Option<u32> {
        Some(self.first.get(&(at.placement, at.geom))? + at.prim)
    }
}

/// A triangle as a leaf of the tree; `None` if it has no area or no power.
fn leaf(surfaces: &Surfaces<'_>, place: Place, index: u32, luminance: f64) -> Option<Leaf> {
    let power = surfaces.area(place)? * luminance;
    let corners = surfaces.corners(place)?;
    let position: [f64; 3] =
        core::array::from_fn(|k| (corners[0][k] + corners[1][k] + corners[2][k]) / 3.0);
    // The mean square over a triangle is a twelfth of the sum over its corners.
    let square = |corner: &[f64; 3]| -> f64 {
        (0..3).map(|k| (corner[k] - position[k]) * (corner[k] - position[k])).sum()
    };
    let radius_sq = corners.iter().map(square).sum::<f64>() / 12.0;
    (power > 0.0 && power.is_finite()).then_some(Leaf { index, position, radius_sq, power })
}
