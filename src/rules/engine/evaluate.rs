//! Semi-naive evaluation, stratum by stratum, on datafrog relations.

use std::collections::{BTreeMap, HashMap};

use crate::check::stratify::Stratum;
use crate::engine::aggregate::{aggregate, projection};
use crate::engine::collect::{Distinct, Sink, bytes_of_row};
use crate::engine::join::Join;
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
    run.facts(layers).map_err(|stop| Stopped { stop, rule: None })?;
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

/// Memory of a recorded round without the row. Unit: bytes.
const ROUND_BYTES: usize = 64;

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
    fn facts(&mut self, layers: &mut Layers<'_>) -> Result<(), Stop> {
        for (predicate, facts) in &self.planned.facts {
            let mut rows = layers.rows(*predicate).to_vec();
            if rows.is_empty() {
                self.finish(*predicate, facts, layers);
                continue;
            }
            rows.extend(facts);
            self.meter.watch.hold(rows.len() / self.predicates.get(*predicate).width * self.row_bytes(*predicate))?;
            self.finish(*predicate, &rows, layers);
        }
        Ok(())
    }

    /// Returns the memory of a tuple in all its orders. Unit: bytes.
    fn row_bytes(&self, predicate: PredicateId) -> usize {
        bytes_of_row(self.predicates.get(predicate).width, self.indexes.of(predicate).len())
    }

    fn finish(&self, predicate: PredicateId, rows: &[TermId], layers: &mut Layers<'_>) {
        let width = self.predicates.get(predicate).width;
        layers.own.set(predicate, finished(width, rows, self.indexes.of(predicate).clone()));
    }

    /// Evaluates a stratum without recursion: each rule once.
    fn once(&mut self, stratum: &Stratum, layers: &mut Layers<'_>) -> Result<(), Stopped> {
        let Some(predicate) = stratum.predicates.first().copied() else { return Ok(()) };
        let (width, orders) = (self.predicates.get(predicate).width, self.indexes.of(predicate).len());
        let mut found = Distinct::new(width, layers.rows(predicate).to_vec(), orders);
        let mut sink = Sink::new(Vec::new());
        let mut empty = |sink: &mut Sink, meter: &Meter| {
            found.add(sink, &meter.watch)?;
            meter.room_for(found.new_rows())
        };
        for rule in &stratum.rules {
            let stopped = |stop| Stopped { stop, rule: Some(*rule) };
            for variant in self.planned.plans[*rule].iter().flat_map(|plan| &plan.variants) {
                self.variant(*rule, variant, layers, None, &mut sink, &mut empty).map_err(stopped)?;
            }
        }
        let stopped = |stop| Stopped { stop, rule: stratum.rules.last().copied() };
        empty(&mut sink, self.meter).map_err(stopped)?;
        self.meter.derived(found.new_rows()).map_err(stopped)?;
        self.finish(predicate, &found.into_rows(), layers);
        Ok(())
    }

    /// Evaluates a recursive stratum in rounds, each over the tuples found in the previous one.
    fn recursive(&mut self, stratum: &Stratum, layers: &mut Layers<'_>) -> Result<(), Stopped> {
        let mut grown = self.grow(stratum, layers);
        // Number of new tuples of the round.
        let mut new = 0;
        for rule in &stratum.rules {
            self.insert_all(*rule, false, stratum, layers, &grown, &mut new)?;
        }
        loop {
            let mut changed = false;
            for growing in &mut grown {
                changed |= growing.changed();
            }
            if !changed {
                break;
            }
            let rule = stratum.rules.iter().copied().find(|rule| self.is_recursive(*rule));
            let stopped = |stop| Stopped { stop, rule };
            self.record_rounds(stratum, &grown).map_err(stopped)?;
            self.meter.derived(new).map_err(stopped)?;
            self.meter.check().map_err(stopped)?;
            new = 0;
            for rule in &stratum.rules {
                self.insert_all(*rule, true, stratum, layers, &grown, &mut new)?;
            }
        }
        for (predicate, growing) in stratum.predicates.iter().zip(grown) {
            layers.own.set(*predicate, growing.complete());
        }
        Ok(())
    }

    /// Records the round of the recent tuples, if rounds are requested.
    fn record_rounds(&mut self, stratum: &Stratum, grown: &Grown) -> Result<(), Stop> {
        let Some(rounds) = &mut self.rounds else { return Ok(()) };
        rounds.next += 1;
        for (predicate, growing) in stratum.predicates.iter().zip(grown) {
            let mut batches = Vec::new();
            growing.batches(Part::Recent, 0, &mut batches);
            let width = self.predicates.get(*predicate).width;
            for row in batches.iter().flat_map(|batch| batch.chunks_exact(width)) {
                rounds.of.insert((*predicate, row.to_vec()), rounds.next);
                self.meter.watch.hold(ROUND_BYTES + bytes_of_row(width, 0))?;
            }
        }
        Ok(())
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
            let mut known = layers.rows(*predicate).to_vec();
            if !known.is_empty() {
                growing.insert(&mut known);
            }
            grown.push(growing);
        }
        grown
    }

    /// Adds the tuples derived by the variants of one rule that read recent tuples, or by those that don't. `new`: number
    /// of new tuples in this round.
    fn insert_all(
        &mut self,
        rule: usize,
        recent: bool,
        stratum: &Stratum,
        layers: &Layers<'_>,
        grown: &Grown,
        new: &mut usize,
    ) -> Result<(), Stopped> {
        let Some(plan) = &self.planned.plans[rule] else { return Ok(()) };
        let predicate = self.planned.rules[rule].head.predicate;
        let Ok(place) = stratum.predicates.binary_search(&predicate) else { return Ok(()) };
        let (target, row_bytes) = (&grown[place], self.row_bytes(predicate));
        let stopped = |stop| Stopped { stop, rule: Some(rule) };
        let mut empty = |sink: &mut Sink, meter: &Meter| {
            let count = target.insert(&mut sink.rows);
            sink.adapt(target.added(), &meter.watch);
            *new += count;
            meter.watch.hold(count * row_bytes)?;
            meter.room_for(*new)
        };
        let mut sink = Sink::new(Vec::new());
        for variant in plan.variants.iter().filter(|variant| variant.recent == recent) {
            self.variant(rule, variant, layers, Some((stratum, grown)), &mut sink, &mut empty).map_err(stopped)?;
        }
        if sink.rows.is_empty() { Ok(()) } else { empty(&mut sink, self.meter).map_err(stopped) }
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

    /// Adds the head rows that one variant derives to a sink; `empty` empties it when it is full.
    fn variant(
        &mut self,
        rule: usize,
        variant: &Variant,
        layers: &Layers<'_>,
        grown: Option<(&Stratum, &Grown)>,
        sink: &mut Sink,
        empty: &mut dyn FnMut(&mut Sink, &Meter) -> Result<(), Stop>,
    ) -> Result<(), Stop> {
        let rule = &self.planned.rules[rule];
        let Some((batches, widths)) = self.sources(variant, layers, grown) else { return Ok(()) };
        let Some(aggregation) = &rule.aggregation else {
            sink.operands.clone_from(&rule.head.args);
            return self.join(rule, variant, (&batches, &widths), sink, empty);
        };
        let operands = projection(aggregation);
        // The groups refer to the rows.
        let mut matches = Distinct::new(operands.len().max(1), Vec::new(), 4);
        let mut collected = Sink::new(operands);
        let mut collect = |sink: &mut Sink, meter: &Meter| matches.add(sink, &meter.watch);
        self.join(rule, variant, (&batches, &widths), &mut collected, &mut collect)?;
        collect(&mut collected, self.meter)?;
        let heads = aggregate(rule, aggregation, matches.rows(), self.universe, self.meter)?;
        self.meter.watch.release(matches.new_bytes());
        sink.rows.extend(heads);
        if sink.rows.len() >= sink.limit { empty(sink, self.meter) } else { Ok(()) }
    }

    fn join(
        &mut self,
        rule: &Rule,
        variant: &Variant,
        (batches, widths): (&[Vec<Batch<'_>>], &[usize]),
        sink: &mut Sink,
        flush: &mut dyn FnMut(&mut Sink, &Meter) -> Result<(), Stop>,
    ) -> Result<(), Stop> {
        let binding = vec![0; rule.variables.len()];
        let (universe, meter) = (&mut *self.universe, &mut *self.meter);
        Join { ops: &variant.ops, batches, widths, binding, universe, meter, sink, flush }.run(0)
    }
}

/// Returns the fault of a stopped evaluation, with the rule's name and place.
pub(crate) fn fault(meter: &Meter, stopped: Stopped, planned: &Planned) -> RuleFault {
    meter.fault(stopped.stop, stopped.rule.map(|rule| &planned.rules[rule]))
}
