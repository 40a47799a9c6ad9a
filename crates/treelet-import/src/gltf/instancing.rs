//! `EXT_mesh_gpu_instancing`: where the copies of a node's mesh stand.

use treelet_model::animation::transform::{self, Rows};

use crate::error::{Place, Result};

use super::accessor::Accessors;
use super::json::Instancing;

/// The transform of each copy against its node.
pub(super) fn read(
    accessors: &Accessors<'_, '_>,
    instancing: &Instancing,
    place: &Place,
) -> Result<Vec<Rows>> {
    let attributes = &instancing.attributes;
    let translations = attributes.translation.map(|t| accessors.vectors(t, "translations"));
    let translations: Option<Vec<[f32; 3]>> = translations.transpose()?;
    let rotations = attributes.rotation.map(|r| accessors.vectors(r, "rotations"));
    let rotations: Option<Vec<[f32; 4]>> = rotations.transpose()?;
    let scales = attributes.scale.map(|s| accessors.vectors(s, "scales"));
    let scales: Option<Vec<[f32; 3]>> = scales.transpose()?;

    // Each list has an element for every copy.
    let lens = [
        translations.as_ref().map(Vec::len),
        rotations.as_ref().map(Vec::len),
        scales.as_ref().map(Vec::len),
    ];
    let count = lens.iter().flatten().copied().max().unwrap_or(0);
    if let Some(other) = lens.iter().flatten().find(|&&len| len != count) {
        let found = format!("has {count} copies by one attribute and {other} by another");
        return Err(accessors.source.broken(place.clone(), found, super::INVALID));
    }
    let mut copies = accessors.source.vec(count, "copies of a node")?;
    for i in 0..count {
        let t = translations.as_ref().map_or([0.0; 3], |t| t[i].map(f64::from));
        let r = rotations.as_ref().map_or([0.0, 0.0, 0.0, 1.0], |r| r[i].map(f64::from));
        let s = scales.as_ref().map_or([1.0; 3], |s| s[i].map(f64::from));
        copies.push(transform::parts(t, r, s));
    }
    Ok(copies)
}
