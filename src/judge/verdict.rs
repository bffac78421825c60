//! The outcomes of one action, with their explanations.

use actcheck_base::{Diagnostic, Diagnostics, Judgement, Outcome, RuleFault, RunFacts, guarded};
use actcheck_base::{did_you_mean, names};
use actcheck_rules::Budget;
use actcheck_rules::explain::Explanation;
use actcheck_verdict::action_score;

use crate::Judge;
use crate::book::panicked;

/// The outcomes of one action.
#[derive(Debug, Clone)]
pub struct Verdict {
    judge: Judge,
    facts: RunFacts,
    judgements: Vec<Judgement>,
}

impl Verdict {
    pub(crate) fn new(judge: Judge, facts: RunFacts, judgements: Vec<Judgement>) -> Self {
        Self {
            judge,
            facts,
            judgements,
        }
    }

    /// Returns one judgement for each success property, in the action's order.
    pub fn judgements(&self) -> &[Judgement] {
        &self.judgements
    }

    /// Returns the facts that decided.
    pub fn facts(&self) -> &RunFacts {
        &self.facts
    }

    /// Whether every property that could be decided passed, and at least one was decided. A property
    /// that broke or exceeded its budget did not pass.
    pub fn passed(&self) -> bool {
        let mut decided = (self.judgements.iter())
            .filter(|judgement| judgement.outcome != Outcome::Inapplicable)
            .peekable();
        decided.peek().is_some() && decided.all(|judgement| judgement.outcome == Outcome::Passed)
    }

    /// Returns the share of the applicable properties that passed, in [0, 1].
    pub fn score(&self) -> f64 {
        action_score(self.judgements.iter().map(|judgement| judgement.outcome))
    }

    /// Returns the local names of the facts that a property reads and that were not given. If it is
    /// decided, its outcome is certain without them.
    ///
    /// # Errors
    /// `J012` if the verdict has no such property.
    pub fn missing(&self, property: &str) -> Result<Vec<&str>, Diagnostics> {
        let iri = self.iri(property)?;
        let missing = self.facts.action(0).map(|facts| {
            let rules = &self.judge.prepared_rules().rules;
            rules.missing(&facts, iri)
        });
        let local = |iri: &'_ str| -> usize {
            iri.strip_prefix(names::W)
                .map_or(0, |local| iri.len() - local.len())
        };
        let missing = missing.unwrap_or_default().into_iter();
        Ok(missing.map(|iri| &iri[local(iri)..]).collect())
    }

    /// Explains the outcome of a property, as `actcheck why` does: its proof, or the rule that came
    /// closest.
    ///
    /// # Errors
    /// `J012` if the verdict has no such property, or it can't be explained.
    pub fn why(&self, property: &str) -> Result<String, Diagnostics> {
        let iri = self.iri(property)?;
        self.explained(|judge| {
            let facts = self.facts.action(0)?;
            let rules = &judge.prepared_rules().rules;
            Some(rules.explain(&facts, iri, &Budget::default()))
        })
    }

    /// Explains why the rules of a property do not derive a statement, such as
    /// `near_its_place(obj:cube)`, or why they do. `_` matches any value.
    ///
    /// # Errors
    /// `J012` if the verdict has no such property, or the statement is invalid.
    pub fn why_not(&self, property: &str, statement: &str) -> Result<String, Diagnostics> {
        let iri = self.iri(property)?;
        self.explained(|judge| {
            let facts = self.facts.action(0)?;
            let rules = &judge.prepared_rules().rules;
            Some(rules.explain_statement(&facts, iri, statement, &Budget::default()))
        })
    }

    fn explained(
        &self,
        explain: impl FnOnce(&Judge) -> Option<Result<Explanation, RuleFault>>,
    ) -> Result<String, Diagnostics> {
        let explained = guarded(|| explain(&self.judge)).ok_or_else(panicked)?;
        match explained {
            Some(Ok(explanation)) => Ok(explanation.to_text()),
            Some(Err(fault)) => Err(Diagnostic::error("J012", fault.to_string()).into()),
            None => Err(Diagnostic::error("J012", "the action has no facts").into()),
        }
    }

    /// Returns the IRI of a property of this verdict, by its local name or IRI.
    fn iri(&self, property: &str) -> Result<&str, Diagnostics> {
        let iris = || {
            self.judgements
                .iter()
                .map(|judgement| judgement.property.as_str())
        };
        let found = iris().find(|iri| *iri == property || names::local(iri) == property);
        found.ok_or_else(|| {
            let known: Vec<&str> = iris().map(names::local).collect();
            Diagnostic::error("J012", format!("no property `{property}` was judged"))
                .help(did_you_mean(property, known))
                .into()
        })
    }
}
