//! What the extensions of a file mean for us, and what of a file is left out.

use crate::error::{Fault, Place, Result, clip};
use crate::source::Source;

use super::json::Root;

/// An extension that is known and not read, and how to get rid of it.
struct Unread {
    name: &'static str,
    remedy: &'static str,
}

/// Geometry in a form of its own, under primitives.
const DRACO: Unread = Unread {
    name: "KHR_draco_mesh_compression",
    remedy: "decode it: npx @gltf-transform/cli copy OLD.glb NEW.glb",
};

/// Textures in forms of their own.
const TEXTURES: [Unread; 2] = [
    Unread {
        name: "KHR_texture_basisu",
        remedy: "turn its KTX2 textures into PNG: npx @gltf-transform/cli ktxdecompress OLD.glb \
                 NEW.glb",
    },
    Unread {
        name: "EXT_texture_webp",
        remedy: "turn its textures into PNG: npx @gltf-transform/cli png OLD.glb NEW.glb",
    },
];

/// Extensions that are read.
const READ: [&str; 15] = [
    "KHR_mesh_quantization",
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
    "EXT_mesh_gpu_instancing",
    "KHR_texture_transform",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_materials_unlit",
    "KHR_materials_clearcoat",
    "KHR_materials_specular",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_draco_mesh_compression",
];

/// Extensions that a file may require though they are not read: without them it looks otherwise, but
/// has the same shape.
const LOOKS: &str = "KHR_materials_";

/// Refuses files that cannot be read right without an extension; warns of others.
pub(super) fn check(source: &Source<'_>, root: &Root) -> Result<Vec<String>> {
    for name in &root.extensions_required {
        let is_draco = name == DRACO.name;
        if !is_draco && (READ.contains(&name.as_str()) || name.starts_with(LOOKS)) {
            continue;
        }
        let known = TEXTURES.iter().chain([&DRACO]).find(|unread| unread.name == name);
        let remedy = known.map_or(
            "export it without that extension, or open it in Blender and export again",
            |unread| unread.remedy,
        );
        let place = Place::Element("extensionsRequired".to_owned());
        return Err(
            source.error(place, Fault::unsupported(format!("names {}", clip(name)), remedy))
        );
    }
    let mut unread: Vec<&str> = root.extensions_used.iter().map(String::as_str).collect();
    unread.retain(|name| !READ.contains(name));
    if unread.is_empty() {
        return Ok(Vec::new());
    }
    let names = clip(&unread.join(", "));
    Ok(vec![format!("Extensions are not read: {names}.")])
}

/// The fault of a primitive whose geometry is packed in a form that is not read.
pub(super) fn draco() -> Fault {
    Fault::unsupported(format!("uses {}", DRACO.name), DRACO.remedy)
}

/// Names what is left out.
pub(super) fn collect_warnings(root: &Root, warnings: &mut Vec<String>) {
    let scenes = root.scenes.len();
    if scenes > 1 {
        warnings.push(format!("The file has {scenes} scenes; one of them is read."));
    }
}
