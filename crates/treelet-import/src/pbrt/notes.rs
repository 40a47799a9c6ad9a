//! What was not understood, each thing counted.

use std::collections::BTreeMap;

use crate::error::clip;

/// Sentences with the number of times they were called for.
#[derive(Debug, Default)]
pub(super) struct Notes {
    counts: BTreeMap<String, u64>,
    /// Cases beyond [`KINDS_MAX`] different ones.
    more: u64,
}

/// So many different warnings are told.
const KINDS_MAX: usize = 40;

impl Notes {
    /// Counts one case of a sentence that ends without a full stop.
    pub(super) fn add(&mut self, sentence: impl Into<String>) {
        let sentence = clip(&sentence.into());
        if let Some(count) = self.counts.get_mut(&sentence) {
            *count += 1;
        } else if self.counts.len() < KINDS_MAX {
            self.counts.insert(sentence, 1);
        } else {
            self.more += 1;
        }
    }

    /// The warnings, in alphabetical order.
    pub(super) fn warnings(self) -> Vec<String> {
        let told = |(sentence, count)| match count {
            1 => format!("{sentence}."),
            _ => format!("{sentence} ({count} times)."),
        };
        let mut warnings: Vec<String> = self.counts.into_iter().map(told).collect();
        if self.more > 0 {
            warnings.push(format!("{} more things are not read.", self.more));
        }
        warnings
    }
}
