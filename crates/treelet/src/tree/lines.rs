//! Long random lines through a tree: what they cost, and how different they are.
//!
//! Source: T. Aila, T. Karras, S. Laine, "On Quality Metrics of Bounding Volume Hierarchies", HPG
//! 2013: leaf count variability (LCV) is the standard deviation of the number of leaves that a ray
//! visits. Rays of different length keep each other waiting where several are traced side by side.
//!
//! Which rays: lines through the root's box that end nowhere, every line as likely as every other
//! (uniform in the measure that does not change when the box is moved or turned). They are the rays
//! of the surface area heuristic, so their mean cost must be the tree's SAH: M. W. Crofton, "On the
//! Theory of Local Probability", Philosophical Transactions 158, 1868. A test holds the two against
//! each other. Such a line enters at a point uniform on the box's surface, in a direction whose
//! chance goes with the cosine to the face.

use super::draws::{Draws, Estimate, Sums};
use super::{Kind, SahConstants, Tree};
use crate::bounds::{Aabb, SlabRay};
use crate::context::{Cancel, Cancelled, parallel};
use alloc::vec::Vec;

/// Lines that are walked together.
const CHUNK: u32 = 1024;

/// How many lines make a measurement by default: the deviation is good to half a percent.
pub const LINES: u32 = 1 << 16;

/// What random lines through the root meet.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LineStats {
    /// Leaves that a line meets.
    pub leaves: Estimate,
    /// The standard deviation of that: LCV.
    pub lcv: f64,
    /// What the nodes cost that a line meets: an estimate of [`Tree::sah`].
    pub cost: Estimate,
}

impl Tree {
    /// Sends `lines` random lines through the tree. The same for any number of threads. All zero
    /// for a root without area (nothing, one point, one line): no line meets it.
    ///
    /// # Errors
    ///
    /// Cancellation.
    pub fn line_stats(
        &self,
        constants: &SahConstants,
        lines: u32,
        cancel: &Cancel,
    ) -> Result<LineStats, Cancelled> {
        let root = self.bounds();
        if root.half_area() <= 0.0 {
            return Ok(LineStats::default());
        }
        let starts: Vec<u32> = (0..lines).step_by(CHUNK as usize).collect();
        let sums = parallel::map(starts, |start| {
            let mut stack = Vec::new();
            let (mut leaves, mut cost) = (Sums::default(), Sums::default());
            for index in start..start.saturating_add(CHUNK).min(lines) {
                cancel.check()?;
                let ray = line(&root, &mut Draws::new(SEED, u64::from(index)));
                let met = self.meet(&ray, constants, &mut stack);
                leaves.add(met.0);
                cost.add(met.1);
            }
            Ok((leaves, cost))
        });
        let mut all = (Sums::default(), Sums::default());
        for sums in sums {
            let (leaves, cost) = sums?;
            all = (all.0.join(leaves), all.1.join(cost));
        }
        let (leaves, cost) = all;
        Ok(LineStats { leaves: leaves.mean(), lcv: leaves.deviation(), cost: cost.mean() })
    }

    /// How many leaves a line meets, and what the nodes cost that it meets.
    fn meet(&self, ray: &SlabRay, constants: &SahConstants, stack: &mut Vec<usize>) -> (f64, f64) {
        let (mut leaves, mut cost) = (0.0, 0.0);
        stack.clear();
        stack.push(0);
        while let Some(at) = stack.pop() {
            let node = &self.nodes[at];
            if ray.interval(&node.bounds).is_empty() {
                continue;
            }
            cost += constants.price(node);
            match node.kind() {
                Kind::Inner { left } => stack.extend([left + 1, left]),
                Kind::Leaf { .. } => leaves += 1.0,
            }
        }
        (leaves, cost)
    }
}

/// Tells this measurement's random numbers from others'.
const SEED: u64 = 0x1C5;

/// A random line through a box.
fn line(bounds: &Aabb, draws: &mut Draws) -> SlabRay {
    // Choose a face by its area.
    let extent = bounds.extent().map(f64::from);
    let faces = [extent[1] * extent[2], extent[2] * extent[0], extent[0] * extent[1]];
    let mut place = (faces[0] + faces[1] + faces[2]) * draws.unit();
    let mut axis = 0;
    while axis < 2 && place >= faces[axis] {
        place -= faces[axis];
        axis += 1;
    }
    let from_above = draws.unit() < 0.5;

    // Enter anywhere on it; a point of the disk below a direction makes its chance its cosine.
    let [a, b] = [(axis + 1) % 3, (axis + 2) % 3];
    let mut origin = if from_above { bounds.hi } else { bounds.lo };
    for axis in [a, b] {
        let share = draws.unit();
        let (lo, hi) = (f64::from(bounds.lo[axis]), f64::from(bounds.hi[axis]));
        origin[axis] = (lo * (1.0 - share) + hi * share) as f32;
    }
    let [x, y] = draws.disk();
    let inward = libm::sqrt((1.0 - x * x - y * y).max(0.0));
    let mut direction = [0.0; 3];
    direction[axis] = if from_above { -inward } else { inward } as f32;
    direction[a] = x as f32;
    direction[b] = y as f32;
    SlabRay::new(origin, direction, 0.0)
}
