//! SPARQL properties: prepared once, evaluated over an action's named graphs.

use std::collections::BTreeSet;

use oxigraph::sparql::{
    PreparedSparqlQuery, QueryEvaluationError, QueryResults, QuerySolutionIter, SparqlEvaluator,
};
use oxrdf::{NamedNode, Term as RdfTerm};

use crate::builtins;
use crate::check::sides::{self, SIDES};
use crate::engine::budget::Budget;
use crate::engine::meter::{Stop, mebibytes};
use crate::engine::reading::smaller_margin;
use crate::model::rdf::{from_rdf, to_rdf};
use crate::model::universe::Universe;
use crate::model::values::lexical;
use crate::sparql::dataset::{Snapshot, Statements, View, length_of};
use crate::sparql::ledger::Ledger;
use crate::sparql::query_text::{first_group, groups, scan, variables};
use crate::sparql::varying::varying;
use crate::watch::Watch;
use actcheck_base::{
    COUNTED_TEXT, Diagnostic, Diagnostics, Findings, MOST_NESTED_CALLS, RuleFault, Source, Span,
    TEXT_FUNCTIONS, Term, WitnessRow, bounded_texts, check_calls, names, sparql_excess,
    unclosed_braces,
};
use actcheck_ontology::{Ontology, Vocabulary};

/// A prepared query.
pub(crate) struct Query {
    prepared: PreparedSparqlQuery,
    /// Whether it is an `ASK` query, which passes if it is true.
    pub(crate) asks: bool,
    /// Warnings about it.
    pub(crate) warnings: Diagnostics,
    /// Name of its file.
    file: String,
}

impl Query {
    /// Parses a query, checks its terms, and binds the designators that it uses as variables.
    pub(crate) fn prepare(
        source: &Source,
        ontology: &Ontology,
        derived: &BTreeSet<String>,
    ) -> Result<Self, Diagnostics> {
        let mut diagnostics = Diagnostics::new();
        if !ontology.vocabulary.terms.is_empty() {
            check_vocabulary(
                source,
                &ontology.vocabulary,
                derived,
                "describe it in the ontology",
                &mut diagnostics,
            );
        }
        if let Some((span, message)) = sparql_excess(&source.text) {
            diagnostics.push(
                Diagnostic::error("R060", message)
                    .at(source, span)
                    .help("split it, or shorten it"),
            );
            return Err(diagnostics);
        }
        if let Err(at) = check_calls(&source.text) {
            let message = format!("calls are nested more than {MOST_NESTED_CALLS} deep");
            let help = "name the inner values, as in `BIND(CONCAT(?a, ?b) AS ?c)`";
            diagnostics.push(
                Diagnostic::error("R060", message)
                    .at(source, at..at + 1)
                    .help(help),
            );
            return Err(diagnostics);
        }
        if let Err(error) = evaluator().parse_query(source.text.as_ref()) {
            diagnostics.push(syntax_fault(source, &error.to_string()));
            return Err(diagnostics);
        }
        if let Some(fault) = varying(source) {
            diagnostics.push(fault);
        }
        let text = bounded_texts(&bind_designators(&source.text, &ontology.designators));
        let prepared = evaluator().parse_query(&text).map_err(|error| {
            let help = "a variable named like a designator is bound to its value; use it in the first group";
            Diagnostics::from(Diagnostic::error("R060", error.to_string()).in_source(source).help(help))
        })?;
        let form = form(&source.text);
        if form.is_none() {
            let help =
                "write `ASK { … }` (true is passed) or `SELECT … { … }` (every row is a violation)";
            diagnostics.push(
                Diagnostic::error("R061", "the query is neither ASK nor SELECT")
                    .in_source(source)
                    .help(help),
            );
        }
        let warnings = one_sided(source).into_iter().collect();
        diagnostics.or(Self {
            prepared,
            warnings,
            asks: form == Some(QueryForm::Ask),
            file: source.name.to_string(),
        })
    }

    /// The place of the keyword `ASK` or `SELECT` in its text.
    pub(crate) fn start(&self, text: &str) -> Span {
        let word = if self.asks { "ask" } else { "select" };
        let found = scan(text)
            .into_iter()
            .find(|token| token.word.eq_ignore_ascii_case(word));
        found.map_or(0..0, |token| token.span)
    }

    /// Judges an action: `ASK` passes if it is true, `SELECT` if it has no rows.
    pub(crate) fn judge(
        &self,
        statements: &Statements,
        snapshot: &Snapshot,
        universe: &Universe<'_>,
        budget: &Budget,
    ) -> Result<Findings, RuleFault> {
        let ledger = Ledger::new(budget);
        let view = View {
            snapshot,
            statements,
            universe,
            ledger: &ledger,
        };
        ledger
            .hold(|| self.evaluate(view, budget))
            .unwrap_or_else(|stop| Err(self.stopped(stop, budget)))
    }

    fn evaluate(&self, view: View<'_>, budget: &Budget) -> Result<Findings, RuleFault> {
        match self
            .prepared
            .clone()
            .on_queryable_dataset(view)
            .execute()
            .map_err(|error| fault(&error))?
        {
            QueryResults::Boolean(holds) => Ok(Findings {
                applicable: true,
                holds,
                witness: Vec::new(),
                witness_count: 0,
                margin: None,
                because: Vec::new(),
            }),
            QueryResults::Solutions(rows) => self.rows_found(rows, budget),
            QueryResults::Graph(_) => Err(RuleFault::Value(
                "the query is neither ASK nor SELECT".into(),
            )),
        }
    }

    /// Reads the findings of a `SELECT` query, whose rows are violations.
    fn rows_found(
        &self,
        rows: QuerySolutionIter<'_>,
        budget: &Budget,
    ) -> Result<Findings, RuleFault> {
        let mut witness = Vec::new();
        let (mut margin, mut because) = (None::<f64>, BTreeSet::new());
        for row in rows {
            let row = row.map_err(|error| fault(&error))?;
            if witness.len() >= budget.tuples {
                return Err(self.budget_spent(&format!("found more than {} rows", budget.tuples)));
            }
            let mut values = Vec::new();
            for (variable, term) in row.iter() {
                let term = from_rdf(term);
                match variable.as_str() {
                    "margin" => margin = Some(smaller_margin(margin, &term)?),
                    "because" => {
                        because.insert(lexical(&term));
                    }
                    name => values.push((name.to_owned(), term)),
                }
            }
            witness.push(WitnessRow {
                predicate: "row".into(),
                values,
            });
        }
        let witness_count = witness.len();
        witness.sort_by(|a, b| a.values.cmp(&b.values));
        witness.truncate(Findings::WITNESS_LIMIT);
        let because = because.into_iter().collect();
        Ok(Findings {
            applicable: true,
            holds: witness_count == 0,
            witness,
            witness_count,
            margin,
            because,
        })
    }

    fn stopped(&self, stop: Stop, budget: &Budget) -> RuleFault {
        match stop {
            Stop::Time => self.budget_spent(&format!("took more than {} s", budget.secs)),
            Stop::Tuples => {
                self.budget_spent(&format!("held more than {} terms at once", budget.tuples))
            }
            Stop::Bytes => {
                let advice = "repeated concatenation doubles a text: write texts once";
                let most = mebibytes(budget.bytes);
                let how = format!("made a text that is too long for a budget of {most}");
                RuleFault::BudgetSpent(format!("the query in {} {how}; {advice}", self.file))
            }
            // Queries read no quantities over time.
            Stop::Requested | Stop::Value | Stop::NewThings => RuleFault::Interrupted,
        }
    }

    fn budget_spent(&self, how: &str) -> RuleFault {
        let advice = "patterns without shared variables multiply: let each share a variable with an earlier one";
        RuleFault::BudgetSpent(format!("the query in {} {how}; {advice}", self.file))
    }
}

/// Creates an evaluator with the known prefixes and the geometry functions.
fn evaluator() -> SparqlEvaluator {
    let mut evaluator = SparqlEvaluator::new();
    for (prefix, namespace) in names::PREFIXES {
        // The namespaces are constants. If one were not a valid IRI, queries with its prefix would
        // report it.
        evaluator = match evaluator.clone().with_prefix(prefix, namespace) {
            Ok(evaluator) => evaluator,
            Err(_) => evaluator,
        };
    }
    for name in builtins::builtin_names() {
        let (Some(local), Some(function)) = (
            name.strip_prefix("geo3d:"),
            builtins::builtin_by_exact_name(name),
        ) else {
            continue;
        };
        let iri = NamedNode::new_unchecked(format!("{}{local}", builtins::GEO3D));
        evaluator = evaluator.with_custom_function(iri, move |args: &[RdfTerm]| {
            if !(function.min_args..=function.max_args).contains(&args.len()) {
                return None;
            }
            let args: Vec<builtins::Value<'_>> = args
                .iter()
                .map(|arg| std::borrow::Cow::Owned(from_rdf(arg)))
                .collect();
            function
                .call(&args, &Watch::new(&Budget::default()))
                .map(|term| to_rdf(&term))
        });
    }
    for (_, iri, function) in TEXT_FUNCTIONS {
        evaluator = evaluator.with_custom_function(
            NamedNode::new_unchecked(iri),
            move |args: &[RdfTerm]| {
                let args: Vec<Term> = args.iter().map(from_rdf).collect();
                Ledger::text(function, &args).map(|term| to_rdf(&term))
            },
        );
    }
    evaluator.with_custom_function(
        NamedNode::new_unchecked(COUNTED_TEXT),
        |args: &[RdfTerm]| {
            let [text] = args else { return None };
            Ledger::append(length_of(text));
            Some(text.clone())
        },
    )
}

fn fault(error: &QueryEvaluationError) -> RuleFault {
    RuleFault::Value(error.to_string())
}

/// Binds each designator that the query uses as a variable, at the start of every group that uses
/// it, for example:
///
/// ```sparql
/// GRAPH act:parameters { act:pickObject act:value ?pickObject }
/// ```
fn bind_designators(text: &str, designators: &BTreeSet<String>) -> String {
    let act = names::ACT;
    let mut out = text.to_owned();
    // From the last group to the first, so that earlier offsets stay valid.
    for group in groups(text).into_iter().rev() {
        let used = variables(&text[group.clone()]);
        let bound: String = designators
            .iter()
            .filter(|name| used.contains(*name))
            .map(|name| {
                format!(" GRAPH <{act}parameters> {{ <{act}{name}> <{act}value> ?{name} }}")
            })
            .collect();
        out.insert_str(group.start + 1, &bound);
    }
    out
}

/// The query forms allowed for properties.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum QueryForm {
    Ask,
    Select,
}

/// Returns the form of a query, or `None` for any other form.
fn form(text: &str) -> Option<QueryForm> {
    let group = first_group(text)?;
    scan(text)
        .into_iter()
        .take_while(|token| token.span.start < group)
        .find_map(|token| match token.word.to_ascii_lowercase().as_str() {
            "ask" => Some(QueryForm::Ask),
            "select" => Some(QueryForm::Select),
            _ => None,
        })
}

/// Returns the warning about a query that depends on the order of a contact's two sides: it reads
/// only one of them, or reads each once and then one of the two variables more often than the
/// other.
fn one_sided(source: &Source) -> Option<Diagnostic> {
    let start = first_group(&source.text)?;
    let words: Vec<_> = scan(&source.text)
        .into_iter()
        .filter(|word| word.span.start >= start)
        .collect();
    let uses = |variable: &str| {
        words
            .iter()
            .filter(|word| word.word.get(1..) == variable.get(1..))
            .count()
    };
    SIDES.iter().find_map(|names| {
        let [first, second] = names.map(|local| {
            let iri = names::w(local);
            (0..words.len())
                .filter(|at| words[*at].iri.as_ref() == Some(&iri))
                .collect::<Vec<usize>>()
        });
        // The variable after each; none if a constant or another property follows, as in
        // `w:first|w:second`.
        let variable = |at: usize| {
            words
                .get(at + 1)
                .map(|next| next.word.as_str())
                .filter(|word| word.starts_with(['?', '$']))
        };
        let at = match (first.as_slice(), second.as_slice()) {
            // That a contact has a side says nothing about which.
            (one @ [at, ..], []) | ([], one @ [at, ..]) => {
                let matters = one
                    .iter()
                    .any(|at| variable(*at).is_none_or(|variable| uses(variable) > 1));
                matters.then_some(*at)
            }
            ([one], [two]) => {
                let (a, b) = (variable(*one)?, variable(*two)?);
                (uses(a) != uses(b)).then_some(*one.min(two))
            }
            _ => None,
        }?;
        let property = if first.contains(&at) {
            names[0]
        } else {
            names[1]
        };
        let derived = if names == &SIDES[0] {
            "w:between"
        } else {
            "w:betweenLinks"
        };
        let help = format!("use `{derived}`, which leads to both sides");
        Some(sides::warning(property, &help).at(source, words[at].span.clone()))
    })
}

/// Converts a message of the SPARQL parser, which contains line and column, to a diagnostic.
fn syntax_fault(source: &Source, message: &str) -> Diagnostic {
    let place = message.strip_prefix("error at ").and_then(|rest| {
        let (line, rest) = rest.split_once(':')?;
        let (column, rest) = rest.split_once(':')?;
        Some((
            line.parse::<usize>().ok()?,
            column.trim().parse::<usize>().ok()?,
            rest.trim(),
        ))
    });
    match place {
        Some((line, column, rest)) => {
            let help = format!("expected {}", expected(rest));
            let start: usize = source
                .text
                .split_inclusive('\n')
                .take(line.saturating_sub(1))
                .map(str::len)
                .sum();
            let offset: usize = source.text[start..]
                .chars()
                .take(column.saturating_sub(1))
                .map(char::len_utf8)
                .sum();
            let at = (start + offset).min(source.text.len());
            let (message, help) = match source.text[at..].trim().is_empty() {
                true => (
                    "the query ends too early",
                    unclosed_braces(&source.text).unwrap_or(help),
                ),
                false => ("syntax error in the query", help),
            };
            Diagnostic::error("R060", message)
                .at(source, at..at)
                .help(help)
        }
        None => {
            let help = "see https://www.w3.org/TR/sparql11-query/";
            Diagnostic::error("R060", format!("invalid query: {message}"))
                .in_source(source)
                .help(help)
        }
    }
}

/// Returns the keywords and symbols that the parser expected, without its character classes, which
/// don't help users.
fn expected(message: &str) -> String {
    let words: Vec<&str> = message
        .trim_start_matches("expected ")
        .trim_start_matches("one of ")
        .split(", ")
        .filter(|word| word.starts_with('"') && word.ends_with('"') && word.len() > 2)
        .take(12)
        .collect();
    if words.is_empty() {
        "something else".to_owned()
    } else {
        words.join(" or ")
    }
}

/// Returns faults about terms of our namespaces in a query that the vocabulary lacks.
pub fn unknown_terms(source: &Source, vocabulary: &Vocabulary) -> Diagnostics {
    let mut found = Diagnostics::new();
    let help = "`actcheck query --named` lists queries with the terms of histories, and `ontology/history.ttl` describes all";
    check_vocabulary(source, vocabulary, &BTreeSet::new(), help, &mut found);
    found
}

/// Checks that terms of our namespaces are in the vocabulary, as in Datalog.
fn check_vocabulary(
    source: &Source,
    vocabulary: &Vocabulary,
    derived: &BTreeSet<String>,
    help_without: &str,
    diagnostics: &mut Diagnostics,
) {
    for token in scan(&source.text) {
        let Some(iri) = &token.iri else { continue };
        let Some(namespace) = [names::W, names::ACT]
            .into_iter()
            .find(|n| iri.starts_with(n))
        else {
            continue;
        };
        let local = &iri[namespace.len()..];
        let ours = namespace == names::ACT
            && matches!(
                local,
                "" | "before" | "after" | "during" | "parameters" | "ontology" | "value"
            );
        if ours || local.is_empty() || vocabulary.terms.contains_key(iri) || derived.contains(iri) {
            continue;
        }
        let known = vocabulary
            .terms
            .keys()
            .chain(derived)
            .filter_map(|known| known.strip_prefix(namespace));
        let help = match actcheck_base::nearest(local, known) {
            Some(found) => format!(
                "did you mean `{}`?",
                names::shorten(&format!("{namespace}{found}"))
            ),
            None => help_without.to_owned(),
        };
        let span: Span = token.span.clone();
        let message = format!("the ontology has no term `{}`", names::shorten(iri));
        diagnostics.push(
            Diagnostic::error("R028", message)
                .at(source, span)
                .help(help),
        );
    }
}
