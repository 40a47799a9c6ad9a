//! The vertices of a PLY file.

use crate::error::{Place, Result};
use crate::source::Source;

use super::header::{Element, Kind, Type};
use super::rows::{POLL_ROWS, Rows};

/// What a vertex element holds for us.
#[derive(Debug)]
pub(super) struct Vertices {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) normals: Option<Vec<[f32; 3]>>,
}

/// Columns that are read, in the order of the slots below.
const NAMES: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];
/// Where the values of other columns go.
const SPARE: usize = NAMES.len();

/// Reads all rows of the vertex element.
pub(super) fn read<'a, R: Rows<'a>>(
    source: &Source<'a>,
    element: &Element,
    rows: &mut R,
    warnings: &mut Vec<String>,
) -> Result<Vertices> {
    // Find the columns.
    let columns = NAMES.map(|name| element.find(&[name]));
    let has = |range: &[Option<usize>]| range.iter().all(Option::is_some);
    if !has(&columns[..3]) {
        return Err(source.broken(
            Place::Line(element.line),
            "the element \"vertex\" lacks x, y or z",
            "export the file again, with positions",
        ));
    }
    let has_normals = has(&columns[3..]);
    if element.find(&["red", "diffuse_red", "r"]).is_some() {
        warnings.push("Vertex colours are not read.".to_owned());
    }
    let Ok(count) = usize::try_from(element.count) else {
        let found = format!("{} vertices are more than this machine can address", element.count);
        return Err(source.broken(Place::Line(element.line), found, "split the file"));
    };
    let mut positions = source.vec(count, "vertex positions")?;
    let mut normals = if has_normals { Some(source.vec(count, "vertex normals")?) } else { None };

    if let (Some(stride), Some(offset), false) =
        (element.fixed_row(), packed_xyz(element), has_normals)
        && R::LITTLE_ENDIAN
    {
        read_packed(rows, stride, offset, count, &mut positions)?;
        return Ok(Vertices { positions, normals });
    }

    // Read row by row, each value into its slot.
    let slots: Vec<(Kind, usize)> = element
        .properties
        .iter()
        .enumerate()
        .map(|(i, property)| {
            let slot = columns.iter().position(|&column| column == Some(i));
            (property.kind, slot.unwrap_or(SPARE))
        })
        .collect();
    let mut values = [0.0_f64; SPARE + 1];
    for row in 0..element.count {
        if row.is_multiple_of(POLL_ROWS) {
            source.check_cancelled()?;
        }
        for &(kind, slot) in &slots {
            match kind {
                Kind::Scalar(kind) => values[slot] = rows.value(kind)?,
                list => rows.skip_kind(list)?,
            }
        }
        rows.end_row()?;
        let [x, y, z, nx, ny, nz, _] = values.map(|value| value as f32);
        positions.push([x, y, z]);
        if let Some(normals) = &mut normals {
            normals.push([nx, ny, nz]);
        }
    }
    Ok(Vertices { positions, normals })
}

/// The offset of x, y, z in a row if they are three f32 one after another.
fn packed_xyz(element: &Element) -> Option<usize> {
    let x = element.find(&["x"])?;
    let [a, b, c] = element.properties.get(x..x + 3)?.first_chunk()?;
    let in_order = a.name == "x" && b.name == "y" && c.name == "z";
    let is_f32 = [a, b, c].iter().all(|property| property.kind == Kind::Scalar(Type::F32));
    let before =
        element.properties[..x].iter().try_fold(0, |sum, property| match property.kind {
            Kind::Scalar(kind) => Some(sum + kind.bytes()),
            Kind::List { .. } => None,
        })?;
    (in_order && is_f32).then_some(before)
}

/// The fast path: rows of `stride` bytes with x, y, z as f32 at `offset`.
fn read_packed<'a, R: Rows<'a>>(
    rows: &mut R,
    stride: usize,
    offset: usize,
    count: usize,
    positions: &mut Vec<[f32; 3]>,
) -> Result<()> {
    let Some(bytes) = count.checked_mul(stride).and_then(|len| rows.take(len)) else {
        return Err(rows.source().broken(
            rows.place(),
            "the vertices are cut short",
            crate::error::DAMAGED,
        ));
    };
    let float = |row: &[u8], at: usize| {
        row.get(at..)
            .and_then(|rest| rest.first_chunk())
            .map_or(0.0, |four| f32::from_le_bytes(*four))
    };
    positions.extend(
        bytes
            .chunks_exact(stride)
            .map(|row| [float(row, offset), float(row, offset + 4), float(row, offset + 8)]),
    );
    Ok(())
}
