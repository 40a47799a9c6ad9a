//! Modes 1 and 2: triangles by edges and vertices used before, and any other indices.

use super::{ended, take};

/// The header bytes.
const TRIANGLES: u8 = 0xe1;
const SEQUENCE: u8 = 0xd1;

/// Common second codes of triangles, at the end of a stream.
const TABLE: usize = 16;
/// Padding at the end of a stream of indices.
const SEQUENCE_TAIL: usize = 4;

/// The last 16 of something, the newest at distance 0.
struct Fifo<T> {
    items: [T; 16],
    next: usize,
}

impl<T: Copy> Fifo<T> {
    fn new(item: T) -> Self {
        Self { items: [item; 16], next: 0 }
    }

    fn push(&mut self, item: T) {
        self.items[self.next & 15] = item;
        self.next = self.next.wrapping_add(1);
    }

    fn back(&self, distance: u8) -> T {
        self.items[self.next.wrapping_sub(1 + usize::from(distance)) & 15]
    }
}

/// What the codes of a triangle stream refer to.
struct State<'a> {
    data: &'a [u8],
    edges: Fifo<[u32; 2]>,
    vertices: Fifo<u32>,
    /// The vertex that no triangle had yet.
    next: u32,
    /// The vertex that was last given in full.
    last: u32,
}

impl State<'_> {
    /// A vertex that is new.
    fn fresh(&mut self) -> u32 {
        let vertex = self.next;
        self.next = self.next.wrapping_add(1);
        vertex
    }

    /// A vertex given as a difference.
    fn given(&mut self) -> Result<u32, String> {
        self.last = self.last.wrapping_add(zigzag(varint(&mut self.data)?));
        Ok(self.last)
    }

    /// A corner by its code: 0 is a new vertex, 15 a given one, all others were used before, so far
    /// back. New and given ones are to be remembered.
    fn corner(&mut self, code: u8) -> Result<(u32, bool), String> {
        match code {
            0 => Ok((self.fresh(), true)),
            // Filled in once all corners are known.
            15 => Ok((0, true)),
            _ => Ok((self.vertices.back(code - 1), false)),
        }
    }

    /// A triangle of one code byte: on an edge used before, or on none.
    fn triangle(&mut self, code: u8, table: &[u8]) -> Result<[u32; 3], String> {
        if code < 0xf0 {
            return self.on_edge(code);
        }
        let (first, second) = match code {
            0xfe => (0, take(&mut self.data, 1)?[0]),
            0xff => (15, take(&mut self.data, 1)?[0]),
            _ => (0, table[usize::from(code & 15)]),
        };
        // A second code of 0 that is not from the table starts the vertices anew.
        if code >= 0xfe && second == 0 {
            self.next = 0;
        }
        let codes = [first, second >> 4, second & 15];
        let mut corners = [(0, false); 3];
        for (corner, code) in corners.iter_mut().zip(codes) {
            *corner = self.corner(code)?;
        }
        for (corner, code) in corners.iter_mut().zip(codes) {
            if code == 15 {
                corner.0 = self.given()?;
            }
        }
        for (vertex, is_kept) in corners {
            if is_kept {
                self.vertices.push(vertex);
            }
        }
        let [a, b, c] = corners.map(|corner| corner.0);
        self.edges.push([b, a]);
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        Ok([a, b, c])
    }

    /// A triangle on an edge used before; the low half of the code says the third corner.
    fn on_edge(&mut self, code: u8) -> Result<[u32; 3], String> {
        let [a, b] = self.edges.back(code >> 4);
        let (c, is_kept) = match code & 15 {
            0 => (self.fresh(), true),
            13 => (self.near(u32::MAX), true),
            14 => (self.near(1), true),
            15 => (self.given()?, true),
            back => (self.vertices.back(back), false),
        };
        if is_kept {
            self.vertices.push(c);
        }
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        Ok([a, b, c])
    }

    /// The vertex beside the one that was last given.
    fn near(&mut self, by: u32) -> u32 {
        self.last = self.last.wrapping_add(by);
        self.last
    }
}

/// Unpacks triangles into indices of `stride` bytes, 2 or 4, until `out` is full.
pub(super) fn decode_triangles(
    mut bytes: &[u8],
    stride: usize,
    out: &mut [u8],
) -> Result<(), String> {
    let count = out.len() / stride;
    if !count.is_multiple_of(3) {
        return Err(format!("has {count} indices, which are no triangles"));
    }
    check_header(take(&mut bytes, 1)?[0], TRIANGLES)?;
    let codes = take(&mut bytes, count / 3)?;
    let split = bytes.len().checked_sub(TABLE).ok_or_else(ended)?;
    let (data, table) = bytes.split_at(split);
    let edges = Fifo::new([u32::MAX; 2]);
    let mut state = State { data, edges, vertices: Fifo::new(u32::MAX), next: 0, last: 0 };
    for (&code, triangle) in codes.iter().zip(out.chunks_exact_mut(3 * stride)) {
        let corners = state.triangle(code, table)?;
        for (corner, place) in corners.iter().zip(triangle.chunks_exact_mut(stride)) {
            place.copy_from_slice(&corner.to_le_bytes()[..stride]);
        }
    }
    check_end(state.data)
}

/// Unpacks indices in any order, likewise. Two sequences are interleaved, each as differences.
pub(super) fn decode_sequence(
    mut bytes: &[u8],
    stride: usize,
    out: &mut [u8],
) -> Result<(), String> {
    check_header(take(&mut bytes, 1)?[0], SEQUENCE)?;
    let len = bytes.len().checked_sub(SEQUENCE_TAIL).ok_or_else(ended)?;
    let mut data = &bytes[..len];
    let mut last = [0_u32; 2];
    for place in out.chunks_exact_mut(stride) {
        let value = varint(&mut data)?;
        let last = &mut last[(value & 1) as usize];
        *last = last.wrapping_add(zigzag(value >> 1));
        place.copy_from_slice(&last.to_le_bytes()[..stride]);
    }
    check_end(data)
}

fn check_header(found: u8, wanted: u8) -> Result<(), String> {
    if found == wanted {
        return Ok(());
    }
    Err(format!("starts with {found:#04x} where {wanted:#04x} should stand"))
}

fn check_end(rest: &[u8]) -> Result<(), String> {
    if rest.is_empty() { Ok(()) } else { Err(format!("has {} bytes too many", rest.len())) }
}

/// A number in groups of seven bits, the lowest first; at most five of them.
fn varint(data: &mut &[u8]) -> Result<u32, String> {
    let mut value = 0;
    for group in 0..5 {
        let byte = take(data, 1)?[0];
        value |= u32::from(byte & 127) << (7 * group);
        if byte < 128 {
            return Ok(value);
        }
    }
    Ok(value)
}

/// A difference whose lowest bit is its sign.
fn zigzag(value: u32) -> u32 {
    value >> 1 ^ (value & 1).wrapping_neg()
}
