//! Decides before each action of a run whether its preconditions hold.

use crate::Env;
use actcheck_actions::{ActionCall, Gate};
use actcheck_base::{ActionFacts, RuleFault, RunFacts};
use actcheck_data::{ActionTrace, Scene, SceneMap, Snapshot, Trace};
use actcheck_facts as facts;
use actcheck_verdict::reason_not_to_perform;
use std::collections::BTreeMap;

/// The preconditions of the actions of one run.
pub(super) struct Preconditions<'a> {
    env: &'a Env,
    map: &'a SceneMap,
    /// Whether an evaluation was interrupted, so that the run can't be judged.
    pub(super) interrupted: bool,
}

impl<'a> Preconditions<'a> {
    pub(super) fn new(env: &'a Env, scene: &'a Scene) -> Self {
        Self {
            env,
            map: &scene.map,
            interrupted: false,
        }
    }
}

impl Gate for Preconditions<'_> {
    fn reason_not_to_perform(&mut self, call: &ActionCall, state: &Snapshot) -> Option<String> {
        let Env {
            ontology,
            rules,
            rule_budget,
            ..
        } = self.env;
        let action = ontology
            .actions
            .get(&call.action)
            .filter(|action| !action.preconditions.is_empty())?;
        let facts = facts_of_state(state, &call.parameters, self.map);
        let found = rules.held_before(&facts_before(&facts), &action.preconditions, rule_budget);
        self.interrupted |= found
            .values()
            .any(|found| *found == Err(RuleFault::Interrupted));
        reason_not_to_perform(ontology, action, &found)
    }
}

/// The facts of one state, with the values of designators.
pub(super) fn facts_of_state(
    state: &Snapshot,
    parameters: &BTreeMap<String, Vec<String>>,
    map: &SceneMap,
) -> RunFacts {
    facts::extract(&Trace {
        snapshots: vec![state.clone()],
        // Not performed: it only holds the values of the designators.
        actions: vec![ActionTrace::not_reached("", parameters)],
        map: map.clone(),
        ..Trace::default()
    })
}

/// The facts of an action that changed nothing, from [`facts_of_state`].
pub(super) fn facts_before(facts: &RunFacts) -> ActionFacts<'_> {
    let state = facts.snapshots.first().map_or(&[][..], Vec::as_slice);
    let parameters = facts.parameters.first().map_or(&[][..], Vec::as_slice);
    ActionFacts {
        terms: &facts.terms,
        before: state,
        after: state,
        during: &[],
        parameters,
        course: None,
        lacks: &facts.lacks,
    }
}
