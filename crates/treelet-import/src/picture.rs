//! Pictures that scenes name, decoded within the budget.

use treelet_model::{Image, Pixels};

use crate::error::Result;
use crate::options::HARMLESS_BYTES;
use crate::source::Source;

/// Decodes a picture. The inner error says why there is none; a scene goes on without it.
pub(crate) fn decode(
    source: &Source<'_>,
    bytes: &[u8],
    name: &str,
) -> Result<std::result::Result<Image, String>> {
    // A picture of one colour packs well, but not without end.
    let ratio = source.options.limits.max_ratio;
    let allowed = (bytes.len() as u64).saturating_mul(ratio).max(HARMLESS_BYTES);
    let limit = source.budget.left().min(allowed);
    let image = match Image::decode(bytes, name, limit) {
        Ok(image) => image,
        Err(error) => return Ok(Err(error.to_string())),
    };
    let pixel = match image.pixels {
        Pixels::Rgba8(_) => 4,
        Pixels::Rgba32F(_) => 16,
    };
    let taken = pixel * image.pixels.len() as u64;
    source.budget.earn(taken / (ratio + 1));
    source.whole(source.budget.spend(taken, "a picture"))?;
    Ok(Ok(image))
}
