//! From geometries and instances to a level that can be walked: gather, build, lower.

use super::builder::{BuildOptions, LayoutChoice, SceneBuilder};
use super::choice;
use super::gather::{Names, Prims, add_triangles, first_ids, other_boxes};
use super::improve;
use super::moving::{self, Moving};
use super::open;
use super::place::{Placements, parts, place_instances};
use super::quality::Cuttable;
use super::report::BuildReport;
use super::travel;
use super::{Plan, Quality, Scene, SceneError};
use crate::bounds::{Aabb, Cover};
use crate::build::BuildError;
use crate::context::clock::Stopwatch;
use crate::geometry::triangle::Ordinary;
use crate::layout::Collapse;
use crate::layout::compact::pack::pack;
use crate::layout::lower::{Numbered, Packed, lower, split_leaves};
use crate::layout::wide::LEAF_MAX;
use crate::simd::Checked;
use crate::trace::moving::MovingMesh;
use crate::trace::placements::{Instance, Instances, Part};
use crate::trace::structure::{Geometry, Layout, Structure};
use crate::tree::{Kind, PRIMS_MAX, Tree};
use alloc::string::ToString;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::mem;
use core::time::Duration;

/// The most boxes that stand for a level when it is transformed.
pub(super) const COVER_MAX: usize = 32;

/// Builds the scene.
pub(super) fn assemble(
    description: SceneBuilder,
    options: &BuildOptions<'_>,
) -> Result<Scene, SceneError> {
    if options.builder.is_none() && options.optimizers.is_none() {
        match options.quality {
            Quality::Rays(rays) => {
                return choice::build(Gathered::new(description, options)?, options, rays);
            }
            Quality::Auto => return improve::start(description, options),
            _ => {}
        }
    }
    Gathered::new(description, options)?.scene(&options.plan(), options, false)
}

/// Geometries and instances, checked and boxed: what any number of trees can be built over.
pub(super) struct Gathered {
    geometries: Vec<Geometry>,
    first_ids: Vec<u32>,
    placements: Placements,
    moving: Vec<Moving>,
    /// Meshes that move and have trees already.
    known: Vec<(usize, MovingMesh)>,
    prims: Prims,
    report: BuildReport,
    clock: Stopwatch,
}

impl Gathered {
    /// Checks and boxes what the leaves will hold: triangles first, then instances, then what else there is.
    pub(super) fn new(
        description: SceneBuilder,
        options: &BuildOptions<'_>,
    ) -> Result<Self, SceneError> {
        let clock = Stopwatch::start();
        let mut report = BuildReport::default();
        let SceneBuilder { geometries, instances, known } = description;
        let first_ids = first_ids(&geometries)?;
        let mut others = other_boxes(&geometries, &first_ids, options, &mut report)?;
        let moving = moving::gather(&geometries, &first_ids, options, &mut report)?;
        others.extend(moving.iter().map(|mesh| (mesh.first_id, mesh.bounds)));
        others.sort_unstable_by_key(|(id, _)| *id);
        let meshes = geometries.iter().enumerate();
        let meshes = meshes.filter_map(|(geom, geometry)| Some((geom, geometry.mesh()?)));
        let meshes = meshes.filter(|(_, mesh)| !mesh.is_moving());
        let triangles: usize = meshes.clone().map(|(_, mesh)| mesh.triangles().len()).sum();
        let budget = open::budget(instances.len(), options);
        let singles = instances.len() + others.len();
        let room = triangles.saturating_add(singles);
        let budget = budget.min(PRIMS_MAX.saturating_sub(room));
        let mut prims = Prims::with_room(triangles, singles + budget)?;
        for (geom, mesh) in meshes {
            add_triangles(geom, mesh, options, &mut prims, &mut report)?;
        }
        let around = others.iter().fold(prims.around, |all, (_, bounds)| all.union(bounds));
        prims.around = around;
        let mut placements = place_instances(parts(instances), around, options, &mut report)?;
        let opened = open::parts(&placements.instances, budget);
        placements.instances = mem::take(&mut placements.instances).opened(&opened);
        add_instances(&placements.instances, &opened, &mut prims, &mut report);
        // Leaves call them by their ids, after all instances and parts of them.
        let after = placements.instances.entries() as u64;
        for (id, bounds) in others {
            let number = after + u64::from(id);
            let number =
                u32::try_from(number).map_err(|_| BuildError::TooManyPrims { prims: number })?;
            prims.add_single(number, bounds);
        }
        report.triangles += prims.triangles as u64;
        Ok(Self { geometries, first_ids, placements, moving, known, prims, report, clock })
    }

    /// What leaves will hold.
    pub(super) fn prims(&self) -> usize {
        self.prims.bounds().len()
    }

    /// The time since gathering began.
    pub(super) fn elapsed(&self) -> Duration {
        self.clock.elapsed()
    }

    /// The scene with the plan's tree. Only what is built so that there may be others `again` leaves enough behind for
    /// another one.
    pub(super) fn scene(
        &mut self,
        plan: &Plan<'_>,
        options: &BuildOptions<'_>,
        again: bool,
    ) -> Result<Scene, SceneError> {
        let (mut tree, mut report) = self.tree(plan, options)?;
        let Self { geometries, first_ids, placements, moving, known, prims, clock, .. } = self;
        if report.tree.leaf_max as usize > LEAF_MAX || !prims.singles.is_empty() {
            tree = split_leaves(tree, prims.bounds(), prims.triangles)?;
        }
        let (geometries, first_ids, instances) = if again {
            (geometries.clone(), first_ids.clone(), placements.instances.clone())
        } else {
            let instances = mem::take(&mut placements.instances);
            (mem::take(geometries), mem::take(first_ids), instances)
        };
        let content =
            Content { geometries, first_ids, placements: Placements { instances, ..*placements } };
        let mut structure = finish(content, prims, &tree, plan.collapse, options, again)?;
        moving::build(&mut structure, (moving, known), plan, options)?;
        travel::split(&mut structure, plan, options)?;
        report.trace_bytes = level_bytes(&structure);
        report.total_time = clock.elapsed();
        let (structure, report) = (Arc::new(structure), Arc::new(report));
        Ok(Scene { structure, report, auto: None, upkeep: Arc::default() })
    }

    /// The plan's tree, and what is to be said of it.
    fn tree(
        &self,
        plan: &Plan<'_>,
        options: &BuildOptions<'_>,
    ) -> Result<(Tree, BuildReport), SceneError> {
        let clock = Stopwatch::start();
        let Self { geometries, prims: Prims { names, triangles, .. }, .. } = self;
        let bounds = self.prims.bounds();
        let cut = Cuttable { geometries, names, triangles: *triangles, bounds };
        let tree = plan.build(bounds, &cut, &options.context)?;
        let report = BuildReport {
            builder: plan.builder.info().name,
            plan: plan.to_string(),
            tree_time: clock.elapsed(),
            tree: tree.measure(&options.context.cancel)?,
            ..self.report.clone()
        };
        Ok((tree, report))
    }
}

/// What the numbers in a tree stand for.
struct Content {
    geometries: Vec<Geometry>,
    first_ids: Vec<u32>,
    placements: Placements,
}

/// Adds the instances that are somewhere, or in the place of those that are opened their parts.
fn add_instances(
    instances: &Instances,
    opened: &[(Part, Aabb)],
    prims: &mut Prims,
    report: &mut BuildReport,
) {
    // Usually that is all of them, block after block.
    if opened.is_empty() && prims.add_blocks(&instances.blocks) {
        report.instances = instances.len() as u64;
        return;
    }
    let mut opened = opened.iter().map(|(part, _)| part.instance).peekable();
    let placed = instances.iter().zip(0..).filter(|(instance, _)| !instance.bounds().is_empty());
    for (instance, index) in placed {
        report.instances += 1;
        if opened.peek() != Some(&index) {
            prims.add_single(index, instance.bounds());
            continue;
        }
        report.opened_instances += 1;
        while opened.next_if_eq(&index).is_some() {}
    }
    for number in instances.len()..instances.entries() {
        prims.add_single(number as u32, instances.bounds(number));
    }
}

/// Lowers the tree and derives what walks need to know about the level. The boxes of `prims` are let go unless
/// another tree is to be built over them `again`.
fn finish(
    content: Content,
    prims: &mut Prims,
    tree: &Tree,
    collapse: Collapse,
    options: &BuildOptions<'_>,
    again: bool,
) -> Result<Structure, SceneError> {
    let Content { geometries, first_ids, placements } = content;
    let Placements { instances, reach, slack, paths } = placements;
    let repeats = tree.prims.len() > prims.bounds().len()
        || instances.blocks.iter().any(|block| block.repeats);
    if !again {
        prims.forget_bounds();
    }
    // Where there are triangles only, nobody looks for anything else.
    let placed = match &*prims.singles {
        [] => Numbered::NONE,
        numbers => Numbered { first: prims.triangles as u32, numbers },
    };
    let level = options.level.checked().ok_or(SceneError::Level { level: options.level })?;

    let source = Source { geometries: &geometries, first_ids: &first_ids, names: &prims.names };
    let source = |prims: &[u32], packed: &mut [Packed]| source.fetch(prims, packed);
    let cancel = &options.context.cancel;
    let layout = match options.layout.unwrap_or(LayoutChoice::best_for(options.level)) {
        LayoutChoice::Wide8 => Layout::Wide8(lower(tree, placed, &source, collapse, cancel)?),
        LayoutChoice::Wide16 => Layout::Wide16(lower(tree, placed, &source, collapse, cancel)?),
        LayoutChoice::Compact => {
            let wide = lower(tree, placed, &source, collapse, cancel)?;
            Layout::Compact(pack(&wide, cancel)?)
        }
    };
    if instances.blocks.iter().any(|block| block.layouts & !layout.bit() != 0) {
        let other = |instance: &Instance| !instance.structure.layout.is_as(&layout);
        let instance = instances.iter().position(other).unwrap_or_default();
        return Err(SceneError::MixedLayouts { instance });
    }
    let level = Level {
        level,
        geometries,
        first_ids,
        placements: Placements { instances, reach, slack, paths },
        layout,
        bounds: tree.bounds(),
        cover: cover(tree),
        repeats,
        around_meshes: prims.around,
    };
    Ok(level.structure())
}

/// All that a level is made of.
pub(super) struct Level {
    pub(super) level: Checked,
    pub(super) geometries: Vec<Geometry>,
    pub(super) first_ids: Vec<u32>,
    pub(super) placements: Placements,
    pub(super) layout: Layout,
    pub(super) bounds: Aabb,
    pub(super) cover: Vec<Aabb>,
    pub(super) repeats: bool,
    /// Around everything but the instances.
    pub(super) around_meshes: Aabb,
}

impl Level {
    /// With what walks want to know besides.
    pub(super) fn structure(self) -> Structure {
        let Self { level, geometries, first_ids, placements, layout, bounds, .. } = self;
        let Placements { instances, reach, slack, paths } = placements;
        Structure {
            repeats: self.repeats,
            level,
            flat: instances.is_empty()
                && geometries.iter().all(|it| it.mesh().is_some_and(|mesh| !mesh.is_moving())),
            unmasked: geometries.iter().all(|geometry| geometry.mask == u32::MAX),
            geometries,
            first_ids,
            moves: instances.blocks.iter().any(|block| block.moves),
            moving: Vec::new(),
            spans: Vec::new(),
            instances,
            layout,
            bounds,
            cover: Cover::new(self.cover),
            reach_cover: Cover::new(alloc::vec![reach]),
            ordinary: Ordinary::level(&reach),
            reach,
            diagonal: bounds.diagonal() as f32,
            reach_lanes: [reach.lo, reach.hi].map(|[x, y, z]| [x, y, z, z]),
            slack,
            paths,
            around_meshes: self.around_meshes,
        }
    }
}

/// Where the triangles of leaves come from.
struct Source<'a> {
    geometries: &'a [Geometry],
    first_ids: &'a [u32],
    /// Only triangles without a defect have one.
    names: &'a Names,
}

/// Triangles that are fetched together.
const FETCH: usize = 64;

impl Source<'_> {
    /// All numbers of vertices first, then all vertices: loads that do not wait for each other, so
    /// that many cache misses are on their way at once.
    fn fetch(&self, prims: &[u32], packed: &mut [Packed]) {
        for (prims, packed) in prims.chunks(FETCH).zip(packed.chunks_mut(FETCH)) {
            match self.names {
                Names::Whole { geom } => self.fetch_of(*geom as usize, prims, packed),
                Names::Listed(names) => self.fetch_named(names, prims, packed),
            }
        }
    }

    /// Triangles of one mesh.
    fn fetch_of(&self, geom: usize, prims: &[u32], packed: &mut [Packed]) {
        let Some(mesh) = self.geometries[geom].mesh() else { return };
        let first_id = self.first_ids[geom];
        let (positions, triangles) = (mesh.positions(), mesh.triangles());
        let mut corners = [[0_u32; 3]; FETCH];
        for (&prim, corners) in prims.iter().zip(&mut corners) {
            *corners = triangles[prim as usize];
        }
        for ((&[a, b, c], &prim), packed) in corners.iter().zip(prims).zip(packed) {
            let corner = |at: u32| positions.get(at as usize).copied().unwrap_or_default();
            *packed = Packed { corners: [corner(a), corner(b), corner(c)], id: first_id + prim };
        }
    }

    fn fetch_named(&self, all: &[(u32, u32)], prims: &[u32], packed: &mut [Packed]) {
        let mut names = [(0, 0); FETCH];
        for (&at, name) in prims.iter().zip(&mut names) {
            *name = all[at as usize];
        }
        for (&(geom, prim), packed) in names.iter().zip(packed) {
            let mesh = self.geometries[geom as usize].mesh();
            let corners = mesh.and_then(|mesh| mesh.corners(prim as usize));
            *packed = Packed {
                corners: corners.unwrap_or_default(),
                id: self.first_ids[geom as usize] + prim,
            };
        }
    }
}

/// A few boxes of the tree that together contain everything: the largest is opened, again and
/// again.
fn cover(tree: &Tree) -> Vec<Aabb> {
    let mut cut = Vec::with_capacity(COVER_MAX + 1);
    if !tree.nodes.is_empty() {
        cut.push(0);
    }
    while cut.len() < COVER_MAX {
        let inner =
            cut.iter().enumerate().filter_map(|(at, &node)| match tree.nodes[node].kind() {
                Kind::Inner { left } => Some((at, left, tree.nodes[node].bounds.half_area())),
                Kind::Leaf { .. } => None,
            });
        let Some((at, left, _)) = inner.max_by(|a, b| a.2.total_cmp(&b.2)) else { break };
        cut[at] = left;
        cut.push(left + 1);
    }
    cut.into_iter().map(|node: usize| tree.nodes[node].bounds).collect()
}

/// Bytes that walks read on one level.
pub(super) fn level_bytes(level: &Structure) -> u64 {
    let moving = level.moving.iter().map(MovingMesh::bytes).sum::<usize>();
    let spans = level.spans.iter().map(Layout::bytes).sum::<usize>();
    (level.layout.bytes() + spans + level.instances.bytes() + moving) as u64
}
