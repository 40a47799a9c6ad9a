//! Sound files with bytes flipped, cut, repeated and replaced: whatever comes of it is a model or
//! an error. Set `TREELET_SEED` to try other cases.

#![allow(clippy::print_stdout, reason = "the seed is printed")]

mod common;

use std::io::Write;
use std::panic::AssertUnwindSafe;

use common::{SQUARE_OBJ, SQUARE_PLY, binary_ply, binary_stl, square_glb, square_json};
use treelet_import::{Limits, Options, load_bytes};

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
const WORDS: [&str; 20] = [
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
                // A digit for a digit keeps text readable and makes it wrong.
                if let Some(digit) = bytes[at..].iter().position(u8::is_ascii_digit) {
                    bytes[at + digit] = b'0' + random.below(10) as u8;
                }
            }
        }
    }
}

fn corpus() -> Vec<(&'static str, Vec<u8>)> {
    let mut unusual = SQUARE_PLY.replace("ascii", "binary_big_endian").into_bytes();
    unusual.extend([0; 60]);
    let strips = SQUARE_PLY.replace("face 1", "tristrips 1").replace("4 0 1 2 3", "5 0 1 2 -1 3");
    let nodes = r#"{"name":"n","children":[1],"rotation":[0,0,1,0],"camera":0},
        {"mesh":0,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]}"#;
    let extra = r#","cameras":[{"perspective":{"yfov":1}}],"materials":[{"emissiveFactor":[1,1,1],
        "extensions":{"KHR_materials_ior":{"ior":1.3}}}],"animations":[{}]"#;
    let data = format!(r#""uri":"data:;base64,{}","#, "AAAA".repeat(20));
    let obj =
        format!("{SQUARE_OBJ}vn 0 0 1\nusemtl a\nf 1//1 2//1 3//1 4//1\nusemtl b\nf -1 -2 -3\n");
    let star: String = (0..9).map(|i| format!("v {} {} 0\n", i % 3, i * i % 5)).collect();
    let polygon = format!("{star}f 1 2 3 4 5 6 7 8 9\nmtllib x.mtl\n");
    let mut gz = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    let gz = gz.write_all(obj.as_bytes()).and_then(|()| gz.finish()).expect("memory takes all");
    let level = ruzstd::encoding::CompressionLevel::Fastest;
    let zst = ruzstd::encoding::compress_to_vec(obj.as_bytes(), level);
    let face: &[i32] = &[0, 1, 2];
    let quad: &[i32] = &[0, 1, 2, 3];
    vec![
        ("a.ply", SQUARE_PLY.into()),
        ("a.ply", binary_ply(&common::SQUARE, &[face, quad, face])),
        ("a.ply", unusual),
        ("a.ply", strips.into()),
        ("a.stl", common::LOWER_STL.into()),
        ("a.stl", binary_stl(b"solid", &[common::LOWER, common::UPPER])),
        ("a.obj", obj.into()),
        ("a.obj", polygon.into()),
        ("a.glb", square_glb(nodes, extra)),
        ("a.gltf", square_json(nodes, &data, extra).into()),
        ("a.obj.gz", gz),
        ("a.obj.zst", zst),
    ]
}

#[test]
fn damaged_files_end_in_a_model_or_an_error() {
    let seed = std::env::var("TREELET_SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(1);
    let cases = std::env::var("TREELET_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(5000);
    println!("TREELET_SEED={seed} TREELET_CASES={cases}");
    // A small limit, so that no case takes long.
    let limits = Limits { max_bytes: 64 << 20, ..Limits::default() };
    let options = Options { limits, ..Options::default() };
    for (file, (name, sound)) in corpus().into_iter().enumerate() {
        let (mut read, mut refused) = (0, 0);
        for case in 0..cases {
            let mut random = Random(seed ^ (file as u64) << 48 ^ (case as u64) << 16);
            let mut bytes = sound.clone();
            mutate(&mut bytes, &mut random);
            let result =
                std::panic::catch_unwind(AssertUnwindSafe(|| load_bytes(name, &bytes, &options)));
            match result {
                Ok(Ok(model)) => {
                    read += 1;
                    check_references(&model);
                }
                Ok(Err(error)) => {
                    refused += 1;
                    let text = error.to_string();
                    assert!(text.starts_with(name) && text.len() < 1000, "{text}");
                }
                Err(_) => {
                    panic!("{name} panicked; seed {seed}, file {file}, case {case}: {bytes:?}")
                }
            }
        }
        // If all were refused or none, the cases would test little.
        assert!(read > 0 && refused > 0, "file {file}, {name}: {read} read, {refused} refused");
    }
}

/// What others index by must be in range, whatever the file said.
fn check_references(model: &treelet_model::Model) {
    assert!(model.placements.iter().all(|placement| placement.object < model.objects.len()));
    for part in model.objects.iter().flat_map(|object| &object.parts) {
        assert!(part.material < model.materials.len());
        if let Some(normals) = &part.normals {
            assert_eq!(normals.len(), part.mesh.positions().len());
            assert!(normals.iter().flatten().all(|x| x.abs() <= 1.001));
        }
    }
}
