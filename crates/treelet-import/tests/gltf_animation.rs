//! What moves in a glTF file: nodes, skins and morph targets, against values worked out by hand.

mod common;

use common::doc::Doc;
use common::{LOWER, check_error, model, read};
use treelet::math::Affine;
use treelet::{BuildOptions, Ray};
use treelet_model::{Changes, LightKind, Model, PlacedModel, PoseError};

/// A quarter turn about z.
const QUARTER: [f32; 4] =
    [0.0, 0.0, core::f32::consts::FRAC_1_SQRT_2, core::f32::consts::FRAC_1_SQRT_2];
const REST: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

#[track_caller]
fn close(got: &[[f32; 3]], want: &[[f32; 3]]) {
    let near = |a: &[f32; 3], b: &[f32; 3]| (0..3).all(|k| (a[k] - b[k]).abs() < 1e-6);
    let all = got.len() == want.len() && got.iter().zip(want).all(|(a, b)| near(a, b));
    assert!(all, "{got:?}\nis not\n{want:?}");
}

/// The vertices of an object as it is now.
fn shape(model: &Model, object: usize) -> &[[f32; 3]] {
    model.objects[object].parts[0].mesh.positions()
}

/// A node turns; a mesh, a camera and a light hang on it, and another mesh does not.
fn turning() -> Vec<u8> {
    let mut doc = Doc::default();
    let (mesh, times) = (doc.vec3(&LOWER), doc.scalars(&[0.0, 2.0]));
    let turns = doc.vec4(&[REST, QUARTER]);
    doc.glb(&format!(
        r#""nodes":[{{"children":[1,2,3],"translation":[0,0,5]}},{{"mesh":0,"translation":[1,0,0]}},
        {{"camera":0,"translation":[0,2,0]}},{{"translation":[3,0,0],"extensions":
        {{"KHR_lights_punctual":{{"light":0}}}}}},{{"mesh":0,"translation":[0,0,9]}}],
        "scenes":[{{"nodes":[0,4]}}],"cameras":[{{"perspective":{{"yfov":1}}}}],
        "extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"point"}}]}}}},
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":{mesh}}}}}]}}],
        "animations":[{{"name":"turn","channels":[{{"sampler":0,"target":{{"node":0,
        "path":"rotation"}}}}],"samplers":[{{"input":{times},"output":{turns}}}]}}]"#
    ))
}

#[test]
fn nodes_carry_what_hangs_on_them() {
    let mut model = model("a.glb", turning());
    assert!(model.warnings.is_empty(), "{:?}", model.warnings);
    let rest = model.clone();
    // Half way, which is an eighth of a turn.
    let changes = model.pose(Some(0), 1.0).expect("there is a clip");
    let want = Changes { placements: 1, cameras: 1, lights: 1, ..Changes::default() };
    assert_eq!(changes, want);
    let h = core::f32::consts::FRAC_1_SQRT_2;
    let place = |map: Affine| map.0.map(|row| row[3]);
    let LightKind::Point { position, .. } = model.lights[0].kind else { panic!("a point") };
    let places = [
        place(model.placements[0].world_from_object),
        place(model.cameras[0].world_from_camera),
        position,
    ];
    close(&places, &[[h, h, 5.0], [-2.0 * h, 2.0 * h, 5.0], [3.0 * h, 3.0 * h, 5.0]]);
    close(&[model.placements[0].world_from_object.vector([1.0, 0.0, 0.0])], &[[h, h, 0.0]]);
    // The same time changes nothing; without a clip all is as the file has it, bit by bit.
    assert_eq!(model.pose(Some(0), 1.0), Ok(Changes::default()));
    model.pose(None, 7.0).expect("no clip is needed");
    for (a, b) in model.placements.iter().zip(&rest.placements) {
        assert_eq!(a.world_from_object, b.world_from_object);
    }
    assert_eq!((&model.cameras, &model.lights), (&rest.cameras, &rest.lights));
    assert_eq!(model.pose(Some(1), 0.0), Err(PoseError::NoSuchClip { clip: 1, clips: 1 }));
}

#[test]
fn only_what_moved_is_built_anew() {
    let mut model = model("a.glb", turning());
    let options = BuildOptions::default();
    let first = PlacedModel::build(&model, &options).expect("it is sound");
    let bounds = model.clip_bounds(0, 16).expect("there is a clip");
    // The box of the triangle turns from (1..2, 0..1) to (-1..0, 1..2), its corner (2, 1) over (0, 2.236).
    let [right, top, front] = bounds.hi;
    close(&[bounds.lo, [right, 2.0, front]], &[[-1.0, 0.0, 5.0], [2.0, 2.0, 9.0]]);
    assert!(top > 2.2 && top < 2.237, "{bounds:?}");
    model.pose(None, 0.0).expect("no clip is needed");
    let changes = model.pose(Some(0), 2.0).expect("there is a clip");
    let updated = first.updated(&model, &changes, &options).expect("it is sound");
    let fresh = PlacedModel::build(&model, &options).expect("it is sound");
    for (x, y, hit) in [(-0.3, 1.6, true), (1.6, 0.3, false), (0.6, 0.3, true)] {
        let ray = Ray::new([x, y, 0.0], [0.0, 0.0, 1.0]);
        let found = updated.scene.closest(&ray);
        assert_eq!((found, found.is_some()), (fresh.scene.closest(&ray), hit), "{x} {y}");
    }
    // What is not told to have changed is not built: here the old place is still there.
    let kept = first.updated(&model, &Changes::default(), &options).expect("it is sound");
    assert!(kept.scene.closest(&Ray::new([1.6, 0.3, 0.0], [0.0, 0.0, 1.0])).is_some());
}

/// A ribbon of two triangles along y, whose upper end follows the second of two joints. That turns by a
/// quarter in a second.
fn ribbon(joints: &[[u8; 4]], weights: &[[f32; 4]], skin: &str, node: &str) -> Vec<u8> {
    let mut doc = Doc::default();
    let mesh = doc.vec3(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [1.0, 2.0, 0.0]]);
    let normals = doc.vec3(&[[0.0, 0.0, 1.0]; 4]);
    let (joints, weights) = (doc.joints(joints), doc.vec4(weights));
    // The second joint stands at y = 1.
    let bind = doc.translations(&[[0.0; 3], [0.0, -1.0, 0.0]]);
    let times = doc.scalars(&[0.0, 1.0]);
    let turns = doc.vec4(&[REST, QUARTER]);
    let skin = skin.replace("BIND", &bind.to_string());
    doc.glb(&format!(
        r#""nodes":[{{"mesh":0,"translation":[70,80,90]{node}}},
        {{"children":[2],"translation":[10,0,0]}},{{"translation":[0,1,0]}}],
        "scenes":[{{"nodes":[0,1]}}],"skins":[{skin}],
        "meshes":[{{"primitives":[{{"mode":5,"attributes":{{"POSITION":{mesh},"NORMAL":{normals},
        "JOINTS_0":{joints},"WEIGHTS_0":{weights}}}}}]}}],
        "animations":[{{"channels":[{{"sampler":0,"target":{{"node":2,"path":"rotation"}}}}],
        "samplers":[{{"input":{times},"output":{turns}}}]}}]"#
    ))
}

const JOINTS: [[u8; 4]; 4] = [[0, 1, 0, 0]; 4];
const WEIGHTS: [[f32; 4]; 4] =
    [[1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0]];
const SKIN: &str = r#"{"joints":[1,2],"inverseBindMatrices":BIND}"#;

#[test]
fn skins_bend_meshes() {
    let mut model = model("a.glb", ribbon(&JOINTS, &WEIGHTS, SKIN, r#","skin":0"#));
    assert!(model.warnings.is_empty(), "{:?}", model.warnings);
    // At rest the joints move all by ten; where the mesh's own node stands does not count.
    assert_eq!(model.placements[0].world_from_object, Affine::IDENTITY);
    let (low, left) = ([[10.0, 0.0, 0.0], [11.0, 0.0, 0.0]], [10.0, 2.0, 0.0]);
    close(shape(&model, 0), &[low[0], low[1], left, [11.0, 2.0, 0.0]]);
    // Bent, the upper end turns about (10, 1): up goes left, right goes up.
    let changes = model.pose(Some(0), 1.0).expect("there is a clip");
    assert_eq!((changes.placements, changes.objects, changes.triangles), (0, vec![0], 2));
    // The last vertex is drawn half to (9, 2), half to (11, 2).
    close(shape(&model, 0), &[low[0], low[1], [9.0, 1.0, 0.0], [10.0, 2.0, 0.0]]);
    close(model.objects[0].parts[0].normals.as_deref().expect("it has"), &[[0.0, 0.0, 1.0]; 4]);
    model.pose(None, 0.0).expect("no clip is needed");
    close(shape(&model, 0), &[low[0], low[1], left, [11.0, 2.0, 0.0]]);
}

#[test]
fn odd_skins_are_named() {
    let rigid = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [1.0, 2.0, 0.0]];
    let stands = "1 skin is not used, and meshes stand as their nodes place them: skin 0 ";
    for (skin, why) in [
        (r#"{"joints":[1,77]}"#, "has node 77 as a joint, which is not in the scene."),
        (r#"{"joints":[]}"#, "has no joints."),
        (r#"{"joints":[1,2,0],"inverseBindMatrices":BIND}"#, "has 2 matrices for 3 joints."),
    ] {
        let got = model("a.glb", ribbon(&JOINTS, &WEIGHTS, skin, r#","skin":0"#));
        assert_eq!(got.warnings, [format!("{stands}{why}")]);
        assert_eq!(shape(&got, 0), rigid);
        let place = got.placements[0].world_from_object.0.map(|row| row[3]);
        assert_eq!(place, [70.0, 80.0, 90.0]);
    }
    // Joints that are not there do not pull; weights are taken against their sum.
    let weights =
        [[0.5, 0.25, 0.0, 0.0], [f32::NAN, 2.0, -1.0, 0.0], [0.0; 4], [0.1, 0.1, 0.0, 0.0]];
    let joints = [[0, 9, 0, 0], [0, 0, 0, 0], [0, 1, 0, 0], [0, 1, 0, 0]];
    let got = model("a.glb", ribbon(&joints, &weights, SKIN, r#","skin":0"#));
    // The third vertex follows its node, as no joint pulls at it.
    let want = [[10.0, 0.0, 0.0], [11.0, 0.0, 0.0], [70.0, 82.0, 90.0], [11.0, 2.0, 0.0]];
    close(shape(&got, 0), &want);
    let mended = "2 weights of joints are below zero or no number; taken as 0.";
    assert_eq!(got.warnings, [mended, "1 weight names joints that their skin lacks; taken as 0."]);
    // A number past the end of the list is an error, as for meshes.
    let bytes = ribbon(&JOINTS, &WEIGHTS, SKIN, r#","skin":7"#);
    check_error("a.glb", bytes, "node 0: names skin 7 of 1");
    let bytes = ribbon(&JOINTS[..3], &WEIGHTS, SKIN, r#","skin":0"#);
    check_error("a.glb", bytes, "mesh 0, primitive 0: has 3 joints for 4 vertices");
    let cycle = ribbon(&JOINTS, &WEIGHTS, SKIN, r#","skin":0,"children":[0]"#);
    check_error("a.glb", cycle, "is its own ancestor");
}

/// A triangle of two targets, placed by the nodes; `clip` is a channel of weights over two seconds.
fn morphing(nodes: &str, interpolation: &str, weights: &[f32]) -> Vec<u8> {
    let mut doc = Doc::default();
    let (mesh, up) = (doc.vec3(&LOWER), doc.vec3(&[[0.0, 0.0, 4.0]; 3]));
    let corner = doc.sparse_vec3(3, 2, [8.0, 0.0, 0.0]);
    let times = doc.scalars(&[0.0, 2.0]);
    let weights = doc.scalars(weights);
    doc.glb(&format!(
        r#""nodes":[{nodes}],"meshes":[{{"weights":[0.25,0],"primitives":[{{"attributes":
        {{"POSITION":{mesh}}},"targets":[{{"POSITION":{up}}},{{"POSITION":{corner}}}]}}]}}],
        "animations":[{{"channels":[{{"sampler":0,"target":{{"node":0,"path":"weights"}}}}],
        "samplers":[{{"input":{times},"output":{weights},"interpolation":"{interpolation}"}}]}}]"#
    ))
}

/// The triangle with these weights.
fn morphed(up: f32, corner: f32) -> [[f32; 3]; 3] {
    let [a, b, c] = LOWER.map(|[x, y, _]| [x, y, 4.0 * up]);
    [a, b, [c[0] + 8.0 * corner, c[1], c[2]]]
}

#[test]
fn targets_are_weighed() {
    let nodes = r#"{"mesh":0},{"mesh":0,"weights":[1,0.5]},{"mesh":0},{"mesh":0}"#;
    let mut model = model("a.glb", morphing(nodes, "LINEAR", &[0.0, 0.0, 1.0, 0.5]));
    assert!(model.warnings.is_empty(), "{:?}", model.warnings);
    // The first is played, the second has weights of its own, the others share the mesh's.
    let objects: Vec<usize> = model.placements.iter().map(|placement| placement.object).collect();
    assert_eq!(objects, [0, 1, 2, 2]);
    let usual = morphed(0.25, 0.0);
    for (object, want) in [usual, morphed(1.0, 0.5), usual].iter().enumerate() {
        close(shape(&model, object), want);
    }
    let changes = model.pose(Some(0), 1.5).expect("there is a clip");
    assert_eq!((changes.objects, changes.parts, changes.triangles), (vec![0], 1, 1));
    for (object, want) in [morphed(0.75, 0.375), morphed(1.0, 0.5), usual].iter().enumerate() {
        close(shape(&model, object), want);
    }
    // Steps hold the earlier key; cubics without slopes ease in and out.
    let mut steps =
        common::model("a.glb", morphing(r#"{"mesh":0}"#, "STEP", &[0.0, 0.0, 1.0, 0.5]));
    steps.pose(Some(0), 1.9).expect("there is a clip");
    close(shape(&steps, 0), &morphed(0.0, 0.0));
    let keys = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.5, 0.0, 0.0];
    let mut cubic = common::model("a.glb", morphing(r#"{"mesh":0}"#, "CUBICSPLINE", &keys));
    cubic.pose(Some(0), 0.5).expect("there is a clip");
    // 3 s^2 - 2 s^3 at a quarter.
    close(shape(&cubic, 0), &morphed(0.15625, 0.078125));
}

#[test]
fn channels_that_say_nothing_are_left_out() {
    let channel = |times: &[f32], values: &[[f32; 3]], node: &str, target: &str| {
        let mut doc = Doc::default();
        let (mesh, times, values) = (doc.vec3(&LOWER), doc.scalars(times), doc.vec3(values));
        let bytes = doc.glb(&format!(
            r#""nodes":[{node}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":{mesh}}}}}]}}],
            "animations":[{{"channels":[{{"sampler":0,"target":{{{target}}}}}],
            "samplers":[{{"input":{times},"output":{values}}}]}}]"#
        ));
        let mut model = model("a.glb", bytes);
        model.pose(Some(0), 0.5).expect("there is a clip");
        (model.animations[0].channels.len(), model.warnings.len())
    };
    let (node, target) = (r#"{"mesh":0}"#, r#""node":0,"path":"translation""#);
    let two = [[1.0; 3]; 2];
    assert_eq!(channel(&[0.0, 1.0], &two, node, target), (1, 0));
    let left_out = (0, 1);
    assert_eq!(channel(&[1.0, 0.0], &two, node, target), left_out, "times fall");
    assert_eq!(channel(&[0.0, f32::NAN], &two, node, target), left_out);
    assert_eq!(channel(&[0.0, f32::INFINITY], &two, node, target), left_out);
    assert_eq!(channel(&[], &[], node, target), left_out, "no keys");
    assert_eq!(channel(&[0.0], &two, node, target), left_out, "too many values");
    assert_eq!(channel(&[0.0, 1.0], &[[f32::NAN; 3]; 2], node, target), left_out);
    assert_eq!(channel(&[0.0, 1.0], &two, node, r#""node":9,"path":"scale""#), left_out);
    assert_eq!(channel(&[0.0, 1.0], &two, node, r#""path":"pointer""#), left_out);
    let matrix = r#"{"mesh":0,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]}"#;
    assert_eq!(channel(&[0.0, 1.0], &two, matrix, target), left_out, "a matrix has no parts");
}

#[test]
fn shapes_without_end_are_refused() {
    // A few bytes of nodes, each with a large mesh of its own: more than the bytes of the file earn.
    let mut doc = Doc::default();
    let mesh = doc.sparse_vec3(600_000, 2, [8.0, 0.0, 0.0]);
    let nodes = [r#"{"mesh":0,"weights":[1]}"#; 9].join(",");
    let bytes = doc.glb(&format!(
        r#""nodes":[{nodes}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":{mesh}}},
        "targets":[{{"POSITION":{mesh}}}]}}]}}]"#
    ));
    let error = read("a.glb", bytes).expect_err("too much").to_string();
    assert!(error.contains("meshes that bend"), "{error}");
}
