//! Derives outcomes from the rules' findings.

use std::collections::BTreeMap;

use actcheck_base::{Findings, Judgement, Outcome, RuleFault, Term, WitnessRow, names};
use actcheck_ontology::{Action, Ontology, Property};

/// How an action ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Fate {
    /// The action reported its end: the rules decide.
    Completed,
    /// A fault in the simulation, the transport or the tool.
    Broken(String),
    /// A budget was exhausted.
    Timeout(String),
    /// The action was never reached.
    NotReached,
    /// A precondition did not hold, with the reason: the action was not performed.
    NotPerformed(String),
}

/// Returns the outcomes of an action's success properties, in the action's order.
///
/// `findings` holds the rules' findings for these properties, and for the action's preconditions and
/// premises. It is ignored unless the fate is `Completed`. A property without findings is `broken`:
/// verdicts are never invented.
pub fn judge(
    ontology: &Ontology,
    action: &Action,
    findings: &BTreeMap<String, Result<Findings, RuleFault>>,
    fate: &Fate,
    rule_digest: impl Fn(&str) -> String,
) -> Vec<Judgement> {
    let unmet = unmet(ontology, &action.premises, "premise", findings)
        .or_else(|| unmet_precondition(ontology, action, findings));
    let decide = |iri: &String| {
        let property = ontology.properties.get(iri);
        let (outcome, margin, witness) = match fate {
            Fate::Broken(reason) => (Outcome::Broken, None, reason.clone()),
            Fate::Timeout(reason) => (Outcome::Timeout, None, reason.clone()),
            Fate::NotReached => (
                Outcome::Untested,
                None,
                "the action was never reached".to_owned(),
            ),
            Fate::NotPerformed(reason) => (Outcome::Inapplicable, None, reason.clone()),
            Fate::Completed => match (&unmet, findings.get(iri)) {
                (Some(unmet), _) => unmet.clone(),
                (None, Some(result)) => outcome_of(result, property),
                (None, None) => (
                    Outcome::Broken,
                    None,
                    "no rule was evaluated for this property".to_owned(),
                ),
            },
        };
        Judgement {
            property: iri.clone(),
            outcome,
            margin,
            witness,
            rule_digest: rule_digest(iri),
            held_before: None,
            vacuous: None,
        }
    };
    action.success_properties.iter().map(decide).collect()
}

/// Returns the reason why an action must not be performed: the first of its preconditions that does
/// not hold, and its witness. `findings` holds the rules' findings for its preconditions.
///
/// Returns `None` if all hold or are inapplicable, and if one can't be decided: the action is then
/// performed, and its properties get the outcome of that precondition.
pub fn reason_not_to_perform(
    ontology: &Ontology,
    action: &Action,
    findings: &BTreeMap<String, Result<Findings, RuleFault>>,
) -> Option<String> {
    let (outcome, _, reason) = unmet_precondition(ontology, action, findings)?;
    (outcome == Outcome::Inapplicable).then_some(reason)
}

/// Returns the outcome that all success properties share if a precondition does not hold, or `None`
/// if all preconditions hold or are inapplicable.
fn unmet_precondition(
    ontology: &Ontology,
    action: &Action,
    findings: &BTreeMap<String, Result<Findings, RuleFault>>,
) -> Option<(Outcome, Option<f64>, String)> {
    unmet(ontology, &action.preconditions, "precondition", findings)
}

/// Returns the outcome that all success properties share if one of some conditions does not hold.
fn unmet(
    ontology: &Ontology,
    conditions: &[String],
    kind: &str,
    findings: &BTreeMap<String, Result<Findings, RuleFault>>,
) -> Option<(Outcome, Option<f64>, String)> {
    conditions.iter().find_map(|iri| {
        let property = ontology.properties.get(iri);
        let label = property.map_or_else(|| names::local(iri), |p| p.label.as_str());
        match findings.get(iri).map(|result| outcome_of(result, property)) {
            Some((Outcome::Passed | Outcome::Inapplicable, ..)) => None,
            Some((Outcome::Failed, _, words)) => Some((
                Outcome::Inapplicable,
                None,
                format!("the {kind} `{label}` does not hold: {words}"),
            )),
            Some((outcome, _, words)) => {
                Some((outcome, None, format!("the {kind} `{label}`: {words}")))
            }
            None => Some((
                Outcome::Broken,
                None,
                format!("the {kind} `{label}` was not evaluated"),
            )),
        }
    })
}

fn outcome_of(
    result: &Result<Findings, RuleFault>,
    property: Option<&Property>,
) -> (Outcome, Option<f64>, String) {
    match result {
        Err(fault) => (fault.outcome(), None, fault.reason().to_owned()),
        Ok(found) => {
            let margin = found.margin.filter(|_| found.applicable);
            (found.outcome(), margin, words(found, property))
        }
    }
}

/// Returns the rule author's explanation, or else the witness tuples as text, or else the distance
/// from holding.
fn words(found: &Findings, property: Option<&Property>) -> String {
    if !found.because.is_empty() {
        return found.because.join("; ");
    }
    if !found.applicable {
        return "the property does not apply".to_owned();
    }
    if !found.witness.is_empty() {
        let mut rows: Vec<String> = found.witness.iter().map(spell).collect();
        let left_out = found.witness_count.saturating_sub(found.witness.len());
        if left_out > 0 {
            rows.push(format!("{left_out} more"));
        }
        return rows.join("; ");
    }
    let unit = property
        .and_then(|p| p.unit.as_deref())
        .filter(|unit| *unit != "1")
        .unwrap_or("");
    match (found.holds, found.margin) {
        (true, _) => "nothing violates it".to_owned(),
        (false, Some(margin)) => format!(
            "no success was derived; missed by {} {unit}",
            short(-margin)
        )
        .trim_end()
        .to_owned(),
        (false, None) => "no success was derived".to_owned(),
    }
}

fn spell(row: &WitnessRow) -> String {
    let values: Vec<String> = row
        .values
        .iter()
        .map(|(name, term)| {
            if name.is_empty() {
                readable(term)
            } else {
                format!("{name} = {}", readable(term))
            }
        })
        .collect();
    format!("{}({})", row.predicate, values.join(", "))
}

fn readable(term: &Term) -> String {
    match term {
        Term::Iri(iri) => names::local(iri).to_owned(),
        Term::Double(value) => short(*value),
        Term::String(text) => text.to_string(),
        other => other.to_string(),
    }
}

/// Formats a number with four significant digits.
fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let decimals = (3 - value.abs().log10().floor() as i32).clamp(0, 9);
    let text = format!("{value:.*}", usize::try_from(decimals).unwrap_or(0));
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(holds: bool) -> Result<Findings, RuleFault> {
        Ok(Findings {
            applicable: true,
            holds,
            witness: vec![],
            witness_count: 0,
            margin: Some(-0.016),
            because: vec![],
        })
    }

    #[test]
    fn a_tool_fault_is_not_a_robot_failure() {
        assert_eq!(outcome_of(&found(false), None).0, Outcome::Failed);
        assert_eq!(
            outcome_of(&Err(RuleFault::BudgetSpent("rule x".into())), None).0,
            Outcome::Timeout
        );
        assert_eq!(
            outcome_of(&Err(RuleFault::Value("no number".into())), None).0,
            Outcome::Broken
        );
    }

    #[test]
    fn witnesses_include_the_margin() {
        assert_eq!(
            outcome_of(&found(false), None).2,
            "no success was derived; missed by 0.016"
        );
        assert_eq!(short(0.000_412_34), "0.0004123");
        assert_eq!(short(1234.6), "1235");
    }
}
