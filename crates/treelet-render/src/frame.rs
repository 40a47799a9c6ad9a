//! A right-handed frame around a unit normal.
//!
//! Source: T. Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017.

use treelet::math::vec3;

/// Three perpendicular unit vectors; `z` is the normal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    x: [f32; 3],
    y: [f32; 3],
    z: [f32; 3],
}

impl Frame {
    /// The frame of a unit vector.
    #[inline]
    pub(crate) fn around(z: [f32; 3]) -> Self {
        let sign = 1f32.copysign(z[2]);
        let a = -1.0 / (sign + z[2]);
        let b = z[0] * z[1] * a;
        let x = [1.0 + sign * z[0] * z[0] * a, sign * b, -sign * z[0]];
        let y = [b, sign + z[1] * z[1] * a, -z[1]];
        Self { x, y, z }
    }

    /// A world vector in this frame.
    #[inline(always)]
    pub(crate) fn to_local(self, v: [f32; 3]) -> [f32; 3] {
        [vec3::dot(self.x, v), vec3::dot(self.y, v), vec3::dot(self.z, v)]
    }

    /// A vector of this frame in the world.
    #[inline(always)]
    pub(crate) fn to_world(self, v: [f32; 3]) -> [f32; 3] {
        let (x, y, z) = (self.x, self.y, self.z);
        [
            x[0] * v[0] + y[0] * v[1] + z[0] * v[2],
            x[1] * v[0] + y[1] * v[1] + z[1] * v[2],
            x[2] * v[0] + y[2] * v[1] + z[2] * v[2],
        ]
    }
}

/// `v` scaled to length 1, or `None` if its length is zero or not finite.
///
/// In f64, where neither the squares of tiny nor of huge components leave the range. Written here and
/// not taken from the library, so that it is compiled into its callers.
#[inline(always)]
pub(crate) fn direction_of(v: [f32; 3]) -> Option<[f32; 3]> {
    let [x, y, z] = [f64::from(v[0]), f64::from(v[1]), f64::from(v[2])];
    let length = (x * x + y * y + z * z).sqrt();
    if !(length > 0.0 && length.is_finite()) {
        return None;
    }
    let scale = 1.0 / length;
    Some([(x * scale) as f32, (y * scale) as f32, (z * scale) as f32])
}

/// `v` scaled to length 1 in f32; for vectors whose length is near 1 or surely of ordinary size.
#[inline(always)]
pub(crate) fn unit(v: [f32; 3]) -> [f32; 3] {
    vec3::scale(v, 1.0 / vec3::dot(v, v).sqrt())
}

#[cfg(test)]
mod tests {
    use super::{Frame, unit};
    use treelet::math::vec3;

    #[test]
    fn is_orthonormal_also_at_the_poles() {
        let mut normals = vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, -0.0, -0.0 - 1.0]];
        normals.extend((1..50).map(|i| {
            let i = i as f32;
            unit([libm::sinf(i), libm::cosf(2.0 * i), libm::sinf(3.0 * i) - 0.3])
        }));
        for z in normals {
            let frame = Frame::around(z);
            assert!(vec3::dot(frame.x, frame.y).abs() < 1e-6, "{z:?}");
            assert!((vec3::dot(vec3::cross(frame.x, frame.y), z) - 1.0).abs() < 1e-6, "{z:?}");
            let back = frame.to_world(frame.to_local([0.3, -0.4, 0.5]));
            assert!(vec3::max_abs(vec3::sub(back, [0.3, -0.4, 0.5])) < 1e-6, "{z:?}");
        }
    }
}
