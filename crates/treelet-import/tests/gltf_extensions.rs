//! What glTF files say beyond plain floats: integers, sparse data, copies, pictures, lights, clips.

mod common;

use common::{
    LOWER, SQUARE, UPPER, check, check_error, glb, le, model, soup, square_glb, square_json,
};
use treelet_import::{Options, load_bytes};
use treelet_model::animation::{Interpolation, Property};
use treelet_model::light::{LightKind, SpotFalloff};
use treelet_model::texture::{ColorSpace, Filtering, Wrap};
use treelet_model::{AlphaMode, Pixels};

#[test]
fn integers_count_as_the_accessor_says() {
    // One triangle of three components a vertex, as bytes or words, padded to four of them.
    let cases: [(u32, bool, &[i32], f32); 6] = [
        (5120, false, &[0, 100, -100], 100.0),
        (5120, true, &[0, 127, -128], 1.0),
        (5121, true, &[0, 255, 0], 1.0),
        (5122, false, &[0, 30_000, -30_000], 30_000.0),
        (5122, true, &[0, 32_767, -32_768], 1.0),
        (5123, false, &[0, 60_000, 0], 60_000.0),
    ];
    for (kind, normalized, values, top) in cases {
        let wide = kind > 5121;
        let mut binary = Vec::new();
        for &value in values {
            for component in [value, 0, value, 0] {
                let word = (component as i16 as u16).to_le_bytes();
                binary.extend(if wide { &word[..] } else { &word[..1] });
            }
        }
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"extensionsRequired":["KHR_mesh_quantization"],
            "nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
            "accessors":[{{"bufferView":0,"componentType":{kind},"normalized":{normalized},
            "count":3,"type":"VEC3"}}],"bufferViews":[{{"buffer":0,"byteLength":{},"byteStride":{}}}],
            "buffers":[{{"byteLength":{}}}]}}"#,
            binary.len(),
            if wide { 8 } else { 4 },
            binary.len()
        );
        let low = if values[2] < 0 { -top } else { 0.0 };
        let want = [[[0.0; 3], [top, 0.0, top], [low, 0.0, low]]];
        check("a.glb", glb(&json, &binary), &want);
    }
}

#[test]
fn sparse_accessors() {
    // Vertex 2 of the square is moved; then a mesh that is nothing but replacements.
    let mut binary = le(SQUARE.as_flattened());
    binary.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|index| index.to_le_bytes()));
    binary.extend([2, 0, 0, 0]);
    binary.extend(le(&[5.0, 6.0, 7.0]));
    let file = |view: &str, place: u8| {
        let mut binary = binary.clone();
        binary[60] = place;
        let json = square_json(r#"{"mesh":0}"#, "", "")
            .replace(
                r#""bufferView":0,"#,
                &format!(
                    r#"{view}"sparse":{{"count":1,"indices":{{"bufferView":2,"componentType":5121}},
                    "values":{{"bufferView":2,"byteOffset":4}}}},"#
                ),
            )
            .replace(
                r#""byteLength":12}]"#,
                r#""byteLength":12},{"buffer":0,"byteOffset":60,"byteLength":16}]"#,
            )
            .replace(r#""byteLength":60}]"#, r#""byteLength":76}]"#);
        glb(&json, &binary)
    };
    let ([a, b, _], [_, _, d]) = (LOWER, UPPER);
    let moved = [5.0, 6.0, 7.0];
    check("a.glb", file(r#""bufferView":0,"#, 2), &[[a, b, moved], [a, moved, d]]);
    let zero = [0.0; 3];
    check("a.glb", file("", 2), &[[zero, zero, moved], [zero, moved, zero]]);
    check_error("a.glb", file("", 9), "accessor 0: replaces element 9 of 4; the file is damaged");
}

#[test]
fn copies_of_a_node() {
    let node = r#"{"mesh":0,"translation":[10,0,0],"extensions":{"EXT_mesh_gpu_instancing":
        {"attributes":{"TRANSLATION":0,"SCALE":0}}}}"#;
    let got = model("a.glb", square_glb(node, ""));
    assert_eq!((got.objects.len(), got.placements.len()), (1, 4));
    // Copy 1 is moved and scaled by (1, 0, 0).
    assert_eq!(soup(&got)[2], LOWER.map(|[x, _, _]| [11.0 + x, 0.0, 0.0]));
    let uneven = node.replace(r#""SCALE":0"#, r#""SCALE":2"#);
    let more = r#","x":0"#;
    let file = square_glb(&uneven, more);
    check_error("a.glb", file, "accessor 2: is named, but there are 2");
}

/// One red pixel as a PNG.
const PIXEL: &str = "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mP8z8DwHwAFBQIAX8jx0gAAAABJRU5ErkJggg==";

#[test]
fn textures_and_how_they_lie() {
    let extra = format!(
        r#","materials":[{{"alphaMode":"MASK","alphaCutoff":0.25,"doubleSided":true,
        "normalTexture":{{"index":1,"scale":0.5}},
        "pbrMetallicRoughness":{{"baseColorTexture":{{"index":0,"texCoord":1,"extensions":
        {{"KHR_texture_transform":{{"offset":[1,2],"rotation":3,"scale":[4,5]}}}}}}}},
        "extensions":{{"KHR_materials_unlit":{{}},"KHR_materials_clearcoat":
        {{"clearcoatFactor":0.5,"clearcoatRoughnessFactor":0.25}},
        "KHR_materials_specular":{{"specularFactor":0.75}}}}}}],
        "textures":[{{"source":0,"sampler":0}},{{"source":0}},{{}}],
        "samplers":[{{"wrapS":33071,"wrapT":33648,"magFilter":9728}}],
        "images":[{{"name":"red","uri":"{PIXEL}"}}]"#
    );
    let got = model("a.glb", square_glb(r#"{"mesh":0}"#, &extra));
    assert_eq!(got.warnings, [""; 0]);
    let [image] = &got.images[..] else { panic!("one picture, not {}", got.images.len()) };
    let Pixels::Rgba8(pixels) = &image.pixels else { panic!("8 bits") };
    assert_eq!((&*image.name, pixels.len(), pixels[0][0]), ("red", 1, 255));
    let material = &got.materials[0];
    let texture = material.base_color_texture.expect("it has a texture");
    assert_eq!((texture.uv_set, texture.color_space), (1, ColorSpace::Srgb));
    assert_eq!((texture.wrap, texture.filter), ([Wrap::Clamp, Wrap::Mirror], Filtering::Nearest));
    let transform = texture.transform;
    assert_eq!(
        (transform.offset, transform.rotation, transform.scale),
        ([1.0, 2.0], 3.0, [4.0, 5.0])
    );
    let normal = material.normal_texture.expect("it has one");
    assert_eq!(
        (normal.color_space, normal.wrap, material.normal_scale),
        (ColorSpace::Linear, [Wrap::Repeat; 2], 0.5)
    );
    assert_eq!(
        (material.alpha, material.double_sided, material.unlit),
        (AlphaMode::Mask { cutoff: 0.25 }, true, true)
    );
    assert_eq!(
        (material.clear_coat, material.clear_coat_roughness, material.specular),
        (0.5, 0.25, 0.75)
    );
    // A texture of another format names the way out.
    let ktx = extra.replace(r#""index":0,"texCoord""#, r#""index":2,"texCoord""#);
    let got = model("a.glb", square_glb(r#"{"mesh":0}"#, &ktx));
    assert!(got.warnings[0].contains("ktxdecompress"), "{:?}", got.warnings);
}

#[test]
fn coordinates_colours_and_tangents() {
    // The same bytes serve as coordinates, colours and tangents.
    let json = square_json(r#"{"mesh":0}"#, "", r#","textures":[{}]"#)
        .replace(r#""POSITION":0"#, r#""POSITION":0,"TEXCOORD_1":2,"COLOR_0":0,"TANGENT":3"#)
        .replace(
            r#""type":"SCALAR"}"#,
            r#""type":"SCALAR"},{"bufferView":0,"componentType":5126,"count":4,"type":"VEC2"},
            {"bufferView":2,"componentType":5126,"count":4,"type":"VEC4"}"#,
        )
        .replace(r#""byteLength":12}]"#, r#""byteLength":12},{"buffer":0,"byteLength":64}]"#)
        .replace(r#""byteLength":60}]"#, r#""byteLength":64}]"#);
    let mut binary = le(SQUARE.as_flattened());
    binary.extend([0_u16, 1, 2, 0, 2, 3, 0, 0].iter().flat_map(|index| index.to_le_bytes()));
    let got = check("a.glb", glb(&json, &binary), &[LOWER, UPPER]);
    let part = &got.objects[0].parts[0];
    assert_eq!(part.uvs[0][..], [[0.0; 2]; 4], "a set that is not there");
    assert_eq!(part.uvs[1][..], [[0.0, 0.0], [0.0, 1.0], [0.0, 0.0], [1.0, 1.0]]);
    let colors = part.colors.as_ref().expect("it has colours");
    assert_eq!(colors[2], [1.0, 1.0, 0.0, 1.0]);
    assert_eq!(part.tangents.as_ref().map(|tangents| tangents.len()), Some(4));
    let few = json.replace(r#""count":4,"type":"VEC2""#, r#""count":3,"type":"VEC2""#);
    check_error("a.glb", glb(&few, &binary), "has 3 texture coordinates for 4 vertices");
}

#[test]
fn lights_stand_where_their_nodes_do() {
    let extra = r#","extensions":{"KHR_lights_punctual":{"lights":[
        {"type":"point","name":"lamp","color":[1,0.5,0],"intensity":4},
        {"type":"directional"},{"type":"spot","spot":{"innerConeAngle":0.25,"outerConeAngle":0.5}},
        {"type":"tube"}]}}"#;
    let light = |node: &str, index: usize| {
        format!(r#"{{{node}"extensions":{{"KHR_lights_punctual":{{"light":{index}}}}}}}"#)
    };
    let nodes = [
        r#"{"mesh":0,"children":[1,2,3,4]}"#.to_owned(),
        light(r#""translation":[1,2,3],"#, 0),
        light(r#""rotation":[1,0,0,0],"#, 1),
        light("", 2),
        light("", 3),
    ];
    let got = model("a.glb", square_glb(&nodes.join(","), extra));
    let kinds: Vec<_> = got.lights.iter().map(|light| light.kind).collect();
    let want = [
        LightKind::Point { position: [1.0, 2.0, 3.0], intensity: [4.0, 2.0, 0.0] },
        LightKind::Directional { direction: [0.0, 0.0, 1.0], irradiance: [1.0; 3] },
        LightKind::Spot {
            position: [0.0; 3],
            direction: [0.0, 0.0, -1.0],
            intensity: [1.0; 3],
            inner_angle: 0.25,
            outer_angle: 0.5,
            falloff: SpotFalloff::Square,
        },
    ];
    assert_eq!(kinds, want);
    assert_eq!(got.lights[0].name, "lamp");
    assert_eq!(got.warnings, ["Lights of unknown kinds or directions are left out."]);
}

#[test]
fn clips_are_kept() {
    let nodes = r#"{"name":"arm","children":[1]},{"mesh":0}"#;
    let extra = r#","animations":[{"name":"wave","channels":[
        {"sampler":0,"target":{"node":1,"path":"translation"}},
        {"sampler":0,"target":{"node":9,"path":"scale"}}],
        "samplers":[{"input":2,"output":0,"interpolation":"STEP"}]}]"#;
    let json = square_json(nodes, "", extra).replace(
        r#""type":"SCALAR"}"#,
        r#""type":"SCALAR"},{"bufferView":0,"componentType":5126,"count":4,"type":"SCALAR"}"#,
    );
    let mut binary = le(SQUARE.as_flattened());
    binary.extend([0; 12]);
    let got = model("a.glb", glb(&json, &binary));
    let [clip] = &got.animations[..] else { panic!("one clip") };
    let [channel] = &clip.channels[..] else { panic!("one channel") };
    assert_eq!((&*clip.name, &*channel.path, channel.node), ("wave", "arm/#1", 1));
    assert_eq!(
        (channel.property, channel.interpolation),
        (Property::Translation, Interpolation::Step)
    );
    assert_eq!(
        (&channel.times[..], &channel.values[..3]),
        (&[0.0, 0.0, 0.0, 1.0][..], &[0.0; 3][..])
    );
    assert!(got.warnings[0].starts_with("1 channel of animations is left out:"));
}

#[test]
fn a_scene_is_chosen() {
    let file = square_glb(r#"{"mesh":0},{"mesh":0,"translation":[5,0,0]}"#, "");
    let text = String::from_utf8_lossy(&file);
    assert!(text.contains(r#""scenes":[{"nodes":[0]}]"#));
    let json = square_json(r#"{"mesh":0},{"mesh":0,"translation":[5,0,0]}"#, "", "").replace(
        r#""scenes":[{"nodes":[0]}]"#,
        r#""scene":1,"scenes":[{"name":"here","nodes":[0]},{"name":"there","nodes":[1]}]"#,
    );
    let mut binary = le(SQUARE.as_flattened());
    binary.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|index| index.to_le_bytes()));
    let bytes = glb(&json, &binary);
    let read = |scene: Option<&str>| {
        let options = Options { scene: scene.map(str::to_owned), ..Options::default() };
        load_bytes("a.glb", &bytes, &options).map(|model| (model.scene, soup(&model)[0][0][0]))
    };
    for (asked, want) in
        [(None, (1, 5.0)), (Some("here"), (0, 0.0)), (Some("1"), (1, 5.0)), (Some("0"), (0, 0.0))]
    {
        assert_eq!(read(asked).ok(), Some(want), "{asked:?}");
    }
    let error = read(Some("nowhere")).expect_err("there is none").to_string();
    assert!(
        error.contains("\"nowhere\" is not one of 2; take a number from 0, or one of here, there"),
        "{error}"
    );
    assert_eq!(model("a.glb", &bytes).scenes, ["here", "there"]);
}
