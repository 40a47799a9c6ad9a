//! Buffer views packed by `EXT_meshopt_compression` and `KHR_meshopt_compression`.
//!
//! After the bitstream appendices of both extensions. A stream is a header byte, codes, and a tail;
//! three modes and five filters. The KHR variant adds version 1 of attributes and the colour filter;
//! both are read under either name, as the header byte tells the version.
//!
//! Nothing is trusted: every read is checked, a stream that ends early or late is an error, and what
//! comes out is as long as the caller's buffer. Indices may name any vertex; the mesh checks them.
//!
//! Cost: one pass a stream, in memory that is there already.

mod attributes;
mod filters;
mod indices;

use super::json::Packed;

/// Unpacks `bytes` into `out`, which holds `packed.count` elements of `packed.byte_stride` bytes, and
/// undoes the filter. The error says what is wrong with the stream.
pub(super) fn decode(packed: &Packed, bytes: &[u8], out: &mut [u8]) -> Result<(), String> {
    let stride = usize::try_from(packed.byte_stride).unwrap_or(usize::MAX);
    match packed.mode.as_str() {
        "ATTRIBUTES" if stride == 0 || stride > 256 || !stride.is_multiple_of(4) => {
            return Err(format!("has a stride of {stride} for mode ATTRIBUTES"));
        }
        "ATTRIBUTES" => attributes::decode(bytes, stride, out)?,
        "TRIANGLES" | "INDICES" if stride != 2 && stride != 4 => {
            return Err(format!("has a stride of {stride} for mode {}", packed.mode));
        }
        "TRIANGLES" => indices::decode_triangles(bytes, stride, out)?,
        "INDICES" => indices::decode_sequence(bytes, stride, out)?,
        other => return Err(format!("has the mode {other:?}")),
    }
    let wrong_stride = || Err(format!("has a stride of {stride} for filter {}", packed.filter));
    match (packed.filter.as_str(), stride) {
        ("" | "NONE", _) => {}
        ("OCTAHEDRAL", 4) => filters::octahedral_8(out),
        ("OCTAHEDRAL", 8) => filters::octahedral_16(out),
        ("QUATERNION", 8) => filters::quaternion(out),
        ("EXPONENTIAL", _) if stride.is_multiple_of(4) => filters::exponential(out),
        ("COLOR", 4) => filters::color_8(out),
        ("COLOR", 8) => filters::color_16(out),
        ("OCTAHEDRAL" | "QUATERNION" | "EXPONENTIAL" | "COLOR", _) => return wrong_stride(),
        (other, _) => return Err(format!("has the filter {other:?}")),
    }
    Ok(())
}

/// What a stream that stops too early is told.
fn ended() -> String {
    "ends too early".to_owned()
}

/// The next `len` bytes of a stream.
fn take<'a>(bytes: &mut &'a [u8], len: usize) -> Result<&'a [u8], String> {
    let (taken, rest) = bytes.split_at_checked(len).ok_or_else(ended)?;
    *bytes = rest;
    Ok(taken)
}
