//! Sound files with bytes flipped, cut, repeated and replaced: whatever comes of it is a model or an
//! error, within the memory that the limits allow, and soon. 100,000 cases a format, from the seed
//! that is printed; set `TREELET_SEED` and `TREELET_CASES` to try others.

#![allow(clippy::print_stdout, reason = "the seed is printed")]

mod common;

use std::io::Write;
use std::panic::AssertUnwindSafe;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use common::doc::Doc;
use common::packing::{EXT, KHR, attributes, packed, sequence};
use common::{SQUARE_OBJ, SQUARE_PLY, binary_ply, binary_stl, le, square_glb, square_json};
use peak_alloc::PeakAlloc;
use treelet_import::{Limits, Options, load_bytes};

/// Counts the bytes that are allocated.
#[global_allocator]
static ALLOCATED: PeakAlloc = PeakAlloc;

/// One format at a time, so that nobody else allocates while a case is measured.
static ALONE: Mutex<()> = Mutex::new(());

/// What a case may spend.
const MAX_BYTES: u64 = 2 << 20;
/// What it may take beside that: decoders' tables and windows, messages.
const BESIDE: usize = 1 << 20;
/// A case that takes longer hangs.
const SECONDS_MAX: u64 = 5;

/// Splitmix64 (Steele, Lea, Flood, OOPSLA 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
}

/// Words that mean much in one format or another.
const WORDS: [&str; 24] = [
    "-1",
    "0",
    "4294967295",
    "18446744073709551615",
    "1e999",
    "nan",
    "-0x1p9",
    "null",
    "{}",
    "[]",
    "\n",
    "\r",
    "\\\n",
    " ",
    "\"",
    "/",
    "#",
    "5121",
    "end_header\n",
    "f 1 2 3 4 5 -1 -2\n",
    "AttributeBegin ",
    "ObjectBegin \"o\" ",
    "Shape \"sphere\" ",
    "[",
];

fn mutate(bytes: &mut Vec<u8>, random: &mut Random) {
    for _ in 0..1 + random.below(4) {
        let at = random.below(bytes.len() + 1);
        let longest = 1 + random.below(24);
        let len = random.below(longest).min(bytes.len() - at);
        match random.below(7) {
            0 if at < bytes.len() => bytes[at] ^= 1 << random.below(8),
            1 => bytes.truncate(at),
            2 => drop(bytes.drain(at..at + len)),
            3 => {
                let piece = bytes[at..at + len].to_vec();
                let to = random.below(bytes.len() + 1);
                bytes.splice(to..to, piece);
            }
            4 => {
                let word = WORDS[random.below(WORDS.len())].bytes();
                bytes.splice(at..at + len, word);
            }
            5 => {
                // A whole word of a binary file.
                let word = [0_u32, 1, 3, 0x7f80_0000, 0x7fc0_0000, u32::MAX][random.below(6)];
                let end = (at + 4).min(bytes.len());
                bytes.splice(at..end, word.to_le_bytes());
            }
            _ => {
                // Digits for a digit keep text readable and make it wrong, or huge.
                if let Some(digit) = bytes[at..].iter().position(u8::is_ascii_digit) {
                    let number = ["0", "1", "7", "30", "900", "30000", "5000000", "900000000"];
                    let number = number[random.below(number.len())].bytes();
                    bytes.splice(at + digit..=at + digit, number);
                }
            }
        }
    }
}

/// Files of the square, or of a triangle, that use what a format has.
fn gltf() -> Vec<(&'static str, Vec<u8>)> {
    let nodes = r#"{"name":"n","children":[1],"rotation":[0,0,1,0],"camera":0,
        "extensions":{"KHR_lights_punctual":{"light":0}}},
        {"mesh":0,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]}"#;
    let extra = r#","cameras":[{"perspective":{"yfov":1}}],"materials":[{"emissiveFactor":[1,1,1],
        "pbrMetallicRoughness":{"baseColorTexture":{"index":0,"extensions":
        {"KHR_texture_transform":{"offset":[1,2]}}}},"extensions":{"KHR_materials_ior":{"ior":1.3}}}],
        "textures":[{"source":0,"sampler":0}],"samplers":[{"wrapS":33071}],"images":[{"uri":
        "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="}],
        "animations":[{"channels":[{"sampler":0,"target":{"node":1,"path":"translation"}}],
        "samplers":[{"input":2,"output":0}]}],
        "extensions":{"KHR_lights_punctual":{"lights":[{"type":"spot","intensity":2}]}}"#;
    let data = format!(r#""uri":"data:;base64,{}","#, "AAAA".repeat(20));
    // A sparse accessor, and an accessor for the times of the clip.
    let sparse = square_json(nodes, &data, extra).replace(
        r#""count":6,"type":"SCALAR"}"#,
        r#""count":6,"type":"SCALAR","sparse":{"count":2,"indices":{"bufferView":1,
        "componentType":5123},"values":{"bufferView":1}}},
        {"bufferView":0,"componentType":5126,"count":4,"type":"SCALAR"}"#,
    );
    let copies = r#"{"mesh":0,"extensions":{"EXT_mesh_gpu_instancing":{"attributes":
        {"TRANSLATION":0,"SCALE":0}}}}"#;
    let elements = le(&[0.25; 60].map(|x: f32| x * 3.0));
    let mut triangles = vec![0xe1, 0xf0, 0x00, 0xfe, 0x0e, 0x00];
    triangles.extend([0; 16]);
    let index = sequence(&[0, 1, 2, 4, 3, 2]);
    let position = r#""componentType":5126,"count":20"#;
    let meshopt = |name, channels, mode, stream: &[u8], stride, count| {
        let packed_positions = attributes(&elements, 12, channels);
        let views = [
            ("ATTRIBUTES", "NONE", 12, 20, &packed_positions[..]),
            (mode, "NONE", stride, count, stream),
        ];
        packed(name, views, position, (if stride == 2 { 5123 } else { 5125 }, count))
    };
    vec![
        ("a.glb", square_glb(nodes, extra)),
        ("a.gltf", sparse.into()),
        ("a.glb", bending()),
        ("a.glb", square_glb(copies, "")),
        ("a.glb", meshopt(EXT, None, "TRIANGLES", &triangles, 2, 12)),
        ("a.glb", meshopt(KHR, Some(&[0, 1, 0x42]), "INDICES", &index, 4, 6)),
    ]
}

/// A triangle that follows two joints and has a morph target, and a clip that moves all of that.
fn bending() -> Vec<u8> {
    let mut doc = Doc::default();
    let mesh = doc.vec3(&common::LOWER);
    let up = doc.sparse_vec3(3, 2, [0.0, 0.0, 1.0]);
    let joints = doc.joints(&[[0, 1, 0, 0]; 3]);
    let weights = doc.vec4(&[[0.5, 0.5, 0.0, 0.0]; 3]);
    let bind = doc.translations(&[[0.0; 3], [0.0, -1.0, 0.0]]);
    let times = doc.scalars(&[0.0, 1.0]);
    let turns = doc.vec4(&[[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0]]);
    let keys = doc.scalars(&[0.0, 0.0, 1.0, 1.0, 0.0, 0.0]);
    doc.glb(&format!(
        r#""nodes":[{{"mesh":0,"skin":0,"weights":[0.5]}},{{"children":[2]}},{{"scale":[1,2,1]}}],
        "skins":[{{"joints":[1,2],"inverseBindMatrices":{bind}}}],"meshes":[{{"primitives":[{{
        "attributes":{{"POSITION":{mesh},"JOINTS_0":{joints},"WEIGHTS_0":{weights}}},
        "targets":[{{"POSITION":{up}}}]}}]}}],"animations":[{{"channels":[
        {{"sampler":0,"target":{{"node":2,"path":"rotation"}}}},
        {{"sampler":1,"target":{{"node":0,"path":"weights"}}}}],"samplers":[
        {{"input":{times},"output":{turns}}},
        {{"input":{times},"output":{keys},"interpolation":"CUBICSPLINE"}}]}}]"#
    ))
}

fn ply() -> Vec<(&'static str, Vec<u8>)> {
    let mut unusual = SQUARE_PLY.replace("ascii", "binary_big_endian").into_bytes();
    unusual.extend([0; 60]);
    let strips = SQUARE_PLY.replace("face 1", "tristrips 1").replace("4 0 1 2 3", "5 0 1 2 -1 3");
    let face: &[i32] = &[0, 1, 2];
    let quad: &[i32] = &[0, 1, 2, 3];
    vec![
        ("a.ply", SQUARE_PLY.into()),
        ("a.ply", binary_ply(&common::SQUARE, &[face, quad, face])),
        ("a.ply", unusual),
        ("a.ply", strips.into()),
    ]
}

fn stl() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("a.stl", common::LOWER_STL.into()),
        ("a.stl", binary_stl(b"solid", &[common::LOWER, common::UPPER])),
    ]
}

fn obj_text() -> String {
    format!(
        "{SQUARE_OBJ}vn 0 0 1\nvt 0 1\nusemtl a\nf 1//1 2//1 3//1 4/1/1\nusemtl b\nf -1 -2 -3\n"
    )
}

fn obj() -> Vec<(&'static str, Vec<u8>)> {
    let star: String = (0..9).map(|i| format!("v {} {} 0\n", i % 3, i * i % 5)).collect();
    let polygon = format!("{star}f 1 2 3 4 5 6 7 8 9\nmtllib x.mtl\n");
    vec![("a.obj", obj_text().into()), ("a.obj", polygon.into())]
}

fn off() -> Vec<(&'static str, Vec<u8>)> {
    let off = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n3 0 1 2 9\n";
    let normals = "NOFF 3 1 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n1 1 0 0 0 1\n3 0 1 2\n";
    vec![("a.off", off.into()), ("a.off", normals.into())]
}

fn pbrt() -> Vec<(&'static str, Vec<u8>)> {
    let scene = "LookAt 0 0 -5 0 0 0 0 1 0 Camera \"perspective\" \"float fov\" 60\nWorldBegin\n\
        LightSource \"point\" \"blackbody I\" 2700\nAttributeBegin\n\
        AreaLightSource \"diffuse\" \"rgb L\" [3 2 1]\nRotate 30 0 0 1\n\
        Shape \"sphere\" \"float zmin\" 0\nAttributeEnd\n\
        Texture \"c\" \"spectrum\" \"checkerboard\" \"rgb tex1\" [1 0 0]\n\
        Material \"diffuse\" \"texture reflectance\" \"c\"\n\
        ObjectBegin \"o\" Shape \"trianglemesh\" \"integer indices\" [0 1 2] \"point3 P\" \
        [0 0 0 1 0 0 1 1 0] ObjectEnd\nObjectInstance \"o\"\n";
    let shapes = "WorldBegin Shape \"disk\" Shape \"bilinearmesh\" \"point3 P\" \
        [0 0 0 1 0 0 0 1 0 1 1 1] Attribute \"shape\" \"float radius\" 2 Scale 1 2 -1 \
        Shape \"sphere\" Material \"conductor\" \"spectrum k\" [400 1 500 2]";
    vec![("a.pbrt", scene.into()), ("a.pbrt", shapes.into())]
}

fn wrapped() -> Vec<(&'static str, Vec<u8>)> {
    let obj = obj_text();
    let mut gz = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    let gz = gz.write_all(obj.as_bytes()).and_then(|()| gz.finish()).expect("memory takes all");
    let level = ruzstd::encoding::CompressionLevel::Fastest;
    let zst = ruzstd::encoding::compress_to_vec(obj.as_bytes(), level);
    vec![("a.obj.gz", gz), ("a.obj.zst", zst)]
}

/// Tries the cases of a format, spread over its files.
fn attack(format: u64, files: Vec<(&'static str, Vec<u8>)>) {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let seed = std::env::var("TREELET_SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(1);
    let cases = std::env::var("TREELET_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(100_000);
    println!("TREELET_SEED={seed} TREELET_CASES={cases}");
    let limits = Limits { max_bytes: MAX_BYTES, ..Limits::default() };
    let options = Options { limits, ..Options::default() };
    let (mut read, mut refused) = (vec![0; files.len()], vec![0; files.len()]);
    for case in 0..cases {
        let file = case % files.len();
        let (name, sound) = &files[file];
        let mut random = Random(seed ^ format << 48 ^ (case as u64) << 16);
        let mut bytes = sound.clone();
        mutate(&mut bytes, &mut random);

        // Read it, and see how much memory that took at the most, and how long.
        let which = || format!("seed {seed}, format {format}, case {case} of {name}: {bytes:?}");
        ALLOCATED.reset_peak_usage();
        let (before, start) = (ALLOCATED.current_usage(), Instant::now());
        let result =
            std::panic::catch_unwind(AssertUnwindSafe(|| load_bytes(name, &bytes, &options)));
        let taken = ALLOCATED.peak_usage().saturating_sub(before);
        assert!(taken <= MAX_BYTES as usize + BESIDE, "{taken} bytes; {}", which());
        assert!(start.elapsed().as_secs() < SECONDS_MAX, "{:?}; {}", start.elapsed(), which());
        match result {
            Ok(Ok(mut model)) => {
                read[file] += 1;
                check_references(&model);
                if let Some(clip) = model.animations.len().checked_sub(1) {
                    assert!(model.pose(Some(clip), 0.5).is_ok(), "{}", which());
                    check_references(&model);
                }
            }
            Ok(Err(error)) => {
                refused[file] += 1;
                let text = error.to_string();
                assert!(text.starts_with(name) && text.len() < 1000, "{text}");
            }
            Err(_) => panic!("panicked; {}", which()),
        }
    }
    // If all were refused or none, the cases would test little.
    assert!(
        read.iter().chain(&refused).all(|&count| count > 0),
        "read {read:?}, refused {refused:?}"
    );
}

#[test]
fn damaged_gltf() {
    attack(0, gltf());
}

#[test]
fn damaged_ply() {
    attack(1, ply());
}

#[test]
fn damaged_stl() {
    attack(2, stl());
}

#[test]
fn damaged_obj() {
    attack(3, obj());
}

#[test]
fn damaged_off() {
    attack(4, off());
}

#[test]
fn damaged_pbrt() {
    attack(5, pbrt());
}

#[test]
fn damaged_wrappers() {
    attack(6, wrapped());
}

/// What others index by must be in range, whatever the file said.
fn check_references(model: &treelet_model::Model) {
    assert!(model.placements.iter().all(|placement| placement.object < model.objects.len()));
    let images = model.images.len();
    let textures = model.materials.iter().flat_map(treelet_model::Material::textures);
    assert!(textures.map(|texture| texture.image).all(|image| image < images));
    assert!(model.environment.as_ref().is_none_or(|environment| environment.image < images));
    for part in model.objects.iter().flat_map(|object| &object.parts) {
        assert!(part.material < model.materials.len());
        let vertices = part.mesh.positions().len();
        assert!(part.uvs.iter().all(|uvs| uvs.len() == vertices));
        assert!(part.colors.as_ref().is_none_or(|colors| colors.len() == vertices));
        assert!(part.tangents.as_ref().is_none_or(|tangents| tangents.len() == vertices));
        if let Some(normals) = &part.normals {
            assert_eq!(normals.len(), vertices);
            assert!(normals.iter().flatten().all(|x| x.abs() <= 1.001));
        }
    }
}
