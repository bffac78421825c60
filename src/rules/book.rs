//! The rules of an ontology, prepared once and used by every worker for every run.

use std::collections::BTreeMap;

use crate::dataset::Statements;
use crate::evaluate::{Layers, Planned, Stopped, Tables, evaluate};
use crate::findings::Budget;
use crate::load::Given;
use crate::meter::Meter;
use crate::plan::Indexes;
use crate::prepare::Preparing;
use crate::program::Predicates;
use crate::reading::{Verdict, findings};
use crate::sparql::Query;
use crate::universe::Universe;
use actcheck_base::{ActionFacts, Diagnostics, Findings, RuleFault, Terms};
use actcheck_ontology::Ontology;

/// Every property's rules with the libraries, parsed, checked and planned. Shared between threads.
pub struct RuleBook {
    pub(crate) terms: Terms,
    pub(crate) predicates: Predicates,
    pub(crate) indexes: Indexes,
    pub(crate) given: Given,
    /// Tuples of the rules that read only the ontology, evaluated when the book is prepared.
    pub(crate) fixed: Tables,
    /// The ontology statements that rules read, without derived tuples.
    pub(crate) fixed_facts: Tables,
    pub(crate) fixed_rules: Planned,
    pub(crate) libraries: Planned,
    pub(crate) properties: BTreeMap<String, Judge>,
    pub(crate) statements: Statements,
    pub(crate) warnings: Diagnostics,
}

impl std::fmt::Debug for RuleBook {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RuleBook").field("properties", &self.properties.keys()).finish_non_exhaustive()
    }
}

/// The prepared rules of one property.
pub(crate) struct Judge {
    pub(crate) digest: String,
    pub(crate) label: String,
    pub(crate) rules: JudgeRules,
}

/// Rules by language.
pub(crate) enum JudgeRules {
    Datalog { planned: Box<Planned>, verdict: Verdict },
    Sparql(Box<Query>),
}

impl RuleBook {
    /// Parses, checks and plans the rule file of every property with all libraries.
    ///
    /// # Errors
    /// All errors of all files, each with its place.
    pub fn prepare(ontology: &Ontology) -> Result<Self, Diagnostics> {
        Self::prepare_within(ontology, &Budget::default())
    }

    /// Like [`RuleBook::prepare`], with a budget for each evaluation over the ontology alone.
    ///
    /// # Errors
    /// All errors of all files, each with its place, or an exceeded budget.
    pub fn prepare_within(ontology: &Ontology, budget: &Budget) -> Result<Self, Diagnostics> {
        Preparing::within(budget).run(ontology)
    }

    /// Judges an action by the given properties (IRIs). Evaluates the libraries once, then each property.
    ///
    /// A property that exceeds the budget or meets an invalid value gets a fault instead of findings. The others are
    /// not affected.
    pub fn judge(
        &self,
        facts: &ActionFacts<'_>,
        properties: &[String],
        budget: &Budget,
    ) -> BTreeMap<String, Result<Findings, RuleFault>> {
        let mut universe = Universe::new(&self.terms, Some(facts.terms));
        let derived = match self.enriched(facts, &mut universe, budget) {
            Ok(derived) => derived,
            Err(fault) => return properties.iter().map(|iri| (iri.clone(), Err(fault.clone()))).collect(),
        };
        let snapshot = std::cell::OnceCell::new();
        let mut results = BTreeMap::new();
        for iri in properties {
            let result = match self.properties.get(iri) {
                None => Err(RuleFault::Value(format!("unknown property {iri}"))),
                Some(Judge { rules: JudgeRules::Datalog { planned, verdict }, .. }) => {
                    self.datalog(planned, verdict, &derived, &mut universe, budget)
                }
                Some(Judge { rules: JudgeRules::Sparql(query), .. }) => {
                    let snapshot = snapshot.get_or_init(|| self.snapshot(facts, &derived, &mut universe));
                    query.judge(self, snapshot, &universe, budget)
                }
            };
            results.insert(iri.clone(), result);
        }
        results
    }

    /// Judges the state before an action as if it were also the state after. If a property already holds there, its
    /// success proves nothing about the action.
    pub fn held_before(
        &self,
        facts: &ActionFacts<'_>,
        properties: &[String],
        budget: &Budget,
    ) -> BTreeMap<String, Result<Findings, RuleFault>> {
        let unchanged = ActionFacts { after: facts.before, during: &[], ..*facts };
        self.judge(&unchanged, properties, budget)
    }

    /// Returns whether a property requires a result (`success`, `ASK`); otherwise it forbids an event (`violation`,
    /// `SELECT`).
    ///
    /// A forbidden event can't have happened before the action, so that such a property held before is not informative.
    pub fn states_success(&self, property: &str) -> bool {
        match self.properties.get(property).map(|judge| &judge.rules) {
            Some(JudgeRules::Datalog { verdict, .. }) => verdict.decisive.as_ref().is_some_and(|it| it.positive),
            Some(JudgeRules::Sparql(query)) => query.asks,
            None => false,
        }
    }

    /// Returns the digest of a property's rule file and all libraries; empty for an unknown property.
    pub fn digest(&self, property: &str) -> &str {
        self.properties.get(property).map_or("", |judge| &judge.digest)
    }

    /// Returns the warnings about the rules.
    pub fn warnings(&self) -> &Diagnostics {
        &self.warnings
    }

    /// Returns the facts of an action with the tuples that the libraries derive from them.
    pub(crate) fn enriched(
        &self,
        facts: &ActionFacts<'_>,
        universe: &mut Universe<'_>,
        budget: &Budget,
    ) -> Result<Tables, RuleFault> {
        let own = self.given.load(facts, universe, &self.predicates, &self.indexes);
        let mut layers = Layers { own, below: vec![&self.fixed] };
        let mut meter = Meter::new(budget);
        evaluate(&self.libraries, &self.predicates, &self.indexes, &mut layers, universe, &mut meter)
            .map_err(|stopped| fault(&meter, stopped, &self.libraries))?;
        Ok(layers.own)
    }

    fn datalog(
        &self,
        planned: &Planned,
        verdict: &Verdict,
        derived: &Tables,
        universe: &mut Universe<'_>,
        budget: &Budget,
    ) -> Result<Findings, RuleFault> {
        let mut layers = Layers { own: Tables::default(), below: vec![derived, &self.fixed] };
        let mut meter = Meter::new(budget);
        evaluate(planned, &self.predicates, &self.indexes, &mut layers, universe, &mut meter)
            .map_err(|stopped| fault(&meter, stopped, planned))?;
        findings(verdict, &layers, universe)
    }
}

/// Returns the fault of a stopped evaluation, with the rule's name and place.
pub(crate) fn fault(meter: &Meter, stopped: Stopped, planned: &Planned) -> RuleFault {
    meter.fault(stopped.stop, stopped.rule.map(|rule| &planned.rules[rule]))
}
