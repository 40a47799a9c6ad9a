//! Whether there is a hit at all.

use super::{Question, ask, ask_simply};
use crate::layout::wide::Child;
use crate::math::Ray;
use crate::trace::Counters;
use crate::trace::stream::Answers;
use crate::trace::structure::Structure;
use crate::trace::walk::{Found, Visitor};
use core::ops::{ControlFlow, Range};

#[derive(Clone, Copy)]
pub(crate) struct Any {
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
    fn lend(&mut self) -> Self {
        *self
    }

    #[inline(always)]
    fn hit(&mut self, _: Found<'a>) -> ControlFlow<()> {
        self.found = true;
        ControlFlow::Break(())
    }
}

impl<'a> Question<'a> for Any {
    type Seed = ();
    type Answer = bool;

    #[inline(always)]
    fn begin(ray: &Ray, (): ()) -> Self {
        Self { t_max: ray.t_max, found: false }
    }

    #[inline(always)]
    fn answer(self) -> bool {
        self.found
    }
}

/// The answer.
#[inline]
pub(crate) fn any(structure: &Structure, ray: &Ray) -> bool {
    ask::<Any>(structure, ray, ())
}

/// The answer, and the work it took.
pub(crate) fn counted(structure: &Structure, ray: &Ray, counters: &mut Counters) -> bool {
    ask_simply::<Any, _>(structure, ray, (), counters)
}

/// The answers to a slice of rays, so far; no to begin with.
pub(crate) struct Many<'h> {
    pub(crate) answers: &'h mut [bool],
}

impl<'a> Answers<'a> for Many<'_> {
    type Visitor = Any;

    const NEAREST_FIRST: bool = false;

    #[inline(always)]
    fn visitor(&self, _: usize, t_max: f32) -> Any {
        Any { t_max, found: false }
    }

    /// Nothing matters any more to a ray with a hit.
    #[inline(always)]
    fn settle(&mut self, slot: usize, _: f32, visitor: Any) -> f32 {
        if visitor.found {
            self.answers[slot] = true;
            return f32::NEG_INFINITY;
        }
        visitor.t_max
    }

    #[inline(always)]
    fn keep(&mut self, slot: usize, _: Found<'a>) {
        self.answers[slot] = true;
    }

    #[inline(always)]
    fn put(&mut self, slot: usize, found: Option<Found<'a>>) {
        self.answers[slot] = found.is_some();
    }

    #[inline(always)]
    fn clear(&mut self, slots: Range<usize>) {
        self.answers[slots].fill(false);
    }

    #[inline(always)]
    fn best(_: &Any) -> Option<Found<'a>> {
        None
    }
}
