//! Lines, words and numbers of text formats, on bytes: nothing here minds what is not UTF-8.

use memchr::memchr;

use crate::error::{Fault, quote};

/// Lines of a text and their numbers, without their ends.
///
/// Lines end in LF or CR LF, or in CR where the text has no LF at all.
#[derive(Clone, Debug)]
pub(crate) struct Lines<'a> {
    rest: &'a [u8],
    end: u8,
    /// Number of the line that [`Lines::next`] gave last; 0 before the first.
    pub(crate) number: u64,
}

impl<'a> Lines<'a> {
    pub(crate) fn new(text: &'a [u8]) -> Self {
        let text = without_bom(text);
        let old_mac = memchr(b'\n', text).is_none() && memchr(b'\r', text).is_some();
        Self { rest: text, end: if old_mac { b'\r' } else { b'\n' }, number: 0 }
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        self.number += 1;
        let (line, rest) = match memchr(self.end, self.rest) {
            Some(at) => (&self.rest[..at], &self.rest[at + 1..]),
            None => (self.rest, &[][..]),
        };
        self.rest = rest;
        Some(line.strip_suffix(b"\r").unwrap_or(line))
    }
}

/// Words of a line, parted by blanks; a word that starts with `#` ends the line.
#[derive(Clone, Debug)]
pub(crate) struct Words<'a>(pub(crate) &'a [u8]);

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    #[inline]
    fn next(&mut self) -> Option<&'a [u8]> {
        let line = self.0;
        let start = line.iter().position(|&b| !is_blank(b))?;
        let line = &line[start..];
        if line[0] == b'#' {
            self.0 = &[];
            return None;
        }
        let end = line.iter().position(|&b| is_blank(b)).unwrap_or(line.len());
        let (word, rest) = line.split_at(end);
        self.0 = rest;
        Some(word)
    }
}

/// Space, tab, and what stray line ends leave behind.
#[inline(always)]
pub(crate) fn is_blank(byte: u8) -> bool {
    byte == b' ' || byte.is_ascii_control()
}

/// The text after its byte order mark, if it has one.
pub(crate) fn without_bom(text: &[u8]) -> &[u8] {
    text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text)
}

/// Refuses text in UTF-16, which every text format here would misread byte by byte.
pub(crate) fn refuse_utf16(text: &[u8]) -> Result<(), Fault> {
    let name = match text {
        [0xff, 0xfe, ..] => "UTF-16LE",
        [0xfe, 0xff, ..] => "UTF-16BE",
        _ => return Ok(()),
    };
    Err(Fault::unsupported(
        format!("is text in UTF-16 (its byte order mark says {name})"),
        format!("save it as UTF-8: iconv -f {name} -t UTF-8 OLD > NEW"),
    ))
}

/// A number as Rust or C spell it: decimal, hexadecimal, infinite or not a number at all (`nan`).
///
/// Decimal numbers are correctly rounded; hexadecimal ones to f64 first, then to f32, after losing
/// the digits that f64 does not hold. A decimal comma is no number.
#[inline]
pub(crate) fn real(word: &[u8]) -> Option<f32> {
    let text = str::from_utf8(word).ok()?;
    match text.parse() {
        Ok(value) => Some(value),
        Err(_) => odd_real(text),
    }
}

/// A number in double precision, as [`real`] reads them.
pub(crate) fn double(word: &[u8]) -> Option<f64> {
    let text = str::from_utf8(word).ok()?;
    text.parse().ok().or_else(|| real(word).map(f64::from))
}

/// The fault of a word that should have been a number.
#[cold]
pub(crate) fn no_number(word: Option<&[u8]>, what: &str) -> Fault {
    match word {
        None => Fault::broken(format!("{what} is missing"), "add it, or export the file again"),
        Some(word) if word.contains(&b',') => Fault::broken(
            format!("{what} is {}, not a number", quote(word)),
            "write a decimal point instead of a comma",
        ),
        Some(word) => Fault::broken(
            format!("{what} is {}, not a number", quote(word)),
            "write it as in 0.125, -3 or 1.25e-1",
        ),
    }
}

/// The spellings that C programs print and Rust does not read.
#[cold]
fn odd_real(text: &str) -> Option<f32> {
    let (sign, rest) = match text.as_bytes().first()? {
        b'-' => (-1.0, &text[1..]),
        b'+' => (1.0, &text[1..]),
        _ => (1.0, text),
    };
    let lower = rest.to_ascii_lowercase();
    // Old Microsoft run-time libraries print `1.#INF`, `1.#QNAN`, `-1.#IND00`.
    if let Some(rest) = lower.strip_prefix("1.#") {
        let value = if rest.starts_with("inf") { f32::INFINITY } else { f32::NAN };
        let known = ["inf", "qnan", "snan", "ind"].iter().any(|name| rest.starts_with(name));
        return known.then_some(sign * value);
    }
    // C99 lets `nan` carry a payload, newer Microsoft libraries print `nan(ind)`.
    if lower.starts_with("nan(") && lower.ends_with(')') {
        return Some(f32::NAN);
    }
    if let Some(hexadecimal) = lower.strip_prefix("0x") {
        return self::hexadecimal(hexadecimal).map(|value| sign * value as f32);
    }
    // Some writers put the exponent's sign before its letter, as in `3.1+e2`.
    let (mantissa, exponent) = lower.split_once('e')?;
    let (mantissa, exponent_sign) = match mantissa.as_bytes().last()? {
        b'+' => (&mantissa[..mantissa.len() - 1], ""),
        b'-' => (&mantissa[..mantissa.len() - 1], "-"),
        _ => return None,
    };
    let is_plain = mantissa.starts_with(|c: char| c.is_ascii_digit())
        && exponent.bytes().all(|digit| digit.is_ascii_digit());
    let value: f32 = format!("{mantissa}e{exponent_sign}{exponent}").parse().ok()?;
    is_plain.then_some(sign * value)
}

/// A C99 hexadecimal number after its `0x`, lower case; digits beyond f64 are cut off.
fn hexadecimal(text: &str) -> Option<f64> {
    let (digits, exponent) = match text.split_once('p') {
        Some((digits, exponent)) => (digits, exponent.parse::<i32>().ok()?),
        None => (text, 0),
    };
    let (whole, part) = digits.split_once('.').unwrap_or((digits, ""));
    if whole.is_empty() && part.is_empty() {
        return None;
    }
    let mut value = 0.0;
    for digit in whole.chars().chain(part.chars()) {
        value = value * 16.0 + f64::from(digit.to_digit(16)?);
    }
    let places = i32::try_from(part.len()).ok()?;
    Some(libm::scalbn(value, exponent.saturating_sub(places.saturating_mul(4))))
}

/// A whole number, with or without a sign.
#[inline]
pub(crate) fn integer(word: &[u8]) -> Option<i64> {
    let (negative, digits) = match word {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, word),
    };
    if digits.is_empty() {
        return None;
    }
    let mut value = 0_i64;
    for &digit in digits {
        let digit = digit.wrapping_sub(b'0');
        if digit > 9 {
            return None;
        }
        value = value.checked_mul(10)?.checked_add(i64::from(digit))?;
    }
    Some(if negative { -value } else { value })
}

#[cfg(test)]
mod tests {
    use super::{Lines, Words, integer, real};

    #[test]
    fn reads_what_rust_and_c_print() {
        let cases = [
            ("1", 1.0),
            ("2.", 2.0),
            (".5", 0.5),
            ("+2.e1", 20.0),
            ("-3.1E+2", -310.0),
            ("1e-2", 0.01),
            ("inf", f32::INFINITY),
            ("-Infinity", f32::NEG_INFINITY),
            ("1.#INF", f32::INFINITY),
            ("-0x1.8p1", -3.0),
            ("0X.8", 0.5),
            ("1e99", f32::INFINITY),
            ("3.1+e2", 310.0),
            ("-2-e1", -0.2),
        ];
        for (text, want) in cases {
            assert_eq!(real(text.as_bytes()), Some(want), "{text}");
        }
        for text in ["nan", "-nan", "NaN", "nan(ind)", "-nan(0x1)", "-1.#IND00", "1.#QNAN"] {
            assert!(real(text.as_bytes()).is_some_and(f32::is_nan), "{text}");
        }
        for text in [
            "", "-", "1,5", "3.1+e", "+e2", "3++e2", "3+e-2", "0x", "0xg", "1.#", "1 2", "--1",
            "e5", "0x1p",
        ] {
            assert_eq!(real(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn integers_do_not_wrap() {
        assert_eq!(integer(b"-12"), Some(-12));
        assert_eq!(integer(b"9223372036854775807"), Some(i64::MAX));
        for text in ["", "-", "9223372036854775808", "1.0", "1a", "0x1"] {
            assert_eq!(integer(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn all_line_ends_count_alike() {
        for text in ["\u{feff}a b\nc", "a b\r\nc\r\n", "a b\rc\r"] {
            let mut lines = Lines::new(text.as_bytes());
            assert_eq!(lines.next(), Some(&b"a b"[..]), "{text:?}");
            assert_eq!(lines.next(), Some(&b"c"[..]), "{text:?}");
            assert_eq!((lines.next(), lines.number), (None, 2), "{text:?}");
        }
        let words: Vec<_> = Words(b" a\tb# c #d e").collect();
        assert_eq!(words, [&b"a"[..], b"b#", b"c"]);
    }
}
