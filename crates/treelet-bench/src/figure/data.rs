//! What the figure is made of, in the form of `bench --figure --json` and of files of other
//! entrants: plain data that anybody may write.
//!
//! Only `points` must be there when a figure is read; the rest is told by treelet's own runs.

use serde::{Deserialize, Serialize};

use super::envelope::Curve;
use crate::report::{Machine, Missing};

/// The builder whose tracing speed the paper measures others by.
pub const YARDSTICK: &str = "sweep-sah";

/// Everything that a run measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Figure {
    /// One for each scene, engine, variant, kind and number of threads.
    pub points: Vec<Point>,
    /// What the library chose for a number of rays, and how well.
    #[serde(default)]
    pub choices: Vec<Choice>,
    /// What it did where nobody told it the number of rays; their variant is `auto`.
    #[serde(default)]
    pub auto: Vec<Choice>,
    /// Where `trbvh` wins among the builders that the paper compared.
    #[serde(default)]
    pub windows: Vec<Window>,
    /// Variants and engines that have no points, and why.
    #[serde(default)]
    pub left_out: Vec<Missing>,
    /// How far treelet is from what it has set itself.
    #[serde(default)]
    pub marks: Vec<FigureMark>,
    /// Where and how it was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub machine: Option<Machine>,
    /// The engines with their versions: `embree 4.4.0 (AVX512)`.
    #[serde(default)]
    pub engines: Vec<String>,
    /// The command line, word by word.
    #[serde(default)]
    pub command: Vec<String>,
}

/// A variant of an engine on a scene: what its tree cost, and how fast one kind of rays goes
/// through it, one ray a call.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// The scene's name.
    pub scene: String,
    /// The engine's name.
    pub engine: String,
    /// A builder, a quality level, a composition.
    pub variant: String,
    /// `primary`, `occlusion` or `diffuse`.
    pub kind: String,
    /// Threads that built and that traced.
    pub threads: usize,
    /// Seconds from the caller's arrays to ready-to-trace: the median of the builds.
    pub build_s: f64,
    /// Millions of rays a second, of all threads together: the median of the rounds.
    pub mrays_per_s: f64,
    /// The tree's cost by the surface area heuristic, a visit and a triangle at 1; null for trees that
    /// nobody can look into.
    pub sah: Option<f64>,
    /// Its end-point overlap, by the same constants.
    pub epo: Option<f64>,
    /// Its leaf count variability.
    pub lcv: Option<f64>,
    /// Triangles of the scene.
    #[serde(default)]
    pub triangles: Option<u64>,
    /// Hit against miss or another `t` than treelet's, in a million rays.
    #[serde(default)]
    pub mismatch_ppm: Option<f64>,
}

/// A choice of the library's for so many rays, against the best of all points in hindsight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    /// The scene's name.
    pub scene: String,
    /// The kind of rays.
    pub kind: String,
    /// How many of them.
    pub rays: u64,
    /// What it chose.
    pub variant: String,
    /// Seconds for choosing, building and tracing, as it foretold; null where it does not foretell.
    pub predicted_s: Option<f64>,
    /// The same by the clock: measured choosing and building, and the rays over the measured rate.
    pub measured_s: f64,
    /// Which of treelet's points would have been best.
    pub best_variant: String,
    /// Seconds that it would have taken.
    pub best_s: f64,
    /// Threads that built and that traced.
    #[serde(default = "one")]
    pub threads: usize,
    /// Why, in the library's words.
    #[serde(default)]
    pub reason: String,
}

/// A mark of the figure, or a number that is only reported.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FigureMark {
    /// What is measured.
    pub what: String,
    /// What was measured; null where nothing was.
    pub value: Option<f64>,
    /// What it must reach, or must not pass; null where it is only reported.
    pub asked: Option<f64>,
    /// Whether it is met; null where it is only reported or not measured.
    pub met: Option<bool>,
    /// Cells that count: scenes, kinds, choices.
    pub cells: usize,
    /// Where it is worst, or what is lacking.
    #[serde(default)]
    pub note: String,
}

/// Numbers of rays for which a variant is the best of the builders that the paper compared, or it with
/// its splitting in place of its plain form.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Window {
    /// The scene's name.
    pub scene: String,
    /// The kind of rays.
    pub kind: String,
    /// The number of threads.
    pub threads: usize,
    /// `trbvh`, or `presplit+trbvh`.
    pub variant: String,
    /// From so many rays; null where it wins nowhere.
    pub from: Option<f64>,
    /// To so many.
    pub to: Option<f64>,
}

/// Points and choices that belong into one diagram.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Panel {
    /// The scene's name.
    pub scene: String,
    /// The kind of rays.
    pub kind: String,
    /// The number of threads.
    pub threads: usize,
}

/// The threads of choices that do not say.
fn one() -> usize {
    1
}

impl Figure {
    /// Every diagram that there are points for, in the points' order.
    pub fn panels(&self) -> Vec<Panel> {
        let mut panels: Vec<Panel> = Vec::new();
        for point in &self.points {
            if !panels.iter().any(|panel| panel.holds(point)) {
                let (scene, kind) = (point.scene.clone(), point.kind.clone());
                panels.push(Panel { scene, kind, threads: point.threads });
            }
        }
        panels
    }

    /// The points of one diagram, in their order.
    pub fn points_of(&self, panel: &Panel) -> Vec<&Point> {
        self.points.iter().filter(|point| panel.holds(point)).collect()
    }

    /// The choices of one diagram, in their order.
    pub fn choices_of(&self, panel: &Panel) -> Vec<&Choice> {
        self.choices.iter().filter(|choice| panel.holds_choice(choice)).collect()
    }
}

impl Panel {
    /// Whether a point is of this diagram.
    pub fn holds(&self, point: &Point) -> bool {
        self.scene == point.scene && self.kind == point.kind && self.threads == point.threads
    }

    /// Whether a choice is of this diagram.
    pub fn holds_choice(&self, choice: &Choice) -> bool {
        self.scene == choice.scene && self.kind == choice.kind && self.threads == choice.threads
    }

    /// `kitchen, diffuse rays`; the threads where there are several.
    pub fn title(&self) -> String {
        let threads = match self.threads {
            1 => String::new(),
            threads => format!(", {threads} threads"),
        };
        format!("{}, {} rays{threads}", self.scene, self.kind)
    }
}

#[cfg(test)]
impl Point {
    /// A point of diffuse rays on one thread, of which only this is known.
    pub(crate) fn of(
        scene: &str,
        engine: &str,
        variant: &str,
        build_s: f64,
        mrays_per_s: f64,
    ) -> Self {
        Self {
            scene: scene.to_owned(),
            engine: engine.to_owned(),
            variant: variant.to_owned(),
            kind: "diffuse".to_owned(),
            threads: 1,
            build_s,
            mrays_per_s,
            sah: None,
            epo: None,
            lcv: None,
            triangles: None,
            mismatch_ppm: None,
        }
    }
}

impl Point {
    /// What it takes to build, and how fast rays go.
    pub fn curve(&self) -> Curve {
        Curve { build_s: self.build_s, rays_per_s: 1e6 * self.mrays_per_s }
    }

    /// The first field that no measurement gives, with its value: a build must take zero seconds or
    /// more, rays must have a speed, both finite.
    pub fn defect(&self) -> Option<(&'static str, f64)> {
        if !(self.build_s.is_finite() && self.build_s >= 0.0) {
            return Some(("build_s", self.build_s));
        }
        let speed = self.mrays_per_s;
        (!(speed.is_finite() && speed > 0.0)).then_some(("mrays_per_s", speed))
    }
}

impl Choice {
    /// The part by which it took longer than the best: 0 is perfect, less is better than hindsight.
    pub fn regret(&self) -> f64 {
        self.measured_s / self.best_s - 1.0
    }

    /// The part by which the foretold time is off.
    pub fn error(&self) -> Option<f64> {
        self.predicted_s.map(|predicted| (predicted / self.measured_s - 1.0).abs())
    }
}

#[cfg(test)]
mod tests {
    use super::{Figure, Panel};

    #[test]
    fn other_entrants_need_nothing_but_points() {
        let text = r#"{"schema":1,"points":[
            {"scene":"a","engine":"x","variant":"v","kind":"diffuse","threads":1,
             "build_s":0.5,"mrays_per_s":2.0,"sah":null,"epo":null,"lcv":null},
            {"scene":"a","engine":"x","variant":"v","kind":"primary","threads":2,
             "build_s":0.5,"mrays_per_s":0.0}]}"#;
        let figure: Figure = serde_json::from_str(text).unwrap();
        let panel = |kind: &str, threads| Panel { scene: "a".into(), kind: kind.into(), threads };
        assert_eq!(figure.panels(), [panel("diffuse", 1), panel("primary", 2)]);
        assert_eq!(figure.points_of(&panel("diffuse", 1)), [&figure.points[0]]);
        assert_eq!(figure.points[0].curve().total(3e6), 2.0);
        let defects: Vec<_> = figure.points.iter().map(super::Point::defect).collect();
        assert_eq!(defects, [None, Some(("mrays_per_s", 0.0))]);
        let again: Figure = serde_json::from_str(&serde_json::to_string(&figure).unwrap()).unwrap();
        assert_eq!(again, figure);
    }
}
