//! The words of a property name every number of its rule: its limits can be read in its
//! description.

use std::collections::BTreeSet;
use std::f64::consts::PI;

use actcheck::base::Files;
use actcheck::ontology::{self, RuleLanguage};
use regex::Regex;

use crate::support::root;

/// Numbers of rules that are not thresholds, and so need no words: property, number, reason.
const NO_THRESHOLDS: &[(&str, f64, &str)] = &[
    ("NoGraspCollisions", 1.0, "the whole of a limit"),
    (
        "NoGraspCollisions",
        0.5,
        "the largest gap that is recorded, for the margin",
    ),
    (
        "NoDriveCollisions",
        0.5,
        "the largest gap that is recorded, for the margin",
    ),
    ("NoPlaceCollisions", 1.0, "the whole of a limit"),
    (
        "NoPlaceCollisions",
        0.5,
        "the largest gap that is recorded, for the margin",
    ),
    ("MovedObject", 2.0, "halves a side"),
    ("PlaneFound", 2.0, "halves a side"),
    ("ObjectOnSurface", 2.0, "halves a side"),
    (
        "StayedInZone",
        0.215,
        "half the width of the base, which the words name",
    ),
    (
        "HeldWhileLifted",
        0.02,
        "the third sample must lie within the action: the second comes after 17 ms",
    ),
    (
        "StillWhenReleased",
        0.01,
        "leaves out the moment itself: the next sample is 17 ms later",
    ),
];

/// Numbers that the words still lack: property, number, meaning. Mend the words, and take the row
/// out.
const NOT_NAMED_YET: &[(&str, f64, &str)] = &[];

/// Words for numbers.
const WORDS: [(&str, f64); 8] = [
    ("half", 0.5),
    ("one", 1.0),
    ("two", 2.0),
    ("twice", 2.0),
    ("three", 3.0),
    ("four", 4.0),
    ("five", 5.0),
    ("a", 1.0),
];

/// Units in words, longest first, with their size in the unit of rules.
const UNITS: [(&str, f64); 10] = [
    ("cm/s", 0.01),
    ("cm", 0.01),
    ("mm", 0.001),
    ("ms", 0.001),
    ("degrees", PI / 180.0),
    ("%", 0.01),
    ("m/s", 1.0),
    ("second", 1.0),
    ("N", 1.0),
    ("s", 1.0),
];

/// The numbers of the rules that decide: those of `margin` repeat them, and `because` converts them
/// for reading.
fn numbers_of_rules(text: &str) -> Vec<f64> {
    let comment = Regex::new(r"(?m)%.*$").unwrap();
    let text = Regex::new(r#""(\\.|[^"\\])*""#)
        .unwrap()
        .replace_all(text, "\"\"")
        .into_owned();
    let text = comment.replace_all(&text, "").into_owned();
    let number = Regex::new(r"[\w?:.]*\d[\w.]*").unwrap();
    let mut found = Vec::new();
    for rule in Regex::new(r"\.\s*\n").unwrap().split(&text) {
        let head = rule.trim_start();
        if ["because(", "margin(", "@prefix"]
            .iter()
            .any(|other| head.starts_with(other))
        {
            continue;
        }
        found.extend(
            number
                .find_iter(rule)
                .filter_map(|text| text.as_str().trim_end_matches('.').parse::<f64>().ok()),
        );
    }
    found.retain(|number| *number != 0.0);
    found.sort_by(f64::total_cmp);
    found.dedup();
    found
}

/// The numbers that words name, in the units of rules. A number without a unit is itself.
fn numbers_in_words(text: &str) -> Vec<f64> {
    let words: Vec<&str> = WORDS.iter().map(|(word, _)| *word).collect();
    let number = Regex::new(&format!(r"(?:\b(?:{})\b|\d+(?:\.\d+)?)", words.join("|"))).unwrap();
    let mut found = Vec::new();
    for at in number.find_iter(text) {
        let word = WORDS
            .iter()
            .find(|(word, _)| *word == at.as_str())
            .map(|(_, value)| *value);
        let Some(value) = word.or_else(|| at.as_str().parse().ok()) else {
            continue;
        };
        // "half a second" is half of one.
        let rest = text[at.end()..].trim_start();
        let rest = if word.is_some() {
            rest.strip_prefix("a ").unwrap_or(rest)
        } else {
            rest
        };
        let ends = |unit: &str| {
            rest[unit.len()..]
                .chars()
                .next()
                .is_none_or(|next| !next.is_alphanumeric() || unit == "second")
        };
        let unit = UNITS
            .iter()
            .find(|(unit, _)| rest.starts_with(unit) && ends(unit));
        found.push(value * unit.map_or(1.0, |(_, size)| *size));
    }
    found
}

fn is_among(number: f64, numbers: &[f64]) -> bool {
    numbers
        .iter()
        .any(|other| (number - other).abs() <= 1e-6 * number.abs())
}

#[test]
fn numbers_are_read_from_rules_and_words() {
    let rule = "% 7 things\n@prefix a: <http://b/9> .\nviolation(?x1) :- p(?x1, \"8\"), ?x1 > 0.02, w:distance2d(?a) < 3 .\n\
        margin(?m) :- ?m = 5 - ?x .\nsuccess(1) :- always[0, 0.5](w:z(?a) > 1e3) .\n";
    assert_eq!(numbers_of_rules(rule), [0.02, 0.5, 1.0, 3.0, 1000.0]);
    let words = "Within 10 cm, it leans by 30 degrees for half a second; at 125 % and 80 N, 20 m/s² in 0.1 s, three times.";
    let found = numbers_in_words(words);
    for number in [0.1, PI / 6.0, 0.5, 1.25, 80.0, 20.0, 3.0] {
        assert!(is_among(number, &found), "{number}: {found:?}");
    }
    assert!(
        !is_among(0.52, &found) && !is_among(10.0, &found),
        "{found:?}"
    );
}

#[test]
fn the_words_of_every_property_name_the_numbers_of_its_rule() {
    let mut missing = BTreeSet::new();
    let mut seen = BTreeSet::new();
    let mut used = vec![false; NO_THRESHOLDS.len()];
    for file in ["actions.ttl", "extra.ttl", "time.ttl"] {
        let ontology = ontology::load(&Files::Disk, &root().join("ontology").join(file)).unwrap();
        for property in ontology
            .properties
            .values()
            .filter(|property| property.rule.language == RuleLanguage::Datalog)
        {
            let words = numbers_in_words(&format!(
                "{}. {}",
                property.label,
                property.comment.as_deref().unwrap_or_default()
            ));
            seen.insert(property.name.clone());
            for number in numbers_of_rules(&property.rule.source.text) {
                let excused = |list: &[(&str, f64, &str)]| {
                    list.iter()
                        .position(|(name, other, _)| *name == property.name && *other == number)
                };
                if let Some(at) = excused(NO_THRESHOLDS) {
                    used[at] = true;
                } else if !is_among(number, &words) {
                    missing.insert((property.name.clone(), number.to_string()));
                }
            }
        }
    }
    assert!(seen.len() > 30, "{seen:?}");
    let known: BTreeSet<(String, String)> = NOT_NAMED_YET
        .iter()
        .map(|(name, number, _)| ((*name).to_owned(), number.to_string()))
        .collect();
    let new: Vec<_> = missing.difference(&known).collect();
    let mended: Vec<_> = known.difference(&missing).collect();
    assert!(
        new.is_empty(),
        "these properties have numbers that their words don't name: {new:#?}"
    );
    assert!(
        mended.is_empty(),
        "take these out of NOT_NAMED_YET: {mended:#?}"
    );
    let unused: Vec<_> = NO_THRESHOLDS
        .iter()
        .zip(&used)
        .filter(|(_, used)| !**used)
        .collect();
    assert!(
        unused.is_empty(),
        "take these out of NO_THRESHOLDS: {unused:#?}"
    );
}
