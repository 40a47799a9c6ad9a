//! OBJ files, small enough to be seen whole, and their material libraries.

mod common;

use common::{LOWER, SQUARE_OBJ, UPPER, check, check_error, model};

const V: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 2\n";

#[test]
fn all_forms_of_indices() {
    let square = [LOWER, UPPER];
    check("a.obj", SQUARE_OBJ, &square);
    check("a.obj", SQUARE_OBJ.replace('\n', "\r\n"), &square);
    check("a.obj", SQUARE_OBJ.replace('\n', "\r"), &square);
    for faces in [
        "f 1 2 3 4",
        "f 1/1 2/1 3/1 4/1",
        "f 1// 2// 3// 4//",
        "f -4 -3 -2 -1 # all of them",
        "f 1 2 \\\n 3 \\\r\n4",
        "fo 1 2 3 4",
        "s off\ng a b\nf 1 2 3\nl 1 2\np 1\nf 1 3 4\n",
    ] {
        let got = check("a.obj", format!("{V}{faces}"), &square);
        assert!(got.objects[0].parts[0].normals.is_none(), "{faces}");
        assert_eq!(got.vertices_stored(), 4, "{faces}");
    }
    for faces in ["f 1//1 2//1 3//1 4//1", "f 1/1/1 2/1/1 3/1/1 4/1/-1", "f -4//-1 2//1 3//1 4//1"]
    {
        let got = check("a.obj", format!("{V}{faces}"), &square);
        let normals = got.objects[0].parts[0].normals.as_ref().expect("it has normals");
        assert_eq!(normals[..], [[0.0, 0.0, 1.0]; 4], "{faces}");
    }
}

#[test]
fn backward_indices_count_from_their_line() {
    check("a.obj", "v 9 9 9\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf -3 -2 -1\nv 5 5 5\n", &[LOWER]);
}

#[test]
fn vertices_with_several_normals_are_split() {
    let text = format!("{V}vn 1 0 0\nf 1//1 2//1 3//1\nf 1//2 3//1 4\n");
    let got = check("a.obj", text, &[LOWER, UPPER]);
    let part = &got.objects[0].parts[0];
    assert_eq!(part.mesh.triangles(), [[0, 1, 2], [3, 2, 4]]);
    let (up, right) = ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]);
    // The corner without a normal gets that of its triangle.
    let normals = part.normals.as_ref().expect("it has normals");
    assert_eq!(normals[..], [up, up, up, right, up]);
    assert_eq!(got.warnings, ["1 normal that is missing or of no length was replaced."]);
}

#[test]
fn parts_follow_materials() {
    let text = format!("{V}o thing\nusemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\nusemtl a\nf 2 3 4\n");
    let got = model("a.obj", text);
    assert_eq!(got.objects.len(), 1);
    assert_eq!(got.objects[0].name, "thing");
    let triangles = |part: usize| got.objects[0].parts[part].mesh.triangles();
    assert_eq!(triangles(0), [[0, 1, 2], [1, 2, 3]]);
    assert_eq!(triangles(1), [[0, 1, 2]]);
    let names: Vec<&str> = got.materials.iter().map(|material| &*material.name).collect();
    assert_eq!(names, ["a", "b"]);
    assert_eq!(got.warnings, ["2 materials are not in any library; shown grey."]);
}

#[test]
fn vertices_alone_are_an_empty_part() {
    for text in [V, "# nothing\n"] {
        let got = check("a.obj", text, &[]);
        assert_eq!((got.objects[0].parts.len(), got.materials.len()), (1, 1), "{text}");
        assert_eq!(got.warnings, ["The file holds no triangles."], "{text}");
    }
}

#[test]
fn faces_too_small_are_counted() {
    let got = check("a.obj", format!("{V}f 1\nf 1 2\nf\nf 1 2 3\n"), &[LOWER]);
    assert_eq!(got.warnings, ["3 faces have fewer than three corners; left out."]);
    let got = check("a.obj", format!("{V}f 1\nuv 0\nf 1 2 3\n"), &[LOWER]);
    let unknown = "1 line starts with no known word, the first is line 8 with \"uv\"; left out.";
    assert_eq!(got.warnings, [unknown, "1 face has fewer than three corners; left out."]);
}

#[test]
fn what_is_no_number_has_a_line() {
    check_error(
        "a.obj",
        "v 0 0 0\n\nv 1,5 0 0",
        "a.obj: line 3: x is \"1,5\", not a number; write a decimal point",
    );
    check_error("a.obj", "v 0 0", "a.obj: line 1: z is missing; add it");
    check_error("a.obj", format!("{V}f 1 2 x"), "a.obj: line 7: \"x\" is no corner of a face");
    check_error("a.obj", format!("{V}f 1 2 3/1/1/1"), "is no corner of a face");
    check_error(
        "a.obj",
        format!("{V}f 1 2 0"),
        "vertex 0 of a face, with 4 so far; indices are counted from 1",
    );
    check_error(
        "a.obj",
        format!("{V}f 1 2 -5"),
        "vertex -5 of a face, with 4 so far; the file is damaged",
    );
    check_error(
        "a.obj",
        format!("{V}f 1//1 2//2 3//1"),
        "line 7: normal 2 of a face, with 1 so far",
    );
    check_error("a.obj", format!("{V}f 1 2 99999999999999999999"), "is no corner of a face");
    check_error(
        "a.obj",
        "f 1 2 3\nv 0 0 0\nv 0 0 0\nv 0 0 0\n",
        "line 1: vertex 1 of a face, with 0",
    );
    check_error("a.obj", "<html>\n", "line 1: \"<html>\" is no OBJ statement");
}

#[test]
fn utf16_is_named() {
    let units: Vec<u16> = "\u{feff}v 0 0 0\n".encode_utf16().collect();
    let little: Vec<u8> = units.iter().flat_map(|unit| unit.to_le_bytes()).collect();
    let big: Vec<u8> = units.iter().flat_map(|unit| unit.to_be_bytes()).collect();
    check_error("a.obj", little, "is text in UTF-16 (its byte order mark says UTF-16LE)");
    check_error("a.obj", big, "iconv -f UTF-16BE -t UTF-8");
}
