//! Transforms of nodes, in f64: what files give, and what the model's f32 maps are rounded from.

use treelet::math::Affine;

use crate::LightKind;

/// Rows of `[m0, m1, m2, b]`, as in [`Affine`].
pub type Rows = [[f64; 4]; 3];

/// The map that leaves every point where it is.
pub const IDENTITY: Rows = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// First scales by `s`, then turns by the quaternion `r` (x, y, z, w, of any length), then moves by
/// `t`.
pub fn parts(t: [f64; 3], r: [f64; 4], s: [f64; 3]) -> Rows {
    let rotation = rotation(r);
    [0, 1, 2].map(|row| {
        let [a, b, c] = rotation[row];
        [a * s[0], b * s[1], c * s[2], t[row]]
    })
}

/// The matrix of a quaternion x, y, z, w of any length; that of length zero turns nothing.
fn rotation([x, y, z, w]: [f64; 4]) -> [[f64; 3]; 3] {
    let square = x * x + y * y + z * z + w * w;
    let two = if square > 0.0 { 2.0 / square } else { 0.0 };
    let (xx, yy, zz) = (two * x * x, two * y * y, two * z * z);
    let (xy, xz, yz) = (two * x * y, two * x * z, two * y * z);
    let (wx, wy, wz) = (two * w * x, two * w * y, two * w * z);
    [
        [1.0 - yy - zz, xy - wz, xz + wy],
        [xy + wz, 1.0 - xx - zz, yz - wx],
        [xz - wy, yz + wx, 1.0 - xx - yy],
    ]
}

/// The map that first applies `inner`, then `outer`.
pub fn compose(outer: &Rows, inner: &Rows) -> Rows {
    outer.map(|[a, b, c, d]| {
        [0, 1, 2, 3].map(|column| {
            let offset = if column == 3 { d } else { 0.0 };
            a * inner[0][column] + b * inner[1][column] + c * inner[2][column] + offset
        })
    })
}

/// A transform as the model has it.
pub fn rounded(map: &Rows) -> Affine {
    Affine(map.map(|row| row.map(|entry| entry as f32)))
}

/// The frame of a camera at a node: rid of scale, looking along the node's -z axis, upright near its
/// y axis. `None` if the node has no such axes.
pub fn camera_frame(world: &Rows) -> Option<Affine> {
    let column = |k: usize| [world[0][k], world[1][k], world[2][k]];
    let back = unit(column(2))?;
    let right = unit(cross(column(1), back))?;
    let up = cross(back, right);
    let row = |k: usize| [right[k], up[k], back[k], world[k][3]].map(|entry| entry as f32);
    let frame = Affine([row(0), row(1), row(2)]);
    frame.is_finite().then_some(frame)
}

/// A light at a node: at its origin, shining along its -z axis. `None` where that leads nowhere.
pub fn light_at(kind: LightKind, world: &Rows) -> Option<LightKind> {
    let place = [0, 1, 2].map(|row: usize| world[row][3] as f32);
    let axis = || {
        let axis = unit([-world[0][2], -world[1][2], -world[2][2]])?;
        Some(axis.map(|x| x as f32))
    };
    let mut moved = kind;
    match &mut moved {
        LightKind::Point { position, .. } => *position = place,
        LightKind::Directional { direction, .. } => *direction = axis()?,
        LightKind::Spot { position, direction, .. } => {
            (*position, *direction) = (place, axis()?);
        }
    }
    place.iter().all(|x| x.is_finite()).then_some(moved)
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// A vector of length 1; `None` for one without a direction.
pub fn unit(a: [f64; 3]) -> Option<[f64; 3]> {
    let length = libm::sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
    (length > 0.0 && length.is_finite()).then(|| a.map(|x| x / length))
}
