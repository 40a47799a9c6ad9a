//! A model in the pose of a time.

use std::collections::HashMap;

use treelet::bounds::Aabb;
use treelet::math::Affine;
use treelet::memory::OutOfMemory;

use super::deform::{Bones, deform};
use super::rig::{Local, Rig};
use super::transform::{self, Rows};
use super::{Animation, Channel, Property};
use crate::{LightKind, Model};

/// What a pose changed, against the one that the model had.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Changes {
    /// Placements that stand elsewhere.
    pub placements: u64,
    /// Objects that have another shape, rising.
    pub objects: Vec<usize>,
    /// Parts of these objects that have another shape.
    pub parts: u64,
    /// Triangles of these parts, each counted once.
    pub triangles: u64,
    /// Cameras that stand elsewhere.
    pub cameras: u64,
    /// Lights that stand elsewhere.
    pub lights: u64,
}

impl Changes {
    /// Whether rays find the same as before.
    pub fn keeps_geometry(&self) -> bool {
        self.placements == 0 && self.objects.is_empty()
    }
}

/// Why a model cannot be posed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PoseError {
    /// There is no such clip.
    #[error("clip {clip} is not one of {clips}")]
    NoSuchClip {
        /// The clip asked for, from 0.
        clip: usize,
        /// How many there are.
        clips: usize,
    },
    /// The rig contradicts itself or the model.
    #[error("the rig's {what} {index} names {found}; rigs that importers make never do")]
    Rig {
        /// Which list of the rig is wrong.
        what: &'static str,
        /// Which of its items.
        index: usize,
        /// What it names in vain.
        found: String,
    },
    /// There is no room for meshes in their new shape.
    #[error(transparent)]
    OutOfMemory(#[from] OutOfMemory),
}

impl Model {
    /// Puts everything where it is `time` seconds into a clip of [`Model::animations`], or where the
    /// file has it if no clip is named.
    ///
    /// The pose before does not matter. Before a channel's first key and after its last, that key
    /// holds. A camera or light whose node has no axes, as one that is scaled to nothing, looks along
    /// the world's -z axis.
    ///
    /// Cost: O(nodes + placements), and for meshes that bend O(vertices).
    ///
    /// # Errors
    ///
    /// If there is no such clip, the rig names what is not there, or memory is refused. The model may
    /// then be half in one pose and half in the other; another pose mends it.
    pub fn pose(&mut self, clip: Option<usize>, time: f64) -> Result<Changes, PoseError> {
        let clip = match clip {
            Some(clip) => {
                let found = self.animations.get(clip);
                let clips = self.animations.len();
                Some(found.ok_or(PoseError::NoSuchClip { clip, clips })?)
            }
            None => None,
        };
        let worlds = worlds(&self.rig, clip, time)?;
        let weights = weights(&self.rig, clip, time);
        let mut changes = Changes::default();
        self.place(&worlds, &mut changes);
        self.bend(&worlds, &weights, &mut changes)?;
        Ok(changes)
    }

    /// The box around all that is seen in `samples` poses, evenly spread over a clip, and in the one
    /// that the model is left in: that of the clip's end.
    ///
    /// # Errors
    ///
    /// Those of [`Model::pose`].
    pub fn clip_bounds(&mut self, clip: usize, samples: u32) -> Result<Aabb, PoseError> {
        let end = self.animations.get(clip).map_or(0.0, Animation::duration);
        let mut bounds = Aabb::EMPTY;
        // Objects that keep their shape are measured once.
        let mut boxes: Vec<Option<Aabb>> = vec![None; self.objects.len()];
        for sample in 0..=samples {
            let share = f64::from(sample) / f64::from(samples.max(1));
            for object in self.pose(Some(clip), share * end)?.objects {
                boxes[object] = None;
            }
            for placement in &self.placements {
                let Some(known) = boxes.get_mut(placement.object) else { continue };
                let object = &self.objects[placement.object];
                let inner = *known.get_or_insert_with(|| {
                    let parts = object.parts.iter().map(|part| part.mesh.bounds());
                    parts.fold(Aabb::EMPTY, |all, part| all.union(&part))
                });
                bounds = bounds.union(&image(&placement.world_from_object, &inner));
            }
        }
        Ok(bounds)
    }

    /// Moves placements, cameras and lights.
    fn place(&mut self, worlds: &[Rows], changes: &mut Changes) {
        for (placement, mount) in self.placements.iter_mut().zip(&self.rig.placements) {
            let Some(world) = mount.node.and_then(|node| worlds.get(node)) else { continue };
            let map = match &mount.node_from_object {
                Some(inner) => transform::rounded(&transform::compose(world, inner)),
                None => transform::rounded(world),
            };
            changes.placements += u64::from(!same_map(&placement.world_from_object, &map));
            placement.world_from_object = map;
        }
        for (camera, &node) in self.cameras.iter_mut().zip(&self.rig.cameras) {
            let Some(world) = worlds.get(node) else { continue };
            let frame = transform::camera_frame(world);
            let frame = frame.or_else(|| transform::camera_frame(&axes_lost(world)));
            let frame = frame.unwrap_or_default();
            changes.cameras += u64::from(!same_map(&camera.world_from_camera, &frame));
            camera.world_from_camera = frame;
        }
        for (light, &node) in self.lights.iter_mut().zip(&self.rig.lights) {
            let Some(world) = worlds.get(node) else { continue };
            let moved =
                |world: &Rows| -> Option<LightKind> { transform::light_at(light.kind, world) };
            let kind = moved(world).or_else(|| moved(&axes_lost(world)));
            let kind = kind.or_else(|| moved(&transform::IDENTITY)).unwrap_or(light.kind);
            changes.lights += u64::from(kind != light.kind);
            light.kind = kind;
        }
    }

    /// Gives meshes their shapes.
    fn bend(
        &mut self,
        worlds: &[Rows],
        weights: &[Vec<f32>],
        changes: &mut Changes,
    ) -> Result<(), PoseError> {
        let skins = bones(&self.rig, worlds)?;
        for (index, (deformer, weights)) in self.rig.deformers.iter().zip(weights).enumerate() {
            let lost = |found| PoseError::Rig { what: "deformer", index, found };
            let object = self.objects.get_mut(deformer.object);
            let object = object.ok_or_else(|| lost(format!("object {}", deformer.object)))?;
            let node = worlds.get(deformer.node);
            let node = node.ok_or_else(|| lost(format!("node {}", deformer.node)))?;
            let bones = match deformer.skin {
                Some(skin) => {
                    let joints = skins.get(skin).ok_or_else(|| lost(format!("skin {skin}")))?;
                    let world_from_node = transform::rounded(node);
                    Some(Bones { world_from_mesh: joints, world_from_node })
                }
                None => None,
            };
            let mut is_changed = false;
            for (shape, part) in deformer.shapes.iter().zip(&mut object.parts) {
                if deform(shape, weights, bones.as_ref(), part)? {
                    is_changed = true;
                    changes.parts += 1;
                    changes.triangles += part.mesh.triangles().len() as u64;
                }
            }
            if is_changed {
                changes.objects.push(deformer.object);
            }
        }
        changes.objects.sort_unstable();
        changes.objects.dedup();
        Ok(())
    }
}

/// Where every node stands in the world; those that the scene does not show stand at its origin.
fn worlds(rig: &Rig, clip: Option<&Animation>, time: f64) -> Result<Vec<Rows>, PoseError> {
    let nodes = &rig.nodes;
    let mut locals: Vec<Local> = nodes.iter().map(|node| node.local.clone()).collect();
    let mut value = Vec::new();
    for channel in clip.iter().flat_map(|clip| &clip.channels) {
        let Some(Local::Parts { translation, rotation, scale }) = locals.get_mut(channel.node)
        else {
            continue;
        };
        if !channel.sample(time, &mut value) {
            continue;
        }
        match (channel.property, value.as_slice()) {
            (Property::Translation, &[x, y, z]) => *translation = [x, y, z],
            (Property::Rotation, &[x, y, z, w]) => *rotation = [x, y, z, w],
            (Property::Scale, &[x, y, z]) => *scale = [x, y, z],
            _ => {}
        }
    }
    let mut worlds = vec![transform::IDENTITY; nodes.len()];
    let mut is_placed = vec![false; nodes.len()];
    for (place, &index) in rig.order.iter().enumerate() {
        let lost = |found| PoseError::Rig { what: "order", index: place, found };
        let local = locals.get(index).ok_or_else(|| lost(format!("node {index}")))?;
        let parent = match nodes[index].parent {
            None => transform::IDENTITY,
            Some(parent) if is_placed.get(parent) == Some(&true) => worlds[parent],
            Some(parent) => return Err(lost(format!("node {index} before its parent {parent}"))),
        };
        worlds[index] = transform::compose(&parent, &local.rows());
        is_placed[index] = true;
    }
    Ok(worlds)
}

impl Local {
    /// The map to the parent.
    pub fn rows(&self) -> Rows {
        match self {
            Self::Parts { translation, rotation, scale } => {
                transform::parts(*translation, *rotation, *scale)
            }
            Self::Matrix(rows) => **rows,
        }
    }
}

/// The weights of every deformer's morph targets.
fn weights(rig: &Rig, clip: Option<&Animation>, time: f64) -> Vec<Vec<f32>> {
    let of_weights = |channel: &&Channel| matches!(channel.property, Property::MorphWeights { .. });
    let channels = clip.iter().flat_map(|clip| &clip.channels).filter(of_weights);
    let by_node: HashMap<usize, &Channel> =
        channels.map(|channel| (channel.node, channel)).collect();
    let mut value = Vec::new();
    let weights = rig.deformers.iter().map(|deformer| match by_node.get(&deformer.node) {
        Some(channel) if channel.sample(time, &mut value) => {
            value.iter().map(|&weight| weight as f32).collect()
        }
        _ => deformer.weights.clone(),
    });
    weights.collect()
}

/// By skin and joint: takes the mesh to the world.
fn bones(rig: &Rig, worlds: &[Rows]) -> Result<Vec<Vec<Affine>>, PoseError> {
    let skins = rig.skins.iter().enumerate().map(|(index, skin)| {
        let joints = skin.joints.iter().map(|joint| {
            let world = worlds.get(joint.node).ok_or_else(|| {
                let found = format!("node {}", joint.node);
                PoseError::Rig { what: "skin", index, found }
            })?;
            Ok(transform::rounded(&transform::compose(world, &joint.joint_from_mesh)))
        });
        joints.collect()
    });
    skins.collect()
}

/// A place without its axes.
fn axes_lost(world: &Rows) -> Rows {
    let mut rows = transform::IDENTITY;
    for (row, from) in rows.iter_mut().zip(world) {
        row[3] = from[3];
    }
    rows
}

/// A box around the image of a box; empty if that is not finite.
fn image(map: &Affine, inner: &Aabb) -> Aabb {
    if inner.is_empty() {
        return Aabb::EMPTY;
    }
    let corners = [0, 1, 2, 3, 4, 5, 6, 7].map(|corner: usize| {
        let end =
            |axis: usize| if corner >> axis & 1 == 0 { inner.lo[axis] } else { inner.hi[axis] };
        map.point([end(0), end(1), end(2)])
    });
    let finite = corners.as_flattened().iter().all(|x| x.is_finite());
    if finite {
        corners.iter().fold(Aabb::EMPTY, |all, &p| all.union(&Aabb { lo: p, hi: p }))
    } else {
        Aabb::EMPTY
    }
}

/// Equal bit by bit: of numbers that are none, too.
fn same_map(a: &Affine, b: &Affine) -> bool {
    let bits = |map: &Affine| map.0.map(|row| row.map(f32::to_bits));
    bits(a) == bits(b)
}
