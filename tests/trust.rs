//! Reports about the properties themselves: their list with pass rates, and warnings about uninformative outcomes.

use serde_json::Value;

use crate::support::{actcheck, edit, project, stderr, stdout};

fn json(output: &std::process::Output) -> Value {
    serde_json::from_str(&stdout(output)).unwrap_or_else(|_| panic!("{}", stderr(output)))
}

/// A property that the picked object fulfils before the action, and one that can't be violated.
fn with_odd_properties() -> tempfile::TempDir {
    let project = project();
    let rules = project.path().join("rules");
    std::fs::write(rules.join("exists.rls"), "success(?o) :- parameter(act:pickObject, ?o), after(?o, w:z, _) .")
        .unwrap();
    std::fs::write(rules.join("stays.rq"), "SELECT ?o WHERE { GRAPH act:after { ?o w:z ?z } FILTER (?z > 1000.0) }")
        .unwrap();
    edit(
        &project.path().join("ontology/actions.ttl"),
        "act:CloseObject, act:ObjectGrasped",
        "act:Exists, act:Stays, act:CloseObject, act:ObjectGrasped",
    );
    let ontology = project.path().join("ontology/actions.ttl");
    let text = std::fs::read_to_string(&ontology).unwrap();
    let more = "\nact:Exists a act:Property ; rdfs:label \"it exists\" ; act:needsParameter act:pickObject ; \
                act:verifiedBy <../rules/exists.rls> .\n\
                act:Stays a act:Property ; act:verifiedBy <../rules/stays.rq> .\n\
                act:Place act:precondition act:Exists .\n";
    std::fs::write(&ontology, text + more).unwrap();
    project
}

#[test]
fn a_campaign_warns_of_uninformative_outcomes() {
    let project = with_odd_properties();
    let run = ["run", "configs/pick.toml", "--runs", "6", "--history", "h", "--format"];
    let printed = json(&actcheck(project.path(), &[&run[..], &["json"]].concat()));
    let remark = |oddity: &str| {
        let remarks = printed["remarks"].as_array().unwrap();
        remarks.iter().find(|remark| remark["oddity"] == oddity).unwrap_or_else(|| panic!("no {oddity} in {remarks:?}"))
    };
    let held = remark("held before");
    assert_eq!(held["properties"], serde_json::json!(["http://actions#Exists"]));
    assert_eq!((&held["count"], &held["of"], &held["severity"]), (&6.into(), &6.into(), &"warning".into()));
    // An unviolated prohibition is not reported: it also held before the action.
    let properties = printed["properties"].as_array().unwrap();
    for property in properties {
        let odd = property["property"] == "http://actions#Exists";
        assert_eq!(property["held_before"], if odd { 6 } else { 0 }, "{property}");
    }
    let never = remark("never failed");
    assert!(never["properties"].as_array().unwrap().contains(&"http://actions#Stays".into()), "{never}");
    assert_eq!(never["severity"], "note");

    let kept = actcheck(
        project.path(),
        &[
            "query",
            "--history",
            "h",
            "--format",
            "csv",
            "SELECT ?property ?held (COUNT(*) AS ?n) WHERE { ?a earl:test ?property ; earl:result [ act:heldBefore ?held ] } \
             GROUP BY ?property ?held HAVING (?held) ORDER BY ?property",
        ],
    );
    let kept = stdout(&kept);
    assert_eq!(kept.lines().count(), 2, "{kept}");
    assert!(kept.contains("Exists") && kept.contains(",6"), "{kept}");
    let run = printed["runs"][0]["run"].as_str().unwrap();
    let shown = stdout(&actcheck(project.path(), &["show", run, "--history", "h"]));
    assert!(shown.contains("passed, held before"), "{shown}");
}

#[test]
fn rules_lists_every_property_with_its_rate() {
    let project = with_odd_properties();
    let list = |arguments: &[&str]| {
        let output = actcheck(project.path(), &[&["rules"], arguments].concat());
        assert!(output.status.success(), "{}", stderr(&output));
        stdout(&output)
    };
    let before = list(&[]);
    assert!(before.contains("rules/moved_object.rls") && before.contains('–'), "{before}");
    assert!(before.contains("Pick, Place (before it)"), "a precondition is not a postcondition:\n{before}");
    actcheck(project.path(), &["run", "configs/pick.toml", "--runs", "4", "--history", "h"]);
    let rows: Value = serde_json::from_str(&list(&["--history", "h", "--format", "json"])).unwrap();
    let rows = rows.as_array().unwrap();
    assert_eq!(rows.len(), 19);
    // This campaign had only picks.
    let is_of_pick = |row: &&Value| row["actions"].as_str().is_some_and(|actions| actions.starts_with("Pick"));
    for row in rows.iter().filter(is_of_pick) {
        let count = |word: &str| row[word].as_u64().unwrap();
        assert_eq!(count("passed") + count("failed"), 4, "{row}");
        assert_eq!(row["pass_rate"].as_f64().unwrap(), count("passed") as f64 / 4.0);
        assert!(row["low"].as_f64() <= row["pass_rate"].as_f64() && row["pass_rate"].as_f64() <= row["high"].as_f64());
    }
    let grasped = rows.iter().find(|row| row["property"] == "ObjectGrasped").unwrap();
    assert_eq!(grasped["language"], "SPARQL");
    let csv = list(&["--history", "h", "--format", "csv"]);
    assert_eq!(csv.lines().count(), rows.len() + 1, "{csv}");
    let missing = actcheck(project.path(), &["rules", "--history", "nowhere"]);
    assert_eq!(missing.status.code(), Some(2));
    let missing = actcheck(project.path(), &["rules", "--ontology", "nowhere.ttl"]);
    assert_eq!(missing.status.code(), Some(2));
}
