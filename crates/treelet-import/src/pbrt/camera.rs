//! Cameras and the film, which says what of a camera's view is seen.

use treelet_model::Camera;
use treelet_model::camera::{Lens, View};

use super::params::Params;
use super::scene::Scene;
use super::transform::{self, Rows};

/// The picture that a file asks for, and the camera that waits for it.
#[derive(Debug)]
pub(super) struct Film {
    resolution: [u32; 2],
    /// The up vector of the last `LookAt`.
    pub(super) up: Option<[f64; 3]>,
    waiting: Option<Waiting>,
}

/// A camera whose film may still come.
#[derive(Debug)]
struct Waiting {
    world_from_camera: Rows,
    is_orthographic: bool,
    /// Degrees over the shorter side.
    fov: f32,
    /// Half the height of the view, in units of half its shorter side.
    window: Option<f32>,
    aspect: Option<f32>,
    lens: Option<Lens>,
}

/// As pbrt has it.
const RESOLUTION: [u32; 2] = [1280, 720];

impl Default for Film {
    fn default() -> Self {
        Self { resolution: RESOLUTION, up: None, waiting: None }
    }
}

impl Film {
    /// Takes the size that `Film` says.
    pub(super) fn size(&mut self, params: &Params) {
        for (side, name) in self.resolution.iter_mut().zip(["xresolution", "yresolution"]) {
            let told = params.integers(name).and_then(|integers| integers.first());
            if let Some(&told) = told
                && (1..=1 << 20).contains(&told)
            {
                *side = told as u32;
            }
        }
    }

    /// The axis that points up, if the file looked at something upright.
    pub(super) fn up_axis(&self) -> Option<usize> {
        let up = self.up?;
        (0..3).find(|&axis| {
            (0..3).all(|other| other == axis || up[axis].abs() > 2.0 * up[other].abs())
        })
    }
}

impl Scene<'_, '_> {
    /// Remembers a camera until the world begins.
    pub(super) fn camera(&mut self, kind: &str, params: &Params) {
        let Some(world_from_camera) = transform::inverse(&self.state.ctm) else {
            self.notes.add("A camera whose transform has no inverse is left out");
            return;
        };
        if !matches!(kind, "perspective" | "orthographic") {
            self.notes.add(format!("The camera {kind:?} is read as \"perspective\""));
        }
        let radius = params.float("lensradius", 0.0);
        let focus_distance = params.float("focaldistance", 1e6);
        let window = params.numbers("screenwindow").and_then(|window| window.get(3)).copied();
        let aspect = params.float("frameaspectratio", 0.0);
        self.film.waiting = Some(Waiting {
            world_from_camera,
            is_orthographic: kind == "orthographic",
            fov: params.float("fov", 90.0),
            window: window.filter(|window| *window > 0.0 && window.is_finite()),
            aspect: Some(aspect).filter(|aspect| *aspect > 0.0),
            lens: (radius > 0.0 && focus_distance > 0.0).then_some(Lens { radius, focus_distance }),
        });
    }

    /// Adds the camera that waits, now that its film is known.
    pub(super) fn place_camera(&mut self) {
        let Some(waiting) = self.film.waiting.take() else { return };
        let [width, height] = self.film.resolution;
        let aspect = waiting.aspect.unwrap_or(width as f32 / height as f32);
        let window = waiting.window.unwrap_or(if aspect < 1.0 { 1.0 / aspect } else { 1.0 });
        // pbrt's cameras look along +z, the model's along -z.
        let m = &waiting.world_from_camera;
        let axis = |k: usize| transform::unit([m[0][k], m[1][k], m[2][k]]);
        let (Some(x), Some(y), Some(z)) = (axis(0), axis(1), axis(2)) else { return };
        let row = |k: usize| [x[k], y[k], -z[k], m[k][3]];
        let world_from_camera = transform::rounded(&[row(0), row(1), row(2)]);
        let scale = transform::vector(m, [0.0, 1.0, 0.0]);
        let scale = libm::sqrt(transform::dot(scale, scale)) as f32;
        let view = if waiting.is_orthographic {
            View::Orthographic { height: 2.0 * window * scale }
        } else {
            let half = waiting.fov.clamp(0.01, 179.0).to_radians() * 0.5;
            View::Perspective { vertical_fov: 2.0 * libm::atanf(libm::tanf(half) * window) }
        };
        let lens = waiting.lens.map(|lens| Lens {
            radius: lens.radius * scale,
            focus_distance: lens.focus_distance * scale,
        });
        if world_from_camera.is_finite() {
            let resolution = Some(self.film.resolution);
            let name = String::new();
            self.model.cameras.push(Camera { name, world_from_camera, view, lens, resolution });
        }
    }
}
