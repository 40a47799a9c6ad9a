//! Tracing one kind of rays through everything that was built: checked, then timed in turn.

use treelet::Ray;

use super::builds::Contender;
use super::{BenchError, Plan, Subject, Watcher, stop};
use crate::check::{self, Difference};
use crate::crew::Crew;
use crate::engine::{Answer, Api, Call, Question};
use crate::rays::Kind;
use crate::report::{Order, Trace};
use crate::rivals::treelet as ours;
use crate::rounds::{Work, measure};
use crate::stats::{median, spread};

/// Rays of one kind in one order, for all contenders.
pub(crate) struct Group<'a> {
    pub(crate) subject: &'a Subject,
    pub(crate) plan: &'a Plan,
    pub(crate) crew: &'a Crew,
    pub(crate) kind: Kind,
    pub(crate) order: Order,
    pub(crate) rays: &'a [Ray],
}

/// A contender, a way to hand it the rays, and how wide.
struct Cell<'a> {
    contender: &'a Contender,
    call: Call,
    width: usize,
}

impl Group<'_> {
    /// Checks every answer, then measures all in turn.
    pub(crate) fn trace(
        &self,
        contenders: &[Contender],
        watcher: &dyn Watcher,
    ) -> Result<Vec<Trace>, BenchError> {
        if self.rays.is_empty() {
            return Ok(Vec::new());
        }
        let cells = self.cells(contenders);
        let works: Vec<Work<'_>> = cells.iter().map(|cell| self.work(cell)).collect();
        let differences = self.check(&cells, &works)?;
        let stopped = || watcher.stopped();
        let seconds = measure(self.crew, &works, self.plan.rounds, &stopped);
        stop(watcher)?;
        let lines = cells.iter().zip(differences).zip(seconds);
        Ok(lines
            .map(|((cell, difference), seconds)| self.line(cell, difference, seconds))
            .collect())
    }

    /// Every contender in every way that suits these rays.
    fn cells<'a>(&self, contenders: &'a [Contender]) -> Vec<Cell<'a>> {
        let mut cells = Vec::new();
        for contender in contenders {
            // Shuffled rays are a question to those that take many at once.
            let takes_many = |call: &Call| call.api == Api::Many && call.width != ours::LOOP;
            let shuffled = self.order == Order::Shuffled;
            if shuffled && !contender.calls.iter().any(takes_many) {
                continue;
            }
            for &call in &contender.calls {
                if shuffled && call.width == ours::LOOP {
                    continue;
                }
                // The hint is for rays that are what it says. On kitchen_bitterli it made Embree's
                // packets of 16 2.6 times as fast for primary rays and 1.05 for shadow rays, but
                // 0.70 for occlusion, 0.55 for diffuse and 0.33 for random ones.
                let coherent = matches!(self.kind, Kind::Primary | Kind::Shadow);
                if call.coherent && (shuffled || !coherent) {
                    continue;
                }
                let widths = if call.width == Call::SLICE {
                    self.plan.slices_in(self.order, self.rays.len())
                } else {
                    vec![call.width]
                };
                cells.extend(widths.into_iter().map(|width| Cell { contender, call, width }));
            }
        }
        cells
    }

    /// The rays in a cell's form.
    fn work<'a>(&'a self, cell: &Cell<'a>) -> Work<'a> {
        let Cell { contender, call, width } = *cell;
        Work::new(&*contender.built, call, self.kind.question(), self.rays, width)
    }

    /// Holds all answers against those of the first of treelet's cells, treelet's own in every bit.
    fn check(&self, cells: &[Cell<'_>], works: &[Work<'_>]) -> Result<Vec<Difference>, BenchError> {
        let mut reference: Option<(String, Vec<Answer>)> = None;
        let mut differences = Vec::new();
        for (cell, work) in cells.iter().zip(works) {
            work.trace(self.crew, 1);
            let answers = work.answers();
            let label = format!("{} /{}", cell.contender.variant, cell.width);
            let (first, expected) =
                reference.get_or_insert_with(|| (label.clone(), answers.clone()));
            if cell.contender.engine == ours::NAME
                && let Some(ray) = check::first_bit_difference(expected, &answers)
            {
                return Err(BenchError::Bits {
                    scene: self.subject.name.clone(),
                    kind: self.kind.name(),
                    variant: label,
                    reference: first.clone(),
                    ray,
                });
            }
            differences.push(check::compare(expected, &answers));
        }
        Ok(differences)
    }

    /// What is told about a cell.
    fn line(&self, cell: &Cell<'_>, difference: Difference, seconds: Vec<f64>) -> Trace {
        let asked_which = self.kind.question() == Question::Closest;
        Trace {
            scene: self.subject.name.clone(),
            engine: cell.contender.engine.clone(),
            variant: cell.contender.variant.clone(),
            kind: self.kind,
            api: cell.call.api,
            width: cell.width,
            threads: self.crew.threads(),
            rays: self.rays.len() as u64,
            mrays_per_s: self.rays.len() as f64 / median(&seconds) * 1e-6,
            spread: spread(&seconds),
            mismatch_ppm: difference.mismatch_ppm,
            ids_ppm: asked_which.then_some(difference.ids_ppm),
            order: self.order,
            coherent: cell.call.coherent,
            seconds,
        }
    }
}
