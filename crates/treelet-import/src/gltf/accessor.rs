//! Accessors: how numbers lie in buffers.
//!
//! Everything that is to come of compressed, quantized and sparse data has its place here; the rest
//! of the importer sees vectors and indices.

use treelet::memory::Array;

use crate::error::{DAMAGED, Fault, Place, Result};
use crate::source::Source;

use super::buffers::Buffers;
use super::json::{self, Accessor, Root};

/// Reads accessors of a document.
#[derive(Clone, Copy)]
pub(super) struct Accessors<'s, 'a> {
    pub(super) source: &'s Source<'a>,
    pub(super) root: &'s Root,
    pub(super) buffers: &'s Buffers<'a>,
}

/// Component types, by their number in the file.
const BYTE: u32 = 5120;
const UNSIGNED_BYTE: u32 = 5121;
const SHORT: u32 = 5122;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;

impl<'s, 'a> Accessors<'s, 'a> {
    /// Three floats an element: positions, normals.
    pub(super) fn vectors(&self, index: usize, what: &'static str) -> Result<Array<[f32; 3]>> {
        let accessor = self.accessor(index)?;
        if accessor.shape != "VEC3" || accessor.component_type != FLOAT {
            return Err(self.wrong_type(index, accessor, "VEC3 of FLOAT", what));
        }
        const ROW: usize = 12;
        let (bytes, stride) = self.bytes(index, accessor, ROW)?;
        let mut vectors = self.source.vec(bytes.len().div_ceil(stride), what)?;
        if stride == ROW {
            let (rows, _) = bytes.as_chunks::<ROW>();
            vectors.extend(rows.iter().map(vector));
        } else {
            // The last element may be shorter than the stride.
            vectors.extend(bytes.chunks(stride).filter_map(|row| row.first_chunk().map(vector)));
        }
        Ok(vectors.into())
    }

    /// One unsigned integer an element.
    pub(super) fn indices(&self, index: usize) -> Result<Vec<u32>> {
        const WHAT: &str = "indices";
        let accessor = self.accessor(index)?;
        let size = match accessor.component_type {
            UNSIGNED_BYTE => 1,
            UNSIGNED_SHORT => 2,
            UNSIGNED_INT => 4,
            _ => 0,
        };
        if accessor.shape != "SCALAR" || size == 0 {
            return Err(self.wrong_type(index, accessor, "SCALAR of an UNSIGNED type", WHAT));
        }
        let (bytes, stride) = self.bytes(index, accessor, size)?;
        let mut indices = self.source.vec(bytes.len().div_ceil(stride), WHAT)?;
        let rows = bytes.chunks(stride);
        match size {
            1 => indices.extend(rows.map(|row| u32::from(row[0]))),
            2 => indices.extend(rows.filter_map(|row| {
                row.first_chunk().map(|two| u32::from(u16::from_le_bytes(*two)))
            })),
            _ => indices.extend(
                rows.filter_map(|row| row.first_chunk().map(|four| u32::from_le_bytes(*four))),
            ),
        }
        Ok(indices)
    }

    fn accessor(&self, index: usize) -> Result<&'s Accessor> {
        let all = &self.root.accessors;
        all.get(index).ok_or_else(|| {
            let found = format!("is named, but there are {}", all.len());
            self.source.broken(place(index), found, super::INVALID)
        })
    }

    /// The bytes from the first to the last element, and the distance from one to the next.
    fn bytes(&self, index: usize, accessor: &Accessor, size: usize) -> Result<(&'s [u8], usize)> {
        let broken =
            |found: String, remedy: &str| Err(self.source.broken(place(index), found, remedy));
        if accessor.sparse.is_some() {
            let remedy = "open it in Blender and export it again, which writes plain arrays";
            let fault = Fault::unsupported("is a sparse accessor", remedy);
            return Err(self.source.error(place(index), fault));
        }
        let Some(view_index) = accessor.buffer_view else {
            return broken("has no bufferView, so no data".to_owned(), super::INVALID);
        };
        let Some(view) = self.root.buffer_views.get(view_index) else {
            let views = self.root.buffer_views.len();
            return broken(format!("names bufferView {view_index} of {views}"), super::INVALID);
        };
        let Some(buffer) = self.buffers.get(view.buffer) else {
            if let Some(fault) = json::compressed(&view.extensions) {
                return Err(self.source.error(place(index), fault));
            }
            return broken(
                format!("needs buffer {}, which has no bytes", view.buffer),
                super::INVALID,
            );
        };

        // Cut the view out of the buffer, and the elements out of the view.
        let slice = |bytes: &'s [u8], offset: u64, len: u64| {
            let (start, end) = (offset, offset.checked_add(len)?);
            bytes.get(usize::try_from(start).ok()?..usize::try_from(end).ok()?)
        };
        let Some(view_bytes) = slice(buffer, view.byte_offset, view.byte_length) else {
            let found = format!(
                "lies in bufferView {view_index} of {} bytes at {}, past the {} of its buffer",
                view.byte_length,
                view.byte_offset,
                buffer.len()
            );
            return broken(found, DAMAGED);
        };
        let size = size as u64;
        let stride = view.byte_stride.filter(|&stride| stride > 0).unwrap_or(size);
        if stride < size {
            return broken(format!("has a stride of {stride} for {size} bytes"), super::INVALID);
        }
        let last = match accessor.count {
            0 => Some(0),
            count => (count - 1).checked_mul(stride).and_then(|start| start.checked_add(size)),
        };
        let elements = last.and_then(|len| slice(view_bytes, accessor.byte_offset, len));
        let Some(elements) = elements else {
            let found = format!(
                "{} elements of {size} bytes, {stride} apart, from byte {} on do not fit the {} of \
                 bufferView {view_index}",
                accessor.count,
                accessor.byte_offset,
                view_bytes.len()
            );
            return broken(found, DAMAGED);
        };
        // A stride past the end serves one element only.
        let stride = usize::try_from(stride).unwrap_or(usize::MAX);
        Ok((elements, stride))
    }

    fn wrong_type(
        &self,
        index: usize,
        accessor: &Accessor,
        wanted: &str,
        what: &str,
    ) -> crate::ImportError {
        let Accessor { shape, component_type, .. } = accessor;
        let quantized = matches!(*component_type, BYTE | UNSIGNED_BYTE | SHORT | UNSIGNED_SHORT);
        if shape == "VEC3" && quantized {
            let fault = Fault::unsupported(
                format!("has {what} as integers (KHR_mesh_quantization)"),
                "turn them into floats: npx @gltf-transform/cli dequantize OLD.glb NEW.glb",
            );
            return self.source.error(place(index), fault);
        }
        let found = format!("is {shape} of type {component_type}, but {what} are {wanted}");
        self.source.broken(place(index), found, super::INVALID)
    }
}

fn place(index: usize) -> Place {
    super::item("accessor", index, "")
}

fn vector(row: &[u8; 12]) -> [f32; 3] {
    let [a0, a1, a2, a3, b0, b1, b2, b3, c0, c1, c2, c3] = *row;
    [[a0, a1, a2, a3], [b0, b1, b2, b3], [c0, c1, c2, c3]].map(f32::from_le_bytes)
}
