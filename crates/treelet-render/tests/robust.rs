//! Nothing that a model may hold makes a picture that is not a number, or a panic.

mod common;

use common::{box_camera, box_scene, camera, cube, exact, lamp, model, part, placed, quad, render};
use treelet::{Affine, BuildOptions, Cancel, Mesh};
use treelet_model::{Camera, Material, Model, Part, PlacedModel, Sky, View};
use treelet_render::{Aov, RenderError, Renderer, Settings, aov, default_sky, sky};

fn sound(film: &treelet_render::Film) -> bool {
    film.sums().as_flattened().iter().all(|c| c.is_finite() && *c >= 0.0)
}

#[test]
fn light_is_finite_and_never_negative() {
    let (film, rays) = render(&box_scene(), &box_camera(), exact(48, 48), 16);
    assert!(sound(&film));
    assert!(rays > 16 * 48 * 48);
    assert!(film.sums().as_flattened().iter().sum::<f32>() > 0.0, "and there is some");
}

/// A scene a million million million times larger or smaller is the same picture: offsets, areas
/// and densities scale along. By powers of two, so that only they could differ.
#[test]
fn size_does_not_matter() {
    let picture = |exponent: i32| {
        let size = libm::ldexpf(1.0, exponent);
        let mut model = box_scene();
        for placement in &mut model.placements {
            let scaled = Affine::scaling([size; 3]).then_from(&placement.world_from_object);
            placement.world_from_object = scaled;
        }
        let camera = camera([0.0, 0.0, 3.9 * size], [0.0; 3], 0.69);
        let (film, rays) = render(&model, &camera, exact(24, 24), 8);
        assert!(sound(&film), "2^{exponent}");
        (film.sums().as_flattened().iter().sum::<f32>(), rays)
    };
    let (light, rays) = picture(0);
    assert!(light > 0.0);
    for exponent in [-60, -20, 20, 60] {
        let (scaled, scaled_rays) = picture(exponent);
        assert!((scaled / light - 1.0).abs() < 1e-3, "2^{exponent}: {scaled} instead of {light}");
        let more = scaled_rays.abs_diff(rays) as f64 / rays as f64;
        assert!(more < 1e-3, "2^{exponent}: {scaled_rays} rays instead of {rays}");
    }
}

/// Factors at and beyond the ends of their ranges, normals that are none, lamps without area.
#[test]
fn odd_models_have_pictures() {
    let odd = |change: &dyn Fn(&mut Material)| {
        let mut material = Material::default();
        change(&mut material);
        material
    };
    let materials = vec![
        odd(&|m| m.roughness = 0.0),
        odd(&|m| (m.roughness, m.metallic, m.base_color) = (1e-30, 7.0, [9.0; 3])),
        odd(&|m| (m.transmission, m.ior) = (3.0, 0.0)),
        odd(&|m| (m.ior, m.base_color) = (1e30, [0.0; 3])),
        odd(&|m| (m.metallic, m.transmission, m.roughness) = (0.5, 0.5, 0.0)),
        lamp([f32::MAX, 0.0, 1e-30]),
    ];
    let nan = Part { normals: Some([[f32::NAN; 3]; 8].into()), ..part(cube(), 0) };
    let zero = Part { normals: Some([[0.0; 3]; 8].into()), ..part(cube(), 1) };
    let inward = {
        let normals: Vec<_> = cube().positions().iter().map(|p| p.map(|c| -c)).collect();
        Part { normals: Some(normals.into()), ..part(cube(), 2) }
    };
    let flat = Mesh::new([[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], [[0, 1, 2], [0, 0, 0]]);
    let panel = quad([[-1., 3., -1.], [1., 3., -1.], [1., 3., 1.], [-1., 3., 1.]]);
    let parts =
        vec![nan, zero, inward, part(cube(), 3), part(cube(), 4), part(flat, 5), part(panel, 5)];
    let mut model = model(parts, materials);
    for (i, placement) in model.placements.iter_mut().enumerate().take(5) {
        let at = Affine::translation([2.2 * i as f32 - 4.4, 0.0, 0.0]);
        placement.world_from_object = at.then_from(&Affine::scaling([1.0, -1.0, 0.6]));
    }
    let (film, _) = render(&model, &camera([1.0, 2.0, 9.0], [0.0; 3], 0.9), exact(64, 32), 8);
    assert!(sound(&film));
}

#[test]
fn nothing_but_sky() {
    let model = Model::default();
    let (film, rays) = render(&model, &box_camera(), exact(8, 8), 2);
    assert_eq!(rays, 2 * 64);
    assert!(sound(&film) && film.mean(0, 0)[2] > 0.1, "the clear sky is blue above");
    assert_eq!(film.mean(8, 0), [0.0; 3]);
    let placed = placed(&model);
    let renderer = Renderer::new(&model, &placed, &box_camera(), exact(8, 8)).unwrap();
    for info in aov::ALL {
        assert!(renderer.aov(info.aov, &Cancel::new()).is_ok(), "{}", info.name);
    }
}

#[test]
fn the_sky_follows_the_model() {
    let mut model = Model::of_mesh("box", cube(), Material::default());
    assert_eq!(default_sky(&model, 2), Sky::clear(2));
    model.materials[0].emission = [0.0, 2.0, 0.0];
    assert_eq!(default_sky(&model, 2), sky::dusk(2));
    model.sky = Some(Sky::uniform([0.5; 3]));
    assert_eq!(default_sky(&model, 2), Sky::uniform([0.5; 3]));
}

#[test]
fn nonsense_is_named() {
    let good = Model::of_mesh("box", cube(), Material::default());
    let scene = placed(&good);
    let refuse = |model: &Model, camera: &Camera, settings: Settings| {
        Renderer::new(model, &scene, camera, settings).map(drop).unwrap_err()
    };
    let camera = box_camera();

    let error = refuse(&good, &camera, Settings { width: 0, ..Settings::default() });
    assert_eq!(error, RenderError::ImageSize { width: 0, height: 720 });
    let error = refuse(&good, &camera, Settings { up: 3, ..Settings::default() });
    assert_eq!(error, RenderError::Up { axis: 3 });
    let blind = Camera { view: View::Perspective { vertical_fov: f32::NAN }, ..camera.clone() };
    let error = refuse(&good, &blind, Settings::default());
    assert!(matches!(error, RenderError::FieldOfView { .. }), "{error}");

    let mut bad = good.clone();
    bad.materials[0].roughness = f32::NAN;
    let error = refuse(&bad, &camera, Settings::default()).to_string();
    assert!(error.contains("material 0") && error.contains("roughness = NaN"), "{error}");
    let mut bad = good.clone();
    bad.objects[0].parts[0].material = 4;
    let error = refuse(&bad, &camera, Settings::default());
    let expected = RenderError::NoSuchMaterial { object: 0, part: 0, material: 4, materials: 1 };
    assert_eq!(error, expected);
    let mut bad = good.clone();
    bad.objects[0].parts[0].normals = Some([[0.0, 0.0, 1.0]; 7].into());
    let error = refuse(&bad, &camera, Settings::default());
    let expected =
        RenderError::AttributeCount { object: 0, part: 0, what: "normals", count: 7, vertices: 8 };
    assert_eq!(error, expected);
    let mut bad = good.clone();
    bad.placements[0].object = 9;
    let error = refuse(&bad, &camera, Settings::default());
    assert_eq!(error, RenderError::NoSuchObject { placement: 0, object: 9, objects: 1 });
    let mut bad = good.clone();
    bad.sky = Some(Sky { ground: [0.0, -1.0, 0.0], ..Sky::clear(1) });
    let error = refuse(&bad, &camera, Settings::default()).to_string();
    assert!(error.contains("ground") && error.contains("-1"), "{error}");
}

#[test]
fn films_of_another_size_are_refused() {
    let model = Model::of_mesh("box", cube(), Material::default());
    let scene = PlacedModel::build(&model, &BuildOptions::default()).unwrap();
    let renderer = Renderer::new(&model, &scene, &box_camera(), exact(8, 6)).unwrap();
    let mut film = treelet_render::Film::new(6, 8).unwrap();
    let error = renderer.pass(&mut film, &Cancel::new()).unwrap_err();
    assert_eq!(error, RenderError::FilmSize { film: [6, 8], renderer: [8, 6] });
    let cancel = Cancel::new();
    cancel.cancel();
    assert_eq!(renderer.aov(Aov::Depth, &cancel).unwrap_err(), RenderError::Cancelled);
}

/// Maps count what the library counts, and show the middle of each pixel.
#[test]
fn maps_show_what_rays_meet() {
    let model = Model::of_mesh("box", cube(), Material::default());
    let scene = placed(&model);
    let camera = camera([0.0, 0.0, 5.0], [0.0; 3], 0.8);
    let renderer = Renderer::new(&model, &scene, &camera, exact(33, 33)).unwrap();
    let normal = renderer.aov(Aov::Normal, &Cancel::new()).unwrap();
    assert_eq!(normal.pixels()[16 * 33 + 16], [128, 128, 255], "toward the eye");
    assert_eq!(normal.pixels()[0], [0; 3], "nothing there");
    let depth = renderer.aov(Aov::Depth, &Cancel::new()).unwrap();
    let [middle, corner] = [depth.pixels()[16 * 33 + 16], depth.pixels()[0]];
    // The face is 4 away; the scale ends at 5.
    assert_eq!((middle[0], corner), ((250.0 - 210.0 * 0.8f32) as u8, [24, 26, 32]));
    // A box is one node, which every ray visits; triangles are tested where it is.
    let tests = renderer.aov(Aov::Tests, &Cancel::new()).unwrap();
    assert_ne!(tests.pixels()[16 * 33 + 16], tests.pixels()[0]);
}
