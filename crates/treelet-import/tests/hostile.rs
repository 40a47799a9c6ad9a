//! Files that lie: huge counts, cuts, references to nothing. A table of what is said about each.

mod common;

use common::{SQUARE_PLY, check_error, glb, read, square_glb, square_json};

fn ply(vertex: &str, face: &str, body: &str) -> String {
    format!("ply\nformat ascii 1.0\n{vertex}\n{face}\nend_header\n{body}")
}

const XYZ: &str = "element vertex 1\nproperty float x\nproperty float y\nproperty float z";
const FACE: &str = "element face 1\nproperty list uchar int vertex_indices";

#[test]
fn ply_files() {
    let none = "";
    let xyz = |count: &str| XYZ.replace("vertex 1", &format!("vertex {count}"));
    let binary = |text: String| text.replace("ascii", "binary_little_endian");
    let table: [(String, &str); 24] = [
        (
            ply(&xyz("18446744073709551615"), FACE, "0 0 0\n"),
            "line 3: 18446744073709551615 rows of \"vertex\" need at least",
        ),
        (
            ply(&xyz("99999999999999999999"), FACE, none),
            "line 3: \"element vertex 99999999999999999999\" is no element with",
        ),
        (
            binary(ply(&xyz("4294967295"), FACE, "0 0 0\n")),
            "4294967295 rows of \"vertex\" need at least 51539607540 bytes, 6 are left",
        ),
        (ply(&xyz("-1"), FACE, none), "line 3: \"element vertex -1\" is no element"),
        (ply(XYZ, &FACE.replace("face 1", "face 3000000000"), "0 0 0\n"), "rows of \"face\" need"),
        (ply(XYZ, FACE, "0 0 0\n250 0 0 0\n"), "line 11: a list of 250 values, with 7 bytes left"),
        (
            ply(XYZ, &FACE.replace("uchar", "int"), "0 0 0\n-4 0 0 0\n"),
            "line 11: a list of -4 values",
        ),
        (
            ply(XYZ, &FACE.replace("uchar", "float"), "0 0 0\n"),
            "line 8: \"property list float int vertex_indices\" is no property",
        ),
        (ply(XYZ, FACE, "0 0\n3 0 0 0\n"), "line 10: a value of the row is missing"),
        (ply(XYZ, FACE, "0 0 x\n3 0 0 0\n"), "line 10: a value of the row is \"x\", not a number"),
        (ply(XYZ, FACE, "0 0 0\n3 0 0\n"), "line 11: a value of the row is missing"),
        (ply(XYZ, FACE, "0 0 0\n"), "line 7: 1 rows of \"face\" need at least 2 bytes, 0 are left"),
        (ply(XYZ, FACE, "0 0 0\n4 0 0 0 9\n"), "face 0: names vertex 9 of 1"),
        (
            ply("element vertex 1\nproperty float x\nproperty float y", FACE, none),
            "line 3: 1 rows of \"vertex\" need",
        ),
        (
            ply("element vertex 0\nproperty float x\nproperty float y", FACE, "3 0 0 0\n"),
            "line 3: the element \"vertex\" lacks x, y or z",
        ),
        (ply(none, FACE, "3 0 0 0\n"), "header: has no element \"vertex\""),
        (
            ply(XYZ, "element face 1\nproperty int vertex_indices", "0 0 0\n7\n"),
            "has no list \"vertex_indices\"",
        ),
        (ply(XYZ, XYZ, none), "line 7: the element \"vertex\" comes twice"),
        (
            ply(XYZ, "element face 1\nproperty list uchar int64 vertex_indices", none),
            "is no property of a known type",
        ),
        (ply("property float x", FACE, none), "line 3: a property stands before the first element"),
        (
            ply(XYZ, FACE, none).replace("end_header", "end"),
            "line 9: \"end\" is no line of a PLY header",
        ),
        (
            ply(XYZ, FACE, none).replace("end_header\n", none),
            "line 9: the header has no \"end_header\"",
        ),
        (
            ply(XYZ, FACE, none).replace("ascii", "ebcdic"),
            "line 2: \"format ebcdic 1.0\" is no PLY format",
        ),
        (
            ply(XYZ, FACE, none).replace("format ascii 1.0", none),
            "line 9: the header has no \"format\"",
        ),
    ];
    for (text, want) in table {
        check_error("a.ply", text, want);
    }
    // An element without properties takes no bytes, and no time.
    let idle = format!("{XYZ}\nelement idle 18000000000000000000");
    assert!(read("a.ply", ply(&idle, "element face 0", "0 0 0\n")).is_ok());
}

#[test]
fn gltf_files() {
    let square = |from: &str, to: &str| {
        let json = square_json(r#"{"mesh":0}"#, "", "");
        assert!(json.contains(from), "{from}");
        glb(&json.replacen(from, to, 1), &[0; 60])
    };
    let table = [
        (
            square("\"count\":4,", "\"count\":4294967295,"),
            "accessor 0: 4294967295 elements of 12 bytes, 12 apart, from byte 0 on do not fit the 48 of bufferView 0",
        ),
        (
            square("\"count\":4,", "\"count\":18446744073709551615,"),
            "accessor 0: 18446744073709551615 elements",
        ),
        (
            square("\"count\":4,", "\"byteOffset\":18446744073709551615,\"count\":4,"),
            "from byte 18446744073709551615 on do not fit",
        ),
        (square("\"count\":4,", "\"count\":-4,"), "line 3: JSON: invalid value: integer `-4`"),
        (square("\"count\":4,", "\"count\":1e99999,"), "line 3: JSON: number out of range"),
        (
            square("\"byteLength\":48}", "\"byteLength\":4800}"),
            "accessor 0: lies in bufferView 0 of 4800 bytes at 0, past the 60 of its buffer",
        ),
        (
            square("\"byteLength\":48}", "\"byteLength\":48,\"byteStride\":4}"),
            "accessor 0: has a stride of 4 for 12 bytes",
        ),
        (
            square("\"byteLength\":48}", "\"byteLength\":48,\"byteStride\":18446744073709551615}"),
            "accessor 0: 4 elements of 12 bytes, 18446744073709551615 apart",
        ),
        (
            square("\"buffer\":0,", "\"buffer\":9,"),
            "accessor 0: needs buffer 9, which has no bytes",
        ),
        (square("\"bufferView\":0,", "\"bufferView\":9,"), "accessor 0: names bufferView 9 of 2"),
        (square("\"bufferView\":0,", ""), "accessor 0: has no bufferView, so no data"),
        (
            square("\"bufferView\":0,", "\"bufferView\":0,\"sparse\":{},"),
            "accessor 0: has sparse indices of type 0",
        ),
        (square("5126", "5125"), "accessor 0: is VEC3 of type 5125, but positions are FLOAT or"),
        (square("5126", "7"), "accessor 0: is VEC3 of type 7, but positions are FLOAT or small"),
        (
            square("5123", "5126"),
            "accessor 1: is SCALAR of type 5126, but indices are SCALAR of an UNSIGNED type",
        ),
        (square("\"indices\":1", "\"indices\":7"), "accessor 7: is named, but there are 2"),
        (
            square("\"indices\":1", "\"indices\":1,\"material\":5"),
            "mesh 0 \"square\", primitive 0: names material 5 of 0",
        ),
        (square("\"indices\":1", "\"mode\":7"), "mesh 0 \"square\", primitive 0: has mode 7"),
        (
            square("\"POSITION\":0", "\"POSITION\":0,\"NORMAL\":1"),
            "accessor 1: is SCALAR of type 5123, but normals are VEC3",
        ),
        (
            square("\"byteLength\":60", "\"byteLength\":61"),
            "buffer 0: should have 61 bytes and has 60",
        ),
        (square("\"scenes\"", "\"scene\":3,\"scenes\""), "scene: names scene 3 of 1"),
        (square("\"2.0\"", "\"1.0\""), "is glTF 1.0, which treelet does not read yet"),
        (square("}", "]"), "line 1: JSON: expected `,` or `}`"),
        (glb(&"[".repeat(100_000), &[]), "line 1: JSON: "),
        (
            square_glb(&format!("{{\"extras\":{}", "[".repeat(100_000)), ""),
            "line 2: JSON: expected `,` or `]`",
        ),
    ];
    for (bytes, want) in table {
        check_error("a.glb", bytes, want);
    }
    for (uri, want) in [
        ("data:application/octet-stream;base64,!!!", "buffer 0: is a data URI with broken base64"),
        ("data:text/plain,abc", "buffer 0: is a data URI that is not base64"),
        ("data:;base64", "buffer 0: is a data URI without data"),
        ("data:;base64,AAAA", "buffer 0: should have 60 bytes and has 3"),
    ] {
        let uri = format!(r#""uri":"{uri}","#);
        check_error("a.gltf", square_json(r#"{"mesh":0}"#, &uri, ""), want);
    }
}

#[test]
fn glb_containers() {
    let good = square_glb(r#"{"mesh":0}"#, "");
    let with = |at: usize, value: u32| {
        let mut bytes = good.clone();
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        bytes
    };
    check_error("a.glb", with(4, 1), "byte 4: is glTF 1.0");
    check_error("a.glb", with(4, 3), "byte 4: is GLB of neither version 1 nor 2");
    check_error(
        "a.glb",
        with(8, u32::MAX),
        "byte 8: the GLB header says 4294967295 bytes, the file has",
    );
    check_error(
        "a.glb",
        with(12, u32::MAX),
        "byte 12: a GLB chunk of 4294967295 bytes reaches past",
    );
    check_error("a.glb", with(16, 0), "byte 12: the GLB has no JSON chunk");
    for len in 4..good.len() {
        check_error("a.glb", &good[..len], "a.glb: byte ");
    }
}

#[test]
fn stl_files() {
    let stl = common::LOWER_STL;
    for (from, to, want) in [
        ("vertex 1 0 0", "vertex 1 0 z", "line 5: z is \"z\", not a number"),
        ("vertex 1 0 0", "vertex 1 0", "line 5: z is missing"),
        ("vertex 1 0 0\n", "\n", "line 7: a loop of 2 vertices"),
        ("  outer loop\n", "", "line 3: \"vertex\" outside \"outer loop\""),
        ("endloop", "", "line 8: \"endfacet\" with nothing to end"),
        (" endfacet", "facet", "line 8: \"endfacet\" is missing before this line"),
        ("endloop", "color 1 2 3", "line 7: \"color\" is no statement of ascii STL"),
        ("endsolid a b", "solid b", "line 9: \"endsolid\" is missing before this line"),
    ] {
        assert!(stl.contains(from), "{from}");
        check_error("a.stl", stl.replacen(from, to, 1), want);
    }
    check_error("a.stl", "", "byte 0: 0 bytes are no STL file: the header alone takes 84");
    let mut huge = common::binary_stl(b"", &[common::LOWER]);
    huge[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    check_error(
        "a.stl",
        huge,
        "byte 80: 4294967295 triangles need 214748364834 bytes, the file has 134",
    );
}

#[test]
fn polygons_that_are_slow_to_split_are_bounded_in_memory() {
    // A million corners of one point: nothing to see, and no time to lose.
    let text = format!("v 0 0 0\nf{}\n", " 1".repeat(1_000_000));
    let model = read("a.obj", text).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(model.triangles_placed(), 999_998);
    // As many normals at one vertex.
    let normals = "vn 0 0 1\n".repeat(200_000);
    let faces: String = (1..=200_000).map(|i| format!("f 1//{i} 2//{i} 3//{i}\n")).collect();
    let model = read("a.obj", format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{normals}{faces}"));
    assert_eq!(model.map(|model| model.triangles_placed()).ok(), Some(200_000));
}

#[test]
fn long_texts_take_linear_time() {
    // What is quadratic in their lines takes minutes.
    const ROWS: usize = 400_000;
    let start = std::time::Instant::now();
    let vertex = XYZ.replace("vertex 1", "vertex 3");
    let face = FACE.replace("face 1", &format!("face {ROWS}"));
    let body = format!("0 0 0\n1 0 0\n0 1 0\n{}", "3 0 1 2\n".repeat(ROWS));
    let facet = common::LOWER_STL.lines().skip(1).take(7).collect::<Vec<_>>().join("\n") + "\n";
    let texts = [
        ("a.ply", ply(&vertex, &face, &body)),
        ("a.obj", format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{}", "f 1 2 3 \\\n\n".repeat(ROWS))),
        ("a.stl", format!("solid\n{}endsolid\n", facet.repeat(ROWS))),
    ];
    for (name, text) in texts {
        let model = read(name, text).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(model.triangles_placed(), ROWS as u64, "{name}");
    }
    assert!(start.elapsed().as_secs() < 30, "{:?}", start.elapsed());
}

#[test]
fn naming_the_same_bytes_over_and_over() {
    // 2,000 meshes over accessors of their own, all of the same 120,000 bytes: 240 MB of a file of
    // half a megabyte.
    let list = |item: &dyn Fn(usize) -> String| {
        let items: Vec<String> = (0..2000).map(item).collect();
        items.join(",")
    };
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{}],"meshes":[{}],"accessors":[{}],
        "bufferViews":[{{"buffer":0,"byteLength":120000}}],"buffers":[{{"byteLength":120000}}]}}"#,
        list(&|i| format!(r#"{{"mesh":{i}}}"#)),
        list(&|i| format!(r#"{{"primitives":[{{"attributes":{{"POSITION":{i}}}}}]}}"#)),
        list(&|_| r#"{"bufferView":0,"componentType":5126,"count":10000,"type":"VEC3"}"#.to_owned()),
    );
    let bytes = glb(&json, &vec![0; 120_000]);
    check_error("a.glb", &bytes, "would take more than 256 times the file's bytes");
    let limits = treelet_import::Limits { max_ratio: 1000, ..Default::default() };
    let options = treelet_import::Options { limits, ..Default::default() };
    assert!(treelet_import::load_bytes("a.glb", &bytes, &options).is_ok(), "as the caller wishes");
}

#[test]
fn limits_bind() {
    use treelet_import::{Fault, Limits, Options, load_bytes};
    let limits = Limits { max_bytes: 100, ..Limits::default() };
    let options = Options { limits, ..Options::default() };
    for (name, bytes) in [
        ("a.ply", SQUARE_PLY.as_bytes().to_vec()),
        ("a.obj", common::SQUARE_OBJ.as_bytes().to_vec()),
        ("a.stl", common::binary_stl(b"", &[common::LOWER; 9])),
        ("a.glb", square_glb(r#"{"mesh":0}"#, "")),
    ] {
        let fault = load_bytes(name, &bytes, &options).expect_err(name).fault;
        let is_expected = matches!(fault, Fault::TooBig { limit: 0..=100, .. });
        assert!(is_expected || name == "a.ply", "{name}: {fault}");
    }
    let options = Options::default();
    options.cancel.cancel();
    // One statement of many lines is no shelter from the flag, either.
    let continued = "g \\\n".repeat(20_000);
    for (name, text) in [("a.ply", SQUARE_PLY), ("a.obj", &continued)] {
        let error = load_bytes(name, text.as_bytes(), &options).expect_err("cancelled");
        assert!(matches!(error.fault, Fault::Cancelled(_)), "{error}");
    }
}
