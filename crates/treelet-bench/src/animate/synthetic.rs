//! The motion of [`super::motion`], kept up with in several ways.

use std::sync::{Mutex, PoisonError};

use treelet::memory::Array;
use treelet::scene::Policy;
use treelet::{BuildOptions, Mesh, Scene, SceneError};

use super::motion::Moving;
use super::{AnimateError, Clip, Frame, Play, Way, compare};
use crate::crew::Crew;
use crate::rays::{self, Kind, RaySource};
use crate::run::{Subject, Watcher};
use crate::scenes;

/// How a mesh is to be moved, and traced.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    /// How many frames.
    pub frames: usize,
    /// Diffuse rays of a frame.
    pub rays: usize,
    /// See [`Clip::repeats`].
    pub repeats: usize,
}

/// A way to keep up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wish {
    /// A fresh default build every frame, from nothing.
    Fresh,
    /// Edits under a policy.
    Edits(Policy),
}

/// Moves a mesh, and keeps up with it in every way that is wished for.
///
/// # Errors
///
/// Those of [`compare`].
pub fn play(
    subject: &Subject,
    motion: &Motion,
    wishes: &[(String, Wish)],
    crew: &Crew,
    watcher: &dyn Watcher,
    told: impl FnMut(&Play, usize),
) -> Result<Play, AnimateError> {
    watcher.step("cutting the mesh into pieces");
    let moving = Moving::new(&subject.triangles);
    let up = subject.up.unwrap_or_else(|| rays::guess_up(&scenes::bounds(&subject.triangles)));
    let indices = moving.rest.indices.clone();
    let now = Mutex::new(moving.rest.positions.clone());
    let positions = || now.lock().unwrap_or_else(PoisonError::into_inner).clone();

    let way = |(name, wish): &(String, Wish)| {
        let (indices, wish) = (indices.clone(), *wish);
        let positions = &positions;
        // The scene of the frame before, and that of the one before it, whose memory may be used again.
        let mut before: [Option<Scene>; 2] = [None, None];
        let update = move |_: usize| {
            let [last, older] = &mut before;
            let frame = advance(last.as_ref(), older.take(), positions(), &indices, wish)?;
            let newest = (wish != Wish::Fresh).then(|| frame.scene.clone());
            before = [newest, before[0].take()];
            Ok(frame)
        };
        Way { name: name.clone(), update: Box::new(update) }
    };
    let mut ways: Vec<_> = wishes.iter().map(way).collect();
    let clip = Clip {
        frames: motion.frames,
        begin: Box::new(|frame| {
            let share = frame as f32 / (motion.frames.max(2) - 1) as f32;
            *now.lock().unwrap_or_else(PoisonError::into_inner) = moving.at(share).into();
            Ok(())
        }),
        rays: Box::new(|scene, _| RaySource::new(scene, up, motion.rays).rays(Kind::Diffuse)),
        repeats: motion.repeats,
    };
    compare(clip, &mut ways, crew, watcher, told)
}

/// The scene of a frame, from the one before if there is one.
fn advance(
    before: Option<&Scene>,
    older: Option<Scene>,
    positions: Array<[f32; 3]>,
    indices: &Array<[u32; 3]>,
    wish: Wish,
) -> Result<Frame, SceneError> {
    let options = BuildOptions::default();
    let (Some(before), Wish::Edits(policy)) = (before, wish) else {
        let mesh = Mesh::new(positions, indices.clone());
        return Ok(Frame { scene: Scene::builder().mesh(mesh).build(&options)?, did: "built" });
    };
    let mut edit = before.edit();
    edit.policy = policy;
    if let Some(older) = older {
        edit.reuse(older);
    }
    // The scene has that one mesh.
    let _ = edit.set_positions(0, positions);
    let commit = edit.commit(&options)?;
    Ok(Frame { did: commit.action.name(), scene: commit.scene })
}
