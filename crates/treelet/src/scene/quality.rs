//! Quality levels: named compositions of a builder and optimisers, as data.
//!
//! # What they are made of, and why
//!
//! Times to build and single rays a second, both relative to `default`, on one core of an AMD EPYC (Zen 5) at
//! AVX-512 whose neighbours were busy: geometric means over twelve scenes of 0.08 to 1.6 million triangles; rays over
//! primary, occlusion and diffuse ones, too; in brackets the scenes at the ends. Measured as by `treelet inspect
//! SCENE.. --metrics --trace-time --threads 1 --builders NAMES`, which gives the rows that have names, but
//! with 16,384 rays and five rounds.
//!
//! | | build | rays a second |
//! |---|---|---|
//! | `fastest`: `lbvh`, lowered greedily | 0.51 | 0.78 (0.64 to 0.90) |
//! | `fast`: `hploc`, lowered greedily | 0.54 | 0.83 (0.71 to 0.93) |
//! | `hploc+top-reinsertion` | 0.76 | 0.92 (0.83 to 0.98) |
//! | `default`: `binned-sah+top-reinsertion` | 1 | 1 |
//! | `hploc+reinsertion` | 1.03 | 0.94 (0.82 to 1.06) |
//! | `high`: `binned-sah+top-reinsertion+reinsertion` | 1.40 | 1.01 (0.98 to 1.07) |
//! | `binned-sah` by single tests, `top-reinsertion` | 1.7 | 1.00 (0.96 to 1.03) |
//! | the same, `reinsertion` | 2.0 | 1.01 (0.97 to 1.12) |
//! | `binned-sah`, full reinsertion | 2.9 | 1.02 (0.98 to 1.06) |
//! | `hploc`, full reinsertion | 3.6 | 0.96 (0.84 to 1.04) |
//! | `binned-sah` by single tests, full reinsertion | 4.6 | 1.03 (0.98 to 1.15) |
//!
//! `best` is the last of these, or `sbvh` with the same reinsertion where that is cheaper by
//! [`Plan::RIVAL_SHARE`]; to find out takes two to twelve times as long again (a kitchen 6 s in all, fur 11 s).
//! Relative to `sweep-sah`, which is about as fast as `default`, with 32,768 rays and seven rounds; full
//! reinsertion in each column; the same tree measured twice differed by up to 3 %:
//!
//! | scene | price of blocks | single tests | `sbvh` | its SAH beside that of single tests |
//! |---|---|---|---|---|
//! | house | 1.08 | 1.15 | 1.19 | 0.94 |
//! | counter | 0.92 | 0.93 | 0.99 | 0.92 |
//! | arches | 1.12 | 1.18 | 1.16 | 1.06 |
//! | building | 1.03 | 1.07 | 1.02 | 0.99 |
//! | kitchen | 1.13 | 1.13 | 1.06 | 1.00 |
//! | coffee maker | 1.05 | 1.05 | 1.03 | 1.02 |
//! | car | 1.04 | 0.99 | 1.02 | 0.97 |
//! | fur | 1.04 | 1.05 | 1.04 | 1.00 |
//! | cave | 1.01 | 1.00 | 1.01 | 1.00 |
//! | terrain | 0.98 | 0.99 | 1.00 | 1.00 |
//! | turbine blade | 1.01 | 0.98 | 0.98 | 0.99 |
//! | figure | 0.96 | 0.98 | 0.98 | 1.00 |
//! | all | 1.03 | 1.04 | 1.04 | |
//!
//! The rule takes `sbvh` in the house and the counter, by which the mean of these numbers is 1.05. What was built
//! before full reinsertion matters little. Tried and lost before the same reinsertion, relative to `sweep-sah`:
//! - itself, at twice the time of single tests: 1.03, as those (six scenes);
//! - prices of 0.5 and 2 for a visit: 1.03 and 1.03; leaves of up to two: 1.03 (the same six);
//! - blocks of four and `ploc`: 1.00 where `binned-sah` has 1.02; `presplit` and `binned-sah` with budgets of
//!   0.1 and 0.3: 0.99 and 0.95 (four scenes);
//! - `sbvh` with 32 bins: 1.08 where 16 have 1.11; with splits of large triangles only, or of small ones only:
//!   1.07 and 1.11 (four scenes);
//! - [`crate::optimize::Insertion`] after it: 1.13 where there was 1.12, for three times the build (the same).

#[cfg(doc)]
use super::Scene;
use super::builder::BuildOptions;
use super::gather::Names;
use crate::bounds::Aabb;
use crate::build::{BinnedSah, BuildError, Builder, Clip, Hploc, Lbvh, Sbvh};
use crate::context::Context;
use crate::geometry::Mesh;
use crate::geometry::clip::{clipped_bounds, least_half_area};
use crate::layout::Collapse;
use crate::optimize::{Optimizer, Reinsertion, TopReinsertion};
use crate::tree::{SahConstants, Tree};
use core::fmt;

/// How much time to spend on a tree that is traced faster. No level changes an answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quality {
    /// For scenes that are hardly traced at all.
    Fastest,
    /// For scenes that change from picture to picture.
    Fast,
    /// For usual numbers of rays.
    #[default]
    Default,
    /// For tens of rays a triangle and more.
    High,
    /// For rays without end.
    Best,
    /// For this many rays: see [`Quality::for_rays`].
    Rays(u64),
    /// For nobody knows how many rays: the quickest build, which [`Scene::improve`] replaces by
    /// better ones as rays are traced.
    Auto,
}

impl Quality {
    /// Whatever answers `n` rays soonest, its build included: chosen for this scene, on this machine.
    ///
    /// A few rays get the quickest build at once. For more, trees are built that promise to be worth it, and
    /// some rays traced through each ([`BuildOptions::pilot`]), for as long as that is cheap beside what it may
    /// save; [`BuildReport::choice`](super::BuildReport::choice) says what was chosen and why. Rays are
    /// taken to be asked one a call, on all threads of the caller's rayon pool. Answers do not depend on what is
    /// chosen; the tree may differ from run to run, since clocks decide. Without a clock, a table does.
    ///
    /// Of a scene that is placed into others, `n` is how many rays will enter it.
    ///
    /// ```
    /// use treelet::{BuildOptions, Mesh, Quality, Scene};
    ///
    /// let mesh = Mesh::new([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0, 1, 2]]);
    /// let options = BuildOptions { quality: Quality::for_rays(1_000_000), ..Default::default() };
    /// let scene = Scene::builder().mesh(mesh).build(&options)?;
    /// println!("{}", scene.report().choice.as_ref().unwrap().reason);
    /// # Ok::<(), treelet::SceneError>(())
    /// ```
    pub fn for_rays(n: u64) -> Self {
        Self::Rays(n)
    }

    /// Every named level, from the fastest build to the fastest trace.
    pub const ALL: [Self; 5] = [Self::Fastest, Self::Fast, Self::Default, Self::High, Self::Best];

    /// As users write it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fastest => "fastest",
            Self::Fast => "fast",
            Self::Default => "default",
            Self::High => "high",
            Self::Best => "best",
            Self::Rays(_) => "rays",
            Self::Auto => "auto",
        }
    }

    /// What it is for, in a line.
    pub fn summary(self) -> &'static str {
        match self {
            Self::Fastest => "for scenes that are hardly traced at all",
            Self::Fast => "for scenes that change from picture to picture",
            Self::Default => "for usual numbers of rays",
            Self::High => "for tens of rays a triangle and more",
            Self::Best => "for rays without end",
            Self::Rays(_) => "for a number of rays, whatever is soonest done",
            Self::Auto => "for an unknown number of rays, better as they are traced",
        }
    }

    /// The named level of that name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|quality| quality.name() == name)
    }

    /// What the level is made of; of [`Quality::Rays`] and [`Quality::Auto`], what they have when there is
    /// nothing to choose by.
    ///
    /// The two quick levels collapse greedily: with the cheapest collapse, `fast` took 1.4 times as long.
    /// The default rearranges the top of its tree, which is where `binned-sah` loses most.
    ///
    /// Reinsertion moves the leaves that `binned-sah` fills with up to four primitives as they are:
    /// with leaves of one primitive to move it finds lower costs, and slower trees (4 to 10 % fewer
    /// rays a second in a car and a coffee maker; layouts then fill leaves less well).
    ///
    /// `best` builds `binned-sah` at the price of single tests, and `sbvh`; the latter is taken if it is cheaper by
    /// the share [`Plan::RIVAL_SHARE`]. What else was measured is in the module's source.
    pub fn plan(self) -> Plan<'static> {
        let plain = |builder| Plan {
            quality: self,
            builder,
            rival: None,
            optimizers: &[],
            collapse: Collapse::Optimal,
        };
        let quick = |builder| Plan { collapse: Collapse::Greedy, ..plain(builder) };
        match self {
            Self::Fastest | Self::Rays(_) | Self::Auto => quick(&Lbvh::DEFAULT),
            Self::Fast => quick(&Hploc::DEFAULT),
            Self::Default => {
                Plan { optimizers: &[&TopReinsertion::DEFAULT], ..plain(&BinnedSah::DEFAULT) }
            }
            Self::High => Plan {
                optimizers: &[&TopReinsertion::DEFAULT, &Reinsertion::DEFAULT],
                ..plain(&BinnedSah::DEFAULT)
            },
            Self::Best => Plan {
                rival: Some(&Sbvh::DEFAULT),
                optimizers: &[&Reinsertion { share: 1.0, gain_min: 1e-3, ..Reinsertion::DEFAULT }],
                ..plain(&BinnedSah { block: 1, ..BinnedSah::DEFAULT })
            },
        }
    }
}

/// What makes a tree: a builder, or the better of two, then optimisers.
#[derive(Clone, Copy)]
pub struct Plan<'a> {
    /// The level that it is, or was made from.
    pub quality: Quality,
    /// Makes the tree.
    pub builder: &'a dyn Builder,
    /// Makes another one, which is taken if it is cheaper by [`Plan::RIVAL_SHARE`], both improved alike.
    pub rival: Option<&'a dyn Builder>,
    /// Improve it, one after the other.
    pub optimizers: &'a [&'a dyn Optimizer],
    /// How the tree becomes a wide one.
    pub collapse: Collapse,
}

impl<'a> Plan<'a> {
    /// What a rival's tree may cost at most, as a share of the other's SAH, to be taken. Splits that save
    /// less than this are not seen in rays a second, or slow them down: see [`Quality::plan`].
    pub const RIVAL_SHARE: f64 = 0.95;

    /// What the options ask for.
    pub(super) fn new(options: &BuildOptions<'a>) -> Self {
        let mut plan: Plan<'a> = options.quality.plan();
        if let Some(builder) = options.builder {
            plan = Plan { builder, rival: None, optimizers: &[], ..plan };
            plan.collapse = Collapse::Optimal;
        }
        Self { optimizers: options.optimizers.unwrap_or(plan.optimizers), ..plan }
    }

    /// The tree over primitives with these boxes.
    ///
    /// # Errors
    ///
    /// An option out of range, too many primitives, cancellation, memory.
    pub fn build(
        &self,
        bounds: &[Aabb],
        clip: &dyn Clip,
        context: &Context<'_>,
    ) -> Result<Tree, BuildError> {
        let improved = |builder: &dyn Builder| {
            let tree = builder.build_clipped(bounds, clip, context)?;
            self.optimizers
                .iter()
                .try_fold(tree, |tree, optimizer| optimizer.optimize(tree, context))
        };
        let tree = improved(self.builder)?;
        let Some(rival) = self.rival else { return Ok(tree) };
        let other = improved(rival)?;
        let cost = |tree: &Tree| tree.sah(&SahConstants::default());
        let is_cheaper = cost(&other) < Self::RIVAL_SHARE * cost(&tree);
        Ok(if is_cheaper { other } else { tree })
    }
}

impl fmt::Display for Plan<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut builder = self.builder;
        while let Some(inner) = builder.inner() {
            write!(f, "{}+", builder.info().name)?;
            builder = inner;
        }
        write!(f, "{}", builder.info().name)?;
        if let Some(rival) = self.rival {
            write!(f, " or {}", rival.info().name)?;
        }
        self.optimizers.iter().try_for_each(|optimizer| write!(f, " + {}", optimizer.info().name))
    }
}

/// A level's triangles and instances, as splits see them.
pub(super) struct Cuttable<'a> {
    pub(super) meshes: &'a [(Mesh, u32)],
    /// Of the triangles; instances come after them.
    pub(super) names: &'a Names,
    pub(super) triangles: usize,
    pub(super) bounds: &'a [Aabb],
}

impl Cuttable<'_> {
    fn corners(&self, prim: u32) -> Option<[[f32; 3]; 3]> {
        if prim as usize >= self.triangles {
            return None;
        }
        let (geom, prim) = self.names.of(prim);
        self.meshes[geom as usize].0.corners(prim as usize)
    }
}

impl Clip for Cuttable<'_> {
    fn clip(&self, prim: u32, region: &Aabb) -> Aabb {
        match self.corners(prim) {
            Some(corners) => clipped_bounds(&corners, region),
            None => self.bounds[prim as usize].intersection(region),
        }
    }

    /// Instances are not cut: to enter one twice costs more than a tighter box saves.
    fn least_half_area(&self, prim: u32) -> Option<f64> {
        self.corners(prim).map(|corners| least_half_area(&corners))
    }

    /// The mesh; instances come after all of them.
    fn group(&self, prim: u32) -> u32 {
        if (prim as usize) < self.triangles {
            self.names.of(prim).0
        } else {
            self.meshes.len() as u32
        }
    }
}
