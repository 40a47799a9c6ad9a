//! Filtered queries: the first of all hits that the filter accepts, for every builder, level and
//! layout, through instances, and for filters of every kind.

use treelet::build;
use treelet::scene::LayoutChoice;
use treelet::simd::Level;
use treelet::verify;
use treelet::{Affine, BuildOptions, Hit, Mesh, Scene};
use treelet_testkit::awkward;

const SEED: u64 = 0xF117E2;

/// A filter with a name, for messages.
type Named = (&'static str, fn(&Hit) -> bool);

/// Pure functions of hits: of their names, of their place in the triangle, of all at once.
const FILTERS: [Named; 6] = [
    ("all", |_| true),
    ("none", |_| false),
    ("even", |hit| hit.prim.is_multiple_of(2)),
    ("far corner", |hit| hit.u + hit.v > 0.4),
    ("one in seven", |hit| (hit.prim ^ hit.geom.wrapping_mul(5) ^ hit.inst as u32) % 7 == 3),
    ("by t", |hit| hit.t.to_bits() & 4 == 0),
];

fn bits(hit: Option<Hit>) -> Option<[u64; 6]> {
    let bits = |x: f32| u64::from((x + 0.0).to_bits());
    hit.map(|h| [bits(h.t), bits(h.u), bits(h.v), u64::from(h.prim), u64::from(h.geom), h.inst])
}

/// Holds filtered answers against lists of all hits; how many filters refused the first hit.
fn check(name: &str, scene: &Scene, rays: usize) -> u64 {
    let mut refusals = 0;
    for ray in verify::rays(scene, rays, SEED) {
        let all = scene.all(&ray);
        for (filter, accept) in FILTERS {
            let want = all.iter().find(|hit| accept(hit)).copied();
            let got = scene.closest_filtered(&ray, accept);
            assert_eq!(bits(got), bits(want), "{name}, {filter}, seed {SEED:#x}: {ray:?}");
            let any = scene.any_filtered(&ray, accept);
            assert_eq!(any, want.is_some(), "{name}, {filter}, seed {SEED:#x}: {ray:?}");
            refusals += u64::from(want.is_some_and(|hit| hit.id() != all[0].id()));
        }
    }
    refusals
}

#[test]
fn every_builder_filters_like_the_list_of_all() {
    let mut refusals = 0;
    for scene in awkward::all(500) {
        for &builder in build::ALL {
            let options = BuildOptions { builder: Some(builder), ..BuildOptions::default() };
            let mesh = Mesh::new(scene.shape.positions.clone(), scene.shape.triangles.clone());
            let built = Scene::builder().mesh(mesh).build(&options).unwrap();
            refusals += check(&format!("{}, {}", scene.name, builder.info().name), &built, 60);
        }
    }
    assert!(refusals > 1000, "{refusals} refusals test little");
}

#[test]
fn every_level_and_layout_filters_like_the_list_of_all() {
    for scene in awkward::all(500) {
        for &level in Level::ALL.iter().filter(|level| level.is_available()) {
            for &layout in LayoutChoice::ALL {
                let layout = Some(layout);
                let options = BuildOptions { level, layout, ..BuildOptions::default() };
                let mesh = Mesh::new(scene.shape.positions.clone(), scene.shape.triangles.clone());
                let inner = Scene::builder().mesh(mesh.clone()).build(&options).unwrap();
                let turned = Affine::rotation([1.0, 2.0, 3.0], 0.5);
                let outer = Scene::builder()
                    .mesh(mesh)
                    .instance(&inner, turned)
                    .instance(&inner, Affine::IDENTITY)
                    .build(&options);
                check(&format!("{}, {}", scene.name, level.name()), &inner, 60);
                // Some awkward shapes are too large to be turned.
                if let Ok(outer) = outer {
                    check(&format!("{} placed, {}", scene.name, level.name()), &outer, 60);
                }
            }
        }
    }
}
