//! `treelet inspect`: one screen about a scene and the trees that each builder makes of it; or the
//! measures of those trees.

mod bounds;
mod fit;
mod flat;
mod metrics;
mod plot;
mod trace_time;
mod walk;

use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::Args;
use serde::Serialize;
use treelet::bounds::Aabb;
use treelet::scene::{LayoutChoice, Recipe};
use treelet::tree::SahConstants;
use treelet::{BuildOptions, Invalid, Quality};
use treelet_model::PlacedModel;

use crate::arguments::{RecipeParser, recipes};
use crate::choice::ChoiceReport;
use crate::duplicates;
use crate::ending::{Ending, Failure};
use crate::input::{Input, SceneFlags};
use crate::progress::Line;
use crate::session::{Outcome, Session, say};
use crate::text;
use crate::tree_flags::number_of_rays;
use metrics::MetricsFlags;

/// Show what a scene holds, and the tree that each builder makes of it
#[derive(Debug, Args)]
pub(crate) struct Flags {
    /// A scene file: glTF, OBJ, PLY, STL, OFF or pbrt, also as .gz or .zst [default: the built-in scene].
    /// Several only with --metrics.
    scenes: Vec<PathBuf>,

    /// Builders to look at, perhaps with optimisers after them: "sweep-sah,lbvh+treelets" [default: all;
    /// with --metrics the quality levels, too].
    #[arg(long, value_name = "NAME,..", value_delimiter = ',', value_parser = RecipeParser)]
    builders: Vec<Recipe>,

    /// Also choose a builder for this many rays, and say why.
    #[arg(long, value_name = "N", conflicts_with_all = ["metrics", "bounds"], value_parser = number_of_rays)]
    rays: Option<u64>,

    #[command(flatten)]
    scene_flags: SceneFlags,

    #[command(flatten)]
    metrics: MetricsFlags,

    /// Compare bounding volumes on this scene: how tight, how fast to test, how often wrong.
    #[arg(long, conflicts_with = "metrics")]
    bounds: bool,
}

#[derive(Serialize)]
struct Report {
    scene: String,
    objects: u64,
    meshes: u64,
    instances: u64,
    materials: u64,
    cameras: u64,
    vertices: u64,
    triangles_stored: u64,
    triangles_placed: u64,
    /// Of the world; null where the scene holds nothing.
    bounds: Option<[[f32; 3]; 2]>,
    /// Triangles without area.
    degenerate: u64,
    /// Triangles with a vertex that is NaN, infinite or too far away.
    non_finite: u64,
    /// Triangles that name a vertex that is not there.
    index_out_of_range: u64,
    /// Triangles whose corners are those of another one of the same mesh.
    duplicate: u64,
    /// Instances whose map is singular or not finite.
    bad_instances: u64,
    seconds_to_read: f64,
    sah_constants: Constants,
    builders: Vec<TreeReport>,
    /// What --rays chose.
    choice: Option<ChoiceReport>,
    layouts: Vec<LayoutReport>,
    warnings: Vec<String>,
}

/// Prices of a tree's parts.
#[derive(Serialize)]
struct Constants {
    visit: f64,
    triangle: f64,
}

/// What a builder made.
#[derive(Serialize)]
struct TreeReport {
    builder: String,
    /// From meshes to a scene that answers.
    seconds: f64,
    nodes: u64,
    leaves: u64,
    /// Nodes on the longest way from the outermost root to a leaf that holds triangles.
    depth: u32,
    leaf_mean: f64,
    leaf_max: u32,
    /// Of the tree over triangles or, where there are instances, the mean over the objects' trees,
    /// weighted by their triangles.
    sah: f64,
    /// Of the tree over the instances, if there is one.
    sah_instances: Option<f64>,
    bytes_per_triangle: f64,
}

/// What a layout makes of the default build's tree.
#[derive(Serialize)]
struct LayoutReport {
    layout: &'static str,
    /// From meshes to a scene that answers.
    seconds: f64,
    bytes_per_triangle: f64,
}

/// Does what the flags ask for.
pub(crate) fn run(flags: Flags, session: &Session) -> Result<Outcome, Failure> {
    if flags.metrics.metrics {
        let Flags { scenes, scene_flags, metrics, builders, .. } = flags;
        return metrics::run(&scenes, &scene_flags, &metrics, builders, session);
    }
    if let [_, second, ..] = flags.scenes.as_slice() {
        let second = second.display();
        return Err(Failure::Usage(format!("{second}: several scenes at once need --metrics")));
    }
    let input = Input::load(flags.scenes.first(), &flags.scene_flags, session)?;
    if flags.bounds {
        return bounds::run(&input, session);
    }
    overview(input, flags.builders, flags.rays, session)
}

/// Counts, builds with every builder and in every layout.
fn overview(
    input: Input,
    builders: Vec<Recipe>,
    rays: Option<u64>,
    session: &Session,
) -> Result<Outcome, Failure> {
    let duplicate = {
        let _line = Line::spinner("looking for duplicates");
        duplicates::count(&input.model, &session.cancel)?
    };

    // Build with each builder in turn; the counts of defects are the same for all.
    let mut reports = Vec::new();
    let mut facts = Facts::default();
    for recipe in recipes(builders) {
        let options = BuildOptions { invalid: Invalid::Skip, ..recipe.options() };
        let start = Instant::now();
        let placed = input.build(&options, session)?;
        reports.push(tree_report(&placed, recipe.name(), start.elapsed()));
        facts = Facts::of(&placed);
    }

    let choice = match rays {
        Some(rays) => choose(&input, rays, session)?,
        None => None,
    };
    let mut layouts = Vec::new();
    for &layout in LayoutChoice::ALL {
        let options =
            BuildOptions { layout: Some(layout), invalid: Invalid::Skip, ..Default::default() };
        let start = Instant::now();
        let placed = input.build(&options, session)?;
        layouts.push(LayoutReport {
            layout: layout.info().name,
            seconds: start.elapsed().as_secs_f64(),
            bytes_per_triangle: bytes_per_triangle(&placed),
        });
    }

    let constants = SahConstants::default();
    let model = &input.model;
    let bounds = facts.bounds;
    let report = Report {
        objects: model.objects.len() as u64,
        meshes: model.objects.iter().map(|object| object.parts.len() as u64).sum(),
        instances: model.placements.len() as u64,
        materials: model.materials.len() as u64,
        cameras: model.cameras.len() as u64,
        vertices: model.vertices_stored(),
        triangles_stored: model.triangles_stored(),
        triangles_placed: model.triangles_placed(),
        bounds: (!bounds.is_empty()).then_some([bounds.lo, bounds.hi]),
        degenerate: facts.degenerate,
        non_finite: facts.non_finite,
        index_out_of_range: facts.index_out_of_range,
        duplicate,
        bad_instances: facts.bad_instances,
        seconds_to_read: input.time.as_secs_f64(),
        sah_constants: Constants { visit: constants.visit, triangle: constants.prim },
        builders: reports,
        choice,
        layouts,
        warnings: model.warnings.clone(),
        scene: input.name,
    };
    tell(&report);
    Outcome::new("inspect", &report, Ending::Done)
}

/// What the library would build for that many rays.
fn choose(input: &Input, rays: u64, session: &Session) -> Result<Option<ChoiceReport>, Failure> {
    let (quality, invalid) = (Quality::for_rays(rays), Invalid::Skip);
    let placed = input.build(&BuildOptions { quality, invalid, ..Default::default() }, session)?;
    Ok(ChoiceReport::of(&placed))
}

/// What every builder finds alike.
struct Facts {
    bounds: Aabb,
    degenerate: u64,
    non_finite: u64,
    index_out_of_range: u64,
    bad_instances: u64,
}

impl Default for Facts {
    fn default() -> Self {
        Self {
            bounds: Aabb::EMPTY,
            degenerate: 0,
            non_finite: 0,
            index_out_of_range: 0,
            bad_instances: 0,
        }
    }
}

impl Facts {
    fn of(placed: &PlacedModel) -> Self {
        let mut facts = Self { bounds: placed.scene.bounds(), ..Self::default() };
        for report in placed.reports() {
            facts.degenerate += report.degenerate;
            facts.non_finite += report.skipped.bad_vertex;
            facts.index_out_of_range += report.skipped.index_out_of_range;
            facts.bad_instances += report.skipped.instances;
        }
        facts
    }
}

/// Adds up the trees of all levels.
fn tree_report(placed: &PlacedModel, builder: &str, time: Duration) -> TreeReport {
    let instanced = placed.scene.instances() > 0;
    let mut tree = TreeReport {
        builder: builder.to_owned(),
        seconds: time.as_secs_f64(),
        nodes: 0,
        leaves: 0,
        depth: 0,
        leaf_mean: 0.0,
        leaf_max: 0,
        sah: 0.0,
        sah_instances: None,
        bytes_per_triangle: 0.0,
    };
    let (mut triangles, mut leaves) = (0, 0);
    for report in placed.reports().filter(|report| report.instances == 0) {
        triangles += report.triangles;
        leaves += report.tree.leaves;
        tree.nodes += report.tree.nodes;
        tree.depth = tree.depth.max(report.tree.depth);
        tree.leaf_max = tree.leaf_max.max(report.tree.leaf_max);
        tree.sah += report.triangles as f64 * report.tree.sah;
    }
    tree.leaves = leaves;
    if instanced {
        // The outermost level holds instances only.
        let world = &placed.scene.report().tree;
        tree.nodes += world.nodes;
        tree.leaves += world.leaves;
        tree.depth += world.depth;
        tree.sah_instances = Some(world.sah);
    }
    let share = |sum: f64, count: u64| if count == 0 { 0.0 } else { sum / count as f64 };
    tree.sah = share(tree.sah, triangles);
    tree.leaf_mean = share(triangles as f64, leaves);
    tree.bytes_per_triangle = bytes_per_triangle(placed);
    tree
}

/// Of all levels, by the triangles stored.
fn bytes_per_triangle(placed: &PlacedModel) -> f64 {
    let triangles: u64 = placed.reports().map(|report| report.triangles).sum();
    if triangles == 0 { 0.0 } else { placed.scene.trace_bytes() as f64 / triangles as f64 }
}

/// Prints the screen.
fn tell(report: &Report) {
    let count = text::count;
    say(&format!(
        "  {}, {}, {}, {}, {}",
        text::things(report.objects, "object"),
        text::things(report.meshes, "part"),
        text::things(report.instances, "instance"),
        text::things(report.materials, "material"),
        text::things(report.cameras, "camera"),
    ));
    say(&format!(
        "  {} stored with {}, {} placed",
        text::things(report.triangles_stored, "triangle"),
        text::things(report.vertices, "vertex"),
        count(report.triangles_placed),
    ));
    match report.bounds {
        Some([lo, hi]) => say(&format!("  bounds {lo:?} .. {hi:?}")),
        None => say("  bounds: none, the scene holds nothing"),
    }
    say(&format!(
        "  {} degenerate, {} not finite, {} with a missing vertex, {} duplicate; {} bad instances",
        count(report.degenerate),
        count(report.non_finite),
        count(report.index_out_of_range),
        count(report.duplicate),
        count(report.bad_instances),
    ));
    let Constants { visit, triangle } = report.sah_constants;
    say(&format!("\n  trees (SAH with a visit at {visit} and a triangle at {triangle})"));
    say("  builder             time        nodes  depth  leaf mean  max     SAH  instances  B/tri");
    for tree in &report.builders {
        let instances = tree.sah_instances.map_or("-".to_owned(), |sah| format!("{sah:.1}"));
        say(&format!(
            "  {:16} {:>7} {:>12}  {:>5}  {:>9.2}  {:>3}  {:>6.1}  {:>9}  {:>5.1}",
            tree.builder,
            text::time(Duration::from_secs_f64(tree.seconds)),
            count(tree.nodes),
            tree.depth,
            tree.leaf_mean,
            tree.leaf_max,
            tree.sah,
            instances,
            tree.bytes_per_triangle,
        ));
    }
    report.choice.iter().for_each(ChoiceReport::tell);
    say("\n  layout              time  B/tri");
    for layout in &report.layouts {
        say(&format!(
            "  {:16} {:>7}  {:>5.1}",
            layout.layout,
            text::time(Duration::from_secs_f64(layout.seconds)),
            layout.bytes_per_triangle,
        ));
    }
}
