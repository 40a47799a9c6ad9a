//! `.gz` and `.zst`: round trips, damage, bombs.

mod common;

use std::io::Write;

use common::{LOWER, SQUARE_OBJ, UPPER, check, check_error};
use treelet_import::{Fault, Limits, Options, load_bytes};

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(bytes).and_then(|()| encoder.finish()).expect("memory takes all")
}

fn zstd(bytes: &[u8]) -> Vec<u8> {
    ruzstd::encoding::compress_to_vec(bytes, ruzstd::encoding::CompressionLevel::Fastest)
}

/// Frame of a content that its reader is to ignore.
fn skippable(len: u32) -> Vec<u8> {
    let mut frame = vec![0x53, 0x2a, 0x4d, 0x18];
    frame.extend(len.to_le_bytes());
    frame.extend(vec![7; len as usize]);
    frame
}

#[test]
fn both_come_off() {
    let square = [LOWER, UPPER];
    for name in ["a.obj.gz", "a.obj.zst", "a.obj", "a"] {
        check(name, gzip(SQUARE_OBJ.as_bytes()), &square);
        check(name, zstd(SQUARE_OBJ.as_bytes()), &square);
    }
    // Several members, several frames, frames to skip, at the start too.
    let (one, two) = SQUARE_OBJ.as_bytes().split_at(20);
    check("a.obj", [gzip(one), gzip(two)].concat(), &square);
    let frames = [skippable(0), zstd(one), skippable(5), zstd(two), skippable(3)];
    check("a.obj", frames.concat(), &square);
}

#[test]
fn damage_is_an_error() {
    // Long enough, and irregular enough, that no cut is harmless.
    let text: String = (0..500).map(|i| format!("v {i} {} 0\n", i * i % 71)).collect();
    for (name, packed) in [("gzip", gzip(text.as_bytes())), ("zstd", zstd(text.as_bytes()))] {
        for len in 5..packed.len() {
            check_error("a.obj", &packed[..len], &format!("a.obj: is broken {name} data ("));
        }
    }
    let mut wrong_sum = zstd(text.as_bytes());
    *wrong_sum.last_mut().expect("it is not empty") ^= 1;
    check_error("a.obj", wrong_sum, "its checksum does not match");
}

#[test]
fn twice_is_once_too_often() {
    let packed = gzip(&zstd(SQUARE_OBJ.as_bytes()));
    check_error("a.obj", packed, "is compressed twice, as compression bombs are");
}

#[test]
fn bombs_stop_early() {
    // 100 MiB of zeros, packed about a thousand to one.
    let zeros = vec![0; 100 << 20];
    let (bomb, bound) = (gzip(&zeros), Limits::default().max_ratio);
    let error = load_bytes("a.ply", &bomb, &Options::default()).expect_err("it is a bomb");
    assert!(matches!(error.fault, Fault::Bomb { ratio, .. } if ratio == bound), "{error}");
    check_error("a.ply", &bomb, "unpacks to more than 256 times its");

    // With the ratio allowed it is just no PLY.
    let limits = Limits { max_ratio: 2000, ..Limits::default() };
    let options = Options { limits, ..Options::default() };
    let error = load_bytes("a.ply", &bomb, &options).expect_err("it is no PLY");
    assert!(matches!(error.fault, Fault::Broken { .. }), "{error}");

    // The absolute limit binds whatever the ratio.
    let limits = Limits { max_bytes: 1 << 20, max_ratio: u64::MAX };
    let options = Options { limits, ..Options::default() };
    let error = load_bytes("a.ply", &bomb, &options).expect_err("it is too big");
    assert!(matches!(error.fault, Fault::TooBig { .. }), "{error}");
}
