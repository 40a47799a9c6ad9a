//! PLY, the Stanford polygon format: ascii, and binary in either byte order.
//!
//! After Greg Turk, "The PLY Polygon File Format", 1994, with the `tristrips` element that the
//! Stanford scans use. Read are the elements `vertex` (x, y, z, nx, ny, nz of any type, in any
//! order), `face` and `tristrips`; all others are stepped over.
//!
//! The reader is our own: a header and a row decoder for all types and orders are short, and they
//! leave room for the two loops that take nearly all files, rows of a fixed size that hold three
//! little-endian f32, and faces that are a u8 count and u32 indices. A library that builds a map of
//! named values for each row is several times slower and allocates what a header claims.
//! Measured: 1.4 million triangles and 0.7 million vertices in 0.03 s, the
//! file being in memory.

mod faces;
mod header;
mod rows;
mod stream;
mod vertices;

use treelet::Mesh;
use treelet_model::{Material, Model, Object, Part, Placement};

use crate::catalogue::{Importer, Info};
use crate::error::{Place, Result, counted, quote};
use crate::normals;
use crate::source::Source;
use crate::stream::Stream;
use crate::text;

use faces::Faces;
use header::{Element, Encoding, Header};
use rows::{Ascii, Binary, Rows};
use vertices::Vertices;

/// The format, as the catalogue names it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ply;

impl Importer for Ply {
    fn info(&self) -> Info {
        Info {
            name: "ply",
            extensions: &["ply"],
            summary: "PLY, ascii and binary: triangles, polygons, strips, vertex normals",
        }
    }

    fn sniff(&self, bytes: &[u8]) -> bool {
        bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r")
    }

    fn read(&self, source: &Source<'_>) -> Result<Model> {
        source.whole(text::refuse_utf16(source.bytes))?;
        let header = header::read(source)?;
        match header.encoding {
            Encoding::Ascii => read_body(source, &header, Ascii::new(source, header.bytes)),
            Encoding::BinaryLittle => {
                read_body(source, &header, Binary::<false>::new(source, header.bytes))
            }
            Encoding::BinaryBig => {
                read_body(source, &header, Binary::<true>::new(source, header.bytes))
            }
        }
    }

    fn stream(&self, stream: &mut Stream<'_>) -> Result<Option<Model>> {
        if !self.sniff(stream.bytes()) {
            return Ok(None);
        }
        let header = header::read(&stream.source())?;
        stream::read(stream, &header)
    }
}

/// The warning about bytes behind all elements.
fn not_read(rest: u64) -> String {
    let one = "byte after the last element is";
    let several = "bytes after the last element are";
    format!("{} not read.", counted(rest, one, several))
}

/// Reads the elements in the file's order; faces that stand before the vertices are read last.
fn read_body<'a, R: Rows<'a>>(source: &Source<'a>, header: &Header, mut rows: R) -> Result<Model> {
    let mut vertices: Option<Vertices> = None;
    let mut faces = Faces::new(source);
    let mut waiting: Vec<(&Element, R)> = Vec::new();
    let mut warnings = Vec::new();
    let mut unread = 0;
    let mut first_unread: Option<&String> = None;
    for element in &header.elements {
        rows.check_room(element)?;
        match element.name.as_str() {
            "vertex" => vertices = Some(vertices::read(source, element, &mut rows, &mut warnings)?),
            "face" | "tristrips" => match &vertices {
                Some(vertices) => faces.read(element, &mut rows, &vertices.positions)?,
                None => {
                    waiting.push((element, rows.clone()));
                    rows.skip(element)?;
                }
            },
            _ => {
                rows.skip(element)?;
                if element.count > 0 {
                    unread += 1;
                    first_unread.get_or_insert(&element.name);
                }
            }
        }
    }
    let Some(vertices) = vertices else {
        return Err(source.broken(
            Place::Element("header".to_owned()),
            "has no element \"vertex\"",
            "export the file again, with vertices",
        ));
    };
    for (element, mut rows) in waiting {
        faces.read(element, &mut rows, &vertices.positions)?;
    }
    if let Some(name) = first_unread {
        let name = quote(name.as_bytes());
        warnings.push(match unread {
            1 => format!("The PLY element {name} is not read."),
            _ => format!("{unread} PLY elements are not read; the first is {name}."),
        });
    }
    let rest = rows.rest();
    if rest > 0 {
        warnings.push(not_read(rest));
    }
    Ok(model(vertices, faces, warnings))
}

/// Puts the arrays together.
fn model(vertices: Vertices, faces: Faces<'_, '_>, mut warnings: Vec<String>) -> Model {
    warnings.extend(faces.warnings());
    let mesh = Mesh::new(vertices.positions, faces.triangles);
    let normals = vertices.normals.map(|mut array| {
        let replaced = normals::repair(&mut array, &mesh);
        if replaced > 0 {
            warnings.push(normals::replaced(replaced));
        }
        array.into()
    });
    let uvs = vertices.uvs.map(Into::into).into_iter().collect();
    let part = Part { normals, uvs, ..Part::new(mesh, 0) };
    Model {
        objects: vec![Object { name: String::new(), parts: vec![part] }],
        placements: vec![Placement { object: 0, world_from_object: Default::default() }],
        materials: vec![Material::default()],
        warnings,
        ..Model::default()
    }
}
