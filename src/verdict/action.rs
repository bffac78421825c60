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

/// Sets `held_before` on the passed judgements whose property states success.
fn note_held_before(
    rules: &RuleBook,
    facts: &ActionFacts<'_>,
    judgements: &mut [Judgement],
    budget: &Budget,
) -> Result<(), Interrupted> {
    let asked: Vec<String> = judgements
        .iter()
        .filter(|judgement| {
            judgement.outcome == Outcome::Passed && rules.states_success(&judgement.property)
        })
        .map(|judgement| judgement.property.clone())
        .collect();
    if asked.is_empty() {
        return Ok(());
    }
    let before = uninterrupted(rules.held_before(facts, &asked, budget))?;
    for judgement in judgements {
        // `held_before` stays unset if the state before the action could not be judged.
        if let Some(Ok(found)) = before.get(&judgement.property) {
            judgement.held_before = Some(found.applicable && found.holds);
        }
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
    let asked: Vec<String> = judgements
        .iter()
        .filter(|judgement| {
            judgement.outcome == Outcome::Passed && rules.can_pass_vacuously(&judgement.property)
        })
        .map(|judgement| judgement.property.clone())
        .collect();
    if asked.is_empty() {
        return Ok(());
    }
    let found = uninterrupted(rules.without_consequents(facts, &asked, budget))?;
    for judgement in judgements {
        if let Some(Ok(found)) = found.get(&judgement.property) {
            judgement.vacuous = Some(found.applicable && found.holds);
        }
    }
    Ok(())
}
