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
    /// is made of. `auto` estimates how many rays the picture will ask (pixels times passes times what a
    /// path of so many bounces asks, or what this many threads answer in --time) and chooses for them, as
    /// --rays does
    #[arg(long, value_name = "LEVEL", default_value = Quality::default().name(), value_parser = quality_names())]
    quality: String,

    /// Choose the builder for this many rays: what answers them soonest, its build included
    #[arg(long, value_name = "N", conflicts_with_all = ["quality", "builder", "optimize"], value_parser = number_of_rays)]
    rays: Option<u64>,

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

    /// The options asked for, with the optimisers of [`TreeFlags::optimizers`]; `estimate` is how many rays are
    /// expected where nobody says.
    pub(crate) fn options<'a>(
        &'a self,
        optimizers: Option<&'a [&'static dyn Optimizer]>,
        estimate: u64,
    ) -> BuildOptions<'a> {
        let named = Quality::by_name(&self.quality).unwrap_or_default();
        let auto = (self.quality == Quality::Auto.name()).then_some(estimate);
        let quality = self.rays.or(auto).map_or(named, Quality::for_rays);
        let named = BuildOptions { quality, ..BuildOptions::default() };
        let options = self.builder.as_ref().map_or(named, Recipe::options);
        match optimizers {
            Some(optimizers) => BuildOptions { optimizers: Some(optimizers), ..options },
            None => options,
        }
    }
}

fn quality_names() -> PossibleValuesParser {
    let levels = Quality::ALL.iter().chain([&Quality::Auto]);
    PossibleValuesParser::new(levels.map(|level| level.name()))
}

/// `250000` or `1e9`; what is too large for a number is as many as there are.
pub(crate) fn number_of_rays(text: &str) -> Result<u64, String> {
    let float = || text.parse().ok().filter(|rays: &f64| *rays >= 0.0).map(|rays| rays as u64);
    let wrong = || format!("`{text}` is no number of rays; write 250000 or 1e9");
    text.parse().ok().or_else(float).ok_or_else(wrong)
}

fn optimizer_names() -> PossibleValuesParser {
    PossibleValuesParser::new(treelet::optimize::ALL.iter().map(|each| each.info().name))
}
