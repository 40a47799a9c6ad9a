//! The same questions for many rays at once, on all threads of the caller's rayon pool.

use super::upkeep::TIMED_MIN;
use super::{Scene, WrongLength};
use crate::context::clock::Stopwatch;
use crate::context::parallel;
use crate::geometry::Hit;
use crate::math::Ray;
use crate::query;
use alloc::vec::Vec;

/// Rays that one task answers, one after the other.
const CHUNK: usize = 1024;

/// Rays that one task answers as packets and streams: so many are sorted at once anyway, and slices of a
/// few ten thousand are to keep several threads busy.
const PIECE: usize = 16_384;

impl Scene {
    /// [`Scene::closest`] for each ray; `hits[i]` answers `rays[i]`, [`Hit::MISS`] if it meets
    /// nothing.
    ///
    /// # Errors
    ///
    /// The slices differ in length; then nothing is written.
    pub fn closest_many(&self, rays: &[Ray], hits: &mut [Hit]) -> Result<(), WrongLength> {
        self.in_pieces(rays, hits, PIECE, |rays, hits| {
            query::many::closest_many(self.structure(), rays, hits);
        })
    }

    /// [`Scene::any`] for each ray.
    ///
    /// # Errors
    ///
    /// The slices differ in length; then nothing is written.
    pub fn any_many(&self, rays: &[Ray], answers: &mut [bool]) -> Result<(), WrongLength> {
        self.in_pieces(rays, answers, PIECE, |rays, answers| {
            query::many::any_many(self.structure(), rays, answers);
        })
    }

    /// [`Scene::count`] for each ray.
    ///
    /// # Errors
    ///
    /// The slices differ in length; then nothing is written.
    pub fn count_many(&self, rays: &[Ray], answers: &mut [u64]) -> Result<(), WrongLength> {
        self.in_pieces(rays, answers, CHUNK, |rays, answers| {
            rays.iter().zip(answers).for_each(|(ray, out)| *out = self.count(ray));
        })
    }

    /// [`Scene::all`] for each ray.
    pub fn all_many(&self, rays: &[Ray]) -> HitLists {
        self.metered(rays.len(), || self.lists(rays))
    }

    fn lists(&self, rays: &[Ray]) -> HitLists {
        let chunks = parallel::map_chunks(rays, CHUNK, |_, rays| {
            let mut lists = HitLists::default();
            for ray in rays {
                query::all::all(self.structure(), ray, &mut lists.hits);
                lists.ends.push(lists.hits.len());
            }
            lists
        });
        let mut all = HitLists::default();
        for chunk in chunks {
            let start = all.hits.len();
            all.ends.extend(chunk.ends.into_iter().map(|end| start + end));
            all.hits.extend(chunk.hits);
        }
        all
    }

    fn in_pieces<A: Send>(
        &self,
        rays: &[Ray],
        answers: &mut [A],
        piece: usize,
        answer: impl Fn(&[Ray], &mut [A]) + Sync + Send,
    ) -> Result<(), WrongLength> {
        if rays.len() != answers.len() {
            return Err(WrongLength { rays: rays.len(), answers: answers.len() });
        }
        self.metered(rays.len(), || parallel::zip_chunks_mut(rays, answers, piece, answer));
        Ok(())
    }

    /// Takes the time of a slice where somebody wants to know it.
    fn metered<R>(&self, rays: usize, ask: impl FnOnce() -> R) -> R {
        if self.auto.is_none() && rays < TIMED_MIN {
            return ask();
        }
        let clock = Stopwatch::start();
        let answer = ask();
        self.note_traced(rays as u64, clock.elapsed());
        answer
    }
}

/// The hits of many rays, one list a ray.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HitLists {
    /// All lists, one after the other.
    hits: Vec<Hit>,
    /// Where each list ends.
    ends: Vec<usize>,
}

impl HitLists {
    /// How many rays were asked.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether no ray was asked.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The hits of ray `i`, ordered along it; `None` if there is no such ray.
    pub fn get(&self, i: usize) -> Option<&[Hit]> {
        let end = *self.ends.get(i)?;
        let start = if i == 0 { 0 } else { self.ends[i - 1] };
        self.hits.get(start..end)
    }

    /// All hits, ray after ray.
    pub fn hits(&self) -> &[Hit] {
        &self.hits
    }
}
