//! What an importer reads from: the bytes of a file, the folder it lies in, and what it may cost.

use std::borrow::Cow;
use std::fs::{self, File};
use std::path::{Component, Path, PathBuf};

use treelet::context::Progress;
use treelet_model::Model;

use crate::budget::Budget;
use crate::error::{Fault, ImportError, Place, Result, clip};
use crate::options::Options;
use crate::stream::READING;
use crate::unpack;

/// A scene file in memory, unpacked.
#[derive(Debug)]
pub struct Source<'a> {
    pub(crate) file: &'a Path,
    pub(crate) bytes: &'a [u8],
    /// Where files that it names are looked for; `None` if there is only memory.
    pub(crate) folder: Option<&'a Path>,
    pub(crate) options: &'a Options,
    pub(crate) budget: &'a Budget,
}

/// Where a file that a scene names was found.
#[derive(Clone, Debug)]
pub(crate) struct SidePath {
    /// The path for messages, as the scene spells it.
    pub(crate) shown: PathBuf,
    /// The file itself, however the scene spells it; what is read once is known by this.
    pub(crate) real: PathBuf,
}

impl<'a> Source<'a> {
    /// An error about this file.
    #[cold]
    pub(crate) fn error(&self, place: Place, fault: impl Into<Fault>) -> ImportError {
        ImportError { file: self.file.to_path_buf(), place, fault: fault.into() }
    }

    /// An error about this file's breaking of the rules.
    #[cold]
    pub(crate) fn broken(
        &self,
        place: Place,
        found: impl Into<String>,
        remedy: impl Into<String>,
    ) -> ImportError {
        self.error(place, Fault::broken(found, remedy))
    }

    /// Names the file in a fault that has none.
    pub(crate) fn whole<T>(&self, result: std::result::Result<T, Fault>) -> Result<T> {
        result.map_err(|fault| self.error(Place::File, fault))
    }

    /// Ends the import if the caller says so. To be asked every few thousand items.
    pub(crate) fn check_cancelled(&self) -> Result<()> {
        self.whole(self.options.cancel.check().map_err(Fault::from))
    }

    /// Appends to a vector within the budget.
    #[inline(always)]
    pub(crate) fn push<T>(&self, items: &mut Vec<T>, item: T, what: &'static str) -> Result<()> {
        match self.budget.push(items, item, what) {
            Ok(()) => Ok(()),
            Err(fault) => Err(self.error(Place::File, fault)),
        }
    }

    /// Makes room for `extra` more items within the budget; at least doubles what it must enlarge.
    pub(crate) fn make_room<T>(
        &self,
        items: &mut Vec<T>,
        extra: usize,
        what: &'static str,
    ) -> Result<()> {
        if items.capacity() - items.len() >= extra {
            return Ok(());
        }
        let more = if items.is_empty() { extra } else { extra.max(items.len()) };
        self.whole(self.budget.reserve(items, more, what))
    }

    /// An empty vector within the budget.
    pub(crate) fn vec<T>(&self, len: usize, what: &'static str) -> Result<Vec<T>> {
        self.whole(self.budget.vec(len, what))
    }

    /// A source over the bytes of a file that this one names, on the same budget.
    pub(crate) fn beside<'b>(&self, side: &'b SidePath, bytes: &'b [u8]) -> Source<'b>
    where
        'a: 'b,
    {
        Source { file: &side.shown, bytes, folder: None, ..*self }
    }

    /// Finds a file that this one names by a relative path, or its `.zst` or `.gz` beside it.
    ///
    /// What leaves the scene's folder, also by a symbolic link, is refused unless the options
    /// allow it; addresses always.
    pub(crate) fn find(&self, place: &Place, target: &str) -> Result<SidePath> {
        let refuse = |fault| Err(self.error(place.clone(), fault));
        let owned = || clip(target);
        if is_url(target) {
            return refuse(Fault::Url { target: owned() });
        }
        let Some(folder) = self.folder else { return refuse(Fault::NoFolder { target: owned() }) };
        let relative = target.replace('\\', "/");
        if !self.options.allow_outside && !stays_below(&relative) {
            return refuse(Fault::Outside { target: owned() });
        }

        // Find the file, or a compressed one of that name.
        let plain = folder.join(&relative);
        let candidates = ["", ".zst", ".gz"].map(|suffix| {
            let mut name = plain.clone().into_os_string();
            name.push(suffix);
            PathBuf::from(name)
        });
        let Some(found) = candidates.iter().find(|path| path.exists()) else {
            return refuse(Fault::broken(
                format!("names the file {:?}, which is not there, nor as .zst or .gz", owned()),
                "put it beside the scene",
            ));
        };

        // Follow symbolic links before asking where the file really lies.
        let canonical = |path: &Path| path.canonicalize();
        let (home, real) = match (canonical(folder), canonical(found)) {
            (Ok(home), Ok(real)) => (home, real),
            (Err(error), _) | (_, Err(error)) => return refuse(error.into()),
        };
        if !self.options.allow_outside && !real.starts_with(&home) {
            return refuse(Fault::Outside { target: owned() });
        }
        Ok(SidePath { shown: found.clone(), real })
    }

    /// Reads a file that this one names. Its bytes count, and earn, each time: an importer must
    /// read no [`SidePath::real`] twice.
    pub(crate) fn read_side(&self, side: &SidePath) -> Result<Vec<u8>> {
        read_plain(&side.real, self.budget, self.options).map_err(|fault| ImportError {
            file: side.shown.clone(),
            place: Place::File,
            fault,
        })
    }

    /// Sets the finishing touch to what was read: a warning if nothing can be seen.
    pub(crate) fn finish(&self, mut model: Model) -> Model {
        if model.triangles_placed() == 0 {
            model.warnings.push("The file holds no triangles.".to_owned());
        }
        model
    }
}

/// Reads and unpacks a file that a scene names; pipes and devices, which may never end, are not
/// read.
fn read_plain(
    path: &Path,
    budget: &Budget,
    options: &Options,
) -> std::result::Result<Vec<u8>, Fault> {
    if !fs::metadata(path)?.is_file() {
        return Err(Fault::broken("is no plain file", "name a file, not a folder or device"));
    }
    read(path, budget, options)
}

/// Reads and unpacks a file.
pub(crate) fn read(
    path: &Path,
    budget: &Budget,
    options: &Options,
) -> std::result::Result<Vec<u8>, Fault> {
    read_open(File::open(path)?, Vec::new(), budget, options)
}

/// Reads and unpacks a file of which `head` was read, and paid for, already.
pub(crate) fn read_open(
    mut file: File,
    head: Vec<u8>,
    budget: &Budget,
    options: &Options,
) -> std::result::Result<Vec<u8>, Fault> {
    let size = file.metadata()?.len();
    if size > budget.left() {
        return Err(Fault::TooBig { what: "the file", needed: size, limit: budget.left() });
    }
    let mut bytes = head;
    let room = usize::try_from(size).unwrap_or(usize::MAX).saturating_add(1 << 19);
    budget.earn(room as u64);
    let extra = room.saturating_sub(bytes.len());
    budget.reserve(&mut bytes, extra, "the file")?;
    unpack::read_all(&mut file, &mut bytes, budget, options, |done| {
        options.tell(Progress { stage: READING, done, total: size });
        Ok(())
    })?;
    unpack::unpack(bytes.into(), budget, options).map(Cow::into_owned)
}

/// Whether `target` starts with a scheme as in `https:`. One letter is a drive, not a scheme.
fn is_url(target: &str) -> bool {
    let Some((scheme, _)) = target.split_once(':') else { return false };
    let letters = scheme.bytes().all(|b| b.is_ascii_alphanumeric() || b"+-.".contains(&b));
    scheme.len() > 1 && letters
}

/// Whether a relative path goes neither up past its start nor to a root or drive.
fn stays_below(path: &str) -> bool {
    let drive = path.as_bytes().get(1) == Some(&b':');
    let mut depth = 0_i64;
    for component in Path::new(path).components() {
        match component {
            Component::Normal(_) => depth += 1,
            Component::CurDir => {}
            Component::ParentDir => depth -= 1,
            Component::RootDir | Component::Prefix(_) => return false,
        }
        if depth < 0 {
            return false;
        }
    }
    !drive
}
