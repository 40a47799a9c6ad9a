//! The catalogue, and files that are in no format of it.

mod common;

use common::{SQUARE_OBJ, SQUARE_PLY, check_error, read, square_glb};
use treelet_import::ALL;

#[test]
fn names_and_extensions_are_unique() {
    let mut names: Vec<&str> = Vec::new();
    for importer in ALL {
        let info = importer.info();
        assert!(info.summary.len() > 10 && !info.extensions.is_empty());
        names.push(info.name);
        names.extend(info.extensions.iter().filter(|extension| **extension != info.name));
    }
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count, "{names:?}");
}

#[test]
fn content_comes_before_extension() {
    for name in ["a.stl", "a.obj.gz", "a.xyz", "a", ""] {
        for bytes in
            [SQUARE_OBJ.as_bytes(), SQUARE_PLY.as_bytes(), &square_glb(r#"{"mesh":0}"#, "")]
        {
            assert_eq!(
                read(name, bytes).map(|model| model.triangles_placed()).ok(),
                Some(2),
                "{name}"
            );
        }
    }
    // Without content only the extension is left.
    assert!(read("A.OBJ", "# nothing but a remark\n").is_ok());
    assert!(read("a.OBJ.GZ", "").is_ok());
}

#[test]
fn other_formats_are_named() {
    let table: [(&str, &[u8], &str); 10] = [
        (
            "a",
            b"ISO-10303-21;\n",
            "a: is IFC, which treelet does not read yet; convert it with IfcOpenShell",
        ),
        ("a", b"Kaydara FBX Binary  \0", "is FBX, which"),
        ("a", b"#usda 1.0\n", "is USD, which"),
        ("a", b"PXR-USDC", "is USD, which"),
        ("a.usdz", b"PK\x03\x04", "is a ZIP archive, which"),
        ("a", b"<?xml version=\"1.0\"?>\n<COLLADA>", "is COLLADA, which"),
        ("a", b"Ogawa\xff", "is Alembic, which"),
        ("a.3ds", b"MM\0\0", "is 3DS, which"),
        ("a.dae.zst", b"what", "is COLLADA, which"),
        (
            "a.txt",
            b"hello",
            "a.txt: is in no format that treelet knows; it reads gltf (.glb, .gltf), ply (.ply),",
        ),
    ];
    for (name, bytes, want) in table {
        check_error(name, bytes, want);
    }
}
