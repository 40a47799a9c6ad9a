//! An Embree device: so many threads, an instruction set, and a count of its memory.

use std::ffi::{CString, c_void};
use std::sync::atomic::{AtomicI64, Ordering};

use super::interface::{Functions, Handle, PROPERTY_VERSION_MAJOR};
use crate::engine::EngineError;

/// A device with its memory counter.
pub(super) struct Device {
    pub(super) functions: Functions,
    pub(super) handle: Handle,
    /// Bytes that the device's scenes hold now. Boxed: Embree keeps its address.
    bytes: Box<AtomicI64>,
}

// SAFETY: Embree's devices may be used from every thread (its manual, "Embree API"); the counter is
// atomic.
unsafe impl Send for Device {}
// SAFETY: as above.
unsafe impl Sync for Device {}

/// Adds what Embree allocates and frees.
extern "C" fn count(counter: *mut c_void, bytes: isize, _post: bool) -> bool {
    // SAFETY: the pointer is that of the device's boxed counter, which outlives the device.
    let counter = unsafe { &*counter.cast::<AtomicI64>() };
    counter.fetch_add(bytes as i64, Ordering::Relaxed);
    true
}

impl Device {
    /// A device with that configuration.
    pub(super) fn new(functions: Functions, configuration: &str) -> Result<Self, EngineError> {
        let bytes = Box::new(AtomicI64::new(0));
        let text = CString::new(configuration)
            .map_err(|_| EngineError::Refused("a NUL in Embree's configuration".into()))?;
        // SAFETY: the text is NUL-terminated and lives through the call.
        let handle = unsafe { (functions.new_device)(text.as_ptr()) };
        if handle.is_null() {
            // SAFETY: a null device asks for the error of this thread.
            let error = unsafe { (functions.device_error)(std::ptr::null_mut()) };
            let what = format!("Embree refuses the device `{configuration}` (error {error})");
            return Err(EngineError::Refused(what));
        }
        let device = Self { functions, handle, bytes };
        let counter: *const AtomicI64 = &*device.bytes;
        // SAFETY: the counter is boxed and lives until the device is released.
        unsafe {
            (functions.set_memory_monitor)(handle, Some(count), counter.cast_mut().cast());
        }
        Ok(device)
    }

    /// Bytes that its scenes hold.
    pub(super) fn bytes(&self) -> i64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// The error since the last call, if there is one.
    pub(super) fn check(&self, what: &str) -> Result<(), EngineError> {
        // SAFETY: the handle is a live device.
        match unsafe { (self.functions.device_error)(self.handle) } {
            0 => Ok(()),
            error => Err(EngineError::Refused(format!("Embree: {what}: error {error}"))),
        }
    }

    /// `4.4.0`.
    pub(super) fn version(&self) -> String {
        let part = |index| {
            // SAFETY: the handle is a live device; the three properties follow each other.
            unsafe { (self.functions.device_property)(self.handle, PROPERTY_VERSION_MAJOR + index) }
        };
        format!("{}.{}.{}", part(0), part(1), part(2))
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: the handle is live and released once; scenes hold references of their own.
        unsafe {
            (self.functions.set_memory_monitor)(self.handle, None, std::ptr::null_mut());
            (self.functions.release_device)(self.handle);
        }
    }
}

/// The instruction set that a device of that configuration chooses, as the device says itself when
/// it is told to be verbose; `None` where it does not say.
///
/// It says so on stdout, which is turned into a file for as long as that takes.
pub(super) fn instruction_set(functions: Functions, configuration: &str) -> Option<String> {
    let text = spoken(|| drop(Device::new(functions, &format!("{configuration},verbose=1"))))?;
    chosen_target(&text)
}

/// Of the targets that the configured processor supports, the last that the library was compiled
/// for: both lists rise, and that is the one Embree takes.
fn chosen_target(text: &str) -> Option<String> {
    let (_, configuration) = text.split_once("Config")?;
    let mut lines = configuration.lines().skip_while(|line| !line.trim().starts_with("Targets"));
    let supported: Vec<&str> = lines.next()?.split_once(':')?.1.split_whitespace().collect();
    let compiled = lines.next()?.split_once('(')?.0;
    compiled.split_whitespace().rfind(|target| supported.contains(target)).map(str::to_owned)
}

/// What `work` prints on stdout.
#[cfg(target_os = "linux")]
fn spoken(work: impl FnOnce()) -> Option<String> {
    use std::io::{Read as _, Seek as _, Write as _};
    let file = nix::sys::memfd::memfd_create(c"embree", nix::sys::memfd::MFdFlags::empty()).ok()?;
    let mut file = std::fs::File::from(file);
    std::io::stdout().flush().ok()?;
    flush_c();
    let kept = nix::unistd::dup(std::io::stdout()).ok()?;
    nix::unistd::dup2_stdout(&file).ok()?;
    work();
    flush_c();
    nix::unistd::dup2_stdout(&kept).ok()?;
    let mut text = String::new();
    file.rewind().ok()?;
    file.read_to_string(&mut text).ok()?;
    Some(text)
}

/// What `work` prints on stdout: not known here.
#[cfg(not(target_os = "linux"))]
fn spoken(_: impl FnOnce()) -> Option<String> {
    None
}

/// Writes out what C's streams hold back.
#[cfg(target_os = "linux")]
fn flush_c() {
    let this: libloading::Library = libloading::os::unix::Library::this().into();
    // SAFETY: `fflush` takes a stream or null for all of them.
    let flush =
        unsafe { this.get::<unsafe extern "C" fn(*mut c_void) -> std::ffi::c_int>(b"fflush") };
    if let Ok(flush) = flush {
        // SAFETY: as above.
        unsafe { flush(std::ptr::null_mut()) };
    }
}

#[cfg(test)]
mod tests {
    use super::chosen_target;

    #[test]
    fn the_best_of_what_is_supported_and_compiled_is_chosen() {
        let text = |supported: &str| {
            format!(
                "Embree\n  CPU\n   Targets  : SSE AVX AVX2 AVX512 \n  Config\n    Threads : 1\n    \
                 ISA     : XMM YMM\n    Targets : {supported}  (supported)\n              \
                 SSE2 SSE4.2 AVX AVX2 AVX512  (compile time enabled)\n"
            )
        };
        let chosen = |supported| chosen_target(&text(supported));
        assert_eq!(chosen("SSE2 SSE4.2 AVX AVXI AVX2 AVX512").as_deref(), Some("AVX512"));
        assert_eq!(chosen("SSE2 SSE4.2 AVX AVXI AVX2").as_deref(), Some("AVX2"));
        assert_eq!(chosen("NEON"), None);
        assert_eq!(chosen_target("nothing of the kind"), None);
    }
}
