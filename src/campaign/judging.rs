//! Judges one performed action of a new or a stored run.

use std::collections::BTreeMap;

use crate::Failure;
use actcheck_base::{ActionFacts, Findings, Judgement, Outcome, RuleFault};
use actcheck_data::ActionEnd;
use actcheck_ontology::{Action, Ontology};
use actcheck_rules::{Budget, RuleBook};
use actcheck_verdict::{Fate, judge};

/// Returns the outcomes of an action's success properties. Rules are evaluated only for completed
/// actions, those of preconditions for the state before the action alone.
///
/// # Errors
/// [`Failure::Interrupted`] if the budget's `stop` is set during a long evaluation.
pub(super) fn judge_action(
    ontology: &Ontology,
    rules: &RuleBook,
    action: &Action,
    end: &ActionEnd,
    facts: Option<ActionFacts<'_>>,
    budget: &Budget,
) -> Result<Vec<Judgement>, Failure> {
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

/// Returns the findings, or [`Failure::Interrupted`] if an evaluation was interrupted.
fn uninterrupted(found: Found) -> Result<Found, Failure> {
    let interrupted = found
        .values()
        .any(|found| *found == Err(RuleFault::Interrupted));
    if interrupted {
        Err(Failure::Interrupted)
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
) -> Result<(), Failure> {
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
) -> Result<(), Failure> {
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
