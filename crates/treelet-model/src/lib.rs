//! What a scene file says, in plain data: objects made of meshes, where they stand, what they are
//! made of, who looks at them and under which sky.
//!
//! Importers fill a [`Model`], the renderer shows one, and neither knows the other. Units: lengths
//! are the file's own, angles are radians, colours are linear Rec. 709, radiance is relative.
//! The y axis points up unless a file says otherwise.

pub mod animation;
pub mod camera;
pub mod decode;
pub mod light;
pub mod material;
pub mod placed;
pub mod sky;
pub mod texture;

pub use animation::{Animation, Changes, PoseError, Rig};
pub use camera::{Camera, Lens, View};
pub use decode::ImageError;
pub use light::{Environment, Light, LightKind};
pub use material::{AlphaMode, Material};
pub use placed::{PlaceError, PlacedModel, Updated};
pub use sky::{Sky, Sun};
pub use texture::{Image, Pixels, Texture};

use treelet::Mesh;
use treelet::math::Affine;
use treelet::memory::Array;

/// Everything a file says about a scene.
#[derive(Clone, Debug, Default)]
pub struct Model {
    /// What can be placed, each stored once.
    pub objects: Vec<Object>,
    /// The placements; their order is the order of `Hit::inst`.
    pub placements: Vec<Placement>,
    /// Materials; parts index into this list.
    pub materials: Vec<Material>,
    /// Pictures; textures and the environment index into this list.
    pub images: Vec<Image>,
    /// Cameras, the file's default first.
    pub cameras: Vec<Camera>,
    /// Lights without a surface.
    pub lights: Vec<Light>,
    /// The light from outside as a picture; it takes the place of the sky.
    pub environment: Option<Environment>,
    /// The light from outside by rule. Without it and an environment the choice is the renderer's.
    pub sky: Option<Sky>,
    /// Names of the file's scenes, of which this is one; empty where files have no such thing.
    pub scenes: Vec<String>,
    /// Which of `scenes` this is.
    pub scene: usize,
    /// The axis (0, 1, 2) that points up, where the format says so.
    pub up: Option<usize>,
    /// Clips; [`Model::pose`] plays them.
    pub animations: Vec<Animation>,
    /// What clips move, and how; empty where nothing can move.
    pub rig: Rig,
    /// What was read but not understood, each thing once, in whole sentences.
    pub warnings: Vec<String>,
}

/// A group of meshes that is placed as one.
#[derive(Clone, Debug, Default)]
pub struct Object {
    /// As the file names it; may be empty.
    pub name: String,
    /// Its meshes: `Hit::geom` is an index into this list.
    pub parts: Vec<Part>,
}

/// One mesh of one material. Arrays beside the mesh have one entry a vertex.
#[derive(Clone, Debug, Default)]
pub struct Part {
    /// The triangles.
    pub mesh: Mesh,
    /// Unit normals, if the file has them; otherwise the part is flat-shaded.
    pub normals: Option<Array<[f32; 3]>>,
    /// Unit tangents along +u, and in the last component the sign of the bitangent, as in glTF.
    /// Without them they follow from positions and coordinates.
    pub tangents: Option<Array<[f32; 4]>>,
    /// Sets of texture coordinates; (0, 0) is the upper left corner of a texture.
    pub uvs: Vec<Array<[f32; 2]>>,
    /// Linear colours and alpha that the base colour is multiplied with.
    pub colors: Option<Array<[f32; 4]>>,
    /// Index into [`Model::materials`].
    pub material: usize,
}

/// An object at a place.
#[derive(Clone, Debug)]
pub struct Placement {
    /// Index into [`Model::objects`].
    pub object: usize,
    /// Takes the object's points to the world.
    pub world_from_object: Affine,
}

impl Model {
    /// A model of one object of one part, where it is.
    pub fn of_mesh(name: impl Into<String>, mesh: Mesh, material: Material) -> Self {
        let part = Part::new(mesh, 0);
        Self {
            objects: vec![Object { name: name.into(), parts: vec![part] }],
            placements: vec![Placement { object: 0, world_from_object: Affine::IDENTITY }],
            materials: vec![material],
            ..Self::default()
        }
    }

    /// Triangles that are stored, each once.
    pub fn triangles_stored(&self) -> u64 {
        self.objects.iter().map(Object::triangles).sum()
    }

    /// Triangles that are seen, counted once for each placement.
    pub fn triangles_placed(&self) -> u64 {
        self.placements
            .iter()
            .filter_map(|placement| self.objects.get(placement.object))
            .map(Object::triangles)
            .sum()
    }

    /// Vertices that are stored, each once.
    pub fn vertices_stored(&self) -> u64 {
        let parts = self.objects.iter().flat_map(|object| &object.parts);
        parts.map(|part| part.mesh.positions().len() as u64).sum()
    }
}

impl Part {
    /// A flat-shaded part without textures.
    pub fn new(mesh: Mesh, material: usize) -> Self {
        Self { mesh, material, ..Self::default() }
    }
}

impl Object {
    /// How many triangles its parts have together.
    pub fn triangles(&self) -> u64 {
        self.parts.iter().map(|part| part.mesh.triangles().len() as u64).sum()
    }
}
