//! The Cornell box with the default settings, unclamped and unsoftened, against a committed reference of
//! many samples: means over blocks must agree within their error bars, in linear light.
//!
//! The bars come from the noise itself: eight renders with seeds of their own give each block's mean and
//! its standard error, and the reference's is smaller by the root of its samples. To renew the reference
//! after a change that is meant to be seen, run
//!
//! ```text
//! TREELET_RENEW_REFERENCE=1 cargo test --release -p treelet-render --test cornell
//! ```

mod common;

use common::{box_camera, box_scene, placed};
use treelet::Cancel;
use treelet_model::{Image, Pixels};
use treelet_render::{Renderer, Settings, encode_exr};

const REFERENCE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/reference/cornell.exr");
const RENEW: &str = "TREELET_RENEW_REFERENCE";

const WIDTH: u32 = 48;
const HEIGHT: u32 = 32;
/// Pixels along the side of a block.
const BLOCK: u32 = 8;
const BLOCKS: usize = (WIDTH / BLOCK * (HEIGHT / BLOCK)) as usize;
const SEEDS: u32 = 8;
const SPP: u32 = 16;
const SPP_REFERENCE: u32 = 4096;
/// Student's t of 7 degrees of freedom is beyond this once in 2,000 times. Seeds are fixed, so what passes
/// once passes always; the largest of 72 was 3.5.
const BARS: f64 = 6.0;
/// A bar is at least this share of the mean: eight renders may agree by luck.
const BAR_LEAST: f64 = 0.004;
/// What is this much is black.
const DARK: f64 = 1e-3;

fn settings(seed: u64) -> Settings {
    Settings { width: WIDTH, height: HEIGHT, seed, ..Settings::default() }
}

/// Means of the blocks of a picture.
fn blocks(pixels: &[[f32; 3]]) -> [[f64; 3]; BLOCKS] {
    let mut sums = [[0.0; 3]; BLOCKS];
    for (index, pixel) in (0..).zip(pixels) {
        let block = index / WIDTH / BLOCK * (WIDTH / BLOCK) + index % WIDTH / BLOCK;
        let sum = &mut sums[block as usize];
        (0..3).for_each(|c| sum[c] += f64::from(pixel[c]) / f64::from(BLOCK * BLOCK));
    }
    sums
}

fn rendered(settings: Settings, spp: u32) -> Vec<[f32; 3]> {
    let model = box_scene();
    let placed = placed(&model);
    let renderer = Renderer::new(&model, &placed, &box_camera(), settings).unwrap();
    let mut film = renderer.film().unwrap();
    for _ in 0..spp {
        renderer.pass(&mut film, &Cancel::new()).unwrap();
    }
    film.means().unwrap()
}

fn reference() -> [[f64; 3]; BLOCKS] {
    let bytes = std::fs::read(REFERENCE)
        .unwrap_or_else(|error| panic!("{REFERENCE}: {error}; make it with {RENEW}=1"));
    let image = Image::decode(&bytes, "cornell.exr", 1 << 20).unwrap();
    assert_eq!((image.width, image.height), (WIDTH, HEIGHT));
    let Pixels::Rgba32F(pixels) = &image.pixels else { panic!("EXR holds light") };
    blocks(&pixels.iter().map(|&[r, g, b, _]| [r, g, b]).collect::<Vec<_>>())
}

/// The largest difference from the reference, in error bars, of the mean of several renders.
fn furthest(renders: &[[[f64; 3]; BLOCKS]], reference: &[[f64; 3]; BLOCKS]) -> f64 {
    let n = renders.len() as f64;
    let mut furthest = 0_f64;
    for block in 0..BLOCKS {
        for c in 0..3 {
            let all = renders.iter().map(|render| render[block][c]);
            let mean = all.clone().sum::<f64>() / n;
            let variance = all.map(|x| (x - mean) * (x - mean)).sum::<f64>() / (n - 1.0) / n;
            let share = f64::from(SEEDS * SPP) / f64::from(SPP_REFERENCE);
            let bar = (variance * (1.0 + share)).sqrt().max(BAR_LEAST * mean + DARK);
            furthest = furthest.max((mean - reference[block][c]).abs() / bar);
        }
    }
    furthest
}

#[test]
fn cornell_box_is_its_reference() {
    if std::env::var_os(RENEW).is_some() {
        let pixels = rendered(settings(1_000), SPP_REFERENCE);
        std::fs::write(REFERENCE, encode_exr(WIDTH, HEIGHT, &pixels, None).unwrap()).unwrap();
        return;
    }
    let reference = reference();
    let renders: Vec<_> =
        (0..SEEDS).map(|seed| blocks(&rendered(settings(seed.into()), SPP))).collect();
    let off = furthest(&renders, &reference);
    assert!(off < BARS, "{off:.1} error bars off; if it is meant, renew with {RENEW}=1");

    // It is not blind: 3 % less light, a channel for another, and one bounce too few are seen.
    let changed = |change: &dyn Fn([f64; 3]) -> [f64; 3]| {
        let renders: Vec<_> = renders.iter().map(|render| render.map(change)).collect();
        furthest(&renders, &reference)
    };
    let darker = changed(&|mean| mean.map(|c| 0.97 * c));
    assert!(darker > BARS, "{darker}");
    let swapped = changed(&|[r, g, b]| [g, r, b]);
    assert!(swapped > BARS, "{swapped}");
    let shallow = |seed: u32| Settings { max_bounces: 4, ..settings(seed.into()) };
    let renders: Vec<_> = (0..SEEDS).map(|seed| blocks(&rendered(shallow(seed), SPP))).collect();
    let off = furthest(&renders, &reference);
    assert!(off > BARS, "{off}");
}
