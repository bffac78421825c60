//! Semi-naive evaluation, stratum by stratum, on datafrog relations.

use std::collections::{BTreeMap, HashMap};

use crate::check::stratify::Stratum;
use crate::engine::aggregate::{aggregate, projection};
use crate::engine::join::{Join, Sink};
use crate::engine::meter::{Meter, Stop};
use crate::engine::plan::{Indexes, Op, Part, RulePlan, Sizes, Variant, plan_rule};
use crate::engine::relation::{Batch, Finished, Growing, finished, growing};
use crate::model::program::{PredicateId, Predicates, Program, Rule};
use crate::model::universe::Universe;
use actcheck_base::{RuleFault, TermId};

/// Finished tuples by predicate.
#[derive(Default)]
pub(crate) struct Tables {
    list: Vec<Option<Box<dyn Finished>>>,
}

impl Tables {
    pub(crate) fn new(predicates: usize) -> Self {
        let mut list = Vec::new();
        list.resize_with(predicates, || None);
        Self { list }
    }

    pub(crate) fn get(&self, predicate: PredicateId) -> Option<&dyn Finished> {
        self.list.get(predicate)?.as_deref()
    }

    /// Removes and returns the rows of a predicate.
    pub(crate) fn take_rows(&mut self, predicate: PredicateId) -> Vec<TermId> {
        self.list.get_mut(predicate).and_then(Option::take).map_or(Vec::new(), |table| table.into_rows())
    }

    pub(crate) fn set(&mut self, predicate: PredicateId, table: Box<dyn Finished>) {
        if self.list.len() <= predicate {
            self.list.resize_with(predicate + 1, || None);
        }
        self.list[predicate] = Some(table);
    }
}

/// Finished tuples in layers: a predicate missing from the own tables is looked up in the layers below.
pub(crate) struct Layers<'a> {
    pub(crate) own: Tables,
    /// Nearest layer first.
    pub(crate) below: Vec<&'a Tables>,
}

impl Layers<'_> {
    pub(crate) fn get(&self, predicate: PredicateId) -> Option<&dyn Finished> {
        self.own.get(predicate).or_else(|| self.below.iter().find_map(|tables| tables.get(predicate)))
    }

    /// Returns the sorted rows of a predicate; empty if it has no tuples.
    pub(crate) fn rows(&self, predicate: PredicateId) -> &[TermId] {
        self.get(predicate).map_or(&[], |table| table.index(0))
    }
}

/// A checked program with its strata and the plan of each rule.
#[derive(Debug, Clone)]
pub(crate) struct Planned {
    pub(crate) rules: Vec<Rule>,
    pub(crate) strata: Vec<Stratum>,
    /// Facts of the text, as rows stored one after another.
    pub(crate) facts: BTreeMap<PredicateId, Vec<TermId>>,
    plans: Vec<Option<RulePlan>>,
}

impl Planned {
    /// Plans every rule of a stratified program.
    pub(crate) fn new(program: Program, strata: Vec<Stratum>, indexes: &mut Indexes, sizes: Sizes<'_>) -> Self {
        let mut plans: Vec<Option<RulePlan>> = vec![None; program.rules.len()];
        for stratum in &strata {
            for rule in &stratum.rules {
                plans[*rule] = Some(plan_rule(&program.rules[*rule], stratum, indexes, sizes));
            }
        }
        Self { rules: program.rules, strata, facts: program.facts, plans }
    }
}

/// Why and where an evaluation stopped.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stopped {
    pub(crate) stop: Stop,
    /// Index of the rule being evaluated, if known.
    pub(crate) rule: Option<usize>,
}

/// The round in which each tuple of a recursive stratum was first derived, counted over all strata. A proof that uses
/// only premises of earlier rounds can't be circular.
#[derive(Debug, Default)]
pub(crate) struct Rounds {
    of: HashMap<(PredicateId, Vec<TermId>), u32>,
    next: u32,
}

impl Rounds {
    /// Returns the round of a tuple, or `None` if its stratum is not recursive.
    pub(crate) fn of(&self, predicate: PredicateId, row: &[TermId]) -> Option<u32> {
        self.of.get(&(predicate, row.to_vec())).copied()
    }
}

/// Evaluates a program over the tuples in the layers. The results go to the layers' own tables.
pub(crate) fn evaluate(
    planned: &Planned,
    predicates: &Predicates,
    indexes: &Indexes,
    layers: &mut Layers<'_>,
    universe: &mut Universe<'_>,
    meter: &mut Meter,
) -> Result<(), Stopped> {
    evaluate_recording_rounds(planned, predicates, indexes, layers, universe, meter, None)
}

/// Evaluates a program and, for explanations, records the round of each tuple.
pub(crate) fn evaluate_recording_rounds(
    planned: &Planned,
    predicates: &Predicates,
    indexes: &Indexes,
    layers: &mut Layers<'_>,
    universe: &mut Universe<'_>,
    meter: &mut Meter,
    rounds: Option<&mut Rounds>,
) -> Result<(), Stopped> {
    let mut run = Run { planned, predicates, indexes, universe, meter, rounds };
    run.facts(layers);
    for stratum in &planned.strata {
        run.meter.check().map_err(|stop| Stopped { stop, rule: stratum.rules.first().copied() })?;
        if stratum.recursive {
            run.recursive(stratum, layers)?;
        } else {
            run.once(stratum, layers)?;
        }
    }
    Ok(())
}

/// Maximum size of the matches kept at once for an aggregating rule. Unit: terms of 4 bytes (1 GiB).
const AGGREGATE_LIMIT: usize = 1 << 28;

struct Run<'a, 'u, 't> {
    planned: &'a Planned,
    predicates: &'a Predicates,
    indexes: &'a Indexes,
    universe: &'u mut Universe<'t>,
    meter: &'u mut Meter,
    rounds: Option<&'u mut Rounds>,
}

/// The growing tuples of a stratum, in the order of its predicates.
type Grown = Vec<Box<dyn Growing>>;

impl Run<'_, '_, '_> {
    /// Adds the facts of the text to the existing tuples.
    fn facts(&mut self, layers: &mut Layers<'_>) {
        for (predicate, facts) in &self.planned.facts {
            let mut rows = layers.rows(*predicate).to_vec();
            if rows.is_empty() {
                self.finish(*predicate, facts, layers);
                continue;
            }
            rows.extend(facts);
            self.finish(*predicate, &rows, layers);
        }
    }

    fn finish(&self, predicate: PredicateId, rows: &[TermId], layers: &mut Layers<'_>) {
        let width = self.predicates.get(predicate).width;
        layers.own.set(predicate, finished(width, rows, self.indexes.of(predicate).clone()));
    }

    /// Evaluates a stratum without recursion: each rule once.
    fn once(&mut self, stratum: &Stratum, layers: &mut Layers<'_>) -> Result<(), Stopped> {
        let Some(predicate) = stratum.predicates.first().copied() else { return Ok(()) };
        let mut rows = layers.rows(predicate).to_vec();
        for rule in &stratum.rules {
            let stopped = |stop| Stopped { stop, rule: Some(*rule) };
            let Some(plan) = &self.planned.plans[*rule] else { continue };
            for variant in &plan.variants {
                let derived = self.variant(*rule, variant, layers, None, &mut |_, _| Ok(())).map_err(stopped)?;
                self.meter.derived(derived.len() / self.predicates.get(predicate).width).map_err(stopped)?;
                rows.extend(derived);
            }
        }
        self.finish(predicate, &rows, layers);
        Ok(())
    }

    /// Evaluates a recursive stratum in rounds, each over the tuples found in the previous one.
    fn recursive(&mut self, stratum: &Stratum, layers: &mut Layers<'_>) -> Result<(), Stopped> {
        let mut grown = self.grow(stratum, layers);
        for rule in &stratum.rules {
            self.insert_all(*rule, false, stratum, layers, &grown)?;
        }
        loop {
            let mut changed = false;
            for growing in &mut grown {
                changed |= growing.changed();
            }
            if !changed {
                break;
            }
            self.record_rounds(stratum, &grown);
            let found = grown.iter().map(|growing| growing.recent_len()).sum();
            let recursive_rule = || stratum.rules.iter().copied().find(|rule| self.is_recursive(*rule));
            let rule = recursive_rule();
            self.meter.derived(found).map_err(|stop| Stopped { stop, rule })?;
            self.meter.check().map_err(|stop| Stopped { stop, rule })?;
            for rule in &stratum.rules {
                self.insert_all(*rule, true, stratum, layers, &grown)?;
            }
        }
        for (predicate, growing) in stratum.predicates.iter().zip(grown) {
            layers.own.set(*predicate, growing.complete());
        }
        Ok(())
    }

    /// Records the round of the recent tuples, if rounds are requested.
    fn record_rounds(&mut self, stratum: &Stratum, grown: &Grown) {
        let Some(rounds) = &mut self.rounds else { return };
        rounds.next += 1;
        for (predicate, growing) in stratum.predicates.iter().zip(grown) {
            let mut batches = Vec::new();
            growing.batches(Part::Recent, 0, &mut batches);
            let width = self.predicates.get(*predicate).width;
            for row in batches.iter().flat_map(|batch| batch.chunks_exact(width)) {
                rounds.of.insert((*predicate, row.to_vec()), rounds.next);
            }
        }
    }

    fn is_recursive(&self, rule: usize) -> bool {
        self.planned.plans[rule].as_ref().is_some_and(|plan| plan.variants.iter().any(|variant| variant.recent))
    }

    /// Creates the growing tuples of the stratum's predicates, with the known tuples inserted.
    fn grow(&self, stratum: &Stratum, layers: &Layers<'_>) -> Grown {
        let mut wanted: Vec<Vec<bool>> =
            stratum.predicates.iter().map(|p| vec![false; self.indexes.of(*p).len()]).collect();
        for rule in &stratum.rules {
            for op in self.planned.plans[*rule].iter().flat_map(|plan| &plan.variants).flat_map(|v| &v.ops) {
                if let Op::Scan { predicate, index, .. } = op
                    && let Ok(place) = stratum.predicates.binary_search(predicate)
                {
                    wanted[place][*index] = true;
                }
            }
        }
        let mut grown = Vec::new();
        for (predicate, wanted) in stratum.predicates.iter().zip(&wanted) {
            let growing = growing(self.predicates.get(*predicate).width, self.indexes.of(*predicate).clone(), wanted);
            let known = layers.rows(*predicate).to_vec();
            if !known.is_empty() {
                growing.insert(known);
            }
            grown.push(growing);
        }
        grown
    }

    /// Adds the tuples derived by the variants of one rule that read recent tuples, or by those that don't.
    fn insert_all(
        &mut self,
        rule: usize,
        recent: bool,
        stratum: &Stratum,
        layers: &Layers<'_>,
        grown: &Grown,
    ) -> Result<(), Stopped> {
        let Some(plan) = &self.planned.plans[rule] else { return Ok(()) };
        let Ok(place) = stratum.predicates.binary_search(&self.planned.rules[rule].head.predicate) else {
            return Ok(());
        };
        let target = &grown[place];
        let mut flushed = 0;
        for variant in plan.variants.iter().filter(|variant| variant.recent == recent) {
            let mut flush = |sink: &mut Sink, left: usize| {
                flushed += target.insert(std::mem::take(&mut sink.rows));
                if flushed > left { Err(Stop::Tuples) } else { Ok(()) }
            };
            let rows = self
                .variant(rule, variant, layers, Some((stratum, grown)), &mut flush)
                .map_err(|stop| Stopped { stop, rule: Some(rule) })?;
            target.insert(rows);
        }
        Ok(())
    }

    /// Returns the rows that each step of a variant reads, and their widths. Returns `None` if an atom has no rows.
    fn sources<'b>(
        &self,
        variant: &Variant,
        layers: &'b Layers<'_>,
        grown: Option<(&Stratum, &'b Grown)>,
    ) -> Option<(Vec<Vec<Batch<'b>>>, Vec<usize>)> {
        let mut batches = Vec::with_capacity(variant.ops.len());
        let mut widths = Vec::with_capacity(variant.ops.len());
        for op in &variant.ops {
            let (predicate, part, index) = match op {
                Op::Scan { predicate, part, index, .. } => (*predicate, *part, *index),
                Op::Absent { predicate, index, .. } => (*predicate, Part::All, *index),
                _ => {
                    batches.push(Vec::new());
                    widths.push(1);
                    continue;
                }
            };
            let mut found = Vec::new();
            let place =
                grown.and_then(|(stratum, grown)| Some((stratum.predicates.binary_search(&predicate).ok()?, grown)));
            match place {
                Some((place, grown)) => grown[place].batches(part, index, &mut found),
                None => found.extend(layers.get(predicate).map(|table| Batch::Plain(table.index(index)))),
            }
            if matches!(op, Op::Scan { .. }) && found.iter().all(|batch| batch.is_empty()) {
                return None;
            }
            batches.push(found);
            widths.push(self.predicates.get(predicate).width);
        }
        Some((batches, widths))
    }

    /// Returns the head rows that one variant derives.
    fn variant(
        &mut self,
        rule: usize,
        variant: &Variant,
        layers: &Layers<'_>,
        grown: Option<(&Stratum, &Grown)>,
        flush: &mut dyn FnMut(&mut Sink, usize) -> Result<(), Stop>,
    ) -> Result<Vec<TermId>, Stop> {
        let rule = &self.planned.rules[rule];
        let Some((batches, widths)) = self.sources(variant, layers, grown) else { return Ok(Vec::new()) };
        let operands = match &rule.aggregation {
            Some(aggregation) => projection(aggregation),
            None => rule.head.args.clone(),
        };
        let mut sink = Sink { operands, rows: Vec::new() };
        let left = self.meter.tuples_left();
        let aggregating = rule.aggregation.is_some();
        Join {
            ops: &variant.ops,
            batches: &batches,
            widths: &widths,
            binding: vec![0; rule.variables.len()],
            universe: self.universe,
            meter: self.meter,
            sink: &mut sink,
            flush: &mut |sink| match aggregating {
                true if sink.rows.len() > AGGREGATE_LIMIT => Err(Stop::Tuples),
                true => Ok(()),
                false => flush(sink, left),
            },
        }
        .run(0)?;
        Ok(match &rule.aggregation {
            Some(aggregation) => aggregate(rule, aggregation, &sink.rows, self.universe, self.meter)?,
            None => sink.rows,
        })
    }
}

/// Returns the fault of a stopped evaluation, with the rule's name and place.
pub(crate) fn fault(meter: &Meter, stopped: Stopped, planned: &Planned) -> RuleFault {
    meter.fault(stopped.stop, stopped.rule.map(|rule| &planned.rules[rule]))
}
