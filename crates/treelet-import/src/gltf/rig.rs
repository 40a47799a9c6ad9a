//! Meshes at their nodes, and what of them can move.
//!
//! A mesh without skin and morph targets is one object, however often it is placed. One that bends is
//! an object for each node that bends it in its own way. What a skin moves is placed where it is: its
//! joints bring it into the world, and its node's place does not count, as the specification says.

use std::collections::{HashMap, HashSet};

use treelet::math::Affine;
use treelet_model::animation::{Deformer, Local, Mount, Property, Shape, transform};
use treelet_model::{Model, Object, Placement, PoseError};

use crate::error::{Fault, Place, Result, counted};

use super::accessor::Accessors;
use super::json::{Mesh, Node, Root};
use super::meshes::{self, Meshes};
use super::nodes::{self, Placed, Walk};
use super::shapes;
use super::skins::Skins;

/// Whether anything in a file can move, so that its nodes must be kept.
pub(super) fn can_move(root: &Root) -> bool {
    !root.animations.is_empty() || !root.skins.is_empty() || root.meshes.iter().any(has_targets)
}

fn has_targets(mesh: &Mesh) -> bool {
    mesh.primitives.iter().any(|primitive| !primitive.targets.is_empty())
}

fn has_joints(mesh: &Mesh) -> bool {
    mesh.primitives.iter().any(|primitive| shapes::joint_sets(primitive).next().is_some())
}

/// Places meshes, rigid ones and those that bend.
pub(super) struct Bodies<'s, 'a> {
    accessors: Accessors<'s, 'a>,
    meshes: Meshes<'s, 'a>,
    skins: Skins,
    /// Nodes whose weights a clip changes.
    weighed: HashSet<usize>,
    /// Meshes that bend, undeformed.
    rest: HashMap<usize, Rest>,
    /// Objects of such meshes: by mesh and, where the node matters, node.
    bent: HashMap<(usize, Option<usize>), usize>,
    can_move: bool,
    /// Weights of vertices that were no numbers, or below zero.
    mended: u64,
    /// Weights of vertices that pull towards joints that are not there.
    lost: u64,
}

/// A mesh before it bends.
#[derive(Clone)]
struct Rest {
    object: Object,
    shapes: Vec<Shape>,
}

impl<'s, 'a> Bodies<'s, 'a> {
    pub(super) fn new(
        accessors: Accessors<'s, 'a>,
        walk: &Walk,
        model: &Model,
        warnings: &mut Vec<String>,
    ) -> Result<Self> {
        let channels = model.animations.iter().flat_map(|clip| &clip.channels);
        let weighed = channels
            .filter(|channel| matches!(channel.property, Property::MorphWeights { .. }))
            .map(|channel| channel.node);
        Ok(Self {
            accessors,
            meshes: Meshes::new(accessors),
            skins: Skins::read(&accessors, walk, warnings)?,
            weighed: weighed.collect(),
            rest: HashMap::new(),
            bent: HashMap::new(),
            can_move: can_move(accessors.root),
            mended: 0,
            lost: 0,
        })
    }

    /// Places a mesh at a node.
    pub(super) fn place(&mut self, placed: &Placed, model: &mut Model) -> Result<()> {
        let Accessors { source, root, .. } = self.accessors;
        let (node, mesh) = (&root.nodes[placed.node], &root.meshes[placed.mesh]);
        let at = || nodes::place(&root.nodes, placed.node);
        let skin = match node.skin {
            // Copies of a mesh have places of their own, which a skin would take from them.
            Some(skin) if placed.copy.is_none() && has_joints(mesh) => {
                self.skins.find(source, skin, at)?
            }
            _ => None,
        };
        let bends = skin.is_some() || has_targets(mesh);
        let object = if bends {
            self.bent_object(placed, skin, model)?
        } else {
            self.meshes.object(placed.mesh, model)?
        };
        let world_from_object = match skin {
            Some(_) => Affine::IDENTITY,
            None => transform::rounded(&placed.world),
        };
        source.push(
            &mut model.placements,
            Placement { object, world_from_object },
            "placements",
        )?;
        if self.can_move {
            let node_from_object = placed.copy.map(Box::new);
            let mount = match skin {
                Some(_) => Mount::default(),
                None => Mount { node: Some(placed.node), node_from_object },
            };
            source.push(&mut model.rig.placements, mount, "placements")?;
        }
        Ok(())
    }

    /// The object of a mesh that bends as its node wants.
    fn bent_object(
        &mut self,
        placed: &Placed,
        skin: Option<usize>,
        model: &mut Model,
    ) -> Result<usize> {
        let Accessors { source, root, .. } = self.accessors;
        let (node, mesh) = (&root.nodes[placed.node], &root.meshes[placed.mesh]);
        let is_own =
            skin.is_some() || node.weights.is_some() || self.weighed.contains(&placed.node);
        let key = (placed.mesh, is_own.then_some(placed.node));
        if let Some(&object) = self.bent.get(&key) {
            return Ok(object);
        }
        let Rest { object, shapes } = self.rest(placed.mesh, model)?;
        let weights = weights(node, mesh, &shapes);
        if let Some(joints) = skin.map(|skin| self.skins.joints(skin)) {
            self.lost += shapes.iter().map(|shape| shapes::lost(shape, joints)).sum::<u64>();
        }

        // Another object takes room for its shape, and work for its targets.
        let bytes: u64 = shapes.iter().map(|shape| shapes::cost(shape, &weights)).sum();
        source.whole(source.budget.spend(bytes, "meshes that bend"))?;
        let index = model.objects.len();
        source.push(&mut model.objects, object, "objects")?;
        let deformer = Deformer { object: index, node: placed.node, skin, weights, shapes };
        source.push(&mut model.rig.deformers, deformer, "meshes that bend")?;
        self.bent.insert(key, index);
        Ok(index)
    }

    /// A mesh that bends, as it is before it does; read once.
    fn rest(&mut self, mesh: usize, model: &Model) -> Result<Rest> {
        if let Some(rest) = self.rest.get(&mesh) {
            return Ok(rest.clone());
        }
        let (object, primitives) = self.meshes.read(mesh, model)?;
        let json = &self.accessors.root.meshes[mesh];
        let mut shapes = Vec::new();
        for (part, index) in object.parts.iter().zip(primitives) {
            let place = meshes::primitive_place(mesh, json, index);
            let primitive = &json.primitives[index];
            shapes.push(shapes::read(&self.accessors, primitive, part, &place, &mut self.mended)?);
        }
        let rest = Rest { object, shapes };
        self.rest.insert(mesh, rest.clone());
        Ok(rest)
    }

    /// Hands the rig over, and puts the model into the pose that the file shows.
    pub(super) fn finish(
        self,
        walk: Walk,
        model: &mut Model,
        warnings: &mut Vec<String>,
    ) -> Result<()> {
        let source = self.accessors.source;
        warnings.extend(self.meshes.warnings());
        if self.mended > 0 {
            let weights = counted(self.mended, "weight of a joint is", "weights of joints are");
            warnings.push(format!("{weights} below zero or no number; taken as 0."));
        }
        if self.lost > 0 {
            let weights = counted(self.lost, "weight names", "weights name");
            warnings.push(format!("{weights} joints that their skin lacks; taken as 0."));
        }
        if !self.can_move {
            return Ok(());
        }
        model.rig.skins = self.skins.into_rig();
        model.rig.nodes = walk.stands;
        model.rig.order = walk.order;
        model.rig.cameras = walk.camera_nodes;
        model.rig.lights = walk.light_nodes;
        // Nodes and what stands on them are where the walk put them already.
        if model.rig.deformers.is_empty() {
            return Ok(());
        }
        let per_node = size_of::<transform::Rows>() + size_of::<Local>();
        let bytes = (model.rig.nodes.len() as u64).saturating_mul(per_node as u64);
        source.whole(source.budget.spend(bytes, "nodes"))?;
        match model.pose(None, 0.0) {
            Ok(_) => Ok(()),
            Err(PoseError::OutOfMemory(error)) => Err(source.error(Place::File, error)),
            Err(error) => {
                let fault = Fault::broken(error.to_string(), super::INVALID);
                Err(source.error(Place::File, fault))
            }
        }
    }
}

/// The weights of a node's morph targets while nothing plays.
fn weights(node: &Node, mesh: &Mesh, shapes: &[Shape]) -> Vec<f32> {
    let targets = shapes.iter().map(|shape| shape.targets.len()).max().unwrap_or(0);
    let weights = node.weights.as_ref().unwrap_or(&mesh.weights);
    let finite = |&weight: &f32| if weight.is_finite() { weight } else { 0.0 };
    weights.iter().map(finite).take(targets).collect()
}
