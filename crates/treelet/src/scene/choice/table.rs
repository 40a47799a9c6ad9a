//! What could be chosen, and what it usually costs. A newcomer is a line here.
//!
//! Measured with `treelet bench SCENE --builders NAMES --kinds primary,occlusion,diffuse --order given --rays 131072
//! --rounds 3 --threads 1` on eight scenes of 0.2 to 1.4 million triangles (a kitchen, a car, a courtyard, fur, a
//! cave, a coffee maker, terrain, a turbine blade), on one core of an AMD EPYC (Zen 5) at AVX-512 while its
//! neighbour was busy: geometric means, over scenes for builds and over scenes and kinds for rays.
//! Only proportions matter: what the machine and the scene make of them is measured while a scene is built.
//!
//! Left out because they are behind another line in both numbers, in every scene measured or nearly so: `ploc`
//! (455 ns, 1.10), `aac` (215 ns, 1.12), `hlbvh` (143 ns, 1.15), `sweep-sah` (1188 ns, 1.03), `sbvh` (3265 ns, 1.04),
//! `presplit+hploc` (422 ns, 1.37), `presplit+hploc+reinsertion` (524 ns, 1.29). `trbvh` and `treelets` are left out for what
//! their heads say about patents.

/// A way to build, as measured.
#[derive(Clone, Copy, Debug)]
pub(in crate::scene) struct Contender {
    /// The name of a [`Recipe`](super::super::Recipe).
    pub(in crate::scene) name: &'static str,
    /// Nanoseconds a triangle from mesh to scene, on one thread.
    pub(in crate::scene) build_ns: f64,
    /// Of that, the share that takes as long on any number of threads.
    pub(in crate::scene) serial: f64,
    /// How much longer a ray takes than in the tree of [`REFERENCE`].
    pub(in crate::scene) slowness: f64,
    /// Standard deviation of that from scene to scene, of its logarithm.
    pub(in crate::scene) spread: f64,
}

const fn line(
    name: &'static str,
    build_ns: f64,
    serial: f64,
    slowness: f64,
    spread: f64,
) -> Contender {
    Contender { name, build_ns, serial, slowness, spread }
}

/// Cheapest build first.
#[rustfmt::skip]
pub(in crate::scene) const CONTENDERS: &[Contender] = &[
    //   name                              build  serial slowness spread
    line("fastest",                         109.0, 0.10, 1.249, 0.109),
    line("fast",                            121.0, 0.10, 1.158, 0.085),
    line("hploc+top-reinsertion",           180.0, 0.15, 1.068, 0.069),
    line(REFERENCE,                         211.0, 0.15, 1.000, 0.030),
    line("binned-sah",                      213.0, 0.10, 1.028, 0.064),
    line("high",                            239.0, 0.15, 1.014, 0.034),
    line("hploc+reinsertion",               241.0, 0.15, 1.051, 0.067),
    line("aac+reinsertion",                 298.0, 0.15, 1.076, 0.068),
    line("presplit+binned-sah+reinsertion", 539.0, 0.15, 1.144, 0.107),
    line("best",                            567.0, 0.15, 0.988, 0.036),
    line("sweep-sah+reinsertion",          1256.0, 0.15, 0.992, 0.055),
    line("sbvh+reinsertion",               3314.0, 0.15, 1.016, 0.051),
];

/// Whose rays the others' are compared with.
pub(in crate::scene) const REFERENCE: &str = "default";

/// A ray in the reference's tree, on one thread, in nanoseconds: the geometric mean over scenes and kinds.
pub(in crate::scene) const RAY_NS: f64 = 140.0;

/// Standard deviation of the logarithm of that: from 40 to 1200 ns.
pub(in crate::scene) const RAY_SPREAD: f64 = 0.9;
