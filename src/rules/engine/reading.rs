//! Reads a property's findings from the tuples of its rules.

use crate::engine::evaluate::Layers;
use crate::model::program::{CheckedProgram, PredicateId, Predicates};
use crate::model::universe::Universe;
use crate::model::values::{Number, lexical};
use actcheck_base::{Findings, RuleFault, Term, WitnessRow};

/// The predicates of a property that determine the verdict.
#[derive(Debug, Clone)]
pub(crate) struct Verdict {
    /// `success` or `violation`.
    pub(crate) decisive: Option<Decisive>,
    pub(crate) margin: Option<PredicateId>,
    pub(crate) applicable: Option<PredicateId>,
    pub(crate) because: Option<PredicateId>,
}

/// The predicate that decides the outcome.
#[derive(Debug, Clone)]
pub(crate) struct Decisive {
    pub(crate) predicate: PredicateId,
    /// `true` for `success`, whose tuples prove that the property holds; `false` for `violation`.
    pub(crate) positive: bool,
    /// Number of arguments as written.
    pub(crate) arity: usize,
    /// Names of the arguments in the first rule's head.
    pub(crate) names: Vec<String>,
}

impl Verdict {
    pub(crate) fn new(program: &CheckedProgram, predicates: &Predicates, scope: usize) -> Self {
        let find = |name: &str| predicates.find(scope, name, None);
        let decisive = [("success", true), ("violation", false)]
            .into_iter()
            .find_map(|(name, positive)| {
                let predicate = find(name)?;
                let rule = program
                    .rules
                    .iter()
                    .find(|rule| rule.head.predicate == predicate);
                let names = rule.map_or(Vec::new(), |rule| rule.head_names.clone());
                Some(Decisive {
                    predicate,
                    positive,
                    arity: predicates.get(predicate).arity,
                    names,
                })
            });
        Self {
            decisive,
            margin: find("margin"),
            applicable: find("applicable"),
            because: find("because"),
        }
    }
}

/// Reads the findings of a property.
pub(crate) fn findings(
    verdict: &Verdict,
    layers: &Layers<'_>,
    universe: &Universe<'_>,
) -> Result<Findings, RuleFault> {
    let Some(decisive) = &verdict.decisive else {
        return Err(RuleFault::Value(
            "the rules define neither success nor violation".into(),
        ));
    };
    let width = decisive.arity.max(1);
    let rows = layers.rows(decisive.predicate);
    let witness_count = rows.len() / width;
    let mut tuples: Vec<Vec<Term>> = rows
        .chunks_exact(width)
        .map(|row| {
            row[..decisive.arity]
                .iter()
                .map(|id| universe.term(*id).clone())
                .collect()
        })
        .collect();
    tuples.sort();
    tuples.truncate(Findings::WITNESS_LIMIT);
    let predicate = if decisive.positive {
        "success"
    } else {
        "violation"
    };
    let witness = tuples
        .into_iter()
        .map(|tuple| WitnessRow {
            predicate: predicate.to_owned(),
            values: tuple
                .into_iter()
                .enumerate()
                .map(|(idx, term)| (decisive.names.get(idx).cloned().unwrap_or_default(), term))
                .collect(),
        })
        .collect();
    Ok(Findings {
        applicable: verdict
            .applicable
            .is_none_or(|predicate| !layers.rows(predicate).is_empty()),
        holds: (witness_count > 0) == decisive.positive,
        witness,
        witness_count,
        margin: margin(verdict, layers, universe)?,
        because: because(verdict, layers, universe),
    })
}

fn margin(
    verdict: &Verdict,
    layers: &Layers<'_>,
    universe: &Universe<'_>,
) -> Result<Option<f64>, RuleFault> {
    let mut smallest: Option<f64> = None;
    for id in verdict
        .margin
        .map_or(&[][..], |predicate| layers.rows(predicate))
    {
        smallest = Some(smaller_margin(smallest, universe.term(*id))?);
    }
    Ok(smallest)
}

/// Returns the value of a margin, or the smallest one so far if that is less.
///
/// # Errors
/// The term is not a number.
pub(crate) fn smaller_margin(smallest: Option<f64>, term: &Term) -> Result<f64, RuleFault> {
    let value = Number::of(term)
        .map(Number::double)
        .filter(|value| !value.is_nan());
    let value = value.ok_or_else(|| RuleFault::Value(format!("margin {term} is not a number")))?;
    Ok(smallest.map_or(value, |least| least.min(value)))
}

fn because(verdict: &Verdict, layers: &Layers<'_>, universe: &Universe<'_>) -> Vec<String> {
    let rows = verdict
        .because
        .map_or(&[][..], |predicate| layers.rows(predicate));
    let mut texts: Vec<String> = rows.iter().map(|id| lexical(universe.term(*id))).collect();
    texts.sort();
    texts
}
