//! glTF 2.0 and GLB.
//!
//! After the Khronos Group's "glTF 2.0 Specification", version 2.0.1. Read are the node graph, meshes
//! of triangles, strips and fans with all that stands beside their vertices, cameras, materials with
//! their textures, lights, and what moves: animations, skins and morph targets. Every node with a mesh
//! becomes a placement; a mesh becomes an object when the first node places it, and one that bends
//! becomes an object for each node (`rig.rs`). The model is as the file shows it when nothing plays.
//!
//! The reader takes the few JSON structures that it needs with `serde`, rather than a glTF library:
//! the kept one sees little upkeep, refuses some files that others open, and does not decompress.
//! `accessor.rs` and `views.rs` alone know how numbers lie in buffers.

mod accessor;
mod animations;
mod buffers;
mod container;
mod extensions;
mod instancing;
mod json;
mod lights;
mod look;
mod material;
mod meshes;
mod meshopt;
mod nodes;
mod rig;
mod shapes;
mod skins;
mod textures;
mod views;

use treelet_model::Model;

use crate::catalogue::{Importer, Info};
use crate::error::{Place, Result, quote};
use crate::source::Source;

use accessor::Accessors;
use buffers::Buffers;
use json::Root;
use textures::Textures;
use views::Views;

/// The format, as the catalogue names it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gltf;

impl Importer for Gltf {
    fn info(&self) -> Info {
        Info {
            name: "gltf",
            extensions: &["glb", "gltf"],
            summary: "glTF 2.0 and GLB: meshes, meshopt, materials, textures, lights, cameras, clips",
        }
    }

    fn sniff(&self, bytes: &[u8]) -> bool {
        container::is_glb(bytes) || container::is_json(bytes)
    }

    fn read(&self, source: &Source<'_>) -> Result<Model> {
        let parts = container::open(source)?;
        let root: Root = json::parse(source, &parts)?;
        let mut warnings = extensions::check(source, &root)?;
        extensions::collect_warnings(&root, &mut warnings);
        let buffers = Buffers::open(source, &root, parts.binary)?;
        let views = Views::open(source, &root, &buffers)?;
        let accessors = Accessors { source, root: &root, views: &views };
        let mut walk = nodes::walk(&accessors, &mut warnings)?;

        // Read each mesh once, when the first node places it.
        let mut model = Model {
            cameras: std::mem::take(&mut walk.cameras),
            lights: std::mem::take(&mut walk.lights),
            scenes: root.scenes.iter().map(|scene| scene.name.clone()).collect(),
            scene: walk.scene,
            up: Some(1),
            ..Model::default()
        };
        let mut textures = Textures::default();
        model.materials = material::read_all(&accessors, &mut textures)?;
        warnings.extend(textures.warnings());
        model.images = textures.images;
        model.animations = animations::read_all(&accessors, &mut warnings)?;
        let mut bodies = rig::Bodies::new(accessors, &walk, &model, &mut warnings)?;
        for placed in &walk.placed {
            bodies.place(placed, &mut model)?;
        }
        bodies.finish(walk, &mut model, &mut warnings)?;
        model.warnings = warnings;
        Ok(model)
    }
}

/// The place of an item of one of the lists, with its name if it has one.
fn item(list: &str, index: usize, name: &str) -> Place {
    let name = if name.is_empty() { String::new() } else { format!(" {}", quote(name.as_bytes())) };
    Place::Element(format!("{list} {index}{name}"))
}

/// What to do about a reference to nothing and the like.
const INVALID: &str = "check the file with a glTF validator, or export it again";
