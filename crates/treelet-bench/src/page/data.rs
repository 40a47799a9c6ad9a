//! What a page is made of: plain data, gathered by whoever ran the bench.

use crate::figure::data::Figure;

/// A page.
#[derive(Clone, Debug, Default)]
pub struct Page {
    /// Everything that was measured, entrants included: see [`super::entrants::join`].
    pub figure: Figure,
    /// Pictures and trees, a scene each; scenes of which nothing but points is known need none.
    pub scenes: Vec<ScenePage>,
    /// Facts about the machine and the run that the figure does not hold: a name and a value each.
    pub facts: Vec<(String, String)>,
    /// The command lines, this run's first.
    pub commands: Vec<String>,
    /// The files that entrants came from.
    pub entrants: Vec<String>,
    /// Whether engines' and variants' names are hidden.
    pub anonymous: bool,
}

/// Pictures and trees of a scene.
#[derive(Clone, Debug, Default)]
pub struct ScenePage {
    /// Its name, as in the points.
    pub scene: String,
    /// Triangles.
    pub triangles: u64,
    /// How it looks.
    pub look: Option<Picture>,
    /// What finding the first hit costs, in trees that differ.
    pub heat: Option<HeatMaps>,
    /// The curve through its triangles.
    pub curve: Option<CurveDrawing>,
    /// What every builder made.
    pub trees: Vec<TreeLine>,
}

/// A picture as a PNG file's bytes.
#[derive(Clone, Debug, Default)]
pub struct Picture {
    /// The file.
    pub png: Vec<u8>,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
}

/// Heat maps of one scale.
#[derive(Clone, Debug, Default)]
pub struct HeatMaps {
    /// The maps, the costliest tree first.
    pub maps: Vec<HeatMap>,
    /// Nodes a ray at the end of the scale; it starts at 0.
    pub end: u64,
    /// Colours of the scale, evenly spaced from its start to its end.
    pub ramp: Vec<[u8; 3]>,
}

/// Nodes entered by the ray through each pixel.
#[derive(Clone, Debug, Default)]
pub struct HeatMap {
    /// The variant that made the tree.
    pub variant: String,
    /// Mean over the pixels.
    pub mean: f64,
    /// Most of a pixel.
    pub max: u64,
    /// The map.
    pub picture: Picture,
}

/// A Morton curve, seen along the shortest axis of its scene.
#[derive(Clone, Debug, Default)]
pub struct CurveDrawing {
    /// Names of the axes that are drawn, across and up.
    pub axes: [char; 2],
    /// Extent of the scene along them.
    pub extent: [f64; 2],
    /// The sample of centroids in the curve's order, from 0 to 1 along each axis, up is up.
    pub path: Vec<[f32; 2]>,
    /// How many centroids the sample is of.
    pub of: u64,
    /// The tree's first levels.
    pub boxes: Vec<LevelBox>,
}

/// A node's box.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LevelBox {
    /// How far below the root.
    pub level: u32,
    /// Its least corner, as the path.
    pub lo: [f32; 2],
    /// Its greatest corner.
    pub hi: [f32; 2],
}

/// What a tree is like.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TreeLine {
    /// The builder, level or composition.
    pub variant: String,
    /// Nodes of the binary tree.
    pub nodes: u64,
    /// Leaves.
    pub leaves: u64,
    /// Nodes on the longest way from the root to a leaf.
    pub depth: u32,
    /// Triangles a leaf, on average.
    pub leaf_mean: f64,
    /// Most triangles of a leaf.
    pub leaf_max: u32,
    /// Bytes that rays read: nodes and triangles.
    pub bytes: u64,
}
