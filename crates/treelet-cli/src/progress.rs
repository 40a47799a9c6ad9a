//! Progress on stderr, if that is a terminal; nothing otherwise.

use std::sync::Mutex;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use treelet::context::Progress;

/// A line that shows how far something is, and vanishes at the end.
pub(crate) struct Line(ProgressBar);

impl Line {
    /// A spinner with a message.
    pub(crate) fn spinner(message: &str) -> Self {
        Self::new(0, "{spinner} {msg} {elapsed}", message)
    }

    /// A bar of `total` units with a message and the time left.
    pub(crate) fn bar(total: u64, message: &str) -> Self {
        Self::new(total, "{wide_bar} {msg}, {eta} left", message)
    }

    fn new(total: u64, template: &str, message: &str) -> Self {
        let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr());
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.set_message(message.to_owned());
        if !bar.is_hidden() {
            bar.enable_steady_tick(Duration::from_millis(120));
        }
        Self(bar)
    }

    /// Shows another message, and where the bar is.
    pub(crate) fn set(&self, done: u64, message: String) {
        self.0.set_message(message);
        self.0.set_position(done);
    }

    /// What an importer tells how far it is: the message gets a share of the file.
    pub(crate) fn reader(&self) -> treelet_import::Watch {
        let bar = self.0.clone();
        treelet_import::Watch::new(move |Progress { stage, done, total }| {
            let percent = done.saturating_mul(100) / total.max(1);
            bar.set_message(format!("{stage}, {percent} %"));
        })
    }

    /// Says something above the line.
    pub(crate) fn say(&self, sentence: &str) {
        self.0.suspend(|| crate::session::say(sentence));
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// A line that follows the stages of a build.
pub(crate) struct Stages {
    line: Line,
    stage: Mutex<&'static str>,
}

impl Stages {
    /// Nothing has begun.
    pub(crate) fn new(message: &str) -> Self {
        Self { line: Line::spinner(message), stage: Mutex::new("") }
    }

    /// What a build tells.
    pub(crate) fn watch(&self, progress: Progress) {
        let Ok(mut stage) = self.stage.lock() else { return };
        if *stage != progress.stage {
            *stage = progress.stage;
            self.line.0.set_message(progress.stage);
        }
    }
}
