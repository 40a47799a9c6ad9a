//! Every level against the scalar one, bit for bit, on values that do something odd.

use super::{Checked, Doubles, Floats, Four, Kernel, Level, NO_BYTE, Simd, Wide};
use crate::math::Ray;
use alloc::vec::Vec;

const ODD: [f32; 16] = [
    0.0,
    -0.0,
    1.0,
    -1.5,
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::MIN_POSITIVE,
    -1e-45,
    3.0e38,
    -3.0e38,
    16_777_217.0,
    0.1,
    -7.25,
    1e-20,
    1.0 + f32::EPSILON,
];

/// Everything a level computes from the odd values, as bits; NaN as one value.
struct Everything;

impl Kernel for Everything {
    type Output = Vec<u64>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Vec<u64> {
        let mut bits = Vec::new();
        for shift in 0..16 {
            floats::<S, 16>(simd, shift, &mut bits);
            floats::<S, 8>(simd, shift, &mut bits);
            doubles(simd, shift, &mut bits);
            four(simd, shift, &mut bits);
        }
        for mask in 0..=0xFFFF {
            bits.extend(packed::<S, 16>(simd, mask));
            bits.extend(packed::<S, 8>(simd, mask & 0xFF));
            bits.extend(selected(simd, mask));
        }
        let rows: [[f32; 16]; 16] =
            core::array::from_fn(|row| core::array::from_fn(|lane| (100 * row + lane) as f32));
        let mut columns = [[0.0; 16]; 16];
        simd.transpose(&core::array::from_fn(|row| &rows[row]), &mut columns);
        bits.extend(columns.iter().flatten().copied().map(narrow_bits));
        let rays: [Ray; 16] = core::array::from_fn(|lane| {
            let word = |i: usize| (100 * lane + i) as f32;
            let mut ray = Ray::new([word(0), word(1), word(2)], [word(4), word(5), word(6)]);
            (ray.t_min, ray.t_max) = (word(3), word(7));
            ray
        });
        let columns = simd.rays(&core::array::from_fn(|lane| &rays[lane]));
        bits.extend(columns.iter().flatten().copied().map(narrow_bits));
        simd.prefetch(bits.as_ptr());
        bits
    }
}

#[inline(always)]
fn floats<S: Wide<W>, const W: usize>(simd: S, shift: usize, bits: &mut Vec<u64>) {
    let a: [f32; W] = core::array::from_fn(|lane| ODD[lane]);
    let b: [f32; W] = core::array::from_fn(|lane| ODD[(lane + shift) % 16]);
    let [a, b] = [S::F::load(simd, &a), S::F::load(simd, &b)];
    let once = S::F::splat(simd, ODD[shift]);
    let all = [a.add(b), a.sub(b), a.mul(b), a.div(b), a.min(b), a.max(b), once];
    bits.extend(all.iter().flat_map(|v| v.lanes()).map(narrow_bits));
    bits.extend(a.min_where(0xA5C3, b).lanes().map(narrow_bits));
    bits.extend([u64::from(a.le(b)), u64::from(a.lt(b))]);
    let halves = core::array::from_fn(|lane| (1600 * shift + 3700 * lane) as u16);
    let start = S::F::splat(simd, 8_388_608.0);
    bits.extend(start.or_halves(&halves).lanes().map(narrow_bits));
}

#[inline(always)]
fn doubles<S: Simd>(simd: S, shift: usize, bits: &mut Vec<u64>) {
    for first in [0, 4, 8, 12] {
        let a: [f32; 4] = core::array::from_fn(|lane| ODD[first + lane]);
        let b: [f32; 4] = core::array::from_fn(|lane| ODD[(first + lane + shift) % 16]);
        let widen = |lanes| S::D4::widen(S::F4::load(simd, lanes));
        let (a, b) = (widen(&a), widen(&b));
        let third = S::D4::splat(simd, 1.0 / 3.0);
        let all =
            [a.add(b).mul(third), a.sub(b.mul(third)), a.mul(b), a.div(b), a.min(b), a.max(b)];
        bits.extend(all.iter().flat_map(|v| v.narrow().lanes()).map(narrow_bits));
        bits.push(u64::from(a.lt(b)));
    }
}

#[inline(always)]
fn four<S: Simd>(simd: S, shift: usize, bits: &mut Vec<u64>) {
    for first in [0, 4, 8, 12] {
        let a: [f32; 4] = core::array::from_fn(|lane| ODD[first + lane]);
        let b: [f32; 4] = core::array::from_fn(|lane| ODD[(first + lane + shift) % 16]);
        // Without NaN and negative zero: lanes are compared in any order.
        let size = b.map(|x| if x.is_nan() { 7.0 } else { x.abs() });
        let negative = size.map(|x| -1.0 - x);
        let [a, b, size, negative] = [a, b, size, negative].map(|x| S::F4::load(simd, &x));
        let order = core::array::from_fn(|i| (4 * ((3 * (i / 4) + shift) % 4) + i % 4) as u8);
        let all = [
            a.xyzz(),
            a.yzxx(),
            a.abs(),
            a.div(b),
            a.reordered(&order),
            size.max_lane(),
            negative.max_lane(),
        ];
        bits.extend(all.iter().flat_map(|v| v.lanes()).map(narrow_bits));
        bits.push(u64::from(a.signs()));
        let bytes = core::array::from_fn(|i| (29 * i + shift) as u8);
        let shuffle = core::array::from_fn(|i| {
            if (i + shift).is_multiple_of(5) { NO_BYTE } else { ((7 * i + first) % 16) as u8 }
        });
        bits.extend(size.add_bytes(&bytes, &shuffle).lanes().map(narrow_bits));
        bits.extend(
            S::F4::columns([a, b, size, negative]).iter().flat_map(|v| v.lanes()).map(narrow_bits),
        );
    }
}

fn narrow_bits(x: f32) -> u64 {
    if x.is_nan() { 1 << 40 } else { u64::from(x.to_bits()) }
}

/// The items that count, and how many.
#[inline(always)]
fn packed<S: Simd, const W: usize>(simd: S, mask: u32) -> Vec<u64> {
    let items = core::array::from_fn(|lane| 100 + lane as u32);
    let packed: [u32; W] = simd.compress(mask, &items);
    packed.iter().take(mask.count_ones() as usize).map(|&item| u64::from(item)).collect()
}

/// The items whose mask, one of many, shares a bit.
#[inline(always)]
fn selected<S: Simd>(simd: S, bits: u32) -> Vec<u64> {
    let masks = core::array::from_fn(|lane| (lane as u32 * 0x9E37 + 1) >> 3 & 0xFFFF);
    let items = core::array::from_fn(|lane| 100 + lane as u32);
    let (selected, count) = simd.select(bits, &masks, &items);
    selected.iter().take(count).map(|&item| u64::from(item)).collect()
}

#[test]
fn every_level_computes_the_same_bits() {
    let expected = Checked::SCALAR.run(Everything);
    let mut levels = 0;
    for level in Level::ALL {
        let Some(checked) = level.checked() else { continue };
        assert_eq!(checked.level(), *level);
        assert!(checked.run(Everything) == expected, "{}", level.name());
        levels += 1;
    }
    assert!(levels > 1 || Level::best() == Level::Scalar);
}

#[test]
fn transposing_swaps_rows_and_columns() {
    let rows: [[f32; 16]; 16] =
        core::array::from_fn(|row| core::array::from_fn(|lane| (100 * row + lane) as f32));
    let mut columns = [[0.0; 16]; 16];
    super::scalar::Scalar.transpose(&core::array::from_fn(|row| &rows[row]), &mut columns);
    for (column, lanes) in columns.iter().enumerate() {
        let expected: [f32; 16] = core::array::from_fn(|row| (100 * row + column) as f32);
        assert_eq!(*lanes, expected);
    }
}

#[test]
fn compress_keeps_the_order() {
    for mask in [0, 1, 0x8000, 0xFFFF, 0x1234] {
        let expected: Vec<u64> = (0..16).filter(|i| mask >> i & 1 == 1).map(|i| 100 + i).collect();
        assert_eq!(packed::<_, 16>(super::scalar::Scalar, mask), expected);
    }
}
