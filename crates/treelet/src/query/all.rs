//! Every hit along the ray, each primitive once, in the order of answers.

use super::{Question, ask_simply};
use crate::geometry::Hit;
use crate::layout::wide::Child;
use crate::math::Ray;
use crate::trace::structure::Structure;
use crate::trace::walk::{Found, Visitor};
use alloc::vec::Vec;
use core::ops::ControlFlow;

struct All<'a> {
    t_max: f32,
    /// `None` while lent.
    hits: Option<&'a mut Vec<Hit>>,
}

impl<'a> Visitor<'a> for All<'_> {
    type Pending = Child;

    fn t_max(&self) -> f32 {
        self.t_max
    }

    #[inline(always)]
    fn lend(&mut self) -> Self {
        Self { t_max: self.t_max, hits: self.hits.take() }
    }

    fn hit(&mut self, found: Found<'a>) -> ControlFlow<()> {
        if let Some(hits) = &mut self.hits {
            hits.push(found.into());
        }
        ControlFlow::Continue(())
    }
}

impl<'a, 'h> Question<'a> for All<'h> {
    type Seed = &'h mut Vec<Hit>;
    type Answer = ();

    fn begin(ray: &Ray, hits: &'h mut Vec<Hit>) -> Self {
        Self { t_max: ray.t_max, hits: Some(hits) }
    }

    fn answer(self) {}
}

/// Appends the hits of the ray to `hits`, ordered by `(t, inst, geom, prim)`.
pub(crate) fn all(structure: &Structure, ray: &Ray, hits: &mut Vec<Hit>) {
    let start = hits.len();
    ask_simply::<All<'_>, _>(structure, ray, hits, &mut ());
    hits[start..].sort_unstable_by(Hit::cmp_along_ray);
    drop_repeated(hits, start);
}

/// Keeps one of each run of equals from `start` on: what lies in several leaves is met in each of
/// them, with the same bits.
fn drop_repeated(hits: &mut Vec<Hit>, start: usize) {
    let mut kept = start;
    for at in start..hits.len() {
        if kept == start || hits[kept - 1].id() != hits[at].id() {
            hits[kept] = hits[at];
            kept += 1;
        }
    }
    hits.truncate(kept);
}
