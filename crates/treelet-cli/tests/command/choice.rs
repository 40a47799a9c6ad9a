//! `--rays` and `--quality auto`: what was chosen is told, and the picture is the same.

use crate::kit::{Folder, SCENE};

#[test]
fn inspect_chooses_and_says_why() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let line = "inspect scene.obj --builders lbvh --rays 1e3 --json";
    let json = folder.run(line).ends(0).json("inspect");
    let choice = &json["choice"];
    assert_eq!(choice["rays"], 1000);
    assert!(choice["reason"].as_str().unwrap().contains(choice["variant"].as_str().unwrap()));
    assert!(choice["predicted_s"].as_f64().unwrap() > 0.0);
    let candidates = choice["candidates"].as_array().unwrap();
    assert!(candidates.iter().any(|each| each["variant"] == choice["variant"]));
    let told = folder.run("inspect scene.obj --builders lbvh --rays 1000").ends(0);
    assert!(told.stderr.contains("chose `"), "{}", told.stderr);
    let json = folder.run("inspect scene.obj --builders lbvh --json").ends(0).json("inspect");
    assert!(json["choice"].is_null());
}

#[test]
fn pictures_do_not_depend_on_what_was_chosen() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let pictures = ["", "--rays 250000", "--quality auto"].map(|flags| {
        let line = format!("render scene.obj --size 16x12 --spp 2 --json {flags}");
        let json = folder.run(&line).ends(0).json("render");
        assert_eq!(json["choice"].is_null(), flags.is_empty(), "{flags}");
        if flags == "--quality auto" {
            // 192 pixels, 2 passes, 3 times 2 rays a path.
            assert_eq!(json["choice"]["rays"], 192 * 2 * 6);
        }
        std::fs::read(folder.path("treelet.png")).unwrap()
    });
    assert!(pictures.iter().all(|picture| *picture == pictures[0]));
}

#[test]
fn rays_and_levels_are_not_both_said() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    for flags in ["--rays 5 --quality best", "--rays -1", "--rays many", "--builder lbvh --rays 5"]
    {
        folder.run(&format!("render scene.obj {flags}")).ends(2);
    }
}
