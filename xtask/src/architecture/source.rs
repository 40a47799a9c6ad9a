//! Rust source as words and marks with their lines: enough to see paths and keywords, no more.
//!
//! Comments, strings and character literals vanish. A lifetime keeps its name as a word.

/// A word (identifier, keyword, number) or one mark; `::` is a single token.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Token {
    pub(crate) text: String,
    /// From 1.
    pub(crate) line: usize,
}

/// A file's tokens.
#[derive(Debug)]
pub(crate) struct Source {
    pub(crate) tokens: Vec<Token>,
}

impl Source {
    /// Splits `text` into tokens. Text that is no Rust gives some tokens, never an error.
    pub(crate) fn parse(text: &str) -> Self {
        let mut reader = Reader { chars: text.chars().collect(), at: 0, line: 1 };
        let mut tokens = Vec::new();
        while let Some(token) = reader.token() {
            tokens.push(token);
        }
        Self { tokens }
    }

    /// The text of token `at`, empty past the end.
    pub(crate) fn text(&self, at: usize) -> &str {
        self.tokens.get(at).map_or("", |token| &token.text)
    }

    /// For each token, whether it stands in an item under a `#[cfg(..test..)]` attribute.
    pub(crate) fn under_test(&self) -> Vec<bool> {
        let mut marks = vec![false; self.tokens.len()];
        let mut at = 0;
        while at < self.tokens.len() {
            let Some(after) = self.test_attribute(at) else {
                at += 1;
                continue;
            };
            let end = self.item_end(after);
            marks[at..end].fill(true);
            at = end;
        }
        marks
    }

    /// The token after the attribute at `at`, if it is `#[cfg(..)]` and names `test` without `not`.
    fn test_attribute(&self, at: usize) -> Option<usize> {
        if self.text(at) != "#" || self.text(at + 1) != "[" || self.text(at + 2) != "cfg" {
            return None;
        }
        let end = self.closing(at + 1);
        let words = self.tokens.get(at + 3..end)?;
        let has = |word: &str| words.iter().any(|token| token.text == word);
        (has("test") && !has("not")).then_some(end)
    }

    /// The token after the item that starts at `at`: after its `;` or its outermost braces.
    fn item_end(&self, mut at: usize) -> usize {
        while at < self.tokens.len() {
            match self.text(at) {
                ";" => return at + 1,
                "{" => return self.closing(at),
                "(" | "[" => at = self.closing(at),
                _ => at += 1,
            }
        }
        at
    }

    /// The token after the bracket that closes the one at `open`, or the end.
    pub(crate) fn closing(&self, open: usize) -> usize {
        let mut depth = 0_usize;
        for at in open..self.tokens.len() {
            match self.text(at) {
                "(" | "[" | "{" => depth += 1,
                ")" | "]" | "}" => depth = depth.saturating_sub(1),
                _ => {}
            }
            if depth == 0 {
                return at + 1;
            }
        }
        self.tokens.len()
    }
}

/// Walks over the characters of a file.
struct Reader {
    chars: Vec<char>,
    at: usize,
    line: usize,
}

impl Reader {
    fn peek(&self, ahead: usize) -> char {
        self.chars.get(self.at + ahead).copied().unwrap_or('\0')
    }

    fn bump(&mut self) {
        if self.peek(0) == '\n' {
            self.line += 1;
        }
        self.at += 1;
    }

    /// The next token, past blanks, comments and literals.
    fn token(&mut self) -> Option<Token> {
        loop {
            let line = self.line;
            match (*self.chars.get(self.at)?, self.peek(1)) {
                ('/', '/') => self.skip_while(|c| c != '\n'),
                ('/', '*') => self.skip_block_comment(),
                ('"', _) => self.skip_string(),
                ('\'', _) => self.skip_quote(),
                (c, _) if c.is_alphanumeric() || c == '_' => {
                    let text = self.word();
                    if !self.skip_prefixed_string(&text) {
                        return Some(Token { text, line });
                    }
                }
                (c, _) if c.is_whitespace() => self.bump(),
                (':', ':') => {
                    self.at += 2;
                    return Some(Token { text: "::".into(), line });
                }
                (c, _) => {
                    self.bump();
                    return Some(Token { text: c.into(), line });
                }
            }
        }
    }

    fn word(&mut self) -> String {
        let start = self.at;
        self.skip_while(|c| c.is_alphanumeric() || c == '_');
        self.chars[start..self.at].iter().collect()
    }

    fn skip_while(&mut self, wanted: impl Fn(char) -> bool) {
        while self.at < self.chars.len() && wanted(self.peek(0)) {
            self.bump();
        }
    }

    /// `/* .. */`, which nests.
    fn skip_block_comment(&mut self) {
        let mut depth = 0_usize;
        while self.at < self.chars.len() {
            match (self.peek(0), self.peek(1)) {
                ('/', '*') => (depth, self.at) = (depth + 1, self.at + 2),
                ('*', '/') => (depth, self.at) = (depth - 1, self.at + 2),
                _ => self.bump(),
            }
            if depth == 0 {
                return;
            }
        }
    }

    /// `".."` with escapes.
    fn skip_string(&mut self) {
        self.bump();
        while self.at < self.chars.len() && self.peek(0) != '"' {
            if self.peek(0) == '\\' {
                self.bump();
            }
            self.bump();
        }
        self.bump();
    }

    /// What follows the word `prefix`, if that makes it a string: `r".."`, `br#".."#`, `c".."`;
    /// or the `#` of a raw identifier.
    fn skip_prefixed_string(&mut self, prefix: &str) -> bool {
        let raw = matches!(prefix, "r" | "br" | "cr");
        if self.peek(0) == '"' && !raw && matches!(prefix, "b" | "c") {
            self.skip_string();
            return true;
        }
        if !raw {
            return false;
        }
        let mut hashes = 0;
        while self.peek(hashes) == '#' {
            hashes += 1;
        }
        if self.peek(hashes) != '"' {
            // `r#name`: the name follows as its own word.
            self.at += usize::from(hashes == 1);
            return hashes == 1;
        }
        self.at += hashes + 1;
        let ends = |reader: &Self| {
            reader.peek(0) == '"' && (1..=hashes).all(|ahead| reader.peek(ahead) == '#')
        };
        while self.at < self.chars.len() && !ends(self) {
            self.bump();
        }
        self.at += hashes + 1;
        true
    }

    /// A character literal, or the quote of a lifetime.
    fn skip_quote(&mut self) {
        self.bump();
        if self.peek(0) == '\\' {
            self.bump();
            self.bump();
            self.skip_while(|c| c != '\'');
            self.bump();
        } else if self.peek(1) == '\'' {
            self.bump();
            self.bump();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Source;

    fn words(text: &str) -> Vec<String> {
        Source::parse(text).tokens.into_iter().map(|token| token.text).collect()
    }

    #[test]
    fn comments_and_literals_vanish() {
        assert_eq!(words("a // crate::b\n/* c /* d */ e */ f"), ["a", "f"]);
        assert_eq!(words(r##"x = "crate::y \" z" ; r#"a"b"# 'q' '\'' b"n""##), ["x", "=", ";"]);
        assert_eq!(words("&'a str, 'b'"), ["&", "a", "str", ","]);
        assert_eq!(words("r#type + r"), ["type", "+", "r"]);
    }

    #[test]
    fn lines_are_counted_through_everything() {
        let source = Source::parse("/*\n*/ \"\n\" r\"\n\" x\ny::z");
        let lines: Vec<_> = source.tokens.iter().map(|t| (t.text.as_str(), t.line)).collect();
        assert_eq!(lines, [("x", 4), ("y", 5), ("::", 5), ("z", 5)]);
    }

    #[test]
    fn test_items_are_marked() {
        let source =
            Source::parse("use a; #[cfg(test)] mod t { fn f() {} } use b; #[cfg(not(test))] c;");
        let marks = source.under_test();
        let plain: Vec<_> = source.tokens.iter().zip(marks).filter(|(_, mark)| !mark).collect();
        let plain: String = plain.iter().map(|(token, _)| token.text.as_str()).collect();
        assert_eq!(plain, "usea;useb;#[cfg(not(test))]c;");
    }

    #[test]
    fn unfinished_text_ends() {
        for text in ["/*", "\"", "'", "r#\"", "#[cfg(test)", "{", "r#"] {
            let source = Source::parse(text);
            assert_eq!(source.under_test().len(), source.tokens.len(), "{text:?}");
        }
    }
}
