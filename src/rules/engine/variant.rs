//! Evaluates one variant of a rule, and plans it anew if it reads more rows than expected.

use std::collections::HashMap;

use crate::engine::access::{Access, Own};
use crate::engine::aggregate::{aggregate, projection};
use crate::engine::evaluate::Layers;
use crate::engine::join::{Halt, Join, Sink};
use crate::engine::lower::outputs;
use crate::engine::meter::{Meter, Stop};
use crate::engine::plan::{Op, Orders, Part, Parts, Scan, Variant, plan_variant};
use crate::engine::relation::Batch;
use crate::engine::sample::{SAMPLED_ATOMS, Sampler};
use crate::model::program::{Literal, Rule};
use crate::model::universe::Universe;
use actcheck_base::TermId;

/// Number of rows that a variant reads before its order is questioned. Fewer are read faster than sampled.
pub(crate) const UNQUESTIONED: u64 = 4_096;
/// How many times the expected number of rows a variant reads before its order is questioned.
const TOLERANCE: f64 = 4.0;
/// Maximum size of the matches kept at once for an aggregating rule. Unit: terms of 4 bytes (1 GiB).
const AGGREGATE_LIMIT: usize = 1 << 28;

/// The variants that were planned by samples, and the number of rows that each may read before it is planned again.
pub(crate) type Adapted = HashMap<(usize, usize), (Variant, u64)>;

/// What the evaluation of a rule reads and writes.
pub(crate) struct Context<'s, 'a, 'u, 't> {
    pub(crate) access: &'s mut Access<'a>,
    pub(crate) universe: &'u mut Universe<'t>,
    pub(crate) meter: &'u mut Meter,
}

/// Returns the number of rows that a variant may read before its order is questioned.
pub(crate) fn allowance(variant: &Variant, rule: &Rule, access: &Access<'_>) -> u64 {
    let atoms = rule.body.iter().filter(|literal| matches!(literal, Literal::Positive(_))).count();
    if variant.has_choice && atoms <= SAMPLED_ATOMS { access.unquestioned } else { u64::MAX }
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
    let mut rows_read = 0.0;
    let orders = Orders::new(rule, parts, &mut |group, first| {
        let mut sampler = Sampler {
            rule,
            parts,
            access: &mut *context.access,
            layers,
            own,
            universe: &*context.universe,
            outputs: &outputs,
        };
        let (atoms, rows) = sampler.order(group, first);
        rows_read += rows;
        atoms
    });
    let variant = plan_variant(rule, parts, &orders, context.access.indexes.to_mut(), true);
    (variant, ((rows_read * TOLERANCE) as u64).max(context.access.unquestioned))
}

/// Returns the head rows that one variant derives.
pub(crate) fn attempt(
    context: &mut Context<'_, '_, '_, '_>,
    rule: &Rule,
    variant: &Variant,
    layers: &Layers<'_>,
    own: Option<Own<'_>>,
    mut rows_left: u64,
    flush: &mut dyn FnMut(&mut Sink, usize) -> Result<(), Stop>,
) -> Result<Vec<TermId>, Halt> {
    let Some(main) = Sources::new(context.access, &variant.ops, layers, own) else { return Ok(Vec::new()) };
    for guard in &variant.guards {
        let Some(sources) = Sources::new(context.access, guard, layers, own) else { return Ok(Vec::new()) };
        let (mut sink, mut ignore) = (Sink::default(), |_: &mut Sink| Ok(()));
        if !sources.run(context, rule, guard, &mut rows_left, &mut sink, &mut ignore)? {
            return Ok(Vec::new());
        }
    }
    let operands = match &rule.aggregation {
        Some(aggregation) => projection(aggregation),
        None => rule.head.args.clone(),
    };
    let mut sink = Sink { operands, rows: Vec::new() };
    let left = context.meter.tuples_left();
    let aggregating = rule.aggregation.is_some();
    let mut flush = |sink: &mut Sink| match aggregating {
        true if sink.rows.len() > AGGREGATE_LIMIT => Err(Stop::Tuples),
        true => Ok(()),
        false => flush(sink, left),
    };
    main.run(context, rule, &variant.ops, &mut rows_left, &mut sink, &mut flush)?;
    Ok(match &rule.aggregation {
        Some(aggregation) => aggregate(rule, aggregation, &sink.rows, context.universe, context.meter)?,
        None => sink.rows,
    })
}

/// The rows that each step reads, and their numbers of columns.
struct Sources<'b> {
    batches: Vec<Vec<Batch<'b>>>,
    widths: Vec<usize>,
}

impl<'b> Sources<'b> {
    /// Returns `None` if an atom has no rows.
    fn new(access: &mut Access<'_>, ops: &[Op], layers: &'b Layers<'_>, own: Option<Own<'b>>) -> Option<Self> {
        let mut sources = Self { batches: Vec::with_capacity(ops.len()), widths: Vec::with_capacity(ops.len()) };
        for op in ops {
            let (predicate, part, index) = match op {
                Op::Scan(Scan { predicate, part, index, .. }) => (*predicate, *part, *index),
                Op::Absent { predicate, index, .. } => (*predicate, Part::All, *index),
                _ => {
                    sources.batches.push(Vec::new());
                    sources.widths.push(1);
                    continue;
                }
            };
            let found = access.batches(predicate, part, index, layers, own);
            if matches!(op, Op::Scan(_)) && found.iter().all(|batch| batch.is_empty()) {
                return None;
            }
            sources.batches.push(found);
            sources.widths.push(access.predicates.get(predicate).width);
        }
        Some(sources)
    }

    /// Runs a join. Returns whether any binding satisfies its steps.
    fn run(
        &self,
        context: &mut Context<'_, '_, '_, '_>,
        rule: &Rule,
        ops: &[Op],
        rows_left: &mut u64,
        sink: &mut Sink,
        flush: &mut dyn FnMut(&mut Sink) -> Result<(), Stop>,
    ) -> Result<bool, Halt> {
        let before = *rows_left;
        let mut join = Join {
            ops,
            batches: &self.batches,
            widths: &self.widths,
            binding: vec![0; rule.variables.len()],
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
