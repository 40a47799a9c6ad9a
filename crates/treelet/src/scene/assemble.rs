//! From meshes and instances to a level that can be walked: gather, build, lower.

use super::builder::{BuildOptions, LayoutChoice, SceneBuilder};
use super::choice;
use super::gather::{Names, Prims, add_triangles};
use super::improve;
use super::moving::{self, Moving};
use super::place::{Placements, parts, place_instances};
use super::quality::Cuttable;
use super::report::BuildReport;
use super::{Plan, Quality, Scene, SceneError};
use crate::bounds::Aabb;
use crate::build::BuildError;
use crate::context::clock::Stopwatch;
use crate::geometry::Mesh;
use crate::geometry::triangle::Ordinary;
use crate::layout::Collapse;
use crate::layout::compact::pack::pack;
use crate::layout::lower::{Numbered, Packed, lower, split_leaves};
use crate::layout::wide::LEAF_MAX;
use crate::simd::Checked;
use crate::trace::moving::MovingMesh;
use crate::trace::placements::Instance;
use crate::trace::structure::{Geometry, Layout, Structure};
use crate::tree::{Kind, Tree};
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

/// Meshes and instances, checked and boxed: what any number of trees can be built over.
pub(super) struct Gathered {
    meshes: Vec<(Mesh, u32)>,
    placements: Placements,
    moving: Vec<Moving>,
    prims: Prims,
    report: BuildReport,
    clock: Stopwatch,
}

impl Gathered {
    /// Checks and boxes what the leaves will hold: triangles first, then instances.
    pub(super) fn new(
        description: SceneBuilder,
        options: &BuildOptions<'_>,
    ) -> Result<Self, SceneError> {
        let clock = Stopwatch::start();
        let mut report = BuildReport::default();
        let standing = |mesh: &Mesh| if mesh.is_moving() { 0 } else { mesh.triangles().len() };
        let room = description.meshes.iter().map(|(mesh, _)| standing(mesh)).sum();
        let others = description.meshes.iter().filter(|(mesh, _)| mesh.is_moving()).count();
        let mut prims = Prims::with_room(room, description.instances.len() + others)?;
        let mut moving = Vec::with_capacity(others);
        for (geom, (mesh, _)) in description.meshes.iter().enumerate() {
            if let Some((step, vertices)) = mesh.uneven_step() {
                let first = mesh.positions().len();
                return Err(SceneError::Steps { geom, step, vertices, first });
            }
            if mesh.is_moving() {
                let mesh = moving::gather(geom, mesh, options, &mut report)?;
                prims.meshes = prims.meshes.union(&mesh.bounds);
                moving.push(mesh);
            } else {
                add_triangles(geom, mesh, options, &mut prims, &mut report)?;
            }
        }
        moving.retain(|mesh| !mesh.bounds.is_empty());
        let meshes = prims.meshes;
        let placements =
            place_instances(parts(description.instances), meshes, options, &mut report)?;
        let placed = placements
            .instances
            .iter()
            .zip(0..)
            .filter(|(instance, _)| !instance.bounds().is_empty());
        for (instance, index) in placed {
            prims.add_instance(index, instance.bounds());
        }
        report.triangles += prims.triangles as u64;
        report.instances = prims.instances.len() as u64;
        // What moves is numbered after the instances, and like them a leaf each.
        for (mesh, number) in moving.iter().zip(placements.instances.len()..) {
            prims.add_instance(number as u32, mesh.bounds);
        }
        Ok(Self { meshes: description.meshes, placements, moving, prims, report, clock })
    }

    /// What leaves will hold: triangles and instances.
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
        let Self { meshes, placements, moving, prims, clock, .. } = self;
        if report.tree.leaf_max as usize > LEAF_MAX || !prims.instances.is_empty() {
            tree = split_leaves(tree, prims.bounds(), prims.triangles);
        }
        let (meshes, instances) = if again {
            (meshes.clone(), placements.instances.clone())
        } else {
            (mem::take(meshes), mem::take(&mut placements.instances))
        };
        let placements = Placements { instances, ..*placements };
        let mut structure =
            finish(meshes, placements, prims, &tree, plan.collapse, options, again)?;
        moving::build(&mut structure, moving, plan, options)?;
        report.trace_bytes = level_bytes(&structure);
        report.total_time = clock.elapsed();
        Ok(Scene { structure: Arc::new(structure), report: Arc::new(report), auto: None })
    }

    /// The plan's tree, and what is to be said of it.
    fn tree(
        &self,
        plan: &Plan<'_>,
        options: &BuildOptions<'_>,
    ) -> Result<(Tree, BuildReport), SceneError> {
        let clock = Stopwatch::start();
        let Self { meshes, prims: Prims { names, triangles, .. }, .. } = self;
        let bounds = self.prims.bounds();
        let cut = Cuttable { meshes, names, triangles: *triangles, bounds };
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

/// Lowers the tree and derives what walks need to know about the level. The boxes of `prims` are let go unless
/// another tree is to be built over them `again`.
fn finish(
    meshes: Vec<(Mesh, u32)>,
    placements: Placements,
    prims: &mut Prims,
    tree: &Tree,
    collapse: Collapse,
    options: &BuildOptions<'_>,
    again: bool,
) -> Result<Structure, SceneError> {
    let Placements { instances, reach, slack, paths } = placements;
    let repeats = tree.prims.len() > prims.bounds().len()
        || instances.blocks.iter().any(|block| block.repeats);
    if !again {
        prims.forget_bounds();
    }
    // Where there is no instance, nobody looks for one.
    let placed = match &*prims.instances {
        [] => Numbered::NONE,
        numbers => Numbered { first: prims.triangles as u32, numbers },
    };
    let level = options.level.checked().ok_or(SceneError::Level { level: options.level })?;
    let geometries: Vec<_> =
        meshes.into_iter().map(|(mesh, mask)| Geometry { mesh, mask }).collect();
    let mut first_ids = Vec::with_capacity(geometries.len());
    let mut id = 0_u32;
    for geometry in &geometries {
        first_ids.push(id);
        let count = geometry.mesh.triangles().len();
        let next = u32::try_from(count).ok().and_then(|count| id.checked_add(count));
        id = next.ok_or(BuildError::TooManyPrims { prims: u64::from(id) + count as u64 })?;
    }

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
    for (at, instance) in instances.iter().enumerate() {
        if !instance.structure.layout.is_as(&layout) {
            return Err(SceneError::MixedLayouts { instance: at });
        }
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
        around_meshes: prims.meshes,
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
    /// Around the meshes alone.
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
            unmasked: geometries.iter().all(|geometry| geometry.mask == u32::MAX),
            geometries,
            first_ids,
            moves: instances.blocks.iter().any(|block| block.moves),
            moving: Vec::new(),
            instances,
            layout,
            bounds,
            cover: self.cover,
            ordinary: Ordinary::level(&reach),
            reach,
            diagonal: bounds.diagonal() as f32,
            reach_lanes: [reach.lo, reach.hi].map(|[x, y, z]| [x, y, z, z]),
            slack,
            paths,
            around_meshes: self.around_meshes,
            price: None,
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
        let (mesh, first_id) = (&self.geometries[geom].mesh, self.first_ids[geom]);
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
            let corners = self.geometries[geom as usize].mesh.corners(prim as usize);
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
    let instances = size_of::<Instance>() * level.instances.len();
    let moving = level.moving.iter().map(MovingMesh::bytes).sum::<usize>();
    (level.layout.bytes() + instances + moving) as u64
}
