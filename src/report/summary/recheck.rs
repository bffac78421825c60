//! The changes that a recheck made, counted and listed.

use std::collections::BTreeMap;

use actcheck_base::{Judgement, Outcome};
use actcheck_history::Recheck;
use actcheck_verdict::Counts;

/// Why an outcome changed or is new.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ChangeReason {
    /// The property was never judged in this run.
    NewProperty,
    /// Its rules changed: digests of the rule file including its libraries, before and now.
    RuleChanged(String, String),
    /// Its rules are unchanged: the ontology or the program changed.
    SameRule,
}

/// An outcome that changed or is new.
#[derive(Debug, Clone, PartialEq)]
pub struct RecheckChange {
    /// Id of the run.
    pub run: String,
    /// Position of the action in the test, from 1.
    pub step: u32,
    /// IRI of the action.
    pub action: String,
    /// Outcome and margin in the history. `None` if the property was never judged there.
    pub before: Option<(Outcome, Option<f64>)>,
    /// The new judgement.
    pub now: Judgement,
    /// Reason for the change.
    pub why: ChangeReason,
}

/// One property over all rechecked runs.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RecheckLine {
    /// Outcomes in the history.
    pub before: Counts,
    /// Outcomes now.
    pub now: Counts,
    /// Outcomes of properties that were never judged before.
    pub new: u64,
    /// Outcomes that differ from before.
    pub changed: u64,
    /// Unchanged outcomes with a different margin, witness or rule.
    pub restated: u64,
    /// Outcomes that pass now because no left side of an `implies` held.
    pub vacuous: u64,
    /// Passed outcomes now whose property already held before the action.
    pub held_before: u64,
}

/// The result of a recheck.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecheckSummary {
    /// Number of rechecked runs.
    pub runs: u64,
    /// Counts by property IRI.
    pub properties: BTreeMap<String, RecheckLine>,
    /// Changes ordered by run, then by step, then by the order of the action's properties.
    pub changes: Vec<RecheckChange>,
}

impl RecheckSummary {
    /// Adds one judgement.
    pub fn add(&mut self, recheck: &Recheck) {
        let line = self
            .properties
            .entry(recheck.now.property.clone())
            .or_default();
        line.now.add(recheck.now.outcome);
        line.vacuous += u64::from(recheck.now.vacuous == Some(true));
        line.held_before += u64::from(recheck.now.held_before == Some(true));
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
        self.changes.push(RecheckChange {
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

    /// 1: a property fails. 0: at least one passes and none fails. 2: nothing could be decided.
    pub fn exit_code(&self) -> u8 {
        match self.now() {
            counts if counts.failed > 0 => 1,
            counts if counts.passed > 0 => 0,
            _ => 2,
        }
    }
}

fn why(before: Option<&Judgement>, now: &Judgement) -> ChangeReason {
    match before {
        None => ChangeReason::NewProperty,
        Some(before) if before.rule_digest != now.rule_digest => {
            ChangeReason::RuleChanged(before.rule_digest.clone(), now.rule_digest.clone())
        }
        Some(_) => ChangeReason::SameRule,
    }
}

/// Describes the reason, with digests shortened to `letters` characters.
pub(crate) fn reason_text(why: &ChangeReason, letters: usize) -> String {
    let short = |digest: &str| digest.get(..letters).unwrap_or(digest).to_owned();
    match why {
        ChangeReason::NewProperty => "property is new".to_owned(),
        ChangeReason::RuleChanged(before, now) => {
            format!("rule changed {} → {}", short(before), short(now))
        }
        ChangeReason::SameRule => "same rule, different ontology or program".to_owned(),
    }
}
