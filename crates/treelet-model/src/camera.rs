//! Pinhole cameras.

use treelet::bounds::Aabb;
use treelet::math::{Affine, vec3};

/// A pinhole camera. It looks down its own -z axis, x to the right, y up, as in glTF.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// As the file names it; may be empty.
    pub name: String,
    /// Takes camera space to the world; a rigid motion.
    pub world_from_camera: Affine,
    /// The angle between the top and the bottom edge of the picture, radians, in `0 .. pi`.
    pub vertical_fov: f32,
}

impl Camera {
    /// A camera at `from` that looks at `at`, the picture's upright near `up`.
    ///
    /// `None` if `from` and `at` coincide or a number is not finite. Where `up` is parallel to the
    /// view, another axis takes its place.
    pub fn look_at(from: [f32; 3], at: [f32; 3], up: [f32; 3], vertical_fov: f32) -> Option<Self> {
        let back = vec3::normalize(vec3::sub(from, at))?;
        let spare = if back[0].abs() < 0.5 { [1.0, 0.0, 0.0] } else { [0.0, 0.0, 1.0] };
        let upright = [up, spare].into_iter().find_map(|up| {
            let right = vec3::cross(vec3::normalize(up)?, back);
            (vec3::max_abs(right) > 1e-4).then(|| vec3::normalize(right)).flatten()
        });
        let right = upright?;
        let up = vec3::cross(back, right);
        let row = |axis: usize| [right[axis], up[axis], back[axis], from[axis]];
        let world_from_camera = Affine([row(0), row(1), row(2)]);
        world_from_camera.is_finite().then_some(Self {
            name: String::new(),
            world_from_camera,
            vertical_fov,
        })
    }

    /// A camera that sees all of `bounds` from a little above and to the side.
    ///
    /// `up` is the axis (0, 1, 2) that points up; `aspect` is width over height.
    pub fn framing(bounds: &Aabb, up: usize, aspect: f32) -> Self {
        let vertical_fov: f32 = 0.7;
        let empty = bounds.is_empty();
        let center = if empty { [0.0; 3] } else { bounds.center() };
        let radius = if empty { 1.0 } else { (0.5 * bounds.diagonal()).max(1e-30) as f32 };
        // The narrower of the two half angles decides how far away the sphere around the box fits.
        let half = libm::atanf(libm::tanf(0.5 * vertical_fov) * aspect.min(1.0));
        let distance = radius / libm::sinf(half);
        let mut toward = [0.0; 3];
        toward[up] = 0.45;
        toward[(up + 1) % 3] = 0.85;
        toward[(up + 2) % 3] = 0.55;
        let toward = vec3::normalize(toward).unwrap_or([0.0, 0.0, 1.0]);
        let from = vec3::add(center, vec3::scale(toward, distance));
        let mut up_vector = [0.0; 3];
        up_vector[up] = 1.0;
        let fallback = Self {
            name: String::new(),
            world_from_camera: Affine::translation([0.0, 0.0, 1.0]),
            vertical_fov,
        };
        Self::look_at(from, center, up_vector, vertical_fov).unwrap_or(fallback)
    }

    /// Where the camera stands.
    pub fn position(&self) -> [f32; 3] {
        self.world_from_camera.0.map(|row| row[3])
    }
}

#[cfg(test)]
mod tests {
    use super::Camera;

    #[test]
    fn looks_where_it_is_told() {
        let camera = Camera::look_at([1.0, 2.0, 3.0], [1.0, 2.0, -5.0], [0.0, 1.0, 0.0], 1.0);
        let camera = camera.unwrap();
        assert_eq!(camera.position(), [1.0, 2.0, 3.0]);
        assert_eq!(camera.world_from_camera.vector([0.0, 0.0, -1.0]), [0.0, 0.0, -1.0]);
        assert_eq!(camera.world_from_camera.vector([1.0, 0.0, 0.0]), [1.0, 0.0, 0.0]);
        assert!(!camera.world_from_camera.is_mirroring());
    }

    #[test]
    fn straight_down_still_has_an_upright() {
        let camera = Camera::look_at([0.0, 5.0, 0.0], [0.0; 3], [0.0, 1.0, 0.0], 1.0).unwrap();
        assert!(camera.world_from_camera.inverse().is_some());
        assert_eq!(Camera::look_at([0.0; 3], [0.0; 3], [0.0, 1.0, 0.0], 1.0), None);
    }
}
