//! Text from skills and files: any text becomes valid RDF, and none controls a terminal.

use oxigraph::io::{RdfFormat, RdfParser};
use oxigraph::model::{NamedNode, Quad, Term};
use proptest::prelude::*;

use actcheck::base::{names, printable};

use crate::support::{actcheck, root, stderr, stdout};

/// Categories that break out of an IRI, or are none.
const CATEGORIES: [&str; 7] = [
    "coffee mug",
    "http://a> <http://b> <http://c> .\n<http://run> <http://www.w3.org/ns/earl#outcome> <http://passed> .\n#",
    "\u{1b}]0;title\u{7}",
    "",
    "http://example.org/a b",
    "Größe \u{202e} \u{0}",
    "http://actions#Glass",
];

fn parsed(text: &str) -> Vec<Quad> {
    let quads = RdfParser::from_format(RdfFormat::NQuads).for_slice(text);
    quads
        .map(|quad| quad.unwrap_or_else(|error| panic!("{error}")))
        .collect()
}

fn decoded(label: &str) -> String {
    let mut bytes = Vec::new();
    let mut rest = label.bytes();
    while let Some(byte) = rest.next() {
        let mut digit = || {
            char::from(rest.next().unwrap())
                .to_digit(16)
                .and_then(|digit| u8::try_from(digit).ok())
                .unwrap()
        };
        bytes.push(if byte == b'%' {
            digit() * 16 + digit()
        } else {
            byte
        });
    }
    String::from_utf8(bytes).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(2000) })]

    /// Texts of any characters, and texts that resemble IRIs.
    #[test]
    fn any_category_is_one_iri_with_the_same_content(
        text in prop_oneof![any::<String>(), "[a-z]{0,4}:/{0,2}[ -~é%0-9a-f#:/@\\[\\]]{0,20}", "\\PC{0,8}[<> \"\n.]{1,4}\\PC{0,8}"]
    ) {
        let iri = names::category(&text);
        let quads = parsed(&format!("<http://a> <http://b> <{iri}> .\n"));
        prop_assert_eq!(quads.len(), 1);
        prop_assert_eq!(&quads[0].object, &Term::from(NamedNode::new(&iri).unwrap()));
        match iri.strip_prefix(&names::w("category/")) {
            Some(label) if iri != text => prop_assert_eq!(decoded(label), text),
            _ => prop_assert_eq!(iri, text),
        }
    }

    #[test]
    fn printable_text_has_no_control_characters(text in any::<String>()) {
        let shown = printable(&text);
        prop_assert!(!shown.chars().any(|c| c.is_control() && c != '\n' && c != '\t'));
        prop_assert_eq!(printable(&shown), shown.clone());
    }
}

#[test]
fn an_export_of_a_run_with_foreign_names_can_be_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    for file in ["wire.py", "names.py"] {
        std::fs::copy(root().join("tests/protocol").join(file), here.join(file)).unwrap();
    }
    std::fs::write(
        here.join("categories.json"),
        serde_json::to_string(&CATEGORIES).unwrap(),
    )
    .unwrap();
    let message = "done\\u001b[2J\\u001b]0;owned\\u0007 \\u202e\\r";
    let config = format!(
        "tests = [[\"Pick\"]]\ntest_count = 1\ntest_launcher = \"names.py\"\nseed = 7\n\
         [objectSurface]\nobject_surfaces = [\"coffee_table\"]\n[pickObject]\nmodel_list = [\"glass\"]\n\
         [skill]\nenv = {{ MESSAGE = \"{message}\" }}\n"
    );
    std::fs::write(here.join("c.toml"), config).unwrap();
    let ran = actcheck(here, &["run", "c.toml"]);
    assert_eq!(ran.status.code(), Some(1), "{}", stderr(&ran));
    for file in ["all.nq", "all.ttl"] {
        let exported = actcheck(here, &["export", "rdf", file, "--history", ".actcheck"]);
        assert!(exported.status.success(), "{}", stderr(&exported));
    }
    let quads = parsed(&std::fs::read_to_string(here.join("all.nq")).unwrap());
    let turtle = std::fs::read(here.join("all.ttl")).unwrap();
    assert!(
        RdfParser::from_format(RdfFormat::Turtle)
            .for_slice(&turtle)
            .all(|quad| quad.is_ok())
    );
    let objects_of = |property: &str| -> Vec<String> {
        let found = quads
            .iter()
            .filter(|quad| quad.predicate.as_str().ends_with(property));
        found.map(|quad| quad.object.to_string()).collect()
    };
    let seen = objects_of("#seenAs");
    for category in CATEGORIES {
        let expected = format!("<{}>", names::category(category));
        assert!(
            seen.contains(&expected),
            "{expected} is missing in {seen:?}"
        );
    }
    assert!(
        !quads
            .iter()
            .any(|quad| quad.subject.to_string() == "<http://run>"),
        "an outcome was injected"
    );
    // The skill's message is shown, but does not control the terminal.
    let shown = actcheck(
        here,
        &["list", "--history", ".actcheck", "--format", "json"],
    );
    let runs: serde_json::Value = serde_json::from_str(&stdout(&shown)).unwrap();
    let run = runs[0]["run"].as_str().unwrap();
    let shown = stdout(&actcheck(here, &["show", run, "--history", ".actcheck"]));
    assert!(
        shown.contains("done\\u{1b}[2J\\u{1b}]0;owned\\u{7}"),
        "{shown}"
    );
    assert!(
        !shown.chars().any(|c| c.is_control() && c != '\n'),
        "{shown:?}"
    );
}

#[test]
fn escape_sequences_of_a_configuration_are_not_printed() {
    let folder = tempfile::tempdir().unwrap();
    let text = "tests = [[\"Pi\u{9b}2Jck\"]] # \u{202e}\nse\u{7f}ed = 1\n\"a\\u001b]0;title\\u0007\" = 1\n";
    std::fs::write(folder.path().join("c.toml"), text).unwrap();
    let output = actcheck(folder.path(), &["check", "c.toml"]);
    assert_eq!(output.status.code(), Some(2));
    let said = stderr(&output);
    assert!(
        !said
            .chars()
            .any(|c| (c.is_control() && c != '\n') || c == '\u{202e}'),
        "{said:?}"
    );
}

#[test]
fn absurd_masses_and_sizes_are_refused_with_their_place() {
    let folder = tempfile::tempdir().unwrap();
    let objects = folder.path().join("models/objects");
    std::fs::create_dir_all(&objects).unwrap();
    let glass = std::fs::read_to_string(root().join("models/objects/glass.toml")).unwrap();
    let mass = glass
        .lines()
        .find(|line| line.starts_with("mass_kg"))
        .unwrap();
    std::fs::write(
        folder.path().join("c.toml"),
        "tests = [[\"Pick\"]]\ntest_count = 1\nmodel_dir = \"models\"\n[pickObject]\nmodel_list = [\"heavy\"]\n",
    )
    .unwrap();
    for written in ["mass_kg = 1e30", "mass_kg = 1e7", "mass_kg = inf"] {
        std::fs::write(objects.join("heavy.toml"), glass.replace(mass, written)).unwrap();
        let output = actcheck(folder.path(), &["check", "c.toml"]);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{written}: {said}");
        assert!(
            said.contains("heavy.toml") && said.contains("`mass_kg`"),
            "{written}: {said}"
        );
    }
}
