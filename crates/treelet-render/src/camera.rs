//! From a place in the picture to a ray: perspective and orthographic cameras, thin lenses.
//!
//! Source: C. Kolb, D. Mitchell, P. Hanrahan, "A Realistic Camera Model for Computer Graphics",
//! SIGGRAPH 1995, section 3 (the thin lens).

use crate::error::RenderError;
use crate::frame::direction_of;
use crate::trig::sincos_of_turn;
use treelet::Ray;
use treelet::math::vec3;
use treelet_model::{Camera, View};

/// A camera over a film of known size.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Eye {
    origin: [f32; 3],
    forward: [f32; 3],
    /// What pixel coordinates `(x, y)` name is `corner + x * right + y * down`: a direction one
    /// unit deep, or for orthographic cameras an offset from the origin.
    corner: [f32; 3],
    right: [f32; 3],
    down: [f32; 3],
    orthographic: bool,
    lens: Option<Glass>,
}

/// A lens of some size.
#[derive(Clone, Copy, Debug)]
struct Glass {
    /// Axes of the lens, as long as its radius.
    x: [f32; 3],
    y: [f32; 3],
    focus_distance: f32,
}

impl Eye {
    /// Checks the camera; its axes are normalised, so that a scale in the file does no harm.
    pub(crate) fn new(camera: &Camera, width: u32, height: u32) -> Result<Self, RenderError> {
        // In pixels the view is `height` high, and this far away.
        let half_height = 0.5 * height as f32;
        let (step, orthographic) = match camera.view {
            View::Perspective { vertical_fov: radians } => {
                if !(radians > 0.0 && radians < core::f32::consts::PI) {
                    return Err(RenderError::FieldOfView { radians });
                }
                (libm::tanf(0.5 * radians) / half_height, false)
            }
            View::Orthographic { height } => {
                if !(height > 0.0 && height.is_finite()) {
                    return Err(RenderError::ViewHeight { height });
                }
                (0.5 * height / half_height, true)
            }
        };
        let rows = camera.world_from_camera.0;
        let bad = RenderError::CameraMatrix { rows };
        if !camera.world_from_camera.is_finite() {
            return Err(bad);
        }
        let column = |c: usize| vec3::normalize(rows.map(|row| row[c]));
        let (Some(x), Some(y), Some(z)) = (column(0), column(1), column(2)) else {
            return Err(bad);
        };
        let (right, down) = (vec3::scale(x, step), vec3::scale(y, -step));
        let to_left = vec3::scale(right, -0.5 * width as f32);
        let to_top = vec3::scale(down, -half_height);
        let deep = if orthographic { [0.0; 3] } else { z };
        let corner = vec3::sub(vec3::add(to_left, to_top), deep);
        let lens = match camera.lens {
            Some(lens) if lens.radius != 0.0 => {
                let fits = lens.radius > 0.0 && lens.radius.is_finite();
                if !(fits && lens.focus_distance > 0.0 && lens.focus_distance.is_finite()) {
                    let (radius, focus_distance) = (lens.radius, lens.focus_distance);
                    return Err(RenderError::Lens { radius, focus_distance });
                }
                let (x, y) = (vec3::scale(x, lens.radius), vec3::scale(y, lens.radius));
                Some(Glass { x, y, focus_distance: lens.focus_distance })
            }
            _ => None,
        };
        let (origin, forward) = (camera.position(), vec3::scale(z, -1.0));
        Ok(Self { origin, forward, corner, right, down, orthographic, lens })
    }

    /// Whether rays start from a lens, so that [`Eye::ray`] wants a point of it.
    pub(crate) fn has_lens(&self) -> bool {
        self.lens.is_some()
    }

    /// The ray through a place on the film, in pixels from its upper left corner, and a point of
    /// the lens by a point of the unit square; of unit length. `[0; 2]` is the lens' middle.
    #[inline]
    pub(crate) fn ray(&self, x: f32, y: f32, u: [f32; 2]) -> Ray {
        let sideways = vec3::add(vec3::scale(self.right, x), vec3::scale(self.down, y));
        let place = vec3::add(self.corner, sideways);
        let (origin, along) = if self.orthographic {
            (vec3::add(self.origin, place), self.forward)
        } else {
            (self.origin, place)
        };
        if let Some(lens) = &self.lens {
            // All rays of a pixel meet in the plane of focus.
            let radius = u[0].sqrt();
            let (sin, cos) = sincos_of_turn(u[1]);
            let x = vec3::scale(lens.x, radius * cos);
            let offset = vec3::add(x, vec3::scale(lens.y, radius * sin));
            let toward = vec3::sub(vec3::scale(along, lens.focus_distance), offset);
            let direction = direction_of(toward).unwrap_or(self.forward);
            return Ray::new(vec3::add(origin, offset), direction);
        }
        // Never `None`: perspective corners lie one unit in front of the camera.
        Ray::new(origin, direction_of(along).unwrap_or(self.forward))
    }
}

#[cfg(test)]
mod tests {
    use super::Eye;
    use crate::error::RenderError;
    use treelet::math::vec3;
    use treelet_model::{Camera, Lens, View};

    #[test]
    fn edges_are_half_the_angle_apart() {
        let camera = Camera::look_at([1.0, 2.0, 3.0], [1.0, 2.0, 0.0], [0.0, 1.0, 0.0], 0.8);
        let eye = Eye::new(&camera.unwrap(), 200, 100).unwrap();
        let top = eye.ray(100.0, 0.0, [0.0; 2]).direction;
        assert!((libm::atan2f(top[1], -top[2]) - 0.4).abs() < 1e-6);
        assert!(top[0].abs() < 1e-6 && (vec3::dot(top, top) - 1.0).abs() < 1e-6);
        let left = eye.ray(0.0, 50.0, [0.0; 2]).direction;
        assert!(left[0] < 0.0 && (left[0] / left[2] - 2.0 * libm::tanf(0.4)).abs() < 1e-6);
    }

    #[test]
    fn nonsense_is_refused() {
        let good = Camera::look_at([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 1.0).unwrap();
        for vertical_fov in [0.0, -1.0, 3.2, f32::NAN, f32::INFINITY] {
            let camera = Camera { view: View::Perspective { vertical_fov }, ..good.clone() };
            let error = Eye::new(&camera, 10, 10).unwrap_err();
            assert!(matches!(error, RenderError::FieldOfView { .. }), "{vertical_fov}");
        }
        let mut flat = good.clone();
        flat.world_from_camera.0.iter_mut().for_each(|row| row[0] = 0.0);
        assert!(Eye::new(&flat, 10, 10).is_err());
        let mut nan = good;
        nan.world_from_camera.0[1][3] = f32::NAN;
        assert!(Eye::new(&nan, 10, 10).is_err());
    }

    #[test]
    fn orthographic_rays_are_parallel() {
        let view = View::Orthographic { height: 4.0 };
        let camera = Camera { view, ..Camera::default() };
        let eye = Eye::new(&camera, 20, 10).unwrap();
        for (x, y, origin) in
            [(10.0, 5.0, [0.0; 3]), (0.0, 0.0, [-4.0, 2.0, 0.0]), (20.0, 10.0, [4.0, -2.0, 0.0])]
        {
            let ray = eye.ray(x, y, [0.0; 2]);
            assert_eq!((ray.origin, ray.direction), (origin, [0.0, 0.0, -1.0]));
        }
        let flat = Camera { view: View::Orthographic { height: 0.0 }, ..camera };
        assert!(matches!(Eye::new(&flat, 9, 9).unwrap_err(), RenderError::ViewHeight { .. }));
    }

    #[test]
    fn rays_of_a_lens_meet_in_the_plane_of_focus() {
        let lens = Some(Lens { radius: 0.5, focus_distance: 3.0 });
        let camera = Camera { lens, ..Camera::default() };
        let eye = Eye::new(&camera, 20, 10).unwrap();
        let sharp = Eye::new(&Camera::default(), 20, 10).unwrap();
        for (x, y) in [(10.0, 5.0), (3.0, 8.0)] {
            let meet = sharp.ray(x, y, [0.0; 2]).direction;
            let meet = vec3::scale(meet, 3.0 / -meet[2]);
            for u in [[0.0, 0.0], [1.0, 0.3], [0.5, 0.9]] {
                let ray = eye.ray(x, y, u);
                let apart = vec3::sub(meet, ray.origin);
                let across = vec3::cross(apart, ray.direction);
                assert!(vec3::max_abs(across) < 1e-5, "{u:?}: {across:?}");
                let off = vec3::dot(ray.origin, ray.origin).sqrt();
                assert!((off - 0.5 * u[0].sqrt()).abs() < 1e-6);
            }
        }
        let bad = Some(Lens { radius: 0.5, focus_distance: 0.0 });
        let bad = Eye::new(&Camera { lens: bad, ..camera }, 9, 9).unwrap_err();
        assert!(matches!(bad, RenderError::Lens { .. }));
    }
}
