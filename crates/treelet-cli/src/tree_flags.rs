//! The flags that say how trees are made; shared by the verbs that build one.

use clap::Args;
use clap::builder::PossibleValuesParser;
use treelet::optimize::Optimizer;
use treelet::{BuildOptions, Quality};

use crate::arguments::builder_names;

/// How trees are made.
#[derive(Debug, Args)]
pub(crate) struct TreeFlags {
    /// How much time to spend on a tree that is traced faster; `treelet list` says what each level
    /// is made of
    #[arg(long, value_name = "LEVEL", default_value = Quality::default().name(), value_parser = quality_names())]
    quality: String,

    /// Builder, instead of the level's own builder, splits and optimisers
    #[arg(long, value_name = "NAME", value_parser = builder_names())]
    builder: Option<String>,

    /// Optimisers, instead of the level's or after --builder: names with commas between
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = optimizer_names())]
    optimize: Option<Vec<String>>,
}

impl TreeFlags {
    /// The optimisers asked for.
    pub(crate) fn optimizers(&self) -> Option<Vec<&'static dyn Optimizer>> {
        let names = self.optimize.as_ref()?;
        Some(names.iter().filter_map(|name| treelet::optimize::by_name(name)).collect())
    }

    /// The options asked for, with the optimisers of [`TreeFlags::optimizers`].
    pub(crate) fn options<'a>(
        &self,
        optimizers: Option<&'a [&'static dyn Optimizer]>,
    ) -> BuildOptions<'a> {
        BuildOptions {
            quality: Quality::by_name(&self.quality).unwrap_or_default(),
            builder: self.builder.as_deref().and_then(treelet::build::by_name),
            optimizers,
            ..BuildOptions::default()
        }
    }
}

fn quality_names() -> PossibleValuesParser {
    PossibleValuesParser::new(Quality::ALL.map(Quality::name))
}

fn optimizer_names() -> PossibleValuesParser {
    PossibleValuesParser::new(treelet::optimize::ALL.iter().map(|each| each.info().name))
}
