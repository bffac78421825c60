//! The rules of relations, which judge the verdicts of two runs.

use std::collections::BTreeMap;

use actcheck_base::{ActionFacts, Diagnostics, Judgement, Outcome, Term, Terms, Triple, names};
use actcheck_config::{Campaign, SceneChange};
use actcheck_ontology::{Action, Ontology, Property, RuleFile, VocabularyTerm};
use actcheck_rules::{Budget, RuleBook};
use actcheck_verdict::{Fate, judge};

/// Namespace of verdicts as subjects of facts.
const VERDICTS: &str = "https://w3id.org/actcheck/verdict/";
/// Local names of the terms for verdicts.
const TERMS: [&str; 4] = ["step", "ofProperty", "outcome", "margin"];

/// A verdict of a run.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Verdict {
    /// Position of the action in the test, from 1.
    pub(crate) step: u32,
    /// IRI of the property.
    pub(crate) property: String,
    pub(crate) outcome: Outcome,
    /// Distance from flipping, in the property's unit; positive if passed.
    pub(crate) margin: Option<f64>,
}

/// The rules of a configuration's relations, prepared for evaluation.
pub(crate) struct RelationRules {
    rules: RuleBook,
    ontology: Ontology,
    budget: Budget,
}

impl RelationRules {
    /// Prepares the rules of a configuration's relations. Returns `None` if it has none.
    ///
    /// # Errors
    /// All faults of the files, each with its place; or the budget is spent.
    pub(crate) fn prepare(
        campaign: &Campaign,
        ontology: &Ontology,
        budget: &Budget,
    ) -> Result<Option<Self>, Diagnostics> {
        if campaign.relations.is_empty() {
            return Ok(None);
        }
        let mut alone = ontology.clone();
        alone.warnings = Diagnostics::new();
        alone.unlinked = Diagnostics::new();
        alone.properties = campaign
            .relations
            .iter()
            .map(|relation| {
                let iri = iri_of(relation.change);
                let mut property = Property::new(iri.clone(), RuleFile::new(relation.rule.clone()));
                property.label = format!("the relation `{}`", relation.change.word());
                (iri, property)
            })
            .collect();
        let terms = TERMS.map(|local| (names::act(local), VocabularyTerm::property()));
        alone.vocabulary.terms.extend(terms);
        Ok(Some(Self {
            rules: RuleBook::prepare_within(&alone, budget)?,
            ontology: alone,
            budget: budget.clone(),
        }))
    }

    /// Judges a relation by the verdicts of both runs.
    pub(crate) fn judge(
        &self,
        change: SceneChange,
        [first, second]: [&[Verdict]; 2],
    ) -> Option<Judgement> {
        let iri = iri_of(change);
        let mut terms = Terms::default();
        let [before, after] = [first, second].map(|verdicts| facts(verdicts, &mut terms));
        let facts = ActionFacts {
            terms: &terms,
            before: &before,
            after: &after,
            during: &[],
            parameters: &[],
            course: None,
            lacks: &[],
        };
        let found = self
            .rules
            .judge(&facts, std::slice::from_ref(&iri), &self.budget);
        let pair = Action::new(names::act("Pair")).with_properties(vec![iri.clone()]);
        let digest = |_: &str| {
            let property = self.ontology.properties.get(&iri);
            property.map_or_else(String::new, |property| property.rule.digest.clone())
        };
        judge(&self.ontology, &pair, &found, &Fate::Completed, digest).pop()
    }
}

/// IRI of the property that represents a relation.
fn iri_of(change: SceneChange) -> String {
    names::act(change.word())
}

/// The facts about the verdicts of a run, sorted.
fn facts(verdicts: &[Verdict], terms: &mut Terms) -> Vec<Triple> {
    let mut facts = Vec::new();
    for verdict in verdicts {
        let of = format!(
            "{VERDICTS}{}/{}",
            verdict.step,
            names::local(&verdict.property)
        );
        let values: BTreeMap<&str, Option<Term>> = [
            ("step", Some(Term::Integer(i64::from(verdict.step)))),
            ("ofProperty", Some(Term::iri(&verdict.property))),
            ("outcome", Some(Term::string(verdict.outcome.word()))),
            ("margin", verdict.margin.map(Term::Double)),
        ]
        .into();
        for (local, value) in values {
            if let Some(value) = value {
                let triple: Triple = [Term::iri(&of), Term::iri(names::act(local)), value]
                    .map(|term| terms.intern(term));
                facts.push(triple);
            }
        }
    }
    facts.sort_unstable();
    facts.dedup();
    facts
}
