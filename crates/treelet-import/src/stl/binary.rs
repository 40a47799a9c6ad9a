//! Binary STL.

use treelet_model::Model;

use crate::error::{DAMAGED, Place, Result, counted};
use crate::source::Source;
use crate::stream::Stream;

/// Free text, then the count.
const HEADER: usize = 84;
/// A normal and three corners of three f32 each, and two bytes of attributes.
const ROW: usize = 50;
/// Where the corners start in a row.
const CORNERS: usize = 12;

/// The count of triangles that the header claims.
fn count(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(HEADER - 4..)?.first_chunk()?;
    usize::try_from(u32::from_le_bytes(*count)).ok()
}

/// Whether the file has exactly the size that its count calls for.
pub(super) fn size_fits(bytes: &[u8]) -> bool {
    count(bytes).is_some_and(|count| count.checked_mul(ROW) == bytes.len().checked_sub(HEADER))
}

/// Reads a binary file.
pub(super) fn read(source: &Source<'_>) -> Result<Model> {
    let bytes = source.bytes;
    let Some(count) = count(bytes) else {
        let found =
            format!("{} bytes are no STL file: the header alone takes {HEADER}", bytes.len());
        return Err(source.broken(Place::Byte(0), found, DAMAGED));
    };
    let needed = HEADER as u64 + count as u64 * ROW as u64;
    let len = count.checked_mul(ROW);
    let Some(rows) = len.and_then(|len| bytes[HEADER..].get(..len)) else {
        let found = format!(
            "{count} triangles need {needed} bytes, the file has {} and does not start with \
             \"solid\"",
            bytes.len()
        );
        return Err(source.broken(Place::Byte(HEADER as u64 - 4), found, DAMAGED));
    };
    if count > super::TRIANGLES_MAX {
        let found = format!("{count} triangles have more corners than 32 bits count");
        return Err(source.broken(Place::Byte(HEADER as u64 - 4), found, "split the file"));
    }
    let rest = bytes.len() as u64 - needed;
    let warnings = match rest {
        0 => vec![],
        _ => {
            let one = "byte after the last triangle is";
            let several = "bytes after the last triangle are";
            vec![format!("{} not read.", counted(rest, one, several))]
        }
    };

    let mut corners = source.vec(count * 3, "vertex positions")?;
    take_rows(rows, &mut corners);
    super::model(source, String::new(), vec![corners], warnings)
}

/// Takes three corners from each row of 50 bytes.
fn take_rows(rows: &[u8], corners: &mut Vec<[f32; 3]>) {
    let (rows, _) = rows.as_chunks::<ROW>();
    for row in rows {
        let (words, _) = row[CORNERS..].as_chunks::<4>();
        let x = |i: usize| f32::from_le_bytes(words[i]);
        corners.extend([[x(0), x(1), x(2)], [x(3), x(4), x(5)], [x(6), x(7), x(8)]]);
    }
}

/// Reads a large file through a window, if its size is what its count calls for.
pub(super) fn stream(stream: &mut Stream<'_>) -> Result<Option<Model>> {
    let Some(count) = count(stream.bytes()) else { return Ok(None) };
    let is_sure = stream.len() == HEADER as u64 + count as u64 * ROW as u64;
    if !is_sure || count > super::TRIANGLES_MAX {
        return Ok(None);
    }
    let mut corners = stream.source().vec(count * 3, "vertex positions")?;
    stream.advance(HEADER)?;
    while corners.len() < 3 * count {
        let whole = stream.bytes().len() / ROW * ROW;
        take_rows(&stream.bytes()[..whole], &mut corners);
        stream.advance(whole)?;
    }
    super::model(&stream.source(), String::new(), vec![corners], Vec::new()).map(Some)
}
