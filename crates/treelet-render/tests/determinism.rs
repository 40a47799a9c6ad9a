//! The same film, bit for bit, for any number of threads and whatever was cancelled on the way.

mod common;

use common::{box_camera, box_scene, placed};
use std::time::Duration;
use treelet::Cancel;
use treelet_render::{Film, RenderError, Renderer, Settings};

const SIZE: Settings = Settings {
    width: 120,
    height: 90,
    max_bounces: 8,
    seed: 7,
    up: 1,
    clamp_indirect: 8.0,
    regularize: true,
    strategy: treelet_render::Strategy::Both,
};

fn bits(film: &Film) -> Vec<u32> {
    film.sums().as_flattened().iter().map(|c| c.to_bits()).collect()
}

#[test]
fn threads_and_cancelled_passes_leave_no_trace() {
    let model = box_scene();
    let placed = placed(&model);
    let renderer = Renderer::new(&model, &placed, &box_camera(), SIZE).unwrap();
    let films = [1, 2, 5].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut film = renderer.film().unwrap();
        for _ in 0..3 {
            let stats = pool.install(|| renderer.pass(&mut film, &Cancel::new())).unwrap();
            assert!(stats.rays >= 120 * 90);
        }
        film
    });
    assert_eq!(bits(&films[0]), bits(&films[1]), "one thread and two");
    assert_eq!(bits(&films[0]), bits(&films[2]), "one thread and five");

    // Cancel in the middle of passes until at least one was caught there.
    let mut film = renderer.film().unwrap();
    let mut caught = 0;
    while film.passes() < 3 {
        let cancel = Cancel::new();
        let raised = cancel.clone();
        let watch = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_micros(500));
            raised.cancel();
        });
        let before = (bits(&film), film.passes());
        if caught < 2 {
            match renderer.pass(&mut film, &cancel) {
                Err(RenderError::Cancelled) => {
                    caught += 1;
                    assert_eq!((bits(&film), film.passes()), before);
                }
                other => assert!(other.is_ok(), "{other:?}"),
            }
        }
        watch.join().unwrap();
        renderer.pass(&mut film, &Cancel::new()).unwrap();
    }
    assert!(caught > 0, "no pass was slow enough to be cancelled");
    assert_eq!(bits(&films[0]), bits(&film), "with cancelled passes between");
}

#[test]
fn seeds_differ() {
    let model = box_scene();
    let placed = placed(&model);
    let [a, b] = [1, 2].map(|seed| {
        let settings = Settings { seed, ..SIZE };
        let renderer = Renderer::new(&model, &placed, &box_camera(), settings).unwrap();
        let mut film = renderer.film().unwrap();
        renderer.pass(&mut film, &Cancel::new()).unwrap();
        bits(&film)
    });
    assert_ne!(a, b);
}

/// Every builder and every number of threads gives the same picture, bit for bit: through holes,
/// with textures, and where only noisy tiles are sampled on.
#[test]
fn builders_and_threads_leave_no_trace() {
    let mut model = box_scene();
    model.materials[4].alpha = treelet_model::AlphaMode::Blend;
    model.materials[4].opacity = 0.6;
    let settings = Settings { width: 256, height: 32, ..SIZE };
    let mut films = Vec::new();
    for &builder in treelet::build::ALL {
        let options = treelet::BuildOptions { builder: Some(builder), ..Default::default() };
        let placed = treelet_model::PlacedModel::build(&model, &options).unwrap();
        let renderer = Renderer::new(&model, &placed, &box_camera(), settings).unwrap();
        let threads = 1 + films.len() % 2;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut film = renderer.film().unwrap();
        pool.install(|| {
            for _ in 0..16 {
                renderer.pass(&mut film, &Cancel::new()).unwrap();
            }
            // Some tiles are noisier than all together, some less.
            let limit = film.noise() as f32;
            for _ in 0..4 {
                renderer.adaptive_pass(&mut film, limit, &Cancel::new()).unwrap();
            }
        });
        let samples = film.samples();
        assert!(samples < 20 * 256 * 32, "some tiles are left: {samples}");
        assert!(samples > 16 * 256 * 32, "and some are not: {samples}");
        films.push((builder.info().name, bits(&film)));
    }
    for (name, film) in &films {
        assert_eq!(film, &films[0].1, "{name} and {}", films[0].0);
    }
}
