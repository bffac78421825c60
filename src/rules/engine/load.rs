//! Loads the facts of one action directly into rows of the given predicates, without an RDF store.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use crate::engine::evaluate::Tables;
use crate::engine::plan::Indexes;
use crate::engine::relation::finished;
use crate::model::given::Phases;
use crate::model::program::{CheckedProgram, Literal, Operand, PredicateId, Predicates};
use crate::model::universe::Universe;
use crate::temporal::{things_of, values_of};
use actcheck_base::{ActionFacts, Course, Term, TermId, Triple};

/// Room for the rows of one property: subject and value of ten things in three states.
const USUAL_ROWS: usize = 3 * 3 * 10;

/// The given predicates that the rules read.
#[derive(Debug, Clone)]
pub(crate) struct Given {
    phases: Phases,
    /// `state` for one property each.
    state: HashMap<TermId, PredicateId>,
    /// `state` for any property.
    any_state: Option<PredicateId>,
    parameter: Option<PredicateId>,
    /// `ontology` for one property each.
    ontology: HashMap<TermId, PredicateId>,
    any_ontology: Option<PredicateId>,
    /// `course` for one quantity each. In order: loading creates terms, whose IDs must not depend
    /// on the process.
    course: BTreeMap<TermId, CourseReader>,
}

/// A predicate with the samples of a quantity.
#[derive(Debug, Clone)]
struct CourseReader {
    predicate: PredicateId,
    /// The things that rules name, if they name one everywhere: the samples of others are not
    /// needed.
    things: Option<BTreeSet<TermId>>,
}

impl Given {
    pub(crate) fn new(predicates: &Predicates, phases: Phases) -> Self {
        let mut given = Self {
            phases,
            state: HashMap::new(),
            any_state: None,
            parameter: None,
            ontology: HashMap::new(),
            any_ontology: None,
            course: BTreeMap::new(),
        };
        for (id, predicate) in predicates
            .list
            .iter()
            .enumerate()
            .filter(|(_, predicate)| predicate.given)
        {
            match (predicate.name.as_str(), predicate.property) {
                ("state", Some(property)) => {
                    given.state.insert(property, id);
                }
                ("state", None) => given.any_state = Some(id),
                ("ontology", Some(property)) => {
                    given.ontology.insert(property, id);
                }
                ("ontology", None) => given.any_ontology = Some(id),
                ("course", Some(quantity)) => {
                    given.course.insert(
                        quantity,
                        CourseReader {
                            predicate: id,
                            things: None,
                        },
                    );
                }
                _ => given.parameter = Some(id),
            }
        }
        given
    }

    /// Restricts the samples that are loaded to those of the things that these rules read.
    pub(crate) fn restrict_course(&mut self, programs: &[&CheckedProgram]) {
        let rules = || programs.iter().flat_map(|program| &program.rules);
        for reader in self.course.values_mut() {
            let atoms = rules()
                .flat_map(|rule| &rule.body)
                .filter_map(Literal::atom);
            let subjects = atoms
                .filter(|atom| atom.predicate == reader.predicate)
                .map(|atom| match atom.args.first() {
                    Some(Operand::Constant(thing)) => Some(*thing),
                    _ => None,
                });
            reader.things = subjects.collect();
        }
    }

    /// Loads the ontology's statements.
    pub(crate) fn load_ontology(
        &self,
        triples: &[[TermId; 3]],
        predicates: &Predicates,
        indexes: &Indexes,
    ) -> Tables {
        let mut rows: HashMap<PredicateId, Vec<TermId>> = HashMap::new();
        for [s, p, o] in triples {
            if let Some(predicate) = self.ontology.get(p) {
                rows.entry(*predicate).or_default().extend([*s, *o]);
            }
            if let Some(predicate) = self.any_ontology {
                rows.entry(predicate).or_default().extend([*s, *p, *o]);
            }
        }
        tables(rows, predicates, indexes)
    }

    /// Loads an action's facts into the predicates that some rule reads.
    pub(crate) fn load(
        &self,
        facts: &ActionFacts<'_>,
        universe: &mut Universe<'_>,
        predicates: &Predicates,
        indexes: &Indexes,
    ) -> Tables {
        let mut rows: Vec<Vec<TermId>> = vec![Vec::new(); predicates.len()];
        let mut readers = Readers {
            given: self,
            of_property: vec![None; facts.terms.len()],
        };
        for (phase, triples) in self.graphs(facts) {
            for [s, p, o] in triples {
                let reader = readers.of(*p, universe);
                if let Some(predicate) = reader {
                    let (s, o) = (universe.of_run(*s), universe.of_run(*o));
                    let rows = &mut rows[predicate];
                    if rows.is_empty() {
                        rows.reserve(USUAL_ROWS);
                    }
                    rows.extend([phase, s, o]);
                }
                if let Some(predicate) = self.any_state {
                    let (s, p, o) = (
                        universe.of_run(*s),
                        universe.of_run(*p),
                        universe.of_run(*o),
                    );
                    rows[predicate].extend([phase, s, p, o]);
                }
            }
        }
        if let Some(predicate) = self.parameter {
            for [designator, value] in facts.parameters {
                rows[predicate].extend([universe.of_run(*designator), universe.of_run(*value)]);
            }
        }
        if let Some(course) = facts.course {
            for (quantity, reader) in &self.course {
                load_course(
                    course,
                    *quantity,
                    reader.things.as_ref(),
                    universe,
                    &mut rows[reader.predicate],
                );
            }
        }
        let mut tables = Tables::new(predicates.len());
        for (predicate, rows) in rows
            .into_iter()
            .enumerate()
            .filter(|(_, rows)| !rows.is_empty())
        {
            tables.set(
                predicate,
                finished(
                    predicates.get(predicate).width,
                    &rows,
                    indexes.of(predicate).clone(),
                ),
            );
        }
        tables
    }

    /// Returns the three snapshots, each with the id of its phase.
    pub(crate) fn graphs<'a>(&self, facts: &ActionFacts<'a>) -> [(TermId, &'a [Triple]); 3] {
        [
            (self.phases.before, facts.before),
            (self.phases.after, facts.after),
            (self.phases.during, facts.during),
        ]
    }

    /// Returns the `state` predicates for single properties, each with its property.
    #[cfg(feature = "sparql")]
    pub(crate) fn states(&self) -> impl Iterator<Item = (TermId, PredicateId)> + '_ {
        self.state
            .iter()
            .map(|(property, predicate)| (*property, *predicate))
    }

    /// Returns `state` for any property, or `None` if no rule reads or derives it.
    #[cfg(feature = "sparql")]
    pub(crate) fn any_state(&self) -> Option<PredicateId> {
        self.any_state
    }
}

/// Appends the samples of a quantity of each thing, or of the given things: subject, time, value.
fn load_course(
    course: &Course,
    quantity: TermId,
    only: Option<&BTreeSet<TermId>>,
    universe: &mut Universe<'_>,
    rows: &mut Vec<TermId>,
) {
    let Some(iri) = universe.term(quantity).as_iri().map(str::to_owned) else {
        return;
    };
    let times: Vec<TermId> = (0..course.count)
        .map(|idx| universe.intern(Term::Double(idx as f64 * course.period_secs)))
        .collect();
    for thing in things_of(course) {
        let id = universe.intern(Term::iri(thing.as_str()));
        if only.is_some_and(|things| !things.contains(&id)) {
            continue;
        }
        let Some(values) = values_of(course, &iri, std::slice::from_ref(&thing)) else {
            continue;
        };
        // Most things are at rest most of the time: their values are the same for many samples.
        let mut last: Option<(f64, TermId)> = None;
        for (time, value) in times.iter().zip(values) {
            let value_id = match last {
                Some((same, same_id)) if same.to_bits() == value.to_bits() => same_id,
                _ => universe.intern(Term::Double(value)),
            };
            last = Some((value, value_id));
            rows.extend([id, *time, value_id]);
        }
    }
}

/// Caches which predicate reads the facts of each property of a run.
struct Readers<'a> {
    given: &'a Given,
    of_property: Vec<Option<Option<PredicateId>>>,
}

impl Readers<'_> {
    fn of(&mut self, property: TermId, universe: &mut Universe<'_>) -> Option<PredicateId> {
        let slot = &mut self.of_property[property as usize];
        *slot.get_or_insert_with(|| self.given.state.get(&universe.of_run(property)).copied())
    }
}

fn tables(
    rows: HashMap<PredicateId, Vec<TermId>>,
    predicates: &Predicates,
    indexes: &Indexes,
) -> Tables {
    let mut tables = Tables::new(predicates.len());
    for (predicate, rows) in rows {
        tables.set(
            predicate,
            finished(
                predicates.get(predicate).width,
                &rows,
                indexes.of(predicate).clone(),
            ),
        );
    }
    tables
}
