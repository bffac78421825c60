//! `@export` and `@output`: write tuples as delimited text.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use crate::check::options::{OptionValue, options};
use crate::model::values;
use crate::standalone::program::{Closure, Program};
use crate::standalone::table::delimiter_of;
use crate::standalone::unfinished::Unfinished;
use crate::syntax::{Statement, Syntax, Transfer};
use actcheck_base::{Diagnostic, Diagnostics, RuleFault, did_you_mean};

const FORMATS: [&str; 3] = ["csv", "dsv", "tsv"];

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
    let mut found = Vec::new();
    for statement in &syntax.statements {
        match statement {
            Statement::Transfer(transfer) if !transfer.import => {
                found.extend(export(program, syntax, transfer, diagnostics));
            }
            Statement::Output { predicates } => found.extend(predicates.iter().map(|predicate| Export {
                predicate: predicate.clone(),
                path: PathBuf::from(format!("{}.csv", file_name(syntax, predicate))),
                delimiter: b',',
            })),
            _ => {}
        }
    }
    found
}

fn export(program: &Program, syntax: &Syntax, transfer: &Transfer, diagnostics: &mut Diagnostics) -> Option<Export> {
    if !FORMATS.contains(&transfer.format.as_str()) {
        let message = format!("exports to `{}` are not supported", transfer.format);
        let help = did_you_mean(&transfer.format, FORMATS);
        diagnostics.push(Diagnostic::error("R070", message).at(&syntax.source, transfer.span.clone()).help(help));
        return None;
    }
    let mut terms = program.terms.clone();
    let mut checking = crate::check::checking::Checking::new(&mut terms, None);
    let options = options(&mut checking, syntax, transfer);
    diagnostics.extend(checking.diagnostics);
    let text = |name: &str| match options.get(name) {
        Some(OptionValue::One(term)) => Some(values::lexical(term)),
        _ => None,
    };
    let path =
        text("resource").unwrap_or_else(|| format!("{}.{}", file_name(syntax, &transfer.predicate), transfer.format));
    let relative = Path::new(&path);
    let inside = relative.is_relative() && !relative.components().any(|c| matches!(c, std::path::Component::ParentDir));
    if !inside {
        let message = format!("`{path}` is outside the output folder");
        let help = "use a relative path without `..`, and set the output folder with `-D`";
        diagnostics.push(Diagnostic::error("R073", message).at(&syntax.source, transfer.span.clone()).help(help));
        return None;
    }
    let delimiter = delimiter_of(&transfer.format, text("delimiter").as_deref());
    Some(Export { predicate: transfer.predicate.clone(), path: PathBuf::from(path), delimiter })
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
    let path = folder.join(&export.path);
    let lower = |error: &dyn std::fmt::Display| error.to_string().to_lowercase();
    if let Some(parent) = path.parent() {
        std::fs::create_dir_all(parent).map_err(|error| lower(&error))?;
    }
    let mut tuples: Vec<Vec<&actcheck_base::Term>> = closure.tuples_unsorted(&export.predicate).collect();
    tuples.sort();
    let (unfinished, file) = Unfinished::begin(path).map_err(|error| lower(&error))?;
    let mut writer = csv::WriterBuilder::new().delimiter(export.delimiter).from_writer(file);
    let mut count = 0;
    for tuple in tuples {
        if stop.load(Ordering::Relaxed) {
            return Err(RuleFault::Interrupted.to_string());
        }
        if !tuple.is_empty() {
            writer.write_record(tuple.into_iter().map(values::full)).map_err(|error| lower(&error))?;
        }
        count += 1;
    }
    writer.flush().map_err(|error| lower(&error))?;
    unfinished.keep().map_err(|error| lower(&error))?;
    Ok(count)
}
