//! What treelet has set itself, and how far it is: against Embree, over the scenes that were given.
//!
//! `rows` says what is compared, `cells` finds the measured numbers, `sum` adds a row up.

mod cells;
mod rows;
mod sum;

use serde::Serialize;

use crate::report::{Build, SceneLine, Trace};

/// Rays of a short slice.
pub const SHORT_SLICE: usize = 1024;

/// How a mark stands, the better first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Standing {
    /// The mean and the worst cell reach what was asked.
    Met,
    /// Their intervals reach it, the medians do not: with less noise it could be either.
    MetByInterval,
    /// One does not.
    NotMet,
    /// There is no cell.
    NotMeasured,
}

/// One mark.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mark {
    /// What is compared.
    pub what: String,
    /// What the geometric mean must reach; for bytes, must not pass.
    pub mean_asked: f64,
    /// What the worst cell must reach; for bytes, must not pass.
    pub worst_asked: Option<f64>,
    /// The geometric mean over the cells.
    pub mean: Option<f64>,
    /// The interval that holds it with 95 % confidence.
    pub interval: Option<[f64; 2]>,
    /// The worst cell.
    pub worst: Option<f64>,
    /// Its interval.
    pub worst_interval: Option<[f64; 2]>,
    /// Where that is.
    pub worst_scene: Option<String>,
    /// Cells that count.
    pub cells: usize,
    /// What the first of the lacking cells lacks.
    pub lacking: Option<String>,
    /// Whether it is met.
    pub standing: Standing,
}

/// All marks over what was measured, with one thread and with whatever else there is.
pub fn marks(scenes: &[SceneLine], builds: &[Build], traces: &[Trace]) -> Vec<Mark> {
    let facts = cells::Facts { scenes, builds, traces };
    let mut marks = Vec::new();
    for threads in facts.thread_counts() {
        rows::tracing(&facts, threads, &mut marks);
        if facts.has_instances() {
            rows::instances(&facts, threads, &mut marks);
        }
        rows::building(&facts, threads, &mut marks);
    }
    rows::memory(&facts, &mut marks);
    rows::own_costs(&facts, &mut marks);
    marks
}

#[cfg(test)]
mod tests;
