//! The clock, for reports and for choosing among builders: nothing that decides an answer asks it.

use core::time::Duration;

/// A running stopwatch; it shows zero where there is no clock (`no_std`).
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch {
    #[cfg(feature = "std")]
    start: std::time::Instant,
}

impl Stopwatch {
    /// Starts at zero.
    pub fn start() -> Self {
        Self {
            #[cfg(feature = "std")]
            start: std::time::Instant::now(),
        }
    }

    /// The time since the start.
    pub fn elapsed(&self) -> Duration {
        #[cfg(feature = "std")]
        return self.start.elapsed();
        #[cfg(not(feature = "std"))]
        return Duration::ZERO;
    }
}
