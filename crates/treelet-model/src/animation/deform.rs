//! The shape of a part in a pose: first morphed, then skinned (glTF 2.0, sections 3.7.2.2 and 3.7.3.3).
//!
//! A vertex goes where the weighted sum of its joints' matrices takes it ("linear blend skinning"; N.
//! Magnenat-Thalmann et al., "Joint-Dependent Local Deformations for Hand Animation and Object
//! Grasping", 1988). Normals go by the cofactors of that sum, which also serve where it has no inverse.
//! O(vertices) time, on one thread.

use treelet::math::{Affine, vec3};
use treelet::memory::{Array, OutOfMemory};

use super::rig::{Influences, Shape, Target};
use crate::Part;

/// The joints of a skeleton in a pose.
#[derive(Debug)]
pub(super) struct Bones<'a> {
    /// By joint: takes the mesh to the world.
    pub(super) world_from_mesh: &'a [Affine],
    /// For vertices that follow no joint: the node's own place.
    pub(super) world_from_node: Affine,
}

/// Gives the part the shape that it has with these weights and joints. Returns whether that is another
/// shape than it had.
pub(super) fn deform(
    shape: &Shape,
    weights: &[f32],
    bones: Option<&Bones<'_>>,
    part: &mut Part,
) -> Result<bool, OutOfMemory> {
    let mut positions = copy(shape.mesh.positions())?;
    let mut normals = shape.normals.as_deref().map(copy).transpose()?;
    let mut tangents = shape.tangents.as_deref().map(copy).transpose()?;

    // Morph.
    let mut morphed = false;
    for (Target { positions: p, normals: n, tangents: t }, &weight) in
        shape.targets.iter().zip(weights)
    {
        if weight == 0.0 {
            continue;
        }
        morphed = true;
        add(&mut positions, p.as_deref(), weight, |at, d| *at = vec3::add(*at, d));
        if let Some(normals) = &mut normals {
            add(normals, n.as_deref(), weight, |at, d| *at = vec3::add(*at, d));
        }
        if let Some(tangents) = &mut tangents {
            let turn = |at: &mut [f32; 4], d: [f32; 3]| {
                *at = [at[0] + d[0], at[1] + d[1], at[2] + d[2], at[3]];
            };
            add(tangents, t.as_deref(), weight, turn);
        }
    }

    // Skin.
    if let Some(bones) = bones {
        skin(
            &shape.influences,
            bones,
            &mut positions,
            normals.as_deref_mut(),
            tangents.as_deref_mut(),
        );
    }

    // Directions have length 1; one that lost its length is as it was at rest.
    if morphed || bones.is_some() {
        if let (Some(normals), Some(rest)) = (&mut normals, shape.normals.as_deref()) {
            for (normal, &rest) in normals.iter_mut().zip(rest) {
                *normal = vec3::normalize(*normal).unwrap_or(rest);
            }
        }
        if let (Some(tangents), Some(rest)) = (&mut tangents, shape.tangents.as_deref()) {
            for (tangent, &rest) in tangents.iter_mut().zip(rest) {
                let [x, y, z, sign] = *tangent;
                *tangent = vec3::normalize([x, y, z]).map_or(rest, |[x, y, z]| [x, y, z, sign]);
            }
        }
    }

    let same = same_bits(part.mesh.positions().as_flattened(), positions.as_flattened())
        && same_directions(part.normals.as_ref(), normals.as_ref())
        && same_directions(part.tangents.as_ref(), tangents.as_ref());
    if same {
        return Ok(false);
    }
    part.mesh = shape.mesh.with_positions(positions);
    part.normals = normals.map(Array::from);
    part.tangents = tangents.map(Array::from);
    Ok(true)
}

/// Adds displacements times a weight.
fn add<T>(items: &mut [T], by: Option<&[[f32; 3]]>, weight: f32, add: impl Fn(&mut T, [f32; 3])) {
    for (item, &by) in items.iter_mut().zip(by.unwrap_or_default()) {
        add(item, vec3::scale(by, weight));
    }
}

/// Takes every vertex to where its joints want it.
fn skin(
    influences: &[Influences],
    bones: &Bones<'_>,
    positions: &mut [[f32; 3]],
    mut normals: Option<&mut [[f32; 3]]>,
    mut tangents: Option<&mut [[f32; 4]]>,
) {
    for (vertex, position) in positions.iter_mut().enumerate() {
        let map = blend(influences, vertex, bones);
        *position = map.point(*position);
        if let Some(normal) = normals.as_deref_mut().and_then(|all| all.get_mut(vertex)) {
            *normal = turned_normal(&map, *normal);
        }
        if let Some(tangent) = tangents.as_deref_mut().and_then(|all| all.get_mut(vertex)) {
            let [x, y, z, sign] = *tangent;
            let [x, y, z] = map.vector([x, y, z]);
            *tangent = [x, y, z, sign];
        }
    }
}

/// The weighted sum of a vertex's joints.
fn blend(influences: &[Influences], vertex: usize, bones: &Bones<'_>) -> Affine {
    let mut sum = [[0.0_f32; 4]; 3];
    let mut total = 0.0;
    for Influences { joints, weights } in influences {
        let (Some(joints), Some(weights)) = (joints.get(vertex), weights.get(vertex)) else {
            continue;
        };
        for (&joint, &weight) in joints.iter().zip(weights) {
            let Some(Affine(map)) = bones.world_from_mesh.get(usize::from(joint)) else { continue };
            if weight == 0.0 {
                continue;
            }
            total += weight;
            for (row, from) in sum.iter_mut().zip(map) {
                for (entry, from) in row.iter_mut().zip(from) {
                    *entry += weight * from;
                }
            }
        }
    }
    if total > 0.0 {
        // Weights need not add up to 1, above all not where a joint is missing.
        let share = 1.0 / total;
        Affine(sum.map(|row| row.map(|entry| share * entry)))
    } else {
        bones.world_from_node
    }
}

/// A normal under a map, by its matrix of cofactors: the transposed inverse times the determinant,
/// whose sign is taken out again.
fn turned_normal(map: &Affine, normal: [f32; 3]) -> [f32; 3] {
    let [a, b, c] = map.0.map(|[x, y, z, _]| [x, y, z]);
    let rows = [vec3::cross(b, c), vec3::cross(c, a), vec3::cross(a, b)];
    let sign = if vec3::dot(a, rows[0]) < 0.0 { -1.0 } else { 1.0 };
    rows.map(|row| sign * vec3::dot(row, normal))
}

/// A copy of an array, if there is room for it.
fn copy<T: Copy>(items: &[T]) -> Result<Vec<T>, OutOfMemory> {
    let mut copied = Vec::new();
    let refused = |_| OutOfMemory { bytes: size_of_val(items) as u64, what: "a mesh in its pose" };
    copied.try_reserve_exact(items.len()).map_err(refused)?;
    copied.extend_from_slice(items);
    Ok(copied)
}

/// Whether two arrays, or none, are the same.
fn same_directions<const N: usize>(
    old: Option<&Array<[f32; N]>>,
    new: Option<&Vec<[f32; N]>>,
) -> bool {
    match (old, new) {
        (Some(old), Some(new)) => same_bits(old.as_flattened(), new.as_flattened()),
        (None, None) => true,
        _ => false,
    }
}

/// Equal bit by bit: of numbers that are none, too.
fn same_bits(a: &[f32], b: &[f32]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}

#[cfg(test)]
mod tests {
    use super::super::{Influences, Shape, Target};
    use super::{Bones, deform, turned_normal};
    use crate::Part;
    use treelet::Mesh;
    use treelet::math::Affine;

    fn bar() -> Shape {
        let mesh = Mesh::new([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], [[0, 1, 2]]);
        Shape { mesh, normals: Some([[0.0, 1.0, 0.0]; 3].into()), ..Shape::default() }
    }

    #[test]
    fn vertices_follow_their_joints() {
        let mut shape = bar();
        shape.influences = vec![Influences {
            joints: [[0, 1, 0, 0], [0, 1, 0, 0], [1, 0, 0, 0]].into(),
            weights: [[1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]].into(),
        }];
        let turn = Affine([[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);
        let bones = [Affine::translation([0.0, 0.0, 4.0]), turn];
        let bones = Bones { world_from_mesh: &bones, world_from_node: Affine::IDENTITY };
        let mut part = Part { normals: shape.normals.clone(), ..Part::new(shape.mesh.clone(), 0) };
        assert_eq!(deform(&shape, &[], Some(&bones), &mut part), Ok(true));
        assert_eq!(part.mesh.positions(), [[0.0, 0.0, 4.0], [0.5, 0.5, 2.0], [0.0, 2.0, 0.0]]);
        let normals = part.normals.as_deref().unwrap();
        assert_eq!((normals[0], normals[2]), ([0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]));
        assert_eq!(deform(&shape, &[], Some(&bones), &mut part), Ok(false), "nothing is new");
        // A vertex that no joint pulls at follows its node.
        shape.influences[0].weights = [[0.0; 4]; 3].into();
        assert_eq!(deform(&shape, &[], Some(&bones), &mut part), Ok(true));
        assert_eq!(part.mesh.positions(), shape.mesh.positions());
    }

    #[test]
    fn targets_add_up_by_weight() {
        let mut shape = bar();
        let up = [[0.0, 2.0, 0.0]; 3];
        let target = |by: [[f32; 3]; 3]| Target { positions: Some(by.into()), ..Target::default() };
        shape.targets = vec![target(up), target([[0.0, 0.0, 8.0]; 3])];
        shape.targets[0].normals = Some([[2.0, 0.0, 0.0]; 3].into());
        let mut part = Part::new(shape.mesh.clone(), 0);
        assert_eq!(deform(&shape, &[0.5, 0.25], None, &mut part), Ok(true));
        assert_eq!(part.mesh.positions()[1], [1.0, 1.0, 2.0]);
        let half = core::f32::consts::FRAC_1_SQRT_2;
        let [x, y, z] = part.normals.as_deref().unwrap()[1];
        assert!((x - half).abs() < 1e-6 && (y - half).abs() < 1e-6 && z == 0.0);
        assert_eq!(
            deform(&shape, &[], None, &mut part),
            Ok(true),
            "weights that are missing are 0"
        );
        assert_eq!(part.mesh.positions(), shape.mesh.positions());
    }

    #[test]
    fn normals_stay_at_right_angles() {
        // Squeezed in x, mirrored in z.
        let map = Affine::scaling([0.5, 1.0, -1.0]);
        let slope = turned_normal(&map, [1.0, 1.0, 0.0]);
        assert_eq!(slope, [1.0, 0.5, 0.0], "along (0.5, -1) runs what was along (1, -1)");
        assert_eq!(turned_normal(&map, [0.0, 0.0, 1.0]), [0.0, 0.0, -0.5]);
        // Flattened: a normal of the plane is left.
        assert_eq!(
            turned_normal(&Affine::scaling([1.0, 1.0, 0.0]), [0.0, 0.6, 0.8]),
            [0.0, 0.0, 0.8]
        );
    }
}
