//! Large binary PLY files, read through a window: vertices of a fixed size first, then faces.
//!
//! Whole rows of the window are handed to the readers of whole files as a small file of their own.
//! Files with another order of elements are left to those readers.

use treelet_model::Model;

use crate::error::Result;
use crate::stream::Stream;

use super::faces::Faces;
use super::header::{Element, Encoding, Header, Kind, Type};
use super::rows::{Binary, Rows};
use super::vertices::{self, Vertices};

/// Reads a file of the usual order of elements; `None` leaves others to be read whole.
pub(super) fn read(stream: &mut Stream<'_>, header: &Header) -> Result<Option<Model>> {
    match header.encoding {
        Encoding::Ascii => Ok(None),
        Encoding::BinaryLittle => read_binary::<false>(stream, header),
        Encoding::BinaryBig => read_binary::<true>(stream, header),
    }
}

fn read_binary<const BIG: bool>(stream: &mut Stream<'_>, header: &Header) -> Result<Option<Model>> {
    let [vertex, others @ ..] = &header.elements[..] else { return Ok(None) };
    let is_usual = vertex.name == "vertex"
        && others.iter().all(|other| matches!(other.name.as_str(), "face" | "tristrips"));
    let (Some(stride @ 1..), true) = (vertex.fixed_row(), is_usual) else { return Ok(None) };
    let after = (header.bytes as u64).saturating_add(vertex.count.saturating_mul(stride as u64));
    // What does not fit is told by those who read it whole.
    if after > stream.len() {
        return Ok(None);
    }
    stream.advance(header.bytes)?;
    let mut warnings = Vec::new();
    let vertices = read_vertices::<BIG>(stream, vertex, stride, &mut warnings)?;
    let whole = stream.whole();
    let mut faces = Faces::new(&whole);
    for element in others {
        read_faces::<BIG>(stream, element, &mut faces, &vertices.positions)?;
    }
    if stream.rest() > 0 {
        warnings.push(super::not_read(stream.rest()));
    }
    Ok(Some(super::model(vertices, faces, warnings)))
}

/// Reads all vertices, window by window.
fn read_vertices<const BIG: bool>(
    stream: &mut Stream<'_>,
    element: &Element,
    stride: usize,
    warnings: &mut Vec<String>,
) -> Result<Vertices> {
    let mut all = vertices::empty(&stream.source(), element, warnings)?;
    let mut left = element.count;
    while left > 0 {
        let rows = (stream.bytes().len() / stride) as u64;
        let count = rows.min(left);
        let part = Element { count, ..element.clone() };
        let source = stream.source();
        let mut rows = Binary::<BIG>::of_part(&source, stream.base());
        vertices::append(&source, &part, &mut rows, &mut all)?;
        left -= count;
        stream.advance(count as usize * stride)?;
    }
    Ok(all)
}

/// Reads all rows of an element of faces or strips, window by window.
fn read_faces<const BIG: bool>(
    stream: &mut Stream<'_>,
    element: &Element,
    faces: &mut Faces<'_, '_>,
    positions: &[[f32; 3]],
) -> Result<()> {
    faces.expect(element, stream.rest())?;
    let mut left = element.count;
    while left > 0 {
        // At the end of the file every row is tried, so that a cut one is told.
        let (rows, bytes) = whole_rows::<BIG>(stream.bytes(), element, left);
        let count = if stream.is_last() { left } else { rows };
        let part = Element { count, ..element.clone() };
        let source = stream.source();
        let mut rows = Binary::<BIG>::of_part(&source, stream.base());
        rows.check_room(&part)?;
        faces.read_part(&part, &mut rows, positions, element.count - left)?;
        left -= count;
        stream.advance(bytes)?;
    }
    Ok(())
}

/// How many rows the window holds whole, up to `most`, and how many bytes they take.
fn whole_rows<const BIG: bool>(bytes: &[u8], element: &Element, most: u64) -> (u64, usize) {
    let (mut rows, mut at) = (0, 0);
    while rows < most {
        match row_end::<BIG>(bytes, element, at) {
            // A row of no bytes is none that anybody writes; all of them end here.
            Some(end) if end > at => at = end,
            _ => break,
        }
        rows += 1;
    }
    (rows, at)
}

/// Where the row that starts at `at` ends; `None` if it is not all there.
fn row_end<const BIG: bool>(bytes: &[u8], element: &Element, mut at: usize) -> Option<usize> {
    for property in &element.properties {
        let (size, count) = match property.kind {
            Kind::Scalar(kind) => (kind.bytes(), 1),
            Kind::List { count, item } => {
                let len = list_len::<BIG>(bytes.get(at..at.checked_add(count.bytes())?)?, count);
                at += count.bytes();
                (item.bytes(), len)
            }
        };
        at = at.checked_add(size.checked_mul(count)?)?;
    }
    (at <= bytes.len()).then_some(at)
}

/// The length of a list; what is no length is more than any file has.
fn list_len<const BIG: bool>(bytes: &[u8], kind: Type) -> usize {
    let mut word = [0; 4];
    for (i, byte) in bytes.iter().take(4).enumerate() {
        word[if BIG { bytes.len().min(4) - 1 - i } else { i }] = *byte;
    }
    let len = u32::from_le_bytes(word);
    let is_signed = matches!(kind, Type::I8 | Type::I16 | Type::I32);
    let sign = 1_u32 << (8 * kind.bytes().min(4) - 1);
    if is_signed && len & sign != 0 { usize::MAX } else { len as usize }
}
