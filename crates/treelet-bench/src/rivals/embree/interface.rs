//! Embree 4's C interface, as far as the bench calls it: our own declarations.
//!
//! Layouts and values follow the documentation of Embree 4.4, with geometry instance arrays enabled
//! (its default): hits then end with `instPrimID`. A library built without them writes less, so the
//! larger structures serve both.

use std::ffi::{c_char, c_int, c_uint, c_void};

/// `RTCDevice`, `RTCScene`, `RTCGeometry`: pointers that only Embree follows.
pub(super) type Handle = *mut c_void;

/// `RTC_INVALID_GEOMETRY_ID`.
pub(super) const INVALID_ID: u32 = u32::MAX;

/// `RTC_GEOMETRY_TYPE_TRIANGLE`.
pub(super) const GEOMETRY_TRIANGLE: c_int = 0;
/// `RTC_GEOMETRY_TYPE_INSTANCE`.
pub(super) const GEOMETRY_INSTANCE: c_int = 121;
/// `RTC_FORMAT_FLOAT3X4_ROW_MAJOR`: an affine map, row by row.
pub(super) const FORMAT_ROWS: c_int = 0x9134;
/// `RTC_BUFFER_TYPE_INDEX`.
pub(super) const BUFFER_INDEX: c_int = 0;
/// `RTC_BUFFER_TYPE_VERTEX`.
pub(super) const BUFFER_VERTEX: c_int = 1;
/// `RTC_FORMAT_UINT3`.
pub(super) const FORMAT_UINT3: c_int = 0x5003;
/// `RTC_FORMAT_FLOAT3`.
pub(super) const FORMAT_FLOAT3: c_int = 0x9003;
/// `RTC_SCENE_FLAG_NONE`.
pub(super) const SCENE_NONE: c_int = 0;
/// `RTC_SCENE_FLAG_COMPACT`.
pub(super) const SCENE_COMPACT: c_int = 1 << 1;
/// `RTC_SCENE_FLAG_ROBUST`.
pub(super) const SCENE_ROBUST: c_int = 1 << 2;
/// `RTC_DEVICE_PROPERTY_VERSION_MAJOR`; minor and patch follow.
pub(super) const PROPERTY_VERSION_MAJOR: c_int = 1;
/// `RTC_RAY_QUERY_FLAG_INCOHERENT`.
pub(super) const QUERY_INCOHERENT: c_int = 0;
/// `RTC_RAY_QUERY_FLAG_COHERENT`.
pub(super) const QUERY_COHERENT: c_int = 1 << 16;

/// `RTCIntersectArguments` and `RTCOccludedArguments`: the same fields.
#[repr(C)]
pub(super) struct Arguments {
    pub(super) flags: c_int,
    pub(super) feature_mask: c_uint,
    pub(super) context: *mut c_void,
    pub(super) filter: *mut c_void,
    pub(super) intersect: *mut c_void,
    /// Only there in some builds; spare bytes in others.
    pub(super) min_width_distance_factor: f32,
}

impl Arguments {
    /// What `rtcInitIntersectArguments` sets, with a hint about the rays.
    pub(super) fn new(coherent: bool) -> Self {
        Self {
            flags: if coherent { QUERY_COHERENT } else { QUERY_INCOHERENT },
            // RTC_FEATURE_FLAG_ALL.
            feature_mask: u32::MAX,
            context: std::ptr::null_mut(),
            filter: std::ptr::null_mut(),
            intersect: std::ptr::null_mut(),
            min_width_distance_factor: 0.0,
        }
    }
}

/// Declares `RTCRay`/`RTCHit`/`RTCRayHit` for a packet of `$width` rays.
macro_rules! packet {
    ($ray:ident $hit:ident $ray_hit:ident, $width:literal, $align:literal) => {
        /// Rays.
        #[repr(C, align($align))]
        #[derive(Clone, Copy)]
        pub(super) struct $ray {
            pub(super) origin: [[f32; $width]; 3],
            pub(super) t_near: [f32; $width],
            pub(super) direction: [[f32; $width]; 3],
            pub(super) time: [f32; $width],
            pub(super) t_far: [f32; $width],
            pub(super) mask: [u32; $width],
            pub(super) id: [u32; $width],
            pub(super) flags: [u32; $width],
        }

        /// Hits.
        #[repr(C, align($align))]
        #[derive(Clone, Copy)]
        pub(super) struct $hit {
            pub(super) normal: [[f32; $width]; 3],
            pub(super) u: [f32; $width],
            pub(super) v: [f32; $width],
            pub(super) prim: [u32; $width],
            pub(super) geom: [u32; $width],
            pub(super) inst: [u32; $width],
            pub(super) inst_prim: [u32; $width],
        }

        /// Rays and their hits.
        #[repr(C, align($align))]
        #[derive(Clone, Copy)]
        pub(super) struct $ray_hit {
            pub(super) ray: $ray,
            pub(super) hit: $hit,
        }

        const _: () = assert!(size_of::<$ray>() == 48 * $width);
    };
}

packet!(Ray1 Hit1 RayHit1, 1, 16);
packet!(Ray8 Hit8 RayHit8, 8, 32);
packet!(Ray16 Hit16 RayHit16, 16, 64);

/// `RTCMemoryMonitorFunction`.
pub(super) type MemoryMonitor = extern "C" fn(*mut c_void, isize, bool) -> bool;

/// Declares the table of functions, and how it is read from a library.
macro_rules! functions {
    ($($field:ident $symbol:literal: fn($($argument:ty),*) $(-> $result:ty)?;)*) => {
        /// Embree's functions; valid as long as the library is loaded, which is for ever.
        #[derive(Clone, Copy)]
        pub(super) struct Functions {
            $(pub(super) $field: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
        }

        impl Functions {
            /// Reads every symbol.
            pub(super) fn of(library: &libloading::Library) -> Result<Self, libloading::Error> {
                $(
                    // SAFETY: the type is that of Embree 4's documentation for this symbol; the
                    // caller never unloads the library, so the copied pointer stays valid.
                    let $field = *unsafe {
                        library.get::<unsafe extern "C" fn($($argument),*) $(-> $result)?>(
                            $symbol.as_bytes(),
                        )
                    }?;
                )*
                Ok(Self { $($field,)* })
            }
        }
    };
}

functions! {
    new_device "rtcNewDevice": fn(*const c_char) -> Handle;
    release_device "rtcReleaseDevice": fn(Handle);
    device_property "rtcGetDeviceProperty": fn(Handle, c_int) -> isize;
    device_error "rtcGetDeviceError": fn(Handle) -> c_int;
    set_memory_monitor "rtcSetDeviceMemoryMonitorFunction":
        fn(Handle, Option<MemoryMonitor>, *mut c_void);
    new_geometry "rtcNewGeometry": fn(Handle, c_int) -> Handle;
    release_geometry "rtcReleaseGeometry": fn(Handle);
    commit_geometry "rtcCommitGeometry": fn(Handle);
    set_geometry_quality "rtcSetGeometryBuildQuality": fn(Handle, c_int);
    set_time_steps "rtcSetGeometryTimeStepCount": fn(Handle, c_uint);
    set_shared_buffer "rtcSetSharedGeometryBuffer":
        fn(Handle, c_int, c_uint, c_int, *const c_void, usize, usize, usize);
    set_instanced_scene "rtcSetGeometryInstancedScene": fn(Handle, Handle);
    set_transform "rtcSetGeometryTransform": fn(Handle, c_uint, c_int, *const c_void);
    new_scene "rtcNewScene": fn(Handle) -> Handle;
    release_scene "rtcReleaseScene": fn(Handle);
    attach_geometry "rtcAttachGeometry": fn(Handle, Handle) -> c_uint;
    set_scene_quality "rtcSetSceneBuildQuality": fn(Handle, c_int);
    set_scene_flags "rtcSetSceneFlags": fn(Handle, c_int);
    commit_scene "rtcCommitScene": fn(Handle);
    intersect1 "rtcIntersect1": fn(Handle, *mut RayHit1, *mut Arguments);
    occluded1 "rtcOccluded1": fn(Handle, *mut Ray1, *mut Arguments);
    intersect8 "rtcIntersect8": fn(*const c_int, Handle, *mut RayHit8, *mut Arguments);
    occluded8 "rtcOccluded8": fn(*const c_int, Handle, *mut Ray8, *mut Arguments);
    intersect16 "rtcIntersect16": fn(*const c_int, Handle, *mut RayHit16, *mut Arguments);
    occluded16 "rtcOccluded16": fn(*const c_int, Handle, *mut Ray16, *mut Arguments);
}
