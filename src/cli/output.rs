//! Results to the output stream, diagnostics to the error stream.

use std::io::{IsTerminal, Write};

use miette::{GraphicalReportHandler, GraphicalTheme};

use actcheck_base::{Diagnostic, Diagnostics, Severity, printable_in_colour};

/// Writes results. A reader that has gone away (`| head`) ends the process quietly.
///
/// On a terminal, control characters of names and messages from files and skills are shown as escapes.
pub fn print(text: &str) {
    if std::io::stdout().is_terminal() {
        print_bytes(printable_in_colour(text).as_bytes());
    } else {
        print_bytes(text.as_bytes());
    }
}

/// Writes binary results, as [`print`] does.
pub fn print_bytes(results: &[u8]) {
    let mut out = std::io::stdout().lock();
    if let Err(error) = out.write_all(results).and_then(|()| out.flush()) {
        if error.kind() == std::io::ErrorKind::BrokenPipe {
            std::process::exit(0);
        }
        print_diagnostics(&Diagnostic::error("X001", format!("results could not be written: {error}")).into());
        std::process::exit(2);
    }
}

/// Prints messages: to the error stream if results go to standard output (`printed`).
pub fn tell(lines: &[String], printed: bool) {
    let text: String = lines.iter().map(|line| format!("{line}\n")).collect();
    if printed {
        // If the error stream itself fails, there is nowhere left to report it.
        let _ = std::io::stderr().lock().write_all(printable_in_colour(&text).as_bytes());
    } else {
        print(&text);
    }
}

/// Whether results may be coloured.
pub fn colour() -> bool {
    std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none()
}

/// Most diagnostics that are printed at once: the excerpt of each takes time in proportion to its file.
const MOST_PRINTED: usize = 200;

/// Writes faults with their places, the first 200 if there are more, and the number of errors.
pub fn print_diagnostics(faults: &Diagnostics) {
    let mut text = String::new();
    let handler = handler();
    for fault in faults.iter().take(MOST_PRINTED) {
        let fault = with_file_in_message(fault);
        if handler.render_report(&mut text, &fault).is_err() {
            text.push_str(&fault.to_string());
        }
        text.push('\n');
    }
    if let Some(more @ 1..) = faults.len().checked_sub(MOST_PRINTED) {
        text.push_str(&format!("{more} more are not printed\n"));
    }
    let errors = faults.iter().filter(|fault| fault.severity == Severity::Error).count();
    if errors > 1 {
        text.push_str(&format!("{errors} errors\n"));
    }
    // For people only; programs read the codes.
    if let (true, Some(first)) = (std::io::stderr().is_terminal(), faults.iter().next()) {
        text.push_str(&format!("`actcheck explain {}` prints usual causes and the way out\n", first.code));
    }
    // If the error stream itself fails, there is nowhere left to report it.
    let _ = std::io::stderr().lock().write_all(printable_in_colour(&text).as_bytes());
}

/// A fault of a whole file has no excerpt with the file's name, so the message names the file.
fn with_file_in_message(fault: &Diagnostic) -> Diagnostic {
    match (&fault.source, &fault.span) {
        (Some(source), None) => Diagnostic { message: format!("{}: {}", source.name, fault.message), ..fault.clone() },
        _ => fault.clone(),
    }
}

fn handler() -> GraphicalReportHandler {
    let terminal = std::io::stderr().is_terminal();
    let theme = match (terminal, std::env::var_os("NO_COLOR").is_some()) {
        (true, false) => GraphicalTheme::unicode(),
        _ => GraphicalTheme::unicode_nocolor(),
    };
    GraphicalReportHandler::new_themed(theme).with_width(100).with_links(false)
}
