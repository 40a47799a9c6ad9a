//! Every layout with every builder, quality level, awkward scene and instance: the same bits as
//! brute force, no leaks, and the bytes that it is there for. `matrix.rs` crosses layouts with levels,
//! `slices.rs` with slices.

use treelet::build;
use treelet::scene::LayoutChoice;
use treelet::verify::{self, BruteForce, Random};
use treelet::{Affine, BuildOptions, Mesh, Quality, Ray, Scene, SceneBuilder, SceneError};
use treelet_testkit::{Shape, awkward, closed, rounds};

const SEED: u64 = 0x1A70;

fn mesh(shape: &Shape) -> Mesh {
    Mesh::new(shape.positions.clone(), shape.triangles.clone())
}

fn options(layout: LayoutChoice) -> BuildOptions<'static> {
    BuildOptions { layout: Some(layout), ..BuildOptions::default() }
}

fn built(scene: SceneBuilder, layout: LayoutChoice) -> Scene {
    scene.build(&options(layout)).expect("test scenes build")
}

fn agree(name: &str, scene: &Scene, rays: usize) {
    let brute = BruteForce::new(scene);
    let rays = verify::rays(scene, rays, SEED);
    if let Err(mismatch) = verify::check_many(scene, &rays, |ray| brute.all(ray)) {
        panic!("{name}, seed {SEED:#x}: {mismatch}");
    }
}

#[test]
fn with_every_builder_and_quality() {
    for scene in awkward::all(1000) {
        for &layout in LayoutChoice::ALL {
            let name = format!("{}, {}", scene.name, layout.info().name);
            let build =
                |options| Scene::builder().mesh(mesh(&scene.shape)).build(&options).unwrap();
            for &builder in build::ALL {
                let built = build(BuildOptions { builder: Some(builder), ..options(layout) });
                agree(&format!("{name}, {}", builder.info().name), &built, 200);
            }
            // Splits put a triangle into several leaves.
            let built = build(BuildOptions { quality: Quality::Best, ..options(layout) });
            agree(&format!("{name}, best"), &built, 200);
        }
    }
}

#[test]
fn with_instances() {
    let mut random = Random::new(SEED);
    for &layout in LayoutChoice::ALL {
        let name = layout.info().name;
        let sphere = built(Scene::builder().mesh(mesh(&closed::sphere(16, 8))), layout);
        let soup = awkward::random_triangles(100, 2.0, 1.0);
        let soup = built(Scene::builder().mesh(mesh(&soup)), layout);
        let mut map = || {
            let scales = [(); 3].map(|()| random.between(0.3, 3.0));
            Affine::translation([(); 3].map(|()| random.between(-20.0, 20.0)))
                .then_from(&Affine::rotation(random.direction(), 1.0))
                .then_from(&Affine::scaling(scales))
        };
        // Triangles and instances side by side, and all of it inside something else.
        let crowd = (0..60)
            .fold(Scene::builder(), |crowd, i| crowd.instance([&sphere, &soup][i % 2], map()));
        let crowd = built(crowd.mesh(mesh(&closed::cube())), layout);
        agree(&format!("a crowd, {name}"), &crowd, 600);
        let nested = built(Scene::builder().instance(&crowd, map()), layout);
        agree(&format!("one instance, {name}"), &nested, 300);
        let nested =
            built(Scene::builder().instance(&nested, map()).instance(&soup, map()), layout);
        agree(&format!("three levels, {name}"), &nested, 600);
    }
}

#[test]
fn layouts_do_not_mix() {
    for &inside in LayoutChoice::ALL {
        for &outside in LayoutChoice::ALL {
            let cube = built(Scene::builder().mesh(mesh(&closed::cube())), inside);
            let outer = Scene::builder().instance(&cube, Affine::IDENTITY);
            match outer.build(&options(outside)) {
                Ok(_) => assert_eq!(inside, outside),
                Err(error) => {
                    assert_ne!(inside, outside);
                    assert_eq!(error, SceneError::MixedLayouts { instance: 0 });
                }
            }
        }
    }
}

#[test]
fn no_ray_slips_through() {
    // Moved away, so that planes are coarse; turned, so that no edge lies on a grid.
    let place = |[x, y, z]: [f32; 3]| [0.6 * x - 0.8 * y + 1e4, 0.8 * x + 0.6 * y - 3e4, z + 7e3];
    for seed in 0..3 {
        let mut star = closed::random_star(48, 24, seed);
        star.positions.iter_mut().for_each(|p| *p = place(*p));
        for &layout in LayoutChoice::ALL {
            let scene = built(Scene::builder().mesh(mesh(&star)), layout);
            let mut random = Random::new(SEED + seed);
            for _ in 0..rounds(100_000) {
                let origin = place([(); 3].map(|()| random.between(-0.02, 0.02)));
                let vertex = random.below(star.positions.len() as u64) as usize;
                let [to, from] = [star.positions[vertex], origin];
                let ray = Ray::new(origin, [to[0] - from[0], to[1] - from[1], to[2] - from[2]]);
                assert!(scene.any(&ray), "{}, star {seed}: {ray:?}", layout.info().name);
                assert!(scene.closest(&ray).is_some(), "{layout:?}, star {seed}: {ray:?}");
            }
        }
    }
}

/// A mesh as people make them: half as many vertices as triangles, ids in the order of places.
#[test]
fn compact_is_half_of_wide() {
    let sphere = mesh(&closed::sphere(400, 200));
    let triangles = sphere.triangles().len() as f64;
    let bytes = |layout: LayoutChoice| {
        built(Scene::builder().mesh(sphere.clone()), layout).trace_bytes() as f64 / triangles
    };
    let [wide, compact] = [bytes(LayoutChoice::Wide16), bytes(LayoutChoice::Compact)];
    assert!(wide < 60.0, "wide: {wide}");
    assert!(compact < 30.0, "compact: {compact}");
}

/// The catalogue and the choices are the same list.
#[test]
fn every_choice_is_in_the_catalogue() {
    let names: Vec<_> = LayoutChoice::ALL.iter().map(|layout| layout.info().name).collect();
    let listed: Vec<_> = treelet::layout::ALL.iter().map(|info| info.name).collect();
    assert_eq!(names, listed);
}
