//! Finding and loading Embree: the shared library inside the PyPI wheel `embreex`, whose name is
//! hashed, or one that somebody names.

use std::path::{Path, PathBuf};

use super::interface::Functions;
use crate::engine::EngineError;

/// The environment variable that names the library.
pub const VARIABLE: &str = "TREELET_EMBREE";

/// How the file's name starts.
const PREFIX: &str = "libembree4";

/// The folder below Cargo's target folder that `cargo xtask rivals` fills.
const RIVALS: &str = "rivals";

/// What would help where there is no library.
const REMEDY: &str = "run `cargo xtask rivals`, or name the library with TREELET_EMBREE";

/// Loads the library that `path` or [`VARIABLE`] names, or the one in the nearest `rivals` folder
/// above the running program.
pub(super) fn load(path: Option<&Path>) -> Result<(PathBuf, Functions), EngineError> {
    let named = path.map(Path::to_path_buf);
    let named = named.or_else(|| std::env::var_os(VARIABLE).map(PathBuf::from));
    let file = match named {
        Some(file) if file.is_dir() => in_folder(&file),
        Some(file) => Some(file),
        None => above_program(),
    };
    let missing = || EngineError::Missing(format!("no {PREFIX}*.so found; {REMEDY}"));
    let file = file.ok_or_else(missing)?;
    let refused = |error: libloading::Error| {
        EngineError::Missing(format!("{}: {error}; {REMEDY}", file.display()))
    };
    // SAFETY: loading runs the library's initialisers; it is the one that the user asked for, and
    // Embree's and TBB's ask nothing of the program. TBB is found through the library's own search
    // path.
    let library = unsafe { libloading::Library::new(&file) }.map_err(refused)?;
    let functions = Functions::of(&library).map_err(refused)?;
    // Never unloaded: TBB's threads may outlive every device.
    std::mem::forget(library);
    Ok((file, functions))
}

/// The library in a `rivals` folder beside the program or above it.
fn above_program() -> Option<PathBuf> {
    let program = std::env::current_exe().ok()?;
    program.ancestors().skip(1).find_map(|folder| in_folder(&folder.join(RIVALS)))
}

/// The library in a folder or in one directly below it, the last by name if there are several.
fn in_folder(folder: &Path) -> Option<PathBuf> {
    let entries = |folder: &Path| -> Vec<PathBuf> {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        entries.map(|entry| entry.path()).collect()
    };
    let files = entries(folder)
        .into_iter()
        .flat_map(|entry| if entry.is_dir() { entries(&entry) } else { vec![entry] });
    let is_library = |file: &PathBuf| {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with(PREFIX) && name.contains(".so")
    };
    files.filter(is_library).max()
}

#[cfg(test)]
mod tests {
    use super::{in_folder, load};

    #[test]
    fn a_library_is_found_by_pattern_one_folder_down() {
        let folder = std::env::temp_dir().join(format!("treelet-embree-{}", std::process::id()));
        let inner = folder.join("embreex.libs");
        std::fs::create_dir_all(&inner).unwrap();
        assert_eq!(in_folder(&folder), None);
        let file = inner.join("libembree4-0123abcd.so.4");
        std::fs::write(&file, "no library").unwrap();
        std::fs::write(inner.join("libtbb-dcf63f8c.so.12"), "").unwrap();
        let found = in_folder(&folder);
        let loaded = load(Some(&folder)).err().map(|error| error.to_string());
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(found, Some(file));
        let error = loaded.expect("a text file is no library");
        assert!(error.contains("libembree4-0123abcd") && error.contains("cargo xtask rivals"));
    }
}
