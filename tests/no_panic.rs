//! Truncated and garbled inputs are refused or read, without a panic, and every message can be
//! shown with its place.

use std::path::Path;

use actcheck::base::{Diagnostics, Files};
use actcheck::config::{self, Overrides};
use actcheck::data::Choices;
use actcheck::ontology;
use actcheck::scenario::{self, Space};

use crate::support::robot_of;

/// Renders the diagnostics as the program prints them.
fn show(found: &Diagnostics) {
    let handler = miette::GraphicalReportHandler::new_themed(miette::GraphicalTheme::none());
    for fault in found.iter() {
        let mut out = String::new();
        handler.render_report(&mut out, fault).unwrap();
        assert!(
            out.contains(&fault.message.chars().take(10).collect::<String>()),
            "{out}"
        );
        assert!(
            fault.span.is_none() || !out.contains("Failed to read"),
            "{out}"
        );
    }
}

/// A text with a few bytes removed, duplicated, moved or replaced; deterministic for each number.
fn garbled(text: &str, number: u64) -> String {
    const STRANGE: [&str; 12] = [
        "\"", "[", "]", "<", ">", ".", "\n", "\u{0}", "é🦀", "\u{feff}", "#", "&",
    ];
    let mut choices = Choices::random(number, 0);
    let mut chars: Vec<char> = text.chars().collect();
    for _ in 0..=choices.index("edits".into(), 3) {
        let at = choices
            .index("at".into(), chars.len().max(1))
            .min(chars.len());
        let length = choices.index("length".into(), 40).min(chars.len() - at);
        match choices.index("how".into(), 4) {
            0 => drop(chars.drain(at..at + length)),
            1 => chars.truncate(at),
            2 => {
                let copy: Vec<char> = chars[at..at + length].to_vec();
                chars.splice(at..at, copy);
            }
            _ => drop(chars.splice(
                at..at,
                STRANGE[choices.index("strange".into(), STRANGE.len())].chars(),
            )),
        }
    }
    chars.into_iter().collect()
}

#[test]
fn garbled_configurations_do_not_panic() {
    let text = std::fs::read_to_string("configs/pick.toml").unwrap();
    let text = text
        .replace("ontology = \"../ontology/actions.ttl\"", "")
        .replace("model_dir = \"../models\"", "");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c.toml");
    let ontology = ontology::load(&Files::Shipped, Path::new("ontology/actions.ttl")).unwrap();
    let mut accepted = 0;
    for number in 0..400 {
        std::fs::write(&path, garbled(&text, number)).unwrap();
        match config::load(&path, &Overrides::default()) {
            Err(found) => show(&found),
            Ok(campaign) => match Space::new(&campaign, &ontology, &robot_of(&campaign)) {
                Err(found) => show(&found),
                Ok(space) => {
                    accepted += 1;
                    let _ = scenario::draw(&space, 0, &mut Choices::random(number, 0));
                }
            },
        }
    }
    assert!(accepted > 20, "some edits fall into comments: {accepted}");
}

#[test]
fn garbled_ontologies_do_not_panic() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("rules")).unwrap();
    for name in [
        "tests/data/pick.owl",
        "tests/data/kinds_of_pick.ttl",
        "ontology/actions.ttl",
    ] {
        let text = std::fs::read_to_string(name).unwrap();
        let ending = name.rsplit('.').next().unwrap();
        let path = folder.path().join(format!("o.{ending}"));
        for number in 0..150 {
            std::fs::write(&path, garbled(&text, number)).unwrap();
            // The imports and the rules are missing here, so there is always a diagnostic.
            show(&ontology::load(&Files::Disk, &path).map(drop).unwrap_err());
        }
    }
}

#[test]
fn byte_order_marks_and_windows_line_ends_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let ontology = "\u{feff}@prefix act: <http://actions#> .\r\nact:Wait a act:Action .\r\n";
    std::fs::write(folder.path().join("o.ttl"), ontology).unwrap();
    let ontology = ontology::load(&Files::Disk, &folder.path().join("o.ttl"))
        .unwrap_or_else(|found| panic!("{found}"));
    assert!(ontology.actions.contains_key("Wait"));
    let config = "\u{feff}tests = [[\"Wait\"]]\r\ntest_count = 1\r\n";
    std::fs::write(folder.path().join("c.toml"), config).unwrap();
    config::load(&folder.path().join("c.toml"), &Overrides::default())
        .unwrap_or_else(|found| panic!("{found}"));
}
