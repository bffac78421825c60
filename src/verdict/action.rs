//! Judges one performed action of a new or a stored run.

use std::collections::BTreeMap;

use crate::judge::{Fate, judge};
use actcheck_base::{ActionFacts, Findings, Judgement, Outcome, RuleFault, Triple};
use actcheck_data::ActionEnd;
use actcheck_ontology::{Action, Ontology};
use actcheck_rules::{Budget, RuleBook};

/// The evaluation of rules was interrupted: the budget's `stop` was set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("interrupted")]
pub struct Interrupted;

/// Returns the outcomes of an action's success properties. Rules are evaluated only for completed
/// actions, those of preconditions for the state before the action alone, those of premises for the
/// first state of the run (`start`).
///
/// # Errors
/// [`Interrupted`] if the budget's `stop` is set during a long evaluation.
pub fn judge_action(
    ontology: &Ontology,
    rules: &RuleBook,
    action: &Action,
    end: &ActionEnd,
    (start, facts): (&[Triple], Option<ActionFacts<'_>>),
    budget: &Budget,
) -> Result<Vec<Judgement>, Interrupted> {
    let fate = match end {
        ActionEnd::Completed => Fate::Completed,
        ActionEnd::Broken(reason) => Fate::Broken(reason.clone()),
        ActionEnd::Timeout(reason) | ActionEnd::Cut(reason) => Fate::Timeout(reason.clone()),
        ActionEnd::NotReached => Fate::NotReached,
        ActionEnd::NotPerformed(reason) => Fate::NotPerformed(reason.clone()),
    };
    let findings = match (&fate, facts) {
        (Fate::Completed, Some(facts)) => {
            let mut found = uninterrupted(rules.judge(&facts, &action.success_properties, budget))?;
            found.extend(uninterrupted(rules.held_before(
                &facts,
                &action.preconditions,
                budget,
            ))?);
            let first = ActionFacts {
                before: start,
                ..facts
            };
            found.extend(uninterrupted(rules.held_before(
                &first,
                &action.premises,
                budget,
            ))?);
            found
        }
        _ => BTreeMap::new(),
    };
    let mut judgements = judge(ontology, action, &findings, &fate, |property| {
        rules.digest(property).to_owned()
    });
    if let Some(facts) = facts {
        note_held_before(rules, &facts, &mut judgements, budget)?;
        note_vacuous(rules, &facts, &mut judgements, budget)?;
    }
    Ok(judgements)
}

type Found = BTreeMap<String, Result<Findings, RuleFault>>;

/// Returns the findings, or [`Interrupted`] if an evaluation was interrupted.
fn uninterrupted(found: Found) -> Result<Found, Interrupted> {
    let interrupted = found
        .values()
        .any(|found| *found == Err(RuleFault::Interrupted));
    if interrupted {
        Err(Interrupted)
    } else {
        Ok(found)
    }
}

/// Sets `held_before` on the passed judgements whose property states success. It stays unset if the
/// state before the action could not be judged.
fn note_held_before(
    rules: &RuleBook,
    facts: &ActionFacts<'_>,
    judgements: &mut [Judgement],
    budget: &Budget,
) -> Result<(), Interrupted> {
    let asked = passed(judgements, |property| rules.states_success(property));
    if asked.is_empty() {
        return Ok(());
    }
    let before = uninterrupted(rules.held_before(facts, &asked, budget))?;
    for judgement in judgements {
        judgement.held_before = judgement
            .held_before
            .or(holds(&before, &judgement.property));
    }
    Ok(())
}

/// Sets `vacuous` on the passed judgements whose property has an `implies`.
fn note_vacuous(
    rules: &RuleBook,
    facts: &ActionFacts<'_>,
    judgements: &mut [Judgement],
    budget: &Budget,
) -> Result<(), Interrupted> {
    let asked = passed(judgements, |property| rules.can_pass_vacuously(property));
    if asked.is_empty() {
        return Ok(());
    }
    let found = uninterrupted(rules.without_consequents(facts, &asked, budget))?;
    for judgement in judgements {
        judgement.vacuous = judgement.vacuous.or(holds(&found, &judgement.property));
    }
    Ok(())
}

/// The passed properties of a kind.
fn passed(judgements: &[Judgement], is_of_kind: impl Fn(&str) -> bool) -> Vec<String> {
    judgements
        .iter()
        .filter(|judgement| judgement.outcome == Outcome::Passed && is_of_kind(&judgement.property))
        .map(|judgement| judgement.property.clone())
        .collect()
}

/// Whether a property applies and holds; `None` if it was not judged.
fn holds(found: &Found, property: &str) -> Option<bool> {
    let found = found.get(property)?.as_ref().ok()?;
    Some(found.applicable && found.holds)
}
