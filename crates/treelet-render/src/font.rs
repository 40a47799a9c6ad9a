//! A tiny bitmap font, three by five pixels a letter: enough to label a scale.

use crate::image::Image;

/// Columns and rows of a letter, and the columns from one letter to the next.
const COLUMNS: u32 = 3;
const ROWS: u32 = 5;
const ADVANCE: u32 = 4;

/// A letter as five octal digits, a row each from the top, the left column in the highest bit.
/// Lower case is drawn as upper case, what is not here as a space.
fn glyph(letter: char) -> u32 {
    match letter.to_ascii_uppercase() {
        '0' => 0o75557,
        '1' => 0o26227,
        '2' => 0o71747,
        '3' => 0o71717,
        '4' => 0o55711,
        '5' => 0o74717,
        '6' => 0o74757,
        '7' => 0o71122,
        '8' => 0o75757,
        '9' => 0o75717,
        'A' => 0o25755,
        'B' => 0o65656,
        'C' => 0o34443,
        'D' => 0o65556,
        'E' => 0o74647,
        'F' => 0o74644,
        'G' => 0o34553,
        'H' => 0o55755,
        'I' => 0o72227,
        'J' => 0o11152,
        'K' => 0o55655,
        'L' => 0o44447,
        'M' => 0o57755,
        'N' => 0o65555,
        'O' => 0o25552,
        'P' => 0o65644,
        'Q' => 0o25563,
        'R' => 0o65655,
        'S' => 0o34216,
        'T' => 0o72222,
        'U' => 0o55557,
        'V' => 0o55552,
        'W' => 0o55775,
        'X' => 0o55255,
        'Y' => 0o55222,
        'Z' => 0o71247,
        '.' => 0o00002,
        '-' => 0o00700,
        '+' => 0o02720,
        _ => 0,
    }
}

/// How wide a text is, in pixels, with letters enlarged `scale` times.
pub(crate) fn width(text: &str, scale: u32) -> u32 {
    let letters = text.chars().count() as u32;
    (letters * ADVANCE).saturating_sub(ADVANCE - COLUMNS) * scale
}

/// How high a text is, in pixels.
pub(crate) fn height(scale: u32) -> u32 {
    ROWS * scale
}

/// Draws a text with its upper left corner at column `x`, row `y`; what is outside is cut off.
pub(crate) fn draw(image: &mut Image, x: u32, y: u32, scale: u32, text: &str, color: [u8; 3]) {
    for (i, letter) in text.chars().enumerate() {
        let bits = glyph(letter);
        let left = x + i as u32 * ADVANCE * scale;
        for row in 0..ROWS {
            for column in 0..COLUMNS {
                let bit = 3 * (ROWS - 1 - row) + (COLUMNS - 1 - column);
                if bits >> bit & 1 == 1 {
                    let (left, top) = (left + column * scale, y + row * scale);
                    image.fill(left, top, scale, scale, color);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{draw, width};
    use crate::image::Image;

    #[test]
    fn letters_are_upright_and_not_mirrored() {
        let mut image = Image::filled(7, 5, [0; 3]).unwrap();
        draw(&mut image, 0, 0, 1, "L7", [1; 3]);
        let rows: Vec<String> = image
            .pixels()
            .chunks(7)
            .map(|row| row.iter().map(|p| if p[0] == 1 { '#' } else { '.' }).collect())
            .collect();
        assert_eq!(rows, ["#...###", "#.....#", "#.....#", "#....#.", "###..#."]);
        assert_eq!(width("L7", 1), 7);
        assert_eq!(width("", 3), 0);
    }
}
