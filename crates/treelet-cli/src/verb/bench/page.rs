//! `treelet bench --report`: the page of a figure, with pictures of its scenes and trees.

mod curve;
mod look;

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;
use treelet::scene::Recipe;
use treelet::{BuildOptions, Context, Mesh, Quality, Scene};
use treelet_bench::figure::data::Figure;
use treelet_bench::page::{self, Page, ScenePage, TreeLine, entrants};
use treelet_bench::rays::{self, Camera};
use treelet_bench::rivals::treelet as ours;
use treelet_bench::run::{Subject, Watcher as _};
use treelet_bench::scenes;

use super::flags::Flags;
use super::steps::Steps;
use super::subject::{scene_name, subject};
use crate::ending::{Ending, Failure};
use crate::output::Output;
use crate::session::{Outcome, Session, say};
use crate::text;

/// What page to write.
#[derive(Debug, Args)]
pub(super) struct PageFlags {
    /// Write the figure, the trees and the standings into one HTML file.
    #[arg(long, value_name = "FILE.html")]
    pub(super) report: Option<PathBuf>,

    /// With --report: results of other engines or machines, in the form of `--figure --json`. Without a
    /// scene the page is made of these alone.
    #[arg(long, value_delimiter = ',', value_name = "FILE.json,..", requires = "report")]
    pub(super) entrant: Vec<PathBuf>,

    /// With --report: hide the names of engines and variants behind letters and numbers.
    #[arg(long, requires = "report")]
    anonymous: bool,
}

/// Trees that took longer to build than so many seconds are not built anew for their statistics.
const REBUILD_MOST: f64 = 10.0;

/// A page to be written, checked before hours are spent on it.
pub(super) struct Report {
    output: Output,
    entrants: Vec<Entrant>,
    anonymous: bool,
}

/// An entrant's file and what is in it.
struct Entrant {
    file: String,
    /// Its name without folders and extension.
    name: String,
    figure: Figure,
}

impl Report {
    /// Reads the entrants and makes sure that the page can be written; `None` if none is wanted.
    pub(super) fn prepare(flags: &PageFlags) -> Result<Option<Self>, Failure> {
        let Some(file) = &flags.report else { return Ok(None) };
        let output = Output::prepare(file)?;
        for entrant in &flags.entrant {
            if entrant.canonicalize().is_ok_and(|entrant| entrant == output.path()) {
                return Err(Failure::Usage(format!(
                    "{}: is an entrant, which would be written over; choose another name with --report",
                    entrant.display()
                )));
            }
        }
        let entrants = flags.entrant.iter().map(|file| read(file)).collect::<Result<_, _>>()?;
        Ok(Some(Self { output, entrants, anonymous: flags.anonymous }))
    }

    /// Draws the scenes, adds the entrants and writes the page.
    pub(super) fn write(
        self,
        figure: &Figure,
        flags: &Flags,
        session: &Session,
    ) -> Result<(), Failure> {
        let mut figure = figure.clone();
        let steps = Steps::new(session.cancel.clone());
        let mut scenes = Vec::new();
        for scene in &flags.scenes {
            let subject = subject(scene, flags, session)?;
            scenes.push(draw(&subject, &figure, &steps, session)?);
        }
        steps.clear();
        let command: Vec<String> =
            std::env::args_os().map(|word| text::shell_word(Path::new(&word))).collect();
        let mut page = Page { anonymous: self.anonymous, scenes, ..Page::default() };
        page.commands.push(command.join(" "));
        for Entrant { file, name, figure: entrant } in self.entrants {
            if !entrant.command.is_empty() {
                page.commands.push(entrant.command.join(" "));
            }
            page.entrants.push(file);
            entrants::join(&mut figure, entrant, &name);
        }
        page.figure = figure;
        self.output.replace(page::render(&page).as_bytes())?;
        say(&format!("the page is in {}", self.output.path().display()));
        Ok(())
    }
}

/// Writes a page of entrants alone.
pub(super) fn of_entrants(flags: &Flags, session: &Session) -> Result<Outcome, Failure> {
    /// What there is to tell.
    #[derive(Serialize)]
    struct Written {
        report: String,
    }
    let report = Report::prepare(&flags.page)?;
    let report = report.ok_or_else(|| Failure::Usage("--entrant needs --report".into()))?;
    let written = Written { report: report.output.path().display().to_string() };
    report.write(&Figure::default(), flags, session)?;
    Outcome::new("bench", &written, Ending::Done)
}

/// Reads an entrant's file.
fn read(file: &Path) -> Result<Entrant, Failure> {
    let name = file.display().to_string();
    let text = std::fs::read_to_string(file).map_err(|error| {
        Failure::told(format!("{name}: cannot be read ({error}); --entrant takes JSON files"))
    })?;
    let figure = entrants::read(&text, &name)?;
    Ok(Entrant { file: name, name: scene_name(file), figure })
}

/// Everything that is drawn of a scene.
fn draw(
    subject: &Subject,
    figure: &Figure,
    steps: &Steps,
    session: &Session,
) -> Result<ScenePage, Failure> {
    let name = &subject.name;
    steps.step(&format!("{name}: looking around"));
    let scene = build(subject, &Recipe::from(Quality::Default), session)?;
    let up = subject.up.unwrap_or_else(|| rays::guess_up(&scenes::bounds(&subject.triangles)));
    let eye = Camera::choose(&scene, up);
    let view = look::View::new(eye.from, eye.at, up);
    let shaded = view.shaded(&scene, &subject.triangles, session)?;
    drop(scene);

    steps.step(&format!("{name}: what rays meet"));
    let mut maps = Vec::new();
    for variant in look::CONTRAST {
        let Ok(recipe) = variant.parse::<Recipe>() else { continue };
        let scene = build(subject, &recipe, session)?;
        maps.push((recipe.name().to_owned(), view.visits(&scene, session)?));
    }

    steps.step(&format!("{name}: the curve"));
    let drawing = curve::draw(&subject.triangles, session)?;
    Ok(ScenePage {
        scene: name.clone(),
        triangles: subject.triangles.len() as u64,
        look: Some(shaded),
        heat: Some(look::heat_maps(maps)?),
        curve: drawing,
        trees: trees(subject, figure, steps, session)?,
    })
}

/// What the trees of the figure are like.
fn trees(
    subject: &Subject,
    figure: &Figure,
    steps: &Steps,
    session: &Session,
) -> Result<Vec<TreeLine>, Failure> {
    let mut trees: Vec<TreeLine> = Vec::new();
    for point in &figure.points {
        let known = trees.iter().any(|tree| tree.variant == point.variant);
        let here = point.scene == subject.name && point.engine == ours::NAME;
        if !here || known || point.build_s > REBUILD_MOST {
            continue;
        }
        let Ok(recipe) = point.variant.parse::<Recipe>() else { continue };
        steps.step(&format!("{}: the tree of {}", subject.name, point.variant));
        let scene = build(subject, &recipe, session)?;
        let tree = &scene.report().tree;
        trees.push(TreeLine {
            variant: point.variant.clone(),
            nodes: tree.nodes,
            leaves: tree.leaves,
            depth: tree.depth,
            leaf_mean: tree.leaf_mean(),
            leaf_max: tree.leaf_max,
            bytes: scene.trace_bytes(),
        });
    }
    Ok(trees)
}

/// The scene that a recipe builds.
fn build(subject: &Subject, recipe: &Recipe, session: &Session) -> Result<Scene, Failure> {
    let triangles = &subject.triangles;
    let mesh = Mesh::new(triangles.positions.clone(), triangles.indices.clone());
    let context = Context { cancel: session.cancel.clone(), progress: None };
    let options = BuildOptions { context, ..recipe.options() };
    Scene::builder().mesh(mesh).build(&options).map_err(|error| {
        if session.cancel.is_cancelled() { Failure::Cancelled } else { Failure::from(error) }
    })
}
