//! The lines of an OBJ file: vertices into lists, faces into parts.

use std::collections::{HashMap, HashSet};

use crate::error::{DAMAGED, Fault, Place, Result, counted, quote};
use crate::polygon::{Splitter, quad_splits_at_0};
use crate::source::Source;
use crate::text::{self, Lines, Words};

/// A corner of a triangle: indices into the file's positions, texture coordinates and normals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Corner {
    pub(super) position: u32,
    /// [`NONE`] if the file gives none, and so below.
    pub(super) texture: u32,
    pub(super) normal: u32,
}

/// No index.
pub(super) const NONE: u32 = u32::MAX;

/// The triangles of one material.
#[derive(Debug, Default)]
pub(super) struct RawPart {
    pub(super) material: String,
    pub(super) triangles: Vec<[Corner; 3]>,
}

/// What the lines said so far.
pub(super) struct Reader<'s, 'a> {
    source: &'s Source<'a>,
    /// The first object's name.
    pub(super) name: String,
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) normals: Vec<[f32; 3]>,
    pub(super) uvs: Vec<[f32; 2]>,
    pub(super) parts: Vec<RawPart>,
    part_of_material: HashMap<Vec<u8>, usize>,
    /// Index of the part that faces go to.
    at: Option<usize>,
    /// Material libraries, with the lines that name them.
    pub(super) libraries: Vec<(u64, String)>,
    known_libraries: HashSet<String>,
    too_small: u64,
    /// Statements that are known and not read, and others.
    unread: [Option<&'static str>; UNREAD.len()],
    unknown: u64,
    /// The first line that starts with no known word.
    first_unknown: Option<(u64, String)>,
    splitter: Splitter,
    polygon: Vec<Corner>,
    corners: Vec<[f32; 3]>,
}

/// Statements with geometry that is not read.
const UNREAD: [(&str, &str); 4] =
    [("p", "points"), ("l", "lines"), ("curv", "curves"), ("surf", "free-form surfaces")];

/// Lines between two looks at the caller's flag.
const POLL_LINES: u64 = 1 << 14;

const TRIANGLES: &str = "triangles";

impl<'s, 'a> Reader<'s, 'a> {
    pub(super) fn new(source: &'s Source<'a>) -> Self {
        Self {
            source,
            name: String::new(),
            positions: Vec::new(),
            normals: Vec::new(),
            uvs: Vec::new(),
            parts: Vec::new(),
            part_of_material: HashMap::new(),
            at: None,
            libraries: Vec::new(),
            known_libraries: HashSet::new(),
            too_small: 0,
            unread: [None; UNREAD.len()],
            unknown: 0,
            first_unknown: None,
            splitter: Splitter::new(&source.options.cancel),
            polygon: Vec::new(),
            corners: Vec::new(),
        }
    }

    /// Reads the file to its end.
    pub(super) fn read_all(&mut self) -> Result<()> {
        let mut lines = Lines::new(self.source.bytes);
        let mut joined = Vec::new();
        while let Some(line) = lines.next() {
            let number = lines.number;
            self.poll(number)?;
            let Some(start) = line.strip_suffix(b"\\") else {
                self.statement(line, number)?;
                continue;
            };
            // A backslash at its end continues a line.
            joined.clear();
            self.append(&mut joined, start)?;
            while let Some(line) = lines.next() {
                self.poll(lines.number)?;
                joined.push(b' ');
                match line.strip_suffix(b"\\") {
                    Some(line) => self.append(&mut joined, line)?,
                    None => {
                        self.append(&mut joined, line)?;
                        break;
                    }
                }
            }
            self.statement(&joined, number)?;
        }
        match &self.first_unknown {
            Some((line, word)) if self.positions.is_empty() => Err(self.source.broken(
                Place::Line(*line),
                format!("{word} is no OBJ statement, and there is no vertex in the file"),
                "check that it is an OBJ file",
            )),
            _ => Ok(()),
        }
    }

    /// Looks at the caller's flag at every few thousandth line.
    fn poll(&self, number: u64) -> Result<()> {
        if number.is_multiple_of(POLL_LINES) {
            return self.source.check_cancelled();
        }
        Ok(())
    }

    fn append(&self, joined: &mut Vec<u8>, line: &[u8]) -> Result<()> {
        self.source.make_room(joined, line.len() + 1, "a line")?;
        joined.extend_from_slice(line);
        Ok(())
    }

    /// What was read but not understood.
    pub(super) fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        for what in self.unread.iter().flatten() {
            warnings.push(format!("OBJ {what} are not read."));
        }
        if let Some((line, word)) = &self.first_unknown {
            let lines = counted(self.unknown, "line starts", "lines start");
            let first = format!("the first is line {line} with {word}");
            warnings.push(format!("{lines} with no known word, {first}; left out."));
        }
        if self.too_small > 0 {
            let faces = counted(self.too_small, "face has", "faces have");
            warnings.push(format!("{faces} fewer than three corners; left out."));
        }
        warnings
    }

    /// Takes one line.
    fn statement(&mut self, line: &[u8], number: u64) -> Result<()> {
        let mut words = Words(line);
        let Some(word) = words.next() else { return Ok(()) };
        match word {
            b"v" => {
                let position = self.vector(&mut words, number)?;
                self.source.push(&mut self.positions, position, "vertex positions")
            }
            b"vn" => {
                let normal = self.vector(&mut words, number)?;
                self.source.push(&mut self.normals, normal, "vertex normals")
            }
            b"vt" => {
                let uv = self.uv(&mut words, number)?;
                self.source.push(&mut self.uvs, uv, "texture coordinates")
            }
            b"f" | b"fo" => self.face(words, number),
            b"usemtl" => self.use_material(words.0.trim_ascii()),
            b"mtllib" => {
                // Names are parted by blanks, but most programs write one name with blanks in it.
                let name = String::from_utf8_lossy(words.0.trim_ascii()).into_owned();
                if self.known_libraries.insert(name.clone()) {
                    self.libraries.push((number, name));
                }
                Ok(())
            }
            b"o" => {
                if self.name.is_empty() {
                    self.name = String::from_utf8_lossy(words.0.trim_ascii()).into_owned();
                }
                Ok(())
            }
            _ => {
                self.step_over(word, number);
                Ok(())
            }
        }
    }

    /// Remembers a statement that is not read.
    fn step_over(&mut self, word: &[u8], number: u64) {
        if let Some(i) = UNREAD.iter().position(|(name, _)| name.as_bytes() == word) {
            self.unread[i] = Some(UNREAD[i].1);
        } else if !HARMLESS.iter().any(|name| name.as_bytes() == word) {
            self.unknown += 1;
            self.first_unknown.get_or_insert_with(|| (number, quote(word)));
        }
    }

    /// Three numbers; more may follow (a weight, a colour).
    #[inline]
    fn vector(&self, words: &mut Words<'_>, number: u64) -> Result<[f32; 3]> {
        let mut vector = [0.0; 3];
        for (axis, value) in vector.iter_mut().enumerate() {
            let word = words.next();
            match word.and_then(text::real) {
                Some(real) => *value = real,
                None => {
                    let fault = text::no_number(word, ["x", "y", "z"][axis]);
                    return Err(self.source.error(Place::Line(number), fault));
                }
            }
        }
        Ok(vector)
    }

    /// One or two numbers; a third may follow. Files count v from below, the model from above.
    #[inline]
    fn uv(&self, words: &mut Words<'_>, number: u64) -> Result<[f32; 2]> {
        let u = words.next();
        let v = words.next().unwrap_or(b"0");
        match (u.and_then(text::real), text::real(v)) {
            (Some(u), Some(v)) => Ok([u, 1.0 - v]),
            (read, _) => {
                let word = if read.is_none() { u } else { Some(v) };
                let fault = text::no_number(word, "a texture coordinate");
                Err(self.source.error(Place::Line(number), fault))
            }
        }
    }

    /// Makes the part of a material the one that faces go to.
    fn use_material(&mut self, name: &[u8]) -> Result<()> {
        if let Some(&part) = self.part_of_material.get(name) {
            self.at = Some(part);
            return Ok(());
        }
        let part = self.parts.len();
        self.source.whole(self.source.budget.spend(PART_BYTES + name.len() as u64, "materials"))?;
        let material = String::from_utf8_lossy(name).into_owned();
        self.parts.push(RawPart { material, triangles: Vec::new() });
        self.part_of_material.insert(name.to_vec(), part);
        self.at = Some(part);
        Ok(())
    }

    /// Takes the corners of a face and splits it into triangles.
    fn face(&mut self, words: Words<'_>, number: u64) -> Result<()> {
        let source = self.source;
        self.polygon.clear();
        for word in words {
            let corner = match self.corner(word) {
                Ok(corner) => corner,
                Err(fault) => return Err(source.error(Place::Line(number), fault)),
            };
            source.push(&mut self.polygon, corner, "a face")?;
        }
        if self.polygon.len() < 3 {
            self.too_small += 1;
            return Ok(());
        }
        if self.at.is_none() {
            self.use_material(b"")?;
        }
        let Some(part) = self.at.and_then(|at| self.parts.get_mut(at)) else { return Ok(()) };
        let triangles = &mut part.triangles;
        if let [a, b, c] = self.polygon[..] {
            return source.push(triangles, [a, b, c], TRIANGLES);
        }

        // Split a polygon where its shape allows.
        self.corners.clear();
        source.make_room(&mut self.corners, self.polygon.len(), "a face")?;
        let positions = &self.positions;
        self.corners.extend(
            self.polygon.iter().filter_map(|corner| positions.get(corner.position as usize)),
        );
        if let ([a, b, c, d], [p, q, r, s]) = (&self.polygon[..], &self.corners[..])
            && quad_splits_at_0([*p, *q, *r, *s])
        {
            source.push(triangles, [*a, *b, *c], TRIANGLES)?;
            return source.push(triangles, [*a, *c, *d], TRIANGLES);
        }
        let split = self.splitter.split(&self.corners);
        let split = split.map_err(|fault| source.error(Place::Line(number), fault))?;
        for triangle in split {
            let triangle = triangle.map(|corner| self.polygon[corner as usize]);
            source.push(triangles, triangle, TRIANGLES)?;
        }
        Ok(())
    }

    /// Reads `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    #[inline]
    fn corner(&self, word: &[u8]) -> std::result::Result<Corner, Fault> {
        let mut indices = word.split(|&b| b == b'/');
        let position = indices.next().unwrap_or_default();
        let texture = indices.next().unwrap_or_default();
        let normal = indices.next().unwrap_or_default();
        if indices.next().is_some() {
            return Err(bad_corner(word));
        }
        let position = index(position, self.positions.len(), "vertex", word)?;
        let texture = match texture {
            [] => NONE,
            // A picture may lie wrong where this leads nowhere; the shape is right.
            texture => index(texture, self.uvs.len(), "texture coordinate", word).unwrap_or(NONE),
        };
        let normal = match normal {
            [] => NONE,
            normal => index(normal, self.normals.len(), "normal", word)?,
        };
        Ok(Corner { position, texture, normal })
    }
}

/// What a part costs beside its triangles, roughly.
const PART_BYTES: u64 = 512;

/// Statements that change nothing for us.
const HARMLESS: [&str; 30] = [
    "g",
    "s",
    "mg",
    "lod",
    "bevel",
    "c_interp",
    "d_interp",
    "usemap",
    "maptlib",
    "maplib",
    "shadow_obj",
    "trace_obj",
    "vp",
    "cstype",
    "deg",
    "bmat",
    "step",
    "parm",
    "trim",
    "hole",
    "scrv",
    "sp",
    "end",
    "con",
    "curv2",
    "ctech",
    "stech",
    "call",
    "csh",
    "vc",
];

/// An index of the file, from 1 or backward from the end, as an index from 0.
#[inline]
fn index(
    word: &[u8],
    len: usize,
    what: &'static str,
    corner: &[u8],
) -> std::result::Result<u32, Fault> {
    let Some(value) = text::integer(word) else { return Err(bad_corner(corner)) };
    let index = if value < 0 { value.checked_add(len as i64) } else { value.checked_sub(1) };
    match index.and_then(|index| u32::try_from(index).ok()) {
        Some(index) if (index as usize) < len && index != NONE => Ok(index),
        _ => Err(out_of_range(value, len, what)),
    }
}

#[cold]
fn bad_corner(corner: &[u8]) -> Fault {
    let found = format!("{} is no corner of a face", quote(corner));
    Fault::broken(found, "write vertex, vertex//normal or vertex/texture/normal, counted from 1")
}

#[cold]
fn out_of_range(value: i64, len: usize, what: &str) -> Fault {
    let found = format!("{what} {value} of a face, with {len} so far");
    let remedy = if value == 0 { "indices are counted from 1" } else { DAMAGED };
    Fault::broken(found, remedy)
}
