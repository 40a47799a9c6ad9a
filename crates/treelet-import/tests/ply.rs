//! PLY files, small enough to be seen whole.

mod common;

use common::{LOWER, SQUARE, SQUARE_PLY, UPPER, binary_ply, check, check_error, model};

const SQUARE_TWO: [common::Corners; 2] = [LOWER, UPPER];

#[test]
fn ascii_quads() {
    check("a.ply", SQUARE_PLY, &SQUARE_TWO);
    check("a.ply", SQUARE_PLY.replace('\n', "\r\n"), &SQUARE_TWO);
    check("a.ply", SQUARE_PLY.replace('\n', "\r"), &SQUARE_TWO);
    check(
        "a.ply",
        SQUARE_PLY.replace("\n4 0", "\n\n4  0").replace("4 0 1 2 3\n", "4 0 1 2 3"),
        &SQUARE_TWO,
    );
}

#[test]
fn common_binary() {
    check("a.ply", binary_ply(&SQUARE, &[&[0, 1, 2], &[0, 2, 3]]), &SQUARE_TWO);
    // Runs of triangles with other faces between them.
    let faces: [&[i32]; 6] = [&[0, 1, 2], &[], &[0, 1, 2, 3], &[0, 2], &[0, 2, 3], &[0, 1, 2]];
    let got = check("a.ply", binary_ply(&SQUARE, &faces), &[LOWER, LOWER, UPPER, UPPER, LOWER]);
    assert_eq!(got.warnings, ["2 faces have fewer than three corners; left out."]);
}

/// The square with doubles out of order, normals, a list between, faces first, in either order.
fn unusual(big: bool) -> Vec<u8> {
    let order = if big { "big" } else { "little" };
    let mut bytes = format!(
        "ply\nformat binary_{order}_endian 1.0\ncomment x\nobj_info y\nelement face 1\n\
         property ushort flags\nproperty list ushort short vertex_indices\n\
         property list uchar float texcoord\nelement vertex 4\nproperty double z\n\
         property list uchar int what\nproperty double x\nproperty uchar red\nproperty double y\n\
         property float nx\nproperty float ny\nproperty float nz\nelement edge 1\n\
         property int a\nend_header\n"
    )
    .into_bytes();
    let mut put = |little: &[u8]| {
        let mut value = little.to_vec();
        if big {
            value.reverse();
        }
        bytes.extend(value);
    };
    for value in [7_u16, 4, 0, 1, 2, 3] {
        put(&value.to_le_bytes());
    }
    put(&[1]);
    put(&0.5_f32.to_le_bytes());
    for [x, y, z] in SQUARE {
        put(&f64::from(z).to_le_bytes());
        put(&[2]);
        put(&1_i32.to_le_bytes());
        put(&2_i32.to_le_bytes());
        put(&f64::from(x).to_le_bytes());
        put(&[255]);
        put(&f64::from(y).to_le_bytes());
        [0.0_f32, 0.0, 2.0].iter().for_each(|n| put(&n.to_le_bytes()));
    }
    put(&9_i32.to_le_bytes());
    bytes
}

#[test]
fn any_order_and_type() {
    for big in [false, true] {
        let got = check("a.ply", unusual(big), &SQUARE_TWO);
        let normals = got.objects[0].parts[0].normals.as_ref().expect("the file has normals");
        assert_eq!(normals[..], [[0.0, 0.0, 1.0]; 4]);
        let want = ["Vertex colours are not read.", "The PLY element \"edge\" is not read."];
        assert_eq!(got.warnings, want);
    }
}

#[test]
fn strips_restart() {
    let text = SQUARE_PLY
        .replace("element face 1", "element tristrips 1")
        .replace("list uchar int vertex_index\n", "list int int vertex_indices\n");
    let text = text.replace("4 0 1 2 3", "9 0 1 3 2 -1 0 1 -1 1");
    // The second triangle of a strip is turned back.
    let [a, b, c, d] = SQUARE;
    check("a.ply", text, &[[a, b, d], [d, b, c]]);
}

#[test]
fn concave_polygons_are_split_inside() {
    // An arrow head whose fan from corner 0 would turn a triangle over.
    let positions = [[4.0, 2.0, 0.0], [0.0, 4.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.0, 0.0]];
    let [tip, up, notch, down] = positions;
    for turn in 0..4 {
        let face: Vec<i32> = (0..4).map(|i| (i + turn) % 4).collect();
        let got = model("a.ply", binary_ply(&positions, &[&face]));
        for triangle in common::soup(&got) {
            // Both halves have the notch and the tip.
            assert!(triangle.contains(&tip) && triangle.contains(&notch), "{turn}: {triangle:?}");
            assert!(triangle.contains(&up) != triangle.contains(&down), "{turn}: {triangle:?}");
        }
    }
}

#[test]
fn bad_indices_of_triangles_pass_and_of_polygons_do_not() {
    let got = model("a.ply", binary_ply(&SQUARE, &[&[0, 1, 77], &[0, 1, -1]]));
    assert_eq!(got.objects[0].parts[0].mesh.triangles(), [[0, 1, 77], [0, 1, u32::MAX]]);
    let want = "a.ply: face 1: names vertex 77 of 4; the file is damaged";
    check_error("a.ply", binary_ply(&SQUARE, &[&[0, 1, 2], &[0, 1, 2, 77]]), want);
}

#[test]
fn points_alone_are_an_empty_mesh() {
    let got = model("a.ply", binary_ply(&SQUARE, &[]));
    assert_eq!((got.triangles_placed(), got.vertices_stored()), (0, 4));
    assert_eq!(got.warnings, ["The file holds no triangles."]);
}

#[test]
fn text_may_end_without_a_line_end() {
    let faces_first = "ply\nformat ascii 1.0\nelement face 1\nproperty list int int vertex_index\n\
        element vertex 3\nproperty int x\nproperty int y\nproperty int z\nend_header\n\
        3 0 1 2\n0 0 0\n1 0 0\n1 1 0";
    check("a.ply", faces_first, &[LOWER]);
    let empty_row = SQUARE_PLY.replace("property list uchar int vertex_index\n", "");
    check_error("a.ply", empty_row, "the element \"face\" has no list");
}

#[test]
fn binary_errors_have_an_offset() {
    let mut bytes = binary_ply(&SQUARE, &[&[0, 1, 2], &[0, 1, 2, 3]]);
    let second = bytes.len() - 17;
    bytes[second] = 200;
    let want = format!("a.ply: byte {second}: a list of 200 values, with 16 bytes left");
    check_error("a.ply", &bytes, &want);
    bytes[second] = 4;
    bytes.truncate(second);
    let want = format!("a.ply: byte {second}: the file ends inside an element");
    // Room for the least row is asked for first, so the other rows must be longer than that.
    check_error("a.ply", &bytes, &want);
}

#[test]
fn elements_that_are_not_read_are_one_warning() {
    let one = "element edge 1\nproperty uchar a\nend_header";
    let more = format!("element twig 1\nproperty uchar a\n{one}");
    for (elements, rows, want) in [
        (one, "1\n", "The PLY element \"edge\" is not read."),
        (&more, "1\n1\n", "2 PLY elements are not read; the first is \"twig\"."),
    ] {
        let text = SQUARE_PLY.replace("end_header", elements) + rows;
        assert_eq!(check("a.ply", text, &SQUARE_TWO).warnings, [want]);
    }
}

#[test]
fn what_follows_the_last_element_is_named() {
    let mut bytes = binary_ply(&SQUARE, &[&[0, 1, 2], &[0, 2, 3]]);
    bytes.extend([1, 2, 3]);
    let got = check("a.ply", bytes, &SQUARE_TWO);
    assert_eq!(got.warnings, ["3 bytes after the last element are not read."]);
}
