//! `KHR_lights_punctual`: lights that nodes place.

use treelet_model::light::SpotFalloff;
use treelet_model::{Light, LightKind};

use super::json;
use super::nodes::Rows;

/// A light at a node; `None` if it is of an unknown kind or shines in no direction.
pub(super) fn place(json: &json::Light, world: &Rows) -> Option<Light> {
    let at = |row: usize| world[row][3] as f32;
    let position = [at(0), at(1), at(2)];
    // It shines along its own -z.
    let axis = super::nodes::unit([-world[0][2], -world[1][2], -world[2][2]]);
    let axis = axis.map(|axis| axis.map(|x| x as f32));
    let intensity = json.intensity.unwrap_or(1.0);
    let light = json.color.unwrap_or([1.0; 3]).map(|channel| channel * intensity);
    let is_sound = light.iter().chain(&position).all(|x| x.is_finite());
    let light = light.map(|channel| channel.max(0.0));
    let kind = match json.kind.as_str() {
        "point" => LightKind::Point { position, intensity: light },
        "directional" => LightKind::Directional { direction: axis?, irradiance: light },
        "spot" => {
            let outer = json.spot.outer_cone_angle.unwrap_or(core::f32::consts::FRAC_PI_4);
            let outer_angle = outer.clamp(1e-4, core::f32::consts::FRAC_PI_2);
            LightKind::Spot {
                position,
                direction: axis?,
                intensity: light,
                inner_angle: json.spot.inner_cone_angle.unwrap_or(0.0).clamp(0.0, outer_angle),
                outer_angle,
                falloff: SpotFalloff::Square,
            }
        }
        _ => return None,
    };
    is_sound.then(|| Light { name: json.name.clone(), kind })
}
