//! Joins the columns of one file to rows.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};

use oxigraph::model::NamedNode;

use crate::vertical::column::{Column, Value};
use crate::vertical::counts::RunBits;
use crate::vertical::expression::Native;
use crate::vertical::leaf::{Leaf, Limit, Step, is_within_run};
use crate::vertical::nodes::{Name, Nodes};
use crate::vertical::sheet::Pairs;
use crate::vertical::stop::{Stop, unfit};
use crate::vertical::value::{Cell, canonical};

/// The code of a value that is missing.
pub(super) const UNBOUND: u32 = u32::MAX;
/// Largest number of rows of one file. They take some hundred megabytes.
const MOST_ROWS: usize = 1 << 22;

/// The columns of a file that a leaf reads.
pub(super) struct FileColumns {
    pub nodes: Nodes,
    /// Number of nodes.
    pub count: u32,
    pub properties: Vec<String>,
    pub columns: Vec<Option<Indexed>>,
    /// The first node of each run.
    firsts: Vec<u32>,
    /// The position of the node of the run itself among its nodes, by profile.
    run_nodes: Vec<Option<u32>>,
}

/// A column that can be looked up.
pub(super) struct Indexed {
    pairs: Pairs,
    by_subject: Index,
    /// Only of nodes.
    by_value: Option<Index>,
}

/// Rows by node.
struct Index {
    starts: Vec<u32>,
    rows: Vec<u32>,
}

impl Index {
    fn of(nodes: &[u32], count: u32) -> Self {
        let mut starts = vec![0u32; count as usize + 1];
        nodes
            .iter()
            .for_each(|node| starts[*node as usize + 1] += 1);
        (1..starts.len()).for_each(|at| starts[at] += starts[at - 1]);
        let mut next = starts.clone();
        let mut rows = vec![0u32; nodes.len()];
        for (row, node) in (0..).zip(nodes) {
            let place = &mut next[*node as usize];
            rows[*place as usize] = row;
            *place += 1;
        }
        Self { starts, rows }
    }

    fn rows(&self, node: u32) -> &[u32] {
        let at = node as usize;
        match (self.starts.get(at), self.starts.get(at + 1)) {
            (Some(from), Some(to)) => &self.rows[*from as usize..*to as usize],
            _ => &[],
        }
    }
}

impl FileColumns {
    pub(super) fn new(
        nodes: Nodes,
        count: u32,
        properties: Vec<String>,
        columns: Vec<Option<Pairs>>,
    ) -> Self {
        let index = |pairs: Pairs| {
            let by_subject = Index::of(&pairs.subjects, count);
            let by_value = match &pairs.column {
                Column::Nodes(values) => Some(Index::of(values, count)),
                Column::Values { .. } => None,
            };
            Indexed {
                pairs,
                by_subject,
                by_value,
            }
        };
        let columns = columns.into_iter().map(|pairs| pairs.map(index)).collect();
        let (mut firsts, mut first) = (Vec::with_capacity(nodes.numbers.len()), 0);
        for profile in &nodes.profile_of {
            firsts.push(first);
            first += nodes
                .profiles
                .get(*profile as usize)
                .map_or(0, |profile| profile.names.len() as u32);
        }
        let is_run = |name: &u32| matches!(nodes.names.get(*name as usize), Some(Name::Below(rest)) if rest.is_empty());
        let run_nodes = nodes
            .profiles
            .iter()
            .map(|profile| profile.names.iter().position(is_run).map(|at| at as u32))
            .collect();
        Self {
            nodes,
            count,
            properties,
            columns,
            firsts,
            run_nodes,
        }
    }

    /// The position of the run that has a node.
    pub(super) fn run_of(&self, node: u32) -> usize {
        self.firsts
            .partition_point(|first| *first <= node)
            .saturating_sub(1)
    }

    /// The node of a run.
    pub(super) fn node_of_run(&self, run: usize) -> Option<u32> {
        let profile = *self.nodes.profile_of.get(run)?;
        Some(self.firsts.get(run)? + (*self.run_nodes.get(profile as usize)?)?)
    }

    /// The IRI of a node; `None` for a blank node.
    fn iri(&self, node: u32) -> Option<String> {
        let run = self.run_of(node);
        let profile = self
            .nodes
            .profiles
            .get(*self.nodes.profile_of.get(run)? as usize)?;
        let name = profile.names.get((node - self.firsts[run]) as usize)?;
        match self.nodes.names.get(*name as usize)? {
            Name::Below(rest) => Some(format!(
                "{}{}{rest}",
                self.nodes.base, self.nodes.numbers[run]
            )),
            Name::Iri(iri) => Some(iri.clone()),
            Name::Assertion | Name::Outcome | Name::Blank(_) => None,
        }
    }

    /// Leaves only the nodes that a limit has.
    fn limit(&self, limit: &Limit, allowed: &mut [bool]) {
        let of_campaign = limit.nodes.get(&self.nodes.base);
        for (run, number) in self.nodes.numbers.iter().enumerate() {
            let below = of_campaign.and_then(|runs| runs.get(number));
            let profile = self
                .nodes
                .profile_of
                .get(run)
                .and_then(|profile| self.nodes.profiles.get(*profile as usize));
            for (node, name) in
                (self.firsts[run]..).zip(profile.into_iter().flat_map(|profile| &profile.names))
            {
                let is_in = match self.nodes.names.get(*name as usize) {
                    Some(Name::Below(rest)) => below.is_some_and(|below| below.contains(rest)),
                    Some(Name::Iri(iri)) => limit
                        .values
                        .contains(&Value::Term(NamedNode::new_unchecked(iri.as_str()).into())),
                    _ => false,
                };
                if let Some(allowed) = allowed.get_mut(node as usize) {
                    *allowed &= is_in;
                }
            }
        }
    }

    /// The column of a property.
    pub(super) fn column(&self, property: &str) -> Option<(usize, &Pairs)> {
        let at = self.properties.iter().position(|known| known == property)?;
        Some((at, &self.columns.get(at)?.as_ref()?.pairs))
    }
}

/// The meaning of the codes of a place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Unknown,
    Node,
    /// Values of a column.
    Values(usize),
}

/// Rows of one file.
pub(super) struct Rows<'a> {
    file: &'a FileColumns,
    counts: Option<&'a RunBits>,
    kinds: Vec<Kind>,
    /// Codes by place.
    pub codes: Vec<Vec<u32>>,
    pub len: usize,
}

impl<'a> Rows<'a> {
    /// The rows of a leaf. `counts`: the runs that count in rates. `without`: numbers of runs to
    /// leave out.
    pub(super) fn of(
        leaf: &Leaf,
        file: &'a FileColumns,
        counts: Option<&'a RunBits>,
        without: &HashSet<u64>,
    ) -> Result<Self, Stop> {
        let places = leaf.places.len();
        let kinds = vec![Kind::Unknown; places];
        let mut rows = Rows {
            file,
            counts,
            kinds,
            codes: vec![vec![UNBOUND]; places],
            len: 1,
        };
        let all_there = leaf
            .steps
            .iter()
            .all(|step| file.column(&step.property).is_some());
        if !all_there || leaf.steps.is_empty() {
            rows.keep(&[]);
            return Ok(rows);
        }
        let mut steps: Vec<&Step> = leaf.steps.iter().collect();
        let mut conditions: Vec<&Native> = leaf.conditions.iter().collect();
        while !steps.is_empty() {
            let next = rows.next(&steps, leaf);
            let step = steps.remove(next);
            let is_first = rows.kinds.iter().all(|kind| *kind == Kind::Unknown);
            rows.join(step, leaf, None)?;
            if is_first && !without.is_empty() {
                rows.leave_out(step.subject, without);
            }
            rows.apply(&mut conditions)?;
        }
        for optional in &leaf.optionals {
            rows.join_optional(&optional.steps, &optional.conditions, leaf)?;
        }
        let late: Vec<&Native> = leaf.late.iter().collect();
        for condition in late {
            rows.filter(condition)?;
        }
        Ok(rows)
    }

    /// The value of a place in a row.
    pub(super) fn cell(&self, place: usize, row: usize) -> Option<Cell<'a>> {
        let code = self.codes[place][row];
        match self.kinds[place] {
            _ if code == UNBOUND => None,
            Kind::Unknown => None,
            Kind::Node => self.file.iri(code).map(|iri| Cell::Iri(Cow::Owned(iri))),
            Kind::Values(column) => self.value_of(column, code).map(Cell::of),
        }
    }

    /// The value of a code, as an answer has it; `None` if it is missing.
    pub(super) fn value(&self, place: usize, code: u32) -> Result<Option<Value>, Stop> {
        match self.kinds[place] {
            _ if code == UNBOUND => Ok(None),
            Kind::Unknown => Ok(None),
            Kind::Node => match self.file.iri(code) {
                Some(iri) => Ok(Some(Value::Term(NamedNode::new_unchecked(iri).into()))),
                None => unfit("outcomes and their results as values (they are blank nodes)"),
            },
            Kind::Values(column) => Ok(self.value_of(column, code).cloned()),
        }
    }

    fn value_of(&self, column: usize, code: u32) -> Option<&'a Value> {
        match &self.file.columns.get(column)?.as_ref()?.pairs.column {
            Column::Values { values, .. } => values.get(code as usize),
            Column::Nodes(_) => None,
        }
    }

    pub(super) fn is_bound(&self, place: usize, row: usize) -> bool {
        self.codes[place][row] != UNBOUND
    }

    /// Whether the run at a place counts in rates.
    pub(super) fn counts(&self, place: usize, row: usize) -> Result<Option<bool>, Stop> {
        let code = self.codes[place][row];
        match (self.kinds[place], self.counts) {
            _ if code == UNBOUND => Ok(None),
            (Kind::Node, Some(counts)) => {
                let run = self.file.run_of(code);
                let is_run = self.file.node_of_run(run) == Some(code);
                Ok(Some(is_run && counts.has(self.file.nodes.numbers[run])))
            }
            _ => unfit("`act:counts` of something that is not a run of the pattern"),
        }
    }

    /// The step to join next: one that is connected, and that leaves few rows.
    fn next(&self, steps: &[&Step], leaf: &Leaf) -> usize {
        let is_fixed = |place: usize| leaf.among.iter().any(|(fixed, _)| *fixed == place);
        let is_bound = |place: usize| self.kinds[place] != Kind::Unknown;
        let size = |step: &Step| {
            self.file
                .column(&step.property)
                .map_or(0, |(_, pairs)| pairs.subjects.len())
        };
        let is_first = self.kinds.iter().all(|kind| *kind == Kind::Unknown);
        let rank = |step: &Step| {
            let fixed = is_fixed(step.subject) || is_fixed(step.value);
            if is_first {
                return (0, if fixed { size(step) / 8 } else { size(step) });
            }
            let reached = is_bound(step.subject) || self.kinds[step.value] == Kind::Node;
            let rank = match (is_bound(step.subject), is_bound(step.value)) {
                _ if !reached => 4,
                (true, true) => 0,
                _ if fixed => 1,
                (true, false) => 2,
                _ => 3,
            };
            (rank, size(step))
        };
        (0..steps.len())
            .min_by_key(|at| rank(steps[*at]))
            .unwrap_or(0)
    }

    /// Joins a step. `origins`: for each row, the row that it comes from, which is kept up to date.
    fn join(
        &mut self,
        step: &Step,
        leaf: &Leaf,
        origins: Option<&mut Vec<u32>>,
    ) -> Result<(), Stop> {
        let Some((at, indexed)) = self
            .file
            .column(&step.property)
            .map(|(at, _)| at)
            .and_then(|at| Some((at, self.file.columns.get(at)?.as_ref()?)))
        else {
            self.keep(&[]);
            origins.into_iter().for_each(Vec::clear);
            return Ok(());
        };
        let value_kind = match indexed.pairs.column {
            Column::Nodes(_) => Kind::Node,
            Column::Values { .. } => Kind::Values(at),
        };
        let codes: &[u32] = match &indexed.pairs.column {
            Column::Nodes(nodes) => nodes,
            Column::Values { codes, .. } => codes,
        };
        let [subject_known, value_known] =
            [step.subject, step.value].map(|place| self.kinds[place] != Kind::Unknown);
        if subject_known && self.kinds[step.subject] != Kind::Node {
            return unfit(format!(
                "`{}` about something else than a run",
                step.property
            ));
        }
        if is_within_run(&step.property) && value_kind != Kind::Node {
            return unfit(format!("`{}` that leads out of its run", step.property));
        }
        let is_allowed = self.allowed(step.value, value_kind, leaf)?;
        let is_subject_allowed = self.allowed(step.subject, Kind::Node, leaf)?;
        let fits = |row: u32| {
            let (subject, value) = (indexed.pairs.subjects[row as usize], codes[row as usize]);
            is_subject_allowed
                .as_ref()
                .is_none_or(|allowed| allowed[subject as usize])
                && is_allowed
                    .as_ref()
                    .is_none_or(|allowed| allowed[value as usize])
        };
        let same = if value_known {
            Some(self.same(step.value, value_kind)?)
        } else {
            None
        };
        let mut found: Vec<(u32, u32)> = Vec::new();
        for row in 0..self.len {
            let candidates: Cow<'_, [u32]> = if subject_known {
                Cow::Borrowed(indexed.by_subject.rows(self.codes[step.subject][row]))
            } else if value_known {
                match &indexed.by_value {
                    Some(index) => Cow::Borrowed(index.rows(self.codes[step.value][row])),
                    None => {
                        return unfit(format!("`{}` that joins runs by a value", step.property));
                    }
                }
            } else {
                Cow::Owned((0..indexed.pairs.subjects.len() as u32).collect())
            };
            for candidate in candidates
                .iter()
                .copied()
                .filter(|candidate| fits(*candidate))
            {
                let is_same = same.as_ref().is_none_or(|same| {
                    same.equal(self.codes[step.value][row], codes[candidate as usize])
                });
                // A pattern such as `?a act:x ?a`.
                let is_loop_free = step.subject != step.value
                    || (value_kind == Kind::Node
                        && indexed.pairs.subjects[candidate as usize] == codes[candidate as usize]);
                if is_same && is_loop_free {
                    found.push((row as u32, candidate));
                }
            }
            if found.len() > MOST_ROWS {
                return unfit("a join with very many rows for each run");
            }
        }
        let rows: Vec<u32> = found.iter().map(|(row, _)| *row).collect();
        self.keep(&rows);
        if let Some(origins) = origins {
            *origins = rows.iter().map(|row| origins[*row as usize]).collect();
        }
        if !subject_known {
            self.codes[step.subject] = found
                .iter()
                .map(|(_, at)| indexed.pairs.subjects[*at as usize])
                .collect();
            self.kinds[step.subject] = Kind::Node;
        }
        if !value_known && step.subject != step.value {
            self.codes[step.value] = found.iter().map(|(_, at)| codes[*at as usize]).collect();
            self.kinds[step.value] = value_kind;
        }
        Ok(())
    }

    /// Joins steps that need not match.
    fn join_optional(
        &mut self,
        steps: &[Step],
        conditions: &[Native],
        leaf: &Leaf,
    ) -> Result<(), Stop> {
        let before: Vec<Vec<u32>> = self.codes.clone();
        let (len, kinds) = (self.len, self.kinds.clone());
        let mut origins: Vec<u32> = (0..len as u32).collect();
        let mut steps: Vec<&Step> = steps.iter().collect();
        while !steps.is_empty() {
            let next = self.next(&steps, leaf);
            let step = steps.remove(next);
            self.join(step, leaf, Some(&mut origins))?;
        }
        for condition in conditions {
            let kept = self.holding(condition)?;
            origins = kept.iter().map(|row| origins[*row as usize]).collect();
            self.keep(&kept);
        }
        let matched: HashSet<u32> = origins.into_iter().collect();
        for row in (0..len).filter(|row| !matched.contains(&(*row as u32))) {
            for (place, codes) in self.codes.iter_mut().enumerate() {
                codes.push(if kinds[place] == Kind::Unknown {
                    UNBOUND
                } else {
                    before[place][row]
                });
            }
            self.len += 1;
        }
        Ok(())
    }

    /// The codes that a place may have, if they are limited.
    fn allowed(&self, place: usize, kind: Kind, leaf: &Leaf) -> Result<Option<Vec<bool>>, Stop> {
        let mut limits = leaf
            .among
            .iter()
            .filter(|(limited, _)| *limited == place)
            .map(|(_, values)| values)
            .peekable();
        if limits.peek().is_none() || self.kinds[place] != Kind::Unknown {
            return Ok(None);
        }
        let limits: Vec<_> = limits.collect();
        Ok(Some(match kind {
            Kind::Values(column) => match &self.file.columns[column]
                .as_ref()
                .map(|column| &column.pairs.column)
            {
                Some(Column::Values { values, .. }) => {
                    let is_in = |value: &Value| {
                        let value = canonical(value).unwrap_or(Cow::Borrowed(value));
                        limits
                            .iter()
                            .all(|limit| limit.values.contains(value.as_ref()))
                    };
                    values.iter().map(is_in).collect()
                }
                _ => Vec::new(),
            },
            _ => {
                let mut allowed = vec![true; self.file.count as usize];
                limits
                    .iter()
                    .for_each(|limit| self.file.limit(limit, &mut allowed));
                allowed
            }
        }))
    }

    /// How codes of a place are compared with those of a column.
    fn same(&self, place: usize, kind: Kind) -> Result<Same, Stop> {
        match (self.kinds[place], kind) {
            (Kind::Node, Kind::Node) => Ok(Same::Codes),
            (Kind::Values(one), Kind::Values(other)) => {
                let mut numbers: HashMap<Cow<'_, Value>, u32> = HashMap::new();
                let mut of = |column: usize| -> Vec<u32> {
                    let values = match self.file.columns[column]
                        .as_ref()
                        .map(|column| &column.pairs.column)
                    {
                        Some(Column::Values { values, .. }) => values.as_slice(),
                        _ => &[],
                    };
                    let mut number = |value| {
                        let next = numbers.len() as u32;
                        *numbers
                            .entry(canonical(value).unwrap_or(Cow::Borrowed(value)))
                            .or_insert(next)
                    };
                    values.iter().map(&mut number).collect()
                };
                Ok(Same::Numbers(of(one), of(other)))
            }
            _ => unfit("a join of a node with a value"),
        }
    }

    fn leave_out(&mut self, place: usize, without: &HashSet<u64>) {
        let stays =
            |node: &u32| !without.contains(&self.file.nodes.numbers[self.file.run_of(*node)]);
        let codes = self.codes[place].iter().enumerate();
        let kept: Vec<u32> = codes
            .filter(|(_, node)| stays(node))
            .map(|(row, _)| row as u32)
            .collect();
        self.keep(&kept);
    }

    /// Applies the conditions whose values are all bound.
    fn apply(&mut self, conditions: &mut Vec<&Native>) -> Result<(), Stop> {
        let mut waiting = Vec::new();
        for condition in std::mem::take(conditions) {
            let mut places = Vec::new();
            condition.places(&mut places);
            if places
                .iter()
                .all(|place| self.kinds[*place] != Kind::Unknown)
            {
                self.filter(condition)?;
            } else {
                waiting.push(condition);
            }
        }
        *conditions = waiting;
        Ok(())
    }

    fn filter(&mut self, condition: &Native) -> Result<(), Stop> {
        let kept = self.holding(condition)?;
        self.keep(&kept);
        Ok(())
    }

    /// The rows in which a condition holds.
    fn holding(&self, condition: &Native) -> Result<Vec<u32>, Stop> {
        let mut kept = Vec::new();
        for row in 0..self.len {
            if condition.truth(self, row)? == Some(true) {
                kept.push(row as u32);
            }
        }
        Ok(kept)
    }

    /// Keeps some rows, in this order.
    pub(super) fn keep(&mut self, rows: &[u32]) {
        for (codes, kind) in self.codes.iter_mut().zip(&self.kinds) {
            *codes = match kind {
                Kind::Unknown => vec![UNBOUND; rows.len()],
                _ => rows.iter().map(|row| codes[*row as usize]).collect(),
            };
        }
        self.len = rows.len();
    }
}

/// How two codes are compared.
enum Same {
    Codes,
    /// Numbers of equal values, for the codes of either side.
    Numbers(Vec<u32>, Vec<u32>),
}

impl Same {
    fn equal(&self, one: u32, other: u32) -> bool {
        match self {
            Self::Codes => one == other,
            Self::Numbers(ones, others) => {
                let one = ones.get(one as usize);
                one.is_some() && one == others.get(other as usize)
            }
        }
    }
}
