//! The parts of the libraries' rules: those that properties need, and those that read only the ontology.

use std::collections::BTreeSet;

use crate::model::given::add_given;
use crate::model::program::{Atom, Literal, Operand, Origin, Predicates, Program, Rule};
use actcheck_base::TermId;

/// Appends the rules and facts of another program.
pub(super) fn extend(program: &mut Program, more: Program) {
    program.rules.extend(more.rules);
    for (predicate, rows) in more.facts {
        program.facts.entry(predicate).or_default().extend(rows);
    }
}

/// If a rule reads `state` for a variable property, it also needs the facts derived for single properties:
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
        let variables = [Operand::Variable(0), Operand::Variable(1), Operand::Variable(2)];
        let args = vec![variables[0], variables[1], Operand::Constant(property), variables[2]];
        let source = actcheck_base::Source::new("(given)", "");
        rules.push(Rule {
            head: Atom { predicate: general, args, span: 0..0 },
            body: vec![Literal::Positive(Atom { predicate: id, args: variables.to_vec(), span: 0..0 })],
            aggregation: None,
            variables: vec!["phase".into(), "s".into(), "o".into()],
            head_names: vec!["phase".into(), "s".into(), String::new(), "o".into()],
            origin: Origin { source, span: 0..0, name: None, comment: None },
        });
    }
    rules
}

/// Keeps the library's rules that some property reads, directly or indirectly. SPARQL reads all snapshots.
pub(super) fn needed<'p>(
    mut library: Program,
    properties: impl Iterator<Item = &'p Program>,
    snapshots: bool,
    predicates: &Predicates,
) -> Program {
    let bodies = |rules: &[Rule]| -> Vec<usize> {
        rules.iter().flat_map(|rule| rule.body.iter().filter_map(Literal::atom).map(|atom| atom.predicate)).collect()
    };
    let mut needed: BTreeSet<usize> = properties.flat_map(|program| bodies(&program.rules)).collect();
    if snapshots {
        needed.extend((0..predicates.len()).filter(|id| predicates.get(*id).name == "state"));
    }
    loop {
        let before = needed.len();
        for rule in &library.rules {
            if needed.contains(&rule.head.predicate) {
                needed.extend(bodies(std::slice::from_ref(rule)));
            }
        }
        if needed.len() == before {
            break;
        }
    }
    library.rules.retain(|rule| needed.contains(&rule.head.predicate));
    library.facts.retain(|predicate, _| needed.contains(predicate));
    library
}

/// Splits the rules into those that read only the ontology, directly or indirectly, and the rest.
pub(super) fn split_fixed(program: Program, predicates: &Predicates) -> (Program, Program) {
    let mut moving: BTreeSet<usize> = (0..predicates.len())
        .filter(|id| predicates.get(*id).given && predicates.get(*id).name != "ontology")
        .collect();
    loop {
        let before = moving.len();
        for rule in &program.rules {
            let reads_moving = rule.body.iter().filter_map(Literal::atom).any(|atom| moving.contains(&atom.predicate));
            if reads_moving {
                moving.insert(rule.head.predicate);
            }
        }
        if moving.len() == before {
            break;
        }
    }
    let (mut fixed, mut rest) = (Program::default(), Program::default());
    for rule in program.rules {
        if moving.contains(&rule.head.predicate) { rest.rules.push(rule) } else { fixed.rules.push(rule) }
    }
    for (predicate, rows) in program.facts {
        let target = if moving.contains(&predicate) { &mut rest } else { &mut fixed };
        target.facts.insert(predicate, rows);
    }
    (fixed, rest)
}
