//! `render`: the picture is whole, the same for any threads, and what the report says.

use crate::kit::{Folder, SCENE, assert_whole_png, exists};

#[test]
fn the_picture_is_the_same_for_any_number_of_threads() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    for threads in [1, 2, 5] {
        let line = "render scene.obj --size 48x32 --spp 2";
        folder.run(&format!("{line} --threads {threads} -o {threads}.png")).ends(0);
    }
    let one = folder.read("1.png");
    assert_whole_png(&one);
    assert!(one == folder.read("2.png") && one == folder.read("5.png"));
    folder.run("render scene.obj --size 48x32 --spp 2 --seed 1 -o seed.png").ends(0);
    assert!(one != folder.read("seed.png"), "another seed, another noise");
}

#[test]
fn every_builder_gives_the_same_picture() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let mut pictures = Vec::new();
    for builder in treelet::build::ALL {
        let name = builder.info().name;
        let line = format!("render scene.obj --size 40x30 --spp 1 --builder {name} --json");
        assert_eq!(folder.run(&line).ends(0).json("render")["builder"], name);
        pictures.push(folder.read("treelet.png"));
    }
    assert!(pictures.iter().all(|picture| *picture == pictures[0]));
}

#[test]
fn a_timed_picture_equals_that_of_its_passes() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let line = "render scene.obj --size 64x48 --json";
    let run = folder.run(&format!("{line} --time 0.3 -o timed.png")).ends(0);
    let json = run.json("render");
    let passes = json["passes"].as_u64().unwrap();
    assert!(passes > 1, "{json}");
    assert!(json["rays"].as_u64().unwrap() >= passes * 64 * 48);
    let run = folder.run(&format!("{line} --spp {passes} -o counted.png")).ends(0);
    assert_eq!(run.json("render")["rays"], json["rays"]);
    assert!(folder.read("timed.png") == folder.read("counted.png"));
}

#[test]
fn the_camera_of_the_report_gives_the_same_picture() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let line = "render scene.obj --size 40x30 --spp 1 --json";
    let json =
        folder.run(&format!("{line} -o a.png --camera from=3,2,5 at=0,0.5,0 fov=45")).ends(0);
    let camera = json.json("render")["camera"].as_str().unwrap().to_owned();
    // One quoted argument this time, and in front of the scene.
    let mut command = folder.command("render --camera");
    command.arg(&camera).args("scene.obj --size 40x30 --spp 1 -o b.png".split(' '));
    let output = command.output().unwrap();
    crate::kit::Run::new(&camera, output).ends(0);
    let (a, b) = (folder.read("a.png"), folder.read("b.png"));
    assert_whole_png(&a);
    // The point looked at is rounded anew, so a pixel may differ in its last bit, not in size.
    assert!(a.len().abs_diff(b.len()) < 200, "{} and {} bytes", a.len(), b.len());
    folder.run("render scene.obj --size 40x30 --spp 1 -o c.png").ends(0);
    assert!(folder.read("c.png") != a, "without --camera another view is taken");
}

#[test]
fn the_camera_of_the_report_is_accepted_far_away() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let line = "render scene.obj --size 8x8 --spp 1 --json";
    let run = folder.run(&format!("{line} --camera=from=3e8,1e8,-5e8 at=0,0,0")).ends(0);
    let camera = run.json("render")["camera"].as_str().unwrap().to_owned();
    let run = folder.run(&format!("{line} --camera {camera}")).ends(0);
    assert_eq!(run.json("render")["camera"].as_str().unwrap(), camera);
}

#[test]
fn layers_lie_beside_the_picture() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let line = "render scene.obj --size 120x80 --spp 1 -o p.png --aov normal,depth,visits,tests";
    let json = folder.run(&format!("{line} --json")).ends(0).json("render");
    assert_eq!(json["aov"].as_array().unwrap().len(), 4);
    for name in ["normal", "depth", "visits", "tests"] {
        assert_whole_png(&folder.read(&format!("p.{name}.png")));
    }
    assert_eq!(folder.files().len(), 6, "{:?}", folder.files());
}

#[test]
fn readers_see_whole_files_only() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let old = b"\x89PNG\r\n\x1a\nold\0\0\0\0IEND\xaeB`\x82";
    std::fs::write(folder.path("treelet.png"), old).unwrap();
    let mut command = folder.command("render scene.obj --size 320x200 --time 0.6");
    command.stderr(std::process::Stdio::null());
    let mut child = command.spawn().unwrap();
    let (mut looks, mut sizes) = (0, std::collections::BTreeSet::new());
    while child.try_wait().unwrap().is_none() {
        let bytes = folder.read("treelet.png");
        assert_whole_png(&bytes);
        sizes.insert(bytes.len());
        looks += 1;
    }
    assert!(child.wait().unwrap().success());
    assert!(looks > 10 && sizes.len() > 1, "{looks} looks, sizes {sizes:?}");
    assert_eq!(folder.files(), ["scene.obj", "treelet.png"], "no temporary file is left");
}

#[test]
fn a_link_stays_a_link() {
    if cfg!(not(unix)) {
        return;
    }
    #[cfg(unix)]
    {
        let folder = Folder::new();
        folder.write("scene.obj", SCENE);
        folder.write("real.png", "old");
        std::os::unix::fs::symlink("real.png", folder.path("link.png")).unwrap();
        folder.run("render scene.obj --size 8x8 --spp 1 -o link.png").ends(0);
        assert!(folder.path("link.png").is_symlink());
        assert_whole_png(&folder.read("real.png"));
    }
}

#[test]
fn the_built_in_scene_needs_no_file() {
    let folder = Folder::new();
    let json = folder.run("render --size 64x36 --spp 1 --json").ends(0).json("render");
    assert_eq!(json["scene"], "demo");
    assert!(json["triangles_placed"].as_u64().unwrap() > 1_000_000);
    assert!(exists(&folder.path("treelet.png")));
    assert_eq!(folder.files(), ["treelet.png"]);
}
