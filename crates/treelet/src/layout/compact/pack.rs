//! From a wide layout to the compact one: node by node, leaf by leaf, in the same order.
//!
//! Leaves differ in size, so what they take is added up first; then every chunk of nodes is written
//! where it stays. What is written depends on the tree alone, not on the number of threads.
//!
//! Cost: O(n) time; both layouts are there while it runs.

use super::grid::Grid;
use super::leaf::{ALIGN, Leaf, READ};
use super::{Compact, Node, WIDTH};
use crate::build::BuildError;
use crate::context::{Cancel, Cancelled, parallel};
use crate::layout::packing::Packing;
use crate::layout::wide::{self, Child, ChildKind, ENTRIES_MAX, Plain, Wide};
use crate::memory::Pages;
use alloc::vec::Vec;

/// Nodes that are written by one task.
const CHUNK: usize = 1024;

/// Packs a wide tree.
pub(crate) fn pack(
    wide: &Wide<WIDTH>,
    cancel: &Cancel,
) -> Result<Wide<WIDTH, Compact>, BuildError> {
    // Add up what leaves take; the root may be one itself.
    let of_root = wide.leaf(wide.root).map_or(0, |leaf| leaf.size());
    let sizes = parallel::map_chunks(&wide.nodes, CHUNK, |_, nodes| {
        cancel.check()?;
        let leaves = nodes.iter().flat_map(|node| node.children);
        Ok(leaves.filter_map(|child| wide.leaf(child)).map(|leaf| leaf.size()).sum::<usize>())
    });
    let sizes = sizes.into_iter().collect::<Result<Vec<_>, Cancelled>>()?;
    let total = of_root + sizes.iter().sum::<usize>();
    let instances = wide.instances();
    if total / ALIGN + instances > ENTRIES_MAX {
        return Err(BuildError::TooManyBytes { bytes: total as u64 });
    }
    let mut bytes = Pages::zeroed(total + READ, "compact leaves")?;
    let mut nodes = Pages::zeroed(wide.nodes.len(), "compact nodes")?;

    // Give every chunk its place, then write.
    let mut root = Writer { wide, triangles: total / ALIGN, at: 0, bytes: &mut bytes };
    let root_child = root.child(wide.root);
    let (mut at, mut rest) = (root.at, root.bytes);
    let mut jobs = Vec::with_capacity(sizes.len());
    let chunks = wide.nodes.chunks(CHUNK).zip(nodes.chunks_mut(CHUNK));
    for ((from, to), size) in chunks.zip(sizes) {
        let (bytes, after) = rest.split_at_mut(size);
        jobs.push((from, to, Writer { wide, triangles: total / ALIGN, at, bytes }));
        (at, rest) = (at + size / ALIGN, after);
    }
    let written = parallel::map(jobs, |(from, to, mut writer): (&[_], &mut [_], Writer<'_>)| {
        cancel.check()?;
        for (from, to) in from.iter().zip(to) {
            *to = writer.node(from);
        }
        Ok(())
    });
    written.into_iter().collect::<Result<(), Cancelled>>()?;
    Ok(Wide { nodes, root: root_child, words: bytes, triangles: total / ALIGN })
}

impl Wide<WIDTH> {
    /// The triangles behind a child, if that is a leaf of some.
    fn leaf(&self, child: Child) -> Option<Leaf> {
        let ChildKind::Leaf { first, count } = child.kind() else { return None };
        let is_triangles = child != Child::END && first < self.triangles;
        is_triangles.then(|| Leaf::new(<Plain as Packing<WIDTH>>::leaf(&self.words, first), count))
    }

    /// One more than the greatest number of an instance.
    fn instances(&self) -> usize {
        let children = self.nodes.iter().flat_map(|node| node.children).chain([self.root]);
        let end = |child: Child| match child.kind() {
            ChildKind::Leaf { first, count } if child != Child::END => {
                (first + count).saturating_sub(self.triangles)
            }
            _ => 0,
        };
        children.map(end).max().unwrap_or(0)
    }
}

/// Writes nodes and their leaves, one after the other.
struct Writer<'a> {
    wide: &'a Wide<WIDTH>,
    /// Where entries begin that are instances.
    triangles: usize,
    /// Where the next leaf begins, in units.
    at: usize,
    /// From there on.
    bytes: &'a mut [u8],
}

impl Writer<'_> {
    /// The word for the same child, whose leaf is written.
    fn child(&mut self, child: Child) -> Child {
        let ChildKind::Leaf { first, count } = child.kind() else { return child };
        if child == Child::END {
            return child;
        }
        let Some(leaf) = self.wide.leaf(child) else {
            return Child::leaf(first - self.wide.triangles + self.triangles, count);
        };
        let (out, rest) = core::mem::take(&mut self.bytes).split_at_mut(leaf.size());
        leaf.write(out);
        let first = self.at;
        self.bytes = rest;
        self.at += leaf.size() / ALIGN;
        Child::leaf(first, count)
    }

    fn node(&mut self, from: &wide::Node<WIDTH>) -> Node {
        let mut to = Node {
            planes: [[[0; WIDTH]; 2]; 3],
            start: [0.0; 3],
            shift: [0.0; 3],
            slots: 0,
            children: [Child::END; WIDTH],
        };
        for slot in 0..WIDTH {
            to.children[slot] = self.child(from.children[slot]);
            to.slots |= u32::from(from.children[slot] != Child::END) << slot;
        }
        let slots = to.slots;
        let used = |slot: &usize| slots >> slot & 1 == 1;
        for axis in 0..3 {
            let [lo, hi] = from.planes[axis];
            let least = (0..WIDTH).filter(used).map(|slot| lo[slot]).fold(f32::INFINITY, f32::min);
            let most =
                (0..WIDTH).filter(used).map(|slot| hi[slot]).fold(f32::NEG_INFINITY, f32::max);
            let grid = Grid::new(least, most);
            [to.start[axis], to.shift[axis]] = grid.words();
            for slot in (0..WIDTH).filter(used) {
                let [lo, hi] = grid.around(lo[slot], hi[slot]);
                (to.planes[axis][0][slot], to.planes[axis][1][slot]) = (lo, hi);
            }
        }
        to
    }
}

#[cfg(test)]
mod tests {
    use super::{Compact, WIDTH, pack};
    use crate::bounds::Aabb;
    use crate::build::{BinnedSah, Builder};
    use crate::context::{Cancel, Context};
    use crate::geometry::mesh::COORDINATE_MAX;
    use crate::layout::Collapse;
    use crate::layout::compact::Random;
    use crate::layout::lower::{Numbered, Packed, lower, split_leaves};
    use crate::layout::packing::{Block, Packing};
    use crate::layout::wide::{BLOCK_WORDS, Child, ChildKind, Plain};
    use crate::simd::Scalar;
    use alloc::vec::Vec;

    /// Triangles and instances of a scale: how far apart, how large.
    fn triangles(count: usize, random: &mut Random, far: f32, size: f32) -> Vec<[[f32; 3]; 3]> {
        (0..count)
            .map(|_| {
                let at = [(); 3].map(|()| random.between(-far, far));
                [(); 3].map(|()| [0, 1, 2].map(|k: usize| at[k] + random.between(-size, size)))
            })
            .collect()
    }

    #[test]
    fn boxes_contain_and_leaves_are_the_same() {
        let mut random = Random(0xC0);
        let largest = 0.9 * COORDINATE_MAX;
        for (far, size) in [(1.0, 0.01), (0.0, 1.0), (1e-40, 1e-40), (1e6, 0.5), (largest, 1e3)] {
            for (count, instances) in
                [(0, 0), (1, 0), (3, 0), (0, 1), (0, 40), (700, 90), (5000, 0)]
            {
                let corners = triangles(count + instances, &mut random, far, size);
                let bounds: Vec<_> =
                    corners.iter().map(|corners| Aabb::of_points(corners)).collect();
                let tree = BinnedSah::DEFAULT.build(&bounds, &Context::default()).unwrap();
                let source = |prims: &[u32], packed: &mut [Packed]| {
                    for (&id, packed) in prims.iter().zip(packed) {
                        *packed = Packed { corners: corners[id as usize], id };
                    }
                };
                let tree = split_leaves(tree, &bounds, count).unwrap();
                let cancel = Cancel::default();
                let numbers: Vec<u32> = (0..instances as u32).map(|at| 3 * at).collect();
                let placed = Numbered { first: count as u32, numbers: &numbers };
                let wide = lower::<WIDTH>(&tree, placed, &source, Collapse::Optimal, &cancel);
                let wide = wide.unwrap();
                let compact = pack(&wide, &cancel).unwrap();
                let leaves = |child: Child, packed: Child| match (child.kind(), packed.kind()) {
                    _ if child == Child::END => assert_eq!(packed, Child::END),
                    (
                        ChildKind::Leaf { first, count },
                        ChildKind::Leaf { first: at, count: same },
                    ) => {
                        assert_eq!(same, count);
                        if first >= wide.triangles {
                            assert_eq!(at - compact.triangles, first - wide.triangles);
                            return;
                        }
                        assert!(at < compact.triangles);
                        let from = <Plain as Packing<WIDTH>>::leaf(&wide.words, first);
                        let leaf = Compact::leaf(&compact.words, at);
                        let mut room: Block = [0.0; BLOCK_WORDS];
                        let (block, stride) = Compact::block(Scalar, leaf, count, &mut room);
                        for row in 0..10 {
                            for lane in 0..count {
                                let expected = from[row * count + lane].to_bits();
                                assert_eq!(block[row * stride + lane].to_bits(), expected);
                            }
                        }
                    }
                    _ => assert_eq!(packed, child),
                };
                leaves(wide.root, compact.root);
                for (from, to) in wide.nodes.iter().zip(&*compact.nodes) {
                    for slot in 0..WIDTH {
                        leaves(from.children[slot], to.children[slot]);
                        let used = from.children[slot] != Child::END;
                        assert_eq!(Compact::slots(to) >> slot & 1 == 1, used);
                        let exact = <Plain as Packing<WIDTH>>::bounds(from, slot);
                        assert!(!used || Compact::bounds(to, slot).contains(&exact));
                    }
                }
            }
        }
    }
}
