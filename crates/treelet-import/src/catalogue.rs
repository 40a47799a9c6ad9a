//! The catalogue of formats, and the choice among them.

use std::fmt::Write as _;
use std::path::Path;

use treelet_model::Model;

use crate::error::{Fault, Result};
use crate::source::Source;
use crate::stream::Stream;
use crate::{foreign, gltf, obj, off, pbrt, ply, stl};

/// Every format that can be read. A new one is a file and a line here; the first whose content
/// fits is taken, so those with a sure sign come first.
pub static ALL: &[&dyn Importer] =
    &[&gltf::Gltf, &ply::Ply, &stl::Stl, &off::Off, &pbrt::Pbrt, &obj::Obj];

/// A scene file format.
pub trait Importer: Send + Sync {
    /// What the format is called.
    fn info(&self) -> Info;
    /// Whether a file of this content is surely or very likely in this format.
    fn sniff(&self, bytes: &[u8]) -> bool;
    /// Reads a scene.
    ///
    /// # Errors
    ///
    /// If the file is damaged, hostile, too large or uses what treelet does not know.
    fn read(&self, source: &Source<'_>) -> Result<Model>;
    /// Reads a large file through a window, or leaves it as it is: `None` if the file is in another
    /// format, or must be seen whole.
    ///
    /// # Errors
    ///
    /// As [`Importer::read`].
    fn stream(&self, stream: &mut Stream<'_>) -> Result<Option<Model>> {
        let _ = stream;
        Ok(None)
    }
}

/// What a format is called.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Info {
    /// A short lower-case name.
    pub name: &'static str,
    /// Its file extensions, lower case, without the dot.
    pub extensions: &'static [&'static str],
    /// One line for people.
    pub summary: &'static str,
}

/// The importer for a file: by content first, then by extension.
pub(crate) fn choose(
    file: &Path,
    bytes: &[u8],
) -> std::result::Result<&'static dyn Importer, Fault> {
    let extension = extension(file);
    let by_name = || ALL.iter().find(|importer| importer.info().extensions.contains(&&*extension));
    if let Some(importer) = ALL.iter().find(|importer| importer.sniff(bytes)) {
        return Ok(*importer);
    }
    if let Some(fault) = foreign::by_content(bytes) {
        return Err(fault);
    }
    if let Some(importer) = by_name() {
        return Ok(*importer);
    }
    Err(foreign::by_extension(&extension)
        .unwrap_or_else(|| Fault::UnknownFormat { formats: formats() }))
}

/// The extension under a `.gz` or `.zst`, lower case; empty if there is none.
pub(crate) fn extension(file: &Path) -> String {
    let lower = |path: &Path| {
        path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
    };
    let outer = lower(file);
    match outer.as_str() {
        "gz" | "zst" => lower(Path::new(file.file_stem().unwrap_or_default())),
        _ => outer,
    }
}

/// All formats with their extensions, in one line.
fn formats() -> String {
    let mut text = String::new();
    for (i, importer) in ALL.iter().enumerate() {
        let Info { name, extensions, .. } = importer.info();
        let comma = if i == 0 { "" } else { ", " };
        let _ = write!(text, "{comma}{name} (.{})", extensions.join(", ."));
    }
    text + ", each also as .gz or .zst"
}
