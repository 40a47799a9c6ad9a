//! pbrt files, small enough to be seen whole.

mod common;

use std::fs;
use std::path::Path;

use common::{LOWER, SQUARE, UPPER, check, check_error, model, soup};
use treelet_import::{Options, load};
use treelet_model::light::{LightKind, Projection, SpotFalloff};
use treelet_model::{AlphaMode, Pixels, View};

const LOWER_MESH: &str =
    "Shape \"trianglemesh\" \"integer indices\" [0 1 2] \"point3 P\" [0 0 0 1 0 0 1 1 0]\n";

#[test]
fn meshes_and_transforms() {
    check("a.pbrt", format!("WorldBegin {LOWER_MESH}"), &[LOWER]);
    // Content tells, in spite of a remark; a lone triangle needs no indices.
    let text = "# \"x\nWorldBegin\nShape \"trianglemesh\"\"point P\"[0 0 0 1 0 0 1 1 0]";
    check("a", text, &[LOWER]);
    let moved = |by: &str| {
        let text = format!("WorldBegin {by} {LOWER_MESH}");
        soup(&model("a.pbrt", text))[0][2]
    };
    assert_eq!(moved("Translate 1 2 3 Scale 2 3 4"), [3.0, 5.0, 3.0]);
    assert_eq!(moved("Transform [2 0 0 0 0 2 0 0 0 0 2 0 5 0 0 1]"), [7.0, 2.0, 0.0]);
    assert_eq!(
        moved("Scale 2 2 2 ConcatTransform [1 0 0 0 0 1 0 0 0 0 1 0 5 0 0 1]"),
        [12.0, 2.0, 0.0]
    );
    let [x, y, _] = moved("Rotate 90 0 0 1");
    assert!((x + 1.0).abs() < 1e-6 && (y - 1.0).abs() < 1e-6, "{x} {y}");
    let saved = "CoordinateSystem \"here\" AttributeBegin Scale 9 9 9 AttributeEnd \
        TransformBegin Scale 8 8 8 TransformEnd Translate 1 0 0 CoordSysTransform \"here\"";
    assert_eq!(moved(saved), [1.0, 1.0, 0.0]);
    // What stands before the world belongs to the camera.
    check("a.pbrt", format!("Scale 5 5 5 WorldBegin {LOWER_MESH}"), &[LOWER]);
}

#[test]
fn mirrored_surfaces_keep_their_side() {
    // The side of a surface is told by its corners after they are placed, and turned over by a
    // mirror, as pbrt does it.
    let [a, b, c] = LOWER;
    check("a.pbrt", format!("WorldBegin ReverseOrientation {LOWER_MESH}"), &[[a, c, b]]);
    let flip = |p: [f32; 3]| [p[0], p[1], -p[2]];
    let want = [[flip(a), flip(c), flip(b)]];
    check("a.pbrt", format!("WorldBegin Scale 1 1 -1 {LOWER_MESH}"), &want);
}

#[test]
fn objects_are_placed() {
    let text = format!(
        "WorldBegin Translate 0 0 1 ObjectBegin \"o\" Translate 1 0 0 {LOWER_MESH} ObjectEnd\n\
         ObjectInstance \"o\" Scale 2 2 2 ObjectInstance \"o\" ObjectInstance \"none\"\n"
    );
    let got = model("a.pbrt", text);
    assert_eq!((got.objects.len(), got.placements.len()), (1, 2));
    let corners: Vec<_> = soup(&got).iter().map(|triangle| triangle[0]).collect();
    // The object's own transform holds the one it was defined under, as in pbrt.
    assert_eq!(corners, [[1.0, 0.0, 2.0], [2.0, 0.0, 3.0]]);
    assert_eq!(got.warnings, ["The object \"none\" is not defined."]);
}

#[test]
fn curved_shapes() {
    let area = |shape: &str| -> f64 {
        let got = model("a.pbrt", format!("WorldBegin Shape {shape}"));
        for part in got.objects.iter().flat_map(|object| &object.parts) {
            assert!((0..part.mesh.triangles().len()).all(|i| part.mesh.defect(i).is_none()));
        }
        let triangles = soup(&got);
        let areas = triangles.iter().map(|[a, b, c]| {
            let [a, b, c] = [a, b, c].map(|p| p.map(f64::from));
            let u = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
            let v = [c[0] - a[0], c[1] - a[1], c[2] - a[2]];
            let n =
                [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            0.5 * (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt()
        });
        areas.sum()
    };
    let pi = core::f64::consts::PI;
    for (shape, want) in [
        ("\"sphere\" \"float radius\" 2", 16.0 * pi),
        ("\"sphere\" \"float zmin\" 0", 2.0 * pi),
        ("\"cylinder\" \"float radius\" 0.5 \"float zmax\" 2", 3.0 * pi),
        ("\"disk\" \"float innerradius\" 0.5", 0.75 * pi),
        ("\"disk\" \"float phimax\" 90", 0.25 * pi),
        ("\"bilinearmesh\" \"point3 P\" [0 0 0 2 0 0 0 1 0 2 1 0]", 2.0),
    ] {
        let got = area(shape);
        assert!((got / want - 1.0).abs() < 0.01, "{shape}: {got} instead of {want}");
    }
    // A patch that is not flat is cut finer; its middle is the mean of its corners.
    let patch = "WorldBegin Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 1]";
    let got = model("a.pbrt", patch);
    assert!(got.objects[0].parts[0].mesh.positions().contains(&[0.5, 0.5, 0.25]));
    // Full spheres share a mesh, and their corners turn left toward the outside.
    let spheres = "WorldBegin Shape \"sphere\" Translate 5 0 0 Shape \"sphere\" \"float radius\" 3";
    let got = model("a.pbrt", spheres);
    assert_eq!((got.objects.len(), got.placements.len()), (1, 2));
    let outward = got.objects[0].parts[0].mesh.triangles().iter().enumerate().all(|(i, _)| {
        let [a, b, c] = got.objects[0].parts[0].mesh.corners(i).expect("in range");
        let u = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
        let v = [c[0] - a[0], c[1] - a[1], c[2] - a[2]];
        let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        n[0] * a[0] + n[1] * a[1] + n[2] * a[2] > 0.0
    });
    assert!(outward);
}

#[test]
fn cameras_see_what_pbrt_shows() {
    let text = "LookAt 0 0 -5 0 0 0 0 1 0 Camera \"perspective\" \"float fov\" 60 \
        \"float lensradius\" 0.1 \"float focaldistance\" 5\n\
        Film \"rgb\" \"integer xresolution\" 200 \"integer yresolution\" 400 WorldBegin\n";
    let got = model("a.pbrt", text);
    let camera = &got.cameras[0];
    // It looks along +z with +x to the right: a mirror image of what a right-handed one sees.
    let rows = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, -1.0, -5.0]];
    assert_eq!(camera.world_from_camera.0, rows);
    assert_eq!((camera.resolution, got.up), (Some([200, 400]), Some(1)));
    // The angle is across the shorter side, which is not the height.
    let View::Perspective { vertical_fov } = camera.view else { panic!("{:?}", camera.view) };
    let want = 2.0 * (2.0 * (30_f32).to_radians().tan()).atan();
    assert!((vertical_fov - want).abs() < 1e-6);
    let lens = camera.lens.expect("it has a lens");
    assert_eq!((lens.radius, lens.focus_distance), (0.1, 5.0));
    let flat =
        "Scale 0.5 0.5 0.5 Camera \"orthographic\" \"float screenwindow\" [-3 3 -2 2] WorldBegin";
    assert_eq!(model("a.pbrt", flat).cameras[0].view, View::Orthographic { height: 8.0 });
}

#[test]
fn lights() {
    let text = "WorldBegin Translate 1 0 0\n\
        LightSource \"point\" \"rgb I\" [1 2 3] \"float scale\" 2 \"point3 from\" [0 1 0]\n\
        LightSource \"spot\" \"point3 to\" [0 0 2] \"float coneangle\" 40 \"float conedeltaangle\" 10\n\
        LightSource \"distant\" \"point3 from\" [0 3 0] \"point3 to\" [0 0 0] \"spectrum L\" \"stdillum-D65\"\n\
        LightSource \"goniometric\"\nLightSource \"infinite\" \"rgb L\" [0.5 0.25 0]\n";
    let got = model("a.pbrt", text);
    assert_eq!(got.warnings[0], "The light \"goniometric\" is read as \"point\".");
    let kinds: Vec<_> = got.lights.iter().map(|light| light.kind).collect();
    assert_eq!(
        kinds[..3],
        [
            LightKind::Point { position: [1.0, 1.0, 0.0], intensity: [2.0, 4.0, 6.0] },
            LightKind::Spot {
                position: [1.0, 0.0, 0.0],
                direction: [0.0, 0.0, 1.0],
                intensity: [1.0; 3],
                inner_angle: 30_f32.to_radians(),
                outer_angle: 40_f32.to_radians(),
                falloff: SpotFalloff::Smooth,
            },
            LightKind::Directional { direction: [0.0, -1.0, 0.0], irradiance: [1.0; 3] },
        ]
    );
    assert_eq!(got.sky.expect("it has a sky").zenith, [0.5, 0.25, 0.0]);
    // A lamp, and no other light.
    let lamp = format!(
        "WorldBegin AreaLightSource \"diffuse\" \"rgb L\" [3 2 1] \"bool twosided\" true {LOWER_MESH}"
    );
    let got = model("a.pbrt", lamp);
    let material = &got.materials[got.objects[0].parts[0].material];
    assert_eq!((material.emission, material.one_sided_emission), ([3.0, 2.0, 1.0], false));
    assert_eq!(got.sky.expect("it is dark").zenith, [0.0; 3]);
    let light = "WorldBegin LightSource \"point\" \"blackbody I\" 2700";
    let LightKind::Point { intensity: [r, g, b], .. } = model("a.pbrt", light).lights[0].kind
    else {
        panic!("a point")
    };
    assert!(r > g && g > b, "{r} {g} {b}");
}

/// The material of the only shape after some directives.
fn material(directives: &str) -> treelet_model::Material {
    let got = model("a.pbrt", format!("WorldBegin {directives}\n{LOWER_MESH}"));
    got.materials[got.objects[0].parts[0].material].clone()
}

#[test]
fn materials() {
    let red = material("Material \"diffuse\" \"rgb reflectance\" [0.8 0.1 0.2]");
    assert_eq!((red.base_color, red.specular, red.metallic), ([0.8, 0.1, 0.2], 0.0, 0.0));
    let gold = material(
        "MakeNamedMaterial \"g\" \"string type\" \"conductor\" \"spectrum eta\" \"metal-Au-eta\" \
         \"spectrum k\" \"metal-Au-k\" \"float roughness\" 0.0625 NamedMaterial \"g\"",
    );
    // A width of 0.25, so a perceptual roughness of 0.5.
    assert_eq!((gold.metallic, gold.roughness, &*gold.name), (1.0, 0.5, "g"));
    assert!(gold.base_color[0] > 0.9 && gold.base_color[2] < 0.5, "{:?}", gold.base_color);
    let raw = "\"float roughness\" 0.25 \"bool remaproughness\" false";
    assert_eq!(material(&format!("Material \"coateddiffuse\" {raw}")).roughness, 0.5);
    let glass = material("Material \"dielectric\" \"spectrum eta\" \"glass-BK7\"");
    assert_eq!((glass.transmission, glass.ior, glass.thin_walled), (1.0, 1.517, false));
    assert!(material("Material \"thindielectric\"").thin_walled);
    assert_eq!(
        material("Material \"coatedconductor\" \"float interface.roughness\" 0").clear_coat,
        1.0
    );
    let last = "Attribute \"material\" \"rgb reflectance\" [0.3 0.3 0.3] Material \"diffuse\"";
    assert_eq!(material(last).base_color, [0.3; 3]);
    let mix = material(
        "MakeNamedMaterial \"a\" \"string type\" \"diffuse\" \"rgb reflectance\" [1 0 0]\n\
         MakeNamedMaterial \"b\" \"string type\" \"diffuse\" \"rgb reflectance\" [0 1 0]\n\
         Material \"mix\" \"string materials\" [\"a\" \"b\"] \"float amount\" 0.75",
    );
    assert_eq!(mix.base_color, [0.0, 1.0, 0.0]);
    let alpha = model(
        "a.pbrt",
        "WorldBegin Shape \"trianglemesh\" \"float alpha\" 0.25 \"point3 P\" [0 0 0 1 0 0 1 1 0]",
    );
    let alpha = &alpha.materials[alpha.objects[0].parts[0].material];
    assert_eq!((alpha.alpha, alpha.opacity), (AlphaMode::Blend, 0.25));
    // What only bounds a medium is not seen.
    check("a.pbrt", format!("WorldBegin Material \"interface\" {LOWER_MESH}"), &[]);
}

#[test]
fn textures() {
    let checks = "Texture \"c\" \"spectrum\" \"checkerboard\" \"rgb tex1\" [1 0 0] \"rgb tex2\" [0 0 1] \
        \"float uscale\" 4 \"float vscale\" 4 Material \"diffuse\" \"texture reflectance\" \"c\"";
    let got = model("a.pbrt", format!("WorldBegin {checks}\n{LOWER_MESH}"));
    let texture = got.materials[got.objects[0].parts[0].material].base_color_texture;
    let texture = texture.expect("it has a texture");
    let Pixels::Rgba32F(pixels) = &got.images[texture.image].pixels else { panic!("floats") };
    // As the model has it: coordinates counted from above, then transformed, then the pixel.
    let at = |u: f32, v: f32| {
        let transform = texture.transform;
        let [x, y] = [
            transform.scale[0] * u + transform.offset[0],
            transform.scale[1] * (1.0 - v) + transform.offset[1],
        ];
        let pixel = |x: f32| usize::from(x.rem_euclid(1.0) >= 0.5);
        pixels[2 * pixel(y) + pixel(x)][0]
    };
    for (u, v, want) in [(0.1, 0.1, 1.0), (0.3, 0.1, 0.0), (0.1, 0.3, 0.0), (0.3, 0.3, 1.0)] {
        assert_eq!(at(u, v), want, "{u} {v}");
    }
    let scaled = "Texture \"a\" \"float\" \"constant\" \"float value\" 0.5\n\
        Texture \"s\" \"spectrum\" \"scale\" \"rgb tex\" [0.8 0.4 0.2] \"texture scale\" \"a\"\n\
        Texture \"m\" \"spectrum\" \"mix\" \"texture tex1\" \"s\" \"rgb tex2\" [0 0 0] \"float amount\" 0.5\n\
        Material \"diffuse\" \"texture reflectance\" \"m\"";
    assert_eq!(material(scaled).base_color, [0.2, 0.1, 0.05]);
}

#[test]
fn unknown_directives_are_counted_and_named_once() {
    let text = format!("WorldBegin Foo \"x\" 1 [2 3] Foo true\n{LOWER_MESH} Shape \"curve\"");
    let got = check("a.pbrt", text, &[LOWER]);
    let want = [
        "Shapes of type \"curve\" are left out.",
        "The pbrt directive \"Foo\" is not known; left out (2 times).",
    ];
    assert_eq!(got.warnings, want);
}

#[test]
fn what_is_wrong_has_a_line() {
    for (text, want) in [
        ("WorldBegin\n\nShape \"sphere\" \"float radius\" x", "line 3: \"x\" is no value of type"),
        (
            "WorldBegin\nShape \"sphere\" \"radius\" 1",
            "line 2: \"radius\" is no parameter of a type",
        ),
        ("WorldBegin\nTranslate 1 2", "line 2: a number of a transform is missing"),
        ("WorldBegin\nTranslate 1 2 nan", "line 2: a number of a transform is \"nan\""),
        ("WorldBegin\nAttributeEnd", "line 2: ends a block of type Attribute that is not the last"),
        ("WorldBegin\n\"x\"", "line 2: \"x\" where a directive should stand"),
        ("WorldBegin\nShape \"sphere", "line 2: a quotation mark has no other"),
        ("WorldBegin\nShape \"plymesh\"", "line 2: is a plymesh without \"filename\""),
        ("WorldBegin\nShape \"plymesh\" \"string filename\" \"a.ply\"", "needs the file \"a.ply\""),
        (
            "WorldBegin\nShape \"trianglemesh\" \"point3 P\" [1 2]",
            "\"P\" has 2 numbers, no multiple of 3",
        ),
        ("LookAt 0 0 0 0 0 0 0 1 0", "line 1: looks nowhere"),
        ("Rotate 1 0 0 0", "line 1: turns about an axis of no length"),
    ] {
        check_error("a.pbrt", text, want);
    }
}

#[test]
fn files_are_included_and_meshes_read_once() {
    let folder =
        Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("pbrt-{}", std::process::id()));
    fs::create_dir_all(folder.join("geometry")).expect("the folder can be made");
    let put =
        |name: &str, bytes: &[u8]| fs::write(folder.join(name), bytes).expect("it is written");
    let ply = common::binary_ply(&SQUARE, &[&[0, 1, 2, 3]]);
    let mut gz = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut gz, &ply).expect("memory takes all");
    put("geometry/a.ply.gz", &gz.finish().expect("memory takes all"));
    put(
        "geometry/b.pbrt",
        b"Translate 1 0 0\nShape \"plymesh\" \"string filename\" \"geometry/a.ply.gz\"\n",
    );
    let mut hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 2\n".to_vec();
    hdr.extend([128, 128, 128, 129].repeat(4));
    put("sky.hdr", &hdr);
    put(
        "a.pbrt",
        b"WorldBegin\nLightSource \"infinite\" \"string filename\" \"sky.hdr\"\n\
        Include \"geometry/b.pbrt\"\nImport \"geometry/b.pbrt\"\n\
        Shape \"plymesh\" \"string filename\" \"geometry/a.ply.gz\"\n",
    );
    let got = load(&folder.join("a.pbrt"), &Options::default()).unwrap_or_else(|e| panic!("{e}"));
    put("c.pbrt", b"Include \"c.pbrt\"\n");
    let cycle = load(&folder.join("c.pbrt"), &Options::default());
    fs::remove_dir_all(&folder).expect("the folder can be removed");
    let moved = |triangle: [[f32; 3]; 3], by: f32| triangle.map(|[x, y, z]| [x + by, y, z]);
    // What a file imports leaves no trace in the state.
    let want: Vec<_> =
        [1.0, 2.0, 1.0].iter().flat_map(|&by| [moved(LOWER, by), moved(UPPER, by)]).collect();
    assert_eq!(soup(&got), want);
    let environment = got.environment.expect("it has one");
    assert_eq!(environment.projection, Projection::EqualAreaOctahedral);
    let error = cycle.expect_err("it includes itself").to_string();
    assert!(error.contains("files include each other 32 deep"), "{error}");
}
