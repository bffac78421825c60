//! Equalities as joins.
//!
//! In `r(?i), ?j = ?i + 1, s(?j)`, the value of `?j` is known before `s` is read, so that only its
//! rows are looked up. In `r(?a), s(?b), ?a + 1 = ROUND(?b)`, the rows of `s` are sorted by the
//! value of `ROUND(?b)`, and looked up by that of `?a + 1`. Two values are equal if they are the
//! same term, and the same term has one id: a look-up finds exactly the rows for which the equality
//! holds.

use std::sync::Arc;

use crate::builtins;
use crate::engine::lower::operand_variables;
use crate::engine::meter::{Meter, Stop};
use crate::engine::plan::{Column, Part};
use crate::engine::relation::{Batch, merge_rows, sort_rows};
use crate::model::expression::{Expr, Variable};
use crate::model::program::{Atom, Literal, Operand, PredicateId, Rule};
use crate::model::universe::Universe;
use crate::syntax::Comparison;
use actcheck_base::TermId;

/// Returns the two sides of a condition that holds exactly if both have the same value. Formulas
/// over time are left where they are, because their values may be missing.
fn sides(literal: &Literal) -> Option<(Expr, Expr)> {
    let (left, right) = match literal {
        Literal::Compare {
            op: Comparison::Equal,
            left,
            right,
            ..
        } => (left.clone(), right.clone()),
        Literal::Assign {
            variable, value, ..
        } => (Expr::Variable(*variable), value.clone()),
        Literal::Test {
            value: Expr::Call(function, args),
            ..
        } => match args.as_slice() {
            [left, right] if builtins::is_equality(function) => (left.clone(), right.clone()),
            _ => return None,
        },
        _ => return None,
    };
    (!left.is_timed() && !right.is_timed()).then_some((left, right))
}

fn all_bound(expr: &Expr, bound: &[bool]) -> bool {
    variables(expr).iter().all(|variable| bound[*variable])
}

fn variables(expr: &Expr) -> Vec<Variable> {
    let mut found = Vec::new();
    expr.variables(&mut found);
    found
}

/// Returns the unbound variable that an equality gives a value, and the value.
pub(crate) fn given(literal: &Literal, bound: &[bool]) -> Option<(Variable, Expr)> {
    let (left, right) = sides(literal)?;
    [(&left, &right), (&right, &left)]
        .into_iter()
        .find_map(|(target, value)| match target {
            Expr::Variable(variable) if !bound[*variable] && all_bound(value, bound) => {
                Some((*variable, value.clone()))
            }
            _ => None,
        })
}

/// Marks the variables to which equalities of a group give values.
pub(crate) fn settle(rule: &Rule, group: &[usize], bound: &mut [bool]) {
    while let Some((variable, _)) = group.iter().find_map(|idx| given(&rule.body[*idx], bound)) {
        bound[variable] = true;
    }
}

/// Returns whether an assignment gives a variable its value: no atom has it.
pub(crate) fn is_assigned(rule: &Rule, variable: Variable) -> bool {
    rule.body
        .iter()
        .any(|literal| matches!(literal, Literal::Assign { variable: assigned, .. } if *assigned == variable))
}

/// An equality of a value that is known before an atom is read, and one computed from the atom's
/// columns.
#[derive(Debug, Clone)]
pub(crate) struct Meeting {
    /// Position of the equality in the body.
    pub(crate) idx: usize,
    pub(crate) known: Expr,
    computed: Expr,
}

/// Finds an equality by which the rows of an atom can be looked up.
pub(crate) fn meeting(
    rule: &Rule,
    conditions: impl IntoIterator<Item = usize>,
    atom: &Atom,
    bound: &[bool],
) -> Option<Meeting> {
    let own = operand_variables(&atom.args);
    conditions.into_iter().find_map(|idx| {
        let (left, right) = sides(&rule.body[idx])?;
        [(&left, &right), (&right, &left)]
            .into_iter()
            .find_map(|(known, computed)| {
                let read = variables(computed);
                let is_computed = read.iter().all(|variable| own.contains(variable))
                    && !all_bound(computed, bound);
                let found = is_computed && all_bound(known, bound);
                found.then(|| Meeting {
                    idx,
                    known: known.clone(),
                    computed: computed.clone(),
                })
            })
    })
}

/// The content of a column of sorted rows.
#[derive(Debug, Clone, Copy)]
enum Source {
    Column(usize),
    Value,
}

/// Rows of a predicate that are sorted by a value computed from their columns.
#[derive(Debug)]
pub(crate) struct Keyed {
    predicate: PredicateId,
    /// Columns that must have these values; they are left out of the sorted rows.
    constants: Vec<(usize, TermId)>,
    columns: Vec<Source>,
    /// The variables are columns of the predicate.
    value: Expr,
    /// The value as text, by which equal ones are recognised.
    name: String,
}

impl Keyed {
    /// Returns the sorted rows for an atom; their key; and how the columns after it are matched, by
    /// their offsets. `slot`: the variable that has the known value.
    pub(crate) fn new(
        atom: &Atom,
        meeting: &Meeting,
        slot: Variable,
        bound: &mut [bool],
    ) -> (Self, Vec<Operand>, Vec<(usize, Column)>) {
        let (mut constants, mut columns, mut key, mut open) =
            (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (column, arg) in atom.args.iter().enumerate() {
            match arg {
                Operand::Constant(id) => constants.push((column, *id)),
                Operand::Variable(variable) if bound[*variable] => {
                    columns.push(Source::Column(column));
                    key.push(*arg);
                }
                _ => open.push(column),
            }
        }
        columns.push(Source::Value);
        key.push(Operand::Variable(slot));
        let mut matched = Vec::new();
        for column in open {
            if let Operand::Variable(variable) = atom.args[column] {
                let how = if bound[variable] {
                    Column::Same(variable)
                } else {
                    Column::Bind(variable)
                };
                bound[variable] = true;
                matched.push((columns.len(), how));
            }
            columns.push(Source::Column(column));
        }
        let place = |variable: Variable| {
            atom.args
                .iter()
                .position(|arg| *arg == Operand::Variable(variable))
                .unwrap_or_default()
        };
        let value = meeting.computed.renamed(&place);
        let name = format!("{value:?} {constants:?} {columns:?}");
        (
            Self {
                predicate: atom.predicate,
                constants,
                columns,
                value,
                name,
            },
            key,
            matched,
        )
    }

    /// Returns the number of columns of the sorted rows.
    pub(crate) fn width(&self) -> usize {
        self.columns.len()
    }

    /// Returns the name under which the sorted rows are kept.
    pub(crate) fn id(&self) -> (PredicateId, &str) {
        (self.predicate, &self.name)
    }

    /// Returns the sorted rows of some batches, whose columns are in the order as written.
    fn sorted(
        &self,
        batches: &[Batch<'_>],
        width: usize,
        universe: &mut Universe<'_>,
        meter: &mut Meter,
    ) -> Result<Vec<TermId>, Stop> {
        let mut sorted = Vec::new();
        for row in batches.iter().flat_map(|rows| rows.chunks_exact(width)) {
            meter.step()?;
            if self
                .constants
                .iter()
                .any(|(column, id)| row[*column] != *id)
            {
                continue;
            }
            let watch = &meter.watch;
            watch.begin();
            let Some(value) = self
                .value
                .value(row, universe, watch)
                .map(std::borrow::Cow::into_owned)
            else {
                watch.stopped()?;
                continue;
            };
            let value = universe.create(value, watch)?;
            sorted.extend(self.columns.iter().map(|source| match source {
                Source::Column(column) => row[*column],
                Source::Value => value,
            }));
            watch.room(size_of_val(sorted.as_slice()))?;
        }
        sort_rows(self.width(), &mut sorted);
        meter.watch.hold(size_of_val(sorted.as_slice()))?;
        Ok(sorted)
    }
}

/// Sorted rows during one evaluation. Those of growing tuples are kept in runs of decreasing
/// length.
#[derive(Debug)]
pub(crate) struct KeyedRows {
    keyed: Arc<Keyed>,
    old: Vec<Arc<[TermId]>>,
    recent: Arc<[TermId]>,
}

impl KeyedRows {
    /// `width`: number of columns of the predicate.
    pub(crate) fn new(
        keyed: &Arc<Keyed>,
        (old, recent): (&[Batch<'_>], &[Batch<'_>]),
        width: usize,
        universe: &mut Universe<'_>,
        meter: &mut Meter,
    ) -> Result<Self, Stop> {
        let old = keyed.sorted(old, width, universe, meter)?;
        let recent = keyed.sorted(recent, width, universe, meter)?;
        Ok(Self {
            keyed: Arc::clone(keyed),
            old: vec![old.into()],
            recent: recent.into(),
        })
    }

    /// Begins a round: the recent rows become old, and others are recent.
    pub(crate) fn advance(
        &mut self,
        recent: &[Batch<'_>],
        width: usize,
        universe: &mut Universe<'_>,
        meter: &mut Meter,
    ) -> Result<(), Stop> {
        let recent = self.keyed.sorted(recent, width, universe, meter)?;
        let mut last = std::mem::replace(&mut self.recent, recent.into());
        while let Some(run) = self.old.pop_if(|run| run.len() <= 2 * last.len()) {
            let mut rows = run.to_vec();
            merge_rows(self.keyed.width(), &mut rows, &last);
            last = rows.into();
        }
        self.old.push(last);
        Ok(())
    }

    /// Appends the rows of a part.
    pub(crate) fn batches(&self, part: Part, found: &mut Vec<Batch<'_>>) {
        if part != Part::Recent {
            found.extend(self.old.iter().map(|run| Batch::Shared(Arc::clone(run))));
        }
        if part != Part::Old {
            found.push(Batch::Shared(Arc::clone(&self.recent)));
        }
    }
}
