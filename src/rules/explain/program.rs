//! Explanations of the tuples of a standalone program.

use crate::engine::budget::Budget;
use crate::engine::evaluate::{Layers, Rounds, Tables, evaluate_recording_rounds, fault};
use crate::engine::meter::Meter;
use crate::explain::goal::{Goal, goal_explained};
use crate::explain::model::Explanation;
use crate::explain::search::{ProofContext, stated_facts};
use crate::model::universe::Universe;
use crate::standalone::Program;
use actcheck_base::RuleFault;

impl Program {
    /// Explains why the program derives a statement such as `p(1, "a")`, or why not. `_` matches any value.
    ///
    /// # Errors
    /// The statement is invalid, or the budget was exceeded.
    pub fn explain(&self, statement: &str, budget: &Budget) -> Result<Explanation, RuleFault> {
        let goal = Goal::parse(statement, &self.syntax.prefixes)?;
        let predicate = goal.predicate(&self.predicates, &[0])?;
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
        let facts = stated_facts(&[planned], &self.predicates, &self.indexes);
        let known = goal.known(&mut universe);
        let context = ProofContext {
            predicates: &self.predicates,
            rules: planned.rules.iter().collect(),
            layers: vec![&layers.own],
            facts: vec![&facts],
            rounds: &rounds,
            universe: &universe,
        };
        Ok(goal_explained(statement, predicate, &known, &context))
    }
}
