//! Goals: the statements that explanations are requested for, such as `p(1, _)`.

use crate::check::checking::counted;
use crate::explain::model::Explanation;
use crate::explain::proof::Prover;
use crate::explain::search::ProofContext;
use crate::model::given::GIVEN;
use crate::model::program::{PredicateId, Predicates, Scope};
use crate::model::universe::Universe;
use crate::syntax::{ExpressionKind, Statement, parse};
use actcheck_base::{RuleFault, Source, Term, TermId};

/// Maximum number of proofs shown.
pub(super) const PROOFS_SHOWN: usize = 3;

/// A predicate with its arguments; `None` matches any value.
#[derive(Debug)]
pub(super) struct Goal {
    predicate: String,
    args: Vec<Option<Term>>,
}

impl Goal {
    /// Parses a statement such as `p(1, _)`. Variables match any value, like `_`.
    ///
    /// # Errors
    /// The text is not one statement, or an argument is neither a constant nor `_`.
    pub(super) fn parse(statement: &str, prefixes: &[(String, String)]) -> Result<Self, RuleFault> {
        let prefixes: String = prefixes.iter().map(|(prefix, iri)| format!("@prefix {prefix}: <{iri}> .\n")).collect();
        let statement = statement.trim().trim_end_matches('.');
        let (syntax, faults) = parse(&Source::new("statement", format!("{prefixes}{statement} .")));
        if let Some(fault) = faults.iter().next() {
            return Err(RuleFault::Value(fault.message.clone()));
        }
        let rule = syntax.statements.iter().find_map(|statement| match statement {
            Statement::Rule(rule) if rule.body.is_empty() => rule.heads.first(),
            _ => None,
        });
        let head = rule.ok_or_else(|| RuleFault::Value("write a statement such as `p(1, _)`".to_owned()))?;
        let args = head.args.iter().map(|arg| match &arg.kind {
            ExpressionKind::Constant(term) => Ok(Some(term.clone())),
            ExpressionKind::Anonymous | ExpressionKind::Variable(_) => Ok(None),
            _ => Err(RuleFault::Value("a statement may contain only constants and `_`".to_owned())),
        });
        Ok(Self { predicate: head.predicate.clone(), args: args.collect::<Result<_, _>>()? })
    }

    /// Returns the predicate in the first of the scopes that has it.
    ///
    /// # Errors
    /// No scope has the predicate, or it has another number of arguments.
    pub(super) fn predicate(&self, predicates: &Predicates, scopes: &[Scope]) -> Result<PredicateId, RuleFault> {
        let name = &self.predicate;
        let found = scopes.iter().find_map(|scope| predicates.find(*scope, name, None));
        let found = found.filter(|id| !predicates.get(*id).given).ok_or_else(|| {
            RuleFault::Value(match GIVEN.iter().any(|(given, ..)| given == name) && *scopes != [0] {
                true => format!("`{name}` is given: only derived statements have an explanation"),
                false => format!("the program has no predicate `{name}`"),
            })
        })?;
        let arity = predicates.get(found).arity;
        if arity != self.args.len() {
            return Err(RuleFault::Value(format!("`{name}` has {}, not {}", counted(arity), self.args.len())));
        }
        Ok(found)
    }

    /// Returns the ids of the arguments. New terms get an id, so that the closest attempt can name them.
    pub(super) fn known(&self, universe: &mut Universe<'_>) -> Vec<Option<TermId>> {
        self.args.iter().map(|term| term.as_ref().map(|term| universe.intern(term.clone()))).collect()
    }
}

/// Explains why the tuples that match a goal hold, or why there are none.
pub(super) fn goal_explained(
    statement: &str,
    predicate: PredicateId,
    known: &[Option<TermId>],
    context: &ProofContext<'_>,
) -> Explanation {
    let matches = |row: &&[TermId]| known.iter().zip(*row).all(|(known, value)| known.is_none_or(|id| id == *value));
    let mut prover = Prover::new(context);
    let proofs: Vec<_> =
        context.rows(predicate).filter(matches).take(PROOFS_SHOWN).map(|row| prover.prove(predicate, row, 0)).collect();
    let miss = if proofs.is_empty() { context.miss(predicate, known, 0) } else { None };
    let notes = match proofs.is_empty() && miss.is_none() {
        true => vec!["it is not a fact and no rule derives it".to_owned()],
        false => Vec::new(),
    };
    Explanation { title: statement.trim().to_owned(), findings: None, proofs, miss, notes }
}
