//! Who is drawn how: a colour means the same variant on the whole page.
//!
//! Those of ours that win the longest stretches of the axis get the eight colours, from the quickest
//! to build to the slowest; other engines are dashed, a pattern each; everybody else is thin and grey.
//! The colours (`style.css`) begin with P. Tol's "vibrant" scheme, SRON technical note 09-002, which people
//! with any colour vision can tell apart; a label stands at every coloured line all the same.

use crate::figure::data::{Figure, Point};
use crate::figure::envelope::{RAYS, winners};
use crate::rivals::treelet as ours;

/// Colours that there are.
const COLORS: usize = 8;
/// Dash patterns that there are; more engines share the last.
const DASHES: usize = 4;

/// How something is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Look {
    /// One of the colours.
    Color(usize),
    /// One of the dash patterns.
    Rival(usize),
    /// Thin and grey.
    Plain,
}

impl Look {
    /// Its class in the style sheet.
    pub(super) fn class(self) -> String {
        match self {
            Self::Color(color) => format!("c{color}"),
            Self::Rival(dash) => format!("r{dash}"),
            Self::Plain => "p".to_owned(),
        }
    }
}

/// The looks of all.
pub(super) struct Looks {
    /// Our variants with a colour, in the colours' order.
    colored: Vec<String>,
    /// The other engines, in the points' order.
    rivals: Vec<String>,
}

impl Looks {
    pub(super) fn new(figure: &Figure) -> Self {
        let mut rivals: Vec<String> = Vec::new();
        for point in figure.points.iter().filter(|point| point.engine != ours::NAME) {
            if !rivals.contains(&point.engine) {
                rivals.push(point.engine.clone());
            }
        }
        // Add up the decades in which each of our variants wins among ours.
        let mut won: Vec<(String, f64)> = Vec::new();
        for panel in figure.panels() {
            let mut points = figure.points_of(&panel);
            points.retain(|point| point.engine == ours::NAME);
            let curves: Vec<_> = points.iter().map(|point| point.curve()).collect();
            for interval in winners(&curves, &RAYS) {
                let decades = (interval.to / interval.from).log10();
                let variant = &points[interval.curve].variant;
                match won.iter_mut().find(|(name, _)| name == variant) {
                    Some((_, sum)) => *sum += decades,
                    None => won.push((variant.clone(), decades)),
                }
            }
        }
        won.sort_by(|a, b| b.1.total_cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
        won.truncate(COLORS);
        let mut colored: Vec<String> = won.into_iter().map(|(variant, _)| variant).collect();
        colored.sort_by(|a, b| build_time(figure, a).total_cmp(&build_time(figure, b)));
        Self { colored, rivals }
    }

    /// How a point is drawn.
    pub(super) fn of(&self, point: &Point) -> Look {
        self.of_named(&point.engine, &point.variant)
    }

    /// How an engine's variant is drawn.
    pub(super) fn of_named(&self, engine: &str, variant: &str) -> Look {
        if let Some(dash) = self.rivals.iter().position(|name| name == engine) {
            return Look::Rival(dash.min(DASHES - 1));
        }
        let place = self.colored.iter().position(|name| name == variant);
        // Few of them lie far apart.
        let steps = self.colored.len().saturating_sub(1).max(1);
        place.map_or(Look::Plain, |place| Look::Color(place * (COLORS - 1) / steps))
    }
}

/// The sum of all build times of one of our variants.
fn build_time(figure: &Figure, variant: &str) -> f64 {
    let ours = |point: &&Point| point.engine == ours::NAME && point.variant == variant;
    figure.points.iter().filter(ours).map(|point| point.build_s).sum()
}
