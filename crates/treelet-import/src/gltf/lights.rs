//! `KHR_lights_punctual`: lights that nodes place.

use treelet_model::animation::transform::{self, Rows};
use treelet_model::light::SpotFalloff;
use treelet_model::{Light, LightKind};

use super::json;

/// A light at a node; `None` if it is of an unknown kind or shines in no direction.
pub(super) fn place(json: &json::Light, world: &Rows) -> Option<Light> {
    let intensity = json.intensity.unwrap_or(1.0);
    let light = json.color.unwrap_or([1.0; 3]).map(|channel| channel * intensity);
    let is_sound = light.iter().all(|x| x.is_finite());
    let light = light.map(|channel| channel.max(0.0));
    let (position, direction) = ([0.0; 3], [0.0, 0.0, -1.0]);
    let kind = match json.kind.as_str() {
        "point" => LightKind::Point { position, intensity: light },
        "directional" => LightKind::Directional { direction, irradiance: light },
        "spot" => {
            let outer = json.spot.outer_cone_angle.unwrap_or(core::f32::consts::FRAC_PI_4);
            let outer_angle = outer.clamp(1e-4, core::f32::consts::FRAC_PI_2);
            LightKind::Spot {
                position,
                direction,
                intensity: light,
                inner_angle: json.spot.inner_cone_angle.unwrap_or(0.0).clamp(0.0, outer_angle),
                outer_angle,
                falloff: SpotFalloff::Square,
            }
        }
        _ => return None,
    };
    let kind = transform::light_at(kind, world)?;
    is_sound.then(|| Light { name: json.name.clone(), kind })
}
