//! Reports conditions that no fact can satisfy, because the ontology declares another type for the
//! property's values, or because they contradict each other.

use std::collections::{BTreeMap, BTreeSet};

use crate::check::formulas::formulas;
use crate::check::left::Left;
use crate::model::expression::{Expr, Variable};
use crate::model::program::{Atom, Literal, Operand, Predicates, Rule};
use crate::syntax::Comparison;
use crate::temporal::CheckedFormula;
use actcheck_base::{Diagnostic, Diagnostics, Span, Term, TermId, Terms, names};
use actcheck_ontology::Ontology;

/// The types of property values, as declared by the ontology.
pub(crate) struct Ranges {
    datatypes: BTreeMap<String, String>,
    /// Object properties: their values are individuals.
    of_things: BTreeSet<String>,
}

/// Literal types used in facts: a constant of another type never equals a fact's value.
const TYPES: [&str; 4] = ["double", "integer", "boolean", "string"];

impl Ranges {
    pub(crate) fn new(ontology: &Ontology) -> Self {
        let (range, kind) = (
            format!("{}range", names::RDFS),
            format!("{}type", names::RDF),
        );
        let things = format!("{}ObjectProperty", names::OWL);
        let mut ranges = Self {
            datatypes: BTreeMap::new(),
            of_things: BTreeSet::new(),
        };
        for [s, p, o] in &ontology.triples {
            let (Some(s), Some(p), Some(o)) = (s.as_iri(), p.as_iri(), o.as_iri()) else {
                continue;
            };
            if p == range
                && o.strip_prefix(names::XSD)
                    .is_some_and(|local| TYPES.contains(&local))
            {
                ranges.datatypes.insert(s.to_owned(), o.to_owned());
            } else if p == kind && o == things {
                ranges.of_things.insert(s.to_owned());
            }
        }
        ranges
    }

    /// Reports `R043` for each condition that can't hold.
    pub(crate) fn check(
        &self,
        rules: &[Rule],
        predicates: &Predicates,
        terms: &Terms,
        diagnostics: &mut Diagnostics,
    ) {
        for rule in rules {
            // The property that each variable gets its value from, with its datatype.
            let mut typed: BTreeMap<Variable, (&str, &str)> = BTreeMap::new();
            for atom in rule.body.iter().filter_map(Literal::atom) {
                let Some(property) = self.property(atom, predicates, terms) else {
                    continue;
                };
                match (atom.args.last(), self.datatypes.get(property)) {
                    (Some(Operand::Constant(id)), datatype) => {
                        self.constant(
                            rule,
                            property,
                            datatype.map(String::as_str),
                            terms.term(*id),
                            atom,
                            diagnostics,
                        );
                    }
                    (Some(Operand::Variable(variable)), Some(datatype)) => {
                        typed.insert(*variable, (property, datatype));
                    }
                    _ => {}
                }
            }
            contradictions(rule, diagnostics);
            numbers_of_formulas(rule, &typed, diagnostics);
            opposites(rule, diagnostics);
            for literal in &rule.body {
                let Literal::Compare {
                    op,
                    left,
                    right,
                    span,
                } = literal
                else {
                    continue;
                };
                let ((Expr::Variable(variable), Expr::Constant(term))
                | (Expr::Constant(term), Expr::Variable(variable))) = (left, right)
                else {
                    continue;
                };
                let Some((property, datatype)) = typed.get(variable) else {
                    continue;
                };
                let is_other = match op {
                    Comparison::Equal => {
                        crate::model::values::datatype(term) != *datatype
                            && !same_integer(term, datatype)
                    }
                    Comparison::Unequal => false,
                    // Numbers of all types can be compared, but nothing else.
                    _ => term.number().is_some() != is_numeric(datatype),
                };
                if is_other {
                    let fault = never(property, datatype, term);
                    diagnostics.push(fault.at(&rule.origin.source, span.clone()));
                }
            }
        }
    }

    /// Returns the constant property of an atom, or `None` if its property is a variable.
    fn property<'t>(
        &self,
        atom: &Atom,
        predicates: &Predicates,
        terms: &'t Terms,
    ) -> Option<&'t str> {
        let property: TermId = predicates.get(atom.predicate).property?;
        terms.term(property).as_iri()
    }

    fn constant(
        &self,
        rule: &Rule,
        property: &str,
        datatype: Option<&str>,
        term: &Term,
        atom: &Atom,
        diagnostics: &mut Diagnostics,
    ) {
        let literal = !matches!(term, Term::Iri(_) | Term::Blank(_));
        let fault = match datatype {
            Some(datatype)
                if crate::model::values::datatype(term) != datatype
                    && !same_integer(term, datatype) =>
            {
                never(property, datatype, term)
            }
            None if literal && self.of_things.contains(property) => {
                let message = format!(
                    "this can never hold: the values of `{}` are individuals",
                    names::shorten(property)
                );
                Diagnostic::error("R043", message)
                    .help("write an individual, such as `obj:glass_1`, or a variable")
            }
            _ => return,
        };
        diagnostics.push(fault.at(&rule.origin.source, atom.span.clone()));
    }
}

/// Reports `R043` for variables that a formula compares with numbers, although their values are not
/// numbers.
fn numbers_of_formulas(
    rule: &Rule,
    typed: &BTreeMap<Variable, (&str, &str)>,
    diagnostics: &mut Diagnostics,
) {
    for formula in formulas(rule) {
        formula.visit(&mut |part| {
            let CheckedFormula::Compare { left, right, span, .. } = part else { return };
            let mut variables = Vec::new();
            [left, right].into_iter().for_each(|side| side.numbers(&mut variables));
            for variable in variables {
                let Some((property, datatype)) = typed.get(&variable).filter(|(_, of)| !is_numeric(of)) else {
                    continue;
                };
                let (property, datatype) = (names::shorten(property), names::shorten(datatype));
                let message = format!("this can never hold: the values of `{property}` are {datatype}, not numbers");
                let help = "compare the quantity with a number, or with the value of a property that has numbers";
                let fault = Diagnostic::error("R043", message).help(help);
                diagnostics.push(fault.at(&rule.origin.source, span.clone()));
            }
        });
    }
}

/// Reports `R044` for comparisons with numbers that no value of their variable satisfies together.
fn contradictions(rule: &Rule, diagnostics: &mut Diagnostics) {
    let mut left: BTreeMap<Variable, Left> = BTreeMap::new();
    for literal in &rule.body {
        let Literal::Compare {
            op,
            left: a,
            right: b,
            span,
        } = literal
        else {
            continue;
        };
        let (variable, number, op) = match (a, b) {
            (Expr::Variable(variable), Expr::Constant(term)) => (variable, term.number(), *op),
            (Expr::Constant(term), Expr::Variable(variable)) => {
                (variable, term.number(), op.turned())
            }
            _ => continue,
        };
        let Some(number) = number else { continue };
        let known = left.entry(*variable).or_default();
        known.keep(op, number);
        if known.is_empty() {
            let name = &rule.variables[*variable];
            let message = format!(
                "this can never hold: no number satisfies all comparisons of `?{name}` in this rule"
            );
            let help = "`,` means and: for or, write one rule for each case";
            diagnostics.push(
                Diagnostic::error("R044", message)
                    .at(&rule.origin.source, span.clone())
                    .help(help),
            );
            return;
        }
    }
}

/// Reports `R044` for conditions that exclude each other: comparisons of the same two variables, a
/// variable that equals two constants, and a pattern that is both required and excluded. One for
/// each rule.
fn opposites(rule: &Rule, diagnostics: &mut Diagnostics) {
    let found = compared_variables(rule)
        .or_else(|| two_constants(rule))
        .or_else(|| required_and_excluded(rule));
    if let Some(Contradiction {
        message,
        with_itself,
        span,
    }) = found
    {
        let help = if with_itself {
            "compare it with another variable or a number"
        } else {
            "`,` means and: for or, write one rule for each case"
        };
        diagnostics.push(
            Diagnostic::error("R044", message)
                .at(&rule.origin.source, span)
                .help(help),
        );
    }
}

/// Conditions that exclude each other.
struct Contradiction {
    message: String,
    /// Whether a variable is compared with itself.
    with_itself: bool,
    span: Span,
}

fn compared_variables(rule: &Rule) -> Option<Contradiction> {
    // Which of less, equal and greater are left for each pair.
    let mut left: BTreeMap<(Variable, Variable), [bool; 3]> = BTreeMap::new();
    for literal in &rule.body {
        let Literal::Compare {
            op,
            left: Expr::Variable(a),
            right: Expr::Variable(b),
            span,
        } = literal
        else {
            continue;
        };
        let (pair, op) = if a <= b {
            ((*a, *b), *op)
        } else {
            ((*b, *a), op.turned())
        };
        let allowed = match op {
            Comparison::Equal => [false, true, false],
            Comparison::Unequal => [true, false, true],
            Comparison::Less => [true, false, false],
            Comparison::LessEqual => [true, true, false],
            Comparison::Greater => [false, false, true],
            Comparison::GreaterEqual => [false, true, true],
        };
        let left = left.entry(pair).or_insert(if a == b {
            [false, true, false]
        } else {
            [true; 3]
        });
        left.iter_mut()
            .zip(allowed)
            .for_each(|(left, allowed)| *left &= allowed);
        if *left == [false; 3] {
            let [a, b] = [pair.0, pair.1].map(|variable| &rule.variables[variable]);
            let message = match a == b {
                true => format!("this can never hold: `?{a}` is compared with itself"),
                false => format!(
                    "this can never hold: the comparisons of `?{a}` with `?{b}` exclude each other"
                ),
            };
            return Some(Contradiction {
                message,
                with_itself: a == b,
                span: span.clone(),
            });
        }
    }
    None
}

fn two_constants(rule: &Rule) -> Option<Contradiction> {
    let mut equal: BTreeMap<Variable, &Term> = BTreeMap::new();
    for literal in &rule.body {
        let Literal::Compare {
            op: Comparison::Equal,
            left,
            right,
            span,
        } = literal
        else {
            continue;
        };
        let ((Expr::Variable(variable), Expr::Constant(term))
        | (Expr::Constant(term), Expr::Variable(variable))) = (left, right)
        else {
            continue;
        };
        let first = equal.entry(*variable).or_insert(term);
        if first.number().is_none() && *first != term {
            let name = &rule.variables[*variable];
            return Some(Contradiction {
                message: format!("this can never hold: `?{name}` is `{first}` and `{term}`"),
                with_itself: false,
                span: span.clone(),
            });
        }
    }
    None
}

fn required_and_excluded(rule: &Rule) -> Option<Contradiction> {
    let positive = |atom: &Atom| {
        rule.body.iter().any(|literal| match literal {
            Literal::Positive(other) => {
                other.predicate == atom.predicate && other.args == atom.args
            }
            _ => false,
        })
    };
    rule.body.iter().find_map(|literal| match literal {
        Literal::Negative(atom) if !atom.args.contains(&Operand::Any) && positive(atom) => {
            let message =
                "this can never hold: the same condition is required and, with `~`, excluded"
                    .to_owned();
            Some(Contradiction {
                message,
                with_itself: false,
                span: atom.span.clone(),
            })
        }
        _ => None,
    })
}

fn is_numeric(datatype: &str) -> bool {
    matches!(datatype.rsplit('#').next(), Some("double" | "integer"))
}

/// Returns whether an integer term matches `xsd:integer`: small integers have narrower datatypes.
fn same_integer(term: &Term, datatype: &str) -> bool {
    matches!(term, Term::Integer(_)) && datatype.ends_with("#integer")
}

fn never(property: &str, datatype: &str, term: &Term) -> Diagnostic {
    let local = names::shorten(datatype);
    let message = format!(
        "this can never hold: the values of `{}` are {local}, but `{term}` is not",
        names::shorten(property)
    );
    let help = match (datatype.rsplit('#').next(), term) {
        (Some("double"), Term::Integer(value)) => {
            format!("`=` compares terms: write `{value}.0`, or compare with `<=` and `>=`")
        }
        (Some("double" | "integer"), Term::String(text)) if text.parse::<f64>().is_ok() => {
            format!("write the number without quotes: `{text}`")
        }
        (Some("boolean"), _) => "write `true` or `false`, without quotes".to_owned(),
        (Some("string"), _) => "write it in double quotes".to_owned(),
        _ => format!("write a value of type {local}"),
    };
    Diagnostic::error("R043", message).help(help)
}
