//! Single rays through a closure: all that the rivals from the crate registry need.
//!
//! Their traversals are generic code, compiled with the loop here and inlined as the compiler likes,
//! as they would be in their users' programs.

use crate::engine::{Answer, Pass};

/// Rays in an engine's own form, and how one is asked.
pub(super) struct Singles<R, F> {
    rays: Vec<R>,
    answers: Vec<Answer>,
    ask: F,
}

impl<R, F: Fn(&R) -> Answer> Singles<R, F> {
    pub(super) fn new(rays: Vec<R>, ask: F) -> Self {
        let answers = vec![Answer::MISS; rays.len()];
        Self { rays, answers, ask }
    }
}

impl<R: Send, F: Fn(&R) -> Answer + Send> Pass for Singles<R, F> {
    fn trace(&mut self) {
        for (ray, answer) in self.rays.iter().zip(&mut self.answers) {
            *answer = (self.ask)(ray);
        }
    }

    fn answers(&self, answers: &mut Vec<Answer>) {
        answers.extend_from_slice(&self.answers);
    }
}
