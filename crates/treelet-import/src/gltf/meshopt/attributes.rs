//! Mode 0: elements of a fixed size, byte by byte as differences from the element before.
//!
//! Elements come in blocks of at most 256. In a block all first bytes come first, then all second
//! bytes and so on; each such run is cut into groups of 16, and each group says how many bits a byte
//! takes. Version 1 knows more widths, and differences of two and four bytes.

use super::{ended, take};

/// Elements of a block at most.
const BLOCK_MAX: usize = 256;
/// Bytes of a block at most.
const BLOCK_BYTES: usize = 8192;
/// Elements of a group.
const GROUP: usize = 16;

/// The header byte, without the version in its low bits.
const HEADER: u8 = 0xa0;

/// The tail is padded to so many bytes, by version.
const TAIL_MIN: [usize; 2] = [32, 24];

/// Bits of a byte in a group, by the group's two header bits: version 0, and the two tables of
/// version 1.
const BITS: [[u32; 4]; 3] = [[0, 2, 4, 8], [0, 1, 2, 4], [1, 2, 4, 8]];

/// Unpacks elements of `stride` bytes, a multiple of 4 up to 256, until `out` is full.
pub(super) fn decode(mut bytes: &[u8], stride: usize, out: &mut [u8]) -> Result<(), String> {
    let version = match take(&mut bytes, 1)?[0] {
        header @ (0xa0 | 0xa1) => usize::from(header - HEADER),
        header => {
            return Err(format!("starts with {header:#04x}, which no version of its mode does"));
        }
    };
    // Part the tail: the element before the first, and how each channel of four bytes differs.
    let tail_len = if version == 0 { stride } else { stride + stride / 4 };
    let body_len = bytes.len().checked_sub(tail_len.max(TAIL_MIN[version])).ok_or_else(ended)?;
    let tail = &bytes[bytes.len() - tail_len..];
    let (first, channels) = tail.split_at(stride);
    let mut last = [0; BLOCK_MAX];
    last[..stride].copy_from_slice(first);
    let mut body = &bytes[..body_len];

    let block_elements = ((BLOCK_BYTES / stride) & !(GROUP - 1)).min(BLOCK_MAX);
    for block in out.chunks_mut(block_elements * stride) {
        let control = take(&mut body, if version == 0 { 0 } else { stride / 4 })?;
        for channel in 0..stride / 4 {
            let mode = if version == 0 { 0 } else { channels[channel] };
            let control = control.get(channel).copied();
            let deltas = read_channel(&mut body, control, block.len() / stride)?;
            let at = 4 * channel;
            add_deltas(mode, &deltas, &mut last[at..at + 4], &mut block[at..], stride)?;
        }
    }
    if body.is_empty() { Ok(()) } else { Err(format!("has {} bytes too many", body.len())) }
}

/// The four runs of a channel.
type Deltas = [[u8; BLOCK_MAX]; 4];

/// Reads the differences of four bytes of `count` elements.
fn read_channel(body: &mut &[u8], control: Option<u8>, count: usize) -> Result<Deltas, String> {
    let mut deltas = [[0; BLOCK_MAX]; 4];
    for (k, run) in deltas.iter_mut().enumerate() {
        match control.map(|control| control >> (2 * k) & 3) {
            None => read_run(body, &BITS[0], count, run)?,
            Some(0) => read_run(body, &BITS[1], count, run)?,
            Some(1) => read_run(body, &BITS[2], count, run)?,
            Some(2) => {}
            Some(_) => run[..count].copy_from_slice(take(body, count)?),
        }
    }
    Ok(deltas)
}

/// Reads one byte of each element, group by group.
fn read_run(
    body: &mut &[u8],
    table: &[u32; 4],
    count: usize,
    run: &mut [u8; BLOCK_MAX],
) -> Result<(), String> {
    let groups = count.div_ceil(GROUP);
    let header = take(body, groups.div_ceil(4))?;
    let (run, _) = run.as_chunks_mut::<GROUP>();
    for (group, values) in run.iter_mut().take(groups).enumerate() {
        let bits = table[usize::from(header[group / 4] >> (2 * (group % 4)) & 3)];
        read_group(body, bits, values)?;
    }
    Ok(())
}

/// Reads 16 values of `bits` bits; one with all bits set stands for a whole byte behind the group.
fn read_group(body: &mut &[u8], bits: u32, values: &mut [u8; GROUP]) -> Result<(), String> {
    match bits {
        0 => return Ok(()),
        8 => {
            values.copy_from_slice(take(body, GROUP)?);
            return Ok(());
        }
        _ => {}
    }
    let packed = take(body, GROUP * bits as usize / 8)?;
    let sentinel = (1_u8 << bits) - 1;
    for (i, value) in values.iter_mut().enumerate() {
        let bit = i * bits as usize;
        // Single bits stand from the lowest up, wider ones from the highest down.
        let shift = if bits == 1 { bit % 8 } else { 8 - bits as usize - bit % 8 };
        *value = packed[bit / 8] >> shift & sentinel;
    }
    for value in values.iter_mut().filter(|value| **value == sentinel) {
        *value = take(body, 1)?[0];
    }
    Ok(())
}

/// Adds differences up, from `last` on, into four bytes of every `stride` of `out`.
fn add_deltas(
    mode: u8,
    deltas: &Deltas,
    last: &mut [u8],
    out: &mut [u8],
    stride: usize,
) -> Result<(), String> {
    let [a, b, c, d] = deltas;
    let mut now = [last[0], last[1], last[2], last[3]];
    let rows = out.chunks_mut(stride).enumerate();
    match mode {
        0 => rows.for_each(|(i, row)| {
            let add =
                |now: u8, delta: u8| now.wrapping_add(delta >> 1 ^ (delta & 1).wrapping_neg());
            now = [add(now[0], a[i]), add(now[1], b[i]), add(now[2], c[i]), add(now[3], d[i])];
            row[..4].copy_from_slice(&now);
        }),
        1 => rows.for_each(|(i, row)| {
            let add = |now: [u8; 2], delta: [u8; 2]| {
                let delta = u16::from_le_bytes(delta);
                let delta = delta >> 1 ^ (delta & 1).wrapping_neg();
                u16::from_le_bytes(now).wrapping_add(delta).to_le_bytes()
            };
            let ([x, y], [z, w]) =
                (add([now[0], now[1]], [a[i], b[i]]), add([now[2], now[3]], [c[i], d[i]]));
            now = [x, y, z, w];
            row[..4].copy_from_slice(&now);
        }),
        mode if mode & 15 == 2 => rows.for_each(|(i, row)| {
            let delta = u32::from_le_bytes([a[i], b[i], c[i], d[i]]);
            // The stream was turned left by so many bits, so it is turned back.
            let delta = delta.rotate_right(u32::from(mode >> 4));
            now = (u32::from_le_bytes(now) ^ delta).to_le_bytes();
            row[..4].copy_from_slice(&now);
        }),
        _ => return Err(format!("has the channel mode {mode:#04x}")),
    }
    last[..4].copy_from_slice(&now);
    Ok(())
}
