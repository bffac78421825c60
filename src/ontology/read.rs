//! Reads RDF files and their imports into statements.

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

use oxrdfio::{RdfFormat, RdfParseError, RdfParser};

use crate::{file_iri, literal};
use actcheck_base::{
    Diagnostic, Diagnostics, FileFault, Files, Source, Span, Term, check_turtle, check_xml, names,
};

/// Importing this IRI adds the ontology embedded in the program, independent of the importing
/// file's location.
const SHIPPED: &str = "https://w3id.org/actcheck/ontology";
const SHIPPED_FOLDER: &str = "ontology";
const SHIPPED_ROOT: &str = "actions.ttl";
/// Maximum number of syntax errors reported per file; more are usually consequences of the first
/// ones.
const MOST_SYNTAX_ERRORS: usize = 5;
/// Maximum number of statements of all files; each takes about 200 bytes.
const MOST_STATEMENTS: usize = 2_000_000;
/// Maximum number of imported files; more indicate a mistake.
const MOST_FILES: usize = 200;

/// A statement with its source position.
#[derive(Debug, Clone)]
pub(super) struct Statement {
    pub(super) subject: Term,
    /// An IRI.
    pub(super) predicate: Arc<str>,
    pub(super) object: Term,
    /// Index of its source.
    pub(super) text: usize,
    /// End of the line on which the statement ends. Unit: bytes.
    pub(super) end: usize,
}

/// All statements of a root file and its imports.
#[derive(Debug, Default)]
pub(super) struct Reading {
    pub(super) sources: Vec<Source>,
    /// For each source, the base of its relative paths.
    pub(super) homes: Vec<Home>,
    pub(super) statements: Vec<Statement>,
}

/// Location of a source: its relative paths are relative to this folder.
#[derive(Debug, Clone)]
pub(super) struct Home {
    pub(super) files: Files,
    pub(super) folder: PathBuf,
}

/// A file that is queued for reading.
struct Waiting {
    home: Home,
    /// Percent-encoded path relative to the home's folder.
    relative: String,
    importer: Option<(usize, Span)>,
}

/// Reads a file and its imports, each once. Follows relative paths and [`SHIPPED`], the embedded
/// ontology. All other imports get a warning: nothing is downloaded.
pub(super) fn read(files: &Files, root: &Path, found: &mut Diagnostics) -> Reading {
    let mut reading = Reading::default();
    let home = Home {
        files: files.clone(),
        folder: root.parent().unwrap_or(Path::new("")).to_path_buf(),
    };
    let name = root
        .file_name()
        .map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let mut waiting = vec![Waiting {
        home,
        relative: file_iri::encoded(&name),
        importer: None,
    }];
    let mut seen: BTreeSet<PathBuf> = BTreeSet::new();
    while let Some(Waiting {
        home,
        relative,
        importer,
    }) = waiting.pop()
    {
        let path = file_iri::on_disk(&home.folder, &relative);
        // An embedded file and a file on disk may have the same path, so the embedded one gets a
        // prefix.
        let key = if home.files == Files::Shipped {
            Path::new("built-in:").join(&path)
        } else {
            path.clone()
        };
        if !seen.insert(key) || seen.len() > MOST_FILES {
            continue;
        }
        let source = match home.files.read(&path) {
            Ok(source) => source,
            Err(reason) => {
                found.push(unreadable(
                    &path,
                    &reason,
                    importer.map(|(text, span)| (&reading.sources[text], span)),
                ));
                continue;
            }
        };
        let text = reading.sources.len();
        parse(
            &source,
            text,
            &file_iri::base_of(&relative),
            &mut reading.statements,
            found,
        );
        reading.sources.push(source);
        reading.homes.push(home);
        let mut imports = imports_of(&reading, text, found);
        imports.reverse();
        waiting.extend(imports);
    }
    reading.statements.iter_mut().for_each(make_plain);
    reading
}

/// Returns the statements of a source in Turtle or RDF/XML, in reading order. The file extension of
/// its name determines the format, or the first characters if the extension is ambiguous. Imports
/// are not followed.
///
/// `document` distinguishes the blank nodes of several sources.
///
/// # Errors
/// `O002` for each syntax error, at most five; `O013` if parsing could exhaust time or memory.
pub fn triples_of(source: &Source, document: usize) -> Result<Vec<[Term; 3]>, Diagnostics> {
    let (mut statements, mut found) = (Vec::new(), Diagnostics::new());
    parse(source, document, "", &mut statements, &mut found);
    found.or(statements
        .into_iter()
        .map(|it| [it.subject, Term::Iri(it.predicate), it.object])
        .collect())
}

fn unreadable(path: &Path, reason: &FileFault, importer: Option<(&Source, Span)>) -> Diagnostic {
    match importer {
        None => Diagnostic::error(
            "O001",
            format!("cannot read the ontology {}: {reason}", path.display()),
        )
        .help("name a Turtle (.ttl) or RDF/XML (.owl, .rdf, .xml) file"),
        Some((source, span)) => Diagnostic::error(
            "O003",
            format!(
                "cannot read the imported ontology {}: {reason}",
                path.display()
            ),
        )
        .at(source, span)
        .help("relative imports are resolved against the importing file"),
    }
}

fn imports_of(reading: &Reading, text: usize, found: &mut Diagnostics) -> Vec<Waiting> {
    let imports = format!("{}imports", names::OWL);
    let of_text = reading
        .statements
        .iter()
        .filter(|statement| statement.text == text && *statement.predicate == *imports);
    let mut waiting = Vec::new();
    for statement in of_text {
        let span = reading.place(statement, statement.object.as_iri().unwrap_or(&imports));
        let importer = Some((text, span.clone()));
        if statement.object.as_iri() == Some(SHIPPED) {
            let home = Home {
                files: Files::Shipped,
                folder: PathBuf::from(SHIPPED_FOLDER),
            };
            waiting.push(Waiting {
                home,
                relative: SHIPPED_ROOT.to_owned(),
                importer,
            });
        } else if let Some(relative) = statement.object.as_iri().and_then(file_iri::relative_of) {
            waiting.push(Waiting {
                home: reading.homes[text].clone(),
                relative,
                importer,
            });
        } else {
            let fault =
                Diagnostic::warning("O018", "this import is not read: it is not a relative path");
            let help = format!(
                "keep a copy of the ontology beside this file, and import it as `<name.ttl>`; only <{SHIPPED}> is built in"
            );
            found.push(fault.at(&reading.sources[text], span).help(help));
        }
    }
    waiting
}

/// Parses one source. Statements before and after a syntax error are kept.
fn parse(
    source: &Source,
    text: usize,
    base: &str,
    statements: &mut Vec<Statement>,
    found: &mut Diagnostics,
) {
    let format = format_of(source);
    if format == RdfFormat::RdfXml
        && let Err(faults) = check_xml(source, "O013")
    {
        found.extend(faults);
        return;
    }
    if format == RdfFormat::Turtle
        && let Err(faults) = check_turtle(source, "O013")
    {
        found.extend(faults);
        return;
    }
    let position = Rc::new(Cell::new(mark_length(source)));
    let lines = Lines {
        text: source.text.as_bytes(),
        position: Rc::clone(&position),
    };
    let parser = RdfParser::from_format(format)
        .with_base_iri(base)
        .unwrap_or_else(|_| RdfParser::from_format(format));
    let mut blanks: BTreeMap<String, Arc<str>> = BTreeMap::new();
    let mut errors = 0;
    for quad in parser.for_reader(lines) {
        let end = position.get();
        if statements.len() == MOST_STATEMENTS {
            let message = format!("the ontology has more than {MOST_STATEMENTS} statements");
            let help = "an ontology describes kinds of things; keep data in files that `actcheck datalog` imports";
            found.push(
                Diagnostic::error("O013", message)
                    .at(source, line_before(&source.text, end))
                    .help(help),
            );
            return;
        }
        match quad {
            Ok(quad) => {
                let subject = literal::subject(&quad.subject, |id| blank(&mut blanks, text, id));
                let Some(object) = literal::object(&quad.object, |id| blank(&mut blanks, text, id))
                else {
                    continue;
                };
                statements.push(Statement {
                    subject,
                    predicate: quad.predicate.as_str().into(),
                    object,
                    text,
                    end,
                });
            }
            Err(error) => {
                errors += 1;
                found.push(syntax_error(source, &error, end));
                // The XML parser does not recover.
                if errors == MOST_SYNTAX_ERRORS || format == RdfFormat::RdfXml {
                    break;
                }
            }
        }
    }
}

fn syntax_error(source: &Source, error: &RdfParseError, end: usize) -> Diagnostic {
    let location = match error {
        RdfParseError::Syntax(error) => error.location(),
        RdfParseError::Io(_) => None,
    };
    let offset = |position: u64| {
        usize::try_from(position)
            .map_or(end, |position| position + mark_length(source))
            .min(source.text.len())
    };
    let span = match location {
        Some(range) => offset(range.start.offset)..offset(range.end.offset),
        None => line_before(&source.text, end),
    };
    // The parser's messages begin with the position, which diagnostics already have.
    let text = error.to_string();
    let message = text
        .rsplit_once("Parser error at ")
        .and_then(|(_, rest)| rest.split_once(": "))
        .map_or(&*text, |(_, m)| m);
    let message = lower_case_start(&message.trim_end_matches('.').replace('\n', " "));
    Diagnostic::error(
        "O002",
        format!("this is not {}: {message}", language(source)),
    )
    .at(source, span)
    .help(match format_of(source) {
        RdfFormat::RdfXml => "close every tag, and declare every prefix with `xmlns:…`",
        _ => "end every statement with ` .`, and declare every prefix with `@prefix …: <…> .`",
    })
}

/// Converts the first letter to lower case ("A dot is missing"), unless the first word is in
/// capitals.
fn lower_case_start(text: &str) -> String {
    let mut chars = text.chars();
    match (chars.next(), chars.clone().next()) {
        (Some(first), Some(second)) if !second.is_uppercase() => {
            first.to_lowercase().chain(chars).collect()
        }
        _ => text.to_owned(),
    }
}

fn line_before(text: &str, end: usize) -> Span {
    let mut end = end.min(text.len());
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    let line_end = text[..end].trim_end().len();
    let start = text[..line_end]
        .rfind('\n')
        .map_or(0, |newline| newline + 1);
    let indent = text[start..line_end].len() - text[start..line_end].trim_start().len();
    start + indent..line_end
}

fn language(source: &Source) -> &'static str {
    if format_of(source) == RdfFormat::RdfXml {
        "RDF/XML"
    } else {
        "Turtle"
    }
}

/// Length of the byte order mark, which some editors write but the parsers don't accept. Unit:
/// bytes.
fn mark_length(source: &Source) -> usize {
    if source.text.starts_with('\u{feff}') {
        '\u{feff}'.len_utf8()
    } else {
        0
    }
}

/// Determines the format from the file extension, or from the first characters if the extension is
/// ambiguous.
fn format_of(source: &Source) -> RdfFormat {
    let ending = source.name.rsplit('.').next().unwrap_or("").to_lowercase();
    match ending.as_str() {
        "ttl" | "nt" => RdfFormat::Turtle,
        "rdf" | "xml" => RdfFormat::RdfXml,
        // `.owl` files can have either format.
        _ if begins_like_xml(&source.text) => RdfFormat::RdfXml,
        _ => RdfFormat::Turtle,
    }
}

fn begins_like_xml(text: &str) -> bool {
    let text = text.trim_start_matches('\u{feff}').trim_start();
    ["<?xml", "<!", "<rdf:", "<RDF", "<owl:"]
        .iter()
        .any(|start| text.starts_with(start))
}

/// Numbers blank nodes, so that the same text always gives the same statements.
fn blank(known: &mut BTreeMap<String, Arc<str>>, text: usize, id: &str) -> Arc<str> {
    let next = known.len() + 1;
    Arc::clone(
        known
            .entry(id.to_owned())
            .or_insert_with(|| format!("t{}b{next}", text + 1).into()),
    )
}

/// Feeds a text to the parser line by line, to track how far it has read.
struct Lines<'a> {
    text: &'a [u8],
    position: Rc<Cell<usize>>,
}

impl Read for Lines<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let rest = self.text.get(self.position.get()..).unwrap_or_default();
        let rest = &rest[..rest.len().min(buffer.len())];
        let length = rest
            .iter()
            .position(|byte| *byte == b'\n')
            .map_or(rest.len(), |newline| newline + 1);
        buffer[..length].copy_from_slice(&rest[..length]);
        self.position.set(self.position.get() + length);
        Ok(length)
    }
}

impl Reading {
    /// Span of an IRI in a statement: the last occurrence of its local name before the statement's
    /// end.
    pub(super) fn place(&self, statement: &Statement, iri: &str) -> Span {
        let text = &self.sources[statement.text].text;
        let before = &text[..floor_char(text, statement.end)];
        last_mention(before, written_name(iri)).unwrap_or_else(|| line_before(text, statement.end))
    }
}

/// The part of an IRI that occurs in the text: after the last `#`, `/` or the prefix's `:`; for
/// files, the file name.
fn written_name(iri: &str) -> &str {
    names::local(iri)
}

fn last_mention(text: &str, name: &str) -> Option<Span> {
    if name.is_empty() {
        return None;
    }
    let in_name = |c: char| c.is_alphanumeric() || c == '_' || c == '-';
    text.rmatch_indices(name)
        .map(|(start, _)| start..start + name.len())
        .find(|span| {
            let before = text[..span.start].chars().next_back().is_some_and(in_name);
            let after = text[span.end..].chars().next().is_some_and(in_name);
            !before && !after
        })
}

fn floor_char(text: &str, offset: usize) -> usize {
    let mut offset = offset.min(text.len());
    while !text.is_char_boundary(offset) {
        offset -= 1;
    }
    offset
}

/// Replaces file IRIs by their plain form, without the placeholders that make `..` work.
fn make_plain(statement: &mut Statement) {
    for term in [&mut statement.subject, &mut statement.object] {
        if let Term::Iri(iri) = term
            && let Some(relative) = file_iri::relative_of(iri)
        {
            *iri = file_iri::plain(&relative).into();
        }
    }
}
