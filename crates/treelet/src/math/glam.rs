//! Conversions between `glam` types and the plain arrays of the interface (feature `glam`).
//!
//! `glam::Vec3` converts to and from `[f32; 3]` by itself; what is missing is the affine map.

use super::Affine;

impl From<glam::Affine3A> for Affine {
    fn from(map: glam::Affine3A) -> Self {
        let columns = [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis, map.translation]
            .map(|column| column.to_array());
        Self(core::array::from_fn(|row| columns.map(|column| column[row])))
    }
}

impl From<Affine> for glam::Affine3A {
    fn from(map: Affine) -> Self {
        let column = |c: usize| glam::Vec3A::from_array(map.0.map(|row| row[c]));
        Self {
            matrix3: glam::Mat3A::from_cols(column(0), column(1), column(2)),
            translation: column(3),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Affine;

    #[test]
    fn both_ways_and_the_same_points() {
        let map = Affine([[1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.5, 8.0], [-9.0, 1.5, 11.0, 12.0]]);
        let theirs = glam::Affine3A::from(map);
        assert_eq!(Affine::from(theirs), map);
        let p = [0.5, -2.0, 4.0];
        assert_eq!(theirs.transform_point3(p.into()).to_array(), map.point(p));
    }
}
