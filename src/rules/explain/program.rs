//! Explanations of the tuples of a standalone program.

use std::cell::{Cell, RefCell};

use crate::engine::budget::Budget;
use crate::engine::evaluate::{Layers, Rounds, Tables, evaluate_recording_rounds, fault};
use crate::engine::meter::Meter;
use crate::explain::goal::{Goal, goal_explained, invalid_goal};
use crate::explain::model::Explanation;
use crate::explain::search::{ProofContext, stated_facts};
use crate::model::program::PredicateId;
use crate::model::universe::Universe;
use crate::standalone::Program;
use actcheck_base::{Diagnostics, RuleFault};

impl Program {
    /// Explains why the program derives a statement such as `p(1, "a")`, or why not. `_` matches
    /// any value.
    ///
    /// # Errors
    /// The statement is invalid, or the budget was exceeded.
    pub fn explain(&self, statement: &str, budget: &Budget) -> Result<Explanation, RuleFault> {
        let (goal, predicate) = self
            .goal(statement)
            .map_err(|faults| invalid_goal(&faults))?;
        let mut universe = Universe::new(&self.terms, None);
        let (mut rounds, mut meter) = (Rounds::default(), Meter::new(budget));
        let mut layers = Layers {
            own: Tables::new(self.predicates.len()),
            below: Vec::new(),
        };
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
        let (known, unknown) = goal.known(&mut universe);
        let watch = meter.into_watch();
        let context = ProofContext {
            predicates: &self.predicates,
            rules: planned.rules.iter().collect(),
            layers: vec![&layers.own],
            facts: vec![&facts],
            rounds: &rounds,
            universe: &universe,
            watch: &watch,
            exhausted: Cell::new(false),
            deciding: RefCell::default(),
        };
        Ok(Explanation {
            unknown,
            ..goal_explained(statement, predicate, &known, &context)
        })
    }

    /// Checks a statement such as `p(1, "a")` before it is explained.
    ///
    /// # Errors
    /// `R092` with the place in the statement: a syntax error, an unknown predicate, the wrong
    /// number of arguments.
    pub fn check_goal(&self, statement: &str) -> Result<(), Diagnostics> {
        self.goal(statement).map(|_| ())
    }

    fn goal(&self, statement: &str) -> Result<(Goal, PredicateId), Diagnostics> {
        let goal = Goal::parse(statement, &self.syntax.prefixes)?;
        let predicate = goal.predicate(&self.predicates, &[0])?;
        Ok((goal, predicate))
    }
}
