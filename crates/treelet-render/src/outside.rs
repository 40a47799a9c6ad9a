//! The light from outside: a sky by rule, or a picture.

use crate::error::RenderError;
use crate::map::MapLight;
use crate::sky::{SkyLight, default_sky};
use treelet_model::Model;

/// What rays see that meet nothing.
#[derive(Clone, Debug)]
pub(crate) enum Outside<'a> {
    Sky(Box<SkyLight>),
    Map(MapLight<'a>),
}

impl<'a> Outside<'a> {
    /// The model's environment, or else its sky, or else the default.
    pub(crate) fn new(model: &'a Model, up: usize, regularize: bool) -> Result<Self, RenderError> {
        Ok(match &model.environment {
            Some(environment) => Self::Map(MapLight::new(environment, &model.images)?),
            None => Self::Sky(Box::new(SkyLight::new(&default_sky(model, up), regularize)?)),
        })
    }

    /// About the irradiance of a surface that sees half of it; 0 if it is black.
    pub(crate) fn irradiance(&self) -> f64 {
        match self {
            Self::Sky(sky) => sky.irradiance(),
            Self::Map(map) => map.irradiance(),
        }
    }

    /// Radiance from a unit direction. `wide` shows a sun widened, see `sky.rs`.
    #[inline]
    pub(crate) fn radiance(&self, direction: [f32; 3], wide: bool) -> [f32; 3] {
        match self {
            Self::Sky(sky) => sky.radiance(direction, wide),
            Self::Map(map) => map.radiance(direction),
        }
    }

    /// A direction, for a number that chooses and a point of the unit square.
    #[inline]
    pub(crate) fn sample(&self, choice: f32, u: [f32; 2]) -> [f32; 3] {
        match self {
            Self::Sky(sky) => sky.sample(choice, u),
            Self::Map(map) => map.sample(choice, u),
        }
    }

    /// The density over solid angle with which [`Outside::sample`] draws a unit direction.
    #[inline]
    pub(crate) fn pdf(&self, direction: [f32; 3]) -> f32 {
        match self {
            Self::Sky(sky) => sky.pdf(direction),
            Self::Map(map) => map.pdf(direction),
        }
    }
}
