//! glTF and GLB files, small enough to be seen whole.

mod common;

use base64::Engine;
use common::{
    LOWER, SQUARE, UPPER, check, check_error, glb, le, model, soup, square_glb, square_json,
};

#[test]
fn glb_and_data_uri() {
    let square = [LOWER, UPPER];
    let got = check("a.glb", square_glb(r#"{"mesh":0}"#, ""), &square);
    assert_eq!(got.objects[0].name, "square");
    let mut binary = le(SQUARE.as_flattened());
    binary.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|index| index.to_le_bytes()));
    let padded = base64::engine::general_purpose::STANDARD.encode(&binary);
    for data in [&*padded, padded.trim_end_matches('=')] {
        for head in ["data:application/octet-stream;base64,", "data:;base64,"] {
            let uri = format!(r#""uri":"{head}{data}","#);
            let json = square_json(r#"{"mesh":0}"#, &uri, "");
            check("a.gltf", &json, &square);
            // The content tells, also without a name.
            check("a", format!("\u{feff} \n{json}"), &square);
        }
    }
}

/// A GLB of one primitive over `positions`, with `indices` of a component type.
fn primitive(mode: u32, positions: &[[f32; 3]], indices: Option<(u32, &[u8], usize)>) -> Vec<u8> {
    let mut binary = le(positions.as_flattened());
    let start = binary.len();
    let (kind, bytes, count) = indices.unwrap_or((5121, &[], 0));
    binary.extend(bytes);
    let named = if indices.is_some() { r#","indices":1"# } else { "" };
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"mode":{mode},"attributes":{{"POSITION":0}}{named}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{},"type":"VEC3"}},
                     {{"bufferView":1,"componentType":{kind},"count":{count},"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":{start}}},
                       {{"buffer":0,"byteOffset":{start},"byteLength":{}}}],
        "buffers":[{{"byteLength":{}}}]}}"#,
        positions.len(),
        bytes.len(),
        binary.len()
    );
    glb(&json, &binary)
}

#[test]
fn lists_strips_fans_and_index_types() {
    let [a, b, c, d] = SQUARE;
    check("a.glb", primitive(4, &[a, b, c, a, c, d], None), &[LOWER, UPPER]);
    check("a.glb", primitive(5, &[a, b, d, c], None), &[[a, b, d], [b, c, d]]);
    check("a.glb", primitive(6, &SQUARE, None), &[[b, c, a], [c, d, a]]);
    let bytes = [0, 1, 2, 0, 2, 3];
    let shorts: Vec<u8> = bytes.iter().flat_map(|&i| u16::from(i).to_le_bytes()).collect();
    let words: Vec<u8> = bytes.iter().flat_map(|&i| u32::from(i).to_le_bytes()).collect();
    for (kind, bytes) in [(5121, &bytes[..]), (5123, &shorts), (5125, &words)] {
        check("a.glb", primitive(4, &SQUARE, Some((kind, bytes, 6))), &[LOWER, UPPER]);
    }
    check("a.glb", primitive(5, &SQUARE, Some((5121, &[0, 1, 3, 2], 4))), &[[a, b, d], [b, c, d]]);
    let ragged = check("a.glb", primitive(4, &SQUARE, Some((5121, &bytes[..5], 5))), &[LOWER]);
    assert_eq!(ragged.warnings, ["1 primitive ends inside a triangle; that is left out."]);
    let lines = check("a.glb", primitive(1, &SQUARE, None), &[]);
    assert_eq!(lines.warnings[0], "1 primitive is points or lines; left out.");
    let out = model("a.glb", primitive(4, &SQUARE, Some((5121, &[0, 1, 200], 3))));
    assert_eq!(out.objects[0].parts[0].mesh.triangles(), [[0, 1, 200]]);
}

#[test]
fn interleaved_positions_and_normals() {
    let mut binary = Vec::new();
    for position in SQUARE {
        binary.extend(le(&position));
        binary.extend(le(&[0.0, 0.0, 3.0]));
    }
    let json = r#"{"asset":{"version":"2.0"},"nodes":[{"mesh":0}],
        "meshes":[{"primitives":[{"mode":6,"attributes":{"POSITION":0,"NORMAL":1}}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"},
                     {"bufferView":0,"byteOffset":12,"componentType":5126,"count":4,"type":"VEC3"}],
        "bufferViews":[{"buffer":0,"byteLength":96,"byteStride":24}],
        "buffers":[{"byteLength":96}]}"#;
    let [a, b, c, d] = SQUARE;
    let got = check("a.glb", glb(json, &binary), &[[b, c, a], [c, d, a]]);
    let normals = got.objects[0].parts[0].normals.as_ref().expect("it has normals");
    assert_eq!(normals[..], [[0.0, 0.0, 1.0]; 4]);
}

#[test]
fn nodes_compose() {
    // Half a turn about z, then scaled by two, then moved; the same mesh twice.
    let nodes = r#"{"children":[1,2],"translation":[10,0,0],"scale":[2,2,2]},
        {"mesh":0,"rotation":[0,0,1,0]},
        {"mesh":0,"matrix":[0,1,0,0, -1,0,0,0, 0,0,1,0, 0,0,5,1]}"#;
    let got = model("a.glb", square_glb(nodes, ""));
    assert_eq!((got.objects.len(), got.placements.len()), (1, 2));
    let triangles = soup(&got);
    let half = LOWER.map(|[x, y, _]| [10.0 - 2.0 * x, -2.0 * y, 0.0]);
    let quarter = LOWER.map(|[x, y, _]| [10.0 - 2.0 * y, 2.0 * x, 10.0]);
    assert_eq!((triangles[0], triangles[2]), (half, quarter));
}

#[test]
fn transforms_are_composed_beyond_f32() {
    // A large offset and its reverse, which f32 would round away against the small one.
    let nodes = r#"{"children":[1],"translation":[1e9,0,0]},
        {"children":[2],"translation":[0.25,0,0]},{"mesh":0,"translation":[-1e9,0,0]}"#;
    let got = model("a.glb", square_glb(nodes, ""));
    assert_eq!(got.placements[0].world_from_object.0[0], [1.0, 0.0, 0.0, 0.25]);
}

#[test]
fn cameras_lose_their_scale() {
    let cameras = r#","cameras":[{"type":"perspective","perspective":{"yfov":0.5,"znear":1}},
        {"type":"orthographic","orthographic":{"xmag":1,"ymag":1,"znear":1,"zfar":2}}]"#;
    let nodes = r#"{"mesh":0,"children":[1,2]},
        {"name":"eye","camera":0,"translation":[1,2,3],"scale":[3,3,3]},{"camera":1}"#;
    let got = model("a.glb", square_glb(nodes, cameras));
    let [camera, flat] = &got.cameras[..] else { panic!("{} cameras", got.cameras.len()) };
    assert_eq!(flat.view, treelet_model::View::Orthographic { height: 2.0 });
    assert_eq!((&*camera.name, camera.vertical_fov(1.0)), ("eye", 0.5));
    let rows = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0]];
    assert_eq!(camera.world_from_camera.0, rows);
    assert!(got.warnings.is_empty(), "{:?}", got.warnings);
}

#[test]
fn materials_by_their_factors() {
    let materials = r#","materials":[{"name":"lamp","emissiveFactor":[1,0.5,0],
        "pbrMetallicRoughness":{"baseColorFactor":[0.1,0.2,0.3,1],"roughnessFactor":0.25},
        "extensions":{"KHR_materials_emissive_strength":{"emissiveStrength":4}}},
        {"pbrMetallicRoughness":{"metallicFactor":0},
        "extensions":{"KHR_materials_transmission":{"transmissionFactor":0.75},
                      "KHR_materials_ior":{"ior":1.25}}},
        {"emissiveFactor":[1,1,1],"emissiveTexture":{"index":0}}]"#;
    let got = model("a.glb", square_glb(r#"{"mesh":0}"#, materials));
    let [lamp, glass, screen, default] = &got.materials[..] else { panic!("four materials") };
    assert_eq!((&*lamp.name, lamp.base_color), ("lamp", [0.1, 0.2, 0.3]));
    assert_eq!((lamp.metallic, lamp.roughness, lamp.emission), (1.0, 0.25, [4.0, 2.0, 0.0]));
    assert_eq!((glass.transmission, glass.ior, glass.metallic), (0.75, 1.25, 0.0));
    assert!(!screen.is_emissive(), "the whole screen would glow");
    assert_eq!(*default, treelet_model::Material::default());
    assert_eq!(got.objects[0].parts[0].material, 3);
    assert!(glass.thin_walled, "without a volume it is a sheet");
    let missing = "1 picture is not read, the first because: texture 0 of 0 is named.";
    assert_eq!(got.warnings, [missing]);
}

#[test]
fn what_is_left_out_is_named() {
    let extra = r#","animations":[{}],"skins":[{}],"extensionsUsed":["KHR_lights_punctual",
        "KHR_materials_sheen","VENDOR_x"],"extensionsRequired":["KHR_texture_transform"]"#;
    let got = check("a.glb", square_glb(r#"{"mesh":0}"#, extra), &[LOWER, UPPER]);
    let want = [
        "Extensions are not read: KHR_materials_sheen, VENDOR_x.",
        "1 skin is not used, and meshes stand as their nodes place them: skin 0 has no joints.",
    ];
    assert_eq!(got.warnings, want);
}

#[test]
fn graphs_that_are_no_trees() {
    let own =
        "a.glb: node 0 \"root\": is its own ancestor, as a child of node 1; nodes must form trees";
    check_error("a.glb", square_glb(r#"{"name":"root","children":[1]},{"children":[0]}"#, ""), own);
    check_error("a.glb", square_glb(r#"{"children":[0]}"#, ""), "node 0: is its own ancestor");
    let two = "node 2: has two parents, node 1 and node 0";
    check_error("a.glb", square_glb(r#"{"children":[1,2]},{"children":[2]},{}"#, ""), two);
    check_error("a.glb", square_glb(r#"{"children":[7]}"#, ""), "node 0: names node 7 of 1");
    check_error("a.glb", square_glb(r#"{"mesh":3}"#, ""), "node 0: names mesh 3 of 1");
    let projective = r#"{"mesh":0,"matrix":[1,0,0,1, 0,1,0,0, 0,0,1,0, 0,0,0,1]}"#;
    check_error("a.glb", square_glb(projective, ""), "node 0: has a matrix whose last row");
}

#[test]
fn a_chain_of_a_hundred_thousand_nodes() {
    let last = 99_999;
    let mut nodes: Vec<String> =
        (0..last).map(|i| format!(r#"{{"children":[{}]}}"#, i + 1)).collect();
    nodes.push(r#"{"mesh":0}"#.to_owned());
    check("a.glb", square_glb(&nodes.join(","), ""), &[LOWER, UPPER]);
}

#[test]
fn extensions_that_are_required_and_not_read() {
    for (name, how) in [
        ("KHR_draco_mesh_compression", "gltf-transform/cli copy"),
        ("KHR_texture_basisu", "gltf-transform/cli ktxdecompress"),
        ("EXT_texture_webp", "gltf-transform/cli png"),
        ("VENDOR_mystery", "Blender"),
    ] {
        let extra = format!(r#","extensionsRequired":["{name}"]"#);
        let want =
            format!("a.glb: extensionsRequired: names {name}, which treelet does not read yet; ");
        check_error("a.glb", square_glb(r#"{"mesh":0}"#, &extra), &want);
        check_error("a.glb", square_glb(r#"{"mesh":0}"#, &extra), how);
    }
}
