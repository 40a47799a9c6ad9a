//! What cannot be done is said in a line, with the right exit code.

use crate::kit::{Folder, Run, SCENE};

#[test]
fn wrong_words_are_usage_errors() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    for line in [
        "",
        "paint",
        "render --builder none",
        "render --spp 0",
        "render --spp 2 --time 1",
        "render --time 0",
        "render --time nan",
        "render --time 2e19",
        "render --time 1e300",
        "render -o x.jpg",
        "render -o x",
        "render --size 0x720",
        "render --size 1280",
        "render --size 4000000000x4000000000",
        "render --size 65536x65536",
        "render --threads 0",
        "render --aov beauty",
        "render --camera",
        "render --camera from=1,2,3",
        "render --camera from=1,2,3 at=1,2,3",
        "render --up x",
        "render --unknown",
        "render a.obj b.obj",
        "verify --rays some",
        "verify --rays 0",
        "verify --ray o=1,2,3",
    ] {
        let run = folder.run(line).ends(2);
        assert_eq!(run.stdout, "", "{line}");
        assert_ne!(run.stderr, "", "{line}");
        assert!(!run.stderr.contains("panicked"), "{line}: {}", run.stderr);
    }
    assert_eq!(folder.files(), ["scene.obj"]);
}

#[test]
fn help_and_version_are_no_errors() {
    let folder = Folder::new();
    for line in ["--help", "--version", "render --help", "help verify"] {
        assert_ne!(folder.run(line).ends(0).stdout, "", "{line}");
    }
}

#[test]
fn a_missing_scene_is_named() {
    let folder = Folder::new();
    for verb in ["render", "inspect", "verify"] {
        let run = folder.run(&format!("{verb} nothing.ply --json")).ends(1);
        let json = run.json(verb);
        assert_eq!(json["exit_code"], 1);
        let error = json["error"][0].as_str().unwrap();
        assert!(error.contains("nothing.ply"), "{error}");
        assert!(run.stderr.starts_with("error: "), "{}", run.stderr);
        assert!(run.stderr.contains(error), "{}", run.stderr);
    }
    assert_eq!(folder.files(), [""; 0]);
}

#[test]
fn an_impossible_output_is_refused_before_time_is_spent() {
    let folder = Folder::new();
    // Not a scene: that the output is refused first shows that it was checked first.
    folder.write("scene.obj", "no scene at all");
    std::fs::create_dir(folder.path("taken.png")).unwrap();
    for (output, word) in [("missing/out.png", "does not exist"), ("taken.png", "regular file")] {
        let run = folder.run(&format!("render scene.obj -o {output}")).ends(1);
        assert!(run.stderr.contains(word), "{output}: {}", run.stderr);
        assert!(run.stderr.contains(output), "{output}: {}", run.stderr);
    }
    assert_eq!(folder.files(), ["scene.obj", "taken.png"]);
}

#[test]
fn invalid_triangles_are_an_error_if_asked() {
    let folder = Folder::new();
    folder.write("nan.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nf 1 2 3\nf 1 2 4\n");
    let line = "render nan.obj --size 8x8 --spp 1";
    let run = folder.run(&format!("{line} --invalid error")).ends(1);
    assert!(run.stderr.contains("triangle 1"), "{}", run.stderr);
    assert!(run.stderr.contains("--invalid skip"), "{}", run.stderr);
    assert_eq!(folder.files(), ["nan.obj"]);
    let run = folder.run(&format!("{line} --json")).ends(0);
    assert_eq!(run.json("render")["skipped_triangles"], 1);
    assert!(run.stderr.contains("1 triangle left out"), "{}", run.stderr);
}

#[test]
fn the_scene_is_not_written_over() {
    let folder = Folder::new();
    // The content tells that it is PLY.
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
        0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    folder.write("p.depth.png", ply);
    for line in ["-o p.depth.png", "-o ../{}/p.depth.png", "-o p.png --aov depth"] {
        let name = folder.path("").file_name().unwrap().to_str().unwrap().to_owned();
        let line = format!("render p.depth.png --size 8x8 --spp 1 {}", line.replace("{}", &name));
        let run = folder.run(&line).ends(2);
        assert!(run.stderr.contains("is the scene"), "{line}: {}", run.stderr);
        assert_eq!(folder.read("p.depth.png"), ply.as_bytes());
    }
    folder.run("render p.depth.png --size 8x8 --spp 1 -o p.png").ends(0);
    assert_eq!(folder.files(), ["p.depth.png", "p.png"]);
}

#[test]
fn remedies_name_flags() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    folder.write(
        "outside.gltf",
        r#"{"asset":{"version":"2.0"},
        "buffers":[{"uri":"../outside.bin","byteLength":4}]}"#,
    );
    for (line, flag) in [
        ("inspect scene.obj --max-bytes 10", "--max-bytes"),
        ("inspect outside.gltf", "--allow-outside"),
    ] {
        let run = folder.run(line).ends(1);
        assert!(run.stderr.contains(flag), "{line}: {}", run.stderr);
        assert!(!run.stderr.contains("Limits::"), "{line}: {}", run.stderr);
    }
    folder.run("inspect scene.obj --max-bytes 10000000 --max-ratio 4").ends(0);
}

#[test]
fn usage_errors_are_reported_as_json_too() {
    let folder = Folder::new();
    for (line, verb, word) in [
        ("render --spp 0 --json", "render".into(), "--spp"),
        ("--json verify --rays none", "verify".into(), "--rays"),
        ("--json paint", serde_json::Value::Null, "paint"),
        ("render --json -- a.ply b.ply", "render".into(), "b.ply"),
    ] {
        let run = folder.run(line).ends(2);
        let json: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
        assert_eq!((&json["schema"], &json["exit_code"]), (&1.into(), &2.into()), "{line}");
        assert_eq!(json["verb"], verb, "{line}");
        let error = json["error"][0].as_str().unwrap();
        assert!(error.contains(word) && !error.starts_with("error"), "{line}: {error}");
    }
    assert_eq!(folder.run("render --spp 0 -- --json").ends(2).stdout, "");
}

/// A device that is always full.
#[cfg(target_os = "linux")]
#[test]
fn a_full_stream_is_told_or_survived() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let full = || std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    for line in ["list --json", "inspect scene.obj --json", "verify scene.obj --rays 9 --json"] {
        let output = folder.command(line).stdout(full()).output().unwrap();
        let run = Run::new(line, output).ends(1);
        assert!(run.stderr.contains("stdout"), "{line}: {}", run.stderr);
        let output = folder.command(line).stderr(full()).output().unwrap();
        let verb = line.split(' ').next().unwrap();
        Run::new(line, output).ends(0).json(verb);
    }
}
