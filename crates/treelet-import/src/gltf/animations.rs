//! Animations: their channels, checked, so that playing them cannot go wrong.

use treelet_model::Animation;
use treelet_model::animation::{Channel, Interpolation, Property};

use crate::error::{Result, counted};

use super::accessor::Accessors;
use super::json::{self, Node};

/// All clips. What a clip says wrongly is left out of it, and counted.
pub(super) fn read_all(
    accessors: &Accessors<'_, '_>,
    warnings: &mut Vec<String>,
) -> Result<Vec<Animation>> {
    let root = accessors.root;
    if root.animations.is_empty() {
        return Ok(Vec::new());
    }
    let parents = parents(accessors, &root.nodes)?;
    let mut clips = Vec::new();
    let mut left_out = 0_u64;
    for json in &root.animations {
        accessors.source.check_cancelled()?;
        let mut clip = Animation { name: json.name.clone(), channels: Vec::new() };
        for channel in &json.channels {
            match read_channel(accessors, json, channel, &parents)? {
                Some(channel) => {
                    accessors.source.push(&mut clip.channels, channel, "animations")?
                }
                None => left_out += 1,
            }
        }
        accessors.source.push(&mut clips, clip, "animations")?;
    }
    if left_out > 0 {
        let channels = counted(left_out, "channel of animations is", "channels of animations are");
        warnings.push(format!(
            "{channels} left out: nothing of a node is named that can move, or the keys are not \
             finite, rising and complete."
        ));
    }
    Ok(clips)
}

/// The parent of each node that has one.
fn parents(accessors: &Accessors<'_, '_>, nodes: &[Node]) -> Result<Vec<Option<usize>>> {
    let source = accessors.source;
    let mut parents = source.whole(source.budget.filled(None, nodes.len(), "nodes"))?;
    for (parent, node) in nodes.iter().enumerate() {
        for &child in &node.children {
            if let Some(place) = parents.get_mut(child) {
                *place = Some(parent);
            }
        }
    }
    Ok(parents)
}

/// Names from the root to a node.
fn path(nodes: &[Node], parents: &[Option<usize>], node: usize) -> String {
    let mut names = Vec::new();
    let mut at = Some(node);
    // A path of a hundred names tells enough, also of a graph that is no tree.
    while let Some(index) = at.filter(|_| names.len() < PATH_MAX) {
        let name = nodes.get(index).map_or("", |node| &*node.name);
        names.push(match name {
            "" => format!("#{index}"),
            name => name.chars().take(PATH_MAX).collect(),
        });
        at = parents.get(index).copied().flatten();
    }
    names.reverse();
    names.join("/")
}

/// Names in a path, and letters of a name.
const PATH_MAX: usize = 100;

fn read_channel(
    accessors: &Accessors<'_, '_>,
    clip: &json::Animation,
    channel: &json::Channel,
    parents: &[Option<usize>],
) -> Result<Option<Channel>> {
    let root = accessors.root;
    let (Some(node), Some(curve)) = (channel.target.node, clip.samplers.get(channel.sampler))
    else {
        return Ok(None);
    };
    // Nodes with a matrix have no parts that could move.
    let moves_parts = channel.target.path != "weights";
    if root.nodes.get(node).is_none_or(|node| moves_parts && node.matrix.is_some()) {
        return Ok(None);
    }
    const WHAT: &str = "animations";
    let times: Vec<f32> = accessors.vectors::<1>(curve.input, WHAT)?.into_flattened();
    let interpolation = match curve.interpolation.as_str() {
        "STEP" => Interpolation::Step,
        "CUBICSPLINE" => Interpolation::CubicSpline,
        _ => Interpolation::Linear,
    };
    let (property, values) = match channel.target.path.as_str() {
        "translation" | "scale" => {
            let values = accessors.vectors::<3>(curve.output, WHAT)?.into_flattened();
            let is_scale = channel.target.path == "scale";
            (if is_scale { Property::Scale } else { Property::Translation }, values)
        }
        "rotation" => {
            (Property::Rotation, accessors.vectors::<4>(curve.output, WHAT)?.into_flattened())
        }
        "weights" => {
            let values = accessors.vectors::<1>(curve.output, WHAT)?.into_flattened();
            let per_key = values.len().checked_div(times.len()).unwrap_or(0);
            let is_cubic = interpolation == Interpolation::CubicSpline;
            (Property::MorphWeights { targets: per_key / if is_cubic { 3 } else { 1 } }, values)
        }
        _ => return Ok(None),
    };
    let per_key =
        property.components() * if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
    let is_whole = !times.is_empty() && values.len() == per_key * times.len();
    let is_finite = times.iter().chain(&values).all(|x| x.is_finite());
    if per_key == 0 || !is_whole || !is_finite || !times.is_sorted() {
        return Ok(None);
    }
    let path = path(&root.nodes, parents, node);
    accessors.source.whole(accessors.source.budget.spend(path.len() as u64, WHAT))?;
    Ok(Some(Channel { node, path, property, interpolation, times, values }))
}
