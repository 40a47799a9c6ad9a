//! Leaves: how they are written, and read again as the block that a wide layout has.

use crate::bounds::{Interval, SlabRay};
use crate::geometry::TriangleRay;
use crate::geometry::block::{BlockHits, BlockTest};
use crate::layout::packing::Block;
use crate::layout::wide::{BLOCK_WORDS, LEAF_MAX};
use crate::simd::{Floats, Four, Function, NO_BYTE, Shuffle, Simd};
use core::marker::PhantomData;

/// Bytes before the ids.
const HEADER: usize = 24;
/// Where the least id is.
const LEAST_ID: usize = 20;
/// Where the header names the corners' vertices and the form.
const CORNERS: usize = 12;
/// Bits that name a vertex.
const NAME_BITS: usize = 4;
/// Where the form is, in bits after `CORNERS`: that of vertices, then, in a byte of its own, how many
/// bytes ids have, less one.
const FORM_SHIFT: usize = 3 * LEAF_MAX * NAME_BITS;
const ID_SHIFT: usize = FORM_SHIFT + 8;
const ID_WIDTH: usize = CORNERS + ID_SHIFT / 8;
/// Vertices of a leaf, at most.
const VERTICES_MAX: usize = 3 * LEAF_MAX;

/// Leaves begin at multiples of this.
pub(super) const ALIGN: usize = 4;

/// Bytes that a leaf is read as: wherever an offset of a byte could lead.
pub(super) const READ: usize = HEADER + 4 * LEAF_MAX + u8::MAX as usize + 16;

/// What a leaf is read as.
pub(crate) type Bytes = [u8; READ];

/// How a vertex is written.
#[derive(Clone, Copy)]
struct Form {
    /// Its bytes, as the bytes of three words.
    shuffle: Shuffle,
    stride: u8,
}

/// Forms, rounded up to what five bits can name.
static FORMS: [Form; 32] = {
    let mut forms = [Form { shuffle: [NO_BYTE; 16], stride: 0 }; 32];
    let mut name = 0;
    while name < 27 {
        let widths = [name / 9 + 2, name / 3 % 3 + 2, name % 3 + 2];
        let form = &mut forms[name];
        let mut axis = 0;
        while axis < 3 {
            let mut byte = 0;
            while byte < widths[axis] {
                form.shuffle[4 * axis + byte] = form.stride;
                form.stride += 1;
                byte += 1;
            }
            axis += 1;
        }
        name += 1;
    }
    forms
};

/// [`BlockTest`] for the triangles of a leaf.
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
        ray: (&'a TriangleRay, &'a SlabRay),
        clip: &'a Interval,
        range: (f32, f32),
    ) -> BlockHits {
        let mut block = [0.0; BLOCK_WORDS];
        decode(simd, leaf, count, &mut block);
        let mut hits = <BlockTest<'_, BLOCK_WORDS> as Function>::run(
            simd,
            (&block, LEAF_MAX),
            ray,
            clip,
            range,
        );
        hits.mask &= (1 << count) - 1;
        hits
    }
}

/// The id of a triangle.
#[inline(always)]
pub(super) fn id(leaf: &Bytes, triangle: usize) -> u32 {
    let width = usize::from(leaf[ID_WIDTH] & 3) + 1;
    let at = HEADER + triangle % LEAF_MAX * width;
    let exceeds = word(leaf, at) & u32::MAX >> (32 - 8 * width);
    word(leaf, LEAST_ID).wrapping_add(exceeds)
}

#[inline(always)]
fn word(leaf: &Bytes, at: usize) -> u32 {
    u32::from_le_bytes([leaf[at], leaf[at + 1], leaf[at + 2], leaf[at + 3]])
}

/// Reads the corners of a leaf's triangles: rows four words apart. (Its ids only hits ask for.)
#[inline(always)]
pub(super) fn decode<S: Simd>(simd: S, leaf: &Bytes, count: usize, block: &mut Block) {
    let word = |at: usize| word(leaf, at);
    let four = |at: usize| {
        let [a, b, c, d] = [word(at), word(at + 4), word(at + 8), word(at + 12)];
        let float = f32::from_bits;
        S::F4::load(simd, &[float(a), float(b), float(c), float(d)])
    };
    let corners = u64::from(word(CORNERS)) | u64::from(word(CORNERS + 4)) << 32;
    let form = &FORMS[(corners >> FORM_SHIFT) as usize % FORMS.len()];
    let id_width = usize::from(leaf[ID_WIDTH] & 3) + 1;
    let vertices = HEADER + id_width * ((count - 1) % LEAF_MAX + 1);
    let least = four(0);

    // Where vertices are: names times bytes a vertex, six products at once, none above a byte.
    const EVERY_OTHER: u64 = 0x0F0F_0F0F_0F0F;
    let stride = u64::from(form.stride);
    let even = (corners & EVERY_OTHER).wrapping_mul(stride);
    let odd = (corners >> NAME_BITS & EVERY_OTHER).wrapping_mul(stride);

    // Corner by corner, the vertices of four triangles, turned into rows.
    let vertex = |at: usize| {
        let offset = if at % 2 == 0 { even } else { odd } >> (at / 2 * 8);
        let at = vertices + usize::from(offset as u8);
        let bytes = leaf.get(at..at + 16).and_then(<[u8]>::first_chunk);
        least.add_bytes(bytes.unwrap_or(&[0; 16]), &form.shuffle)
    };
    for corner in 0..3 {
        let at = LEAF_MAX * corner;
        let rows = S::F4::columns([vertex(at), vertex(at + 1), vertex(at + 2), vertex(at + 3)]);
        for axis in 0..3 {
            let row = LEAF_MAX * (3 * corner + axis);
            block[row..row + LEAF_MAX].copy_from_slice(&rows[axis].lanes());
        }
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
    /// As the header names them.
    corners: u64,
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
            corners: 0,
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
                leaf.corners |= name << (NAME_BITS * (LEAF_MAX * corner + lane));
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
            leaf.widths[axis] = bytes_of(most[axis] - leaf.least[axis]).max(2);
        }
        leaf.id_width = bytes_of(most_id - leaf.least_id).max(1);
        let [x, y, z] = leaf.widths;
        leaf.corners |= (((x - 2) * 9 + (y - 2) * 3 + (z - 2)) as u64) << FORM_SHIFT;
        leaf.corners |= (leaf.id_width as u64 - 1) << ID_SHIFT;
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
            put(&least.to_le_bytes());
        }
        put(&self.corners.to_le_bytes());
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
    use super::{Block, LEAF_MAX, Leaf, READ, decode, id};
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
            let exponents = [0, 1, 2].map(|axis: usize| (round / 4 >> axis) % 9);
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
            for row in 0..9 {
                for triangle in 0..count {
                    let expected = block[row * count + triangle].to_bits();
                    let found = read[row * LEAF_MAX + triangle].to_bits();
                    assert_eq!(found, expected, "round {round}, row {row}, triangle {triangle}");
                }
            }
            for triangle in 0..count {
                let expected = block[9 * count + triangle].to_bits();
                assert_eq!(id(bytes, triangle), expected, "round {round}, triangle {triangle}");
            }
        }
        assert_eq!(widths_seen, [false, false, true, true, true]);
        assert_eq!(id_widths_seen, [false, true, true, true, true]);
    }
}
