//! Rewrites a query so that the evaluator needs no statements of outlines: patterns that match in
//! outlines become tables.

use std::collections::BTreeSet;
use std::sync::Arc;

use oxigraph::model::{NamedOrBlankNodeRef, Term, Variable};
use oxigraph::sparql::SparqlEvaluator;
use spargebra::Query;
use spargebra::algebra::{Expression, GraphPattern, OrderExpression};
use spargebra::term::{NamedNodePattern, TermPattern};

use crate::Cancel;
use crate::graphs::holds_facts;
use crate::open::OpenStore;
use crate::vertical::counts::Counts;
use crate::vertical::leaf::{components, is_of_campaigns};
use crate::vertical::need::{Mode, Need, Rewritten};
use crate::vertical::scan::Files;
use crate::vertical::stop::{Stop, unfit};
use crate::vertical::walk::{bound, used, walk, walk_expression};

/// The variable of an ascending order.
fn ascending(key: &OrderExpression) -> Option<Variable> {
    match key {
        OrderExpression::Asc(Expression::Variable(variable)) => Some(variable.clone()),
        _ => None,
    }
}

/// Makes the evaluator of parts of a query.
pub(crate) type MakeEvaluator<'a> = dyn Fn(Option<Arc<Counts>>) -> SparqlEvaluator + 'a;

/// Rewrites a query.
pub(super) struct Rewriter<'a> {
    pub store: &'a OpenStore,
    pub files: &'a Files,
    pub counts: Option<Arc<Counts>>,
    pub evaluator: &'a MakeEvaluator<'a>,
    pub cancel: &'a Cancel,
    /// The beginning of names of new variables, which the query does not have.
    pub prefix: String,
    /// The variables by which the answer is sorted.
    pub order: Vec<Variable>,
    /// Number of new variables so far.
    pub new: usize,
}

impl Rewriter<'_> {
    /// The same query without statements of outlines.
    pub(super) fn query(&mut self, query: Query) -> Result<Query, Stop> {
        Ok(match query {
            Query::Select {
                dataset: None,
                pattern,
                base_iri,
            } => {
                let need = Need::of(bound(&pattern), Mode::Bag);
                Query::Select {
                    dataset: None,
                    pattern: self.rewrite(pattern, &need)?.pattern,
                    base_iri,
                }
            }
            Query::Ask {
                dataset: None,
                pattern,
                base_iri,
            } => {
                let need = Need {
                    any: Some(1),
                    ..Need::of(BTreeSet::new(), Mode::Bag)
                };
                Query::Ask {
                    dataset: None,
                    pattern: self.rewrite(pattern, &need)?.pattern,
                    base_iri,
                }
            }
            Query::Construct {
                dataset: None,
                pattern,
                template,
                base_iri,
            } => {
                let is_blank = |term: &TermPattern| matches!(term, TermPattern::BlankNode(_));
                let has_blank = template
                    .iter()
                    .any(|triple| is_blank(&triple.subject) || is_blank(&triple.object));
                let mode = if has_blank { Mode::Bag } else { Mode::Set };
                let need = Need::of(bound(&pattern), mode);
                let pattern = self.rewrite(pattern, &need)?.pattern;
                Query::Construct {
                    dataset: None,
                    pattern,
                    template,
                    base_iri,
                }
            }
            Query::Describe { .. } => return unfit("`DESCRIBE`"),
            _ => return unfit("`FROM`"),
        })
    }

    pub(super) fn fresh(&mut self) -> Variable {
        self.new += 1;
        Variable::new_unchecked(format!("{}{}", self.prefix, self.new))
    }

    /// A pattern that needs no statements of outlines.
    pub(super) fn rewrite(
        &mut self,
        pattern: GraphPattern,
        need: &Need,
    ) -> Result<Rewritten, Stop> {
        use GraphPattern as G;
        match pattern {
            G::Bgp { .. } | G::Join { .. } | G::Filter { .. } | G::LeftJoin { .. } => {
                self.joined(pattern, need)
            }
            G::Values { .. } => Ok(Rewritten::plain(pattern)),
            G::Group {
                inner,
                variables,
                aggregates,
            } => self.group(*inner, variables, aggregates),
            G::Project { inner, variables } => self.project(*inner, variables, need),
            G::Distinct { inner } | G::Reduced { inner } => {
                let need = Need {
                    known: need.known.clone(),
                    ..Need::of(bound(&inner), Mode::Set)
                };
                let inner = self.rewrite(*inner, &need)?;
                Ok(Rewritten::plain(G::Distinct {
                    inner: Box::new(inner.pattern),
                }))
            }
            G::Slice {
                inner,
                start,
                length,
            } => {
                let need = need.clone().asking(|_| false);
                let any = length.map(|length| start.saturating_add(length));
                let need = Need {
                    any,
                    ..Need::of(need.exact, Mode::Bag)
                };
                let inner = self.rewrite(*inner, &need)?;
                Ok(Rewritten::plain(G::Slice {
                    inner: Box::new(inner.pattern),
                    start,
                    length,
                }))
            }
            G::OrderBy { inner, expression } => {
                let keys = expression
                    .iter()
                    .map(|(OrderExpression::Asc(key) | OrderExpression::Desc(key))| key);
                let mut inner_need = need.and(keys.flat_map(used));
                inner_need.first = need.any.map(|any| (expression.clone(), any));
                self.order = expression.iter().map_while(ascending).collect();
                Ok(self
                    .rewrite(*inner, &inner_need)?
                    .map(|inner| G::OrderBy { inner, expression }))
            }
            G::Extend {
                inner,
                variable,
                expression,
            } => {
                let is_before =
                    |asked: &super::need::Asked| !used(&asked.expression).contains(&variable);
                let mut inner_need = need.and(used(&expression)).asking(is_before);
                inner_need.exact.remove(&variable);
                inner_need.known.retain(|(known, _)| *known != variable);
                inner_need.any = need.any;
                Ok(self.rewrite(*inner, &inner_need)?.map(|inner| G::Extend {
                    inner,
                    variable,
                    expression,
                }))
            }
            G::Union { left, right } => {
                let need = need.and([]).asking(|_| false);
                let left = self.rewrite(*left, &need)?;
                let right = self.rewrite(*right, &need)?;
                Ok(left.with(right, |left, right| G::Union { left, right }))
            }
            G::Minus { left, right } => {
                let shared: BTreeSet<Variable> =
                    bound(&left).intersection(&bound(&right)).cloned().collect();
                let left = self.rewrite(*left, &need.and(shared.iter().cloned()))?;
                let right = self.rewrite(*right, &Need::of(shared, Mode::Set))?;
                let right = right.pattern;
                Ok(left.map(|left| G::Minus {
                    left,
                    right: Box::new(right),
                }))
            }
            G::Graph { name, inner } => match &name {
                NamedNodePattern::NamedNode(node)
                    if !holds_facts(NamedOrBlankNodeRef::from(node.as_ref()).into()) =>
                {
                    Ok(Rewritten::plain(G::Graph { name, inner }))
                }
                _ => unfit(format!("facts (`GRAPH {name}`)")),
            },
            G::Path {
                subject,
                path,
                object,
            } => unfit(format!("the path `{subject} {path} {object}`")),
            G::Service { .. } => unfit("`SERVICE`"),
            _ => unfit("a rare kind of pattern"),
        }
    }

    fn project(
        &mut self,
        inner: GraphPattern,
        variables: Vec<Variable>,
        need: &Need,
    ) -> Result<Rewritten, Stop> {
        let is_visible = |variable: &Variable| variables.contains(variable);
        let mut inner_need = need
            .clone()
            .asking(|asked| used(&asked.expression).iter().all(is_visible));
        inner_need.exact.retain(is_visible);
        inner_need
            .known
            .retain(|(variable, _)| is_visible(variable));
        let inner = self.rewrite(inner, &inner_need)?;
        let variables = variables.into_iter().chain(inner.added()).collect();
        Ok(inner.map(|inner| GraphPattern::Project { inner, variables }))
    }

    /// Whether no outline has statements that match all patterns of a component.
    pub(super) fn is_stored(&self, triples: &[spargebra::term::TriplePattern]) -> bool {
        triples.iter().any(|triple| match &triple.predicate {
            NamedNodePattern::NamedNode(property) => {
                self.files.statements(property.as_str()) == 0 || is_of_campaigns(triple)
            }
            NamedNodePattern::Variable(_) => false,
        })
    }

    /// Refuses conditions with patterns that may match in outlines.
    pub(super) fn check_condition(
        &self,
        condition: &spargebra::algebra::Expression,
    ) -> Result<(), Stop> {
        let mut fault = None;
        let mut check = |pattern: &GraphPattern| {
            match pattern {
                GraphPattern::Bgp { patterns } => {
                    for members in components(patterns) {
                        let triples: Vec<_> =
                            members.iter().map(|at| patterns[*at].clone()).collect();
                        if !self.is_stored(&triples) {
                            fault = Some(format!("`EXISTS {{ {} }}`", triples[0]));
                        }
                    }
                }
                GraphPattern::Graph {
                    name: NamedNodePattern::NamedNode(node),
                    ..
                } => {
                    if !holds_facts(NamedOrBlankNodeRef::from(node.as_ref()).into()) {
                        return false;
                    }
                    fault = Some("facts in `EXISTS`".to_owned());
                }
                GraphPattern::Graph { .. } => fault = Some("facts in `EXISTS`".to_owned()),
                GraphPattern::Path { .. } => fault = Some("a path in `EXISTS`".to_owned()),
                _ => {}
            }
            true
        };
        walk_expression(condition, &mut check, &mut |_| {});
        fault.map_or(Ok(()), unfit)
    }

    /// The rows of a pattern that needs no statements of outlines.
    pub(super) fn select(
        &self,
        pattern: GraphPattern,
        variables: &[Variable],
    ) -> Result<Vec<Vec<Option<Term>>>, Stop> {
        use crate::evaluation::{Unfinished, evaluate};
        use oxigraph::sparql::QueryResults;
        let pattern = GraphPattern::Project {
            inner: Box::new(pattern),
            variables: variables.to_vec(),
        };
        let mut query = Query::Select {
            dataset: None,
            pattern,
            base_iri: None,
        };
        if self
            .store
            .size()
            .is_some_and(|size| crate::query::COLUMNS.contains(&size))
        {
            query = crate::columns::by_columns(query);
        }
        let prepared = (self.evaluator)(self.counts.clone()).for_query(query);
        let rows = evaluate(self.store, self.cancel, move |store| {
            let mut rows = Vec::new();
            if let QueryResults::Solutions(solutions) = prepared.on_store(store).execute()? {
                for solution in solutions {
                    rows.push(solution?.values().to_vec());
                }
            }
            Ok(rows)
        });
        rows.map_err(|fault| match fault {
            Unfinished::Stopped => Stop::Cancelled,
            Unfinished::Failed(error) => Stop::Failed(error),
            Unfinished::Crashed => Stop::Crashed,
            Unfinished::Damaged(error) => Stop::Store(error),
        })
    }
}

/// Whether a query uses `act:counts`.
pub(super) fn uses_counts(query: &Query) -> bool {
    use spargebra::algebra::{Expression, Function};
    let (Query::Select { pattern, .. }
    | Query::Ask { pattern, .. }
    | Query::Construct { pattern, .. }) = query
    else {
        return false;
    };
    let mut found = false;
    walk(pattern, &mut |_| true, &mut |expression| {
        if let Expression::FunctionCall(Function::Custom(function), _) = expression {
            found |= function.as_str() == actcheck_base::names::act("counts");
        }
    });
    found
}
