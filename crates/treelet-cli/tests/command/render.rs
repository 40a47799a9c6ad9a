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

#[test]
fn light_is_kept_in_exr_and_hdr_and_compared() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let line = "render scene.obj --size 48x32 --spp 2";
    folder.run(&format!("{line} -o a.exr")).ends(0);
    folder.run(&format!("{line} -o a.hdr")).ends(0);
    assert!(folder.read("a.exr").starts_with(&[0x76, 0x2F, 0x31, 0x01]));
    assert!(folder.read("a.hdr").starts_with(b"#?RADIANCE"));
    let layers = folder.read("a.exr");
    for layer in ["albedo.R", "normal.X", "depth.Z", "id.triangle", "visits.Y", "tests.Y"] {
        assert!(layers.windows(layer.len()).any(|bytes| bytes == layer.as_bytes()), "{layer}");
    }

    let same = folder.run(&format!("{line} --compare a.exr --json")).ends(0).json("render");
    assert_eq!(same["errors"]["mean_squared"], 0.0, "{same}");
    let near = folder.run(&format!("{line} --compare a.hdr --json")).ends(0).json("render");
    let near = near["errors"]["relative_squared"].as_f64().unwrap();
    assert!(near > 0.0 && near < 1e-3, "{near}");
    let other = folder.run(&format!("{line} --seed 5 --compare a.exr --json")).ends(0);
    let other = other.json("render")["errors"]["relative_squared"].as_f64().unwrap();
    assert!(other > near, "{other}");
    folder.run("render scene.obj --size 40x32 --spp 1 --compare a.exr").ends(2);
    folder.run(&format!("{line} --compare a.exr -o a.exr")).ends(2);
    let lit = folder.run(&format!("{line} --env a.hdr --compare a.exr --json")).ends(0);
    assert!(lit.json("render")["errors"]["mean_squared"].as_f64().unwrap() > 0.0);
}

#[test]
fn a_smoothed_picture_has_the_raw_one_beside_it() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let line = "render scene.obj --size 64x48 --spp 4";
    folder.run(&format!("{line} -o plain.png")).ends(0);
    folder.run(&format!("{line} -o s.png --denoise")).ends(0);
    assert!(folder.read("s.raw.png") == folder.read("plain.png"));
    let smooth = folder.read("s.png");
    assert_whole_png(&smooth);
    assert!(smooth.len() < folder.read("s.raw.png").len(), "what is smooth packs better");
}

#[test]
fn noise_is_stated_and_reached() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let line = "render scene.obj --size 128x96 --noise 4 --spp 2000 --json";
    let json = folder.run(line).ends(0).json("render");
    let (passes, samples) = (json["passes"].as_u64().unwrap(), json["samples"].as_u64().unwrap());
    assert!((16..2000).contains(&passes), "{json}");
    assert!(samples < passes * 128 * 96, "clean tiles are left alone: {json}");
    assert!(json["noise"].as_f64().unwrap() <= 0.04, "{json}");
}

#[test]
fn biases_are_told() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let line = "render scene.obj --size 16x16 --spp 1";
    let plain = folder.run(line).ends(0);
    assert!(!plain.stderr.contains("cut off") && !plain.stderr.contains("softened"));
    let biased = folder.run(&format!("{line} --clamp 4 --soften")).ends(0);
    assert!(biased.stderr.contains("cut off at 4 times white"), "{}", biased.stderr);
    assert!(biased.stderr.contains("softened"));
}

#[test]
fn a_turntable_turns() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let line = "render scene.obj --size 24x16 --spp 1 --turntable 3 -o t.png --json";
    let json = folder.run(line).ends(0).json("render");
    assert_eq!(json["frames"].as_array().unwrap().len(), 3);
    let frames = [0, 1, 2].map(|frame| folder.read(&format!("t.{frame:03}.png")));
    assert!(frames[0] != frames[1] && frames[1] != frames[2]);
    folder.run("render scene.obj --size 24x16 --spp 1 -o still.png").ends(0);
    assert!(folder.read("still.png") == frames[0], "it begins where a single picture stands");
}

#[test]
fn cameras_are_listed_and_chosen() {
    let folder = Folder::new();
    let list = folder.run("render --cameras --json").ends(0).json("render");
    let camera = list["cameras"][0]["camera"].as_str().unwrap();
    assert!(camera.starts_with("from="), "{list}");
    assert!(folder.files().is_empty(), "nothing is rendered");
    folder.write("scene.obj", SCENE);
    let run = folder.run("render scene.obj --size 8x8 --spp 1 --camera front").ends(2);
    assert!(run.stderr.contains("front"), "{}", run.stderr);
    let line = "render scene.obj --size 24x16 --spp 4";
    for camera in ["height=3.5", "lens=0.25 focus=2.5", "fov=30"] {
        let words = format!("--camera from=3,2,5 at=0,0.5,0 {camera} --json");
        let json = folder.run(&format!("{line} {words}")).ends(0).json("render");
        assert!(json["camera"].as_str().unwrap().contains(camera), "{json}");
    }
}

#[test]
fn pictures_are_drawn_in_terminals() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let line = "render scene.obj --size 24x16 --spp 1";
    for (how, part) in [
        ("kitty", "\x1b_Ga=T,f=100,"),
        ("iterm", "\x1b]1337;File=inline=1;"),
        ("sixel", "\x1bPq"),
        ("blocks", "\u{2580}"),
    ] {
        let run = folder.run(&format!("{line} --show={how}")).ends(0);
        assert!(run.stderr.contains(part), "{how}: {}", run.stderr);
    }
}

#[test]
fn shells_and_manuals_know_the_flags() {
    let folder = Folder::new();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let run = folder.run(&format!("completions {shell}")).ends(0);
        assert!(run.stdout.contains("turntable"), "{shell}");
    }
    let page = folder.run("man render").ends(0);
    assert!(page.stdout.contains(".TH") && page.stdout.contains("turntable"), "{}", page.stdout);
    assert!(folder.run("man").ends(0).stdout.contains("inspect"));
    folder.run("man nothing").ends(2);
}

/// A room without doors, seen from inside: the sky cannot light it, a lamp at the camera can.
#[test]
fn dark_rooms_are_told_and_lit() {
    let folder = Folder::new();
    let corner = |i: u32| {
        let side = |axis: u32| if i >> axis & 1 == 1 { 1 } else { -1 };
        format!("v {} {} {}\n", side(0), side(1), side(2))
    };
    let room: String = (0..8).map(corner).collect();
    folder.write(
        "room.obj",
        &format!("{room}f 1 5 7 3\nf 2 4 8 6\nf 1 2 6 5\nf 3 7 8 4\nf 1 3 4 2\nf 5 6 8 7\n"),
    );
    let inside = |rest: &str| {
        let mut command = folder.command("render room.obj --size 24x16 --spp 2 --json --camera");
        command.arg("from=0,0,0.9 at=0,0,0").args(rest.split_whitespace());
        crate::kit::Run::new(rest, command.output().unwrap()).ends(0)
    };
    let dark = inside("-o dark.png");
    assert!(dark.stderr.contains("--light headlamp"), "{}", dark.stderr);
    assert!(dark.json("render")["warnings"][0].as_str().unwrap().starts_with("100 %"));
    let lit = inside("-o lit.png --light headlamp");
    assert!(!lit.stderr.contains("black"), "{}", lit.stderr);
    assert!(folder.read("lit.png").len() > 2 * folder.read("dark.png").len());
    let share = lit.json("render")["query_share"].as_f64().unwrap();
    assert!(share > 0.0 && share < 1.0, "{share}");

    folder.write("scene.obj", SCENE);
    let open = folder.run("render scene.obj --size 24x16 --spp 2").ends(0);
    assert!(!open.stderr.contains("black"), "{}", open.stderr);
}
