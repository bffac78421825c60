//! `actcheck query`

use std::io::Read as _;
use std::path::PathBuf;

use clap::Args;

use crate::options::{HistoryArgs, QueryFormat};
use crate::why::ontology_file;
use crate::{history_dir, named_queries, output, query_endpoint, stop};
use actcheck_base::{Diagnostic, Diagnostics, Files, Source, Term, names};
use actcheck_history::{Cancel, QueryAnswer};
use actcheck_ontology::{Vocabulary, load_vocabulary};
use actcheck_report::{Table, TableFormat, answer_table};
use actcheck_rules::unknown_terms;

/// `actcheck query`
#[derive(Debug, Args)]
pub struct QueryArgs {
    /// The query's text
    #[arg(value_name = "SPARQL", required_unless_present_any = ["file", "named"])]
    #[arg(conflicts_with_all = ["file", "named"])]
    pub text: Option<String>,
    /// A file with the query
    #[arg(short, long, value_name = "FILE", conflicts_with = "named")]
    pub file: Option<PathBuf>,
    /// Name of a query: a shipped one, or `ontology/queries/NAME.rq` here; without NAME, lists all
    /// with their descriptions
    #[arg(long, value_name = "NAME", num_args = 0..=1, default_missing_value = "")]
    pub named: Option<String>,
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
    /// Ask a SPARQL 1.1 endpoint, to which the history was sent with `actcheck export store`,
    /// instead of the history here. Credentials: as for `export store`
    #[arg(long, value_name = "URL", conflicts_with = "history")]
    pub endpoint: Option<String>,
    /// How the answer is printed (turtle: for CONSTRUCT and DESCRIBE)
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: QueryFormat,
}

/// Runs a query and prints its answer. Ctrl-C stops a long query. Returns the exit code.
pub fn query(args: &QueryArgs) -> Result<u8, Diagnostics> {
    if args.named.as_deref() == Some("") {
        return list_named(args.format).map(|()| 0);
    }
    let text = text(args)?;
    match &args.endpoint {
        Some(url) => query_endpoint::query(args, url, &text),
        None => ask_history(args, &text).map(|()| 0),
    }
}

fn ask_history(args: &QueryArgs, text: &Source) -> Result<(), Diagnostics> {
    let history = history_dir::open_to_read(&args.history)?;
    let cancel = Cancel::new();
    let asked = cancel.clone();
    let _flag = stop::on_interrupt(move || asked.cancel());
    let answer = history.query_from(text, &cancel)?;
    let format = match (args.format, &answer) {
        (QueryFormat::Turtle, QueryAnswer::Graph(triples)) => {
            output::print(&turtle(triples));
            return Ok(());
        }
        (QueryFormat::Turtle, _) => {
            return Err(Diagnostic::error(
                "X004",
                "this query's answer is a table, but Turtle is for graphs",
            )
            .help("use CONSTRUCT or DESCRIBE, or `--format text`, `csv` or `json`")
            .into());
        }
        (QueryFormat::Text, _) => TableFormat::Table,
        (QueryFormat::Csv, _) => TableFormat::Csv,
        (QueryFormat::Json, _) => TableFormat::Json,
    };
    output::print(&answer_table(&answer, format).render(format, output::page()));
    if is_empty(&answer) {
        unanswered(text)?;
    }
    Ok(())
}

/// Reports that a query has no answers.
///
/// # Errors
/// R028 for its unknown terms, which are the likely reason.
pub(super) fn unanswered(text: &Source) -> Result<(), Diagnostics> {
    output::print_none("the query has no answers");
    unknown_terms(text, &vocabulary()).or(())
}

fn is_empty(answer: &QueryAnswer) -> bool {
    match answer {
        QueryAnswer::Boolean(is) => !is,
        QueryAnswer::Table { rows, .. } => rows.is_empty(),
        QueryAnswer::Graph(triples) => triples.is_empty(),
    }
}

/// The terms of histories, of the world, and of the ontology in this folder. Files that can't be
/// read are left out: the query has been answered without them.
fn vocabulary() -> Vocabulary {
    let shipped = [
        "ontology/history.ttl",
        "ontology/world.ttl",
        "ontology/actions.ttl",
    ];
    let mut files: Vec<(Files, PathBuf)> = shipped
        .map(|file| (Files::Shipped, PathBuf::from(file)))
        .into();
    files.push(ontology_file(None));
    let read = files
        .iter()
        .filter_map(|(files, path)| load_vocabulary(files, path).ok());
    let mut all = Vocabulary::default();
    all.terms
        .extend(read.flat_map(|vocabulary| vocabulary.terms));
    all
}

/// Prints the named queries. Needs no history.
fn list_named(format: QueryFormat) -> Result<(), Diagnostics> {
    let format = match format {
        QueryFormat::Text => TableFormat::Table,
        QueryFormat::Csv => TableFormat::Csv,
        QueryFormat::Json => TableFormat::Json,
        QueryFormat::Turtle => {
            return Err(Diagnostic::error(
                "X004",
                "the list of queries is a table, but Turtle is for graphs",
            )
            .help("use `--format text`, `csv` or `json`")
            .into());
        }
    };
    let mut table = Table::new(["name", "title", "description"]);
    for query in named_queries::all()? {
        table.rows.push(vec![
            query.name.into(),
            query.title.into(),
            query.description.into(),
        ]);
    }
    output::print(&table.render(format, output::page()));
    Ok(())
}

/// The query's text: by name, from the command line, from a file, or (`-f -`) from standard input.
fn text(args: &QueryArgs) -> Result<Source, Diagnostics> {
    if let Some(name) = &args.named {
        return named_queries::named(name);
    }
    match (&args.text, &args.file) {
        (Some(text), _) if named_queries::is_named(text) => {
            let help = format!("write `actcheck query --named {text}`");
            Err(Diagnostic::error(
                "X005",
                format!("`{text}` is the name of a query, not its text"),
            )
            .help(help)
            .into())
        }
        (Some(text), _) => Ok(Source::new("query", text.as_str())),
        (None, Some(file)) if file.as_os_str() == "-" => {
            let mut text = String::new();
            let read = std::io::stdin().read_to_string(&mut text);
            read.map_err(|error| {
                Diagnostic::error("X005", format!("standard input can't be read: {error}"))
            })?;
            Ok(Source::new("standard input", text))
        }
        (None, Some(file)) => Files::Disk.read(file).map_err(|why| {
            Diagnostic::error("X005", format!("{}: {why}", file.display()))
                .help("name a file with a SPARQL query")
                .into()
        }),
        (None, None) => Err(Diagnostic::error("X005", "no query was given")
            .help("give its text, or a file with -f")
            .into()),
    }
}

/// Triples in Turtle, one per line.
fn turtle(triples: &[[Term; 3]]) -> String {
    turtle_prefixes() + &triples.iter().map(turtle_line).collect::<String>()
}

/// The beginning of a graph in Turtle.
pub(super) fn turtle_prefixes() -> String {
    names::PREFIXES
        .iter()
        .map(|(prefix, namespace)| format!("@prefix {prefix}: <{namespace}> .\n"))
        .collect()
}

/// A triple in Turtle.
pub(super) fn turtle_line([s, p, o]: &[Term; 3]) -> String {
    format!(
        "{} {} {} .\n",
        turtle_term(s),
        turtle_term(p),
        turtle_term(o)
    )
}

/// A term in Turtle. Literals whose shorthand would have another type carry their datatype.
fn turtle_term(term: &Term) -> String {
    let quoted = |text: &str| {
        let text = text
            .replace('\\', "\\\\")
            .replace('"', "\\\"")
            .replace('\n', "\\n")
            .replace('\r', "\\r");
        format!("\"{text}\"")
    };
    match term {
        Term::Double(value) => format!("\"{value}\"^^xsd:double"),
        Term::Decimal(text) => format!("\"{text}\"^^xsd:decimal"),
        Term::String(text) => quoted(text),
        Term::LangString(text, tag) => format!("{}@{tag}", quoted(text)),
        Term::Literal(text, datatype) => format!("{}^^{}", quoted(text), names::shorten(datatype)),
        Term::Iri(_) | Term::Blank(_) | Term::Integer(_) | Term::Boolean(_) => term.to_string(),
    }
}
