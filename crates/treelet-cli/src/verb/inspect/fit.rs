//! How well measures of trees predict what rays take.
//!
//! Source: T. Aila, T. Karras, S. Laine, "On Quality Metrics of Bounding Volume Hierarchies", HPG
//! 2013: the time of a ray as a weighted sum of SAH, EPO and LCV, the weights fitted for each scene.
//! Differs from it: no weight is negative, a constant stands for what a ray costs in any tree, and
//! the sum of squared *relative* errors is what is least. (Without the constant, EPO's weight came out
//! as 0 for a kitchen whose worst tree has 3.7 times the SAH of its best, 9 times the EPO, and 2.3
//! times the time.) Besides the correlation, which grows with every measure that
//! is added, it tells the error for trees that the fit has not seen: each tree in turn is left out,
//! with those that measure exactly the same, and predicted from the others.

use serde::Serialize;

use crate::session::say;

/// What predicts, by index into [`Row::terms`].
const MODELS: [(&str, &[usize]); 3] =
    [("SAH", &[0, 1]), ("SAH+EPO", &[0, 1, 2]), ("SAH+EPO+LCV", &[0, 1, 2, 3])];

/// A constant, SAH, EPO, LCV.
const TERMS: usize = 4;

/// A tree, and the rays of one kind through it.
#[derive(Clone, Debug)]
pub(super) struct Row {
    pub(super) scene: String,
    pub(super) kind: String,
    pub(super) variant: String,
    /// SAH, EPO, LCV.
    pub(super) measures: [f64; 3],
    /// A ray.
    pub(super) nanoseconds: f64,
}

impl Row {
    /// What may be weighted.
    fn terms(&self) -> [f64; TERMS] {
        let [sah, epo, lcv] = self.measures;
        [1.0, sah, epo, lcv]
    }
}

/// What one model makes of one scene and kind.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Fit {
    pub(super) scene: String,
    pub(super) kind: String,
    pub(super) model: &'static str,
    /// Nanoseconds for any ray, and for each unit of SAH, EPO and LCV.
    weights: [f64; TERMS],
    /// Pearson's r of fitted and measured times.
    correlation: f64,
    /// The mean relative error for trees left out.
    error: f64,
    pub(super) points: Vec<Point>,
}

/// One tree.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Point {
    pub(super) variant: String,
    /// From the other trees, in nanoseconds.
    pub(super) predicted: f64,
    pub(super) measured: f64,
}

/// One weight for all scenes: time goes with `(1 - epo_weight) SAH + epo_weight EPO`, a factor and a
/// constant for each scene.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Shared {
    kind: String,
    /// That with the least error.
    epo_weight: f64,
    /// The mean relative error with that weight.
    error: f64,
    /// With a weight of 0: SAH alone.
    error_of_sah: f64,
}

/// Every model for every scene and kind, in the rows' order.
pub(super) fn fits(rows: &[Row]) -> Vec<Fit> {
    let mut fits = Vec::new();
    for group in groups(rows) {
        for (model, measures) in MODELS {
            let fitted = weights(&group, measures);
            let predicted: Vec<f64> = group.iter().map(|row| predict(&fitted, row)).collect();
            let measured: Vec<f64> = group.iter().map(|row| row.nanoseconds).collect();
            let points: Vec<Point> =
                group.iter().map(|row| left_out(&group, row, measures)).collect();
            let errors = points.iter().map(|point| (point.predicted / point.measured - 1.0).abs());
            fits.push(Fit {
                scene: group[0].scene.clone(),
                kind: group[0].kind.clone(),
                model,
                weights: fitted,
                correlation: correlation(&predicted, &measured),
                error: errors.sum::<f64>() / points.len() as f64,
                points,
            });
        }
    }
    fits
}

/// Rows of the same scene and kind.
fn groups(rows: &[Row]) -> Vec<Vec<&Row>> {
    let mut groups: Vec<Vec<&Row>> = Vec::new();
    for row in rows {
        let same =
            |group: &&mut Vec<&Row>| group[0].scene == row.scene && group[0].kind == row.kind;
        match groups.iter_mut().find(same) {
            Some(group) => group.push(row),
            None => groups.push(vec![row]),
        }
    }
    groups
}

/// A tree predicted from the others that are not the same.
fn left_out(group: &[&Row], row: &Row, measures: &[usize]) -> Point {
    let others: Vec<&Row> =
        group.iter().copied().filter(|other| other.measures != row.measures).collect();
    let predicted = predict(&weights(&others, measures), row);
    Point { variant: row.variant.clone(), predicted, measured: row.nanoseconds }
}

fn predict(weights: &[f64; TERMS], row: &Row) -> f64 {
    let terms = row.terms();
    (0..TERMS).map(|i| weights[i] * terms[i]).sum()
}

/// Weights, none negative, for the least sum of squared relative errors: of all choices of measures
/// that may count, the best whose weights turn out not negative.
fn weights(rows: &[&Row], measures: &[usize]) -> [f64; TERMS] {
    let mut best = (f64::INFINITY, [0.0; TERMS]);
    for chosen in 1_usize..1 << measures.len() {
        let columns: Vec<usize> = measures
            .iter()
            .enumerate()
            .filter(|(bit, _)| chosen >> bit & 1 == 1)
            .map(|(_, &m)| m)
            .collect();
        let Some(solved) = least_squares(rows, &columns) else { continue };
        if solved.iter().any(|&weight| weight < 0.0) {
            continue;
        }
        let error = |row: &&Row| (predict(&solved, row) / row.nanoseconds - 1.0).powi(2);
        let sum: f64 = rows.iter().map(error).sum();
        if sum < best.0 {
            best = (sum, solved);
        }
    }
    best.1
}

/// Weights of some measures by the normal equations; `None` where they do not determine them.
fn least_squares(rows: &[&Row], columns: &[usize]) -> Option<[f64; TERMS]> {
    let n = columns.len();
    // The equations, and in the last column what they shall give.
    let mut equations = [[0.0; TERMS + 1]; TERMS];
    for row in rows {
        let terms = row.terms();
        let x = |i: usize| terms[columns[i]] / row.nanoseconds;
        for i in 0..n {
            (0..n).for_each(|j| equations[i][j] += x(i) * x(j));
            equations[i][TERMS] += x(i);
        }
    }
    // Eliminate; the matrix is positive, so the diagonal does for pivots.
    /// A pivot that has lost this share of itself is noise.
    const SINGULAR: f64 = 1e-12;
    let diagonal = [0, 1, 2, 3].map(|i: usize| equations[i][i]);
    for i in 0..n {
        if equations[i][i] <= SINGULAR * diagonal[i] {
            return None;
        }
        for below in i + 1..n {
            let share = equations[below][i] / equations[i][i];
            (0..=TERMS).for_each(|j| equations[below][j] -= share * equations[i][j]);
        }
    }
    let mut weights = [0.0; TERMS];
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|j| equations[i][j] * weights[columns[j]]).sum();
        weights[columns[i]] = (equations[i][TERMS] - known) / equations[i][i];
    }
    Some(weights)
}

/// Pearson's r; 0 where one of the two does not vary.
fn correlation(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len() as f64;
    let (mean_x, mean_y) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
        x.iter().zip(y).map(|(x, y)| f(x - mean_x, y - mean_y)).sum()
    };
    let both = sum(&|x, y| x * y);
    let scale = (sum(&|x, _| x * x) * sum(&|_, y| y * y)).sqrt();
    if scale > 0.0 { both / scale } else { 0.0 }
}

/// The best weight of EPO for all scenes together, by kind.
pub(super) fn shared(rows: &[Row]) -> Vec<Shared> {
    let groups = groups(rows);
    let mut kinds: Vec<&str> = Vec::new();
    for group in &groups {
        if !kinds.contains(&group[0].kind.as_str()) {
            kinds.push(&group[0].kind);
        }
    }
    let of_kind = |kind: &str| {
        let groups: Vec<_> = groups.iter().filter(|group| group[0].kind == kind).collect();
        let error = |weight: f64| {
            groups.iter().map(|group| scaled_error(group, weight)).sum::<f64>()
                / groups.len() as f64
        };
        let weights = (0..=100).map(|percent| f64::from(percent) / 100.0);
        let tried = weights.map(|weight| (weight, error(weight)));
        let best = tried.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default();
        Shared {
            kind: kind.to_owned(),
            epo_weight: best.0,
            error: best.1,
            error_of_sah: error(0.0),
        }
    };
    kinds.into_iter().map(of_kind).collect()
}

/// The mean relative error of a scene's trees under one weight, with the best constant and factor
/// for the scene.
fn scaled_error(group: &[&Row], weight: f64) -> f64 {
    let joined: Vec<Row> = group
        .iter()
        .map(|row| {
            let [sah, epo, _] = row.measures;
            let joined = (1.0 - weight) * sah + weight * epo;
            Row { measures: [joined, 0.0, 0.0], ..(*row).clone() }
        })
        .collect();
    let joined: Vec<&Row> = joined.iter().collect();
    let fitted = weights(&joined, MODELS[0].1);
    let errors = joined.iter().map(|row| (predict(&fitted, row) / row.nanoseconds - 1.0).abs());
    errors.sum::<f64>() / joined.len() as f64
}

/// Prints a table for each kind of ray.
pub(super) fn tell(fits: &[Fit], shared: &[Shared]) {
    for shared in shared {
        say(&format!(
            "\n  {} rays: correlation of fitted and measured times, and mean error for trees left out",
            shared.kind
        ));
        let names = MODELS.map(|(name, _)| format!("{name:>18}")).concat();
        say(&format!("  {:18}{names}   EPO's weight", "scene"));
        let of_kind: Vec<&Fit> = fits.iter().filter(|fit| fit.kind == shared.kind).collect();
        let mut means = [(0.0, 0.0); MODELS.len()];
        let scenes = of_kind.len() / MODELS.len();
        for fits in of_kind.chunks(MODELS.len()) {
            for (mean, fit) in means.iter_mut().zip(fits) {
                mean.0 += fit.correlation / scenes as f64;
                mean.1 += fit.error / scenes as f64;
            }
            let cells: String = fits.iter().map(|fit| cell(fit.correlation, fit.error)).collect();
            let [_, sah, epo, _] = fits[1].weights;
            say(&format!("  {:18}{cells}   {:>12.2}", fits[0].scene, epo / (sah + epo)));
        }
        let cells: String = means.iter().map(|&(r, error)| cell(r, error)).collect();
        say(&format!("  {:18}{cells}", "mean"));
        say(&format!(
            "  one weight for all scenes: EPO at {:.2}, mean error {:.1} % (SAH alone: {:.1} %)",
            shared.epo_weight,
            100.0 * shared.error,
            100.0 * shared.error_of_sah
        ));
    }
}

fn cell(correlation: f64, error: f64) -> String {
    format!("{:>10.3} {:>5.1} %", correlation, 100.0 * error)
}

#[cfg(test)]
mod tests {
    use super::{Row, correlation, fits, shared};

    fn row(measures: [f64; 3], nanoseconds: f64) -> Row {
        let variant = format!("{measures:?}");
        Row { scene: "s".into(), kind: "k".into(), variant, measures, nanoseconds }
    }

    /// Times that are made of SAH and EPO are predicted by both, not by one.
    #[test]
    fn weights_are_found_again() {
        let made =
            |sah: f64, epo: f64, lcv: f64| row([sah, epo, lcv], 20.0 + 3.0 * sah + 7.0 * epo);
        let rows = [
            made(10.0, 3.0, 1.0),
            made(12.0, 1.0, 2.0),
            made(20.0, 9.0, 1.5),
            made(9.0, 5.0, 4.0),
            made(15.0, 2.0, 0.5),
            made(11.0, 4.0, 2.5),
        ];
        let fits = fits(&rows);
        assert!(fits[0].error > 0.03 && fits[0].correlation < 0.99, "{:?}", fits[0]);
        for fit in &fits[1..] {
            assert!(fit.error < 1e-6 && fit.correlation > 1.0 - 1e-6, "{fit:?}");
            let expected = [20.0, 3.0, 7.0, 0.0];
            assert!((0..4).all(|i| (fit.weights[i] - expected[i]).abs() < 1e-4), "{fit:?}");
        }
        let shared = &shared(&rows)[0];
        assert!((shared.epo_weight - 0.7).abs() < 1e-9 && shared.error < 1e-6, "{shared:?}");
    }

    #[test]
    fn weights_are_not_negative_and_a_tree_is_not_predicted_from_itself() {
        let rows = [
            row([1.0, 9.0, 0.0], 10.0),
            row([2.0, 1.0, 0.0], 20.0),
            row([3.0, 0.5, 0.0], 31.0),
            row([4.0, 0.1, 0.0], 45.0),
        ];
        let fits = fits(&rows);
        assert!(fits.iter().all(|fit| fit.weights.iter().all(|&weight| weight >= 0.0)), "{fits:?}");
        // The twin of the odd one must not help.
        let odd = row([1.0, 1.0, 1.0], 100.0);
        let with_twins = [odd.clone(), odd, row([1.0, 2.0, 0.0], 10.0), row([2.0, 1.0, 0.0], 20.0)];
        let fit = &super::fits(&with_twins)[0];
        assert!((fit.points[0].predicted - 10.0).abs() < 1e-6, "{fit:?}");
    }

    #[test]
    fn correlations_are_pearsons() {
        assert!((correlation(&[1.0, 2.0, 3.0], &[2.0, 4.0, 6.0]) - 1.0).abs() < 1e-12);
        assert!((correlation(&[1.0, 2.0, 3.0], &[1.0, 0.0, 1.0])).abs() < 1e-12);
        assert_eq!(correlation(&[1.0, 1.0], &[1.0, 2.0]), 0.0);
    }
}
