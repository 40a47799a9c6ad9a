//! Textures, holes, vertex colours and normal textures, seen.

mod common;

use common::{exact, lambert, model, part, quad, render};
use treelet_model::texture::{ColorSpace, Filtering};
use treelet_model::{
    AlphaMode, Camera, Image, Light, LightKind, Material, Model, Part, Pixels, Sky, Texture, View,
};

/// A square `-1 ..= 1` at depth `z`, upright, with coordinates from its upper left corner.
fn sheet(z: f32, material: usize) -> Part {
    let corners = [[-1., -1., z], [1., -1., z], [1., 1., z], [-1., 1., z]];
    let uvs = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
    Part { uvs: vec![uvs.into()], ..part(quad(corners), material) }
}

/// Sees exactly the square.
fn front() -> Camera {
    let camera = Camera::look_at([0.0, 0.0, 5.0], [0.0; 3], [0.0, 1.0, 0.0], 1.0).unwrap();
    Camera { view: View::Orthographic { height: 2.0 }, ..camera }
}

/// Two by two pixels: red, green above blue, half-transparent white.
fn image() -> Image {
    let pixels = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255, 255, 255, 64]];
    Image { name: String::new(), width: 2, height: 2, pixels: Pixels::Rgba8(pixels.into()) }
}

fn shown(material: Material, images: Vec<Image>) -> Model {
    let back = Material { unlit: true, base_color: [0.5; 3], ..Material::default() };
    let mut model = model(vec![sheet(0.0, 0), sheet(-1.0, 1)], vec![material, back]);
    model.images = images;
    model.sky = Some(Sky::uniform([0.0; 3]));
    model
}

/// The means of a picture of `n` by `n` pixels, far from its edges.
fn pixels(model: &Model, n: u32, passes: u32) -> Vec<[f32; 3]> {
    let (film, _) = render(model, &front(), exact(n, n), passes);
    film.means().unwrap()
}

fn near(a: [f32; 3], b: [f32; 3]) -> bool {
    (0..3).all(|c| (a[c] - b[c]).abs() < 0.03)
}

/// A texture of the image, without interpolation.
fn texture() -> Texture {
    Texture { filter: Filtering::Nearest, ..Texture::new(0, ColorSpace::Linear) }
}

#[test]
fn pictures_are_upright() {
    let material = Material {
        unlit: true,
        base_color: [1.0; 3],
        base_color_texture: Some(texture()),
        ..Material::default()
    };
    let got = pixels(&shown(material, vec![image()]), 16, 4);
    let at = |x: usize, y: usize| got[y * 16 + x];
    assert!(near(at(3, 3), [1.0, 0.0, 0.0]), "{:?}", at(3, 3));
    assert!(near(at(12, 3), [0.0, 1.0, 0.0]), "{:?}", at(12, 3));
    assert!(near(at(3, 12), [0.0, 0.0, 1.0]), "{:?}", at(3, 12));
    assert!(near(at(12, 12), [1.0; 3]), "{:?}", at(12, 12));
}

#[test]
fn holes_show_what_is_behind() {
    let material = |alpha| Material {
        unlit: true,
        base_color: [1.0; 3],
        base_color_texture: Some(texture()),
        alpha,
        ..Material::default()
    };
    for (alpha, expected) in [
        (AlphaMode::Opaque, 1.0),
        (AlphaMode::Mask { cutoff: 0.5 }, 0.5),
        (AlphaMode::Mask { cutoff: 0.2 }, 1.0),
        (AlphaMode::Blend, 0.5 + 0.5 * 64.0 / 255.0),
    ] {
        let got = pixels(&shown(material(alpha), vec![image()]), 16, 1024);
        assert!(near(got[12 * 16 + 12], [expected; 3]), "{alpha:?}: {:?}", got[12 * 16 + 12]);
        assert!(near(got[3 * 16 + 3], [1.0, 0.0, 0.0]), "{alpha:?}");
    }
    // A texture of its own, and vertices, have a say as well.
    let own =
        Material { opacity_texture: Some(texture()), ..material(AlphaMode::Mask { cutoff: 0.5 }) };
    let got = pixels(&shown(own, vec![image()]), 16, 4);
    assert!(near(got[3 * 16 + 12], [0.5; 3]), "green has no red: {:?}", got[3 * 16 + 12]);
    let mut faint = shown(material(AlphaMode::Mask { cutoff: 0.5 }), vec![image()]);
    faint.objects[0].parts[0].colors = Some([[1.0, 1.0, 1.0, 0.3]; 4].into());
    let got = pixels(&faint, 16, 4);
    assert!(near(got[3 * 16 + 3], [0.5; 3]), "{:?}", got[3 * 16 + 3]);
}

/// Light reaches through holes: shadows are cut out too.
#[test]
fn shadows_have_holes() {
    let cut = |cutoff: f32| {
        let leaf = Material {
            base_color_texture: Some(texture()),
            alpha: AlphaMode::Mask { cutoff },
            ..lambert([0.0; 3])
        };
        let mut model = shown(leaf, vec![image()]);
        model.materials[1] = lambert([1.0; 3]);
        let direction = [0.0, 0.0, -1.0];
        let kind = LightKind::Directional { direction, irradiance: [std::f32::consts::PI; 3] };
        model.lights = vec![Light { name: String::new(), kind }];
        pixels(&model, 16, 4)[12 * 16 + 12]
    };
    assert!(near(cut(0.5), [1.0; 3]), "through the hole: {:?}", cut(0.5));
    assert!(near(cut(0.2), [0.0; 3]), "no hole: {:?}", cut(0.2));
}

#[test]
fn vertices_have_colours() {
    let white = Material { unlit: true, base_color: [1.0; 3], ..Material::default() };
    let mut model = shown(white, Vec::new());
    let [left, right] = [[1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]];
    model.objects[0].parts[0].colors = Some([left, right, right, left].into());
    let got = pixels(&model, 16, 16);
    assert!(near(got[8 * 16 + 4], [1.0 - 4.5 / 16.0, 0.0, 4.5 / 16.0]), "{:?}", got[8 * 16 + 4]);
}

/// Red tilts a normal to the right of the picture, green up: under light from there it is brighter.
/// With the file's tangents as without.
#[test]
fn normals_tilt_as_gltf_says() {
    let lit = |normal: [u8; 3], toward: [f32; 3], tangents: bool| {
        let pixel = [normal[0], normal[1], normal[2], 255];
        let pixels_of = Pixels::Rgba8([pixel].into());
        let image = Image { name: String::new(), width: 1, height: 1, pixels: pixels_of };
        let material = Material { normal_texture: Some(texture()), ..lambert([1.0; 3]) };
        let mut model = shown(material, vec![image]);
        if tangents {
            model.objects[0].parts[0].tangents = Some([[1.0, 0.0, 0.0, 1.0]; 4].into());
        }
        let direction = toward.map(|c| -c);
        let kind = LightKind::Directional { direction, irradiance: [std::f32::consts::PI; 3] };
        model.lights = vec![Light { name: String::new(), kind }];
        pixels(&model, 8, 1)[4 * 8 + 4][0]
    };
    // Tilted by 45 degrees, and light from 45 degrees.
    let (right, up) = ([218, 128, 218], [128, 218, 218]);
    let side = std::f32::consts::FRAC_1_SQRT_2;
    for tangents in [false, true] {
        let flat = lit([128, 128, 255], [side, 0.0, side], tangents);
        assert!((flat - side).abs() < 0.02, "{flat}");
        for (normal, toward, expected) in [
            (right, [side, 0.0, side], 1.0),
            (right, [-side, 0.0, side], 0.0),
            (up, [0.0, side, side], 1.0),
            (up, [0.0, -side, side], 0.0),
        ] {
            let got = lit(normal, toward, tangents);
            let case = format!("{normal:?} toward {toward:?}, tangents {tangents}: {got}");
            assert!((got - expected).abs() < 0.03, "{case}");
        }
    }
}
