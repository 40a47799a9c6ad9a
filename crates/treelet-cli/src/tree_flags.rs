//! The flags that say how trees are made; shared by the verbs that build one.

use clap::Args;
use clap::builder::PossibleValuesParser;
use treelet::optimize::Optimizer;
use treelet::scene::Recipe;
use treelet::{BuildOptions, Quality};

use crate::arguments::RecipeParser;

/// How trees are made.
#[derive(Debug, Args)]
pub(crate) struct TreeFlags {
    /// How much time to spend on a tree that is traced faster; `treelet list` says what each level
    /// is made of
    #[arg(long, value_name = "LEVEL", default_value = Quality::default().name(), value_parser = quality_names())]
    quality: String,

    /// Builder, instead of the level's own builder, splits and optimisers; with optimisers after it if
    /// you like: "lbvh+treelets"
    #[arg(long, value_name = "NAME", value_parser = RecipeParser)]
    builder: Option<Recipe>,

    /// Optimisers, instead of the level's or after --builder: names with commas between
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = optimizer_names())]
    optimize: Option<Vec<String>>,
}

impl TreeFlags {
    /// The optimisers of --optimize, after those that --builder names.
    pub(crate) fn optimizers(&self) -> Option<Vec<&'static dyn Optimizer>> {
        let names = self.optimize.as_ref()?;
        let own = self.builder.as_ref().and_then(Recipe::optimizers).unwrap_or_default();
        let more = names.iter().filter_map(|name| treelet::optimize::by_name(name));
        Some(own.iter().copied().chain(more).collect())
    }

    /// The options asked for, with the optimisers of [`TreeFlags::optimizers`].
    pub(crate) fn options<'a>(
        &'a self,
        optimizers: Option<&'a [&'static dyn Optimizer]>,
    ) -> BuildOptions<'a> {
        let quality = Quality::by_name(&self.quality).unwrap_or_default();
        let named = BuildOptions { quality, ..BuildOptions::default() };
        let options = self.builder.as_ref().map_or(named, Recipe::options);
        match optimizers {
            Some(optimizers) => BuildOptions { optimizers: Some(optimizers), ..options },
            None => options,
        }
    }
}

fn quality_names() -> PossibleValuesParser {
    PossibleValuesParser::new(Quality::ALL.map(Quality::name))
}

fn optimizer_names() -> PossibleValuesParser {
    PossibleValuesParser::new(treelet::optimize::ALL.iter().map(|each| each.info().name))
}
