//! Ascii STL.

use treelet_model::Model;

use crate::error::{DAMAGED, Place, Result, counted, quote};
use crate::polygon::Splitter;
use crate::source::Source;
use crate::text::{self, Lines, Words};

/// So far into the file is looked for a byte that no text has.
const LOOKED_AT: usize = 1 << 10;

/// Whether the file starts as an ascii file does.
pub(super) fn starts_like(bytes: &[u8]) -> bool {
    let text = text::without_bom(bytes).trim_ascii_start();
    let Some((word, rest)) = text.split_at_checked(5) else { return false };
    let head = &rest[..rest.len().min(LOOKED_AT)];
    let ends = rest.first().is_none_or(u8::is_ascii_whitespace);
    word.eq_ignore_ascii_case(b"solid") && ends && !head.contains(&0)
}

/// Lines between two looks at the caller's flag.
const POLL_LINES: u64 = 1 << 14;

/// Reads an ascii file.
pub(super) fn read(source: &Source<'_>) -> Result<Model> {
    let mut reader = Reader {
        source,
        name: None,
        solids: Vec::new(),
        corners: Vec::new(),
        facet: Vec::new(),
        open: Vec::new(),
        splitter: Splitter::new(&source.options.cancel),
        split_facets: 0,
    };
    let mut lines = Lines::new(source.bytes);
    while let Some(line) = lines.next() {
        if lines.number.is_multiple_of(POLL_LINES) {
            source.check_cancelled()?;
        }
        let mut words = Words(line);
        // Several statements may share a line.
        while let Some(word) = words.next() {
            reader.statement(word, &mut words, lines.number)?;
        }
    }
    if let Some(open) = reader.open.last() {
        let found = format!("the file ends before \"{}\"", open.end());
        return Err(source.broken(Place::Line(lines.number), found, DAMAGED));
    }
    let warnings = match reader.split_facets {
        0 => vec![],
        count => {
            let facets = counted(count, "facet has", "facets have");
            vec![format!("{facets} more than three corners; split.")]
        }
    };
    super::model(source, reader.name.unwrap_or_default(), reader.solids, warnings)
}

/// What `end...` closes.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Block {
    Solid,
    Facet,
    Loop,
}

impl Block {
    fn end(self) -> &'static str {
        match self {
            Self::Solid => "endsolid",
            Self::Facet => "endfacet",
            Self::Loop => "endloop",
        }
    }
}

struct Reader<'s, 'a> {
    source: &'s Source<'a>,
    name: Option<String>,
    solids: Vec<Vec<[f32; 3]>>,
    /// Of the solid at hand.
    corners: Vec<[f32; 3]>,
    /// Corners of the loop at hand.
    facet: Vec<[f32; 3]>,
    /// The blocks around the line at hand, outermost first; at most three.
    open: Vec<Block>,
    splitter: Splitter,
    split_facets: u64,
}

impl Reader<'_, '_> {
    /// Takes one statement, whose first word is `word`.
    fn statement(&mut self, word: &[u8], words: &mut Words<'_>, line: u64) -> Result<()> {
        let is = |name: &str| word.eq_ignore_ascii_case(name.as_bytes());
        if is("vertex") {
            return self.vertex(words, line);
        }
        if is("facet") {
            // The normal follows from the corners.
            words.by_ref().take(4).for_each(drop);
            return self.begin(Block::Facet, line);
        }
        if is("outer") {
            words.next();
            return self.begin(Block::Loop, line);
        }
        if is("solid") {
            // The rest of the line is a name and may be anything.
            let name = std::mem::replace(words, Words(&[])).0.trim_ascii();
            self.name.get_or_insert_with(|| String::from_utf8_lossy(name).into_owned());
            return self.begin(Block::Solid, line);
        }
        let Some(block) =
            [Block::Loop, Block::Facet, Block::Solid].into_iter().find(|block| is(block.end()))
        else {
            let found = format!("{} is no statement of ascii STL", quote(word));
            return Err(self.source.broken(Place::Line(line), found, DAMAGED));
        };
        if self.open.pop() != Some(block) {
            let found = format!("\"{}\" with nothing to end", block.end());
            return Err(self.source.broken(Place::Line(line), found, DAMAGED));
        }
        match block {
            Block::Loop => self.end_loop(line),
            Block::Facet => Ok(()),
            Block::Solid => {
                *words = Words(&[]);
                if !self.corners.is_empty() {
                    self.solids.push(std::mem::take(&mut self.corners));
                }
                Ok(())
            }
        }
    }

    /// Opens a block, which must be in its place.
    fn begin(&mut self, block: Block, line: u64) -> Result<()> {
        let outer: &[Block] = match block {
            Block::Solid => &[],
            Block::Facet => &[Block::Solid],
            Block::Loop => &[Block::Solid, Block::Facet],
        };
        if self.open != outer {
            let missing = self.open.last().map_or("solid", |open| open.end());
            let found = format!("\"{missing}\" is missing before this line");
            return Err(self.source.broken(Place::Line(line), found, DAMAGED));
        }
        self.open.push(block);
        self.facet.clear();
        Ok(())
    }

    fn vertex(&mut self, words: &mut Words<'_>, line: u64) -> Result<()> {
        let source = self.source;
        if self.open.last() != Some(&Block::Loop) {
            let found = "\"vertex\" outside \"outer loop\"";
            return Err(source.broken(Place::Line(line), found, DAMAGED));
        }
        let mut position = [0.0; 3];
        for (axis, value) in position.iter_mut().enumerate() {
            let word = words.next();
            *value = word.and_then(text::real).ok_or_else(|| {
                let what = ["x", "y", "z"][axis];
                source.error(Place::Line(line), text::no_number(word, what))
            })?;
        }
        source.push(&mut self.facet, position, "vertex positions")
    }

    /// Adds the triangles of a loop.
    fn end_loop(&mut self, line: u64) -> Result<()> {
        let source = self.source;
        if self.facet.len() < 3 {
            let found = format!("a loop of {} vertices", self.facet.len());
            return Err(source.broken(Place::Line(line), found, DAMAGED));
        }
        self.split_facets += u64::from(self.facet.len() > 3);
        let split = self.splitter.split(&self.facet);
        let split = split.map_err(|fault| source.error(Place::Line(line), fault))?;
        if self.corners.len() / 3 + split.len() > super::TRIANGLES_MAX {
            let found = "the solid has more corners than 32 bits count";
            return Err(source.broken(Place::Line(line), found, "split the solid"));
        }
        for corner in split.as_flattened() {
            let position = self.facet[*corner as usize];
            source.push(&mut self.corners, position, "vertex positions")?;
        }
        self.facet.clear();
        Ok(())
    }
}
