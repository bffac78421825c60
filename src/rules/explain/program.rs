//! Explanations of the tuples of a standalone program.

use crate::engine::budget::Budget;
use crate::engine::evaluate::{Layers, Rounds, Tables, evaluate_recording_rounds, fault};
use crate::engine::meter::Meter;
use crate::engine::relation::finished;
use crate::explain::book::PROOFS_SHOWN;
use crate::explain::model::Explanation;
use crate::explain::proof::Prover;
use crate::explain::search::ProofContext;
use crate::model::program::PredicateId;
use crate::model::universe::Universe;
use crate::standalone::Program;
use actcheck_base::{RuleFault, Term};

impl Program {
    /// Explains why the program derives a statement such as `p(1, "a")`, or why not. `_` matches any value.
    ///
    /// # Errors
    /// The statement is invalid, or the budget was exceeded.
    pub fn explain(&self, statement: &str, budget: &Budget) -> Result<Explanation, RuleFault> {
        let (name, pattern) = self.pattern(statement).map_err(RuleFault::Value)?;
        let mut universe = Universe::new(&self.terms, None);
        let (mut rounds, mut meter) = (Rounds::default(), Meter::new(budget));
        let mut layers = Layers { own: Tables::new(self.predicates.len()), below: Vec::new() };
        let planned = &self.planned;
        evaluate_recording_rounds(
            planned,
            &self.predicates,
            &self.indexes,
            &mut layers,
            &mut universe,
            &mut meter,
            Some(&mut rounds),
        )
        .map_err(|stopped| fault(&meter, stopped, planned))?;
        let facts = self.stated();
        let context = ProofContext {
            predicates: &self.predicates,
            rules: planned.rules.iter().collect(),
            layers: vec![&layers.own],
            facts: vec![&facts],
            rounds: &rounds,
            universe: &universe,
        };
        let Some(predicate) = self.predicates.find(0, &name, None) else {
            return Err(RuleFault::Value(format!("the program has no predicate `{name}`")));
        };
        Ok(explained(statement, predicate, &pattern, &context))
    }

    /// Returns the program's facts without derived tuples.
    fn stated(&self) -> Tables {
        let mut facts = Tables::default();
        for (predicate, rows) in &self.planned.facts {
            let width = self.predicates.get(*predicate).width;
            facts.set(*predicate, finished(width, rows.clone(), self.indexes.of(*predicate).clone()));
        }
        facts
    }
}

fn explained(
    statement: &str,
    predicate: PredicateId,
    pattern: &[Option<Term>],
    context: &ProofContext<'_>,
) -> Explanation {
    // A term without an id occurs in no tuple, so the pattern can't match.
    let known: Option<Vec<Option<u32>>> = pattern
        .iter()
        .map(|term| term.as_ref().map_or(Some(None), |term| context.universe.id(term).map(Some)))
        .collect();
    let fits = |row: &&[u32]| {
        known.as_ref().is_some_and(|known| known.iter().zip(*row).all(|(k, v)| k.is_none_or(|k| k == *v)))
    };
    let mut prover = Prover::new(context);
    let proofs: Vec<_> =
        context.rows(predicate).filter(fits).take(PROOFS_SHOWN).map(|row| prover.prove(predicate, row, 0)).collect();
    let miss = match &known {
        Some(known) if proofs.is_empty() => context.miss(predicate, known, 0),
        _ => None,
    };
    let notes = if proofs.is_empty() && miss.is_none() {
        vec!["it is not a fact and no rule derives it".to_owned()]
    } else {
        Vec::new()
    };
    Explanation { title: statement.trim().to_owned(), findings: None, proofs, miss, notes }
}
