//! OFF files, small enough to be seen whole.

mod common;

use common::{LOWER, SQUARE, UPPER, check, check_error};

const SQUARE_OFF: &str =
    "OFF\n# a square\n4 1 0\n\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 255 0 0\n";

#[test]
fn keywords_and_layouts() {
    let square = [LOWER, UPPER];
    check("a.off", SQUARE_OFF, &square);
    check("a", SQUARE_OFF, &square);
    check("a.off", SQUARE_OFF.replace('\n', "\r\n"), &square);
    check("a.off", SQUARE_OFF.replacen("OFF\n# a square\n4", "OFF 4", 1), &square);
    check("a.off", SQUARE_OFF.replacen("OFF\n# a square\n4", "OFF4", 1), &square);
    check("a.off", SQUARE_OFF.replacen("OFF\n# a square\n", "", 1), &square);
    let colored = SQUARE_OFF.replace("OFF", "COFF").replace("0 1 0\n", "0 1 0 255 0 0 255\n");
    check("a.off", colored, &square);
}

#[test]
fn normals_are_read() {
    let normals = SQUARE_OFF.replace("OFF", "NOFF").replace(" 0\n1", " 0 0 0 2\n1");
    let normals = normals.replace("1 1 0\n", "1 1 0 0 0 2\n").replace("0 1 0\n4", "0 1 0 0 0 2\n4");
    let normals = normals.replace("4 1 0 0 0 2\n", "4 1 0\n");
    let got = check("a.off", &normals, &[LOWER, UPPER]);
    let part = &got.objects[0].parts[0];
    assert_eq!(part.normals.as_ref().map(|n| n.to_vec()), Some(vec![[0.0, 0.0, 1.0]; 4]));
    assert_eq!(part.mesh.positions(), SQUARE);
}

#[test]
fn what_is_wrong_has_a_line() {
    for (from, to, want) in [
        (
            "4 1 0",
            "353535235358 6 0",
            "line 3: the number of vertices is 353535235358, which takes 2121211412148 bytes",
        ),
        ("4 1 0", "4 x 0", "line 3: the number of faces is \"x\", not a number"),
        ("1 1 0", "1 y 0", "line 7: y is \"y\", not a number"),
        ("4 0 1 2 3 255 0 0", "4 0 1 2", "line 9: a face of 4 corners names 3"),
        ("4 0 1 2 3 255 0 0", "4 0 1 2 9", "line 9: names vertex 9 of 4"),
        ("4 0 1 2 3 255 0 0", "", "line 9: the file ends too early"),
        ("OFF\n", "4OFF\n", "line 1: has vertices in four or more dimensions"),
        ("OFF\n", "OFF BINARY\n", "line 1: is binary OFF"),
    ] {
        assert!(SQUARE_OFF.contains(from), "{from}");
        check_error("a.off", SQUARE_OFF.replacen(from, to, 1), want);
    }
}
