//! Explanations of properties.

use crate::book::{JudgeRules, RuleBook, fault};
use crate::evaluate::{Layers, Planned, Rounds, Tables, evaluate_noting};
use crate::explain::model::Explanation;
use crate::explain::proof::Prover;
use crate::explain::search::Ground;
use crate::findings::Budget;
use crate::meter::Meter;
use crate::program::Rule;
use crate::reading::{Verdict, findings};
use crate::universe::Universe;
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
        evaluate_noting(
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
        evaluate_noting(planned, predicates, indexes, &mut layers, &mut universe, &mut meter, Some(&mut rounds))
            .map_err(|stopped| fault(&meter, stopped, planned))?;
        let findings = findings(verdict, &layers, &universe)?;
        let rules: Vec<&Rule> =
            planned.rules.iter().chain(&self.libraries.rules).chain(&self.fixed_rules.rules).collect();
        let stated = stated(&[planned, &self.libraries, &self.fixed_rules], self);
        let ground = Ground {
            predicates,
            rules,
            layers: vec![&layers.own, &enriched.own, &self.fixed],
            facts: vec![&given, &self.fixed_facts, &stated],
            rounds: &rounds,
            universe: &universe,
        };
        Ok(explained(label, findings, verdict, &ground))
    }
}

/// Returns the facts written in the rule texts.
fn stated(programs: &[&Planned], book: &RuleBook) -> Tables {
    let mut tables = Tables::default();
    for (predicate, rows) in programs.iter().flat_map(|planned| &planned.facts) {
        let width = book.predicates.get(*predicate).width;
        let table = crate::relation::finished(width, rows.clone(), book.indexes.of(*predicate).clone());
        tables.set(*predicate, table);
    }
    tables
}

fn explained(label: &str, findings: Findings, verdict: &Verdict, ground: &Ground<'_>) -> Explanation {
    let mut explanation =
        Explanation { title: label.to_owned(), findings: None, proofs: Vec::new(), miss: None, notes: Vec::new() };
    if let Some(decisive) = &verdict.decisive {
        let mut prover = Prover::new(ground);
        let mut rows: Vec<&[u32]> = ground.rows(decisive.predicate).collect();
        rows.truncate(PROOFS_SHOWN);
        explanation.proofs = rows.into_iter().map(|row| prover.prove(decisive.predicate, row, 0)).collect();
        if explanation.proofs.is_empty() {
            explanation.miss = ground.miss(decisive.predicate, &vec![None; decisive.arity], 0);
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
