//! The JSON of glTF, as far as it is read.

use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::error::{Fault, Place, Result};
use crate::source::Source;

use super::container::{self, Parts};
pub(super) use super::look::{
    Image, Light, Material, RootExtensions, Sampler, Texture, TextureInfo,
};

/// JSON text may take so many times its size in memory once it is structures.
const BYTES_PER_BYTE: u64 = 64;

/// At most so many characters of a message of the JSON library are passed on.
const MESSAGE_MAX: usize = 200;

/// The whole document.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Root {
    pub(super) asset: Asset,
    pub(super) extensions_used: Vec<String>,
    pub(super) extensions_required: Vec<String>,
    pub(super) scene: Option<usize>,
    pub(super) scenes: Vec<Scene>,
    pub(super) nodes: Vec<Node>,
    pub(super) meshes: Vec<Mesh>,
    pub(super) accessors: Vec<Accessor>,
    pub(super) buffer_views: Vec<BufferView>,
    pub(super) buffers: Vec<Buffer>,
    pub(super) materials: Vec<Material>,
    pub(super) cameras: Vec<Camera>,
    pub(super) animations: Vec<Animation>,
    pub(super) images: Vec<Image>,
    pub(super) samplers: Vec<Sampler>,
    pub(super) textures: Vec<Texture>,
    pub(super) extensions: RootExtensions,
    pub(super) skins: Vec<Skin>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Asset {
    pub(super) version: String,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Scene {
    pub(super) name: String,
    pub(super) nodes: Vec<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Node {
    pub(super) name: String,
    pub(super) children: Vec<usize>,
    pub(super) mesh: Option<usize>,
    pub(super) camera: Option<usize>,
    pub(super) skin: Option<usize>,
    /// Of morph targets, instead of the mesh's.
    pub(super) weights: Option<Vec<f32>>,
    // Boxed: most of a hundred thousand nodes have one of them at most.
    pub(super) matrix: Option<Box<[f64; 16]>>,
    pub(super) translation: Option<Box<[f64; 3]>>,
    pub(super) rotation: Option<Box<[f64; 4]>>,
    pub(super) scale: Option<Box<[f64; 3]>>,
    pub(super) extensions: Option<Box<NodeExtensions>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct NodeExtensions {
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    pub(super) instancing: Option<Instancing>,
    #[serde(rename = "KHR_lights_punctual")]
    pub(super) light: Option<LightIndex>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct LightIndex {
    pub(super) light: usize,
}

/// `EXT_mesh_gpu_instancing`: one node that stands for many copies of its mesh.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Instancing {
    pub(super) attributes: InstanceAttributes,
}

/// Accessors, one element a copy.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "UPPERCASE", default)]
pub(super) struct InstanceAttributes {
    pub(super) translation: Option<usize>,
    pub(super) rotation: Option<usize>,
    pub(super) scale: Option<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Mesh {
    pub(super) name: String,
    pub(super) primitives: Vec<Primitive>,
    /// Of morph targets.
    pub(super) weights: Vec<f32>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Skin {
    pub(super) inverse_bind_matrices: Option<usize>,
    pub(super) joints: Vec<usize>,
}

/// Accessors of a morph target.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "UPPERCASE", default)]
pub(super) struct MorphTarget {
    pub(super) position: Option<usize>,
    pub(super) normal: Option<usize>,
    pub(super) tangent: Option<usize>,
}

#[derive(Debug, Deserialize)]
#[serde(default)]
pub(super) struct Primitive {
    pub(super) attributes: Attributes,
    pub(super) indices: Option<usize>,
    pub(super) material: Option<usize>,
    pub(super) mode: u32,
    pub(super) targets: Vec<MorphTarget>,
    pub(super) extensions: PrimitiveExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct PrimitiveExtensions {
    #[serde(rename = "KHR_draco_mesh_compression")]
    pub(super) draco: Option<IgnoredAny>,
}

impl Default for Primitive {
    fn default() -> Self {
        Self {
            attributes: Attributes::default(),
            indices: None,
            material: None,
            mode: mode::TRIANGLES,
            targets: Vec::new(),
            extensions: PrimitiveExtensions::default(),
        }
    }
}

/// Values of `primitive.mode`.
pub(super) mod mode {
    pub(in crate::gltf) const TRIANGLES: u32 = 4;
    pub(in crate::gltf) const TRIANGLE_STRIP: u32 = 5;
    pub(in crate::gltf) const TRIANGLE_FAN: u32 = 6;
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "UPPERCASE", default)]
pub(super) struct Attributes {
    pub(super) position: Option<usize>,
    pub(super) normal: Option<usize>,
    pub(super) tangent: Option<usize>,
    pub(super) texcoord_0: Option<usize>,
    pub(super) texcoord_1: Option<usize>,
    pub(super) texcoord_2: Option<usize>,
    pub(super) texcoord_3: Option<usize>,
    pub(super) color_0: Option<usize>,
    pub(super) joints_0: Option<usize>,
    pub(super) joints_1: Option<usize>,
    pub(super) weights_0: Option<usize>,
    pub(super) weights_1: Option<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Accessor {
    pub(super) buffer_view: Option<usize>,
    pub(super) byte_offset: u64,
    pub(super) component_type: u32,
    pub(super) count: u64,
    #[serde(rename = "type")]
    pub(super) shape: String,
    pub(super) normalized: bool,
    pub(super) sparse: Option<Sparse>,
}

/// Elements that take the place of others.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Sparse {
    pub(super) count: u64,
    pub(super) indices: SparseView,
    pub(super) values: SparseView,
}

/// Where the indices or the elements are; elements have the accessor's type.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct SparseView {
    pub(super) buffer_view: usize,
    pub(super) byte_offset: u64,
    pub(super) component_type: u32,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct BufferView {
    pub(super) buffer: usize,
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
    pub(super) byte_stride: Option<u64>,
    pub(super) extensions: ViewExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct ViewExtensions {
    #[serde(rename = "EXT_meshopt_compression")]
    pub(super) meshopt_ext: Option<Packed>,
    #[serde(rename = "KHR_meshopt_compression")]
    pub(super) meshopt_khr: Option<Packed>,
}

impl ViewExtensions {
    /// How the view is packed, if it is.
    pub(super) fn packed(&self) -> Option<&Packed> {
        self.meshopt_khr.as_ref().or(self.meshopt_ext.as_ref())
    }
}

/// Where the packed bytes of a view are, and what they unpack to.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Packed {
    pub(super) buffer: usize,
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
    pub(super) byte_stride: u64,
    pub(super) count: u64,
    pub(super) mode: String,
    pub(super) filter: String,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Buffer {
    pub(super) uri: Option<String>,
    pub(super) byte_length: u64,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Camera {
    pub(super) name: String,
    pub(super) perspective: Option<Perspective>,
    pub(super) orthographic: Option<Orthographic>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Orthographic {
    pub(super) ymag: f64,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Perspective {
    pub(super) yfov: f64,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Animation {
    pub(super) name: String,
    pub(super) channels: Vec<Channel>,
    pub(super) samplers: Vec<Curve>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Channel {
    pub(super) sampler: usize,
    pub(super) target: Target,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Target {
    pub(super) node: Option<usize>,
    pub(super) path: String,
}

/// Keys over time, by accessors.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Curve {
    pub(super) input: usize,
    pub(super) output: usize,
    pub(super) interpolation: String,
}

/// Reads the JSON. Its nesting is bounded by the JSON library, its size here.
pub(super) fn parse(source: &Source<'_>, parts: &Parts<'_>) -> Result<Root> {
    let needed = (parts.json.len() as u64).saturating_mul(BYTES_PER_BYTE);
    let limit = source.budget.left();
    if needed > limit {
        let fault = Fault::TooBig { what: "the JSON, in memory,", needed, limit };
        return Err(source.error(Place::File, fault));
    }
    let root: Root = serde_json::from_slice(parts.json).map_err(|error| {
        let place = Place::Line(error.line() as u64);
        // The message may quote a value of any length.
        let text: String = error.to_string().chars().take(MESSAGE_MAX).collect();
        source.broken(place, format!("JSON: {text}"), super::INVALID)
    })?;
    if root.asset.version.starts_with("1.") {
        return Err(source.error(Place::File, container::old_version()));
    }
    if root.asset.version.is_empty() && root.meshes.is_empty() {
        let found = "is JSON without \"asset\" and \"meshes\"";
        return Err(source.broken(Place::File, found, "check that it is a glTF file"));
    }
    Ok(root)
}
