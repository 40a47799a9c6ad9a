//! What is to be measured, and who looks on.

use super::BenchError;
use crate::crew::Clock;
use crate::engine::{Built, Call, Engine, EngineError, Placed, Triangles};
use crate::rays::Kind;
use crate::report::Order;
use crate::rivals::treelet as ours;
use crate::rounds::Rounds;

/// What is measured.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Which rays.
    pub kinds: Vec<Kind>,
    /// In which orders.
    pub orders: Vec<Order>,
    /// How long slices are; longer ones hold all the rays.
    pub slices: Vec<usize>,
    /// With how many threads, one after the other.
    pub threads: Vec<usize>,
    /// How many rays of each kind.
    pub rays: usize,
    /// How often and how long.
    pub rounds: Rounds,
    /// The clock.
    pub clock: Clock,
    /// treelet's variants; its usual ones if there is none.
    pub builders: Vec<String>,
    /// The rivals' variants; each rival's usual ones if there is none.
    pub variants: Vec<String>,
}

/// Something to measure.
#[derive(Clone, Debug)]
pub struct Subject {
    /// As the report names it.
    pub name: String,
    /// Whether the bench made it.
    pub generated: bool,
    /// Its triangles.
    pub triangles: Triangles,
    /// What is measured in place of `triangles`, which are none then: a scene with instances.
    pub placed: Option<Placed>,
    /// The axis that points up; `None` guesses.
    pub up: Option<usize>,
}

impl Subject {
    /// Triangles that are stored.
    pub fn stored(&self) -> usize {
        self.placed.as_ref().map_or(self.triangles.len(), Placed::stored)
    }

    /// Builds it with an engine.
    pub(crate) fn build(
        &self,
        engine: &dyn Engine,
        variant: &str,
    ) -> Result<Box<dyn Built>, EngineError> {
        match &self.placed {
            Some(placed) => engine.build_placed(variant, placed),
            None => engine.build(variant, &self.triangles),
        }
    }
}

/// Whom a bench tells what it does, and who may stop it.
pub trait Watcher: Sync {
    /// A step begins.
    fn step(&self, what: &str);
    /// Whether to stop.
    fn stopped(&self) -> bool;
}

impl Plan {
    /// The variants that somebody asked for, of treelet or of its rivals.
    fn asked(&self, engine: &dyn Engine) -> &[String] {
        if engine.name() == ours::NAME { &self.builders } else { &self.variants }
    }

    /// Which of an engine's variants are measured.
    pub(crate) fn variants_of(&self, engine: &dyn Engine) -> Vec<String> {
        let asked = self.asked(engine);
        if asked.is_empty() {
            return engine.usual_variants();
        }
        let mut variants: Vec<String> = Vec::new();
        for variant in asked.iter().filter_map(|name| engine.variant(name)) {
            if !variants.contains(&variant) {
                variants.push(variant);
            }
        }
        variants
    }

    /// Whether a variant is given rays in that way: all ways if somebody asked for the variant.
    pub(super) fn takes(&self, engine: &dyn Engine, variant: &str, call: Call) -> bool {
        !self.asked(engine).is_empty() || engine.is_usual(variant, call)
    }

    /// Every variant that was asked for must be one that some engine has.
    pub(crate) fn check_variants(&self, engines: &[Box<dyn Engine>]) -> Result<(), BenchError> {
        for (is_ours, asked) in [(true, &self.builders), (false, &self.variants)] {
            let side = || engines.iter().filter(|engine| (engine.name() == ours::NAME) == is_ours);
            for name in asked {
                // Without rivals there is nothing to choose from, and nothing to complain about.
                if side().next().is_some() && !side().any(|engine| engine.variant(name).is_some()) {
                    let known: Vec<_> = side().flat_map(|engine| engine.variants()).collect();
                    return Err(BenchError::NoVariant {
                        name: name.clone(),
                        known: known.join(", "),
                    });
                }
            }
        }
        Ok(())
    }

    /// The lengths of slices in an order of `rays` rays: short ones are cut from neighbours only,
    /// since of shuffled rays a short slice is as good as any.
    pub(super) fn slices_in(&self, order: Order, rays: usize) -> Vec<usize> {
        let mut lengths: Vec<usize> = self.slices.iter().map(|&slice| slice.min(rays)).collect();
        lengths.dedup();
        if order == Order::Shuffled {
            let longest = lengths.iter().copied().max();
            lengths = longest.into_iter().collect();
        }
        lengths
    }
}
