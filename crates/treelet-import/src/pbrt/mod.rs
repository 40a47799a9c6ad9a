//! pbrt version 4, with the names of version 3 where only names differ.
//!
//! After the format description of M. Pharr, W. Jakob and G. Humphreys, "pbrt-v4 Input File Format".
//! A file is a list of directives, read one after the other; `Include` and `Import` are read in
//! their place. All shapes outside `ObjectBegin` become parts of one object, in the world's
//! coordinates; each object that is defined becomes one, and its instances placements. Full spheres
//! outside objects share one mesh a material.
//!
//! What the model has no word for is put into its nearest, or left out; either is a warning that
//! counts the cases. Unknown directives are stepped over up to the next one.
//!
//! pbrt's space is left-handed. Coordinates stay as they are, so the matrix of a camera may mirror;
//! then pictures come out as pbrt shows them.

mod camera;
mod directives;
mod lights;
mod materials;
mod notes;
mod params;
mod quadrics;
mod scene;
mod shapes;
mod spectrum;
mod textures;
mod tokens;
mod transform;

use treelet_model::Model;

use crate::catalogue::{Importer, Info};
use crate::error::Result;
use crate::source::Source;
use crate::text;

use tokens::{Token, Tokens};

/// The format, as the catalogue names it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pbrt;

/// Directives that files start with.
const FIRST: [&[u8]; 17] = [
    b"LookAt",
    b"Film",
    b"Camera",
    b"Integrator",
    b"Sampler",
    b"WorldBegin",
    b"Scale",
    b"Rotate",
    b"Translate",
    b"Transform",
    b"ConcatTransform",
    b"PixelFilter",
    b"Option",
    b"ColorSpace",
    b"AttributeBegin",
    b"Accelerator",
    b"Shape",
];

impl Importer for Pbrt {
    fn info(&self) -> Info {
        Info {
            name: "pbrt",
            extensions: &["pbrt"],
            summary: "pbrt v4: meshes, quadrics, instances, cameras, materials, textures, lights",
        }
    }

    fn sniff(&self, bytes: &[u8]) -> bool {
        let head = &bytes[..bytes.len().min(LOOKED_AT)];
        matches!(Tokens::new(head).next(), Ok(Some(Token::Word(word))) if FIRST.contains(&word))
    }

    fn read(&self, source: &Source<'_>) -> Result<Model> {
        source.whole(text::refuse_utf16(source.bytes))?;
        let mut scene = scene::Scene::new(source);
        scene.run(source, 0)?;
        scene.finish()
    }
}

/// How far into a file its first directive is looked for.
const LOOKED_AT: usize = 1 << 14;
