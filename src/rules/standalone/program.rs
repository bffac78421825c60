//! A program in memory: checked, planned, and evaluated by either engine.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use crate::check::checking::{Checking, Role, unique};
use crate::check::stratify::stratify;
use crate::check::termination::warnings;
use crate::engine::budget::Budget;
use crate::engine::evaluate::{Layers, Planned, Tables, evaluate, fault};
use crate::engine::meter::Meter;
use crate::engine::naive;
use crate::engine::plan::Indexes;
use crate::model::program::{PredicateId, Predicates};
use crate::model::universe::Universe;
use crate::standalone::import::{define_imports, import};
use crate::standalone::input::Limits;
use crate::syntax::{Expression, Statement, Syntax, parse};
use crate::watch::Stop;
use actcheck_base::{
    Diagnostic, Diagnostics, RuleFault, Source, Term, TermId, Terms, did_you_mean,
};

/// The evaluator of a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Engine {
    /// Semi-naive evaluation on datafrog relations.
    Fast,
    /// Nested loops over sets: slow and obviously correct.
    Naive,
}

/// How the imports of a program are read.
///
/// ```
/// use actcheck_rules::standalone::Loading;
///
/// assert!(!Loading::default().lenient, "a row that can't be read is an error");
/// ```
#[derive(Debug, Clone)]
pub struct Loading {
    /// Limits on the memory of all facts and on the time, and a flag to stop.
    pub budget: Budget,
    /// Whether rows and statements that can't be read are left out with a warning.
    pub lenient: bool,
    /// Values of parameters by name, as written in rules; they replace those of `@parameter`.
    pub parameters: BTreeMap<String, String>,
}

impl Loading {
    /// Strict, with these limits and without values of parameters.
    pub fn within(budget: &Budget) -> Self {
        Self {
            budget: budget.clone(),
            lenient: false,
            parameters: BTreeMap::new(),
        }
    }
}

impl Default for Loading {
    /// Strict, with at most 4 GiB of facts and without a time limit.
    fn default() -> Self {
        Self {
            budget: Budget {
                bytes: 4 << 30,
                secs: f64::INFINITY,
                ..Budget::default()
            },
            ..Self::within(&Budget::default())
        }
    }
}

/// Why facts can't be added to a program.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FactFault {
    /// The program does not use this predicate.
    #[error("the program has no predicate `{0}`")]
    UnknownPredicate(String),
    /// A row has the wrong number of terms.
    #[error("a row of `{predicate}` has {terms} terms instead of {arity}")]
    Width {
        /// The predicate.
        predicate: String,
        /// Number of terms of the row.
        terms: usize,
        /// Number of arguments of the predicate.
        arity: usize,
    },
}

/// A checked program with its facts. Unlike the rules of a property, it has only predicates of its
/// own.
///
/// ```
/// use std::path::Path;
///
/// use actcheck_base::{Source, Term};
/// use actcheck_rules::Budget;
/// use actcheck_rules::standalone::{Engine, Program};
///
/// let text = "reaches(?a, ?b) :- door(?a, ?b) .\n reaches(?a, ?c) :- reaches(?a, ?b), door(?b, ?c) .";
/// // The folder is that of relative paths in `@import`.
/// let mut program = Program::load(&Source::new("rooms.rls", text), Path::new(""))?;
/// let door = |from: &str, to: &str| [Term::string(from), Term::string(to)];
/// let doors = [door("hall", "kitchen"), door("kitchen", "cellar")];
/// program.add_facts("door", doors.iter().map(|row| row.as_slice()))?;
///
/// let closure = program.close(Engine::Fast, &Budget::default())?;
/// assert_eq!(closure.count("reaches"), 3);
/// let why = program.explain(r#"reaches("hall", "cellar")"#, &Budget::default())?;
/// assert!(why.to_text().contains(r#"door("kitchen", "cellar")  (fact)"#));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Program {
    pub(crate) syntax: Syntax,
    /// Shared with closures, because a large import has tens of millions of terms.
    pub(crate) terms: Arc<Terms>,
    pub(crate) predicates: Predicates,
    pub(crate) indexes: Indexes,
    pub(crate) planned: Planned,
    /// Warnings about the program.
    pub warnings: Diagnostics,
    /// Those of them about rules that may make new things without end.
    pub(super) endless: Diagnostics,
}

/// Everything that a program derives, including its facts.
///
/// ```
/// use std::path::Path;
///
/// use actcheck_base::{Source, Term};
/// use actcheck_rules::Budget;
/// use actcheck_rules::standalone::{Engine, Program};
///
/// let text = "price(\"cup\", 3) . price(\"plate\", 5) . total(#sum(?p, ?item)) :- price(?item, ?p) .";
/// let program = Program::load(&Source::new("prices.rls", text), Path::new(""))?;
/// let closure = program.close(Engine::Fast, &Budget::default())?;
/// assert_eq!(closure.tuples("total"), [[Term::Integer(8)]]);
/// assert_eq!(closure.predicates().collect::<Vec<_>>(), ["price", "total"]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Closure {
    /// The terms of the program, and those of the evaluation.
    terms: Arc<Terms>,
    created: Vec<Term>,
    /// Arity and rows of each predicate.
    tables: BTreeMap<String, (usize, Vec<TermId>)>,
}

impl Closure {
    /// Returns the names of the predicates, sorted.
    pub fn predicates(&self) -> impl Iterator<Item = &str> {
        self.tables.keys().map(String::as_str)
    }

    /// Returns the number of tuples of a predicate.
    pub fn count(&self, predicate: &str) -> usize {
        self.tables
            .get(predicate)
            .map_or(0, |(arity, rows)| rows.len() / (*arity).max(1))
    }

    /// Returns the number of arguments of a predicate, or `None` if the program does not use it.
    pub fn arity(&self, predicate: &str) -> Option<usize> {
        self.tables.get(predicate).map(|(arity, _)| *arity)
    }

    /// Returns the tuples of a predicate, in no particular order.
    pub fn tuples_unsorted(&self, predicate: &str) -> impl Iterator<Item = Vec<&Term>> {
        self.rows_unsorted(predicate)
            .map(move |row| row.iter().map(|id| self.term(*id)).collect())
    }

    /// Returns the rows of a predicate, in no particular order.
    pub(super) fn rows_unsorted(&self, predicate: &str) -> impl Iterator<Item = &[TermId]> {
        let (arity, rows) = self
            .tables
            .get(predicate)
            .map_or((0, &[][..]), |(arity, rows)| (*arity, rows.as_slice()));
        rows.chunks_exact(arity.max(1))
            .map(move |row| &row[..arity])
    }

    /// Returns the term of an id in a row.
    pub(super) fn term(&self, id: TermId) -> &Term {
        match (id as usize).checked_sub(self.terms.len()) {
            Some(created) => &self.created[created],
            None => self.terms.term(id),
        }
    }

    /// Returns the tuples of a predicate, sorted.
    pub fn tuples(&self, predicate: &str) -> Vec<Vec<Term>> {
        let mut tuples: Vec<Vec<Term>> = self
            .tuples_unsorted(predicate)
            .map(|tuple| tuple.into_iter().cloned().collect())
            .collect();
        tuples.sort();
        tuples
    }
}

impl Program {
    /// Checks a program and reads its imports. Relative paths of imports are resolved against
    /// `folder`.
    ///
    /// # Errors
    /// All errors with their places: syntax errors, invalid rules, files that can't be read, and
    /// rows of files.
    pub fn load(source: &Source, folder: &Path) -> Result<Self, Diagnostics> {
        Self::load_as(source, folder, &Loading::default())
    }

    /// Like [`Program::load`], with limits on the imports, and on request without the rows that
    /// can't be read.
    ///
    /// # Errors
    /// All errors with their places; a limit was reached (`R090`), or the budget's `stop` was set
    /// (`R091`).
    pub fn load_as(source: &Source, folder: &Path, loading: &Loading) -> Result<Self, Diagnostics> {
        let limits = Limits::new(&loading.budget);
        let (mut syntax, mut diagnostics) = parse(source);
        diagnostics.extend(set_parameters(&mut syntax, &loading.parameters));
        let mut terms = Terms::new();
        let mut checking = Checking::new(&mut terms, None);
        checking.define(&syntax, Role::Standalone);
        define_declared(&mut checking, &syntax);
        let imports = define_imports(&mut checking, &syntax, folder, &limits);
        let mut program = checking.rules(&syntax, Role::Standalone);
        let (predicates, found) = (checking.predicates, checking.diagnostics);
        diagnostics.extend(found);
        diagnostics = unique(diagnostics);
        if diagnostics.has_errors() {
            return Err(diagnostics);
        }
        for table in imports {
            let found = import(
                table,
                &predicates,
                &mut terms,
                &mut program,
                &limits,
                loading.lenient,
            );
            diagnostics.extend(found);
            // A later import would end at the same limit.
            if limits.ended().is_some() {
                return Err(diagnostics);
            }
        }
        let strata = stratify(&program.rules, &predicates, &Universe::new(&terms, None))
            .unwrap_or_else(|found| {
                diagnostics.extend(found);
                Vec::new()
            });
        let sizes: Vec<Option<usize>> = (0..predicates.len())
            .map(|id| {
                program
                    .facts
                    .get(&id)
                    .map(|rows| rows.len() / predicates.get(id).width)
            })
            .collect();
        let endless = warnings(&program.rules, &predicates, &Universe::new(&terms, None));
        diagnostics.extend(endless.clone());
        let mut indexes = Indexes::new(&predicates);
        let planned = Planned::new(program, strata, &mut indexes, &|id| sizes[id]);
        let terms = Arc::new(terms);
        diagnostics.clone().or(Self {
            syntax,
            terms,
            predicates,
            indexes,
            planned,
            warnings: diagnostics,
            endless,
        })
    }

    /// Adds facts of a predicate that the program uses.
    ///
    /// # Errors
    /// [`FactFault`] if the program does not use the predicate, or a row has the wrong number of
    /// terms.
    pub fn add_facts<'t>(
        &mut self,
        predicate: &str,
        rows: impl IntoIterator<Item = &'t [Term]>,
    ) -> Result<(), FactFault> {
        let id = self
            .predicates
            .find(0, predicate, None)
            .ok_or_else(|| FactFault::UnknownPredicate(predicate.to_owned()))?;
        let width = self.predicates.get(id).arity;
        let facts = self.planned.facts.entry(id).or_default();
        for row in rows {
            if row.len() != width || width == 0 {
                return Err(FactFault::Width {
                    predicate: predicate.to_owned(),
                    terms: row.len(),
                    arity: width,
                });
            }
            let terms = Arc::make_mut(&mut self.terms);
            facts.extend(row.iter().map(|term| terms.intern(term.clone())));
        }
        Ok(())
    }

    /// Derives all tuples.
    ///
    /// # Errors
    /// The budget was exceeded; the fault names the rule.
    pub fn close(&self, engine: Engine, budget: &Budget) -> Result<Closure, RuleFault> {
        self.closed(engine, budget).map_err(|(fault, _)| fault)
    }

    /// As [`Program::close`], with the reason why the evaluation stopped.
    pub(super) fn closed(
        &self,
        engine: Engine,
        budget: &Budget,
    ) -> Result<Closure, (RuleFault, Stop)> {
        let mut universe = Universe::new(&self.terms, None);
        let mut meter = Meter::new(budget);
        let rows: Vec<(PredicateId, Vec<TermId>)> = match engine {
            Engine::Fast => {
                let mut layers = Layers {
                    own: Tables::new(self.predicates.len()),
                    below: Vec::new(),
                };
                evaluate(
                    &self.planned,
                    &self.predicates,
                    &self.indexes,
                    &mut layers,
                    &mut universe,
                    &mut meter,
                )
                .map_err(|stopped| (fault(&meter, stopped, &self.planned), stopped.stop))?;
                (0..self.predicates.len())
                    .map(|id| (id, layers.own.take_rows(id)))
                    .collect()
            }
            Engine::Naive => self
                .naive(&mut universe, &mut meter)
                .map_err(|stop| (meter.fault(stop, None), stop))?,
        };
        let mut tables = BTreeMap::new();
        for (id, rows) in rows {
            let predicate = self.predicates.get(id);
            if !predicate.name.contains('~') {
                tables.insert(predicate.name.clone(), (predicate.arity, rows));
            }
        }
        Ok(Closure {
            terms: Arc::clone(&self.terms),
            created: universe.into_created(),
            tables,
        })
    }

    fn naive(
        &self,
        universe: &mut Universe<'_>,
        meter: &mut Meter,
    ) -> Result<Vec<(PredicateId, Vec<TermId>)>, Stop> {
        let mut sets = naive::Sets::new();
        for (predicate, rows) in &self.planned.facts {
            let width = self.predicates.get(*predicate).width;
            sets.entry(*predicate)
                .or_default()
                .extend(rows.chunks_exact(width).map(<[TermId]>::to_vec));
        }
        let Planned {
            rules,
            strata,
            endless,
            ..
        } = &self.planned;
        naive::close(rules, strata, endless, &mut sets, universe, meter)?;
        let rows = |id| {
            sets.get(&id)
                .map_or(Vec::new(), |set| set.iter().flatten().copied().collect())
        };
        Ok((0..self.predicates.len())
            .map(|id| (id, rows(id)))
            .collect())
    }
}

/// Gives parameters other values. Reports those that the program does not have, and values that are
/// not constants.
fn set_parameters(syntax: &mut Syntax, values: &BTreeMap<String, String>) -> Diagnostics {
    let mut found = Diagnostics::new();
    for (name, text) in values {
        let source = Source::new("parameter", format!("value({text}) ."));
        let (parsed, faults) = parse(&source);
        let value = match parsed.statements.as_slice() {
            [Statement::Rule(rule)] if rule.body.is_empty() && !faults.has_errors() => rule
                .heads
                .first()
                .and_then(|head| Some((head.args.first()?.clone(), head.args.len() == 1))),
            _ => None,
        };
        let Some((value, true)) = value else {
            let help = "write a constant as in rules, such as `limit=1` or `name=\"text\"`";
            found.push(
                Diagnostic::error("R036", format!("`{text}` is not a value for `${name}`"))
                    .help(help),
            );
            continue;
        };
        let mut known = Vec::new();
        let mut is_set = false;
        for statement in &mut syntax.statements {
            let Statement::Parameter {
                name: own,
                value: old,
                span,
            } = statement
            else {
                continue;
            };
            known.push(own.clone());
            if own == name {
                // Faults of the value are shown at the parameter.
                *old = Some(Expression {
                    kind: value.kind.clone(),
                    span: span.clone(),
                });
                is_set = true;
            }
        }
        // As in Nemo, a program may use a parameter that only the caller sets.
        if !is_set && syntax.source.text.contains(&format!("${name}")) {
            let value = Some(Expression {
                kind: value.kind,
                span: 0..0,
            });
            syntax.statements.insert(
                0,
                Statement::Parameter {
                    name: name.clone(),
                    value,
                    span: 0..0,
                },
            );
        } else if !is_set {
            let help = did_you_mean(name, known.iter().map(String::as_str));
            found.push(
                Diagnostic::error("R036", format!("the program has no parameter `${name}`"))
                    .help(help),
            );
        }
    }
    found
}

fn define_declared(checking: &mut Checking<'_>, syntax: &Syntax) {
    for statement in &syntax.statements {
        if let Statement::Declare { name, arity, span } = statement {
            checking.define_predicate(&syntax.source, name, *arity, span, Role::Standalone);
        }
    }
}
