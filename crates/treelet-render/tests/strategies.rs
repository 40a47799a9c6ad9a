//! Sampling lights, sampling lobes, and both weighed against each other are three estimates of one
//! picture: their means agree within their error bars.

mod common;

use common::{camera, cube, exact, lambert, lamp, model, part, placed, quad, sphere};
use treelet::{Affine, Cancel};
use treelet_model::{Material, Model, Sky, Sun};
use treelet_render::{Renderer, Settings, Strategy};

/// A floor, a box and balls of metal, coat and glass under a lamp and a sky with a large sun; the
/// lamp is placed twice, once through a mirrored, stretched map.
fn scene() -> Model {
    let materials = vec![
        lambert([0.6, 0.5, 0.4]),
        Material {
            base_color: [0.9, 0.6, 0.3],
            metallic: 1.0,
            roughness: 0.4,
            ..Material::default()
        },
        Material { base_color: [0.2, 0.3, 0.7], roughness: 0.5, ..Material::default() },
        Material { base_color: [0.9; 3], transmission: 0.6, roughness: 0.7, ..Material::default() },
        lamp([4.0, 3.0, 2.0]),
    ];
    let floor = quad([[-4., 0., 4.], [4., 0., 4.], [4., 0., -4.], [-4., 0., -4.]]);
    let panel = quad([[-0.8, 0., -0.8], [0.8, 0., -0.8], [0.8, 0., 0.8], [-0.8, 0., 0.8]]);
    let parts = vec![
        part(floor, 0),
        part(cube(), 2),
        part(sphere(12).0, 1),
        part(sphere(12).0, 3),
        part(panel, 4),
    ];
    let mut model = model(parts, materials);
    let ball = |x: f32| Affine::translation([x, 0.5, 0.6]).then_from(&Affine::scaling([0.5; 3]));
    model.placements[1].world_from_object = Affine::translation([0.0, 0.6, -0.9])
        .then_from(&Affine::rotation([0.0, 1.0, 0.0], 0.5))
        .then_from(&Affine::scaling([0.6, 0.6, 0.3]));
    model.placements[2].world_from_object = ball(-0.8);
    model.placements[3].world_from_object = ball(0.8);
    model.placements[4].world_from_object = Affine::translation([0.0, 2.5, 0.0]);
    let mut second = model.placements[4].clone();
    second.world_from_object = Affine::translation([-2.5, 1.0, 0.0])
        .then_from(&Affine::rotation([0.0, 0.0, 1.0], 1.2))
        .then_from(&Affine::scaling([-1.5, 1.0, 0.5]));
    model.placements.push(second);
    let sun = Sun { direction: [0.6, 0.8, 0.0], angular_radius: 0.35, radiance: [6.0, 5.0, 4.0] };
    model.sky = Some(Sky { sun: Some(sun), ..Sky::clear(1) });
    model
}

/// The mean of each channel and its standard error.
fn estimate(model: &Model, strategy: Strategy, passes: u32) -> [(f64, f64); 3] {
    let settings = Settings { strategy, max_bounces: 6, seed: strategy as u64, ..exact(40, 30) };
    let placed = placed(model);
    let camera = camera([0.5, 1.6, 4.0], [0.0, 0.5, 0.0], 0.7);
    let renderer = Renderer::new(model, &placed, &camera, settings).unwrap();
    let mut film = renderer.film().unwrap();
    let mut sums = vec![];
    for _ in 0..passes {
        renderer.pass(&mut film, &Cancel::new()).unwrap();
        sums.push([0, 1, 2].map(|c| film.sums().iter().map(|p| f64::from(p[c])).sum::<f64>()));
    }
    [0, 1, 2].map(|c| {
        let pixels = film.sums().len() as f64;
        let passes: Vec<f64> = (0..sums.len())
            .map(|i| (sums[i][c] - if i == 0 { 0.0 } else { sums[i - 1][c] }) / pixels)
            .collect();
        let n = passes.len() as f64;
        let mean = passes.iter().sum::<f64>() / n;
        let variance = passes.iter().map(|m| (m - mean) * (m - mean)).sum::<f64>() / (n - 1.0);
        (mean, (variance / n).sqrt())
    })
}

#[test]
fn agree_on_the_picture() {
    let model = scene();
    let both = estimate(&model, Strategy::Both, 96);
    for strategy in [Strategy::Lights, Strategy::Lobes] {
        let other = estimate(&model, strategy, 192);
        for c in 0..3 {
            let ((a, error_a), (b, error_b)) = (both[c], other[c]);
            let bar = 5.0 * (error_a * error_a + error_b * error_b).sqrt();
            assert!((a - b).abs() < bar, "{strategy:?}, channel {c}: {a} and {b}, bar {bar}");
            // The bar is fine enough to see a factor that one strategy forgets.
            assert!(bar < 0.02 * a, "{strategy:?}, channel {c}: bar {bar} of {a}");
        }
    }
}
