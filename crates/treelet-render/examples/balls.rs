//! Balls of every material on a plane under the clear sky, written to `balls.png`.
//!
//! `cargo run --release -p treelet-render --example balls`

use treelet::{Affine, BuildOptions, Cancel, Mesh};
use treelet_model::{Camera, Material, Model, Object, Part, PlacedModel, Placement};
use treelet_render::{Renderer, Settings, ToneMap};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let model = scene();
    let placed = PlacedModel::build(&model, &BuildOptions::default())?;
    let camera = Camera::look_at([0.5, 3.2, 9.0], [0.0, 0.7, 0.0], [0.0, 1.0, 0.0], 0.55)
        .ok_or("the camera stands where it looks")?;
    let settings = Settings { width: 960, height: 540, ..Settings::default() };
    let renderer = Renderer::new(&model, &placed, &camera, settings)?;
    let mut film = renderer.film()?;
    for _ in 0..64 {
        renderer.pass(&mut film, &Cancel::new())?;
    }
    std::fs::write("balls.png", film.to_image(&ToneMap::default())?.encode_png()?)?;
    Ok(())
}

/// A floor, and a row of balls from matt to mirror with glass and a lamp among them.
pub fn scene() -> Model {
    let plain = Material::default();
    let metal = Material { metallic: 1.0, ..plain.clone() };
    let gold = [1.0, 0.72, 0.3];
    let materials = vec![
        Material { base_color: [0.45, 0.44, 0.42], ..plain.clone() },
        Material { base_color: [0.7, 0.1, 0.08], ..plain.clone() },
        Material { base_color: [0.05, 0.2, 0.6], roughness: 0.15, ..plain.clone() },
        Material { base_color: gold, roughness: 0.45, ..metal.clone() },
        Material { base_color: [0.95; 3], roughness: 0.02, ..metal },
        Material { base_color: [1.0; 3], transmission: 1.0, roughness: 0.0, ..plain.clone() },
        Material { base_color: [0.5, 0.9, 0.6], transmission: 1.0, ..plain.clone() },
        Material { emission: [9.0, 5.0, 2.0], ..plain },
    ];
    let mesh = Mesh::new(
        [[-30.0, 0.0, 30.0], [30.0, 0.0, 30.0], [30.0, 0.0, -30.0], [-30.0, 0.0, -30.0]],
        [[0, 1, 2], [0, 2, 3]],
    );
    let floor = Part::new(mesh, 0);
    let mut model = Model {
        objects: vec![Object { name: "floor".into(), parts: vec![floor] }],
        placements: vec![Placement { object: 0, world_from_object: Affine::IDENTITY }],
        materials,
        sky: Some(treelet_model::Sky::clear(1)),
        ..Model::default()
    };
    let places = [
        (1, [-3.3, 0.9, -0.6], 0.9),
        (2, [-1.25, 0.9, -1.4], 0.9),
        (3, [0.9, 0.9, -1.4], 0.9),
        (4, [3.0, 0.9, -0.6], 0.9),
        (5, [-1.0, 0.7, 1.1], 0.7),
        (6, [1.0, 0.7, 1.3], 0.7),
        (7, [2.6, 0.3, 1.9], 0.3),
    ];
    let (mesh, normals) = ball(64);
    for (material, at, radius) in places {
        let part =
            Part { normals: Some(normals.clone().into()), ..Part::new(mesh.clone(), material) };
        let world_from_object = Affine::translation(at).then_from(&Affine::scaling([radius; 3]));
        model.placements.push(Placement { object: model.objects.len(), world_from_object });
        model.objects.push(Object { name: "ball".into(), parts: vec![part] });
    }
    model
}

/// A unit sphere and its normals.
fn ball(rings: u32) -> (Mesh, Vec<[f32; 3]>) {
    let columns = 2 * rings;
    let mut points = Vec::new();
    for ring in 0..=rings {
        let theta = std::f32::consts::PI * ring as f32 / rings as f32;
        for column in 0..=columns {
            let phi = std::f32::consts::PI * column as f32 / rings as f32;
            let (sin, cos) = libm::sincosf(theta);
            points.push([sin * libm::cosf(phi), cos, -sin * libm::sinf(phi)]);
        }
    }
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for column in 0..columns {
            let a = ring * (columns + 1) + column;
            let b = a + columns + 1;
            triangles.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
        }
    }
    (Mesh::new(points.clone(), triangles), points)
}
