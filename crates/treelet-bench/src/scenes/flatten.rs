//! A model as one array of triangles: for rivals that have no instances.

use treelet::Mesh;
use treelet_model::Model;

use crate::engine::Triangles;

/// Triangles that a flattened scene may have: above, arrays of several engines leave no room.
const MOST: u64 = 100_000_000;

/// A model that cannot be measured.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FlattenError {
    /// Instances multiply to too much.
    #[error(
        "{placed} triangles once its instances are copied ({stored} stored); the bench gives every \
         engine plain triangles, at most {MOST}: take a scene with fewer instances"
    )]
    TooMany {
        /// With instances.
        placed: u64,
        /// Without.
        stored: u64,
    },
    /// There is nothing to hit.
    #[error("no triangle with three finite corners: choose another scene")]
    Empty,
}

/// The model's triangles in the world, without those that have a defect.
///
/// One spare vertex follows the last: Embree reads vertices 16 bytes at a time.
///
/// # Errors
///
/// Too many triangles, or none.
pub fn flatten(model: &Model) -> Result<Triangles, FlattenError> {
    let placed = model.triangles_placed();
    let vertices: u64 = model
        .placements
        .iter()
        .filter_map(|placement| model.objects.get(placement.object))
        .flat_map(|object| &object.parts)
        .map(|part| part.mesh.positions().len() as u64)
        .sum();
    if placed > MOST || vertices >= u64::from(u32::MAX) {
        return Err(FlattenError::TooMany { placed, stored: model.triangles_stored() });
    }

    // Copy every placed mesh, its indices moved to where its vertices went.
    let mut positions = Vec::with_capacity(vertices as usize + 1);
    let mut indices = Vec::with_capacity(placed as usize);
    for placement in &model.placements {
        let Some(object) = model.objects.get(placement.object) else { continue };
        for part in &object.parts {
            let world = |position| placement.world_from_object.point(position);
            add(&part.mesh, world, &mut positions, &mut indices);
        }
    }
    if indices.is_empty() {
        return Err(FlattenError::Empty);
    }
    positions.push([0.0; 3]);
    Ok(Triangles { positions: positions.into(), indices: indices.into(), later: None })
}

/// Adds a mesh, its points moved and its indices to where these went, without triangles that have a
/// defect.
pub(super) fn add(
    mesh: &Mesh,
    place: impl Fn([f32; 3]) -> [f32; 3],
    positions: &mut Vec<[f32; 3]>,
    indices: &mut Vec<[u32; 3]>,
) {
    let first = positions.len() as u32;
    positions.extend(mesh.positions().iter().map(|position| place(*position)));
    for (prim, triangle) in mesh.triangles().iter().enumerate() {
        let sound = mesh.defect(prim).is_none();
        if sound && triangle.iter().all(|&v| usable(&positions[(first + v) as usize])) {
            indices.push(triangle.map(|vertex| first + vertex));
        }
    }
}

/// Coordinates up to here are taken by every engine.
const FAR: f32 = 1e18;

/// Whether a placed vertex is one that every engine takes.
fn usable(position: &[f32; 3]) -> bool {
    position.iter().all(|x| x.abs() <= FAR)
}

#[cfg(test)]
mod tests {
    use super::{FlattenError, flatten};
    use treelet::Mesh;
    use treelet::math::Affine;
    use treelet_model::{Material, Model, Placement};

    fn model() -> Model {
        let positions = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [f32::NAN; 3]];
        let mesh = Mesh::new(positions, [[0, 1, 2], [0, 1, 3], [0, 1, 9]]);
        Model::of_mesh("one", mesh, Material::default())
    }

    #[test]
    fn instances_become_triangles_and_defects_vanish() {
        let mut model = model();
        let moved = Affine::translation([0.0, 0.0, 5.0]);
        model.placements.push(Placement { object: 0, world_from_object: moved });
        let triangles = flatten(&model).unwrap();
        assert_eq!(triangles.len(), 2);
        assert_eq!(triangles.corners(1), [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0]]);
        assert_eq!(triangles.positions.len(), 9, "a spare vertex");
    }

    #[test]
    fn too_many_and_none_are_errors() {
        let mut many = model();
        many.placements = vec![many.placements[0].clone(); 40_000_000];
        assert!(matches!(flatten(&many), Err(FlattenError::TooMany { stored: 3, .. })));
        assert_eq!(flatten(&Model::default()).unwrap_err(), FlattenError::Empty);
    }
}
