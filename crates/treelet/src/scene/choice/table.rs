//! What could be chosen, and what it usually costs. A newcomer is a line here.
//!
//! PROVISIONAL numbers.

/// A way to build, as measured.
#[derive(Clone, Copy, Debug)]
pub(in crate::scene) struct Contender {
    /// The name of a [`Recipe`](super::super::Recipe).
    pub(in crate::scene) name: &'static str,
    /// Nanoseconds a primitive to build its tree and to pack it, on one thread.
    pub(in crate::scene) build_ns: f64,
    /// How much longer a ray takes than in the best of these trees.
    pub(in crate::scene) slowness: f64,
}

const fn line(name: &'static str, build_ns: f64, slowness: f64) -> Contender {
    Contender { name, build_ns, slowness }
}

/// Cheapest build first.
pub(in crate::scene) const CONTENDERS: &[Contender] = &[
    line("fastest", 120.0, 1.35),
    line("fast", 180.0, 1.22),
    line("default", 500.0, 1.06),
    line("high", 900.0, 1.03),
    line("best", 2000.0, 1.0),
];

/// A ray in the best of trees, on one thread: it lies in 60 to 1500 ns.
pub(in crate::scene) const RAY_NS: f64 = 200.0;
