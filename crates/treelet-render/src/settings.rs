//! What a picture is made with.

/// The settings of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Pixels in a row, at least 1.
    pub width: u32,
    /// Rows, at least 1; `width * height` at most `2^31`.
    pub height: u32,
    /// How often light may be scattered between a lamp and the eye; 0 shows lamps and sky only.
    pub max_bounces: u32,
    /// Another seed, another noise.
    pub seed: u64,
    /// The axis (0, 1, 2) that points up, for the sky of a model that has none.
    pub up: usize,
    /// The most that one path may bring, per channel, after it was scattered twice, in the units of
    /// radiance that an exposure of 1 shows as near white; more is cut off. Infinite: nothing is.
    /// Cutting makes fireflies dim, and what is lit by them a little darker than it should be.
    pub clamp_indirect: f32,
    /// Whether shiny surfaces are shown less shiny, and the sun wider, to light that was already
    /// scattered broadly: caustics become soft instead of a few bright pixels.
    pub regularize: bool,
    /// How lights are found. All three give the same picture in the end.
    pub strategy: Strategy,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            width: 1280,
            height: 720,
            max_bounces: 8,
            seed: 0,
            up: 1,
            clamp_indirect: f32::INFINITY,
            regularize: false,
            strategy: Strategy::Both,
        }
    }
}

impl Settings {
    /// The defaults with two biases that make less noise: fireflies are cut off, caustics soft.
    pub fn softened() -> Self {
        Self { clamp_indirect: CLAMP, regularize: true, ..Self::default() }
    }
}

/// What [`Settings::softened`] cuts off at: four times what shows as near white.
const CLAMP: f32 = 4.0;

/// How lights are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Strategy {
    /// Toward the lights and along the surface's lobes, each weighed by the power heuristic.
    #[default]
    Both,
    /// Toward the lights only, except along smooth glass.
    Lights,
    /// Along the lobes only; lights without a surface are not found.
    Lobes,
}
