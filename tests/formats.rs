//! Results in other formats: made-up runs with known counts, checked with external validators and
//! generators.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use actcheck::base::{Files, Outcome, Term, names};
use actcheck::history::{CampaignRow, RunDetail, RunStatus};
use actcheck::ontology;
use actcheck::report::{
    Attachment, EarlReport, JunitReport, MarkdownReport, Repetitions, allure_common,
    allure_results, markdown, observation,
};
use actcheck::rules::owl_closure;
use oxigraph::io::{RdfFormat, RdfParser};
use serde_json::Value;

use crate::support::planted::Dice;
use crate::support::{actcheck, foreign, made_up, project, root, stderr, stdout};

/// Fifteen outcomes: 11 passed, 3 failed, 1 broken. Runs 4 and 5 share the scene of run 3 and have
/// other outcomes.
fn fifteen() -> Vec<RunDetail> {
    let outcomes = [
        [Outcome::Passed; 3],
        [Outcome::Passed, Outcome::Passed, Outcome::Failed],
        [Outcome::Passed; 3],
        [Outcome::Passed, Outcome::Failed, Outcome::Broken],
        [Outcome::Passed, Outcome::Failed, Outcome::Passed],
    ];
    let mut dice = Dice::new(11);
    let mut runs: Vec<RunDetail> = (0..outcomes.len())
        .map(|idx| {
            made_up::run("aaaa", idx as u64, &mut dice, &["Pick"], |_, _, _| {
                ["CloseObject", "MovedObject", "ObjectInGripper"]
                    .into_iter()
                    .zip(outcomes[idx])
                    .collect()
            })
        })
        .collect();
    for repetition in [3, 4] {
        let (objects, base) = (runs[2].objects.clone(), runs[2].robot_base);
        (runs[repetition].objects, runs[repetition].robot_base) = (objects, base);
    }
    runs[3].row.status = RunStatus::Broken;
    runs[3].reason = Some("a body flew <away> & \"beyond\" \u{7}all bounds".to_owned());
    runs[3].actions[0].judgements[1].witness = "]]> <b>&amp; | `\u{1}\n@all".to_owned();
    runs
}

/// The same number of outcomes of each of the six kinds.
fn six() -> Vec<RunDetail> {
    let mut dice = Dice::new(5);
    vec![made_up::run(
        "bbbb",
        0,
        &mut dice,
        &["Pick", "Place"],
        |_, step, _| {
            let half = if step == 0 {
                &Outcome::ALL[..3]
            } else {
                &Outcome::ALL[3..]
            };
            ["CloseObject", "MovedObject", "ObjectInGripper"]
                .into_iter()
                .zip(half.iter().copied())
                .collect()
        },
    )]
}

fn allure_files(runs: &[RunDetail]) -> BTreeMap<String, Vec<u8>> {
    let mut repetitions = Repetitions::new();
    let mut files: BTreeMap<String, Vec<u8>> = allure_common("0.1.0", &["aaaa".to_owned()])
        .into_iter()
        .collect();
    for run in runs {
        let about = Some((1, run.actions[0].judgements[0].property.clone()));
        let why = |about, name: &str| Attachment {
            about,
            name: name.to_owned(),
            media_type: "text/plain",
            ending: "txt",
            bytes: b"why".to_vec(),
        };
        let attachments = [why(about, "explanation"), why(None, "notes")];
        for (name, bytes) in
            allure_results(run, repetitions.number(run), &attachments, &BTreeMap::new())
        {
            assert!(
                files.insert(name.clone(), bytes).is_none(),
                "{name} is there twice"
            );
        }
    }
    files
}

fn results(files: &BTreeMap<String, Vec<u8>>) -> Vec<Value> {
    let results = files
        .iter()
        .filter(|(name, _)| name.ends_with("-result.json"));
    results
        .map(|(_, bytes)| serde_json::from_slice(bytes).unwrap())
        .collect()
}

fn write(files: &BTreeMap<String, Vec<u8>>) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("results")).unwrap();
    for (name, bytes) in files {
        std::fs::write(folder.path().join("results").join(name), bytes).unwrap();
    }
    folder
}

/// A path below `tests`.
fn of_tests(name: &str) -> PathBuf {
    root().join("tests").join(name)
}

/// Runs `check_formats.py`; returns `None` if Python is not available.
fn checked(arguments: &[&Path]) -> Option<(bool, String)> {
    let python = foreign::python()?;
    let output = Command::new(python)
        .arg(of_tests("foreign/check_formats.py"))
        .args(arguments)
        .output()
        .unwrap();
    let said = [output.stdout, output.stderr]
        .map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
        .concat();
    Some((output.status.success(), said))
}

#[test]
fn allure_results_have_ids_steps_parameters_and_attachments() {
    let files = allure_files(&fifteen());
    let results = results(&files);
    let count = |status: &str| {
        results
            .iter()
            .filter(|result| result["status"] == status)
            .count()
    };
    assert_eq!(
        [count("passed"), count("failed"), count("broken")],
        [11, 3, 1]
    );
    assert_eq!(results.len(), 15);
    let distinct = |field: &str| {
        results
            .iter()
            .map(|result| result[field].to_string())
            .collect::<BTreeSet<_>>()
            .len()
    };
    assert_eq!(
        [distinct("uuid"), distinct("historyId")],
        [15, 15],
        "repetitions of a scene are not retries"
    );
    assert_eq!(distinct("testCaseId"), 3);
    for result in &results {
        assert_eq!(result["stage"], "finished");
        assert!(
            result["start"].as_i64() < result["stop"].as_i64(),
            "{result}"
        );
        assert_eq!(result["steps"][0]["name"], "1. Pick: reported success");
        assert_eq!(result["steps"][0]["steps"][0]["status"], result["status"]);
        assert!(
            result["steps"][0]["parameters"]
                .as_array()
                .unwrap()
                .iter()
                .any(|p| p["name"] == "pickObject")
        );
        let attachments = result["attachments"].as_array().unwrap();
        assert!(attachments.len() >= 2);
        assert!(
            attachments
                .iter()
                .all(|it| files.contains_key(it["source"].as_str().unwrap())),
            "{attachments:?}"
        );
    }
    let explained = results
        .iter()
        .filter(|result| result["attachments"].as_array().unwrap().len() == 3);
    assert_eq!(
        explained.count(),
        5,
        "each explanation is shown with its property"
    );
}

#[test]
fn the_same_scene_has_the_same_allure_history_on_another_day() {
    let ids = |runs: &[RunDetail]| -> Vec<String> {
        results(&allure_files(runs))
            .iter()
            .map(|result| result["historyId"].to_string())
            .collect()
    };
    let (today, mut later) = (fifteen(), fifteen());
    for run in &mut later {
        run.row.campaign = "zzzz".to_owned();
        run.row.run = run.row.run.replace("aaaa", "zzzz");
        run.row.started = "2027-01-01T00:00:00Z".to_owned();
        run.actions[0]
            .judgements
            .iter_mut()
            .for_each(|judgement| judgement.outcome = Outcome::Failed);
    }
    let sorted = |runs: &[RunDetail]| ids(runs).into_iter().collect::<BTreeSet<_>>();
    assert_eq!(sorted(&today), sorted(&later));
    later[0].objects[1].x += 1e-9;
    assert_eq!(
        sorted(&today).intersection(&sorted(&later)).count(),
        12,
        "another scene has another history"
    );
}

#[test]
fn allure_categories_distinguish_all_outcomes() {
    let files = allure_files(&six());
    let categories: Value = serde_json::from_slice(&files["categories.json"]).unwrap();
    let mut of_category: BTreeMap<String, u32> = BTreeMap::new();
    for result in results(&files) {
        let message = result["statusDetails"]["message"].as_str().unwrap();
        let found: Vec<&Value> = categories
            .as_array()
            .unwrap()
            .iter()
            .filter(|category| category["matchedStatuses"][0] == result["status"])
            .filter(|category| {
                regex::Regex::new(category["messageRegex"].as_str().unwrap())
                    .unwrap()
                    .is_match(message)
            })
            .collect();
        assert_eq!(
            found.len(),
            usize::from(result["status"] != "passed"),
            "{message}"
        );
        found.iter().for_each(|category| {
            *of_category.entry(category["name"].to_string()).or_default() += 1
        });
    }
    assert_eq!(
        of_category.values().copied().collect::<Vec<u32>>(),
        [1; 5],
        "{of_category:?}"
    );
}

#[test]
fn the_allure_generator_shows_the_true_counts() {
    let Some(allure) = foreign::allure() else {
        return;
    };
    let folder = write(&allure_files(&fifteen()));
    let output = Command::new(allure)
        .args(["generate", "results", "--output", "report"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let said = [output.stdout, output.stderr]
        .map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
        .concat();
    assert!(output.status.success(), "{said}");
    let summary = std::fs::read_to_string(folder.path().join("report/summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&summary).unwrap();
    let stats = &summary["stats"];
    assert_eq!(
        [
            &stats["total"],
            &stats["passed"],
            &stats["failed"],
            &stats["broken"]
        ],
        [15, 11, 3, 1].map(Value::from).each_ref(),
        "{summary}"
    );
    assert_eq!(stats["retries"].as_u64().unwrap_or(0), 0, "{summary}");
}

#[test]
fn junit_is_valid_and_has_the_true_counts() {
    let mut report = JunitReport::new();
    fifteen()
        .iter()
        .chain(&six())
        .for_each(|run| report.add(run));
    let text = report.text();
    let document = roxmltree::Document::parse(&text).unwrap();
    let suites: Vec<_> = document
        .descendants()
        .filter(|node| node.has_tag_name("testsuite"))
        .collect();
    let counts = |suite: usize| {
        ["tests", "failures", "errors", "skipped"].map(|name| {
            suites[suite]
                .attribute(name)
                .unwrap()
                .parse::<usize>()
                .unwrap()
        })
    };
    assert_eq!(counts(0), [15, 3, 1, 0]);
    assert_eq!(counts(1), [6, 1, 2, 2]);
    for (idx, suite) in suites.iter().enumerate() {
        let elements = |name: &str| {
            suite
                .descendants()
                .filter(|node| node.has_tag_name(name))
                .count()
        };
        assert_eq!(
            counts(idx),
            [
                elements("testcase"),
                elements("failure"),
                elements("error"),
                elements("skipped")
            ]
        );
    }
    // Times are those of the clock, not of the simulation: a server adds them up.
    for (suite, runs) in suites.iter().zip([fifteen(), six()]) {
        let secs =
            |node: roxmltree::Node<'_, '_>| node.attribute("time").unwrap().parse::<f64>().unwrap();
        let cases: f64 = suite
            .children()
            .filter(|node| node.has_tag_name("testcase"))
            .map(secs)
            .sum();
        let wall: f64 = runs.iter().map(|run| run.wall_secs).sum();
        assert!(
            wall > 0.0 && (secs(*suite) - wall).abs() < 1e-3 && (cases - wall).abs() < 1e-3,
            "{cases} {wall}"
        );
    }
    let kinds: BTreeSet<&str> = document
        .descendants()
        .filter(|node| node.has_tag_name("error"))
        .map(|node| node.attribute("type").unwrap())
        .collect();
    assert_eq!(kinds.into_iter().collect::<Vec<_>>(), ["broken", "timeout"]);
    assert!(
        document.descendants().all(|node| !node.has_tag_name("b")),
        "a witness became markup"
    );

    let folder = tempfile::tempdir().unwrap();
    let (good, bad) = (
        folder.path().join("good.xml"),
        folder.path().join("bad.xml"),
    );
    std::fs::write(&good, &text).unwrap();
    std::fs::write(
        &bad,
        text.replace("<failure ", "<failed ")
            .replace("</failure>", "</failed>"),
    )
    .unwrap();
    let schema = of_tests("data/formats/junit.xsd");
    let Some((valid, said)) = checked(&[Path::new("junit"), &good, &schema]) else {
        return;
    };
    assert!(valid, "{said}");
    assert!(
        !checked(&[Path::new("junit"), &bad, &schema]).unwrap().0,
        "the check can't fail"
    );
}

#[test]
fn observations_follow_the_schema() {
    let mut runs = fifteen();
    runs.extend(six());
    let observations: Vec<Value> = runs
        .iter()
        .map(|run| observation(run, "2026-01-01T00:00:00Z"))
        .collect();
    let status: Vec<&str> = observations
        .iter()
        .map(|it| it["status"].as_str().unwrap())
        .collect();
    assert_eq!(
        status,
        ["passed", "failed", "passed", "failed", "failed", "failed"]
    );
    assert_eq!(observations[0]["run_start"], 1_767_225_600.0);
    let schema: Value = serde_json::from_str(
        &std::fs::read_to_string(of_tests("data/formats/observation.schema.json")).unwrap(),
    )
    .unwrap();
    for observation in &observations {
        let fields: BTreeSet<&String> = observation.as_object().unwrap().keys().collect();
        assert_eq!(
            fields,
            schema["properties"].as_object().unwrap().keys().collect()
        );
        assert_eq!(
            observation["features"].as_object().unwrap().len() % 2,
            1,
            "six outcomes, the score, and pairs"
        );
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("runs.jsonl");
    std::fs::write(
        &file,
        observations
            .iter()
            .map(|it| format!("{it}\n"))
            .collect::<String>(),
    )
    .unwrap();
    let Some((valid, said)) = checked(&[
        Path::new("jsonl"),
        &file,
        &of_tests("data/formats/observation.schema.json"),
    ]) else {
        return;
    };
    assert!(valid && said.trim() == "6 valid", "{said}");
}

/// A run that is broken, or without any judged property, has not passed.
#[test]
fn a_run_that_tested_nothing_is_not_a_passed_observation() {
    let mut run = fifteen().swap_remove(0);
    run.actions.clear();
    assert_eq!(observation(&run, "")["status"], "gave_up");
    run.row.status = RunStatus::Timeout;
    run.reason = Some("300 s on the clock".to_owned());
    let observed = observation(&run, "no moment");
    assert_eq!(
        [&observed["status"], &observed["status_reason"]],
        ["gave_up", "300 s on the clock"]
    );
    assert_eq!(observed["run_start"], 0.0);
}

fn turtle(text: &str) -> Vec<[Term; 3]> {
    let term = |term: oxigraph::model::Term| match term {
        oxigraph::model::Term::NamedNode(node) => Term::iri(node.as_str()),
        oxigraph::model::Term::BlankNode(node) => Term::Blank(node.as_str().into()),
        oxigraph::model::Term::Literal(literal) => {
            Term::Literal(literal.value().into(), literal.datatype().as_str().into())
        }
        #[expect(
            unreachable_patterns,
            reason = "quoted triples exist in other builds of the library"
        )]
        _ => unreachable!("quoted triples are never written"),
    };
    RdfParser::from_format(RdfFormat::Turtle)
        .with_base_iri("https://w3id.org/actcheck/test")
        .unwrap()
        .for_slice(text.as_bytes())
        .map(|quad| {
            let quad = quad.unwrap();
            [
                term(quad.subject.into()),
                Term::iri(quad.predicate.as_str()),
                term(quad.object),
            ]
        })
        .collect()
}

#[test]
fn earl_parses_and_is_consistent_under_owl_rl() {
    let mut report = EarlReport::new();
    let runs: Vec<RunDetail> = fifteen().into_iter().chain(six()).collect();
    runs.iter().for_each(|run| report.add(run));
    let campaign = CampaignRow {
        imported_from: None,
        id: "aaaa".to_owned(),
        name: "pick".to_owned(),
        started: "2026-01-01T00:00:00Z".to_owned(),
        ended: Some("2026-01-01T00:01:00Z".to_owned()),
        ended_by: None,
        interrupted: false,
        seed: 7,
        planned_runs: 5,
        runs: 5,
        score: None,
        score_without_broken: None,
        outcomes: BTreeMap::new(),
        program_version: "0.1.0".to_owned(),
        config_digest: String::new(),
        ontology_digest: String::new(),
        skill: None,
    };
    let text = report.text(&[campaign]);
    let statements = turtle(&text);
    let outcome = Term::iri(format!("{}outcome", names::EARL));
    let count = |value: &str| {
        let value = Term::iri(format!("{}{value}", names::EARL));
        statements
            .iter()
            .filter(|[_, property, object]| *property == outcome && *object == value)
            .count()
    };
    assert_eq!(
        ["passed", "failed", "cantTell", "inapplicable", "untested"].map(count),
        [12, 4, 3, 1, 1]
    );

    // Together with the vocabularies, ours included, the data is consistent, and a planted
    // contradiction is found.
    let vocabularies = std::fs::read_to_string(of_tests("data/formats/vocabularies.ttl")).unwrap();
    let mut all = ontology::load(&Files::Shipped, Path::new("ontology/actions.ttl"))
        .unwrap()
        .triples;
    all.extend(turtle(
        &std::fs::read_to_string(root().join("ontology/history.ttl")).unwrap(),
    ));
    all.extend(turtle(&vocabularies));
    all.extend(statements);
    let closure = owl_closure(&all).unwrap();
    let assertor = [
        Term::iri("https://w3id.org/actcheck/program/0.1.0"),
        Term::iri(format!("{}type", names::RDF)),
        Term::iri(format!("{}Assertor", names::EARL)),
    ];
    assert!(
        closure.contains(&assertor),
        "consequences of the vocabularies are derived"
    );
    let wrong = "@prefix prov: <http://www.w3.org/ns/prov#> . <https://w3id.org/actcheck/run/aaaa-1> a prov:Entity .";
    all.extend(turtle(wrong));
    assert!(owl_closure(&all).is_err(), "a run is not an entity");

    let folder = tempfile::tempdir().unwrap();
    let [good, bad] = ["good.ttl", "bad.ttl"].map(|name| folder.path().join(name));
    std::fs::write(&good, &text).unwrap();
    std::fs::write(&bad, format!("{text}\n{wrong}")).unwrap();
    let (vocabularies, history) = (
        of_tests("data/formats/vocabularies.ttl"),
        root().join("ontology/history.ttl"),
    );
    let Some((consistent, said)) = checked(&[Path::new("earl"), &good, &vocabularies, &history])
    else {
        return;
    };
    assert!(
        consistent && said.contains("21 assertions, consistent"),
        "{said}"
    );
    assert!(
        !checked(&[Path::new("earl"), &bad, &vocabularies, &history])
            .unwrap()
            .0,
        "the check can't fail"
    );
}

#[test]
fn markdown_shows_counts_first_and_escapes_markup() {
    let mut report = MarkdownReport::new();
    fifteen().iter().for_each(|run| report.add(run));
    let text = markdown(&report);
    insta::assert_snapshot!(text);
    assert!(!text.contains("<b>") && !text.contains("@all"));
}

/// The flags of `actcheck report`, on a history that simulation made.
#[test]
fn report_writes_the_requested_formats() {
    let project = project();
    let here = project.path();
    let ran = actcheck(
        here,
        &["run", "configs/quick.toml", "--runs", "2", "--jobs", "1"],
    );
    assert!(
        ran.status.code().is_some_and(|code| code < 2),
        "{}",
        stderr(&ran)
    );
    let report = |arguments: &[&str]| {
        let output = actcheck(here, &[&["report"], arguments].concat());
        (output.status.code(), stdout(&output), stderr(&output))
    };
    let files = [
        "--allure",
        "a",
        "--junit",
        "j.xml",
        "--earl",
        "e.ttl",
        "--jsonl",
        "o.jsonl",
        "--markdown",
    ];
    let (code, printed, messages) = report(&files);
    assert_eq!(code, Some(0), "{messages}");
    assert!(printed.starts_with("## actcheck: "), "{printed}");
    assert!(
        !printed.contains("holds") && messages.contains("j.xml holds"),
        "stdout must have only the summary: {printed}{messages}"
    );
    let read = |name: &str| std::fs::read_to_string(here.join(name)).unwrap();
    // Three properties of PerceivePlane, five of Pick.
    let names: Vec<String> = std::fs::read_dir(here.join("a"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    assert_eq!(
        names
            .iter()
            .filter(|name| name.ends_with("-result.json"))
            .count(),
        2 * 8
    );
    let not_all_passed = read("o.jsonl")
        .lines()
        .filter(|line| !line.contains("\"passed\":8,"))
        .count();
    assert_eq!(
        names.iter().filter(|name| name.ends_with(".svg")).count(),
        not_all_passed,
        "each of them has a picture"
    );
    assert!(read("j.xml").contains("tests=\"16\""));
    assert_eq!(read("o.jsonl").lines().count(), 2);
    assert!(!turtle(&read("e.ttl")).is_empty());

    // A single format, of one property, can be printed.
    let (code, printed, _) = report(&["--junit", "-", "--property", "MovedObject"]);
    assert!(
        code == Some(0) && printed.contains("tests=\"2\""),
        "{printed}"
    );
    for (wrong, fault) in [
        (vec!["--junit", "-", "--markdown"], "X058"),
        (vec!["--markdown", "--property", "MovedObjekt"], "X045"),
        (vec!["--markdown", "--since", "2999-01-01"], "X044"),
        (vec!["--markdown", "--campaign", "none"], "H014"),
        (vec!["--junit", "no/folder/j.xml"], "X007"),
        (vec![], "--allure"),
    ] {
        let (code, _, messages) = report(&wrong);
        assert!(
            code == Some(2) && messages.contains(fault),
            "{wrong:?}: {messages}"
        );
    }
}
