//! Goals: the statements that explanations are requested for, such as `p(1, _)`.

use std::collections::BTreeSet;

use crate::check::checking::counted;
use crate::explain::model::{Explanation, UnknownTerm};
use crate::explain::proof::Prover;
use crate::explain::search::ProofContext;
use crate::model::given::GIVEN;
use crate::model::program::{PredicateId, Predicates, Scope};
use crate::model::universe::Universe;
use crate::syntax::{AtomSyntax, ExpressionKind, Statement, parse};
use actcheck_base::{
    Diagnostic, Diagnostics, RuleFault, Source, Span, Term, TermId, did_you_mean, nearest,
};

/// Maximum number of proofs shown.
pub(super) const PROOFS_SHOWN: usize = 3;
/// Maximum number of terms compared with an unknown one.
const TERMS_COMPARED: usize = 100_000;
/// The remedy for a goal that is not one statement.
const FORM: &str = "write one statement with constants and `_`, such as `p(1, _)`";

/// A predicate with its arguments; `None` matches any value.
#[derive(Debug)]
pub(super) struct Goal {
    source: Source,
    predicate: String,
    name_span: Span,
    span: Span,
    args: Vec<GoalArgument>,
}

impl Goal {
    /// Parses a statement such as `p(1, _)`. A variable matches any value, like `_`.
    ///
    /// # Errors
    /// `R092`: the text is not one statement, an argument is neither a constant nor `_`, or a
    /// variable is repeated.
    pub(super) fn parse(
        statement: &str,
        prefixes: &[(String, String)],
    ) -> Result<Self, Diagnostics> {
        let prefixes: String = prefixes
            .iter()
            .map(|(prefix, iri)| format!("@prefix {prefix}: <{iri}> .\n"))
            .collect();
        let source = Source::new("goal", statement.trim().trim_end_matches('.').trim_end());
        let (syntax, faults) = parse(&Source::new("goal", format!("{prefixes}{} .", source.text)));
        // Places in the parsed text, which begins with the prefixes, as places in the goal.
        let place = |span: &Span| {
            let of_goal = |at: usize| at.saturating_sub(prefixes.len()).min(source.text.len());
            of_goal(span.start)..of_goal(span.end)
        };
        let fault = |message: String, span: &Span| {
            Diagnostics::from(
                Diagnostic::error("R092", message)
                    .at(&source, place(span))
                    .help(FORM),
            )
        };
        if let Some(found) = faults.iter().next() {
            return Err(fault(
                found.message.clone(),
                &found.span.clone().unwrap_or_default(),
            ));
        }
        let end = prefixes.len()..prefixes.len() + source.text.len();
        let head = match syntax.statements.as_slice() {
            [Statement::Rule(rule)] if rule.body.is_empty() => match rule.heads.as_slice() {
                [head] => head,
                _ => {
                    return Err(fault(
                        "a goal is one statement, not several".to_owned(),
                        &end,
                    ));
                }
            },
            [_] => {
                return Err(fault(
                    "a goal is a statement without conditions".to_owned(),
                    &end,
                ));
            }
            _ => return Err(fault("a goal is one statement".to_owned(), &end)),
        };
        let args = arguments(head).map_err(|(message, span)| fault(message, &span))?;
        let args = args
            .into_iter()
            .map(|(term, span)| (term, place(&span)))
            .collect();
        let (name_span, span) = (place(&head.name_span), place(&head.span));
        Ok(Self {
            predicate: head.predicate.clone(),
            name_span,
            span,
            args,
            source,
        })
    }

    /// Returns the predicate in the first of the scopes that has it.
    ///
    /// # Errors
    /// `R092`: no scope has the predicate, or it has another number of arguments.
    pub(super) fn predicate(
        &self,
        predicates: &Predicates,
        scopes: &[Scope],
    ) -> Result<PredicateId, Diagnostics> {
        let name = &self.predicate;
        let fault = |message: String, span: &Span, help: String| {
            Diagnostics::from(
                Diagnostic::error("R092", message)
                    .at(&self.source, span.clone())
                    .help(help),
            )
        };
        let found = scopes
            .iter()
            .find_map(|scope| predicates.find(*scope, name, None));
        let Some(found) = found.filter(|id| !predicates.get(*id).given) else {
            if GIVEN.iter().any(|(given, ..)| given == name) && *scopes != [0] {
                let message =
                    format!("`{name}` is given: only derived statements have an explanation");
                return Err(fault(
                    message,
                    &self.name_span,
                    "name a predicate of the rules".to_owned(),
                ));
            }
            let known = predicates
                .list
                .iter()
                .filter(|p| scopes.contains(&p.scope) && !p.given && !p.name.contains('~'));
            let help = did_you_mean(name, known.map(|predicate| predicate.name.as_str()));
            return Err(fault(
                format!("the program has no predicate `{name}`"),
                &self.name_span,
                help,
            ));
        };
        let arity = predicates.get(found).arity;
        if arity != self.args.len() {
            let message = format!("`{name}` has {}, not {}", counted(arity), self.args.len());
            let args: Vec<&str> = vec!["_"; arity];
            return Err(fault(
                message,
                &self.span,
                format!("write `{name}({})`", args.join(", ")),
            ));
        }
        Ok(found)
    }

    /// Returns the ids of the arguments, and the constants that had none. These get an id, so that
    /// the closest attempt can name them.
    pub(super) fn known(
        &self,
        universe: &mut Universe<'_>,
    ) -> (Vec<Option<TermId>>, Vec<UnknownTerm>) {
        let missing = self
            .args
            .iter()
            .filter_map(|(term, span)| Some((term.as_ref()?, span)));
        let unknown = missing
            .filter(|(term, _)| universe.id(term).is_none())
            .map(|(term, span)| UnknownTerm {
                text: self
                    .source
                    .text
                    .get(span.clone())
                    .unwrap_or_default()
                    .to_owned(),
                span: span.clone(),
                similar: similar(term, universe),
            })
            .collect();
        let ids = self
            .args
            .iter()
            .map(|(term, _)| term.as_ref().map(|term| universe.intern(term.clone())))
            .collect();
        (ids, unknown)
    }
}

/// A constant, or `None` for any value; and its place.
type GoalArgument = (Option<Term>, Span);

/// Returns the arguments of a goal, or the reason why one is invalid, with its place.
fn arguments(head: &AtomSyntax) -> Result<Vec<GoalArgument>, (String, Span)> {
    let mut variables = BTreeSet::new();
    let mut args = Vec::new();
    for arg in &head.args {
        let term = match &arg.kind {
            ExpressionKind::Constant(term) => Some(term.clone()),
            ExpressionKind::Anonymous => None,
            ExpressionKind::Variable(name) if variables.insert(name) => None,
            ExpressionKind::Variable(name) => {
                let message =
                    format!("`?{name}` occurs twice, but a variable of a goal matches any value");
                return Err((message, arg.span.clone()));
            }
            _ => {
                return Err((
                    "a statement may contain only constants and `_`".to_owned(),
                    arg.span.clone(),
                ));
            }
        };
        args.push((term, arg.span.clone()));
    }
    Ok(args)
}

/// Returns a known term with a similar name.
fn similar(term: &Term, universe: &Universe<'_>) -> Option<String> {
    let name = |term: &Term| match term {
        // A bare name.
        Term::Iri(iri) if !iri.contains(':') => Some(iri.to_string()),
        Term::Iri(_) | Term::String(_) => Some(term.to_string()),
        _ => None,
    };
    let wanted = name(term)?;
    let known: Vec<String> = universe
        .terms()
        .take(TERMS_COMPARED)
        .filter_map(name)
        .collect();
    nearest(&wanted, known.iter().map(String::as_str)).map(str::to_owned)
}

/// Returns the fault of an invalid goal, with its place.
pub(super) fn invalid_goal(faults: &Diagnostics) -> RuleFault {
    let text = faults.iter().next().map(|fault| match fault.place() {
        Some(place) => format!("{place}: {fault}"),
        None => fault.to_string(),
    });
    RuleFault::Value(text.unwrap_or_default())
}

/// Returns the remark that a search for the closest rule was stopped.
pub(super) fn stopped_early(context: &ProofContext<'_>) -> Option<String> {
    context
        .exhausted
        .get()
        .then(|| "the search stopped at its limit: another rule may be closer".to_owned())
}

/// Explains why the tuples that match a goal hold, or why there are none.
pub(super) fn goal_explained(
    statement: &str,
    predicate: PredicateId,
    known: &[Option<TermId>],
    context: &ProofContext<'_>,
) -> Explanation {
    let matches = |row: &&[TermId]| {
        known
            .iter()
            .zip(*row)
            .all(|(known, value)| known.is_none_or(|id| id == *value))
    };
    let mut prover = Prover::new(context);
    let proofs: Vec<_> = context
        .rows(predicate)
        .filter(matches)
        .take(PROOFS_SHOWN)
        .map(|row| prover.prove(predicate, row, 0))
        .collect();
    let mut notes = Vec::new();
    let mut miss = None;
    if proofs.is_empty() {
        miss = context.miss(predicate, known, 0);
        notes.extend(stopped_early(context));
        if miss.is_none() && notes.is_empty() {
            miss = Some(context.underivable(predicate, known));
        }
    }
    let title = statement.trim().to_owned();
    Explanation {
        title,
        findings: None,
        proofs,
        miss,
        unknown: Vec::new(),
        notes,
        deciding: Vec::new(),
    }
}
