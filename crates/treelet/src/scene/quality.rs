//! Quality levels: named compositions of a builder and optimisers, as data.

#[cfg(doc)]
use super::Scene;
use super::builder::BuildOptions;
use super::gather::Names;
use crate::bounds::Aabb;
use crate::build::{BinnedSah, BuildError, Builder, Clip, Hploc, Lbvh};
use crate::context::Context;
use crate::geometry::clip::{clipped_bounds, least_half_area};
use crate::layout::Collapse;
use crate::optimize::{Optimizer, Reinsertion, TopReinsertion};
use crate::trace::structure::Geometry;
use crate::tree::Tree;
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
    /// rays a second in a car and a coffee maker; layouts then fill leaves less well). Spatial splits
    /// (`sbvh`, `presplit`) are in none: instead of `binned-sah` in `best`, `sbvh` traces 1.11 to 1.16 times
    /// as many rays a second in a house, 0.88 to 0.97 times in a kitchen.
    pub fn plan(self) -> Plan<'static> {
        let plain =
            |builder| Plan { quality: self, builder, optimizers: &[], collapse: Collapse::Optimal };
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
                optimizers: &[&Reinsertion { share: 1.0, gain_min: 1e-3, ..Reinsertion::DEFAULT }],
                ..plain(&BinnedSah::DEFAULT)
            },
        }
    }
}

/// What makes a tree: a builder, then optimisers.
#[derive(Clone, Copy)]
pub struct Plan<'a> {
    /// The level that it is, or was made from.
    pub quality: Quality,
    /// Makes the tree.
    pub builder: &'a dyn Builder,
    /// Improve it, one after the other.
    pub optimizers: &'a [&'a dyn Optimizer],
    /// How the tree becomes a wide one.
    pub collapse: Collapse,
}

impl<'a> Plan<'a> {
    /// What the options ask for.
    pub(super) fn new(options: &BuildOptions<'a>) -> Self {
        let mut plan: Plan<'a> = options.quality.plan();
        if let Some(builder) = options.builder {
            plan = Plan { builder, optimizers: &[], ..plan };
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
        let mut tree = self.builder.build_clipped(bounds, clip, context)?;
        for optimizer in self.optimizers {
            tree = optimizer.optimize(tree, context)?;
        }
        Ok(tree)
    }

    /// The same over what cannot be cut.
    pub(super) fn build_whole(
        &self,
        bounds: &[Aabb],
        context: &Context<'_>,
    ) -> Result<Tree, BuildError> {
        let mut tree = self.builder.build(bounds, context)?;
        for optimizer in self.optimizers {
            tree = optimizer.optimize(tree, context)?;
        }
        Ok(tree)
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
        self.optimizers.iter().try_for_each(|optimizer| write!(f, " + {}", optimizer.info().name))
    }
}

/// A level's triangles and instances, as splits see them.
pub(super) struct Cuttable<'a> {
    pub(super) geometries: &'a [Geometry],
    /// Of the triangles; all else comes after them.
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
        self.geometries[geom as usize].mesh()?.corners(prim as usize)
    }
}

impl Clip for Cuttable<'_> {
    fn clip(&self, prim: u32, region: &Aabb) -> Aabb {
        match self.corners(prim) {
            Some(corners) => clipped_bounds(&corners, region),
            None => self.bounds[prim as usize].intersection(region),
        }
    }

    /// Only triangles are cut: to enter an instance twice costs more than a tighter box saves.
    fn least_half_area(&self, prim: u32) -> Option<f64> {
        self.corners(prim).map(|corners| least_half_area(&corners))
    }

    /// The mesh; all else comes after all of them.
    fn group(&self, prim: u32) -> u32 {
        if (prim as usize) < self.triangles {
            self.names.of(prim).0
        } else {
            self.geometries.len() as u32
        }
    }
}
