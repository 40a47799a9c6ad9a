//! The white furnace: in a room of radiance 1 everywhere, what neither absorbs nor emits cannot be
//! seen. Every material that claims to lose nothing is put there and the picture must be 1.
//!
//! Allowed are the error bar of the mean (five standard errors over passes) and, for lobes whose
//! lost energy comes back by a table, the error of the table.

mod common;

use common::{camera, exact, lambert, model, part, placed, sphere};
use treelet::Cancel;
use treelet_model::{Material, Sky};
use treelet_render::{Renderer, Settings, Strategy};

/// Interpolation and quadrature of the albedo tables.
const TABLE: f64 = 0.004;
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
    let (mean, error) = furnace(material, settings, 48);
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
    for ior in [1.0, 1.5, 2.4] {
        let glass =
            Material { base_color: [1.0; 3], transmission: 1.0, ior, ..Material::default() };
        // Total reflection keeps light for long between the facets.
        let settings = Settings { max_bounces: 2000, ..exact(32, 32) };
        expect_one(&format!("glass of {ior}"), glass, settings, ROUNDING);
    }
}

#[test]
fn mixtures_lose_nothing() {
    let mixed = Material {
        base_color: [1.0; 3],
        metallic: 0.4,
        transmission: 0.5,
        roughness: 0.5,
        ..Material::default()
    };
    expect_one("mixture", mixed.clone(), exact(32, 32), TABLE);
    let softened = Settings { regularize: true, ..exact(32, 32) };
    expect_one("mixture, regularised", mixed, softened, TABLE);
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
