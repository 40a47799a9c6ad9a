//! The nearest hit; of hits at the very same `t` the one with the smallest id.

use crate::geometry::Hit;
use crate::math::Ray;
use crate::trace::counters::Count;
use crate::trace::structure::Structure;
use crate::trace::walk::{Visitor, walk};
use core::ops::ControlFlow;

struct Closest {
    best: Hit,
}

impl Visitor for Closest {
    #[inline(always)]
    fn t_max(&self) -> f32 {
        self.best.t
    }

    #[inline(always)]
    fn hit(&mut self, hit: Hit) -> ControlFlow<()> {
        // The walk offers only `t <= t_max()`, so only a tie needs a look at the ids.
        if hit.t < self.best.t || hit.id() < self.best.id() {
            self.best = hit;
        }
        ControlFlow::Continue(())
    }
}

/// The answer, and the work it took.
#[inline]
pub(crate) fn closest<C: Count>(structure: &Structure, ray: &Ray, counters: &mut C) -> Option<Hit> {
    if !ray.is_valid() {
        return None;
    }
    // A miss at the ray's end: any hit there has a smaller id.
    let mut visitor = Closest { best: Hit { t: ray.t_max, ..Hit::MISS } };
    walk(structure, ray, &mut visitor, counters);
    visitor.best.is_hit().then_some(visitor.best)
}
