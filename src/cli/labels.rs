//! Files with people's labels of runs.

use std::path::Path;

use actcheck_base::{Diagnostic, Diagnostics};

/// The columns of the file.
const COLUMNS: [&str; 3] = ["run", "property", "label"];

/// A label, with its line in the file.
pub struct Label {
    /// Id of the run.
    pub run: String,
    /// Name of the property.
    pub property: String,
    /// Whether people say that it passes.
    pub passes: bool,
    /// Line in the file, from 1.
    pub line: usize,
}

/// Reads the labels. Returns also the faults of lines, so that those of the history are reported
/// with them.
pub fn read(path: &Path) -> Result<(Vec<Label>, Diagnostics), Diagnostics> {
    let unreadable = |why: String| {
        Diagnostic::error(
            "X097",
            format!("can't read the labels {}: {why}", path.display()),
        )
        .help(
            "write a CSV file: `run,property,label`, then lines such as `k7f3-3,MovedObject,pass`",
        )
    };
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_path(path)
        .map_err(|error| unreadable(error.to_string()))?;
    let head = reader
        .headers()
        .map_err(|error| unreadable(error.to_string()))?
        .clone();
    let column = |name: &str| {
        head.iter()
            .position(|own| own.trim_start_matches('\u{feff}') == name)
    };
    let [Some(run), Some(property), Some(label)] = COLUMNS.map(column) else {
        let missing: Vec<&str> = COLUMNS
            .into_iter()
            .filter(|name| column(name).is_none())
            .collect();
        return Err(unreadable(format!("line 1 has no column {}", missing.join(", "))).into());
    };
    let mut faults = Diagnostics::new();
    let mut labels = Vec::new();
    for record in reader.records() {
        let record = match record {
            Ok(record) => record,
            Err(error) => {
                faults.push(unreadable(error.to_string()));
                break;
            }
        };
        let line = record
            .position()
            .map_or(0, |at| usize::try_from(at.line()).unwrap_or(0));
        let of = |column: usize| record.get(column).unwrap_or_default().to_owned();
        let passes = match of(label).to_lowercase().as_str() {
            "pass" | "passed" | "true" | "yes" | "1" | "success" => true,
            "fail" | "failed" | "false" | "no" | "0" | "failure" => false,
            other => {
                let message = format!("{}, line {line}: the label is `{other}`", path.display());
                faults.push(Diagnostic::error("X097", message).help("write pass or fail"));
                continue;
            }
        };
        labels.push(Label {
            run: of(run),
            property: of(property),
            passes,
            line,
        });
    }
    if labels.is_empty() && faults.is_empty() {
        faults.push(unreadable("it has no labels".to_owned()));
    }
    Ok((labels, faults))
}
