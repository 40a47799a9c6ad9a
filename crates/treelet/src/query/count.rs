//! How many hits there are along the ray.

use super::{Question, ask_simply};
use crate::layout::wide::Child;
use crate::math::Ray;
use crate::trace::structure::Structure;
use crate::trace::walk::{Found, Visitor};
use alloc::vec::Vec;
use core::ops::ControlFlow;

#[derive(Clone, Copy)]
struct Counting {
    t_max: f32,
    hits: u64,
}

impl<'a> Visitor<'a> for Counting {
    type Pending = Child;

    fn t_max(&self) -> f32 {
        self.t_max
    }

    #[inline(always)]
    fn lend(&mut self) -> Self {
        *self
    }

    fn hit(&mut self, _: Found<'a>) -> ControlFlow<()> {
        // Leaves share no primitive here, so each is offered once.
        self.hits += 1;
        ControlFlow::Continue(())
    }
}

impl<'a> Question<'a> for Counting {
    type Seed = ();
    type Answer = u64;

    fn begin(ray: &Ray, (): ()) -> Self {
        Self { t_max: ray.t_max, hits: 0 }
    }

    fn answer(self) -> u64 {
        self.hits
    }
}

/// The number of hits that [`super::all::all`] would list.
pub(crate) fn count(structure: &Structure, ray: &Ray) -> u64 {
    // Where a primitive may lie in several leaves, only a list tells which were counted before.
    if structure.repeats {
        let mut hits = Vec::new();
        super::all::all(structure, ray, &mut hits);
        return hits.len() as u64;
    }
    ask_simply::<Counting, _>(structure, ray, (), &mut ())
}
