//! A tiny figure from end to end, killed and resumed, without the command.

use std::path::PathBuf;

use treelet_bench::crew::Clock;
use treelet_bench::engine::Engine;
use treelet_bench::figure::data::{Figure, Panel};
use treelet_bench::figure::{self, FigurePlan, KINDS, SceneFigure, State};
use treelet_bench::rays::Kind;
use treelet_bench::report::Order;
use treelet_bench::rivals::treelet::Treelet;
use treelet_bench::rounds::Rounds;
use treelet_bench::run::{BenchError, Plan, Subject, Watcher};
use treelet_bench::scenes::Generated;

struct Nobody;

impl Watcher for Nobody {
    fn step(&self, _: &str) {}
    fn stopped(&self) -> bool {
        false
    }
}

/// A file in the folder for such, removed at the end.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let name = format!("treelet-figure-{}-{name}", std::process::id());
        Self(std::env::temp_dir().join(name))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        drop(std::fs::remove_file(&self.0));
    }
}

fn plan(kinds: &[Kind]) -> FigurePlan {
    let base = Plan {
        kinds: kinds.to_vec(),
        orders: vec![Order::Given],
        slices: Vec::new(),
        threads: vec![1],
        rays: 2000,
        rounds: Rounds { count: 1, seconds: 0.0 },
        clock: Clock::Wall,
        builders: ["lbvh", "sweep-sah", "presplit+trbvh"].map(str::to_owned).to_vec(),
        variants: Vec::new(),
    };
    // Few numbers of rays: the more there are, the more trees the library tries.
    let (choices, auto) = (vec![10_000, 1_000_000], vec![10_000]);
    FigurePlan { choices, auto, ..FigurePlan::new(base, true) }
}

fn measure(plan: &FigurePlan, state: &mut State, count: u64) -> Result<SceneFigure, BenchError> {
    let triangles = Generated::Terrain(count).triangles();
    let subject =
        Subject { name: "hill".into(), generated: true, triangles, placed: None, up: Some(1) };
    figure::scene(&subject, &mut engines(), plan, state, &Nobody)
}

fn engines() -> Vec<Box<dyn Engine>> {
    vec![Box::new(Treelet)]
}

#[test]
fn every_variant_has_a_point_and_every_number_of_rays_a_choice() {
    let found = measure(&plan(&KINDS), &mut State::default(), 500).unwrap();
    assert_eq!(found.points.len(), 3 * 3);
    for point in &found.points {
        assert_eq!(point.defect(), None, "{point:?}");
        assert_eq!((point.triangles, point.mismatch_ppm), (Some(512), Some(0.0)));
        assert!([point.sah, point.epo, point.lcv].iter().all(Option::is_some), "{point:?}");
    }
    assert_eq!(found.choices.len(), 3 * 2);
    for choice in &found.choices {
        let of_kind = found.points.iter().filter(|point| point.kind == choice.kind);
        let totals = of_kind.map(|point| point.curve().total(choice.rays as f64));
        assert_eq!(choice.best_s, totals.fold(f64::INFINITY, f64::min));
        assert!(choice.measured_s > 0.0 && choice.predicted_s > Some(0.0), "{choice:?}");
        assert!(!choice.reason.is_empty());
    }
    // What follows from it names every panel and draws every line.
    let mut figure = Figure { points: found.points, choices: found.choices, ..Figure::default() };
    figure.windows = figure::windows(&figure);
    assert_eq!(figure.windows.len(), 3, "presplit+trbvh for each kind");
    for panel in figure.panels() {
        let lines = figure::panel_lines(&figure, &panel).join("\n");
        assert!(lines.contains("share of sweep-sah") && lines.contains("treelet "), "{lines}");
    }
    assert_eq!(figure::mean_svg(&figure).unwrap().matches("<polyline").count(), 3);
}

#[test]
fn a_killed_run_goes_on_with_the_very_same_numbers() {
    let file = Scratch::new("resume");
    let plan = plan(&[Kind::Primary, Kind::Diffuse]);
    let open = || State::open(Some(&file.0), &plan, &engines());
    let whole = measure(&plan, &mut open().unwrap(), 500).unwrap();
    let text = std::fs::read_to_string(&file.0).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    // Settings, the scene, three builds, traces and choices of two kinds.
    assert_eq!(lines.len(), 1 + 1 + 3 + 2 * 2, "{text}");
    assert_eq!(measure(&plan, &mut open().unwrap(), 500).unwrap().points, whole.points);

    // Killed while it wrote the traces of the second kind.
    let torn = format!("{}\n{}", lines[..7].join("\n"), &lines[7][..20]);
    std::fs::write(&file.0, torn).unwrap();
    let mut state = open().unwrap();
    assert_eq!(state.pieces(), 6);
    let again = measure(&plan, &mut state, 500).unwrap();
    let panel = Panel { scene: "hill".into(), kind: "primary".into(), threads: 1 };
    let first = |it: &SceneFigure| {
        let of_first = it.points.iter().filter(|point| panel.holds(point));
        of_first.cloned().collect::<Vec<_>>()
    };
    assert_eq!((first(&again), again.points.len()), (first(&whole), 6));
    assert_eq!(std::fs::read_to_string(&file.0).unwrap().lines().count(), lines.len());

    // Another scene of that name is not the one that was begun.
    let error = measure(&plan, &mut state, 2000).unwrap_err().to_string();
    assert!(error.contains("of 512 triangles") && error.contains("has 2048 triangles"), "{error}");
}

#[test]
fn other_settings_and_other_files_are_refused_and_left_alone() {
    let file = Scratch::new("other");
    let plan = plan(&[Kind::Diffuse]);
    let open = |plan: &FigurePlan| State::open(Some(&file.0), plan, &engines());
    drop(open(&plan).unwrap());
    let mut other = plan.clone();
    other.base.rounds.count = 2;
    let error = open(&other).unwrap_err().to_string();
    assert!(error.contains("rounds 1, this run has 2"), "{error}");
    open(&plan).unwrap();
    for text in ["{\"points\":[]}\n", "{\"points\":[]}", "notes", "{\"settings\":{}}\n{}\n"] {
        std::fs::write(&file.0, text).unwrap();
        let error = open(&plan).unwrap_err().to_string();
        assert!(error.contains("--resume"), "{text}: {error}");
        assert_eq!(std::fs::read_to_string(&file.0).unwrap(), text);
    }
    // Half a first line is what a run leaves that was killed at once.
    std::fs::write(&file.0, "{\"sett").unwrap();
    assert_eq!(open(&plan).unwrap().pieces(), 0);
}
