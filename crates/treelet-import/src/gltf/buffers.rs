//! The bytes behind buffers: the GLB chunk, data URIs, files.

use std::borrow::Cow;

use base64::Engine;
use base64::engine::DecodePaddingMode;
use base64::engine::general_purpose::{GeneralPurpose, GeneralPurposeConfig};

use crate::error::{DAMAGED, Place, Result};
use crate::source::Source;

use super::json::{Buffer, Root};

/// All buffers of a file.
#[derive(Debug)]
pub(super) struct Buffers<'a> {
    bytes: Vec<Option<Cow<'a, [u8]>>>,
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
        for (index, buffer) in root.buffers.iter().enumerate() {
            let place = super::item("buffer", index, "");
            let found = match &buffer.uri {
                None if index == 0 => binary.map(Cow::Borrowed),
                // What compression extensions keep as a stand-in.
                None => None,
                Some(uri) => Some(read_uri(source, &place, uri)?.into()),
            };
            if let Some(found) = &found {
                check_length(source, &place, buffer, found)?;
            }
            bytes.push(found);
        }
        Ok(Self { bytes })
    }

    /// The bytes of a buffer; `None` if there is no such buffer or it has none.
    pub(super) fn get(&self, index: usize) -> Option<&[u8]> {
        self.bytes.get(index)?.as_deref()
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

/// Reads a data URI or a file.
fn read_uri(source: &Source<'_>, place: &Place, uri: &str) -> Result<Vec<u8>> {
    if !uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:")) {
        let path = percent_decoded(uri);
        return source.side_file(place, &path).map(|side| side.bytes);
    }
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
fn percent_decoded(uri: &str) -> String {
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
