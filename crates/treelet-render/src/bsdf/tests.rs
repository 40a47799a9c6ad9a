//! Every kind of surface, by itself: samples follow densities, light is neither made nor lost, and
//! both directions see each other alike.

use super::{Albedos, Bsdf, Factors, Lobes, Tables};
use crate::sampler::Sampler;
use core::f32::consts::TAU;
use treelet_model::Material;

/// White materials of every kind, with what they may lose; what they may gain is the tables' error.
fn whites() -> Vec<(&'static str, Material, f64)> {
    let white = [1.0; 3];
    let mut all = vec![
        ("diffuse", Material::diffuse(white), 1e-3),
        ("coated", Material::coated_diffuse(white, 0.5, 1.5), 4e-3),
        (
            "half specular",
            Material { specular: 0.5, ..Material::coated_diffuse(white, 0.3, 1.5) },
            4e-3,
        ),
        ("metal", Material::metal(white, 0.6), 4e-3),
        ("rough metal", Material::metal(white, 1.0), 4e-3),
        ("glass", Material::dielectric(1.5, 0.4), 6e-3),
        ("very rough glass", Material::dielectric(1.5, 1.0), 6e-3),
        ("diamond", Material::dielectric(2.4, 0.5), 6e-3),
        ("nothing", Material::dielectric(1.0, 0.5), 6e-3),
        ("next to nothing", Material::dielectric(1.05, 0.3), 6e-3),
        ("pane", Material { thin_walled: true, ..Material::dielectric(1.5, 0.5) }, 6e-3),
        (
            "mixture",
            Material {
                metallic: 0.4,
                transmission: 0.5,
                roughness: 0.5,
                base_color: white,
                ..Material::default()
            },
            6e-3,
        ),
    ];
    let coat =
        |material: Material| Material { clear_coat: 1.0, clear_coat_roughness: 0.3, ..material };
    all.push(("clear coat on diffuse", coat(Material::diffuse(white)), 4e-3));
    all.push(("clear coat on metal", coat(Material::metal(white, 0.5)), 0.1));
    all.push(("clear coat on glass", coat(Material::dielectric(1.5, 0.5)), 0.1));
    all
}

fn tables(material: &Material) -> Tables {
    Tables::new(material, 0.0, &mut Albedos::default())
}

fn lobes(material: &Material, tables: &Tables) -> Lobes {
    let factors = Factors {
        base_color: material.base_color,
        metallic: material.metallic,
        roughness: material.roughness,
        transmission: material.transmission,
        specular: [material.specular; 3],
        clear_coat: material.clear_coat,
        clear_coat_roughness: material.clear_coat_roughness,
        thin_walled: material.thin_walled,
    };
    Lobes::new(tables, &factors)
}

fn direction(cos: f32, phi: f32) -> [f32; 3] {
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    [sin * libm::cosf(phi), sin * libm::sinf(phi), cos]
}

/// The mean weight of samples is 1 from every angle and side.
#[test]
fn white_surfaces_lose_nothing() {
    for (name, material, slack) in whites() {
        let tables = tables(&material);
        for outside in [true, false] {
            let lobes = lobes(&material, &tables);
            let bsdf = Bsdf::new(&tables, &lobes, outside);
            for cos in [0.15, 0.5, 0.95] {
                let wo = direction(cos, 0.3);
                let n = 1 << 14;
                let (mut sum, mut square) = (0.0, 0.0);
                for i in 0..n {
                    let sampler = Sampler::new(21, 0, 0, i);
                    let weight = bsdf
                        .sample(&bsdf.odds(wo), wo, sampler.pair(0)[0], sampler.pair(1))
                        .map_or(0.0, |scattered| f64::from(scattered.weight[1]));
                    sum += weight;
                    square += weight * weight;
                }
                let mean = sum / f64::from(n);
                let error = ((square / f64::from(n) - mean * mean) / f64::from(n)).sqrt();
                let case = format!("{name}, outside {outside}, cos {cos}: {mean} +- {error}");
                assert!(mean < 1.0 + 4.0 * error + slack.min(6e-3), "{case}");
                assert!(mean > 1.0 - 4.0 * error - slack, "{case}");
                assert!(error < 0.02, "{case}");
            }
        }
    }
}

/// Directions are drawn with the density that is told: shares of a coarse grid of the sphere agree.
#[test]
fn samples_follow_their_density() {
    const ROWS: usize = 6;
    const COLUMNS: usize = 6;
    for (name, material, _) in whites() {
        let tables = tables(&material);
        let lobes = lobes(&material, &tables);
        let bsdf = Bsdf::new(&tables, &lobes, true);
        let wo = direction(0.6, 0.3);
        let cell = |w: [f32; 3]| {
            let row = ((w[2] + 1.0) * 0.5 * ROWS as f32) as usize;
            let turn = libm::atan2f(w[1], w[0]) / TAU + 0.5;
            row.min(ROWS - 1) * COLUMNS + ((turn * COLUMNS as f32) as usize).min(COLUMNS - 1)
        };
        let n = 1 << 16;
        let mut drawn = [0.0; ROWS * COLUMNS];
        let mut told = [0.0; ROWS * COLUMNS];
        for i in 0..n {
            let sampler = Sampler::new(33, 0, 0, i);
            if let Some(scattered) =
                bsdf.sample(&bsdf.odds(wo), wo, sampler.pair(0)[0], sampler.pair(1))
                && scattered.pdf > 0.0
            {
                drawn[cell(scattered.wi)] += 1.0 / f64::from(n);
            }
            let [z, turn] = sampler.pair(2);
            let w = direction(2.0 * z - 1.0, TAU * turn);
            let (_, pdf) = bsdf.eval(&bsdf.odds(wo), wo, w);
            told[cell(w)] += f64::from(pdf * 2.0 * TAU) / f64::from(n);
        }
        for (i, (drawn, told)) in drawn.iter().zip(&told).enumerate() {
            // Narrow lobes make the uniform estimate noisy.
            let bar = 0.006 + 0.05 * told;
            assert!((drawn - told).abs() < bar, "{name}, cell {i}: drawn {drawn}, told {told}");
        }
    }
}

/// Light that goes one way goes the other way as well, by the squared index of refraction.
#[test]
fn both_directions_see_each_other_alike() {
    for (name, mut material, _) in whites() {
        material.base_color = [0.9, 0.5, 0.2];
        let tables = tables(&material);
        let lobes = lobes(&material, &tables);
        let [outside, inside] = [true, false].map(|side| Bsdf::new(&tables, &lobes, side));
        let squared = if material.thin_walled { 1.0 } else { material.ior * material.ior };
        let (mut compared, mut passed) = (0, 0);
        for i in 0..400 {
            let sampler = Sampler::new(5, 0, 0, i);
            let ([a, phi], [b, psi]) = (sampler.pair(0), sampler.pair(1));
            let (cos_a, cos_b) = (0.1 + 0.9 * a, 0.1 + 0.9 * b);
            let (first, second) = (direction(cos_a, TAU * phi), direction(cos_b, TAU * psi));
            let (there, _) = outside.eval(&outside.odds(first), first, second);
            let (back, _) = outside.eval(&outside.odds(second), second, first);
            // Without the cosine of the direction that light comes from.
            let same = |a: f32, b: f32| (a - b).abs() <= 2e-3 * (a + b) + 1e-5;
            for c in 0..3 {
                let (there, back) = (there[c] / cos_b, back[c] / cos_a);
                assert!(same(there, back), "{name}, {first:?} {second:?}: {there} {back}");
                compared += 1;
            }

            // Through: `second` below the surface, and seen from there with the normal turned over.
            let flip = |w: [f32; 3]| [w[0], w[1], -w[2]];
            let (there, _) = outside.eval(&outside.odds(first), first, flip(second));
            let (back, _) = inside.eval(&inside.odds(second), second, flip(first));
            for c in 0..3 {
                let (there, back) = (there[c] / cos_b, back[c] / cos_a * squared);
                assert!(same(there, back), "{name} through, {first:?} {second:?}: {there} {back}");
                passed += u32::from(there > 1e-4);
            }
        }
        assert!(compared > 0);
        let lets_through = material.transmission > 0.0 && material.ior > 1.02;
        assert_eq!(passed > 0, lets_through, "{name}: {passed}");
    }
}
