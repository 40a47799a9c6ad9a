//! Affine transforms in f64, as the directives of a file build them up.

use treelet::math::Affine;

/// Rows of `[m0, m1, m2, b]`, as in [`Affine`].
pub(super) type Rows = [[f64; 4]; 3];

pub(super) const IDENTITY: Rows = scaling([1.0; 3]);

pub(super) const fn scaling([x, y, z]: [f64; 3]) -> Rows {
    [[x, 0.0, 0.0, 0.0], [0.0, y, 0.0, 0.0], [0.0, 0.0, z, 0.0]]
}

pub(super) const fn translation([x, y, z]: [f64; 3]) -> Rows {
    [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, y], [0.0, 0.0, 1.0, z]]
}

/// The map that first applies `inner`, then `outer`.
pub(super) fn compose(outer: &Rows, inner: &Rows) -> Rows {
    outer.map(|[a, b, c, d]| {
        [0, 1, 2, 3].map(|column| {
            let offset = if column == 3 { d } else { 0.0 };
            a * inner[0][column] + b * inner[1][column] + c * inner[2][column] + offset
        })
    })
}

/// A turn by `degrees` about an axis; `None` if it has no length.
pub(super) fn rotation(degrees: f64, axis: [f64; 3]) -> Option<Rows> {
    let [x, y, z] = unit(axis)?;
    let angle = degrees.to_radians();
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    let rest = 1.0 - cos;
    Some([
        [x * x * rest + cos, x * y * rest - z * sin, x * z * rest + y * sin, 0.0],
        [x * y * rest + z * sin, y * y * rest + cos, y * z * rest - x * sin, 0.0],
        [x * z * rest - y * sin, y * z * rest + x * sin, z * z * rest + cos, 0.0],
    ])
}

/// Takes the world to a camera at `eye` that looks at `at` along its +z; left-handed, as pbrt is.
pub(super) fn look_at(eye: [f64; 3], at: [f64; 3], up: [f64; 3]) -> Option<Rows> {
    let forward = unit([at[0] - eye[0], at[1] - eye[1], at[2] - eye[2]])?;
    let right = unit(cross(unit(up)?, forward))?;
    let above = cross(forward, right);
    let row = |k: usize| [right[k], above[k], forward[k], eye[k]];
    inverse(&[row(0), row(1), row(2)])
}

/// A matrix of 16 numbers, column after column; `None` if it is projective.
pub(super) fn matrix(m: &[f64; 16]) -> Option<Rows> {
    let is_affine = [m[3], m[7], m[11], m[15]] == [0.0, 0.0, 0.0, 1.0];
    is_affine.then(|| [0, 1, 2].map(|row| [m[row], m[4 + row], m[8 + row], m[12 + row]]))
}

/// The determinant of the linear part: below zero for a map that mirrors.
pub(super) fn determinant(m: &Rows) -> f64 {
    dot(row3(m, 0), cross(row3(m, 1), row3(m, 2)))
}

/// The inverse map, if there is one.
pub(super) fn inverse(m: &Rows) -> Option<Rows> {
    let det = determinant(m);
    let columns = cofactors(m);
    let inverse = [0, 1, 2].map(|row| {
        let line = [0, 1, 2].map(|column: usize| columns[column][row] / det);
        let offset = -(line[0] * m[0][3] + line[1] * m[1][3] + line[2] * m[2][3]);
        [line[0], line[1], line[2], offset]
    });
    inverse.iter().flatten().all(|x| x.is_finite()).then_some(inverse)
}

/// The matrix that normals are transformed by, up to a factor of the determinant's sign.
pub(super) fn cofactors(m: &Rows) -> [[f64; 3]; 3] {
    let [a, b, c] = [row3(m, 0), row3(m, 1), row3(m, 2)];
    [cross(b, c), cross(c, a), cross(a, b)]
}

/// A point in another space.
pub(super) fn point(m: &Rows, p: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = p.map(f64::from);
    m.map(|[a, b, c, d]| (a * x + b * y + c * z + d) as f32)
}

/// A vector in another space.
pub(super) fn vector(m: &Rows, v: [f32; 3]) -> [f64; 3] {
    let [x, y, z] = v.map(f64::from);
    m.map(|[a, b, c, _]| a * x + b * y + c * z)
}

/// As the model has it.
pub(super) fn rounded(m: &Rows) -> Affine {
    Affine(m.map(|row| row.map(|entry| entry as f32)))
}

fn row3(m: &Rows, row: usize) -> [f64; 3] {
    [m[row][0], m[row][1], m[row][2]]
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(super) fn unit(a: [f64; 3]) -> Option<[f64; 3]> {
    let length = libm::sqrt(dot(a, a));
    (length > 0.0 && length.is_finite()).then(|| a.map(|x| x / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_looks_along_z() {
        let camera_from_world = look_at([1.0, 2.0, 3.0], [1.0, 2.0, 8.0], [0.0, 1.0, 0.0]).unwrap();
        assert_eq!(point(&camera_from_world, [1.0, 2.0, 8.0]), [0.0, 0.0, 5.0]);
        assert_eq!(look_at([0.0; 3], [0.0; 3], [0.0, 1.0, 0.0]), None);
    }

    #[test]
    fn inverses_undo() {
        let turn = rotation(30.0, [1.0, 2.0, 3.0]).unwrap();
        let m = compose(&compose(&translation([5.0, 6.0, 7.0]), &turn), &scaling([2.0, -3.0, 4.0]));
        let back = compose(&inverse(&m).unwrap(), &m);
        for (row, want) in back.iter().flatten().zip(IDENTITY.iter().flatten()) {
            assert!((row - want).abs() < 1e-12, "{back:?}");
        }
        assert!((determinant(&m) + 24.0).abs() < 1e-9);
        assert_eq!(inverse(&scaling([1.0, 0.0, 1.0])), None);
    }
}
