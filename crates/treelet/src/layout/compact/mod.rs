//! The compact layout: for scenes that outgrow the cache, at half the bytes of the wide ones.
//!
//! # Nodes
//!
//! Planes are 16-bit numbers on a grid of the node's own, whose steps are a power of two an axis.
//!
//! | bytes    | field      | meaning                                                |
//! |----------|------------|--------------------------------------------------------|
//! | 0..192   | `planes`   | by axis: `lo` of every child, then `hi` of every child |
//! | 192..204 | `start`    | by axis: `2^23` steps                                  |
//! | 204..216 | `shift`    | by axis: `start` less where the grid begins            |
//! | 216..220 | `slots`    | bit `i`: slot `i` holds a child                        |
//! | 220..284 | `children` | one [`Child`] word each                                |
//! | 284..288 |            | unused                                                 |
//!
//! A plane is `(start | number) - shift`, the bits of `start` or'ed with the number: its last bit is
//! worth one step. The grid begins at a multiple of the step, and all its planes are less than `2^24`
//! steps from zero, so this is exact: the planes are f32 values that contain the child's box,
//! and all that is said about boxes (`bounds::slab`, the culling lemma) holds for them. Empty slots
//! need a bit of their own: on a grid no box is so empty that a ray's slack cannot fill it.
//!
//! # Leaves
//!
//! | bytes  | field    | meaning                                                                      |
//! |--------|----------|------------------------------------------------------------------------------|
//! | 0..9   | least    | by axis: the least of the vertices' bits, as unsigned numbers, without the   |
//! |        |          | last 8 bits, which are taken as zero                                         |
//! | 9..15  | names    | 4 bits each: which vertex; of four triangles, the first corners, the second, |
//! |        |          | the third. The last triangle is there again where there are fewer            |
//! | 15     | form     | `9 (x - 2) + 3 (y - 2) + (z - 2) + 32 (i - 1)` for `x`, `y` and `z` bytes a  |
//! |        |          | coordinate and `i` bytes an id                                               |
//! | 16..20 | least id |                                                                              |
//! | 20..   | ids      | what each exceeds the least by                                               |
//! | ..     | vertices | each once: by axis, what its bits exceed the least by                        |
//!
//! A leaf begins at a multiple of four bytes: that multiple is what its [`Child`] word says. What
//! vertices exceed the least by needs few bytes, since leaves are small: bits of f32 of one sign are
//! in the order of the numbers, and neighbours differ in the last ones. Where signs differ, it takes
//! all four bytes. Nothing is rounded: the corners are the caller's f32, bit for bit.
//!
//! # What it costs
//!
//! Measured, AVX-512, one thread, bytes a triangle and the speed of single rays against 16 wide children:
//! kitchen (1.4 M triangles) 25.7, primary 0.81, occlusion 0.93, diffuse 0.87, random 0.90; hair (1.2 M)
//! 37.8, 0.78 to 0.82; a height field (4 M) 24.2, 0.78, 0.86, 0.83, 0.97; a turbine (0.2 M, in the
//! cache) 28.2, 0.72 to 0.86. 12 M separate triangles take 40.6: 36 of them are vertices and 4 ids
//! before there is a node. Rays there visit many leaves in vain: 0.60 to 0.70.
//!
//! That is three instructions a vector of planes more than the wide layouts, and about 90 a leaf.
//! Leaves hold at most 2 GiB a tree. Lowering goes through the wide layout (`pack.rs`).
//!
//! # What was tried
//!
//! - Planes of 8 bits (nodes of 192 bytes, 3 bytes a triangle less): a wall is thinner than a step of
//!   the node that it is in, and a ray that starts on it starts inside the box of that leaf. Kitchen,
//!   occlusion: 0.85 leaves a ray instead of 0.28, and 0.61 of the wide layout's speed instead of 0.89.
//!   With 16 bits, visits are those of the wide layout to three digits.
//! - Nodes of 8 children: as many bytes (27.1 a triangle instead of 26.8), 3 to 14 % slower with
//!   AVX-512, and with AVX2 and SSE4.2 from 5 % faster (primary rays) to 11 % slower (random ones).
//! - Leaves read into a block in memory, which was then tested: camera rays 0.76 of the wide layout's
//!   speed instead of 0.81 (kitchen); stores are waited for. Closures there, not functions: 0.54.
//! - Names times bytes a vertex, one after the other: 12 multiplications instead of two, 1 to 4 % slower.
//! - Asking for all lines of a leaf before its header is read: 0.61 of the wide layout's speed instead of
//!   0.60 where rays miss the cache most (2 million separate triangles): not memory, but reading.
//! - Not built, but counted on the trees of eleven scenes, leaves alone, bytes a triangle (kitchen,
//!   hair, 12 million separate triangles): about as here 18.3, 24.3, 34.2; vertices as plain f32 24.9,
//!   26.9, 42.1; one table of vertices for all leaves of a node 13.6, 15.4, 34.1, where a leaf needs its node
//!   and lies in more cache lines.
//!
//! Sources: H. Ylitie, T. Karras, S. Laine, "Efficient Incoherent Ray Traversal on GPUs Through
//! Compressed Wide BVHs", HPG 2017 (8-bit planes, power-of-two steps; differs: exact in f32, decoded
//! without conversion or multiplication, children in words); C. Benthin, I. Wald, S. Woop, A. Afra,
//! "Compressed-Leaf Bounding Volume Hierarchies", HPG 2018 (vertices shared inside a leaf; differs:
//! lossless offsets of bits, chosen leaf by leaf).

pub(crate) mod grid;
pub(crate) mod leaf;
pub(crate) mod pack;

use super::packing::{Block, Packing};
use super::wide::{Child, LEAF_MAX};
use crate::bounds::{Aabb, Interval, SlabRay};
use crate::build::Info;
use crate::geometry::TriangleRay;
use crate::geometry::block::BlockHits;
use crate::memory::prefetch;
use crate::memory::zeroed;
use crate::simd::{Floats, Simd, Wide};

/// The catalogue's entry.
pub const INFO: Info = Info {
    name: "compact",
    summary: "up to 16 children a node, 288 bytes; 17 to 23 bytes a triangle of a mesh",
    source: "Ylitie, Karras, Laine 2017; Benthin, Wald, Woop, Afra 2018",
};

/// Children of a node, at most.
pub const WIDTH: usize = 16;

/// Up to 16 children.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct Node {
    /// By axis: the lower planes, then the upper ones.
    pub planes: [[[u16; WIDTH]; 2]; 3],
    /// `2^23` steps of each axis.
    pub start: [f32; 3],
    /// `start` less where the grid begins.
    pub shift: [f32; 3],
    /// Bit `i`: slot `i` holds a child.
    pub slots: u32,
    /// What is behind each box.
    pub children: [Child; WIDTH],
}

const _: () = assert!(size_of::<Node>() == 288);

zeroed! { Node []: [[[u16; WIDTH]; 2]; 3], [f32; 3], u32, [Child; WIDTH] }

/// Nodes and leaves as above.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Compact;

impl Packing<WIDTH> for Compact {
    type Node = Node;
    type Unit = u8;
    type Leaf = leaf::Bytes;

    #[inline(always)]
    fn children(node: &Node) -> &[Child; WIDTH] {
        &node.children
    }

    #[inline(always)]
    fn slots(node: &Node) -> u32 {
        node.slots
    }

    #[inline(always)]
    fn planes<S: Wide<WIDTH>>(simd: S, node: &Node, axis: usize, side: usize) -> S::F {
        let start = S::F::splat(simd, node.start[axis]);
        start.or_halves(&node.planes[axis][side & 1]).sub(S::F::splat(simd, node.shift[axis]))
    }

    #[inline(always)]
    fn bounds(node: &Node, slot: usize) -> Aabb {
        let slot = slot % WIDTH;
        let plane = |axis: usize, side: usize| {
            let number = u32::from(node.planes[axis][side][slot]);
            f32::from_bits(node.start[axis].to_bits() | number) - node.shift[axis]
        };
        Aabb {
            lo: [plane(0, 0), plane(1, 0), plane(2, 0)],
            hi: [plane(0, 1), plane(1, 1), plane(2, 1)],
        }
    }

    #[inline(always)]
    fn leaf(bytes: &[u8], first: usize) -> &leaf::Bytes {
        const EMPTY: &leaf::Bytes = &[0; leaf::READ];
        bytes.get(leaf::ALIGN * first..).and_then(<[u8]>::first_chunk).unwrap_or(EMPTY)
    }

    #[inline(always)]
    fn expect_ids(bytes: &[u8], first: usize, _: usize) {
        prefetch(bytes, leaf::ALIGN * first);
    }

    #[inline(always)]
    fn hits<S: Simd>(
        simd: S,
        leaf: &leaf::Bytes,
        count: usize,
        ray: (&TriangleRay, &SlabRay),
        clip: &Interval,
        range: (f32, f32),
    ) -> BlockHits {
        simd.apply::<leaf::Test<'_>>((leaf, count), ray, clip, range)
    }

    #[inline(always)]
    fn id(leaf: &leaf::Bytes, _: usize, triangle: usize) -> u32 {
        leaf::id(leaf, triangle)
    }

    #[inline(always)]
    fn block<'b, S: Simd>(
        simd: S,
        leaf: &'b leaf::Bytes,
        count: usize,
        room: &'b mut Block,
    ) -> (&'b Block, usize) {
        leaf::decode(simd, leaf, count, room);
        (room, LEAF_MAX)
    }
}

/// Numbers without a pattern (`verify`, which has better ones, stands below this folder).
#[cfg(test)]
pub(super) struct Random(pub(super) u64);

#[cfg(test)]
impl Random {
    fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(0x1405_7B7E_F767_814F);
        (self.0 >> 32) as u32
    }

    /// In `0.0 .. 1.0`.
    pub(super) fn unit(&mut self) -> f32 {
        (self.bits() >> 8) as f32 / (1 << 24) as f32
    }

    pub(super) fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }
}
