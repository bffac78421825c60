//! Termination: finds rules whose new things may lead to further ones without end.
//!
//! Sound, and independent of the facts: joint acyclicity (Krötzsch and Rudolph, IJCAI 2011). A new
//! thing may get into an argument only through a rule that reads each occurrence of a variable from
//! an argument which it may get into. Rules that it finds may still terminate, because of their
//! facts or conditions. Values that rules compute without end, such as `?x + 1`, are left to the
//! other limits of an evaluation.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet, HashMap, VecDeque};

use crate::check::stratify::shown;
use crate::model::expression::{Expr, Variable};
use crate::model::given::property_place;
use crate::model::program::{Atom, Literal, Operand, PredicateId, Predicates, Rule};
use crate::model::universe::Universe;
use actcheck_base::{Diagnostic, Diagnostics};

/// A column of a predicate.
type Position = (PredicateId, usize);

/// Where the things that one `!x` makes may get, each position with the one it was reached from.
type Reach = BTreeMap<Position, Option<Position>>;

/// A rule that makes new things.
struct MakingRule<'r> {
    rule: &'r Rule,
    /// The predicate of its matches.
    entrance: PredicateId,
    /// Name and reach of each new variable.
    new: Vec<(Variable, Reach)>,
}

/// A rule whose new things lead to further ones by way of the other rules.
pub(crate) struct Endless<'r> {
    rule: &'r Rule,
    /// The rules that make new things in turn, the rule itself first; and for each, the positions
    /// by which its new thing gets to the next.
    turns: Vec<(&'r Rule, Variable, Vec<Position>)>,
}

/// Returns the rules whose new things may lead to further ones without end.
pub(crate) fn endless(rules: &[Rule]) -> Vec<Endless<'_>> {
    if rules.iter().all(|rule| rule.makes().is_none()) {
        return Vec::new();
    }
    let moves = Moves::new(rules);
    let makers: Vec<MakingRule<'_>> = rules
        .iter()
        .filter_map(|rule| maker(rule, &rule.makes()?.new, &moves))
        .collect();
    let entrances: HashMap<PredicateId, usize> = makers
        .iter()
        .enumerate()
        .map(|(at, maker)| (maker.entrance, at))
        .collect();
    // From each new variable to those of the rules that make a thing for it.
    let next = |(at, new): Node| {
        let reached = makers[at].new[new]
            .1
            .keys()
            .filter_map(|(predicate, _)| entrances.get(predicate));
        let makers_reached: BTreeSet<usize> = reached.copied().collect();
        makers_reached
            .into_iter()
            .flat_map(|other| (0..makers[other].new.len()).map(move |new| (other, new)))
            .collect()
    };
    let mut found = Vec::new();
    for (at, maker) in makers.iter().enumerate() {
        let Some(cycle) = (0..maker.new.len()).find_map(|new| cycle((at, new), &next)) else {
            continue;
        };
        let turns = cycle
            .iter()
            .zip(cycle.iter().cycle().skip(1))
            .map(|((at, new), (other, _))| {
                let (variable, reach) = &makers[*at].new[*new];
                (
                    makers[*at].rule,
                    *variable,
                    way(reach, makers[*other].entrance),
                )
            })
            .collect();
        found.push(Endless {
            rule: maker.rule,
            turns,
        });
    }
    found
}

/// A new variable: the index of its rule among those that make new things, and its own in the rule.
type Node = (usize, usize);

/// Returns the shortest cycle through a node.
fn cycle(start: Node, next: &dyn Fn(Node) -> Vec<Node>) -> Option<Vec<Node>> {
    let mut from: BTreeMap<Node, Node> = BTreeMap::new();
    let mut queue = VecDeque::from([start]);
    while let Some(node) = queue.pop_front() {
        for other in next(node) {
            if other == start {
                let mut way = vec![node];
                while let Some(before) = from
                    .get(&way[way.len() - 1])
                    .filter(|_| way[way.len() - 1] != start)
                {
                    way.push(*before);
                }
                way.reverse();
                return Some(way);
            }
            if let Entry::Vacant(entry) = from.entry(other) {
                entry.insert(node);
                queue.push_back(other);
            }
        }
    }
    None
}

/// Returns the positions from the new thing to a reached predicate.
fn way(reach: &Reach, end: PredicateId) -> Vec<Position> {
    let mut way: Vec<Position> = Vec::new();
    let mut at = reach
        .keys()
        .find(|(predicate, _)| *predicate == end)
        .copied();
    while let Some(position) = at {
        way.push(position);
        at = reach.get(&position).copied().flatten();
    }
    way.reverse();
    way
}

/// A variable of a rule: the positions of its body from which its values come, and those of its
/// head.
struct Move {
    /// A thing gets through if each of these is reached. Empty for a computed variable, for which
    /// one position is enough.
    all: Vec<Position>,
    to: Vec<Position>,
}

struct Moves {
    list: Vec<Move>,
    /// The moves that begin at each position.
    at: HashMap<Position, Vec<usize>>,
}

impl Moves {
    fn new(rules: &[Rule]) -> Self {
        let mut moves = Self {
            list: Vec::new(),
            at: HashMap::new(),
        };
        for rule in rules {
            let mut read: BTreeMap<Variable, Vec<Position>> = BTreeMap::new();
            for literal in &rule.body {
                let Literal::Positive(atom) = literal else {
                    continue;
                };
                for (variable, position) in positions(atom) {
                    read.entry(variable).or_default().push(position);
                }
            }
            let mut written: BTreeMap<Variable, Vec<Position>> = BTreeMap::new();
            for (variable, position) in positions(&rule.head) {
                written.entry(variable).or_default().push(position);
            }
            for (variable, to) in written {
                let all = read.get(&variable).cloned().unwrap_or_default();
                let any = if all.is_empty() {
                    computed_from(rule, variable, &read)
                } else {
                    Vec::new()
                };
                for position in all.iter().chain(&any) {
                    moves
                        .at
                        .entry(*position)
                        .or_default()
                        .push(moves.list.len());
                }
                moves.list.push(Move { all, to });
            }
        }
        moves
    }

    /// Returns where a thing that begins at some positions may get.
    fn reach(&self, start: Vec<Position>) -> Reach {
        let mut reach: Reach = start.iter().map(|position| (*position, None)).collect();
        let mut waiting = VecDeque::from(start);
        while let Some(position) = waiting.pop_front() {
            for Move { all, to } in self
                .at
                .get(&position)
                .into_iter()
                .flatten()
                .map(|idx| &self.list[*idx])
            {
                if !all.iter().all(|position| reach.contains_key(position)) {
                    continue;
                }
                for next in to {
                    if !reach.contains_key(next) {
                        reach.insert(*next, Some(position));
                        waiting.push_back(*next);
                    }
                }
            }
        }
        reach
    }
}

/// Returns the variables of an atom with their positions.
fn positions(atom: &Atom) -> Vec<(Variable, Position)> {
    let variable = |(column, arg): (usize, &Operand)| match arg {
        Operand::Variable(variable) => Some((*variable, (atom.predicate, column))),
        _ => None,
    };
    atom.args.iter().enumerate().filter_map(variable).collect()
}

/// Returns the positions of the values that a variable is computed from.
fn computed_from(
    rule: &Rule,
    variable: Variable,
    read: &BTreeMap<Variable, Vec<Position>>,
) -> Vec<Position> {
    let (mut waiting, mut seen, mut found) = (vec![variable], BTreeSet::new(), Vec::new());
    while let Some(variable) = waiting.pop() {
        if !seen.insert(variable) {
            continue;
        }
        found.extend(read.get(&variable).into_iter().flatten());
        let value = |literal: &Literal| match literal {
            Literal::Assign {
                variable: assigned,
                value,
                ..
            } if *assigned == variable => Some(inputs(value)),
            _ => None,
        };
        waiting.extend(rule.body.iter().filter_map(value).flatten());
    }
    found
}

fn inputs(value: &Expr) -> Vec<Variable> {
    let mut variables = Vec::new();
    value.variables(&mut variables);
    variables
}

fn maker<'r>(rule: &'r Rule, new: &[Variable], moves: &Moves) -> Option<MakingRule<'r>> {
    let own = positions(&rule.head);
    let start = |variable| {
        own.iter()
            .filter(|(other, _)| *other == variable)
            .map(|(_, position)| *position)
            .collect()
    };
    let new = new
        .iter()
        .map(|variable| (*variable, moves.reach(start(*variable))))
        .collect();
    let entrance = rule.body.iter().find_map(Literal::atom)?.predicate;
    Some(MakingRule {
        rule,
        entrance,
        new,
    })
}

impl Endless<'_> {
    /// Returns the predicate of the rule's things.
    pub(crate) fn made(&self) -> PredicateId {
        self.rule.head.predicate
    }

    /// Warns (R063) that the rule may make new things without end, with the way from one to the
    /// next.
    fn warning(&self, predicates: &Predicates, terms: &Universe<'_>) -> Diagnostic {
        let name = |rule: &Rule, new: Variable| rule.variables[new].clone();
        let new = self
            .turns
            .first()
            .map(|(rule, variable, _)| name(rule, *variable))
            .unwrap_or_default();
        let mut way = String::new();
        for (idx, (rule, variable, positions)) in self.turns.iter().enumerate() {
            let places = places(positions, predicates, terms);
            let next = self
                .turns
                .get(idx + 1)
                .map(|(rule, variable, _)| (rule, name(rule, *variable)));
            let then = match next {
                Some((rule, next)) => format!("the rule at line {} makes `{next}`", line(rule)),
                None if idx == 0 => format!("the rule makes another `{new}`"),
                None => format!("this rule makes another `{new}`"),
            };
            let from = if idx == 0 {
                String::new()
            } else {
                "; ".to_owned()
            };
            way.push_str(&format!(
                "{from}`{}` gets into {places}, for which {then}",
                name(rule, *variable)
            ));
        }
        let message = format!("this rule may make new things (`{new}`) without end");
        let help = format!(
            "{way}; add a condition that new things don't satisfy, because an evaluation that makes too many ends with \
             an error"
        );
        Diagnostic::warning("R063", message)
            .at(&self.rule.origin.source, self.rule.origin.span.clone())
            .help(help)
    }
}

fn line(rule: &Rule) -> usize {
    rule.origin.source.line_and_column(rule.origin.span.start).0
}

/// Lists the positions of predicates that the text names.
fn places(positions: &[Position], predicates: &Predicates, terms: &Universe<'_>) -> String {
    let named = positions
        .iter()
        .filter(|(predicate, _)| predicates.get(*predicate).helps().is_none());
    // A constant property is an argument, but not a column.
    let argument = |id: PredicateId, column: usize| {
        let predicate = predicates.get(id);
        let place = predicate
            .property
            .and_then(|_| property_place(&predicate.name));
        column + 1 + usize::from(place.is_some_and(|place| place <= column))
    };
    let places: Vec<String> = named
        .map(|(id, column)| {
            format!(
                "`{}` (argument {})",
                shown(predicates, *id, terms),
                argument(*id, *column)
            )
        })
        .collect();
    match places.split_last() {
        Some((last, others)) if !others.is_empty() => {
            format!("{} and then {last}", others.join(", "))
        }
        Some((last, _)) => last.clone(),
        None => "its heads".to_owned(),
    }
}

/// Returns a warning for each rule whose new things may lead to further ones without end.
pub(crate) fn warnings(
    rules: &[Rule],
    predicates: &Predicates,
    terms: &Universe<'_>,
) -> Diagnostics {
    let mut diagnostics = Diagnostics::new();
    for endless in endless(rules) {
        diagnostics.push(endless.warning(predicates, terms));
    }
    diagnostics
}
