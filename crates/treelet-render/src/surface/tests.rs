//! Leaving surfaces: no acne, no leaks; and normals that stay above them.

use super::{PartPoint, Surface, Surfaces};
use crate::frame::Frame;
use crate::sampler::Sampler;
use treelet::math::{Affine, vec3};
use treelet::{BuildOptions, Mesh, Ray};
use treelet_model::{Material, Model, PlacedModel};

/// A closed convex body: rings of planar trapezoids on the unit sphere, and two caps.
fn ball() -> Mesh {
    const RINGS: u32 = 12;
    const COLUMNS: u32 = 20;
    let mut corners = vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    for ring in 1..RINGS {
        let (sin, cos) = libm::sincos(core::f64::consts::PI * f64::from(ring) / f64::from(RINGS));
        for column in 0..COLUMNS {
            let turn = core::f64::consts::TAU * f64::from(column) / f64::from(COLUMNS);
            corners.push([sin * libm::cos(turn), sin * libm::sin(turn), cos].map(|c| c as f32));
        }
    }
    let at = |ring: u32, column: u32| 2 + (ring - 1) * COLUMNS + column % COLUMNS;
    let mut triangles = Vec::new();
    for column in 0..COLUMNS {
        triangles.push([0, at(1, column), at(1, column + 1)]);
        triangles.push([1, at(RINGS - 1, column + 1), at(RINGS - 1, column)]);
        for ring in 1..RINGS - 1 {
            let [a, b] = [at(ring, column), at(ring + 1, column)];
            let [c, d] = [at(ring + 1, column + 1), at(ring, column + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    Mesh::new(corners, triangles)
}

/// A direction of the hemisphere around a unit vector, grazing ones among them.
fn hemisphere(around: [f32; 3], u: [f32; 2]) -> [f32; 3] {
    // A direction in the plane itself has no side.
    let height = (u[0] * u[0]).max(1e-6);
    let radius = (1.0 - height * height).sqrt();
    let phi = core::f32::consts::TAU * u[1];
    Frame::around(around).to_world([radius * libm::cosf(phi), radius * libm::sinf(phi), height])
}

/// Rays that leave a convex body outward meet nothing, rays that enter it meet it again: at
/// every size, far away, turned, stretched and mirrored.
#[test]
fn no_acne_and_no_leaks() {
    let turn = Affine::rotation([1.0, -2.0, 0.5], 1.1);
    let stretch = Affine::scaling([-1.0, 3.0, 0.25]);
    let shape = turn.then_from(&stretch).then_from(&Affine::rotation([0.3, 1.0, 0.0], 0.4));
    for (bake, shape) in [(true, Affine::IDENTITY), (false, Affine::IDENTITY), (false, shape)] {
        for size in [1e-3f32, 1.0, 1e3, 1e6] {
            for at in [[0.0; 3], [1.0, -2.0, 3.0], [148_376.0, 1_234.0, -223_423.0]] {
                // Where f32 has no room for the body, there is nothing to leave.
                if vec3::max_abs(at) * 1e-4 > size {
                    continue;
                }
                let place = Affine::translation(at)
                    .then_from(&shape)
                    .then_from(&Affine::scaling([size; 3]));
                attack(&place, bake, &format!("size {size} at {at:?}, {shape:?}, baked {bake}"));
            }
        }
    }
}

fn attack(place: &Affine, bake: bool, case: &str) {
    let mut mesh = ball();
    if bake {
        let moved: Vec<_> = mesh.positions().iter().map(|&p| place.point(p)).collect();
        mesh = Mesh::new(moved, mesh.triangles().to_vec());
    }
    let mut model = Model::of_mesh("ball", mesh, Material::default());
    if !bake {
        model.placements[0].world_from_object = *place;
    }
    let placed = PlacedModel::build(&model, &BuildOptions::default()).unwrap();
    let surfaces = Surfaces::new(&model).unwrap();
    let center = placed.scene.bounds().center();
    for i in 0..4000 {
        let sampler = Sampler::new(11, 0, 0, i);
        let direction =
            hemisphere(if i % 2 == 0 { [0., 0., 1.] } else { [0., 0., -1.] }, sampler.pair(0));
        let ray = Ray::new(center, direction);
        let hit = placed.scene.closest(&ray).unwrap_or_else(|| panic!("{case}: {ray:?} escapes"));
        let placement = placed.placement_index(&hit).unwrap();
        let surface = surfaces.under(&hit, placement, direction).unwrap();
        assert!(vec3::dot(surface.geometric, direction) > 0.0, "{case}: normals point outward");
        for k in 1..5 {
            let outward = hemisphere(surface.geometric, sampler.pair(k));
            let out = Ray::new(surface.leave(outward), outward);
            let met = placed.scene.closest(&out);
            assert_eq!(met, None, "{case}: {out:?} from {hit:?}, {surface:?}");
            let inward = vec3::scale(outward, -1.0);
            let back = Ray::new(surface.leave(inward), inward);
            assert!(placed.scene.any(&back), "{case}: {back:?} leaks");
        }
    }
}

#[test]
fn shading_normals_are_bent_above_the_surface() {
    let geometric = [0.0, 0.0, 1.0];
    for i in 0..5000 {
        let sampler = Sampler::new(5, 0, 0, i);
        let wo = hemisphere(geometric, sampler.pair(0));
        let surface = Surface {
            point: [0.0; 3],
            offset: 0.0,
            geometric,
            shading: hemisphere(geometric, sampler.pair(1)),
            on: PartPoint::default(),
        };
        let normal = surface.shading_toward(wo, geometric);
        let mirrored = vec3::sub(vec3::scale(normal, 2.0 * vec3::dot(wo, normal)), wo);
        assert!(vec3::dot(mirrored, geometric) > -1e-4, "{wo:?} {surface:?}");
        assert!(vec3::dot(wo, normal) > -1e-4, "{wo:?} {surface:?}");
        let below = vec3::scale(wo, -1.0);
        let other = surface.shading_toward(below, vec3::scale(geometric, -1.0));
        assert!(vec3::dot(other, geometric) < 0.0);
    }
}
