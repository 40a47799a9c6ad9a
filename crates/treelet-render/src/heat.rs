//! Numbers as colours, with a scale to read them by.
//!
//! The scale starts at 0 and ends at a round number (1, 2 or 5 times a power of ten) that all but
//! one pixel in two hundred stay below, so that one odd ray does not darken the picture and maps of
//! similar trees share their scale. Mean and maximum are written beside it, exact.

use crate::color;
use crate::error::RenderError;
use crate::font;
use crate::image::Image;

/// How numbers become colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ramp {
    /// From black over blue, red and yellow to white, brighter throughout.
    Heat,
    /// From white at 0 to dark grey.
    Near,
}

/// Way points of the colours of heat maps, evenly spaced, sRGB, of evenly rising lightness.
pub const HEAT: [[f32; 3]; 7] = [
    [0.0, 0.0, 16.0],
    [38.0, 20.0, 104.0],
    [122.0, 28.0, 120.0],
    [200.0, 52.0, 76.0],
    [244.0, 116.0, 32.0],
    [252.0, 196.0, 56.0],
    [255.0, 255.0, 224.0],
];

impl Ramp {
    /// The colour at a place of the scale, `0 ..= 1`.
    pub(crate) fn color(self, place: f32) -> [u8; 3] {
        let place = place.clamp(0.0, 1.0);
        let rgb = match self {
            Self::Heat => {
                let along = place * (HEAT.len() - 1) as f32;
                let step = (along as usize).min(HEAT.len() - 2);
                color::mix(HEAT[step], HEAT[step + 1], along - step as f32)
            }
            Self::Near => [250.0 - 210.0 * place; 3],
        };
        rgb.map(|c| (c + 0.5) as u8)
    }
}

/// The colour of heat maps at a place of its scale, `0 ..= 1`, sRGB.
pub fn heat_color(place: f32) -> [u8; 3] {
    Ramp::Heat.color(place)
}

/// The colour of pixels that have no number.
const NOTHING: [u8; 3] = [24, 26, 32];
/// The share of pixels that stay within the scale.
const WITHIN: f64 = 0.995;

/// A picture of `values`, row by row; infinite ones have no number. `title` stands over the scale.
pub(crate) fn paint(
    values: &[f32],
    width: u32,
    height: u32,
    ramp: Ramp,
    title: &str,
) -> Result<Image, RenderError> {
    let mut image = Image::filled(width, height, NOTHING)?;
    let (end, mean, max) = measure(values)?;
    for (pixel, &value) in image.pixels_mut().iter_mut().zip(values) {
        if value.is_finite() {
            *pixel = ramp.color(value / end);
        }
    }
    let statistics = format!("MEAN {}  MAX {}", number(mean), number(max));
    draw_scale(&mut image, ramp, end, title, &statistics);
    Ok(image)
}

/// The end of the scale, the mean and the maximum of the finite values; no values count as 0.
fn measure(values: &[f32]) -> Result<(f32, f32, f32), RenderError> {
    let mut sorted = Vec::new();
    let bytes = size_of_val(values) as u64;
    sorted
        .try_reserve_exact(values.len())
        .map_err(|_| RenderError::OutOfMemory { bytes, what: "the colour scale" })?;
    sorted.extend(values.iter().copied().filter(|value| value.is_finite()));
    if sorted.is_empty() {
        return Ok((1.0, 0.0, 0.0));
    }
    let sum: f64 = sorted.iter().map(|&value| f64::from(value)).sum();
    let mean = (sum / sorted.len() as f64) as f32;
    let rank = ((sorted.len() as f64 * WITHIN) as usize).min(sorted.len() - 1);
    let (_, &mut within, above) = sorted.select_nth_unstable_by(rank, f32::total_cmp);
    let max = above.iter().copied().fold(within, f32::max);
    Ok((round_up(within), mean, max))
}

/// The least of 1, 2 and 5 times a power of ten that is not below `x`; 1 for 0.
fn round_up(x: f32) -> f32 {
    if x <= 0.0 {
        return 1.0;
    }
    let power = libm::pow(10.0, libm::floor(libm::log10(f64::from(x))));
    let steps = [1.0, 2.0, 5.0, 10.0].map(|step| (step * power) as f32);
    steps.into_iter().find(|&step| step >= x).unwrap_or(x)
}

/// A number in few letters: three digits, thousands and millions shortened.
fn number(x: f32) -> String {
    let (x, unit) = match x {
        x if x.abs() >= 1e9 || (x != 0.0 && x.abs() < 1e-3) => return format!("{x:.1E}"),
        x if x.abs() >= 1e6 => (x / 1e6, "M"),
        x if x.abs() >= 1e4 => (x / 1e3, "K"),
        x => (x, ""),
    };
    let decimals = match x.abs() {
        size if size >= 100.0 || x == x.round() => 0,
        size if size >= 10.0 => 1,
        size if size >= 1.0 => 2,
        _ => 3,
    };
    format!("{x:.decimals$}{unit}")
}

/// Colours of the panel behind the scale, and of its letters.
const PANEL: [u8; 3] = [12, 12, 16];
const LETTERS: [u8; 3] = [235, 235, 235];
/// Half of the scale and its end are labelled, besides 0.
const LABELS: [f32; 3] = [0.0, 0.5, 1.0];

/// Draws the scale into the lower left corner, as large as the picture allows: letters down to one
/// pixel a dot, then the bar alone, and nothing in a picture that is smaller still.
fn draw_scale(image: &mut Image, ramp: Ramp, end: f32, title: &str, statistics: &str) {
    let (width, height) = (image.width(), image.height());
    let needed = |scale: u32| {
        let text = font::width(title, scale).max(font::width(statistics, scale));
        (text.max(48 * scale) + 4 * scale, 4 * font::height(scale) + 10 * scale)
    };
    let largest = (width / 320).clamp(1, 6) + 1;
    let fits = |&scale: &u32| needed(scale).0 <= width && needed(scale).1 * 2 <= height;
    let Some(scale) = (1..=largest).rev().find(fits) else {
        if width >= 16 && height >= 8 {
            draw_bar(image, ramp, 0, height - 2, width, 2);
        }
        return;
    };

    // The panel, and the two lines over the bar.
    let (panel_width, panel_height) = needed(scale);
    let (line, pad) = (font::height(scale) + 2 * scale, 2 * scale);
    let top = height - panel_height;
    image.fill(0, top, panel_width, panel_height, PANEL);
    font::draw(image, pad, top + pad, scale, title, LETTERS);
    font::draw(image, pad, top + pad + line, scale, statistics, LETTERS);

    // The bar, and its labels below.
    let (bar_top, bar_width) = (top + pad + 2 * line, panel_width - 2 * pad);
    draw_bar(image, ramp, pad, bar_top, bar_width, font::height(scale));
    for place in LABELS {
        let label = number(place * end);
        let label_width = font::width(&label, scale);
        let left = (place * (bar_width - label_width.min(bar_width)) as f32) as u32;
        font::draw(image, pad + left, bar_top + line, scale, &label, LETTERS);
    }
}

fn draw_bar(image: &mut Image, ramp: Ramp, left: u32, top: u32, width: u32, height: u32) {
    for x in 0..width {
        let place = x as f32 / (width - 1).max(1) as f32;
        image.fill(left + x, top, 1, height, ramp.color(place));
    }
}

#[cfg(test)]
mod tests {
    use super::{NOTHING, Ramp, measure, number, paint, round_up};
    use crate::color;

    #[test]
    fn scales_end_at_round_numbers() {
        let ends = [0.0, 0.7, 1.0, 1.1, 3.0, 17.0, 51.0, 1000.0, 1001.0].map(round_up);
        assert_eq!(ends, [1.0, 1.0, 1.0, 2.0, 5.0, 20.0, 100.0, 1000.0, 2000.0]);
        let mut values = vec![3.0; 999];
        values.push(500.0);
        values.push(f32::INFINITY);
        let (end, mean, max) = measure(&values).unwrap();
        assert_eq!((end, max), (5.0, 500.0));
        assert!((mean - 3.497).abs() < 1e-4);
        assert_eq!(measure(&[]).unwrap(), (1.0, 0.0, 0.0));
    }

    #[test]
    fn numbers_are_short() {
        let numbers = [0.0, 0.25, 1.5, 12.34, 100.0, 9999.0, 12_345.0, 2.5e6, 3e-7].map(number);
        assert_eq!(
            numbers,
            ["0", "0.250", "1.50", "12.3", "100", "9999", "12.3K", "2.50M", "3.0E-7"]
        );
    }

    #[test]
    fn heat_grows_lighter() {
        let lightness = |place: f32| {
            let linear = Ramp::Heat.color(place).map(|c| libm::powf(f32::from(c) / 255.0, 2.2));
            libm::cbrtf(color::luminance(linear))
        };
        let steps: Vec<_> = (0..=60).map(|i| lightness(i as f32 / 60.0)).collect();
        assert!(steps.windows(2).all(|pair| pair[0] < pair[1]), "{steps:?}");
    }

    #[test]
    fn every_size_is_painted() {
        for (width, height) in
            [(1, 1), (3, 40), (20, 10), (60, 60), (96, 64), (640, 360), (4000, 20)]
        {
            let mut values = vec![1.0; width as usize * height as usize];
            values[0] = f32::INFINITY;
            let image = paint(&values, width, height, Ramp::Heat, "NODES A RAY").unwrap();
            assert_eq!(image.pixels()[0], NOTHING, "{width}x{height}");
        }
    }
}
