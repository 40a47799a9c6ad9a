//! From a scene to a picture: a path tracer over [`treelet`]'s queries, and maps of what the tree did.
//!
//! A [`Renderer`] takes a [`treelet_model::Model`], the scene built from it and a camera; each
//! [`Renderer::pass`] adds one sample a pixel to a [`Film`]; [`Film::to_image`] shows what is there so
//! far. Nothing here prints or starts a thread of its own, and the clock is asked only for the
//! report of a pass: passes run on the caller's rayon pool. The picture is a pure function of model, camera and settings, bit for bit,
//! for any number of threads: all maths functions are `libm`'s.

mod alias;
pub mod aov;
mod bsdf;
mod camera;
mod color;
pub mod compare;
pub mod denoise;
mod error;
pub mod exr;
pub mod film;
pub mod filter;
mod font;
mod frame;
mod heat;
pub mod image;
mod integrator;
pub mod layers;
mod light;
mod map;
mod material;
mod outside;
mod path;
mod renderer;
pub mod sampler;
mod settings;
pub mod sky;
mod surface;
mod texture;
pub mod tonemap;
mod trig;
mod vertex;
mod wave;

pub use aov::Aov;
pub use denoise::denoise;
pub use error::RenderError;
pub use exr::{encode_exr, encode_hdr};
pub use film::Film;
pub use heat::{HEAT, heat_color};
pub use image::Image;
pub use layers::Layers;
pub use renderer::{PassStats, Renderer};
pub use settings::{Settings, Strategy};
pub use sky::default_sky;
pub use tonemap::ToneMap;
