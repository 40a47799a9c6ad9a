//! `treelet inspect --metrics`: the measures of every builder's tree, and how well they predict what
//! rays take.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use serde::{Deserialize, Serialize};
use treelet::layout::Collapse;
use treelet::scene::Recipe;
use treelet::tree::{Estimate, SahConstants, lines};
use treelet_bench::figure::data::Point;

use super::Constants;
use super::fit::{self, Fit, Row};
use super::flat::{self, Flat, stopped_or};
use super::plot;
use super::trace_time::{self, Times};
use crate::ending::{Ending, Failure};
use crate::input::{Input, SceneFlags};
use crate::output::Output;
use crate::progress::Line;
use crate::session::{Outcome, Session, say};
use crate::text;

/// Scenes of up to so many triangles have their end-point overlap measured exactly by default.
const EXACT_MOST: usize = 1 << 18;

/// Points from which it is measured otherwise: good to about half a percent.
const POINTS: u32 = 1 << 18;

/// What to measure of trees.
#[derive(Debug, Args)]
pub(super) struct MetricsFlags {
    /// Measure the trees: SAH, end-point overlap (EPO) and leaf count variability (LCV).
    #[arg(long)]
    pub(super) metrics: bool,

    /// With --metrics: end-point overlap exactly, however large the scene [default: from points where
    /// it has more than 262,144 triangles].
    #[arg(long, requires = "metrics")]
    exact: bool,

    /// With --metrics: trace rays through every tree, and tell how well the measures predict the
    /// time.
    #[arg(long, requires = "metrics")]
    trace_time: bool,

    /// With --trace-time: seconds that each tree is traced in each of nine rounds, at least.
    #[arg(long, value_name = "S", default_value_t = 0.08, value_parser = seconds)]
    seconds: f64,

    /// With --trace-time: trees that earlier runs measured, from their JSON reports, or from those of `bench --figure`. They are told of
    /// together with those of this run; without a scene, this run measures none.
    #[arg(long, value_delimiter = ',', value_name = "FILE,..", requires = "trace_time")]
    earlier: Vec<PathBuf>,

    /// With --trace-time: draw predicted against measured times into an SVG file.
    #[arg(long, value_name = "FILE", requires = "trace_time")]
    plot: Option<PathBuf>,
}

#[derive(Serialize)]
struct Report {
    sah_constants: Constants,
    /// Lines that LCV is measured with.
    lines: u32,
    scenes: Vec<SceneReport>,
    /// Only with --trace-time.
    fits: Vec<Fit>,
    /// One weight for all scenes. Only with --trace-time.
    shared: Vec<fit::Shared>,
}

/// What is needed of an earlier report, of this verb or of `bench --figure`.
#[derive(Deserialize)]
#[serde(untagged)]
enum Earlier {
    Metrics { scenes: Vec<SceneReport> },
    Figure { points: Vec<Point> },
}

impl Earlier {
    fn scenes(self) -> Vec<SceneReport> {
        match self {
            Self::Metrics { scenes } => scenes,
            Self::Figure { points } => of_figure(&points),
        }
    }
}

/// The trees of a figure that anybody could look into, each with its rays' times on one thread. The
/// modelling hierarchy is left out: it is so far from all others that it would be all that a fit sees.
fn of_figure(points: &[Point]) -> Vec<SceneReport> {
    let mut scenes: Vec<SceneReport> = Vec::new();
    for point in points.iter().filter(|it| it.threads == 1 && it.variant != "scene-graph") {
        let (Some(sah), Some(epo), Some(lcv)) = (point.sah, point.epo, point.lcv) else { continue };
        let (name, triangles) = (point.scene.clone(), point.triangles.unwrap_or(0));
        let at = scenes.iter().position(|it| it.scene == name).unwrap_or_else(|| {
            scenes.push(SceneReport { scene: name, triangles, trees: Vec::new() });
            scenes.len() - 1
        });
        let trees = &mut scenes[at].trees;
        let at = trees.iter().position(|it| it.variant == point.variant).unwrap_or_else(|| {
            trees.push(TreeReport {
                variant: point.variant.clone(),
                seconds: point.build_s,
                sah,
                epo,
                epo_error: 0.0,
                epo_seconds: 0.0,
                lcv,
                leaves: 0.0,
                times: Vec::new(),
            });
            trees.len() - 1
        });
        trees[at].times.push(Times::new(point.kind.clone(), 1e3 / point.mrays_per_s));
    }
    scenes
}

/// The trees of a scene.
#[derive(Serialize, Deserialize)]
pub(super) struct SceneReport {
    scene: String,
    triangles: u64,
    trees: Vec<TreeReport>,
}

/// One tree.
#[derive(Serialize, Deserialize)]
struct TreeReport {
    variant: String,
    /// From boxes to tree, by the wall's clock.
    seconds: f64,
    sah: f64,
    epo: f64,
    /// Standard error; 0 where EPO is exact.
    epo_error: f64,
    epo_seconds: f64,
    lcv: f64,
    /// Leaves that a random line meets.
    leaves: f64,
    /// How long rays take, by kind. Only with --trace-time.
    times: Vec<Times>,
}

/// Measures scene after scene.
pub(super) fn run(
    scenes: &[PathBuf],
    scene_flags: &SceneFlags,
    flags: &MetricsFlags,
    builders: Vec<Recipe>,
    session: &Session,
) -> Result<Outcome, Failure> {
    let plot = flags.plot.as_deref().map(Output::prepare).transpose()?;
    let constants = SahConstants::default();
    let mut report = Report {
        sah_constants: Constants { visit: constants.visit, triangle: constants.prim },
        lines: lines::LINES,
        scenes: Vec::new(),
        fits: Vec::new(),
        shared: Vec::new(),
    };
    for file in &flags.earlier {
        report.scenes.extend(earlier(file)?);
    }
    report.scenes.iter().for_each(tell);
    let recipes = if builders.is_empty() { flat::recipes() } else { builders };
    let mut files: Vec<Option<&PathBuf>> = scenes.iter().map(Some).collect();
    if files.is_empty() && flags.earlier.is_empty() {
        files.push(None);
    }
    for file in files {
        let input = Input::load(file, scene_flags, session)?;
        let scene = measure(&input, flags, &recipes, session)?;
        tell(&scene);
        report.scenes.push(scene);
    }
    if flags.trace_time {
        let rows = rows(&report.scenes);
        report.fits = fit::fits(&rows);
        report.shared = fit::shared(&rows);
        fit::tell(&report.fits, &report.shared);
        if let Some(plot) = &plot {
            plot.replace(plot::svg(&report.fits).as_bytes())?;
            say(&format!("\n  drawn: {}", plot.path().display()));
        }
    }
    Outcome::new("inspect", &report, Ending::Done)
}

/// A number of seconds that makes sense.
fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse::<f64>().ok().filter(|seconds| (0.0..=3600.0).contains(seconds));
    seconds.ok_or_else(|| "give seconds in 0 ..= 3600".to_owned())
}

/// The scenes of an earlier report.
fn earlier(file: &Path) -> Result<Vec<SceneReport>, Failure> {
    let name = file.display();
    let text =
        std::fs::read_to_string(file).map_err(|error| Failure::told(format!("{name}: {error}")))?;
    let report: Earlier = serde_json::from_str(&text).map_err(|error| {
        Failure::told(format!(
            "{name}: {error}; it must be what `treelet inspect --metrics --trace-time --json` or `treelet bench --figure --json` printed"
        ))
    })?;
    Ok(report.scenes())
}

/// Builds and measures the trees of one scene.
fn measure(
    input: &Input,
    flags: &MetricsFlags,
    recipes: &[Recipe],
    session: &Session,
) -> Result<SceneReport, Failure> {
    let flat = Flat::new(input)?;
    let exact = flags.exact || flat.triangles.len() <= EXACT_MOST;
    let line = Line::spinner("measuring");
    let mut trees = Vec::new();
    for recipe in recipes {
        line.set(0, format!("measuring {}", recipe.name()));
        trees.push(tree_report(&flat, recipe, exact, session)?);
    }
    if flags.trace_time {
        let (triangles, up, seconds) = (&flat.triangles, input.up, flags.seconds);
        let variants: Vec<_> = recipes.iter().map(Recipe::name).collect();
        let times = trace_time::measure(triangles, up, &variants, seconds, &line, session)?;
        for (tree, times) in trees.iter_mut().zip(times) {
            tree.times = times;
        }
    }
    drop(line);
    let triangles = flat.triangles.len() as u64;
    Ok(SceneReport { scene: stem(&input.name), triangles, trees })
}

/// Builds one tree and measures it.
fn tree_report(
    flat: &Flat,
    recipe: &Recipe,
    exact: bool,
    session: &Session,
) -> Result<TreeReport, Failure> {
    let constants = SahConstants::default();
    let start = Instant::now();
    let tree = flat.tree(recipe, session)?;
    let seconds = start.elapsed().as_secs_f64();
    let cancel = &session.cancel;
    let start = Instant::now();
    let epo = if exact {
        tree.epo(&flat.mesh, &constants, cancel).map(|value| Estimate { value, error: 0.0 })
    } else {
        tree.epo_sampled(&flat.mesh, &constants, POINTS, cancel)
    };
    let epo = epo.map_err(|error| stopped_or(session, error))?;
    let epo_seconds = start.elapsed().as_secs_f64();
    let stats = tree.line_stats(&constants, lines::LINES, cancel);
    let stats = stats.map_err(|error| stopped_or(session, error))?;
    Ok(TreeReport {
        variant: recipe.name().to_owned(),
        seconds,
        sah: tree.sah(&constants),
        epo: epo.value,
        epo_error: epo.error,
        epo_seconds,
        lcv: stats.lcv,
        leaves: stats.leaves.value,
        times: Vec::new(),
    })
}

/// A file's name without folders and endings.
fn stem(name: &str) -> String {
    let file = name.rsplit(['/', '\\']).next().unwrap_or(name);
    file.split('.').next().unwrap_or(file).to_owned()
}

/// Each tree with each kind of ray, but for trees that are not lowered like the rest: the greedy
/// collapse of the two quick levels costs up to a fifth in time and nothing in any measure. With
/// them, the mean correlation of SAH and diffuse rays fell from 0.94 to 0.90.
fn rows(scenes: &[SceneReport]) -> Vec<Row> {
    let alike = |tree: &&TreeReport| {
        let recipe = tree.variant.parse::<Recipe>();
        recipe.is_ok_and(|recipe| recipe.options().plan().collapse == Collapse::Optimal)
    };
    let mut rows = Vec::new();
    for scene in scenes {
        for tree in scene.trees.iter().filter(alike) {
            rows.extend(tree.times.iter().map(|times| Row {
                scene: scene.scene.clone(),
                kind: times.kind.clone(),
                variant: tree.variant.clone(),
                measures: [tree.sah, tree.epo, tree.lcv],
                nanoseconds: times.nanoseconds,
            }));
        }
    }
    rows
}

/// Prints the table of a scene.
fn tell(scene: &SceneReport) {
    let times = scene.trees.first().map_or(&[][..], |tree| &tree.times);
    let kinds: Vec<&str> = times.iter().map(|times| times.kind.as_str()).collect();
    say(&format!(
        "\n  {}: {} (SAH and EPO with a visit and a triangle at 1)",
        scene.scene,
        text::things(scene.triangles, "triangle")
    ));
    let mut head = format!(
        "  {:16} {:>7} {:>8} {:>16} {:>7} {:>7}",
        "tree", "build", "SAH", "EPO", "LCV", "leaves"
    );
    kinds.iter().for_each(|kind| head += &format!(" {kind:>9}"));
    if !kinds.is_empty() {
        head += " ns a ray";
    }
    say(&head);
    for tree in &scene.trees {
        let mut epo = format!("{:.2}", tree.epo);
        if tree.epo_error > 0.0 {
            epo += &format!(" ± {:.2}", tree.epo_error);
        }
        let mut line = format!(
            "  {:16} {:>7} {:>8.2} {:>16} {:>7.2} {:>7.2}",
            tree.variant,
            text::time(Duration::from_secs_f64(tree.seconds)),
            tree.sah,
            epo,
            tree.lcv,
            tree.leaves
        );
        tree.times.iter().for_each(|times| line += &format!(" {:>9.0}", times.nanoseconds));
        say(&line);
    }
}
