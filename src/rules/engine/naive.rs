//! A naive evaluator that is obviously correct: nested loops over sets, repeated until there are no
//! new tuples.
//!
//! It reads the checked rules without their plans, and serves as the test oracle of the fast
//! evaluator.

use std::collections::{BTreeMap, BTreeSet};

use crate::check::stratify::Stratum;
use crate::engine::aggregate::{aggregate, projection};
use crate::engine::collect::bytes_of_row;
use crate::engine::making::sort_by_value;
use crate::engine::meter::{Meter, Stop};
use crate::engine::plan::operand_value;
use crate::engine::relation::sort_rows;
use crate::model::expression::holds;
use crate::model::program::{Atom, Literal, Operand, PredicateId, Rule};
use crate::model::universe::Universe;
use actcheck_base::{Term, TermId};

/// Tuples by predicate.
pub(crate) type Sets = BTreeMap<PredicateId, BTreeSet<Vec<TermId>>>;

/// Memory of a row in a set without its values. Unit: bytes.
const ROW_BYTES: usize = 64;

/// Adds all tuples that the rules derive to `sets`. `endless`: the predicates of new things whose
/// number is limited.
pub(crate) fn close(
    rules: &[Rule],
    strata: &[Stratum],
    endless: &BTreeSet<PredicateId>,
    sets: &mut Sets,
    universe: &mut Universe<'_>,
    meter: &mut Meter,
) -> Result<(), Stop> {
    for stratum in strata {
        let rules: Vec<&Rule> = stratum.rules.iter().map(|idx| &rules[*idx]).collect();
        let (makers, others): (Vec<&Rule>, Vec<&Rule>) =
            rules.into_iter().partition(|rule| rule.makes().is_some());
        saturate(&others, sets, universe, meter)?;
        // Until each rule in turn makes nothing.
        let (mut turn, mut idle) = (0, 0);
        while idle < makers.len() {
            let rule = makers[turn % makers.len()];
            let made = make(
                rule,
                endless.contains(&rule.head.predicate),
                sets,
                universe,
                meter,
            )?;
            (turn, idle) = (turn + 1, if made { 0 } else { idle + 1 });
            if made {
                saturate(&others, sets, universe, meter)?;
            }
        }
    }
    Ok(())
}

/// Applies rules that make no new things until there are no new tuples.
fn saturate(
    rules: &[&Rule],
    sets: &mut Sets,
    universe: &mut Universe<'_>,
    meter: &mut Meter,
) -> Result<(), Stop> {
    loop {
        let mut new = Vec::new();
        for rule in rules {
            for row in derive(rule, sets, universe, meter)? {
                if !sets
                    .get(&rule.head.predicate)
                    .is_some_and(|set| set.contains(&row))
                {
                    new.push((rule.head.predicate, row));
                }
            }
        }
        if new.is_empty() {
            return Ok(());
        }
        for (predicate, row) in new {
            add(predicate, row, sets, meter)?;
        }
    }
}

fn add(
    predicate: PredicateId,
    row: Vec<TermId>,
    sets: &mut Sets,
    meter: &mut Meter,
) -> Result<(), Stop> {
    let bytes = ROW_BYTES + bytes_of_row(row.len(), 0);
    if sets.entry(predicate).or_default().insert(row) {
        meter.derived(1)?;
        meter.watch.hold(bytes)?;
    }
    Ok(())
}

/// Makes new things for each match of a rule whose heads no tuples satisfy. Returns whether it made
/// some.
fn make(
    rule: &Rule,
    limit: bool,
    sets: &mut Sets,
    universe: &mut Universe<'_>,
    meter: &mut Meter,
) -> Result<bool, Stop> {
    let (Some(making), Some(matched)) = (rule.makes(), rule.body.iter().find_map(Literal::atom))
    else {
        return Ok(false);
    };
    let matched_rows: Vec<Vec<TermId>> = sets
        .get(&matched.predicate)
        .into_iter()
        .flatten()
        .cloned()
        .collect();
    let mut rows: Vec<&[TermId]> = matched_rows.iter().map(Vec::as_slice).collect();
    sort_by_value(&mut rows, universe);
    let heads: Vec<Literal> = making
        .heads
        .iter()
        .cloned()
        .map(Literal::Positive)
        .collect();
    let mut any = false;
    for row in rows {
        let mut binding = vec![None; rule.variables.len()];
        unify(matched, row, &mut binding);
        let mut satisfied = Vec::new();
        matches(&heads, sets, universe, &mut binding, &mut satisfied, meter)?;
        if !satisfied.is_empty() {
            continue;
        }
        for variable in &making.new {
            binding[*variable] = Some(universe.new_thing(&meter.watch)?);
            if limit {
                meter.made()?;
            }
        }
        let values: Vec<TermId> = binding.iter().map(|id| id.unwrap_or(0)).collect();
        // The heads too, so that the next match finds them.
        for atom in making.heads.iter().chain([&rule.head]) {
            let row = atom
                .args
                .iter()
                .map(|arg| operand_value(*arg, &values))
                .collect();
            add(atom.predicate, row, sets, meter)?;
        }
        any = true;
    }
    Ok(any)
}

/// Returns all head rows of one rule.
fn derive(
    rule: &Rule,
    sets: &Sets,
    universe: &mut Universe<'_>,
    meter: &mut Meter,
) -> Result<Vec<Vec<TermId>>, Stop> {
    let mut bindings = Vec::new();
    let mut binding = vec![None; rule.variables.len()];
    matches(
        &rule.body,
        sets,
        universe,
        &mut binding,
        &mut bindings,
        meter,
    )?;
    let complete =
        |binding: &[Option<TermId>]| binding.iter().map(|id| id.unwrap_or(0)).collect::<Vec<_>>();
    let width = rule.head.args.len();
    Ok(match &rule.aggregation {
        None => bindings
            .iter()
            .map(|binding| {
                rule.head
                    .args
                    .iter()
                    .map(|arg| operand_value(*arg, &complete(binding)))
                    .collect()
            })
            .collect(),
        Some(aggregation) => {
            let operands = projection(aggregation);
            let rows: Vec<TermId> = bindings
                .iter()
                .flat_map(|binding| {
                    let binding = complete(binding);
                    operands
                        .iter()
                        .map(|arg| operand_value(*arg, &binding))
                        .collect::<Vec<_>>()
                })
                .collect();
            let mut rows = rows;
            sort_rows(operands.len().max(1), &mut rows);
            aggregate(rule, aggregation, &rows, universe, meter)?
                .chunks(width)
                .map(<[TermId]>::to_vec)
                .collect()
        }
    })
}

/// Collects every binding that satisfies the conditions, which are ordered so that their inputs are
/// bound.
fn matches(
    body: &[Literal],
    sets: &Sets,
    universe: &mut Universe<'_>,
    binding: &mut Vec<Option<TermId>>,
    found: &mut Vec<Vec<Option<TermId>>>,
    meter: &mut Meter,
) -> Result<(), Stop> {
    meter.step()?;
    meter.watch.begin();
    let Some((first, rest)) = body.split_first() else {
        // Later, each match becomes a row.
        meter
            .watch
            .room(found.len() * (2 * ROW_BYTES + 2 * size_of_val(binding.as_slice())))?;
        found.push(binding.clone());
        return Ok(());
    };
    let values: Vec<TermId> = binding.iter().map(|id| id.unwrap_or(0)).collect();
    match first {
        Literal::Positive(atom) => {
            for row in sets.get(&atom.predicate).into_iter().flatten() {
                meter.step()?;
                let before = binding.clone();
                if unify(atom, row, binding) {
                    matches(rest, sets, universe, binding, found, meter)?;
                }
                *binding = before;
            }
            return Ok(());
        }
        Literal::Negative(atom) => {
            for row in sets.get(&atom.predicate).into_iter().flatten() {
                meter.step()?;
                if unify(atom, row, &mut binding.clone()) {
                    return Ok(());
                }
            }
        }
        Literal::Assign {
            variable, value, ..
        } => {
            let Some(value) = value
                .value(&values, universe, &meter.watch)
                .map(std::borrow::Cow::into_owned)
            else {
                return meter.watch.stopped();
            };
            binding[*variable] = Some(universe.create(value, &meter.watch)?);
        }
        Literal::Compare {
            op, left, right, ..
        } => {
            let watch = &meter.watch;
            let (left, right) = (
                left.value(&values, universe, watch),
                right.value(&values, universe, watch),
            );
            if !matches!((left, right), (Some(left), Some(right)) if holds(*op, &left, &right)) {
                return watch.stopped();
            }
        }
        Literal::Test { value, .. } => {
            if value
                .value(&values, universe, &meter.watch)
                .is_none_or(|value| *value != Term::Boolean(true))
            {
                return meter.watch.stopped();
            }
        }
    }
    matches(rest, sets, universe, binding, found, meter)
}

/// Returns whether a row matches an atom, and binds the atom's unbound variables.
pub(crate) fn unify(atom: &Atom, row: &[TermId], binding: &mut [Option<TermId>]) -> bool {
    atom.args.iter().zip(row).all(|(arg, value)| match arg {
        Operand::Any => true,
        Operand::Constant(id) => id == value,
        Operand::Variable(variable) => *binding[*variable].get_or_insert(*value) == *value,
    })
}
