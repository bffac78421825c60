//! Properties that are proposed from passing runs.

use serde_json::Value;

use crate::support::{actcheck, root, stderr, stdout};
use actcheck::history::{History, RunFilter};

#[test]
fn properties_from_passing_runs_notice_faults_and_are_kept_by_runs_of_another_seed() {
    let folder = tempfile::tempdir().unwrap();
    let config = root().join("configs/pick.toml");
    let picks = |history: &str, seed: &str| {
        let config = config.to_str().unwrap();
        let arguments = [
            "run",
            config,
            "--runs",
            "160",
            "--seed",
            seed,
            "--history",
            history,
            "-q",
        ];
        actcheck(folder.path(), &arguments)
    };
    picks("h", "3");
    let propose = |more: &[&str]| {
        let mut arguments = vec![
            "propose-properties",
            "h",
            "--scenes",
            "8",
            "--format",
            "json",
        ];
        arguments.extend(more);
        let output = actcheck(folder.path(), &arguments);
        let found: Value = serde_json::from_str(&stdout(&output))
            .unwrap_or_else(|_| panic!("{}", stderr(&output)));
        found
    };
    let found = propose(&["--jobs", "1"]);
    assert_eq!(found, propose(&["--jobs", "2", "-o", "again"]));
    let properties = found["properties"].as_array().unwrap();
    assert!(properties.len() >= 5, "{found:#}");
    for property in properties {
        let alarms = property["false_alarms"].as_f64().unwrap();
        assert!(
            alarms <= 0.01 * property["held_out"].as_f64().unwrap(),
            "{property}"
        );
        assert!(
            !property["faults"].as_object().unwrap().is_empty(),
            "{property}"
        );
    }

    // The proposed ontology judges fresh runs: those that pass keep the proposed limits, too.
    let text = std::fs::read_to_string(&config).unwrap();
    let text = text
        .replace("\"../ontology/actions.ttl\"", "\"proposed/properties.ttl\"")
        .replace("\"../", &format!("\"{}/", root().display()));
    std::fs::write(folder.path().join("with.toml"), text).unwrap();
    let check = actcheck(folder.path(), &["check", "with.toml"]);
    assert!(check.status.success(), "{}", stderr(&check));
    let arguments = [
        "run",
        "with.toml",
        "--runs",
        "100",
        "--seed",
        "4",
        "--history",
        "fresh",
        "-q",
    ];
    actcheck(folder.path(), &arguments);
    let history = History::open_to_read(&folder.path().join("fresh")).unwrap();
    let outcomes = history.outcomes(&RunFilter::default()).unwrap();
    let names: Vec<&str> = properties
        .iter()
        .map(|property| property["property"].as_str().unwrap())
        .collect();
    let is_proposed = |iri: &str| names.iter().any(|name| iri.ends_with(&format!("#{name}")));
    let failed = |run: &str, proposed: bool| {
        let of_run = outcomes.iter().filter(|row| row.run == run);
        of_run
            .filter(|row| is_proposed(&row.property) == proposed)
            .filter(|row| row.outcome.word() == "failed")
            .count()
    };
    let runs = history.runs(&RunFilter::default()).unwrap();
    let passing: Vec<&str> = runs
        .iter()
        .map(|row| row.run.as_str())
        .filter(|run| failed(run, false) == 0)
        .collect();
    let alarms: usize = passing.iter().map(|run| failed(run, true)).sum();
    let judged = passing.len() * names.len();
    assert!(
        passing.len() > 50 && alarms * 50 <= judged,
        "{alarms} of {judged}"
    );

    let again = actcheck(folder.path(), &["propose-properties", "h", "--scenes", "1"]);
    assert!(
        stderr(&again).contains("X015"),
        "files of users are never replaced"
    );
}

#[test]
fn labels_at_random_are_no_evidence_and_an_imported_campaign_needs_some() {
    let folder = tempfile::tempdir().unwrap();
    let config = root().join("configs/pick.toml");
    let arguments = [
        "run",
        config.to_str().unwrap(),
        "--runs",
        "90",
        "--history",
        "h",
        "-q",
    ];
    actcheck(folder.path(), &arguments);
    let history = History::open_to_read(&folder.path().join("h")).unwrap();
    let runs = history.runs(&RunFilter::default()).unwrap();
    let mut labels = "run,property,label\n".to_owned();
    for (idx, run) in runs.iter().enumerate() {
        let label = if idx % 4 == 2 { "fail" } else { "pass" };
        labels += &format!("{},MovedObject,{label}\n", run.run);
    }
    std::fs::write(folder.path().join("labels.csv"), labels).unwrap();
    let arguments = [
        "propose-properties",
        "h",
        "--labels",
        "labels.csv",
        "--scenes",
        "1",
        "--format",
        "json",
    ];
    let output = actcheck(folder.path(), &arguments);
    let found: Value = serde_json::from_str(&stdout(&output)).unwrap();
    let by_labels = found["properties"].as_array().unwrap().iter();
    let by_labels = by_labels.filter(|property| !property["bad_runs"].is_null());
    assert_eq!(by_labels.count(), 0, "{found:#}");

    let episodes = root().join("tests/data/episodes");
    let mapping = episodes.join("made.toml");
    let arguments = [
        "import",
        episodes.to_str().unwrap(),
        "--mapping",
        mapping.to_str().unwrap(),
        "--history",
        "e",
    ];
    actcheck(folder.path(), &arguments);
    let refused = actcheck(folder.path(), &["propose-properties", "e"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("S056"), "{}", stderr(&refused));
}
