//! The relations between pairs of runs of a campaign, ready to print.

use std::collections::BTreeMap;

use actcheck_analysis::Agreement;
use actcheck_base::{Outcome, ShellLine};
use actcheck_history::{RelatedPair, RelatedRuns};

/// The pairs of runs of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct RelationsSummary {
    /// The pairs.
    pub related: RelatedRuns,
    /// Path of the history, as the user named it.
    pub history: String,
    /// How the user invoked this program; used in suggested commands.
    pub program: String,
}

/// The pairs of a relation.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RelationSummary<'a> {
    /// Name of the relation.
    pub(crate) name: &'a str,
    /// How often it holds, of the pairs to which it applies.
    pub(crate) kept: Agreement,
    /// Number of pairs to which it does not apply.
    pub(crate) inapplicable: u64,
    /// Number of pairs that could not be judged.
    pub(crate) broken: u64,
    /// The pairs in which it does not hold.
    pub(crate) violated: Vec<&'a RelatedPair>,
}

impl RelationsSummary {
    /// Sums up the pairs of each relation, by its name.
    pub(crate) fn relations(&self) -> Vec<RelationSummary<'_>> {
        let mut by_name: BTreeMap<&str, Vec<&RelatedPair>> = BTreeMap::new();
        for pair in &self.related.pairs {
            by_name.entry(&pair.relation).or_default().push(pair);
        }
        by_name.into_iter().map(summed).collect()
    }

    /// 0: all relations hold in all pairs. 1: some do not. 2: a pair could not be judged.
    pub fn exit_code(&self) -> u8 {
        let relations = self.relations();
        match relations.iter().any(|relation| relation.broken > 0) {
            true => 2,
            false => u8::from(
                relations
                    .iter()
                    .any(|relation| !relation.violated.is_empty()),
            ),
        }
    }

    /// The command that finds the smallest scene of a pair.
    pub(crate) fn shrink(&self, pair: &RelatedPair) -> ShellLine {
        ShellLine::new(&self.program)
            .fixed("shrink")
            .word(&pair.run)
            .option("--property", &pair.relation)
            .option("--history", &self.history)
    }
}

fn summed<'a>((name, pairs): (&'a str, Vec<&'a RelatedPair>)) -> RelationSummary<'a> {
    let number = |of: Outcome| pairs.iter().filter(|pair| pair.outcome == of).count() as u64;
    let agree = number(Outcome::Passed);
    let inapplicable = number(Outcome::Inapplicable);
    let of = agree + number(Outcome::Failed);
    RelationSummary {
        name,
        kept: Agreement { agree, of },
        inapplicable,
        broken: pairs.len() as u64 - of - inapplicable,
        violated: pairs
            .iter()
            .copied()
            .filter(|pair| pair.outcome == Outcome::Failed)
            .collect(),
    }
}
