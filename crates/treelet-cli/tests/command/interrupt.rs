//! Ctrl-C: what was reached is kept, whole, and the exit code says so.
#![cfg(unix)]

use std::io::{BufRead as _, BufReader, Read as _};
use std::process::{Child, Command, Stdio};

use crate::kit::{Folder, Run, SCENE, assert_whole_png};

/// A command under way, its stderr read up to a line that holds `word`.
struct Started {
    child: Child,
    stderr: BufReader<std::process::ChildStderr>,
    line: String,
}

impl Started {
    fn until(folder: &Folder, line: &str, word: &str) -> Self {
        let mut command = folder.command(line);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let mut stderr = BufReader::new(child.stderr.take().unwrap());
        let mut text = String::new();
        while !text.contains(word) {
            let read = stderr.read_line(&mut text).unwrap();
            assert!(read > 0, "`treelet {line}` ended before it said {word:?}: {text}");
        }
        Self { child, stderr, line: line.to_owned() }
    }

    fn interrupt(&self) {
        let pid = self.child.id().to_string();
        assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
    }

    fn finish(mut self) -> Run {
        let mut text = Vec::new();
        self.stderr.read_to_end(&mut text).unwrap();
        let mut output = self.child.wait_with_output().unwrap();
        output.stderr = text;
        Run::new(&self.line, output)
    }
}

#[test]
fn the_picture_so_far_is_kept() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let line = "render scene.obj --size 64x48 --spp 4000000000 --json";
    let started = Started::until(&folder, line, "first pass");
    started.interrupt();
    let run = started.finish().ends(130);
    let json = run.json("render");
    assert_eq!(json["cancelled"], true);
    let kept = folder.read("treelet.png");
    assert_whole_png(&kept);
    let passes = json["passes"].as_u64().unwrap();
    assert!(run.stderr.contains(&format!("--spp {passes}")), "{}", run.stderr);
    folder.run(&format!("render scene.obj --size 64x48 --spp {passes} -o again.png")).ends(0);
    assert!(folder.read("again.png") == kept, "not the picture of {passes} passes");
    assert_eq!(folder.files(), ["again.png", "scene.obj", "treelet.png"]);
}

#[test]
fn before_the_first_pass_nothing_is_written() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let line = "render scene.obj --size 9000x6000 --spp 1 --json";
    let started = Started::until(&folder, line, "tree built");
    started.interrupt();
    let run = started.finish().ends(130);
    assert_eq!(run.json("render")["exit_code"], 130);
    assert_eq!(folder.files(), ["scene.obj"]);
}

#[test]
fn a_check_stops() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let started = Started::until(&folder, "verify scene.obj --rays 30000000", "scene.obj:");
    started.interrupt();
    let run = started.finish().ends(130);
    assert!(run.stderr.contains("cancelled"), "{}", run.stderr);
}

#[test]
fn layers_that_were_not_made_are_named() {
    let folder = Folder::new();
    folder.write("scene.obj", SCENE);
    let layers = "--aov normal,depth,visits,tests";
    // During the layers, and during the passes.
    for passes in [1, 4_000_000_000_u64] {
        let line = format!("render scene.obj --size 1200x900 --spp {passes} {layers} --json");
        let started = Started::until(&folder, &line, "first pass");
        started.interrupt();
        let run = started.finish().ends(130);
        let json = run.json("render");
        assert_eq!(json["cancelled"], true);
        let (made, missing) = (&json["aov"], json["aov_missing"].as_array().unwrap());
        assert_eq!(made.as_array().unwrap().len() + missing.len(), 4, "{json}");
        assert!(passes == 1 || missing.len() == 4, "{json}");
        let names: Vec<_> = missing.iter().map(|name| name.as_str().unwrap()).collect();
        let told = format!("not made: --aov {}", names.join(","));
        assert!(!names.is_empty() && run.stderr.contains(&told), "{}", run.stderr);
    }
}

#[test]
fn frames_that_are_there_are_whole() {
    let folder = Folder::new();
    crate::frames::write_scene(&folder);
    let line =
        "render scene.gltf --size 64x48 --frames 0..9999 --spp 1 --video c.png -o f.#.png --json";
    let started = Started::until(&folder, line, "frame 2 ");
    started.interrupt();
    let json = started.finish().ends(130).json("render");
    let made = json["frames"].as_array().unwrap();
    assert!(made.len() >= 3 && made.len() == json["poses"].as_array().unwrap().len(), "{json}");
    for name in made {
        assert_whole_png(&folder.read(name.as_str().unwrap()));
    }
    // The video holds as many, and nothing half-made is left.
    let decoder = png::Decoder::new(std::io::Cursor::new(folder.read("c.png")));
    let reader = decoder.read_info().unwrap();
    let control = reader.info().animation_control().unwrap();
    assert_eq!(control.num_frames as usize, made.len());
    assert_eq!(folder.files().len(), made.len() + 3, "{:?}", folder.files());
}
