//! From the corners of an OBJ file, which index positions, normals and texture coordinates apart, to
//! meshes, whose vertices have all of them.

use treelet::Mesh;
use treelet_model::Part;

use crate::error::{Result, counted};
use crate::normals;
use crate::source::Source;

use super::reader::{Corner, NONE, RawPart, Reader};

/// A mesh for each part, in order, with the vertices that it uses in the order of first use.
pub(super) fn make(
    source: &Source<'_>,
    reader: Reader<'_, '_>,
    warnings: &mut Vec<String>,
) -> Result<Vec<Part>> {
    let Reader { positions, normals, uvs, parts, .. } = reader;
    let any =
        |part: &RawPart, has: fn(&Corner) -> bool| part.triangles.as_flattened().iter().any(has);
    let has_normals = |part: &RawPart| any(part, |corner| corner.normal != NONE);
    let has_uvs = |part: &RawPart| any(part, |corner| corner.texture != NONE);
    // The usual scan: everything as the file has it, no vertex moved.
    if let [part] = &parts[..]
        && !has_normals(part)
        && !has_uvs(part)
    {
        let mut triangles = source.vec(part.triangles.len(), "triangles")?;
        triangles.extend(part.triangles.iter().map(|t| t.map(|corner| corner.position)));
        let mesh = Mesh::new(positions, triangles);
        return Ok(vec![Part::new(mesh, 0)]);
    }
    if parts.is_empty() {
        let mesh = Mesh::new(positions, Vec::new());
        return Ok(vec![Part::new(mesh, 0)]);
    }

    let heads = source.whole(source.budget.filled(NONE, positions.len(), "vertex numbers"))?;
    let mut weld = Weld { source, heads, vertices: Vec::new() };
    let mut made = Vec::new();
    let mut replaced = 0;
    for part in parts {
        let (has_normals, has_uvs) = (has_normals(&part), has_uvs(&part));
        let triangles = weld.number(&part.triangles)?;
        let mut own_positions = source.vec(weld.vertices.len(), "vertex positions")?;
        let position = |v: &Vertex| positions.get(v.corner.position as usize).copied();
        own_positions.extend(weld.vertices.iter().map(|v| position(v).unwrap_or_default()));
        let mesh = Mesh::new(own_positions, triangles);
        let own_normals = if has_normals {
            let mut own = source.vec(weld.vertices.len(), "vertex normals")?;
            let normal = |v: &Vertex| normals.get(v.corner.normal as usize).copied();
            own.extend(weld.vertices.iter().map(|v| normal(v).unwrap_or_default()));
            replaced += normals::repair(&mut own, &mesh);
            Some(own.into())
        } else {
            None
        };
        let mut own_uvs = Vec::new();
        if has_uvs {
            let mut own = source.vec(weld.vertices.len(), "texture coordinates")?;
            let uv = |v: &Vertex| uvs.get(v.corner.texture as usize).copied();
            own.extend(weld.vertices.iter().map(|v| uv(v).unwrap_or_default()));
            own_uvs.push(own.into());
        }
        weld.reset();
        made.push(Part { normals: own_normals, uvs: own_uvs, ..Part::new(mesh, 0) });
    }
    if replaced > 0 {
        let one = "normal that is missing or of no length was";
        let several = "normals that are missing or of no length were";
        warnings.push(format!("{} replaced.", counted(replaced as u64, one, several)));
    }
    Ok(made)
}

/// So many vertices of a position are looked through before a new one is made without need; keeps
/// a file with a million normals at one position linear.
const CHAIN_MAX: usize = 64;

/// Gives a number to each pair of position and normal. The vertices of a position form a chain, so
/// there is no hashing and the order is the file's.
struct Weld<'s, 'a> {
    source: &'s Source<'a>,
    /// First vertex of each position.
    heads: Vec<u32>,
    vertices: Vec<Vertex>,
}

struct Vertex {
    corner: Corner,
    /// Next vertex of the same position.
    next: u32,
}

impl Weld<'_, '_> {
    fn number(&mut self, triangles: &[[Corner; 3]]) -> Result<Vec<[u32; 3]>> {
        let mut numbered = self.source.vec(triangles.len(), "triangles")?;
        for triangle in triangles {
            let mut numbers = [0; 3];
            for (number, corner) in numbers.iter_mut().zip(triangle) {
                *number = self.vertex(*corner)?;
            }
            numbered.push(numbers);
        }
        Ok(numbered)
    }

    fn vertex(&mut self, corner: Corner) -> Result<u32> {
        let head = &mut self.heads[corner.position as usize];
        let mut at = *head;
        for _ in 0..CHAIN_MAX {
            let Some(vertex) = self.vertices.get(at as usize) else { break };
            if vertex.corner == corner {
                return Ok(at);
            }
            at = vertex.next;
        }
        let number = self.vertices.len() as u32;
        let vertex = Vertex { corner, next: *head };
        *head = number;
        self.source.push(&mut self.vertices, vertex, "vertices")?;
        Ok(number)
    }

    /// Forgets the vertices, at a cost of their number.
    fn reset(&mut self) {
        for vertex in self.vertices.drain(..) {
            self.heads[vertex.corner.position as usize] = NONE;
        }
    }
}
