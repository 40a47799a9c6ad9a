//! Files that scenes name: found, found packed, refused.

mod common;

use std::fs;
use std::path::{Path, PathBuf};

use common::{SQUARE, le, soup, square_json};
use treelet_import::{Limits, Options, load};
use treelet_model::Model;

/// A folder of its own for each test, with an inner one for the scene.
fn folder(test: &str) -> PathBuf {
    let folder =
        Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{test}-{}", std::process::id()));
    fs::create_dir_all(folder.join("scene")).expect("the folder can be made");
    folder
}

fn put(path: &Path, bytes: impl AsRef<[u8]>) {
    fs::write(path, bytes).expect("the file can be written");
}

fn buffer() -> Vec<u8> {
    let mut binary = le(SQUARE.as_flattened());
    binary.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|index| index.to_le_bytes()));
    binary
}

fn gltf(uri: &str) -> String {
    square_json(r#"{"mesh":0}"#, &format!(r#""uri":"{uri}","#), "")
}

/// Reads `scene/a.gltf`, after writing it with a buffer of this address.
fn load_gltf(folder: &Path, uri: &str, allow_outside: bool) -> Result<Model, String> {
    let path = folder.join("scene/a.gltf");
    put(&path, gltf(uri));
    let options = Options { allow_outside, ..Options::default() };
    load(&path, &options).map_err(|error| error.to_string())
}

#[track_caller]
fn assert_refused(result: Result<Model, String>, want: &str) {
    let error = result.expect_err("it is to be refused");
    assert!(error.contains(want), "{error}\nshould contain: {want}");
}

#[test]
fn buffers_beside_the_scene() {
    let folder = folder("beside");
    let scene = folder.join("scene");
    fs::create_dir_all(scene.join("sub")).expect("the folder can be made");
    put(&scene.join("b 1.bin"), buffer());
    put(&scene.join("sub/b.bin"), buffer());
    let zstd = ruzstd::encoding::CompressionLevel::Fastest;
    put(&scene.join("c.bin.zst"), ruzstd::encoding::compress_to_vec(&buffer()[..], zstd));
    let uris = ["b 1.bin", "b%201.bin", "./sub/b.bin", r"sub\\b.bin", "sub/../b%201.bin", "c.bin"];
    for uri in uris {
        let model = load_gltf(&folder, uri, false).unwrap_or_else(|error| panic!("{uri}: {error}"));
        assert_eq!(soup(&model).len(), 2, "{uri}");
    }
    assert_refused(
        load_gltf(&folder, "no.bin", false),
        "buffer 0: names the file \"no.bin\", which is not there",
    );
    assert_refused(load_gltf(&folder, "sub", false), "sub: is no plain file");
    put(&scene.join("short.bin"), &buffer()[..59]);
    assert_refused(
        load_gltf(&folder, "short.bin", false),
        "buffer 0: should have 60 bytes and has 59",
    );
}

#[test]
fn paths_that_leave_the_folder() {
    let folder = folder("leave");
    put(&folder.join("b.bin"), buffer());
    let absolute = folder.join("b.bin").display().to_string();
    for uri in ["../b.bin", "x/../../b.bin", "%2e%2e/b.bin", r"..\\b.bin", &absolute] {
        assert_refused(load_gltf(&folder, uri, false), "which is not below the scene's folder");
    }
    for uri in ["../b.bin", "%2e%2e/b.bin", &absolute] {
        assert!(load_gltf(&folder, uri, true).is_ok(), "{uri}");
    }
    // Whether a file outside is there must not be told, either.
    assert_refused(load_gltf(&folder, "../missing.bin", false), "not below the scene's folder");
    for uri in ["https://host/b.bin", "file:///b.bin", "HTTP://host"] {
        for allow_outside in [false, true] {
            assert_refused(load_gltf(&folder, uri, allow_outside), "treelet never opens one");
        }
    }
    assert_refused(load_gltf(&folder, "c:/b.bin", false), "not below the scene's folder");
}

#[cfg(unix)]
#[test]
fn links_that_leave_the_folder() {
    let folder = folder("links");
    put(&folder.join("b.bin"), buffer());
    put(&folder.join("scene/inside.bin"), buffer());
    for (to, link) in [("../b.bin", "out.bin"), ("..", "up"), ("inside.bin", "in.bin")] {
        let link = folder.join("scene").join(link);
        let _ = fs::remove_file(&link);
        std::os::unix::fs::symlink(to, link).expect("the link can be made");
    }
    assert!(load_gltf(&folder, "in.bin", false).is_ok());
    for uri in ["out.bin", "up/b.bin"] {
        assert_refused(load_gltf(&folder, uri, false), "not below the scene's folder");
        assert!(load_gltf(&folder, uri, true).is_ok(), "{uri}");
    }
}

#[test]
fn memory_has_no_folder() {
    let error = common::read("a.gltf", gltf("b.bin")).expect_err("there is no file");
    assert!(
        error.to_string().contains("needs the file \"b.bin\", but was read from memory"),
        "{error}"
    );
}

#[test]
fn material_libraries() {
    let folder = folder("mtl");
    let scene = folder.join("scene");
    let obj = scene.join("a.obj");
    let mtl = "\
        newmtl plain\nKd 0.1 0.2 0.3\nmap_Kd x.png\n\
        newmtl shiny\nKd 0.5\nKs 1 1 1\nNs 30\n\
        newmtl glass\nKd 0 0 0\nillum 7\nNi 1.4\n\
        newmtl smoke\nKd 0.2 0.2 0.2\nd 0.25\n\
        newmtl haze\nTr 0.25\n\
        newmtl lamp\nKe 3 2 1\n\
        newmtl chrome\nKd 0 0 0\nKs 0.9 0.8 0.7\nillum 3\n\
        newmtl pbr\nPr 0.5\nPm 1\n";
    put(&scene.join("b 1.mtl"), mtl);
    let names = ["plain", "shiny", "glass", "smoke", "haze", "lamp", "chrome", "pbr"];
    let faces: String = names.map(|name| format!("usemtl {name}\nf 1 2 3\n")).concat();
    put(&obj, format!("mtllib b 1.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\n{faces}"));
    let model = load(&obj, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
    let missing =
        "1 picture is not read, the first because: names the file \"x.png\", which is not";
    assert!(
        model.warnings.len() == 1 && model.warnings[0].starts_with(missing),
        "{:?}",
        model.warnings
    );
    let [plain, shiny, glass, smoke, haze, lamp, chrome, pbr] = &model.materials[..] else {
        panic!("eight materials, not {}", model.materials.len())
    };
    assert_eq!((plain.base_color, plain.roughness), ([0.1, 0.2, 0.3], 1.0));
    assert_eq!((shiny.base_color, shiny.roughness, shiny.metallic), ([0.5; 3], 0.5, 0.0));
    assert_eq!((glass.base_color, glass.transmission, glass.ior), ([1.0; 3], 1.0, 1.4));
    assert_eq!((glass.roughness, smoke.transmission, haze.transmission), (0.0, 0.75, 0.25));
    assert_eq!(lamp.emission, [3.0, 2.0, 1.0]);
    assert_eq!((chrome.base_color, chrome.metallic), ([0.9, 0.8, 0.7], 1.0));
    assert_eq!((pbr.roughness, pbr.metallic), (0.5, 1.0));

    // A library that is out of bounds or not there leaves the mesh; a broken one is an error.
    put(&folder.join("out.mtl"), mtl);
    put(&obj, format!("mtllib ../out.mtl\nmtllib no.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\n{faces}"));
    let model = load(&obj, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
    let warning = "Materials of 2 lines are missing; the first is line 1: names the file \
                   \"../out.mtl\", which is not below";
    assert!(model.warnings[0].starts_with(warning), "{:?}", model.warnings);
    assert!(model.warnings[1].contains("materials are not in any library"), "{:?}", model.warnings);
    // Of several on a line, those that are there are read.
    put(&scene.join("c.mtl"), mtl);
    put(&obj, format!("mtllib no.mtl c.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\n{faces}"));
    let model = load(&obj, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
    let warning = "Materials are missing: line 1: names the file \"no.mtl c.mtl\"";
    assert!(model.warnings[0].starts_with(warning), "{:?}", model.warnings);
    assert_eq!(model.materials[5].emission, [3.0, 2.0, 1.0]);
    put(&scene.join("bad.mtl"), "newmtl a\n\nKd 0 x 0\n");
    put(&obj, "mtllib bad.mtl\nv 0 0 0\n");
    let error = load(&obj, &Options::default()).expect_err("the library is broken").to_string();
    assert!(
        error.contains("bad.mtl: line 3: the number of \"Kd\" is \"x\", not a number"),
        "{error}"
    );
}

/// Reads a scene within so many bytes.
fn load_within(path: &Path, max_bytes: u64) -> Model {
    let limits = Limits { max_bytes, ..Limits::default() };
    let options = Options { limits, ..Options::default() };
    load(path, &options).unwrap_or_else(|error| panic!("{error}"))
}

/// Many times what a file may cost that is named so often and read once.
const NAMED: usize = 400;

#[test]
fn a_buffer_named_many_times_is_read_once() {
    let folder = folder("same-buffer");
    let scene = folder.join("scene");
    put(&scene.join("b.bin"), buffer());
    let more = r#",{"uri":"./b.bin","byteLength":60},{"uri":"b%2Ebin","byteLength":60}"#;
    let json = gltf("b.bin");
    let first = r#""byteLength":60}"#;
    assert!(json.contains(first));
    put(&scene.join("a.gltf"), json.replace(first, &format!("{first}{}", more.repeat(NAMED / 2))));
    // The scene and the buffer take half a mebibyte each beside their own size.
    assert_eq!(load_within(&scene.join("a.gltf"), 2 << 20).triangles_placed(), 2);
}

#[test]
fn a_library_named_many_times_is_read_once() {
    let folder = folder("same-library");
    let scene = folder.join("scene");
    let path = scene.join("a.obj");
    put(&scene.join("a.mtl"), "newmtl red\nKd 1 0 0\nmap_Kd x.png\n");
    let spellings: String =
        (0..NAMED).map(|i| format!("mtllib {}a.mtl\n", "./".repeat(i))).collect();
    let face = "v 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl red\nf 1 2 3\n";
    for names in [spellings, format!("mtllib{}\n", " a.mtl".repeat(NAMED))] {
        put(&path, names + face);
        let model = load_within(&path, 2 << 20);
        assert_eq!(model.materials[0].base_color, [1.0, 0.0, 0.0]);
        assert_eq!(model.warnings.len(), 1, "{:?}", model.warnings);
    }
    // So many that are missing are one warning.
    put(&path, (0..NAMED).map(|i| format!("mtllib {i}.mtl\n")).collect::<String>() + face);
    let model = load_within(&path, 2 << 20);
    let want = "Materials of 400 lines are missing; the first is line 1: names the file \"0.mtl\"";
    assert!(model.warnings[0].starts_with(want), "{:?}", model.warnings);
    assert_eq!(model.warnings.len(), 2, "{:?}", model.warnings);
}

#[test]
fn a_folder_or_nothing_is_no_scene() {
    let folder = folder("nothing");
    for path in [folder.clone(), folder.join("no.ply")] {
        let error = load(&path, &Options::default()).expect_err("there is no file").to_string();
        assert!(error.contains("cannot be read ("), "{error}");
    }
}

/// A picture of two pixels, red above blue.
fn two_pixels() -> Vec<u8> {
    let mut bytes = b"BM".to_vec();
    bytes.extend(62_u32.to_le_bytes());
    bytes.extend([0; 4]);
    for word in [54_u32, 40, 1, 2] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.extend([1, 0, 24, 0]);
    bytes.extend([0; 24]);
    // Rows of blue, green, red from the bottom up, each padded to four bytes.
    bytes.extend([255, 0, 0, 0, 0, 0, 255, 0]);
    bytes
}

#[test]
fn pictures_of_material_libraries() {
    let folder = folder("pictures");
    let scene = folder.join("scene");
    fs::create_dir_all(scene.join("looks")).expect("the folder can be made");
    put(&scene.join("looks/two.bmp"), two_pixels());
    let mtl = "newmtl a\nmap_Kd -s 2 3 1 -o 0.5 0.25 -clamp on two.bmp\nmap_d two.bmp\n\
        newmtl b\nKd 1 0 0\nmap_Ke C:\\pictures\\two.bmp\nmap_Kd none.png\n";
    put(&scene.join("looks/a.mtl"), mtl);
    put(&scene.join("two.bmp"), two_pixels());
    let obj = scene.join("a.obj");
    put(
        &obj,
        "mtllib looks/a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 0.75\nusemtl a\n\
         f 1/1 2/2 3/3\nusemtl b\nf 1/1 2/1 3/9\n",
    );
    let model = load(&obj, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
    fs::remove_dir_all(&folder).expect("the folder can be removed");
    assert_eq!(model.images.len(), 2, "one a file");
    assert_eq!(model.warnings.len(), 1, "{:?}", model.warnings);
    let [a, b] = &model.materials[..] else { panic!("two materials") };
    // White where nothing else is said; the picture's own alpha counts, not its red.
    assert_eq!((a.base_color, a.opacity_texture), ([1.0; 3], None));
    assert_eq!(a.alpha, treelet_model::AlphaMode::Blend);
    let texture = a.base_color_texture.expect("it has a texture");
    assert_eq!(texture.wrap, [treelet_model::texture::Wrap::Clamp; 2]);
    // Counted from above: 1 - (3 v + 0.25) = 3 (1 - v) + (1 - 3 - 0.25).
    assert_eq!((texture.transform.scale, texture.transform.offset), ([2.0, 3.0], [0.5, -2.25]));
    assert_eq!((b.emission, b.base_color_texture), ([1.0; 3], None));
    let uvs = &model.objects[0].parts[0].uvs[0];
    assert_eq!(uvs[..], [[0.0, 1.0], [1.0, 1.0], [1.0, 0.25]]);
    // A coordinate that leads nowhere harms no shape.
    assert_eq!(model.objects[0].parts[1].mesh.triangles().len(), 1);
}

#[test]
fn large_files_tell_how_far_they_are() {
    use std::sync::{Arc, Mutex};
    let folder = folder("progress");
    let corners = [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]];
    let many = vec![corners[0]; 200_000];
    let file = folder.join("a.stl");
    put(&file, common::binary_stl(b"", &many));
    let told = Arc::new(Mutex::new(Vec::new()));
    let watcher = Arc::clone(&told);
    let watch = treelet_import::Watch::new(move |progress| {
        watcher.lock().expect("nobody panicked").push((progress.done, progress.total));
    });
    let options = Options { progress: Some(watch), ..Options::default() };
    let model = load(&file, &options).unwrap_or_else(|error| panic!("{error}"));
    // The bytes of a file that passes by do not count, only its arrays: 48 bytes a triangle.
    let limits = Limits { max_bytes: 14 << 20, ..Limits::default() };
    let small = load(&file, &Options { limits, ..Options::default() });
    fs::remove_dir_all(&folder).expect("the folder can be removed");
    assert_eq!(model.triangles_placed(), 200_000);
    let told = told.lock().expect("nobody panicked");
    assert!(told.len() >= 3 && told.is_sorted(), "{told:?}");
    assert_eq!(told.last(), Some(&(10_000_084, 10_000_084)));
    assert!(small.is_ok(), "{small:?}");
}
