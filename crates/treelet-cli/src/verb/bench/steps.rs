//! Shows what is being done.

use std::sync::Mutex;

use treelet::Cancel;
use treelet_bench::run::Watcher;

use crate::progress::Line;

/// Shows what is being done.
pub(super) struct Steps {
    cancel: Cancel,
    line: Mutex<Option<Line>>,
}

impl Steps {
    pub(super) fn new(cancel: Cancel) -> Self {
        Self { cancel, line: Mutex::new(None) }
    }

    /// Removes the line.
    pub(super) fn clear(&self) {
        if let Ok(mut line) = self.line.lock() {
            *line = None;
        }
    }
}

impl Watcher for Steps {
    fn step(&self, what: &str) {
        if let Ok(mut line) = self.line.lock() {
            line.get_or_insert_with(|| Line::spinner(what)).set(0, what.to_owned());
        }
    }

    fn stopped(&self) -> bool {
        self.cancel.is_cancelled()
    }
}
