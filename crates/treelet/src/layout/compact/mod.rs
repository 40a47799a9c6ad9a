//! The compact layouts: for scenes that outgrow the cache, at half the bytes of the wide ones.
//!
//! # Nodes
//!
//! Planes are 16-bit numbers on a grid of the node's own, whose steps are a power of two an axis.
//!
//! | bytes (8 wide) | (16 wide) | field      | meaning                                                |
//! |----------------|-----------|------------|--------------------------------------------------------|
//! | 0..96          | 0..192    | `planes`   | by axis: `lo` of every child, then `hi` of every child |
//! | 96..108        | 192..204  | `start`    | by axis: `2^23` steps                                  |
//! | 108..120       | 204..216  | `shift`    | by axis: `start` less where the grid begins            |
//! | 120..124       | 216..220  | `slots`    | bit `i`: slot `i` holds a child                        |
//! | 124..156       | 220..284  | `children` | one [`Child`] word each                                |
//! | 156..160       | 284..288  |            | unused                                                 |
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
//! | 0..12  | least    | by axis: the least of the vertices' bits, as unsigned numbers                |
//! | 12..18 | corners  | 4 bits each: which vertex; of four triangles, the first corners, the second, |
//! |        |          | the third. The last triangle is there again where there are fewer            |
//! | 18..20 | form     | `9 (x - 2) + 3 (y - 2) + (z - 2) + 32 (i - 1)` for `x`, `y` and `z` bytes a  |
//! |        |          | coordinate and `i` bytes an id                                               |
//! | 20..24 | least id |                                                                              |
//! | 24..   | ids      | what each exceeds the least by                                               |
//! | ..     | vertices | each once: by axis, what its bits exceed the least by                        |
//!
//! A leaf begins at a multiple of four bytes: that multiple is what its [`Child`] word says. What
//! vertices exceed the least by needs few bytes, since leaves are small: bits of f32 of one sign
//! are in the order of the numbers, and neighbours differ in the last ones. Where signs differ, it takes all four
//! bytes. Nothing is rounded: the corners are the caller's f32, bit for bit.
//!
//! # What it costs
//!
//! Three instructions a vector of planes more than the wide layouts, about 85 a leaf. Leaves hold at
//! most 2 GiB. Lowering goes through the wide layout ([`pack`]).
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
use super::wide::Child;
use crate::bounds::Aabb;
use crate::build::Info;
use crate::memory::zeroed;
use crate::simd::{Floats, Simd, Wide};

/// The catalogue's entry for 8 children.
pub const INFO_8: Info = Info {
    name: "compact8",
    summary: "up to 8 children a node, 160 bytes; about 20 bytes a triangle",
    source: "Ylitie, Karras, Laine 2017; Benthin, Wald, Woop, Afra 2018",
};

/// The catalogue's entry for 16 children.
pub const INFO_16: Info = Info {
    name: "compact16",
    summary: "up to 16 children a node, 288 bytes; about 20 bytes a triangle",
    source: "Ylitie, Karras, Laine 2017; Benthin, Wald, Woop, Afra 2018",
};

/// Up to `W` children.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub struct Node<const W: usize> {
    /// By axis: the lower planes, then the upper ones.
    pub planes: [[[u16; W]; 2]; 3],
    /// `2^23` steps of each axis.
    pub start: [f32; 3],
    /// `start` less where the grid begins.
    pub shift: [f32; 3],
    /// Bit `i`: slot `i` holds a child.
    pub slots: u32,
    /// What is behind each box.
    pub children: [Child; W],
}

const _: () = assert!(size_of::<Node<8>>() == 160 && size_of::<Node<16>>() == 288);

zeroed! { Node<W> [const W: usize]: [[[u16; W]; 2]; 3], [f32; 3], u32, [Child; W] }

/// Nodes and leaves as above.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Compact;

impl<const W: usize> Packing<W> for Compact {
    type Node = Node<W>;
    type Unit = u8;

    #[inline(always)]
    fn children(node: &Node<W>) -> &[Child; W] {
        &node.children
    }

    #[inline(always)]
    fn slots(node: &Node<W>) -> u32 {
        node.slots
    }

    #[inline(always)]
    fn planes<S: Wide<W>>(simd: S, node: &Node<W>, axis: usize, side: usize) -> S::F {
        let start = S::F::splat(simd, node.start[axis]);
        start.or_halves(&node.planes[axis][side & 1]).sub(S::F::splat(simd, node.shift[axis]))
    }

    #[inline(always)]
    fn bounds(node: &Node<W>, slot: usize) -> Aabb {
        let slot = slot % W;
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
    fn block<'b, S: Simd>(
        simd: S,
        bytes: &'b [u8],
        first: usize,
        count: usize,
        room: &'b mut Block,
    ) -> (&'b Block, usize) {
        leaf::decode(simd, bytes, first, count, room);
        (room, super::wide::LEAF_MAX)
    }
}
