//! Wrong input is an error that names the first offender, or skipped and counted.

use treelet::geometry::Defect;
use treelet::{BuildOptions, Hit, Invalid, Mesh, Ray, Scene, SceneError};
use treelet_testkit::awkward::random_triangles;

const STRICT: Invalid = Invalid::Error;

fn build(meshes: &[Mesh], invalid: Invalid) -> Result<Scene, SceneError> {
    let options = BuildOptions { invalid, ..BuildOptions::default() };
    let all = meshes.iter().fold(Scene::builder(), |all, mesh| all.mesh(mesh.clone()));
    all.build(&options)
}

/// `count` triangles without a defect, and more than one chunk of the builder's checks if large.
fn good(count: usize) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let shape = random_triangles(count, 10.0, 1.0);
    (shape.positions, shape.triangles)
}

/// Every value that no vertex may have, and the nearest ones that it may.
fn values() -> (Vec<f32>, Vec<f32>) {
    let limit = 2.0_f32.powi(62);
    let bad = vec![f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY, limit.next_up()];
    let bad = bad.into_iter().chain([-limit.next_up(), f32::MAX, f32::MIN]).collect();
    (bad, vec![limit, -limit, f32::MIN_POSITIVE, 1e-45, -0.0])
}

#[test]
fn errors_name_mesh_triangle_and_vertex() {
    let (bad, fine) = values();
    for (count, prim) in [(1, 0), (100, 99), (50_000, 33_333)] {
        for corner in 0..3 {
            for axis in 0..3 {
                for &value in &bad {
                    let (mut positions, triangles) = good(count);
                    let vertex = triangles[prim][corner];
                    positions[vertex as usize][axis] = value;
                    // A later offender must not be the one that is named.
                    positions[count * 3 - 1][0] = f32::NAN;
                    let mesh = Mesh::new(positions.clone(), triangles);
                    let first = Mesh::new(good(3).0, good(3).1);
                    let error = build(&[first, mesh], STRICT).unwrap_err();
                    let SceneError::Triangle { geom: 1, prim: named, defect } = error else {
                        panic!("{value} at triangle {prim}: {error}");
                    };
                    assert_eq!(named, prim, "{value}: {error}");
                    let Defect::BadVertex { vertex: named, position } = defect else {
                        panic!("{value}: {error}");
                    };
                    // The triangle's first bad vertex in the order of its corners.
                    assert_eq!(named, vertex, "{value}: {error}");
                    let bits = |p: [f32; 3]| p.map(f32::to_bits);
                    assert_eq!(bits(position), bits(positions[vertex as usize]));
                    let text = error.to_string();
                    for part in ["mesh 1", &format!("triangle {prim}"), &format!("vertex {vertex}")]
                    {
                        assert!(text.contains(part), "{part} is missing in: {text}");
                    }
                }
                if count > 1000 {
                    return;
                }
            }
        }
    }
    for value in fine {
        let (mut positions, triangles) = good(10);
        positions[7][1] = value;
        assert!(build(&[Mesh::new(positions, triangles)], STRICT).is_ok(), "{value} is allowed");
    }
}

#[test]
fn an_index_past_the_end_is_named() {
    for vertex in [30, 31, u32::MAX] {
        let (positions, mut triangles) = good(10);
        triangles[4][1] = vertex;
        let error = build(&[Mesh::new(positions, triangles)], STRICT).unwrap_err();
        let defect = Defect::IndexOutOfRange { vertex, vertices: 30 };
        assert_eq!(error, SceneError::Triangle { geom: 0, prim: 4, defect });
        assert!(error.to_string().contains(&format!("vertex index {vertex}")), "{error}");
    }
    let nothing: Vec<[f32; 3]> = Vec::new();
    assert!(build(&[Mesh::new(nothing, vec![[0, 0, 0]])], STRICT).is_err());
}

#[test]
fn skipped_triangles_are_counted_and_never_hit() {
    let (mut positions, mut triangles) = good(40_000);
    let clean = build(&[Mesh::new(positions.clone(), triangles.clone())], STRICT).unwrap();
    // Every 1000th triangle gets a bad vertex, every 1500th another index.
    let mut spoiled = Vec::new();
    for prim in (17..40_000).step_by(1000) {
        positions[triangles[prim][2] as usize][0] = f32::NAN;
        spoiled.push(prim);
    }
    for prim in (5..40_000).step_by(1500) {
        triangles[prim][0] = 120_000;
        spoiled.push(prim);
    }
    let scene = build(&[Mesh::new(positions, triangles)], Invalid::Skip).unwrap();

    let skipped = &scene.report().skipped;
    assert_eq!(skipped.bad_vertex, 40);
    assert_eq!(skipped.index_out_of_range, 27);
    assert_eq!(skipped.triangles, 67);
    assert_eq!(scene.report().triangles, 40_000 - 67);
    assert!(
        matches!(skipped.first_triangle, Some((0, 5, Defect::IndexOutOfRange { .. }))),
        "{:?}",
        skipped.first_triangle
    );
    // The others keep their numbers: answers are those of the clean scene without the spoiled.
    let spoiled = |hit: &Hit| spoiled.contains(&(hit.prim as usize));
    let mut met = 0;
    for ray in treelet::verify::rays(&clean, 5000, 11) {
        let expected: Vec<Hit> = clean.all(&ray).into_iter().filter(|hit| !spoiled(hit)).collect();
        met += clean.all(&ray).len() - expected.len();
        let ids = |hits: &[Hit]| hits.iter().map(Hit::id).collect::<Vec<_>>();
        assert_eq!(ids(&scene.all(&ray)), ids(&expected), "{ray:?}");
    }
    assert!(met > 0, "the rays must meet a spoiled triangle for this to mean anything");
}

#[test]
fn vertices_that_no_triangle_uses_may_be_anything() {
    let (mut positions, triangles) = good(10);
    positions.extend([[f32::NAN; 3], [f32::INFINITY; 3], [f32::MAX; 3]]);
    let scene = build(&[Mesh::new(positions, triangles)], STRICT).unwrap();
    assert_eq!(scene.report().skipped.triangles, 0);
    assert!(scene.bounds().max_abs() < 20.0);
}

#[test]
fn nothing_left_is_a_scene_that_is_never_hit() {
    let mesh = Mesh::new([[f32::NAN; 3]; 3], [[0, 1, 2], [0, 0, 7]]);
    let scene = build(&[mesh.clone(), mesh], Invalid::Skip).unwrap();
    assert_eq!(scene.report().skipped.triangles, 4);
    assert!(scene.bounds().is_empty());
    let ray = Ray::new([0.0; 3], [1.0, 0.0, -0.0]);
    assert_eq!((scene.closest(&ray), scene.any(&ray), scene.count(&ray)), (None, false, 0));
}

#[test]
fn degenerate_triangles_are_kept_and_counted() {
    let line = [[0.0, 0.0, 0.0], [1.0, 2.0, 3.0], [0.5, 1.0, 1.5], [4.0, 0.0, 0.0]];
    let mesh = Mesh::new(line, [[0, 1, 2], [0, 0, 1], [3, 3, 3], [0, 1, 3]]);
    let scene = build(&[mesh], STRICT).unwrap();
    assert_eq!((scene.report().degenerate, scene.report().triangles), (3, 4));
}
