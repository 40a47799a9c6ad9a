//! A clip of an animated file, kept up with in several ways.

use std::sync::{Mutex, MutexGuard, PoisonError};

use treelet::BuildOptions;
use treelet::scene::Action;
use treelet_model::{Changes, Model, PlacedModel, Updated};

use super::{AnimateError, Clip, Frame, Motion, Play, Way, Wish, compare};
use crate::crew::Crew;
use crate::rays::{self, Kind, RaySource};
use crate::run::Watcher;

/// A clip of a model.
#[derive(Clone, Debug)]
pub struct Animated {
    /// The model.
    pub model: Model,
    /// Which of its clips.
    pub clip: usize,
    /// The axis that points up; `None` guesses.
    pub up: Option<usize>,
}

/// A model in the pose of a frame, and what changed since the frame before.
struct Posed {
    model: Model,
    changes: Changes,
}

/// Plays a clip from its first key to its last, and keeps up with it in every way that is wished for.
///
/// # Errors
///
/// Those of [`compare`]; there may be no such clip.
pub fn play_clip(
    animated: Animated,
    motion: &Motion,
    wishes: &[(String, Wish)],
    crew: &Crew,
    watcher: &dyn Watcher,
    told: impl FnMut(&Play, usize),
) -> Result<Play, AnimateError> {
    let Animated { model, clip, up } = animated;
    let seconds = model.animations.get(clip).map_or(0.0, |clip| clip.duration());
    let posed = Mutex::new(Posed { model, changes: Changes::default() });
    let now = || -> MutexGuard<'_, Posed> { posed.lock().unwrap_or_else(PoisonError::into_inner) };

    let way = |(name, wish): &(String, Wish)| {
        let (now, wish) = (&now, *wish);
        let mut before: Option<PlacedModel> = None;
        let update = move |_: usize| {
            let Posed { model, changes } = &*now();
            let (placed, did) = advance(before.take(), model, changes, wish)?;
            let frame = Frame { scene: placed.scene.clone(), did };
            before = (wish != Wish::Fresh).then_some(placed);
            Ok(frame)
        };
        Way { name: name.clone(), update: Box::new(update) }
    };
    let mut ways: Vec<_> = wishes.iter().map(way).collect();
    let last = motion.frames.max(2) - 1;
    let clip = Clip {
        frames: motion.frames,
        begin: Box::new(|frame| {
            let mut now = now();
            now.changes = now.model.pose(Some(clip), seconds * frame as f64 / last as f64)?;
            Ok(())
        }),
        rays: Box::new(|scene, _| {
            let up = up.unwrap_or_else(|| rays::guess_up(&scene.bounds()));
            RaySource::new(scene, up, motion.rays).rays(Kind::Diffuse)
        }),
        repeats: motion.repeats,
    };
    compare(clip, &mut ways, crew, watcher, told)
}

/// The scenes of a frame, from those of the one before if there are any; and what was done.
fn advance(
    before: Option<PlacedModel>,
    model: &Model,
    changes: &Changes,
    wish: Wish,
) -> Result<(PlacedModel, &'static str), treelet_model::PlaceError> {
    let options = BuildOptions::default();
    let (before, policy) = match (before, wish) {
        (_, Wish::Fresh) => return Ok((PlacedModel::build(model, &options)?, "built")),
        (None, Wish::Edits(policy)) => {
            return Ok((PlacedModel::build(model, &options)?.under(policy), "built"));
        }
        (Some(before), Wish::Edits(policy)) => (before, policy),
    };
    let placed = before.under(policy).updated(model, changes, &options)?;
    let did = did(&placed.update());
    Ok((placed, did))
}

/// The most that was done to a tree.
fn did(updated: &Updated) -> &'static str {
    let to_objects = [
        (Action::Rebuilt, updated.rebuilt),
        (Action::Repaired, updated.repaired),
        (Action::Refitted, updated.refitted),
    ];
    let mut done = to_objects
        .iter()
        .filter(|(action, count)| *count > 0 || updated.placements == Some(*action));
    done.next().map_or(Action::Kept, |(action, _)| *action).name()
}
