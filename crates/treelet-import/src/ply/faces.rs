//! The faces and triangle strips of a PLY file.

use crate::error::{Place, Result};
use crate::polygons::Polygons;
use crate::source::Source;

use super::header::{Element, Kind, Type};
use super::rows::{POLL_ROWS, Rows};

const LISTS: [&str; 2] = ["vertex_indices", "vertex_index"];
const TRIANGLES: &str = "triangles";

/// Triangles, as they come.
pub(super) struct Faces<'s, 'a> {
    source: &'s Source<'a>,
    pub(super) triangles: Vec<[u32; 3]>,
    polygons: Polygons,
    polygon: Vec<u32>,
}

impl<'s, 'a> Faces<'s, 'a> {
    pub(super) fn new(source: &'s Source<'a>) -> Self {
        Self {
            source,
            triangles: Vec::new(),
            polygons: Polygons::new(&source.options.cancel),
            polygon: Vec::new(),
        }
    }

    /// What was left out.
    pub(super) fn warnings(&self) -> Option<String> {
        self.polygons.warnings()
    }

    /// Reads all rows of an element of faces or strips.
    pub(super) fn read<'b, R: Rows<'b>>(
        &mut self,
        element: &Element,
        rows: &mut R,
        positions: &[[f32; 3]],
    ) -> Result<()> {
        self.expect(element, rows.rest())?;
        self.read_part(element, rows, positions, 0)
    }

    /// Makes room for the triangles of an element, of which `rest` bytes of file are left.
    pub(super) fn expect(&mut self, element: &Element, rest: u64) -> Result<()> {
        if element.name == "tristrips" {
            return Ok(());
        }
        let rows = usize::try_from(element.count.min(rest)).unwrap_or(usize::MAX);
        self.source.make_room(&mut self.triangles, rows, TRIANGLES)
    }

    /// Reads some rows of an element, from row `first` of it on.
    pub(super) fn read_part<'b, R: Rows<'b>>(
        &mut self,
        element: &Element,
        rows: &mut R,
        positions: &[[f32; 3]],
        first: u64,
    ) -> Result<()> {
        let is_strips = element.name == "tristrips";
        let Some((index, count_type, item_type)) = index_list(element) else {
            if element.count == 0 {
                return Ok(());
            }
            return Err(self.source.broken(
                Place::Line(element.line),
                format!("the element {:?} has no list \"vertex_indices\"", element.name),
                "export the file again, with faces as lists of vertex indices",
            ));
        };
        let is_common = element.properties.len() == 1
            && matches!((count_type, item_type), (Type::U8, Type::I32 | Type::U32));
        let mut row = 0;
        while row < element.count {
            if row.is_multiple_of(POLL_ROWS) {
                self.source.check_cancelled()?;
            }
            // Take a run of triangles at once where the layout is the common one.
            if R::LITTLE_ENDIAN && is_common && !is_strips {
                let run = self.read_triangle_run(rows, element.count - row)?;
                if run > 0 {
                    row += run;
                    continue;
                }
            }
            self.read_row(element, index, rows)?;
            if is_strips {
                self.add_strips()?;
            } else {
                self.add_polygon(first + row, positions)?;
            }
            row += 1;
        }
        Ok(())
    }

    /// The fast path: as many rows of `3 a b c`, one byte and three little-endian words, as follow
    /// each other. Returns how many.
    fn read_triangle_run<'b, R: Rows<'b>>(&mut self, rows: &mut R, most: u64) -> Result<u64> {
        const ROW: usize = 13;
        let room = (rows.rest() / ROW as u64).min(most).min(POLL_ROWS);
        let mut look = rows.clone();
        let Some(bytes) = look.take(room as usize * ROW) else { return Ok(0) };
        let before = self.triangles.len();
        // Room for all faces was made, but polygons may have taken it.
        self.source.make_room(&mut self.triangles, room as usize, TRIANGLES)?;
        let (chunks, _) = bytes.as_chunks::<ROW>();
        self.triangles.extend(chunks.iter().take_while(|row| row[0] == 3).map(|row| {
            let [_, a0, a1, a2, a3, b0, b1, b2, b3, c0, c1, c2, c3] = *row;
            [[a0, a1, a2, a3], [b0, b1, b2, b3], [c0, c1, c2, c3]].map(u32::from_le_bytes)
        }));
        let run = self.triangles.len() - before;
        let taken = rows.take(run * ROW);
        debug_assert!(taken.is_some(), "the run was just looked at");
        Ok(run as u64)
    }

    /// Reads one row; its index list goes to `self.polygon`.
    fn read_row<'b, R: Rows<'b>>(
        &mut self,
        element: &Element,
        index: usize,
        rows: &mut R,
    ) -> Result<()> {
        for (i, property) in element.properties.iter().enumerate() {
            match property.kind {
                Kind::List { count, item } if i == index => {
                    let len = rows.list_len(count, item)?;
                    self.polygon.clear();
                    self.source.make_room(&mut self.polygon, len, "a face")?;
                    for corner in 0..len {
                        if corner as u64 % POLL_ROWS == POLL_ROWS - 1 {
                            self.source.check_cancelled()?;
                        }
                        self.polygon.push(vertex_index(rows.value(item)?));
                    }
                }
                kind => rows.skip_kind(kind)?,
            }
        }
        rows.end_row()
    }

    /// Adds the triangles of the polygon just read.
    fn add_polygon(&mut self, row: u64, positions: &[[f32; 3]]) -> Result<()> {
        let place = || Place::Element(format!("face {row}"));
        let Self { source, triangles, polygons, polygon, .. } = self;
        polygons.add(source, place, polygon, positions, triangles)
    }

    /// Adds the triangles of the strips just read; a negative index starts a new strip.
    fn add_strips(&mut self) -> Result<()> {
        for strip in self.polygon.split(|&vertex| vertex == NO_VERTEX) {
            for (i, window) in strip.windows(3).enumerate() {
                // Every other triangle of a strip is wound the other way round.
                let (a, b, c) = (window[0], window[1], window[2]);
                let triangle = if i % 2 == 0 { [a, b, c] } else { [b, a, c] };
                self.source.push(&mut self.triangles, triangle, TRIANGLES)?;
            }
        }
        Ok(())
    }
}

/// An index that no vertex has: what was negative or too large in the file.
const NO_VERTEX: u32 = u32::MAX;

/// A vertex index out of a number of any type.
fn vertex_index(value: f64) -> u32 {
    if value >= 0.0 && value < f64::from(NO_VERTEX) { value as u32 } else { NO_VERTEX }
}

/// Which property lists the vertices, and its types.
fn index_list(element: &Element) -> Option<(usize, Type, Type)> {
    let index = element.find(&LISTS)?;
    match element.properties[index].kind {
        Kind::List { count, item } => Some((index, count, item)),
        Kind::Scalar(_) => None,
    }
}
