//! What the tests of all formats share: data in, data out.

#![allow(dead_code, reason = "each test binary uses its own share")]

pub(crate) mod doc;
pub(crate) mod packing;

use treelet_import::{ImportError, Options, load_bytes};
use treelet_model::Model;

/// A triangle by its corners.
pub(crate) type Corners = [[f32; 3]; 3];

/// Reads a file from memory.
pub(crate) fn read(name: &str, bytes: impl AsRef<[u8]>) -> Result<Model, ImportError> {
    load_bytes(name, bytes.as_ref(), &Options::default())
}

/// Reads a file that is sound.
pub(crate) fn model(name: &str, bytes: impl AsRef<[u8]>) -> Model {
    read(name, bytes).unwrap_or_else(|error| panic!("{error}"))
}

/// Every triangle of every placement, in order, in the world.
pub(crate) fn soup(model: &Model) -> Vec<Corners> {
    let mut triangles = Vec::new();
    for placement in &model.placements {
        for part in &model.objects[placement.object].parts {
            for prim in 0..part.mesh.triangles().len() {
                let corners = part.mesh.corners(prim).expect("indices are in range");
                triangles.push(corners.map(|p| placement.world_from_object.point(p)));
            }
        }
    }
    triangles
}

/// Checks that a file holds exactly these triangles, corner by corner.
#[track_caller]
pub(crate) fn check(name: &str, bytes: impl AsRef<[u8]>, want: &[Corners]) -> Model {
    let model = model(name, bytes);
    assert_eq!(soup(&model), want, "{name}");
    model
}

/// Checks that a file is refused in these words.
#[track_caller]
pub(crate) fn check_error(name: &str, bytes: impl AsRef<[u8]>, want: &str) {
    match read(name, bytes) {
        Ok(_) => panic!("{name} was read, but should give: {want}"),
        Err(error) => assert!(error.to_string().contains(want), "{error}\nshould contain: {want}"),
    }
}

/// Three corners of a unit square in the xy plane, and the other three.
pub(crate) const LOWER: Corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]];
pub(crate) const UPPER: Corners = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
/// Corners of that square, in order.
pub(crate) const SQUARE: [[f32; 3]; 4] =
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

/// Numbers as little-endian bytes.
pub(crate) fn le(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// A GLB of JSON and one buffer.
pub(crate) fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let pad = |bytes: &[u8], with: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), with);
        bytes
    };
    let mut out = Vec::new();
    for (kind, chunk) in [(b"JSON", pad(json.as_bytes(), b' ')), (b"BIN\0", pad(binary, 0))] {
        out.extend((chunk.len() as u32).to_le_bytes());
        out.extend(kind);
        out.extend(chunk);
    }
    let length = out.len() as u32 + 12;
    let mut glb = b"glTF".to_vec();
    glb.extend(2_u32.to_le_bytes());
    glb.extend(length.to_le_bytes());
    glb.extend(out);
    glb
}

/// The unit square as a GLB: four positions, then six u16 indices. `extra` is put into the root,
/// `node` is the only node.
pub(crate) fn square_glb(node: &str, extra: &str) -> Vec<u8> {
    let mut binary = le(SQUARE.as_flattened());
    binary.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|index| index.to_le_bytes()));
    glb(&square_json(node, "", extra), &binary)
}

/// The JSON of [`square_glb`]; `uri` is put into the buffer.
pub(crate) fn square_json(node: &str, uri: &str, extra: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{node}],
        "meshes":[{{"name":"square","primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},
                     {{"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":48}},
                       {{"buffer":0,"byteOffset":48,"byteLength":12}}],
        "buffers":[{{{uri}"byteLength":60}}]{extra}}}"#
    )
}

/// A binary STL of triangles.
pub(crate) fn binary_stl(header: &[u8], triangles: &[Corners]) -> Vec<u8> {
    let mut bytes = header.to_vec();
    bytes.resize(80, b' ');
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        bytes.extend(le(&[0.0, 0.0, 1.0]));
        bytes.extend(le(triangle.as_flattened()));
        bytes.extend([0, 0]);
    }
    bytes
}

/// The common binary PLY: three f32, then u8 counts and i32 indices.
pub(crate) fn binary_ply(positions: &[[f32; 3]], faces: &[&[i32]]) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\n\
         property float y\nproperty float z\nelement face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        positions.len(),
        faces.len()
    )
    .into_bytes();
    bytes.extend(le(positions.as_flattened()));
    for face in faces {
        bytes.push(face.len() as u8);
        bytes.extend(face.iter().flat_map(|index| index.to_le_bytes()));
    }
    bytes
}

/// The unit square as OBJ.
pub(crate) const SQUARE_OBJ: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n";

/// The unit square as ascii PLY.
pub(crate) const SQUARE_PLY: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\n\
    property float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_index\n\
    end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";

/// One triangle as ascii STL.
pub(crate) const LOWER_STL: &str = "solid a b\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   \
    vertex 1 0 0\n   vertex 1 1 0\n  endloop\n endfacet\nendsolid a b\n";
