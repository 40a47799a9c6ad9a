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
    use base64::Engine as _;
    use base64::engine::general_purpose::STANDARD;
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

    /// The kitty documentation: each piece is an escape of its own; all but the last hold 4096
    /// characters of base64 and say `m=1`; the first alone has the other keys.
    #[test]
    fn kitty_goes_in_pieces() {
        for length in [0_usize, 1, 3072, 3073, 10_000] {
            let png: Vec<u8> = (0..length).map(|i| (i * 7) as u8).collect();
            let text = kitty(&png);
            let stream = text.strip_suffix('\n').unwrap();
            let pieces: Vec<&str> = stream.split_terminator("\x1b\\").collect();
            let mut payload = String::new();
            for (number, piece) in pieces.iter().enumerate() {
                let (keys, data) = piece.strip_prefix("\x1b_G").unwrap().split_once(';').unwrap();
                let last = number + 1 == pieces.len();
                let first = if number == 0 { "a=T,f=100," } else { "" };
                assert_eq!(keys, format!("{first}m={}", u8::from(!last)), "{length}: {number}");
                assert!(last && data.len() <= 4096 || data.len() == 4096, "{length}: {number}");
                payload += data;
            }
            assert_eq!(STANDARD.decode(payload).unwrap(), png);
        }
    }

    /// The iTerm2 documentation: OSC 1337, the file's size in bytes, base64, BEL.
    #[test]
    fn iterm_is_one_sequence() {
        let png: Vec<u8> = (0..10_000).map(|i| (i * 7) as u8).collect();
        let text = iterm(&png);
        let body = text.strip_prefix("\x1b]1337;File=").unwrap().strip_suffix("\x07\n").unwrap();
        let (keys, data) = body.split_once(':').unwrap();
        assert_eq!(keys, "inline=1;size=10000");
        assert_eq!(STANDARD.decode(data).unwrap(), png);
    }

    /// A sixel terminal in miniature: colours by number in percent, six rows a character, repeats, back to
    /// the left edge, down. Every pixel is painted once, near its colour.
    #[test]
    fn sixel_paints_every_pixel() {
        let mut image = Image::filled(37, 13, [0; 3]).unwrap();
        for (i, pixel) in image.pixels_mut().iter_mut().enumerate() {
            *pixel = [(i % 37 * 6) as u8, (i / 37 * 19) as u8, 90];
        }
        let text = sixel(&image);
        let body = text.strip_prefix("\x1bPq").unwrap().strip_suffix("\x1b\\\n").unwrap();
        let mut bytes = body.bytes().peekable();
        let numbers = |bytes: &mut std::iter::Peekable<std::str::Bytes<'_>>| {
            let (mut all, mut number) = (Vec::new(), 0_u32);
            while let Some(&byte) = bytes.peek().filter(|b| b.is_ascii_digit() || **b == b';') {
                bytes.next();
                if byte == b';' {
                    all.push(std::mem::take(&mut number));
                } else {
                    number = 10 * number + u32::from(byte - b'0');
                }
            }
            all.push(number);
            all
        };
        let mut colors = std::collections::BTreeMap::new();
        let mut painted = vec![None; 37 * 13];
        let (mut x, mut top, mut color, mut repeat) = (0, 0, 0, 1);
        while let Some(byte) = bytes.next() {
            match byte {
                b'"' => assert_eq!(numbers(&mut bytes), [1, 1, 37, 13]),
                b'#' => match numbers(&mut bytes).as_slice() {
                    [number] => color = *number,
                    &[number, 2, r, g, b] => {
                        assert!(number < 256 && r <= 100 && g <= 100 && b <= 100);
                        colors.insert(number, [r, g, b]);
                    }
                    other => panic!("{other:?}"),
                },
                b'!' => repeat = numbers(&mut bytes)[0] as usize,
                b'$' => x = 0,
                b'-' => (x, top) = (0, top + 6),
                b'?'..=b'~' => {
                    for column in x..x + repeat {
                        for row in (0..6).filter(|row| (byte - b'?') >> row & 1 == 1) {
                            let place = &mut painted[(top + row) * 37 + column];
                            assert_eq!(place.replace(colors[&color]), None, "painted twice");
                        }
                    }
                    (x, repeat) = (x + repeat, 1);
                }
                other => panic!("{other} is no sixel"),
            }
        }
        for (pixel, painted) in image.pixels().iter().zip(painted) {
            let painted = painted.expect("every pixel is painted");
            for c in 0..3 {
                let off = f64::from(pixel[c]) - 2.55 * f64::from(painted[c]);
                assert!(off.abs() <= 52.0, "{pixel:?} {painted:?}");
            }
        }
    }

    #[test]
    fn shrinking_takes_means() {
        let small = shrunk(&picture(), 3);
        assert_eq!((small.width(), small.height()), (3, 1));
        assert_eq!(small.pixels()[0], [255, 0, 0]);
        assert!(small.pixels()[1][0] > 0 && small.pixels()[1][2] > 0);
    }
}
