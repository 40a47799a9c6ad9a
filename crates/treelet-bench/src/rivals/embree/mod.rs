//! Embree 4, the yardstick: a shared library loaded at run time.
//!
//! Source: I. Wald, S. Woop, C. Benthin, G. S. Johnson, M. Ernst, "Embree: A Kernel Framework for
//! Efficient CPU Ray Tracing", ACM Transactions on Graphics 33(4), 2014; its API by the manual of
//! version 4.4.
//!
//! How it is set up: `threads=N,set_affinity=0`, huge pages as the bench was told, static scenes of
//! one triangle geometry over the caller's own arrays. LOW is asked of scene and geometry (the
//! Morton builder needs both), MEDIUM and HIGH of the scene. Not robust unless the variant says so.
//! Flush-to-zero is left off, as for everybody: setting it, as Embree's manual advises, changed no
//! rate on kitchen_bitterli by more than rounds differ (0.97 to 1.10 in two tries of five rounds).
//!
//! This folder holds the only unsafe code outside the library: a C interface has no other way.
#![allow(unsafe_code, reason = "Embree is a C library; every call of it is unsafe")]

mod device;
mod interface;
mod library;
mod passes;

pub use library::VARIABLE;

use std::path::PathBuf;
use std::sync::Arc;

use device::Device;
use interface::{
    BUFFER_INDEX, BUFFER_VERTEX, FORMAT_FLOAT3, FORMAT_ROWS, FORMAT_UINT3, Functions,
    GEOMETRY_INSTANCE, GEOMETRY_TRIANGLE, Handle, SCENE_COMPACT, SCENE_NONE, SCENE_ROBUST,
};
use treelet::Ray;
use treelet::math::Affine;

use super::treelet::no_object;
use crate::engine::{
    Built, Bytes, Call, Engine, EngineError, Pass, Placed, Question, Threading, Triangles,
};

/// The name in reports.
pub const NAME: &str = "embree";

/// `RTCBuildQuality`, by its place.
const QUALITIES: [&str; 3] = ["LOW", "MEDIUM", "HIGH"];

/// What a variant's name may end with, and the scene flag it stands for.
const FLAVOURS: [(&str, i32); 3] =
    [("", SCENE_NONE), (" robust", SCENE_ROBUST), (" compact", SCENE_COMPACT)];

/// How Embree is wanted.
#[derive(Clone, Debug, Default)]
pub struct Wishes {
    /// The library, or a folder that it is in; `None` looks in the environment and near the program.
    pub library: Option<PathBuf>,
    /// `isa=`: an instruction set instead of Embree's own choice.
    pub isa: Option<String>,
    /// Whether to use huge pages.
    pub huge_pages: bool,
}

/// The engine.
pub struct Embree {
    functions: Functions,
    configuration: String,
    version: String,
    device: Option<Arc<Device>>,
}

impl Embree {
    /// Loads the library and asks it who it is.
    ///
    /// # Errors
    ///
    /// There is no library, it is not Embree 4, or it does not run here.
    pub fn load(wishes: &Wishes) -> Result<Self, EngineError> {
        let (_, functions) = library::load(wishes.library.as_deref())?;
        let mut configuration = format!("set_affinity=0,hugepages={}", u8::from(wishes.huge_pages));
        if let Some(isa) = &wishes.isa {
            configuration += &format!(",isa={isa}");
        }
        let number = Device::new(functions, &format!("threads=1,{configuration}"))?.version();
        let isa = device::instruction_set(functions, &format!("threads=1,{configuration}"));
        let isa = isa.unwrap_or_else(|| "instruction set not told".to_owned());
        let version = format!("{number} ({isa})");
        Ok(Self { functions, configuration, version, device: None })
    }
}

impl Engine for Embree {
    fn name(&self) -> &'static str {
        NAME
    }

    fn version(&self) -> String {
        self.version.clone()
    }

    fn variants(&self) -> Vec<String> {
        let names =
            |(flavour, _): &(&str, i32)| QUALITIES.map(|quality| format!("{quality}{flavour}"));
        FLAVOURS.iter().flat_map(names).collect()
    }

    fn usual_variants(&self) -> Vec<String> {
        QUALITIES.map(str::to_owned).to_vec()
    }

    /// Packets are for the tree that is made to be traced.
    fn is_usual(&self, variant: &str, call: Call) -> bool {
        call == Call::ONE || variant.starts_with("HIGH")
    }

    fn threading(&self) -> Threading {
        Threading::Own
    }

    fn prepare(&mut self, threads: usize) -> Result<(), EngineError> {
        self.device = None;
        let configuration = format!("threads={threads},{}", self.configuration);
        self.device = Some(Arc::new(Device::new(self.functions, &configuration)?));
        Ok(())
    }

    fn build(&self, variant: &str, triangles: &Triangles) -> Result<Box<dyn Built>, EngineError> {
        let (device, manner) = self.ready(variant)?;
        Ok(Box::new(Scene::flat(device, manner, triangles)?))
    }

    fn has_instances(&self) -> bool {
        true
    }

    fn build_placed(&self, variant: &str, placed: &Placed) -> Result<Box<dyn Built>, EngineError> {
        let (device, manner) = self.ready(variant)?;
        Ok(Box::new(Scene::placed(device, manner, placed)?))
    }
}

impl Embree {
    /// The device, and what a variant's name means.
    fn ready(&self, variant: &str) -> Result<(Arc<Device>, Manner), EngineError> {
        let refused = |what: &str| EngineError::Refused(what.to_owned());
        let device = self.device.as_ref().ok_or_else(|| refused("no device was prepared"))?;
        let (quality, flags) =
            parse(variant).ok_or_else(|| refused(&format!("Embree has no variant `{variant}`")))?;
        Ok((Arc::clone(device), Manner { quality, flags }))
    }
}

/// The build quality and scene flags behind a variant's name.
fn parse(variant: &str) -> Option<(i32, i32)> {
    let (quality, rest) = (0..)
        .zip(QUALITIES)
        .find_map(|(value, name)| Some((value, variant.strip_prefix(name)?)))?;
    let flags = FLAVOURS.iter().find(|(name, _)| *name == rest)?.1;
    Some((quality, flags))
}

/// A committed scene.
struct Scene {
    device: Arc<Device>,
    handle: Handle,
    /// Embree reads the arrays whenever it likes.
    kept: Vec<Triangles>,
    bytes: u64,
}

// SAFETY: a committed scene may be traced from every thread (Embree's manual).
unsafe impl Send for Scene {}
// SAFETY: as above.
unsafe impl Sync for Scene {}

/// How scenes are built.
#[derive(Clone, Copy)]
struct Manner {
    quality: i32,
    flags: i32,
}

impl Scene {
    /// Of triangles.
    fn flat(
        device: Arc<Device>,
        manner: Manner,
        triangles: &Triangles,
    ) -> Result<Self, EngineError> {
        let before = device.bytes();
        let geometry = geometry(&device, manner, triangles);
        let handle = committed(&device, manner, &[geometry]);
        Self::checked(device, handle, vec![triangles.clone()], before)
    }

    /// Of instances, over one scene an object.
    fn placed(device: Arc<Device>, manner: Manner, placed: &Placed) -> Result<Self, EngineError> {
        let objects = placed.objects.len();
        if let Some(&(object, _)) = placed.instances.iter().find(|it| it.0 >= objects) {
            return Err(no_object(object, objects));
        }
        let before = device.bytes();
        let of_object =
            |triangles| committed(&device, manner, &[geometry(&device, manner, triangles)]);
        let objects: Vec<Handle> = placed.objects.iter().map(of_object).collect();
        let instance = |(object, map): &(usize, Affine)| instance(&device, objects[*object], map);
        let instances: Vec<Handle> = placed.instances.iter().map(instance).collect();
        let handle = committed(&device, manner, &instances);
        for object in objects {
            // SAFETY: live, and released once; the instances hold references of their own.
            unsafe { (device.functions.release_scene)(object) }
        }
        Self::checked(device, handle, placed.objects.clone(), before)
    }

    /// A scene that Embree does not complain about; `before` is what its device held without it.
    fn checked(
        device: Arc<Device>,
        handle: Handle,
        kept: Vec<Triangles>,
        before: i64,
    ) -> Result<Self, EngineError> {
        let bytes = u64::try_from(device.bytes() - before).unwrap_or(0);
        // Made before the check, so that a refused scene is released too.
        let scene = Self { device, handle, kept, bytes };
        scene.device.check("building")?;
        Ok(scene)
    }
}

/// A geometry of triangles, which must outlive it.
fn geometry(device: &Device, manner: Manner, triangles: &Triangles) -> Handle {
    /// `RTC_BUILD_QUALITY_LOW`.
    const LOW: i32 = 0;
    let functions = device.functions;
    let (positions, indices) = (&triangles.positions, &triangles.indices);
    // SAFETY: all handles are live; the arrays are kept alive by `Scene::kept`, items are 12 bytes
    // apart in both, and Embree reads the last vertex with 16-byte loads only where its manual says
    // that it pads: it asks for that, so the positions that come here have a spare vertex at their
    // end (`Triangles` made by `flatten` and `placed`).
    unsafe {
        let geometry = (functions.new_geometry)(device.handle, GEOMETRY_TRIANGLE);
        let steps = [Some(positions), triangles.later.as_ref()];
        (functions.set_time_steps)(geometry, steps.iter().flatten().count() as u32);
        for (slot, positions) in steps.into_iter().flatten().enumerate() {
            (functions.set_shared_buffer)(
                geometry,
                BUFFER_VERTEX,
                slot as u32,
                FORMAT_FLOAT3,
                positions.as_ptr().cast(),
                0,
                12,
                positions.len(),
            );
        }
        (functions.set_shared_buffer)(
            geometry,
            BUFFER_INDEX,
            0,
            FORMAT_UINT3,
            indices.as_ptr().cast(),
            0,
            12,
            indices.len(),
        );
        if manner.quality == LOW {
            (functions.set_geometry_quality)(geometry, manner.quality);
        }
        (functions.commit_geometry)(geometry);
        geometry
    }
}

/// A geometry that places a scene.
fn instance(device: &Device, scene: Handle, world_from_object: &Affine) -> Handle {
    let functions = device.functions;
    // SAFETY: all handles are live; Embree copies the twelve numbers, which lie row by row.
    unsafe {
        let geometry = (functions.new_geometry)(device.handle, GEOMETRY_INSTANCE);
        (functions.set_instanced_scene)(geometry, scene);
        (functions.set_transform)(geometry, 0, FORMAT_ROWS, world_from_object.0.as_ptr().cast());
        (functions.commit_geometry)(geometry);
        geometry
    }
}

/// A scene of geometries, which it takes over.
fn committed(device: &Device, manner: Manner, geometries: &[Handle]) -> Handle {
    let functions = device.functions;
    // SAFETY: all handles are live; the scene holds a reference to each geometry, so ours are given back.
    unsafe {
        let handle = (functions.new_scene)(device.handle);
        (functions.set_scene_flags)(handle, manner.flags);
        (functions.set_scene_quality)(handle, manner.quality);
        for &geometry in geometries {
            (functions.attach_geometry)(handle, geometry);
            (functions.release_geometry)(geometry);
        }
        (functions.commit_scene)(handle);
        handle
    }
}

impl Drop for Scene {
    fn drop(&mut self) {
        // SAFETY: the handle is live, and no pass borrows the scene any more.
        unsafe { (self.device.functions.release_scene)(self.handle) }
    }
}

impl Built for Scene {
    fn bytes(&self) -> Bytes {
        Bytes { own: self.bytes, shared: self.kept.iter().map(Triangles::bytes).sum() }
    }

    fn calls(&self) -> Vec<Call> {
        let widths = [Call::ONE, Call::packets(8), Call::packets(16)];
        widths.into_iter().chain(widths[1..].iter().map(|call| call.coherent())).collect()
    }

    fn pass<'a>(&'a self, call: Call, question: Question, rays: &'a [Ray]) -> Box<dyn Pass + 'a> {
        passes::pass(self.device.functions, self.handle, call, question, rays)
    }
}

#[cfg(test)]
mod tests {
    use super::{SCENE_COMPACT, SCENE_NONE, SCENE_ROBUST, parse};

    #[test]
    fn variants_have_a_quality_and_perhaps_a_flag() {
        assert_eq!(parse("LOW"), Some((0, SCENE_NONE)));
        assert_eq!(parse("MEDIUM robust"), Some((1, SCENE_ROBUST)));
        assert_eq!(parse("HIGH compact"), Some((2, SCENE_COMPACT)));
        assert_eq!(parse("HIGH fast"), None);
        assert_eq!(parse("binned-sah"), None);
    }
}
