//! The JSON of glTF, as far as it is read, and what its extensions mean for us.

use std::collections::HashMap;

use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::error::{Fault, Place, Result};
use crate::source::Source;

use super::container::{self, Parts};

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
    pub(super) animations: Vec<IgnoredAny>,
    pub(super) skins: Vec<IgnoredAny>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Asset {
    pub(super) version: String,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Scene {
    pub(super) nodes: Vec<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Node {
    pub(super) name: String,
    pub(super) children: Vec<usize>,
    pub(super) mesh: Option<usize>,
    pub(super) camera: Option<usize>,
    // Boxed: most of a hundred thousand nodes have one of them at most.
    pub(super) matrix: Option<Box<[f64; 16]>>,
    pub(super) translation: Option<Box<[f64; 3]>>,
    pub(super) rotation: Option<Box<[f64; 4]>>,
    pub(super) scale: Option<Box<[f64; 3]>>,
    pub(super) extensions: HashMap<String, IgnoredAny>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Mesh {
    pub(super) name: String,
    pub(super) primitives: Vec<Primitive>,
}

#[derive(Debug, Deserialize)]
#[serde(default)]
pub(super) struct Primitive {
    pub(super) attributes: Attributes,
    pub(super) indices: Option<usize>,
    pub(super) material: Option<usize>,
    pub(super) mode: u32,
    pub(super) targets: Vec<IgnoredAny>,
    pub(super) extensions: HashMap<String, IgnoredAny>,
}

impl Default for Primitive {
    fn default() -> Self {
        Self {
            attributes: Attributes::default(),
            indices: None,
            material: None,
            mode: mode::TRIANGLES,
            targets: Vec::new(),
            extensions: HashMap::new(),
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
    pub(super) sparse: Option<IgnoredAny>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct BufferView {
    pub(super) buffer: usize,
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
    pub(super) byte_stride: Option<u64>,
    pub(super) extensions: HashMap<String, IgnoredAny>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Buffer {
    pub(super) uri: Option<String>,
    pub(super) byte_length: u64,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Material {
    pub(super) name: String,
    pub(super) pbr_metallic_roughness: MetallicRoughness,
    pub(super) emissive_factor: [f32; 3],
    pub(super) emissive_texture: Option<IgnoredAny>,
    pub(super) extensions: MaterialExtensions,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct MetallicRoughness {
    pub(super) base_color_factor: [f32; 4],
    pub(super) metallic_factor: f32,
    pub(super) roughness_factor: f32,
    pub(super) base_color_texture: Option<IgnoredAny>,
    pub(super) metallic_roughness_texture: Option<IgnoredAny>,
}

impl Default for MetallicRoughness {
    /// As the specification sets them.
    fn default() -> Self {
        Self {
            base_color_factor: [1.0; 4],
            metallic_factor: 1.0,
            roughness_factor: 1.0,
            base_color_texture: None,
            metallic_roughness_texture: None,
        }
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct MaterialExtensions {
    #[serde(rename = "KHR_materials_transmission")]
    pub(super) transmission: Option<Transmission>,
    #[serde(rename = "KHR_materials_ior")]
    pub(super) ior: Option<Ior>,
    #[serde(rename = "KHR_materials_emissive_strength")]
    pub(super) emissive_strength: Option<EmissiveStrength>,
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
    pub(super) specular_glossiness: Option<SpecularGlossiness>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Transmission {
    pub(super) transmission_factor: f32,
    pub(super) transmission_texture: Option<IgnoredAny>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Ior {
    pub(super) ior: Option<f32>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct EmissiveStrength {
    pub(super) emissive_strength: Option<f32>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct SpecularGlossiness {
    pub(super) diffuse_factor: Option<[f32; 4]>,
    pub(super) glossiness_factor: Option<f32>,
    pub(super) diffuse_texture: Option<IgnoredAny>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Camera {
    pub(super) name: String,
    pub(super) perspective: Option<Perspective>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Perspective {
    pub(super) yfov: f64,
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

/// An extension that changes the geometry, and how to get rid of it.
struct GeometryExtension {
    name: &'static str,
    remedy: &'static str,
}

const DECODE: &str = "decode it: npx @gltf-transform/cli copy OLD.glb NEW.glb";

/// In the order in which they are reported.
const UNREAD: [GeometryExtension; 5] = [
    GeometryExtension { name: "KHR_draco_mesh_compression", remedy: DECODE },
    GeometryExtension { name: "EXT_meshopt_compression", remedy: DECODE },
    GeometryExtension { name: "KHR_meshopt_compression", remedy: DECODE },
    GeometryExtension {
        name: "KHR_mesh_quantization",
        remedy: "turn its integers into floats: npx @gltf-transform/cli dequantize OLD.glb NEW.glb",
    },
    INSTANCING,
];

/// One node that stands for many copies.
const INSTANCING: GeometryExtension = GeometryExtension {
    name: "EXT_mesh_gpu_instancing",
    remedy: "export it with one node for each copy, for example by importing it into Blender and \
             exporting it again",
};

/// Extensions that may be required, because they change nothing that is read: textures, looks.
const HARMLESS: [&str; 7] = [
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "MSFT_texture_",
    "KHR_lights_punctual",
    "KHR_animation_pointer",
    "KHR_xmp",
];

/// Refuses files that cannot be read right without an extension.
pub(super) fn check_extensions(source: &Source<'_>, root: &Root) -> Result<Vec<String>> {
    let uses = |name: &str| root.extensions_used.iter().any(|used| used == name);
    let requires = |name: &str| root.extensions_required.iter().any(|used| used == name);
    let unread = |name: &str, remedy: &str| {
        let place = Place::Element("extensionsRequired".to_owned());
        source.error(place, Fault::unsupported(format!("names {name}"), remedy))
    };
    for GeometryExtension { name, remedy } in UNREAD {
        if requires(name) {
            return Err(unread(name, remedy));
        }
    }
    for name in &root.extensions_required {
        if !HARMLESS.iter().any(|harmless| name.starts_with(harmless)) {
            let remedy = "export it without that extension, or open it in Blender and export again";
            return Err(unread(name, remedy));
        }
    }
    // Without its instances a scene is another scene, though the file says it is optional.
    let GeometryExtension { name, remedy } = INSTANCING;
    let is_instanced = |node: &Node| node.extensions.contains_key(name);
    if let Some(index) = root.nodes.iter().position(is_instanced) {
        let place = super::item("node", index, &root.nodes[index].name);
        return Err(source.error(place, Fault::unsupported(format!("uses {name}"), remedy)));
    }
    let lights = uses("KHR_lights_punctual");
    Ok(lights
        .then(|| "Lights (KHR_lights_punctual) are not read.".to_owned())
        .into_iter()
        .collect())
}

/// The fault of an accessor without data of its own, by what stands in its place.
pub(super) fn compressed(extensions: &HashMap<String, IgnoredAny>) -> Option<Fault> {
    let found = UNREAD.iter().find(|unread| extensions.contains_key(unread.name))?;
    Some(Fault::unsupported(format!("uses {}", found.name), found.remedy))
}

/// Names what is left out.
pub(super) fn collect_warnings(root: &Root, warnings: &mut Vec<String>) {
    let scenes = root.scenes.len();
    if scenes > 1 {
        warnings.push(format!("The file has {scenes} scenes; only its default is read."));
    }
    if !root.animations.is_empty() {
        warnings.push("Animations are not read; nodes stand as the file places them.".to_owned());
    }
    if !root.skins.is_empty() {
        warnings.push("Skins are not read; meshes stand as their nodes place them.".to_owned());
    }
    let has_targets = |mesh: &Mesh| mesh.primitives.iter().any(|p| !p.targets.is_empty());
    if root.meshes.iter().any(has_targets) {
        warnings.push("Morph targets are not read; meshes have their base shape.".to_owned());
    }
}
