//! An encoder of `EXT_meshopt_compression` and `KHR_meshopt_compression`, which uses every kind of
//! group; triangles are encoded by hand.

use super::glb;

/// The byte that stands for a difference of bytes.
fn zigzag8(delta: u8) -> u8 {
    delta << 1 ^ ((delta as i8) >> 7) as u8
}

fn zigzag16(delta: u16) -> u16 {
    delta << 1 ^ ((delta as i16) >> 15) as u16
}

/// Packs 16 values with `bits` bits each.
fn group(values: &[u8], bits: u32) -> Vec<u8> {
    match bits {
        0 => return vec![],
        8 => return values.to_vec(),
        _ => {}
    }
    let sentinel = (1_u8 << bits) - 1;
    let mut packed = vec![0_u8; 2 * bits as usize];
    let mut behind = Vec::new();
    for (i, &value) in values.iter().enumerate() {
        let bit = i * bits as usize;
        let shift = if bits == 1 { bit % 8 } else { 8 - bits as usize - bit % 8 };
        packed[bit / 8] |= value.min(sentinel) << shift;
        if value >= sentinel {
            behind.push(value);
        }
    }
    packed.extend(behind);
    packed
}

/// One byte of each element of a block, each group in its smallest form.
fn run(values: &[u8], table: [u32; 4]) -> Vec<u8> {
    let mut padded = values.to_vec();
    padded.resize(values.len().next_multiple_of(16), 0);
    let mut header = vec![0_u8; (padded.len() / 16).div_ceil(4)];
    let mut data = Vec::new();
    for (i, chunk) in padded.chunks(16).enumerate() {
        let best = (0..4)
            .filter(|&mode| table[mode] > 0 || chunk.iter().all(|&value| value == 0))
            .min_by_key(|&mode| group(chunk, table[mode]).len())
            .expect("there is always one");
        header[i / 4] |= (best as u8) << (2 * (i % 4));
        data.extend(group(chunk, table[best]));
    }
    [header, data].concat()
}

/// Packs elements of `stride` bytes; version 1 has a channel mode for each four bytes.
pub(crate) fn attributes(elements: &[u8], stride: usize, channels: Option<&[u8]>) -> Vec<u8> {
    let mut out = vec![if channels.is_some() { 0xa1 } else { 0xa0 }];
    let mut last = elements[..stride].to_vec();
    let first = last.clone();
    let block = ((8192 / stride) & !15).min(256);
    for block in elements.chunks(block * stride) {
        let mut columns: Vec<Vec<u8>> = vec![Vec::new(); stride];
        for element in block.chunks(stride) {
            for at in (0..stride).step_by(4) {
                let (now, old) = (&element[at..at + 4], &last[at..at + 4]);
                let deltas: Vec<u8> = match channels.map_or(0, |channels| channels[at / 4]) {
                    0 => (0..4).map(|k| zigzag8(now[k].wrapping_sub(old[k]))).collect(),
                    1 => [0, 2]
                        .iter()
                        .flat_map(|&k| {
                            let word = |x: &[u8]| u16::from_le_bytes([x[k], x[k + 1]]);
                            zigzag16(word(now).wrapping_sub(word(old))).to_le_bytes()
                        })
                        .collect(),
                    mode => {
                        let word = |x: &[u8]| u32::from_le_bytes([x[0], x[1], x[2], x[3]]);
                        let turn = u32::from(mode >> 4);
                        (word(now) ^ word(old)).rotate_left(turn).to_le_bytes().to_vec()
                    }
                };
                for (k, delta) in deltas.into_iter().enumerate() {
                    columns[at + k].push(delta);
                }
            }
            last.copy_from_slice(element);
        }
        // Version 1 takes another form for each byte, in turn, where it can.
        let forms: Vec<u8> = columns
            .iter()
            .enumerate()
            .map(|(k, column)| match (k % 4, column.iter().all(|&x| x == 0)) {
                (_, true) => 2,
                (0, _) => 1,
                (1, _) if column.iter().all(|&x| x < 15) => 0,
                (2, _) => 3,
                _ => 1,
            })
            .collect();
        if channels.is_some() {
            out.extend(forms.chunks(4).map(|f| f[0] | f[1] << 2 | f[2] << 4 | f[3] << 6));
        }
        for (column, form) in columns.iter().zip(forms) {
            match (channels.is_some(), form) {
                (false, _) => out.extend(run(column, [0, 2, 4, 8])),
                (true, 0) => out.extend(run(column, [0, 1, 2, 4])),
                (true, 1) => out.extend(run(column, [1, 2, 4, 8])),
                (true, 2) => {}
                (true, _) => out.extend(column),
            }
        }
    }
    let tail = [&first[..], channels.unwrap_or_default()].concat();
    let least = if channels.is_some() { 24_usize } else { 32 };
    out.resize(out.len() + least.saturating_sub(tail.len()), 0);
    out.extend(tail);
    out
}

fn varint(mut value: u32, out: &mut Vec<u8>) {
    while value >= 128 {
        out.push(value as u8 | 128);
        value >>= 7;
    }
    out.push(value as u8);
}

/// Packs indices as differences of one sequence.
pub(crate) fn sequence(indices: &[u32]) -> Vec<u8> {
    let mut out = vec![0xd1];
    let mut last = 0_u32;
    for &index in indices {
        let delta = index.wrapping_sub(last);
        varint((delta << 1 ^ ((delta as i32) >> 31) as u32) << 1, &mut out);
        last = index;
    }
    out.extend([0; 4]);
    out
}

/// A file of one mesh whose positions and indices are packed. `views` are mode, filter, stride,
/// count and the stream; `position` completes the accessor of positions.
pub(crate) fn packed(
    name: &str,
    views: [(&str, &str, usize, usize, &[u8]); 2],
    position: &str,
    index: (u32, usize),
) -> Vec<u8> {
    let mut binary = Vec::new();
    let mut json = Vec::new();
    for (mode, filter, stride, count, stream) in views {
        let at = binary.len();
        binary.extend(stream);
        json.push(format!(
            r#"{{"buffer":1,"byteLength":{},"extensions":{{"{name}":{{"buffer":0,"byteOffset":{at},
            "byteLength":{},"byteStride":{stride},"count":{count},"mode":"{mode}","filter":"{filter}"}}}}}}"#,
            stride * count,
            stream.len()
        ));
    }
    let (kind, count) = index;
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsRequired":["{name}"],"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "accessors":[{{"bufferView":0,"type":"VEC3",{position}}},
                     {{"bufferView":1,"componentType":{kind},"count":{count},"type":"SCALAR"}}],
        "bufferViews":[{}],"buffers":[{{"byteLength":{}}},{{"byteLength":9999}}]}}"#,
        json.join(","),
        binary.len()
    );
    glb(&json, &binary)
}

pub(crate) const EXT: &str = "EXT_meshopt_compression";
pub(crate) const KHR: &str = "KHR_meshopt_compression";
