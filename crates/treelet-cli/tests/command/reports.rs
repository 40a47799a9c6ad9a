//! `list`, `inspect` and `verify`: what they find, and one object on stdout.

use crate::kit::{Folder, SCENE};

#[test]
fn list_shows_the_catalogues() {
    let folder = Folder::new();
    let json = folder.run("list --json").ends(0).json("list");
    let names = |list: &str| -> Vec<String> {
        let list = json[list].as_array().unwrap();
        list.iter().map(|entry| entry["name"].as_str().unwrap().to_owned()).collect()
    };
    let builders: Vec<_> = treelet::build::ALL.iter().map(|b| b.info().name).collect();
    assert_eq!(names("builders"), builders);
    let optimizers: Vec<_> = treelet::optimize::ALL.iter().map(|o| o.info().name).collect();
    assert_eq!(names("optimizers"), optimizers);
    assert_eq!(names("qualities"), treelet::Quality::ALL.map(treelet::Quality::name));
    for level in json["qualities"].as_array().unwrap() {
        assert_ne!(level["plan"], "", "{level}");
    }
    let layouts: Vec<_> = treelet::layout::ALL.iter().map(|info| info.name).collect();
    assert_eq!(names("layouts"), layouts);
    let importers: Vec<_> = treelet_import::ALL.iter().map(|i| i.info().name).collect();
    assert_eq!(names("importers"), importers);
    let verbs = ["render", "inspect", "verify", "bench", "list", "completions", "man"];
    assert_eq!(names("verbs"), verbs);
    for verb in json["verbs"].as_array().unwrap() {
        assert_ne!(verb["summary"], "", "{verb}");
    }
}

#[test]
fn people_read_stderr_and_stdout_stays_empty() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    for line in ["list", "inspect scene.obj", "verify scene.obj --rays 60"] {
        let run = folder.run(line).ends(0);
        assert_eq!(run.stdout, "", "{line}");
        assert!(run.stderr.lines().count() > 2, "{line}: {}", run.stderr);
        assert!(!run.stderr.contains('\x1b'), "{line}: colours in a pipe");
    }
}

#[test]
fn inspect_counts_what_is_wrong() {
    let folder = Folder::new();
    // Vertex 4 is NaN; a triangle uses it, one is a line, one is there twice, turned.
    folder.write(
        "odd.ply",
        "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\n\
         property float z\nelement face 5\nproperty list uchar int vertex_indices\nend_header\n\
         0 0 0\n1 0 0\n0 1 0\n2 0 0\nnan 0 0\n0 0 4\n\
         3 0 1 2\n3 1 2 0\n3 0 1 3\n3 0 1 4\n3 0 2 5\n",
    );
    let json = folder.run("inspect odd.ply --json").ends(0).json("inspect");
    assert_eq!(json["triangles_stored"], 5);
    assert_eq!(json["triangles_placed"], 5);
    assert_eq!(json["vertices"], 6);
    assert_eq!(json["degenerate"], 1);
    assert_eq!(json["non_finite"], 1);
    assert_eq!(json["index_out_of_range"], 0);
    let layouts = json["layouts"].as_array().unwrap();
    let names: Vec<_> = layouts.iter().map(|layout| layout["layout"].as_str().unwrap()).collect();
    assert_eq!(names, treelet::layout::ALL.iter().map(|info| info.name).collect::<Vec<_>>());
    assert!(layouts.iter().all(|layout| layout["bytes_per_triangle"].as_f64().unwrap() > 0.0));
    assert_eq!(json["duplicate"], 1);
    assert_eq!(json["bounds"], serde_json::json!([[0.0, 0.0, 0.0], [2.0, 1.0, 4.0]]));
    let builders = json["builders"].as_array().unwrap();
    assert_eq!(builders.len(), treelet::build::ALL.len());
    for (report, builder) in builders.iter().zip(treelet::build::ALL) {
        assert_eq!(report["builder"], builder.info().name);
        assert!(report["nodes"].as_u64().unwrap() >= 1, "{report}");
        assert!(report["sah"].as_f64().unwrap() > 0.0, "{report}");
        assert!(report["bytes_per_triangle"].as_f64().unwrap() > 36.0, "{report}");
    }
}

#[test]
fn verify_agrees_and_replays() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let json = folder.run("verify scene.obj --rays 600 --seed 5 --json").ends(0).json("verify");
    assert_eq!(json["rays"], 600);
    assert_eq!(json["rays_by_brute_force"], 600);
    assert!(json["difference"].is_null());
    assert!(json["hits"].as_u64().unwrap() > 100, "the rays look for triangles");

    let json = folder.run("verify scene.obj --rays 600 --brute 100 --json").ends(0).json("verify");
    assert_eq!((&json["rays"], &json["rays_by_brute_force"]), (&600.into(), &100.into()));

    let mut command = folder.command("verify scene.obj --json --ray");
    let output = command.arg("o=0.25,2,0.25 d=0,-2,0 t=0,inf").output().unwrap();
    let run = crate::kit::Run::new("verify --ray", output).ends(0);
    let json = run.json("verify");
    assert_eq!(json["rays"], 1);
    let hits = json["hits_of_ray"].as_array().unwrap();
    assert!(hits.len() >= 3, "a side, the underside, the floor: {hits:?}");
    assert_eq!(hits.last().unwrap()["t"], 1.0);
}
