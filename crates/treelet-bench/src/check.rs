//! Answers are held against each other before anything is timed.

use treelet::verify::{self, BruteForce, Mismatch};
use treelet::{Ray, Scene};

use crate::engine::Answer;

/// How far two `t` may be apart, of the larger, and still be the same hit to another engine.
const TOLERANCE: f32 = 1e-4;

/// How answers differ from treelet's, in parts per million of the rays.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Difference {
    /// Hit against miss, or another `t`.
    pub mismatch_ppm: f64,
    /// The same `t`, another triangle or another instance.
    pub ids_ppm: f64,
}

/// Compares the answers of an engine with the reference, ray by ray.
///
/// Lists of different length differ in every ray that only one of them has.
pub fn compare(reference: &[Answer], answers: &[Answer]) -> Difference {
    let rays = reference.len().max(answers.len()).max(1) as f64;
    let mut mismatches = reference.len().abs_diff(answers.len());
    let mut ids = 0_usize;
    for (expected, got) in reference.iter().zip(answers) {
        match (expected.is_hit(), got.is_hit()) {
            (false, false) => {}
            (true, true) if near(expected.t, got.t) => {
                ids += usize::from((expected.inst, expected.prim) != (got.inst, got.prim))
            }
            _ => mismatches += 1,
        }
    }
    let ppm = |count: usize| count as f64 / rays * 1e6;
    Difference { mismatch_ppm: ppm(mismatches), ids_ppm: ppm(ids) }
}

/// Whether two `t` count as the same.
fn near(a: f32, b: f32) -> bool {
    // Written so that NaN is never near.
    (a - b).abs() <= TOLERANCE * a.abs().max(b.abs())
}

/// The first ray to which two lists of answers differ in a bit.
pub fn first_bit_difference(reference: &[Answer], answers: &[Answer]) -> Option<usize> {
    if reference.len() != answers.len() {
        return Some(reference.len().min(answers.len()));
    }
    let bits = |answer: &Answer| (answer.t.to_bits(), answer.inst, answer.prim);
    reference.iter().zip(answers).position(|(a, b)| bits(a) != bits(b))
}

/// Triangle tests that brute force is given for one kind of ray: about a second.
const BRUTE_TESTS: u64 = 500_000_000;
/// Rays that are checked by brute force at least, and at most, of one kind.
const BRUTE_RAYS: (usize, usize) = (8, 512);

/// Holds the scene against brute force on some of the rays, evenly spread; how many.
///
/// # Errors
///
/// The first answer with a bit that differs.
pub fn brute_force(
    scene: &Scene,
    brute: &BruteForce<'_>,
    rays: &[Ray],
) -> Result<usize, Box<Mismatch>> {
    let affordable = BRUTE_TESTS / brute.tests_per_ray().max(1);
    let count = usize::try_from(affordable).unwrap_or(usize::MAX);
    let count = count.clamp(BRUTE_RAYS.0, BRUTE_RAYS.1).min(rays.len());
    let sample: Vec<Ray> = (0..count).map(|i| rays[i * rays.len() / count]).collect();
    verify::check_many(scene, &sample, |ray| brute.all(ray)).map_err(Box::new)?;
    Ok(count)
}

#[cfg(test)]
mod tests {
    use super::{Difference, compare, first_bit_difference};
    use crate::engine::Answer;

    const HIT: Answer = Answer::hit(2.0, 7);

    #[test]
    fn every_way_to_differ_is_counted() {
        let other_id = Answer { prim: 8, ..HIT };
        let elsewhere = Answer { inst: 1, ..HIT };
        let beside = Answer { t: 2.000_1, ..HIT };
        let behind = Answer { t: 2.001, ..HIT };
        let nan = Answer::hit(f32::NAN, 7);
        let none = Difference::default();
        let mismatch = Difference { mismatch_ppm: 1e6, ids_ppm: 0.0 };
        for (got, expected) in [
            (HIT, none),
            (beside, none),
            (other_id, Difference { mismatch_ppm: 0.0, ids_ppm: 1e6 }),
            (elsewhere, Difference { mismatch_ppm: 0.0, ids_ppm: 1e6 }),
            (behind, mismatch),
            (nan, mismatch),
            (Answer::MISS, mismatch),
        ] {
            assert_eq!(compare(&[HIT], &[got]), expected, "{got:?}");
        }
        assert_eq!(compare(&[Answer::MISS], &[HIT]), mismatch);
        assert_eq!(compare(&[Answer::any(true)], &[Answer::any(false)]), mismatch);
        assert_eq!(compare(&[HIT; 2], &[HIT]).mismatch_ppm, 5e5, "an answer is lacking");
    }

    #[test]
    fn bits_are_bits() {
        assert_eq!(first_bit_difference(&[HIT, HIT], &[HIT, HIT]), None);
        let next = Answer { t: HIT.t.next_up(), ..HIT };
        let elsewhere = Answer { inst: 1, ..HIT };
        assert_eq!(first_bit_difference(&[HIT, HIT], &[HIT, elsewhere]), Some(1));
        assert_eq!(first_bit_difference(&[HIT, HIT], &[HIT, next]), Some(1));
        assert_eq!(first_bit_difference(&[HIT], &[HIT, HIT]), Some(1));
    }
}
