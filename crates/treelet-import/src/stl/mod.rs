//! STL, ascii and binary (3D Systems, "Stereolithography Interface Specification", 1988).
//!
//! A binary file is 80 bytes of anything, a count, and 50 bytes a triangle. Its first bytes may read
//! `solid`, as an ascii file's do, so a file whose size fits its count exactly is binary.
//! Vertices stay as they are, three a triangle; equal corners have equal bits, so nothing leaks.
//! Facet normals and attribute bytes are not read. Several solids are parts of one object.

mod ascii;
mod binary;

use treelet::Mesh;
use treelet_model::{Material, Model, Object, Part, Placement};

use crate::catalogue::{Importer, Info};
use crate::error::Result;
use crate::source::Source;
use crate::stream::Stream;
use crate::text;

/// The format, as the catalogue names it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stl;

impl Importer for Stl {
    fn info(&self) -> Info {
        Info {
            name: "stl",
            extensions: &["stl"],
            summary: "STL, ascii and binary, one solid or several",
        }
    }

    fn sniff(&self, bytes: &[u8]) -> bool {
        binary::size_fits(bytes) || ascii::starts_like(bytes)
    }

    fn read(&self, source: &Source<'_>) -> Result<Model> {
        source.whole(text::refuse_utf16(source.bytes))?;
        let bytes = source.bytes;
        if !binary::size_fits(bytes) && ascii::starts_like(bytes) {
            ascii::read(source)
        } else {
            binary::read(source)
        }
    }

    fn stream(&self, stream: &mut Stream<'_>) -> Result<Option<Model>> {
        binary::stream(stream)
    }
}

/// A model of solids, each a list of triangle corners.
fn model(
    source: &Source<'_>,
    name: String,
    solids: Vec<Vec<[f32; 3]>>,
    warnings: Vec<String>,
) -> Result<Model> {
    let mut parts = Vec::new();
    for corners in solids {
        let mut triangles = source.vec(corners.len() / 3, "triangles")?;
        triangles.extend((0..corners.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]));
        parts.push(Part::new(Mesh::new(corners, triangles), 0));
    }
    Ok(Model {
        objects: vec![Object { name, parts }],
        placements: vec![Placement { object: 0, world_from_object: Default::default() }],
        materials: vec![Material::default()],
        warnings,
        ..Model::default()
    })
}

/// Vertex indices are 32-bit.
const TRIANGLES_MAX: usize = u32::MAX as usize / 3;
