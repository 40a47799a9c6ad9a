//! Shapes and helpers that the renderer's tests share.
#![allow(dead_code, reason = "every test file takes what it needs")]

use treelet::{Affine, BuildOptions, Cancel, Mesh};
use treelet_model::{Camera, Material, Model, Object, Part, PlacedModel, Placement};
use treelet_render::{Film, Renderer, Settings};

/// The unit cube `-1 ..= 1`, corners turning left seen from outside.
pub(crate) fn cube() -> Mesh {
    let corner = |i: u32| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { 1.0 } else { -1.0 });
    let quads =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles: Vec<[u32; 3]> =
        quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Mesh::new((0..8).map(corner).collect::<Vec<_>>(), triangles)
}

/// A unit sphere of `2 n^2` quads, and its normals, which are its positions.
pub(crate) fn sphere(n: u32) -> (Mesh, Vec<[f32; 3]>) {
    let (rings, columns) = (n, 2 * n);
    let mut positions = vec![[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]];
    for ring in 1..rings {
        let theta = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
        for column in 0..columns {
            let phi = std::f64::consts::TAU * f64::from(column) / f64::from(columns);
            let (sin, cos) = (libm::sin(theta), libm::cos(theta));
            positions.push([sin * libm::cos(phi), cos, -sin * libm::sin(phi)].map(|x| x as f32));
        }
    }
    let at = |ring: u32, column: u32| 2 + (ring - 1) * columns + column % columns;
    let mut triangles = Vec::new();
    for column in 0..columns {
        triangles.push([0, at(1, column), at(1, column + 1)]);
        triangles.push([1, at(rings - 1, column + 1), at(rings - 1, column)]);
        for ring in 1..rings - 1 {
            let [a, b] = [at(ring, column), at(ring + 1, column)];
            let [c, d] = [at(ring + 1, column + 1), at(ring, column + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    (Mesh::new(positions.clone(), triangles), positions)
}

/// A flat-shaded part.
pub(crate) fn part(mesh: Mesh, material: usize) -> Part {
    Part::new(mesh, material)
}

/// A quadrilateral of two triangles, its corners in order.
pub(crate) fn quad(corners: [[f32; 3]; 4]) -> Mesh {
    Mesh::new(corners, [[0, 1, 2], [0, 2, 3]])
}

/// A diffuse material without a coat.
pub(crate) fn lambert(color: [f32; 3]) -> Material {
    Material { base_color: color, ior: 1.0, ..Material::default() }
}

/// A lamp that reflects nothing.
pub(crate) fn lamp(radiance: [f32; 3]) -> Material {
    Material { emission: radiance, ..lambert([0.0; 3]) }
}

/// A model with one object a part, each placed once where it is.
pub(crate) fn model(parts: Vec<Part>, materials: Vec<Material>) -> Model {
    let place = |object| Placement { object, world_from_object: Affine::IDENTITY };
    let placements = (0..parts.len()).map(place).collect();
    let object = |part| Object { name: String::new(), parts: vec![part] };
    let objects = parts.into_iter().map(object).collect();
    Model { objects, placements, materials, ..Model::default() }
}

/// A room of side 2 around the origin, open toward +z, white with a red and a green wall, a lamp
/// under the ceiling, a tall mirror box and a glass ball: what Cornell's box became.
pub(crate) fn box_scene() -> Model {
    let materials = vec![
        lambert([0.73, 0.73, 0.73]),
        lambert([0.63, 0.065, 0.05]),
        lambert([0.14, 0.45, 0.091]),
        lamp([15.0, 12.0, 8.0]),
        Material {
            base_color: [0.9, 0.8, 0.5],
            metallic: 1.0,
            roughness: 0.3,
            ..Material::default()
        },
        Material { base_color: [1.0; 3], transmission: 1.0, roughness: 0.0, ..Material::default() },
        Material { base_color: [0.1, 0.2, 0.6], roughness: 0.25, ..Material::default() },
    ];
    let p = |x: f32, y: f32, z: f32| [x, y, z];
    let walls = vec![
        part(quad([p(-1., -1., 1.), p(1., -1., 1.), p(1., -1., -1.), p(-1., -1., -1.)]), 0),
        part(quad([p(-1., 1., 1.), p(-1., 1., -1.), p(1., 1., -1.), p(1., 1., 1.)]), 0),
        part(quad([p(-1., -1., -1.), p(1., -1., -1.), p(1., 1., -1.), p(-1., 1., -1.)]), 0),
        part(quad([p(-1., -1., 1.), p(-1., -1., -1.), p(-1., 1., -1.), p(-1., 1., 1.)]), 1),
        part(quad([p(1., -1., -1.), p(1., -1., 1.), p(1., 1., 1.), p(1., 1., -1.)]), 2),
        part(
            quad([p(-0.3, 0.99, -0.3), p(0.3, 0.99, -0.3), p(0.3, 0.99, 0.3), p(-0.3, 0.99, 0.3)]),
            3,
        ),
    ];
    let mut model = model(walls, materials);
    let (ball, normals) = sphere(24);
    let smooth = |material| Part {
        normals: Some(normals.clone().into()),
        ..Part::new(ball.clone(), material)
    };
    for (part, scale, at, angle) in [
        (part(cube(), 4), [0.28, 0.55, 0.28], [-0.4, -0.45, -0.35], 0.35),
        (smooth(5), [0.32; 3], [0.45, -0.68, 0.3], 0.0),
        (smooth(6), [0.2; 3], [0.1, -0.8, -0.45], 0.0),
    ] {
        let world_from_object = Affine::translation(at)
            .then_from(&Affine::rotation([0.0, 1.0, 0.0], angle))
            .then_from(&Affine::scaling(scale));
        model.placements.push(Placement { object: model.objects.len(), world_from_object });
        model.objects.push(Object { name: String::new(), parts: vec![part] });
    }
    model.sky = Some(treelet_model::Sky::uniform([0.0; 3]));
    model
}

/// The camera in front of [`box_scene`].
pub(crate) fn box_camera() -> Camera {
    camera([0.0, 0.0, 3.9], [0.0; 3], 0.69)
}

/// A camera that looks from one point to another, y upward.
pub(crate) fn camera(from: [f32; 3], at: [f32; 3], fov: f32) -> Camera {
    Camera::look_at(from, at, [0.0, 1.0, 0.0], fov).expect("a camera")
}

/// The model's scene.
pub(crate) fn placed(model: &Model) -> PlacedModel {
    PlacedModel::build(model, &BuildOptions::default()).expect("a sound model")
}

/// The film after some passes, and the rays they took.
pub(crate) fn render(
    model: &Model,
    camera: &Camera,
    settings: Settings,
    passes: u32,
) -> (Film, u64) {
    let placed = placed(model);
    let renderer = Renderer::new(model, &placed, camera, settings).expect("a renderer");
    let mut film = renderer.film().expect("a film");
    let mut rays = 0;
    for _ in 0..passes {
        rays += renderer.pass(&mut film, &Cancel::new()).expect("a pass").rays;
    }
    (film, rays)
}

/// Settings of a small picture without any cutting or softening.
pub(crate) fn exact(width: u32, height: u32) -> Settings {
    Settings {
        width,
        height,
        max_bounces: 64,
        clamp_indirect: f32::INFINITY,
        regularize: false,
        ..Settings::default()
    }
}
