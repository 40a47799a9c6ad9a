//! Leaves: how they are written, and read again as the block that a wide layout has.

use crate::bounds::{Interval, SlabRay};
use crate::geometry::TriangleRay;
use crate::geometry::block::{self, BlockHits, Corners};
use crate::layout::packing::Block;
use crate::layout::wide::LEAF_MAX;
use crate::simd::{Floats, Four, Function, NO_BYTE, Shuffle, Simd};
use core::marker::PhantomData;

/// Bytes before the ids.
const HEADER: usize = 20;
/// Where the header names the corners' vertices, and the form.
const NAMES: usize = 9;
/// Where the least id is.
const LEAST_ID: usize = 16;
/// Bits that name a vertex.
const NAME_BITS: usize = 4;
/// Where the form of vertices is, in bits after `NAMES`.
const FORM_SHIFT: usize = 3 * LEAF_MAX * NAME_BITS;
/// Where the bytes of an id are, less one.
const ID_SHIFT: usize = FORM_SHIFT + 5;
/// Vertices of a leaf, at most.
const VERTICES_MAX: usize = 3 * LEAF_MAX;
/// The last bits of what is least, which are zero.
const LEAST_ZEROS: u32 = 0xFF;

/// Leaves begin at multiples of this.
pub(super) const ALIGN: usize = 4;

/// Bytes that a leaf is read as: wherever an offset of a byte could lead.
pub(super) const READ: usize = VERTICES_END + u8::MAX as usize + 16;
/// Vertices begin before.
const VERTICES_END: usize = 64;
const _: () = assert!(HEADER + 4 * LEAF_MAX < VERTICES_END);

/// What a leaf is read as.
pub(crate) type Bytes = [u8; READ];

/// How a vertex is written: its bytes, as the bytes of three words. The words are those of the axes
/// in the order of `x, y, z`, from the one after `last` on.
const fn form(widths: [u8; 3], last: usize) -> Shuffle {
    let mut shuffle = [NO_BYTE; 16];
    let mut word = 0;
    while word < 3 {
        let axis = (last + 1 + word) % 3;
        let before = [0, widths[0], widths[0] + widths[1]][axis];
        let mut byte = 0;
        while byte < widths[axis] {
            shuffle[4 * word + byte as usize] = before + byte;
            byte += 1;
        }
        word += 1;
    }
    shuffle
}

/// Forms rounded up to what five bits can name.
const FORMS: usize = 32;

/// Bytes of the coordinates, by form.
const fn widths(form: usize) -> [u8; 3] {
    [(form / 9 % 3) as u8 + 2, (form / 3 % 3) as u8 + 2, (form % 3) as u8 + 2]
}

/// By last axis and form.
static VERTEX: [[Shuffle; FORMS]; 3] = {
    let mut shuffles = [[[NO_BYTE; 16]; FORMS]; 3];
    let mut at = 0;
    while at < 3 * FORMS {
        shuffles[at / FORMS][at % FORMS] = form(widths(at % FORMS), at / FORMS);
        at += 1;
    }
    shuffles
};

/// By form: bytes of a vertex.
static STRIDE: [u8; FORMS] = {
    let mut strides = [0; FORMS];
    let mut form = 0;
    while form < FORMS {
        let [x, y, z] = widths(form);
        strides[form] = x + y + z;
        form += 1;
    }
    strides
};

/// By last axis: the upper three bytes of what is least.
static LEAST: [Shuffle; 3] = {
    let mut shuffles = [[NO_BYTE; 16]; 3];
    let mut at = 0;
    while at < 9 {
        let (last, word) = (at / 3, at % 3);
        let axis = (last + 1 + word) % 3;
        let mut byte = 0;
        while byte < 3 {
            shuffles[last][4 * word + 1 + byte] = (3 * axis + byte) as u8;
            byte += 1;
        }
        at += 1;
    }
    shuffles
};

/// [`BlockTest`](crate::geometry::block::BlockTest) for the triangles of a leaf.
pub(super) struct Test<'a>(PhantomData<&'a ()>);

impl<'a> Function for Test<'a> {
    type A = (&'a Bytes, usize);
    type B = (&'a TriangleRay, &'a SlabRay);
    type C = &'a Interval;
    type D = (f32, f32);
    type Output = BlockHits;

    #[inline(always)]
    fn run<S: Simd>(
        simd: S,
        (leaf, count): (&'a Bytes, usize),
        (ray, slab): (&'a TriangleRay, &'a SlabRay),
        clip: &'a Interval,
        range: (f32, f32),
    ) -> BlockHits {
        let count = (count - 1) % LEAF_MAX + 1;
        block::hit(simd, Reader::new(leaf, count), count, ray, slab, clip, range)
    }
}

/// The id of a triangle.
#[inline(always)]
pub(super) fn id(leaf: &Bytes, triangle: usize) -> u32 {
    let width = id_width(names(leaf));
    let at = HEADER + triangle % LEAF_MAX * width;
    let exceeds = word(leaf, at) & u32::MAX >> (32 - 8 * width);
    word(leaf, LEAST_ID).wrapping_add(exceeds)
}

#[inline(always)]
fn word(leaf: &Bytes, at: usize) -> u32 {
    u32::from_le_bytes([leaf[at], leaf[at + 1], leaf[at + 2], leaf[at + 3]])
}

/// The names of vertices, the form and the bytes of an id; anything above.
#[inline(always)]
fn names(leaf: &Bytes) -> u64 {
    u64::from(word(leaf, NAMES)) | u64::from(word(leaf, NAMES + 4)) << 32
}

#[inline(always)]
fn id_width(names: u64) -> usize {
    (names >> ID_SHIFT) as usize % 4 + 1
}

/// Reads the corners of a leaf's triangles.
#[derive(Clone, Copy)]
pub(super) struct Reader<'a> {
    leaf: &'a Bytes,
    /// Where vertices begin.
    vertices: usize,
    form: usize,
    /// Where those of every other corner begin after that, a byte each.
    offsets: [u64; 2],
}

impl<'a> Reader<'a> {
    #[inline(always)]
    pub(super) fn new(leaf: &'a Bytes, count: usize) -> Self {
        let names = names(leaf);
        let form = (names >> FORM_SHIFT) as usize % FORMS;
        // Names times bytes a vertex: six products at once, none above a byte.
        const EVERY_OTHER: u64 = 0x0F0F_0F0F_0F0F;
        let stride = u64::from(STRIDE[form]);
        let even = (names & EVERY_OTHER).wrapping_mul(stride);
        let odd = (names >> NAME_BITS & EVERY_OTHER).wrapping_mul(stride);
        Self { leaf, vertices: HEADER + id_width(names) * count, form, offsets: [even, odd] }
    }

    /// The bytes of a corner's vertex, and some more. (A function, since closures in kernels may end
    /// up outside of them.)
    #[inline(always)]
    fn vertex(&self, corner: usize) -> &'a [u8; 16] {
        let offset = (self.offsets[corner % 2] >> (corner / 2 * 8)) as u8;
        let at = self.vertices % VERTICES_END + usize::from(offset);
        self.leaf.get(at..at + 16).and_then(<[u8]>::first_chunk).unwrap_or(&[0; 16])
    }
}

impl Corners for Reader<'_> {
    #[inline(always)]
    fn corner<S: Simd>(&self, simd: S, corner: usize, [.., last]: [u8; 3]) -> [S::F4; 3] {
        let last = usize::from(last).min(2);
        let shuffle = &VERTEX[last][self.form];
        let zero = S::F4::splat(simd, 0.0);
        let least = self.leaf.first_chunk().unwrap_or(&[0; 16]);
        let least = zero.add_bytes(least, &LEAST[last]);
        let at = LEAF_MAX * corner;
        S::F4::columns([
            least.add_bytes(self.vertex(at), shuffle),
            least.add_bytes(self.vertex(at + 1), shuffle),
            least.add_bytes(self.vertex(at + 2), shuffle),
            least.add_bytes(self.vertex(at + 3), shuffle),
        ])
    }
}

/// Writes the leaf as a block whose rows are four words apart.
#[inline(always)]
pub(super) fn decode<S: Simd>(simd: S, leaf: &Bytes, count: usize, block: &mut Block) {
    let count = (count - 1) % LEAF_MAX + 1;
    let reader = Reader::new(leaf, count);
    for corner in 0..3 {
        let rows = reader.corner(simd, corner, [0, 1, 2]);
        for axis in 0..3 {
            let row = LEAF_MAX * (3 * corner + axis);
            block[row..row + LEAF_MAX].copy_from_slice(&rows[axis].lanes());
        }
    }
    for triangle in 0..count {
        block[9 * LEAF_MAX + triangle] = f32::from_bits(id(leaf, triangle));
    }
}

/// Bytes that a number takes.
fn bytes_of(number: u32) -> usize {
    (u32::BITS - number.leading_zeros()).div_ceil(8) as usize
}

/// A leaf to be written.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leaf {
    vertices: [[u32; 3]; VERTICES_MAX],
    len: usize,
    /// As in the header.
    names: u64,
    ids: [u32; LEAF_MAX],
    count: usize,
    least: [u32; 3],
    /// Bytes of each coordinate.
    widths: [usize; 3],
    least_id: u32,
    /// Bytes of an id.
    id_width: usize,
}

impl Leaf {
    /// The `count` triangles of a block whose rows are as long.
    pub(super) fn new(block: &Block, count: usize) -> Self {
        let mut leaf = Self {
            vertices: [[0; 3]; VERTICES_MAX],
            len: 0,
            names: 0,
            ids: [0; LEAF_MAX],
            count,
            least: [u32::MAX; 3],
            widths: [0; 3],
            least_id: u32::MAX,
            id_width: 0,
        };
        let (mut most, mut most_id) = ([0; 3], 0);
        for lane in 0..LEAF_MAX {
            // The last triangle is there again where there are fewer.
            let triangle = lane.min(count - 1);
            for corner in 0..3 {
                let bits = |axis: usize| block[(3 * corner + axis) * count + triangle].to_bits();
                let vertex = [bits(0), bits(1), bits(2)];
                let name = leaf.name(vertex) as u64;
                leaf.names |= name << (NAME_BITS * (LEAF_MAX * corner + lane));
                for axis in 0..3 {
                    leaf.least[axis] = leaf.least[axis].min(vertex[axis]);
                    most[axis] = most[axis].max(vertex[axis]);
                }
            }
            let id = block[9 * count + triangle].to_bits();
            leaf.ids[lane] = id;
            leaf.least_id = leaf.least_id.min(id);
            most_id = most_id.max(id);
        }
        for axis in 0..3 {
            leaf.least[axis] &= !LEAST_ZEROS;
            leaf.widths[axis] = bytes_of(most[axis] - leaf.least[axis]).max(2);
        }
        leaf.id_width = bytes_of(most_id - leaf.least_id).max(1);
        let [x, y, z] = leaf.widths;
        leaf.names |= (((x - 2) * 9 + (y - 2) * 3 + (z - 2)) as u64) << FORM_SHIFT;
        leaf.names |= (leaf.id_width as u64 - 1) << ID_SHIFT;
        leaf
    }

    /// The number of a vertex: a new one if it is not there yet.
    fn name(&mut self, vertex: [u32; 3]) -> usize {
        let known = self.vertices[..self.len].iter().position(|known| *known == vertex);
        known.unwrap_or_else(|| {
            self.vertices[self.len] = vertex;
            self.len += 1;
            self.len - 1
        })
    }

    /// Bytes that [`Leaf::write`] takes.
    pub(super) fn size(&self) -> usize {
        let stride: usize = self.widths.iter().sum();
        (HEADER + self.id_width * self.count + self.len * stride).next_multiple_of(ALIGN)
    }

    /// Writes it.
    pub(super) fn write(&self, out: &mut [u8]) {
        let mut at = 0;
        let mut put = |bytes: &[u8]| {
            out[at..at + bytes.len()].copy_from_slice(bytes);
            at += bytes.len();
        };
        for least in self.least {
            put(&least.to_le_bytes()[1..]);
        }
        put(&self.names.to_le_bytes()[..LEAST_ID - NAMES]);
        put(&self.least_id.to_le_bytes());
        for id in &self.ids[..self.count] {
            put(&(id - self.least_id).to_le_bytes()[..self.id_width]);
        }
        for vertex in &self.vertices[..self.len] {
            for axis in 0..3 {
                let exceeds = vertex[axis] - self.least[axis];
                put(&exceeds.to_le_bytes()[..self.widths[axis]]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Block, LEAF_MAX, Leaf, READ, decode};
    use crate::layout::compact::Random;
    use crate::layout::wide::BLOCK_WORDS;
    use crate::simd::Scalar;
    use alloc::vec::Vec;

    /// Triangles of every spread, shared and unshared, of either sign: written and read again.
    #[test]
    fn corners_come_back_bit_for_bit() {
        let mut random = Random(0xC0);
        let mut widths_seen = [false; 5];
        let mut id_widths_seen = [false; 5];
        for round in 0..4000 {
            let count = round % LEAF_MAX + 1;
            let exponents = [0, 1, 2].map(|axis: usize| ((round / 4) >> axis) % 9);
            let mut pool: Vec<[f32; 3]> = Vec::new();
            for _ in 0..[3, 6, 12][round % 3] {
                let unit = [random.unit(), random.unit(), random.unit()];
                let near = [0, 1, 2].map(|axis: usize| match exponents[axis] {
                    8 => f32::from_bits((unit[axis] * 4e9) as u32 & !(1 << 30)),
                    exponent => 1.0 + unit[axis] / (1_u32 << (3 * exponent)) as f32,
                });
                pool.push(near);
            }
            let mut block: Block = [0.0; BLOCK_WORDS];
            for triangle in 0..count {
                for corner in 0..3 {
                    let vertex = pool[(random.unit() * pool.len() as f32) as usize % pool.len()];
                    for axis in 0..3 {
                        block[(3 * corner + axis) * count + triangle] = vertex[axis];
                    }
                }
                let id = (triangle as u32) << (round / 4 % 4 * 10) | round as u32;
                block[9 * count + triangle] = f32::from_bits(id);
            }
            let leaf = Leaf::new(&block, count);
            leaf.widths.iter().for_each(|&width| widths_seen[width] = true);
            id_widths_seen[leaf.id_width] = true;
            let mut bytes = alloc::vec![0; 8 + leaf.size() + READ];
            leaf.write(&mut bytes[8..8 + leaf.size()]);
            let mut read: Block = [0.0; BLOCK_WORDS];
            let bytes = bytes[8..].first_chunk().unwrap();
            decode(Scalar, bytes, count, &mut read);
            for row in 0..10 {
                for triangle in 0..count {
                    let expected = block[row * count + triangle].to_bits();
                    let found = read[row * LEAF_MAX + triangle].to_bits();
                    assert_eq!(found, expected, "round {round}, row {row}, triangle {triangle}");
                }
            }
        }
        assert_eq!(widths_seen, [false, false, true, true, true]);
        assert_eq!(id_widths_seen, [false, true, true, true, true]);
    }
}
