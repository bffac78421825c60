//! The facts that a property reads, and whether its outcome is certain if some were not recorded.
//!
//! Without some facts, a rule may derive too little: its predicate is *incomplete*. A rule that
//! negates or aggregates an incomplete predicate may also derive too much: its own predicate is
//! *unsound*. Tuples of a sound predicate are certain, and so is their absence from a complete one.
//!
//! A missing fact is named by its property (`w:tilt`), by the thing that all facts are missing about
//! (`w:gripper`), or by a quantity over time. `w:samples/z` means that no thing has the quantity `z`,
//! `w:samples/each/z` that at least one thing lacks it, and `w:samples` that no quantity was recorded
//! over time.

use std::collections::{BTreeMap, BTreeSet};

use crate::model::expression::Expr;
use crate::model::program::{
    CheckedProgram, Literal, Operand, PredicateId, Predicates, Rule, RulesByHead, Scope,
};
use crate::temporal::quantities_read;
use actcheck_base::{Findings, Terms, names};

/// Part of the name of a quantity that only some things lack.
const EACH: &str = "/each/";

/// Most names of missing facts in an explanation.
const MOST_NAMED: usize = 3;

/// The facts of which the rules of a property make its outcome.
#[derive(Debug, Clone, Default)]
pub(crate) struct FactsRead {
    rules: Vec<ReadRule>,
    /// Predicates with facts that the rule files state: they have tuples in any case.
    stated: BTreeSet<PredicateId>,
    /// Facts by their predicates: the names under which they can be missing; empty for facts of any
    /// property.
    given: BTreeMap<PredicateId, Vec<String>>,
    /// IRIs of the quantities that formulas read, and of the things that they name. Without one, the
    /// rules can't be evaluated.
    quantities: BTreeSet<String>,
    /// `success` or `violation`; for a query, all predicates that it reads.
    deciding: Vec<PredicateId>,
    applicable: Option<PredicateId>,
    margin: Option<PredicateId>,
    /// Whether the deciding predicates are those that a query reads.
    is_query: bool,
}

/// The predicates of a rule.
#[derive(Debug, Clone)]
struct ReadRule {
    head: PredicateId,
    positive: Vec<PredicateId>,
    negative: Vec<PredicateId>,
    /// IRIs of the things that positive and negated literals name.
    positive_things: Vec<String>,
    negative_things: Vec<String>,
    aggregates: bool,
}

/// Whether the tuples of a predicate are certain.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Doubt {
    /// Tuples may be missing.
    incomplete: bool,
    /// Tuples may be wrong.
    unsound: bool,
}

impl Doubt {
    fn or(self, other: Self) -> Self {
        Self {
            incomplete: self.incomplete || other.incomplete,
            unsound: self.unsound || other.unsound,
        }
    }

    /// Whether a finding is certain: that there are tuples, or that there are none.
    fn permits(self, found: bool) -> bool {
        if found {
            !self.unsound
        } else {
            !self.incomplete
        }
    }
}

impl FactsRead {
    /// Returns the findings if a quantity is missing without which the rules can't be evaluated.
    pub(crate) fn unevaluated(&self, missing: &[String]) -> Option<Findings> {
        let is_missing = |iri: &&String| missing.binary_search(iri).is_ok();
        let named: Vec<&str> = self
            .quantities
            .iter()
            .filter(is_missing)
            .map(String::as_str)
            .collect();
        (!named.is_empty()).then(|| undecided(&named))
    }

    /// Returns the missing facts (of sorted IRIs) that the rules read.
    pub(crate) fn missing<'m>(&self, missing: &'m [String]) -> Vec<&'m str> {
        let reads_any = self.given.values().any(Vec::is_empty);
        let things = |rule: &'_ ReadRule, iri: &String| {
            rule.positive_things.contains(iri) || rule.negative_things.contains(iri)
        };
        missing
            .iter()
            .filter(|iri| {
                reads_any
                    || self.quantities.contains(*iri)
                    || self.given.values().any(|known| known.contains(iri))
                    || self.rules.iter().any(|rule| things(rule, iri))
            })
            .map(String::as_str)
            .collect()
    }

    /// Returns the findings as far as they are certain without the missing facts (sorted IRIs).
    ///
    /// # Errors
    /// The outcome is not certain: the findings that say so.
    pub(crate) fn certain(
        &self,
        found: Findings,
        missing: &[String],
    ) -> Result<Findings, Box<Findings>> {
        if missing.is_empty() {
            return Ok(found);
        }
        let doubts = self.doubts(missing);
        let of = |predicate: &PredicateId| doubts.get(predicate).copied().unwrap_or_default();
        let deciding = self
            .deciding
            .iter()
            .map(of)
            .fold(Doubt::default(), Doubt::or);
        let applies = self
            .applicable
            .as_ref()
            .is_none_or(|predicate| of(predicate).permits(found.applicable));
        let decides = if self.is_query {
            deciding == Doubt::default()
        } else {
            deciding.permits(found.witness_count > 0)
        };
        if !applies || (found.applicable && !decides) {
            return Err(Box::new(undecided(&self.missing(missing))));
        }
        let margin = self.margin.as_ref().map(of).unwrap_or_default();
        Ok(Findings {
            margin: found.margin.filter(|_| margin == Doubt::default()),
            ..found
        })
    }

    /// The predicates without any tuple: facts that were not recorded, and those that follow from
    /// them alone.
    fn without_tuples(&self, missing: &[String]) -> BTreeSet<PredicateId> {
        let derived: BTreeSet<PredicateId> = self.rules.iter().map(|rule| rule.head).collect();
        // A quantity that only some things lack has tuples.
        let is_missing = |known: &[String]| {
            known
                .iter()
                .any(|iri| !iri.contains(EACH) && missing.binary_search(iri).is_ok())
        };
        let mut empty: BTreeSet<PredicateId> = self
            .given
            .iter()
            .filter(|(predicate, property)| is_missing(property) && !derived.contains(predicate))
            .map(|(predicate, _)| *predicate)
            .filter(|predicate| !self.stated.contains(predicate))
            .collect();
        loop {
            let derives = |rule: &&ReadRule| !rule.positive.iter().any(|it| empty.contains(it));
            let heads = self.rules.iter().filter(derives).map(|rule| rule.head);
            let filled: BTreeSet<PredicateId> = heads.chain(self.stated.iter().copied()).collect();
            let more: Vec<PredicateId> = derived
                .iter()
                .copied()
                .filter(|head| {
                    let is_fact = self.given.get(head).is_some_and(|own| !is_missing(own));
                    !filled.contains(head) && !is_fact && !empty.contains(head)
                })
                .collect();
            if more.is_empty() {
                return empty;
            }
            empty.extend(more);
        }
    }

    /// The doubts about each predicate that has some.
    fn doubts(&self, missing: &[String]) -> BTreeMap<PredicateId, Doubt> {
        let empty = self.without_tuples(missing);
        let mut doubts: BTreeMap<PredicateId, Doubt> = self
            .given
            .iter()
            .filter(|(_, known)| known.is_empty() || any_of(known, missing))
            .map(|(predicate, _)| {
                let doubt = Doubt {
                    incomplete: true,
                    unsound: false,
                };
                (*predicate, doubt)
            })
            .collect();
        loop {
            let mut grows = false;
            for rule in &self.rules {
                let all = |predicates: &[PredicateId]| {
                    predicates
                        .iter()
                        .filter_map(|predicate| doubts.get(predicate).copied())
                        .fold(Doubt::default(), Doubt::or)
                };
                let (positive, negative) = (all(&rule.positive), all(&rule.negative));
                let body = Doubt {
                    incomplete: positive.incomplete
                        || negative.unsound
                        || any_of(&rule.positive_things, missing),
                    unsound: positive.unsound
                        || negative.incomplete
                        || any_of(&rule.negative_things, missing),
                };
                let any = body.incomplete || body.unsound;
                let body = if rule.positive.iter().any(|read| empty.contains(read)) {
                    // It derives nothing.
                    Doubt {
                        incomplete: true,
                        unsound: false,
                    }
                } else if rule.aggregates {
                    Doubt {
                        incomplete: any,
                        unsound: any,
                    }
                } else {
                    body
                };
                if any {
                    let before = doubts.get(&rule.head).copied().unwrap_or_default();
                    let now = before.or(body);
                    grows |= now != before;
                    doubts.insert(rule.head, now);
                }
            }
            if !grows {
                return doubts;
            }
        }
    }
}

/// Whether some of the names are among the missing ones (sorted IRIs).
fn any_of(names: &[String], missing: &[String]) -> bool {
    names.iter().any(|iri| missing.binary_search(iri).is_ok())
}

/// The findings of a property that can't be decided without these facts.
fn undecided(missing: &[&str]) -> Findings {
    let mut named: Vec<String> = missing
        .iter()
        .take(MOST_NAMED)
        .map(|iri| match iri.strip_prefix(names::W) {
            Some(local) => format!("`w:{local}`"),
            None => format!("`{}`", names::shorten(iri)),
        })
        .collect();
    if missing.len() > MOST_NAMED {
        named.push(format!("{} more facts", missing.len() - MOST_NAMED));
    }
    let verb = if missing.len() == 1 { "was" } else { "were" };
    let last = named.pop().unwrap_or_default();
    let listed = if named.is_empty() {
        last
    } else {
        format!("{} and {last}", named.join(", "))
    };
    Findings {
        applicable: false,
        holds: false,
        witness: Vec::new(),
        witness_count: 0,
        margin: None,
        because: vec![format!("{listed} {verb} not recorded")],
    }
}

/// The rules that may derive each predicate of the libraries.
pub(crate) struct Derivations<'a> {
    rules: RulesByHead<'a>,
    /// Predicates of the facts that the rule files state.
    stated: BTreeSet<PredicateId>,
    predicates: &'a Predicates,
    terms: &'a Terms,
}

impl<'a> Derivations<'a> {
    pub(crate) fn new(
        library: &'a CheckedProgram,
        predicates: &'a Predicates,
        terms: &'a Terms,
    ) -> Self {
        let mut derivations = Self {
            rules: RulesByHead::default(),
            stated: BTreeSet::new(),
            predicates,
            terms,
        };
        derivations.add(library);
        derivations
    }

    fn add(&mut self, program: &'a CheckedProgram) {
        self.rules.add(program);
        self.stated.extend(program.facts.keys());
    }

    /// Returns the facts that a property in Datalog reads.
    pub(crate) fn of_program(&self, program: &'a CheckedProgram, scope: Scope) -> FactsRead {
        let mut own = Self {
            rules: self.rules.clone(),
            stated: self.stated.clone(),
            ..*self
        };
        own.add(program);
        let find = |name: &str| self.predicates.find(scope, name, None);
        let read = FactsRead {
            deciding: find("success")
                .or_else(|| find("violation"))
                .into_iter()
                .collect(),
            applicable: find("applicable"),
            margin: find("margin"),
            ..FactsRead::default()
        };
        let because = find("because");
        let from = read.deciding.iter().copied();
        let from: Vec<PredicateId> = from
            .chain(read.applicable)
            .chain(read.margin)
            .chain(because)
            .collect();
        own.reached(from, read)
    }

    /// Returns the facts that a query reads, from the IRIs of the properties in it; `of_any` if it
    /// reads facts of any property.
    #[cfg(feature = "sparql")]
    pub(crate) fn of_query(&self, properties: &BTreeSet<String>, of_any: bool) -> FactsRead {
        let read = self.predicates.list.iter().enumerate().filter(|(_, it)| {
            let iri = it.property.and_then(|id| self.terms.term(id).as_iri());
            it.given && iri.is_some_and(|iri| of_any || properties.contains(iri))
        });
        let deciding: Vec<PredicateId> = read.map(|(id, _)| id).collect();
        let mut found = self.reached(
            deciding.clone(),
            FactsRead {
                deciding,
                is_query: true,
                ..FactsRead::default()
            },
        );
        // Facts that no rule reads have no predicate.
        let unread = |iri: &&String| {
            let known = found.given.values().flatten();
            !known.into_iter().any(|known| known == *iri)
        };
        let unread: Vec<Vec<String>> = properties
            .iter()
            .filter(unread)
            .map(|iri| vec![iri.clone()])
            .chain(of_any.then(Vec::new))
            .collect();
        let next = self.predicates.list.len();
        for (number, property) in unread.into_iter().enumerate() {
            found.given.insert(next + number, property);
            found.deciding.push(next + number);
        }
        found
    }

    /// Adds everything from which some predicates follow.
    fn reached(&self, from: Vec<PredicateId>, mut read: FactsRead) -> FactsRead {
        let mut open = from;
        let mut seen: BTreeSet<PredicateId> = open.iter().copied().collect();
        while let Some(id) = open.pop() {
            let predicate = self.predicates.get(id);
            if predicate.given && !matches!(predicate.name.as_str(), "ontology" | "parameter") {
                let iri = predicate
                    .property
                    .and_then(|property| self.terms.term(property).as_iri());
                let mut known: Vec<String> = iri.map(str::to_owned).into_iter().collect();
                if predicate.name == "course" {
                    let quantity = iri.map_or("", names::local);
                    known.push(names::w(&format!("samples/{quantity}")));
                    known.push(names::w(&format!("samples/each/{quantity}")));
                    read.quantities.insert(names::w("samples"));
                }
                read.given.insert(id, known);
            }
            if self.stated.contains(&id) {
                read.stated.insert(id);
            }
            for rule in self.rules.of(id) {
                open.extend(rule.reads().filter(|read| seen.insert(*read)));
                read.quantities.extend(quantities(rule));
                read.rules.push(ReadRule::of(rule, self.terms));
            }
        }
        read
    }
}

impl ReadRule {
    fn of(rule: &Rule, terms: &Terms) -> Self {
        let (mut positive, mut negative) = (Vec::new(), Vec::new());
        let (mut positive_things, mut negative_things) = (Vec::new(), Vec::new());
        for literal in &rule.body {
            let (atom, predicates, things) = match literal {
                Literal::Positive(atom) => (atom, &mut positive, &mut positive_things),
                Literal::Negative(atom) => (atom, &mut negative, &mut negative_things),
                _ => continue,
            };
            predicates.push(atom.predicate);
            let constants = atom.args.iter().filter_map(|arg| match arg {
                Operand::Constant(id) => terms.term(*id).as_iri(),
                _ => None,
            });
            let of_world = constants.filter(|iri| iri.starts_with(names::W));
            things.extend(of_world.map(str::to_owned));
        }
        // New things are made for the tuples that lack the heads.
        let heads = rule.makes().into_iter().flat_map(|making| &making.heads);
        negative.extend(heads.map(|head| head.predicate));
        Self {
            head: rule.head.predicate,
            positive,
            negative,
            positive_things,
            negative_things,
            aggregates: rule.aggregation.is_some(),
        }
    }
}

/// Returns the quantities that the formulas of a rule read.
fn quantities(rule: &Rule) -> Vec<String> {
    let values = rule.body.iter().filter_map(|literal| match literal {
        Literal::Test { value, .. } | Literal::Assign { value, .. } => Some(value),
        _ => None,
    });
    values
        .filter_map(|value| match value {
            Expr::Timed(timed) => Some(timed),
            _ => None,
        })
        .flat_map(|timed| timed.formulas())
        .flat_map(quantities_read)
        .flat_map(|iri| {
            let over_time = names::w(&format!("samples/{}", names::local(&iri)));
            [iri, over_time, names::w("samples")]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use crate::{Budget, Facts, RuleBook};
    use actcheck_base::{ActionFacts, Outcome, Source};
    use actcheck_ontology::{Ontology, Property, RuleFile};

    const EX: &str = "http://example.org/";

    /// The outcome of a rule about `:cup`, whose wetness was not recorded, with its margin and
    /// words.
    fn judged(rule: &str) -> (Outcome, Option<f64>, String) {
        let iri = "http://example.org/property";
        let text = format!("@prefix : <{EX}> .\n{rule}");
        let rule = RuleFile::new(Source::new("property.rls", text));
        let mut ontology = Ontology::default();
        ontology
            .properties
            .insert(iri.to_owned(), Property::new(iri, rule));
        let book = RuleBook::prepare(&ontology).expect("the rule is valid");
        let facts = Facts::from_turtle(
            "@prefix : <http://example.org/> . :cup :on :table ; :height 0.3 ; :full true .",
        )
        .expect("the facts are valid");
        let lacks = ["full", "wet"].map(|name| format!("{EX}{name}"));
        let action = ActionFacts {
            lacks: &lacks[1..],
            ..facts.as_action()
        };
        let found = book
            .judge(&action, &[iri.to_owned()], &Budget::default())
            .remove(iri)
            .expect("it was judged")
            .expect("it was evaluated");
        (found.outcome(), found.margin, found.because.join("; "))
    }

    #[test]
    fn only_certain_outcomes_are_decided() {
        use Outcome::{Failed, Inapplicable, Passed};
        for (rule, expected) in [
            // Other facts decide.
            ("success(?x) :- after(?x, :on, :table) .", Passed),
            ("success(?x) :- after(?x, :on, :floor) .", Failed),
            // It may be wet.
            ("success(?x) :- after(?x, :wet, true) .", Inapplicable),
            ("violation(?x) :- after(?x, :wet, true) .", Inapplicable),
            (
                "success(?x) :- after(?x, :on, _), ~after(?x, :wet, true) .",
                Inapplicable,
            ),
            // Another rule proves it.
            (
                "success(?x) :- after(?x, :wet, true) . success(?x) :- after(?x, :full, true) .",
                Passed,
            ),
            (
                "violation(?x) :- after(?x, :wet, true) . violation(?x) :- after(?x, :full, true) .",
                Failed,
            ),
            (
                "harm(?x) :- after(?x, :wet, true) . harm(?x) :- after(?x, :on, :floor) . violation(?x) :- harm(?x) .",
                Inapplicable,
            ),
            // Dry or wet, it is not on the floor.
            (
                "success(?x) :- after(?x, :on, :floor), ~after(?x, :wet, true) .",
                Failed,
            ),
            (
                "n(#count(?x)) :- after(?x, :wet, _) . success(?x) :- after(?x, :on, _), n(?n), ?n > 1 .",
                Inapplicable,
            ),
            // A rule that derives nothing derives nothing wrong.
            (
                "dry(?x) :- after(?x, :wet, false), ~soaked(?x) . soaked(?x) :- after(?x, :wet, true) .
                 good(?x) :- dry(?x) . good(?x) :- after(?x, :full, true) . success(?x) :- good(?x) .",
                Passed,
            ),
            // The rule file states a fact that it could also derive.
            (
                "wettest(:lake) . wettest(?x) :- after(?x, :wet, true) .
                 success(?x) :- after(?x, :on, :table), ~dirty(?x) . dirty(?x) :- after(?x, :on, :floor), ~wettest(?x) .",
                Passed,
            ),
            (
                "listed(:cup) . listed(?x) :- after(?x, :wet, true) .
                 known(?x) :- listed(?x), ~soaked(?x) . soaked(?x) :- after(?x, :wet, true) . success(?x) :- known(?x) .",
                Inapplicable,
            ),
            // Whether it applies is known, or not.
            (
                "success(?x) :- after(?x, :on, :table) . applicable(?x) :- after(?x, :wet, true) .",
                Inapplicable,
            ),
            (
                "success(?x) :- after(?x, :on, :table) . applicable(?x) :- after(?x, :full, true) .
                 applicable(?x) :- after(?x, :wet, true) .",
                Passed,
            ),
        ] {
            let (outcome, _, words) = judged(rule);
            assert_eq!(outcome, expected, "{rule}: {words}");
        }
        let (_, _, words) = judged("success(?x) :- after(?x, :wet, true) .");
        assert_eq!(words, "`<http://example.org/wet>` was not recorded");
    }

    #[test]
    fn a_margin_needs_all_its_facts() {
        let margin =
            |rule: &str| judged(&format!("success(?x) :- after(?x, :on, :table) . {rule}")).1;
        assert_eq!(margin("margin(?h) :- after(_, :height, ?h) ."), Some(0.3));
        assert_eq!(
            margin("margin(?h) :- after(?x, :height, ?h), ~after(?x, :wet, true) ."),
            None
        );
    }
}
