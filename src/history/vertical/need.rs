//! The values and rows of a pattern that the rest of a query needs.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use oxigraph::model::Variable;
use spargebra::algebra::{Expression, GraphPattern, OrderExpression};

use crate::vertical::leaf::Limit;
use crate::vertical::reduce::Kind;
use crate::vertical::walk::used;

/// How often equal rows are needed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Mode {
    /// As often as they occur.
    #[default]
    Bag,
    /// Once, with their number.
    Counted,
    /// Once.
    Set,
}

/// An aggregate that a pattern may compute for its own rows.
#[derive(Debug, Clone)]
pub(super) struct Asked {
    pub id: usize,
    pub kind: Kind,
    pub expression: Expression,
}

/// The need of a pattern.
#[derive(Debug, Clone, Default)]
pub(super) struct Need {
    /// Variables whose values are needed.
    pub exact: BTreeSet<Variable>,
    pub mode: Mode,
    pub asked: Vec<Asked>,
    /// The values that variables may have.
    pub known: Vec<(Variable, Arc<Limit>)>,
    /// The order and the number of the first rows, if no others are needed.
    pub first: Option<(Vec<OrderExpression>, usize)>,
    /// The number of rows, if any of them will do.
    pub any: Option<usize>,
}

impl Need {
    pub(super) fn of(exact: BTreeSet<Variable>, mode: Mode) -> Self {
        Self {
            exact,
            mode,
            ..Self::default()
        }
    }

    /// Also these variables. All rows are needed then.
    pub(super) fn and(&self, variables: impl IntoIterator<Item = Variable>) -> Self {
        let mut need = self.clone();
        need.exact.extend(variables);
        (need.first, need.any) = (None, None);
        need
    }

    /// Keeps only the aggregates for which `may` is true; the values of the others are needed
    /// instead.
    pub(super) fn asking(mut self, may: impl Fn(&Asked) -> bool) -> Self {
        let (kept, dropped): (Vec<Asked>, Vec<Asked>) = self.asked.into_iter().partition(may);
        self.asked = kept;
        self.exact
            .extend(dropped.iter().flat_map(|asked| used(&asked.expression)));
        self
    }
}

/// A pattern in which tables replace the statements of outlines.
#[derive(Debug, Clone)]
pub(super) struct Rewritten {
    pub pattern: GraphPattern,
    /// Variables with the numbers of equal rows; if unbound, 1.
    pub counts: Vec<Variable>,
    /// Aggregates that are computed.
    pub taken: BTreeMap<usize, Taken>,
    /// Variables of which no two rows have the same values, if they are known.
    pub distinct: Option<Vec<Variable>>,
}

/// An aggregate of the rows of one table.
#[derive(Debug, Clone)]
pub(super) struct Taken {
    pub result: Variable,
    /// The number of equal rows of its own table.
    pub own: Option<Variable>,
}

impl Rewritten {
    pub(super) fn plain(pattern: GraphPattern) -> Self {
        Self {
            pattern,
            counts: Vec::new(),
            taken: BTreeMap::new(),
            distinct: None,
        }
    }

    /// The variables that were added.
    pub(super) fn added(&self) -> impl Iterator<Item = Variable> {
        self.counts
            .iter()
            .cloned()
            .chain(self.taken.values().map(|taken| taken.result.clone()))
    }

    /// The same with another pattern.
    pub(super) fn map(self, make: impl FnOnce(Box<GraphPattern>) -> GraphPattern) -> Self {
        Self {
            pattern: make(Box::new(self.pattern)),
            ..self
        }
    }

    /// Both in one pattern.
    pub(super) fn with(
        mut self,
        other: Self,
        make: impl FnOnce(Box<GraphPattern>, Box<GraphPattern>) -> GraphPattern,
    ) -> Self {
        self.counts.extend(other.counts);
        self.taken.extend(other.taken);
        Self {
            pattern: make(Box::new(self.pattern), Box::new(other.pattern)),
            distinct: None,
            ..self
        }
    }
}
