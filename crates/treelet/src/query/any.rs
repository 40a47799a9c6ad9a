//! Whether there is a hit at all.

use crate::geometry::Hit;
use crate::math::Ray;
use crate::trace::counters::Count;
use crate::trace::structure::Structure;
use crate::trace::walk::{Visitor, walk};
use core::ops::ControlFlow;

struct Any {
    t_max: f32,
    found: bool,
}

impl Visitor for Any {
    #[inline(always)]
    fn t_max(&self) -> f32 {
        self.t_max
    }

    #[inline(always)]
    fn hit(&mut self, _: Hit) -> ControlFlow<()> {
        self.found = true;
        ControlFlow::Break(())
    }
}

/// The answer, and the work it took.
#[inline]
pub(crate) fn any<C: Count>(structure: &Structure, ray: &Ray, counters: &mut C) -> bool {
    let mut visitor = Any { t_max: ray.t_max, found: false };
    if ray.is_valid() {
        walk(structure, ray, &mut visitor, counters);
    }
    visitor.found
}
