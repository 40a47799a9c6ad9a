//! Parameter lists: `"type name" value` or `"type name" [ values ]`.

use std::rc::Rc;

use crate::error::{Fault, Place, Result, quote};
use crate::source::Source;
use crate::text;

use super::tokens::{Token, Tokens};

/// The values of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    Numbers(Vec<f32>),
    Integers(Vec<i64>),
    Strings(Vec<String>),
    Bools(Vec<bool>),
}

/// A parameter by its declared type and name.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Param {
    pub(super) kind: String,
    pub(super) name: String,
    pub(super) values: Values,
}

/// The parameters of a directive. Of several with one name the first counts, as in pbrt.
#[derive(Clone, Debug, Default)]
pub(super) struct Params {
    /// Shared with the defaults that `Attribute` sets.
    pub(super) list: Vec<Rc<Param>>,
    /// The line of the directive.
    pub(super) line: u64,
}

impl Params {
    /// Reads parameters until a directive follows.
    pub(super) fn read(source: &Source<'_>, tokens: &mut Tokens<'_>) -> Result<Self> {
        let mut params = Self { list: Vec::new(), line: tokens.line };
        loop {
            let fail = |line: u64, fault: Fault| source.error(Place::Line(line), fault);
            let line = tokens.line;
            let Some(Token::Quoted(declared)) = tokens.peek().map_err(|f| fail(line, f))? else {
                return Ok(params);
            };
            tokens.next().map_err(|fault| fail(line, fault))?;
            let mut words = declared.split(|&b| b == b' ' || b == b'\t').filter(|w| !w.is_empty());
            let (Some(kind), Some(name), None) = (words.next(), words.next(), words.next()) else {
                let found = format!("{} is no parameter of a type and a name", quote(declared));
                let remedy = "write it as in \"float radius\"";
                return Err(fail(tokens.line, Fault::broken(found, remedy)));
            };
            let values = read_values(source, tokens, kind)?;
            let text = |word| String::from_utf8_lossy(word).into_owned();
            let param = Param { kind: text(kind), name: text(name), values };
            source.push(&mut params.list, Rc::new(param), "parameters")?;
        }
    }

    pub(super) fn find(&self, name: &str) -> Option<&Param> {
        self.list.iter().find(|param| param.name == name).map(Rc::as_ref)
    }

    /// All numbers of a parameter.
    pub(super) fn numbers(&self, name: &str) -> Option<&[f32]> {
        match &self.find(name)?.values {
            Values::Numbers(numbers) => Some(numbers),
            _ => None,
        }
    }

    /// All integers of a parameter.
    pub(super) fn integers(&self, name: &str) -> Option<&[i64]> {
        match &self.find(name)?.values {
            Values::Integers(integers) => Some(integers),
            _ => None,
        }
    }

    /// One finite number, or what stands for it.
    pub(super) fn float(&self, name: &str, default: f32) -> f32 {
        let number = match self.find(name).map(|param| &param.values) {
            Some(Values::Numbers(numbers)) => numbers.first().copied(),
            Some(Values::Integers(integers)) => integers.first().map(|&i| i as f32),
            _ => None,
        };
        number.filter(|number| number.is_finite()).unwrap_or(default)
    }

    /// Three finite numbers.
    pub(super) fn point(&self, name: &str, default: [f32; 3]) -> [f32; 3] {
        let point = self.numbers(name).and_then(|numbers| numbers.first_chunk()).copied();
        point.filter(|point: &[f32; 3]| point.iter().all(|x| x.is_finite())).unwrap_or(default)
    }

    pub(super) fn string(&self, name: &str) -> Option<&str> {
        match &self.find(name)?.values {
            Values::Strings(strings) => strings.first().map(String::as_str),
            _ => None,
        }
    }

    pub(super) fn bool(&self, name: &str, default: bool) -> bool {
        match self.find(name).map(|param| &param.values) {
            Some(Values::Bools(bools)) => bools.first().copied().unwrap_or(default),
            _ => default,
        }
    }

    /// Groups of `N` numbers; an error if some are left over.
    pub(super) fn groups<const N: usize>(
        &self,
        source: &Source<'_>,
        name: &str,
    ) -> Result<Option<&[[f32; N]]>> {
        let Some(numbers) = self.numbers(name) else { return Ok(None) };
        let (groups, rest) = numbers.as_chunks();
        if rest.is_empty() {
            return Ok(Some(groups));
        }
        let found = format!("{name:?} has {} numbers, no multiple of {N}", numbers.len());
        Err(source.broken(Place::Line(self.line), found, "check the program that wrote it"))
    }
}

/// What a string costs beside its letters, roughly.
const STRING_BYTES: u64 = 64;

/// Reads one value or a bracketed list of them.
fn read_values(source: &Source<'_>, tokens: &mut Tokens<'_>, kind: &[u8]) -> Result<Values> {
    const WHAT: &str = "values of a parameter";
    let mut values = match kind {
        b"integer" => Values::Integers(Vec::new()),
        b"bool" => Values::Bools(Vec::new()),
        b"string" | b"texture" => Values::Strings(Vec::new()),
        _ => Values::Numbers(Vec::new()),
    };
    let mut is_list = false;
    let mut count = 0_u64;
    loop {
        let line = tokens.line;
        let fail = |fault: Fault| source.error(Place::Line(line), fault);
        let odd = |word: &[u8]| {
            let found = format!("{} is no value of type {}", quote(word), quote(kind));
            fail(Fault::broken(found, "check the program that wrote it"))
        };
        count += 1;
        if count.is_multiple_of(1 << 14) {
            source.check_cancelled()?;
        }
        match tokens.next().map_err(fail)? {
            Some(Token::Open) if !is_list => {
                is_list = true;
                continue;
            }
            Some(Token::Close) if is_list => break,
            Some(Token::Word(word)) => match &mut values {
                Values::Numbers(numbers) => {
                    let number = text::real(word).ok_or_else(|| odd(word))?;
                    source.push(numbers, number, WHAT)?;
                }
                Values::Integers(integers) => {
                    let real = || text::real(word).filter(|x| libm::truncf(*x) == *x);
                    let integer = text::integer(word).or_else(|| real().map(|x| x as i64));
                    source.push(integers, integer.ok_or_else(|| odd(word))?, WHAT)?;
                }
                Values::Bools(bools) => bools.push(bool_of(word).ok_or_else(|| odd(word))?),
                Values::Strings(_) => return Err(odd(word)),
            },
            Some(Token::Quoted(word)) => match &mut values {
                Values::Bools(bools) => bools.push(bool_of(word).ok_or_else(|| odd(word))?),
                Values::Strings(strings) => {
                    source.whole(source.budget.spend(word.len() as u64 + STRING_BYTES, WHAT))?;
                    strings.push(String::from_utf8_lossy(word).into_owned());
                }
                // A spectrum may be named; then nothing else stands in the list.
                Values::Numbers(numbers) if numbers.is_empty() => {
                    values = Values::Strings(vec![String::from_utf8_lossy(word).into_owned()]);
                }
                _ => return Err(odd(word)),
            },
            Some(Token::Open | Token::Close) | None => {
                return Err(fail(Fault::broken("a parameter has no value", crate::error::DAMAGED)));
            }
        }
        if !is_list {
            break;
        }
    }
    Ok(values)
}

fn bool_of(word: &[u8]) -> Option<bool> {
    match word {
        b"true" => Some(true),
        b"false" => Some(false),
        _ => None,
    }
}
