//! What a recheck changed, counted and listed.

use std::collections::BTreeMap;

use crate::history::Recheck;
use crate::verdict::{Counts, Judgement, Outcome};

/// Why an outcome is another than it was, or is there at all.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Why {
    /// The property was never judged in this run.
    NewProperty,
    /// Its rules changed: digests of the rule file with its libraries, before and now.
    RuleChanged(String, String),
    /// Its rules did not change: the ontology or the program did.
    SameRule,
}

/// An outcome that is new, or another than it was.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// Id of the run.
    pub run: String,
    /// Position of the action in the test, from 1.
    pub step: u32,
    /// IRI of the action.
    pub action: String,
    /// Outcome and margin that the history held; nothing for a property that was never judged there.
    pub before: Option<(Outcome, Option<f64>)>,
    /// What the rules say now.
    pub now: Judgement,
    /// Why.
    pub why: Why,
}

/// One property in all runs that were judged.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RecheckLine {
    /// Outcomes that the history held.
    pub before: Counts,
    /// Outcomes now.
    pub now: Counts,
    /// Of them: never judged before.
    pub new: u64,
    /// Of them: another outcome than before.
    pub changed: u64,
    /// Of them: the same outcome, with another margin, witness or rule.
    pub restated: u64,
}

/// A whole recheck.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecheckSummary {
    /// Runs that were judged.
    pub runs: u64,
    /// By IRI of the property.
    pub properties: BTreeMap<String, RecheckLine>,
    /// In the order of the runs, then by step, then in the order of the action's properties.
    pub changes: Vec<Change>,
}

impl RecheckSummary {
    /// Counts one more judgement.
    pub fn add(&mut self, recheck: &Recheck) {
        let line = self.properties.entry(recheck.now.property.clone()).or_default();
        line.now.add(recheck.now.outcome);
        let before = recheck.before.as_ref().map(|before| &before.judgement);
        if let Some(before) = before {
            line.before.add(before.outcome);
        }
        match before {
            None => line.new += 1,
            Some(before) if before.outcome != recheck.now.outcome => line.changed += 1,
            Some(_) => {
                line.restated += u64::from(recheck.is_news());
                return;
            }
        }
        self.changes.push(Change {
            run: recheck.run.clone(),
            step: recheck.step,
            action: recheck.action.clone(),
            before: before.map(|before| (before.outcome, before.margin)),
            now: recheck.now.clone(),
            why: why(before, &recheck.now),
        });
    }

    /// All outcomes now.
    pub fn now(&self) -> Counts {
        let mut counts = Counts::default();
        for line in self.properties.values() {
            counts.add_all(line.now);
        }
        counts
    }

    /// 1 something fails now, 0 nothing fails and something passes, 2 nothing could be decided.
    pub fn exit_code(&self) -> u8 {
        match self.now() {
            counts if counts.failed > 0 => 1,
            counts if counts.passed > 0 => 0,
            _ => 2,
        }
    }
}

fn why(before: Option<&Judgement>, now: &Judgement) -> Why {
    match before {
        None => Why::NewProperty,
        Some(before) if before.rule_digest != now.rule_digest => {
            Why::RuleChanged(before.rule_digest.clone(), now.rule_digest.clone())
        }
        Some(_) => Why::SameRule,
    }
}
