//! The rows of PLY elements, value by value, for the three encodings.

use crate::error::{DAMAGED, ImportError, Place, Result};
use crate::source::Source;
use crate::text;

use super::header::{Element, Kind, Type};

/// A place in the body of a file, from which values are read in order.
pub(super) trait Rows<'a>: Clone {
    /// Whether values are fixed-size little-endian bytes, so that [`Rows::take`] is of use.
    const LITTLE_ENDIAN: bool;

    /// Bytes that the very last value of the file may lack: a text may end without a blank.
    const LACKING: u64;

    /// The next value, as the nearest f64.
    fn value(&mut self, kind: Type) -> Result<f64>;

    /// The next `len` bytes, in an encoding that knows how long a row is.
    fn take(&mut self, len: usize) -> Option<&'a [u8]>;

    /// Ends a row.
    fn end_row(&mut self) -> Result<()>;

    /// Bytes that are left.
    fn rest(&self) -> u64;

    /// The fewest bytes that a row may take; in a text a value is a digit and a blank.
    fn smallest_row(element: &Element) -> u64;

    /// The fewest bytes that `count` values may take.
    fn smallest_values(count: u64, kind: Type) -> u64;

    /// Where the next value stands. Costs a look at all that was read, so for errors only.
    fn place(&self) -> Place;

    /// The file.
    fn source(&self) -> &Source<'a>;

    /// Compares the rows that the header claims with the bytes that are left.
    fn check_room(&self, element: &Element) -> Result<()> {
        let needed = element.count.saturating_mul(Self::smallest_row(element));
        if needed <= self.rest() + Self::LACKING {
            return Ok(());
        }
        let Element { name, count, line, .. } = element;
        let rest = self.rest();
        Err(self.source().broken(
            Place::Line(*line),
            format!("{count} rows of {name:?} need at least {needed} bytes, {rest} are left"),
            DAMAGED,
        ))
    }

    /// The next value as a list length, compared with the bytes that are left.
    fn list_len(&mut self, count: Type, item: Type) -> Result<usize> {
        // Only an error needs to know the place: in a text it takes counting all lines before.
        let start = self.clone();
        let len = self.value(count)?;
        if len >= 0.0 && Self::smallest_values(len as u64, item) <= self.rest() + Self::LACKING {
            return Ok(len as usize);
        }
        let found = format!("a list of {len} values, with {} bytes left", self.rest());
        Err(self.source().broken(start.place(), found, DAMAGED))
    }

    /// Steps over a value or list.
    fn skip_kind(&mut self, kind: Kind) -> Result<()> {
        match kind {
            Kind::Scalar(kind) => self.value(kind).map(drop),
            Kind::List { count, item } => {
                let len = self.list_len(count, item)?;
                (0..len).try_for_each(|_| self.value(item).map(drop))
            }
        }
    }

    /// Steps over all rows of an element.
    fn skip(&mut self, element: &Element) -> Result<()> {
        // Rows without values take no time, however many are claimed.
        if element.properties.is_empty() {
            return Ok(());
        }
        for row in 0..element.count {
            if row.is_multiple_of(POLL_ROWS) {
                self.source().check_cancelled()?;
            }
            for property in &element.properties {
                self.skip_kind(property.kind)?;
            }
            self.end_row()?;
        }
        Ok(())
    }
}

/// Rows between two looks at the caller's flag.
pub(super) const POLL_ROWS: u64 = 1 << 14;

/// Values as little- or big-endian bytes.
#[derive(Clone)]
pub(super) struct Binary<'s, 'a, const BIG: bool> {
    source: &'s Source<'a>,
    at: usize,
    /// Where in the file the bytes of the source start.
    base: u64,
}

impl<'s, 'a, const BIG: bool> Binary<'s, 'a, BIG> {
    pub(super) fn new(source: &'s Source<'a>, at: usize) -> Self {
        Self { source, at, base: 0 }
    }

    /// Rows of a part of the file that starts at byte `base` of it.
    pub(super) fn of_part(source: &'s Source<'a>, base: u64) -> Self {
        Self { source, at: 0, base }
    }

    #[cold]
    fn ended(&self) -> ImportError {
        self.source.broken(self.place(), "the file ends inside an element", DAMAGED)
    }

    #[inline(always)]
    fn array<const N: usize>(&mut self) -> Result<[u8; N]> {
        let Some(bytes) = self.source.bytes.get(self.at..).and_then(|rest| rest.first_chunk())
        else {
            return Err(self.ended());
        };
        self.at += N;
        let mut bytes: [u8; N] = *bytes;
        if BIG {
            bytes.reverse();
        }
        Ok(bytes)
    }
}

impl<'a, const BIG: bool> Rows<'a> for Binary<'_, 'a, BIG> {
    const LITTLE_ENDIAN: bool = !BIG;
    const LACKING: u64 = 0;

    #[inline]
    fn value(&mut self, kind: Type) -> Result<f64> {
        Ok(match kind {
            Type::I8 => f64::from(i8::from_le_bytes(self.array()?)),
            Type::U8 => f64::from(u8::from_le_bytes(self.array()?)),
            Type::I16 => f64::from(i16::from_le_bytes(self.array()?)),
            Type::U16 => f64::from(u16::from_le_bytes(self.array()?)),
            Type::I32 => f64::from(i32::from_le_bytes(self.array()?)),
            Type::U32 => f64::from(u32::from_le_bytes(self.array()?)),
            Type::F32 => f64::from(f32::from_le_bytes(self.array()?)),
            Type::F64 => f64::from_le_bytes(self.array()?),
        })
    }

    fn take(&mut self, len: usize) -> Option<&'a [u8]> {
        let end = self.at.checked_add(len)?;
        let bytes = self.source.bytes.get(self.at..end)?;
        self.at = end;
        Some(bytes)
    }

    fn end_row(&mut self) -> Result<()> {
        Ok(())
    }

    fn rest(&self) -> u64 {
        (self.source.bytes.len() - self.at) as u64
    }

    fn smallest_row(element: &Element) -> u64 {
        let size = |kind: Kind| match kind {
            Kind::Scalar(kind) => kind.bytes(),
            Kind::List { count, .. } => count.bytes(),
        };
        element.properties.iter().map(|property| size(property.kind) as u64).sum()
    }

    fn smallest_values(count: u64, kind: Type) -> u64 {
        count.saturating_mul(kind.bytes() as u64)
    }

    fn place(&self) -> Place {
        Place::Byte(self.base + self.at as u64)
    }

    fn source(&self) -> &Source<'a> {
        self.source
    }
}

/// Values as words, a row to a line. Blank lines are stepped over; words beyond the row's values
/// are ignored.
#[derive(Clone)]
pub(super) struct Ascii<'s, 'a> {
    source: &'s Source<'a>,
    at: usize,
}

impl<'s, 'a> Ascii<'s, 'a> {
    pub(super) fn new(source: &'s Source<'a>, at: usize) -> Self {
        let mut rows = Self { source, at };
        rows.skip_while(text::is_blank);
        rows
    }

    fn skip_while(&mut self, condition: impl Fn(u8) -> bool) {
        let rest = self.source.bytes.get(self.at..).unwrap_or_default();
        self.at += rest.iter().position(|&b| !condition(b)).unwrap_or(rest.len());
    }

    /// The next word of this line; `None` at its end.
    #[inline]
    fn word(&mut self) -> Option<&'a [u8]> {
        self.skip_while(|b| text::is_blank(b) && !is_line_end(b));
        let start = self.at;
        self.skip_while(|b| !text::is_blank(b));
        (self.at > start).then(|| &self.source.bytes[start..self.at])
    }

    /// The number of the line at hand; counted only when there is something to say.
    #[cold]
    fn line(&self) -> u64 {
        let before = &self.source.bytes[..self.at];
        let line_ends = memchr::memchr_iter(b'\n', before).count();
        // Files of old Macs have CR alone.
        let line_ends =
            if line_ends > 0 { line_ends } else { memchr::memchr_iter(b'\r', before).count() };
        1 + line_ends as u64
    }
}

fn is_line_end(byte: u8) -> bool {
    byte == b'\n' || byte == b'\r'
}

impl<'a> Rows<'a> for Ascii<'_, 'a> {
    const LITTLE_ENDIAN: bool = false;
    const LACKING: u64 = 1;

    fn value(&mut self, kind: Type) -> Result<f64> {
        let start = self.at;
        let word = self.word();
        let number = word.and_then(|word| {
            if kind.is_float() { None } else { text::integer(word).map(|value| value as f64) }
        });
        // Integers written as 3.0 or 1e3 are fine, too.
        let number = number.or_else(|| text::real(word?).map(f64::from));
        if let Some(number) = number {
            return Ok(number);
        }
        self.at = start;
        Err(self
            .source
            .error(Place::Line(self.line()), text::no_number(word, "a value of the row")))
    }

    fn take(&mut self, _: usize) -> Option<&'a [u8]> {
        None
    }

    fn end_row(&mut self) -> Result<()> {
        self.skip_while(|b| !is_line_end(b));
        self.skip_while(text::is_blank);
        Ok(())
    }

    fn rest(&self) -> u64 {
        (self.source.bytes.len() - self.at) as u64
    }

    fn smallest_row(element: &Element) -> u64 {
        2 * element.properties.len() as u64
    }

    fn smallest_values(count: u64, _: Type) -> u64 {
        count.saturating_mul(2)
    }

    fn place(&self) -> Place {
        Place::Line(self.line())
    }

    fn source(&self) -> &Source<'a> {
        self.source
    }
}
