//! Semi-naive evaluation, stratum by stratum, on datafrog relations.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use crate::check::stratify::Stratum;
use crate::check::termination::{Endless, endless};
use crate::engine::access::{Access, Own};
use crate::engine::collect::{Distinct, Sink, bytes_of_row};
use crate::engine::join::Halt;
use crate::engine::making::Search;
use crate::engine::meter::{Meter, Stop};
use crate::engine::plan::{Indexes, Op, Part, Parts, RulePlan, Scan, Sizes, Variant, plan_rule};
use crate::engine::relation::{Finished, Growing, finished, growing};
use crate::engine::variant::{Adapted, Context, allowance, attempt, replanned};
use crate::model::program::{CheckedProgram, PredicateId, Predicates, Rule};
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
        self.list
            .get_mut(predicate)
            .and_then(Option::take)
            .map_or(Vec::new(), |table| table.into_rows())
    }

    pub(crate) fn set(&mut self, predicate: PredicateId, table: Box<dyn Finished>) {
        if self.list.len() <= predicate {
            self.list.resize_with(predicate + 1, || None);
        }
        self.list[predicate] = Some(table);
    }
}

/// Finished tuples in layers: a predicate missing from the own tables is looked up in the layers
/// below.
pub(crate) struct Layers<'a> {
    pub(crate) own: Tables,
    /// Nearest layer first.
    pub(crate) below: Vec<&'a Tables>,
}

impl Layers<'_> {
    pub(crate) fn get(&self, predicate: PredicateId) -> Option<&dyn Finished> {
        self.own
            .get(predicate)
            .or_else(|| self.below.iter().find_map(|tables| tables.get(predicate)))
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
    pub(crate) plans: Vec<Option<RulePlan>>,
    /// For each rule that makes new things, how it looks for known ones.
    pub(crate) searches: Vec<Option<Search>>,
    /// The predicates of new things that may be made without end.
    pub(crate) endless: BTreeSet<PredicateId>,
}

impl Planned {
    /// Plans every rule of a stratified program.
    pub(crate) fn new(
        program: CheckedProgram,
        strata: Vec<Stratum>,
        indexes: &mut Indexes,
        sizes: Sizes<'_>,
    ) -> Self {
        let mut plans: Vec<Option<RulePlan>> = vec![None; program.rules.len()];
        let mut searches: Vec<Option<Search>> = vec![None; program.rules.len()];
        for stratum in &strata {
            for idx in &stratum.rules {
                let rule = &program.rules[*idx];
                match rule.makes() {
                    Some(making) => searches[*idx] = Some(Search::new(rule, making, indexes)),
                    None => plans[*idx] = Some(plan_rule(rule, stratum, indexes, sizes)),
                }
            }
        }
        let endless = endless(&program.rules).iter().map(Endless::made).collect();
        Self {
            rules: program.rules,
            strata,
            facts: program.facts,
            plans,
            searches,
            endless,
        }
    }
}

/// Why and where an evaluation stopped.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stopped {
    pub(crate) stop: Stop,
    /// Index of the rule being evaluated, if known.
    pub(crate) rule: Option<usize>,
}

/// The round in which each tuple of a recursive stratum was first derived, counted over all strata.
/// A proof that uses only premises of earlier rounds can't be circular.
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
    let access = Access::new(predicates, indexes);
    Run {
        planned,
        predicates,
        access,
        adapted: Adapted::new(),
        spent: HashMap::new(),
        universe,
        meter,
        rounds,
    }
    .all(layers)
}

/// Memory of a recorded round without the row. Unit: bytes.
const ROUND_BYTES: usize = 64;

/// One evaluation of a program.
pub(crate) struct Run<'a, 'u, 't> {
    pub(crate) planned: &'a Planned,
    pub(crate) predicates: &'a Predicates,
    pub(crate) access: Access<'a>,
    pub(crate) adapted: Adapted,
    /// Number of rows that each variant of a rule has read.
    pub(crate) spent: HashMap<(usize, usize), u64>,
    pub(crate) universe: &'u mut Universe<'t>,
    pub(crate) meter: &'u mut Meter,
    pub(crate) rounds: Option<&'u mut Rounds>,
}

/// The growing tuples of a stratum, in the order of its predicates.
pub(crate) type Grown = Vec<Box<dyn Growing>>;

impl Run<'_, '_, '_> {
    /// Evaluates all strata.
    pub(crate) fn all(&mut self, layers: &mut Layers<'_>) -> Result<(), Stopped> {
        self.facts(layers)
            .map_err(|stop| Stopped { stop, rule: None })?;
        for stratum in &self.planned.strata {
            self.meter.check().map_err(|stop| Stopped {
                stop,
                rule: stratum.rules.first().copied(),
            })?;
            if stratum.recursive {
                self.recursive(stratum, layers)?;
            } else {
                self.once(stratum, layers)?;
            }
        }
        Ok(())
    }

    /// Adds the facts of the text to the existing tuples.
    fn facts(&mut self, layers: &mut Layers<'_>) -> Result<(), Stop> {
        for (predicate, facts) in &self.planned.facts {
            let mut rows = layers.rows(*predicate).to_vec();
            if rows.is_empty() {
                self.finish(*predicate, facts, layers);
                continue;
            }
            rows.extend(facts);
            self.meter.watch.hold(
                rows.len() / self.predicates.get(*predicate).width * self.row_bytes(*predicate),
            )?;
            self.finish(*predicate, &rows, layers);
        }
        Ok(())
    }

    /// Returns the memory of a tuple in all its orders. Unit: bytes.
    pub(crate) fn row_bytes(&self, predicate: PredicateId) -> usize {
        bytes_of_row(
            self.predicates.get(predicate).width,
            self.access.indexes.of(predicate).len(),
        )
    }

    fn finish(&self, predicate: PredicateId, rows: &[TermId], layers: &mut Layers<'_>) {
        let width = self.predicates.get(predicate).width;
        layers.own.set(
            predicate,
            finished(width, rows, self.access.indexes.of(predicate).clone()),
        );
    }

    /// Evaluates a stratum without recursion: each rule once.
    fn once(&mut self, stratum: &Stratum, layers: &mut Layers<'_>) -> Result<(), Stopped> {
        let Some(predicate) = stratum.predicates.first().copied() else {
            return Ok(());
        };
        let (width, orders) = (
            self.predicates.get(predicate).width,
            self.access.indexes.of(predicate).len(),
        );
        let mut found = Distinct::new(width, layers.rows(predicate).to_vec(), orders);
        let mut sink = Sink::new(Vec::new());
        let mut empty = |sink: &mut Sink, meter: &Meter| {
            found.add(sink, &meter.watch)?;
            meter.room_for(found.new_rows())
        };
        for rule in &stratum.rules {
            let stopped = |stop| Stopped {
                stop,
                rule: Some(*rule),
            };
            for variant in 0..self.variants(*rule).len() {
                let mut empty = |_: &Grown, sink: &mut Sink, meter: &Meter| empty(sink, meter);
                let grown = &mut Grown::new();
                self.variant(
                    *rule, variant, stratum, layers, grown, &mut sink, &mut empty,
                )
                .map_err(stopped)?;
            }
        }
        let stopped = |stop| Stopped {
            stop,
            rule: stratum.rules.last().copied(),
        };
        empty(&mut sink, self.meter).map_err(stopped)?;
        self.meter.derived(found.new_rows()).map_err(stopped)?;
        self.finish(predicate, &found.into_rows(), layers);
        Ok(())
    }

    /// Evaluates a recursive stratum in rounds, each over the tuples found in the previous one.
    fn recursive(&mut self, stratum: &Stratum, layers: &mut Layers<'_>) -> Result<(), Stopped> {
        let mut grown = self.grow(stratum, layers);
        let readers = self.readers(stratum);
        let mut makers = self
            .makers(stratum, layers)
            .map_err(|stop| Stopped { stop, rule: None })?;
        // The predicates that have new tuples, or had some in the last round.
        let mut active: BTreeSet<usize> = (0..grown.len()).collect();
        // Number of new tuples of the round.
        let mut new = 0;
        for rule in &stratum.rules {
            for variant in 0..self.variants(*rule).len() {
                if self.variants(*rule)[variant].delta.is_none() {
                    self.insert_all(*rule, variant, stratum, layers, &mut grown, &mut new)?;
                }
            }
        }
        loop {
            let places: Vec<usize> = active.iter().copied().collect();
            active.retain(|place| grown[*place].changed());
            self.access
                .advance(
                    &places,
                    Own {
                        stratum,
                        grown: &grown,
                    },
                    self.universe,
                    self.meter,
                )
                .map_err(|stop| Stopped {
                    stop,
                    rule: stratum.rules.first().copied(),
                })?;
            if active.is_empty() {
                active.extend(self.turn(&mut makers, stratum, layers, &grown, &mut new)?);
                if active.is_empty() {
                    break;
                }
                continue;
            }
            let mut due: Vec<(usize, usize)> = active
                .iter()
                .flat_map(|place| &readers[*place])
                .copied()
                .collect();
            due.sort_unstable();
            let rule = due
                .first()
                .map(|(rule, _)| *rule)
                .or(stratum.rules.first().copied());
            let stopped = |stop| Stopped { stop, rule };
            self.record_rounds(stratum, &active, &grown)
                .map_err(stopped)?;
            makers
                .add_matches(&active, &grown, &self.meter.watch)
                .map_err(stopped)?;
            self.meter.derived(new).map_err(stopped)?;
            self.meter.check().map_err(stopped)?;
            new = 0;
            for (rule, variant) in due {
                active
                    .extend(self.insert_all(rule, variant, stratum, layers, &mut grown, &mut new)?);
            }
        }
        for (predicate, growing) in stratum.predicates.iter().zip(grown) {
            layers.own.set(*predicate, growing.complete());
        }
        Ok(())
    }

    /// Returns the variants that read the recent tuples of each predicate of a stratum, as rule and
    /// position.
    fn readers(&self, stratum: &Stratum) -> Vec<Vec<(usize, usize)>> {
        let mut readers = vec![Vec::new(); stratum.predicates.len()];
        for rule in &stratum.rules {
            for (position, variant) in self.variants(*rule).iter().enumerate() {
                if let Some(delta) = variant.delta
                    && let Some(atom) = self.planned.rules[*rule].body[delta].atom()
                    && let Ok(place) = stratum.predicates.binary_search(&atom.predicate)
                {
                    readers[place].push((*rule, position));
                }
            }
        }
        readers
    }

    fn variants(&self, rule: usize) -> &'_ [Variant] {
        self.planned.plans[rule]
            .as_ref()
            .map_or(&[], |plan| &plan.variants)
    }

    /// Records the round of the recent tuples, if rounds are requested.
    fn record_rounds(
        &mut self,
        stratum: &Stratum,
        active: &BTreeSet<usize>,
        grown: &Grown,
    ) -> Result<(), Stop> {
        let Some(rounds) = &mut self.rounds else {
            return Ok(());
        };
        rounds.next += 1;
        for place in active {
            let predicate = &stratum.predicates[*place];
            let mut batches = Vec::new();
            grown[*place].batches(Part::Recent, 0, &mut batches);
            let width = self.predicates.get(*predicate).width;
            for row in batches.iter().flat_map(|batch| batch.chunks_exact(width)) {
                rounds.of.insert((*predicate, row.to_vec()), rounds.next);
                self.meter
                    .watch
                    .hold(ROUND_BYTES + bytes_of_row(width, 0))?;
            }
        }
        Ok(())
    }

    /// Creates the growing tuples of the stratum's predicates, with the known tuples inserted.
    fn grow(&self, stratum: &Stratum, layers: &Layers<'_>) -> Grown {
        let mut wanted: Vec<Vec<bool>> = stratum
            .predicates
            .iter()
            .map(|p| vec![false; self.access.indexes.of(*p).len()])
            .collect();
        for rule in &stratum.rules {
            for op in self
                .variants(*rule)
                .iter()
                .flat_map(|v| v.guards.iter().flatten().chain(&v.ops))
            {
                if let Op::Scan(Scan {
                    predicate, index, ..
                }) = op
                    && let Ok(place) = stratum.predicates.binary_search(predicate)
                {
                    wanted[place][*index] = true;
                }
            }
        }
        for scan in stratum
            .rules
            .iter()
            .filter_map(|rule| self.planned.searches[*rule].as_ref())
            .flat_map(Search::steps)
        {
            if let Ok(place) = stratum.predicates.binary_search(&scan.predicate) {
                wanted[place][scan.index] = true;
            }
        }
        let mut grown = Vec::new();
        for (predicate, wanted) in stratum.predicates.iter().zip(&wanted) {
            let growing = growing(
                self.predicates.get(*predicate).width,
                self.access.indexes.of(*predicate).clone(),
                wanted,
            );
            let mut known = layers.rows(*predicate).to_vec();
            if !known.is_empty() {
                growing.insert(&mut known);
            }
            grown.push(growing);
        }
        grown
    }

    /// Adds the tuples that a variant derives. Returns the place of their predicate if some are
    /// new. `new`: number of new tuples in this round.
    fn insert_all(
        &mut self,
        rule: usize,
        variant: usize,
        stratum: &Stratum,
        layers: &Layers<'_>,
        grown: &mut Grown,
        new: &mut usize,
    ) -> Result<Option<usize>, Stopped> {
        let predicate = self.planned.rules[rule].head.predicate;
        let Ok(place) = stratum.predicates.binary_search(&predicate) else {
            return Ok(None);
        };
        let row_bytes = self.row_bytes(predicate);
        let stopped = |stop| Stopped {
            stop,
            rule: Some(rule),
        };
        let before = *new;
        let mut empty = |grown: &Grown, sink: &mut Sink, meter: &Meter| {
            let target = &grown[place];
            let count = target.insert(&mut sink.rows);
            sink.adapt(target.added(), &meter.watch);
            *new += count;
            meter.watch.hold(count * row_bytes)?;
            meter.room_for(*new)
        };
        let mut sink = Sink::new(Vec::new());
        self.variant(rule, variant, stratum, layers, grown, &mut sink, &mut empty)
            .map_err(stopped)?;
        if !sink.rows.is_empty() {
            empty(grown, &mut sink, self.meter).map_err(stopped)?;
        }
        Ok((*new > before).then_some(place))
    }

    /// Adds the head rows that one variant derives to a sink; `empty` empties it when it is full.
    /// If the variant reads more rows than expected, it is planned by samples and begins again;
    /// tuples that it has already added are right in any case.
    #[expect(
        clippy::too_many_arguments,
        reason = "the parts of one evaluation, borrowed separately"
    )]
    fn variant(
        &mut self,
        rule_idx: usize,
        position: usize,
        stratum: &Stratum,
        layers: &Layers<'_>,
        grown: &mut Grown,
        sink: &mut Sink,
        empty: &mut dyn FnMut(&Grown, &mut Sink, &Meter) -> Result<(), Stop>,
    ) -> Result<(), Stop> {
        let planned = self.planned;
        let rule = &planned.rules[rule_idx];
        let Some(planned) = planned.plans[rule_idx]
            .as_ref()
            .map(|plan| &plan.variants[position])
        else {
            return Ok(());
        };
        let adapted = self.adapted.get(&(rule_idx, position));
        let (variant, allowed) = adapted.map_or(
            (planned, allowance(planned, rule, &self.access)),
            |(variant, allowed)| (variant, *allowed),
        );
        // A few rows in each of many rounds are many, too.
        let spent = self.spent.entry((rule_idx, position)).or_default();
        let is_doubtful = adapted.is_none() && planned.may_meet;
        let allowed = if is_doubtful {
            allowed.saturating_sub(*spent)
        } else {
            allowed
        };
        let before = self.access.rows_read;
        let mut context = Context {
            access: &mut self.access,
            universe: self.universe,
            meter: self.meter,
        };
        let own = stratum.recursive.then_some(Own { stratum, grown });
        let mut flush = |sink: &mut Sink, meter: &Meter| empty(grown, sink, meter);
        match attempt(
            &mut context,
            rule,
            variant,
            layers,
            own,
            allowed,
            sink,
            &mut flush,
        ) {
            Ok(()) => {
                *spent += context.access.rows_read - before;
                return Ok(());
            }
            Err(Halt::Stop(stop)) => return Err(stop),
            Err(Halt::Replan) => {}
        }
        let parts = Parts::new(rule, stratum, planned.delta);
        let (variant, allowed) = replanned(&mut context, rule, &parts, layers, own);
        add_indexes(&variant, stratum, &context, grown)?;
        let own = stratum.recursive.then_some(Own { stratum, grown });
        let mut flush = |sink: &mut Sink, meter: &Meter| empty(grown, sink, meter);
        let ended = attempt(
            &mut context,
            rule,
            &variant,
            layers,
            own,
            u64::MAX,
            sink,
            &mut flush,
        );
        self.adapted
            .insert((rule_idx, position), (variant, allowed));
        ended.map_err(|halt| match halt {
            Halt::Stop(stop) => stop,
            Halt::Replan => Stop::Time,
        })
    }
}

/// Adds the indexes that a new plan reads to the growing tuples.
fn add_indexes(
    variant: &Variant,
    stratum: &Stratum,
    context: &Context<'_, '_, '_, '_>,
    grown: &mut Grown,
) -> Result<(), Stop> {
    if !stratum.recursive {
        return Ok(());
    }
    for op in variant.guards.iter().flatten().chain(&variant.ops) {
        if let Op::Scan(Scan {
            predicate, index, ..
        }) = op
            && let Ok(place) = stratum.predicates.binary_search(predicate)
            && !grown[place].has_index(*index)
        {
            let orders = context.access.indexes.of(*predicate);
            let rows = grown[place].add_index(*index, orders);
            context
                .meter
                .watch
                .hold(rows * bytes_of_row(orders[0].len(), 0))?;
        }
    }
    Ok(())
}

/// Returns the fault of a stopped evaluation, with the rule's name and place.
pub(crate) fn fault(meter: &Meter, stopped: Stopped, planned: &Planned) -> RuleFault {
    meter.fault(stopped.stop, stopped.rule.map(|rule| &planned.rules[rule]))
}
