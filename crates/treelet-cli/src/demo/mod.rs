//! The built-in scene: a garden at golden hour, made by rule, without a single file.
//!
//! A rope of gold, copper and steel, tied into a trefoil, stands on a terrace of polished stone
//! among spheres of glass and metal, lanterns and old stones; meadows and wooded hills surround
//! it. A few hundred thousand triangles are stored and, through instances, tens of millions seen.
//! Sun and sky give nearly all the light, the lanterns little: a path tracer needs few passes.
//! The same on every machine: seeds are fixed and no platform mathematics is used.

mod forest;
mod furniture;
mod garden;
mod knot;
mod meadow;
mod noise;
mod palette;
mod shape;
mod terrace;
mod terrain;
mod tree;

use treelet::math::vec3;
use treelet_model::{Camera, Model, Sky, Sun};

/// The scene, with its camera and its sky.
pub(crate) fn demo() -> Model {
    let mut model = Model { materials: palette::Palette::materials(), ..Model::default() };
    garden::plant(&mut model);
    let camera = Camera::look_at([2.2, 1.9, 14.5], [0.0, 2.05, 0.0], [0.0, 1.0, 0.0], 0.56);
    model.cameras.extend(camera);
    model.sky = Some(golden_hour());
    model
}

/// A low warm sun from the left, a sky that pales toward the horizon.
fn golden_hour() -> Sky {
    let direction = vec3::normalize([-0.80, 0.42, 0.46]).unwrap_or([0.0, 1.0, 0.0]);
    Sky {
        up: 1,
        zenith: [0.08, 0.24, 0.74],
        horizon: [0.84, 0.95, 1.14],
        ground: [0.22, 0.19, 0.14],
        // Irradiance pi * 0.03^2 * 3000, about 8: several times that of the sky.
        sun: Some(Sun { direction, angular_radius: 0.03, radiance: [4100.0, 2800.0, 1500.0] }),
    }
}

#[cfg(test)]
mod tests {
    use super::demo;

    #[test]
    fn the_scene_is_what_it_says() {
        let model = demo();
        assert!(model.triangles_stored() < 1_500_000, "{} stored", model.triangles_stored());
        assert!(model.triangles_placed() > 10_000_000, "{} placed", model.triangles_placed());
        assert_eq!(model.cameras.len(), 1);
        let materials = &model.materials;
        assert!(materials.iter().any(|material| material.metallic == 1.0));
        assert!(materials.iter().any(|material| material.transmission == 1.0));
        assert!(materials.iter().any(|material| material.is_emissive()));
    }

    #[test]
    fn every_triangle_is_sound() {
        for object in &demo().objects {
            for part in &object.parts {
                let vertices = part.mesh.positions().len();
                assert!(part.normals.as_ref().is_none_or(|normals| normals.len() == vertices));
                for prim in 0..part.mesh.triangles().len() {
                    assert_eq!(part.mesh.defect(prim), None, "{} {prim}", object.name);
                }
            }
        }
    }

    #[test]
    fn the_scene_is_the_same_every_time() {
        let bits = || {
            let model = demo();
            let parts = model.objects.iter().flat_map(|object| &object.parts);
            let points = parts.flat_map(|part| part.mesh.positions().to_vec());
            let places = model.placements.iter().map(|placement| placement.world_from_object.0);
            let numbers = points.flatten().chain(places.flatten().flatten());
            numbers.fold(0_u64, |hash, x| {
                (hash.rotate_left(5) ^ u64::from(x.to_bits())).wrapping_mul(0x9E37_79B9_7F4A_7C15)
            })
        };
        assert_eq!(bits(), bits());
    }
}
