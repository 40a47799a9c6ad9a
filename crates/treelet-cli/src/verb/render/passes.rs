//! Making passes until the goal is reached or somebody presses Ctrl-C.

use std::time::{Duration, Instant};

use treelet_render::{Film, PassStats, RenderError, Renderer};

use super::files::Picture;
use crate::ending::Failure;
use crate::progress::Line;
use crate::session::Session;
use crate::text;

/// Seconds of passes where neither --spp nor --time is given: with reading, building and writing,
/// the whole job stays under a minute on two cores.
pub(super) const TIME: Duration = Duration::from_secs(35);

/// The picture so far is written this often.
const WRITE_EVERY: Duration = Duration::from_secs(3);

/// When to stop.
#[derive(Clone, Copy, Debug)]
pub(super) struct Goal {
    passes: Option<u32>,
    time: Option<Duration>,
    /// The noise that is low enough, as a share of 1.
    noise: Option<f32>,
}

impl Goal {
    pub(super) fn new(passes: Option<u32>, time: Option<Duration>, noise: Option<f32>) -> Self {
        let default = passes.is_none() && noise.is_none();
        Self { passes, time: time.or(default.then_some(TIME)), noise }
    }

    /// For one of several pictures: its part of the time.
    pub(super) fn of_frames(self, frames: u32) -> Self {
        Self { time: self.time.map(|time| time / frames), ..self }
    }

    /// Whether time alone decides.
    pub(super) fn is_plain_time(&self) -> bool {
        self.passes.is_none() && self.noise.is_none()
    }

    fn line(&self) -> Line {
        match (self.passes, self.time) {
            (Some(passes), _) => Line::bar(passes.into(), "first pass"),
            (_, Some(time)) => Line::bar(time.as_millis() as u64, "first pass"),
            (None, None) => Line::spinner("first pass"),
        }
    }
}

/// What the passes took.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Made {
    pub(super) stats: PassStats,
    pub(super) time: Duration,
    /// Whether Ctrl-C came before the goal was reached.
    pub(super) is_cut_short: bool,
}

impl Made {
    /// The share of the threads' time that went by in the library's queries; what is left is
    /// shading.
    pub(super) fn query_share(&self) -> f64 {
        self.stats.asking.as_secs_f64() / self.stats.busy.as_secs_f64().max(1e-9)
    }
}

/// Adds passes to the film, and writes the picture, if one is given, after the first, every few
/// seconds, and at the end. Ctrl-C discards the pass under way.
pub(super) fn make_passes(
    renderer: &Renderer<'_>,
    film: &mut Film,
    goal: &Goal,
    picture: Option<&Picture<'_>>,
    session: &Session,
) -> Result<Made, Failure> {
    let line = goal.line();
    let start = Instant::now();
    let mut made = Made::default();
    let (mut written, mut write_time) = (0, start);
    loop {
        match next_pass(renderer, film, goal, session) {
            Ok(Some(stats)) => made.stats = made.stats.and(stats),
            Ok(None) => break,
            Err(RenderError::Cancelled) if film.passes() == 0 => return Err(Failure::Cancelled),
            Err(RenderError::Cancelled) => {
                made.is_cut_short = true;
                break;
            }
            Err(error) => return Err(error.into()),
        }
        made.time = start.elapsed();
        if let Some(picture) = picture
            && (written == 0 || write_time.elapsed() >= WRITE_EVERY)
        {
            picture.write(film)?;
            if written == 0 {
                line.say(&format!("first pass in {}", picture.path().display()));
            }
            (written, write_time) = (film.passes(), Instant::now());
        }
        let rate =
            format!("pass {}, {}rays/s", film.passes(), text::rate(made.stats.rays, made.time));
        let place = match (goal.passes, goal.time) {
            (None, Some(_)) => made.time.as_millis() as u64,
            _ => film.passes().into(),
        };
        line.set(place, rate);
        let enough = goal.passes.is_some_and(|passes| film.passes() >= passes);
        // Another pass is begun if it can be expected to end in time.
        let late = goal.time.is_some_and(|time| made.time + made.time / film.passes() > time);
        if enough || late {
            break;
        }
    }
    if let Some(picture) = picture
        && written != film.passes()
    {
        picture.write(film)?;
    }
    Ok(made)
}

/// One more pass; `None` if the noise is low enough everywhere.
fn next_pass(
    renderer: &Renderer<'_>,
    film: &mut Film,
    goal: &Goal,
    session: &Session,
) -> Result<Option<PassStats>, RenderError> {
    match goal.noise {
        Some(limit) => renderer.adaptive_pass(film, limit, &session.cancel),
        None => renderer.pass(film, &session.cancel).map(Some),
    }
}
