//! The nearest hit that the caller accepts, and whether there is one: alpha cut-outs, rays that
//! pass through what they have met before.
//!
//! The filter is asked inside the walk, by one call out of the loop for each hit that would become
//! the answer if accepted. It must be a pure function of the hit: how often it is asked, and in
//! which order, is not promised; for such a filter the answer is the first of [`super::all`] that
//! it accepts, whatever the tree. Hits are offered to it with all their digits, so it may look
//! anything up. The walk is compiled once a level for all filters.

use super::{Question, ask};
use crate::geometry::Hit;
use crate::layout::wide::Child;
use crate::math::Ray;
use crate::trace::pending::ByEntry;
use crate::trace::structure::Structure;
use crate::trace::walk::{Found, Visitor};
use core::ops::ControlFlow;

/// What callers filter with.
pub(crate) type Filter<'f> = &'f dyn Fn(&Hit) -> bool;

/// The answer so far: a miss at the ray's end.
#[derive(Clone, Copy)]
struct Closest<'f> {
    t: f32,
    best: Option<Hit>,
    accept: Filter<'f>,
}

impl<'a> Visitor<'a> for Closest<'_> {
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
        self.offer(found.into());
        ControlFlow::Continue(())
    }
}

impl Closest<'_> {
    #[inline(never)]
    fn offer(&mut self, hit: Hit) {
        let first = self.best.is_none_or(|best| hit.cmp_along_ray(&best).is_lt());
        if first && (self.accept)(&hit) {
            self.t = hit.t;
            self.best = Some(hit);
        }
    }
}

impl<'a, 'f> Question<'a> for Closest<'f> {
    type Seed = Filter<'f>;
    type Answer = Option<Hit>;

    #[inline(always)]
    fn begin(ray: &Ray, accept: Filter<'f>) -> Self {
        Self { t: ray.t_max, best: None, accept }
    }

    #[inline(always)]
    fn answer(self) -> Option<Hit> {
        self.best
    }
}

/// The first hit that is accepted.
pub(crate) fn closest(structure: &Structure, ray: &Ray, accept: Filter<'_>) -> Option<Hit> {
    ask::<Closest<'_>>(structure, ray, accept)
}

#[derive(Clone, Copy)]
struct Any<'f> {
    t_max: f32,
    found: bool,
    accept: Filter<'f>,
}

impl<'a> Visitor<'a> for Any<'_> {
    type Pending = Child;

    #[inline(always)]
    fn t_max(&self) -> f32 {
        self.t_max
    }

    #[inline(always)]
    fn lend(&mut self) -> Self {
        *self
    }

    #[inline(always)]
    fn hit(&mut self, found: Found<'a>) -> ControlFlow<()> {
        if self.accepts(found.into()) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

impl Any<'_> {
    #[inline(never)]
    fn accepts(&mut self, hit: Hit) -> bool {
        self.found = (self.accept)(&hit);
        self.found
    }
}

impl<'a, 'f> Question<'a> for Any<'f> {
    type Seed = Filter<'f>;
    type Answer = bool;

    #[inline(always)]
    fn begin(ray: &Ray, accept: Filter<'f>) -> Self {
        Self { t_max: ray.t_max, found: false, accept }
    }

    #[inline(always)]
    fn answer(self) -> bool {
        self.found
    }
}

/// Whether a hit is accepted.
pub(crate) fn any(structure: &Structure, ray: &Ray, accept: Filter<'_>) -> bool {
    ask::<Any<'_>>(structure, ray, accept)
}
