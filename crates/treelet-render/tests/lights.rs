//! Lights of every kind against what paper and pencil say, and strategies against each other where
//! there are thousands of lights or a bright spot in an environment.

mod common;

use common::{camera, exact, lambert, lamp, model, part, placed, quad, render};
use treelet::{Affine, Cancel, Mesh};
use treelet_model::light::{Projection, SpotFalloff};
use treelet_model::{
    Camera, Environment, Image, Light, LightKind, Material, Model, Pixels, Sky, View,
};
use treelet_render::{Renderer, Settings, Strategy};

const ALBEDO: f32 = 0.5;

/// A large floor at height 0 under a black sky.
fn floor() -> Model {
    let quad = quad([[-50., 0., 50.], [50., 0., 50.], [50., 0., -50.], [-50., 0., -50.]]);
    let mut model = model(vec![part(quad, 0)], vec![lambert([ALBEDO; 3])]);
    model.sky = Some(Sky::uniform([0.0; 3]));
    model
}

/// Looks straight down at a spot of the floor that is a hundredth wide.
fn above(x: f32) -> Camera {
    let view = View::Orthographic { height: 0.01 };
    let camera = Camera::look_at([x, 1.0, 0.0], [x, 0.0, 0.0], [0.0, 0.0, -1.0], 1.0).unwrap();
    Camera { view, ..camera }
}

/// The mean radiance of what a camera sees.
fn seen(model: &Model, camera: &Camera, passes: u32) -> f64 {
    let (film, _) = render(model, camera, Settings { max_bounces: 1, ..exact(4, 4) }, passes);
    let sum: f64 = film.sums().iter().map(|pixel| f64::from(pixel[1])).sum();
    sum / (f64::from(passes) * 16.0)
}

fn expect(name: &str, got: f64, want: f64, slack: f64) {
    assert!((got - want).abs() <= slack * want.max(1e-3), "{name}: {got} instead of {want}");
}

fn light(kind: LightKind) -> Vec<Light> {
    vec![Light { name: String::new(), kind }]
}

const RHO: f64 = ALBEDO as f64 / std::f64::consts::PI;

#[test]
fn points_and_spots() {
    let mut model = floor();
    let intensity = [1.0, 8.0, 1.0];
    model.lights = light(LightKind::Point { position: [0.0, 2.0, 0.0], intensity });
    expect("below a point", seen(&model, &above(0.0), 1), RHO * 8.0 / 4.0, 1e-3);
    // At 45 degrees: twice the squared distance, and the cosine.
    expect("beside it", seen(&model, &above(2.0), 1), RHO * 8.0 / 8.0 / 2f64.sqrt(), 1e-2);

    for falloff in [SpotFalloff::Square, SpotFalloff::Smooth] {
        let (inner_angle, outer_angle) = (0.3, 1.0);
        model.lights = light(LightKind::Spot {
            position: [0.0, 2.0, 0.0],
            direction: [0.0, -3.0, 0.0],
            intensity,
            inner_angle,
            outer_angle,
            falloff,
        });
        expect("in the spot", seen(&model, &above(0.0), 1), RHO * 2.0, 1e-3);
        expect("out of it", seen(&model, &above(4.0), 1), 0.0, 0.0);
        let cos = libm::cos(0.7);
        let x = (cos - libm::cos(1.0)) / (libm::cos(0.3) - libm::cos(1.0));
        let fade = if falloff == SpotFalloff::Square { x * x } else { x * x * (3.0 - 2.0 * x) };
        let beside = (2.0 * libm::tan(0.7)) as f32;
        let want = RHO * 8.0 / 4.0 * cos * cos * cos * fade;
        expect("at its edge", seen(&model, &above(beside), 1), want, 2e-2);
    }
}

#[test]
fn directional_lights_and_several_at_once() {
    let mut model = floor();
    let sun = |direction| LightKind::Directional { direction, irradiance: [3.0; 3] };
    model.lights = light(sun([0.0, -1.0, 0.0]));
    expect("noon", seen(&model, &above(0.0), 1), RHO * 3.0, 1e-3);
    model.lights = light(sun([0.6, -0.8, 0.0]));
    expect("afternoon", seen(&model, &above(0.0), 1), RHO * 3.0 * 0.8, 1e-3);
    // A second one, a point and a sky: choices among them add up.
    model.lights.extend(light(sun([0.0, -1.0, 0.0])));
    model.lights.extend(light(LightKind::Point { position: [0.0, 2.0, 0.0], intensity: [8.0; 3] }));
    model.sky = Some(Sky::uniform([0.7; 3]));
    let want = RHO * (3.0 * 1.8 + 2.0) + 0.7 * f64::from(ALBEDO);
    expect("all of it", seen(&model, &above(0.0), 1 << 12), want, 1e-2);
}

#[test]
fn one_sided_lamps_shine_on_one_side() {
    let panel = |y: f32| quad([[-1., y, 1.], [1., y, 1.], [1., y, -1.], [-1., y, -1.]]);
    for (one_sided, turned) in [(false, false), (true, false), (true, true)] {
        let mut model = floor();
        model.materials.push(Material { one_sided_emission: one_sided, ..lamp([5.0; 3]) });
        let object =
            treelet_model::Object { name: String::new(), parts: vec![part(panel(3.0), 1)] };
        model.objects.push(object);
        let turn = if turned {
            Affine([[1., 0., 0., 0.], [0., -1., 0., 6.], [0., 0., -1., 0.]])
        } else {
            Affine::IDENTITY
        };
        model.placements.push(treelet_model::Placement { object: 1, world_from_object: turn });
        // The panel faces up unless it is turned; the camera stands below it.
        let lit = seen(&model, &above(0.0), 64) > 0.1;
        assert_eq!(lit, !one_sided || turned, "one-sided {one_sided}, turned {turned}");
    }
}

/// A picture of one radiance lights like a sky of it.
#[test]
fn even_environments_are_skies() {
    for projection in [Projection::LatLong, Projection::EqualAreaOctahedral] {
        let mut model = floor();
        let pixels = Pixels::Rgba32F(vec![[0.25, 0.5, 1.0, 1.0]; 64].into());
        model.images = vec![Image { name: String::new(), width: 8, height: 8, pixels }];
        model.environment = Some(Environment {
            image: 0,
            projection,
            world_from_environment: Affine::rotation([1.0, 1.0, 0.0], 0.7),
            scale: [1.0, 2.0, 1.0],
        });
        let got = seen(&model, &above(0.0), 1024);
        expect(&format!("{projection:?}"), got, f64::from(ALBEDO), 5e-3);
    }
}

/// The mean of a picture, with its standard error, over passes.
fn estimate(model: &Model, strategy: Strategy, passes: u32) -> (f64, f64) {
    let settings = Settings { strategy, max_bounces: 3, seed: strategy as u64, ..exact(24, 18) };
    let placed = placed(model);
    let camera = camera([0.5, 2.0, 4.0], [0.0, 0.3, 0.0], 0.7);
    let renderer = Renderer::new(model, &placed, &camera, settings).unwrap();
    let mut film = renderer.film().unwrap();
    let (mut means, mut before) = (Vec::new(), 0.0);
    for _ in 0..passes {
        renderer.pass(&mut film, &Cancel::new()).unwrap();
        let sum: f64 = film.sums().as_flattened().iter().map(|&c| f64::from(c)).sum();
        means.push((sum - before) / (film.sums().len() * 3) as f64);
        before = sum;
    }
    let n = means.len() as f64;
    let mean = means.iter().sum::<f64>() / n;
    let variance = means.iter().map(|m| (m - mean) * (m - mean)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

fn strategies_agree(name: &str, model: &Model, passes: u32) {
    let both = estimate(model, Strategy::Both, passes);
    for strategy in [Strategy::Lights, Strategy::Lobes] {
        let other = estimate(model, strategy, 3 * passes);
        let bar = 5.0 * (both.1 * both.1 + other.1 * other.1).sqrt();
        assert!((both.0 - other.0).abs() < bar, "{name}, {strategy:?}: {both:?} {other:?}");
        assert!(bar < 0.04 * both.0, "{name}, {strategy:?}: bar {bar} of {both:?}");
    }
}

#[test]
fn strategies_agree_under_an_environment_with_a_bright_spot() {
    let mut model = floor();
    model.materials[0] = Material::coated_diffuse([0.6, 0.5, 0.4], 0.5, 1.5);
    let mut pixels = vec![[0.2, 0.3, 0.4, 1.0]; 16 * 8];
    pixels[2 * 16 + 5] = [30.0, 28.0, 20.0, 1.0];
    let pixels = Pixels::Rgba32F(pixels.into());
    model.images = vec![Image { name: String::new(), width: 16, height: 8, pixels }];
    model.environment = Some(Environment {
        image: 0,
        projection: Projection::LatLong,
        world_from_environment: Affine::IDENTITY,
        scale: [1.0; 3],
    });
    strategies_agree("environment", &model, 256);
}

#[test]
fn strategies_agree_under_thousands_of_lamps() {
    let mut model = floor();
    model.materials.push(lamp([6.0, 5.0, 4.0]));
    // A ceiling of scattered triangles, some without area.
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for i in 0..3000_u32 {
        let sampler = treelet_render::sampler::Sampler::new(8, 0, 0, i);
        let ([x, z], [y, size]) = (sampler.pair(0), sampler.pair(1));
        let at = [8.0 * x - 4.0, 1.0 + y, 8.0 * z - 4.0];
        let size = if i % 10 == 0 { 0.0 } else { 0.05 + 0.1 * size };
        let first = positions.len() as u32;
        positions.extend([
            at,
            [at[0] + size, at[1], at[2]],
            [at[0], at[1] + 0.3 * size, at[2] + size],
        ]);
        triangles.push([first, first + 1, first + 2]);
    }
    let object = treelet_model::Object {
        name: String::new(),
        parts: vec![part(Mesh::new(positions, triangles), 1)],
    };
    model.objects.push(object);
    let world_from_object = Affine::translation([0.0, 0.2, 0.0]);
    model.placements.push(treelet_model::Placement { object: 1, world_from_object });
    strategies_agree("lamps", &model, 256);
}
