//! Committing an edit: what of the old snapshot stays, what is refitted, what is built anew.
//!
//! Cost: O(blocks of instances + meshes), and what changed: one reverse sweep of the tree where vertices
//! moved, a copy of it and the way up from a few instances, or a build.

use super::changes::{Changes, changes};
use super::fetch::{Moved, bounds_of, has_defects};
use super::ledger::{Ledger, Next};
use super::mend::{Mended, appraise, sweep, touched};
use super::{Action, Commit, Edit, Parts, Policy, Reason, WORTH_KEEPING};
use crate::bounds::Aabb;
use crate::context::clock::Stopwatch;
use crate::context::parallel;
use crate::layout::lower::Packed;
use crate::layout::refit::{self, Areas, Came, Content};
use crate::layout::wide::Wide;
use crate::scene::assemble::Level;
use crate::scene::builder::{BuildOptions, Placed, SceneBuilder};
use crate::scene::place::{self, Part, Placements, place_instances};
use crate::scene::report::BuildReport;
use crate::scene::upkeep::{Standing, Upkeep};
use crate::scene::{Quality, Scene, SceneError, assemble};
use crate::trace::placements::{BLOCK, Block, Instances};
use crate::trace::slack::{Near, Slack};
use crate::trace::structure::{Geometry, Layout, Structure};
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::mem;

/// What followed what moved, on its way to a scene.
struct Followed {
    geometries: Vec<Geometry>,
    placements: Placements,
    /// `None` where the meshes are all there is.
    around_meshes: Option<Aabb>,
    mended: Mended,
    standing: Standing,
    /// What came and went.
    parts: Parts,
}

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

impl Followed {
    /// How much dearer the tree is than when it was built.
    fn decay(&self) -> f64 {
        self.mended.areas().price() / self.standing.built
    }
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
        let mut scene = assemble::assemble(self.description(), options)?;
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
        let Followed { geometries, placements, around_meshes, mended, mut standing, .. } = followed;
        standing.areas = mended.areas();
        let bounds = mended.bounds();
        let (layout, cover, triangles) = mended.finish(&options.context.cancel)?;
        standing.triangles = triangles.into();
        let repeats = placements.instances.blocks.iter().any(|block| block.repeats);
        let level = Level {
            level: before.level,
            geometries,
            first_ids: before.first_ids.clone(),
            placements,
            layout,
            bounds,
            cover,
            repeats: before.repeats || repeats,
            around_meshes: around_meshes.unwrap_or(bounds),
        };
        Ok(Scene {
            structure: Arc::new(level.structure()),
            report: Arc::clone(&self.before.report),
            auto: None,
            upkeep: Upkeep::new(Some(standing), Some(ledger)),
        })
    }

    /// Everything as it is to be.
    fn description(&self) -> SceneBuilder {
        let before = &self.before.structure;
        let placed = |at: usize| match (self.instances.get(&at), before.instances.get(at)) {
            (Some(placed), _) => Some(placed.clone()),
            (None, before) => before.map(Placed::again),
        };
        let instances = (0..self.counts[1]).filter_map(placed).collect();
        SceneBuilder { geometries: self.geometries(), instances }
    }

    /// Meshes and other shapes as they are to be.
    fn geometries(&self) -> Vec<Geometry> {
        let before = &self.before.structure.geometries;
        let geometry = |geom: usize| self.geometries.get(&geom).or(before.get(geom)).cloned();
        (0..self.counts[0]).filter_map(geometry).collect()
    }

    /// The instances as they are to be: blocks without a change stay.
    fn parts(&self) -> Vec<Part> {
        let blocks = self.before.structure.instances.blocks.iter().enumerate();
        let part = |(index, block): (usize, &Arc<Block>)| {
            // What was added fills the last block.
            let first = index * BLOCK;
            let mut changes = self.instances.range(first..first + BLOCK).peekable();
            if changes.peek().is_none() {
                return Part::Kept(Arc::clone(block));
            }
            let mut placed: Vec<_> = block.items.iter().map(Placed::again).collect();
            for (at, change) in changes {
                match placed.get_mut(at - first) {
                    Some(placed) => *placed = change.clone(),
                    None => placed.push(change.clone()),
                }
            }
            Part::New(placed.into_iter().collect())
        };
        let mut parts: Vec<_> = blocks.map(part).collect();
        let added = self.instances.range(parts.len() * BLOCK..);
        parts.extend(place::parts(added.map(|(_, placed)| placed.clone()).collect()));
        parts
    }

    /// Whether primitives are elsewhere; or why the tree
    /// cannot stay.
    fn reshaped(&self) -> Result<bool, Reason> {
        let before = &self.before.structure;
        // To the first instances of all, there is no tree of instances.
        let more = self.counts[1] > before.instances.len();
        if self.counts[0] != before.geometries.len() || (more && before.instances.is_empty()) {
            return Err(Reason::Different);
        }
        let moves = |it: &Geometry| it.mesh().is_some_and(|mesh| mesh.is_moving());
        let is_moving = self.geometries.values().any(moves);
        if is_moving || !before.moving.is_empty() {
            return Err(Reason::Moving);
        }
        let mut reshaped = false;
        for (&geom, Geometry { shape, .. }) in &self.geometries {
            let old = &before.geometries[geom].shape;
            if old.kind() != shape.kind() || old.len() != shape.len() {
                return Err(Reason::Different);
            }
            if old.is_same(shape) {
                continue;
            }
            reshaped = true;
            // Triangles are looked at where they are fetched.
            if shape.mesh().is_none() && has_defects(shape) {
                return Err(Reason::Unfit);
            }
        }
        let skipped = &self.before.report.skipped;
        if reshaped && skipped.triangles + skipped.others > 0 {
            return Err(Reason::Unfit);
        }
        Ok(reshaped)
    }

    /// The tree around what moved; or why it cannot stay.
    fn follow(
        &mut self,
        ledger: &Ledger,
        options: &BuildOptions<'_>,
    ) -> Result<Result<Followed, Reason>, SceneError> {
        let spare = self.spare.take();
        let before = &*self.before.structure;
        let reshaped = match self.reshaped() {
            Err(reason) => return Ok(Err(reason)),
            Ok(reshaped) => reshaped,
        };

        // Place the instances; without any, nobody asks where the meshes are before it is known.
        let geometries = self.geometries();
        let alone = before.instances.is_empty();
        let around_meshes = match (reshaped, alone) {
            (false, _) => before.around_meshes,
            (true, true) => Aabb::EMPTY,
            (true, false) => bounds_of(&geometries),
        };
        let mut report = BuildReport::default();
        let mut placements = place_instances(self.parts(), around_meshes, options, &mut report)?;
        let Some(instances) = mem::take(&mut placements.instances).opened_as(&before.instances)
        else {
            return Ok(Err(Reason::Different));
        };
        placements.instances = instances;
        let changes = match changes(&before.instances, &placements.instances, &before.layout)? {
            Err(reason) => return Ok(Err(reason)),
            Ok(changes) => changes,
        };
        let Changes { moved, came, gone } = &changes;
        let same = came.is_empty() && *gone == 0 && self.counts[1] == before.instances.len();

        // Mend the boxes: all of them, or those that few instances are in.
        let single = |number: usize| single(&geometries, &placements.instances, before, number);
        let known = self.before.upkeep.standing.clone();
        let mut standing = known.unwrap_or_else(|| standing(&self.before));
        // A tree of one leaf has no node to put another one into.
        if !came.is_empty() && !before.layout.root().is_inner() {
            return Ok(Err(Reason::Different));
        }
        // Only the way up from single ones takes some in, or leaves some out.
        let few = !reshaped && (!same || moved.len() < before.instances.len() / 8 + 2);
        let touched = if few {
            // What it was is asked for where nothing is called otherwise now.
            let numbers = moved.iter().flat_map(|&at| placements.instances.numbers(at));
            let was = |number| if same { before.instances.bounds(number) } else { Aabb::EMPTY };
            let moved = numbers.map(|number| refit::Moved { number, was: was(number) });
            let mut moved: Vec<_> = moved.filter(|it| !same || !it.was.is_empty()).collect();
            moved.sort_unstable_by_key(|it| it.number);
            touched(
                &before.layout,
                (before.bounds, standing.areas, &standing.triangles),
                &moved,
                &Came {
                    from: before.instances.len(),
                    numbers: self.counts[1] - before.instances.len(),
                    placed: came,
                },
                single,
            )?
        } else {
            None
        };
        if touched.is_none() && !same {
            return Ok(Err(Reason::Different));
        }
        let mended = if touched.is_some() {
            touched
        } else {
            let moved = Moved { geometries: &geometries, before };
            let fetch = |ids: &[u32], packed: &mut [Packed]| moved.fetch(ids, packed);
            let expect = |ids: &[u32]| moved.expect(ids);
            let expect_corners = |ids: &[u32]| moved.expect_corners(ids);
            let content = Content {
                triangles: &fetch,
                expect: &expect,
                expect_corners: &expect_corners,
                instance: &single,
            };
            let spare = spare.and_then(|spare| Arc::into_inner(spare.structure));
            standing.sweeps = standing.sweeps.wrapping_add(1);
            let is_worn = ledger.is_worn(standing.areas.price() / standing.built);
            let worn = is_worn.then_some(standing.sweeps);
            sweep(&before.layout, &content, worn, spare, &options.context.cancel)?
        };
        let Some(mended) = mended else { return Ok(Err(Reason::Unfit)) };
        if alone && reshaped {
            placements = place_instances(Vec::new(), mended.bounds(), options, &mut report)?;
        }
        let around_meshes = (!alone).then_some(around_meshes);
        let parts = Parts { added: came.len() as u64, removed: *gone, ..Parts::default() };
        let mut followed =
            Followed { geometries, placements, around_meshes, mended, standing, parts };
        followed.standing.prices = followed.mended.prices(&followed.standing.prices);
        Ok(Ok(followed))
    }
}

/// The box of an instance or, numbered after them, of a primitive that is no triangle.
fn single(
    geometries: &[Geometry],
    instances: &Instances,
    before: &Structure,
    number: usize,
) -> Aabb {
    match number.checked_sub(instances.entries()) {
        None => instances.bounds(number),
        Some(id) => {
            let (geom, prim) = before.name(id as u32);
            geometries[geom as usize].shape.bounds(prim as usize)
        }
    }
}

/// What a tree is worth that is as it was built.
fn standing(scene: &Scene) -> Standing {
    let structure = &*scene.structure;
    let moved = Moved { geometries: &structure.geometries, before: structure };
    let fetch = |ids: &[u32], packed: &mut [Packed]| moved.fetch(ids, packed);
    let single =
        |number: usize| single(&structure.geometries, &structure.instances, structure, number);
    let expect = |ids: &[u32]| moved.expect(ids);
    let expect_corners = |ids: &[u32]| moved.expect_corners(ids);
    let content = Content {
        triangles: &fetch,
        expect: &expect,
        expect_corners: &expect_corners,
        instance: &single,
    };
    appraise(&structure.layout, &content)
}

/// A scene of nothing that can be placed into this one.
pub(super) fn nothing_like(like: &Structure) -> Arc<Structure> {
    let bounds = Aabb::EMPTY;
    let layout = match like.layout {
        Layout::Wide8(_) => Layout::Wide8(Wide::nothing()),
        Layout::Wide16(_) => Layout::Wide16(Wide::nothing()),
        Layout::Compact(_) => Layout::Compact(Wide::nothing()),
    };
    let placements = Placements {
        instances: Instances::default(),
        reach: bounds,
        slack: Slack::new(Near::of(&bounds), 0.0),
        paths: 1,
    };
    let level = Level {
        level: like.level,
        geometries: Vec::new(),
        first_ids: Vec::new(),
        placements,
        layout,
        bounds,
        cover: Vec::new(),
        repeats: false,
        around_meshes: bounds,
    };
    Arc::new(level.structure())
}
