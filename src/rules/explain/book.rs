//! Explanations of properties.

use crate::book::judge::{JudgeRules, RuleBook};
use crate::engine::budget::Budget;
use crate::engine::evaluate::{Layers, Planned, Rounds, Tables, evaluate_recording_rounds, fault};
use crate::engine::meter::Meter;
use crate::engine::reading::{Verdict, findings};
use crate::explain::model::Explanation;
use crate::explain::proof::Prover;
use crate::explain::search::ProofContext;
use crate::model::program::Rule;
use crate::model::universe::Universe;
use actcheck_base::{ActionFacts, Findings, RuleFault};

/// Maximum number of proofs shown.
pub(super) const PROOFS_SHOWN: usize = 3;

impl RuleBook {
    /// Explains why a property (by IRI) holds in an action, or why not.
    ///
    /// # Errors
    /// The property is unknown, a value is invalid, or the budget was exceeded.
    pub fn explain(&self, facts: &ActionFacts<'_>, property: &str, budget: &Budget) -> Result<Explanation, RuleFault> {
        let judge =
            self.properties.get(property).ok_or_else(|| RuleFault::Value(format!("unknown property {property}")))?;
        match &judge.rules {
            JudgeRules::Datalog { planned, verdict } => {
                self.explain_datalog(facts, &judge.label, planned, verdict, budget)
            }
            #[cfg(feature = "sparql")]
            JudgeRules::Sparql(_) => {
                let results = self.judge(facts, &[property.to_owned()], budget).remove(property);
                let findings =
                    results.unwrap_or_else(|| Err(RuleFault::Value("the property was not judged".into())))?;
                Ok(of_query(&judge.label, findings))
            }
        }
    }

    fn explain_datalog(
        &self,
        facts: &ActionFacts<'_>,
        label: &str,
        planned: &Planned,
        verdict: &Verdict,
        budget: &Budget,
    ) -> Result<Explanation, RuleFault> {
        let mut universe = Universe::new(&self.terms, Some(facts.terms));
        let (mut rounds, mut meter) = (Rounds::default(), Meter::new(budget));
        let given = self.given.load(facts, &mut universe, &self.predicates, &self.indexes);
        let own = self.given.load(facts, &mut universe, &self.predicates, &self.indexes);
        let mut enriched = Layers { own, below: vec![&self.fixed] };
        let (predicates, indexes) = (&self.predicates, &self.indexes);
        evaluate_recording_rounds(
            &self.libraries,
            predicates,
            indexes,
            &mut enriched,
            &mut universe,
            &mut meter,
            Some(&mut rounds),
        )
        .map_err(|stopped| fault(&meter, stopped, &self.libraries))?;
        let mut layers = Layers { own: Tables::default(), below: vec![&enriched.own, &self.fixed] };
        evaluate_recording_rounds(
            planned,
            predicates,
            indexes,
            &mut layers,
            &mut universe,
            &mut meter,
            Some(&mut rounds),
        )
        .map_err(|stopped| fault(&meter, stopped, planned))?;
        let findings = findings(verdict, &layers, &universe)?;
        let rules: Vec<&Rule> =
            planned.rules.iter().chain(&self.libraries.rules).chain(&self.fixed_rules.rules).collect();
        let given_facts = given_facts(&[planned, &self.libraries, &self.fixed_rules], self);
        let context = ProofContext {
            predicates,
            rules,
            layers: vec![&layers.own, &enriched.own, &self.fixed],
            facts: vec![&given, &self.fixed_facts, &given_facts],
            rounds: &rounds,
            universe: &universe,
        };
        Ok(explained(label, findings, verdict, &context))
    }
}

/// Returns the facts written in the rule texts.
fn given_facts(programs: &[&Planned], book: &RuleBook) -> Tables {
    let mut tables = Tables::default();
    for (predicate, rows) in programs.iter().flat_map(|planned| &planned.facts) {
        let width = book.predicates.get(*predicate).width;
        let table = crate::engine::relation::finished(width, rows.clone(), book.indexes.of(*predicate).clone());
        tables.set(*predicate, table);
    }
    tables
}

fn explained(label: &str, findings: Findings, verdict: &Verdict, context: &ProofContext<'_>) -> Explanation {
    let mut explanation =
        Explanation { title: label.to_owned(), findings: None, proofs: Vec::new(), miss: None, notes: Vec::new() };
    if let Some(decisive) = &verdict.decisive {
        let mut prover = Prover::new(context);
        let mut rows: Vec<&[u32]> = context.rows(decisive.predicate).collect();
        rows.truncate(PROOFS_SHOWN);
        explanation.proofs = rows.into_iter().map(|row| prover.prove(decisive.predicate, row, 0)).collect();
        if explanation.proofs.is_empty() {
            explanation.miss = context.miss(decisive.predicate, &vec![None; decisive.arity], 0);
        }
        let shown = explanation.proofs.len();
        if findings.witness_count > shown {
            explanation.notes.push(format!("and {} more like this", findings.witness_count - shown));
        }
    }
    if !findings.applicable {
        explanation.notes.push("the property is inapplicable here: `applicable` has no tuples".to_owned());
    }
    explanation.findings = Some(findings);
    explanation
}

/// Explains a query by its rows: it has no proof tree.
#[cfg(feature = "sparql")]
fn of_query(label: &str, findings: Findings) -> Explanation {
    let notes = findings
        .witness
        .iter()
        .map(|row| {
            let values: Vec<String> = row.values.iter().map(|(name, term)| format!("?{name} = {term}")).collect();
            format!("row: {}", values.join(", "))
        })
        .chain(["a SPARQL property is explained by its rows; only Datalog properties have proofs".to_owned()])
        .collect();
    Explanation { title: label.to_owned(), findings: Some(findings), proofs: Vec::new(), miss: None, notes }
}
