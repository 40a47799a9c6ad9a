//! The nearest hit; of hits at the very same `t` the one with the smallest id.

use super::{ask, ask_simply};
use crate::geometry::Hit;
use crate::math::Ray;
use crate::trace::Counters;
use crate::trace::structure::Structure;
use crate::trace::walk::{ByEntry, Found, Visitor};
use core::ops::ControlFlow;

/// The answer so far: a miss at the ray's end.
struct Closest<'a> {
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

/// The answer.
#[inline]
pub(crate) fn closest(structure: &Structure, ray: &Ray) -> Option<Hit> {
    let mut visitor = Closest { t: ray.t_max, best: None };
    ask(structure, ray, &mut visitor);
    visitor.best.map(Hit::from)
}

/// The answer, and the work it took.
pub(crate) fn counted(structure: &Structure, ray: &Ray, counters: &mut Counters) -> Option<Hit> {
    let mut visitor = Closest { t: ray.t_max, best: None };
    ask_simply(structure, ray, &mut visitor, counters);
    visitor.best.map(Hit::from)
}

impl From<Found<'_>> for Hit {
    #[inline]
    fn from(found: Found<'_>) -> Self {
        let Found { t, u, v, inst, .. } = found;
        let (geom, prim) = found.structure.name(found.id);
        Self { t, u, v, prim, geom, inst }
    }
}
