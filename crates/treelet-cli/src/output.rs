//! Files that are whole or not there: written beside their place, flushed to the disk, then moved.

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// A file that could not be written.
#[derive(Debug, thiserror::Error)]
pub(crate) enum OutputError {
    /// The folder is not there.
    #[error("{}: the folder {} does not exist; create it or choose another with -o", .file.display(), .folder.display())]
    NoFolder { file: PathBuf, folder: PathBuf },
    /// The path is a folder or a device.
    #[error("{}: is not a regular file; choose another name with -o", .file.display())]
    NotAFile { file: PathBuf },
    /// The file system said no.
    #[error("{}: cannot be written ({error}); choose another place with -o", .file.display())]
    Refused { file: PathBuf, error: io::Error },
}

/// The temporary file that is being written, for a program that must end at once.
static UNFINISHED: Mutex<Option<PathBuf>> = Mutex::new(None);

/// A place for a file, checked before work begins.
#[derive(Clone, Debug)]
pub(crate) struct Output {
    file: PathBuf,
    temporary: PathBuf,
}

impl Output {
    /// Checks that `file` can be written by writing an empty file beside it.
    pub(crate) fn prepare(file: &Path) -> Result<Self, OutputError> {
        // A link keeps pointing where it points: what it points to is replaced.
        let target = fs::canonicalize(file).unwrap_or_else(|_| file.to_path_buf());
        if target.exists() && !target.is_file() || target.file_name().is_none() {
            return Err(OutputError::NotAFile { file: file.to_path_buf() });
        }
        let folder = match target.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        if !folder.is_dir() {
            let folder = folder.to_path_buf();
            return Err(OutputError::NoFolder { file: file.to_path_buf(), folder });
        }
        let mut name = std::ffi::OsString::from(".");
        name.push(target.file_name().unwrap_or_default());
        name.push(format!(".{}.tmp", std::process::id()));
        let output = Self { temporary: folder.join(name), file: target };
        output.attempt(|output| {
            File::create(&output.temporary)?;
            fs::remove_file(&output.temporary)
        })?;
        Ok(output)
    }

    /// Where the file will be.
    pub(crate) fn path(&self) -> &Path {
        &self.file
    }

    /// Puts `bytes` in the file's place: readers see the old file or all of the new one.
    pub(crate) fn replace(&self, bytes: &[u8]) -> Result<(), OutputError> {
        self.attempt(|output| {
            let mut file = File::create(&output.temporary)?;
            file.write_all(bytes)?;
            file.sync_all()?;
            drop(file);
            fs::rename(&output.temporary, &output.file)
        })
    }

    /// Runs `work`; whatever it leaves unfinished is removed.
    fn attempt(&self, work: impl FnOnce(&Self) -> io::Result<()>) -> Result<(), OutputError> {
        *lock() = Some(self.temporary.clone());
        let outcome = work(self);
        if outcome.is_err() {
            // The first error is the one to tell.
            drop(fs::remove_file(&self.temporary));
        }
        *lock() = None;
        outcome.map_err(|error| OutputError::Refused { file: self.file.clone(), error })
    }
}

/// Removes the temporary file that is being written, if one is.
pub(crate) fn remove_unfinished() {
    if let Some(file) = lock().take() {
        drop(fs::remove_file(file));
    }
}

fn lock() -> std::sync::MutexGuard<'static, Option<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}
