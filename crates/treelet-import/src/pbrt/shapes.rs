//! Shapes to parts: meshes in the file, meshes in other files, and surfaces cut into triangles.

use std::rc::Rc;

use treelet::Mesh;
use treelet_model::{Object, Part, Placement};

use crate::catalogue::Importer as _;
use crate::error::{DAMAGED, Place, Result};
use crate::normals;
use crate::ply::Ply;
use crate::source::Source;

use super::params::Params;
use super::quadrics;
use super::scene::Scene;
use super::transform::{self, Rows};

/// A mesh in the coordinates of a shape.
#[derive(Debug, Default)]
pub(super) struct Surface {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) normals: Option<Vec<[f32; 3]>>,
    /// Counted from the upper left, as the model has it.
    pub(super) uvs: Option<Vec<[f32; 2]>>,
    /// Whether it turns its corners left toward its outside whatever space it is in.
    pub(super) is_quadric: bool,
}

impl Scene<'_, '_> {
    /// Adds a shape to the object at hand.
    pub(super) fn shape(&mut self, file: &Source<'_>, kind: &str, params: &Params) -> Result<()> {
        let Some(material) = self.shape_material(file, params)? else { return Ok(()) };
        if kind == "sphere" && self.open.is_none() && quadrics::is_whole(params) {
            return self.place_sphere(file, params, material);
        }
        let surface = match kind {
            "trianglemesh" => triangle_mesh(file, params)?,
            "loopsubdiv" => {
                self.notes.add("Subdivision surfaces have the shape of their base mesh");
                triangle_mesh(file, params)?
            }
            "bilinearmesh" => quadrics::bilinear(file, params)?,
            "plymesh" => self.ply_mesh(file, params)?,
            "sphere" => quadrics::sphere(file, params)?,
            "cylinder" => quadrics::cylinder(file, params)?,
            "disk" => quadrics::disk(file, params)?,
            kind => {
                self.notes.add(format!("Shapes of type {kind:?} are left out"));
                return Ok(());
            }
        };
        if surface.triangles.is_empty() {
            return Ok(());
        }
        let part = self.part(file, surface, material)?;
        let parts = match self.open.and_then(|open| self.model.objects.get_mut(open)) {
            Some(object) => &mut object.parts,
            None => &mut self.world,
        };
        file.push(parts, part, "parts")
    }

    /// A part in the coordinates of the world or of the object at hand.
    fn part(&mut self, file: &Source<'_>, surface: Surface, material: usize) -> Result<Part> {
        let Surface { mut positions, mut triangles, normals, uvs, is_quadric } = surface;
        let ctm = self.state.ctm;
        for position in &mut positions {
            *position = transform::point(&ctm, *position);
        }
        // A side is where corners turn left once the shape is placed; mirroring turns it over.
        let is_mirrored = transform::determinant(&ctm) < 0.0;
        let is_turned = self.state.is_reversed ^ is_mirrored;
        let mut normals = normals;
        if let Some(normals) = &mut normals {
            place_normals(normals, &ctm, is_mirrored ^ (self.state.is_reversed && !is_quadric));
        }
        // A quadric's corners follow its outside, also through a mirror.
        if is_turned {
            for [_, b, c] in &mut triangles {
                std::mem::swap(b, c);
            }
        }
        file.check_cancelled()?;
        let mesh = Mesh::new(positions, triangles);
        if let Some(normals) = &mut normals {
            let replaced = normals::repair(normals, &mesh);
            if replaced > 0 {
                self.notes.add("Normals of no length were replaced");
            }
        }
        let uvs = uvs.map(Into::into).into_iter().collect();
        Ok(Part { normals: normals.map(Into::into), uvs, ..Part::new(mesh, material) })
    }

    /// Places the one sphere that all full spheres of a material share.
    fn place_sphere(&mut self, file: &Source<'_>, params: &Params, material: usize) -> Result<()> {
        let key = (material, self.state.is_reversed);
        let object = match self.spheres.get(&key) {
            Some(&object) => object,
            None => {
                let unit = quadrics::sphere(file, &Params::default())?;
                let ctm = std::mem::replace(&mut self.state.ctm, transform::IDENTITY);
                let part = self.part(file, unit, material);
                self.state.ctm = ctm;
                let object = self.model.objects.len();
                let made = Object { name: "sphere".to_owned(), parts: vec![part?] };
                file.push(&mut self.model.objects, made, "objects")?;
                self.spheres.insert(key, object);
                object
            }
        };
        let radius = f64::from(params.float("radius", 1.0));
        let world = transform::compose(&self.state.ctm, &transform::scaling([radius; 3]));
        let placement = Placement { object, world_from_object: transform::rounded(&world) };
        file.push(&mut self.model.placements, placement, "placements")
    }

    /// The mesh of another file, which is read once.
    fn ply_mesh(&mut self, file: &Source<'_>, params: &Params) -> Result<Surface> {
        let place = Place::Line(params.line);
        let Some(name) = params.string("filename") else {
            return Err(file.broken(place, "is a plymesh without \"filename\"", DAMAGED));
        };
        let side = self.main.find(&place, name)?;
        let part = match self.files.get(&side.real) {
            Some(part) => Rc::clone(part),
            None => {
                let bytes = self.main.read_side(&side)?;
                let source = self.main.beside(&side, &bytes);
                let mut model = Ply.read(&source)?;
                let part = model.objects.pop().and_then(|mut object| object.parts.pop());
                let part = Rc::new(part.unwrap_or_default());
                self.files.insert(side.real, Rc::clone(&part));
                part
            }
        };
        let mesh = &part.mesh;
        let mut surface = Surface {
            positions: file.vec(mesh.positions().len(), "vertex positions")?,
            triangles: file.vec(mesh.triangles().len(), "triangles")?,
            ..Surface::default()
        };
        surface.positions.extend_from_slice(mesh.positions());
        surface.triangles.extend_from_slice(mesh.triangles());
        if let Some(normals) = &part.normals {
            let mut copy = file.vec(normals.len(), "normals")?;
            copy.extend_from_slice(normals);
            surface.normals = Some(copy);
        }
        if let Some(uvs) = part.uvs.first() {
            let mut copy = file.vec(uvs.len(), "texture coordinates")?;
            copy.extend_from_slice(uvs);
            surface.uvs = Some(copy);
        }
        Ok(surface)
    }
}

/// Takes normals through a transform, and turns them over.
fn place_normals(normals: &mut [[f32; 3]], ctm: &Rows, is_turned: bool) {
    let rows = transform::cofactors(ctm);
    let sign = if is_turned { -1.0 } else { 1.0 };
    for normal in normals {
        let n = normal.map(f64::from);
        *normal = rows.map(|row| (sign * transform::dot(row, n)) as f32);
    }
}

/// A mesh whose arrays stand in the file.
fn triangle_mesh(file: &Source<'_>, params: &Params) -> Result<Surface> {
    let broken = |found: String| {
        Err(file.broken(Place::Line(params.line), found, "check the program that wrote it"))
    };
    let Some(points) = params.groups::<3>(file, "P")? else {
        return broken("a mesh has no points \"P\"".to_owned());
    };
    let mut surface =
        Surface { positions: file.vec(points.len(), "vertex positions")?, ..Surface::default() };
    surface.positions.extend_from_slice(points);
    match params.integers("indices") {
        Some(indices) => {
            let (corners, rest) = indices.as_chunks::<3>();
            if !rest.is_empty() {
                return broken(format!("{} indices are no triangles", indices.len()));
            }
            surface.triangles = file.vec(corners.len(), "triangles")?;
            // What names no vertex is for the scene builder to report.
            let corner = |index: i64| u32::try_from(index).unwrap_or(u32::MAX);
            surface.triangles.extend(corners.iter().map(|triangle| triangle.map(corner)));
        }
        None if points.len() == 3 => surface.triangles.push([0, 1, 2]),
        None => return broken("a mesh of more than one triangle has no \"indices\"".to_owned()),
    }
    let beside = |name: &str, len: usize| {
        let found = format!("{len} entries of {name:?} for {} points", points.len());
        file.broken(Place::Line(params.line), found, "check the program that wrote it")
    };
    if let Some(normals) = params.groups::<3>(file, "N")? {
        if normals.len() != points.len() {
            return Err(beside("N", normals.len()));
        }
        surface.normals = Some(normals.to_vec());
    }
    if let Some(name) = ["uv", "st"].into_iter().find(|name| params.numbers(name).is_some()) {
        let uvs = params.groups::<2>(file, name)?.unwrap_or_default();
        if uvs.len() != points.len() {
            return Err(beside(name, uvs.len()));
        }
        file.whole(file.budget.spend(size_of_val(uvs) as u64, "texture coordinates"))?;
        surface.uvs = Some(uvs.iter().map(|&[u, v]| [u, 1.0 - v]).collect());
    }
    Ok(surface)
}
