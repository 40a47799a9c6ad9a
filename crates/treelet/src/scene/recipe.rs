//! How trees are asked for by name: `binned-sah`, `lbvh+treelets`, `default+rotations`.
//!
//! The first word is a quality level's or a builder's, perhaps with the pre-pass in front of it
//! (`presplit+hploc`), each one after a `+` an optimiser's; a level's own optimisers come before those. Whatever takes names of builders (the command's flags, the
//! bench's variants) reads them here.

use super::builder::BuildOptions;
use super::quality::Quality;
use crate::build::{self, Builder, Presplit};
use crate::optimize::{self, Optimizer};
use alloc::borrow::ToOwned;
use alloc::string::String;
use alloc::vec::Vec;
use core::str::FromStr;

/// A builder and optimisers, by their names.
#[derive(Clone)]
pub struct Recipe {
    quality: Quality,
    builder: Option<&'static dyn Builder>,
    /// A level's own ones where there are none.
    optimizers: Option<Vec<&'static dyn Optimizer>>,
    name: String,
}

/// A name that no catalogue has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RecipeError {
    /// The first word.
    #[error("`{0}` is neither a builder nor a quality level; `treelet list` names them all")]
    Base(String),
    /// A word after a `+`.
    #[error("`{0}` is no optimiser; `treelet list` names them all")]
    Optimizer(String),
}

impl FromStr for Recipe {
    type Err = RecipeError;

    fn from_str(name: &str) -> Result<Self, RecipeError> {
        // A pre-pass and its builder are one name.
        let start = name.strip_prefix(Presplit::NAME).and_then(|rest| rest.strip_prefix('+'));
        let start = start.map_or(0, |rest| name.len() - rest.len());
        let end = name[start..].find('+').map_or(name.len(), |end| start + end);
        let base = &name[..end];
        let words = name[end..].split('+').skip(1);
        let level = Quality::by_name(base);
        let builder = build::by_name(base);
        if level.is_none() && builder.is_none() {
            return Err(RecipeError::Base(base.to_owned()));
        }
        let find = |word: &str| {
            optimize::by_name(word).ok_or_else(|| RecipeError::Optimizer(word.to_owned()))
        };
        let more = words.map(find).collect::<Result<Vec<_>, _>>()?;
        let own = level.map_or(&[][..], |level| level.plan().optimizers);
        let all = || own.iter().copied().chain(more.iter().copied()).collect();
        Ok(Self {
            quality: level.unwrap_or_default(),
            builder,
            optimizers: (!more.is_empty()).then(all),
            name: name.to_owned(),
        })
    }
}

impl Recipe {
    /// As it was written.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The optimisers, if any are named.
    pub fn optimizers(&self) -> Option<&[&'static dyn Optimizer]> {
        self.optimizers.as_deref()
    }

    /// The options that ask for it.
    pub fn options(&self) -> BuildOptions<'_> {
        BuildOptions {
            quality: self.quality,
            builder: self.builder.map(|builder| builder as &dyn Builder),
            optimizers: self.optimizers.as_deref(),
            ..BuildOptions::default()
        }
    }
}

impl From<Quality> for Recipe {
    fn from(quality: Quality) -> Self {
        Self { quality, builder: None, optimizers: None, name: quality.name().to_owned() }
    }
}

impl core::fmt::Debug for Recipe {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Recipe({})", self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Plan;
    use alloc::string::ToString;

    #[test]
    fn names_mean_what_they_say() {
        for (name, plan) in [
            ("lbvh", "lbvh"),
            ("lbvh+treelets", "lbvh + treelets"),
            ("sweep-sah+treelets+reinsertion", "sweep-sah + treelets + reinsertion"),
            ("presplit+hploc", "presplit+hploc"),
            ("presplit+lbvh+rotations", "presplit+lbvh + rotations"),
            ("default", "binned-sah + top-reinsertion"),
            ("default+treelets", "binned-sah + top-reinsertion + treelets"),
        ] {
            let recipe: Recipe = name.parse().unwrap();
            assert_eq!(Plan::new(&recipe.options()).to_string(), plan);
            assert_eq!(recipe.name(), name);
        }
        for builder in build::ALL {
            let name = builder.info().name;
            assert_eq!(Plan::new(&name.parse::<Recipe>().unwrap().options()).to_string(), name);
        }
        for (name, wrong) in [
            ("", ""),
            ("x", "x"),
            ("treelets", "treelets"),
            ("+lbvh", ""),
            ("presplit+", "presplit+"),
        ] {
            assert_eq!(name.parse::<Recipe>().unwrap_err(), RecipeError::Base(wrong.into()));
        }
        for (name, wrong) in [("lbvh+", ""), ("lbvh+lbvh", "lbvh"), ("best+x+treelets", "x")] {
            assert_eq!(name.parse::<Recipe>().unwrap_err(), RecipeError::Optimizer(wrong.into()));
        }
    }
}
