//! OFF, Geomview's object file format, in ascii.
//!
//! After the manual of Geomview, "OFF Files". The keyword may be missing or glued to the first count,
//! as in well-known data sets; vertices may carry normals (`N`), which are read, and colours (`C`) or
//! texture coordinates (`ST`), which are stepped over with what stands behind a face. Remarks start
//! with `#`.

use treelet::Mesh;
use treelet_model::{Material, Model, Part};

use crate::catalogue::{Importer, Info};
use crate::error::{DAMAGED, Fault, Place, Result};
use crate::normals;
use crate::polygons::Polygons;
use crate::source::Source;
use crate::text::{self, Lines, Words};

/// The format, as the catalogue names it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Off;

impl Importer for Off {
    fn info(&self) -> Info {
        Info {
            name: "off",
            extensions: &["off", "noff", "coff"],
            summary: "OFF, ascii: triangles, polygons, vertex normals",
        }
    }

    fn sniff(&self, bytes: &[u8]) -> bool {
        let text = text::without_bom(bytes).trim_ascii_start();
        keyword(text).is_some_and(|(_, rest)| rest.first().is_none_or(u8::is_ascii_whitespace))
    }

    fn read(&self, source: &Source<'_>) -> Result<Model> {
        source.whole(text::refuse_utf16(source.bytes))?;
        Reader { source, lines: Lines::new(source.bytes) }.read()
    }
}

/// The letters before `OFF`, and what follows it.
fn keyword(text: &[u8]) -> Option<(&[u8], &[u8])> {
    let at = memchr::memmem::find(&text[..text.len().min(KEYWORD_MAX)], b"OFF")?;
    let (prefix, rest) = text.split_at(at);
    prefix.iter().all(|letter| b"STCN4n".contains(letter)).then(|| (prefix, &rest[3..]))
}

/// The longest keyword is `STCN4nOFF`.
const KEYWORD_MAX: usize = 9;

/// Lines between two looks at the caller's flag.
const POLL_LINES: u64 = 1 << 14;

struct Reader<'s, 'a> {
    source: &'s Source<'a>,
    lines: Lines<'a>,
}

impl<'a> Reader<'_, 'a> {
    fn read(&mut self) -> Result<Model> {
        // The keyword, and the counts, which may stand in its line.
        let mut line = self.line()?;
        let mut has_normals = false;
        if let Some((prefix, rest)) = keyword(line) {
            if prefix.iter().any(|letter| b"4n".contains(letter)) {
                let remedy = "save it with three coordinates a vertex";
                let fault = Fault::unsupported("has vertices in four or more dimensions", remedy);
                return Err(self.source.error(Place::Line(self.lines.number), fault));
            }
            has_normals = prefix.contains(&b'N');
            line = rest.trim_ascii();
            if line.starts_with(b"BINARY") {
                let fault = Fault::unsupported("is binary OFF", "save it as ascii OFF or as PLY");
                return Err(self.source.error(Place::Line(self.lines.number), fault));
            }
            if Words(line).next().is_none() {
                line = self.line()?;
            }
        }
        let mut words = Words(line);
        let vertices = self.count(words.next(), "the number of vertices", 6)?;
        let faces = self.count(words.next(), "the number of faces", 4)?;
        self.mesh(vertices, faces, has_normals)
    }

    /// Reads vertices and faces, a line each.
    fn mesh(&mut self, vertices: usize, faces: usize, has_normals: bool) -> Result<Model> {
        let source = self.source;
        let mut positions = source.vec(vertices, "vertex positions")?;
        let mut normals = source.vec(if has_normals { vertices } else { 0 }, "vertex normals")?;
        for _ in 0..vertices {
            let mut words = Words(self.line()?);
            positions.push(self.vector(&mut words)?);
            if has_normals {
                normals.push(self.vector(&mut words)?);
            }
        }
        let mut triangles = source.vec(faces, "triangles")?;
        let mut polygons = Polygons::new(&source.options.cancel);
        let mut polygon = Vec::new();
        for _ in 0..faces {
            let mut words = Words(self.line()?);
            let number = self.lines.number;
            let corners = self.count(words.next(), "the number of corners", 0)?;
            polygon.clear();
            for _ in 0..corners {
                let index = words.next().and_then(text::integer);
                let Some(index) = index else {
                    let found = format!("a face of {corners} corners names {}", polygon.len());
                    return Err(source.broken(Place::Line(number), found, DAMAGED));
                };
                // What names no vertex is for the scene builder to report.
                let index = u32::try_from(index).unwrap_or(u32::MAX);
                source.push(&mut polygon, index, "a face")?;
            }
            let place = || Place::Line(number);
            polygons.add(source, place, &polygon, &positions, &mut triangles)?;
        }
        let mut warnings: Vec<String> = polygons.warnings().into_iter().collect();
        let mesh = Mesh::new(positions, triangles);
        let mut part = Part::new(mesh, 0);
        if has_normals {
            let replaced = normals::repair(&mut normals, &part.mesh);
            if replaced > 0 {
                warnings.push(normals::replaced(replaced));
            }
            part.normals = Some(normals.into());
        }
        let mut model = Model::of_mesh("", Mesh::default(), Material::default());
        model.objects[0].parts = vec![part];
        model.warnings = warnings;
        Ok(model)
    }

    /// The next line that says something.
    fn line(&mut self) -> Result<&'a [u8]> {
        loop {
            let Some(line) = self.lines.next() else {
                let place = Place::Line(self.lines.number);
                return Err(self.source.broken(place, "the file ends too early", DAMAGED));
            };
            if self.lines.number.is_multiple_of(POLL_LINES) {
                self.source.check_cancelled()?;
            }
            if Words(line).next().is_some() {
                return Ok(line);
            }
        }
    }

    /// A count of things that take at least `bytes` bytes each, compared with those of the file.
    fn count(&self, word: Option<&[u8]>, what: &str, bytes: u64) -> Result<usize> {
        let place = || Place::Line(self.lines.number);
        let count = word.and_then(text::integer).and_then(|count| u64::try_from(count).ok());
        let Some(count) = count else {
            return Err(self.source.error(place(), text::no_number(word, what)));
        };
        let size = self.source.bytes.len() as u64;
        let needed = count.saturating_mul(bytes);
        if needed > size + 1 {
            let found =
                format!("{what} is {count}, which takes {needed} bytes; the file has {size}");
            return Err(self.source.broken(place(), found, DAMAGED));
        }
        Ok(usize::try_from(count).unwrap_or(usize::MAX))
    }

    fn vector(&self, words: &mut Words<'_>) -> Result<[f32; 3]> {
        let mut vector = [0.0; 3];
        for (axis, value) in vector.iter_mut().enumerate() {
            let word = words.next();
            *value = word.and_then(text::real).ok_or_else(|| {
                let fault = text::no_number(word, ["x", "y", "z"][axis]);
                self.source.error(Place::Line(self.lines.number), fault)
            })?;
        }
        Ok(vector)
    }
}
