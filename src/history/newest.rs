//! The newest outcomes.

use crate::{History, Judgements, LaterRules, OutcomeRow, RunFilter, Wish};
use actcheck_base::Diagnostics;

/// The newest outcomes of runs: later judgements where they exist, otherwise those of the campaign
/// itself.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct NewestOutcomes {
    /// In the order of [`History::outcomes`].
    pub rows: Vec<OutcomeRow>,
    /// Digests of the rules of later judgements, by the IRI of the property.
    pub rules: LaterRules,
}

impl History {
    /// Returns the newest outcomes of the runs that match a filter.
    ///
    /// # Errors
    /// A file is damaged or can't be read.
    pub fn newest_outcomes(&self, filter: &RunFilter) -> Result<NewestOutcomes, Diagnostics> {
        let mut rows = Vec::new();
        let wish = Wish {
            judgements: Judgements::Newest,
            ..Wish::default()
        };
        let rules = self.each_judged(filter, wish, &mut |run| rows.extend(run.outcome_rows()))?;
        Ok(NewestOutcomes { rows, rules })
    }
}
