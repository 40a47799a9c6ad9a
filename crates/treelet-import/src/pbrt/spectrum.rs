//! Spectra as linear Rec. 709 colours.
//!
//! The eye's response is the fit of C. Wyman, P.-P. Sloan and P. Shirley, "Simple Analytic
//! Approximations to the CIE XYZ Color Matching Functions", JCGT 2(2), 2013. A spectrum's colour is
//! taken against that of a flat one, so that a flat reflectance is grey.

/// The colour of samples `(wavelength in nm, value)`, rising in wavelength, linear in between.
pub(super) fn sampled(samples: &[[f32; 2]]) -> [f32; 3] {
    let value = |nm: f64| {
        let after = samples.partition_point(|sample| f64::from(sample[0]) < nm);
        let [low, high] = match (after.checked_sub(1), samples.get(after)) {
            (Some(before), Some(after)) => [samples[before], *after],
            (None, Some(first)) => [*first; 2],
            (Some(last), None) => [samples[last]; 2],
            (None, None) => return 0.0,
        };
        let span = f64::from(high[0]) - f64::from(low[0]);
        let t = if span > 0.0 { (nm - f64::from(low[0])) / span } else { 0.0 };
        f64::from(low[1]) * (1.0 - t) + f64::from(high[1]) * t
    };
    let (color, flat) = (integrate(value), integrate(|_| 1.0));
    finite([0, 1, 2].map(|c| (color[c] / flat[c]) as f32))
}

/// The colour of a glowing body of so many kelvin, of luminance 1.
pub(super) fn blackbody(kelvin: f32) -> [f32; 3] {
    // Planck's law with c2 = h c / k in nm K; its factor falls out.
    const C2: f64 = 1.438_776_877e7;
    let kelvin = f64::from(kelvin.clamp(500.0, 1e6));
    let planck = |nm: f64| {
        let x = nm / 1000.0;
        1.0 / (x * x * x * x * x * (libm::exp(C2 / (nm * kelvin)) - 1.0))
    };
    let [r, g, b] = integrate(planck);
    let luminance = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    finite([r, g, b].map(|c| (c / luminance).max(0.0) as f32))
}

/// The index of refraction of a named glass or crystal at the sodium line (general tables).
pub(super) fn named_ior(name: &str) -> Option<f32> {
    Some(match name {
        "glass-BK7" => 1.517,
        "glass-BAF10" => 1.67,
        "glass-FK51A" => 1.487,
        "glass-LASF9" => 1.85,
        "glass-F5" | "glass-SF5" => 1.673,
        "glass-F10" | "glass-SF10" => 1.728,
        "glass-F11" | "glass-SF11" => 1.785,
        "metal-MgO-eta" => 1.735,
        "metal-TiO2-eta" => 2.58,
        _ => return None,
    })
}

/// Complex indices of refraction of a named metal at about 650, 550 and 450 nm: approximations of
/// the measured tables that pbrt carries.
pub(super) fn named_metal(name: &str) -> Option<[[f32; 3]; 2]> {
    let symbol = name.strip_prefix("metal-")?.split('-').next()?;
    Some(match symbol {
        "Ag" => [[0.155, 0.117, 0.138], [4.828, 3.122, 2.147]],
        "Al" => [[1.345, 0.965, 0.617], [7.474, 6.400, 5.303]],
        "Au" => [[0.143, 0.375, 1.442], [3.983, 2.386, 1.603]],
        "Cu" => [[0.200, 0.924, 1.102], [3.912, 2.452, 2.142]],
        "CuZn" => [[0.444, 0.527, 1.094], [3.695, 2.765, 1.829]],
        _ => return None,
    })
}

/// A named light as a colour of luminance 1.
pub(super) fn named_light(name: &str) -> Option<[f32; 3]> {
    match name.strip_prefix("stdillum-")? {
        "A" => Some(blackbody(2856.0)),
        "D50" => Some(blackbody(5003.0)),
        "D65" => Some([1.0; 3]),
        _ => None,
    }
}

/// The red, green and blue that the eye makes of a spectrum.
fn integrate(value: impl Fn(f64) -> f64) -> [f64; 3] {
    let mut xyz = [0.0; 3];
    // Steps of 5 nm are finer than anything in the response.
    for step in 0..=80 {
        let nm = 380.0 + 5.0 * f64::from(step);
        let value = value(nm);
        let response = response(nm);
        for k in 0..3 {
            xyz[k] += value * response[k];
        }
    }
    let [x, y, z] = xyz;
    // IEC 61966-2-1.
    [
        3.2406 * x - 1.5372 * y - 0.4986 * z,
        -0.9689 * x + 1.8758 * y + 0.0415 * z,
        0.0557 * x - 0.2040 * y + 1.0570 * z,
    ]
}

/// The multi-lobe fit of the colour matching functions of 1931.
fn response(nm: f64) -> [f64; 3] {
    let lobe = |height: f64, mean: f64, below: f64, above: f64| {
        let t = (nm - mean) * if nm < mean { below } else { above };
        height * libm::exp(-0.5 * t * t)
    };
    let x = lobe(0.362, 442.0, 0.0624, 0.0374) + lobe(1.056, 599.8, 0.0264, 0.0323)
        - lobe(0.065, 501.1, 0.0490, 0.0382);
    let y = lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322);
    let z = lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725);
    [x, y, z]
}

/// Anything that is no colour becomes black.
fn finite(color: [f32; 3]) -> [f32; 3] {
    color.map(|channel| if channel.is_finite() { channel } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glowing_bodies_go_from_red_to_blue() {
        let [r, g, b] = blackbody(2700.0);
        assert!(r > 1.5 * g && g > 2.0 * b, "{r} {g} {b}");
        let [r, g, b] = blackbody(6504.0);
        assert!((r - g).abs() < 0.1 && (b - g).abs() < 0.1, "{r} {g} {b}");
        let [r, _, b] = blackbody(20_000.0);
        assert!(b > 1.5 * r, "{r} {b}");
    }

    #[test]
    fn flat_reflectances_are_grey() {
        let grey = sampled(&[[300.0, 0.25], [800.0, 0.25]]);
        assert!(grey.iter().all(|c| (c - 0.25).abs() < 1e-6), "{grey:?}");
        let [r, g, b] = sampled(&[[400.0, 0.0], [590.0, 0.0], [600.0, 1.0], [700.0, 1.0]]);
        assert!(r > 0.8 && g < 0.3 && b < 0.1, "{r} {g} {b}");
        assert_eq!(sampled(&[]), [0.0; 3]);
    }
}
