//! Threads that stay on their processors, and their clocks.

use std::time::{Duration, Instant};

use rayon::{ThreadPool, ThreadPoolBuilder};

/// Which clock times are read from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// The one on the wall.
    Wall,
    /// The time that processors spent on this work: steadier where other programs are busy. With
    /// more than one thread it cannot show what users wait for, so the wall's is taken there.
    Processor,
}

/// Why there is no crew.
#[derive(Debug, thiserror::Error)]
pub enum CrewError {
    /// More threads than processors: nothing that could be pinned.
    #[error(
        "{wanted} threads asked for, {there} processors there; give --threads {there} or fewer"
    )]
    TooFew {
        /// Threads asked for.
        wanted: usize,
        /// Processors that the program may use.
        there: usize,
    },
    /// The threads could not be started.
    #[error(transparent)]
    Pool(#[from] rayon::ThreadPoolBuildError),
}

/// A pool of threads, each pinned to a processor of its own where the system can.
pub struct Crew {
    pool: ThreadPool,
    processors: Vec<usize>,
    clock: Clock,
}

impl Crew {
    /// A crew on the last of the processors that the program may use: the first ones serve
    /// interrupts.
    ///
    /// # Errors
    ///
    /// There are fewer processors than that.
    pub fn new(threads: usize, clock: Clock) -> Result<Self, CrewError> {
        let mut there = processors();
        if there.len() < threads {
            return Err(CrewError::TooFew { wanted: threads, there: there.len() });
        }
        let processors = there.split_off(there.len() - threads);
        let pinned = processors.clone();
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads)
            .start_handler(move |index| pin(&pinned[index..=index]))
            .build()?;
        let clock = if threads == 1 { clock } else { Clock::Wall };
        Ok(Self { pool, processors, clock })
    }

    /// How many threads.
    pub fn threads(&self) -> usize {
        self.processors.len()
    }

    /// Where they are.
    pub fn processors(&self) -> &[usize] {
        &self.processors
    }

    /// The clock that this crew is timed with.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// Runs `work` on the pool.
    pub fn install<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        self.pool.install(work)
    }

    /// Runs `work` on a thread that may use all of the crew's processors, as do the threads that it
    /// starts.
    pub fn at_large<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        std::thread::scope(|scope| {
            let thread = scope.spawn(|| {
                pin(&self.processors);
                work()
            });
            match thread.join() {
                Ok(result) => result,
                Err(panic) => std::panic::resume_unwind(panic),
            }
        })
    }

    /// How long `work` takes, started by one of the pool's threads; it may share itself out to the
    /// others.
    pub fn time_shared(&self, work: impl FnOnce() + Send) -> Duration {
        self.install(|| match self.clock {
            Clock::Wall => {
                let start = Instant::now();
                work();
                start.elapsed()
            }
            Clock::Processor => {
                let start = thread_time();
                work();
                thread_time().saturating_sub(start)
            }
        })
    }

    /// How long it takes until every thread has done its part of `work`.
    pub fn time(&self, work: impl Fn() + Sync) -> Duration {
        match self.clock {
            Clock::Wall => {
                let start = Instant::now();
                self.pool.broadcast(|_| work());
                start.elapsed()
            }
            Clock::Processor => {
                let times = self.pool.broadcast(|_| {
                    let start = thread_time();
                    work();
                    thread_time().saturating_sub(start)
                });
                times.into_iter().max().unwrap_or_default()
            }
        }
    }
}

/// A stopwatch for work on threads that the bench does not know.
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch {
    wall: Instant,
    processor: Option<Duration>,
}

impl Stopwatch {
    /// Starts at zero.
    pub fn start(clock: Clock) -> Self {
        let processor = if clock == Clock::Processor { process_time() } else { None };
        Self { wall: Instant::now(), processor }
    }

    /// The time since then: that of all of the program's threads together, or the wall's.
    pub fn elapsed(&self) -> Duration {
        match (self.processor, process_time()) {
            (Some(start), Some(now)) => now.saturating_sub(start),
            _ => self.wall.elapsed(),
        }
    }
}

/// Forbids this program transparent huge pages, whoever asks for them; whether that worked.
pub fn forbid_huge_pages() -> bool {
    #[cfg(target_os = "linux")]
    return nix::sys::prctl::set_thp_disable(true).is_ok();
    #[cfg(not(target_os = "linux"))]
    return false;
}

/// The processors that this program may use, in order.
#[cfg(target_os = "linux")]
fn processors() -> Vec<usize> {
    use nix::sched::{CpuSet, sched_getaffinity};
    use nix::unistd::Pid;
    let all = sched_getaffinity(Pid::from_raw(0)).map(|set| {
        (0..CpuSet::count()).filter(|&cpu| set.is_set(cpu).unwrap_or(false)).collect::<Vec<_>>()
    });
    all.unwrap_or_else(|_| (0..available()).collect())
}

/// The processors, numbered.
#[cfg(not(target_os = "linux"))]
fn processors() -> Vec<usize> {
    (0..available()).collect()
}

fn available() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Keeps the calling thread on these processors; where the system refuses, it goes where it likes.
#[cfg(target_os = "linux")]
fn pin(processors: &[usize]) {
    use nix::sched::{CpuSet, sched_setaffinity};
    let mut set = CpuSet::new();
    if processors.iter().all(|&cpu| set.set(cpu).is_ok()) {
        let _ = sched_setaffinity(nix::unistd::Pid::from_raw(0), &set);
    }
}

#[cfg(not(target_os = "linux"))]
fn pin(_: &[usize]) {}

/// Processor time of the calling thread.
#[cfg(target_os = "linux")]
fn thread_time() -> Duration {
    let time = nix::time::clock_gettime(nix::time::ClockId::CLOCK_THREAD_CPUTIME_ID);
    time.map(Duration::from).unwrap_or_default()
}

/// Processor time of the whole program.
#[cfg(target_os = "linux")]
fn process_time() -> Option<Duration> {
    let time = nix::time::clock_gettime(nix::time::ClockId::CLOCK_PROCESS_CPUTIME_ID);
    time.map(Duration::from).ok()
}

/// The wall's time, for want of a better clock.
#[cfg(not(target_os = "linux"))]
fn thread_time() -> Duration {
    use std::sync::OnceLock;
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed()
}

#[cfg(not(target_os = "linux"))]
fn process_time() -> Option<Duration> {
    None
}

#[cfg(test)]
mod tests {
    use super::{Clock, Crew, CrewError};
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn every_thread_works_and_time_passes() {
        let crew = Crew::new(1, Clock::Processor).unwrap();
        let runs = AtomicUsize::new(0);
        let time = crew.time(|| {
            runs.fetch_add(1, Ordering::Relaxed);
            let sum = (0..2_000_000_u64).fold(0, |sum, i| sum ^ std::hint::black_box(i));
            std::hint::black_box(sum);
        });
        assert_eq!(runs.into_inner(), 1);
        assert!(time.as_nanos() > 100_000, "{time:?}");
    }

    #[test]
    fn more_threads_than_processors_is_an_error() {
        assert!(matches!(Crew::new(100_000, Clock::Wall), Err(CrewError::TooFew { .. })));
    }
}
