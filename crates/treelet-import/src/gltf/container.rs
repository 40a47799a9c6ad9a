//! The two shapes of a glTF file: JSON text, and GLB, which wraps the JSON and one buffer.

use crate::error::{DAMAGED, Place, Result};
use crate::source::Source;
use crate::text;

/// JSON, and the buffer that came with it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parts<'a> {
    pub(super) json: &'a [u8],
    pub(super) binary: Option<&'a [u8]>,
}

const MAGIC: &[u8] = b"glTF";
/// Magic, version, length.
const HEADER: usize = 12;
/// Length and type of a chunk.
const CHUNK_HEADER: usize = 8;
const JSON_CHUNK: &[u8] = b"JSON";
const BINARY_CHUNK: &[u8] = b"BIN\0";

pub(super) fn is_glb(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

/// Whether the bytes are a JSON object with the one member that glTF demands.
pub(super) fn is_json(bytes: &[u8]) -> bool {
    let text = text::without_bom(bytes).trim_ascii_start();
    text.starts_with(b"{") && memchr::memmem::find(text, b"\"asset\"").is_some()
}

/// Finds the JSON and the binary chunk.
pub(super) fn open<'a>(source: &Source<'a>) -> Result<Parts<'a>> {
    let bytes = source.bytes;
    source.whole(text::refuse_utf16(bytes))?;
    if !is_glb(bytes) {
        return Ok(Parts { json: text::without_bom(bytes), binary: None });
    }
    let word = |at: usize| {
        let four = bytes.get(at..).and_then(|rest| rest.first_chunk());
        four.map(|four| u32::from_le_bytes(*four))
    };
    let broken =
        |at: usize, found: &str| Err(source.broken(Place::Byte(at as u64), found, DAMAGED));
    match word(4) {
        Some(2) => {}
        Some(1) => return Err(source.error(Place::Byte(4), old_version())),
        _ => return broken(4, "is GLB of neither version 1 nor 2"),
    }
    let Some(length) = word(8) else { return broken(8, "the GLB header is cut short") };
    if length as usize > bytes.len() {
        let found = format!("the GLB header says {length} bytes, the file has {}", bytes.len());
        return broken(8, &found);
    }

    // Walk the chunks; unknown ones are to be ignored.
    let (mut json, mut binary) = (None, None);
    let mut at = HEADER;
    while at < length as usize {
        let Some(size) = word(at) else { return broken(at, "a GLB chunk is cut short") };
        let start = at + CHUNK_HEADER;
        let content = bytes.get(start..).and_then(|rest| rest.get(..size as usize));
        let Some(content) = content else {
            let found = format!("a GLB chunk of {size} bytes reaches past the end of the file");
            return broken(at, &found);
        };
        match &bytes[at + 4..start] {
            JSON_CHUNK if json.is_none() => json = Some(content),
            BINARY_CHUNK if binary.is_none() => binary = Some(content),
            _ => {}
        }
        // Chunks start at multiples of four.
        at = start + (size as usize).next_multiple_of(4);
    }
    match json {
        Some(json) => Ok(Parts { json, binary }),
        None => broken(HEADER, "the GLB has no JSON chunk"),
    }
}

/// glTF 1.0 has quite another structure.
pub(super) fn old_version() -> crate::Fault {
    crate::Fault::unsupported(
        "is glTF 1.0",
        "convert it to 2.0: npx gltf-pipeline -i OLD.gltf -o NEW.glb",
    )
}
