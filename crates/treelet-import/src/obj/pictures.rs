//! The pictures that materials of a library name.

use std::collections::HashMap;
use std::path::PathBuf;

use treelet_model::texture::{ColorSpace, UvTransform, Wrap};
use treelet_model::{AlphaMode, Image, Material, Texture};

use crate::error::{Place, Result, counted};
use crate::picture;
use crate::source::Source;

use super::mtl::{Map, Named, Slot};

/// Pictures, each read once.
#[derive(Debug, Default)]
pub(super) struct Pictures {
    pub(super) images: Vec<Image>,
    known: HashMap<PathBuf, Option<usize>>,
    missing: u64,
    /// What is wrong with the first that is missing.
    first_missing: Option<String>,
}

impl Pictures {
    /// A material with its pictures; those that cannot be read are counted.
    pub(super) fn cover(
        &mut self,
        source: &Source<'_>,
        folder: &str,
        named: Named,
    ) -> Result<Material> {
        let Named { mut material, maps } = named;
        for (slot, map) in maps {
            source.check_cancelled()?;
            let Some(image) = self.read(source, folder, &map.name)? else { continue };
            let space = match slot {
                Slot::BaseColor | Slot::Emission => ColorSpace::Srgb,
                Slot::Opacity | Slot::Normal => ColorSpace::Linear,
            };
            let texture = Some(place(image, &map, space));
            match slot {
                Slot::BaseColor => material.base_color_texture = texture,
                Slot::Emission => material.emission_texture = texture,
                Slot::Normal => material.normal_texture = texture,
                Slot::Opacity => {
                    material.alpha = AlphaMode::Blend;
                    // The colour's own picture means its alpha, which counts by itself.
                    let color = material.base_color_texture.map(|texture| texture.image);
                    if color != Some(image) {
                        material.opacity_texture = texture;
                    }
                }
            }
        }
        Ok(material)
    }

    /// Reads a picture beside the library, or, where its path leads elsewhere, beside the scene.
    fn read(&mut self, source: &Source<'_>, folder: &str, name: &str) -> Result<Option<usize>> {
        let spelled = if folder.is_empty() { name.to_owned() } else { format!("{folder}/{name}") };
        let file = name.rsplit(['/', '\\']).next().unwrap_or(name);
        let found = source.find(&Place::File, &spelled);
        let found = found.or_else(|error| source.find(&Place::File, file).map_err(|_| error));
        let side = match found {
            Ok(side) => side,
            Err(error) => {
                self.miss(error.fault.to_string());
                return Ok(None);
            }
        };
        if let Some(&known) = self.known.get(&side.real) {
            return Ok(known);
        }
        let bytes = source.read_side(&side)?;
        let image = match picture::decode(source, &bytes, name)? {
            Ok(image) => {
                source.push(&mut self.images, image, "pictures")?;
                Some(self.images.len() - 1)
            }
            Err(reason) => {
                self.miss(reason);
                None
            }
        };
        self.known.insert(side.real, image);
        Ok(image)
    }

    fn miss(&mut self, reason: String) {
        self.missing += 1;
        self.first_missing.get_or_insert(reason);
    }

    /// What could not be read.
    pub(super) fn warning(&self) -> Option<String> {
        let first = self.first_missing.as_ref()?;
        let pictures = counted(self.missing, "picture is", "pictures are");
        Some(format!("{pictures} not read, the first because: {first}."))
    }
}

/// Where a picture lies: MTL counts v from below, parts from above.
fn place(image: usize, map: &Map, space: ColorSpace) -> Texture {
    let Map { scale: [u, v], offset: [du, dv], is_clamped, .. } = *map;
    let mut texture = Texture::new(image, space);
    texture.transform = UvTransform { offset: [du, 1.0 - v - dv], rotation: 0.0, scale: [u, v] };
    texture.wrap = [if is_clamped { Wrap::Clamp } else { Wrap::Repeat }; 2];
    texture
}
