//! The inputs below `tests/fuzz_corpus/`, each given to its fuzz target: none panics, and all come back.
//!
//! They are a sample of what ten minutes of libFuzzer kept, short and long ones, because each reached code that no smaller
//! one did. `fuzz/README.md` tells how to search for more.

use std::path::{Path, PathBuf};

#[path = "../fuzz/src/lib.rs"]
mod entrances;

/// The inputs of a target, sorted.
fn inputs(target: &str) -> Vec<PathBuf> {
    let folder = Path::new("tests/fuzz_corpus").join(target);
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths
}

/// Gives every input to an entrance. Of bytes that are no UTF-8, libFuzzer's adapter gives what stands before them.
fn run(target: &str, entrance: fn(&str)) {
    let inputs = inputs(target);
    assert!(inputs.len() >= 20, "only {} inputs of {target}", inputs.len());
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
fn sparql_properties_come_back_from_their_corpus() {
    run("sparql_property", entrances::sparql_property);
}

/// Found by `evaluate`: behind a comment without end in the braces of an f-string, the fault's place began one byte before
/// the end of the text, in the middle of a character, and could not be shown.
#[test]
fn a_torn_f_string_has_its_fault_at_a_character() {
    for text in ["a(f\"{/*é", "a(f\"{/*🦀", "a(f\"{?x🦀\")", "a(f\"{🦀"] {
        entrances::parse(text);
        entrances::check(text);
    }
}
