//! Files that are whole or not there: written beside their place, flushed to the disk, then moved.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::hash::{BuildHasher as _, RandomState};
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

/// Names that are tried for a temporary file; by chance not even a second one is needed.
const TRIES: u32 = 16;

/// The temporary files that are being written, for a program that must end at once.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A place for a file, checked before work begins.
#[derive(Clone, Debug)]
pub(crate) struct Output {
    file: PathBuf,
    /// The folder that the file is in.
    folder: PathBuf,
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
        let output = Self { folder: folder.to_path_buf(), file: target };
        output.attempt(|_, temporary| fs::remove_file(temporary))?;
        Ok(output)
    }

    /// Where the file will be.
    pub(crate) fn path(&self) -> &Path {
        &self.file
    }

    /// Puts `bytes` in the file's place: readers see the old file or all of the new one.
    pub(crate) fn replace(&self, bytes: &[u8]) -> Result<(), OutputError> {
        self.attempt(|mut file, temporary| {
            file.write_all(bytes)?;
            file.sync_all()?;
            drop(file);
            fs::rename(temporary, &self.file)
        })
    }

    /// A temporary file beside the place, to be written bit by bit, whose name ends as the place's.
    pub(crate) fn draft(&self) -> Result<Draft, OutputError> {
        let extension = self.file.extension().unwrap_or_default();
        let ending = Path::new("tmp").with_extension(extension);
        let created = self.create(ending.as_os_str());
        let (file, temporary) = created.map_err(|error| self.refused(error))?;
        Ok(Draft { output: self.clone(), file, temporary })
    }

    fn refused(&self, error: io::Error) -> OutputError {
        OutputError::Refused { file: self.file.clone(), error }
    }

    /// Runs `work` on a new temporary file; whatever it leaves unfinished is removed.
    fn attempt(&self, work: impl FnOnce(File, &Path) -> io::Result<()>) -> Result<(), OutputError> {
        let outcome = self.create("tmp".as_ref()).and_then(|(file, temporary)| {
            let outcome = work(file, &temporary);
            if outcome.is_err() {
                // The first error is the one to tell.
                drop(fs::remove_file(&temporary));
            }
            forget(&temporary);
            outcome
        });
        outcome.map_err(|error| self.refused(error))
    }

    /// Makes the temporary file, anew: a file or link that somebody put there is never opened.
    fn create(&self, ending: &OsStr) -> io::Result<(File, PathBuf)> {
        let mut tries = 0;
        loop {
            let mut name = OsString::from(".");
            name.push(self.file.file_name().unwrap_or_default());
            // The standard library seeds these hashers at random, so nobody foresees the name.
            name.push(format!(".{:016x}.", RandomState::new().hash_one(tries)));
            name.push(ending);
            let temporary = self.folder.join(name);
            let mut unfinished = lock();
            match File::create_new(&temporary) {
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists && tries < TRIES => {
                    tries += 1;
                }
                file => {
                    let file = file?;
                    unfinished.push(temporary.clone());
                    return Ok((file, temporary));
                }
            }
        }
    }
}

/// A file in the making: in its place once it is finished, and gone if it never is.
#[derive(Debug)]
pub(crate) struct Draft {
    output: Output,
    /// Open for writing.
    pub(crate) file: File,
    temporary: PathBuf,
}

impl Draft {
    /// Where it is while it is made, for a program that writes it.
    pub(crate) fn path(&self) -> &Path {
        &self.temporary
    }

    /// An error of writing, as one about the file's place.
    pub(crate) fn refused(&self, error: io::Error) -> OutputError {
        self.output.refused(error)
    }

    /// Puts the file in its place.
    pub(crate) fn finish(self) -> Result<(), OutputError> {
        let moved = self.file.sync_all();
        let moved = moved.and_then(|()| fs::rename(&self.temporary, &self.output.file));
        moved.map_err(|error| self.refused(error))
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        // Of a file that was finished nothing is left under this name.
        drop(fs::remove_file(&self.temporary));
        forget(&self.temporary);
    }
}

/// Removes the temporary files that are being written, if any are.
pub(crate) fn remove_unfinished() {
    for file in lock().drain(..) {
        drop(fs::remove_file(file));
    }
}

/// A temporary file is finished or gone.
fn forget(temporary: &Path) {
    lock().retain(|other| other != temporary);
}

fn lock() -> std::sync::MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}
