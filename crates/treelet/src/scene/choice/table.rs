//! What could be chosen, and what it usually costs. A newcomer is a line here.
//!
//! Measured with `treelet bench SCENE --builders NAMES --kinds primary,occlusion,diffuse --order given --rays 131072
//! --rounds 3 --threads 1` on eight scenes of 0.2 to 1.4 million triangles (a kitchen, a car, a courtyard, fur, a
//! cave, a coffee maker, terrain, a turbine blade), on one core of an AMD EPYC (Zen 5) at AVX-512 while its
//! neighbour was busy: geometric means, over scenes for builds and over scenes and kinds for rays.
//! The builds of all but the last two lines were measured again, in five rounds on four of the scenes (kitchen, car, coffee
//! maker, fur), when quick builds had become quicker.
//! What does not go faster on more threads: from builds of the coffee maker on one and on two threads.
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
    /// Standard deviation of that from scene to scene, of its logarithm; that of two measurements of the same
    /// (0.035) taken off.
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
    line("fastest",                          86.0, 0.25, 1.249, 0.103),
    line("fast",                             98.0, 0.25, 1.158, 0.077),
    line("hploc+top-reinsertion",           144.0, 0.10, 1.068, 0.060),
    line("binned-sah",                      176.0, 0.10, 1.028, 0.054),
    line(REFERENCE,                         184.0, 0.20, 1.000, 0.015),
    line("hploc+reinsertion",               217.0, 0.10, 1.051, 0.057),
    line("high",                            234.0, 0.20, 1.014, 0.015),
    line("aac+reinsertion",                 271.0, 0.10, 1.076, 0.058),
    line("presplit+binned-sah+reinsertion", 528.0, 0.10, 1.144, 0.101),
    line("best",                            593.0, 0.10, 0.988, 0.015),
    line("sweep-sah+reinsertion",          1256.0, 0.10, 0.992, 0.042),
    line("sbvh+reinsertion",               3314.0, 0.10, 1.016, 0.037),
];

/// Whose rays the others' are compared with.
pub(in crate::scene) const REFERENCE: &str = "default";

/// A ray in the reference's tree, on one thread, in nanoseconds: the geometric mean over scenes and kinds.
pub(in crate::scene) const RAY_NS: f64 = 140.0;

/// Standard deviation of the logarithm of that: from 40 to 1200 ns.
pub(in crate::scene) const RAY_SPREAD: f64 = 0.9;
