//! Choosing one of many lights by about what it brings to a point: a tree over the lights.
//!
//! After A. Conty Estevez, C. Kulla, "Importance Sampling of Many Lights with Adaptive Tree
//! Splitting", HPG 2018. Each node knows the power below it, the middle of that power and its mean
//! squared distance from there, which makes `power / (d^2 + r^2)` the guess of what it brings to a
//! point; a choice walks down from the root, a child with the probability of its guess. Differs from
//! it: no cones of normals, as most emitters shine on both sides, and no splitting at the point; the
//! lists are halved at the median of the longest axis, so that a path fits 32 bits.
//!
//! Every light keeps a probability above 0 at every point. 48 bytes a node, two nodes a light; a
//! choice, or the probability of one, costs `log2 n` steps.

use crate::error::RenderError;

/// A light for the tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leaf {
    /// Of the caller's list.
    pub(super) index: u32,
    pub(super) position: [f64; 3],
    /// Mean squared distance of its light from its position.
    pub(super) radius_sq: f64,
    /// What it brings at distance 1; above 0.
    pub(super) power: f64,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    center: [f64; 3],
    radius_sq: f64,
    power: f64,
    /// The second child of an inner node, the first being the next node; or the light of a leaf.
    child_or_light: u32,
    leaf: bool,
}

/// The tree.
#[derive(Clone, Debug)]
pub(super) struct LightTree {
    nodes: Vec<Node>,
    /// By light: the way to it from the root, the first turn in the lowest bit.
    paths: Vec<u32>,
}

/// The least squared spread of the light, of its squared distance from the origin: rounding must
/// not make it 0.
const RADIUS_MIN: f64 = 1e-12;

impl Node {
    /// About what the lights below bring to a point.
    #[inline]
    fn guess(&self, point: [f32; 3]) -> f64 {
        let [x, y, z]: [f64; 3] = core::array::from_fn(|k| f64::from(point[k]) - self.center[k]);
        self.power / (x * x + y * y + z * z + self.radius_sq)
    }
}

impl LightTree {
    /// A tree over some lights, of a list of `count`; `None` if there is none.
    pub(super) fn new(mut leaves: Vec<Leaf>, count: usize) -> Result<Option<Self>, RenderError> {
        if leaves.is_empty() {
            return Ok(None);
        }
        let bytes = (2 * leaves.len() * size_of::<Node>() + count * size_of::<u32>()) as u64;
        let refused = |_| RenderError::OutOfMemory { bytes, what: "the tree of lights" };
        let mut tree = Self { nodes: Vec::new(), paths: Vec::new() };
        tree.nodes.try_reserve_exact(2 * leaves.len()).map_err(refused)?;
        tree.paths.try_reserve_exact(count).map_err(refused)?;
        tree.paths.resize(count, u32::MAX);
        tree.build(&mut leaves, 0, 0);
        Ok(Some(tree))
    }

    /// Adds the node of some lights, reached by `path` of `depth` turns; its power, first moment
    /// and mean square come back in the node.
    fn build(&mut self, leaves: &mut [Leaf], path: u32, depth: u32) {
        let power: f64 = leaves.iter().map(|leaf| leaf.power).sum();
        let mut center = [0.0; 3];
        for leaf in leaves.iter() {
            (0..3).for_each(|k| center[k] += leaf.power / power * leaf.position[k]);
        }
        let mut radius_sq = 0.0;
        for leaf in leaves.iter() {
            let apart: [f64; 3] = core::array::from_fn(|k| leaf.position[k] - center[k]);
            let square = apart[0] * apart[0] + apart[1] * apart[1] + apart[2] * apart[2];
            radius_sq += leaf.power / power * (square + leaf.radius_sq);
        }
        let far = center[0] * center[0] + center[1] * center[1] + center[2] * center[2];
        let radius_sq = radius_sq.max(RADIUS_MIN * far).max(f64::MIN_POSITIVE);
        let node = self.nodes.len();
        if let [only] = leaves {
            let child_or_light = only.index;
            self.nodes.push(Node { center, radius_sq, power, child_or_light, leaf: true });
            self.paths[only.index as usize] = path;
            return;
        }
        self.nodes.push(Node { center, radius_sq, power, child_or_light: 0, leaf: false });

        // Halve along the longest axis; ties go by index, so that the tree is one.
        let axis = longest_axis(leaves);
        let half = leaves.len() / 2;
        leaves.select_nth_unstable_by(half, |a, b| {
            let places = a.position[axis].total_cmp(&b.position[axis]);
            places.then(a.index.cmp(&b.index))
        });
        let (first, second) = leaves.split_at_mut(half);
        self.build(first, path, depth + 1);
        self.nodes[node].child_or_light = self.nodes.len() as u32;
        self.build(second, path | 1 << depth, depth + 1);
    }

    /// About what all lights bring to a point.
    #[inline]
    pub(super) fn guess(&self, point: [f32; 3]) -> f64 {
        self.nodes[0].guess(point)
    }

    /// A light for a point and a number in `0 .. 1`, and its probability.
    pub(super) fn sample(&self, point: [f32; 3], mut u: f64) -> (u32, f64) {
        let (mut at, mut probability) = (0, 1.0);
        loop {
            let node = &self.nodes[at];
            if node.leaf {
                return (node.child_or_light, probability);
            }
            let first = self.first_share(at, point);
            if u < first {
                u /= first;
                probability *= first;
                at += 1;
            } else {
                // What is left of the number chooses again.
                u = ((u - first) / (1.0 - first)).min(1.0 - f64::EPSILON);
                probability *= 1.0 - first;
                at = node.child_or_light as usize;
            }
        }
    }

    /// The probability with which [`LightTree::sample`] chooses a light at a point.
    pub(super) fn probability(&self, light: u32, point: [f32; 3]) -> f64 {
        let Some(mut path) = self.paths.get(light as usize).copied() else { return 0.0 };
        let (mut at, mut probability) = (0, 1.0);
        loop {
            let node = &self.nodes[at];
            if node.leaf {
                // A light without power has no leaf; its path leads to another's.
                return if node.child_or_light == light { probability } else { 0.0 };
            }
            let first = self.first_share(at, point);
            if path & 1 == 0 {
                probability *= first;
                at += 1;
            } else {
                probability *= 1.0 - first;
                at = node.child_or_light as usize;
            }
            path >>= 1;
        }
    }

    /// The probability of an inner node's first child.
    #[inline]
    fn first_share(&self, at: usize, point: [f32; 3]) -> f64 {
        let first = self.nodes[at + 1].guess(point);
        let second = self.nodes[self.nodes[at].child_or_light as usize].guess(point);
        let share = first / (first + second);
        // Where both vanish or overflow, either will do.
        if share.is_finite() { share.clamp(SHARE_MIN, 1.0 - SHARE_MIN) } else { 0.5 }
    }
}

/// No child is left out, however dim it is.
const SHARE_MIN: f64 = 1e-3;

fn longest_axis(leaves: &[Leaf]) -> usize {
    let extent = |axis: usize| {
        let places = leaves.iter().map(|leaf| leaf.position[axis]);
        let (lo, hi) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), place| {
            (lo.min(place), hi.max(place))
        });
        hi - lo
    };
    let extents = [extent(0), extent(1), extent(2)];
    (1..3).fold(0, |best, axis| if extents[axis] > extents[best] { axis } else { best })
}

#[cfg(test)]
mod tests {
    use super::{Leaf, LightTree};
    use crate::sampler::Sampler;

    fn tree(count: u32) -> LightTree {
        let leaves = (0..count).filter(|index| index % 5 != 4).map(|index| {
            let sampler = Sampler::new(9, 0, 0, index);
            let ([x, y], [z, power]) = (sampler.pair(0), sampler.pair(1));
            let position = [x, y, z].map(|c| 10.0 * f64::from(c));
            Leaf { index, position, radius_sq: 1e-4, power: 0.01 + f64::from(power) }
        });
        LightTree::new(leaves.collect(), count as usize).unwrap().unwrap()
    }

    /// Probabilities add up to 1, are above 0 for what has power, and are those of choices.
    #[test]
    fn choices_follow_probabilities() {
        for count in [1, 2, 3, 7, 500] {
            let tree = tree(count);
            for point in [[5.0, 5.0, 5.0], [0.1, 9.0, 3.0], [1e4, 0.0, 0.0]] {
                let all: Vec<f64> =
                    (0..count).map(|light| tree.probability(light, point)).collect();
                assert!((all.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{count} at {point:?}");
                for (light, probability) in all.iter().enumerate() {
                    assert_eq!(*probability > 0.0, light % 5 != 4, "{light} of {count}");
                }
                let n = 1 << 14;
                let mut counts = vec![0u32; count as usize];
                for i in 0..n {
                    let u = (f64::from(i) + 0.5) / f64::from(n);
                    let (light, probability) = tree.sample(point, u);
                    assert!((probability - all[light as usize]).abs() < 1e-12);
                    counts[light as usize] += 1;
                }
                for (light, count) in counts.iter().enumerate() {
                    let share = f64::from(*count) / f64::from(n);
                    assert!((share - all[light]).abs() < 2e-3, "{light}: {share} {}", all[light]);
                }
            }
        }
    }

    /// What the tree is for: near lights are chosen much more often than by power alone.
    #[test]
    fn near_lights_are_likelier() {
        let leaves = (0..1000).map(|index| {
            let position = [f64::from(index), 0.0, 0.0];
            Leaf { index, position, radius_sq: 0.01, power: 1.0 }
        });
        let tree = LightTree::new(leaves.collect(), 1000).unwrap().unwrap();
        let near = tree.probability(500, [500.0, 1.0, 0.0]);
        assert!(near > 0.05, "{near} instead of 0.001");
    }
}
