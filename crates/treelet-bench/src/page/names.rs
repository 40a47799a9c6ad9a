//! How engines and variants are called on the page: by their names, or by letters and numbers.
//!
//! Hidden names follow from the names alone, in the order of their hashes, so that they are the same
//! in figures, tables and command lines, and do not tell the alphabet. They keep a jury from taking
//! sides; who wants to find out, can.

use std::collections::BTreeSet;

use super::data::Page;
use crate::rivals::{self, treelet as ours};

/// Calls everybody by name, or hides the names.
pub(super) struct Names {
    hidden: bool,
    /// In the order of their hashes.
    engines: Vec<String>,
    /// With their engines, likewise.
    variants: Vec<(String, String)>,
}

impl Names {
    pub(super) fn new(page: &Page) -> Self {
        let mut engines = BTreeSet::from([ours::NAME.to_owned()]);
        let mut variants = BTreeSet::new();
        for point in &page.figure.points {
            engines.insert(point.engine.clone());
            variants.insert((point.engine.clone(), point.variant.clone()));
        }
        // Choices and trees are the library's own.
        let choices = page.figure.choices.iter().chain(&page.figure.auto);
        let chosen = choices.flat_map(|choice| [&choice.variant, &choice.best_variant]);
        let chosen = chosen.chain(page.figure.windows.iter().map(|window| &window.variant));
        let drawn = page.scenes.iter().flat_map(|scene| {
            let maps = scene.heat.iter().flat_map(|heat| &heat.maps).map(|map| &map.variant);
            maps.chain(scene.trees.iter().map(|tree| &tree.variant))
        });
        variants.extend(chosen.chain(drawn).map(|name| (ours::NAME.to_owned(), name.clone())));
        let mut engines: Vec<String> = engines.into_iter().collect();
        engines.sort_by_key(|name| hash(name));
        let mut variants: Vec<(String, String)> = variants.into_iter().collect();
        variants.sort_by_key(|(engine, variant)| hash(&format!("{engine}/{variant}")));
        Self { hidden: page.anonymous, engines, variants }
    }

    /// Whether names are hidden.
    pub(super) fn hidden(&self) -> bool {
        self.hidden
    }

    /// What an engine is called.
    pub(super) fn engine(&self, engine: &str) -> String {
        if !self.hidden {
            return engine.to_owned();
        }
        let place = self.engines.iter().position(|name| name == engine);
        place.map_or_else(|| "?".to_owned(), letters)
    }

    /// What a variant of ours is called.
    pub(super) fn ours(&self, variant: &str) -> String {
        self.variant(ours::NAME, variant)
    }

    /// What a variant is called beside its engine's name.
    pub(super) fn variant(&self, engine: &str, variant: &str) -> String {
        if !self.hidden {
            return variant.to_owned();
        }
        let of_engine = self.variants.iter().filter(|(name, _)| name == engine);
        let place = of_engine.map(|(_, name)| name).position(|name| name == variant);
        let number = place.map_or_else(|| "?".to_owned(), |place| (place + 1).to_string());
        format!("{}{number}", self.engine(engine))
    }

    /// What a variant is called where nothing else tells its engine: ours goes without saying.
    pub(super) fn full(&self, engine: &str, variant: &str) -> String {
        if self.hidden || engine == ours::NAME {
            self.variant(engine, variant)
        } else {
            format!("{engine} {variant}")
        }
    }

    /// Free text, such as a command line, with names replaced wherever they stand.
    pub(super) fn text(&self, text: &str) -> String {
        if !self.hidden {
            return text.to_owned();
        }
        let variants = self
            .variants
            .iter()
            .map(|(engine, variant)| (variant.to_lowercase(), self.variant(engine, variant)));
        let engines = self.engines.iter().map(|name| (name.to_lowercase(), self.engine(name)));
        let mut replaced: Vec<(String, String)> = engines.chain(variants).collect();
        // Names that have no points, such as a part of a composition.
        for name in catalogue() {
            if !replaced.iter().any(|(known, _)| *known == name) {
                replaced.push((name, UNKNOWN.to_owned()));
            }
        }
        // Longer names first: one may hold another.
        replaced.sort_by(|a, b| b.0.len().cmp(&a.0.len()).then_with(|| a.0.cmp(&b.0)));
        replace_all(text, &replaced)
    }
}

/// What stands for a name that has no points.
const UNKNOWN: &str = "\u{2026}";

/// Every name that a command line may hold.
fn catalogue() -> impl Iterator<Item = String> {
    let builders = treelet::build::ALL.iter().map(|builder| builder.info().name);
    let optimizers = treelet::optimize::ALL.iter().map(|optimizer| optimizer.info().name);
    let qualities = treelet::Quality::ALL.map(treelet::Quality::name);
    let names = builders.chain(optimizers).chain(qualities).chain(rivals::NAMES);
    names.map(str::to_owned)
}

/// Replaces every occurrence, whatever its case, of the first pattern that fits at a place.
fn replace_all(text: &str, patterns: &[(String, String)]) -> String {
    let mut out = String::new();
    let mut rest = text;
    while let Some(next) = rest.chars().next() {
        let found = patterns.iter().find_map(|(name, label)| {
            let head = rest.get(..name.len())?;
            (!name.is_empty() && head.to_lowercase() == *name).then_some((name.len(), label))
        });
        let length = match found {
            Some((length, label)) => {
                out.push_str(label);
                length
            }
            None => {
                out.push(next);
                next.len_utf8()
            }
        };
        rest = &rest[length..];
    }
    out
}

/// A, B, .. Z, AA, AB..
fn letters(place: usize) -> String {
    let letter = char::from(b'A' + (place % 26) as u8);
    let before = if place < 26 { String::new() } else { letters(place / 26 - 1) };
    format!("{before}{letter}")
}

/// FNV-1a: G. Fowler, L. C. Noll, K.-P. Vo, "The FNV Non-Cryptographic Hash Algorithm", IETF draft.
fn hash(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::{letters, replace_all};

    #[test]
    fn letters_go_on_after_z() {
        assert_eq!([0, 25, 26, 51, 52, 702].map(letters), ["A", "Z", "AA", "AZ", "BA", "AAA"]);
    }

    #[test]
    fn the_longest_name_is_replaced_and_case_does_not_save_it() {
        let patterns = [("ploc+x", "A2"), ("ploc", "A1")].map(|(a, b)| (a.into(), b.into()));
        assert_eq!(replace_all("--b PLOC+x,ploc,é", &patterns), "--b A2,A1,é");
    }
}
