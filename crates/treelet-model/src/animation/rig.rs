//! What of a model can move, in plain data.

use treelet::Mesh;
use treelet::memory::Array;

use super::transform::Rows;

/// What stands where because of which node. Empty for a model in which nothing can move.
///
/// The base shapes are kept here, undeformed; the model's objects have the shape of its pose.
#[derive(Clone, Debug, Default)]
pub struct Rig {
    /// Nodes, as the file numbers them.
    pub nodes: Vec<Node>,
    /// Those nodes that the scene shows, parents before their children.
    pub order: Vec<usize>,
    /// What each of [`crate::Model::placements`] hangs on; placements past the end stand still.
    pub placements: Vec<Mount>,
    /// The node of each of [`crate::Model::cameras`]; cameras past the end stand still.
    pub cameras: Vec<usize>,
    /// The node of each of [`crate::Model::lights`]; lights past the end stand still.
    pub lights: Vec<usize>,
    /// Skeletons.
    pub skins: Vec<Skin>,
    /// Objects whose shape changes.
    pub deformers: Vec<Deformer>,
}

/// A node of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Node {
    /// The node that it stands on; `None` for a root.
    pub parent: Option<usize>,
    /// How it stands there when nothing moves it.
    pub local: Local,
}

/// How a node stands against its parent.
#[derive(Clone, Debug, PartialEq)]
pub enum Local {
    /// Scaled, then turned, then moved: what clips can change.
    Parts {
        /// Moved by.
        translation: [f64; 3],
        /// A quaternion x, y, z, w of any length but zero.
        rotation: [f64; 4],
        /// A factor for each axis.
        scale: [f64; 3],
    },
    /// A matrix, which no clip changes.
    Matrix(Box<Rows>),
}

impl Default for Local {
    /// Where its parent is.
    fn default() -> Self {
        Self::Parts { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0], scale: [1.0; 3] }
    }
}

/// What a placement hangs on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mount {
    /// The node; `None` for what stands still, as skinned objects do: their joints bring them into
    /// the world.
    pub node: Option<usize>,
    /// Where it stands against the node, for one of many copies.
    pub node_from_object: Option<Box<Rows>>,
}

/// A skeleton: nodes that vertices follow.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// Its joints.
    pub joints: Vec<Joint>,
}

/// A joint of a skeleton.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// Index into [`Rig::nodes`].
    pub node: usize,
    /// Takes the mesh, as it was when it was bound, to the joint.
    pub joint_from_mesh: Rows,
}

/// An object that bends.
#[derive(Clone, Debug, Default)]
pub struct Deformer {
    /// Index into [`crate::Model::objects`].
    pub object: usize,
    /// The node that places it: its weights are what clips change.
    pub node: usize,
    /// Index into [`Rig::skins`], if it follows a skeleton.
    pub skin: Option<usize>,
    /// Weights of the morph targets when no clip changes them; targets past the end have none.
    pub weights: Vec<f32>,
    /// One for each part of the object.
    pub shapes: Vec<Shape>,
}

/// A part as it is before it bends, and how it can.
#[derive(Clone, Debug, Default)]
pub struct Shape {
    /// The mesh at rest.
    pub mesh: Mesh,
    /// Its normals, if the part has them.
    pub normals: Option<Array<[f32; 3]>>,
    /// Its tangents, if the part has them.
    pub tangents: Option<Array<[f32; 4]>>,
    /// What is added to it, by weights.
    pub targets: Vec<Target>,
    /// What its vertices follow, four joints a set; empty for a part that follows its node.
    pub influences: Vec<Influences>,
}

/// A morph target: displacements, one a vertex.
#[derive(Clone, Debug, Default)]
pub struct Target {
    /// Of positions.
    pub positions: Option<Array<[f32; 3]>>,
    /// Of normals.
    pub normals: Option<Array<[f32; 3]>>,
    /// Of tangents.
    pub tangents: Option<Array<[f32; 3]>>,
}

/// Four joints a vertex, and how much each of them pulls against the others of all sets. A vertex that
/// none pulls at follows its node.
#[derive(Clone, Debug, Default)]
pub struct Influences {
    /// Indices into [`Skin::joints`].
    pub joints: Array<[u16; 4]>,
    /// Not below 0.
    pub weights: Array<[f32; 4]>,
}
