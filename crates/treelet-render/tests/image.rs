//! The picture of a small box against a committed reference, by eye: colours are compared in CIELAB
//! after a blur over three by three pixels, so that noise and rounding pass and light that is
//! missing, doubled or displaced does not.
//!
//! The reference is the same scene with sixteen times the samples. To renew it after a change that
//! is meant to be seen, run
//!
//! ```text
//! TREELET_RENEW_REFERENCE=1 cargo test --release -p treelet-render --test image
//! ```
//!
//! and look at `tests/reference/box.png` before committing it.

mod common;

use common::{box_camera, box_scene, render};
use std::path::Path;
use treelet_render::{Image, Settings, ToneMap};

const REFERENCE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/reference/box.png");
const RENEW: &str = "TREELET_RENEW_REFERENCE";
const SPP: u32 = 256;
const SPP_REFERENCE: u32 = 4096;

/// Differences (CIE 1976) that nobody minds: 2.3 is said to be just noticeable side by side.
const MEAN_MAX: f32 = 0.9;
const PERCENTILE_99_MAX: f32 = 4.5;

#[test]
fn box_looks_like_its_reference() {
    let settings = Settings { width: 96, height: 64, ..Settings::softened() };
    let renew = std::env::var_os(RENEW).is_some();
    let spp = if renew { SPP_REFERENCE } else { SPP };
    let (film, _) = render(&box_scene(), &box_camera(), settings, spp);
    let image = film.to_image(&ToneMap::default()).unwrap();
    if renew {
        std::fs::write(REFERENCE, image.encode_png().unwrap()).unwrap();
        return;
    }
    let (width, height, reference) = read(Path::new(REFERENCE));
    assert_eq!((width, height), (image.width(), image.height()));
    let (mean, percentile_99) = difference(&image, &reference);
    assert!(
        mean < MEAN_MAX && percentile_99 < PERCENTILE_99_MAX,
        "mean difference {mean} (at most {MEAN_MAX}), 99th percentile {percentile_99} (at most \
         {PERCENTILE_99_MAX}); if the change is meant, renew the reference with {RENEW}=1"
    );
}

/// The metric sees what it should: a shifted, a darker and a tinted picture fail.
#[test]
fn the_metric_is_not_blind() {
    let (width, height, reference) = read(Path::new(REFERENCE));
    let changed = |change: &dyn Fn(usize) -> [u8; 3]| {
        let mut image = Image::filled(width, height, [0; 3]).unwrap();
        image.pixels_mut().iter_mut().enumerate().for_each(|(i, pixel)| *pixel = change(i));
        difference(&image, &reference)
    };
    assert_eq!(changed(&|i| reference[i]), (0.0, 0.0));
    let (_, shifted) = changed(&|i| reference[i.saturating_sub(2)]);
    assert!(shifted > PERCENTILE_99_MAX, "{shifted}");
    let (darker, _) = changed(&|i| reference[i].map(|c| (f32::from(c) * 0.95) as u8));
    assert!(darker > MEAN_MAX, "{darker}");
    let (tinted, _) = changed(&|i| [reference[i][0], reference[i][1], reference[i][2] / 8 * 7]);
    assert!(tinted > MEAN_MAX, "{tinted}");
}

/// The mean and the 99th percentile of the differences.
fn difference(image: &Image, reference: &[[u8; 3]]) -> (f32, f32) {
    let (width, height) = (image.width() as usize, image.height() as usize);
    let a = blurred_lab(image.pixels(), width, height);
    let b = blurred_lab(reference, width, height);
    let mut apart: Vec<f32> = a
        .iter()
        .zip(&b)
        .map(|(a, b)| (0..3).map(|c| (a[c] - b[c]) * (a[c] - b[c])).sum::<f32>().sqrt())
        .collect();
    apart.sort_by(f32::total_cmp);
    let mean = apart.iter().sum::<f32>() / apart.len() as f32;
    (mean, apart[apart.len() * 99 / 100])
}

/// CIELAB under D65 of the means over three by three pixels, taken in linear light.
fn blurred_lab(pixels: &[[u8; 3]], width: usize, height: usize) -> Vec<[f32; 3]> {
    let linear: Vec<[f32; 3]> = pixels.iter().map(|p| p.map(from_srgb)).collect();
    let mean = |x: usize, y: usize| {
        let mut sum = [0.0; 3];
        for dy in 0..3 {
            for dx in 0..3 {
                let column = (x + dx).saturating_sub(1).min(width - 1);
                let row = (y + dy).saturating_sub(1).min(height - 1);
                (0..3).for_each(|c| sum[c] += linear[row * width + column][c] / 9.0);
            }
        }
        sum
    };
    (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| lab(mean(x, y)))
        .collect()
}

fn from_srgb(code: u8) -> f32 {
    let c = f32::from(code) / 255.0;
    if c <= 0.040_45 { c / 12.92 } else { libm::powf((c + 0.055) / 1.055, 2.4) }
}

/// CIE 15:2004, from linear Rec. 709, white D65.
fn lab([r, g, b]: [f32; 3]) -> [f32; 3] {
    let f = |t: f32| {
        if t > 216.0 / 24389.0 { libm::cbrtf(t) } else { (24389.0 / 27.0 * t + 16.0) / 116.0 }
    };
    let x = f((0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.9505);
    let y = f(0.2126 * r + 0.7152 * g + 0.0722 * b);
    let z = f((0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.0888);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn read(path: &Path) -> (u32, u32, Vec<[u8; 3]>) {
    let file = std::fs::File::open(path).unwrap_or_else(|error| {
        panic!("{} cannot be read ({error}); make it with {RENEW}=1", path.display())
    });
    let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgb, png::BitDepth::Eight));
    let pixels = bytes.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
    (info.width, info.height, pixels)
}
