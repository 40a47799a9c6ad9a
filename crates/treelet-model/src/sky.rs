//! The light from outside: a gradient, and a sun of finite size.

/// A sky without clouds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    /// The axis (0, 1, 2) that points up.
    pub up: usize,
    /// Radiance overhead.
    pub zenith: [f32; 3],
    /// Radiance at the horizon.
    pub horizon: [f32; 3],
    /// Radiance from below the horizon.
    pub ground: [f32; 3],
    /// The sun, if it shines.
    pub sun: Option<Sun>,
}

/// A disc of constant radiance at infinity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Unit vector toward the sun.
    pub direction: [f32; 3],
    /// Half the angle under which it is seen, radians, above 0.
    pub angular_radius: f32,
    /// Radiance of the disc.
    pub radiance: [f32; 3],
}

impl Sky {
    /// The same radiance from everywhere, as a furnace test wants it.
    pub const fn uniform(radiance: [f32; 3]) -> Self {
        Self { up: 1, zenith: radiance, horizon: radiance, ground: radiance, sun: None }
    }

    /// A clear day: blue above, warm sun at a third of the height, grey ground.
    pub fn clear(up: usize) -> Self {
        let mut direction = [0.0; 3];
        // A unit vector: 0.6^2 + 0.64^2 + 0.48^2 = 1.
        direction[up % 3] = 0.6;
        direction[(up + 1) % 3] = 0.64;
        // Beside, not behind, the camera of `Camera::framing`: shapes are seen by their shade.
        direction[(up + 2) % 3] = -0.48;
        Self {
            up: up % 3,
            zenith: [0.26, 0.42, 0.78],
            horizon: [0.86, 0.93, 1.0],
            ground: [0.22, 0.20, 0.18],
            sun: Some(Sun {
                direction,
                angular_radius: 0.02,
                // Irradiance pi * 0.02^2 * 2400, about 3, three times that of the sky.
                radiance: [2700.0, 2400.0, 1950.0],
            }),
        }
    }
}
