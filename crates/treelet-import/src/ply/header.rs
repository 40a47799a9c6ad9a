//! The header of a PLY file.

use crate::error::{DAMAGED, Place, Result, quote};
use crate::source::Source;

/// How the values are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    BinaryLittle,
    BinaryBig,
}

/// A number type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Type {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Type {
    /// Bytes of a binary value.
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    pub(super) fn is_float(self) -> bool {
        matches!(self, Self::F32 | Self::F64)
    }

    fn of_name(name: &[u8]) -> Option<Self> {
        Some(match name {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }
}

/// What one value, or list of values, of a row is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Scalar(Type),
    List { count: Type, item: Type },
}

/// A column of an element.
#[derive(Clone, Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
}

/// A table of the file.
#[derive(Clone, Debug)]
pub(super) struct Element {
    pub(super) name: String,
    /// Rows, as the header claims.
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
    /// The header line that names it.
    pub(super) line: u64,
}

impl Element {
    /// Index of the first property with one of these names.
    pub(super) fn find(&self, names: &[&str]) -> Option<usize> {
        self.properties.iter().position(|property| names.contains(&&*property.name))
    }

    /// Bytes of a binary row if all rows are alike, that is without lists.
    pub(super) fn fixed_row(&self) -> Option<usize> {
        self.properties.iter().try_fold(0, |sum, property| match property.kind {
            Kind::Scalar(kind) => Some(sum + kind.bytes()),
            Kind::List { .. } => None,
        })
    }
}

/// The tables of a file, and where they start.
#[derive(Clone, Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// Bytes of the header, with the line end of `end_header`.
    pub(super) bytes: usize,
}

/// No honest header is longer; binary junk without line ends is.
const HEADER_MAX: usize = 1 << 20;

/// Reads the header.
pub(super) fn read(source: &Source<'_>) -> Result<Header> {
    let mut lines = HeaderLines::new(source.bytes);
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut number = 0;
    loop {
        number += 1;
        let place = Place::Line(number);
        let Some(line) = lines.next() else {
            return Err(source.broken(place, "the header has no \"end_header\"", DAMAGED));
        };
        let mut words = line.split(|&b| b == b' ' || b == b'\t').filter(|word| !word.is_empty());
        let first = words.next().unwrap_or_default();
        let odd = |found: String| Err(source.broken(Place::Line(number), found, DAMAGED));
        match first {
            b"ply" if number == 1 => {}
            _ if number == 1 => return odd(format!("{} where \"ply\" should stand", quote(line))),
            b"" | b"comment" | b"obj_info" => {}
            b"format" => match words.next() {
                Some(b"ascii") => encoding = Some(Encoding::Ascii),
                Some(b"binary_little_endian") => encoding = Some(Encoding::BinaryLittle),
                Some(b"binary_big_endian") => encoding = Some(Encoding::BinaryBig),
                _ => return odd(format!("{} is no PLY format", quote(line))),
            },
            b"element" => {
                let name = words.next().map(String::from_utf8_lossy);
                let count = words.next().and_then(|word| str::from_utf8(word).ok()?.parse().ok());
                let (Some(name), Some(count)) = (name, count) else {
                    return odd(format!("{} is no element with a name and count", quote(line)));
                };
                if elements.iter().any(|element| element.name == name) {
                    return odd(format!("the element {name:?} comes twice"));
                }
                let properties = Vec::new();
                elements.push(Element { name: name.into(), count, properties, line: number });
            }
            b"property" => {
                let Some(element) = elements.last_mut() else {
                    return odd("a property stands before the first element".to_owned());
                };
                let Some(property) = read_property(&mut words) else {
                    return odd(format!("{} is no property of a known type", quote(line)));
                };
                element.properties.push(property);
            }
            b"end_header" => break,
            _ => return odd(format!("{} is no line of a PLY header", quote(line))),
        }
    }
    let Some(encoding) = encoding else {
        return Err(source.broken(Place::Line(number), "the header has no \"format\"", DAMAGED));
    };
    Ok(Header { encoding, elements, bytes: lines.at })
}

/// Reads what follows the word `property`.
fn read_property<'a>(words: &mut impl Iterator<Item = &'a [u8]>) -> Option<Property> {
    let kind = match words.next()? {
        b"list" => {
            Kind::List { count: Type::of_name(words.next()?)?, item: Type::of_name(words.next()?)? }
        }
        name => Kind::Scalar(Type::of_name(name)?),
    };
    let name = String::from_utf8_lossy(words.next()?).into_owned();
    let counts = !matches!(kind, Kind::List { count, .. } if count.is_float());
    (counts && words.next().is_none()).then_some(Property { name, kind })
}

/// Lines that end in LF, CR LF or CR, as the first one does: after the header comes binary data,
/// so no line end may be guessed.
struct HeaderLines<'a> {
    bytes: &'a [u8],
    at: usize,
    end: &'static [u8],
}

impl<'a> HeaderLines<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        let first = bytes.iter().position(|&b| b == b'\n' || b == b'\r').unwrap_or(bytes.len());
        let end: &[u8] = match bytes[first..] {
            [b'\r', b'\n', ..] => b"\r\n",
            [b'\r', ..] => b"\r",
            _ => b"\n",
        };
        Self { bytes: &bytes[..bytes.len().min(HEADER_MAX)], at: 0, end }
    }

    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = &self.bytes[self.at..];
        let len = memchr::memmem::find(rest, self.end)?;
        self.at += len + self.end.len();
        let line = &rest[..len];
        Some(line.strip_suffix(b"\r").unwrap_or(line))
    }
}
