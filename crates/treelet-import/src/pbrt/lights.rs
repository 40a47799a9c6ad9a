//! Lights: with a place or a direction, far away, and on surfaces.

use treelet_model::light::{Projection, SpotFalloff};
use treelet_model::{Environment, Light, LightKind, Sky};

use crate::error::{Place, Result};
use crate::source::Source;

use super::params::Params;
use super::scene::Scene;
use super::transform;

impl Scene<'_, '_> {
    /// What the next shapes emit.
    pub(super) fn area_light(&mut self, kind: &str, params: &Params) {
        if kind != "diffuse" && kind != "area" {
            self.notes.add(format!("The area light {kind:?} is read as \"diffuse\""));
        }
        if params.find("filename").is_some() {
            self.notes.add("Pictures on area lights are not read");
        }
        let radiance = self.radiance(params, "L");
        self.state.emission = Some((radiance, params.bool("twosided", false)));
    }

    /// A light with no surface.
    pub(super) fn light(&mut self, file: &Source<'_>, kind: &str, params: &Params) -> Result<()> {
        let from = params.point("from", [0.0; 3]);
        let to = params.point("to", [0.0, 0.0, 1.0]);
        let position = transform::point(&self.state.ctm, from);
        let along = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
        let direction = transform::unit(transform::vector(&self.state.ctm, along));
        let direction = direction.map(|d| d.map(|x| x as f32));
        let kind = match (kind, direction) {
            ("infinite", _) => return self.infinite(file, params),
            ("distant", Some(direction)) => {
                let irradiance = match params.find("illuminance") {
                    Some(_) => [params.float("illuminance", 1.0); 3],
                    None => self.radiance(params, "L"),
                };
                LightKind::Directional { direction, irradiance }
            }
            ("spot", Some(direction)) => {
                let cone = params.float("coneangle", 30.0).clamp(0.01, 180.0);
                let delta = params.float("conedeltaangle", 5.0).clamp(0.0, cone);
                LightKind::Spot {
                    position,
                    direction,
                    intensity: self.radiance(params, "I"),
                    inner_angle: (cone - delta).to_radians(),
                    outer_angle: cone.to_radians(),
                    falloff: SpotFalloff::Smooth,
                }
            }
            ("distant" | "spot", None) => {
                self.notes.add("A light that shines in no direction is left out");
                return Ok(());
            }
            (kind, _) => {
                if kind != "point" {
                    self.notes.add(format!("The light {kind:?} is read as \"point\""));
                }
                LightKind::Point { position, intensity: self.radiance(params, "I") }
            }
        };
        file.push(&mut self.model.lights, Light { name: String::new(), kind }, "lights")
    }

    /// Light from all that is far away.
    fn infinite(&mut self, file: &Source<'_>, params: &Params) -> Result<()> {
        if self.model.environment.is_some() || self.model.sky.is_some() {
            self.notes.add("Only the first infinite light is read");
            return Ok(());
        }
        let name = params.string("filename").or_else(|| params.string("mapname"));
        let Some(name) = name else {
            self.model.sky = Some(Sky::uniform(self.radiance(params, "L")));
            return Ok(());
        };
        let name = name.to_owned();
        let Some(image) = self.image(file, &Place::Line(params.line), &name)? else {
            return Ok(());
        };
        let scale = [params.float("scale", 1.0); 3];
        // Maps of version 3 are twice as wide as high; version 4 has squares.
        let is_square = self.model.images.get(image).is_some_and(|i| i.width == i.height);
        let ctm = &self.state.ctm;
        let (projection, world) = if is_square {
            (Projection::EqualAreaOctahedral, *ctm)
        } else {
            // There +z points up, and the picture's middle looks along -x, its right half along -y.
            let turn = [[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]];
            (Projection::LatLong, transform::compose(ctm, &turn))
        };
        let mut world_from_environment = transform::rounded(&world);
        for row in &mut world_from_environment.0 {
            row[3] = 0.0;
        }
        self.model.environment =
            Some(Environment { image, projection, world_from_environment, scale });
        Ok(())
    }

    /// A light's colour times its `scale`; finite and not below zero.
    fn radiance(&mut self, params: &Params, name: &str) -> [f32; 3] {
        if params.find("power").is_some() {
            self.notes.add("The power of a light is not read; its colour and scale are");
        }
        let scale = params.float("scale", 1.0);
        let color = self.light_color(params, name);
        color.map(|channel| {
            let channel = channel * scale;
            if channel.is_finite() { channel.max(0.0) } else { 0.0 }
        })
    }
}
