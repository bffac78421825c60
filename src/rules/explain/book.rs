//! Explanations of properties.

use std::cell::{Cell, RefCell};

use crate::book::judge::{Judge, JudgeRules, RuleBook};
use crate::engine::budget::Budget;
use crate::engine::evaluate::{Layers, Planned, Rounds, Tables, evaluate_recording_rounds, fault};
use crate::engine::meter::{Meter, Watch};
use crate::engine::reading::{Verdict, findings};
use crate::explain::goal::{Goal, PROOFS_SHOWN, goal_explained, invalid_goal, stopped_early};
use crate::explain::model::Explanation;
use crate::explain::proof::Prover;
use crate::explain::search::{ProofContext, stated_facts};
use crate::model::universe::Universe;
use actcheck_base::{ActionFacts, Findings, RuleFault};

impl RuleBook {
    /// Explains why a property (by IRI) holds in an action, or why not.
    ///
    /// # Errors
    /// The property is unknown, a value is invalid, or the budget was exceeded.
    pub fn explain(
        &self,
        facts: &ActionFacts<'_>,
        property: &str,
        budget: &Budget,
    ) -> Result<Explanation, RuleFault> {
        self.explain_all(facts, &[property], budget).remove(0)
    }

    /// Explains several properties (by IRI) in an action, in the given order. Evaluates the
    /// libraries once.
    ///
    /// Each property has an error of its own: see [`RuleBook::explain`].
    pub fn explain_all(
        &self,
        facts: &ActionFacts<'_>,
        properties: &[&str],
        budget: &Budget,
    ) -> Vec<Result<Explanation, RuleFault>> {
        let mut base = None;
        properties
            .iter()
            .map(|property| self.explained(facts, property, &mut base, budget))
            .collect()
    }

    fn explained<'a>(
        &'a self,
        facts: &ActionFacts<'a>,
        property: &str,
        base: &mut Option<Base<'a>>,
        budget: &Budget,
    ) -> Result<Explanation, RuleFault> {
        let judge = self.property(property)?;
        if let Some(findings) = judge.reads.unevaluated(facts.lacks) {
            return Ok(without_proof(&judge.label, findings));
        }
        match &judge.rules {
            JudgeRules::Datalog {
                planned, verdict, ..
            } => {
                let base = match base {
                    Some(base) => base,
                    None => base.insert(self.base(facts, budget)?),
                };
                let evaluated = self.evaluate_for_proofs(base, planned, verdict, budget)?;
                let findings = match judge
                    .reads
                    .certain(evaluated.findings.clone()?, facts.lacks)
                {
                    Ok(findings) => findings,
                    Err(undecided) => return Ok(without_proof(&judge.label, *undecided)),
                };
                let context = evaluated.context(self, base, planned);
                Ok(explained(&judge.label, findings, verdict, &context))
            }
            #[cfg(feature = "sparql")]
            JudgeRules::Sparql(_) => {
                let results = self
                    .judge(facts, &[property.to_owned()], budget)
                    .remove(property);
                let findings = results.unwrap_or_else(|| {
                    Err(RuleFault::Value("the property was not judged".into()))
                })?;
                Ok(of_query(&judge.label, findings))
            }
        }
    }

    /// Explains why the rules of a property (by IRI) derive a statement such as
    /// `near(obj:cup_1, _)` in an action, or why not. `_` matches any value. The statement may use
    /// the prefixes of the property's rule file.
    ///
    /// # Errors
    /// The property is unknown or a SPARQL query, the statement is invalid, or the budget was
    /// exceeded.
    pub fn explain_statement(
        &self,
        facts: &ActionFacts<'_>,
        property: &str,
        statement: &str,
        budget: &Budget,
    ) -> Result<Explanation, RuleFault> {
        match &self.property(property)?.rules {
            JudgeRules::Datalog {
                planned,
                verdict,
                scope,
                prefixes,
                ..
            } => {
                let goal = Goal::parse(statement, prefixes).and_then(|goal| {
                    let predicate = goal.predicate(&self.predicates, &[*scope, 0])?;
                    Ok((goal, predicate))
                });
                let (goal, predicate) = goal.map_err(|faults| invalid_goal(&faults))?;
                let mut base = self.base(facts, budget)?;
                let evaluated = self.evaluate_for_proofs(&mut base, planned, verdict, budget)?;
                let (known, unknown) = goal.known(&mut base.universe);
                let context = evaluated.context(self, &base, planned);
                Ok(Explanation {
                    unknown,
                    ..goal_explained(statement, predicate, &known, &context)
                })
            }
            #[cfg(feature = "sparql")]
            JudgeRules::Sparql(_) => Err(RuleFault::Value(
                "a SPARQL query derives no statements; explain the property instead".into(),
            )),
        }
    }

    fn property(&self, iri: &str) -> Result<&Judge, RuleFault> {
        self.properties
            .get(iri)
            .ok_or_else(|| RuleFault::Value(format!("unknown property {iri}")))
    }

    /// Evaluates the libraries over an action, and keeps the tuples of every stage.
    fn base<'a>(&'a self, facts: &ActionFacts<'a>, budget: &Budget) -> Result<Base<'a>, RuleFault> {
        let mut universe = Universe::of_action(&self.terms, facts);
        let (mut rounds, mut meter) = (Rounds::default(), Meter::new(budget));
        let given = self
            .given
            .load(facts, &mut universe, &self.predicates, &self.indexes);
        let own = self
            .given
            .load(facts, &mut universe, &self.predicates, &self.indexes);
        let mut layers = Layers {
            own,
            below: vec![&self.fixed],
        };
        self.evaluate_recording(
            &self.libraries,
            &mut layers,
            (&mut universe, &mut rounds),
            &mut meter,
        )?;
        let enriched = layers.own;
        let label = universe.next_label();
        Ok(Base {
            universe,
            label,
            rounds,
            given,
            enriched,
        })
    }

    /// Evaluates the rules of a property.
    fn evaluate_for_proofs(
        &self,
        base: &mut Base<'_>,
        planned: &Planned,
        verdict: &Verdict,
        budget: &Budget,
    ) -> Result<Evaluated, RuleFault> {
        let Base {
            universe,
            label,
            rounds,
            enriched,
            ..
        } = base;
        universe.label_from(*label);
        let mut meter = Meter::new(budget);
        let mut layers = Layers {
            own: Tables::default(),
            below: vec![enriched, &self.fixed],
        };
        self.evaluate_recording(planned, &mut layers, (universe, rounds), &mut meter)?;
        let findings = findings(verdict, &layers, universe);
        let (own, watch) = (layers.own, meter.into_watch());
        let stated = stated_facts(
            &[planned, &self.libraries, &self.fixed_rules],
            &self.predicates,
            &self.indexes,
        );
        Ok(Evaluated {
            stated,
            own,
            watch,
            findings,
        })
    }

    fn evaluate_recording(
        &self,
        planned: &Planned,
        layers: &mut Layers<'_>,
        (universe, rounds): (&mut Universe<'_>, &mut Rounds),
        meter: &mut Meter,
    ) -> Result<(), RuleFault> {
        let (predicates, indexes) = (&self.predicates, &self.indexes);
        evaluate_recording_rounds(
            planned,
            predicates,
            indexes,
            layers,
            universe,
            meter,
            Some(rounds),
        )
        .map_err(|stopped| fault(meter, stopped, planned))
    }
}

/// The tuples of one action, which the explanations of all its properties share.
struct Base<'a> {
    universe: Universe<'a>,
    /// The first label for the new things of a property.
    label: u64,
    rounds: Rounds,
    /// The facts of the action.
    given: Tables,
    /// The facts of the action with the tuples of the libraries.
    enriched: Tables,
}

/// The tuples of one property by stage, from which proofs are built.
struct Evaluated {
    /// The facts written in the rule texts.
    stated: Tables,
    /// The tuples of the property's rules.
    own: Tables,
    watch: Watch,
    findings: Result<Findings, RuleFault>,
}

impl Evaluated {
    fn context<'c>(
        &'c self,
        book: &'c RuleBook,
        base: &'c Base<'_>,
        planned: &'c Planned,
    ) -> ProofContext<'c> {
        ProofContext {
            predicates: &book.predicates,
            rules: planned
                .rules
                .iter()
                .chain(&book.libraries.rules)
                .chain(&book.fixed_rules.rules)
                .collect(),
            layers: vec![&self.own, &base.enriched, &book.fixed],
            facts: vec![&base.given, &book.fixed_facts, &self.stated],
            rounds: &base.rounds,
            universe: &base.universe,
            watch: &self.watch,
            exhausted: Cell::new(false),
            deciding: RefCell::default(),
        }
    }
}

fn explained(
    label: &str,
    findings: Findings,
    verdict: &Verdict,
    context: &ProofContext<'_>,
) -> Explanation {
    let mut explanation = Explanation {
        title: label.to_owned(),
        findings: None,
        proofs: Vec::new(),
        miss: None,
        unknown: Vec::new(),
        notes: Vec::new(),
        deciding: Vec::new(),
    };
    if let Some(decisive) = &verdict.decisive {
        let mut prover = Prover::new(context);
        let mut rows: Vec<&[u32]> = context.rows(decisive.predicate).collect();
        rows.truncate(PROOFS_SHOWN);
        explanation.proofs = rows
            .into_iter()
            .map(|row| prover.prove(decisive.predicate, row, 0))
            .collect();
        if explanation.proofs.is_empty() {
            explanation.miss = context.miss(decisive.predicate, &vec![None; decisive.arity], 0);
        }
        let shown = explanation.proofs.len();
        if findings.witness_count > shown {
            explanation.notes.push(format!(
                "and {} more like this",
                findings.witness_count - shown
            ));
        }
    }
    explanation.notes.extend(stopped_early(context));
    if !findings.applicable {
        explanation
            .notes
            .push("the property is inapplicable here: `applicable` has no tuples".to_owned());
    }
    explanation.findings = Some(findings);
    explanation.deciding = context.deciding_in(&explanation.to_text());
    explanation
}

/// Explains a property that can't be decided without facts that were not recorded.
fn without_proof(label: &str, findings: Findings) -> Explanation {
    Explanation {
        title: label.to_owned(),
        findings: Some(findings),
        proofs: Vec::new(),
        miss: None,
        unknown: Vec::new(),
        notes: Vec::new(),
        deciding: Vec::new(),
    }
}

/// Explains a query by its rows: it has no proof tree.
#[cfg(feature = "sparql")]
fn of_query(label: &str, findings: Findings) -> Explanation {
    let notes = findings
        .witness
        .iter()
        .map(|row| {
            let values: Vec<String> = row
                .values
                .iter()
                .map(|(name, term)| format!("?{name} = {term}"))
                .collect();
            format!("row: {}", values.join(", "))
        })
        .chain([
            "a SPARQL property is explained by its rows; only Datalog properties have proofs"
                .to_owned(),
        ])
        .collect();
    let (proofs, unknown) = (Vec::new(), Vec::new());
    Explanation {
        title: label.to_owned(),
        findings: Some(findings),
        proofs,
        miss: None,
        unknown,
        notes,
        deciding: Vec::new(),
    }
}
