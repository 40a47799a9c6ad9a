//! A folder that vanishes, scenes that are written into it, and the command run in it.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::atomic::{AtomicUsize, Ordering};

use serde_json::Value;

/// A fresh folder, removed at the end of the test.
pub(crate) struct Folder(PathBuf);

impl Folder {
    pub(crate) fn new() -> Self {
        static NEXT: AtomicUsize = AtomicUsize::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let name = format!("treelet-test-{}-{number}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        fs::create_dir_all(&folder).unwrap();
        Self(folder)
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    pub(crate) fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    /// The names of the files that are there, sorted.
    pub(crate) fn files(&self) -> Vec<String> {
        let entries = fs::read_dir(&self.0).unwrap();
        let name = |entry: std::io::Result<fs::DirEntry>| entry.unwrap().file_name();
        let mut names: Vec<_> = entries.map(|entry| name(entry).into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// The command with the words of `line`, not yet started.
    pub(crate) fn command(&self, line: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_treelet"));
        command.args(line.split_whitespace()).current_dir(&self.0);
        command
    }

    /// Runs the command to its end.
    pub(crate) fn run(&self, line: &str) -> Run {
        Run::new(line, self.command(line).output().unwrap())
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        drop(fs::remove_dir_all(&self.0));
    }
}

/// A command that has ended.
pub(crate) struct Run {
    line: String,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
    pub(crate) code: Option<i32>,
}

impl Run {
    pub(crate) fn new(line: &str, output: Output) -> Self {
        Self {
            line: line.to_owned(),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
            code: output.status.code(),
        }
    }

    /// Asserts the exit code.
    #[track_caller]
    pub(crate) fn ends(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "`treelet {}` said\n{}", self.line, self.stderr);
        self
    }

    /// The one object on stdout, with what every report has.
    #[track_caller]
    pub(crate) fn json(&self, verb: &str) -> Value {
        let value: Value = serde_json::from_str(&self.stdout)
            .unwrap_or_else(|error| panic!("`treelet {}`: {error}\n{}", self.line, self.stdout));
        assert_eq!(value["schema"], 1, "`treelet {}`", self.line);
        assert_eq!(value["verb"], verb, "`treelet {}`", self.line);
        value
    }
}

/// Asserts that a file is a PNG from its first byte to its last chunk.
#[track_caller]
pub(crate) fn assert_whole_png(bytes: &[u8]) {
    assert!(bytes.starts_with(b"\x89PNG\r\n\x1a\n"), "{} bytes do not start a PNG", bytes.len());
    // The end chunk has no data: length, name, checksum.
    assert!(bytes.ends_with(b"\0\0\0\0IEND\xaeB`\x82"), "{} bytes do not end a PNG", bytes.len());
}

/// A square floor and a tetrahedron on it.
pub(crate) const SCENE: &str = "\
v -3 0 -3\nv 3 0 -3\nv 3 0 3\nv -3 0 3
v -1 0 -1\nv 1 0 -1\nv 0 0 1\nv 0 1.5 0
f 1 4 3 2
f 5 6 7\nf 5 8 6\nf 6 8 7\nf 7 8 5
";

/// Whether a path is there.
pub(crate) fn exists(path: &Path) -> bool {
    path.try_exists().unwrap()
}
