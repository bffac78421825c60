//! Finds the right sides of `implies` on which a pass may depend.
//!
//! Source: Beer, Ben-David, Eisner and Rodeh, "Efficient detection of vacuity in temporal model
//! checking", 2001: a formula passes vacuously if it still passes with a part replaced by the value
//! that makes it hardest to pass.

use std::collections::{BTreeMap, BTreeSet};

use crate::check::formulas::formulas_mut;
use crate::engine::reading::Decisive;
use crate::model::program::{CheckedProgram, Literal, PredicateId};
use crate::temporal::CheckedFormula;

/// Marks the right sides of `implies` that only make the property harder to pass if they are false.
/// Returns whether there is one.
///
/// A right side that counts both for and against the property, or through an aggregate, is left
/// out.
pub(crate) fn mark_consequents(program: &mut CheckedProgram, decisive: &Decisive) -> bool {
    let directions = directions(program, decisive);
    let mut found = false;
    for rule in &mut program.rules {
        let Some(own) = directions
            .get(&rule.head.predicate)
            .filter(|own| own.len() == 1)
        else {
            continue;
        };
        let helps = own.contains(&true);
        for formula in formulas_mut(rule) {
            mark(formula, helps, &mut found);
        }
    }
    found
}

/// Returns for each predicate whether its tuples help the property to pass (`true`), prevent it
/// (`false`), or both.
fn directions(
    program: &CheckedProgram,
    decisive: &Decisive,
) -> BTreeMap<PredicateId, BTreeSet<bool>> {
    let mut found: BTreeMap<PredicateId, BTreeSet<bool>> = BTreeMap::new();
    let mut waiting = vec![(decisive.predicate, decisive.positive)];
    while let Some((predicate, helps)) = waiting.pop() {
        if !found.entry(predicate).or_default().insert(helps) {
            continue;
        }
        for rule in program
            .rules
            .iter()
            .filter(|rule| rule.head.predicate == predicate)
        {
            for literal in &rule.body {
                match literal {
                    Literal::Positive(atom) | Literal::Negative(atom)
                        if rule.aggregation.is_some() =>
                    {
                        waiting.extend([(atom.predicate, true), (atom.predicate, false)]);
                    }
                    Literal::Positive(atom) => waiting.push((atom.predicate, helps)),
                    Literal::Negative(atom) => waiting.push((atom.predicate, !helps)),
                    Literal::Assign { .. } | Literal::Compare { .. } | Literal::Test { .. } => {}
                }
            }
        }
    }
    // The tuples that an aggregate reads directly may count for it or against it.
    for rule in program
        .rules
        .iter()
        .filter(|rule| rule.aggregation.is_some())
    {
        if let Some(own) = found.get_mut(&rule.head.predicate) {
            own.extend([true, false]);
        }
    }
    found
}

fn mark(formula: &mut CheckedFormula, helps: bool, found: &mut bool) {
    match formula {
        CheckedFormula::Compare { .. } | CheckedFormula::Truth { .. } => {}
        CheckedFormula::Not(inner) => mark(inner, !helps, found),
        CheckedFormula::And(parts)
        | CheckedFormula::Or(parts)
        | CheckedFormula::Temporal { parts, .. } => {
            parts.iter_mut().for_each(|part| mark(part, helps, found));
        }
        CheckedFormula::Consequent { formula, needed } => {
            // `a implies (b implies c)` asks for `c` only.
            let mut inner = false;
            mark(formula, helps, &mut inner);
            *needed = helps && !inner;
            *found |= helps || inner;
        }
    }
}
