//! Accessors: how numbers lie in buffer views, as floats or as integers, some of them replaced.
//!
//! Integers where floats are expected are what `KHR_mesh_quantization` allows; they are read whether
//! a file names that extension or not.

use treelet_model::animation::transform::Rows;

use crate::error::{DAMAGED, Place, Result};
use crate::source::Source;

use super::json::{Accessor, Root, Sparse};
use super::views::{Views, slice};

/// Reads accessors of a document.
#[derive(Clone, Copy, Debug)]
pub(super) struct Accessors<'s, 'a> {
    pub(super) source: &'s Source<'a>,
    pub(super) root: &'s Root,
    pub(super) views: &'s Views<'s, 'a>,
}

/// Component types, by their number in the file.
const BYTE: u32 = 5120;
const UNSIGNED_BYTE: u32 = 5121;
const SHORT: u32 = 5122;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;

/// Bytes of the largest element: sixteen floats.
const LARGEST: usize = 64;

/// Elements of a view, so far apart; the last may be shorter than the distance.
struct Elements<'s> {
    bytes: &'s [u8],
    stride: usize,
}

/// Names of shapes by their number of components.
const SHAPES: [&str; 5] = ["", "SCALAR", "VEC2", "VEC3", "VEC4"];

impl<'s> Accessors<'s, '_> {
    /// `N` numbers an element, 1 to 4; integers that are normalized lie in `-1 ..= 1`.
    pub(super) fn vectors<const N: usize>(
        &self,
        index: usize,
        what: &'static str,
    ) -> Result<Vec<[f32; N]>> {
        let accessor = self.accessor(index)?;
        if accessor.shape != SHAPES[N] {
            return Err(self.wrong_type(index, accessor, SHAPES[N], what));
        }
        let most = if accessor.normalized { 1.0 } else { 0.0 };
        // Divides by the largest value, or by nothing.
        let unit = |x: f32, max: f32| if most > 0.0 { (x / max).max(-1.0) } else { x };
        match accessor.component_type {
            FLOAT => self.read(index, accessor, 4 * N, what, |row| lanes(row, f32::from_le_bytes)),
            BYTE => self.read(index, accessor, N, what, |row| {
                lanes(row, |[byte]| unit(f32::from(byte as i8), 127.0))
            }),
            UNSIGNED_BYTE => self.read(index, accessor, N, what, |row| {
                lanes(row, |[byte]| unit(f32::from(byte), 255.0))
            }),
            SHORT => self.read(index, accessor, 2 * N, what, |row| {
                lanes(row, |two| unit(f32::from(i16::from_le_bytes(two)), 32767.0))
            }),
            UNSIGNED_SHORT => self.read(index, accessor, 2 * N, what, |row| {
                lanes(row, |two| unit(f32::from(u16::from_le_bytes(two)), 65535.0))
            }),
            _ => Err(self.wrong_type(index, accessor, "FLOAT or small integers", what)),
        }
    }

    /// Colours with alpha, which is 1 where there is none; finite and not below zero.
    pub(super) fn colors(&self, index: usize) -> Result<Vec<[f32; 4]>> {
        const WHAT: &str = "colours";
        let mut colors = if self.accessor(index)?.shape == SHAPES[3] {
            let opaque: Vec<[f32; 3]> = self.vectors(index, WHAT)?;
            let mut colors = self.source.vec(opaque.len(), WHAT)?;
            colors.extend(opaque.iter().map(|&[r, g, b]| [r, g, b, 1.0]));
            colors
        } else {
            self.vectors::<4>(index, WHAT)?
        };
        for channel in colors.as_flattened_mut() {
            *channel = if channel.is_finite() { channel.max(0.0) } else { 0.0 };
        }
        Ok(colors)
    }

    /// One unsigned integer an element.
    pub(super) fn indices(&self, index: usize) -> Result<Vec<u32>> {
        const WHAT: &str = "indices";
        let accessor = self.accessor(index)?;
        if accessor.shape != "SCALAR" {
            return Err(self.wrong_type(index, accessor, "SCALAR of an UNSIGNED type", WHAT));
        }
        match accessor.component_type {
            UNSIGNED_BYTE => self.read(index, accessor, 1, WHAT, |row| u32::from(row[0])),
            UNSIGNED_SHORT => self.read(index, accessor, 2, WHAT, |row| u32::from(short(row))),
            UNSIGNED_INT => self.read(index, accessor, 4, WHAT, word),
            _ => Err(self.wrong_type(index, accessor, "SCALAR of an UNSIGNED type", WHAT)),
        }
    }

    /// Affine matrices, as rows; their last row, 0 0 0 1, is not looked at.
    pub(super) fn matrices(&self, index: usize, what: &'static str) -> Result<Vec<Rows>> {
        let accessor = self.accessor(index)?;
        if (accessor.shape.as_str(), accessor.component_type) != ("MAT4", FLOAT) {
            return Err(self.wrong_type(index, accessor, "MAT4 of FLOAT", what));
        }
        self.read(index, accessor, LARGEST, what, |bytes| {
            let entries: [f32; 16] = lanes(bytes, f32::from_le_bytes);
            // Column after column.
            let at = |row: usize, column: usize| f64::from(entries[4 * column + row]);
            [0, 1, 2].map(|row| [0, 1, 2, 3].map(|column| at(row, column)))
        })
    }

    fn accessor(&self, index: usize) -> Result<&'s Accessor> {
        let all = &self.root.accessors;
        all.get(index).ok_or_else(|| {
            let found = format!("is named, but there are {}", all.len());
            self.source.broken(place(index), found, super::INVALID)
        })
    }

    /// Reads elements of `size` bytes, and puts those of a sparse accessor in their places.
    fn read<T: Copy>(
        &self,
        index: usize,
        accessor: &Accessor,
        size: usize,
        what: &'static str,
        convert: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>> {
        let count = accessor.count;
        let mut items = match accessor.buffer_view {
            Some(view) => {
                let stride = self.views.stride(view).unwrap_or(size as u64);
                let offset = accessor.byte_offset;
                let elements = self.elements(index, view, offset, count, size, stride)?;
                let rows = elements.bytes.chunks(elements.stride);
                let mut items = self.source.vec(rows.len(), what)?;
                items.extend(rows.map(&convert));
                items
            }
            // A sparse accessor may start from zeros.
            None if accessor.sparse.is_some() => {
                let count = usize::try_from(count).unwrap_or(usize::MAX);
                let zero = convert(&[0; LARGEST][..size]);
                self.source.whole(self.source.budget.filled(zero, count, what))?
            }
            None => {
                let found = match accessor.component_type {
                    _ if count == 0 => return Ok(Vec::new()),
                    _ => "has no bufferView, so no data",
                };
                return Err(self.source.broken(place(index), found, super::INVALID));
            }
        };
        if let Some(sparse) = &accessor.sparse {
            self.replace(index, sparse, size, &convert, &mut items)?;
        }
        Ok(items)
    }

    /// Puts the elements of a sparse accessor where they belong.
    fn replace<T>(
        &self,
        index: usize,
        sparse: &Sparse,
        size: usize,
        convert: impl Fn(&[u8]) -> T,
        items: &mut [T],
    ) -> Result<()> {
        let (places, values) = (&sparse.indices, &sparse.values);
        let place_size = match places.component_type {
            UNSIGNED_BYTE => 1,
            UNSIGNED_SHORT => 2,
            UNSIGNED_INT => 4,
            other => {
                let found = format!("has sparse indices of type {other}");
                return Err(self.source.broken(place(index), found, super::INVALID));
            }
        };
        let tight = |view: usize, offset: u64, size: usize| {
            self.elements(index, view, offset, sparse.count, size, size as u64)
        };
        let places = tight(places.buffer_view, places.byte_offset, place_size)?;
        let values = tight(values.buffer_view, values.byte_offset, size)?;
        for (at, value) in places.bytes.chunks(place_size).zip(values.bytes.chunks(size)) {
            let at = match place_size {
                1 => u32::from(at[0]),
                2 => u32::from(short(at)),
                _ => word(at),
            };
            let count = items.len();
            match items.get_mut(at as usize) {
                Some(item) => *item = convert(value),
                None => {
                    let found = format!("replaces element {at} of {count}");
                    return Err(self.source.broken(place(index), found, DAMAGED));
                }
            }
        }
        Ok(())
    }

    /// The bytes from the first to the last of `count` elements of a view.
    fn elements(
        &self,
        index: usize,
        view: usize,
        offset: u64,
        count: u64,
        size: usize,
        stride: u64,
    ) -> Result<Elements<'s>> {
        let broken =
            |found: String, remedy: &str| Err(self.source.broken(place(index), found, remedy));
        let view_bytes = self.views.bytes(&place(index), view)?;
        let size = size as u64;
        if stride < size {
            return broken(format!("has a stride of {stride} for {size} bytes"), super::INVALID);
        }
        let last = match count {
            0 => Some(0),
            count => (count - 1).checked_mul(stride).and_then(|start| start.checked_add(size)),
        };
        let Some(bytes) = last.and_then(|len| slice(view_bytes, offset, len)) else {
            let found = format!(
                "{count} elements of {size} bytes, {stride} apart, from byte {offset} on do not fit \
                 the {} of bufferView {view}",
                view_bytes.len()
            );
            return broken(found, DAMAGED);
        };
        // A stride past the end serves one element only.
        Ok(Elements { bytes, stride: usize::try_from(stride).unwrap_or(usize::MAX) })
    }

    fn wrong_type(
        &self,
        index: usize,
        accessor: &Accessor,
        wanted: &str,
        what: &str,
    ) -> crate::ImportError {
        let Accessor { shape, component_type, .. } = accessor;
        let found = format!("is {shape} of type {component_type}, but {what} are {wanted}");
        self.source.broken(place(index), found, super::INVALID)
    }
}

fn place(index: usize) -> Place {
    super::item("accessor", index, "")
}

/// The components of an element that has all its bytes.
fn lanes<const N: usize, const B: usize>(row: &[u8], convert: impl Fn([u8; B]) -> f32) -> [f32; N] {
    let mut lanes = [0.0; N];
    let (components, _) = row.as_chunks::<B>();
    for (lane, component) in lanes.iter_mut().zip(components) {
        *lane = convert(*component);
    }
    lanes
}

fn short(row: &[u8]) -> u16 {
    row.first_chunk().map_or(0, |two| u16::from_le_bytes(*two))
}

fn word(row: &[u8]) -> u32 {
    row.first_chunk().map_or(0, |four| u32::from_le_bytes(*four))
}
