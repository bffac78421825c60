//! `@export` and `@output`: write tuples as delimited text or as RDF.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Component, Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use oxrdf::{GraphName, NamedOrBlankNode, Quad, Term as RdfTerm};
use oxrdfio::{RdfFormat, RdfSerializer};

use crate::check::checking::counted;
use crate::model::rdf::to_rdf;
use crate::model::values;
use crate::standalone::import::{compression, rdf_format};
use crate::standalone::input::Compression;
use crate::standalone::program::{Closure, Program};
use crate::standalone::settings::Settings;
use crate::standalone::statements::DEFAULT_GRAPH;
use crate::standalone::table::ColumnKind;
use crate::syntax::{Statement, Syntax, Transfer};
use actcheck_base::{Below, Diagnostic, Diagnostics, RuleFault, Span, Term, TermId, did_you_mean};

const FORMATS: [&str; 9] = [
    "csv", "dsv", "tsv", "rdf", "ntriples", "nquads", "turtle", "trig", "rdfxml",
];
const TABLE_OPTIONS: [&str; 5] = ["resource", "format", "delimiter", "compression", "limit"];
const RDF_OPTIONS: [&str; 3] = ["resource", "compression", "limit"];

/// A predicate and its output file.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Export {
    pub(super) predicate: String,
    pub(super) path: PathBuf,
    content: ExportFormat,
    compression: Compression,
    limit: usize,
}

#[derive(Debug, PartialEq, Eq)]
enum ExportFormat {
    /// `columns`: the stated ones.
    Table {
        delimiter: u8,
        columns: Option<Vec<ColumnKind>>,
    },
    Rdf(RdfFormat),
}

/// Returns the exports of a program.
pub(super) fn exports(program: &Program, diagnostics: &mut Diagnostics) -> Vec<Export> {
    let syntax = &program.syntax;
    let mut found: Vec<Export> = Vec::new();
    for statement in &syntax.statements {
        let (exports, span): (Vec<Export>, Option<&Span>) = match statement {
            Statement::Transfer(transfer) if !transfer.import => (
                export(program, transfer, diagnostics).into_iter().collect(),
                Some(&transfer.span),
            ),
            Statement::Output { predicates } => (
                predicates.iter().map(|one| output(syntax, one)).collect(),
                None,
            ),
            _ => (Vec::new(), None),
        };
        for export in exports {
            match found.iter().find(|other| other.path == export.path) {
                None => found.push(export),
                // The same table twice is one file.
                Some(other) if *other == export => {}
                Some(other) => {
                    let (path, predicate) = (export.path.display(), &export.predicate);
                    let message = format!(
                        "`{path}` is the file of `{predicate}` and of `{}`",
                        other.predicate
                    );
                    let error = Diagnostic::error("R073", message)
                        .help("name another file with `resource = \"…\"`");
                    diagnostics.push(match span {
                        Some(span) => error.at(&syntax.source, span.clone()),
                        None => error.in_source(&syntax.source),
                    });
                }
            }
        }
    }
    found
}

fn output(syntax: &Syntax, predicate: &str) -> Export {
    let path = PathBuf::from(format!("{}.csv", file_name(syntax, predicate)));
    let content = ExportFormat::Table {
        delimiter: b',',
        columns: None,
    };
    Export {
        predicate: predicate.to_owned(),
        path,
        content,
        compression: Compression::None,
        limit: usize::MAX,
    }
}

fn export(program: &Program, transfer: &Transfer, diagnostics: &mut Diagnostics) -> Option<Export> {
    let syntax = &program.syntax;
    let format = transfer.format.as_str();
    if !FORMATS.contains(&format) {
        let message = format!("exports to `{format}` are not supported");
        let help = did_you_mean(format, FORMATS);
        diagnostics.push(
            Diagnostic::error("R070", message)
                .at(&syntax.source, transfer.span.clone())
                .help(help),
        );
        return None;
    }
    let is_table = matches!(format, "csv" | "dsv" | "tsv");
    let mut settings = Settings::new(
        syntax,
        transfer,
        if is_table {
            &TABLE_OPTIONS
        } else {
            &RDF_OPTIONS
        },
    );
    let resource = settings.text("resource");
    let named = resource.as_deref().map(Path::new);
    let rdf = if is_table {
        None
    } else {
        rdf_format(format, named.unwrap_or(Path::new("")))
    };
    let arity = program
        .predicates
        .find(0, &transfer.predicate, None)
        .map(|id| program.predicates.get(id).arity);
    let content = match rdf {
        Some(rdf) => {
            let wanted = if rdf.supports_datasets() { 4 } else { 3 };
            if let Some(arity) = arity.filter(|arity| *arity != wanted) {
                let message = format!(
                    "`{}` has {}, but `{format}` needs {wanted}",
                    transfer.predicate,
                    counted(arity)
                );
                settings.error(
                    &transfer.span,
                    message,
                    "export subject, predicate and object; first the graph for quads",
                );
            }
            ExportFormat::Rdf(rdf)
        }
        None if is_table => {
            let delimiter = settings.delimiter();
            let stated = transfer.options.iter().any(|(name, _)| name == "format");
            let columns = if stated { settings.columns() } else { None };
            if let (Some(columns), Some(arity)) = (&columns, arity.filter(|arity| *arity > 0))
                && columns.len() != arity
            {
                let message = format!(
                    "`{}` has {}, but `format` has {}",
                    transfer.predicate,
                    counted(arity),
                    columns.len()
                );
                settings.error(
                    &settings.span("format"),
                    message,
                    "write one word for each column",
                );
            }
            ExportFormat::Table { delimiter, columns }
        }
        None => {
            let message = "the RDF format of the export is unknown".to_owned();
            let help = "name the format: ntriples, nquads, turtle, trig or rdfxml";
            let found = Diagnostic::error("R070", message)
                .at(&syntax.source, transfer.span.clone())
                .help(help);
            diagnostics.push(found);
            return None;
        }
    };
    let compression = compression(&mut settings, named.unwrap_or(Path::new("")));
    let packed = if compression == Compression::Gzip {
        ".gz"
    } else {
        ""
    };
    let extension = rdf.map_or(format, |rdf| rdf.file_extension());
    let usual = || {
        format!(
            "{}.{extension}{packed}",
            file_name(syntax, &transfer.predicate)
        )
    };
    let path = resource.unwrap_or_else(usual);
    let limit = settings.count("limit").unwrap_or(usize::MAX);
    if compression == Compression::Gzip && !cfg!(feature = "gzip") {
        let help = "export without compression, or build `actcheck-rules` with the feature `gzip`";
        settings.error(
            &settings.span("resource"),
            "this build can't compress exports".to_owned(),
            help,
        );
    }
    let failed = settings.diagnostics.has_errors();
    diagnostics.extend(settings.diagnostics);
    let relative = Path::new(&path);
    let inside = relative.is_relative()
        && !relative
            .components()
            .any(|c| matches!(c, Component::ParentDir));
    if !inside {
        let message = format!("`{path}` is outside the output folder");
        let help = "use a relative path without `..`, and set the output folder with `-D`";
        diagnostics.push(
            Diagnostic::error("R073", message)
                .at(&syntax.source, transfer.span.clone())
                .help(help),
        );
        return None;
    }
    // Without `.`, so that equal files have equal paths.
    let path = relative
        .components()
        .filter(|c| matches!(c, Component::Normal(_)))
        .collect();
    (!failed).then(|| Export {
        predicate: transfer.predicate.clone(),
        path,
        content,
        compression,
        limit,
    })
}

/// Converts a predicate's name, with its base, to a file name. Other characters become `_`.
fn file_name(syntax: &Syntax, predicate: &str) -> String {
    let base = syntax
        .base
        .as_deref()
        .filter(|_| !predicate.contains(':'))
        .unwrap_or("");
    let fits = |c: char| c.is_alphanumeric() || ".-_".contains(c);
    format!("{base}{predicate}")
        .chars()
        .map(|c| if fits(c) { c } else { '_' })
        .collect()
}

/// Number of rows of an export.
#[derive(Debug, Default)]
pub(super) struct Written {
    pub(super) rows: usize,
    /// Rows that are not RDF statements.
    pub(super) left_out: usize,
}

/// Writes the sorted tuples of a predicate. The complete file is renamed into place.
///
/// # Errors
/// The reason why the file can't be written, or `stop` was set.
pub(super) fn write(
    export: &Export,
    folder: &Path,
    closure: &Closure,
    stop: &AtomicBool,
) -> std::io::Result<Written> {
    let (path, below) = (folder.join(&export.path), Below::new(folder));
    below.create_folder(path.parent().unwrap_or(folder))?;
    let mut rows: Vec<&[TermId]> = closure.rows_unsorted(&export.predicate).collect();
    rows.sort_unstable_by(|a, b| {
        a.iter()
            .map(|id| closure.term(*id))
            .cmp(b.iter().map(|id| closure.term(*id)))
    });
    let rows = rows.into_iter().map(|row| {
        row.iter()
            .map(|id| closure.term(*id))
            .collect::<Vec<&Term>>()
    });
    let rows = rows.map(|row| {
        if stop.load(Ordering::Relaxed) {
            Err(RuleFault::Interrupted)
        } else {
            Ok(row)
        }
    });
    let new = below.new_file(&path)?;
    let mut packed = Packed::new(new.writer()?, export.compression);
    let written = match &export.content {
        ExportFormat::Table { delimiter, columns } => {
            let columns = columns.as_deref();
            table(rows, export.limit, *delimiter, columns, packed.writer())
        }
        ExportFormat::Rdf(format) => statements(rows, export.limit, *format, packed.writer()),
    };
    let written = written?;
    packed.finish()?;
    new.finish()?;
    Ok(written)
}

/// Writes rows as delimited text. A row with a value that does not fit its column is left out, as
/// in Nemo.
fn table<'r>(
    rows: impl Iterator<Item = Result<Vec<&'r Term>, RuleFault>>,
    limit: usize,
    delimiter: u8,
    columns: Option<&[ColumnKind]>,
    writer: &mut dyn Write,
) -> std::io::Result<Written> {
    let mut writer = csv::WriterBuilder::new()
        .delimiter(delimiter)
        .from_writer(writer);
    let mut written = Written::default();
    for row in rows {
        let row = row.map_err(std::io::Error::other)?;
        let kind = |column| {
            columns
                .and_then(|columns| columns.get(column))
                .copied()
                .unwrap_or(ColumnKind::Any)
        };
        let kinds = (0..row.len())
            .map(kind)
            .zip(&row)
            .filter(|(kind, _)| *kind != ColumnKind::Skip);
        let Some(fields) = kinds
            .map(|(kind, term)| field(kind, term))
            .collect::<Option<Vec<String>>>()
        else {
            continue;
        };
        if written.rows == limit {
            break;
        }
        if !fields.is_empty() {
            writer.write_record(fields).map_err(std::io::Error::other)?;
        }
        written.rows += 1;
    }
    writer.flush()?;
    Ok(written)
}

/// Returns the text of a value in a column; `None` if it does not fit.
fn field(kind: ColumnKind, term: &Term) -> Option<String> {
    match (kind, term) {
        (ColumnKind::Any | ColumnKind::Skip, term) => Some(values::full(term)),
        (ColumnKind::String, Term::String(text)) => Some(text.to_string()),
        (ColumnKind::Int, Term::Integer(_)) | (ColumnKind::Double, Term::Double(_)) => {
            Some(values::lexical(term))
        }
        (ColumnKind::Int, term) if values::is_beyond_64_bits(term) => Some(values::lexical(term)),
        _ => None,
    }
}

/// Writes rows as RDF statements, of quads with the graph first. Other rows are left out.
fn statements<'r>(
    rows: impl Iterator<Item = Result<Vec<&'r Term>, RuleFault>>,
    limit: usize,
    format: RdfFormat,
    writer: &mut dyn Write,
) -> std::io::Result<Written> {
    let mut serializer = RdfSerializer::from_format(format).for_writer(writer);
    let mut written = Written::default();
    for row in rows {
        let Some(quad) = quad(&row.map_err(std::io::Error::other)?) else {
            written.left_out += 1;
            continue;
        };
        if written.rows == limit {
            break;
        }
        serializer.serialize_quad(&quad)?;
        written.rows += 1;
    }
    serializer.finish()?;
    Ok(written)
}

/// Returns the statement of a row, or `None` if it is none.
fn quad(row: &[&Term]) -> Option<Quad> {
    let is_iri = |iri: &str| !iri.contains(|c: char| c <= ' ' || "<>\"{}|\\^`".contains(c));
    let node = |term: &Term| match to_rdf(term) {
        RdfTerm::NamedNode(node) if is_iri(node.as_str()) => Some(NamedOrBlankNode::from(node)),
        RdfTerm::BlankNode(node) => Some(node.into()),
        _ => None,
    };
    let (graph, [subject, predicate, object]) = match row {
        [graph, rest @ ..] if row.len() == 4 => (Some(*graph), rest.try_into().ok()?),
        _ => (None, row.try_into().ok()?),
    };
    let graph = match graph {
        Some(Term::Iri(iri)) if iri.as_ref() == DEFAULT_GRAPH => GraphName::DefaultGraph,
        Some(term) => node(term)?.into(),
        None => GraphName::DefaultGraph,
    };
    let NamedOrBlankNode::NamedNode(predicate) = node(predicate)? else {
        return None;
    };
    let object = match to_rdf(object) {
        RdfTerm::NamedNode(node) if !is_iri(node.as_str()) => return None,
        object => object,
    };
    Some(Quad::new(node(subject)?, predicate, object, graph))
}

/// A file that is written, compressed or not.
enum Packed {
    Plain(BufWriter<File>),
    #[cfg(feature = "gzip")]
    Gzip(Box<flate2::write::GzEncoder<BufWriter<File>>>),
}

impl Packed {
    fn new(file: File, compression: Compression) -> Self {
        let file = BufWriter::new(file);
        match compression {
            #[cfg(feature = "gzip")]
            Compression::Gzip => Self::Gzip(Box::new(flate2::write::GzEncoder::new(
                file,
                flate2::Compression::default(),
            ))),
            _ => Self::Plain(file),
        }
    }

    fn writer(&mut self) -> &mut dyn Write {
        match self {
            Self::Plain(file) => file,
            #[cfg(feature = "gzip")]
            Self::Gzip(file) => file,
        }
    }

    fn finish(self) -> std::io::Result<()> {
        match self {
            Self::Plain(mut file) => file.flush(),
            #[cfg(feature = "gzip")]
            Self::Gzip(file) => file.finish()?.flush(),
        }
    }
}
