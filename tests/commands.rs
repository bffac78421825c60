//! The commands other than `run`, with the built program.

use serde_json::Value;

use crate::support::{actcheck, project, stderr, stdout};

#[test]
fn a_new_property_is_judged_as_soon_as_it_is_written() {
    let project = project();
    let new = actcheck(project.path(), &["new", "property", "StaysUpright", "--for", "Pick"]);
    assert!(new.status.success(), "{}", stderr(&new));
    let check = actcheck(project.path(), &["check", "configs/pick.toml"]);
    assert!(check.status.success(), "{}", stderr(&check));
    let run =
        actcheck(project.path(), &["run", "configs/pick.toml", "--runs", "2", "--history", "h", "--format", "json"]);
    let json: Value = serde_json::from_str(&stdout(&run)).unwrap_or_else(|_| panic!("{}", stderr(&run)));
    let properties = json["properties"].as_array().unwrap();
    let new = properties.iter().find(|p| p["property"] == "http://actions#StaysUpright").expect("it is judged");
    assert_eq!(new["counts"]["passed"].as_u64().unwrap() + new["counts"]["failed"].as_u64().unwrap(), 2);
    let twice = actcheck(project.path(), &["new", "property", "StaysUpright", "--for", "Pick"]);
    assert_eq!(twice.status.code(), Some(2));
    assert!(stderr(&twice).contains("already"), "{}", stderr(&twice));
    let wrong = actcheck(project.path(), &["new", "property", "Other", "--for", "Pikc"]);
    assert!(stderr(&wrong).contains("did you mean `Pick`"), "{}", stderr(&wrong));
}

#[test]
fn why_prints_the_proof_or_the_missing_facts() {
    let project = project();
    actcheck(project.path(), &["run", "configs/pick.toml", "--runs", "4", "--history", "h"]);
    let list = stdout(&actcheck(project.path(), &["list", "--history", "h", "--format", "csv"]));
    let run = |score: &str| {
        let line = list.lines().find(|line| line.contains(score)).expect("the first four runs pass and fail");
        line.split(',').next().unwrap().to_owned()
    };
    let why = |run: &str, property: &str| {
        let output = actcheck(project.path(), &["why", run, property, "--history", "h"]);
        assert!(output.status.success(), "{}", stderr(&output));
        stdout(&output)
    };
    let holds = why(&run(",1.0,"), "MovedObject");
    assert!(holds.contains("moved_object.rls") && holds.contains("geometry.rls"), "no rule's place:\n{holds}");
    let fails = why(&run(",0."), "ObjectInGripper");
    assert!(fails.contains("object_in_gripper.rls"), "no rule's place:\n{fails}");
    assert_ne!(holds, fails);
    let unknown = actcheck(project.path(), &["why", &run(",1.0,"), "MovedObjekt", "--history", "h"]);
    assert!(stderr(&unknown).contains("did you mean `MovedObject`"), "{}", stderr(&unknown));
}

#[test]
fn a_standalone_datalog_program_exports_and_explains() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("edges.csv"), "a,b\nb,c\nc,d\n").unwrap();
    std::fs::write(
        folder.path().join("paths.rls"),
        "@import edge :- csv{resource = \"edges.csv\"} .\n\
         path(?x, ?y) :- edge(?x, ?y) .\npath(?x, ?z) :- path(?x, ?y), edge(?y, ?z) .\n@export path :- csv{} .\n",
    )
    .unwrap();
    let run = actcheck(folder.path(), &["datalog", "paths.rls", "-D", "out"]);
    assert!(run.status.success(), "{}", stderr(&run));
    let rows = std::fs::read_to_string(folder.path().join("out/path.csv")).unwrap();
    assert_eq!(rows.lines().count(), 6, "{rows}");
    let trace = actcheck(folder.path(), &["datalog", "paths.rls", "--trace", "path(a, d)"]);
    assert!(trace.status.success(), "{}", stderr(&trace));
    assert!(stdout(&trace).contains("paths.rls"), "{}", stdout(&trace));
    std::fs::write(folder.path().join("endless.rls"), "n(0) .\nn(?y) :- n(?x), ?y = ?x + 1 .\n").unwrap();
    let endless = actcheck(folder.path(), &["datalog", "endless.rls", "--max-tuples", "10000"]);
    assert_eq!(endless.status.code(), Some(2));
    assert!(stderr(&endless).contains("endless.rls"), "{}", stderr(&endless));
}
