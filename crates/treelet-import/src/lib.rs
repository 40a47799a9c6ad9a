//! Scene files to [`treelet_model::Model`]s.
//!
//! ```no_run
//! let options = treelet_import::Options::default();
//! let model = treelet_import::load("scene.glb.zst".as_ref(), &options)?;
//! println!("{} triangles", model.triangles_placed());
//! # Ok::<(), treelet_import::ImportError>(())
//! ```
//!
//! The format is told by content first, then by extension; `.gz` and `.zst` wrappers come off
//! before that. [`ALL`] is the catalogue of formats.
//!
//! Files are not trusted. Counts in headers are compared with the bytes that are there before
//! anything is allocated, [`Limits`] bound what a scene may cost, paths stay in the scene's folder
//! unless [`Options::allow_outside`] says otherwise, and whatever is wrong is an [`ImportError`]
//! that names the file, the place and the remedy. Two things are passed on for the scene builder
//! to report or skip: vertices that are not finite, and triangles that name a vertex past the end.

mod budget;
mod catalogue;
mod error;
mod foreign;
mod gltf;
mod normals;
mod obj;
mod off;
mod options;
mod pbrt;
mod picture;
mod ply;
mod polygon;
mod polygons;
mod source;
mod stl;
mod stream;
mod text;
mod unpack;

pub use catalogue::{ALL, Importer, Info};
pub use error::{Fault, ImportError, Place, Result};
pub use options::{Limits, Options, Watch};
pub use source::Source;
pub use stream::Stream;

use std::fs::File;
use std::path::Path;

use budget::Budget;
use treelet_model::Model;

/// Reads a scene file, and the files beside it that it names.
///
/// # Errors
///
/// If a file cannot be read, is damaged or hostile, exceeds the limits, or uses what treelet does
/// not know.
pub fn load(path: &Path, options: &Options) -> Result<Model> {
    let budget = Budget::new(&options.limits);
    let fail = |fault| ImportError { file: path.to_path_buf(), place: Place::File, fault };
    let mut file = File::open(path).map_err(|error| fail(error.into()))?;
    let len = file.metadata().map_err(|error| fail(error.into()))?.len();
    let mut head = Vec::new();
    if len > stream::WINDOW as u64 {
        let window = stream::WINDOW;
        let mut stream = Stream::open(path, &mut file, len, window, options, &budget)?;
        if let Some(model) = read_stream(&mut stream)? {
            return Ok(model);
        }
        head = stream.into_bytes();
    }
    let bytes = source::read_open(file, head, &budget, options).map_err(fail)?;
    let folder = match path.parent() {
        Some(parent) if parent.as_os_str().is_empty() => Path::new("."),
        Some(parent) => parent,
        None => Path::new("."),
    };
    let source =
        Source { file: path, bytes: &bytes, folder: Some(folder), options, budget: &budget };
    read(&source)
}

/// Reads a scene from memory. `name` stands in messages, and its extension counts.
///
/// # Errors
///
/// As [`load`]; besides, a scene that cannot do without a second file is an error.
pub fn load_bytes(name: &str, bytes: &[u8], options: &Options) -> Result<Model> {
    let budget = Budget::new(&options.limits);
    let file = Path::new(name);
    let fail = |fault| ImportError { file: file.to_path_buf(), place: Place::File, fault };
    budget.earn(bytes.len() as u64);
    let unpacked = unpack::unpack(bytes.into(), &budget, options).map_err(fail)?;
    let source = Source { file, bytes: &unpacked, folder: None, options, budget: &budget };
    read(&source)
}

/// Chooses the importer and runs it.
fn read(source: &Source<'_>) -> Result<Model> {
    let importer = source.whole(catalogue::choose(source.file, source.bytes))?;
    importer.read(source).map(|model| source.finish(model))
}

/// Reads a large file through a window, if its format can.
fn read_stream(stream: &mut Stream<'_>) -> Result<Option<Model>> {
    for importer in ALL {
        if let Some(model) = importer.stream(stream)? {
            let model = stream.source().finish(model);
            return Ok(Some(model));
        }
    }
    Ok(None)
}
