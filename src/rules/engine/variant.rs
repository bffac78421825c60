//! Evaluates one variant of a rule, and plans it anew if it reads more rows than expected.

use std::collections::{BTreeSet, HashMap};

use crate::engine::access::{Access, Own};
use crate::engine::aggregate::{aggregate, projection};
use crate::engine::collect::{Distinct, Sink};
use crate::engine::evaluate::Layers;
use crate::engine::join::{Halt, Join};
use crate::engine::lower::outputs;
use crate::engine::meter::{Meter, Stop};
use crate::engine::plan::{Op, Orders, Part, Parts, Scan, Variant, plan_variant};
use crate::engine::relation::Batch;
use crate::engine::sample::{SAMPLED_ATOMS, Sampler};
use crate::model::program::{Literal, Rule};
use crate::model::universe::Universe;

/// Number of rows that a variant reads before its order is questioned. Fewer are read faster than
/// sampled.
pub(crate) const UNQUESTIONED: u64 = 4_096;
/// How many times the expected number of rows a variant reads before its order is questioned.
const TOLERANCE: f64 = 4.0;

/// The variants that were planned by samples, and the number of rows that each may read before it
/// is planned again.
pub(crate) type Adapted = HashMap<(usize, usize), (Variant, u64)>;

/// The facts, terms and limits with which a rule is evaluated.
pub(crate) struct Context<'s, 'a, 'u, 't> {
    pub(crate) access: &'s mut Access<'a>,
    pub(crate) universe: &'u mut Universe<'t>,
    pub(crate) meter: &'u mut Meter,
}

/// Returns the number of rows that a variant may read before its order is questioned.
pub(crate) fn allowance(variant: &Variant, rule: &Rule, access: &Access<'_>) -> u64 {
    let atoms = rule
        .body
        .iter()
        .filter(|literal| matches!(literal, Literal::Positive(_)))
        .count();
    if variant.has_choice && atoms <= SAMPLED_ATOMS {
        access.unquestioned
    } else {
        u64::MAX
    }
}

/// Plans a variant by samples of the tuples that are there now.
pub(crate) fn replanned(
    context: &mut Context<'_, '_, '_, '_>,
    rule: &Rule,
    parts: &Parts,
    layers: &Layers<'_>,
    own: Option<Own<'_>>,
) -> (Variant, u64) {
    let outputs = outputs(rule);
    let (mut rows_read, mut many) = (0.0, BTreeSet::new());
    let trial = context.meter.watch.trial();
    let orders = Orders::new(rule, parts, &mut |group, first| {
        let mut sampler = Sampler {
            rule,
            parts,
            access: &mut *context.access,
            layers,
            own,
            universe: &*context.universe,
            watch: &trial,
            outputs: &outputs,
        };
        let (atoms, rows, keyed) = sampler.order(group, first);
        rows_read += rows;
        many.extend(keyed);
        atoms
    });
    let variant = plan_variant(
        rule,
        parts,
        &orders,
        context.access.indexes.to_mut(),
        Some(&many),
    );
    (
        variant,
        ((rows_read * TOLERANCE) as u64).max(context.access.unquestioned),
    )
}

/// Adds the head rows that one variant derives to a sink, which `flush` empties when it is full.
#[expect(
    clippy::too_many_arguments,
    reason = "the parts of one evaluation, borrowed separately"
)]
pub(crate) fn attempt(
    context: &mut Context<'_, '_, '_, '_>,
    rule: &Rule,
    variant: &Variant,
    layers: &Layers<'_>,
    own: Option<Own<'_>>,
    mut rows_left: u64,
    sink: &mut Sink,
    flush: Flush<'_>,
) -> Result<(), Halt> {
    let Some(main) = Sources::new(context, &variant.ops, layers, own)? else {
        return Ok(());
    };
    for guard in &variant.guards {
        let Some(sources) = Sources::new(context, guard, layers, own)? else {
            return Ok(());
        };
        let (mut nothing, mut ignore) = (Sink::new(Vec::new()), |_: &mut Sink, _: &Meter| Ok(()));
        if !sources.run(
            context,
            rule,
            guard,
            &mut rows_left,
            &mut nothing,
            &mut ignore,
        )? {
            return Ok(());
        }
    }
    let Some(aggregation) = &rule.aggregation else {
        sink.operands.clone_from(&rule.head.args);
        main.run(context, rule, &variant.ops, &mut rows_left, sink, flush)?;
        return Ok(());
    };
    let operands = projection(aggregation);
    // The groups refer to the rows.
    let mut matches = Distinct::new(operands.len().max(1), Vec::new(), 4);
    let mut collected = Sink::new(operands);
    let mut collect = |sink: &mut Sink, meter: &Meter| matches.add(sink, &meter.watch);
    let joined = main.run(
        context,
        rule,
        &variant.ops,
        &mut rows_left,
        &mut collected,
        &mut collect,
    );
    if let Err(halt) = joined {
        context.meter.watch.release(matches.new_bytes());
        return Err(halt);
    }
    collect(&mut collected, context.meter)?;
    let heads = aggregate(
        rule,
        aggregation,
        matches.rows(),
        context.universe,
        context.meter,
    )?;
    context.meter.watch.release(matches.new_bytes());
    sink.rows.extend(heads);
    if sink.rows.len() >= sink.limit {
        flush(sink, context.meter)?;
    }
    Ok(())
}

/// Empties a full sink.
type Flush<'f> = &'f mut dyn FnMut(&mut Sink, &Meter) -> Result<(), Stop>;

/// The rows that each step reads, and their numbers of columns.
struct Sources<'b> {
    batches: Vec<Vec<Batch<'b>>>,
    widths: Vec<usize>,
}

impl<'b> Sources<'b> {
    /// Returns `None` if an atom has no rows.
    fn new(
        context: &mut Context<'_, '_, '_, '_>,
        ops: &[Op],
        layers: &'b Layers<'_>,
        own: Option<Own<'b>>,
    ) -> Result<Option<Self>, Stop> {
        let access = &mut *context.access;
        let mut sources = Self {
            batches: Vec::with_capacity(ops.len()),
            widths: Vec::with_capacity(ops.len()),
        };
        for op in ops {
            let (predicate, part, index) = match op {
                Op::Scan(Scan {
                    keyed: Some(keyed),
                    part,
                    ..
                }) => {
                    let found =
                        access.keyed(keyed, *part, layers, own, context.universe, context.meter)?;
                    if found.iter().all(|batch| batch.is_empty()) {
                        return Ok(None);
                    }
                    sources.batches.push(found);
                    sources.widths.push(keyed.width());
                    continue;
                }
                Op::Scan(Scan {
                    predicate,
                    part,
                    index,
                    ..
                }) => (*predicate, *part, *index),
                Op::Absent {
                    predicate, index, ..
                } => (*predicate, Part::All, *index),
                _ => {
                    sources.batches.push(Vec::new());
                    sources.widths.push(1);
                    continue;
                }
            };
            let found = access.batches(predicate, part, index, layers, own);
            if matches!(op, Op::Scan(_)) && found.iter().all(|batch| batch.is_empty()) {
                return Ok(None);
            }
            sources.batches.push(found);
            sources.widths.push(access.predicates.get(predicate).width);
        }
        context
            .meter
            .watch
            .hold(std::mem::take(&mut access.unaccounted))?;
        Ok(Some(sources))
    }

    /// Runs a join. Returns whether any binding satisfies its steps.
    fn run(
        &self,
        context: &mut Context<'_, '_, '_, '_>,
        rule: &Rule,
        ops: &[Op],
        rows_left: &mut u64,
        sink: &mut Sink,
        flush: Flush<'_>,
    ) -> Result<bool, Halt> {
        let before = *rows_left;
        let mut join = Join {
            ops,
            batches: &self.batches,
            widths: &self.widths,
            // With a slot for the known value of each equality.
            binding: vec![0; rule.variables.len() + rule.body.len()],
            universe: &mut *context.universe,
            meter: &mut *context.meter,
            sink,
            rows_left: before,
            flush,
        };
        let found = join.run(0);
        *rows_left = join.rows_left;
        context.access.rows_read += before - *rows_left;
        found
    }
}
