//! What a figure is made of: which variants, which rays, how often.

use serde::Serialize;
use treelet::{Quality, Ray, build};

use crate::crew::Clock;
use crate::engine::Engine;
use crate::rays::Kind;
use crate::report::{Machine, Order};
use crate::rivals::treelet as ours;
use crate::run::Plan;

/// The kinds of rays that figures show unless told otherwise.
pub const KINDS: [Kind; 3] = [Kind::Primary, Kind::Occlusion, Kind::Diffuse];

/// Compositions worth drawing beside every builder and every quality level: what the library may
/// choose, so that hindsight knows it too, and the paper's builder with its splitting.
pub const COMPOSITIONS: [&str; 9] = [
    "hploc+top-reinsertion",
    "hploc+reinsertion",
    "presplit+hploc+reinsertion",
    "presplit+trbvh",
    "presplit+binned-sah+reinsertion",
    "aac+reinsertion",
    "sweep-sah+reinsertion",
    "sbvh+top-reinsertion",
    "sbvh+reinsertion",
];

/// Bytes a triangle of a tree that is ready to trace, about, over all variants.
const TREE_BYTES: u64 = 65;
/// Bytes a triangle that the dearest build takes besides, about.
const BUILD_BYTES: u64 = 200;

/// Rays that follow each other, of which a stretch is either timed or given to the library to try: long
/// enough to be as coherent as their neighbours.
const STRETCH: usize = 256;

/// Of so many stretches one is given to the library.
const PILOT_EVERY: usize = 3;

/// What is measured.
#[derive(Clone, Debug)]
pub struct FigurePlan {
    /// Kinds, threads, rounds, clock and variants; its orders and slices are not looked at.
    pub base: Plan,
    /// Rays of each kind that are timed.
    pub rays: usize,
    /// Fewer builds, fewer choices, coarser measures.
    pub quick: bool,
    /// Numbers of rays for which the library is asked to choose.
    pub choices: Vec<u64>,
    /// Numbers of rays that a scene answers without having been told.
    pub auto: Vec<u64>,
}

/// What two runs must have in common to be parts of one figure.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Settings {
    version: &'static str,
    processor: String,
    system_huge_pages: String,
    kinds: Vec<&'static str>,
    threads: Vec<usize>,
    rays: usize,
    rounds: usize,
    seconds: f64,
    clock: String,
    quick: bool,
    engines: Vec<String>,
    builders: Vec<String>,
    variants: Vec<String>,
    choices: Vec<u64>,
    auto: Vec<u64>,
}

impl FigurePlan {
    /// The usual figure of what `base` asks for.
    pub fn new(base: Plan, quick: bool) -> Self {
        let rays = base.rays;
        // So many that as many as asked for are left when the library has its part.
        let all = rays.saturating_mul(PILOT_EVERY).div_ceil(PILOT_EVERY - 1);
        let base = Plan { rays: all, orders: vec![Order::Given], slices: Vec::new(), ..base };
        // From 10^4 to 10^11, a decade or half of one apart.
        let step = if quick { 2 } else { 1 };
        let choices =
            (8..=22).step_by(step).map(|half| 10f64.powf(f64::from(half) / 2.0).round() as u64);
        let decades: &[u32] = if quick { &[5, 6, 7] } else { &[5, 6, 7, 8] };
        // Tracing them takes as long as timing rays does a few times over.
        let most = 1000 * rays as u64;
        let auto = decades.iter().map(|&decade| 10_u64.pow(decade)).filter(|&n| n <= most);
        let auto = auto.collect();
        Self { base, rays, quick, choices: choices.collect(), auto }
    }

    /// An engine's variants that are drawn.
    pub(super) fn variants_of(&self, engine: &dyn Engine) -> Vec<String> {
        if engine.name() != ours::NAME || !self.base.builders.is_empty() {
            return self.base.variants_of(engine);
        }
        let builders = build::ALL.iter().map(|builder| builder.info().name);
        let levels = Quality::ALL.iter().map(|level| level.name());
        builders.chain(levels).chain(COMPOSITIONS).map(str::to_owned).collect()
    }

    /// Why a scene of so many triangles cannot be measured with `free` bytes of memory; `None` if it can. All trees
    /// of a scene stand at once, so that rays go through them in turn.
    pub fn too_large(
        &self,
        engines: &[Box<dyn Engine>],
        triangles: usize,
        free: u64,
    ) -> Option<String> {
        let trees: usize = engines.iter().map(|engine| self.variants_of(&**engine).len()).sum();
        let bytes = triangles as u64 * (trees as u64 * TREE_BYTES + BUILD_BYTES);
        let gib = |bytes: u64| bytes as f64 / f64::from(1 << 30);
        (bytes > free).then(|| {
            format!(
                "its {trees} trees, which stand side by side, would take about {:.1} GiB, and {:.1} are free; name fewer \
                 with --builders and --variants",
                gib(bytes),
                gib(free)
            )
        })
    }

    /// Parts the rays: those that are timed, and a sample of the same kind that is not.
    pub(super) fn parted(&self, rays: &[Ray]) -> (Vec<Ray>, Vec<Ray>) {
        let (mut timed, mut pilot) = (Vec::new(), Vec::new());
        for (index, stretch) in rays.chunks(STRETCH).enumerate() {
            let part = if index % PILOT_EVERY == 1 { &mut pilot } else { &mut timed };
            part.extend_from_slice(stretch);
        }
        (timed, pilot)
    }

    /// What another run must have in common with this one to go on with it.
    pub(super) fn settings(&self, engines: &[Box<dyn Engine>]) -> Settings {
        let Plan { kinds, threads, rounds, clock, builders, variants, .. } = &self.base;
        let engine = |engine: &dyn Engine| format!("{} {}", engine.name(), engine.version());
        Settings {
            version: env!("CARGO_PKG_VERSION"),
            processor: Machine::processor_name(),
            system_huge_pages: Machine::huge_pages_setting(),
            kinds: kinds.iter().map(|kind| kind.name()).collect(),
            threads: threads.clone(),
            rays: self.rays,
            rounds: rounds.count,
            seconds: rounds.seconds,
            clock: if *clock == Clock::Wall { "wall".into() } else { "processor".into() },
            quick: self.quick,
            engines: engines.iter().map(|it| engine(&**it)).collect(),
            builders: builders.clone(),
            variants: variants.clone(),
            choices: self.choices.clone(),
            auto: self.auto.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::FigurePlan;
    use crate::crew::Clock;
    use crate::rivals::treelet::Treelet;
    use crate::rounds::Rounds;
    use crate::run::Plan;

    #[test]
    fn scenes_that_do_not_fit_are_known_before() {
        let base = Plan {
            kinds: Vec::new(),
            orders: Vec::new(),
            slices: Vec::new(),
            threads: vec![1],
            rays: 1,
            rounds: Rounds { count: 1, seconds: 0.0 },
            clock: Clock::Wall,
            builders: vec!["lbvh".into(), "hploc".into()],
            variants: Vec::new(),
        };
        let plan = FigurePlan::new(base, true);
        let reason = |free| plan.too_large(&[Box::new(Treelet)], 1 << 20, free);
        assert_eq!(reason(1 << 30), None);
        assert!(reason(1 << 28).unwrap().starts_with("its 2 trees"));
    }
}
