//! Checks the syntax tree: names, arities, safety, vocabulary, and the predicates that a property
//! must define.

use std::collections::{BTreeMap, BTreeSet};

use crate::builtins;
use crate::check::translate::translate;
use crate::model::given::{GIVEN, VERDICT};
use crate::model::program::{CheckedProgram, MAX_ARITY, Predicate, Predicates, Scope};
use crate::syntax::limits::{FAULT_LIMIT, LITERAL_LIMIT, RULE_LIMIT, WARNING_LIMIT};
use crate::syntax::{AtomSyntax, LiteralSyntax, Statement, Syntax, TemporalOperator};
use actcheck_base::{Diagnostic, Diagnostics, Source, Span, Term, Terms, did_you_mean, names};
use actcheck_ontology::Vocabulary;

/// The role of a rule file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Role {
    /// Every rule may use its predicates.
    Library,
    /// It verifies a property; its predicates are visible in this file only.
    Property(Scope),
    /// A standalone program without given predicates.
    Standalone,
}

impl Role {
    /// Returns the scope of this file's predicates.
    pub(crate) fn scope(self) -> Scope {
        match self {
            Self::Library | Self::Standalone => 0,
            Self::Property(scope) => scope,
        }
    }
}

/// State shared by all files while they are checked.
pub(crate) struct Checking<'a> {
    pub(crate) terms: &'a mut Terms,
    pub(crate) predicates: Predicates,
    pub(crate) vocabulary: Option<&'a Vocabulary>,
    /// Whether a constant property is part of the predicate: `false` if a rule derives `state` for
    /// a variable property.
    pub(crate) split: bool,
    /// Properties that a library derives. All rules may use them like those of the vocabulary.
    pub(crate) derived_terms: BTreeSet<String>,
    /// Where each predicate was first defined.
    pub(crate) defined: BTreeMap<(Scope, String), Definition>,
    /// Names that begin with a capital, of which a warning was given.
    pub(crate) bare_names: BTreeSet<String>,
    pub(crate) diagnostics: Diagnostics,
    /// Number of errors reported so far.
    pub(crate) errors: usize,
}

/// First definition of a predicate.
#[derive(Debug, Clone)]
pub(crate) struct Definition {
    pub(crate) arity: usize,
    source: Source,
    /// Unit: bytes of the source.
    start: usize,
}

impl Definition {
    /// Returns file and line. Only called for errors, because counting lines takes time.
    pub(crate) fn place(&self) -> String {
        format!(
            "{}:{}",
            self.source.name,
            self.source.line_and_column(self.start).0
        )
    }
}

impl<'a> Checking<'a> {
    pub(crate) fn new(terms: &'a mut Terms, vocabulary: Option<&'a Vocabulary>) -> Self {
        Self {
            terms,
            predicates: Predicates::default(),
            vocabulary,
            split: true,
            derived_terms: BTreeSet::new(),
            defined: BTreeMap::new(),
            bare_names: BTreeSet::new(),
            diagnostics: Diagnostics::new(),
            errors: 0,
        }
    }

    pub(crate) fn error(
        &mut self,
        code: &'static str,
        source: &Source,
        span: &Span,
        message: impl Into<String>,
        help: impl Into<String>,
    ) {
        self.errors += 1;
        self.diagnostics.push(
            Diagnostic::error(code, message)
                .at(source, span.clone())
                .help(help),
        );
    }

    pub(crate) fn warning(
        &mut self,
        code: &'static str,
        source: &Source,
        span: &Span,
        message: impl Into<String>,
        help: impl Into<String>,
    ) {
        if self.diagnostics.len() - self.errors.min(self.diagnostics.len()) < WARNING_LIMIT {
            self.diagnostics.push(
                Diagnostic::warning(code, message)
                    .at(source, span.clone())
                    .help(help),
            );
        }
    }

    /// First pass: collects the predicates that the heads of a file define.
    pub(crate) fn define(&mut self, syntax: &Syntax, role: Role) {
        let source = &syntax.source;
        let (mut rules, before) = (0, self.errors);
        for statement in &syntax.statements {
            if self.errors - before >= FAULT_LIMIT {
                return;
            }
            match statement {
                Statement::Rule(rule) => {
                    rules += 1;
                    if rules == RULE_LIMIT + 1 && role != Role::Standalone {
                        let help = "keep tables of facts outside rule files";
                        self.error(
                            "R006",
                            source,
                            &rule.span,
                            format!("more than {RULE_LIMIT} rules in one file"),
                            help,
                        );
                    }
                    if rule.body.len() > LITERAL_LIMIT {
                        let message = format!("rule with more than {LITERAL_LIMIT} conditions");
                        self.error(
                            "R006",
                            source,
                            &rule.span,
                            message,
                            "split it into several rules",
                        );
                    }
                    for head in &rule.heads {
                        self.define_head(source, head, role);
                    }
                }
                Statement::Transfer(transfer) if role != Role::Standalone => {
                    let word = if transfer.import {
                        "@import"
                    } else {
                        "@export"
                    };
                    let help = "facts come from the run; use `actcheck datalog` for programs with imports and exports";
                    let message = format!("`{word}` is not possible in the rules of a property");
                    self.error("R030", source, &transfer.span, message, help);
                }
                _ => {}
            }
        }
    }

    fn define_head(&mut self, source: &Source, head: &AtomSyntax, role: Role) {
        let name = head.predicate.as_str();
        if role != Role::Standalone && GIVEN.iter().any(|(given, ..)| *given == name) {
            return self.define_given(source, head, role);
        }
        if role == Role::Library && VERDICT.iter().any(|(verdict, _)| *verdict == name) {
            let help = "define it in the file of one property, which `act:verifiedBy` links";
            return self.error(
                "R034",
                source,
                &head.name_span,
                format!("a library can't define `{name}`"),
                help,
            );
        }
        if role != Role::Standalone && builtins::is_reserved(name) {
            let help = "choose another name";
            return self.error(
                "R038",
                source,
                &head.name_span,
                format!("`{name}` is a built-in function"),
                help,
            );
        }
        let elsewhere = self
            .defined
            .get(&(0, name.to_owned()))
            .filter(|_| role.scope() != 0);
        if let Some(definition) = elsewhere {
            let message = format!(
                "`{name}` is already defined by a library ({})",
                definition.place()
            );
            return self.error(
                "R038",
                source,
                &head.name_span,
                message,
                "choose another name, or use the library's",
            );
        }
        if role != Role::Standalone && TemporalOperator::named(name).is_some() {
            let message = format!("`{name}` is a temporal operator");
            return self.error(
                "R038",
                source,
                &head.name_span,
                message,
                "choose another name",
            );
        }
        self.define_predicate(source, name, head.args.len(), &head.span, role);
    }

    /// Registers a predicate with its arity.
    pub(crate) fn define_predicate(
        &mut self,
        source: &Source,
        name: &str,
        arity: usize,
        span: &Span,
        role: Role,
    ) {
        let key = (role.scope(), name.to_owned());
        if let Some(known) = self.defined.get(&key) {
            if known.arity != arity {
                let message = format!(
                    "`{name}` has {} here and {} in {}",
                    counted(arity),
                    known.arity,
                    known.place()
                );
                self.error(
                    "R022",
                    source,
                    span,
                    message,
                    "use the same number everywhere, or another name",
                );
            }
            return;
        }
        if arity > MAX_ARITY {
            let help = "split the tuple over several predicates that share a key";
            return self.error(
                "R024",
                source,
                span,
                format!("`{name}` has more than {MAX_ARITY} arguments"),
                help,
            );
        }
        self.defined.insert(
            key,
            Definition {
                arity,
                source: source.clone(),
                start: span.start,
            },
        );
        self.predicates.add(Predicate {
            name: name.to_owned(),
            scope: role.scope(),
            property: None,
            arity,
            width: arity.max(1),
            given: false,
        });
    }

    /// Checks a head that adds facts to the snapshots.
    fn define_given(&mut self, source: &Source, head: &AtomSyntax, role: Role) {
        let name = head.predicate.as_str();
        let addable = matches!(name, "state" | "before" | "after" | "during");
        if !addable || role != Role::Library {
            let (message, help) = if addable {
                (
                    format!("only a library may derive `{name}`"),
                    "move this rule to a library (`act:ruleLibrary`), or derive a predicate of your own",
                )
            } else {
                (
                    format!("`{name}` is given and can't be derived"),
                    "derive a predicate of your own",
                )
            };
            return self.error("R031", source, &head.name_span, message, help);
        }
        let place = if name == "state" { 2 } else { 1 };
        match head.args.get(place).map(|arg| &arg.kind) {
            Some(crate::syntax::ExpressionKind::Constant(Term::Iri(iri))) => {
                self.derived_terms.insert(iri.to_string());
            }
            Some(_) => self.split = false,
            None => {}
        }
    }

    /// Second pass: checks and translates the rules of a file.
    pub(crate) fn rules(&mut self, syntax: &Syntax, role: Role) -> CheckedProgram {
        let program = translate(self, syntax, role);
        // After a syntax error, a missing definition may be in the part that was not parsed.
        if let Role::Property(scope) = role
            && syntax.whole
        {
            self.verdict(syntax, scope);
        }
        program
    }

    /// Checks that a property's file defines exactly one of `success` and `violation`.
    fn verdict(&mut self, syntax: &Syntax, scope: Scope) {
        let has = |name: &str| self.defined.contains_key(&(scope, name.to_owned()));
        let (success, violation) = (has("success"), has("violation"));
        let source = &syntax.source;
        if success && violation {
            let help = "keep one: `success` for \"there is a …\", `violation` for \"for all …\"";
            let span = place_of(syntax, "violation");
            self.error(
                "R025",
                source,
                &span,
                "the file defines both `success` and `violation`",
                help,
            );
        } else if !success && !violation {
            let own: Vec<String> = self
                .defined
                .keys()
                .filter(|(known, _)| *known == scope)
                .map(|(_, name)| name.clone())
                .collect();
            let near = own
                .iter()
                .find(|name| actcheck_base::nearest(name, ["success", "violation"]).is_some());
            let help = match near {
                Some(name) => format!(
                    "`{name}` is neither of them: {}",
                    did_you_mean(name, ["success", "violation"])
                ),
                None => "add a rule such as `success(?o) :- parameter(act:pickObject, ?o), … .`"
                    .to_owned(),
            };
            let fault =
                Diagnostic::error("R026", "the file defines neither `success` nor `violation`")
                    .help(help);
            self.diagnostics.push(match near {
                Some(name) => fault.at(source, place_of(syntax, name)),
                None => fault.in_source(source),
            });
        }
        for (name, columns) in [("margin", 1), ("because", 1)] {
            if let Some(definition) = self.defined.get(&(scope, name.to_owned()))
                && definition.arity != columns
            {
                let message = format!("`{name}` has {}, needs one", counted(definition.arity));
                let help = format!("write `{name}(?value) :- … .`");
                self.error("R022", source, &place_of(syntax, name), message, help);
            }
        }
    }

    /// Checks that an IRI in one of the ontology's namespaces is described there.
    pub(crate) fn vocabulary(
        &mut self,
        source: &Source,
        iri: &str,
        span: &Span,
        as_property: bool,
    ) {
        let Some(vocabulary) = self.vocabulary else {
            return;
        };
        if self.derived_terms.contains(iri) || is_phase(iri) {
            return;
        }
        match vocabulary.terms.get(iri) {
            Some(term) if as_property && !term.is_property => {
                let help = "write a property, such as `w:mass`";
                let message = format!("`{}` is not a property", names::shorten(iri));
                self.error("R029", source, span, message, help);
            }
            Some(_) => {}
            None => {
                let Some(namespace) = [names::W, names::ACT]
                    .into_iter()
                    .find(|n| iri.starts_with(n))
                else {
                    return;
                };
                let locals: Vec<&str> = vocabulary
                    .terms
                    .iter()
                    .filter(|(_, term)| !as_property || term.is_property)
                    .filter_map(|(known, _)| known.strip_prefix(namespace))
                    .chain(
                        self.derived_terms
                            .iter()
                            .filter_map(|known| known.strip_prefix(namespace)),
                    )
                    .collect();
                let local = &iri[namespace.len()..];
                let help = match actcheck_base::nearest(local, locals.iter().copied()) {
                    Some(found) => format!(
                        "did you mean `{}`?",
                        names::shorten(&format!("{namespace}{found}"))
                    ),
                    None => "describe it in the ontology, or derive it in a library".to_owned(),
                };
                let message = format!("the ontology has no term `{}`", names::shorten(iri));
                self.error("R028", source, span, message, help);
            }
        }
    }

    /// Returns the predicate names that a file may use, for "did you mean".
    pub(crate) fn known_names(&self, role: Role) -> Vec<String> {
        let own = self
            .defined
            .keys()
            .filter(|(scope, name)| (*scope == 0 || *scope == role.scope()) && !name.contains('~'))
            .map(|(_, name)| name.clone());
        let given = GIVEN
            .iter()
            .filter(|_| role != Role::Standalone)
            .map(|(name, ..)| (*name).to_owned());
        own.chain(given).collect()
    }
}

/// Removes duplicates: a rule with several heads is checked once for each head.
pub(crate) fn unique(diagnostics: Diagnostics) -> Diagnostics {
    let mut seen = BTreeSet::new();
    let mut kept = Diagnostics::new();
    for diagnostic in diagnostics {
        if seen.insert((
            diagnostic.code,
            diagnostic.place(),
            diagnostic.message.clone(),
        )) {
            kept.push(diagnostic);
        }
    }
    kept
}

/// Formats a number of arguments: "1 argument", "2 arguments".
pub(crate) fn counted(arguments: usize) -> String {
    if arguments == 1 {
        "1 argument".to_owned()
    } else {
        format!("{arguments} arguments")
    }
}

/// Returns whether an IRI names a graph of an action. Graph names need no description in the
/// ontology.
fn is_phase(iri: &str) -> bool {
    iri.strip_prefix(names::ACT).is_some_and(|local| {
        matches!(
            local,
            "before" | "after" | "during" | "parameters" | "ontology"
        )
    })
}

/// Returns the span of the first head with a name, or the start of the file.
fn place_of(syntax: &Syntax, name: &str) -> Span {
    syntax
        .statements
        .iter()
        .find_map(|statement| match statement {
            Statement::Rule(rule) => rule
                .heads
                .iter()
                .find(|head| head.predicate == name)
                .map(|head| head.span.clone()),
            _ => None,
        })
        .unwrap_or(0..0)
}

/// Returns the predicates that the bodies of a file use.
pub(crate) fn used_names(syntax: &Syntax) -> BTreeSet<&str> {
    let mut used = BTreeSet::new();
    for statement in &syntax.statements {
        if let Statement::Rule(rule) = statement {
            for literal in &rule.body {
                if let LiteralSyntax::Atom(atom) | LiteralSyntax::Negated(atom) = literal {
                    used.insert(atom.predicate.as_str());
                }
            }
        }
    }
    used
}
