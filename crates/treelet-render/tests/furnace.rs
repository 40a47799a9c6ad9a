//! The white furnace: in a room of radiance 1 everywhere, what neither absorbs nor emits cannot be
//! seen. Every material that claims to lose nothing is put there and the picture must be 1.
//!
//! Allowed are the error bar of the mean (five standard errors over passes) and, for lobes whose
//! lost energy comes back by a table, the error of the table.

mod common;

use common::{camera, exact, lambert, model, part, placed, sphere};
use treelet::Cancel;
use treelet_model::{AlphaMode, Material, Sky};
use treelet_render::{Renderer, Settings, Strategy};

/// Interpolation and quadrature of the albedo tables.
const TABLE: f64 = 0.004;
/// Light passes rough glass through several such lobes.
const TABLE_TWICE: f64 = 0.008;
/// Rounding of sums.
const ROUNDING: f64 = 5e-4;

/// The mean of the picture and its standard error, from the means of passes.
fn furnace(material: Material, settings: Settings, passes: u32) -> (f64, f64) {
    let mut model = model(vec![part(sphere(12).0, 0)], vec![material]);
    model.sky = Some(Sky::uniform([1.0; 3]));
    let camera = camera([0.0, 0.6, 3.2], [0.0; 3], 0.7);
    let placed = placed(&model);
    let renderer = Renderer::new(&model, &placed, &camera, settings).unwrap();
    let mut film = renderer.film().unwrap();
    let mut means = Vec::new();
    let mut before = 0.0;
    for _ in 0..passes {
        renderer.pass(&mut film, &Cancel::new()).unwrap();
        let sum: f64 = film.sums().as_flattened().iter().map(|&c| f64::from(c)).sum();
        means.push((sum - before) / (film.sums().len() * 3) as f64);
        before = sum;
    }
    let n = means.len() as f64;
    let mean = means.iter().sum::<f64>() / n;
    let variance = means.iter().map(|m| (m - mean) * (m - mean)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

fn expect_one(name: &str, material: Material, settings: Settings, slack: f64) {
    let (mean, error) = furnace(material, settings, 64);
    let strategy = settings.strategy;
    assert!(
        (mean - 1.0).abs() < 5.0 * error + slack,
        "{name}, {strategy:?}: {mean} +- {error}, slack {slack}"
    );
    // A bar so wide that everything passes would prove nothing.
    assert!(error < 0.01, "{name}, {strategy:?}: standard error {error}");
}

const STRATEGIES: [Strategy; 3] = [Strategy::Both, Strategy::Lights, Strategy::Lobes];

#[test]
fn diffuse_loses_nothing() {
    for strategy in STRATEGIES {
        let settings = Settings { strategy, ..exact(32, 32) };
        expect_one("lambert", lambert([1.0; 3]), settings, ROUNDING);
    }
}

#[test]
fn coated_diffuse_loses_nothing() {
    for roughness in [0.25, 0.6, 1.0] {
        for strategy in STRATEGIES {
            let white = Material { base_color: [1.0; 3], roughness, ..Material::default() };
            let settings = Settings { strategy, ..exact(32, 32) };
            expect_one(&format!("coat of roughness {roughness}"), white, settings, TABLE);
        }
    }
    let white = Material { base_color: [1.0; 3], roughness: 0.0, ..Material::default() };
    expect_one("smooth coat", white, exact(32, 32), TABLE);
}

#[test]
fn white_metal_loses_nothing() {
    for roughness in [0.0, 0.3, 0.6, 1.0] {
        let white =
            Material { base_color: [1.0; 3], metallic: 1.0, roughness, ..Material::default() };
        expect_one(&format!("metal of roughness {roughness}"), white, exact(32, 32), TABLE);
    }
}

#[test]
fn clear_glass_loses_nothing() {
    for ior in [1.0, 1.5, 1.8] {
        let glass = Material::dielectric(ior, 0.0);
        // Total reflection keeps light for long between the facets.
        let settings = Settings { max_bounces: 2000, ..exact(32, 32) };
        expect_one(&format!("glass of {ior}"), glass, settings, ROUNDING);
    }
    expect_one("pane", Material::thin_dielectric(1.5), exact(32, 32), ROUNDING);
}

#[test]
fn rough_glass_loses_nothing() {
    for (ior, roughness) in [(1.0, 0.5), (1.5, 0.2), (1.5, 0.5), (1.5, 1.0), (2.0, 0.7)] {
        // Sampling lights alone finds narrow lobes through glass next to never.
        let strategies = if roughness < 1.0 {
            [Strategy::Both, Strategy::Lobes]
        } else {
            [Strategy::Both, Strategy::Lights]
        };
        for strategy in strategies {
            let glass = Material::dielectric(ior, roughness);
            let settings = Settings { max_bounces: 2000, strategy, ..exact(32, 32) };
            let name = format!("glass of {ior}, roughness {roughness}");
            expect_one(&name, glass, settings, TABLE_TWICE);
        }
    }
    let pane = Material { thin_walled: true, ..Material::dielectric(1.5, 0.6) };
    expect_one("rough pane", pane, exact(32, 32), TABLE_TWICE);
}

/// A coat on what shines sideways takes away a little more than it reflects; on a diffuse base or a
/// smooth metal it is exact.
#[test]
fn clear_coats_lose_next_to_nothing() {
    for (base, roughness, slack) in [
        (lambert([1.0; 3]), 0.0, TABLE),
        (lambert([1.0; 3]), 0.7, TABLE),
        (Material::metal([1.0; 3], 0.0), 0.0, TABLE),
        (Material::metal([1.0; 3], 0.6), 0.2, 0.05),
        (Material::coated_diffuse([1.0; 3], 0.4, 1.5), 0.0, 0.02),
    ] {
        let coated = Material { clear_coat: 1.0, clear_coat_roughness: roughness, ..base };
        let name = format!("{} under a coat of roughness {roughness}", coated.metallic);
        expect_one(&name, coated, Settings { max_bounces: 2000, ..exact(32, 32) }, slack);
    }
}

#[test]
fn mixtures_lose_nothing() {
    let mixed = Material {
        base_color: [1.0; 3],
        metallic: 0.4,
        transmission: 0.5,
        roughness: 0.5,
        specular: 0.5,
        ..Material::default()
    };
    expect_one("mixture", mixed.clone(), Settings { max_bounces: 500, ..exact(32, 32) }, TABLE);
    let softened = Settings { regularize: true, max_bounces: 500, ..exact(32, 32) };
    expect_one("mixture, regularised", mixed, softened, TABLE);
}

/// Holes and surfaces that are there by chance change nothing in the furnace.
#[test]
fn alpha_loses_nothing() {
    let half = Material { alpha: AlphaMode::Blend, opacity: 0.5, ..lambert([1.0; 3]) };
    expect_one("half there", half, exact(32, 32), ROUNDING);
    let gone =
        Material { alpha: AlphaMode::Mask { cutoff: 0.6 }, opacity: 0.5, ..lambert([0.0; 3]) };
    let (mean, _) = furnace(gone, exact(32, 32), 2);
    assert!((mean - 1.0).abs() < 1e-6, "a surface that is a hole is seen: {mean}");
}

/// Colour is what is lost: a surface of albedo one half in the furnace shows one half.
#[test]
fn half_white_is_half_as_bright() {
    let black = furnace(lambert([0.0; 3]), exact(32, 32), 48);
    let half = furnace(lambert([0.5; 3]), exact(32, 32), 48);
    // Outside the ball the picture is 1; the ball itself is black, then 0.5.
    let ball = 1.0 - black.0;
    assert!(ball > 0.5, "the ball fills most of the picture: {ball}");
    let shown = 1.0 - 0.5 * ball;
    let bar = 5.0 * (half.1 + black.1) + ROUNDING;
    assert!((half.0 - shown).abs() < bar, "{} instead of {shown} +- {bar}", half.0);
}
