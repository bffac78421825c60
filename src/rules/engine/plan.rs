//! Plans the evaluation of each rule: the order of its conditions and the indexes it needs.

use std::collections::BTreeSet;
use std::sync::Arc;

use crate::check::stratify::Stratum;
use crate::engine::equal::{Keyed, meeting, settle};
use crate::engine::lower::{
    add_rivals, groups, literal_variables, lower, mark, operand_variables, outputs,
};
use crate::model::expression::{Expr, Variable};
use crate::model::program::{Atom, Literal, Operand, PredicateId, Predicates, Rule};
use crate::syntax::Comparison;
use actcheck_base::TermId;

/// The columns of a predicate in the order of one index.
pub(crate) type Order = Vec<usize>;

/// The indexes of each predicate. The first one always has the columns in the order as written.
#[derive(Debug, Clone)]
pub(crate) struct Indexes {
    orders: Vec<Arc<Vec<Order>>>,
}

impl Indexes {
    /// Creates only the first index of every predicate.
    pub(crate) fn new(predicates: &Predicates) -> Self {
        Self {
            orders: predicates
                .list
                .iter()
                .map(|p| Arc::new(vec![(0..p.width).collect()]))
                .collect(),
        }
    }

    /// Returns the column orders of one predicate.
    pub(crate) fn of(&self, predicate: PredicateId) -> &Arc<Vec<Order>> {
        &self.orders[predicate]
    }

    /// Returns the indexes that begin with the given columns (in any order).
    pub(crate) fn all_beginning_with(
        &self,
        predicate: PredicateId,
        columns: &[usize],
    ) -> impl Iterator<Item = usize> {
        let begins = |order: &Order| {
            order[..columns.len()]
                .iter()
                .all(|column| columns.contains(column))
        };
        self.orders[predicate]
            .iter()
            .enumerate()
            .filter(move |(_, order)| begins(order))
            .map(|(index, _)| index)
    }

    /// Finds or adds an index that begins with the given columns (in any order).
    pub(crate) fn beginning_with(&mut self, predicate: PredicateId, columns: &[usize]) -> usize {
        let orders = Arc::make_mut(&mut self.orders[predicate]);
        let begins = |order: &Order| {
            order[..columns.len()]
                .iter()
                .all(|column| columns.contains(column))
        };
        if let Some(found) = orders.iter().position(begins) {
            return found;
        }
        let width = orders[0].len();
        let mut order = columns.to_vec();
        order.extend((0..width).filter(|column| !columns.contains(column)));
        orders.push(order);
        orders.len() - 1
    }

    /// Finds an index that begins with the given columns (in any order), followed by another one.
    /// Adds it if it is missing and `add` is set.
    pub(crate) fn followed_by(
        &mut self,
        predicate: PredicateId,
        columns: &[usize],
        last: usize,
        add: bool,
    ) -> Option<usize> {
        let begins = |order: &Order| {
            order[..columns.len()]
                .iter()
                .all(|column| columns.contains(column))
                && order[columns.len()] == last
        };
        let orders = &self.orders[predicate];
        let found = orders.iter().position(begins);
        if found.is_some() || !add {
            return found;
        }
        let fixed: Vec<usize> = columns.iter().copied().chain([last]).collect();
        let rest = (0..orders[0].len()).filter(|column| !fixed.contains(column));
        let order = fixed.iter().copied().chain(rest).collect();
        let orders = Arc::make_mut(&mut self.orders[predicate]);
        orders.push(order);
        Some(orders.len() - 1)
    }
}

/// Which tuples a condition reads from a predicate of its own stratum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    /// Tuples of all rounds.
    All,
    /// Tuples of the rounds before the last.
    Old,
    /// Tuples of the last round.
    Recent,
}

/// How a column outside the key is matched.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Column {
    /// Binds the variable to the column's value.
    Bind(Variable),
    /// The value must equal the variable, which an earlier column of the same atom has bound.
    Same(Variable),
}

/// A later step that checks the value which a scan binds. Its rows may be read instead, if they are
/// fewer.
#[derive(Debug, Clone)]
pub(crate) struct Rival {
    /// Position of the check.
    pub(crate) at: usize,
    /// The check's key without the value, in the order of its index. The value's column is next.
    pub(crate) key: Vec<Operand>,
}

/// Reads the tuples that begin with a key.
#[derive(Debug, Clone)]
pub(crate) struct Scan {
    pub(crate) predicate: PredicateId,
    pub(crate) part: Part,
    pub(crate) index: usize,
    pub(crate) key: Vec<Operand>,
    /// Offsets in the index's order, with how to match each.
    pub(crate) columns: Vec<(usize, Column)>,
    /// None of the bound variables is read later, so one match is enough.
    pub(crate) once: bool,
    /// The head's variables are bound before this step, so one match of this step and all later
    /// ones is enough.
    pub(crate) exists: bool,
    /// After this many columns, the head's variables are bound: rows that agree in them need one
    /// match in all. 0 if no column is left, or some variable is bound later.
    pub(crate) settled: usize,
    pub(crate) rivals: Vec<Rival>,
    /// The rows are sorted by a computed value, and `index` is not used.
    pub(crate) keyed: Option<Arc<Keyed>>,
}

/// One step of a rule's evaluation.
#[derive(Debug, Clone)]
pub(crate) enum Op {
    /// Continues for each matching tuple.
    Scan(Scan),
    /// Continues only if no tuple begins with the key.
    Absent {
        predicate: PredicateId,
        index: usize,
        key: Vec<Operand>,
    },
    Assign {
        variable: Variable,
        value: Expr,
    },
    /// Like an assignment, but continues only if some tuple may have the value.
    Equate {
        variable: Variable,
        value: Expr,
    },
    Compare {
        op: Comparison,
        left: Expr,
        right: Expr,
    },
    Test {
        value: Expr,
    },
}

/// One way to evaluate a rule: over all tuples, or with one condition restricted to recent tuples.
#[derive(Debug, Clone)]
pub(crate) struct Variant {
    /// Conditions that share no variable with the head or with each other: each needs one match
    /// only.
    pub(crate) guards: Vec<Vec<Op>>,
    /// The other conditions.
    pub(crate) ops: Vec<Op>,
    /// The condition that is restricted to recent tuples.
    pub(crate) delta: Option<usize>,
    /// Whether the conditions can be evaluated in more than one order.
    pub(crate) has_choice: bool,
    /// Whether rows that are looked up by some columns could be looked up by a computed value too,
    /// if they are many.
    pub(crate) may_meet: bool,
}

/// A rule's variants.
#[derive(Debug, Clone)]
pub(crate) struct RulePlan {
    pub(crate) variants: Vec<Variant>,
}

/// Expected number of tuples of a predicate; `None` if unknown.
pub(crate) type Sizes<'a> = &'a dyn Fn(PredicateId) -> Option<usize>;

/// Returns the order in which the atoms of a group of conditions are read, the delta first.
pub(crate) type AtomOrder<'a> = &'a mut dyn FnMut(&[usize], Option<usize>) -> Vec<usize>;

/// The conditions of a rule in groups without common variables, each with the order of its atoms.
pub(crate) struct Orders {
    /// Groups that share no variable with the head: each needs one match only.
    guards: Vec<(Vec<usize>, Vec<usize>)>,
    /// All other conditions.
    main: (Vec<usize>, Vec<usize>),
    has_choice: bool,
}

impl Orders {
    pub(crate) fn new(rule: &Rule, parts: &Parts, order: AtomOrder<'_>) -> Self {
        let outputs = outputs(rule);
        let in_head = |idx: &usize| {
            literal_variables(&rule.body[*idx])
                .iter()
                .any(|v| outputs[*v])
        };
        let (main, guards): (Vec<_>, Vec<_>) = groups(rule)
            .into_iter()
            .partition(|group| group.iter().any(in_head));
        let mut main = main.concat();
        main.sort_unstable();
        let mut has_choice = false;
        let mut ordered = |group: Vec<usize>| {
            let atoms = group
                .iter()
                .filter(|idx| matches!(rule.body[**idx], Literal::Positive(_)))
                .count();
            let first = parts.delta.filter(|delta| group.contains(delta));
            has_choice |= atoms > if first.is_some() { 2 } else { 1 };
            let order = order(&group, first);
            (group, order)
        };
        let guards = guards.into_iter().map(&mut ordered).collect();
        let main = ordered(main);
        Self {
            guards,
            main,
            has_choice,
        }
    }
}

/// Which tuples a condition reads, by its position in the body.
pub(crate) struct Parts {
    /// Conditions that read predicates of the rule's own recursive stratum.
    own: Vec<usize>,
    /// The condition that is restricted to recent tuples.
    pub(crate) delta: Option<usize>,
}

impl Parts {
    pub(crate) fn new(rule: &Rule, stratum: &Stratum, delta: Option<usize>) -> Self {
        Self {
            own: own_atoms(rule, stratum),
            delta,
        }
    }

    /// Returns the tuples that a condition reads. A pair of recent tuples is found only once: by
    /// the first of the two conditions.
    pub(crate) fn of(&self, idx: usize) -> Part {
        match self.delta.map(|delta| idx.cmp(&delta)) {
            Some(std::cmp::Ordering::Equal) => Part::Recent,
            Some(std::cmp::Ordering::Less) if self.own.contains(&idx) => Part::Old,
            _ => Part::All,
        }
    }
}

fn own_atoms(rule: &Rule, stratum: &Stratum) -> Vec<usize> {
    let own = |literal: &Literal| {
        matches!(literal, Literal::Positive(atom)
            if stratum.recursive && stratum.predicates.binary_search(&atom.predicate).is_ok())
    };
    (0..rule.body.len())
        .filter(|idx| own(&rule.body[*idx]))
        .collect()
}

/// Plans a rule of a stratum before its tuples are known.
pub(crate) fn plan_rule(
    rule: &Rule,
    stratum: &Stratum,
    indexes: &mut Indexes,
    sizes: Sizes<'_>,
) -> RulePlan {
    let own = own_atoms(rule, stratum);
    let deltas: Vec<Option<usize>> = if own.is_empty() {
        vec![None]
    } else {
        own.into_iter().map(Some).collect()
    };
    let variants = deltas
        .into_iter()
        .map(|delta| {
            let parts = Parts::new(rule, stratum, delta);
            let orders = Orders::new(rule, &parts, &mut |group, first| {
                by_connection(rule, group, first, sizes)
            });
            plan_variant(rule, &parts, &orders, indexes, None)
        })
        .collect();
    RulePlan { variants }
}

/// Plans one variant with given orders of atoms. `measured`: the atoms that have many rows for each
/// key, if they were counted. Then an index may be added only to read the smaller of two sets of
/// rows that must share a value.
pub(crate) fn plan_variant(
    rule: &Rule,
    parts: &Parts,
    orders: &Orders,
    indexes: &mut Indexes,
    measured: Option<&BTreeSet<usize>>,
) -> Variant {
    let mut may_meet = false;
    let mut lowered = |(group, atoms): &(Vec<usize>, Vec<usize>), outputs: &[bool]| {
        let mut ops = lower(rule, group, atoms, parts, indexes, measured, &mut may_meet);
        mark(rule, outputs, &mut ops);
        add_rivals(&mut ops, indexes, measured.is_some());
        ops
    };
    let guards = orders
        .guards
        .iter()
        .map(|guard| lowered(guard, &[]))
        .collect();
    let ops = lowered(&orders.main, &outputs(rule));
    Variant {
        guards,
        ops,
        delta: parts.delta,
        has_choice: orders.has_choice || may_meet,
        may_meet,
    }
}

/// Orders the atoms of a group before their tuples are known: those that share variables with
/// earlier ones first, then by expected number of matches.
pub(crate) fn by_connection(
    rule: &Rule,
    group: &[usize],
    first: Option<usize>,
    sizes: Sizes<'_>,
) -> Vec<usize> {
    let mut bound = vec![false; rule.variables.len()];
    let mut left: Vec<(usize, &Atom)> = group
        .iter()
        .filter_map(|idx| match &rule.body[*idx] {
            Literal::Positive(atom) => Some((*idx, atom)),
            _ => None,
        })
        .collect();
    let mut sorted = Vec::new();
    let mut next = first;
    while !left.is_empty() {
        settle(rule, group, &mut bound);
        let place = next
            .take()
            .and_then(|first| left.iter().position(|(idx, _)| *idx == first))
            .unwrap_or_else(|| best_atom(rule, group, &left, &bound, sizes));
        let (idx, atom) = left.remove(place);
        operand_variables(&atom.args)
            .into_iter()
            .for_each(|v| bound[v] = true);
        sorted.push(idx);
    }
    sorted
}

/// Returns the place of the atom to read next, the first one of equals.
fn best_atom(
    rule: &Rule,
    group: &[usize],
    left: &[(usize, &Atom)],
    bound: &[bool],
    sizes: Sizes<'_>,
) -> usize {
    let rank = |atom: &Atom| {
        // Unknown sizes count as 1000 tuples. A constant or bound variable is assumed to keep one
        // tuple of ten.
        let size = sizes(atom.predicate).unwrap_or(1000) as f64;
        let constants = atom
            .args
            .iter()
            .filter(|arg| matches!(arg, Operand::Constant(_)))
            .count();
        let shared = operand_variables(&atom.args)
            .into_iter()
            .filter(|v| bound[*v])
            .count();
        // A computed value that must be equal counts as a variable.
        let meets =
            bound.contains(&true) && meeting(rule, group.iter().copied(), atom, bound).is_some();
        let shared = shared + usize::from(meets);
        let fixed = constants + shared;
        let expected = if fixed >= atom.args.len() {
            0.0
        } else {
            size / 10f64.powi(i32::try_from(fixed).unwrap_or(9))
        };
        // The first atom, and one whose columns are all fixed, need no shared variable.
        (
            bound.contains(&true) && shared == 0 && expected > 0.0,
            expected,
        )
    };
    let mut best = (0, (true, f64::INFINITY));
    for (place, (_, atom)) in left.iter().enumerate() {
        let rank = rank(atom);
        if (!rank.0 && best.1.0) || (rank.0 == best.1.0 && rank.1 < best.1.1) {
            best = (place, rank);
        }
    }
    best.0
}

/// Returns the value of an operand under a binding. [`Operand::Any`] is never part of a key or a
/// head.
pub(crate) fn operand_value(operand: Operand, binding: &[TermId]) -> TermId {
    match operand {
        Operand::Constant(id) => id,
        Operand::Variable(variable) => binding[variable],
        Operand::Any => TermId::MAX,
    }
}
