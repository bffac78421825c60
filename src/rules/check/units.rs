//! Checks the units of values in rules, based on the vocabulary: a length can't be compared with a
//! mass.

use std::collections::{BTreeSet, HashMap};

use crate::model::expression::Expr;
use crate::model::program::{Atom, Literal, Operand, PredicateId, Predicates, Rule};
use crate::syntax::Comparison;
use crate::temporal::{CheckedFormula, Quantity};
use actcheck_base::{Diagnostic, Diagnostics, Span, Term, Terms};
use actcheck_ontology::Vocabulary;

/// Exponents of metre, kilogram, second and radian.
type Dimension = [i8; 4];

/// The unit of a value; `None` if it is unknown, as for constants.
type Unit = Option<Dimension>;

const NONE: Dimension = [0; 4];
const RADIAN: Dimension = [0, 0, 0, 1];

/// Largest angle in the vocabulary. Unit: radians.
const FULL_TURN_RAD: f64 = std::f64::consts::TAU;

/// Passes over the rules: units propagate through at least this many predicates in a row.
const PASSES: usize = 4;

/// Parses a unit of the vocabulary: symbols and `/`, for example `m/s`. Returns `None` if a symbol
/// is unknown.
fn dimension(text: &str) -> Unit {
    let (above, below) = text.split_once('/').unwrap_or((text, "1"));
    let [above, below] = [above, below].map(|part| {
        Some(match part.trim() {
            "1" => NONE,
            "m" => [1, 0, 0, 0],
            "m2" | "m²" => [2, 0, 0, 0],
            "kg" => [0, 1, 0, 0],
            "s" => [0, 0, 1, 0],
            "s2" | "s²" => [0, 0, 2, 0],
            "rad" => RADIAN,
            "N" => [1, 1, -2, 0],
            "Nm" | "N·m" | "J" => [2, 1, -2, 0],
            _ => return None,
        })
    });
    Some(combine(above?, below?, -1))
}

fn combine(a: Dimension, b: Dimension, sign: i8) -> Dimension {
    std::array::from_fn(|idx| a[idx].saturating_add(b[idx].saturating_mul(sign)))
}

/// Dimensions with a name of their own.
const NAMED: [(&str, Dimension); 3] = [
    ("N", [1, 1, -2, 0]),
    ("N·m", [2, 1, -2, 0]),
    ("W", [2, 1, -3, 0]),
];

/// Formats a dimension.
fn shown(dimension: Dimension) -> String {
    if let Some((name, _)) = NAMED.iter().find(|(_, named)| *named == dimension) {
        return (*name).to_owned();
    }
    let part = |wanted: fn(i8) -> bool| -> String {
        let symbols = ["m", "kg", "s", "rad"]
            .into_iter()
            .zip(dimension)
            .filter(|(_, power)| wanted(*power));
        let power = |power: i8| {
            if power.abs() == 1 {
                String::new()
            } else {
                power.abs().to_string()
            }
        };
        symbols
            .map(|(symbol, p)| format!("{symbol}{}", power(p)))
            .collect::<Vec<_>>()
            .join("·")
    };
    match (part(|power| power > 0), part(|power| power < 0)) {
        (above, below) if above.is_empty() && below.is_empty() => "a plain number".to_owned(),
        (above, below) if below.is_empty() => above,
        (above, below) if above.is_empty() => format!("1/{below}"),
        (above, below) => format!("{above}/{below}"),
    }
}

/// Checks the units in the rules of a book.
pub(crate) struct Units<'a> {
    predicates: &'a Predicates,
    vocabulary: &'a Vocabulary,
    terms: &'a Terms,
    /// Known units of the columns of derived predicates.
    columns: HashMap<(PredicateId, usize), Unit>,
}

impl<'a> Units<'a> {
    pub(crate) fn new(
        predicates: &'a Predicates,
        vocabulary: &'a Vocabulary,
        terms: &'a Terms,
    ) -> Self {
        Self {
            predicates,
            vocabulary,
            terms,
            columns: HashMap::new(),
        }
    }

    /// Infers the units of the rules' head predicates. ([`Units::check`] reports the errors.)
    pub(crate) fn learn(&mut self, rules: &[Rule]) {
        for _ in 0..PASSES {
            for rule in rules {
                let units = self.rule(rule, &mut Diagnostics::new());
                for (column, arg) in rule.head.args.iter().enumerate() {
                    let unit = match arg {
                        Operand::Variable(variable) => units[*variable],
                        _ => None,
                    };
                    // If rules disagree, the unit is unknown.
                    let known = self
                        .columns
                        .entry((rule.head.predicate, column))
                        .or_insert(unit);
                    if unit.is_some() && *known != unit {
                        *known = known.xor(unit);
                    }
                }
            }
        }
    }

    /// Reports `R042` if units don't match.
    pub(crate) fn check(&self, rules: &[Rule], diagnostics: &mut Diagnostics) {
        for rule in rules {
            self.rule(rule, diagnostics);
        }
    }

    /// Reports `R042` if the margin is not in the property's unit.
    pub(crate) fn check_margin(
        &self,
        rules: &[Rule],
        margin: PredicateId,
        unit: &str,
        diagnostics: &mut Diagnostics,
    ) {
        let (Some(Some(found)), Some(wanted)) = (self.columns.get(&(margin, 0)), dimension(unit))
        else {
            return;
        };
        let rule = rules.iter().find(|rule| rule.head.predicate == margin);
        if let Some(rule) = rule.filter(|_| *found != wanted) {
            let message = format!(
                "the margin is in {}, but the property's unit is {}",
                shown(*found),
                shown(wanted)
            );
            let help = match shown(*found) {
                unit if found.iter().any(|power| *power != 0) => {
                    format!(
                        "write `act:unit \"{unit}\"` in the property's entry of the ontology, or convert the margin"
                    )
                }
                _ => "change `act:unit` in the property's entry of the ontology, or convert the margin".to_owned(),
            };
            diagnostics.push(
                Diagnostic::error("R042", message)
                    .at(&rule.origin.source, rule.head.span.clone())
                    .help(help),
            );
        }
    }

    /// Returns the unit of a column of an atom.
    fn column(&self, atom: &Atom, column: usize) -> Unit {
        let predicate = self.predicates.get(atom.predicate);
        match predicate.property {
            Some(property) if column + 1 == predicate.width => {
                let term = self
                    .vocabulary
                    .terms
                    .get(self.terms.term(property).as_iri()?)?;
                dimension(term.unit.as_deref()?)
            }
            _ => self
                .columns
                .get(&(atom.predicate, column))
                .copied()
                .flatten(),
        }
    }

    /// Infers the units of a rule's variables and reports mismatches.
    fn rule(&self, rule: &Rule, diagnostics: &mut Diagnostics) -> Vec<Unit> {
        let units = vec![None; rule.variables.len()];
        let mut seen = Seen {
            rule,
            vocabulary: self.vocabulary,
            units,
            of_properties: BTreeSet::new(),
            diagnostics,
        };
        for literal in &rule.body {
            if let Literal::Positive(atom) = literal {
                let property = self.predicates.get(atom.predicate).property;
                for (column, arg) in atom.args.iter().enumerate() {
                    if let Operand::Variable(variable) = arg {
                        if property.is_some() && column + 1 == atom.args.len() {
                            seen.of_properties.insert(*variable);
                        }
                        seen.both(*variable, self.column(atom, column), &atom.span);
                    }
                }
            }
        }
        for literal in &rule.body {
            match literal {
                Literal::Assign {
                    variable,
                    value,
                    span,
                } => {
                    let unit = seen.expression(value, span);
                    seen.both(*variable, unit, span);
                }
                Literal::Compare {
                    op,
                    left,
                    right,
                    span,
                } => {
                    let (left, right) = (seen.expression(left, span), seen.expression(right, span));
                    let word = if *op == Comparison::Equal {
                        "equates"
                    } else {
                        "compares"
                    };
                    seen.alike(left, right, word, span);
                }
                Literal::Test { value, span } => {
                    seen.expression(value, span);
                }
                _ => {}
            }
        }
        for literal in &rule.body {
            if let Literal::Compare {
                op,
                left,
                right,
                span,
            } = literal
            {
                seen.degrees(left, right, span);
                seen.degrees(right, left, span);
                if *op != Comparison::Unequal {
                    seen.text(left, right, span);
                    seen.text(right, left, span);
                }
            }
        }
        for aggregate in rule
            .aggregation
            .iter()
            .flat_map(|aggregation| &aggregation.aggregates)
        {
            use crate::model::program::AggregateKind::Count;
            seen.units[aggregate.output] = if aggregate.kind == Count {
                None
            } else {
                seen.units[aggregate.input]
            };
        }
        for (variable, value) in rule
            .aggregation
            .iter()
            .flat_map(|aggregation| &aggregation.after)
        {
            let unit = seen.expression(value, &rule.head.span);
            seen.units[*variable] = unit;
        }
        seen.units
    }
}

/// The units inferred so far for one rule.
struct Seen<'a> {
    rule: &'a Rule,
    vocabulary: &'a Vocabulary,
    units: Vec<Unit>,
    /// Variables that are the value of a property of the vocabulary.
    of_properties: BTreeSet<usize>,
    diagnostics: &'a mut Diagnostics,
}

impl Seen<'_> {
    fn fault(&mut self, message: String, span: &Span) {
        let help = "units of properties are declared in ontology/world.ttl; a number in the rule text fits every unit";
        let fault = Diagnostic::error("R042", message)
            .at(&self.rule.origin.source, span.clone())
            .help(help);
        self.diagnostics.push(fault);
    }

    /// Reports `R043` for a number with a unit that is compared with a text. `Ranges` reports
    /// values of properties.
    fn text(&mut self, number: &Expr, text: &Expr, span: &Span) {
        let (Expr::Constant(Term::String(text)), Some(unit)) = (text, self.unit_of(number, span))
        else {
            return;
        };
        let is_of_property =
            matches!(number, Expr::Variable(variable) if self.of_properties.contains(variable));
        if is_of_property {
            return;
        }
        let of = if unit == NONE {
            String::new()
        } else {
            format!(" in {}", shown(unit))
        };
        let message =
            format!("this can never hold: a number{of} is compared with the text `\"{text}\"`");
        let help = match text.parse::<f64>() {
            Ok(_) => format!("write the number without quotes: `{text}`"),
            Err(_) => "compare it with a number".to_owned(),
        };
        self.diagnostics.push(
            Diagnostic::error("R043", message)
                .at(&self.rule.origin.source, span.clone())
                .help(help),
        );
    }

    /// The unit of an expression, whose mismatches are reported elsewhere.
    fn unit_of(&self, expr: &Expr, span: &Span) -> Unit {
        let (units, of_properties, mut ignored) =
            (self.units.clone(), BTreeSet::new(), Diagnostics::new());
        let vocabulary = self.vocabulary;
        Seen {
            rule: self.rule,
            vocabulary,
            units,
            of_properties,
            diagnostics: &mut ignored,
        }
        .expression(expr, span)
    }

    /// Warns (R045) of an angle that is compared with a number beyond a full turn, which is
    /// probably in degrees.
    fn degrees(&mut self, angle: &Expr, number: &Expr, span: &Span) {
        let unit = self.unit_of(angle, span);
        let Expr::Constant(term) = number else { return };
        let Some(number) = term
            .number()
            .filter(|number| unit == Some(RADIAN) && number.abs() > FULL_TURN_RAD)
        else {
            return;
        };
        self.beyond_full_turn(number, span);
    }

    fn beyond_full_turn(&mut self, number: f64, span: &Span) {
        let message =
            format!("an angle in rad is compared with {number}, which is more than a full turn");
        let help = format!("{number} degrees are {:.4} rad", number.to_radians());
        self.diagnostics.push(
            Diagnostic::warning("R045", message)
                .at(&self.rule.origin.source, span.clone())
                .help(help),
        );
    }

    /// Records the unit of a variable and reports a conflict with its known unit.
    fn both(&mut self, variable: usize, unit: Unit, span: &Span) {
        match (self.units[variable], unit) {
            (Some(known), Some(unit)) if known != unit => {
                let name = &self.rule.variables[variable];
                self.fault(
                    format!("`?{name}` is in {} and in {}", shown(known), shown(unit)),
                    span,
                );
            }
            (None, unit) => self.units[variable] = unit,
            _ => {}
        }
    }

    fn alike(&mut self, a: Unit, b: Unit, word: &str, span: &Span) -> Unit {
        if let (Some(a), Some(b)) = (a, b)
            && a != b
        {
            let between = if word == "adds" { "and" } else { "with" };
            self.fault(
                format!("the rule {word} {} {between} {}", shown(a), shown(b)),
                span,
            );
        }
        a.or(b)
    }

    fn expression(&mut self, expr: &Expr, span: &Span) -> Unit {
        match expr {
            Expr::Variable(variable) => self.units[*variable],
            Expr::Call(builtin, args) => {
                let units: Vec<Unit> = args.iter().map(|arg| self.expression(arg, span)).collect();
                self.call(builtin.name, &units, span)
            }
            Expr::Format(parts) => {
                parts.iter().for_each(|part| {
                    self.expression(part, span);
                });
                None
            }
            Expr::Timed(timed) => {
                let mut units = Vec::new();
                timed
                    .formulas()
                    .iter()
                    .for_each(|formula| self.formula(formula, &mut units));
                // Robustness has a unit if all comparisons have the same.
                units
                    .first()
                    .copied()
                    .flatten()
                    .filter(|unit| units.iter().all(|other| *other == Some(*unit)))
            }
            Expr::Constant(_) | Expr::Matches(..) => None,
        }
    }

    /// Checks the comparisons of a formula and appends the unit of each.
    fn formula(&mut self, formula: &CheckedFormula, found: &mut Vec<Unit>) {
        match formula {
            CheckedFormula::Compare {
                left, right, span, ..
            } => {
                let (a, b) = (self.quantity(left, span), self.quantity(right, span));
                found.push(self.alike(a, b, "compares", span));
                for (unit, other) in [(a, right), (b, left)] {
                    if let (Some(RADIAN), Quantity::Number(number)) = (unit, other)
                        && number.abs() > FULL_TURN_RAD
                    {
                        self.beyond_full_turn(*number, span);
                    }
                }
            }
            CheckedFormula::Truth { .. } => {}
            CheckedFormula::Not(inner) | CheckedFormula::Consequent { formula: inner, .. } => {
                self.formula(inner, found)
            }
            CheckedFormula::And(parts)
            | CheckedFormula::Or(parts)
            | CheckedFormula::Temporal { parts, .. } => {
                parts.iter().for_each(|part| self.formula(part, found));
            }
        }
    }

    fn quantity(&mut self, quantity: &Quantity, span: &Span) -> Unit {
        match quantity {
            Quantity::Number(_) => None,
            Quantity::Variable(variable) => self.units[*variable],
            Quantity::Recorded { iri, .. } => {
                dimension(self.vocabulary.terms.get(iri.as_str())?.unit.as_deref()?)
            }
            Quantity::Call(builtin, args) => {
                let units: Vec<Unit> = args.iter().map(|arg| self.quantity(arg, span)).collect();
                self.call(builtin.name, &units, span)
            }
        }
    }

    fn call(&mut self, name: &str, units: &[Unit], span: &Span) -> Unit {
        let first = units.first().copied().flatten();
        match name {
            "SUM" | "MINUS" | "MIN" | "MAX" => {
                let word = if name == "SUM" || name == "MINUS" {
                    "adds"
                } else {
                    "compares"
                };
                units
                    .iter()
                    .fold(None, |known, unit| self.alike(known, *unit, word, span))
            }
            "PRODUCT" => units
                .iter()
                .copied()
                .reduce(|a, b| Some(combine(a?, b?, 1)))
                .flatten(),
            "DIVISION" => Some(combine(first?, units.get(1).copied().flatten()?, -1)),
            "SQRT" => first
                .filter(|unit| unit.iter().all(|power| power % 2 == 0))
                .map(|unit| unit.map(|p| p / 2)),
            "ABS" | "ROUND" | "FLOOR" | "CEIL" | "INVERSE" | "NEGATIVE" | "DOUBLE"
            | "geo3d:distance" | "geo3d:distance2d" | "geo3d:norm" | "geo3d:boxDistance" => first,
            "SIN" | "COS" | "TAN" => {
                if let Some(unit) = first.filter(|unit| *unit != RADIAN && *unit != NONE) {
                    self.fault(
                        format!("{name} takes an angle in rad, not {}", shown(unit)),
                        span,
                    );
                }
                Some(NONE)
            }
            "ASIN"
            | "ACOS"
            | "ATAN2"
            | "geo3d:angle"
            | "geo3d:angleDifference"
            | "geo3d:rotation"
            | "geo3d:yaw"
            | "geo3d:tilt" => Some(RADIAN),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A force was called `m·kg/s2`.
    #[test]
    fn derived_units_have_their_names() {
        for name in ["N", "N·m", "m", "m/s", "kg"] {
            assert_eq!(dimension(name).map(shown).as_deref(), Some(name));
        }
        assert_eq!(shown(NONE), "a plain number");
    }
}
