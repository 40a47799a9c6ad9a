//! The Morton curve through a scene's triangles, and the first levels of the tree that it implies,
//! seen along the scene's shortest axis.

use treelet::math::morton::{COARSE_BITS_MAX, Curve};
use treelet::scene::Recipe;
use treelet::tree::Tree;
use treelet::{Aabb, Context};
use treelet_bench::engine::Triangles;
use treelet_bench::page::{CurveDrawing, LevelBox};

use crate::ending::Failure;
use crate::session::Session;

/// The builder whose tree is the curve's own.
const BUILDER: &str = "lbvh";
/// Levels of it that are drawn, below the root.
const LEVELS: u32 = 4;
/// Most corners of the line.
const CORNERS: usize = 2400;

/// Draws curve and tree; `None` of a scene without triangles.
pub(super) fn draw(
    triangles: &Triangles,
    session: &Session,
) -> Result<Option<CurveDrawing>, Failure> {
    let of = |prim: usize| Aabb::of_points(&triangles.corners(prim));
    let bounds: Vec<Aabb> = (0..triangles.len()).map(of).collect();
    let tree = tree(&bounds, session)?;
    let all = tree.bounds();
    if all.is_empty() {
        return Ok(None);
    }

    // Draw the two longest axes, the longer one to the right.
    let extent = all.extent();
    let mut axes = [0, 1, 2];
    axes.sort_by(|&a, &b| extent[b].total_cmp(&extent[a]).then(a.cmp(&b)));
    let [across, up, _] = axes;
    let place = |point: [f32; 3]| {
        [across, up].map(|axis: usize| {
            let share = (point[axis] - all.lo[axis]) / extent[axis];
            if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.5 }
        })
    };

    let order = in_order(&bounds);
    let step = order.len().div_ceil(CORNERS).max(1);
    let path = order.iter().step_by(step).map(|&prim| place(bounds[prim as usize].center()));
    let levels = tree.nodes.iter().zip(tree.depths());
    let drawn = levels.filter(|(_, depth)| (1..=LEVELS).contains(depth));
    let boxes = drawn.map(|(node, level)| LevelBox {
        level,
        lo: place(node.bounds.lo),
        hi: place(node.bounds.hi),
    });
    let name = |axis: usize| ['x', 'y', 'z'][axis];
    Ok(Some(CurveDrawing {
        axes: [name(across), name(up)],
        extent: [across, up].map(|axis| f64::from(extent[axis])),
        path: path.collect(),
        of: order.len() as u64,
        boxes: boxes.collect(),
    }))
}

/// The tree of the curve.
fn tree(bounds: &[Aabb], session: &Session) -> Result<Tree, Failure> {
    let recipe: Recipe = BUILDER.parse().map_err(Failure::from)?;
    let context = Context { cancel: session.cancel.clone(), progress: None };
    let tree = recipe.options().plan().build(bounds, &Whole(bounds), &context);
    tree.map_err(|error| {
        if session.cancel.is_cancelled() { Failure::Cancelled } else { Failure::from(error) }
    })
}

/// Triangles that are never cut.
struct Whole<'a>(&'a [Aabb]);

impl treelet::build::Clip for Whole<'_> {
    fn clip(&self, prim: u32, region: &Aabb) -> Aabb {
        self.0[prim as usize].intersection(region)
    }
}

/// The triangles in the order of the curve through their boxes' centres, those that are not finite
/// left out.
fn in_order(bounds: &[Aabb]) -> Vec<u32> {
    let finite = |prim: &u32| bounds[*prim as usize].center().iter().all(|c| c.is_finite());
    let count = u32::try_from(bounds.len()).unwrap_or(u32::MAX);
    let prims: Vec<u32> = (0..count).filter(finite).collect();
    let centers = prims.iter().fold(Aabb::EMPTY, |all, &prim| {
        let center = bounds[prim as usize].center();
        all.union(&Aabb { lo: center, hi: center })
    });
    let curve = Curve::new(centers.lo, centers.hi, COARSE_BITS_MAX);
    let code = |prim: u32| curve.coarse(curve.cell(bounds[prim as usize].center()));
    let mut keys: Vec<(u64, u32)> = prims.into_iter().map(|prim| (code(prim), prim)).collect();
    keys.sort_unstable();
    keys.into_iter().map(|(_, prim)| prim).collect()
}

#[cfg(test)]
mod tests {
    use super::in_order;
    use treelet::Aabb;

    #[test]
    fn the_curve_goes_through_cell_after_cell() {
        // Corners of a square, the first cell's twice over; and something that is nowhere.
        let at = |x: f32, y: f32| Aabb { lo: [x, y, 0.0], hi: [x, y, 0.0] };
        let nowhere = Aabb { lo: [f32::NAN; 3], hi: [f32::NAN; 3] };
        let boxes = [at(9.0, 8.0), at(0.0, 0.0), nowhere, at(9.0, 0.0), at(1.0, 1.0), at(0.0, 8.0)];
        // The longer axis decides first: the left pair of corners before the right one.
        assert_eq!(in_order(&boxes), [1, 4, 5, 3, 0]);
        assert!(in_order(&[]).is_empty());
    }
}
