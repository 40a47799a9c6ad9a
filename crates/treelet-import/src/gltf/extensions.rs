//! What the extensions of a file mean for us, and what of a file is left out.

use crate::error::{Fault, Place, Result, clip};
use crate::source::Source;

use super::json::{Mesh, Root};

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

/// Extensions that a file may require: those that are read, and those that change looks a little.
const FINE: [&str; 9] = [
    "KHR_mesh_quantization",
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
    "EXT_mesh_gpu_instancing",
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "KHR_lights_punctual",
    "KHR_animation_pointer",
];

/// Refuses files that cannot be read right without an extension.
pub(super) fn check(source: &Source<'_>, root: &Root) -> Result<Vec<String>> {
    for name in &root.extensions_required {
        if FINE.iter().any(|fine| name.starts_with(fine)) {
            continue;
        }
        let remedy = match name.as_str() {
            name if name == DRACO.name => DRACO.remedy,
            _ => "export it without that extension, or open it in Blender and export again",
        };
        let place = Place::Element("extensionsRequired".to_owned());
        return Err(
            source.error(place, Fault::unsupported(format!("names {}", clip(name)), remedy))
        );
    }
    let lights = root.extensions_used.iter().any(|used| used == "KHR_lights_punctual");
    Ok(lights
        .then(|| "Lights (KHR_lights_punctual) are not read.".to_owned())
        .into_iter()
        .collect())
}

/// The fault of a primitive whose geometry is packed in a form that is not read.
pub(super) fn draco() -> Fault {
    Fault::unsupported(format!("uses {}", DRACO.name), DRACO.remedy)
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
