//! The commands other than `run`, with the built program.

use serde_json::Value;

use crate::support::{actcheck, edit, project, stderr, stdout};

#[test]
fn a_new_property_is_judged_as_soon_as_it_is_written() {
    let project = project();
    let new = actcheck(
        project.path(),
        &["new", "property", "StaysUpright", "--for", "Pick"],
    );
    assert!(new.status.success(), "{}", stderr(&new));
    let check = actcheck(project.path(), &["check", "configs/pick.toml"]);
    assert!(check.status.success(), "{}", stderr(&check));
    let run = actcheck(
        project.path(),
        &[
            "run",
            "configs/pick.toml",
            "--runs",
            "2",
            "--history",
            "h",
            "--format",
            "json",
        ],
    );
    let json: Value =
        serde_json::from_str(&stdout(&run)).unwrap_or_else(|_| panic!("{}", stderr(&run)));
    let properties = json["properties"].as_array().unwrap();
    let new = properties
        .iter()
        .find(|p| p["property"] == "http://actions#StaysUpright")
        .expect("it is judged");
    assert_eq!(
        new["counts"]["passed"].as_u64().unwrap() + new["counts"]["failed"].as_u64().unwrap(),
        2
    );
    let twice = actcheck(
        project.path(),
        &["new", "property", "StaysUpright", "--for", "Pick"],
    );
    assert_eq!(twice.status.code(), Some(2));
    assert!(stderr(&twice).contains("already"), "{}", stderr(&twice));
    let wrong = actcheck(
        project.path(),
        &["new", "property", "Other", "--for", "Pikc"],
    );
    assert!(
        stderr(&wrong).contains("did you mean `Pick`"),
        "{}",
        stderr(&wrong)
    );
}

#[test]
fn why_prints_the_proof_or_the_missing_facts() {
    let project = project();
    actcheck(
        project.path(),
        &["run", "configs/pick.toml", "--runs", "6", "--history", "h"],
    );
    let list = stdout(&actcheck(
        project.path(),
        &["list", "--history", "h", "--format", "csv"],
    ));
    let run = |score: &str| {
        let line = list
            .lines()
            .find(|line| line.contains(score))
            .expect("the first six runs pass and fail");
        line.split(',').next().unwrap().to_owned()
    };
    let why = |run: &str, property: &str| {
        let output = actcheck(project.path(), &["why", run, property, "--history", "h"]);
        assert!(output.status.success(), "{}", stderr(&output));
        stdout(&output)
    };
    let holds = why(&run(",1.0,"), "MovedObject");
    assert!(
        holds.contains("moved_object.rls") && holds.contains("geometry.rls"),
        "no rule's place:\n{holds}"
    );
    let fails = why(&run(",0."), "ObjectInGripper");
    assert!(
        fails.contains("object_in_gripper.rls"),
        "no rule's place:\n{fails}"
    );
    assert_ne!(holds, fails);
    let unknown = actcheck(
        project.path(),
        &["why", &run(",1.0,"), "MovedObjekt", "--history", "h"],
    );
    assert!(
        stderr(&unknown).contains("did you mean `MovedObject`"),
        "{}",
        stderr(&unknown)
    );
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
    let trace = actcheck(
        folder.path(),
        &["datalog", "paths.rls", "--trace", "path(a, d)"],
    );
    assert!(trace.status.success(), "{}", stderr(&trace));
    assert!(stdout(&trace).contains("paths.rls"), "{}", stdout(&trace));
    for (format, begins) in [("csv", "predicate,tuples\n"), ("json", "[")] {
        let table = actcheck(
            folder.path(),
            &["datalog", "paths.rls", "-D", "out", "--format", format],
        );
        assert!(stdout(&table).starts_with(begins), "{}", stdout(&table));
        assert!(
            stderr(&table).contains("6 lines"),
            "one document on standard output: {}",
            stderr(&table)
        );
    }
    let trace = ["datalog", "paths.rls", "--trace", "path(a, d)", "--format"];
    let csv = stdout(&actcheck(folder.path(), &[&trace[..], &["csv"]].concat()));
    assert!(
        csv.starts_with("fact,holds,margin,explanation\n\"path(a, d)\","),
        "{csv}"
    );
    let dot = actcheck(folder.path(), &["datalog", "paths.rls", "--format", "dot"]);
    assert_eq!(dot.status.code(), Some(2));
    assert!(
        stderr(&dot).contains("X004") && stderr(&dot).contains("--trace"),
        "{}",
        stderr(&dot)
    );
    std::fs::write(
        folder.path().join("endless.rls"),
        "n(0) .\nn(?y) :- n(?x), ?y = ?x + 1 .\n",
    )
    .unwrap();
    let endless = actcheck(
        folder.path(),
        &["datalog", "endless.rls", "--max-memory", "10MB"],
    );
    assert_eq!(endless.status.code(), Some(2));
    assert!(
        stderr(&endless).contains("endless.rls"),
        "{}",
        stderr(&endless)
    );
    std::fs::write(
        folder.path().join("things.rls"),
        "n(0) .\nm(?x, !y), n(!y) :- n(?x) .\n",
    )
    .unwrap();
    let endless = actcheck(
        folder.path(),
        &["datalog", "things.rls", "--max-new", "100"],
    );
    assert_eq!(endless.status.code(), Some(2));
    let text = stderr(&endless);
    assert!(
        [
            "R063",
            "R090",
            "`n` (argument 1)",
            "more than 100 new things",
            "--max-new"
        ]
        .iter()
        .all(|word| text.contains(word)),
        "{text}"
    );
}

#[test]
fn a_limit_of_time_has_a_unit_or_is_a_number_of_seconds() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("one.rls"), "p(1) .\n").unwrap();
    for limit in [["--max-time", "60"], ["--max-time", "1.5s"]] {
        let run = actcheck(folder.path(), &["datalog", "one.rls", limit[0], limit[1]]);
        assert!(run.status.success(), "{limit:?}: {}", stderr(&run));
    }
    for wrong in ["0", "0s", "-1s", "soon", "10 apples"] {
        let run = actcheck(
            folder.path(),
            &["datalog", "one.rls", &format!("--max-time={wrong}")],
        );
        assert_eq!(run.status.code(), Some(2), "{wrong}");
    }
}

#[test]
fn the_last_runs_have_names_and_help_is_a_command() {
    let project = project();
    let folder = project.path();
    let list = |more: &[&str]| {
        stdout(&actcheck(
            folder,
            &[&["list", "--history", "h", "--format", "csv"], more].concat(),
        ))
    };
    let shown = |name: &str| actcheck(folder, &["show", name, "--history", "h"]);
    let run = actcheck(
        folder,
        &["run", "configs/pick.toml", "--runs", "6", "--history", "h"],
    );
    assert_eq!(run.status.code(), Some(1), "{}", stderr(&run));
    for (name, rows) in [("@last", list(&[])), ("@last-failed", list(&["--failed"]))] {
        let id = rows.lines().last().unwrap().split(',').next().unwrap();
        let output = shown(name);
        assert!(
            stdout(&output).starts_with(&format!("run {id} ")),
            "{name}: {}{}",
            stdout(&output),
            stderr(&output)
        );
    }
    let run = actcheck(
        folder,
        &[
            "run",
            "configs/lone_glass.toml",
            "--runs",
            "1",
            "--history",
            "whole",
        ],
    );
    assert_eq!(run.status.code(), Some(0), "{}", stderr(&run));
    let none = actcheck(folder, &["show", "@last-failed", "--history", "whole"]);
    assert!(
        stderr(&none).contains("has no run in which a property failed"),
        "{}",
        stderr(&none)
    );

    let help = stdout(&actcheck(folder, &["help", "run"]));
    assert_eq!(help, stdout(&actcheck(folder, &["run", "--help"])));
}

/// An empty table is also the answer to a misspelt query.
#[test]
fn an_empty_answer_names_the_terms_that_do_not_exist() {
    const NONE: &str = "the query has no answers\n";
    let project = project();
    actcheck(
        project.path(),
        &[
            "run",
            "configs/lone_glass.toml",
            "--runs",
            "1",
            "--history",
            "h",
        ],
    );
    let told = |query: &str, code: i32| {
        let output = actcheck(project.path(), &["query", "--history", "h", query]);
        assert_eq!(output.status.code(), Some(code), "{}", stderr(&output));
        stderr(&output)
    };
    let misspelt = told("SELECT ?run { ?o act:ofRun ?run ; act:rol \"target\" }", 2);
    assert!(
        misspelt.contains("no term `act:rol`") && misspelt.contains("did you mean `act:role`?"),
        "{misspelt}"
    );
    assert_eq!(
        told(
            "SELECT ?run { ?o act:ofRun ?run ; act:role \"act:rol\" }",
            0
        ),
        NONE
    );
    assert_eq!(
        told(
            "SELECT ?a { GRAPH act:rechecked { ?a earl:test act:MovedObject } FILTER(act:counts(?a)) }",
            0
        ),
        NONE
    );
}

/// A broken file that no scene can contain stopped every campaign of the folder.
#[test]
fn a_broken_model_stops_only_the_campaigns_that_name_it() {
    let project = project();
    let folder = project.path();
    std::fs::write(
        folder.join("models/objects/broken.toml"),
        "category = \"act:Glass\"\n[",
    )
    .unwrap();
    let check = actcheck(folder, &["check", "configs/pick.toml"]);
    assert!(check.status.success(), "{}", stderr(&check));
    assert!(
        stderr(&check).contains("C002") && stderr(&check).contains("broken.toml"),
        "{}",
        stderr(&check)
    );
    edit(
        &folder.join("configs/pick.toml"),
        "model_list = [\"glass\"]",
        "model_list = [\"glass\", \"broken\"]",
    );
    let check = actcheck(folder, &["check", "configs/pick.toml"]);
    assert_eq!(check.status.code(), Some(2), "{}", stdout(&check));
    assert!(stderr(&check).contains("C002"), "{}", stderr(&check));
}
