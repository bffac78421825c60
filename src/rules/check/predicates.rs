//! Resolves the predicates of bodies: defined ones, and the given ones with their shorthands.

use crate::check::checking::{Role, counted};
use crate::check::translate::Translation;
use crate::model::given::{GIVEN, add_given, phase_of, property_place};
use crate::model::program::PredicateId;
use crate::syntax::{AtomSyntax, Expression, ExpressionKind};
use crate::temporal::{known_quantity, quantity_names};
use actcheck_base::{Term, did_you_mean, names};

impl Translation<'_, '_> {
    /// Returns the predicate of an atom and the arguments that are columns. Returns `None` if an
    /// error was reported.
    pub(super) fn predicate<'e>(
        &mut self,
        atom: &'e AtomSyntax,
        head: bool,
    ) -> Option<(PredicateId, Vec<std::borrow::Cow<'e, Expression>>)> {
        use std::borrow::Cow;
        let name = atom.predicate.as_str();
        let args: Vec<Cow<'e, Expression>> = atom.args.iter().map(Cow::Borrowed).collect();
        if self.role != Role::Standalone
            && let Some((_, form, arity)) = GIVEN.iter().find(|(given, ..)| *given == name)
        {
            if args.len() != *arity {
                let message = format!("`{name}` has {}, needs {arity}", counted(args.len()));
                self.error("R022", &atom.span, message, format!("write `{form}`"));
                return None;
            }
            if name == "course" && !self.names_quantity(&args[1]) {
                return None;
            }
            return Some(self.given(atom, args));
        }
        for scope in [self.role.scope(), 0] {
            let Some(definition) = self.checking.defined.get(&(scope, name.to_owned())) else {
                continue;
            };
            if definition.arity != args.len() {
                if !head {
                    let message = format!(
                        "`{name}` has {} here and {} in {}",
                        counted(args.len()),
                        definition.arity,
                        definition.place()
                    );
                    self.error(
                        "R022",
                        &atom.span,
                        message,
                        "use the same number everywhere, or another name",
                    );
                }
                self.faulty = true;
                return None;
            }
            return self
                .checking
                .predicates
                .find(scope, name, None)
                .map(|id| (id, args));
        }
        self.faulty = true;
        if !head {
            self.undefined(atom);
        }
        None
    }

    fn undefined(&mut self, atom: &AtomSyntax) {
        let name = atom.predicate.as_str();
        if self.role == Role::Standalone {
            // A standalone program may use a predicate without facts or rules: it is empty.
            return;
        }
        let known = self.checking.known_names(self.role);
        let help = did_you_mean(name, known.iter().map(String::as_str));
        self.error(
            "R023",
            &atom.name_span,
            format!("no rule defines `{name}`"),
            help,
        );
    }

    /// Checks that the property of `course` is a quantity of one thing. Reports an error if it is
    /// not.
    fn names_quantity(&mut self, property: &Expression) -> bool {
        let iri = match &property.kind {
            ExpressionKind::Constant(Term::Iri(iri)) => iri.to_string(),
            ExpressionKind::Global(global) => self
                .globals
                .get(global)
                .and_then(Term::as_iri)
                .unwrap_or_default()
                .to_owned(),
            _ => String::new(),
        };
        let (message, help) = match iri.strip_prefix(names::W) {
            None if !iri.is_empty() => return true,
            Some(local) => match known_quantity(local) {
                Some(1) if local != "phase" => return true,
                Some(_) => (
                    format!("`w:{local}` is not a quantity of one thing"),
                    "read it in a formula, such as `always(w:distance(?a, ?b) > 0.1)`".to_owned(),
                ),
                None => (
                    format!("unknown quantity `w:{local}`"),
                    did_you_mean(local, quantity_names()),
                ),
            },
            None => (
                "`course` needs a constant property".to_owned(),
                "write a quantity, such as `course(?o, w:z, ?t, ?z)`".to_owned(),
            ),
        };
        self.error("R052", &property.span, message, help);
        false
    }

    /// Resolves a given predicate: shorthands become `state`, a constant property becomes part of
    /// the predicate.
    fn given<'e>(
        &mut self,
        atom: &'e AtomSyntax,
        mut args: Vec<std::borrow::Cow<'e, Expression>>,
    ) -> (PredicateId, Vec<std::borrow::Cow<'e, Expression>>) {
        let mut name = atom.predicate.as_str();
        if let Some(phase) = phase_of(name) {
            let kind = ExpressionKind::Constant(Term::iri(phase));
            args.insert(
                0,
                std::borrow::Cow::Owned(Expression {
                    kind,
                    span: atom.name_span.clone(),
                }),
            );
            name = "state";
        }
        let Some(place) = property_place(name) else {
            return (add_given(&mut self.checking.predicates, name, None), args);
        };
        let property = match &args[place].kind {
            ExpressionKind::Constant(Term::Iri(iri)) => Some(iri.to_string()),
            ExpressionKind::Global(global) => self
                .globals
                .get(global)
                .and_then(Term::as_iri)
                .map(str::to_owned),
            _ => None,
        };
        if let Some(iri) = &property {
            let span = args[place].span.clone();
            self.checking.vocabulary(self.source, iri, &span, true);
        }
        match property.filter(|_| self.checking.split) {
            Some(iri) => {
                let property = self.checking.terms.intern(Term::iri(iri));
                args.remove(place);
                (
                    add_given(&mut self.checking.predicates, name, Some(property)),
                    args,
                )
            }
            None => (add_given(&mut self.checking.predicates, name, None), args),
        }
    }
}
