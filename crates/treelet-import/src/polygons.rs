//! Faces by vertex indices, as PLY and OFF have them, to triangles.

use treelet::context::Cancel;

use crate::error::{DAMAGED, Place, Result, counted};
use crate::polygon::{Splitter, quad_splits_at_0};
use crate::source::Source;

/// Splits faces, one after another, and counts those that are none.
#[derive(Debug)]
pub(crate) struct Polygons {
    splitter: Splitter,
    corners: Vec<[f32; 3]>,
    /// Faces of fewer than three corners.
    too_small: u64,
}

const TRIANGLES: &str = "triangles";

impl Polygons {
    pub(crate) fn new(cancel: &Cancel) -> Self {
        Self { splitter: Splitter::new(cancel), corners: Vec::new(), too_small: 0 }
    }

    /// Adds the triangles of a face. The scene builder judges the indices of plain triangles.
    pub(crate) fn add(
        &mut self,
        source: &Source<'_>,
        place: impl Fn() -> Place,
        polygon: &[u32],
        positions: &[[f32; 3]],
        triangles: &mut Vec<[u32; 3]>,
    ) -> Result<()> {
        match *polygon {
            [] | [_] | [_, _] => {
                self.too_small += 1;
                return Ok(());
            }
            [a, b, c] => return source.push(triangles, [a, b, c], TRIANGLES),
            _ => {}
        }
        self.corners.clear();
        source.make_room(&mut self.corners, polygon.len(), "a face")?;
        for &vertex in polygon {
            let Some(&position) = positions.get(vertex as usize) else {
                let found = format!("names vertex {vertex} of {}", positions.len());
                return Err(source.broken(place(), found, DAMAGED));
            };
            self.corners.push(position);
        }
        if let ([a, b, c, d], [p, q, r, s]) = (polygon, &self.corners[..])
            && quad_splits_at_0([*p, *q, *r, *s])
        {
            source.push(triangles, [*a, *b, *c], TRIANGLES)?;
            return source.push(triangles, [*a, *c, *d], TRIANGLES);
        }
        let split = self.splitter.split(&self.corners);
        for triangle in split.map_err(|fault| source.error(place(), fault))? {
            let triangle = triangle.map(|corner| polygon[corner as usize]);
            source.push(triangles, triangle, TRIANGLES)?;
        }
        Ok(())
    }

    /// What was left out.
    pub(crate) fn warnings(&self) -> Option<String> {
        let faces = counted(self.too_small, "face has", "faces have");
        (self.too_small > 0).then(|| format!("{faces} fewer than three corners; left out."))
    }
}
