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
    pub(super) uvs: Option<Vec<[f32; 2]>>,
}

/// Columns that are read, in the order of the slots below.
const NAMES: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];
/// What programs call texture coordinates, which come after them.
const UVS: [[&str; 2]; 4] = [["u", "v"], ["s", "t"], ["texture_u", "texture_v"], ["s0", "t0"]];
/// Where the values of other columns go.
const SPARE: usize = NAMES.len() + 2;

/// Reads all rows of the vertex element.
pub(super) fn read<'a, R: Rows<'a>>(
    source: &Source<'a>,
    element: &Element,
    rows: &mut R,
    warnings: &mut Vec<String>,
) -> Result<Vertices> {
    let mut vertices = empty(source, element, warnings)?;
    append(source, element, rows, &mut vertices)?;
    Ok(vertices)
}

/// No vertices yet, with room for all rows of the element.
pub(super) fn empty(
    source: &Source<'_>,
    element: &Element,
    warnings: &mut Vec<String>,
) -> Result<Vertices> {
    let has = |names: &[&str]| names.iter().all(|name| element.find(&[name]).is_some());
    if !has(&NAMES[..3]) {
        return Err(source.broken(
            Place::Line(element.line),
            "the element \"vertex\" lacks x, y or z",
            "export the file again, with positions",
        ));
    }
    if element.find(&["red", "diffuse_red", "r"]).is_some() {
        warnings.push("Vertex colours are not read.".to_owned());
    }
    let Ok(count) = usize::try_from(element.count) else {
        let found = format!("{} vertices are more than this machine can address", element.count);
        return Err(source.broken(Place::Line(element.line), found, "split the file"));
    };
    let positions = source.vec(count, "vertex positions")?;
    let has_normals = has(&NAMES[3..6]);
    let normals = if has_normals { Some(source.vec(count, "vertex normals")?) } else { None };
    let uvs = match UVS.iter().find(|names| has(&names[..])) {
        Some(_) => Some(source.vec(count, "texture coordinates")?),
        None => None,
    };
    Ok(Vertices { positions, normals, uvs })
}

/// Reads the rows of a part of the vertex element, for which there is room.
pub(super) fn append<'a, R: Rows<'a>>(
    source: &Source<'a>,
    element: &Element,
    rows: &mut R,
    vertices: &mut Vertices,
) -> Result<()> {
    let Vertices { positions, normals, uvs } = vertices;
    if let (Some(stride), Some(offset), None, None) =
        (element.fixed_row(), packed_xyz(element), &normals, &uvs)
        && R::LITTLE_ENDIAN
    {
        let count = usize::try_from(element.count).unwrap_or(usize::MAX);
        return read_packed(rows, stride, offset, count, positions);
    }

    // Read row by row, each value into its slot.
    let uv_names =
        UVS.iter().find(|names| names.iter().all(|name| element.find(&[name]).is_some()));
    let uv_names = uv_names.unwrap_or(&UVS[0]);
    let names =
        [NAMES[0], NAMES[1], NAMES[2], NAMES[3], NAMES[4], NAMES[5]].into_iter().chain(*uv_names);
    let columns: Vec<Option<usize>> = names.map(|name| element.find(&[name])).collect();
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
        let [x, y, z, nx, ny, nz, u, v, _] = values.map(|value| value as f32);
        positions.push([x, y, z]);
        if let Some(normals) = normals {
            normals.push([nx, ny, nz]);
        }
        if let Some(uvs) = uvs {
            // Files count v from below.
            uvs.push([u, 1.0 - v]);
        }
    }
    Ok(())
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
