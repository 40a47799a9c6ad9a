//! Cameras: perspective, with a pinhole or a thin lens, and orthographic.

use treelet::bounds::Aabb;
use treelet::math::{Affine, vec3};

/// A camera. It looks down its own -z axis, x to the right, y up, as in glTF.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// As the file names it; may be empty.
    pub name: String,
    /// Takes camera space to the world; a rigid motion.
    pub world_from_camera: Affine,
    /// What it sees.
    pub view: View,
    /// The lens; without one all is sharp.
    pub lens: Option<Lens>,
    /// Pixels in a row and rows that the file asks for.
    pub resolution: Option<[u32; 2]>,
}

/// What a camera sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum View {
    /// Far things are small.
    Perspective {
        /// The angle between the top and the bottom edge of the picture, radians, in `0 .. pi`.
        vertical_fov: f32,
    },
    /// Far things are as large as near ones.
    Orthographic {
        /// Between the top and the bottom edge of the picture, in the world's lengths, above 0.
        height: f32,
    },
}

/// A thin lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Half its width, in the world's lengths, at least 0.
    pub radius: f32,
    /// How far in front of the camera, along its axis, things are sharp; above 0.
    pub focus_distance: f32,
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
            view: View::Perspective { vertical_fov },
            lens: None,
            resolution: None,
        })
    }

    /// A camera that sees all of `bounds`, as large as fits, from a little above and to the side.
    ///
    /// `up` is the axis (0, 1, 2) that points up; `aspect` is width over height.
    pub fn framing(bounds: &Aabb, up: usize, aspect: f32) -> Self {
        let vertical_fov: f32 = 0.7;
        let bounds = if bounds.is_empty() { Aabb { lo: [-1.0; 3], hi: [1.0; 3] } } else { *bounds };
        let mut toward = [0.0; 3];
        toward[up] = 0.45;
        toward[(up + 1) % 3] = 0.85;
        toward[(up + 2) % 3] = 0.55;
        let mut upright = [0.0; 3];
        upright[up] = 1.0;
        let turned = Self::look_at(toward, [0.0; 3], upright, vertical_fov).unwrap_or_default();

        // In f64 about the middle of the box, in units of its size, so that nothing overflows.
        let center = bounds.center();
        let size = bounds.diagonal().max(1e-30);
        let column = |axis: usize| turned.world_from_camera.0.map(|row| f64::from(row[axis]));
        let [right, above, back] = [0, 1, 2].map(column);
        let along = |axis: [f64; 3], corner: [f64; 3]| {
            (0..3).map(|k| axis[k] * corner[k]).sum::<f64>() / size
        };
        let corners = [0, 1, 2, 3, 4, 5, 6, 7].map(|corner: usize| {
            [0, 1, 2].map(|axis| {
                let end = if corner >> axis & 1 == 0 { bounds.lo } else { bounds.hi };
                f64::from(end[axis]) - f64::from(center[axis])
            })
        });

        // Each side of the picture is a plane that all corners are behind. A pair of opposite
        // sides says how far back the eye must be, and where across.
        let half = libm::tan(0.5 * f64::from(vertical_fov)) * MARGIN;
        let fit = |across: [f64; 3], slope: f64| {
            let sides = corners.map(|corner| {
                let (x, depth) = (along(across, corner), -along(back, corner));
                [x - slope * depth, x + slope * depth]
            });
            let high = sides.iter().fold(f64::NEG_INFINITY, |most, side| most.max(side[0]));
            let low = sides.iter().fold(f64::INFINITY, |least, side| least.min(side[1]));
            (0.5 * (high + low), (high - low) / (2.0 * slope))
        };
        let (x, x_distance) = fit(right, half * f64::from(aspect));
        let (y, y_distance) = fit(above, half);
        let distance = x_distance.max(y_distance).max(1e-3);
        let mut world_from_camera = turned.world_from_camera;
        for (axis, row) in world_from_camera.0.iter_mut().enumerate() {
            let offset = right[axis] * x + above[axis] * y + back[axis] * distance;
            row[3] = (f64::from(center[axis]) + size * offset) as f32;
        }
        Self { world_from_camera, ..turned }
    }

    /// The angle between the top and the bottom edge of the picture, radians; for an orthographic
    /// camera, that of the perspective one which sees as much at distance `depth`.
    pub fn vertical_fov(&self, depth: f32) -> f32 {
        match self.view {
            View::Perspective { vertical_fov } => vertical_fov,
            View::Orthographic { height } => 2.0 * libm::atanf(0.5 * height / depth),
        }
    }

    /// Where the camera stands.
    pub fn position(&self) -> [f32; 3] {
        self.world_from_camera.0.map(|row| row[3])
    }
}

impl Default for Camera {
    /// At the origin, with a view of 0.7 radians.
    fn default() -> Self {
        Self {
            name: String::new(),
            world_from_camera: Affine::IDENTITY,
            view: View::Perspective { vertical_fov: 0.7 },
            lens: None,
            resolution: None,
        }
    }
}

/// The share of the picture that [`Camera::framing`] fills in the direction that decides.
const MARGIN: f64 = 0.92;

#[cfg(test)]
mod tests {
    use super::Camera;
    use treelet::bounds::Aabb;
    use treelet::math::vec3;

    #[test]
    fn framing_shows_every_corner_and_wastes_little() {
        let boxes = [
            Aabb { lo: [-1.0, -2.0, -3.0], hi: [4.0, 5.0, 6.0] },
            Aabb { lo: [148_376.0, 1234.0, -223_423.0], hi: [149_376.0, 1235.0, -223_410.0] },
            Aabb { lo: [0.0; 3], hi: [1e-9, 2e-9, 0.0] },
            Aabb { lo: [-4e18; 3], hi: [4e18; 3] },
        ];
        for bounds in boxes {
            for (up, aspect) in [(0, 1.0), (1, 1.78), (2, 0.5)] {
                let camera = Camera::framing(&bounds, up, aspect);
                let rows = camera.world_from_camera.0;
                let half = libm::tanf(0.5 * camera.vertical_fov(1.0));
                let mut widest = 0_f32;
                for corner in 0..8 {
                    let corner = [0, 1, 2].map(|axis: usize| {
                        if corner >> axis & 1 == 0 { bounds.lo[axis] } else { bounds.hi[axis] }
                    });
                    // Scaled down, so that products stay in f32.
                    let view = vec3::sub(corner, camera.position());
                    let view = vec3::scale(view, 1.0 / vec3::max_abs(view));
                    let along = |axis: usize| vec3::dot(rows.map(|row| row[axis]), view);
                    let depth = -along(2);
                    assert!(depth > 0.0, "{bounds:?} up {up}: a corner is behind the eye");
                    widest = widest.max((along(0) / (depth * half * aspect)).abs());
                    widest = widest.max((along(1) / (depth * half)).abs());
                }
                assert!((0.88..0.96).contains(&widest), "{bounds:?} up {up}: {widest}");
            }
        }
    }

    #[test]
    fn framing_nothing_or_a_point_gives_a_camera() {
        let point = Aabb { lo: [5.0; 3], hi: [5.0; 3] };
        for bounds in [Aabb::EMPTY, point] {
            assert!(Camera::framing(&bounds, 1, 1.5).world_from_camera.is_finite());
        }
    }

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
