//! The bytes of buffer views, unpacked where an extension packed them.

use crate::error::{DAMAGED, Place, Result};
use crate::source::Source;

use super::buffers::Buffers;
use super::json::{Packed, Root};
use super::{INVALID, meshopt};

/// All views of a file; the packed ones are unpacked once, when the file is opened.
#[derive(Debug)]
pub(super) struct Views<'s, 'a> {
    source: &'s Source<'a>,
    root: &'s Root,
    buffers: &'s Buffers<'a>,
    unpacked: Vec<Option<Vec<u8>>>,
}

impl<'s, 'a> Views<'s, 'a> {
    /// Unpacks what is packed.
    pub(super) fn open(
        source: &'s Source<'a>,
        root: &'s Root,
        buffers: &'s Buffers<'a>,
    ) -> Result<Self> {
        let mut views = Self { source, root, buffers, unpacked: Vec::new() };
        for (index, view) in root.buffer_views.iter().enumerate() {
            source.check_cancelled()?;
            let bytes = match view.extensions.packed() {
                Some(packed) => Some(views.unpack(index, packed)?),
                None => None,
            };
            views.unpacked.push(bytes);
        }
        Ok(views)
    }

    /// The bytes of a view that `place` names.
    pub(super) fn bytes(&self, place: &Place, index: usize) -> Result<&[u8]> {
        let broken =
            |found: String, remedy: &str| Err(self.source.broken(place.clone(), found, remedy));
        if let Some(Some(bytes)) = self.unpacked.get(index) {
            return Ok(bytes);
        }
        let Some(view) = self.root.buffer_views.get(index) else {
            let views = self.root.buffer_views.len();
            return broken(format!("names bufferView {index} of {views}"), INVALID);
        };
        let Some(buffer) = self.buffers.get(view.buffer) else {
            return broken(format!("needs buffer {}, which has no bytes", view.buffer), INVALID);
        };
        match slice(buffer, view.byte_offset, view.byte_length) {
            Some(bytes) => Ok(bytes),
            None => broken(
                format!(
                    "lies in bufferView {index} of {} bytes at {}, past the {} of its buffer",
                    view.byte_length,
                    view.byte_offset,
                    buffer.len()
                ),
                DAMAGED,
            ),
        }
    }

    /// The distance of the elements of a view, if it says so.
    pub(super) fn stride(&self, index: usize) -> Option<u64> {
        let view = self.root.buffer_views.get(index)?;
        let packed = view.extensions.packed().map(|packed| packed.byte_stride);
        view.byte_stride.or(packed).filter(|&stride| stride > 0)
    }

    /// Unpacks one view.
    fn unpack(&self, index: usize, packed: &Packed) -> Result<Vec<u8>> {
        let place = super::item("bufferView", index, "");
        let broken = |found: String| Err(self.source.broken(place.clone(), found, DAMAGED));
        let Some(buffer) = self.buffers.get(packed.buffer) else {
            return broken(format!("needs buffer {}, which has no bytes", packed.buffer));
        };
        let Some(bytes) = slice(buffer, packed.byte_offset, packed.byte_length) else {
            return broken(format!(
                "is packed in {} bytes at {}, past the {} of its buffer",
                packed.byte_length,
                packed.byte_offset,
                buffer.len()
            ));
        };
        let len = packed.count.checked_mul(packed.byte_stride);
        let Some(len) = len.and_then(|len| usize::try_from(len).ok()) else {
            return broken(format!("unpacks to {} elements", packed.count));
        };
        let filled = self.source.budget.filled(0, len, "an unpacked bufferView");
        let mut out = self.source.whole(filled)?;
        match meshopt::decode(packed, bytes, &mut out) {
            Ok(()) => Ok(out),
            Err(found) => broken(format!("is packed in a meshopt stream that {found}")),
        }
    }
}

/// A part of some bytes, if it is there.
pub(super) fn slice(bytes: &[u8], offset: u64, len: u64) -> Option<&[u8]> {
    let end = offset.checked_add(len)?;
    bytes.get(usize::try_from(offset).ok()?..usize::try_from(end).ok()?)
}
