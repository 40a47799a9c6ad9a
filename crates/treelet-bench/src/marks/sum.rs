//! Adds up the cells of a mark.

use super::cells::{Cell, Cells};
use super::{Mark, Standing};
use crate::stats::Ratio;

/// Which way is better.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Better {
    /// Speed.
    More,
    /// Memory.
    Less,
}

/// What is asked of a mark.
#[derive(Clone, Copy)]
pub(super) struct Asked {
    /// Of the geometric mean.
    pub(super) mean: f64,
    /// Of the worst cell, if anything.
    pub(super) worst: Option<f64>,
    /// Which way is better.
    pub(super) better: Better,
}

impl Asked {
    /// At least that in the mean and in the worst cell.
    pub(super) const fn at_least(mean: f64, worst: f64) -> Self {
        Self { mean, worst: Some(worst), better: Better::More }
    }

    /// At least that in the mean.
    pub(super) const fn mean_at_least(mean: f64) -> Self {
        Self { mean, worst: None, better: Better::More }
    }

    /// At most that in the mean and perhaps in the worst cell.
    pub(super) const fn at_most(mean: f64, worst: Option<f64>) -> Self {
        Self { mean, worst, better: Better::Less }
    }

    /// How a ratio stands to what was asked of it.
    fn standing(&self, ratio: &Ratio, asked: f64) -> Standing {
        let (by_median, by_interval) = match self.better {
            Better::More => (ratio.median >= asked, ratio.high >= asked),
            Better::Less => (ratio.median <= asked, ratio.low <= asked),
        };
        match (by_median, by_interval) {
            (true, _) => Standing::Met,
            (false, true) => Standing::MetByInterval,
            (false, false) => Standing::NotMet,
        }
    }
}

/// Sums up the cells of a mark.
pub(super) fn mark(what: String, cells: Cells, asked: Asked) -> Mark {
    let Cells { there, lacking } = cells;
    let mut mark = Mark {
        what,
        mean_asked: asked.mean,
        worst_asked: asked.worst,
        mean: None,
        interval: None,
        worst: None,
        worst_interval: None,
        worst_scene: None,
        cells: there.len(),
        lacking,
        standing: Standing::NotMeasured,
    };
    let by_median = |a: &&Cell, b: &&Cell| a.1.median.total_cmp(&b.1.median);
    let worst_cell = match asked.better {
        Better::More => there.iter().min_by(by_median),
        Better::Less => there.iter().max_by(by_median),
    };
    let Some((place, at_worst)) = worst_cell else { return mark };
    let ratios: Vec<Ratio> = there.iter().map(|(_, ratio)| *ratio).collect();
    let over_all = Ratio::geometric_mean(&ratios);
    let of_mean = asked.standing(&over_all, asked.mean);
    let of_worst = asked.worst.map_or(Standing::Met, |worst| asked.standing(at_worst, worst));
    mark.mean = Some(over_all.median);
    mark.interval = Some([over_all.low, over_all.high]);
    mark.worst = Some(at_worst.median);
    mark.worst_interval = Some([at_worst.low, at_worst.high]);
    mark.worst_scene = Some(place.clone());
    mark.standing = of_mean.max(of_worst);
    mark
}

/// A mark that counts only where another is met.
pub(super) fn on_condition(mut mark: Mark, condition: &Mark) -> Mark {
    if mark.standing < Standing::NotMet {
        mark.standing = mark.standing.max(condition.standing);
        if mark.standing == Standing::NotMeasured {
            mark.lacking = mark.lacking.or_else(|| condition.lacking.clone());
        }
    }
    mark
}

#[cfg(test)]
mod tests {
    use super::{Asked, Better, Cells, Standing, mark, on_condition};
    use crate::stats::Ratio;

    fn cells(medians: &[(&str, f64)]) -> Cells {
        let cell = |&(name, median): &(&str, f64)| {
            (name.to_owned(), Ratio { median, low: median * 0.99, high: median * 1.01 })
        };
        Cells { there: medians.iter().map(cell).collect(), lacking: None }
    }

    fn standing(medians: &[f64]) -> Standing {
        let named: Vec<_> = medians.iter().map(|&median| ("x", median)).collect();
        mark(String::new(), cells(&named), Asked::at_least(1.25, 1.0)).standing
    }

    #[test]
    fn a_mark_needs_its_mean_and_its_worst_cell() {
        assert_eq!(standing(&[1.3, 1.3]), Standing::Met);
        assert_eq!(standing(&[1.0, 1.6]), Standing::Met);
        assert_eq!(standing(&[0.995, 1.6]), Standing::MetByInterval, "the interval reaches 1");
        assert_eq!(standing(&[0.9, 2.0]), Standing::NotMet, "the worst cell");
        assert_eq!(standing(&[1.1, 1.2]), Standing::NotMet, "the mean");
        assert_eq!(standing(&[]), Standing::NotMeasured);
    }

    #[test]
    fn the_worst_cell_is_named_either_way() {
        let of = |better| {
            let asked = Asked { mean: 60.0, worst: Some(75.0), better };
            mark(String::new(), cells(&[("small", 50.0), ("large", 70.0)]), asked)
        };
        assert_eq!(of(Better::Less).worst_scene.as_deref(), Some("large"));
        assert_eq!(of(Better::More).worst_scene.as_deref(), Some("small"));
        assert_eq!(of(Better::Less).standing, Standing::Met);
    }

    #[test]
    fn a_condition_that_is_not_met_takes_the_mark_with_it() {
        let of = |median| mark(String::new(), cells(&[("x", median)]), Asked::mean_at_least(1.0));
        let unmeasured = mark(String::new(), Cells::default(), Asked::mean_at_least(1.0));
        assert_eq!(on_condition(of(2.0), &of(2.0)).standing, Standing::Met);
        assert_eq!(on_condition(of(2.0), &of(0.5)).standing, Standing::NotMet);
        assert_eq!(on_condition(of(2.0), &unmeasured).standing, Standing::NotMeasured);
        assert_eq!(on_condition(of(0.5), &of(2.0)).standing, Standing::NotMet);
        assert_eq!(on_condition(of(0.5), &unmeasured).standing, Standing::NotMet);
    }
}
