//! Joins: which patterns become tables, and in which order, so that the values of small ones limit
//! large ones.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::sync::Arc;

use oxigraph::model::{Term, Variable};
use spargebra::algebra::{
    AggregateExpression, AggregateFunction, Expression, GraphPattern, OrderExpression,
};
use spargebra::term::{GroundTerm, NamedNodePattern, TermPattern, TriplePattern};

use crate::vertical::column::Value;
use crate::vertical::expression::Native;
use crate::vertical::flat::{Flat, filtered};
use crate::vertical::leaf::{Leaf, Limit, Optional, components, variable, variables};
use crate::vertical::need::{Asked, Mode, Need, Rewritten, Taken};
use crate::vertical::reduce::{Kind, Output};
use crate::vertical::rewrite::Rewriter;
use crate::vertical::stop::{Stop, unfit};
use crate::vertical::value::canonical;
use crate::vertical::walk::{bound, used};

/// Largest number of rows whose values limit other patterns.
const MOST_KNOWN: usize = 300_000;

/// Patterns about one run, before they are a leaf.
#[derive(Debug, Clone, Default)]
struct Component {
    triples: Vec<TriplePattern>,
    conditions: Vec<Expression>,
    optionals: Vec<(Vec<TriplePattern>, Vec<Expression>)>,
    late: Vec<Expression>,
}

impl Component {
    fn variables(&self) -> BTreeSet<Variable> {
        let optional = self.optionals.iter().flat_map(|(triples, _)| triples);
        variables(self.triples.iter().chain(optional))
    }

    /// The places of its variables, and its steps.
    fn leaf(&self) -> Result<Leaf, Stop> {
        let mut leaf = Leaf::default();
        for triple in &self.triples {
            let step = leaf.step(triple)?;
            leaf.steps.push(step);
        }
        for (triples, conditions) in &self.optionals {
            let steps = triples
                .iter()
                .map(|triple| leaf.step(triple))
                .collect::<Result<_, Stop>>()?;
            let conditions = natives(conditions, &leaf)?;
            leaf.optionals.push(Optional { steps, conditions });
        }
        (leaf.conditions, leaf.late) = (
            natives(&self.conditions, &leaf)?,
            natives(&self.late, &leaf)?,
        );
        Ok(leaf)
    }

    /// The same as a pattern for the store. Blank nodes are variables, so that their values can be
    /// named.
    fn pattern(&self) -> GraphPattern {
        let named =
            |term: &TermPattern| variable(term).map_or_else(|| term.clone(), TermPattern::Variable);
        let all = |triples: &[TriplePattern]| GraphPattern::Bgp {
            patterns: triples
                .iter()
                .map(|triple| TriplePattern {
                    subject: named(&triple.subject),
                    object: named(&triple.object),
                    ..triple.clone()
                })
                .collect(),
        };
        let mut pattern = filtered(all(&self.triples), self.conditions.clone());
        for (triples, conditions) in &self.optionals {
            let expression = conditions
                .iter()
                .cloned()
                .reduce(|one, other| Expression::And(Box::new(one), Box::new(other)));
            pattern = GraphPattern::LeftJoin {
                left: Box::new(pattern),
                right: Box::new(all(triples)),
                expression,
            };
        }
        filtered(pattern, self.late.clone())
    }

    /// Whether an optional part only adds values of the same run: it becomes part of the leaf.
    fn takes(
        &self,
        pattern: &GraphPattern,
        condition: Option<&Expression>,
        others: &BTreeSet<Variable>,
    ) -> bool {
        let flat = Flat::of(pattern.clone());
        if !(flat.optionals.is_empty() && flat.others.is_empty() && flat.late.is_empty()) {
            return false;
        }
        let own = self.variables();
        let all: Vec<TriplePattern> = self.triples.iter().chain(&flat.triples).cloned().collect();
        let known = variables(&all);
        let shared: BTreeSet<Variable> = variables(&flat.triples)
            .intersection(others)
            .cloned()
            .collect();
        let is_free = shared.is_subset(&variables(&self.triples))
            && variables(&flat.triples)
                .is_disjoint(&own.difference(&variables(&self.triples)).cloned().collect());
        let conditions = flat.conditions.iter().chain(condition);
        let is_native = conditions
            .into_iter()
            .all(|condition| is_native(condition, &known));
        !flat.triples.is_empty() && components(&all).len() == 1 && is_free && is_native
    }
}

fn natives(conditions: &[Expression], leaf: &Leaf) -> Result<Vec<Native>, Stop> {
    let of = |condition: &Expression| match Native::of(condition, &|variable| leaf.place(variable))
    {
        Some(native) => Ok(native),
        None => unfit(format!("the condition `{condition}`")),
    };
    conditions.iter().map(of).collect()
}

/// Whether an expression can be evaluated on rows with these variables.
fn is_native(expression: &Expression, known: &BTreeSet<Variable>) -> bool {
    Native::of(expression, &|variable| {
        known.contains(variable).then_some(0)
    })
    .is_some()
}

impl Rewriter<'_> {
    pub(super) fn joined(&mut self, pattern: GraphPattern, need: &Need) -> Result<Rewritten, Stop> {
        let mut flat = Flat::of(pattern);
        if flat.triples.is_empty() && flat.optionals.is_empty() && flat.others.len() == 1 {
            // Nothing to flatten: the pattern itself, or one that joins are evaluated after.
            let only = flat.others.remove(0);
            if let GraphPattern::LeftJoin {
                left,
                right,
                expression,
            } = only
            {
                let vars: BTreeSet<Variable> = bound(&right)
                    .into_iter()
                    .chain(expression.iter().flat_map(used))
                    .collect();
                let late: Vec<Variable> = flat.late.iter().flat_map(used).collect();
                let inner_need = need.and(vars).and(late).asking(|_| false);
                let left = self.rewrite(*left, &inner_need)?;
                let joined = self.left_join(left, *right, expression, &inner_need, false)?;
                return self.conditioned(joined, flat.late);
            }
            let late: Vec<Variable> = flat.late.iter().flat_map(used).collect();
            let need = if flat.late.is_empty() {
                need.clone()
            } else {
                need.and(late)
            };
            let inner = self.rewrite(only, &need)?;
            return self.conditioned(inner, flat.late);
        }
        let (components, stored) = self.components(&mut flat)?;
        let mut items: Vec<BTreeSet<Variable>> =
            components.iter().map(Component::variables).collect();
        flat.others.extend(stored);
        items.extend(flat.others.iter().map(bound));
        items.extend(flat.optionals.iter().map(|(pattern, _)| bound(pattern)));
        let exact = self.exact(need, &flat, &items);
        // Each aggregate is computed by one table, if it uses no other's values.
        let owner = |asked: &Asked| -> Option<usize> {
            let vars = used(&asked.expression);
            let all: Vec<usize> = (0..items.len())
                .filter(|at| !vars.is_disjoint(&items[*at]))
                .collect();
            match all.as_slice() {
                [at] if vars.is_subset(&items[*at]) => {
                    let is_table = components
                        .get(*at)
                        .is_some_and(|_| is_native(&asked.expression, &vars));
                    (is_table || *at >= components.len() + flat.others.len()).then_some(*at)
                }
                _ => None,
            }
        };
        let owners: BTreeMap<usize, usize> = need
            .asked
            .iter()
            .filter_map(|asked| Some((asked.id, owner(asked)?)))
            .collect();
        let base = Need {
            exact,
            first: None,
            any: None,
            ..need.clone()
        }
        .asking(|asked| owners.contains_key(&asked.id));
        let asked_of = |at: usize| -> Vec<Asked> {
            base.asked
                .iter()
                .filter(|asked| owners.get(&asked.id) == Some(&at))
                .cloned()
                .collect()
        };
        let need_of = |at: usize, known: &[(Variable, Arc<Limit>)]| Need {
            asked: asked_of(at),
            known: known.to_vec(),
            ..base.clone()
        };
        let mut known = need.known.clone();
        let mut parts: Vec<Rewritten> = Vec::new();
        let mut is_empty = false;
        let others = std::mem::take(&mut flat.others);
        let has_tables = !components.is_empty() || !flat.optionals.is_empty();
        for (at, other) in others.into_iter().enumerate() {
            let names = &items[components.len() + at];
            let is_stored = matches!(other, GraphPattern::Bgp { .. });
            let mut part = match is_stored {
                true => Rewritten::plain(other),
                false => self.rewrite(other, &need_of(usize::MAX, &known))?,
            };
            if has_tables {
                let wanted: Vec<Variable> = names.intersection(&base.exact).cloned().collect();
                is_empty |= self.materialize(&mut part, &wanted, &mut known)?;
            }
            parts.push(part);
        }
        let mut order: Vec<usize> = (0..components.len()).collect();
        let size = |at: &usize| {
            let of = |triple: &TriplePattern| match &triple.predicate {
                NamedNodePattern::NamedNode(property) => self.files.statements(property.as_str()),
                NamedNodePattern::Variable(_) => u64::MAX,
            };
            components[*at].triples.iter().map(of).min()
        };
        order.sort_by_key(size);
        let is_alone = components.len() == 1
            && parts.is_empty()
            && flat.optionals.is_empty()
            && flat.late.is_empty();
        for at in order {
            let mut own = need_of(at, &known);
            if is_alone {
                (own.first, own.any) = (need.first.clone(), need.any);
            }
            let (part, none) = self.table(&components[at], &own, is_empty, &mut known)?;
            is_empty |= none;
            parts.push(part);
        }
        let join = |one: Rewritten, other| {
            one.with(other, |left, right| GraphPattern::Join { left, right })
        };
        let mut all = parts
            .into_iter()
            .reduce(join)
            .unwrap_or_else(|| Rewritten::plain(GraphPattern::default()));
        let first_optional = items.len() - flat.optionals.len();
        // Values of aggregates that an optional part did not compute: the parts after it must keep
        // them.
        let mut untaken: BTreeSet<Variable> = BTreeSet::new();
        for (at, (right, expression)) in std::mem::take(&mut flat.optionals).into_iter().enumerate()
        {
            let mut own = need_of(first_optional + at, &known);
            own.exact.extend(untaken.iter().cloned());
            all = self.left_join(all, right, expression, &own, is_empty)?;
            let left = own
                .asked
                .iter()
                .filter(|asked| !all.taken.contains_key(&asked.id));
            untaken.extend(left.flat_map(|asked| used(&asked.expression)));
        }
        self.conditioned(all, flat.late)
    }

    fn conditioned(&self, all: Rewritten, late: Vec<Expression>) -> Result<Rewritten, Stop> {
        late.iter()
            .try_for_each(|condition| self.check_condition(condition))?;
        Ok(Rewritten {
            pattern: filtered(all.pattern, late),
            ..all
        })
    }

    /// The variables whose values are needed outside of the patterns that bind them.
    fn exact(&self, need: &Need, flat: &Flat, items: &[BTreeSet<Variable>]) -> BTreeSet<Variable> {
        let mut exact = need.exact.clone();
        exact.extend(flat.late.iter().flat_map(used));
        exact.extend(
            flat.optionals
                .iter()
                .filter_map(|(_, condition)| condition.as_ref())
                .flat_map(used),
        );
        for (at, item) in items.iter().enumerate() {
            let is_shared =
                |variable: &&Variable| items[..at].iter().any(|other| other.contains(variable));
            exact.extend(item.iter().filter(is_shared).cloned());
        }
        exact
    }

    /// The components that may match in outlines, with their conditions and optional parts, and the
    /// patterns that match only in the store.
    fn components(&self, flat: &mut Flat) -> Result<(Vec<Component>, Vec<GraphPattern>), Stop> {
        let (mut found, mut stored) = (Vec::new(), Vec::new());
        for members in components(&flat.triples) {
            let triples: Vec<TriplePattern> =
                members.iter().map(|at| flat.triples[*at].clone()).collect();
            match self.is_stored(&triples) {
                true => stored.extend(triples),
                false => found.push(Component {
                    triples,
                    ..Component::default()
                }),
            }
        }
        for condition in std::mem::take(&mut flat.conditions) {
            let vars = used(&condition);
            let owner = found
                .iter_mut()
                .find(|component| vars.is_subset(&variables(&component.triples)));
            match owner {
                Some(component) if is_native(&condition, &vars) && !vars.is_empty() => {
                    component.conditions.push(condition)
                }
                _ => flat.late.push(condition),
            }
        }
        let mut rest = Vec::new();
        for (at, (pattern, condition)) in flat.optionals.iter().enumerate() {
            let mut others: BTreeSet<Variable> = flat
                .others
                .iter()
                .flat_map(bound)
                .chain(variables(&stored))
                .collect();
            let siblings = flat
                .optionals
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != at);
            others.extend(siblings.flat_map(|(_, (pattern, _))| bound(pattern)));
            let owner = (0..found.len()).find(|own| {
                let mut others = others.clone();
                let rest = found.iter().enumerate().filter(|(other, _)| other != own);
                others.extend(rest.flat_map(|(_, component)| component.variables()));
                found[*own].takes(pattern, condition.as_ref(), &others)
            });
            match owner {
                Some(own) if rest.is_empty() => {
                    let inner = Flat::of(pattern.clone());
                    let conditions = inner
                        .conditions
                        .into_iter()
                        .chain(condition.clone())
                        .collect();
                    found[own].optionals.push((inner.triples, conditions));
                }
                _ => rest.push((pattern.clone(), condition.clone())),
            }
        }
        flat.optionals = rest;
        if let ([component], true) = (
            found.as_mut_slice(),
            flat.optionals.is_empty() && flat.others.is_empty() && stored.is_empty(),
        ) {
            let vars = component.variables();
            let (native, late) = std::mem::take(&mut flat.late)
                .into_iter()
                .partition(|condition| is_native(condition, &vars));
            (component.late, flat.late) = (native, late);
        }
        let stored = if stored.is_empty() {
            Vec::new()
        } else {
            vec![GraphPattern::Bgp { patterns: stored }]
        };
        Ok((found, stored))
    }

    fn left_join(
        &mut self,
        mut left: Rewritten,
        right: GraphPattern,
        expression: Option<Expression>,
        need: &Need,
        is_empty: bool,
    ) -> Result<Rewritten, Stop> {
        expression
            .iter()
            .try_for_each(|condition| self.check_condition(condition))?;
        let names = bound(&left.pattern);
        let mut known = need.known.clone();
        let mut wanted: Vec<Variable> = names.intersection(&need.exact).cloned().collect();
        wanted.extend(left.added());
        wanted.sort();
        wanted.dedup();
        let none = is_empty || self.materialize(&mut left, &wanted, &mut known)?;
        let vars = bound(&right);
        let mut own = Need {
            known,
            first: None,
            any: None,
            ..need.clone()
        };
        own.known
            .retain(|(variable, _)| names.contains(variable) && vars.contains(variable));
        let right = match none {
            true => Rewritten::plain(empty(Vec::new())),
            false => self.rewrite(right, &own)?,
        };
        Ok(left.with(right, |left, right| GraphPattern::LeftJoin {
            left,
            right,
            expression,
        }))
    }

    /// Evaluates a pattern that needs no outlines, and puts its rows in its place. Their values
    /// limit other patterns. Returns whether it has no rows.
    fn materialize(
        &self,
        part: &mut Rewritten,
        wanted: &[Variable],
        known: &mut Vec<(Variable, Arc<Limit>)>,
    ) -> Result<bool, Stop> {
        let mut all: Vec<Variable> = wanted.to_vec();
        all.extend(part.added());
        all.sort();
        all.dedup();
        let rows = self.select(part.pattern.clone(), &all)?;
        if rows.len() > MOST_KNOWN {
            return Ok(false);
        }
        let values: Vec<Vec<Option<Value>>> = rows
            .iter()
            .map(|row| {
                row.iter()
                    .map(|term| term.as_ref().map(Value::of))
                    .collect()
            })
            .collect();
        limits(&all, &values, known);
        if let Some(bindings) = ground(&values) {
            part.pattern = table(all, bindings);
        }
        Ok(rows.is_empty())
    }

    /// The table of a component. Returns also whether it has no rows.
    fn table(
        &mut self,
        component: &Component,
        need: &Need,
        is_empty: bool,
        known: &mut Vec<(Variable, Arc<Limit>)>,
    ) -> Result<(Rewritten, bool), Stop> {
        let mut leaf = component.leaf()?;
        let keys: Vec<Variable> = component
            .variables()
            .intersection(&need.exact)
            .cloned()
            .collect();
        for (variable, limit) in &need.known {
            // Values of optional parts can't be limited: without them, rows would remain that have
            // none.
            let is_certain = variables(&component.triples).contains(variable);
            if let Some(place) = leaf.place(variable).filter(|_| is_certain) {
                leaf.among.push((place, Arc::clone(limit)));
            }
        }
        let place = |variable: &Variable| leaf.place(variable);
        let aggregates: Option<Vec<(Kind, Native)>> = need
            .asked
            .iter()
            .map(|asked| Some((asked.kind.clone(), Native::of(&asked.expression, &place)?)))
            .collect();
        let Some(aggregates) = aggregates else {
            return unfit("an aggregate");
        };
        let first = need.first.as_ref().and_then(|(keys, most)| {
            let key = |key: &OrderExpression| match key {
                OrderExpression::Asc(key) => Some((Native::of(key, &place)?, false)),
                OrderExpression::Desc(key) => Some((Native::of(key, &place)?, true)),
            };
            Some((keys.iter().map(key).collect::<Option<Vec<_>>>()?, *most))
        });
        let output = Output {
            keys: keys.iter().filter_map(place).collect(),
            aggregates,
            grouped: need.mode != Mode::Bag,
            first: first.filter(|_| need.mode == Mode::Bag),
            any: need.any.filter(|_| need.mode == Mode::Bag),
        };
        let count = (need.mode == Mode::Counted).then(|| self.fresh());
        let results: Vec<Variable> = need.asked.iter().map(|_| self.fresh()).collect();
        let names: Vec<Variable> = keys
            .iter()
            .cloned()
            .chain(count.clone())
            .chain(results.iter().cloned())
            .collect();
        let mut rows: Vec<Vec<Option<Value>>> = Vec::new();
        let mut is_distinct = output.grouped;
        if !is_empty {
            for row in self.files.rows(&leaf, &output, self.counts.as_deref())? {
                let mut values = row.values.clone();
                values.extend(
                    count
                        .iter()
                        .map(|_| i64::try_from(row.count).ok().map(Value::Integer)),
                );
                values.extend(row.results());
                rows.push(values);
            }
            let stored =
                self.stored_rows(component, need, &keys, count.as_ref(), &results, &names)?;
            is_distinct &= stored.is_empty() || rows.is_empty();
            rows.extend(stored);
        }
        self.sort(&mut rows, &names);
        if rows.len() <= MOST_KNOWN {
            let values: Vec<Vec<Option<Value>>> =
                rows.iter().map(|row| row[..keys.len()].to_vec()).collect();
            limits(&keys, &values, known);
        }
        let none = rows.is_empty();
        let Some(bindings) = ground(&rows) else {
            return unfit("outcomes and their results as values (they are blank nodes)");
        };
        let taken = need.asked.iter().zip(results);
        let taken = taken
            .map(|(asked, result)| {
                (
                    asked.id,
                    Taken {
                        result,
                        own: count.clone(),
                    },
                )
            })
            .collect();
        let counts = count.into_iter().collect();
        let distinct = is_distinct.then_some(keys);
        Ok((
            Rewritten {
                pattern: table(names, bindings),
                counts,
                taken,
                distinct,
            },
            none,
        ))
    }

    /// Sorts the rows of a table as the answer, as far as it has the variables. Any order is right,
    /// but the evaluator looks up the texts of both terms for each comparison; sorted rows need
    /// few.
    fn sort(&self, rows: &mut [Vec<Option<Value>>], names: &[Variable]) {
        let place = |variable: &Variable| names.iter().position(|name| name == variable);
        let keys: Vec<usize> = self.order.iter().map_while(place).collect();
        let compared = |one: &Vec<Option<Value>>, other: &Vec<Option<Value>>, key: &usize| match (
            &one[*key],
            &other[*key],
        ) {
            (Some(one), Some(other)) => one.rough_order(other),
            (one, other) => one.is_some().cmp(&other.is_some()),
        };
        rows.sort_by(|one, other| {
            keys.iter()
                .map(|key| compared(one, other, key))
                .find(|order| order.is_ne())
                .unwrap_or(Ordering::Equal)
        });
    }

    /// The rows of the runs that the store has.
    fn stored_rows(
        &self,
        component: &Component,
        need: &Need,
        keys: &[Variable],
        count: Option<&Variable>,
        results: &[Variable],
        names: &[Variable],
    ) -> Result<Vec<Vec<Option<Value>>>, Stop> {
        let mut pattern = component.pattern();
        if let Some(count) = count {
            let mut aggregates = vec![(
                count.clone(),
                AggregateExpression::CountSolutions { distinct: false },
            )];
            for (asked, result) in need.asked.iter().zip(results) {
                let name = match &asked.kind {
                    Kind::Count => AggregateFunction::Count,
                    Kind::Sum => AggregateFunction::Sum,
                    Kind::Least => AggregateFunction::Min,
                    Kind::Greatest => AggregateFunction::Max,
                    Kind::Joined(separator) => AggregateFunction::GroupConcat {
                        separator: Some(separator.to_string()),
                    },
                };
                let expr = asked.expression.clone();
                aggregates.push((
                    result.clone(),
                    AggregateExpression::FunctionCall {
                        name,
                        expr,
                        distinct: false,
                    },
                ));
            }
            pattern = GraphPattern::Group {
                inner: Box::new(pattern),
                variables: keys.to_vec(),
                aggregates,
            };
        } else if let Some((expression, most)) = &need.first {
            let ordered = GraphPattern::OrderBy {
                inner: Box::new(pattern),
                expression: expression.clone(),
            };
            pattern = GraphPattern::Slice {
                inner: Box::new(ordered),
                start: 0,
                length: Some(*most),
            };
        } else if let Some(any) = need.any {
            pattern = GraphPattern::Slice {
                inner: Box::new(pattern),
                start: 0,
                length: Some(any),
            };
        } else if need.mode == Mode::Set {
            let projected = GraphPattern::Project {
                inner: Box::new(pattern),
                variables: keys.to_vec(),
            };
            pattern = GraphPattern::Distinct {
                inner: Box::new(projected),
            };
        }
        let rows = self.select(pattern, names)?;
        let values = rows.iter().map(|row| {
            row.iter()
                .map(|term| term.as_ref().map(Value::of))
                .collect::<Vec<_>>()
        });
        // Of no rows, there is one group.
        let is_there = |row: &Vec<Option<Value>>| {
            count.is_none() || row.get(keys.len()) != Some(&Some(Value::Integer(0)))
        };
        Ok(values.filter(is_there).collect())
    }
}

/// Adds the values of each variable that always has one.
fn limits(
    variables: &[Variable],
    rows: &[Vec<Option<Value>>],
    known: &mut Vec<(Variable, Arc<Limit>)>,
) {
    for (at, variable) in variables.iter().enumerate() {
        let of = |row: &Vec<Option<Value>>| Some(canonical(row[at].as_ref()?)?.into_owned());
        if let Some(values) = rows.iter().map(of).collect::<Option<HashSet<Value>>>() {
            known.push((variable.clone(), Arc::new(Limit::of(values))));
        }
    }
}

/// The rows as terms of a table; `None` if there is a blank node.
fn ground(rows: &[Vec<Option<Value>>]) -> Option<Vec<Vec<Option<GroundTerm>>>> {
    let of = |value: &Option<Value>| match value.as_ref().map(Value::term) {
        None => Some(None),
        Some(Term::NamedNode(node)) => Some(Some(GroundTerm::NamedNode(node))),
        Some(Term::Literal(literal)) => Some(Some(GroundTerm::Literal(literal))),
        Some(_) => None,
    };
    rows.iter()
        .map(|row| row.iter().map(of).collect())
        .collect()
}

/// A table. As a subquery, it is joined by hashes; by itself, it would be read again for each row.
fn table(variables: Vec<Variable>, bindings: Vec<Vec<Option<GroundTerm>>>) -> GraphPattern {
    let inner = Box::new(GraphPattern::Values {
        variables: variables.clone(),
        bindings,
    });
    GraphPattern::Project { inner, variables }
}

fn empty(variables: Vec<Variable>) -> GraphPattern {
    table(variables, Vec::new())
}
