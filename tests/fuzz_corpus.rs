//! Every input below `tests/fuzz_corpus/` is given to its fuzz target: none panics, and all return.
//!
//! The inputs are a sample of those that ten minutes of libFuzzer kept, short and long ones,
//! because each reached code that no smaller one did. `fuzz/README.md` describes how to search for
//! more.

use std::path::{Path, PathBuf};

#[path = "../fuzz/src/lib.rs"]
pub mod entrances;

/// The inputs of a target, sorted.
fn inputs(target: &str) -> Vec<PathBuf> {
    let folder = Path::new("tests/fuzz_corpus").join(target);
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    paths.sort();
    paths
}

/// Gives every input to an entry point. Of bytes that are not UTF-8, libFuzzer's adapter gives the
/// valid prefix.
fn run(target: &str, entrance: fn(&str)) {
    let inputs = inputs(target);
    assert!(
        inputs.len() >= 20,
        "only {} inputs of {target}",
        inputs.len()
    );
    for input in inputs {
        let bytes = std::fs::read(&input).unwrap();
        let text = bytes.utf8_chunks().next().map_or("", |chunk| chunk.valid());
        if std::panic::catch_unwind(|| entrance(text)).is_err() {
            panic!("{} brings {target} down", input.display());
        }
    }
}

#[test]
fn the_parser_reads_its_corpus() {
    run("parse", entrances::parse);
}

#[test]
fn the_checker_reads_its_corpus() {
    run("check", entrances::check);
}

#[test]
fn the_evaluators_agree_on_their_corpus() {
    run("evaluate", entrances::evaluate);
}

#[test]
fn sparql_properties_read_their_corpus() {
    run("sparql_property", entrances::sparql_property);
}

/// Found by `evaluate`: after an unterminated comment in the braces of an f-string, the fault's
/// span began one byte before the end of the text, in the middle of a character, and could not be
/// shown.
#[test]
fn a_fault_in_a_torn_f_string_is_at_a_character_boundary() {
    for text in ["a(f\"{/*é", "a(f\"{/*🦀", "a(f\"{?x🦀\")", "a(f\"{🦀"] {
        entrances::parse(text);
        entrances::check(text);
    }
}
