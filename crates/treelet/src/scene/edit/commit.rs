//! Committing an edit: what of the old snapshot stays, what is refitted, what is built anew.
//!
//! Cost: O(blocks of instances + meshes), and what changed: one reverse sweep of the tree where vertices
//! moved, a copy of it and the way up from a few instances, or a build.

use super::follow::Followed;
use super::ledger::{Ledger, Next};
use super::mend::standing;
use super::{Action, Commit, Edit, Parts, Policy, Reason, WORTH_KEEPING};
use crate::bounds::Aabb;
use crate::context::clock::Stopwatch;
use crate::context::parallel;
use crate::layout::refit::Areas;
use crate::scene::assemble::{self, Level};
use crate::scene::builder::{BuildOptions, Placed, SceneBuilder};
use crate::scene::report::Skipped;
use crate::scene::upkeep::Upkeep;
use crate::scene::{Quality, Scene, SceneError};
use alloc::sync::Arc;

/// A scene whose tree stayed.
struct Done {
    scene: Scene,
    action: Action,
    reason: Reason,
    decay: f64,
    parts: Parts,
}

/// A tree that should not stay.
struct Worn {
    decay: f64,
    areas: Areas,
}

impl Edit {
    /// Makes the new snapshot. `options` say how a tree is built if one has to be; instructions and
    /// layout stay what they were unless it is.
    ///
    /// # Errors
    ///
    /// As [`SceneBuilder::build`]; the old snapshot stays what it is.
    pub fn commit(mut self, options: &BuildOptions<'_>) -> Result<Commit, SceneError> {
        let watch = Stopwatch::start();
        let done = |scene, action, reason, decay, parts| {
            Ok(Commit { scene, action, reason, decay, parts, time: watch.elapsed() })
        };
        if self.geometries.is_empty() && self.instances.is_empty() {
            return done(self.before, Action::Kept, Reason::Unchanged, 1.0, Parts::default());
        }
        let mut ledger = self.ledger();
        let followed = match self.policy {
            Policy::Rebuild => Err(Reason::Asked),
            _ => self.follow(&ledger, options)?,
        };
        let (reason, before) = match followed {
            Err(reason) => (reason, None),
            Ok(followed) => {
                ledger.refit = watch.elapsed().as_secs_f64();
                match self.mend(followed, &mut ledger, options)? {
                    Ok(Done { scene, action, reason, decay, parts }) => {
                        return done(scene, action, reason, decay, parts);
                    }
                    Err(worn) => (Reason::Decayed, Some(worn)),
                }
            }
        };
        let scene = self.rebuild(before, ledger, options)?;
        done(scene, Action::Rebuilt, reason, 1.0, Parts::default())
    }

    /// What is known from earlier commits, and from the rays since the last one.
    fn ledger(&self) -> Ledger {
        let upkeep = &self.before.upkeep;
        let build = self.before.report.total_time.as_secs_f64();
        let mut ledger = upkeep.ledger.unwrap_or_else(|| Ledger::new(build, parallel::threads()));
        ledger.ray = upkeep.ray_seconds().unwrap_or(ledger.ray);
        ledger
    }

    /// A new tree. `before` is what the old one had come to, where it could have stayed.
    fn rebuild(
        &self,
        before: Option<Worn>,
        mut ledger: Ledger,
        options: &BuildOptions<'_>,
    ) -> Result<Scene, SceneError> {
        let watch = Stopwatch::start();
        let mut scene = assemble::assemble(self.description(options)?, options)?;
        let seconds = watch.elapsed().as_secs_f64();
        let standing = before.map(|Worn { decay, areas }| {
            let standing = standing(&scene);
            // As old trees are measured: what one costs that was built for this shape, by what one did for the old.
            let after = decay * standing.built / areas.price();
            ledger.rebuilt(seconds, decay, after);
            standing
        });
        if standing.is_none() {
            ledger.rebuilt(seconds, 1.0, 1.0);
        }
        scene.upkeep = Upkeep::new(standing, Some(ledger));
        Ok(scene)
    }

    /// The scene with the tree that followed, repaired where that is what to do; or what the tree has come to, if there should be a new
    /// one.
    fn mend(
        &self,
        mut followed: Followed,
        ledger: &mut Ledger,
        options: &BuildOptions<'_>,
    ) -> Result<Result<Done, Worn>, SceneError> {
        let decay = followed.decay();
        let reason = if followed.parts == Parts::default() { Reason::Same } else { Reason::Few };
        let mut done = (Action::Refitted, reason, decay, followed.parts);
        match ledger.next(self.policy, decay) {
            Next::Nothing => {}
            Next::Rebuild => return Ok(Err(Worn { decay, areas: followed.mended.areas() })),
            Next::Repair => {
                let watch = Stopwatch::start();
                let context = &options.context;
                let build = |boxes: &[Aabb]| Quality::Default.plan().build_whole(boxes, context);
                let prices = &followed.standing.prices;
                let areas = followed.mended.areas();
                if let Some(repair) = followed.mended.repair(prices, build, &context.cancel)? {
                    followed.mended = repair.mended;
                    followed.standing.prices = Arc::new(repair.prices);
                    let decay = followed.decay();
                    ledger.repaired(watch.elapsed().as_secs_f64(), done.2, decay);
                    let (kept, loose) = (repair.kept as u64, repair.loose as u64);
                    let parts = Parts { kept, loose, ..followed.parts };
                    done = (Action::Repaired, Reason::Decayed, decay, parts);
                } else {
                    ledger.beyond_repair(decay);
                }
                // Who counts rays waits until a new tree pays.
                let enough = match self.policy {
                    Policy::Auto => done.2 <= WORTH_KEEPING,
                    Policy::Repair => done.0 == Action::Repaired,
                    _ => true,
                };
                if !enough {
                    return Ok(Err(Worn { decay, areas }));
                }
            }
        }
        let (action, reason, decay, parts) = done;
        let scene = self.finish(followed, *ledger, options)?;
        Ok(Ok(Done { scene, action, reason, decay, parts }))
    }

    /// The scene with the tree that followed.
    fn finish(
        &self,
        followed: Followed,
        ledger: Ledger,
        options: &BuildOptions<'_>,
    ) -> Result<Scene, SceneError> {
        let before = &*self.before.structure;
        let Followed { geometries, first_ids, moving, placements, mended, mut standing, .. } =
            followed;
        standing.areas = mended.areas();
        let bounds = mended.bounds();
        let (layout, cover, triangles) = mended.finish(&options.context.cancel)?;
        standing.triangles = triangles.into();
        let repeats = placements.instances.blocks.iter().any(|block| block.repeats);
        let level = Level {
            level: before.level,
            geometries,
            first_ids,
            placements,
            layout,
            bounds,
            cover,
            repeats: before.repeats || repeats || followed.repeats,
            around_meshes: followed.around_meshes.unwrap_or(bounds),
        };
        let mut structure = level.structure();
        structure.moves |= !moving.is_empty();
        structure.moving = moving;
        structure.spans = self.spans(&structure, &followed.came, &options.context.cancel)?;
        let mut report = Arc::clone(&self.before.report);
        if followed.skipped != Skipped::default() {
            Arc::make_mut(&mut report).skipped.add(&followed.skipped);
        }
        Ok(Scene {
            structure: Arc::new(structure),
            report,
            auto: None,
            upkeep: Upkeep::new(Some(standing), Some(ledger)),
        })
    }

    /// Everything as it is to be.
    fn description(&self, options: &BuildOptions<'_>) -> Result<SceneBuilder, SceneError> {
        let known = self.known(options)?;
        let before = &self.before.structure;
        let placed = |at: usize| match (self.instances.get(&at), before.instances.get(at)) {
            (Some(placed), _) => Some(placed.clone()),
            (None, before) => before.map(Placed::again),
        };
        let instances = (0..self.counts[1]).filter_map(placed).collect();
        Ok(SceneBuilder { geometries: self.geometries(), instances, known })
    }
}
