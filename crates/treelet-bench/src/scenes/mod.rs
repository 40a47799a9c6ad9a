//! What is measured: scene files, with their instances or flattened to triangles, and two scenes that are made on
//! the spot.

mod flatten;
mod placed;
mod soup;
mod terrain;

pub use flatten::{FlattenError, flatten};
pub use placed::{placed, repeats};

use crate::engine::Triangles;
use treelet::Aabb;

/// A scene that is made, with its number of triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Generated {
    /// A fractal height field.
    Terrain(u64),
    /// Small random triangles.
    Soup(u64),
}

impl Generated {
    /// Names, as users write them, and the usual numbers of triangles.
    pub const NAMES: [(&str, u64); 2] = [("fractal-terrain", 4_000_000), ("soup", 12_000_000)];

    /// The scene behind `NAME` or `NAME:N`, where N may end with `k` or `M`; `None` if the words
    /// name no generated scene, an error if only the number is wrong.
    pub fn parse(words: &str) -> Option<Result<Self, String>> {
        let (name, number) = match words.split_once(':') {
            Some((name, number)) => (name, Some(number)),
            None => (words, None),
        };
        let make: fn(u64) -> Self = match name {
            "fractal-terrain" => Self::Terrain,
            "soup" => Self::Soup,
            _ => return None,
        };
        let usual = Self::NAMES.iter().find(|(known, _)| *known == name)?.1;
        let count = match number {
            None => usual,
            Some(number) => match parse_count(number) {
                Some(count) => count,
                None => {
                    return Some(Err(format!(
                        "{words}: {number} is not a number of triangles in 2 ..= 1000M; \
                         write {name}:4000000 or {name}:4M"
                    )));
                }
            },
        };
        Some(Ok(make(count)))
    }

    /// Makes its triangles: the same on every machine.
    pub fn triangles(self) -> Triangles {
        match self {
            Self::Terrain(count) => terrain::terrain(count),
            Self::Soup(count) => soup::soup(count),
        }
    }
}

/// `12`, `12k` or `12M`, within what one tree can hold.
fn parse_count(text: &str) -> Option<u64> {
    let (digits, unit) = match text.strip_suffix(['k', 'M']) {
        Some(digits) => (digits, if text.ends_with('k') { 1_000 } else { 1_000_000 }),
        None => (text, 1),
    };
    let count = digits.parse::<u64>().ok()?.checked_mul(unit)?;
    (2..=1_000_000_000).contains(&count).then_some(count)
}

/// The box around all triangles.
pub fn bounds(triangles: &Triangles) -> Aabb {
    (0..triangles.len())
        .fold(Aabb::EMPTY, |bounds, prim| bounds.union(&Aabb::of_points(&triangles.corners(prim))))
}

#[cfg(test)]
mod tests {
    use super::Generated;

    #[test]
    fn generated_scenes_have_a_name_and_perhaps_a_number() {
        let parse = |words| Generated::parse(words);
        assert_eq!(parse("soup"), Some(Ok(Generated::Soup(12_000_000))));
        assert_eq!(parse("fractal-terrain:9k"), Some(Ok(Generated::Terrain(9_000))));
        assert_eq!(parse("soup:7"), Some(Ok(Generated::Soup(7))));
        assert_eq!(parse("soup.ply"), None);
        for wrong in ["soup:", "soup:x", "soup:1", "soup:-3", "soup:99999M", "soup:k"] {
            assert!(parse(wrong).unwrap().is_err(), "{wrong}");
        }
    }

    #[test]
    fn they_hold_what_they_say() {
        for scene in [Generated::Terrain(5_000), Generated::Soup(5_000)] {
            let triangles = scene.triangles();
            let off = triangles.len().abs_diff(5_000);
            assert!(off < 200, "{scene:?}: {}", triangles.len());
            let bounds = super::bounds(&triangles);
            assert!(
                bounds.extent().iter().all(|extent| (0.01..1.1).contains(extent)),
                "{bounds:?}"
            );
        }
    }
}
