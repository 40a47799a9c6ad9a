//! What a directive is made of: names, numbers, and what is stepped over; and the directives that
//! change the current transform.

use crate::error::{DAMAGED, Fault, Place, Result, quote};
use crate::source::Source;
use crate::text;

use super::scene::Scene;
use super::tokens::{Token, Tokens};
use super::transform::{self, IDENTITY};

impl Scene<'_, '_> {
    /// Directives that change the current transform. Tells whether this is one.
    pub(super) fn transform_directive(
        &mut self,
        file: &Source<'_>,
        word: &[u8],
        line: u64,
        tokens: &mut Tokens<'_>,
    ) -> Result<bool> {
        let place = Place::Line(line);
        let bad = |found: &str| Err(file.broken(place.clone(), found, "check the numbers"));
        let local = match word {
            b"Identity" => {
                self.state.ctm = IDENTITY;
                return Ok(true);
            }
            b"Translate" => transform::translation(numbers(file, tokens)?),
            b"Scale" => transform::scaling(numbers(file, tokens)?),
            b"Rotate" => {
                let [angle, x, y, z] = numbers(file, tokens)?;
                match transform::rotation(angle, [x, y, z]) {
                    Some(rotation) => rotation,
                    None => return bad("turns about an axis of no length"),
                }
            }
            b"LookAt" => {
                let [a, b, c, d, e, f, g, h, i] = numbers(file, tokens)?;
                self.film.up = Some([g, h, i]);
                match transform::look_at([a, b, c], [d, e, f], [g, h, i]) {
                    Some(look) => look,
                    None => return bad("looks nowhere: its points or vectors coincide"),
                }
            }
            b"Transform" | b"ConcatTransform" => {
                let Some(matrix) = transform::matrix(&numbers(file, tokens)?) else {
                    return bad("is a matrix whose last row is not 0 0 0 1");
                };
                if word == b"Transform" {
                    self.state.ctm = matrix;
                    return Ok(true);
                }
                matrix
            }
            b"CoordinateSystem" => {
                let name = string(file, tokens)?.to_vec();
                file.whole(file.budget.spend(128 + name.len() as u64, "coordinate systems"))?;
                self.spaces.insert(name, self.state.ctm);
                return Ok(true);
            }
            b"CoordSysTransform" => {
                let name = string(file, tokens)?;
                match self.spaces.get(name) {
                    Some(space) => self.state.ctm = *space,
                    None => {
                        let told = format!("The coordinate system {} is not defined", quote(name));
                        self.notes.add(told);
                    }
                }
                return Ok(true);
            }
            b"TransformTimes" => {
                numbers::<2>(file, tokens)?;
                return Ok(true);
            }
            _ => return Ok(false),
        };
        self.state.ctm = transform::compose(&self.state.ctm, &local);
        Ok(true)
    }
}

/// Steps over whatever belongs to a directive that is not read.
pub(super) fn step_over(file: &Source<'_>, tokens: &mut Tokens<'_>) -> Result<()> {
    let mut depth = 0_u64;
    loop {
        let line = tokens.line;
        let fail = |fault| file.error(Place::Line(line), fault);
        match tokens.peek().map_err(fail)? {
            None => return Ok(()),
            Some(Token::Word(word)) if depth == 0 && is_directive(word) => return Ok(()),
            Some(Token::Open) => depth += 1,
            Some(Token::Close) => depth = depth.saturating_sub(1),
            Some(Token::Quoted(_) | Token::Word(_)) => {}
        }
        tokens.next().map_err(fail)?;
    }
}

/// Whether a word begins a directive; numbers and truth values do not.
fn is_directive(word: &[u8]) -> bool {
    word.first().is_some_and(u8::is_ascii_uppercase) && text::real(word).is_none()
}

pub(super) fn shown(token: Token<'_>) -> String {
    match token {
        Token::Quoted(text) | Token::Word(text) => quote(text),
        Token::Open => quote(b"["),
        Token::Close => quote(b"]"),
    }
}

/// The quoted string that must come next.
pub(super) fn string<'t>(file: &Source<'_>, tokens: &mut Tokens<'t>) -> Result<&'t [u8]> {
    let place = Place::Line(tokens.line);
    match tokens.next().map_err(|fault| file.error(place.clone(), fault))? {
        Some(Token::Quoted(text)) => Ok(text),
        Some(token) => {
            let found = format!("{} where a name in quotation marks should stand", shown(token));
            Err(file.broken(place, found, DAMAGED))
        }
        None => Err(file.broken(place, "the file ends inside a directive", DAMAGED)),
    }
}

/// The numbers that must come next, in brackets or not.
fn numbers<const N: usize>(file: &Source<'_>, tokens: &mut Tokens<'_>) -> Result<[f64; N]> {
    let mut numbers = [0.0; N];
    let line = tokens.line;
    let fail = |fault| file.error(Place::Line(line), fault);
    let in_brackets = tokens.peek().map_err(fail)? == Some(Token::Open);
    if in_brackets {
        tokens.next().map_err(fail)?;
    }
    for number in &mut numbers {
        let word = match tokens.next().map_err(fail)? {
            Some(Token::Word(word)) => Some(word),
            _ => None,
        };
        let value = word.and_then(text::double).filter(|value| value.is_finite());
        *number = value.ok_or_else(|| fail(text::no_number(word, "a number of a transform")))?;
    }
    if in_brackets && tokens.next().map_err(fail)? != Some(Token::Close) {
        return Err(fail(Fault::broken("a bracket is not closed", DAMAGED)));
    }
    Ok(numbers)
}
