//! Entry point of the fuzz target `import`: a file of any format is refused or read, quickly and
//! without a panic.

use std::collections::BTreeSet;
use std::path::Path;

use actcheck::base::{Diagnostics, Severity, Source, Term};
use actcheck::rules::Budget;
use actcheck::rules::standalone::{Engine, Loading, Program};

/// The formats: a name, the ending of the file, and the options of the import.
pub const FORMATS: [(&str, &str, &str); 12] = [
    ("csv", "csv", ", format = (any, any)"),
    (
        "csv",
        "csv",
        ", format = (int, string, double), ignore_headers = true",
    ),
    (
        "dsv",
        "txt",
        ", delimiter = \";\", quoting = false, format = (skip, any)",
    ),
    ("tsv", "tsv", ", format = (string, any), limit = 3"),
    ("csv", "csv.gz", ", format = (any, any)"),
    ("ntriples", "nt", ""),
    ("nquads", "nq", ""),
    ("turtle", "ttl", ", base = \"http://x/\""),
    ("trig", "trig", ""),
    ("rdfxml", "rdf", ""),
    ("rdfxml", "rdf.gz", ", base = \"http://x/\""),
    ("json", "json", ""),
];

/// Small enough for many inputs per second; every import returns within it.
fn budget() -> Budget {
    Budget {
        tuples: 100_000,
        bytes: 1 << 20,
        secs: 5.0,
        ..Budget::default()
    }
}

/// Imports the bytes after the first, which chooses the format, strictly and leniently. Returns
/// whether the strict import had no fault.
pub fn import(data: &[u8]) -> bool {
    let Some((first, bytes)) = data.split_first() else {
        return false;
    };
    let (format, ending, options) = FORMATS[usize::from(*first) % FORMATS.len()];
    let folder = tempfile::tempdir().expect("there is a folder for temporary files");
    let name = format!("file.{ending}");
    std::fs::write(folder.path().join(&name), bytes).expect("the folder is writable");
    let text = format!("@import p :- {format}{{resource = \"{name}\"{options}}} .");
    let strict = load(&text, folder.path(), false);
    let lenient = load(&text, folder.path(), true);
    match (strict, lenient) {
        (Ok((rows, warnings)), Ok((same_rows, same_warnings))) => {
            assert!(
                warnings.is_empty() && same_warnings.is_empty(),
                "a warning, but no error: {same_warnings}"
            );
            assert!(rows == same_rows, "strict and lenient imports differ");
            if format == "csv" && ending == "csv" && !options.contains("headers") {
                assert_eq!(
                    rows.is_empty(),
                    of_the_crate(bytes) == 0,
                    "rows of the crate csv"
                );
            }
            true
        }
        (Err(errors), Ok((_, warnings))) => {
            assert!(errors.iter().all(|error| error.code == "R074"), "{errors}");
            let messages = |found: &Diagnostics| {
                found
                    .iter()
                    .map(|one| one.message.clone())
                    .collect::<Vec<_>>()
            };
            assert_eq!(messages(&errors), messages(&warnings));
            assert!(
                warnings
                    .iter()
                    .all(|warning| warning.severity == Severity::Warning)
            );
            assert!(
                messages(&errors)
                    .iter()
                    .all(|message| message.contains(&format!("{name}:"))),
                "no place: {errors}"
            );
            false
        }
        (Err(errors), Err(_)) => {
            assert!(
                errors
                    .iter()
                    .all(|error| ["R072", "R090"].contains(&error.code)),
                "{errors}"
            );
            false
        }
        (Ok(_), Err(errors)) => panic!("only the lenient import fails: {errors}"),
    }
}

/// The rows of a program's `p`, and its warnings.
fn load(
    text: &str,
    folder: &Path,
    lenient: bool,
) -> Result<(BTreeSet<Vec<Term>>, Diagnostics), Diagnostics> {
    let source = Source::new("fuzz.rls", text);
    let program = Program::load_as(
        &source,
        folder,
        &Loading {
            lenient,
            ..Loading::within(&budget())
        },
    )?;
    let closure = program
        .close(Engine::Fast, &budget())
        .expect("there are no rules");
    Ok((closure.tuples("p").into_iter().collect(), program.warnings))
}

/// Number of rows that the crate `csv` reads.
fn of_the_crate(bytes: &[u8]) -> usize {
    csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .from_reader(bytes)
        .byte_records()
        .count()
}
