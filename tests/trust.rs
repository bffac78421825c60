//! Reports about the properties themselves: their list with pass rates, and warnings about
//! uninformative outcomes.

use serde_json::Value;

use crate::support::{actcheck, edit, project, stderr, stdout};

fn json(output: &std::process::Output) -> Value {
    serde_json::from_str(&stdout(output)).unwrap_or_else(|_| panic!("{}", stderr(output)))
}

/// A property that the picked object fulfils before the action, and one that can't be violated.
fn with_odd_properties() -> tempfile::TempDir {
    let project = project();
    let rules = project.path().join("rules");
    std::fs::write(
        rules.join("exists.rls"),
        "success(?o) :- parameter(act:pickObject, ?o), after(?o, w:z, _) .",
    )
    .unwrap();
    std::fs::write(
        rules.join("stays.rq"),
        "SELECT ?o WHERE { GRAPH act:after { ?o w:z ?z } FILTER (?z > 1000.0) }",
    )
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
    let run = [
        "run",
        "configs/pick.toml",
        "--runs",
        "6",
        "--history",
        "h",
        "--format",
    ];
    let printed = json(&actcheck(project.path(), &[&run[..], &["json"]].concat()));
    let remark = |oddity: &str| {
        let remarks = printed["remarks"].as_array().unwrap();
        remarks
            .iter()
            .find(|remark| remark["oddity"] == oddity)
            .unwrap_or_else(|| panic!("no {oddity} in {remarks:?}"))
    };
    let held = remark("held before");
    assert_eq!(
        held["properties"],
        serde_json::json!(["http://actions#Exists"])
    );
    assert_eq!(
        (&held["count"], &held["of"], &held["severity"]),
        (&6.into(), &6.into(), &"warning".into())
    );
    // An unviolated prohibition is not reported: it also held before the action.
    let properties = printed["properties"].as_array().unwrap();
    for property in properties {
        let odd = property["property"] == "http://actions#Exists";
        assert_eq!(
            property["held_before"],
            if odd { 6 } else { 0 },
            "{property}"
        );
    }
    let never = remark("never failed");
    assert!(
        never["properties"]
            .as_array()
            .unwrap()
            .contains(&"http://actions#Stays".into()),
        "{never}"
    );
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
        let output = actcheck(project.path(), &[&["list", "--rules"], arguments].concat());
        assert!(output.status.success(), "{}", stderr(&output));
        stdout(&output)
    };
    let before = list(&[]);
    assert!(
        before.contains("rules/moved_object.rls") && before.contains('–'),
        "{before}"
    );
    assert!(
        before.contains("Pick, Place (before it)"),
        "a precondition is not a postcondition:\n{before}"
    );
    actcheck(
        project.path(),
        &["run", "configs/pick.toml", "--runs", "4", "--history", "h"],
    );
    let rows: Value = serde_json::from_str(&list(&["--history", "h", "--format", "json"])).unwrap();
    let rows = rows.as_array().unwrap();
    assert_eq!(rows.len(), 21);
    // This campaign had only picks.
    let is_of_pick = |row: &&Value| {
        row["actions"]
            .as_str()
            .is_some_and(|actions| actions.starts_with("Pick"))
    };
    for row in rows.iter().filter(is_of_pick) {
        let count = |word: &str| row[word].as_u64().unwrap();
        assert_eq!(count("passed") + count("failed"), 4, "{row}");
        assert_eq!(
            row["pass_rate"].as_f64().unwrap(),
            count("passed") as f64 / 4.0
        );
        assert!(
            row["low"].as_f64() <= row["pass_rate"].as_f64()
                && row["pass_rate"].as_f64() <= row["high"].as_f64()
        );
    }
    let grasped = rows
        .iter()
        .find(|row| row["property"] == "ObjectGrasped")
        .unwrap();
    assert_eq!(grasped["language"], "SPARQL");
    let csv = list(&["--history", "h", "--format", "csv"]);
    assert_eq!(csv.lines().count(), rows.len() + 1, "{csv}");
    let missing = actcheck(project.path(), &["list", "--rules", "--history", "nowhere"]);
    assert_eq!(missing.status.code(), Some(2));
    let missing = actcheck(
        project.path(),
        &["list", "--rules", "--ontology", "nowhere.ttl"],
    );
    assert_eq!(missing.status.code(), Some(2));
}

#[test]
fn a_pass_that_no_left_side_tested_is_counted_as_vacuous() {
    let project = project();
    let folder = project.path();
    for (name, left) in [("High", "w:z(?o) > 10"), ("Lifted", "w:rise(?o) > 0.001")] {
        let text = format!(
            "success(?o) :- parameter(act:pickObject, ?o), always({left} implies w:speed(?o) < 1000) ."
        );
        std::fs::write(folder.join(format!("rules/{name}.rls")), text).unwrap();
    }
    let ontology = folder.join("ontology/actions.ttl");
    edit(
        &ontology,
        "act:CloseObject, act:ObjectGrasped",
        "act:High, act:Lifted, act:CloseObject, act:ObjectGrasped",
    );
    let text = std::fs::read_to_string(&ontology).unwrap();
    let more = "\nact:High a act:Property ; act:verifiedBy <../rules/High.rls> .\n\
                act:Lifted a act:Property ; act:verifiedBy <../rules/Lifted.rls> .\n";
    std::fs::write(&ontology, text + more).unwrap();

    let run = [
        "run",
        "configs/pick.toml",
        "--runs",
        "2",
        "--history",
        "h",
        "--format",
        "json",
    ];
    let printed = json(&actcheck(folder, &run));
    let vacuous = |printed: &Value| -> Vec<(String, Value)> {
        let properties = printed["properties"].as_array().unwrap();
        properties
            .iter()
            .map(|of| {
                (
                    of["property"].as_str().unwrap().to_owned(),
                    of["vacuous"].clone(),
                )
            })
            .collect()
    };
    for (property, count) in vacuous(&printed) {
        assert_eq!(
            count,
            if property.ends_with("#High") { 2 } else { 0 },
            "{property}"
        );
    }
    let remarks = printed["remarks"].as_array().unwrap();
    let remark = remarks
        .iter()
        .find(|remark| remark["oddity"] == "vacuous")
        .expect("there is a remark");
    assert_eq!(
        remark["properties"],
        serde_json::json!(["http://actions#High"])
    );
    assert_eq!(
        (&remark["count"], &remark["of"], &remark["severity"]),
        (&2.into(), &2.into(), &"warning".into())
    );
    let outcomes = printed["runs"][0]["actions"][0]["outcomes"]
        .as_array()
        .unwrap();
    let of = |name: &str| {
        outcomes
            .iter()
            .find(|of| of["property"] == format!("http://actions#{name}"))
            .unwrap()
    };
    assert_eq!(
        (&of("High")["vacuous"], &of("Lifted")["vacuous"]),
        (&true.into(), &false.into())
    );
    assert!(of("CloseObject")["vacuous"].is_null());

    // The history keeps it.
    let shown = stdout(&actcheck(
        folder,
        &[
            "show",
            printed["runs"][0]["run"].as_str().unwrap(),
            "--history",
            "h",
        ],
    ));
    assert!(shown.contains("passed, vacuously"), "{shown}");
    let summary = stdout(&actcheck(
        folder,
        &["run", "configs/pick.toml", "--runs", "2", "--history", "h2"],
    ));
    assert!(summary.contains("2 vacuously"), "{summary}");
    let query = "SELECT (COUNT(*) AS ?n) WHERE { ?result act:vacuous true }";
    let kept = stdout(&actcheck(
        folder,
        &["query", "--history", "h", "--format", "csv", query],
    ));
    assert_eq!(kept.lines().nth(1), Some("2"), "{kept}");

    let again = actcheck(folder, &["recheck", "--history", "h", "--format", "json"]);
    for (property, count) in vacuous(&json(&again)) {
        assert_eq!(
            count,
            if property.ends_with("#High") { 2 } else { 0 },
            "{property}"
        );
    }
    let again = stdout(&actcheck(folder, &["recheck", "--history", "h"]));
    assert!(again.contains("2 passed; 2 vacuously"), "{again}");
}
