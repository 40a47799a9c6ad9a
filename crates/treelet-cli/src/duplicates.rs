//! Counts triangles that are there twice: the same three corners, in any order.
//!
//! Exact: triangles are sorted by a hash of their corners, and equal hashes are compared in full.
//! O(n log n) time, 16 bytes a triangle of the largest mesh.

use rayon::prelude::*;
use treelet::memory::OutOfMemory;
use treelet::{Cancel, Mesh};
use treelet_model::Model;

use crate::ending::Failure;

/// Triangles of which an equal one comes earlier in the same mesh; those with a defect not counted.
pub(crate) fn count(model: &Model, cancel: &Cancel) -> Result<u64, Failure> {
    let mut duplicates = 0;
    for part in model.objects.iter().flat_map(|object| &object.parts) {
        if cancel.is_cancelled() {
            return Err(Failure::Cancelled);
        }
        duplicates += count_mesh(&part.mesh)?;
    }
    Ok(duplicates)
}

fn count_mesh(mesh: &Mesh) -> Result<u64, OutOfMemory> {
    // Bring equal triangles together by their hashes.
    let triangles = mesh.triangles().len();
    let mut hashes: Vec<(u64, usize)> = Vec::new();
    hashes.try_reserve_exact(triangles).map_err(|_| OutOfMemory {
        bytes: triangles as u64 * size_of::<(u64, usize)>() as u64,
        what: "the search for duplicate triangles",
    })?;
    hashes.par_extend((0..triangles).into_par_iter().map(|prim| (hash(mesh, prim), prim)));
    hashes.par_sort_unstable();

    // Among equal hashes count those that are not the first with their corners.
    let mut duplicates = 0;
    for run in hashes.chunk_by(|a, b| a.0 == b.0).filter(|run| run.len() > 1) {
        let mut corners: Vec<_> = run.iter().filter_map(|&(_, prim)| key(mesh, prim)).collect();
        let all = corners.len();
        corners.sort_unstable();
        corners.dedup();
        duplicates += (all - corners.len()) as u64;
    }
    Ok(duplicates)
}

/// The corners' bits in an order that does not depend on how the triangle names them; `None` for
/// one with a defect.
fn key(mesh: &Mesh, prim: usize) -> Option<[[u32; 3]; 3]> {
    if mesh.defect(prim).is_some() {
        return None;
    }
    // Adding 0 makes -0 into 0, which is the same place.
    let mut corners = mesh.corners(prim)?.map(|corner| corner.map(|x| (x + 0.0).to_bits()));
    corners.sort_unstable();
    Some(corners)
}

/// A hash of the key: words mixed in by the finaliser of SplitMix64.
fn hash(mesh: &Mesh, prim: usize) -> u64 {
    let words = key(mesh, prim).into_iter().flatten().flatten();
    words.fold(0, |hash, word| {
        let mut z = (hash ^ u64::from(word)).wrapping_add(0x9E37_79B9_7F4A_7C15);
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    })
}

#[cfg(test)]
mod tests {
    use super::count_mesh;
    use treelet::Mesh;

    #[test]
    fn equal_corners_are_duplicates_in_any_order() {
        let positions =
            [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.0; 3], [f32::NAN; 3], [2.0; 3]];
        let count =
            |triangles: &[[u32; 3]]| count_mesh(&Mesh::new(positions, triangles.to_vec())).unwrap();
        assert_eq!(count(&[]), 0);
        assert_eq!(count(&[[0, 1, 2], [0, 1, 5]]), 0);
        assert_eq!(count(&[[0, 1, 2], [2, 0, 1]]), 1, "turned");
        assert_eq!(count(&[[0, 1, 2], [0, 2, 1]]), 1, "mirrored");
        assert_eq!(count(&[[0, 1, 2], [3, 1, 2]]), 1, "zeros of either sign are one place");
        assert_eq!(count(&[[0, 1, 2]; 5]), 4);
        assert_eq!(count(&[[4, 1, 2], [4, 1, 2]]), 0, "defects are counted elsewhere");
        assert_eq!(count(&[[0, 1, 9], [0, 1, 9]]), 0);
    }
}
