//! Pictures in terminals: the protocols of kitty, iTerm2 and sixel, or half blocks in 24-bit colour
//! where nothing better is known.
//!
//! Sources: "Terminal graphics protocol", kitty documentation; "Inline Images Protocol", iTerm2
//! documentation; "VT330/VT340 Programmer Reference Manual", volume 2, chapter 14 (sixel).

use std::io::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use clap::ValueEnum;
use treelet_render::Image;

use crate::ending::Failure;

/// How a terminal takes pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Protocol {
    /// What the terminal's name says it understands.
    Auto,
    Kitty,
    Iterm,
    Sixel,
    /// Two pixels a character: every terminal with 24-bit colours.
    Blocks,
}

/// Columns of half blocks where the terminal does not say how wide it is.
const COLUMNS: u32 = 80;

/// The most columns of pixels that sixel terminals are sent: older ones draw no more.
const SIXEL_WIDTH: u32 = 800;

/// Draws a picture on stderr, where all that is for people goes.
pub(crate) fn draw(image: &Image, protocol: Protocol) -> Result<(), Failure> {
    let variable = |name: &str| std::env::var(name).ok();
    let text = match protocol {
        Protocol::Auto => return draw(image, guess(&variable)),
        Protocol::Kitty => kitty(&image.encode_png()?),
        Protocol::Iterm => iterm(&image.encode_png()?),
        Protocol::Sixel => sixel(&shrunk(image, SIXEL_WIDTH)),
        Protocol::Blocks => {
            let columns = variable("COLUMNS").and_then(|columns| columns.parse().ok());
            blocks(&shrunk(image, columns.unwrap_or(COLUMNS).max(2)))
        }
    };
    let mut stderr = std::io::stderr().lock();
    // A terminal that went away is not our failure.
    drop(stderr.write_all(text.as_bytes()).and_then(|()| stderr.flush()));
    Ok(())
}

/// The protocol of a terminal, by the variables that it sets.
fn guess(variable: &dyn Fn(&str) -> Option<String>) -> Protocol {
    let has = |name: &str, part: &str| variable(name).is_some_and(|value| value.contains(part));
    let program = |name: &str| has("TERM_PROGRAM", name);
    if has("TERM", "kitty") || has("TERM", "ghostty") || variable("KITTY_WINDOW_ID").is_some() {
        Protocol::Kitty
    } else if program("iTerm") || program("WezTerm") || program("mintty") || program("vscode") {
        Protocol::Iterm
    } else if ["foot", "mlterm", "sixel", "contour"].iter().any(|name| has("TERM", name)) {
        Protocol::Sixel
    } else {
        Protocol::Blocks
    }
}

/// The PNG in pieces of at most 4096 characters.
fn kitty(png: &[u8]) -> String {
    let encoded = STANDARD.encode(png);
    let mut text = String::new();
    let pieces = encoded.as_bytes().chunks(4096);
    let last = pieces.len().saturating_sub(1);
    for (number, piece) in pieces.enumerate() {
        let first = if number == 0 { "a=T,f=100," } else { "" };
        let more = u8::from(number < last);
        // Base64 is ASCII.
        let piece = String::from_utf8_lossy(piece);
        text += &format!("\x1b_G{first}m={more};{piece}\x1b\\");
    }
    text + "\n"
}

fn iterm(png: &[u8]) -> String {
    let size = png.len();
    format!("\x1b]1337;File=inline=1;size={size}:{}\x07\n", STANDARD.encode(png))
}

/// Six rows at a time, a colour at a time, out of a cube of 6 by 6 by 6 colours; what rounding takes
/// away is passed on to the right.
fn sixel(image: &Image) -> String {
    const STEPS: u32 = 5;
    let (width, height) = (image.width() as usize, image.height() as usize);
    let mut text = format!("\x1bPq\"1;1;{width};{height}");
    for color in 0..216_u32 {
        let [r, g, b] = [color / 36, color / 6 % 6, color % 6].map(|c| c * 100 / STEPS);
        text += &format!("#{color};2;{r};{g};{b}");
    }
    let mut indexed = vec![0_u8; width * height];
    for (row, out) in image.pixels().chunks(width).zip(indexed.chunks_mut(width)) {
        let mut carried = [0_i32; 3];
        for (pixel, out) in row.iter().zip(out) {
            let mut color = 0;
            for c in 0..3 {
                let wanted = i32::from(pixel[c]) + carried[c];
                let step = ((wanted * 5 + 127) / 255).clamp(0, 5);
                carried[c] = wanted - step * 51;
                color = color * 6 + step;
            }
            *out = color as u8;
        }
    }
    for band in 0..height.div_ceil(6) {
        let rows = band * 6..(band * 6 + 6).min(height);
        let mut used = [false; 216];
        for row in rows.clone() {
            indexed[row * width..][..width].iter().for_each(|&c| used[usize::from(c)] = true);
        }
        for color in (0..216).filter(|&color| used[color]) {
            text += &format!("#{color}");
            let cell = |x: usize| {
                let bits = rows.clone().enumerate().map(|(bit, row)| {
                    u8::from(usize::from(indexed[row * width + x]) == color) << bit
                });
                bits.sum::<u8>() + b'?'
            };
            let mut x = 0;
            while x < width {
                let sixel = cell(x);
                let run = (x..width).take_while(|&x| cell(x) == sixel).count();
                let sixel = char::from(sixel);
                if run > 3 {
                    text += &format!("!{run}{sixel}");
                } else {
                    text.extend(std::iter::repeat_n(sixel, run));
                }
                x += run;
            }
            text.push('$');
        }
        text.push('-');
    }
    text + "\x1b\\\n"
}

/// Upper half blocks: the character's colour above, its background below.
fn blocks(image: &Image) -> String {
    let width = image.width() as usize;
    let mut text = String::new();
    for pair in image.pixels().chunks(2 * width) {
        let (above, below) = pair.split_at(width.min(pair.len()));
        for (x, [r, g, b]) in above.iter().enumerate() {
            let [s, t, u] = below.get(x).copied().unwrap_or([0; 3]);
            text += &format!("\x1b[38;2;{r};{g};{b};48;2;{s};{t};{u}m\u{2580}");
        }
        text += "\x1b[0m\n";
    }
    text
}

/// The picture with at most so many columns, and rows shrunk alike: means of rectangles.
fn shrunk(image: &Image, columns: u32) -> Image {
    let width = columns.min(image.width());
    let height = u64::from(image.height()) * u64::from(width) / u64::from(image.width());
    let height = u32::try_from(height).unwrap_or(u32::MAX).max(1);
    let Ok(mut out) = Image::filled(width, height, [0; 3]) else { return image.clone() };
    let span = |at: u32, of: u32, side: u32| {
        let edge = |at: u32| (u64::from(at) * u64::from(side) / u64::from(of)) as usize;
        edge(at)..edge(at + 1).max(edge(at) + 1)
    };
    for y in 0..height {
        for x in 0..width {
            let (mut sum, mut count) = ([0_u64; 3], 0);
            for row in span(y, height, image.height()) {
                for column in span(x, width, image.width()) {
                    let pixel = image.pixels()[row * image.width() as usize + column];
                    (0..3).for_each(|c| sum[c] += u64::from(pixel[c]));
                    count += 1;
                }
            }
            out.set(x, y, sum.map(|sum| (sum / count) as u8));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::{Protocol, blocks, guess, iterm, kitty, shrunk, sixel};
    use treelet_render::Image;

    fn picture() -> Image {
        let mut image = Image::filled(20, 7, [255, 0, 0]).unwrap();
        image.fill(10, 0, 10, 7, [0, 0, 255]);
        image
    }

    #[test]
    fn terminals_are_told_apart() {
        let with = |name: &'static str, value: &'static str| {
            guess(&move |asked: &str| (asked == name).then(|| value.to_owned()))
        };
        assert_eq!(with("TERM", "xterm-kitty"), Protocol::Kitty);
        assert_eq!(with("KITTY_WINDOW_ID", "1"), Protocol::Kitty);
        assert_eq!(with("TERM_PROGRAM", "iTerm.app"), Protocol::Iterm);
        assert_eq!(with("TERM", "foot"), Protocol::Sixel);
        assert_eq!(with("TERM", "xterm-256color"), Protocol::Blocks);
    }

    #[test]
    fn blocks_are_two_pixels_each() {
        let text = blocks(&picture());
        assert_eq!(text.matches('\u{2580}').count(), 20 * 4);
        assert_eq!(text.lines().count(), 4);
        assert!(text.starts_with("\x1b[38;2;255;0;0;48;2;255;0;0m"));
        assert!(text.contains("38;2;0;0;255;48;2;0;0;0m"), "below the last row it is black");
    }

    #[test]
    fn sixel_is_whole() {
        let text = sixel(&picture());
        assert!(text.starts_with("\x1bPq\"1;1;20;7") && text.ends_with("\x1b\\\n"));
        // Two bands of two colours: 10 of all six rows, then 10 of one.
        assert!(text.contains("#5!10?!10~$#180!10~!10?$-"), "{text}");
        assert!(text.contains("#5!10?!10@$#180!10@!10?$-"), "{text}");
    }

    #[test]
    fn kitty_goes_in_pieces() {
        let text = kitty(&[7; 10_000]);
        assert_eq!(text.matches("\x1b_G").count(), 4);
        assert!(text.starts_with("\x1b_Ga=T,f=100,m=1;") && text.contains("\x1b_Gm=0;"));
        assert!(iterm(b"png").contains("size=3:cG5n\x07"));
    }

    #[test]
    fn shrinking_takes_means() {
        let small = shrunk(&picture(), 3);
        assert_eq!((small.width(), small.height()), (3, 1));
        assert_eq!(small.pixels()[0], [255, 0, 0]);
        assert!(small.pixels()[1][0] > 0 && small.pixels()[1][2] > 0);
    }
}
