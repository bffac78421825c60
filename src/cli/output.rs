//! Results to the output stream, diagnostics to the error stream.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::io::{IsTerminal, Write};

use miette::{GraphicalReportHandler, GraphicalTheme, ThemeCharacters, ThemeStyles};

use crate::{own_files, terminal};
use actcheck_base::{Diagnostic, Diagnostics, Severity, printable_in_colour};
use actcheck_report::Page;

/// Writes results. A reader that has gone away (`| head`) ends the process quietly.
///
/// On a terminal, control characters of names and messages from files and skills are shown as
/// escapes.
pub fn print(text: &str) {
    if std::io::stdout().is_terminal() {
        print_bytes(printable_in_colour(text).as_bytes());
    } else {
        print_bytes(text.as_bytes());
    }
}

/// Writes results in sentences, broken between words into lines that fit the terminal.
pub fn print_prose(text: &str) {
    print(&page().set(text));
}

/// The width and colours of results.
pub fn page() -> Page {
    terminal::of_results()
}

/// Writes binary results, as [`print`] does.
pub fn print_bytes(results: &[u8]) {
    let mut out = std::io::stdout().lock();
    if let Err(error) = out.write_all(results).and_then(|()| out.flush()) {
        if error.kind() == std::io::ErrorKind::BrokenPipe {
            std::process::exit(0);
        }
        print_diagnostics(
            &Diagnostic::error("X001", format!("results could not be written: {error}")).into(),
        );
        std::process::exit(2);
    }
}

/// Prints messages: to the error stream if results go to standard output (`printed`).
pub fn tell(lines: &[String], printed: bool) {
    let text: String = lines.iter().map(|line| format!("{line}\n")).collect();
    if printed {
        print_error_text(&terminal::of_errors().set(&text));
    } else {
        print_prose(&text);
    }
}

/// Prints to the error stream that there are no results: an empty table looks like a fault.
pub fn print_none(sentence: &str) {
    print_error_text(&terminal::of_errors().set(&format!("{sentence}\n")));
}

/// Writes a text to the error stream.
pub fn print_error_text(text: &str) {
    // If the error stream itself fails, there is nowhere left to report it.
    let _ = std::io::stderr()
        .lock()
        .write_all(printable_in_colour(text).as_bytes());
}

/// Returns the first `most` faults and, if there are more, one with their number.
pub fn first_of(
    faults: Diagnostics,
    most: usize,
    others: impl Fn(usize) -> Diagnostic,
) -> Diagnostics {
    let left_out = faults.len().saturating_sub(most);
    let mut first = Diagnostics::new();
    faults
        .into_iter()
        .take(most)
        .for_each(|fault| first.push(fault));
    if left_out > 0 {
        first.push(others(left_out));
    }
    first
}

/// Most diagnostics that are printed at once: the excerpt of each takes time in proportion to its
/// file.
const MOST_PRINTED: usize = 200;

/// Writes faults with their places, the first 200 if there are more, and the number of errors.
pub fn print_diagnostics(faults: &Diagnostics) {
    let mut text = String::new();
    let page = terminal::of_errors();
    let handler = handler(page);
    let told = first_of_foreign(once(faults));
    for fault in told.iter().take(MOST_PRINTED) {
        let fault = broken_into_lines(with_file_in_message(&without_foreign_text(fault)), page);
        if handler.render_report(&mut text, &fault).is_err() {
            text.push_str(&fault.to_string());
        }
        text.push('\n');
    }
    if let Some(more @ 1..) = told.len().checked_sub(MOST_PRINTED) {
        text.push_str(&format!("{more} more are not printed\n"));
    }
    let errors = faults
        .iter()
        .filter(|fault| fault.severity == Severity::Error)
        .count();
    if errors > 1 {
        text.push_str(&format!("{errors} errors\n"));
    }
    // For people only; programs read the codes.
    if let (true, Some(first)) = (std::io::stderr().is_terminal(), faults.iter().next()) {
        text.push_str(&page.set(&format!(
            "`actcheck explain {}` prints usual causes and the way out\n",
            first.code
        )));
    }
    print_error_text(&text);
}

/// Number of places that are named for a warning with many.
const PLACES_NAMED: usize = 3;

/// The diagnostics with each warning once, since all files of a collection often have the same one.
/// Its help names other places.
fn once(faults: &Diagnostics) -> Vec<Diagnostic> {
    let mut told: Vec<Diagnostic> = Vec::new();
    let mut first: HashMap<(&str, &str, Option<&str>), usize> = HashMap::new();
    let mut others: BTreeMap<usize, (usize, Vec<String>)> = BTreeMap::new();
    for fault in faults.iter() {
        let same = (fault.code, fault.message.as_str(), fault.help.as_deref());
        match first.get(&same) {
            Some(first) if fault.severity == Severity::Warning && fault.source.is_some() => {
                let (count, named) = others.entry(*first).or_default();
                *count += 1;
                // Finding a place takes time in proportion to its file.
                named.extend(if named.len() < PLACES_NAMED {
                    fault.place()
                } else {
                    None
                });
            }
            _ => {
                first.entry(same).or_insert(told.len());
                told.push(fault.clone());
            }
        }
    }
    for (idx, (count, named)) in others {
        let help = told[idx]
            .help
            .take()
            .map_or_else(String::new, |help| help + "\n");
        let places = if count == 1 { "place" } else { "places" };
        let more = if count > named.len() { ", …" } else { "" };
        told[idx].help = Some(format!(
            "{help}the same in {count} more {places}: {}{more}",
            named.join(", ")
        ));
    }
    told
}

/// Breaks message and help between words, but not within code.
fn broken_into_lines(fault: Diagnostic, page: Page) -> Diagnostic {
    let width = page.width.map_or(WIDEST, |width| width.min(WIDEST));
    let fill = |text: &str, before: usize| {
        Page {
            width: width.checked_sub(before),
            ..page
        }
        .fill(text)
    };
    // In front of a message are four columns, such as `  × `, and in front of a help `  help: `.
    Diagnostic {
        message: fill(&fault.message, 4),
        help: fault.help.as_deref().map(|help| fill(help, 8)),
        ..fault
    }
}

/// Only the first error of each file outside of the project: messages may quote its words.
fn first_of_foreign(faults: Vec<Diagnostic>) -> Vec<Diagnostic> {
    let mut seen: BTreeSet<String> = BTreeSet::new();
    let mut is_first = |fault: &Diagnostic| match &fault.source {
        Some(source) if fault.severity == Severity::Error && !own_files::is_own(&source.name) => {
            seen.insert(source.name.to_string())
        }
        _ => true,
    };
    faults.into_iter().filter(|fault| is_first(fault)).collect()
}

/// A fault in a file outside of the project has its place, but no excerpt.
fn without_foreign_text(fault: &Diagnostic) -> Diagnostic {
    let is_foreign = fault
        .source
        .as_ref()
        .is_some_and(|source| !own_files::is_own(&source.name));
    match fault.place() {
        Some(place) if is_foreign && fault.span.is_some() => {
            // Parsers quote a part of a text that they can't parse.
            let is_syntax = fault.message.starts_with("this is not ");
            let problem = fault
                .message
                .split_once(": ")
                .filter(|_| is_syntax)
                .map_or(&*fault.message, |(what, _)| what);
            let message = format!("{place}: {problem}");
            Diagnostic {
                source: None,
                span: None,
                message,
                ..fault.clone()
            }
        }
        _ => fault.clone(),
    }
}

/// A fault of a whole file has no excerpt with the file's name, so the message names the file.
fn with_file_in_message(fault: &Diagnostic) -> Diagnostic {
    match (&fault.source, &fault.span) {
        (Some(source), None) => Diagnostic {
            message: format!("{}: {}", source.name, fault.message),
            ..fault.clone()
        },
        _ => fault.clone(),
    }
}

/// Widest message of a diagnostic: longer lines are hard to read. Unit: columns.
const WIDEST: usize = 100;

/// Colours are those of the terminal's own palette, which fit a light and a dark background.
fn handler(page: Page) -> GraphicalReportHandler {
    let styles = if page.colour {
        ThemeStyles::ansi()
    } else {
        ThemeStyles::none()
    };
    let theme = GraphicalTheme {
        characters: ThemeCharacters::unicode(),
        styles,
    };
    GraphicalReportHandler::new_themed(theme)
        .with_width(WIDEST)
        .with_wrap_lines(false)
        .with_links(false)
}
