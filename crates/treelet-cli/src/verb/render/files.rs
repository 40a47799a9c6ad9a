//! The files of `treelet render`: the picture in its format, and those beside it.

use std::path::{Path, PathBuf};

use treelet_model::{Image, Pixels};
use treelet_render::{Film, Layers, RenderError, Renderer, ToneMap, encode_exr, encode_hdr};

use super::flags::{Flags, Format};
use super::report::Layer;
use crate::ending::Failure;
use crate::output::Output;
use crate::session::Session;

/// The most bytes of pixels that a picture which is read may have.
const PICTURE_BYTES: u64 = 4 << 30;

/// Where the film goes, and how it is shown.
pub(super) struct Picture<'a> {
    output: &'a Output,
    format: Format,
    tone: ToneMap,
}

impl<'a> Picture<'a> {
    /// The picture in `output`, so many stops brighter than usual.
    pub(super) fn new(output: &'a Output, stops: f32) -> Self {
        let format = Format::of(output.path()).unwrap_or(Format::Png);
        Self { output, format, tone: tone(stops) }
    }

    /// Whether a file of that name has room for layers.
    pub(super) fn is_layered(file: &Path) -> bool {
        Format::of(file) == Some(Format::Exr)
    }

    pub(super) fn path(&self) -> &Path {
        self.output.path()
    }

    pub(super) fn tone(&self) -> &ToneMap {
        &self.tone
    }

    /// Whether layers have a place in the file.
    pub(super) fn has_layers(&self) -> bool {
        self.format == Format::Exr
    }

    /// Replaces the file by the film as it is now, whole.
    pub(super) fn write(&self, film: &Film) -> Result<(), Failure> {
        self.write_means(film, &film.means()?, None)
    }

    /// Replaces the file by radiances, as many as the film has pixels.
    pub(super) fn write_means(
        &self,
        film: &Film,
        means: &[[f32; 3]],
        layers: Option<&Layers>,
    ) -> Result<(), Failure> {
        let (width, height) = (film.width(), film.height());
        let bytes = match self.format {
            Format::Png => treelet_render::Image::of_radiance(width, height, means, &self.tone)?
                .encode_png()?,
            Format::Exr => encode_exr(width, height, means, layers)?,
            Format::Hdr => encode_hdr(width, height, means)?,
        };
        Ok(self.output.replace(&bytes)?)
    }
}

/// How light is shown, so many stops brighter than usual.
pub(super) fn tone(stops: f32) -> ToneMap {
    ToneMap { exposure: ToneMap::default().exposure * libm::exp2f(stops) }
}

/// `treelet.png` has `treelet.raw.png` beside it.
pub(super) fn beside(output: &Path, name: &str) -> PathBuf {
    let extension = output.extension().unwrap_or_default().to_string_lossy();
    output.with_extension(format!("{name}.{extension}"))
}

/// The files of the layers that are wanted, each checked.
pub(super) fn layer_files(flags: &Flags) -> Result<Vec<(String, Output)>, Failure> {
    let mut layers: Vec<(String, Output)> = Vec::new();
    for name in &flags.aov {
        if layers.iter().all(|(other, _)| other != name) {
            // `treelet.png` has `treelet.normal.png` beside it.
            let file = flags.output.with_extension(format!("{name}.png"));
            layers.push((name.clone(), Output::prepare(&file)?));
        }
    }
    Ok(layers)
}

/// Refuses to write over the scene, or another file that is read.
pub(super) fn keep_inputs<'o>(
    flags: &Flags,
    outputs: impl Iterator<Item = &'o Output> + Clone,
) -> Result<(), Failure> {
    for (what, read) in
        [("scene", &flags.scene), ("environment", &flags.env), ("reference", &flags.compare)]
    {
        // A file that is not there is told when it is read.
        let Some(read) = read.as_ref().and_then(|read| read.canonicalize().ok()) else { continue };
        let same = |output: &&Output| output.path().canonicalize().is_ok_and(|file| file == read);
        if let Some(output) = outputs.clone().find(same) {
            return Err(Failure::Usage(format!(
                "{}: is the {what}, which would be written over; choose another name with -o",
                output.path().display()
            )));
        }
    }
    Ok(())
}

/// Reads a picture.
pub(super) fn read_picture(file: &Path) -> Result<Image, Failure> {
    let name = file.display().to_string();
    let bytes = std::fs::read(file)
        .map_err(|error| Failure::told(format!("{name}: cannot be read ({error})")))?;
    Ok(Image::decode(&bytes, &name, PICTURE_BYTES)?)
}

/// Reads a reference of the size of the picture: its radiances.
pub(super) fn read_reference(file: &Path, flags: &Flags) -> Result<Vec<[f32; 3]>, Failure> {
    let image = read_picture(file)?;
    let name = file.display();
    let (width, height) = (flags.size.width, flags.size.height);
    if (image.width, image.height) != (width, height) {
        return Err(Failure::Usage(format!(
            "{name}: has {}x{} pixels, the picture {width}x{height}; render with --size {}x{}",
            image.width, image.height, image.width, image.height
        )));
    }
    match &image.pixels {
        Pixels::Rgba32F(pixels) => Ok(pixels.iter().map(|&[r, g, b, _]| [r, g, b]).collect()),
        Pixels::Rgba8(_) => Err(Failure::Usage(format!(
            "{name}: holds display values, not light; compare with an .exr or .hdr"
        ))),
    }
}

/// Renders and writes the layers; the names of those for which Ctrl-C left no time come second.
pub(super) fn write_layers(
    renderer: &Renderer<'_>,
    layers: Vec<(String, Output)>,
    session: &Session,
) -> Result<(Vec<Layer>, Vec<String>), Failure> {
    let (mut written, mut missing) = (Vec::new(), Vec::new());
    for (name, output) in layers {
        let Some(aov) = treelet_render::Aov::by_name(&name) else { continue };
        if session.cancel.is_cancelled() {
            missing.push(name);
            continue;
        }
        let image = match renderer.aov(aov, &session.cancel) {
            // The picture is there, so what is missing is told, not mourned.
            Err(RenderError::Cancelled) => {
                missing.push(name);
                continue;
            }
            image => image?,
        };
        output.replace(&image.encode_png()?)?;
        written.push(Layer { name, file: output.path().display().to_string() });
    }
    Ok((written, missing))
}
