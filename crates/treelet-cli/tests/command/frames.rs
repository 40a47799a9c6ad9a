//! `render --frames` and `--video`: a clip of a tiny glTF, its pictures, its lines, its files.

use std::fs;

use crate::kit::{Folder, Run, assert_whole_png};

/// Little-endian bytes of numbers.
fn le(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// Two triangles: one slides to the right by 4 in one second, the other swells by a morph target, in the
/// second clip only.
pub(crate) fn write_scene(folder: &Folder) {
    let mut binary = le(&[-1.0, 0.0, 0.0, 0.0, 2.0, 0.0, -1.0, 2.0, 0.0]);
    binary.extend(le(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 3.0, 0.0]));
    binary.extend(le(&[0.0, 1.0]));
    binary.extend(le(&[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]));
    binary.extend(le(&[0.0, 1.0]));
    fs::write(folder.path("scene.bin"), binary).unwrap();
    let accessor = |view: usize, count: usize, shape: &str| {
        format!(r#"{{"bufferView":{view},"componentType":5126,"count":{count},"type":"{shape}"}}"#)
    };
    let accessors = [
        accessor(0, 3, "VEC3"),
        accessor(1, 3, "VEC3"),
        accessor(2, 2, "SCALAR"),
        accessor(3, 2, "VEC3"),
        accessor(4, 2, "SCALAR"),
    ];
    let mut start = 0;
    let views = [36, 36, 8, 24, 8].map(|len| {
        start += len;
        format!(r#"{{"buffer":0,"byteOffset":{},"byteLength":{len}}}"#, start - len)
    });
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0}},{{"mesh":1,"translation":[0,4,0]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}},{{"primitives":[{{
        "attributes":{{"POSITION":0}},"targets":[{{"POSITION":1}}]}}]}}],
        "animations":[{{"name":"slide","channels":[{{"sampler":0,"target":{{"node":0,
        "path":"translation"}}}}],"samplers":[{{"input":2,"output":3}}]}},
        {{"name":"swell","channels":[{{"sampler":0,"target":{{"node":1,"path":"weights"}}}}],
        "samplers":[{{"input":2,"output":4}}]}}],
        "accessors":[{}],"bufferViews":[{}],"buffers":[{{"uri":"scene.bin","byteLength":112}}]}}"#,
        accessors.join(","),
        views.join(",")
    );
    folder.write("scene.gltf", &json);
}

const LINE: &str = "render scene.gltf --size 24x16 --spp 1 --json";

#[test]
fn frames_are_pictures_of_their_times() {
    let folder = Folder::new();
    write_scene(&folder);
    let run = folder.run(&format!("{LINE} --frames 0..3 --fps 2 -o out.###.png")).ends(0);
    let json = run.json("render");
    assert_eq!(json["frames"], serde_json::json!(["out.000.png", "out.001.png", "out.002.png"]));
    let pose = |frame: usize, key: &str| json["poses"][frame][key].clone();
    assert_eq!([0, 1, 2].map(|frame| pose(frame, "time").as_f64().unwrap()), [0.0, 0.5, 1.0]);
    assert_eq!([0, 1, 2].map(|frame| pose(frame, "tree")), ["built", "refitted", "refitted"]);
    assert_eq!((pose(1, "instances_moved"), pose(1, "objects_rebuilt")), (1.into(), 0.into()));
    let line = "frame 1 at 0.500 s: 1 instance moved; tree: instances refitted; pose ";
    assert!(run.stderr.contains(line), "{}", run.stderr);
    let frames = [0, 1, 2].map(|frame| folder.read(&format!("out.{frame:03}.png")));
    frames.iter().for_each(|frame| assert_whole_png(frame));
    assert!(frames[0] != frames[1] && frames[1] != frames[2]);
    // A frame is the same alone, with other threads, and after the clip began anew.
    let alone = format!("{LINE} --frames 1 --fps 2 --threads 3 -o one.png");
    folder.run(&alone).ends(0);
    assert!(folder.read("one.0001.png") == frames[1]);
    folder.run(&format!("{LINE} --frames 3 --fps 2 -o one.png")).ends(0);
    assert!(folder.read("one.0003.png") == frames[1]);
    let names: Vec<_> = folder.files().into_iter().filter(|name| name.contains("tmp")).collect();
    assert!(names.is_empty(), "{names:?}");
}

#[test]
fn what_bends_is_built_and_what_stands_is_kept() {
    let folder = Folder::new();
    write_scene(&folder);
    let run = folder.run(&format!("{LINE} --clip swell --frames 0..=1 --fps 2 -o f.png")).ends(0);
    let line = "frame 1 at 0.500 s: 0 instances moved, 1 mesh deformed (1 triangle); tree: 1 of 2 ";
    assert!(run.stderr.contains(line), "{}", run.stderr);
    let two = [0, 1].map(|frame| folder.read(&format!("f.000{frame}.png")));
    assert!(two[0] != two[1]);
    // A thousand frames a second: at the clip's end nothing moves any more.
    let line = format!("{LINE} --clip 2 --frames 1000..=1000 --fps 1000 -o f.png");
    assert_eq!(folder.run(&line).ends(0).json("render")["poses"][0]["time"], 1.0);
    for (flags, words) in [
        ("--frames 0..1 --clip hop", "no such clip, but 1 slide, 2 swell"),
        ("--frames 5..5", "holds no frame"),
        ("--frames 0..1 --turntable 3", "cannot be used with"),
        ("--frames 0..1 --fps 0", "frames a second"),
        ("--video out", "what kind of video?"),
    ] {
        let run = folder.run(&format!("{LINE} {flags}")).ends(2);
        assert!(run.stderr.contains(words), "{flags}: {}", run.stderr);
    }
    folder.write("still.obj", crate::kit::SCENE);
    let run = folder.run("render still.obj --frames 0..2").ends(2);
    assert!(run.stderr.contains("nothing in the scene moves"), "{}", run.stderr);
}

/// Runs with a search path that holds nothing, or a program of the test's.
#[cfg(unix)]
fn run_with_path(folder: &Folder, line: &str) -> Run {
    let mut command = folder.command(line);
    command.env("PATH", folder.path("bin"));
    Run::new(line, command.output().unwrap())
}

#[test]
#[cfg(unix)]
fn without_ffmpeg_the_video_is_an_animated_png() {
    let folder = Folder::new();
    write_scene(&folder);
    let line = format!("{LINE} --video clip.mp4 --fps 4");
    let run = run_with_path(&folder, &line).ends(0);
    assert!(run.stderr.contains("ffmpeg is not there"), "{}", run.stderr);
    let json = run.json("render");
    assert_eq!(json["video"].as_str().unwrap().rsplit('/').next(), Some("clip.png"));
    assert_eq!(folder.files(), ["clip.png", "scene.bin", "scene.gltf"], "no frames are asked for");

    // What a decoder makes of it is what single frames show.
    folder.run(&format!("{LINE} --frames .. --fps 4 -o f.png")).ends(0);
    let read = |name: &str| {
        let decoder = png::Decoder::new(std::io::Cursor::new(folder.read(name)));
        let mut reader = decoder.read_info().unwrap();
        let control = reader.info().animation_control().copied();
        let count = control.map_or(1, |control| control.num_frames);
        let frames: Vec<Vec<u8>> = (0..count)
            .map(|_| {
                let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
                reader.next_frame(&mut pixels).unwrap();
                pixels
            })
            .collect();
        let delay = reader.info().frame_control().map(|frame| (frame.delay_num, frame.delay_den));
        (frames, delay)
    };
    let (frames, delay) = read("clip.png");
    assert_eq!((frames.len(), delay), (4, Some((1, 4))));
    for (number, frame) in frames.iter().enumerate() {
        assert!(*frame == read(&format!("f.000{number}.png")).0[0], "frame {number}");
    }
}

#[test]
#[cfg(unix)]
fn ffmpeg_gets_pixels_and_is_believed() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = Folder::new();
    write_scene(&folder);
    fs::create_dir(folder.path("bin")).unwrap();
    let program = |script: &str| {
        let file = folder.path("bin/ffmpeg");
        fs::write(&file, format!("#!/bin/sh\n{script}\n")).unwrap();
        fs::set_permissions(&file, fs::Permissions::from_mode(0o755)).unwrap();
    };
    // Copies what it is sent to the file that it is told last.
    program("for last; do :; done\nexec /bin/cat > \"$last\"");
    let line = format!("{LINE} --video clip.mkv --frames 0..2 -o f.#.png");
    run_with_path(&folder, &line).ends(0);
    assert_eq!(folder.read("clip.mkv").len(), 2 * 24 * 16 * 3);
    assert!(folder.files().contains(&"f.1.png".to_owned()), "{:?}", folder.files());
    // One that fails leaves no video, and says so.
    program("/bin/cat > /dev/null\nexit 9");
    let run = run_with_path(&folder, &line.replace("clip.mkv", "none.mkv")).ends(1);
    assert!(run.stderr.contains("ffmpeg made no video (exit status: 9)"), "{}", run.stderr);
    assert!(folder.files().iter().all(|name| !name.contains("none")), "{:?}", folder.files());
}
