//! How far a picture is from a reference: measures over linear radiance.

use crate::color;

/// Differences between two pictures of the same size.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    /// Mean of the absolute differences.
    pub mean_absolute: f64,
    /// Mean of the squared differences.
    pub mean_squared: f64,
    /// Mean of the squared differences over the squared reference (plus 0.01, so that black counts):
    /// what noise is usually compared by. Source: F. Rousselle, C. Knaus, M. Zwicker, "Adaptive
    /// Sampling and Reconstruction using Greedy Error Minimization", SIGGRAPH Asia 2011.
    pub relative_squared: f64,
    /// The mean of the picture less that of the reference, over the latter: noise averages out of
    /// it, light that is missing or too much does not.
    pub bias: f64,
    /// The largest difference of luminance.
    pub greatest: f64,
}

/// The differences, over all pixels and channels; `None` if the pictures are not of one size, or
/// empty.
pub fn errors(picture: &[[f32; 3]], reference: &[[f32; 3]]) -> Option<Errors> {
    const BLACK: f64 = 0.01;
    if picture.len() != reference.len() || picture.is_empty() {
        return None;
    }
    let mut out = Errors::default();
    let (mut shown, mut wanted) = (0.0, 0.0);
    for (a, b) in picture.iter().zip(reference) {
        for c in 0..3 {
            let (a, b) = (f64::from(a[c]), f64::from(b[c]));
            out.mean_absolute += (a - b).abs();
            out.mean_squared += (a - b) * (a - b);
            out.relative_squared += (a - b) * (a - b) / (b * b + BLACK);
            shown += a;
            wanted += b;
        }
        let apart = f64::from(color::luminance(*a)) - f64::from(color::luminance(*b));
        out.greatest = out.greatest.max(apart.abs());
    }
    let n = (3 * picture.len()) as f64;
    out.mean_absolute /= n;
    out.mean_squared /= n;
    out.relative_squared /= n;
    out.bias = (shown - wanted) / wanted.max(f64::MIN_POSITIVE);
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::errors;

    #[test]
    fn measures_are_what_they_say() {
        let reference = [[1.0; 3], [2.0; 3]];
        let same = errors(&reference, &reference).unwrap();
        assert_eq!((same.mean_squared, same.bias, same.greatest), (0.0, 0.0, 0.0));
        let off = errors(&[[1.5; 3], [2.0; 3]], &reference).unwrap();
        assert!((off.mean_absolute - 0.25).abs() < 1e-9 && (off.mean_squared - 0.125).abs() < 1e-9);
        assert!((off.relative_squared - 0.25 / 1.01 / 2.0).abs() < 1e-9);
        assert!((off.bias - 0.5 / 3.0).abs() < 1e-9 && (off.greatest - 0.5).abs() < 1e-6);
        assert_eq!(errors(&reference, &reference[..1]), None);
    }
}
