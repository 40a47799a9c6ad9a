//! Work that somebody may stop, or that takes too long.

use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

use treelet::Cancel;

use crate::run::Watcher;

/// How often somebody looks whether to stop.
const GLANCE: Duration = Duration::from_millis(50);

/// Runs `work` with a flag that is raised when the watcher wants to stop, or after `limit`.
pub(super) fn watched<R>(
    watcher: &dyn Watcher,
    limit: Duration,
    work: impl FnOnce(&Cancel) -> R,
) -> R {
    let cancel = Cancel::new();
    let flag = cancel.clone();
    let (done, waiting) = mpsc::channel::<()>();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            let start = Instant::now();
            // The channel closes when the work has ended.
            while waiting.recv_timeout(GLANCE) == Err(RecvTimeoutError::Timeout) {
                if watcher.stopped() || start.elapsed() > limit {
                    flag.cancel();
                }
            }
        });
        let result = work(&cancel);
        drop(done);
        result
    })
}

#[cfg(test)]
mod tests {
    use super::{Duration, Instant, Watcher, watched};

    struct Patient(bool);

    impl Watcher for Patient {
        fn step(&self, _: &str) {}
        fn stopped(&self) -> bool {
            self.0
        }
    }

    #[test]
    fn work_is_stopped_by_time_and_by_people() {
        for (stopped, limit) in [(false, Duration::ZERO), (true, Duration::from_secs(60))] {
            let start = Instant::now();
            let cancelled = watched(&Patient(stopped), limit, |cancel| {
                while !cancel.is_cancelled() && start.elapsed().as_secs() < 20 {
                    std::thread::yield_now();
                }
                cancel.is_cancelled()
            });
            assert!(cancelled);
        }
        assert_eq!(watched(&Patient(false), Duration::from_secs(60), |_| 7), 7);
    }
}
