//! Animated PNG, written frame by frame.
//!
//! After the "Portable Network Graphics (PNG) Specification (Third Edition)", W3C, section 11.3.5
//! (`acTL`, `fcTL`, `fdAT`). Frames are whole PNG files, whose compressed bytes are taken over. How many
//! there are is known at the end only, and then written where it belongs.

use std::io::{self, Seek, SeekFrom, Write};

/// What every PNG begins with.
const SIGNATURE: [u8; 8] = *b"\x89PNG\r\n\x1a\n";

/// Bytes of a chunk around its data: length and name before it, a checksum behind.
const HEAD: usize = 8;
const CHECKSUM: usize = 4;

/// A picture that moves, in the making.
pub(super) struct Apng<W> {
    out: W,
    /// The seconds of a frame, as a fraction.
    delay: [u16; 2],
    /// Where the chunk is that tells how many frames there are.
    count_at: u64,
    frames: u32,
    /// Numbers of the chunks that belong to the animation.
    sequence: u32,
}

impl<W: Write + Seek> Apng<W> {
    /// Nothing is written yet.
    pub(super) fn new(out: W, fps: f64) -> Self {
        Self { out, delay: delay(fps), count_at: 0, frames: 0, sequence: 0 }
    }

    /// Adds a frame: a PNG of the size and kind of the first.
    pub(super) fn push(&mut self, png: &[u8]) -> io::Result<()> {
        let odd = || io::Error::new(io::ErrorKind::InvalidData, "a frame is no PNG");
        let is_first = self.frames == 0;
        if is_first {
            self.out.write_all(&SIGNATURE)?;
        }
        let mut rest = png.strip_prefix(&SIGNATURE).ok_or_else(odd)?;
        while let Some((head, tail)) = rest.split_first_chunk::<HEAD>() {
            let [a, b, c, d, name @ ..] = *head;
            let len = u32::from_be_bytes([a, b, c, d]) as usize;
            let data = tail.get(..len).ok_or_else(odd)?;
            rest = tail.get(len + CHECKSUM..).ok_or_else(odd)?;
            match &name {
                b"IHDR" if is_first => {
                    self.chunk(&name, &[data])?;
                    self.count_at = self.out.stream_position()?;
                    self.write_count()?;
                }
                b"IHDR" => {}
                b"IDAT" if is_first => self.chunk(&name, &[data])?,
                b"IDAT" => {
                    let number = self.number();
                    self.chunk(b"fdAT", &[&number, data])?;
                }
                b"IEND" => {}
                // Colour spaces and the like; the first frame speaks for all.
                _ if is_first => self.chunk(&name, &[data])?,
                _ => {}
            }
            // The frame's own chunk stands before the first of its bytes.
            let is_next = rest.get(4..HEAD) == Some(b"IDAT");
            if is_next && &name != b"IDAT" {
                self.control(png.get(16..24).ok_or_else(odd)?)?;
            }
        }
        self.frames += 1;
        Ok(())
    }

    /// Ends the picture, and tells how many frames it has.
    pub(super) fn finish(mut self) -> io::Result<u32> {
        self.chunk(b"IEND", &[])?;
        self.out.seek(SeekFrom::Start(self.count_at))?;
        self.write_count()?;
        self.out.flush()?;
        Ok(self.frames)
    }

    /// How many frames there are, to be shown over and over.
    fn write_count(&mut self) -> io::Result<()> {
        let (frames, forever) = (self.frames.to_be_bytes(), [0; 4]);
        self.chunk(b"acTL", &[&frames, &forever])
    }

    /// What a frame of that size, as bytes, does: takes the place of the one before it.
    fn control(&mut self, size: &[u8]) -> io::Result<()> {
        let number = self.number();
        let offset = [0; 8];
        let [seconds, parts] = self.delay.map(u16::to_be_bytes);
        let replace = [0, 0];
        self.chunk(b"fcTL", &[&number, size, &offset, &seconds, &parts, &replace])
    }

    fn number(&mut self) -> [u8; 4] {
        self.sequence += 1;
        (self.sequence - 1).to_be_bytes()
    }

    fn chunk(&mut self, name: &[u8; 4], data: &[&[u8]]) -> io::Result<()> {
        let len: usize = data.iter().map(|piece| piece.len()).sum();
        let len = u32::try_from(len).map_err(io::Error::other)?;
        self.out.write_all(&len.to_be_bytes())?;
        self.out.write_all(name)?;
        let mut sum = checksum(!0, name);
        for piece in data {
            self.out.write_all(piece)?;
            sum = checksum(sum, piece);
        }
        self.out.write_all(&(!sum).to_be_bytes())
    }
}

/// The seconds of a frame as a fraction of numbers that have room in 16 bits.
fn delay(fps: f64) -> [u16; 2] {
    let fraction = [1, 1000, 100, 10].into_iter().find_map(|scale: u16| {
        let parts = fps * f64::from(scale);
        let fits = parts <= f64::from(u16::MAX) && parts >= 1.0;
        let exact = (parts - parts.round()).abs() < 1e-6 || scale != 1;
        (fits && exact).then(|| [scale, parts.round() as u16])
    });
    fraction.unwrap_or([1, (fps.round() as u16).max(1)])
}

/// Goes on with the checksum of PNG's annex D, bit by bit.
fn checksum(sum: u32, bytes: &[u8]) -> u32 {
    /// The polynomial of ISO 3309, its bits reversed.
    const POLYNOMIAL: u32 = 0xedb8_8320;
    bytes.iter().fold(sum, |sum, &byte| {
        (0..8).fold(sum ^ u32::from(byte), |sum, _| {
            (sum >> 1) ^ if sum & 1 == 1 { POLYNOMIAL } else { 0 }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::{checksum, delay};

    #[test]
    fn delays_are_fractions() {
        assert_eq!(delay(24.0), [1, 24]);
        assert_eq!(delay(1000.0), [1, 1000]);
        assert_eq!(delay(29.97), [1000, 29970]);
        assert_eq!(delay(0.5), [1000, 500]);
        assert_eq!(delay(99.5), [100, 9950]);
    }

    #[test]
    fn checksums_are_those_of_png() {
        // The end of every PNG.
        assert_eq!(!checksum(!0, b"IEND"), 0xae42_6082);
    }
}
