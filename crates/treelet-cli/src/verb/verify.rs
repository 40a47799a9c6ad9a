//! `treelet verify`: does every tree answer like brute force, whoever built and improved it?
//!
//! Rays that look for trouble (the library's `verify` makes them) are answered by testing every
//! triangle, and by each builder's tree, with all four queries; every bit must agree. Where brute
//! force would take hours, it answers the first rays, and the sweep-SAH tree, itself held against
//! brute force on those, the rest.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use clap::builder::RangedU64ValueParser;
use rayon::prelude::*;
use serde::Serialize;
use treelet::build::Presplit;
use treelet::scene::Recipe;
use treelet::verify::{self, BruteForce, Mismatch};
use treelet::{BuildOptions, Hit, Invalid, Ray, Scene};

use crate::arguments::{RecipeParser, recipes};
use crate::ending::{Ending, Failure};
use crate::input::{self, Input, SceneFlags};
use crate::progress::Line;
use crate::ray_text::{self, RayText};
use crate::session::{Outcome, Session, say};
use crate::text;

/// Triangle tests that brute force may make in all where --brute is not given: a quarter of an
/// hour on two cores, at the 2 ns a test that it takes.
const BRUTE_TESTS: u64 = 900_000_000_000;

/// What answers where brute force is too slow.
const STAND_IN: &str = "sweep-sah";

/// What optimisers improve, and what is built from pieces.
const QUICK: &str = "lbvh";

/// Rays between two looks at Ctrl-C.
const CHUNK: usize = 64;

/// Rays that are made at a time.
const BATCH: u64 = 1 << 16;

/// The name of the first reference.
const BRUTE: &str = "brute force";

/// Hold the answers of every builder's tree against brute force
#[derive(Debug, Args)]
pub(crate) struct Flags {
    /// A scene file: glTF, OBJ, PLY, STL, OFF or pbrt, also as .gz or .zst [default: the built-in scene].
    scene: Option<PathBuf>,

    /// How many rays: random ones, at vertices and edges, along axes, grazing, from surfaces.
    #[arg(long, value_name = "N", default_value_t = 10_000, value_parser = RangedU64ValueParser::<u64>::new().range(1..))]
    rays: u64,

    /// Other rays.
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,

    /// How many of the rays brute force answers; the sweep-SAH tree answers the rest [default: as
    /// many as take about a quarter of an hour on two cores].
    #[arg(long, value_name = "N")]
    brute: Option<u64>,

    /// Check one ray only, as a failed check prints it: "o=x,y,z d=x,y,z t=min,max".
    #[arg(long, value_name = "RAY", conflicts_with_all = ["rays", "seed", "brute"])]
    ray: Option<RayText>,

    /// Builders to compare, perhaps with optimisers after them or presplit before them, such as
    /// "presplit+hploc+treelets", and sweep-sah [default: all builders, and lbvh with presplit and with
    /// each optimiser].
    #[arg(long, value_name = "NAME,..", value_delimiter = ',', value_parser = RecipeParser)]
    builders: Vec<Recipe>,

    #[command(flatten)]
    scene_flags: SceneFlags,
}

#[derive(Serialize)]
struct Report {
    scene: String,
    seed: u64,
    builders: Vec<String>,
    queries: [&'static str; 4],
    /// Rays that every builder answered like the reference.
    rays: u64,
    /// Of these, rays whose reference was brute force.
    rays_by_brute_force: u64,
    /// What answered the other rays.
    stand_in: &'static str,
    /// Hits of all rays together.
    hits: u64,
    seconds: f64,
    difference: Option<Difference>,
    /// The hits of the one ray of --ray.
    hits_of_ray: Option<Vec<HitReport>>,
    warnings: Vec<String>,
}

/// The first ray that was answered differently.
#[derive(Serialize)]
struct Difference {
    /// What --ray takes.
    ray: String,
    builder: String,
    reference: &'static str,
    query: &'static str,
    expected: String,
    got: String,
}

#[derive(Serialize)]
struct HitReport {
    t: f32,
    u: f32,
    v: f32,
    inst: u64,
    geom: u32,
    prim: u32,
}

/// A builder's name and its scene.
type Candidate = (String, Scene);

/// Reads, builds with every builder, compares.
pub(crate) fn run(flags: Flags, session: &Session) -> Result<Outcome, Failure> {
    let input = Input::load(flags.scene.as_ref(), &flags.scene_flags, session)?;
    let mut candidates: Vec<Candidate> = Vec::new();
    for recipe in compared(flags.builders) {
        let options = BuildOptions { invalid: Invalid::Skip, ..recipe.options() };
        let placed = input.build(&options, session)?;
        if candidates.is_empty() {
            input::warn_of_skipped(&placed);
        }
        candidates.push((recipe.name().to_owned(), placed.scene));
    }
    let Some((_, scene)) = candidates.first() else {
        return Err(Failure::told("the catalogue of builders is empty"));
    };

    // Decide how many rays brute force can answer.
    let start = Instant::now();
    let total = if flags.ray.is_some() { 1 } else { flags.rays };
    let brute = BruteForce::new(scene);
    let affordable = BRUTE_TESTS / brute.tests_per_ray().max(1);
    let brute_rays = match flags.ray {
        Some(_) => 1,
        None => flags.brute.unwrap_or(affordable).min(total),
    };

    // Compare, first ray first.
    let mut tally = Tally::default();
    let mut difference = None;
    let stand_in = candidates.iter().find(|(name, _)| name == STAND_IN).map_or(scene, |(_, s)| s);
    let by_brute_force = |ray: &Ray| brute.all(ray);
    let by_stand_in = |ray: &Ray| stand_in.all(ray);
    let line = Line::bar(total, "comparing");
    while tally.rays < total && difference.is_none() {
        let rays = match flags.ray {
            Some(RayText(ray)) => vec![ray],
            None => batch(scene, flags.seed, tally.rays, total),
        };
        let first = usize::try_from(brute_rays.saturating_sub(tally.rays)).unwrap_or(usize::MAX);
        let (first, rest) = rays.split_at(first.min(rays.len()));
        difference = tally.compare(&candidates, first, BRUTE, by_brute_force, &line, session)?;
        tally.by_brute_force = tally.rays.min(brute_rays);
        if difference.is_none() {
            difference = tally.compare(&candidates, rest, STAND_IN, by_stand_in, &line, session)?;
        }
    }
    drop(line);

    let hits_of_ray =
        flags.ray.map(|RayText(ray)| brute.all(&ray).iter().map(report_hit).collect());
    let report = Report {
        scene: input.name,
        seed: flags.seed,
        builders: candidates.iter().map(|(name, _)| name.clone()).collect(),
        queries: ["closest", "any", "count", "all"],
        rays: tally.rays,
        rays_by_brute_force: tally.by_brute_force,
        stand_in: STAND_IN,
        hits: tally.hits,
        seconds: start.elapsed().as_secs_f64(),
        difference,
        hits_of_ray,
        warnings: input.model.warnings,
    };
    tell(&report, &again(flags.scene.as_deref(), &flags.scene_flags));
    let ending = if report.difference.is_some() { Ending::CheckFailed } else { Ending::Done };
    Outcome::new("verify", &report, ending)
}

/// What was asked for, and the stand-in; or else every builder, and what comes before and after builders
/// with a quick one.
fn compared(asked: Vec<Recipe>) -> Vec<Recipe> {
    let all = asked.is_empty();
    let mut compared = recipes(asked);
    if !compared.iter().any(|recipe| recipe.name() == STAND_IN) {
        compared.extend(STAND_IN.parse());
    }
    let optimizers = treelet::optimize::ALL.iter();
    let after = optimizers.map(|optimizer| format!("{QUICK}+{}", optimizer.info().name));
    let before = core::iter::once(format!("{}+{QUICK}", Presplit::NAME));
    compared.extend(before.chain(after).filter(|_| all).filter_map(|name| name.parse().ok()));
    compared
}

/// The rays from number `from` on: at most [`BATCH`], so that memory does not grow with --rays.
fn batch(scene: &Scene, seed: u64, from: u64, total: u64) -> Vec<Ray> {
    let count = (total - from).min(BATCH) as usize;
    // Each batch has a seed of its own, far from those of neighbouring --seed values.
    verify::rays(scene, count, seed.wrapping_add((from / BATCH) << 32))
}

/// What was compared so far.
#[derive(Default)]
struct Tally {
    rays: u64,
    by_brute_force: u64,
    hits: u64,
}

impl Tally {
    /// Holds every candidate against the reference; the first ray that differs, if one does.
    fn compare(
        &mut self,
        candidates: &[Candidate],
        rays: &[Ray],
        reference: &'static str,
        answer: impl Fn(&Ray) -> Vec<Hit> + Sync,
        line: &Line,
        session: &Session,
    ) -> Result<Option<Difference>, Failure> {
        for chunk in rays.chunks(CHUNK) {
            if session.cancel.is_cancelled() {
                return Err(Failure::Cancelled);
            }
            // In order, so that the first difference is the same for any number of threads.
            let checked: Vec<_> = chunk
                .par_iter()
                .map(|ray| {
                    let expected = answer(ray);
                    let hits = expected.len() as u64;
                    let differs = |(name, scene): &Candidate| {
                        verify::check(scene, ray, &expected)
                            .err()
                            .map(|mismatch| (name.clone(), mismatch))
                    };
                    (hits, candidates.iter().find_map(differs))
                })
                .collect();
            for (hits, difference) in checked {
                if let Some((builder, mismatch)) = difference {
                    let Mismatch { ray, query, expected, got } = mismatch;
                    let ray = ray_text::text(&ray);
                    return Ok(Some(Difference { ray, builder, reference, query, expected, got }));
                }
                self.rays += 1;
                self.hits += hits;
            }
            line.set(self.rays, format!("comparing with {reference}"));
        }
        Ok(None)
    }
}

fn report_hit(hit: &Hit) -> HitReport {
    let Hit { t, u, v, prim, geom, inst } = *hit;
    HitReport { t, u, v, inst, geom, prim }
}

/// The command that reads the same scene anew, for a POSIX shell.
fn again(scene: Option<&Path>, flags: &SceneFlags) -> String {
    let scene = scene.map_or(String::new(), |scene| format!(" {}", text::shell_word(scene)));
    format!("treelet verify{scene}{}", flags.words())
}

/// Prints the summary.
fn tell(report: &Report, again: &str) {
    for hit in report.hits_of_ray.iter().flatten() {
        let HitReport { t, u, v, inst, geom, prim } = hit;
        say(&format!("  t={t:?} u={u:?} v={v:?} inst={inst} geom={geom} prim={prim}"));
    }
    if let Some(difference) = &report.difference {
        let Difference { ray, builder, reference, query, expected, got } = difference;
        say(&format!("DIFFERENT after {}: {query} by {builder}", text::things(report.rays, "ray")));
        say(&format!("  {reference} says {expected}"));
        say(&format!("  {builder} says {got}"));
        say(&format!("  again: {again} --ray \"{ray}\""));
        return;
    }
    let Report { rays, rays_by_brute_force, .. } = *report;
    say(&format!(
        "no difference: {} ({}) x {} trees x 4 queries, in {:.1} s",
        text::things(rays, "ray"),
        text::things(report.hits, "hit"),
        report.builders.len(),
        report.seconds,
    ));
    let by_stand_in = rays - rays_by_brute_force;
    say(&format!(
        "  {} against brute force{}",
        text::count(rays_by_brute_force),
        if by_stand_in == 0 {
            String::new()
        } else {
            format!(", {} against {}", text::count(by_stand_in), report.stand_in)
        },
    ));
}

#[cfg(test)]
mod tests {
    use treelet::verify::{self, BruteForce};
    use treelet::{BuildOptions, Mesh, Scene};

    use super::{Line, Session, Tally};

    fn scene(width: f32) -> Scene {
        let mesh = Mesh::new([[0.0; 3], [width, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0, 1, 2]]);
        Scene::builder().mesh(mesh).build(&BuildOptions::default()).unwrap()
    }

    /// What no name leads to would be left out in silence.
    #[test]
    fn everything_in_the_catalogues_is_compared() {
        let compared = super::compared(Vec::new());
        let plans: Vec<String> =
            compared.iter().map(|recipe| recipe.options().plan().to_string()).collect();
        let has = |plan: &str| plans.iter().any(|other| other == plan);
        for builder in treelet::build::ALL {
            assert!(has(builder.info().name), "{}", builder.info().name);
        }
        for optimizer in treelet::optimize::ALL {
            assert!(has(&format!("lbvh + {}", optimizer.info().name)), "{}", optimizer.info().name);
        }
        assert!(has("presplit+lbvh"), "{plans:?}");
        let asked = super::compared(vec!["presplit+sbvh+rotations".parse().unwrap()]);
        let names: Vec<&str> = asked.iter().map(|recipe| recipe.name()).collect();
        assert_eq!(names, ["presplit+sbvh+rotations", super::STAND_IN]);
    }

    #[test]
    fn the_line_to_paste_back_reads_the_same_scene() {
        use clap::Parser as _;
        for (line, again) in [
            ("treelet verify --rays 5", "treelet verify"),
            ("treelet verify a/b-1.ply", "treelet verify a/b-1.ply"),
            (
                "treelet verify a.ply --allow-outside --max-bytes 7 --max-ratio 9",
                "treelet verify a.ply --allow-outside --max-bytes 7 --max-ratio 9",
            ),
        ] {
            let words = crate::arguments::Arguments::try_parse_from(line.split(' ')).unwrap();
            let crate::verb::Verb::Verify(flags) = words.verb else { panic!("{line}") };
            assert_eq!(super::again(flags.scene.as_deref(), &flags.scene_flags), again);
        }
    }

    /// No builder is wrong, so a wrong scene takes its part.
    #[test]
    fn a_wrong_candidate_is_found_with_its_first_ray() {
        let (right, wrong) = (scene(1.0), scene(0.99));
        let rays = verify::rays(&right, 500, 3);
        let brute = BruteForce::new(&right);
        let candidates = [("right".to_owned(), right.clone()), ("wrong".to_owned(), wrong.clone())];
        let session = Session { cancel: treelet::Cancel::new(), threads: 1, threads_asked: vec![] };
        let mut tally = Tally::default();
        let line = Line::spinner("");
        let found =
            tally.compare(&candidates, &rays, "brute force", |ray| brute.all(ray), &line, &session);
        let found = found.unwrap().expect("the scenes differ");
        assert_eq!(found.builder, "wrong");

        // It is the first that differs, and its text gives it back.
        let differs = |ray| verify::check(&wrong, ray, &brute.all(ray)).is_err();
        let first = rays.iter().position(differs).unwrap();
        assert_eq!(tally.rays, first as u64);
        let super::RayText(ray) = found.ray.parse().unwrap();
        assert_eq!(ray, rays[first]);
        assert!(differs(&ray));
    }
}
