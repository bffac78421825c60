//! The parts of the libraries' rules: those that properties need, and those that read only the
//! ontology.

use std::collections::{BTreeMap, BTreeSet};

use crate::model::given::add_given;
use crate::model::program::{Atom, CheckedProgram, Literal, Operand, Origin, Predicates, Rule};
use actcheck_base::TermId;

/// Appends the rules and facts of another program.
pub(super) fn extend(program: &mut CheckedProgram, more: CheckedProgram) {
    program.rules.extend(more.rules);
    for (predicate, rows) in more.facts {
        program.facts.entry(predicate).or_default().extend(rows);
    }
}

/// Name of the source of [`gather_state`]'s rules.
const GATHERED: &str = "(given)";

/// Returns whether a rule is one of [`gather_state`]'s.
pub(super) fn gathers_state(rule: &Rule) -> bool {
    &*rule.origin.source.name == GATHERED
}

/// If a rule reads `state` for a variable property, it also needs the facts derived for single
/// properties:
///
/// ```prolog
/// state(?phase, ?s, p, ?o) :- state_p(?phase, ?s, ?o) .
/// ```
pub(super) fn gather_state(predicates: &mut Predicates) -> Vec<Rule> {
    let mut rules = Vec::new();
    let name = "state";
    if predicates.find(0, name, None).is_none() {
        return rules;
    }
    let general = add_given(predicates, name, None);
    let single: Vec<(usize, TermId)> = predicates
        .list
        .iter()
        .enumerate()
        .filter(|(_, p)| p.given && p.name == name)
        .filter_map(|(id, p)| Some((id, p.property?)))
        .collect();
    for (id, property) in single {
        let variables = [
            Operand::Variable(0),
            Operand::Variable(1),
            Operand::Variable(2),
        ];
        let args = vec![
            variables[0],
            variables[1],
            Operand::Constant(property),
            variables[2],
        ];
        let source = actcheck_base::Source::new(GATHERED, "");
        rules.push(Rule {
            head: Atom {
                predicate: general,
                args,
                span: 0..0,
            },
            body: vec![Literal::Positive(Atom {
                predicate: id,
                args: variables.to_vec(),
                span: 0..0,
            })],
            aggregation: None,
            variables: vec!["phase".into(), "s".into(), "o".into()],
            head_names: vec!["phase".into(), "s".into(), String::new(), "o".into()],
            origin: Origin {
                source,
                span: 0..0,
                name: None,
                comment: None,
            },
            making: None,
        });
    }
    rules
}

/// Keeps the library's rules that some property reads, directly or indirectly. SPARQL reads all
/// snapshots.
pub(super) fn needed<'p>(
    mut library: CheckedProgram,
    properties: impl Iterator<Item = &'p CheckedProgram>,
    snapshots: bool,
    predicates: &Predicates,
) -> CheckedProgram {
    let bodies = |rules: &[Rule]| -> Vec<usize> { rules.iter().flat_map(Rule::reads).collect() };
    let mut needed: BTreeSet<usize> = properties
        .flat_map(|program| bodies(&program.rules))
        .collect();
    if snapshots {
        needed.extend((0..predicates.len()).filter(|id| predicates.get(*id).name == "state"));
    }
    let mut rules_of: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (idx, rule) in library.rules.iter().enumerate() {
        rules_of.entry(rule.head.predicate).or_default().push(idx);
    }
    let mut waiting: Vec<usize> = needed.iter().copied().collect();
    while let Some(predicate) = waiting.pop() {
        for rule in rules_of.get(&predicate).into_iter().flatten() {
            let read = bodies(std::slice::from_ref(&library.rules[*rule]));
            waiting.extend(read.into_iter().filter(|id| needed.insert(*id)));
        }
    }
    library
        .rules
        .retain(|rule| needed.contains(&rule.head.predicate));
    library
        .facts
        .retain(|predicate, _| needed.contains(predicate));
    library
}

/// Splits the library into the rules that depend on the course of the action, directly or
/// indirectly, and the rest. `reads` returns whether a rule reads it directly.
///
/// The first are evaluated with each property that needs them: a run without a course breaks only
/// these properties.
pub(super) fn split_timed(
    library: CheckedProgram,
    reads: impl Fn(&Rule) -> bool,
) -> (CheckedProgram, CheckedProgram) {
    let timed: Vec<usize> = library
        .rules
        .iter()
        .filter(|rule| reads(rule))
        .map(|rule| rule.head.predicate)
        .collect();
    let timed = with_dependents(&library.rules, timed);
    partitioned(library, &timed)
}

/// Returns some predicates with those whose rules read them, directly or indirectly.
fn with_dependents(rules: &[Rule], mut waiting: Vec<usize>) -> BTreeSet<usize> {
    let mut found: BTreeSet<usize> = waiting.iter().copied().collect();
    let mut heads_of: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for rule in rules {
        for predicate in rule.reads() {
            heads_of
                .entry(predicate)
                .or_default()
                .push(rule.head.predicate);
        }
    }
    while let Some(predicate) = waiting.pop() {
        let heads = heads_of.get(&predicate).into_iter().flatten();
        waiting.extend(heads.copied().filter(|head| found.insert(*head)));
    }
    found
}

/// Splits a program into the rules and facts of some predicates, and the rest.
fn partitioned(
    program: CheckedProgram,
    predicates: &BTreeSet<usize>,
) -> (CheckedProgram, CheckedProgram) {
    let (mut inside, mut outside) = (CheckedProgram::default(), CheckedProgram::default());
    for rule in program.rules {
        let target = if predicates.contains(&rule.head.predicate) {
            &mut inside
        } else {
            &mut outside
        };
        target.rules.push(rule);
    }
    for (predicate, rows) in program.facts {
        let target = if predicates.contains(&predicate) {
            &mut inside
        } else {
            &mut outside
        };
        target.facts.insert(predicate, rows);
    }
    (inside, outside)
}

/// Splits the rules into those that read only the ontology, directly or indirectly, and the rest.
pub(super) fn split_fixed(
    program: CheckedProgram,
    predicates: &Predicates,
) -> (CheckedProgram, CheckedProgram) {
    let given = |id: &usize| predicates.get(*id).given && predicates.get(*id).name != "ontology";
    let moving = with_dependents(
        &program.rules,
        (0..predicates.len()).filter(given).collect(),
    );
    let (rest, fixed) = partitioned(program, &moving);
    (fixed, rest)
}
