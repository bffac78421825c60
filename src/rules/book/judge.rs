//! The rules of an ontology, prepared once and used by every worker for every run.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::check::checking::unique;
use crate::check::facts_read::FactsRead;
use crate::check::formulas::Bound;
use crate::engine::budget::Budget;
use crate::engine::evaluate::{Layers, Planned, Tables, evaluate, fault};
use crate::engine::load::Given;
use crate::engine::meter::Meter;
use crate::engine::plan::Indexes;
use crate::engine::reading::{Verdict, findings};
use crate::model::program::{Predicates, Scope};
use crate::model::universe::Universe;
#[cfg(feature = "sparql")]
use crate::sparql::{dataset::Statements, query::Query, snapshot::snapshot};
use crate::temporal::UNRECORDED;
use actcheck_base::{ActionFacts, Diagnostics, Findings, RuleFault, Term, Terms};

/// Every property's rules with the libraries, parsed, checked and planned. Shared between threads.
///
/// The libraries are evaluated once for an action, then each property. For the rules of one
/// property, [`Rules`](crate::Rules) is simpler.
///
/// ```
/// use actcheck_base::Source;
/// use actcheck_ontology::{Ontology, Property, RuleFile};
/// use actcheck_rules::{Budget, Facts, RuleBook};
///
/// let mut ontology = Ontology::default();
/// for (iri, text) in [
///     (
///         "http://example.org/onTable",
///         "success(?x) :- after(?x, <http://example.org/on>, <http://example.org/table>) .",
///     ),
///     ("http://example.org/allDry", "violation(?x) :- after(?x, <http://example.org/wet>, true) ."),
/// ] {
///     let rule = RuleFile::new(Source::new(format!("{iri}.rls"), text));
///     ontology.properties.insert(iri.to_owned(), Property::new(iri, rule));
/// }
/// let book = RuleBook::prepare(&ontology)?;
///
/// let facts = Facts::from_turtle("@prefix : <http://example.org/> . :cup :on :table ; :wet true .")?;
/// let properties: Vec<String> = ontology.properties.keys().cloned().collect();
/// let findings = book.judge(&facts.as_action(), &properties, &Budget::default());
/// let holds = |iri: &str| findings[iri].as_ref().map(|found| found.holds);
/// assert_eq!(holds("http://example.org/onTable"), Ok(true));
/// assert_eq!(holds("http://example.org/allDry"), Ok(false));
/// # Ok::<(), actcheck_base::Diagnostics>(())
/// ```
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
    /// The ontology's statements with their closure; `None` without statements.
    pub(crate) closed: Option<Arc<[[Term; 3]]>>,
    /// The ontology's statements, for queries.
    #[cfg(feature = "sparql")]
    pub(crate) statements: Statements,
    pub(crate) warnings: Diagnostics,
    /// Whether a rule reads quantities over time.
    pub(crate) reads_course: bool,
    /// The intervals of formulas.
    pub(crate) bounds: Vec<Bound>,
}

impl std::fmt::Debug for RuleBook {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RuleBook")
            .field("properties", &self.properties.keys())
            .finish_non_exhaustive()
    }
}

/// The prepared rules of one property.
pub(crate) struct Judge {
    pub(crate) digest: String,
    pub(crate) label: String,
    pub(crate) rules: JudgeRules,
    pub(crate) reads: FactsRead,
}

/// Rules by language.
pub(crate) enum JudgeRules {
    Datalog {
        planned: Box<Planned>,
        verdict: Verdict,
        /// Whether its rules read quantities over time.
        reads_course: bool,
        /// Whether its pass may depend on the right side of an `implies`.
        implies: bool,
        /// Scope of the file's predicates.
        scope: Scope,
        /// Prefixes that the file declares.
        prefixes: Vec<(String, String)>,
    },
    #[cfg(feature = "sparql")]
    Sparql(Box<Query>),
}

impl RuleBook {
    /// Judges an action by the given properties (IRIs). Evaluates the libraries once, then each
    /// property.
    ///
    /// A property that exceeds the budget or meets an invalid value gets a fault instead of
    /// findings. The others are not affected. A property whose outcome depends on facts that were not
    /// recorded ([`ActionFacts::lacks`]) is inapplicable.
    pub fn judge(
        &self,
        facts: &ActionFacts<'_>,
        properties: &[String],
        budget: &Budget,
    ) -> BTreeMap<String, Result<Findings, RuleFault>> {
        self.judge_as(facts, properties, budget, false)
    }

    fn judge_as(
        &self,
        facts: &ActionFacts<'_>,
        properties: &[String],
        budget: &Budget,
        fails_consequents: bool,
    ) -> BTreeMap<String, Result<Findings, RuleFault>> {
        if properties.is_empty() {
            return BTreeMap::new();
        }
        let mut universe = Universe::of_action(&self.terms, facts);
        let derived = match self.enriched(facts, &mut universe, budget) {
            Ok(derived) => derived,
            Err(fault) => {
                return properties
                    .iter()
                    .map(|iri| (iri.clone(), Err(fault.clone())))
                    .collect();
            }
        };
        #[cfg(feature = "sparql")]
        let graphs = std::cell::OnceCell::new();
        let mut results = BTreeMap::new();
        let label = universe.next_label();
        for iri in properties {
            // A property's new things don't depend on the properties that are judged with it.
            universe.label_from(label);
            let judge = self.properties.get(iri);
            let unevaluated = judge.and_then(|judge| judge.reads.unevaluated(facts.lacks));
            if let Some(findings) = unevaluated {
                results.insert(iri.clone(), Ok(findings));
                continue;
            }
            let result = match judge {
                None => Err(RuleFault::Value(format!("unknown property {iri}"))),
                Some(Judge {
                    rules:
                        JudgeRules::Datalog {
                            planned,
                            verdict,
                            reads_course,
                            ..
                        },
                    ..
                }) => self.datalog(
                    (planned, verdict, *reads_course),
                    &derived,
                    &mut universe,
                    budget,
                    fails_consequents,
                ),
                #[cfg(feature = "sparql")]
                Some(Judge {
                    rules: JudgeRules::Sparql(query),
                    ..
                }) => {
                    let graphs = graphs.get_or_init(|| {
                        snapshot(
                            &self.given,
                            &self.statements,
                            facts,
                            &derived,
                            &mut universe,
                        )
                    });
                    query.judge(&self.statements, graphs, &universe, budget)
                }
            };
            let result = result.map(|found| match judge {
                Some(judge) => judge
                    .reads
                    .certain(found, facts.lacks)
                    .unwrap_or_else(|undecided| *undecided),
                None => found,
            });
            results.insert(iri.clone(), result);
        }
        results
    }

    /// Judges the state before an action as if it were also the state after. If a property already
    /// holds there, its success proves nothing about the action.
    pub fn held_before(
        &self,
        facts: &ActionFacts<'_>,
        properties: &[String],
        budget: &Budget,
    ) -> BTreeMap<String, Result<Findings, RuleFault>> {
        let unchanged = ActionFacts {
            after: facts.before,
            during: &[],
            course: None,
            ..*facts
        };
        self.judge(&unchanged, properties, budget)
    }

    /// Judges an action as if the right side `b` of every `a implies b` were false. A property that
    /// still holds passed vacuously: no `a` held where it matters, so that no `b` was asked for.
    ///
    /// Only right sides count that make the property harder to pass.
    /// [`RuleBook::can_pass_vacuously`] returns the properties that have one.
    pub fn without_consequents(
        &self,
        facts: &ActionFacts<'_>,
        properties: &[String],
        budget: &Budget,
    ) -> BTreeMap<String, Result<Findings, RuleFault>> {
        self.judge_as(facts, properties, budget, true)
    }

    /// Returns the names of the facts that were not recorded ([`ActionFacts::lacks`]) and that the
    /// rules of a property (by IRI) read. If its outcome is decided, it is certain without them.
    pub fn missing<'f>(&self, facts: &ActionFacts<'f>, property: &str) -> Vec<&'f str> {
        self.properties
            .get(property)
            .map_or_else(Vec::new, |judge| judge.reads.missing(facts.lacks))
    }

    /// Returns whether a property has an `implies` whose left side may never hold while the
    /// property passes.
    pub fn can_pass_vacuously(&self, property: &str) -> bool {
        let rules = self.properties.get(property).map(|judge| &judge.rules);
        matches!(rules, Some(JudgeRules::Datalog { implies: true, .. }))
    }

    /// Returns whether a property requires a result (`success`, `ASK`); otherwise it forbids an
    /// event (`violation`, `SELECT`).
    ///
    /// A forbidden event can't have happened before the action, so that such a property held before
    /// is not informative. Neither is a property of the course of the action.
    pub fn states_success(&self, property: &str) -> bool {
        match self.properties.get(property).map(|judge| &judge.rules) {
            Some(JudgeRules::Datalog {
                verdict,
                reads_course,
                ..
            }) => !reads_course && verdict.decisive.as_ref().is_some_and(|it| it.positive),
            #[cfg(feature = "sparql")]
            Some(JudgeRules::Sparql(query)) => query.asks,
            None => false,
        }
    }

    /// Returns the digest of a property's rule file and all libraries; empty for an unknown
    /// property.
    pub fn digest(&self, property: &str) -> &str {
        self.properties
            .get(property)
            .map_or("", |judge| &judge.digest)
    }

    /// Returns whether a rule reads quantities over time, which stored runs keep apart from the
    /// other facts.
    pub fn reads_course(&self) -> bool {
        self.reads_course
    }

    /// Returns the warnings about the rules, after those of their ontology.
    pub fn warnings(&self) -> &Diagnostics {
        &self.warnings
    }

    /// Returns the warnings `R055` about formulas whose intervals reach beyond the time limit of
    /// actions. Unit: seconds.
    pub fn beyond(&self, limit_secs: f64) -> Diagnostics {
        unique(
            self.bounds
                .iter()
                .filter_map(|bound| bound.beyond(limit_secs))
                .collect(),
        )
    }

    /// Returns the facts of an action with the tuples that the libraries derive from them.
    pub(crate) fn enriched(
        &self,
        facts: &ActionFacts<'_>,
        universe: &mut Universe<'_>,
        budget: &Budget,
    ) -> Result<Tables, RuleFault> {
        let own = self
            .given
            .load(facts, universe, &self.predicates, &self.indexes);
        let mut layers = Layers {
            own,
            below: vec![&self.fixed],
        };
        let mut meter = Meter::new(budget);
        evaluate(
            &self.libraries,
            &self.predicates,
            &self.indexes,
            &mut layers,
            universe,
            &mut meter,
        )
        .map_err(|stopped| fault(&meter, stopped, &self.libraries))?;
        Ok(layers.own)
    }

    fn datalog(
        &self,
        (planned, verdict, reads_course): (&Planned, &Verdict, bool),
        derived: &Tables,
        universe: &mut Universe<'_>,
        budget: &Budget,
        fails_consequents: bool,
    ) -> Result<Findings, RuleFault> {
        if reads_course && universe.course().is_none() {
            return Err(RuleFault::Value(UNRECORDED.to_owned()));
        }
        let mut layers = Layers {
            own: Tables::default(),
            below: vec![derived, &self.fixed],
        };
        let mut meter = Meter::new(budget);
        if fails_consequents {
            meter.watch.fail_consequents();
        }
        evaluate(
            planned,
            &self.predicates,
            &self.indexes,
            &mut layers,
            universe,
            &mut meter,
        )
        .map_err(|stopped| fault(&meter, stopped, planned))?;
        findings(verdict, &layers, universe)
    }
}
