//! A lamp beside the camera, for rooms that no other light reaches; and how to tell that one is needed.

use clap::ValueEnum;
use treelet::Ray;
use treelet::math::vec3;
use treelet_model::{Camera, Light, LightKind, Model, PlacedModel, View};
use treelet_render::{Film, RenderError};

/// What lights the scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum LightChoice {
    /// The lights of the file, or a sky where there are none.
    #[default]
    Scene,
    /// These, and a lamp where the camera stands.
    Headlamp,
}

/// Irradiance where most of what is seen stands: as much as the default sky's sun brings.
const IRRADIANCE: f32 = 3.0;

/// Rays along each side of the grid that asks how far away things are.
const SIDE: u32 = 16;

/// A picture of which so much is black shows nothing.
const BLACK_SHARE: f64 = 0.75;

/// A lamp where the camera stands, as bright as what it sees is far away.
///
/// For a turntable it stays where the first camera stands.
pub(super) fn headlamp(camera: &Camera, placed: &PlacedModel) -> Light {
    let distance = usual_distance(camera, placed);
    let intensity = IRRADIANCE * distance * distance;
    let kind = LightKind::Point { position: camera.position(), intensity: [intensity; 3] };
    Light { name: "headlamp".into(), kind }
}

/// The median distance of what a grid of rays sees.
fn usual_distance(camera: &Camera, placed: &PlacedModel) -> f32 {
    let map = &camera.world_from_camera;
    let reach = match camera.view {
        View::Perspective { vertical_fov } => libm::tanf(0.5 * vertical_fov),
        View::Orthographic { .. } => 0.0,
    };
    let place = |i: u32| reach * (2.0 * (i as f32 + 0.5) / SIDE as f32 - 1.0);
    let mut seen: Vec<f32> = (0..SIDE * SIDE)
        .filter_map(|i| {
            let along = map.vector([place(i % SIDE), place(i / SIDE), -1.0]);
            let hit =
                placed.scene.closest(&Ray::new(camera.position(), vec3::normalize(along)?))?;
            Some(hit.t)
        })
        .collect();
    seen.sort_by(f32::total_cmp);
    seen.get(seen.len() / 2).copied().unwrap_or(1.0)
}

/// What to say where all light comes from outside, and next to none reaches what is seen.
pub(super) fn complaint(model: &Model, film: &Film) -> Result<Option<String>, RenderError> {
    let inside = !model.lights.is_empty() || model.materials.iter().any(|m| m.is_emissive());
    if inside {
        return Ok(None);
    }
    let means = film.means()?;
    let black = means.iter().filter(|mean| **mean == [0.0; 3]).count();
    let share = black as f64 / means.len() as f64;
    Ok((share > BLACK_SHARE).then(|| {
        format!(
            "{} % of the picture is black: all light comes from outside the scene, and hardly any \
             reaches what the camera sees; --light headlamp puts a lamp where the camera stands",
            // Never 100 while anything is seen.
            (100.0 * share).floor()
        )
    }))
}
