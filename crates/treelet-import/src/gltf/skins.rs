//! Skins: skeletons that meshes follow.

use treelet_model::animation::{Joint, Skin, transform};

use crate::error::{Place, Result};
use crate::source::Source;

use super::accessor::Accessors;
use super::json;
use super::nodes::Walk;

/// The skins of a file.
pub(super) struct Skins {
    skins: Vec<Skin>,
    /// By the file's number: index into `skins`; none for one that cannot be used.
    known: Vec<Option<usize>>,
}

impl Skins {
    /// All skins. One that lacks a joint in the scene or a matrix for it is left out, and named.
    pub(super) fn read(
        accessors: &Accessors<'_, '_>,
        walk: &Walk,
        warnings: &mut Vec<String>,
    ) -> Result<Self> {
        let Accessors { source, root, .. } = *accessors;
        let mut skins = Self { skins: Vec::new(), known: Vec::new() };
        if root.skins.is_empty() {
            return Ok(skins);
        }
        let filled = source.budget.filled(false, root.nodes.len(), "nodes");
        let mut is_shown = source.whole(filled)?;
        walk.order.iter().for_each(|&node| is_shown[node] = true);
        let mut unfit = None;
        for (index, json) in root.skins.iter().enumerate() {
            source.check_cancelled()?;
            let known = match read_skin(accessors, json, &is_shown)? {
                Ok(skin) => {
                    source.push(&mut skins.skins, skin, "skins")?;
                    Some(skins.skins.len() - 1)
                }
                Err(fault) => {
                    let (count, _) = unfit.get_or_insert((0_u64, format!("skin {index} {fault}")));
                    *count += 1;
                    None
                }
            };
            source.push(&mut skins.known, known, "skins")?;
        }
        if let Some((count, first)) = unfit {
            let skins = if count == 1 { "skin is" } else { "skins are" };
            warnings.push(format!(
                "{count} {skins} not used, and meshes stand as their nodes place them: {first}."
            ));
        }
        Ok(skins)
    }

    /// The skin that a node names; `None` if it cannot be used.
    pub(super) fn find(
        &self,
        source: &Source<'_>,
        skin: usize,
        node: impl FnOnce() -> Place,
    ) -> Result<Option<usize>> {
        self.known.get(skin).copied().ok_or_else(|| {
            let found = format!("names skin {skin} of {}", self.known.len());
            source.broken(node(), found, super::INVALID)
        })
    }

    /// How many joints a skin has.
    pub(super) fn joints(&self, skin: usize) -> usize {
        self.skins[skin].joints.len()
    }

    /// The skins that can be used.
    pub(super) fn into_rig(self) -> Vec<Skin> {
        self.skins
    }
}

/// A skin, or why it cannot be used.
fn read_skin(
    accessors: &Accessors<'_, '_>,
    json: &json::Skin,
    is_shown: &[bool],
) -> Result<std::result::Result<Skin, String>> {
    if json.joints.is_empty() {
        return Ok(Err("has no joints".to_owned()));
    }
    if let Some(lost) = json.joints.iter().find(|&&joint| is_shown.get(joint) != Some(&true)) {
        return Ok(Err(format!("has node {lost} as a joint, which is not in the scene")));
    }
    let matrices = match json.inverse_bind_matrices {
        Some(accessor) => Some(accessors.matrices(accessor, "inverse bind matrices")?),
        None => None,
    };
    let given = matrices.as_ref().map_or(json.joints.len(), Vec::len);
    if given < json.joints.len() {
        return Ok(Err(format!("has {given} matrices for {} joints", json.joints.len())));
    }
    let mut joints = accessors.source.vec(json.joints.len(), "joints")?;
    joints.extend(json.joints.iter().enumerate().map(|(index, &node)| Joint {
        node,
        joint_from_mesh: matrices.as_ref().map_or(transform::IDENTITY, |all| all[index]),
    }));
    Ok(Ok(Skin { joints }))
}
