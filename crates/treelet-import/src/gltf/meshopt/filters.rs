//! What is undone after unpacking: numbers that were rewritten so that they pack well.
//!
//! The formulas are those of the extensions' appendices; the square root is correctly rounded, so
//! every machine gets the same bits.

/// Unit vectors of four signed bytes: two coordinates on an octahedron, its size, anything.
pub(super) fn octahedral_8(out: &mut [u8]) {
    let (rows, _) = out.as_chunks_mut::<4>();
    for row in rows {
        let [x, y, one, _] = row.map(|byte| f32::from(byte as i8));
        let [x, y, z] = octahedral(x, y, one, 127.0);
        [row[0], row[1], row[2]] = [x as i8 as u8, y as i8 as u8, z as i8 as u8];
    }
}

/// The same of four signed 16-bit words.
pub(super) fn octahedral_16(out: &mut [u8]) {
    let (rows, _) = out.as_chunks_mut::<8>();
    for row in rows {
        let words = words(row);
        let [x, y, one, _] = words.map(f32::from);
        let [x, y, z] = octahedral(x, y, one, 32767.0);
        set_words(row, [x as i16, y as i16, z as i16, words[3]]);
    }
}

/// From the octahedron to the sphere of radius `max`, rounded.
fn octahedral(x: f32, y: f32, one: f32, max: f32) -> [f32; 3] {
    let z = one - x.abs() - y.abs();
    // Fold the lower half down.
    let fold = z.min(0.0);
    let x = x + if x >= 0.0 { fold } else { -fold };
    let y = y + if y >= 0.0 { fold } else { -fold };
    let scale = max / libm::sqrtf(x * x + y * y + z * z);
    [x, y, z].map(|axis| round(axis * scale))
}

/// Unit quaternions of four signed words: three components, and which is missing with a scale.
pub(super) fn quaternion(out: &mut [u8]) {
    let (rows, _) = out.as_chunks_mut::<8>();
    for row in rows {
        let words = words(row);
        let scale = std::f32::consts::FRAC_1_SQRT_2 / f32::from(words[3] | 3);
        let [x, y, z] = [words[0], words[1], words[2]].map(|word| f32::from(word) * scale);
        let w = libm::sqrtf((1.0 - x * x - y * y - z * z).max(0.0));
        let missing = (words[3] & 3) as usize;
        let mut quaternion = [0; 4];
        for (i, component) in [w, x, y, z].into_iter().enumerate() {
            quaternion[(missing + i) & 3] = round(component * 32767.0) as i16;
        }
        set_words(row, quaternion);
    }
}

/// Floats of 8 bits of exponent and 24 of mantissa, both signed.
pub(super) fn exponential(out: &mut [u8]) {
    let (words, _) = out.as_chunks_mut::<4>();
    for word in words {
        let packed = i32::from_le_bytes(*word);
        let (exponent, mantissa) = (packed >> 24, packed << 8 >> 8);
        *word = libm::scalbnf(mantissa as f32, exponent).to_le_bytes();
    }
}

/// Colours of four bytes: luma, two differences, and opacity under a bit that tells the scale.
pub(super) fn color_8(out: &mut [u8]) {
    let (rows, _) = out.as_chunks_mut::<4>();
    for row in rows {
        let [y, co, cg, a] = *row;
        let color =
            color([i32::from(y), i32::from(co as i8), i32::from(cg as i8), i32::from(a)], 255.0);
        *row = color.map(|channel| channel as u8);
    }
}

/// The same of four words.
pub(super) fn color_16(out: &mut [u8]) {
    let (rows, _) = out.as_chunks_mut::<8>();
    for row in rows {
        let [y, co, cg, a] = words(row);
        let [y, a] = [y, a].map(|word| i32::from(word as u16));
        let color = color([y, i32::from(co), i32::from(cg), a], 65535.0);
        set_words(row, color.map(|channel| channel as u16 as i16));
    }
}

/// Red, green, blue and opacity up to `max`, rounded.
fn color([y, co, cg, a]: [i32; 4], max: f32) -> [f32; 4] {
    // All bits from the highest one of the opacity down; none of them is 0 in a sound file.
    let scale_bits = (1_i64 << (32 - (a as u32).leading_zeros())) - 1;
    let scale = max / (scale_bits.max(1) as f32);
    let opacity = i64::from(a) << 1 & scale_bits | i64::from(a) & 1;
    let channels = [y + co - cg, y + cg, y - co - cg, opacity as i32];
    channels.map(|channel| (channel as f32 * scale + 0.5).clamp(0.0, max))
}

/// To the nearest integer, halves away from zero, as the extension wants it.
fn round(x: f32) -> f32 {
    (x + if x >= 0.0 { 0.5 } else { -0.5 }).trunc()
}

fn words(row: &[u8; 8]) -> [i16; 4] {
    let [a, b, c, d, e, f, g, h] = *row;
    [[a, b], [c, d], [e, f], [g, h]].map(i16::from_le_bytes)
}

fn set_words(row: &mut [u8; 8], words: [i16; 4]) {
    let [[a, b], [c, d], [e, f], [g, h]] = words.map(i16::to_le_bytes);
    *row = [a, b, c, d, e, f, g, h];
}
