//! Large files, read through a window: what an importer makes of them is all that stays in memory.
//!
//! A format whose large files are rows of numbers reads them here; others ask for the whole file.
//! The window holds [`WINDOW`] bytes, or one row where that is longer.

use std::io::Read;
use std::path::Path;

use treelet::context::Progress;

use crate::budget::Budget;
use crate::error::{Fault, ImportError, Place, Result};
use crate::options::Options;
use crate::source::Source;

/// Bytes of a window, of a few milliseconds' work. Files that fit are read whole.
pub(crate) const WINDOW: usize = 1 << 22;

/// A file of which a window is in memory.
pub struct Stream<'a> {
    file: &'a Path,
    reader: &'a mut dyn Read,
    options: &'a Options,
    budget: &'a Budget,
    /// Bytes of the file, as the file system tells.
    len: u64,
    /// Where in the file the window starts.
    base: u64,
    bytes: Vec<u8>,
    /// Bytes that a window should have.
    window: usize,
}

impl std::fmt::Debug for Stream<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Stream").field("file", &self.file).field("base", &self.base).finish()
    }
}

impl<'a> Stream<'a> {
    /// The first window of a file of `len` bytes.
    pub(crate) fn open(
        file: &'a Path,
        reader: &'a mut dyn Read,
        len: u64,
        window: usize,
        options: &'a Options,
        budget: &'a Budget,
    ) -> Result<Self> {
        let bytes = Vec::new();
        let mut stream = Self { file, reader, options, budget, len, base: 0, bytes, window };
        budget.earn(len);
        stream.grow(window)?;
        stream.fill()?;
        Ok(stream)
    }

    /// The window as a file of its own: for headers, rows, errors and the budget.
    pub(crate) fn source(&self) -> Source<'_> {
        let Self { file, options, budget, .. } = *self;
        Source { file, bytes: &self.bytes, folder: None, options, budget }
    }

    /// What errors and arrays need, without the window.
    pub(crate) fn whole(&self) -> Source<'a> {
        let Self { file, options, budget, .. } = *self;
        Source { file, bytes: &[], folder: None, options, budget }
    }

    /// The bytes of the window.
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Where in the file the window starts.
    pub(crate) fn base(&self) -> u64 {
        self.base
    }

    /// Bytes of the file from the start of the window on.
    pub(crate) fn rest(&self) -> u64 {
        self.len - self.base
    }

    /// Bytes of the whole file.
    pub(crate) fn len(&self) -> u64 {
        self.len
    }

    /// Whether the window reaches the end of the file.
    pub(crate) fn is_last(&self) -> bool {
        self.bytes.len() as u64 >= self.rest()
    }

    /// Moves the window on by `consumed` bytes, and lets it grow if it holds not one row.
    ///
    /// Fails if the file has become shorter than it was.
    pub(crate) fn advance(&mut self, consumed: usize) -> Result<()> {
        self.bytes.drain(..consumed);
        self.base += consumed as u64;
        if consumed == 0 {
            self.grow(2 * self.window)?;
        }
        self.fill()
    }

    fn grow(&mut self, window: usize) -> Result<()> {
        let extra = window - self.bytes.len();
        let reserved = self.budget.reserve(&mut self.bytes, extra, "a window of the file");
        reserved.map_err(|fault| self.fail(fault))?;
        self.window = window;
        Ok(())
    }

    /// Reads until the window is full or the file has ended.
    fn fill(&mut self) -> Result<()> {
        self.options.cancel.check().map_err(|error| self.fail(error.into()))?;
        let wanted = (self.window as u64).min(self.rest()) - self.bytes.len() as u64;
        let read = (&mut *self.reader).take(wanted).read_to_end(&mut self.bytes);
        let read = read.map_err(|error| self.fail(error.into()))?;
        if (read as u64) < wanted {
            let found = "the file has become shorter while it was read";
            return Err(self.fail(Fault::broken(found, "read it again once it is written")));
        }
        let done = self.base + self.bytes.len() as u64;
        self.options.tell(Progress { stage: READING, done, total: self.len });
        Ok(())
    }

    fn fail(&self, fault: Fault) -> ImportError {
        ImportError { file: self.file.to_path_buf(), place: Place::File, fault }
    }

    /// Gives up the window: what was read, for those who want the file whole.
    pub(crate) fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }
}

/// What progress calls the reading of files.
pub(crate) const READING: &str = "reading";

#[cfg(test)]
mod tests {
    use std::path::Path;

    use treelet_model::Model;

    use super::Stream;
    use crate::budget::Budget;
    use crate::options::Options;

    /// A grid of quads, split or not, as a binary PLY in either byte order.
    /// With `extra` columns lists count in two bytes.
    fn ply(big: bool, side: u32, is_split: bool, extra: &str) -> Vec<u8> {
        let count = if extra.is_empty() { "uchar" } else { "ushort" };
        let order = if big { "big" } else { "little" };
        let faces = if is_split { 2 * side * side } else { side * side };
        let vertices = (side + 1) * (side + 1);
        let mut bytes = format!(
            "ply\nformat binary_{order}_endian 1.0\nelement vertex {vertices}\n{extra}property float \
             x\nproperty float y\nproperty float z\nelement face {faces}\nproperty list {count} int \
             vertex_indices\nend_header\n"
        )
        .into_bytes();
        let mut word = |word: [u8; 4]| {
            let turned = [word[3], word[2], word[1], word[0]];
            bytes.extend(if big { turned } else { word });
        };
        let at = |i: u32, j: u32| i * (side + 1) + j;
        for (i, j) in (0..=side).flat_map(|i| (0..=side).map(move |j| (i, j))) {
            if !extra.is_empty() {
                word([0; 4]);
            }
            for x in [i as f32, j as f32, (i * j % 7) as f32] {
                word(x.to_le_bytes());
            }
        }
        for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            let faces =
                if is_split { vec![vec![a, b, c], vec![a, c, d]] } else { vec![vec![a, b, c, d]] };
            for face in faces {
                let len = face.len() as u8;
                match (extra.is_empty(), big) {
                    (true, _) => bytes.push(len),
                    (false, true) => bytes.extend([0, len]),
                    (false, false) => bytes.extend([len, 0]),
                }
                for vertex in face {
                    let word = vertex.to_le_bytes();
                    let turned = [word[3], word[2], word[1], word[0]];
                    bytes.extend(if big { turned } else { word });
                }
            }
        }
        bytes
    }

    fn stl(count: u32) -> Vec<u8> {
        let mut bytes = vec![b' '; 80];
        bytes.extend(count.to_le_bytes());
        for i in 0..count {
            bytes.extend([0; 12]);
            bytes.extend((0..9).flat_map(|k| ((i * 9 + k) as f32).to_le_bytes()));
            bytes.extend([0, 0]);
        }
        bytes
    }

    /// What can be compared of a result.
    fn told(result: crate::Result<Model>) -> Result<(String, String), String> {
        let model = result.map_err(|error| error.to_string())?;
        let parts = model.objects.iter().flat_map(|object| &object.parts);
        let mesh =
            parts.map(|part| (part.mesh.positions().to_vec(), part.mesh.triangles().to_vec()));
        Ok((format!("{:?}", mesh.collect::<Vec<_>>()), format!("{:?}", model.warnings)))
    }

    /// Reads through a window; `None` if the file must be seen whole.
    fn streamed(name: &str, bytes: &[u8], window: usize) -> Option<crate::Result<Model>> {
        let options = Options::default();
        let budget = Budget::new(&options.limits);
        let mut reader = bytes;
        let len = bytes.len() as u64;
        let file = Path::new(name);
        let mut stream = match Stream::open(file, &mut reader, len, window, &options, &budget) {
            Ok(stream) => stream,
            Err(error) => return Some(Err(error)),
        };
        crate::read_stream(&mut stream).transpose()
    }

    #[test]
    fn through_a_window_files_read_as_whole() {
        let mut files = vec![("a.stl", stl(100))];
        for big in [false, true] {
            files.push(("a.ply", ply(big, 9, true, "")));
            files.push(("a.ply", ply(big, 9, false, "property int label\n")));
        }
        let mut state = 1_u64;
        let mut random = |below: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 33) as usize % below
        };
        let (mut read, mut refused) = (0, 0);
        for (name, sound) in files {
            for case in 0..300 {
                let mut bytes = sound.clone();
                if case > 0 {
                    // Damage behind the header.
                    let at = 200 + random(bytes.len() - 200);
                    bytes[at] ^= 1 << random(8);
                    bytes.truncate(bytes.len() - random(3) * random(40));
                }
                let whole = told(crate::load_bytes(name, &bytes, &Options::default()));
                // A window holds the header at least.
                let window = 300 + random(bytes.len());
                let Some(part) = streamed(name, &bytes, window) else { continue };
                let part = told(part);
                match (&whole, &part) {
                    (Ok(_), Ok(_)) => read += 1,
                    (Err(_), Err(_)) => refused += 1,
                    _ => {}
                }
                assert_eq!(part.is_ok(), whole.is_ok(), "case {case} of {name}: {part:?}");
                if whole.is_ok() {
                    assert_eq!(part, whole, "case {case} of {name}, window {window}");
                }
            }
        }
        assert!(read > 100 && refused > 20, "{read} read, {refused} refused");
    }

    #[test]
    fn a_file_that_shrinks_is_an_error() {
        let bytes = stl(100);
        let options = Options::default();
        let budget = Budget::new(&options.limits);
        let mut reader = &bytes[..2000];
        let len = bytes.len() as u64;
        let stream = Stream::open(Path::new("a.stl"), &mut reader, len, 1000, &options, &budget);
        let mut stream = stream.unwrap_or_else(|error| panic!("{error}"));
        let error = crate::read_stream(&mut stream).map(|_| ()).expect_err("it is cut");
        assert!(error.to_string().contains("has become shorter"), "{error}");
    }
}
