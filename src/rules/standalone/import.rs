//! `@import`: reads the rows of a file as facts.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use oxrdf::GraphName;
use oxrdfio::{RdfFormat, RdfParseError, RdfParser};

use crate::check::checking::{Checking, Role, counted};
use crate::check::options::{OptionValue, options};
use crate::model::program::{Predicates, Program};
use crate::model::rdf::from_rdf;
use crate::model::values::lexical;
use crate::standalone::stoppable::Stoppable;
use crate::standalone::table::{ColumnKind, LeftOut, delimiter_of, read_table};
use crate::syntax::{LiteralSyntax, Statement, Syntax, Transfer};
use actcheck_base::{Diagnostic, Diagnostics, Source, Span, Term, TermId, Terms, did_you_mean};

/// Formats of imports.
const FORMATS: [&str; 9] = ["csv", "dsv", "tsv", "rdf", "ntriples", "nquads", "turtle", "trig", "rdfxml"];
const OPTIONS: [&str; 8] =
    ["resource", "format", "delimiter", "quoting", "compression", "ignore_headers", "limit", "base"];
/// Only this much of a file is read, after decompression. Unit: bytes.
const SIZE_LIMIT: u64 = 4 << 30;

/// A file to import.
#[derive(Debug)]
pub(super) struct Import {
    source: Source,
    span: Span,
    predicate: String,
    arity: usize,
    path: PathBuf,
    content: Content,
    limit: usize,
}

#[derive(Debug)]
enum Content {
    Table { delimiter: u8, quoting: bool, headers: bool, columns: Vec<ColumnKind> },
    Rdf { format: RdfFormat, base: Option<String> },
}

/// First pass: collects the imports. The number of columns comes from an option, a rule, or the file itself.
pub(super) fn define_imports(checking: &mut Checking<'_>, syntax: &Syntax, folder: &Path) -> Vec<Import> {
    let mut imports = Vec::new();
    for statement in &syntax.statements {
        if let Statement::Transfer(transfer) = statement
            && transfer.import
            && let Some(import) = define_import(checking, syntax, transfer, folder)
        {
            let Import { predicate, arity, .. } = &import;
            checking.define_predicate(&syntax.source, predicate, *arity, &transfer.span, Role::Standalone);
            imports.push(import);
        }
    }
    imports
}

fn define_import(checking: &mut Checking<'_>, syntax: &Syntax, transfer: &Transfer, folder: &Path) -> Option<Import> {
    let source = &syntax.source;
    known_words(checking, source, transfer)?;
    let options = options(checking, syntax, transfer);
    let Some(resource) = text(&options, "resource") else {
        let help = "write `csv{resource = \"file.csv\"}`";
        checking.error("R071", source, &transfer.span, "the import has no `resource`", help);
        return None;
    };
    if resource.contains("://") {
        let help = "download it first; imports read local files only";
        checking.error("R072", source, &transfer.span, format!("`{resource}` is not a local file"), help);
        return None;
    }
    let path = folder.join(&resource);
    let (content, arity) = match transfer.format.as_str() {
        "csv" | "dsv" | "tsv" => table(checking, syntax, transfer, &options, &path)?,
        _ => rdf(checking, source, transfer, &options, &path)?,
    };
    let limit = text(&options, "limit").and_then(|limit| limit.parse().ok()).unwrap_or(usize::MAX);
    let predicate = transfer.predicate.clone();
    Some(Import { source: source.clone(), span: transfer.span.clone(), predicate, arity, path, content, limit })
}

type Options = std::collections::BTreeMap<String, OptionValue>;

fn text(options: &Options, name: &str) -> Option<String> {
    match options.get(name) {
        Some(OptionValue::One(term)) => Some(lexical(term)),
        _ => None,
    }
}

/// Reports unknown formats and options. Returns `None` if the format is unknown.
fn known_words(checking: &mut Checking<'_>, source: &Source, transfer: &Transfer) -> Option<()> {
    let format = transfer.format.as_str();
    if !FORMATS.contains(&format) {
        let (message, help) = match format {
            "json" | "sparql" => {
                (format!("imports from {format} are not supported"), format!("formats: {}", FORMATS.join(", ")))
            }
            _ => (format!("unknown format `{format}`"), did_you_mean(format, FORMATS)),
        };
        checking.error("R070", source, &transfer.span, message, help);
        return None;
    }
    for (name, value) in transfer.options.iter().filter(|(name, _)| !OPTIONS.contains(&name.as_str())) {
        let message = format!("unknown option `{name}`");
        checking.error("R071", source, &value.span, message, did_you_mean(name, OPTIONS));
    }
    Some(())
}

/// Returns the options of a table and the number of imported columns. Returns `None` if an error was reported.
fn table(
    checking: &mut Checking<'_>,
    syntax: &Syntax,
    transfer: &Transfer,
    options: &Options,
    path: &Path,
) -> Option<(Content, usize)> {
    let flag = |name: &str, usual: bool| text(options, name).map_or(usual, |value| value == "true");
    let (quoting, headers) = (flag("quoting", true), flag("ignore_headers", false));
    let delimiter = delimiter_of(&transfer.format, text(options, "delimiter").as_deref());
    let stated = match columns(options) {
        Ok(columns) => columns,
        Err(word) => {
            let help = did_you_mean(&word, ColumnKind::NAMES);
            checking.error("R071", &syntax.source, &transfer.span, format!("unknown column format `{word}`"), help);
            return None;
        }
    };
    let columns = stated.unwrap_or_else(|| {
        let used = arity_in_rules(checking, syntax, &transfer.predicate);
        vec![ColumnKind::Any; used.or_else(|| columns_of_file(path, delimiter)).unwrap_or(0)]
    });
    let arity = columns.iter().filter(|column| **column != ColumnKind::Skip).count();
    Some((Content::Table { delimiter, quoting, headers, columns }, arity))
}

/// Returns the RDF format of a file and its number of columns: 3 for triples, 4 for quads. Returns `None` if an error
/// was reported.
fn rdf(
    checking: &mut Checking<'_>,
    source: &Source,
    transfer: &Transfer,
    options: &Options,
    path: &Path,
) -> Option<(Content, usize)> {
    let Some(format) = rdf_format(&transfer.format, path) else {
        let help = "name the format: ntriples, nquads, turtle, trig or rdfxml";
        let message = format!("the RDF format of `{}` is unknown", path.display());
        checking.error("R070", source, &transfer.span, message, help);
        return None;
    };
    let arity = if format.supports_datasets() { 4 } else { 3 };
    Some((Content::Rdf { format, base: text(options, "base") }, arity))
}

/// Returns the number of arguments of a predicate, or `None` if the program does not use it.
fn arity_in_rules(checking: &Checking<'_>, syntax: &Syntax, predicate: &str) -> Option<usize> {
    if let Some(definition) = checking.defined.get(&(0, predicate.to_owned())) {
        return Some(definition.arity);
    }
    syntax.statements.iter().find_map(|statement| match statement {
        Statement::Rule(rule) => rule.body.iter().find_map(|literal| match literal {
            LiteralSyntax::Atom(atom) | LiteralSyntax::Negated(atom) if atom.predicate == predicate => {
                Some(atom.args.len())
            }
            _ => None,
        }),
        _ => None,
    })
}

fn columns(options: &Options) -> Result<Option<Vec<ColumnKind>>, String> {
    let terms = match options.get("format") {
        None => return Ok(None),
        Some(OptionValue::One(term)) => std::slice::from_ref(term),
        Some(OptionValue::Many(terms)) => terms.as_slice(),
    };
    let kinds = terms.iter().map(|term| {
        let word = lexical(term);
        ColumnKind::from_word(&word).ok_or(word)
    });
    kinds.collect::<Result<Vec<_>, _>>().map(Some)
}

/// Returns the number of columns in the first row, or `None` if the file is empty or unreadable.
fn columns_of_file(path: &Path, delimiter: u8) -> Option<usize> {
    let reader = open(path).ok()?;
    let mut table =
        csv::ReaderBuilder::new().delimiter(delimiter).has_headers(false).flexible(true).from_reader(reader);
    table.records().next()?.ok().map(|row| row.len())
}

fn rdf_format(format: &str, path: &Path) -> Option<RdfFormat> {
    match format {
        "ntriples" => Some(RdfFormat::NTriples),
        "nquads" => Some(RdfFormat::NQuads),
        "turtle" => Some(RdfFormat::Turtle),
        "trig" => Some(RdfFormat::TriG),
        "rdfxml" => Some(RdfFormat::RdfXml),
        _ => {
            let name = path.file_name()?.to_str()?;
            let name = name.strip_suffix(".gz").unwrap_or(name);
            RdfFormat::from_extension(name.rsplit_once('.')?.1)
        }
    }
}

/// Opens a file and decompresses it if its name ends in `.gz`.
fn open(path: &Path) -> Result<Box<dyn Read>, String> {
    let file = std::fs::File::open(path).map_err(|error| error.to_string().to_lowercase())?;
    let file = std::io::BufReader::new(file);
    if path.extension().is_some_and(|extension| extension == "gz") {
        return unpacked(file);
    }
    Ok(Box::new(file.take(SIZE_LIMIT)))
}

/// Decompresses a file.
#[cfg(feature = "gzip")]
fn unpacked(file: impl Read + 'static) -> Result<Box<dyn Read>, String> {
    Ok(Box::new(flate2::read::MultiGzDecoder::new(file).take(SIZE_LIMIT)))
}

/// Reports that compressed files need the feature `gzip`.
#[cfg(not(feature = "gzip"))]
fn unpacked(_file: impl Read) -> Result<Box<dyn Read>, String> {
    Err("this build can't decompress it; unpack it, or build `actcheck-rules` with the feature `gzip`".to_owned())
}

/// Second pass: adds the rows of a file to the program's facts.
pub(super) fn import(
    import: Import,
    predicates: &Predicates,
    terms: &mut Terms,
    program: &mut Program,
    diagnostics: &mut Diagnostics,
    stop: &AtomicBool,
) {
    let Some(id) = predicates.find(0, &import.predicate, None) else { return };
    let arity = predicates.get(id).arity;
    let fault = |message: String, help: &str| {
        Diagnostic::error("R072", message).at(&import.source, import.span.clone()).help(help)
    };
    if arity != import.arity {
        let message = format!("`{}` has {}, but the file has {}", import.predicate, counted(arity), import.arity);
        diagnostics.push(fault(message, "use every column, or skip some with `format = (any, skip, …)`"));
        return;
    }
    let rows = program.facts.entry(id).or_default();
    let reader = open(&import.path).map(|inner| Stoppable { inner, stop });
    let read = reader.and_then(|reader| match &import.content {
        Content::Table { delimiter, quoting, headers, columns } => {
            read_table(reader, *delimiter, *quoting, *headers, columns, import.limit, terms, rows)
        }
        Content::Rdf { format, base } => read_rdf(reader, *format, base.as_deref(), import.limit, terms, rows),
    });
    match read {
        Err(reason) => {
            let message = format!("`{}` can't be read: {reason}", import.path.display());
            diagnostics.push(fault(message, "paths are relative to the program's folder"));
        }
        Ok(LeftOut { count: 0, .. }) => {}
        Ok(LeftOut { count, first }) => {
            let message = format!("{count} rows of `{}` were left out; the first: {first}", import.path.display());
            let help = "each row needs one field for each column, in the format of the column";
            let warning = Diagnostic::warning("R074", message).at(&import.source, import.span.clone()).help(help);
            diagnostics.push(warning);
        }
    }
}

fn read_rdf(
    reader: impl Read,
    format: RdfFormat,
    base: Option<&str>,
    limit: usize,
    terms: &mut Terms,
    rows: &mut Vec<TermId>,
) -> Result<LeftOut, String> {
    let mut left_out = LeftOut::default();
    let mut parser = RdfParser::from_format(format);
    if let Some(base) = base {
        parser = parser.with_base_iri(base).map_err(|error| error.to_string())?;
    }
    let quads = format.supports_datasets();
    // Nemo's name for the default graph.
    let default_graph = Term::iri("tag:nemo:defaultgraph");
    for quad in parser.for_reader(reader).take(limit) {
        let quad = match quad {
            Ok(quad) => quad,
            Err(RdfParseError::Io(error)) => return Err(error.to_string()),
            Err(RdfParseError::Syntax(error)) => {
                left_out.add(|| error.to_string());
                continue;
            }
        };
        if quads {
            let graph = match quad.graph_name {
                GraphName::NamedNode(node) => Term::iri(node.as_str()),
                GraphName::BlankNode(node) => Term::Blank(node.as_str().into()),
                GraphName::DefaultGraph => default_graph.clone(),
            };
            rows.push(terms.intern(graph));
        }
        for term in [quad.subject.into(), quad.predicate.into(), quad.object] {
            rows.push(terms.intern(from_rdf(&term)));
        }
    }
    Ok(left_out)
}

#[cfg(test)]
mod tests {
    use crate::standalone::Program;
    use actcheck_base::Source;

    /// A table of two rows, compressed with gzip.
    const PACKED: [u8; 28] = [
        0x1f, 0x8b, 0x08, 0x00, 0x00, 0x00, 0x00, 0x00, 0x02, 0xff, 0x33, 0xd4, 0x31, 0xe2, 0x32, 0xd6, 0x31, 0xe1,
        0x02, 0x00, 0x47, 0x93, 0x6c, 0xaf, 0x08, 0x00, 0x00, 0x00,
    ];

    fn load(folder: &std::path::Path) -> Result<Program, actcheck_base::Diagnostics> {
        std::fs::write(folder.join("table.csv.gz"), PACKED).expect("the folder is writable");
        Program::load(&Source::new("p.rls", "@import p :- csv{resource = \"table.csv.gz\"} ."), folder)
    }

    #[test]
    #[cfg(feature = "gzip")]
    fn a_compressed_table_is_imported() {
        let folder = tempfile::tempdir().expect("there is a folder for temporary files");
        let program = load(folder.path()).expect("the table is valid");
        let closure = program.close(crate::standalone::Engine::Fast, &crate::Budget::default()).expect("it is small");
        assert_eq!((closure.arity("p"), closure.count("p")), (Some(2), 2));
    }

    #[test]
    #[cfg(not(feature = "gzip"))]
    fn a_compressed_table_without_the_feature_is_reported() {
        let folder = tempfile::tempdir().expect("there is a folder for temporary files");
        let found = load(folder.path()).expect_err("the feature is off").to_string();
        assert!(found.contains("R072") && found.contains("feature `gzip`"), "{found}");
    }
}
