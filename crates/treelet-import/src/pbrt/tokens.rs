//! The words of a pbrt file: quoted strings, brackets, and all else.

use crate::error::{DAMAGED, Fault};

/// A word of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Token<'a> {
    /// Between quotation marks, without them.
    Quoted(&'a [u8]),
    /// A directive, a number, `true` or `false`.
    Word(&'a [u8]),
    Open,
    Close,
}

/// The words of a text, one after another.
#[derive(Clone, Debug)]
pub(super) struct Tokens<'a> {
    rest: &'a [u8],
    /// The line of the next word.
    pub(super) line: u64,
}

impl<'a> Tokens<'a> {
    pub(super) fn new(text: &'a [u8]) -> Self {
        let mut tokens = Self { rest: crate::text::without_bom(text), line: 1 };
        tokens.skip_blanks();
        tokens
    }

    /// The next word, without taking it.
    pub(super) fn peek(&self) -> Result<Option<Token<'a>>, Fault> {
        self.clone().next()
    }

    /// The next word; `None` at the end.
    pub(super) fn next(&mut self) -> Result<Option<Token<'a>>, Fault> {
        let Some(&first) = self.rest.first() else { return Ok(None) };
        Ok(Some(match first {
            b'[' => self.take(1, Token::Open),
            b']' => self.take(1, Token::Close),
            b'"' => {
                let text = &self.rest[1..];
                let Some(end) = memchr::memchr2(b'"', b'\n', text).filter(|&end| text[end] == b'"')
                else {
                    return Err(Fault::broken("a quotation mark has no other", DAMAGED));
                };
                self.take(end + 2, Token::Quoted(&text[..end]))
            }
            _ => {
                let end = self.rest.iter().position(|&b| ends_word(b)).unwrap_or(self.rest.len());
                self.take(end, Token::Word(&self.rest[..end]))
            }
        }))
    }

    fn take(&mut self, len: usize, token: Token<'a>) -> Token<'a> {
        self.rest = &self.rest[len..];
        self.skip_blanks();
        token
    }

    /// Steps over white space and remarks, which last from `#` to the end of the line.
    fn skip_blanks(&mut self) {
        while let Some(&first) = self.rest.first() {
            match first {
                b'#' => {
                    let end = memchr::memchr(b'\n', self.rest).unwrap_or(self.rest.len());
                    self.rest = &self.rest[end..];
                }
                b'\n' => {
                    self.line += 1;
                    self.rest = &self.rest[1..];
                }
                _ if crate::text::is_blank(first) => self.rest = &self.rest[1..],
                _ => return,
            }
        }
    }
}

fn ends_word(byte: u8) -> bool {
    crate::text::is_blank(byte) || matches!(byte, b'[' | b']' | b'"' | b'#')
}

#[cfg(test)]
mod tests {
    use super::{Token, Tokens};

    #[test]
    fn words_brackets_and_remarks() {
        let text = b"Shape \"a b\"[1-2]# \"x\n true#\n\"";
        let mut tokens = Tokens::new(text);
        let want = [
            Token::Word(b"Shape"),
            Token::Quoted(b"a b"),
            Token::Open,
            Token::Word(b"1-2"),
            Token::Close,
            Token::Word(b"true"),
        ];
        for token in want {
            assert_eq!(tokens.next().unwrap(), Some(token));
        }
        assert!(tokens.next().is_err());
        assert_eq!(tokens.line, 3);
        assert_eq!(Tokens::new(b" # nothing").next().unwrap(), None);
    }
}
