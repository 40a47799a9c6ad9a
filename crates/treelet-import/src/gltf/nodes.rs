//! The node graph, walked without recursion, every world transform composed in f64; and kept, where
//! something in the file can move it.

use treelet_model::animation::transform::{self, Rows};
use treelet_model::animation::{Local, Node as Stand};
use treelet_model::{Camera, Light, View};

use crate::error::{Place, Result, clip};
use crate::source::Source;

use super::accessor::Accessors;
use super::instancing;
use super::json::{Node, Root};
use super::lights;

/// What stands where.
#[derive(Debug, Default)]
pub(super) struct Walk {
    /// Meshes, in the order of a depth-first walk.
    pub(super) placed: Vec<Placed>,
    /// Cameras, and the nodes that they hang on.
    pub(super) cameras: Vec<Camera>,
    pub(super) camera_nodes: Vec<usize>,
    /// Lights, and the nodes that they hang on.
    pub(super) lights: Vec<Light>,
    pub(super) light_nodes: Vec<usize>,
    /// Which of the file's scenes this is.
    pub(super) scene: usize,
    /// If something in the file can move: all nodes, and those that were met, in that order.
    pub(super) stands: Vec<Stand>,
    pub(super) order: Vec<usize>,
}

/// A mesh at a place.
#[derive(Debug)]
pub(super) struct Placed {
    pub(super) mesh: usize,
    pub(super) node: usize,
    pub(super) world: Rows,
    /// Where it stands against its node, for one of many copies.
    pub(super) copy: Option<Rows>,
}

/// Walks the scene that the file shows.
pub(super) fn walk(accessors: &Accessors<'_, '_>, warnings: &mut Vec<String>) -> Result<Walk> {
    let Accessors { source, root, .. } = *accessors;
    let scene = scene(source, root)?;
    let roots = roots(source, root, scene)?;
    let nodes = &root.nodes;
    let mut parents: Vec<Option<Parent>> =
        source.whole(source.budget.filled(None, nodes.len(), "nodes"))?;
    let mut walk = Walk { scene: scene.unwrap_or(0), ..Walk::default() };
    let can_move = super::rig::can_move(root);
    if can_move {
        let stands = source.budget.filled(Stand::default(), nodes.len(), "nodes");
        walk.stands = source.whole(stands)?;
    }
    let mut stack: Vec<(usize, Parent, Rows)> =
        roots.iter().rev().map(|&node| (node, Parent::Scene, transform::IDENTITY)).collect();
    let (mut odd_cameras, mut odd_lights) = (false, false);
    while let Some((index, parent, world_from_parent)) = stack.pop() {
        // Each node has one parent, or the graph is no tree.
        let Some(node) = nodes.get(index) else {
            let found = format!("names node {index} of {}", nodes.len());
            return Err(source.broken(parent.place(nodes), found, super::INVALID));
        };
        if let Some(first) = parents[index].replace(parent) {
            parents[index] = Some(first);
            let (first, second) = (first.name(), parent.name());
            let found = if is_below(&parents, parent, index) {
                format!("is its own ancestor, as a child of {second}; nodes must form trees")
            } else {
                format!("has two parents, {first} and {second}; nodes must form trees")
            };
            return Err(source.broken(place(nodes, index), found, super::INVALID));
        }
        let Some(local) = local_transform(node) else {
            let found = "has a matrix whose last row is not 0 0 0 1";
            return Err(source.broken(place(nodes, index), found, super::INVALID));
        };
        let world = transform::compose(&world_from_parent, &local.rows());
        if can_move {
            let parent = match parent {
                Parent::Scene => None,
                Parent::Node(parent) => Some(parent),
            };
            walk.stands[index] = Stand { parent, local };
            source.push(&mut walk.order, index, "nodes")?;
        }
        if let Some(mesh) = node.mesh {
            if mesh >= root.meshes.len() {
                let found = format!("names mesh {mesh} of {}", root.meshes.len());
                return Err(source.broken(place(nodes, index), found, super::INVALID));
            }
            match node.extensions.as_ref().and_then(|extensions| extensions.instancing.as_ref()) {
                Some(copies) => {
                    let copies = instancing::read(accessors, copies, &place(nodes, index))?;
                    source.make_room(&mut walk.placed, copies.len(), "placements")?;
                    walk.placed.extend(copies.iter().map(|copy| {
                        let world = transform::compose(&world, copy);
                        Placed { mesh, node: index, world, copy: Some(*copy) }
                    }));
                }
                None => {
                    let placed = Placed { mesh, node: index, world, copy: None };
                    source.push(&mut walk.placed, placed, "placements")?;
                }
            }
        }
        if let Some(camera) = node.camera {
            let camera = root.cameras.get(camera);
            match camera.and_then(|camera| place_camera(camera, node, &world)) {
                Some(camera) => {
                    source.push(&mut walk.cameras, camera, "cameras")?;
                    source.push(&mut walk.camera_nodes, index, "cameras")?;
                }
                None => odd_cameras = true,
            }
        }
        let light = node.extensions.as_ref().and_then(|extensions| extensions.light.as_ref());
        if let Some(light) = light {
            let light = root.extensions.lights.lights.get(light.light);
            match light.and_then(|light| lights::place(light, &world)) {
                Some(light) => {
                    source.push(&mut walk.lights, light, "lights")?;
                    source.push(&mut walk.light_nodes, index, "lights")?;
                }
                None => odd_lights = true,
            }
        }
        for &child in node.children.iter().rev() {
            source.push(&mut stack, (child, Parent::Node(index), world), "nodes")?;
        }
    }
    if odd_cameras {
        warnings.push("Cameras that see nothing are left out.".to_owned());
    }
    if odd_lights {
        warnings.push("Lights of unknown kinds or directions are left out.".to_owned());
    }
    Ok(walk)
}

/// What names a node.
#[derive(Clone, Copy, Debug)]
enum Parent {
    Scene,
    Node(usize),
}

impl Parent {
    fn name(self) -> String {
        match self {
            Self::Scene => "the scene".to_owned(),
            Self::Node(index) => format!("node {index}"),
        }
    }

    fn place(self, nodes: &[Node]) -> Place {
        match self {
            Self::Scene => Place::Element("scene".to_owned()),
            Self::Node(index) => place(nodes, index),
        }
    }
}

/// Whether `node` is `ancestor` or stands below it.
fn is_below(parents: &[Option<Parent>], node: Parent, ancestor: usize) -> bool {
    let mut at = node;
    // The chain of parents has no cycle: each node was entered once, after its parent.
    while let Parent::Node(index) = at {
        if index == ancestor {
            return true;
        }
        match parents.get(index) {
            Some(Some(parent)) => at = *parent,
            _ => return false,
        }
    }
    false
}

pub(super) fn place(nodes: &[Node], index: usize) -> Place {
    super::item("node", index, nodes.get(index).map_or("", |node| &node.name))
}

/// Which scene is read: the one that is asked for, by name or number, else the default, else the
/// first; `None` if there is none.
fn scene(source: &Source<'_>, root: &Root) -> Result<Option<usize>> {
    let scenes = root.scenes.len();
    let place = || Place::Element("scene".to_owned());
    if let Some(asked) = &source.options.scene {
        let by_name = root.scenes.iter().position(|scene| scene.name == *asked);
        let by_number = || asked.parse().ok().filter(|&number: &usize| number < scenes);
        return match by_name.or_else(by_number) {
            Some(scene) => Ok(Some(scene)),
            None => {
                let names: Vec<&str> = root.scenes.iter().map(|scene| &*scene.name).collect();
                let found = format!("{:?} is not one of {scenes}", clip(asked));
                let remedy = format!("take a number from 0, or one of {}", clip(&names.join(", ")));
                Err(source.broken(place(), found, remedy))
            }
        };
    }
    match root.scene {
        Some(scene) if scene >= scenes => {
            let found = format!("names scene {scene} of {scenes}");
            Err(source.broken(place(), found, super::INVALID))
        }
        Some(scene) => Ok(Some(scene)),
        None => Ok((scenes > 0).then_some(0)),
    }
}

/// The roots of a scene; without scenes all nodes that have no parent.
fn roots(source: &Source<'_>, root: &Root, scene: Option<usize>) -> Result<Vec<usize>> {
    if let Some(scene) = scene.and_then(|scene| root.scenes.get(scene)) {
        return Ok(scene.nodes.clone());
    }
    let mut has_parent = vec![false; root.nodes.len()];
    for child in root.nodes.iter().flat_map(|node| &node.children) {
        if let Some(has_parent) = has_parent.get_mut(*child) {
            *has_parent = true;
        }
    }
    let roots: Vec<usize> = (0..root.nodes.len()).filter(|&node| !has_parent[node]).collect();
    if roots.is_empty() && !root.nodes.is_empty() {
        let found = "every node has a parent, so the nodes form a cycle";
        return Err(source.broken(place(&root.nodes, 0), found, super::INVALID));
    }
    Ok(roots)
}

/// The transform of a node against its parent; `None` for a projective matrix.
fn local_transform(node: &Node) -> Option<Local> {
    if let Some(matrix) = &node.matrix {
        // Column after column.
        let at = |row: usize, column: usize| matrix[4 * column + row];
        let affine = [at(3, 0), at(3, 1), at(3, 2), at(3, 3)] == [0.0, 0.0, 0.0, 1.0];
        let rows = || [0, 1, 2].map(|row| [0, 1, 2, 3].map(|column| at(row, column)));
        return affine.then(|| Local::Matrix(Box::new(rows())));
    }
    Some(Local::Parts {
        translation: node.translation.as_deref().copied().unwrap_or([0.0; 3]),
        rotation: node.rotation.as_deref().copied().unwrap_or([0.0, 0.0, 0.0, 1.0]),
        scale: node.scale.as_deref().copied().unwrap_or([1.0; 3]),
    })
}

/// A camera at a node, rid of the node's scale; `None` if it sees nothing or has no frame.
fn place_camera(camera: &super::json::Camera, node: &Node, world: &Rows) -> Option<Camera> {
    let view = match (&camera.perspective, &camera.orthographic) {
        (Some(perspective), _) => {
            let yfov = perspective.yfov;
            let is_sound = yfov > 0.0 && yfov < std::f64::consts::PI;
            is_sound.then_some(View::Perspective { vertical_fov: yfov as f32 })?
        }
        // `ymag` is half the height of the view.
        (None, Some(orthographic)) => {
            let height = 2.0 * orthographic.ymag.abs() as f32;
            (height > 0.0 && height.is_finite()).then_some(View::Orthographic { height })?
        }
        (None, None) => return None,
    };
    let world_from_camera = transform::camera_frame(world)?;
    let name = if node.name.is_empty() { &camera.name } else { &node.name };
    Some(Camera { name: name.clone(), world_from_camera, view, ..Camera::default() })
}
