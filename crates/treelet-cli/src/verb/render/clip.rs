//! Which frames of which clip are shown.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use treelet_model::{Animation, Model};

use crate::ending::Failure;
use crate::session::say;
use crate::text;

/// Frames a second unless somebody says otherwise.
pub(super) const FPS: f64 = 24.0;

/// The last frame that has a number.
const LAST: u32 = 9_999_999;

/// Digits of a frame's number where the name of -o does not say.
const DIGITS: usize = 4;

/// At most so many clips are named.
const NAMED: usize = 12;

/// The frames of the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FrameRange {
    first: u32,
    /// The one after the last; with the clip, if nobody says.
    end: Option<u32>,
}

impl FrameRange {
    /// From the first to the end of the clip.
    pub(super) const WHOLE: Self = Self { first: 0, end: None };

    /// The numbers, for a clip of so many seconds: at least one.
    pub(super) fn numbers(self, seconds: f64, fps: f64) -> Range<u32> {
        /// A clip that ends this short a part of a frame after a frame needs no further one.
        const HARDLY: f64 = 1e-3;
        let frames = (seconds * fps - HARDLY).ceil().clamp(1.0, f64::from(LAST));
        let end = self.end.unwrap_or(frames as u32);
        self.first..end.max(self.first + 1)
    }
}

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        const FORMS: &str = "frames are 0..120, 0..=119, 7, 10.. or ..";
        let number = |text: &str| -> Result<u32, String> {
            let number = text.parse().ok().filter(|&number| number <= LAST);
            number.ok_or_else(|| format!("{FORMS}, with numbers up to {LAST}"))
        };
        let Some((first, end)) = text.split_once("..") else {
            let first = number(text)?;
            return Ok(Self { first, end: Some(first + 1) });
        };
        let first = if first.is_empty() { 0 } else { number(first)? };
        let end = match (end, end.strip_prefix('=')) {
            ("", _) => None,
            (_, Some(last)) => Some(number(last)? + 1),
            (end, None) => Some(number(end)?),
        };
        if end.is_some_and(|end| end <= first) {
            return Err(format!("holds no frame; {FORMS}"));
        }
        Ok(Self { first, end })
    }
}

/// The clip that is asked for, by its place in the list.
pub(in crate::verb) fn choose(model: &Model, asked: Option<&str>) -> Result<usize, Failure> {
    let clips = &model.animations;
    if clips.is_empty() {
        return Err(Failure::Usage(
            "nothing in the scene moves, so there is no clip; render goes round it with --turntable N".into(),
        ));
    }
    let Some(asked) = asked else { return Ok(0) };
    let by_name = clips.iter().position(|clip| clip.name == asked);
    let by_number = || {
        let number = asked.parse::<usize>().ok()?.checked_sub(1)?;
        (number < clips.len()).then_some(number)
    };
    by_name.or_else(by_number).ok_or_else(|| {
        Failure::Usage(format!("--clip {asked}: the scene has no such clip, but {}", names(model)))
    })
}

/// Tells of the clips of a scene that is shown standing still.
pub(super) fn tell(model: &Model) {
    let clips = model.animations.len() as u64;
    if clips > 0 {
        let (clips, names) = (text::things(clips, "clip"), names(model));
        say(&format!("{clips}: {names}; --frames .. plays the first, --clip another"));
    }
}

/// A clip's number and name.
pub(in crate::verb) fn name(clip: &Animation, index: usize) -> String {
    let number = index + 1;
    if clip.name.is_empty() { number.to_string() } else { format!("{number} {}", clip.name) }
}

/// Numbers and names of the clips.
fn names(model: &Model) -> String {
    let clips = model.animations.iter().enumerate();
    let names: Vec<String> = clips.take(NAMED).map(|(index, clip)| name(clip, index)).collect();
    let more = if model.animations.len() > NAMED { " ..." } else { "" };
    names.join(", ") + more
}

/// Whether a file's name has a place for a number.
pub(super) fn has_place(output: &Path) -> bool {
    output.file_name().is_some_and(|name| name.to_string_lossy().contains('#'))
}

/// The file of a frame: its number in the place of the first `#`s, or before the extension.
pub(super) fn frame_file(output: &Path, number: u32) -> PathBuf {
    let name = output.file_name().unwrap_or_default().to_string_lossy();
    let Some(start) = name.find('#') else {
        return super::files::beside(output, &format!("{number:0DIGITS$}"));
    };
    let rest = name[start..].trim_start_matches('#');
    let digits = name.len() - start - rest.len();
    output.with_file_name(format!("{}{number:0digits$}{rest}", &name[..start]))
}

#[cfg(test)]
mod tests {
    use super::{FrameRange, frame_file};
    use std::path::Path;

    #[test]
    fn ranges_are_read() {
        let range = |text: &str| text.parse::<FrameRange>().map(|range| range.numbers(1.0, 24.0));
        assert_eq!(range("0..120"), Ok(0..120));
        assert_eq!(range("3..=5"), Ok(3..6));
        assert_eq!(range("7"), Ok(7..8));
        assert_eq!(range(".."), Ok(0..24));
        assert_eq!(range("10.."), Ok(10..24));
        assert_eq!(range("30.."), Ok(30..31), "a clip that is over still has a frame");
        assert_eq!(range("..=2"), Ok(0..3));
        assert_eq!(FrameRange::WHOLE.numbers(1.01, 24.0), 0..25);
        assert_eq!(FrameRange::WHOLE.numbers(0.0, 24.0), 0..1);
        assert_eq!(FrameRange::WHOLE.numbers(f64::INFINITY, 24.0).start, 0);
        for text in ["5..5", "5..4", "a", "-1..3", "0..99999999", "0...3", ""] {
            assert!(range(text).is_err(), "{text}");
        }
    }

    #[test]
    fn frames_have_names() {
        let file = |output: &str, number| frame_file(Path::new(output), number);
        assert_eq!(file("a/out.####.png", 7), Path::new("a/out.0007.png"));
        assert_eq!(file("a#/#_#.png", 123), Path::new("a#/123_#.png"));
        assert_eq!(file("treelet.png", 12), Path::new("treelet.0012.png"));
    }
}
