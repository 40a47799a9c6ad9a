//! The most memory that a build takes, every mapping included, whoever made it.
//!
//! Counted by the system, as the high-water mark of resident pages, in a process of its own that
//! does nothing else: Rust's allocators, C++ ones and mappings by hand are all seen alike, and
//! timings elsewhere are not disturbed, as they would be by an allocator that counts. Huge pages are
//! forbidden there and large blocks go back to the system as soon as they are freed, so that pages
//! are neither counted by the two megabytes nor found lying about. What is off: pages that were
//! asked for and never touched do not count, and the system counts in batches of 64 pages a thread.

use crate::crew::Crew;
use crate::engine::{Engine, EngineError, Threading, Triangles};

/// The environment variable for the process that measures.
pub const VARIABLE: &str = "GLIBC_TUNABLES";
/// What it says to glibc: give blocks from 128 KiB back as soon as they are freed.
pub const TUNABLES: &str = "glibc.malloc.mmap_threshold=131072:glibc.malloc.hugetlb=0";

/// Why there is no number.
#[derive(Debug, thiserror::Error)]
pub enum PeakError {
    /// The system does not tell.
    #[error("the system does not tell the high-water mark of memory: {0}")]
    Untold(&'static str),
    /// The engine does not build.
    #[error(transparent)]
    Engine(#[from] EngineError),
}

/// Bytes that building a variant takes at its peak, above what was there before; the result is part
/// of that, the caller's arrays are not. To be called once in a process made for it.
///
/// # Errors
///
/// The engine refuses, or the system does not tell.
pub fn of_build(
    engine: &dyn Engine,
    variant: &str,
    triangles: &Triangles,
    crew: &Crew,
) -> Result<u64, PeakError> {
    let before = status("VmRSS:").ok_or(PeakError::Untold("no VmRSS"))?;
    // 5: the high-water mark falls to what is resident now (the kernel's proc.rst, clear_refs).
    std::fs::write("/proc/self/clear_refs", "5")
        .map_err(|_| PeakError::Untold("clear_refs cannot be written"))?;
    let work = || engine.build(variant, triangles);
    let built = match engine.threading() {
        Threading::Callers => crew.install(work),
        Threading::Own => crew.at_large(work),
    }?;
    let peak = status("VmHWM:").ok_or(PeakError::Untold("no VmHWM"))?;
    drop(built);
    Ok(peak.saturating_sub(before))
}

/// A size from `/proc/self/status`, in bytes.
fn status(name: &str) -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let rest = text.lines().find_map(|line| line.strip_prefix(name))?;
    let kilobytes: u64 = rest.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(1024 * kilobytes)
}

/// Bytes of memory that programs may still take; `None` where the system does not say.
pub fn free_memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::of_build;
    use crate::crew::{Clock, Crew};
    use crate::engine::{Built, Engine, EngineError, Triangles};
    use crate::rivals::treelet::{Treelet, default_variant};
    use crate::scenes::Generated;

    /// Takes 64 MiB more than treelet for a moment.
    struct Glutton;

    const EXTRA: usize = 64 << 20;

    impl Engine for Glutton {
        fn name(&self) -> &'static str {
            "glutton"
        }
        fn version(&self) -> String {
            String::new()
        }
        fn variants(&self) -> Vec<String> {
            Vec::new()
        }
        fn build(&self, _: &str, triangles: &Triangles) -> Result<Box<dyn Built>, EngineError> {
            std::hint::black_box(vec![1_u8; EXTRA]);
            Treelet.build(default_variant(), triangles)
        }
    }

    /// Other tests run in this process too, so only the order of magnitude is asked.
    #[test]
    fn what_is_taken_for_a_moment_counts() {
        let triangles = Generated::Soup(1_000).triangles();
        let crew = Crew::new(1, Clock::Wall).unwrap();
        let peak = of_build(&Glutton, "", &triangles, &crew).unwrap();
        assert!(peak > EXTRA as u64 / 2, "{peak}");
    }
}
