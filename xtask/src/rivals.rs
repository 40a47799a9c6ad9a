//! `cargo xtask rivals`: fetches what `treelet bench` measures itself against and no crate registry
//! has. No check needs it.
//!
//! Embree comes as the shared library inside the Python wheel `embreex`: `pip` downloads it into
//! the folder `rivals` of Cargo's target folder, Python unpacks it there, and the bench finds the
//! library by its name's beginning.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::step::announced;

/// The wheel: what the marks are measured against is Embree 4.4.
const WHEEL: &str = "embreex>=4.4,<4.5";

/// How the library's file name begins.
const LIBRARY: &str = "libembree4";

/// Interpreters that may be there, the likelier first.
const PYTHONS: [&str; 2] = ["python3", "python"];

/// Downloads and unpacks the wheel, and says where the library is.
pub(crate) fn run(root: &Path) -> Result<(), String> {
    let folder = target(root).join("rivals");
    let told = |error: std::io::Error| format!("{}: {error}", folder.display());
    fs::create_dir_all(&folder).map_err(told)?;
    if let Some(library) = library(&folder) {
        eprintln!("  Embree is there already: {}", library.display());
        return Ok(());
    }
    let python = python()?;

    let mut download = Command::new(python);
    download.args(["-m", "pip", "download", WHEEL, "--no-deps", "--only-binary=:all:", "-d"]);
    let shown = format!("{python} -m pip download '{WHEEL}' --no-deps -d {}", folder.display());
    announced(download.arg(&folder), &shown)?;
    let wheel =
        newest_wheel(&folder).ok_or_else(|| format!("pip left no .whl in {}", folder.display()))?;

    let mut unpack = Command::new(python);
    unpack.args(["-m", "zipfile", "-e"]).arg(&wheel).arg(&folder);
    announced(&mut unpack, &format!("{python} -m zipfile -e {}", wheel.display()))?;
    match library(&folder) {
        Some(library) => {
            eprintln!("  Embree: {}", library.display());
            Ok(())
        }
        None => Err(format!("{} holds no {LIBRARY}*; is it for this system?", wheel.display())),
    }
}

/// Cargo's target folder.
pub(crate) fn target(root: &Path) -> PathBuf {
    let named = std::env::var_os("CARGO_TARGET_DIR").map(PathBuf::from);
    named.map_or_else(|| root.join("target"), |folder| root.join(folder))
}

/// An interpreter that has pip.
fn python() -> Result<&'static str, String> {
    let has_pip = |python: &&str| {
        let mut command = Command::new(python);
        command.args(["-m", "pip", "--version"]).stdout(Stdio::null()).stderr(Stdio::null());
        command.status().is_ok_and(|status| status.success())
    };
    PYTHONS.into_iter().find(has_pip).ok_or_else(|| {
        "Python with pip is missing; install your distribution's python3-pip".to_owned()
    })
}

/// The wheel that sorts last: the highest version, for versions of one length.
fn newest_wheel(folder: &Path) -> Option<PathBuf> {
    let wheels = files(folder).into_iter();
    wheels.filter(|file| file.extension().is_some_and(|extension| extension == "whl")).max()
}

/// The library in `folder` or in a folder of it.
fn library(folder: &Path) -> Option<PathBuf> {
    let folders = files(folder).into_iter().filter(|entry| entry.is_dir());
    folders.flat_map(|folder| files(&folder)).find(|file| {
        file.file_name().is_some_and(|name| name.to_string_lossy().starts_with(LIBRARY))
    })
}

/// What is in a folder; nothing if it cannot be read.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.map(|entry| entry.path()).collect()
}

#[cfg(test)]
mod tests {
    use super::{library, newest_wheel};
    use std::fs;

    #[test]
    fn the_library_and_the_wheel_are_found_by_name() {
        let folder = std::env::temp_dir().join(format!("xtask-rivals-{}", std::process::id()));
        let inner = folder.join("embreex.libs");
        fs::create_dir_all(&inner).unwrap();
        let nothing = (library(&folder), newest_wheel(&folder));
        let file = inner.join("libembree4-abc.so.4");
        for file in [&file, &folder.join("embreex-4.4.0.whl"), &folder.join("embreex-4.4.1.whl")] {
            fs::write(file, "").unwrap();
        }
        let found = (library(&folder), newest_wheel(&folder));
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!(nothing, (None, None));
        assert_eq!(found, (Some(file), Some(folder.join("embreex-4.4.1.whl"))));
    }
}
