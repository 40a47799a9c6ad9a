//! The bytes behind buffers: the GLB chunk, data URIs, files.

use std::collections::HashMap;
use std::path::PathBuf;
use std::rc::Rc;

use base64::Engine;
use base64::engine::DecodePaddingMode;
use base64::engine::general_purpose::{GeneralPurpose, GeneralPurposeConfig};

use crate::error::{DAMAGED, Place, Result};
use crate::source::Source;

use super::json::{Buffer, Root};

/// All buffers of a file. Several may be over the same file, which is read once.
#[derive(Debug)]
pub(super) struct Buffers<'a> {
    bytes: Vec<Option<Bytes<'a>>>,
}

/// Where the bytes of a buffer are.
#[derive(Clone, Debug)]
enum Bytes<'a> {
    /// In the scene's own bytes.
    Chunk(&'a [u8]),
    /// In memory of their own.
    Read(Rc<Vec<u8>>),
}

impl Bytes<'_> {
    fn get(&self) -> &[u8] {
        match self {
            Self::Chunk(bytes) => bytes,
            Self::Read(bytes) => bytes,
        }
    }
}

/// Base64 with or without padding, as exporters differ.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &base64::alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

impl<'a> Buffers<'a> {
    /// Reads every buffer that has bytes.
    pub(super) fn open(source: &Source<'a>, root: &Root, binary: Option<&'a [u8]>) -> Result<Self> {
        let mut bytes = Vec::new();
        let mut known = HashMap::new();
        for (index, buffer) in root.buffers.iter().enumerate() {
            source.check_cancelled()?;
            let place = super::item("buffer", index, "");
            let found = match &buffer.uri {
                None if index == 0 => binary.map(Bytes::Chunk),
                // What compression extensions keep as a stand-in.
                None => None,
                Some(uri) => Some(Bytes::Read(read_uri(source, &place, uri, &mut known)?)),
            };
            if let Some(found) = &found {
                check_length(source, &place, buffer, found.get())?;
            }
            bytes.push(found);
        }
        Ok(Self { bytes })
    }

    /// The bytes of a buffer; `None` if there is no such buffer or it has none.
    pub(super) fn get(&self, index: usize) -> Option<&[u8]> {
        self.bytes.get(index)?.as_ref().map(Bytes::get)
    }
}

/// A buffer may be longer than it says, but not shorter.
fn check_length(source: &Source<'_>, place: &Place, buffer: &Buffer, found: &[u8]) -> Result<()> {
    let Buffer { byte_length, .. } = buffer;
    if found.len() as u64 >= *byte_length {
        return Ok(());
    }
    let found = format!("should have {byte_length} bytes and has {}", found.len());
    Err(source.broken(place.clone(), found, DAMAGED))
}

/// Reads a data URI or a file; `known` are the files that were read before.
fn read_uri(
    source: &Source<'_>,
    place: &Place,
    uri: &str,
    known: &mut HashMap<PathBuf, Rc<Vec<u8>>>,
) -> Result<Rc<Vec<u8>>> {
    if is_data(uri) {
        return read_data(source, place, uri).map(Rc::new);
    }
    let side = source.find(place, &percent_decoded(uri))?;
    if let Some(bytes) = known.get(&side.real) {
        return Ok(Rc::clone(bytes));
    }
    let bytes = Rc::new(source.read_side(&side)?);
    known.insert(side.real, Rc::clone(&bytes));
    Ok(bytes)
}

/// Whether a URI holds its data itself.
pub(super) fn is_data(uri: &str) -> bool {
    uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:"))
}

/// Decodes a data URI.
pub(super) fn read_data(source: &Source<'_>, place: &Place, uri: &str) -> Result<Vec<u8>> {
    let Some((head, data)) = uri.split_once(',') else {
        return Err(source.broken(place.clone(), "is a data URI without data", super::INVALID));
    };
    if !head.ends_with(";base64") {
        let found = "is a data URI that is not base64";
        return Err(source.broken(place.clone(), found, super::INVALID));
    }
    let room = data.len() / 4 * 3 + 3;
    let mut bytes = source.whole(source.budget.filled(0, room, "a data URI"))?;
    match BASE64.decode_slice(data.trim_ascii(), &mut bytes) {
        Ok(len) => bytes.truncate(len),
        Err(error) => {
            let found = format!("is a data URI with broken base64 ({error})");
            return Err(source.broken(place.clone(), found, DAMAGED));
        }
    }
    Ok(bytes)
}

/// Replaces `%20` and the like; what is no such code stays as it is.
pub(super) fn percent_decoded(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, tail @ ..] = rest {
        let code = (*first == b'%')
            .then(|| tail.get(..2))
            .flatten()
            .and_then(|two| u8::from_str_radix(str::from_utf8(two).ok()?, 16).ok());
        bytes.push(code.unwrap_or(*first));
        rest = if code.is_some() { &tail[2..] } else { tail };
    }
    String::from_utf8(bytes).unwrap_or_else(|_| uri.to_owned())
}
