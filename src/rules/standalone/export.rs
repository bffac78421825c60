//! `@export` and `@output`: write tuples as delimited text.

use std::path::{Component, Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use crate::model::values;
use crate::standalone::program::{Closure, Program};
use crate::standalone::settings::Settings;
use crate::syntax::{Statement, Syntax, Transfer};
use actcheck_base::{Below, Diagnostic, Diagnostics, RuleFault, Span, TermId, did_you_mean};

const FORMATS: [&str; 3] = ["csv", "dsv", "tsv"];
const OPTIONS: [&str; 2] = ["resource", "delimiter"];

/// A predicate and its output file.
#[derive(Debug)]
pub(super) struct Export {
    pub(super) predicate: String,
    pub(super) path: PathBuf,
    delimiter: u8,
}

/// Returns the exports of a program.
pub(super) fn exports(program: &Program, diagnostics: &mut Diagnostics) -> Vec<Export> {
    let syntax = &program.syntax;
    let mut found: Vec<Export> = Vec::new();
    for statement in &syntax.statements {
        let (exports, span): (Vec<Export>, Option<&Span>) = match statement {
            Statement::Transfer(transfer) if !transfer.import => {
                (export(syntax, transfer, diagnostics).into_iter().collect(), Some(&transfer.span))
            }
            Statement::Output { predicates } => (predicates.iter().map(|one| output(syntax, one)).collect(), None),
            _ => (Vec::new(), None),
        };
        for export in exports {
            match found.iter().find(|other| other.path == export.path) {
                None => found.push(export),
                // The same table twice is one file.
                Some(other) if other.predicate == export.predicate && other.delimiter == export.delimiter => {}
                Some(other) => {
                    let (path, predicate) = (export.path.display(), &export.predicate);
                    let message = format!("`{path}` is the file of `{predicate}` and of `{}`", other.predicate);
                    let error = Diagnostic::error("R073", message).help("name another file with `resource = \"…\"`");
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
    Export { predicate: predicate.to_owned(), path, delimiter: b',' }
}

fn export(syntax: &Syntax, transfer: &Transfer, diagnostics: &mut Diagnostics) -> Option<Export> {
    if !FORMATS.contains(&transfer.format.as_str()) {
        let message = format!("exports to `{}` are not supported", transfer.format);
        let help = did_you_mean(&transfer.format, FORMATS);
        diagnostics.push(Diagnostic::error("R070", message).at(&syntax.source, transfer.span.clone()).help(help));
        return None;
    }
    let mut settings = Settings::new(syntax, transfer, &OPTIONS);
    let usual = || format!("{}.{}", file_name(syntax, &transfer.predicate), transfer.format);
    let path = settings.text("resource").unwrap_or_else(usual);
    let delimiter = settings.delimiter();
    let failed = settings.diagnostics.has_errors();
    if path.ends_with(".gz") {
        let help = "export to a name without `.gz`, and compress the file afterwards";
        settings.error(&settings.span("resource"), "exports are not compressed".to_owned(), help);
    }
    diagnostics.extend(settings.diagnostics);
    let relative = Path::new(&path);
    let inside = relative.is_relative() && !relative.components().any(|c| matches!(c, Component::ParentDir));
    if !inside {
        let message = format!("`{path}` is outside the output folder");
        let help = "use a relative path without `..`, and set the output folder with `-D`";
        diagnostics.push(Diagnostic::error("R073", message).at(&syntax.source, transfer.span.clone()).help(help));
        return None;
    }
    // Without `.`, so that equal files have equal paths.
    let path = relative.components().filter(|c| matches!(c, Component::Normal(_))).collect();
    (!failed).then(|| Export { predicate: transfer.predicate.clone(), path, delimiter })
}

/// Converts a predicate's name, with its base, to a file name. Other characters become `_`.
fn file_name(syntax: &Syntax, predicate: &str) -> String {
    let base = syntax.base.as_deref().filter(|_| !predicate.contains(':')).unwrap_or("");
    let fits = |c: char| c.is_alphanumeric() || ".-_".contains(c);
    format!("{base}{predicate}").chars().map(|c| if fits(c) { c } else { '_' }).collect()
}

/// Writes the sorted tuples of a predicate and returns their number. The complete file is renamed into place.
///
/// # Errors
/// The reason why the file can't be written, or `stop` was set.
pub(super) fn write(export: &Export, folder: &Path, closure: &Closure, stop: &AtomicBool) -> Result<usize, String> {
    let (path, below) = (folder.join(&export.path), Below::new(folder));
    let lower = |error: &dyn std::fmt::Display| error.to_string().to_lowercase();
    below.create_folder(path.parent().unwrap_or(folder)).map_err(|error| lower(&error))?;
    let mut rows: Vec<&[TermId]> = closure.rows_unsorted(&export.predicate).collect();
    rows.sort_unstable_by(|a, b| a.iter().map(|id| closure.term(*id)).cmp(b.iter().map(|id| closure.term(*id))));
    let new = below.new_file(&path).map_err(|error| lower(&error))?;
    let file = new.writer().map_err(|error| lower(&error))?;
    let mut writer = csv::WriterBuilder::new().delimiter(export.delimiter).from_writer(file);
    let mut count = 0;
    for row in rows {
        if stop.load(Ordering::Relaxed) {
            return Err(RuleFault::Interrupted.to_string());
        }
        if !row.is_empty() {
            writer.write_record(row.iter().map(|id| values::full(closure.term(*id)))).map_err(|error| lower(&error))?;
        }
        count += 1;
    }
    writer.flush().map_err(|error| lower(&error))?;
    new.finish().map_err(|error| lower(&error))?;
    Ok(count)
}
