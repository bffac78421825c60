//! `@import`: reads the rows of a file as facts.

use std::path::{Path, PathBuf};

use oxrdfio::{RdfFormat, RdfParser};

use crate::check::checking::{Checking, Role, counted};
use crate::model::program::{CheckedProgram, Predicates};
use crate::standalone::faults::Faults;
use crate::standalone::input::{Compression, Ended, InputFault, Limits, open};
use crate::standalone::json::read_json;
use crate::standalone::records::{Records, RowRead};
use crate::standalone::settings::Settings;
use crate::standalone::sink::ImportSink;
use crate::standalone::statements::read_rdf;
use crate::standalone::table::{ColumnKind, Layout, read_table};
use crate::syntax::{LiteralSyntax, Statement, Syntax, Transfer};
use actcheck_base::{
    Diagnostic, Diagnostics, RuleFault, Source, Span, TermId, Terms, did_you_mean,
};

/// Formats of imports.
const FORMATS: [&str; 10] = [
    "csv", "dsv", "tsv", "json", "rdf", "ntriples", "nquads", "turtle", "trig", "rdfxml",
];
const TABLE_OPTIONS: [&str; 7] = [
    "resource",
    "format",
    "delimiter",
    "quoting",
    "compression",
    "ignore_headers",
    "limit",
];
const JSON_OPTIONS: [&str; 3] = ["resource", "compression", "limit"];
const RDF_OPTIONS: [&str; 4] = ["resource", "compression", "limit", "base"];

/// A file to import.
#[derive(Debug)]
pub(super) struct Import {
    source: Source,
    span: Span,
    predicate: String,
    arity: usize,
    path: PathBuf,
    compression: Compression,
    content: ImportFormat,
    limit: usize,
}

#[derive(Debug)]
enum ImportFormat {
    Table(Layout),
    Rdf {
        format: RdfFormat,
        base: Option<String>,
    },
    Json,
}

/// First pass: collects the imports. The number of columns comes from an option, a rule, or the
/// file itself.
pub(super) fn define_imports(
    checking: &mut Checking<'_>,
    syntax: &Syntax,
    folder: &Path,
    limits: &Limits<'_>,
) -> Vec<Import> {
    let mut imports = Vec::new();
    for statement in &syntax.statements {
        if let Statement::Transfer(transfer) = statement
            && transfer.import
            && let Some(import) = define_import(checking, syntax, transfer, (folder, limits))
        {
            let Import {
                predicate, arity, ..
            } = &import;
            checking.define_predicate(
                &syntax.source,
                predicate,
                *arity,
                &transfer.span,
                Role::Standalone,
            );
            imports.push(import);
        }
    }
    imports
}

/// Returns `None` if an error was reported.
fn define_import(
    checking: &mut Checking<'_>,
    syntax: &Syntax,
    transfer: &Transfer,
    place: (&Path, &Limits<'_>),
) -> Option<Import> {
    let source = &syntax.source;
    known_format(checking, source, transfer)?;
    let options: &[&str] = match transfer.format.as_str() {
        "csv" | "dsv" | "tsv" => &TABLE_OPTIONS,
        "json" => &JSON_OPTIONS,
        _ => &RDF_OPTIONS,
    };
    let mut settings = Settings::new(syntax, transfer, options);
    let import = import_of(checking, syntax, transfer, place, &mut settings);
    let failed = settings.diagnostics.has_errors();
    checking.diagnostics.extend(settings.diagnostics);
    import.filter(|_| !failed)
}

/// Returns `None` if an error was reported.
fn import_of(
    checking: &mut Checking<'_>,
    syntax: &Syntax,
    transfer: &Transfer,
    (folder, limits): (&Path, &Limits<'_>),
    settings: &mut Settings<'_>,
) -> Option<Import> {
    let source = &syntax.source;
    if !transfer.options.iter().any(|(name, _)| name == "resource") {
        let help = format!("write `{}{{resource = \"file.{0}\"}}`", transfer.format);
        settings.error(
            &transfer.span,
            "the import has no `resource`".to_owned(),
            &help,
        );
        return None;
    }
    let resource = settings.text("resource")?;
    if resource.contains("://") {
        let help = "download it first; imports read local files only";
        checking.error(
            "R072",
            source,
            &transfer.span,
            format!("`{resource}` is not a local file"),
            help,
        );
        return None;
    }
    let path = folder.join(&resource);
    let compression = compression(settings, &path);
    let (content, arity) = match transfer.format.as_str() {
        "csv" | "dsv" | "tsv" => table(
            checking,
            syntax,
            transfer,
            settings,
            (&path, compression, limits),
        )?,
        "json" => (ImportFormat::Json, 3),
        _ => rdf(checking, source, transfer, settings, &path)?,
    };
    let limit = settings.count("limit").unwrap_or(usize::MAX);
    let (predicate, span) = (transfer.predicate.clone(), transfer.span.clone());
    Some(Import {
        source: source.clone(),
        span,
        predicate,
        arity,
        path,
        compression,
        content,
        limit,
    })
}

/// Reports an unknown format.
fn known_format(checking: &mut Checking<'_>, source: &Source, transfer: &Transfer) -> Option<()> {
    let format = transfer.format.as_str();
    if FORMATS.contains(&format) {
        return Some(());
    }
    let (message, help) = match format {
        "sparql" => (
            format!("imports from {format} are not supported"),
            format!("formats: {}", FORMATS.join(", ")),
        ),
        _ => (
            format!("unknown format `{format}`"),
            did_you_mean(format, FORMATS),
        ),
    };
    checking.error("R070", source, &transfer.span, message, help);
    None
}

/// Returns the stated compression, or that of the file's name.
pub(super) fn compression(settings: &mut Settings<'_>, path: &Path) -> Compression {
    let usual = match path.extension().is_some_and(|extension| extension == "gz") {
        true => Compression::Gzip,
        false => Compression::None,
    };
    let Some(word) = settings.text("compression") else {
        return usual;
    };
    match word.as_str() {
        "gzip" => Compression::Gzip,
        "none" => Compression::None,
        _ => {
            let help = did_you_mean(&word, ["gzip", "none"]);
            settings.error(
                &settings.span("compression"),
                format!("unknown compression `{word}`"),
                &help,
            );
            usual
        }
    }
}

/// Returns the layout of a table and the number of imported columns. Returns `None` if an error was
/// reported.
fn table(
    checking: &Checking<'_>,
    syntax: &Syntax,
    transfer: &Transfer,
    settings: &mut Settings<'_>,
    (path, compression, limits): (&Path, Compression, &Limits<'_>),
) -> Option<(ImportFormat, usize)> {
    let delimiter = settings.delimiter();
    let (quoting, headers) = (
        settings.flag("quoting").unwrap_or(true),
        settings.flag("ignore_headers") == Some(true),
    );
    let known = match transfer.options.iter().any(|(name, _)| name == "format") {
        true => settings.columns()?,
        false => {
            let used = arity_in_rules(checking, syntax, &transfer.predicate);
            let count =
                used.or_else(|| columns_of_file(path, compression, delimiter, quoting, limits));
            vec![ColumnKind::Any; count.unwrap_or(0)]
        }
    };
    if known.is_empty()
        && std::fs::metadata(path).is_ok_and(|file| !file.is_file() || file.len() > 0)
    {
        let help = "add `format = (any, …)` with one word for each column";
        settings.error(
            &transfer.span,
            format!("the number of columns of `{}` is unknown", path.display()),
            help,
        );
        return None;
    }
    let arity = known
        .iter()
        .filter(|column| **column != ColumnKind::Skip)
        .count();
    Some((
        ImportFormat::Table(Layout {
            delimiter,
            quoting,
            headers,
            columns: known,
        }),
        arity,
    ))
}

/// Returns the RDF format of a file and its number of columns: 3 for triples, 4 for quads. Returns
/// `None` if an error was reported.
fn rdf(
    checking: &mut Checking<'_>,
    source: &Source,
    transfer: &Transfer,
    settings: &mut Settings<'_>,
    path: &Path,
) -> Option<(ImportFormat, usize)> {
    let Some(format) = rdf_format(&transfer.format, path) else {
        let help = "name the format: ntriples, nquads, turtle, trig or rdfxml";
        let message = format!("the RDF format of `{}` is unknown", path.display());
        checking.error("R070", source, &transfer.span, message, help);
        return None;
    };
    let arity = if format.supports_datasets() { 4 } else { 3 };
    let base = settings.text("base");
    if base.is_some() && matches!(format, RdfFormat::NTriples | RdfFormat::NQuads) {
        let message = format!("an import of `{}` has no option `base`", transfer.format);
        settings.error(
            &settings.span("base"),
            message,
            "N-Triples and N-Quads have no relative IRIs; remove it",
        );
    } else if let Some(base) = &base
        && let Err(error) = RdfParser::from_format(format).with_base_iri(base)
    {
        let message = format!(
            "`{base}` is not a base IRI: {}",
            error.to_string().to_lowercase()
        );
        settings.error(&settings.span("base"), message, "write an absolute IRI");
    }
    Some((ImportFormat::Rdf { format, base }, arity))
}

/// Returns the number of arguments of a predicate, or `None` if the program does not use it.
fn arity_in_rules(checking: &Checking<'_>, syntax: &Syntax, predicate: &str) -> Option<usize> {
    if let Some(definition) = checking.defined.get(&(0, predicate.to_owned())) {
        return Some(definition.arity);
    }
    syntax
        .statements
        .iter()
        .find_map(|statement| match statement {
            Statement::Rule(rule) => rule.body.iter().find_map(|literal| match literal {
                LiteralSyntax::Atom(atom) | LiteralSyntax::Negated(atom)
                    if atom.predicate == predicate =>
                {
                    Some(atom.args.len())
                }
                _ => None,
            }),
            _ => None,
        })
}

/// Returns the number of columns in the first row, or `None` if the file is empty, unreadable or a
/// pipe.
fn columns_of_file(
    path: &Path,
    compression: Compression,
    delimiter: u8,
    quoting: bool,
    limits: &Limits<'_>,
) -> Option<usize> {
    // A pipe can be read only once.
    if !std::fs::metadata(path).ok()?.is_file() {
        return None;
    }
    let mut records = Records::new(
        limits.counted(open(path, compression, limits).ok()?),
        delimiter,
        quoting,
    );
    let found = records.next();
    limits.settle();
    (found.ok()? == RowRead::Row).then_some(records.len())
}

pub(super) fn rdf_format(format: &str, path: &Path) -> Option<RdfFormat> {
    match format {
        "ntriples" => Some(RdfFormat::NTriples),
        "nquads" => Some(RdfFormat::NQuads),
        "turtle" => Some(RdfFormat::Turtle),
        "trig" => Some(RdfFormat::TriG),
        "rdfxml" => Some(RdfFormat::RdfXml),
        _ => {
            let name = path.file_name()?.to_str()?;
            let name = name.strip_suffix(".gz").unwrap_or(name);
            match RdfFormat::from_extension(name.rsplit_once('.')?.1)? {
                // These have no name above.
                RdfFormat::N3 | RdfFormat::JsonLd { .. } => None,
                known => Some(known),
            }
        }
    }
}

/// Second pass: adds the rows of a file to the program's facts.
///
/// A row or statement that can't be read is an error, or with `lenient` left out with a warning.
pub(super) fn import(
    import: Import,
    predicates: &Predicates,
    terms: &mut Terms,
    program: &mut CheckedProgram,
    limits: &Limits<'_>,
    lenient: bool,
) -> Diagnostics {
    let fault = |code, message: String| {
        Diagnostic::error(code, message).at(&import.source, import.span.clone())
    };
    let Some(id) = predicates.find(0, &import.predicate, None) else {
        return Diagnostics::new();
    };
    let arity = predicates.get(id).arity;
    if arity != import.arity {
        let message = format!(
            "`{}` has {}, but the file has {}",
            import.predicate,
            counted(arity),
            import.arity
        );
        return fault("R072", message)
            .help("use every column, or skip some with `format = (any, skip, …)`")
            .into();
    }
    let others = program.facts.iter().filter(|(other, _)| **other != id);
    let other_bytes = others.map(|(_, rows)| rows.len()).sum::<usize>() * size_of::<TermId>();
    let rows = program.facts.entry(id).or_default();
    let mut sink = ImportSink {
        terms,
        rows,
        limits,
        other_bytes,
        unchecked: 0,
    };
    let mut faults = Faults::default();
    let path = import.path.display();
    match read(&import, &mut sink, &mut faults) {
        Err(reason) => match limits.ended() {
            None => {
                let help = "paths are relative to the program's folder";
                fault("R072", format!("`{path}` can't be read: {reason}"))
                    .help(help)
                    .into()
            }
            Some(Ended::Interrupted) => fault("R091", RuleFault::Interrupted.to_string()).into(),
            Some(ended) => {
                let (limit, help) = match ended {
                    Ended::Memory => ("memory", "import fewer rows or columns: `limit`, `skip`"),
                    _ => (
                        "time",
                        "allow more time with `--max-time`; a pipe without a writer has no end",
                    ),
                };
                fault(
                    "R090",
                    format!("the import of `{path}` exceeded the limit of {limit}"),
                )
                .help(help)
                .into()
            }
        },
        Ok(()) if faults.is_empty() => Diagnostics::new(),
        Ok(()) if lenient => {
            let warning = Diagnostic::warning("R074", faults.message(&import.path));
            warning
                .at(&import.source, import.span.clone())
                .help("rows and statements that can't be read were left out")
                .into()
        }
        Ok(()) => {
            let help = "correct the file or the options of the import; `--lenient` leaves out these rows or statements";
            fault("R074", faults.message(&import.path))
                .help(help)
                .into()
        }
    }
}

fn read(import: &Import, sink: &mut ImportSink<'_>, faults: &mut Faults) -> Result<(), InputFault> {
    let reader = open(&import.path, import.compression, sink.limits)?;
    match &import.content {
        ImportFormat::Table(layout) => read_table(
            sink.limits.counted(reader),
            layout,
            import.limit,
            sink,
            faults,
        ),
        ImportFormat::Json => read_json(reader, import.limit, sink, faults),
        ImportFormat::Rdf { format, base } => read_rdf(
            sink.limits.counted(reader),
            *format,
            base.as_deref(),
            import.limit,
            sink,
            faults,
        ),
    }
    .and_then(|()| sink.check())
    .map_err(InputFault::Read)
}

#[cfg(test)]
mod tests {
    use crate::standalone::Program;
    use actcheck_base::Source;

    /// A table of two rows, compressed with gzip.
    const PACKED: [u8; 28] = [
        0x1f, 0x8b, 0x08, 0x00, 0x00, 0x00, 0x00, 0x00, 0x02, 0xff, 0x33, 0xd4, 0x31, 0xe2, 0x32,
        0xd6, 0x31, 0xe1, 0x02, 0x00, 0x47, 0x93, 0x6c, 0xaf, 0x08, 0x00, 0x00, 0x00,
    ];

    fn load(bytes: &[u8]) -> Result<Program, actcheck_base::Diagnostics> {
        let folder = tempfile::tempdir().expect("there is a folder for temporary files");
        std::fs::write(folder.path().join("table.csv.gz"), bytes).expect("the folder is writable");
        let text = "@import p :- csv{resource = \"table.csv.gz\", format = (any, any)} .";
        Program::load(&Source::new("p.rls", text), folder.path())
    }

    #[test]
    #[cfg(feature = "gzip")]
    fn a_compressed_table_is_imported() {
        let program = load(&PACKED).expect("the table is valid");
        let closure = program
            .close(crate::standalone::Engine::Fast, &crate::Budget::default())
            .expect("it is small");
        assert_eq!((closure.arity("p"), closure.count("p")), (Some(2), 2));
    }

    #[test]
    #[cfg(feature = "gzip")]
    fn a_cut_compressed_table_is_refused() {
        for length in 1..PACKED.len() {
            let found = load(&PACKED[..length]).expect_err("it is cut").to_string();
            assert!(found.contains("R072"), "{length}: {found}");
        }
    }

    #[test]
    #[cfg(not(feature = "gzip"))]
    fn a_compressed_table_without_the_feature_is_reported() {
        let found = load(&PACKED).expect_err("the feature is off").to_string();
        assert!(
            found.contains("R072") && found.contains("feature `gzip`"),
            "{found}"
        );
    }
}
