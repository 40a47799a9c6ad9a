//! The nearest hit; of hits at the very same `t` the one with the smallest id.

use super::{Question, ask, ask_simply};
use crate::geometry::Hit;
use crate::math::Ray;
use crate::trace::Counters;
use crate::trace::pending::ByEntry;
use crate::trace::stream::Answers;
use crate::trace::structure::Structure;
use crate::trace::walk::{Found, Visitor};
use core::ops::{ControlFlow, Range};

/// The answer so far: a miss at the ray's end.
#[derive(Clone, Copy)]
pub(crate) struct Closest<'a> {
    t: f32,
    best: Option<Found<'a>>,
}

impl<'a> Visitor<'a> for Closest<'a> {
    type Pending = ByEntry;

    #[inline(always)]
    fn t_max(&self) -> f32 {
        self.t
    }

    #[inline(always)]
    fn lend(&mut self) -> Self {
        *self
    }

    #[inline(always)]
    fn hit(&mut self, found: Found<'a>) -> ControlFlow<()> {
        // The walk offers only `t <= t_max()`, so only a tie needs a look at the ids.
        let first = self.best.is_none_or(|best| (found.inst, found.id) < (best.inst, best.id));
        if found.t < self.t || first {
            self.t = found.t;
            self.best = Some(found);
        }
        ControlFlow::Continue(())
    }
}

impl<'a> Question<'a> for Closest<'a> {
    type Seed = ();
    type Answer = Option<Hit>;

    #[inline(always)]
    fn begin(ray: &Ray, (): ()) -> Self {
        Self { t: ray.t_max, best: None }
    }

    #[inline(always)]
    fn answer(self) -> Option<Hit> {
        self.best.map(Hit::from)
    }
}

/// The answer.
#[inline]
pub(crate) fn closest(structure: &Structure, ray: &Ray) -> Option<Hit> {
    ask::<Closest<'_>>(structure, ray, ())
}

/// The answer, and the work it took.
pub(crate) fn counted(structure: &Structure, ray: &Ray, counters: &mut Counters) -> Option<Hit> {
    ask_simply::<Closest<'_>, _>(structure, ray, (), counters)
}

/// The answers to a slice of rays, so far; misses to begin with.
pub(crate) struct Many<'h> {
    pub(crate) hits: &'h mut [Hit],
}

impl<'a> Answers<'a> for Many<'_> {
    type Visitor = Closest<'a>;

    const NEAREST_FIRST: bool = true;

    #[inline(always)]
    fn visitor(&self, _: usize, t_max: f32) -> Closest<'a> {
        Closest { t: t_max, best: None }
    }

    #[inline(always)]
    fn settle(&mut self, slot: usize, t_max: f32, visitor: Closest<'a>) -> f32 {
        if let Some(found) = visitor.best {
            let hit = Hit::from(found);
            // Usually nearer, and then what was there need not be read. At the same `t`, the
            // smallest id; a miss has the largest.
            if hit.t < t_max || hit.id() < self.hits[slot].id() {
                self.hits[slot] = hit;
            }
        }
        visitor.t
    }

    #[inline(always)]
    fn keep(&mut self, slot: usize, found: Found<'a>) {
        let hit = Hit::from(found);
        let kept = &mut self.hits[slot];
        if hit.t < kept.t || (hit.t == kept.t && hit.id() < kept.id()) {
            *kept = hit;
        }
    }

    #[inline(always)]
    fn put(&mut self, slot: usize, found: Option<Found<'a>>) {
        self.hits[slot] = found.map_or(Hit::MISS, Hit::from);
    }

    #[inline(always)]
    fn clear(&mut self, slots: Range<usize>) {
        self.hits[slots].fill(Hit::MISS);
    }

    #[inline(always)]
    fn best(visitor: &Closest<'a>) -> Option<Found<'a>> {
        visitor.best
    }
}

impl From<Found<'_>> for Hit {
    #[inline]
    fn from(found: Found<'_>) -> Self {
        let Found { t, u, v, inst, .. } = found;
        let (geom, prim) = found.structure.name(found.id);
        Self { t, u, v, prim, geom, inst }
    }
}
