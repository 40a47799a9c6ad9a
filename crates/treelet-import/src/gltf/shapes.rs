//! What bends a primitive: morph targets, and the joints that its vertices follow.

use treelet::memory::Array;
use treelet_model::Part;
use treelet_model::animation::{Influences, Shape, Target};

use crate::error::{Place, Result};

use super::accessor::Accessors;
use super::json::Primitive;

/// Accessors of joints and their weights, four a vertex and set.
pub(super) fn joint_sets(primitive: &Primitive) -> impl Iterator<Item = (usize, usize)> {
    let attributes = &primitive.attributes;
    let sets = [
        attributes.joints_0.zip(attributes.weights_0),
        attributes.joints_1.zip(attributes.weights_1),
    ];
    sets.into_iter().flatten()
}

/// The part of a primitive as it is before it bends, and how it can; `mended` counts weights that
/// were none.
pub(super) fn read(
    accessors: &Accessors<'_, '_>,
    primitive: &Primitive,
    part: &Part,
    place: &Place,
    mended: &mut u64,
) -> Result<Shape> {
    let source = accessors.source;
    let vertices = part.mesh.positions().len();
    let check = |len: usize, what: &str| {
        if len == vertices {
            return Ok(());
        }
        let found = format!("has {len} {what} for {vertices} vertices");
        Err(source.broken(place.clone(), found, super::INVALID))
    };

    let mut targets = Vec::new();
    for target in &primitive.targets {
        source.check_cancelled()?;
        let read = |accessor: Option<usize>, what: &'static str| -> Result<_> {
            let Some(accessor) = accessor else { return Ok(None) };
            let by: Vec<[f32; 3]> = accessors.vectors(accessor, what)?;
            check(by.len(), what)?;
            Ok(Some(Array::from(by)))
        };
        let normal = target.normal.filter(|_| part.normals.is_some());
        let tangent = target.tangent.filter(|_| part.tangents.is_some());
        let target = Target {
            positions: read(target.position, "positions of a morph target")?,
            normals: read(normal, "normals of a morph target")?,
            tangents: read(tangent, "tangents of a morph target")?,
        };
        source.push(&mut targets, target, "morph targets")?;
    }

    let mut influences = Vec::new();
    for (joints, weights) in joint_sets(primitive) {
        let joints: Vec<[f32; 4]> = accessors.vectors(joints, "joints")?;
        check(joints.len(), "joints")?;
        let mut indices = source.vec(joints.len(), "joints")?;
        // Small integers pass through f32 unchanged; whatever else is there is clamped to them.
        indices.extend(joints.iter().map(|set| set.map(|joint| joint as u16)));
        let mut weights: Vec<[f32; 4]> = accessors.vectors(weights, "weights")?;
        check(weights.len(), "weights")?;
        for weight in weights.as_flattened_mut() {
            if !weight.is_finite() || *weight < 0.0 {
                *weight = 0.0;
                *mended += 1;
            }
        }
        influences.push(Influences { joints: indices.into(), weights: weights.into() });
    }
    Ok(Shape {
        mesh: part.mesh.clone(),
        normals: part.normals.clone(),
        tangents: part.tangents.clone(),
        targets,
        influences,
    })
}

/// How many weights of a shape pull towards joints past the end of a skin.
pub(super) fn lost(shape: &Shape, joints: usize) -> u64 {
    let sets = shape.influences.iter();
    let pulls =
        sets.flat_map(|set| set.joints.as_flattened().iter().zip(set.weights.as_flattened()));
    pulls.filter(|&(&joint, &weight)| weight > 0.0 && usize::from(joint) >= joints).count() as u64
}

/// The bytes that a pose of a shape writes, and those of the targets that it reads for that.
pub(super) fn cost(shape: &Shape, weights: &[f32]) -> u64 {
    let vertex = size_of::<[f32; 3]>()
        + shape.normals.as_ref().map_or(0, |_| size_of::<[f32; 3]>())
        + shape.tangents.as_ref().map_or(0, |_| size_of::<[f32; 4]>());
    let active = shape.targets.iter().zip(weights).filter(|&(_, &weight)| weight != 0.0).count();
    let times = active as u64 + 1;
    let vertices = shape.mesh.positions().len() as u64;
    let weights = size_of_val(weights) as u64;
    vertices.saturating_mul(vertex as u64).saturating_mul(times).saturating_add(weights)
}
