//! Cutting a range at a plane: what goes to which side, whole or in pieces.

use super::planes::{Grid, ObjectPlane, SpatialPlane};
use super::{Build, CHUNK, Extent, Range, Ref, Sides};
use crate::build::BuildError;
use crate::context::Cancelled;
use crate::memory;
use alloc::vec::Vec;

impl Build<'_> {
    /// Moves what lies left of a plane between primitives to the back.
    pub(super) fn cut_between(
        &self,
        refs: &mut [Ref],
        extent: &Extent,
        plane: &ObjectPlane,
    ) -> Result<Option<(Sides, usize)>, Cancelled> {
        let grid = Grid::new(&extent.centers, self.options.bins as usize);
        let mut sides = Sides { left: Extent::EMPTY, right: Extent::EMPTY, made: 0, clips: 0 };
        let (mut right, mut end, mut steps) = (0, refs.len(), 0);
        while right < end {
            if steps % CHUNK == 0 {
                self.stage.check()?;
            }
            steps += 1;
            let bounds = refs[right].bounds;
            if grid.bin(bounds.center()[plane.axis], plane.axis) < plane.bin {
                end -= 1;
                sides.left.add(&bounds);
                refs.swap(right, end);
            } else {
                sides.right.add(&bounds);
                right += 1;
            }
        }
        let one_sided = right == 0 || right == refs.len();
        Ok((!one_sided).then_some((sides, right)))
    }

    /// Cuts what straddles a plane, where that is cheaper than to keep it whole on one side.
    pub(super) fn cut_through(
        &self,
        refs: &mut Vec<Ref>,
        begin: usize,
        range: &Range,
        plane: &SpatialPlane,
    ) -> Result<Option<(Sides, usize)>, BuildError> {
        let Some(clip) = self.clip else { return Ok(None) };
        let SpatialPlane { axis, at, .. } = *plane;
        let (mut left, mut right) = (Vec::new(), Vec::new());
        let mut straddling = Vec::new();
        let mut sides = Sides { left: Extent::EMPTY, right: Extent::EMPTY, made: 0, clips: 0 };
        for chunk in refs[begin..].chunks(CHUNK) {
            self.stage.check()?;
            for item in chunk {
                if item.bounds.hi[axis] <= at {
                    sides.left.add(&item.bounds);
                    left.push(*item);
                } else if item.bounds.lo[axis] >= at {
                    sides.right.add(&item.bounds);
                    right.push(*item);
                } else {
                    straddling.push(*item);
                }
            }
        }
        // Decided one after the other: each sees what the ones before made of the two sides.
        let mut counts = [plane.counts[0] as f64, plane.counts[1] as f64];
        let mut areas = [plane.bounds[0], plane.bounds[1]];
        for (step, item) in straddling.into_iter().enumerate() {
            if step % 1024 == 0 {
                self.stage.check()?;
            }
            let (mut a, mut b) = (item.bounds, item.bounds);
            a.hi[axis] = at;
            b.lo[axis] = at;
            let [a, b] = [a, b].map(|region| clip.clip(item.prim, &region));
            let whole = [areas[0].union(&item.bounds), areas[1].union(&item.bounds)];
            let [area_left, area_right] = [areas[0].half_area(), areas[1].half_area()];
            let split = area_left * counts[0] + area_right * counts[1];
            let stay = [
                whole[0].half_area() * counts[0] + area_right * (counts[1] - 1.0),
                area_left * (counts[0] - 1.0) + whole[1].half_area() * counts[1],
            ];
            let has_both = !a.is_empty() && !b.is_empty() && sides.made < range.budget;
            let pays = split < stay[0] && split < stay[1];
            if has_both && pays && clip.least_half_area(item.prim).is_some() {
                sides.made += 1;
                sides.left.add(&a);
                sides.right.add(&b);
                left.push(Ref { bounds: a, ..item });
                right.push(Ref { bounds: b, ..item });
                continue;
            }
            // Whole, or what there is of it, on one side.
            let to_left = match (a.is_empty(), b.is_empty()) {
                (true, false) => false,
                (false, true) => true,
                _ => stay[0] <= stay[1],
            };
            let bounds = match (a.is_empty(), b.is_empty()) {
                (true, false) => b,
                (false, true) => a,
                _ => item.bounds,
            };
            let side = usize::from(!to_left);
            counts[1 - side] -= 1.0;
            areas[side] = areas[side].union(&bounds);
            [&mut sides.left, &mut sides.right][side].add(&bounds);
            [&mut left, &mut right][side].push(Ref { bounds, ..item });
        }
        if left.is_empty() || right.is_empty() {
            return Ok(None);
        }
        refs.truncate(begin);
        memory::try_reserve(refs, left.len() + right.len(), "pieces of primitives")?;
        let count = right.len();
        refs.extend(right);
        refs.extend(left);
        Ok(Some((sides, count)))
    }
}
