//! From a place in the picture to a ray.

use crate::error::RenderError;
use treelet::Ray;
use treelet::math::vec3;
use treelet_model::Camera;

/// A pinhole camera over a film of known size.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pinhole {
    origin: [f32; 3],
    /// The direction through pixel coordinates `(x, y)` is `corner + x * right + y * down`.
    corner: [f32; 3],
    right: [f32; 3],
    down: [f32; 3],
}

impl Pinhole {
    /// Checks the camera; its axes are normalised, so that a scale in the file does no harm.
    pub(crate) fn new(camera: &Camera, width: u32, height: u32) -> Result<Self, RenderError> {
        let radians = camera.vertical_fov(1.0);
        if !(radians > 0.0 && radians < core::f32::consts::PI) {
            return Err(RenderError::FieldOfView { radians });
        }
        let rows = camera.world_from_camera.0;
        let bad = RenderError::CameraMatrix { rows };
        if !camera.world_from_camera.is_finite() {
            return Err(bad);
        }
        let column = |c: usize| vec3::normalize(rows.map(|row| row[c]));
        let (Some(x), Some(y), Some(z)) = (column(0), column(1), column(2)) else {
            return Err(bad);
        };
        // In pixels the view is `height` high, and this far away.
        let half_height = 0.5 * height as f32;
        let step = libm::tanf(0.5 * radians) / half_height;
        let (right, down) = (vec3::scale(x, step), vec3::scale(y, -step));
        let to_left = vec3::scale(right, -0.5 * width as f32);
        let to_top = vec3::scale(down, -half_height);
        let corner = vec3::sub(vec3::add(to_left, to_top), z);
        Ok(Self { origin: camera.position(), corner, right, down })
    }

    /// The ray through a place on the film, in pixels from its upper left corner; of unit length.
    #[inline]
    pub(crate) fn ray(&self, x: f32, y: f32) -> Ray {
        let sideways = vec3::add(vec3::scale(self.right, x), vec3::scale(self.down, y));
        let direction = vec3::normalize(vec3::add(self.corner, sideways));
        // Never `None`: the corner lies one unit in front of the camera.
        Ray::new(self.origin, direction.unwrap_or([0.0, 0.0, -1.0]))
    }
}

#[cfg(test)]
mod tests {
    use super::Pinhole;
    use crate::error::RenderError;
    use treelet::math::vec3;
    use treelet_model::{Camera, View};

    #[test]
    fn edges_are_half_the_angle_apart() {
        let camera = Camera::look_at([1.0, 2.0, 3.0], [1.0, 2.0, 0.0], [0.0, 1.0, 0.0], 0.8);
        let pinhole = Pinhole::new(&camera.unwrap(), 200, 100).unwrap();
        let top = pinhole.ray(100.0, 0.0).direction;
        assert!((libm::atan2f(top[1], -top[2]) - 0.4).abs() < 1e-6);
        assert!(top[0].abs() < 1e-6 && (vec3::dot(top, top) - 1.0).abs() < 1e-6);
        let left = pinhole.ray(0.0, 50.0).direction;
        assert!(left[0] < 0.0 && (left[0] / left[2] - 2.0 * libm::tanf(0.4)).abs() < 1e-6);
    }

    #[test]
    fn nonsense_is_refused() {
        let good = Camera::look_at([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 1.0).unwrap();
        for vertical_fov in [0.0, -1.0, 3.2, f32::NAN, f32::INFINITY] {
            let camera = Camera { view: View::Perspective { vertical_fov }, ..good.clone() };
            let error = Pinhole::new(&camera, 10, 10).unwrap_err();
            assert!(matches!(error, RenderError::FieldOfView { .. }), "{vertical_fov}");
        }
        let mut flat = good.clone();
        flat.world_from_camera.0.iter_mut().for_each(|row| row[0] = 0.0);
        assert!(Pinhole::new(&flat, 10, 10).is_err());
        let mut nan = good;
        nan.world_from_camera.0[1][3] = f32::NAN;
        assert!(Pinhole::new(&nan, 10, 10).is_err());
    }
}
