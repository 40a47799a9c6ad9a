//! What the library chose for a number of rays, and why; for programs and for people.

use serde::Serialize;
use treelet::{Candidate, Choice};
use treelet_model::PlacedModel;

use crate::session::say;

/// Of the scene with the most triangles, if there are several: each chooses for itself.
#[derive(Serialize)]
pub(crate) struct ChoiceReport {
    rays: u64,
    variant: String,
    /// Expected seconds of build and rays, choosing included.
    predicted_s: f64,
    choosing_s: f64,
    reason: String,
    candidates: Vec<CandidateReport>,
}

#[derive(Serialize)]
struct CandidateReport {
    variant: String,
    build_s: f64,
    ray_ns: f64,
    /// Whether it was built and traced here; otherwise both are expectations.
    measured: bool,
}

impl ChoiceReport {
    /// `None` where nothing was left to choose.
    pub(crate) fn of(placed: &PlacedModel) -> Option<Self> {
        let largest = placed.reports().max_by_key(|report| report.triangles)?;
        let Choice { rays, variant, predicted, choosing, reason, candidates } =
            largest.choice.clone()?;
        let (predicted_s, choosing_s) = (predicted.as_secs_f64(), choosing.as_secs_f64());
        let candidates = candidates.into_iter().map(CandidateReport::from).collect();
        Some(Self { rays, variant, predicted_s, choosing_s, reason, candidates })
    }

    /// Says what was chosen, and why.
    pub(crate) fn tell(&self) {
        let tried = self.candidates.iter().filter(|each| each.measured).count();
        let tried = if tried > 1 { format!(" ({tried} were tried)") } else { String::new() };
        say(&format!("chose `{}`{tried}: {}", self.variant, self.reason));
    }
}

impl From<Candidate> for CandidateReport {
    fn from(candidate: Candidate) -> Self {
        let Candidate { variant, build, ray_ns, measured } = candidate;
        Self { variant, build_s: build.as_secs_f64(), ray_ns, measured }
    }
}
