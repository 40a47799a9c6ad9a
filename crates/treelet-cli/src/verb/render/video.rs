//! A clip as one file: through ffmpeg, where it is found, or as an animated PNG.
//!
//! Either way the file is whole or not there, and holds the frames that were made if Ctrl-C ends the
//! work early: ffmpeg stands apart from the command's process group and is told by the end of its input.

use std::io::{self, ErrorKind, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};

use treelet_render::Image;

use super::apng::Apng;
use crate::ending::Failure;
use crate::output::{Draft, Output};
use crate::session::say;

/// The program that makes videos.
const FFMPEG: &str = "ffmpeg";

/// Players of H.264 want colours at half size, so sides must be even; what is missing is padded.
const EVEN: &str = "pad=ceil(iw/2)*2:ceil(ih/2)*2";

/// A video in the making.
pub(super) struct Video {
    output: Output,
    draft: Draft,
    maker: Maker,
}

/// Who makes it.
enum Maker {
    Ffmpeg(Ffmpeg),
    Apng(Apng<std::fs::File>),
}

impl Video {
    /// The file that a video will be, as far as that is known: the one asked for, or the animated PNG
    /// in its place.
    pub(super) fn begin(file: &Path, size: [u32; 2], fps: f64) -> Result<Self, Failure> {
        let output = Output::prepare(file)?;
        let extension = file.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if extension.is_empty() {
            let name = file.display();
            return Err(Failure::Usage(format!(
                "--video {name}: what kind of video? a name that ends in .mp4, .webm, .gif or .png \
                 is needed"
            )));
        }
        if ["png", "apng"].contains(&extension.as_str()) {
            return Self::animated(output, fps);
        }
        let draft = output.draft()?;
        match Ffmpeg::start(draft.path(), size, fps) {
            Ok(ffmpeg) => Ok(Self { output, draft, maker: Maker::Ffmpeg(ffmpeg) }),
            Err(error) if error.kind() == ErrorKind::NotFound => {
                let output = Output::prepare(&file.with_extension("png"))?;
                let name = output.path().display();
                say(&format!("ffmpeg is not there; the video will be an animated PNG: {name}"));
                Self::animated(output, fps)
            }
            Err(error) => Err(Failure::told(format!(
                "ffmpeg cannot be started ({error}); mend it, or ask for an animated PNG: --video \
                 {}",
                file.with_extension("png").display()
            ))),
        }
    }

    fn animated(output: Output, fps: f64) -> Result<Self, Failure> {
        let draft = output.draft()?;
        let file = draft.file.try_clone().map_err(|error| draft.refused(error))?;
        Ok(Self { output, draft, maker: Maker::Apng(Apng::new(file, fps)) })
    }

    /// Where it will be.
    pub(super) fn output(&self) -> &Output {
        &self.output
    }

    /// Adds a frame.
    pub(super) fn push(&mut self, image: &Image) -> Result<(), Failure> {
        match &mut self.maker {
            Maker::Apng(apng) => {
                let png = image.encode_png()?;
                apng.push(&png).map_err(|error| self.draft.refused(error))?;
                Ok(())
            }
            Maker::Ffmpeg(ffmpeg) => ffmpeg.push(image),
        }
    }

    /// Puts the video in its place.
    pub(super) fn finish(self) -> Result<(), Failure> {
        match self.maker {
            Maker::Apng(apng) => {
                apng.finish().map_err(|error| self.draft.refused(error))?;
            }
            Maker::Ffmpeg(ffmpeg) => ffmpeg.finish()?,
        }
        Ok(self.draft.finish()?)
    }
}

/// The program at work.
struct Ffmpeg {
    child: Child,
    /// Taken at the end: that closes it.
    input: Option<ChildStdin>,
}

impl Ffmpeg {
    /// Starts it: raw pixels in, a file of the name's kind out.
    fn start(file: &Path, [width, height]: [u32; 2], fps: f64) -> io::Result<Self> {
        let mut command = Command::new(FFMPEG);
        command.args(["-hide_banner", "-loglevel", "error", "-y"]);
        command.args(["-f", "rawvideo", "-pix_fmt", "rgb24"]);
        command.args(["-s", &format!("{width}x{height}"), "-r", &fps.to_string(), "-i", "-"]);
        command.args(["-an", "-vf", EVEN, "-pix_fmt", "yuv420p"]);
        // A name with a dash in front would be read as a flag.
        command.arg(Path::new(".").join(file));
        command.stdin(Stdio::piped()).stdout(Stdio::null());
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn()?;
        let input = child.stdin.take();
        Ok(Self { child, input })
    }

    fn push(&mut self, image: &Image) -> Result<(), Failure> {
        let pixels = image.pixels().as_flattened();
        match self.input.as_mut().map(|input| input.write_all(pixels)) {
            Some(Ok(())) => Ok(()),
            _ => {
                self.input = None;
                self.check().and(Err(unwilling("it takes no more frames")))
            }
        }
    }

    /// Waits for the end, and asks how it was.
    fn check(&mut self) -> Result<(), Failure> {
        match self.child.wait() {
            Ok(status) if status.success() => Ok(()),
            Ok(status) => Err(unwilling(&status.to_string())),
            Err(error) => Err(unwilling(&error.to_string())),
        }
    }

    fn finish(mut self) -> Result<(), Failure> {
        self.input = None;
        self.check()
    }
}

impl Drop for Ffmpeg {
    fn drop(&mut self) {
        // Only one that nobody waited for is still there.
        if self.input.take().is_some() {
            drop(self.child.kill());
            drop(self.child.wait());
        }
    }
}

fn unwilling(reason: &str) -> Failure {
    Failure::told(format!(
        "ffmpeg made no video ({reason}); what it said stands above: ask for another kind, or for an \
         animated PNG with --video FILE.png"
    ))
}
