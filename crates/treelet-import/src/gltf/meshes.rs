//! Meshes to objects, primitives to parts.

use std::collections::HashMap;

use treelet::memory::Array;
use treelet_model::{Model, Object, Part};

use crate::error::{Place, Result, counted};
use crate::normals;
use crate::source::Source;

use super::accessor::Accessors;
use super::extensions;
use super::json::{Mesh, Primitive, Root, mode};

/// Reads meshes, each once, and once also the positions and indices that several primitives share.
pub(super) struct Meshes<'s, 'a> {
    source: &'s Source<'a>,
    root: &'s Root,
    pub(super) accessors: Accessors<'s, 'a>,
    /// Object of each mesh that was read.
    objects: HashMap<usize, usize>,
    positions: HashMap<usize, Array<[f32; 3]>>,
    uvs: HashMap<usize, Array<[f32; 2]>>,
    /// By accessor and mode.
    triangles: HashMap<(usize, u32), Array<[u32; 3]>>,
    /// Primitives that are points or lines.
    unread: usize,
    /// Primitives whose last triangle lacks corners.
    ragged: usize,
    replaced_normals: usize,
}

impl<'s, 'a> Meshes<'s, 'a> {
    pub(super) fn new(accessors: Accessors<'s, 'a>) -> Self {
        Self {
            source: accessors.source,
            root: accessors.root,
            accessors,
            objects: HashMap::new(),
            positions: HashMap::new(),
            uvs: HashMap::new(),
            triangles: HashMap::new(),
            unread: 0,
            ragged: 0,
            replaced_normals: 0,
        }
    }

    /// The object of a mesh, read now if this is the first time.
    pub(super) fn object(&mut self, mesh: usize, model: &mut Model) -> Result<usize> {
        if let Some(&object) = self.objects.get(&mesh) {
            return Ok(object);
        }
        let (read, _) = self.read(mesh, model)?;
        let object = model.objects.len();
        model.objects.push(read);
        self.objects.insert(mesh, object);
        Ok(object)
    }

    /// A mesh, read now, and the primitive that each of its parts comes from.
    pub(super) fn read(&mut self, mesh: usize, model: &Model) -> Result<(Object, Vec<usize>)> {
        self.source.check_cancelled()?;
        let Some(json) = self.root.meshes.get(mesh) else {
            let found = format!("is named, but there are {}", self.root.meshes.len());
            return Err(self.source.broken(super::item("mesh", mesh, ""), found, super::INVALID));
        };
        let (mut parts, mut primitives) = (Vec::new(), Vec::new());
        for (index, primitive) in json.primitives.iter().enumerate() {
            let place = primitive_place(mesh, json, index);
            if let Some(part) = self.part(primitive, place, model)? {
                parts.push(part);
                primitives.push(index);
            }
        }
        Ok((Object { name: json.name.clone(), parts }, primitives))
    }

    /// What was left out or mended.
    pub(super) fn warnings(&self) -> Vec<String> {
        let Self { unread, ragged, replaced_normals, .. } = self;
        let mut warnings = Vec::new();
        if *unread > 0 {
            let primitives = counted(*unread as u64, "primitive is", "primitives are");
            warnings.push(format!("{primitives} points or lines; left out."));
        }
        if *ragged > 0 {
            let primitives = counted(*ragged as u64, "primitive ends", "primitives end");
            warnings.push(format!("{primitives} inside a triangle; that is left out."));
        }
        if *replaced_normals > 0 {
            warnings.push(normals::replaced(*replaced_normals));
        }
        warnings
    }

    /// The part of a primitive; `None` if it has no triangles by nature.
    fn part(&mut self, primitive: &Primitive, place: Place, model: &Model) -> Result<Option<Part>> {
        let source = self.source;
        if primitive.mode > mode::TRIANGLE_FAN {
            let found = format!("has mode {}", primitive.mode);
            return Err(source.broken(place, found, super::INVALID));
        }
        let Some(position) =
            primitive.attributes.position.filter(|_| primitive.mode >= mode::TRIANGLES)
        else {
            self.unread += 1;
            return Ok(None);
        };
        // A decoder's place-holder has no data; if there is data beside it, all is well.
        let has_data = |accessor: usize| {
            self.root.accessors.get(accessor).is_some_and(|a| a.buffer_view.is_some())
        };
        if primitive.extensions.draco.is_some() && !has_data(position) {
            return Err(source.error(place, extensions::draco()));
        }

        let positions = match self.positions.get(&position) {
            Some(positions) => positions.clone(),
            None => {
                let positions: Array<_> = self.accessors.vectors(position, "positions")?.into();
                self.positions.insert(position, positions.clone());
                positions
            }
        };
        if positions.len() as u64 > u64::from(u32::MAX) {
            return Err(source.broken(place, "has more than 2^32 vertices", "split the mesh"));
        }
        let mode = primitive.mode;
        let known = primitive.indices.and_then(|indices| self.triangles.get(&(indices, mode)));
        let triangles: Array<[u32; 3]> = match (primitive.indices, known) {
            (_, Some(triangles)) => triangles.clone(),
            (Some(accessor), None) => {
                let indices = self.accessors.indices(accessor)?;
                let made: Array<_> =
                    self.make_triangles(mode, indices.len(), |i| indices[i])?.into();
                self.triangles.insert((accessor, mode), made.clone());
                made
            }
            (None, None) => self.make_triangles(mode, positions.len(), |i| i as u32)?.into(),
        };
        let vertices = positions.len();
        let mesh = treelet::Mesh::new(positions, triangles);
        let normals = match primitive.attributes.normal {
            Some(normal) => Some(self.normals(normal, vertices, &mesh, &place)?),
            None => None,
        };
        // The list of materials ends with the one that primitives have by default.
        let default = self.root.materials.len();
        let material = primitive.material.unwrap_or(default);
        if material >= model.materials.len() {
            let found = format!("names material {material} of {default}");
            return Err(source.broken(place, found, super::INVALID));
        }
        let mut part = Part { normals, ..Part::new(mesh, material) };
        self.beside(primitive, vertices, &place, &mut part)?;
        Ok(Some(part))
    }

    /// Reads what stands beside positions and normals: coordinates, tangents, colours.
    fn beside(
        &mut self,
        primitive: &Primitive,
        vertices: usize,
        place: &Place,
        part: &mut Part,
    ) -> Result<()> {
        let attributes = &primitive.attributes;
        let source = self.source;
        let check = |len: usize, what: &str| {
            if len == vertices {
                return Ok(());
            }
            let found = format!("has {len} {what} for {vertices} vertices");
            Err(source.broken(place.clone(), found, super::INVALID))
        };
        // Without textures nobody asks where they lie.
        if !self.root.textures.is_empty() {
            let sets = [
                attributes.texcoord_0,
                attributes.texcoord_1,
                attributes.texcoord_2,
                attributes.texcoord_3,
            ];
            let last = sets.iter().rposition(Option::is_some);
            for &set in sets.iter().take(last.map_or(0, |last| last + 1)) {
                const WHAT: &str = "texture coordinates";
                let uvs: Array<[f32; 2]> = match set {
                    Some(set) => match self.uvs.get(&set) {
                        Some(uvs) => uvs.clone(),
                        None => {
                            let uvs: Array<_> = self.accessors.vectors(set, WHAT)?.into();
                            self.uvs.insert(set, uvs.clone());
                            uvs
                        }
                    },
                    None => source.whole(source.budget.filled([0.0; 2], vertices, WHAT))?.into(),
                };
                check(uvs.len(), WHAT)?;
                part.uvs.push(uvs);
            }
            if let Some(tangent) = attributes.tangent {
                let tangents: Vec<[f32; 4]> = self.accessors.vectors(tangent, "tangents")?;
                check(tangents.len(), "tangents")?;
                part.tangents = Some(tangents.into());
            }
        }
        if let Some(color) = attributes.color_0 {
            let colors = self.accessors.colors(color)?;
            check(colors.len(), "colours")?;
            part.colors = Some(colors.into());
        }
        Ok(())
    }

    /// Unit normals, one a vertex.
    fn normals(
        &mut self,
        accessor: usize,
        vertices: usize,
        mesh: &treelet::Mesh,
        place: &Place,
    ) -> Result<Array<[f32; 3]>> {
        let mut normals = self.accessors.vectors(accessor, "normals")?;
        if normals.len() != vertices {
            let found = format!("has {} normals for {vertices} vertices", normals.len());
            return Err(self.source.broken(place.clone(), found, super::INVALID));
        }
        self.replaced_normals += normals::repair(&mut normals, mesh);
        Ok(normals.into())
    }

    /// Triangles of a list, strip or fan of `count` corners.
    fn make_triangles(
        &mut self,
        mode: u32,
        count: usize,
        corner: impl Fn(usize) -> u32,
    ) -> Result<Vec<[u32; 3]>> {
        let len = if mode == mode::TRIANGLES { count / 3 } else { count.saturating_sub(2) };
        self.ragged += usize::from(mode == mode::TRIANGLES && !count.is_multiple_of(3));
        let mut triangles = self.source.vec(len, "triangles")?;
        triangles.extend((0..len).map(|i| {
            match mode {
                mode::TRIANGLES => [3 * i, 3 * i + 1, 3 * i + 2],
                // Every other triangle of a strip is wound the other way round.
                mode::TRIANGLE_STRIP => [i, i + 1 + i % 2, i + 2 - i % 2],
                _ => [i + 1, i + 2, 0],
            }
            .map(&corner)
        }));
        Ok(triangles)
    }
}

pub(super) fn primitive_place(mesh: usize, json: &Mesh, index: usize) -> Place {
    match super::item("mesh", mesh, &json.name) {
        Place::Element(name) => Place::Element(format!("{name}, primitive {index}")),
        other => other,
    }
}
