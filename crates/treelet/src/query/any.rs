//! Whether there is a hit at all.

use super::{ask, ask_simply};
use crate::layout::wide::Child;
use crate::math::Ray;
use crate::trace::Counters;
use crate::trace::structure::Structure;
use crate::trace::walk::{Found, Visitor};
use core::ops::ControlFlow;

struct Any {
    t_max: f32,
    found: bool,
}

impl<'a> Visitor<'a> for Any {
    type Pending = Child;

    #[inline(always)]
    fn t_max(&self) -> f32 {
        self.t_max
    }

    #[inline(always)]
    fn hit(&mut self, _: Found<'a>) -> ControlFlow<()> {
        self.found = true;
        ControlFlow::Break(())
    }
}

/// The answer.
#[inline]
pub(crate) fn any(structure: &Structure, ray: &Ray) -> bool {
    let mut visitor = Any { t_max: ray.t_max, found: false };
    ask(structure, ray, &mut visitor);
    visitor.found
}

/// The answer, and the work it took.
pub(crate) fn counted(structure: &Structure, ray: &Ray, counters: &mut Counters) -> bool {
    let mut visitor = Any { t_max: ray.t_max, found: false };
    ask_simply(structure, ray, &mut visitor, counters);
    visitor.found
}
