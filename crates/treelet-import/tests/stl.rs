//! STL files, small enough to be seen whole.

mod common;

use common::{LOWER, LOWER_STL, UPPER, binary_stl, check, check_error, model};

#[test]
fn binary_whatever_its_header_says() {
    for header in ["", "solid", "solid cube\nfacet normal 0 0 1"] {
        let got = check("a.stl", binary_stl(header.as_bytes(), &[LOWER, UPPER]), &[LOWER, UPPER]);
        assert_eq!(got.vertices_stored(), 6, "nothing is welded");
    }
    // The content tells, also under another name.
    check("a.ply", binary_stl(b"", &[LOWER]), &[LOWER]);
    check("a.stl", binary_stl(b"", &[]), &[]);
    let mut longer = binary_stl(b"solid\0", &[LOWER]);
    longer.extend([0; 7]);
    let got = check("a.stl", longer, &[LOWER]);
    assert_eq!(got.warnings, ["7 bytes after the last triangle are not read."]);
}

#[test]
fn ascii_in_any_case_and_layout() {
    let got = check("a.stl", LOWER_STL, &[LOWER]);
    assert_eq!(got.objects[0].name, "a b");
    check("a.stl", LOWER_STL.to_ascii_uppercase().replace('\n', "\r\n"), &[LOWER]);
    let (head, body) = LOWER_STL.split_once('\n').expect("two lines");
    check("a.stl", format!("\u{feff}{head}\n{}", body.replace('\n', " ")), &[LOWER]);
    check("a.stl", LOWER_STL.replace("normal 0 0 1", "normal nan -nan(ind) x"), &[LOWER]);
}

#[test]
fn solids_are_parts_and_empty_ones_are_none() {
    let other = LOWER_STL.replace("vertex 1 0 0", "vertex 1 1 0").replacen("1 1 0", "X", 1);
    let other = other.replace("vertex 1 1 0", "vertex 0 1 0").replace('X', "1 1 0");
    let text = format!("{LOWER_STL}solid empty\nendsolid\n{other}");
    let got = check("a.stl", text, &[LOWER, UPPER]);
    assert_eq!(got.objects[0].parts.len(), 2);
    let none = model("a.stl", "solid nothing\nendsolid nothing\n");
    assert_eq!(none.warnings, ["The file holds no triangles."]);
}

#[test]
fn loops_of_four_are_split() {
    let text = LOWER_STL.replace("vertex 1 1 0\n", "vertex 1 1 0\nvertex 0 1 0\n");
    check("a.stl", text, &[LOWER, UPPER]);
}

#[test]
fn truncation_is_found_at_every_line() {
    let lines: Vec<&str> = LOWER_STL.lines().collect();
    for len in 1..lines.len() {
        check_error("a.stl", lines[..len].join("\n"), "the file ends before \"end");
    }
    let binary = binary_stl(b"", &[LOWER]);
    for len in 84..binary.len() {
        check_error("a.stl", &binary[..len], "byte 80: 1 triangles need 134 bytes, the file has");
    }
}
