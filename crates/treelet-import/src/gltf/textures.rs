//! Textures of glTF: which picture, how it repeats, and where it lies on a surface.

use std::collections::HashMap;
use std::path::PathBuf;

use treelet_model::Texture;
use treelet_model::texture::{ColorSpace, Filtering, UvTransform, Wrap};

use crate::error::{Result, clip, counted};
use crate::picture;
use crate::source::Source;

use super::buffers;
use super::json::{Image, Root, TextureInfo};
use super::views::Views;

/// Pictures that were read, and those that could not be.
#[derive(Debug, Default)]
pub(super) struct Textures {
    /// By image of the file: where it is in the model.
    known: HashMap<usize, Option<usize>>,
    /// Files by path; several images may be one file.
    files: HashMap<PathBuf, Option<usize>>,
    pub(super) images: Vec<treelet_model::Image>,
    missing: u64,
    /// What is wrong with the first that is missing.
    first_missing: Option<String>,
}

/// Values of a sampler.
const NEAREST: u32 = 9728;
const CLAMP_TO_EDGE: u32 = 33071;
const MIRRORED_REPEAT: u32 = 33648;

/// Coordinate sets that are read.
pub(super) const UV_SETS: usize = 4;

impl Textures {
    /// A use of a texture; `None` if its picture is missing, which is a warning.
    pub(super) fn read(
        &mut self,
        source: &Source<'_>,
        root: &Root,
        views: &Views<'_, '_>,
        info: Option<&TextureInfo>,
        color_space: ColorSpace,
    ) -> Result<Option<Texture>> {
        let Some(info) = info else { return Ok(None) };
        let Some(json) = root.textures.get(info.index) else {
            self.miss(format!("texture {} of {} is named", info.index, root.textures.len()));
            return Ok(None);
        };
        let Some(image) = json.source else {
            self.miss(format!(
                "texture {} has no PNG or JPEG picture (KTX2 becomes one by: npx \
                 @gltf-transform/cli ktxdecompress OLD.glb NEW.glb)",
                info.index
            ));
            return Ok(None);
        };
        let image = match self.known.get(&image) {
            Some(&known) => known,
            None => {
                let read = self.image(source, root, views, image)?;
                self.known.insert(image, read);
                read
            }
        };
        let Some(image) = image else { return Ok(None) };

        // Put its use together.
        let mut texture = Texture::new(image, color_space);
        let transform = info.extensions.transform.as_ref();
        let set = transform.and_then(|transform| transform.tex_coord).unwrap_or(info.tex_coord);
        texture.uv_set = set.min(UV_SETS - 1);
        if let Some(transform) = transform {
            texture.transform = UvTransform {
                offset: transform.offset,
                rotation: transform.rotation,
                scale: transform.scale.unwrap_or([1.0; 2]),
            };
        }
        if let Some(sampler) = json.sampler.and_then(|sampler| root.samplers.get(sampler)) {
            let wrap = |wrap: Option<u32>| match wrap {
                Some(CLAMP_TO_EDGE) => Wrap::Clamp,
                Some(MIRRORED_REPEAT) => Wrap::Mirror,
                _ => Wrap::Repeat,
            };
            texture.wrap = [wrap(sampler.wrap_s), wrap(sampler.wrap_t)];
            if sampler.mag_filter == Some(NEAREST) {
                texture.filter = Filtering::Nearest;
            }
        }
        Ok(Some(texture))
    }

    /// Reads a picture out of a view, a data URI or a file.
    fn image(
        &mut self,
        source: &Source<'_>,
        root: &Root,
        views: &Views<'_, '_>,
        index: usize,
    ) -> Result<Option<usize>> {
        source.check_cancelled()?;
        let Some(json) = root.images.get(index) else {
            self.miss(format!("image {index} of {} is named", root.images.len()));
            return Ok(None);
        };
        let place = super::item("image", index, &json.name);
        let read;
        let bytes = match json {
            Image { buffer_view: Some(view), .. } => views.bytes(&place, *view)?,
            Image { uri: Some(uri), .. } if buffers::is_data(uri) => {
                read = buffers::read_data(source, &place, uri)?;
                &read
            }
            Image { uri: Some(uri), .. } => {
                let side = match source.find(&place, &buffers::percent_decoded(uri)) {
                    Ok(side) => side,
                    Err(error) => {
                        self.miss(format!("{place}{}", error.fault));
                        return Ok(None);
                    }
                };
                if let Some(&known) = self.files.get(&side.real) {
                    return Ok(known);
                }
                read = source.read_side(&side)?;
                let made = self.decode(source, &read, json, index)?;
                self.files.insert(side.real, made);
                return Ok(made);
            }
            Image { uri: None, .. } => {
                self.miss(format!("{place}has no bytes"));
                return Ok(None);
            }
        };
        self.decode(source, bytes, json, index)
    }

    fn decode(
        &mut self,
        source: &Source<'_>,
        bytes: &[u8],
        json: &Image,
        index: usize,
    ) -> Result<Option<usize>> {
        let name = match (&json.uri, json.name.as_str()) {
            (Some(uri), "") if !buffers::is_data(uri) => clip(uri),
            (_, "") => format!("image {index}"),
            (_, name) => clip(name),
        };
        match picture::decode(source, bytes, &name)? {
            Ok(image) => {
                source.push(&mut self.images, image, "pictures")?;
                Ok(Some(self.images.len() - 1))
            }
            Err(reason) => {
                self.miss(reason);
                Ok(None)
            }
        }
    }

    fn miss(&mut self, reason: String) {
        self.missing += 1;
        self.first_missing.get_or_insert(reason);
    }

    /// What could not be read.
    pub(super) fn warnings(&self) -> Option<String> {
        let first = self.first_missing.as_ref()?;
        let pictures = counted(self.missing, "picture is", "pictures are");
        Some(format!("{pictures} not read, the first because: {first}."))
    }
}
