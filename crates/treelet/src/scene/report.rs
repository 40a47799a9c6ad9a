//! What building a scene found and made.

use super::choice::Choice;
use super::error::InstanceDefect;
use crate::geometry::Defect;
use crate::tree::TreeStats;
use alloc::string::String;
use core::time::Duration;

/// What building one scene found and made, the scenes inside its instances not included.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BuildReport {
    /// Which builder made the tree.
    pub builder: &'static str,
    /// All that made the tree, in order, as in `sbvh + reinsertion`.
    pub plan: String,
    /// What [`Quality::Rays`](super::Quality::Rays) or [`Quality::Auto`](super::Quality::Auto) chose, and why.
    pub choice: Option<Choice>,
    /// Triangles in the tree.
    pub triangles: u64,
    /// Of these, triangles without area: kept, and never hit where they are seen as a line.
    pub degenerate: u64,
    /// Primitives of other kinds in the tree.
    pub others: u64,
    /// Instances in the tree.
    pub instances: u64,
    /// Of these, instances whose large, empty boxes the tree has not: several smaller ones in their place, around parts
    /// of what is placed.
    pub opened_instances: u64,
    /// Instances of scenes that hold nothing: kept in the numbering, not in the tree.
    pub empty_instances: u64,
    /// What was left out, because the caller chose so.
    pub skipped: Skipped,
    /// The tree's vital statistics.
    pub tree: TreeStats,
    /// Time to build the tree, from boxes to nodes; zero where there is no clock.
    pub tree_time: Duration,
    /// Time for everything, from meshes to a scene that answers; zero where there is no clock.
    pub total_time: Duration,
    /// Bytes that queries read on this level: nodes, packed triangles, instances.
    pub trace_bytes: u64,
}

/// What was wrong in the input and skipped, with the first offender of each sort.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skipped {
    /// Triangles skipped: `index_out_of_range + bad_vertex`.
    pub triangles: u64,
    /// Of these, triangles that name a vertex that is not there.
    pub index_out_of_range: u64,
    /// Of these, triangles with a vertex that is NaN, infinite or too far away.
    pub bad_vertex: u64,
    /// The first triangle skipped: mesh, triangle, what is wrong.
    pub first_triangle: Option<(usize, usize, Defect)>,
    /// Primitives of other kinds skipped.
    pub others: u64,
    /// The first of them: geometry, primitive, what is wrong.
    pub first_other: Option<(usize, usize, Defect)>,
    /// Instances skipped: their map is singular, not finite, or leads too far away.
    pub instances: u64,
    /// The first instance skipped, and what is wrong.
    pub first_instance: Option<(usize, InstanceDefect)>,
}

impl Skipped {
    /// Adds what was skipped of more.
    pub(super) fn add(&mut self, more: &Self) {
        self.triangles += more.triangles;
        self.index_out_of_range += more.index_out_of_range;
        self.bad_vertex += more.bad_vertex;
        self.others += more.others;
        self.instances += more.instances;
        self.first_triangle = self.first_triangle.or(more.first_triangle);
        self.first_other = self.first_other.or(more.first_other);
        self.first_instance = self.first_instance.or(more.first_instance);
    }
}
