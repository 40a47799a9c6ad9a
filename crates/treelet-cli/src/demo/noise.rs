//! Smooth noise: values at the corners of a lattice, blended, and sums of it at finer scales.

/// Noise in `-1 ..= 1` over three dimensions, smooth to the first derivative.
pub(super) fn smooth(p: [f32; 3]) -> f32 {
    let cell = p.map(|x| x.floor());
    let blend: [f32; 3] = std::array::from_fn(|axis| {
        let t = p[axis] - cell[axis];
        t * t * (3.0 - 2.0 * t)
    });
    let corner = |x: i32, y: i32, z: i32| {
        lattice([cell[0] as i32 + x, cell[1] as i32 + y, cell[2] as i32 + z])
    };
    let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let edge = |y: i32, z: i32| mix(corner(0, y, z), corner(1, y, z), blend[0]);
    let face = |z: i32| mix(edge(0, z), edge(1, z), blend[1]);
    mix(face(0), face(1), blend[2])
}

/// `octaves` of [`smooth`], each half as strong and about twice as fine.
pub(super) fn fractal(p: [f32; 3], octaves: u32) -> f32 {
    let (mut sum, mut strength, mut scale) = (0.0, 0.5, 1.0);
    for _ in 0..octaves {
        sum += strength * smooth(p.map(|x| x * scale));
        strength *= 0.5;
        // Not exactly 2, so that the lattices never line up.
        scale *= 2.03;
    }
    sum
}

/// The value of a lattice point, in `-1 ..= 1`.
fn lattice([x, y, z]: [i32; 3]) -> f32 {
    // Three odd factors spread the coordinates, two rounds of shift and multiply mix the bits.
    let mut h = (x as u32).wrapping_mul(0x8DA6_B343)
        ^ (y as u32).wrapping_mul(0xD816_3841)
        ^ (z as u32).wrapping_mul(0xCB1A_B31F);
    h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
    h = (h ^ (h >> 12)).wrapping_mul(0x297A_2D39);
    h ^= h >> 15;
    (h >> 8) as f32 * (2.0 / (1 << 24) as f32) - 1.0
}

/// 0 below `lo`, 1 above `hi`, smooth between.
pub(super) fn step(lo: f32, hi: f32, x: f32) -> f32 {
    let t = ((x - lo) / (hi - lo)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
