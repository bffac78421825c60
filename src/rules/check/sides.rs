//! Warns of rules that depend on the order of a contact's two sides: which side is `w:first`
//! depends only on names.
//!
//! A property reads both sides alike if its rules stay the same when `w:first` and `w:second` are
//! exchanged: up to the names of variables, the order of conditions, and the predicates and
//! arguments that the exchange turns into each other. This is the greatest set of such pairs: all
//! pairs are assumed, and those that contradict the rules are taken out.

use std::collections::{BTreeMap, BTreeSet};

use crate::model::expression::{Expr, Variable};
use crate::model::given::VERDICT;
use crate::model::program::{
    Atom, CheckedProgram, Literal, Operand, PredicateId, Predicates, Rule, Scope,
};
use actcheck_base::{Diagnostic, Term, Terms, names};

/// The properties of contacts of two things, and of two links of the robot.
pub(crate) const SIDES: [[&str; 2]; 2] = [["first", "second"], ["firstLink", "secondLink"]];

/// Most pairs of conditions that are compared for one property. Beyond, it is
/// taken to be in order.
const STEPS: usize = 200_000;

/// Most arguments of a predicate whose arguments may be exchanged.
const MOST_EXCHANGED: usize = 6;

/// Warning R056 at a place that reads one side of a contact. `property`: the local name of the
/// property that it reads.
pub(crate) fn warning(property: &str, help: &str) -> Diagnostic {
    let message = format!(
        "the outcome depends on which side of a contact `w:{property}` is, and that depends only on the names of the two"
    );
    Diagnostic::warning("R056", message).help(help)
}

/// The image of a predicate under the exchange of sides: another one (or the same), and for each
/// argument its place there.
type Image = (PredicateId, Vec<usize>);

/// The rules below a property.
pub(crate) struct Sides<'a> {
    rules: BTreeMap<PredicateId, Vec<&'a Rule>>,
    with_facts: BTreeSet<PredicateId>,
    predicates: &'a Predicates,
    /// The predicates of the facts about sides, each with that of the other side.
    other: BTreeMap<PredicateId, PredicateId>,
    /// The local names of their properties.
    names: BTreeMap<PredicateId, &'static str>,
}

/// A rule without the values that nothing reads.
struct Plain<'a> {
    rule: &'a Rule,
    /// Head without the arguments that nothing reads.
    head: Vec<Option<Operand>>,
    /// Atoms first.
    body: Vec<Literal>,
}

impl<'a> Sides<'a> {
    /// `library`: the rules of the libraries. Returns `None` if no rule or query can read a side by
    /// its name.
    pub(crate) fn new(
        library: &'a CheckedProgram,
        predicates: &'a Predicates,
        terms: &Terms,
    ) -> Option<Self> {
        let id = |local: &str| {
            let property = terms.id(&Term::iri(names::w(local)))?;
            predicates.find(0, "state", Some(property))
        };
        let (mut other, mut properties) = (BTreeMap::new(), BTreeMap::new());
        for [first, second] in SIDES {
            for (one, two) in [(first, second), (second, first)] {
                if let Some(predicate) = id(one) {
                    // Without rules that read the other side, it has no predicate.
                    other.insert(predicate, id(two).unwrap_or(PredicateId::MAX));
                    properties.insert(predicate, one);
                }
            }
        }
        let names = properties;
        let mut sides = Self {
            rules: BTreeMap::new(),
            with_facts: BTreeSet::new(),
            predicates,
            other,
            names,
        };
        sides.add(library);
        (!sides.other.is_empty()).then_some(sides)
    }

    fn add(&mut self, program: &'a CheckedProgram) {
        for rule in &program.rules {
            self.rules
                .entry(rule.head.predicate)
                .or_default()
                .push(rule);
        }
        self.with_facts.extend(program.facts.keys());
    }

    /// The warning about a property whose outcome or margin changes if all sides are exchanged.
    pub(crate) fn one_sided(
        &self,
        program: &'a CheckedProgram,
        scope: Scope,
    ) -> Option<Diagnostic> {
        let mut below = Self {
            rules: self.rules.clone(),
            with_facts: self.with_facts.clone(),
            predicates: self.predicates,
            other: self.other.clone(),
            names: self.names.clone(),
        };
        below.add(program);
        let verdict: Vec<PredicateId> = VERDICT
            .iter()
            .filter(|(name, _)| *name != "because")
            .filter_map(|(name, _)| self.predicates.find(scope, name, None))
            .collect();
        let read = below.read(&verdict);
        let reading = below.reading_sides(&read);
        if !verdict.iter().any(|predicate| reading.contains(predicate)) {
            return None;
        }
        let plain = below.plain(&read, &reading);
        let mut exchange = Exchange {
            sides: &below,
            read: &read,
            plain: &plain,
            images: BTreeMap::new(),
            steps: 0,
        };
        exchange.find();
        if exchange.steps > STEPS {
            return None;
        }
        let faulty = verdict
            .into_iter()
            .find(|p| reading.contains(p) && !exchange.is_alike(*p))?;
        exchange.innermost(faulty)
    }

    /// The predicates that a verdict reads, each with whether its arguments are read.
    fn read(&self, verdict: &[PredicateId]) -> BTreeMap<PredicateId, Vec<bool>> {
        let mut read: BTreeMap<PredicateId, Vec<bool>> = BTreeMap::new();
        let mut waiting = Vec::new();
        for predicate in verdict {
            let known = self.predicates.get(*predicate);
            read.insert(*predicate, vec![known.name == "margin"; known.width]);
            waiting.push(*predicate);
        }
        while let Some(predicate) = waiting.pop() {
            for rule in self.rules.get(&predicate).into_iter().flatten() {
                for atom in plain(rule, &read[&predicate])
                    .body
                    .iter()
                    .filter_map(Literal::atom)
                {
                    let known = read.contains_key(&atom.predicate);
                    let args = read
                        .entry(atom.predicate)
                        .or_insert_with(|| vec![false; atom.args.len()]);
                    let mut more = !known;
                    for (is_read, arg) in args.iter_mut().zip(&atom.args) {
                        if !*is_read && *arg != Operand::Any {
                            *is_read = true;
                            more = true;
                        }
                    }
                    if more {
                        waiting.push(atom.predicate);
                    }
                }
            }
        }
        read
    }

    /// Those of some predicates that read a side of a contact, directly or indirectly.
    fn reading_sides(&self, read: &BTreeMap<PredicateId, Vec<bool>>) -> BTreeSet<PredicateId> {
        let mut reading: BTreeSet<PredicateId> = self
            .other
            .keys()
            .copied()
            .filter(|p| read.contains_key(p))
            .collect();
        loop {
            let reads = |predicate: &PredicateId| {
                self.rules
                    .get(predicate)
                    .into_iter()
                    .flatten()
                    .any(|rule| rule.reads().any(|p| reading.contains(&p)))
            };
            let more: Vec<PredicateId> = read
                .keys()
                .copied()
                .filter(|p| !reading.contains(p) && reads(p))
                .collect();
            if more.is_empty() {
                return reading;
            }
            reading.extend(more);
        }
    }

    fn plain(
        &self,
        read: &BTreeMap<PredicateId, Vec<bool>>,
        reading: &BTreeSet<PredicateId>,
    ) -> BTreeMap<PredicateId, Vec<Plain<'a>>> {
        let of = |predicate: &PredicateId| {
            self.rules
                .get(predicate)
                .into_iter()
                .flatten()
                .map(|rule| plain(rule, &read[predicate]))
                .collect()
        };
        reading
            .iter()
            .filter(|p| !self.other.contains_key(p))
            .map(|p| (*p, of(p)))
            .collect()
    }
}

/// Returns a rule without the values that nothing reads. `read`: whether the arguments of its head
/// are read.
fn plain<'a>(rule: &'a Rule, read: &[bool]) -> Plain<'a> {
    // An aggregate depends on all values.
    let is_read = |at: usize| rule.aggregation.is_some() || read.get(at).copied().unwrap_or(true);
    let head: Vec<Option<Operand>> = rule
        .head
        .args
        .iter()
        .enumerate()
        .map(|(at, arg)| is_read(at).then_some(*arg))
        .collect();
    let mut body: Vec<Literal> = rule.body.clone();
    loop {
        let mut count: BTreeMap<Variable, usize> = BTreeMap::new();
        for variable in occurrences(&head, &body, rule) {
            *count.entry(variable).or_default() += 1;
        }
        let length = body.len();
        let once = |variable: Variable| count.get(&variable).copied().unwrap_or_default() < 2;
        body.retain(
            |literal| !matches!(literal, Literal::Assign { variable, .. } if once(*variable)),
        );
        if body.len() < length {
            continue;
        }
        for literal in &mut body {
            if let Literal::Positive(atom) | Literal::Negative(atom) = literal {
                for arg in &mut atom.args {
                    if matches!(arg, Operand::Variable(variable) if once(*variable)) {
                        *arg = Operand::Any;
                    }
                }
            }
        }
        body.sort_by_key(|literal| match literal {
            Literal::Positive(_) => 0,
            Literal::Negative(_) => 1,
            _ => 2,
        });
        return Plain { rule, head, body };
    }
}

/// The variables of a rule, as often as they occur.
fn occurrences(head: &[Option<Operand>], body: &[Literal], rule: &Rule) -> Vec<Variable> {
    let mut found = Vec::new();
    let mut operand = |arg: &Operand| {
        if let Operand::Variable(variable) = arg {
            found.push(*variable);
        }
    };
    head.iter().flatten().for_each(&mut operand);
    body.iter()
        .filter_map(Literal::atom)
        .flat_map(|atom| &atom.args)
        .for_each(&mut operand);
    for literal in body {
        match literal {
            Literal::Positive(_) | Literal::Negative(_) => {}
            Literal::Assign {
                variable, value, ..
            } => {
                found.push(*variable);
                value.variables(&mut found);
            }
            Literal::Compare { left, right, .. } => {
                left.variables(&mut found);
                right.variables(&mut found);
            }
            Literal::Test { value, .. } => value.variables(&mut found),
        }
    }
    if let Some(aggregation) = &rule.aggregation {
        found.extend(&aggregation.group);
        for aggregate in &aggregation.aggregates {
            found.push(aggregate.input);
            found.extend(&aggregate.distinct);
        }
        for (variable, value) in &aggregation.after {
            found.push(*variable);
            value.variables(&mut found);
        }
    }
    found
}

/// The search for the image of each predicate under the exchange of sides.
struct Exchange<'p, 'a> {
    sides: &'p Sides<'a>,
    read: &'p BTreeMap<PredicateId, Vec<bool>>,
    plain: &'p BTreeMap<PredicateId, Vec<Plain<'a>>>,
    images: BTreeMap<PredicateId, Vec<Image>>,
    steps: usize,
}

/// Variables of one rule with those of another, in both directions.
#[derive(Clone, Default)]
struct Renaming {
    to: BTreeMap<Variable, Variable>,
    from: BTreeMap<Variable, Variable>,
}

impl Renaming {
    fn variable(&mut self, a: Variable, b: Variable) -> bool {
        *self.to.entry(a).or_insert(b) == b && *self.from.entry(b).or_insert(a) == a
    }

    fn operand(&mut self, a: &Operand, b: &Operand) -> bool {
        match (a, b) {
            (Operand::Variable(a), Operand::Variable(b)) => self.variable(*a, *b),
            (a, b) => a == b,
        }
    }

    /// Takes over the renaming of the first attempt that succeeds.
    fn either(&mut self, attempts: [&dyn Fn(&mut Self) -> bool; 2]) -> bool {
        attempts.into_iter().any(|attempt| {
            let mut copy = self.clone();
            let holds = attempt(&mut copy);
            if holds {
                *self = copy;
            }
            holds
        })
    }

    fn all(&mut self, a: &[Expr], b: &[Expr]) -> bool {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| self.expression(a, b))
    }

    fn expression(&mut self, a: &Expr, b: &Expr) -> bool {
        match (a, b) {
            (Expr::Constant(a), Expr::Constant(b)) => a == b,
            (Expr::Variable(a), Expr::Variable(b)) => self.variable(*a, *b),
            (Expr::Format(a), Expr::Format(b)) => self.all(a, b),
            (Expr::Matches(a, of), Expr::Matches(b, with)) => {
                of.as_str() == with.as_str() && self.expression(a, b)
            }
            (Expr::Call(f, a), Expr::Call(g, b)) if f.name == g.name => {
                let half = a.len() / 2;
                let turned: Vec<Expr> = match (f.name, a.as_slice()) {
                    ("ABS", [Expr::Call(h, inner)])
                        if matches!(h.name, "MINUS" | "geo3d:angleDifference")
                            && inner.len() == 2 =>
                    {
                        vec![Expr::Call(h, vec![inner[1].clone(), inner[0].clone()])]
                    }
                    (name, _) if has_alike_halves(name) && a.len() == 2 * half => {
                        a[half..].iter().chain(&a[..half]).cloned().collect()
                    }
                    _ => return self.all(a, b),
                };
                self.either([&|renaming| renaming.all(a, b), &|renaming| {
                    renaming.all(&turned, b)
                }])
            }
            // A formula is only the same as itself.
            (Expr::Timed(_), Expr::Timed(_)) => {
                let mut variables = Vec::new();
                a.variables(&mut variables);
                format!("{a:?}") == format!("{b:?}")
                    && variables.into_iter().all(|v| self.variable(v, v))
            }
            _ => false,
        }
    }
}

/// Whether a built-in gives the same for the two halves of its arguments in the other order.
fn has_alike_halves(name: &str) -> bool {
    let geometry = [
        "distance",
        "distance2d",
        "boxDistance",
        "boxesOverlap",
        "overlapArea",
        "dot",
        "angle",
    ];
    matches!(name, "SUM" | "PRODUCT" | "MAX" | "MIN" | "AND" | "OR")
        || name
            .strip_prefix("geo3d:")
            .is_some_and(|local| geometry.contains(&local))
}

impl<'a> Exchange<'_, 'a> {
    /// Whether the exchange changes nothing for a predicate.
    fn is_alike(&self, predicate: PredicateId) -> bool {
        !self.plain.contains_key(&predicate) && !self.sides.other.contains_key(&predicate)
            || self
                .images
                .get(&predicate)
                .into_iter()
                .flatten()
                .any(|(image, places)| {
                    *image == predicate && places.iter().enumerate().all(|(at, place)| at == *place)
                })
    }

    /// Finds the images of all predicates.
    fn find(&mut self) {
        let plain = self.plain;
        for predicate in plain.keys() {
            let candidates = plain
                .keys()
                .flat_map(|image| self.candidates(*predicate, *image))
                .collect();
            self.images.insert(*predicate, candidates);
        }
        let mut changed = true;
        while changed && self.steps <= STEPS {
            changed = false;
            for predicate in plain.keys() {
                for image in self.images[predicate].clone() {
                    if !self.fits(*predicate, &image) {
                        changed = true;
                        if let Some(images) = self.images.get_mut(predicate) {
                            images.retain(|known| *known != image);
                        }
                    }
                }
            }
        }
    }

    /// The images that are possible by the numbers of arguments.
    fn candidates(&self, predicate: PredicateId, image: PredicateId) -> Vec<Image> {
        let [read, there] = [&self.read[&predicate], &self.read[&image]];
        let is_input = |p| self.sides.with_facts.contains(&p) || self.sides.predicates.get(p).given;
        let only_itself = is_input(predicate) || is_input(image);
        if read.len() != there.len() || (only_itself && predicate != image) {
            return Vec::new();
        }
        let same: Vec<usize> = (0..read.len()).collect();
        let mut orders = vec![same.clone()];
        if !only_itself && read.len() <= MOST_EXCHANGED {
            for one in 0..read.len() {
                for two in one + 1..read.len() {
                    let mut order = same.clone();
                    order.swap(one, two);
                    orders.push(order);
                }
            }
        }
        orders.retain(|order| {
            order
                .iter()
                .enumerate()
                .all(|(at, place)| read[at] == there[*place])
        });
        orders.into_iter().map(|order| (image, order)).collect()
    }

    /// Whether each rule of a predicate has a counterpart among those of its image, and the
    /// reverse.
    fn fits(&mut self, predicate: PredicateId, (image, places): &Image) -> bool {
        let plain = self.plain;
        let [rules, others] = [&plain[&predicate], &plain[image]];
        rules
            .iter()
            .all(|rule| others.iter().any(|other| self.same(rule, other, places)))
            && others
                .iter()
                .all(|other| rules.iter().any(|rule| self.same(rule, other, places)))
    }

    /// Whether the exchange of sides turns a rule into another.
    fn same(&mut self, rule: &Plain<'a>, other: &Plain<'a>, places: &[usize]) -> bool {
        let mut renaming = Renaming::default();
        let heads =
            rule.head
                .iter()
                .zip(places)
                .all(|(arg, place)| match (arg, &other.head[*place]) {
                    (Some(a), Some(b)) => renaming.operand(a, b),
                    (a, b) => a.is_none() && b.is_none(),
                });
        if !heads || rule.body.len() != other.body.len() {
            return false;
        }
        let aggregates = match (&rule.rule.aggregation, &other.rule.aggregation) {
            (None, None) => true,
            (Some(a), Some(b)) => {
                let lists = |renaming: &mut Renaming, a: &[Variable], b: &[Variable]| {
                    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| renaming.variable(*a, *b))
                };
                a.aggregates.len() == b.aggregates.len()
                    && a.group.len() == b.group.len()
                    && a.after.len() == b.after.len()
                    && a.aggregates.iter().zip(&b.aggregates).all(|(a, b)| {
                        a.kind == b.kind
                            && renaming.variable(a.output, b.output)
                            && renaming.variable(a.input, b.input)
                            && lists(&mut renaming, &a.distinct, &b.distinct)
                    })
                    && a.after.iter().zip(&b.after).all(|((v, a), (w, b))| {
                        renaming.variable(*v, *w) && renaming.expression(a, b)
                    })
            }
            _ => false,
        };
        aggregates
            && self.bodies(
                &rule.body,
                &mut other.body.iter().collect::<Vec<_>>(),
                &renaming,
            )
    }

    /// Whether the first condition has a counterpart, and the rest has, too.
    fn bodies(&mut self, body: &[Literal], other: &mut Vec<&Literal>, renaming: &Renaming) -> bool {
        let Some((literal, rest)) = body.split_first() else {
            return true;
        };
        for at in 0..other.len() {
            self.steps += 1;
            if self.steps > STEPS {
                return true;
            }
            for tried in self.literals(literal, other[at], renaming) {
                let taken = other.remove(at);
                let holds = self.bodies(rest, other, &tried);
                other.insert(at, taken);
                if holds {
                    return true;
                }
            }
        }
        false
    }

    /// The renamings under which the exchange turns a condition into another.
    fn literals(&self, literal: &Literal, other: &Literal, renaming: &Renaming) -> Vec<Renaming> {
        let mut copy = renaming.clone();
        let holds = match (literal, other) {
            (Literal::Positive(a), Literal::Positive(b))
            | (Literal::Negative(a), Literal::Negative(b)) => {
                return self.atoms(a, b, renaming);
            }
            (
                Literal::Assign {
                    variable: v,
                    value: a,
                    ..
                },
                Literal::Assign {
                    variable: w,
                    value: b,
                    ..
                },
            ) => copy.variable(*v, *w) && copy.expression(a, b),
            (Literal::Test { value: a, .. }, Literal::Test { value: b, .. }) => {
                copy.expression(a, b)
            }
            (
                Literal::Compare {
                    op, left, right, ..
                },
                Literal::Compare {
                    op: op_b,
                    left: l,
                    right: r,
                    ..
                },
            ) => copy.either([
                &|renaming| {
                    op == op_b && renaming.expression(left, l) && renaming.expression(right, r)
                },
                &|renaming| {
                    *op == op_b.turned()
                        && renaming.expression(left, r)
                        && renaming.expression(right, l)
                },
            ]),
            _ => false,
        };
        if holds { vec![copy] } else { Vec::new() }
    }

    fn atoms(&self, a: &Atom, b: &Atom, renaming: &Renaming) -> Vec<Renaming> {
        let same: Vec<usize> = (0..a.args.len()).collect();
        let images: Vec<Image> = match self.sides.other.get(&a.predicate) {
            // That a contact has a side says nothing about which.
            Some(other) if a.args.last() == Some(&Operand::Any) => {
                vec![(*other, same.clone()), (a.predicate, same)]
            }
            Some(other) => vec![(*other, same)],
            None if self.plain.contains_key(&a.predicate) => self.images[&a.predicate].clone(),
            None => vec![(a.predicate, same)],
        };
        let mut found = Vec::new();
        for (image, places) in images {
            let mut copy = renaming.clone();
            if image == b.predicate
                && a.args.len() == b.args.len()
                && a.args
                    .iter()
                    .zip(&places)
                    .all(|(arg, place)| copy.operand(arg, &b.args[*place]))
            {
                found.push(copy);
            }
        }
        found
    }

    /// The warning at the rule that makes the difference, for a predicate that the exchange
    /// changes.
    fn innermost(&mut self, predicate: PredicateId) -> Option<Diagnostic> {
        let (mut at, mut seen) = (predicate, BTreeSet::new());
        let plain = self.plain;
        while seen.insert(at) {
            let atoms = plain[&at]
                .iter()
                .flat_map(|rule| &rule.body)
                .filter_map(Literal::atom);
            let mut below = atoms
                .map(|atom| atom.predicate)
                .filter(|p| plain.contains_key(p) && !seen.contains(p));
            match below.find(|p| self.images[p].is_empty()) {
                Some(next) => at = next,
                None => break,
            }
        }
        let itself: Vec<usize> = (0..self.read[&at].len()).collect();
        let rules = &plain[&at];
        let lonely = |exchange: &mut Self, rule: &&Plain<'a>| {
            !rules
                .iter()
                .any(|other| exchange.same(rule, other, &itself))
        };
        let rule = rules
            .iter()
            .find(|rule| lonely(self, rule))
            .or(rules.first())?;
        let tells_apart = |atom: &&Atom| match self.sides.other.contains_key(&atom.predicate) {
            true => atom.args.last() != Some(&Operand::Any),
            false => !self.is_alike(atom.predicate),
        };
        let atom = rule
            .body
            .iter()
            .filter_map(Literal::atom)
            .filter(tells_apart)
            .min_by_key(|atom| atom.span.start);
        let property = atom
            .and_then(|atom| self.side_below(atom.predicate))
            .unwrap_or(SIDES[0][0]);
        let help = match SIDES[0].contains(&property) {
            true => "use `contact(?c, ?a, ?b)`, in which each side comes first once",
            false => "use `self_contact(?c, ?a, ?b)`, in which each link comes first once",
        };
        let span = atom.map_or(&rule.rule.head.span, |atom| &atom.span).clone();
        Some(warning(property, help).at(&rule.rule.origin.source, span))
    }

    /// The first property of a side that a predicate reads, directly or indirectly.
    fn side_below(&self, predicate: PredicateId) -> Option<&'static str> {
        let (mut waiting, mut seen) = (vec![predicate], BTreeSet::new());
        while let Some(predicate) = waiting.pop() {
            if !seen.insert(predicate) {
                continue;
            }
            if self.sides.other.contains_key(&predicate) {
                return self.sides.names.get(&predicate).copied();
            }
            let atoms = self
                .plain
                .get(&predicate)
                .into_iter()
                .flatten()
                .flat_map(|rule| &rule.body);
            waiting.extend(atoms.filter_map(Literal::atom).map(|atom| atom.predicate));
        }
        None
    }
}
