//! What treelet has set itself, and how far it is: against Embree, over the scenes that were given.

use serde::Serialize;

use crate::engine::Api;
use crate::rays::Kind;
use crate::report::{Build, Order, SceneLine, Trace};
use crate::rivals::embree::NAME as EMBREE;
use crate::rivals::treelet as ours;
use crate::stats::Ratio;

/// How a mark stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Standing {
    /// The intervals of the mean and of the worst cell reach what was asked.
    Met,
    /// One does not.
    NotMet,
    /// Cells are lacking.
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
    /// The geometric mean over the scenes.
    pub mean: Option<f64>,
    /// Its interval.
    pub interval: Option<[f64; 2]>,
    /// The worst cell.
    pub worst: Option<f64>,
    /// Where that is.
    pub worst_scene: Option<String>,
    /// Cells that count.
    pub cells: usize,
    /// Whether it is met.
    pub standing: Standing,
}

/// A cell of a mark: where, and the ratio there.
type Cell = (String, Ratio);

/// Which slices count.
type Length<'a> = &'a dyn Fn(&Trace) -> bool;

/// Which way is better.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Better {
    More,
    Less,
}

/// All marks over what was measured.
pub fn marks(scenes: &[SceneLine], builds: &[Build], traces: &[Trace]) -> Vec<Mark> {
    let facts = Facts { scenes, builds, traces };
    let mut marks = Vec::new();
    let best = facts.best();
    for threads in facts.thread_counts() {
        facts.trace_marks(threads, best.as_deref(), &mut marks);
        facts.build_marks(threads, &mut marks);
    }
    facts.memory_marks(&mut marks);
    marks
}

struct Facts<'a> {
    scenes: &'a [SceneLine],
    builds: &'a [Build],
    traces: &'a [Trace],
}

impl Facts<'_> {
    /// One, and whatever else was measured.
    fn thread_counts(&self) -> Vec<usize> {
        let mut counts: Vec<usize> = self.traces.iter().map(|trace| trace.threads).collect();
        counts.extend(self.builds.iter().map(|build| build.threads));
        counts.push(1);
        counts.sort_unstable();
        counts.dedup();
        counts
    }

    /// The variant that stands for treelet's best build: the one that says so, or the one that is
    /// fastest on single rays in the mean over all cells.
    fn best(&self) -> Option<String> {
        let mut names: Vec<&str> = Vec::new();
        for trace in self.traces.iter().filter(|trace| trace.engine == ours::NAME) {
            if !names.contains(&trace.variant.as_str()) {
                names.push(&trace.variant);
            }
        }
        if let Some(name) = ["best", "high"].into_iter().find(|name| names.contains(name)) {
            return Some(name.to_owned());
        }
        let worth = |name: &str| {
            let ours = self.traces.iter().filter(|t| t.engine == ours::NAME && t.api == Api::One);
            ours.filter(|t| t.variant == name).map(|t| t.mrays_per_s.ln()).sum::<f64>()
        };
        let best = names.into_iter().max_by(|a, b| worth(a).total_cmp(&worth(b)));
        best.map(str::to_owned)
    }

    /// The marks about rays.
    fn trace_marks(&self, threads: usize, best: Option<&str>, marks: &mut Vec<Mark>) {
        let default = ours::default_variant();
        let with = if threads == 1 { "1 thread".to_owned() } else { format!("{threads} threads") };
        let best = best.unwrap_or("best");

        // One ray at a time, each kind.
        for (variant, rival) in [(default, "MEDIUM"), (best, "HIGH")] {
            for kind in Kind::ALL {
                let cells = self.trace_cells(|scene| {
                    let pick = |engine: &str, variant: &str, api| {
                        self.find(scene, threads, kind, Order::Given, |t| {
                            t.engine == engine && t.variant == variant && t.api == api
                        })
                    };
                    Some(pick(ours::NAME, variant, Api::One)?.ratio(pick(EMBREE, rival, Api::One)?))
                });
                let what = format!("single {}, {variant} / Embree {rival}, {with}", kind.name());
                marks.push(mark(what, &cells, 1.25, Some(1.0), Better::More));
            }
        }

        // Slices, each kind; of all the rays in both orders, and short ones.
        let whole = |trace: &Trace| trace.width as u64 == trace.rays;
        let short = |trace: &Trace| trace.width == SHORT_SLICE;
        let rows: [(&str, Order, f64, Length<'_>); 3] = [
            ("slices", Order::Given, 1.4, &whole),
            ("shuffled slices", Order::Shuffled, 1.5, &whole),
            ("slices of 1024", Order::Given, 1.15, &short),
        ];
        for (name, order, asked, length) in rows {
            for kind in Kind::ALL {
                let cells = self
                    .trace_cells(|scene| self.slices(scene, threads, kind, order, best, length));
                let what = format!("{name} {}, {best} / best of Embree HIGH, {with}", kind.name());
                marks.push(mark(what, &cells, asked, Some(1.0), Better::More));
            }
        }
        let generated = |scene: &str| self.scenes.iter().any(|s| s.generated && s.scene == scene);
        let cells = self.trace_cells(|scene| {
            let kind = Kind::Random;
            generated(scene)
                .then(|| self.slices(scene, threads, kind, Order::Given, best, &whole))
                .flatten()
        });
        let what = format!("slices random, generated scenes, {best} / best of Embree HIGH, {with}");
        marks.push(mark(what, &cells, 1.6, Some(1.4), Better::More));

        // The compact layout.
        if threads == 1 {
            let cells = self.cells_of(|scene, kind| {
                let pick = |variant: &str| {
                    self.find(scene, threads, kind, Order::Given, |t| {
                        t.engine == ours::NAME && t.variant == variant && t.api == Api::One
                    })
                };
                Some(pick(COMPACT)?.ratio(pick(default)?))
            });
            let what = format!("compact layout / default layout, single rays, {with}");
            marks.push(mark(what, &cells, 0.85, Some(0.7), Better::More));
            let what = format!("single-ray call / inlined loop, {with}");
            marks.push(mark(what, &[], 0.97, None, Better::More));
        }
    }

    /// The marks about building.
    fn build_marks(&self, threads: usize, marks: &mut Vec<Mark>) {
        let with = if threads == 1 { "1 thread".to_owned() } else { format!("{threads} threads") };
        for (variant, rival) in [(ours::default_variant(), "MEDIUM"), (FAST, "LOW")] {
            let cells = self.trace_cells(|scene| {
                let ours = self.find_build(scene, ours::NAME, variant, threads)?;
                Some(ours.ratio(self.find_build(scene, EMBREE, rival, threads)?))
            });
            let what = format!("build, {variant} / Embree {rival}, {with}");
            marks.push(mark(what, &cells, 1.5, Some(1.0), Better::More));
        }
        let cells = self.cells_of(|scene, kind| {
            let pick = |engine: &str, variant: &str| {
                self.find(scene, threads, kind, Order::Given, |t| {
                    t.engine == engine && t.variant == variant && t.api == Api::One
                })
            };
            Some(pick(ours::NAME, FAST)?.ratio(pick(EMBREE, "LOW")?))
        });
        let what = format!("tracing that build's tree, {FAST} / Embree LOW, {with}");
        marks.push(mark(what, &cells, 1.0, None, Better::More));
    }

    /// The marks about memory; they do not depend on threads, so those of the first count stand.
    fn memory_marks(&self, marks: &mut Vec<Mark>) {
        let threads = self.builds.iter().map(|build| build.threads).min().unwrap_or(1);
        let exact = |value: f64| Ratio { median: value, low: value, high: value };
        let default = ours::default_variant();
        for (variant, asked, worst) in [(default, 60.0, 75.0), (COMPACT, 30.0, 40.0)] {
            let cells = self.trace_cells(|scene| {
                Some(exact(self.find_build(scene, ours::NAME, variant, threads)?.bytes_per_tri))
            });
            let what = format!("bytes a triangle, {variant}");
            marks.push(mark(what, &cells, asked, Some(worst), Better::Less));
        }
        for (variant, asked) in [(default, 96.0), (FAST, 64.0)] {
            let cells = self.trace_cells(|scene| {
                let build = self.find_build(scene, ours::NAME, variant, threads)?;
                // Nothing at all above the result has no logarithm.
                Some(exact((build.peak_bytes_per_tri? - build.bytes_per_tri).max(0.1)))
            });
            let what = format!("peak of a build above its result, bytes a triangle, {variant}");
            marks.push(mark(what, &cells, asked, None, Better::Less));
        }
    }

    /// A cell a scene, where there is one.
    fn trace_cells(&self, cell: impl Fn(&str) -> Option<Ratio>) -> Vec<Cell> {
        let names = self.scenes.iter().map(|scene| scene.scene.as_str());
        names.filter_map(|name| Some((name.to_owned(), cell(name)?))).collect()
    }

    /// A cell a scene and kind, where there is one.
    fn cells_of(&self, cell: impl Fn(&str, Kind) -> Option<Ratio>) -> Vec<Cell> {
        let pairs = self.scenes.iter().flat_map(|s| Kind::ALL.map(|kind| (s.scene.as_str(), kind)));
        pairs
            .filter_map(|(name, kind)| Some((format!("{name} {}", kind.name()), cell(name, kind)?)))
            .collect()
    }

    /// treelet's slices against the fastest way through Embree's HIGH tree.
    fn slices(
        &self,
        scene: &str,
        threads: usize,
        kind: Kind,
        order: Order,
        best: &str,
        length: Length<'_>,
    ) -> Option<Ratio> {
        let ours = self.find(scene, threads, kind, order, |t| {
            t.engine == ours::NAME && t.variant == best && t.api == Api::Many && length(t)
        })?;
        let theirs = self.of_group(scene, threads, kind, order);
        let theirs = theirs.filter(|t| t.engine == EMBREE && t.variant == "HIGH");
        let theirs = theirs.max_by(|a, b| a.mrays_per_s.total_cmp(&b.mrays_per_s))?;
        Some(ours.ratio(theirs))
    }

    /// The traces that were measured in turn with each other.
    fn of_group(
        &self,
        scene: &str,
        threads: usize,
        kind: Kind,
        order: Order,
    ) -> impl Iterator<Item = &Trace> {
        self.traces.iter().filter(move |t| {
            t.scene == scene && t.threads == threads && t.kind == kind && t.order == order
        })
    }

    fn find(
        &self,
        scene: &str,
        threads: usize,
        kind: Kind,
        order: Order,
        is_it: impl Fn(&Trace) -> bool,
    ) -> Option<&Trace> {
        self.of_group(scene, threads, kind, order).find(|trace| is_it(trace))
    }

    fn find_build(
        &self,
        scene: &str,
        engine: &str,
        variant: &str,
        threads: usize,
    ) -> Option<&Build> {
        self.builds.iter().find(|build| {
            build.scene == scene
                && build.engine == engine
                && build.variant == variant
                && build.threads == threads
        })
    }
}

/// The variant that is built fastest for its worth.
const FAST: &str = "fast";
/// The variant for scenes that outgrow the cache.
const COMPACT: &str = "compact";
/// Rays of a short slice.
const SHORT_SLICE: usize = 1024;

/// Sums up the cells of a mark.
fn mark(what: String, cells: &[Cell], mean: f64, worst: Option<f64>, better: Better) -> Mark {
    let mut mark = Mark {
        what,
        mean_asked: mean,
        worst_asked: worst,
        mean: None,
        interval: None,
        worst: None,
        worst_scene: None,
        cells: cells.len(),
        standing: Standing::NotMeasured,
    };
    let by_median = |a: &&Cell, b: &&Cell| a.1.median.total_cmp(&b.1.median);
    let worst_cell = match better {
        Better::More => cells.iter().min_by(by_median),
        Better::Less => cells.iter().max_by(by_median),
    };
    let Some((place, at_worst)) = worst_cell else { return mark };
    let ratios: Vec<Ratio> = cells.iter().map(|(_, ratio)| *ratio).collect();
    let over_all = Ratio::geometric_mean(&ratios);
    let reaches = |ratio: &Ratio, asked: f64| match better {
        Better::More => ratio.high >= asked,
        Better::Less => ratio.low <= asked,
    };
    let met = reaches(&over_all, mean) && worst.is_none_or(|asked| reaches(at_worst, asked));
    mark.mean = Some(over_all.median);
    mark.interval = Some([over_all.low, over_all.high]);
    mark.worst = Some(at_worst.median);
    mark.worst_scene = Some(place.clone());
    mark.standing = if met { Standing::Met } else { Standing::NotMet };
    mark
}

#[cfg(test)]
mod tests {
    use super::{Better, Standing, mark};
    use crate::stats::Ratio;

    fn cell(name: &str, median: f64) -> (String, Ratio) {
        (name.to_owned(), Ratio { median, low: median * 0.99, high: median * 1.01 })
    }

    #[test]
    fn a_mark_needs_its_mean_and_its_worst_cell() {
        let standing = |cells: &[f64]| {
            let cells: Vec<_> = cells.iter().map(|&value| cell("x", value)).collect();
            mark(String::new(), &cells, 1.25, Some(1.0), Better::More).standing
        };
        assert_eq!(standing(&[1.3, 1.3]), Standing::Met);
        assert_eq!(standing(&[1.0, 1.6]), Standing::Met);
        assert_eq!(standing(&[0.995, 1.6]), Standing::Met, "the interval reaches 1");
        assert_eq!(standing(&[0.9, 2.0]), Standing::NotMet, "the worst cell");
        assert_eq!(standing(&[1.1, 1.2]), Standing::NotMet, "the mean");
        assert_eq!(standing(&[]), Standing::NotMeasured);
    }

    #[test]
    fn the_worst_cell_is_named_either_way() {
        let cells = [cell("small", 50.0), cell("large", 70.0)];
        let mark_of = |better| mark(String::new(), &cells, 60.0, Some(75.0), better);
        assert_eq!(mark_of(Better::Less).worst_scene.as_deref(), Some("large"));
        assert_eq!(mark_of(Better::More).worst_scene.as_deref(), Some("small"));
        assert_eq!(mark_of(Better::Less).standing, Standing::Met);
    }
}
