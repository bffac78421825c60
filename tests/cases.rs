//! Stored runs exported as files, and the corpus of them that campaigns run first, with the built
//! program.

use std::path::Path;

use serde_json::Value;

use actcheck::history::History;

use crate::support::look::blurred;
use crate::support::{actcheck, copy, edit, project, root, script, stderr, stdout};

/// A project in which the second run of a campaign of two fails. Returns the campaign's id.
fn failing(folder: &Path) -> String {
    failing_of(folder, "configs/clutter.toml")
}

fn failing_of(folder: &Path, config: &str) -> String {
    let output = actcheck(
        folder,
        &[
            "run",
            config,
            "--runs",
            "1",
            "--history",
            "h",
            "--format",
            "json",
        ],
    );
    let json: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    assert_eq!(
        json["exit_code"], 1,
        "the first run of {config} fails: {json:#}"
    );
    format!("{}-1", json["campaign"].as_str().unwrap())
}

fn export(folder: &Path, run: &str, to: &str) {
    let output = actcheck(folder, &["export", "run", run, "-o", to, "--history", "h"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}

/// Exit code and the report about the case.
fn run_case(folder: &Path, file: &str) -> (Option<i32>, Value) {
    let output = actcheck(
        folder,
        &["run", file, "--history", "h2", "--format", "json"],
    );
    let json: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    (output.status.code(), json["case"].clone())
}

fn refused(folder: &Path, arguments: &[&str]) -> String {
    let output = actcheck(folder, arguments);
    assert_eq!(
        output.status.code(),
        Some(2),
        "{}{}",
        stdout(&output),
        stderr(&output)
    );
    stderr(&output)
}

#[test]
fn an_exported_run_reproduces_inside_and_outside_the_project() {
    let project = project();
    let run = failing(project.path());
    export(project.path(), &run, "configs/case.toml");
    let (code, case) = run_case(project.path(), "configs/case.toml");
    assert_eq!(code, Some(1), "{case:#}");
    assert_eq!(
        (&case["recurrence"], &case["same_trace"]),
        (&"as before".into(), &true.into()),
        "{case:#}"
    );
    assert_eq!(case["failed"], case["expected"]);

    let elsewhere = tempfile::tempdir().unwrap();
    let file = elsewhere.path().join("case.toml");
    export(project.path(), &run, file.to_str().unwrap());
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(
        !text.contains("model_dir") && !text.contains("ontology ="),
        "the embedded files are the same: {text}"
    );
    let machine = tempfile::tempdir().unwrap();
    std::fs::copy(&file, machine.path().join("case.toml")).unwrap();
    drop(project);
    let (code, case) = run_case(machine.path(), "case.toml");
    assert_eq!(
        (code, &case["same_trace"]),
        (Some(1), &true.into()),
        "{case:#}"
    );
    let output = actcheck(machine.path(), &["run", "case.toml"]);
    assert!(
        stdout(&output).contains("still fails as recorded: NoGraspCollisions; same trace"),
        "{}",
        stdout(&output)
    );
    // The run of a case is an ordinary run: it can be replayed and exported again.
    let again = case["run"].as_str().unwrap();
    let replayed = actcheck(machine.path(), &["replay", again, "--history", "h2"]);
    assert!(
        stdout(&replayed).contains("the same, every bit"),
        "{}{}",
        stdout(&replayed),
        stderr(&replayed)
    );
    let second = actcheck(
        machine.path(),
        &["export", "run", again, "-o", "-", "--history", "h2"],
    );
    let from = |text: &str| {
        text.lines()
            .filter(|line| !line.contains(again) && !line.contains(&run))
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    assert_eq!(from(&stdout(&second)), from(&text));
}

/// Cases of pick-and-place runs had indices of the surfaces: with another surface before its own in
/// the list, the case ran on that one, without a warning.
#[test]
fn a_case_keeps_its_surface_when_another_one_is_put_before_it() {
    let project = project();
    let arguments = [
        "run",
        "configs/pick_and_place.toml",
        "--runs",
        "1",
        "--history",
        "h",
        "--format",
        "json",
    ];
    let output = actcheck(project.path(), &arguments);
    let json: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    export(
        project.path(),
        &format!("{}-1", json["campaign"].as_str().unwrap()),
        "case.toml",
    );
    let file = project.path().join("case.toml");
    for list in ["\nobject_surfaces = [", "\nplace_object_surfaces = ["] {
        edit(
            &file,
            list,
            &format!("{list}\"dining_table\", \"side_table\", "),
        );
    }
    let (_, case) = run_case(project.path(), "case.toml");
    assert_eq!(case["same_trace"], true, "{case:#}");
    let text = std::fs::read_to_string(&file).unwrap();
    for choice in ["surface.name", "location.name", "place.name"] {
        assert!(
            text.contains(&format!("\n{choice} = \"")),
            "{choice} is named: {text}"
        );
    }
}

#[test]
fn a_case_is_readable_and_its_values_have_names_units_and_bounds() {
    let project = project();
    let run = failing(project.path());
    let output = actcheck(
        project.path(),
        &["export", "run", &run, "-o", "-", "--history", "h"],
    );
    let text = stdout(&output);
    for line in [
        "tests = [[\"Pick\"]]",
        "test_count = 1",
        "expect = [\"NoGraspCollisions\"]",
        "target.model = \"glass\"",
        "other.count = 12",
    ] {
        assert!(
            text.lines().any(|known| known == line),
            "`{line}` in:\n{text}"
        );
    }
    let yaw = text
        .lines()
        .find(|line| line.starts_with("target.yaw = "))
        .unwrap();
    assert!(yaw.ends_with("  # rad, -3.1416 to 3.1416"), "{yaw}");
    assert_eq!(
        text.lines()
            .filter(|line| line.starts_with("other.12.x = "))
            .count(),
        1,
        "only the accepted position is exported"
    );
    assert!(!text.contains("other.12.x = ["), "{text}");
}

#[test]
fn a_case_survives_edits_of_rules_comments_and_ontology() {
    let project = project();
    let run = failing(project.path());
    export(project.path(), &run, "case.toml");
    edit(
        &project.path().join("case.toml"),
        "[case.choices]",
        "# A remark.\n[case.choices]",
    );
    let rule = project.path().join("rules/no_grasp_collisions.rls");
    let kept = std::fs::read_to_string(&rule).unwrap();
    std::fs::write(
        &rule,
        "violation(?x) :- during(?x, <http://nothing.of/that#sort>, ?x) .\n",
    )
    .unwrap();
    let (code, case) = run_case(project.path(), "case.toml");
    assert_eq!(
        (code, &case["recurrence"], &case["same_trace"]),
        (Some(0), &"no longer".into(), &true.into()),
        "{case:#}"
    );

    std::fs::write(&rule, kept).unwrap();
    std::fs::write(
        project.path().join("rules/moved_object.rls"),
        "@prefix w: <https://w3id.org/actcheck/world#> .\n\
         success(?d) :- during(w:action, w:duration, ?d), ?d < 0.1 .\n",
    )
    .unwrap();
    let (code, case) = run_case(project.path(), "case.toml");
    assert_eq!(
        (code, &case["recurrence"]),
        (Some(1), &"otherwise".into()),
        "{case:#}"
    );
    let output = actcheck(project.path(), &["run", "case.toml", "--history", "h2"]);
    let expected =
        "fails differently: MovedObject + NoGraspCollisions (was NoGraspCollisions); same trace";
    assert!(stdout(&output).contains(expected), "{}", stdout(&output));

    let ontology = project.path().join("ontology/actions.ttl");
    let added = "\nact:Extra a owl:Class ; rdfs:label \"extra\" .\n";
    std::fs::write(
        &ontology,
        std::fs::read_to_string(&ontology).unwrap() + added,
    )
    .unwrap();
    assert_eq!(run_case(project.path(), "case.toml").1["same_trace"], true);
}

#[test]
fn impossible_values_are_refused_with_their_lines() {
    let project = project();
    let run = failing(project.path());
    export(project.path(), &run, "case.toml");
    let file = project.path().join("case.toml");
    let good = std::fs::read_to_string(&file).unwrap();
    let place = |text: &str, name: &str| {
        let line = text
            .lines()
            .find(|line| line.starts_with(&format!("{name} = ")))
            .unwrap();
        line.split_once(" = ")
            .unwrap()
            .1
            .split("  #")
            .next()
            .unwrap()
            .to_owned()
    };
    let changed = |text: &str, name: &str, value: &str| {
        let line = |line: &str| match line
            .strip_prefix(name)
            .is_some_and(|rest| rest.starts_with(" = "))
        {
            true => format!("{name} = {value}\n"),
            false => format!("{line}\n"),
        };
        text.lines().map(line).collect::<String>()
    };
    let with = |name: &str, value: &str| changed(&good, name, value);
    let on_top = ["model", "yaw", "x", "y"]
        .iter()
        .fold(good.clone(), |text, what| {
            changed(
                &text,
                &format!("other.2.{what}"),
                &place(&good, &format!("other.1.{what}")),
            )
        });
    let cases = [
        (
            with("target.x", "5.0"),
            "S062",
            "target.x = 5.0",
            "allowed:",
        ),
        (
            with("target.mass_scale", "0.1"),
            "S062",
            "target.mass_scale = 0.1",
            "0.7 to 1.3",
        ),
        (
            with("other.count", "40"),
            "S062",
            "other.count = 40",
            "8 to 12",
        ),
        (
            with("target.model", "\"glas\""),
            "C015",
            "target.model = \"glas\"",
            "`glass`",
        ),
        (
            with("target.yaw", "\"left\""),
            "C004",
            "target.yaw = \"left\"",
            "a number",
        ),
        (
            good.replace("target.yaw = ", "target.yaww = "),
            "S061",
            "target.yaww = ",
            "`target.yaw`",
        ),
        (
            good.replace("sense.glass_1.x = ", "sense.glas_1.x = "),
            "S061",
            "sense.glas_1.x = ",
            "`sense.glass_1.x`",
        ),
        (
            good.replace("robot.gap = ", "\"target.x\" = 0.0\nrobot.gap = "),
            "C015",
            "",
            "twice",
        ),
        (on_top, "S063", "other.2.x = ", "move one of the two"),
    ];
    for (text, code, line, help) in cases {
        std::fs::write(&file, &text).unwrap();
        let printed = refused(project.path(), &["run", "case.toml", "--history", "h2"]);
        assert!(
            printed.contains(code) && printed.contains(line) && printed.contains(help),
            "{code} {line}: {printed}"
        );
        assert!(printed.contains("case.toml:"), "the place: {printed}");
        let checked = refused(project.path(), &["check", "case.toml"]);
        assert!(checked.contains(code), "{checked}");
    }
    std::fs::write(&file, with("target.mass_scale", "1.0")).unwrap();
    let (_, case) = run_case(project.path(), "case.toml");
    assert_eq!(
        case["same_trace"], false,
        "an edited value counts: {case:#}"
    );
    std::fs::write(&file, &good).unwrap();
    let printed = refused(
        project.path(),
        &["run", "case.toml", "--runs", "5", "--seed", "3", "--shrink"],
    );
    assert_eq!(printed.matches("X040").count(), 3, "{printed}");
}

#[test]
fn shrunk_runs_and_runs_of_several_tests_can_be_exported() {
    let project = blurred();
    let config = project.path().join("configs/look.toml");
    let look = "\"PerceivePlane\"";
    edit(
        &config,
        &format!("tests = [[{look}]]"),
        &format!("tests = [[{look}, {look}], [{look}]]"),
    );
    let run = failing_of(project.path(), "configs/look.toml");
    let output = actcheck(
        project.path(),
        &[
            "shrink",
            &run,
            "--trials",
            "8",
            "--history",
            "h",
            "--format",
            "json",
        ],
    );
    let small: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    let small = small["run"].as_str().unwrap();
    // A shrunk run is the only run of its campaign, and may perform fewer actions than its test.
    let replayed = actcheck(project.path(), &["replay", small, "--history", "h"]);
    assert_eq!(
        replayed.status.code(),
        Some(0),
        "{}{}",
        stdout(&replayed),
        stderr(&replayed)
    );
    for exported in [run.as_str(), small] {
        export(project.path(), exported, "case.toml");
        let (code, case) = run_case(project.path(), "case.toml");
        assert_eq!(
            (code, &case["same_trace"]),
            (Some(1), &true.into()),
            "{exported}: {case:#}"
        );
    }
    let text = std::fs::read_to_string(project.path().join("case.toml")).unwrap();
    assert!(
        text.contains(".left_out = true") && !text.contains("test.left_out"),
        "{text}"
    );
}

#[test]
fn a_campaign_runs_its_regressions_first_and_reports_them_separately() {
    let project = project();
    let run = failing(project.path());
    let added = actcheck(
        project.path(),
        &["export", "run", &run, "--regression", "--history", "h"],
    );
    assert!(
        stdout(&added).contains(&format!("regressions/{run}.toml holds run {run}")),
        "{}",
        stdout(&added)
    );
    let twice = refused(
        project.path(),
        &["export", "run", &run, "--regression", "--history", "h"],
    );
    assert!(twice.contains("X042"), "{twice}");
    let arguments = [
        "run",
        "configs/lone_glass.toml",
        "--runs",
        "1",
        "--history",
        "h3",
    ];
    let campaign = |more: &[&str]| actcheck(project.path(), &[&arguments[..], more].concat());
    let output = campaign(&["--format", "json"]);
    let json: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    assert_eq!(
        json["regressions"][0]["recurrence"], "as before",
        "{json:#}"
    );
    assert_eq!(
        json["runs"].as_array().unwrap().len(),
        1,
        "regressions are not counted among the runs"
    );
    assert_eq!(
        (json["exit_code"].as_i64(), output.status.code()),
        (Some(1), Some(1))
    );
    let text = stdout(&campaign(&["--jobs", "1"]));
    let expected = format!("regressions: 1 ran, 1 fails again: {run}.toml (NoGraspCollisions)\n");
    assert!(text.starts_with(&expected), "{text}");

    let file = project.path().join(format!("regressions/{run}.toml"));
    edit(&file, "target.model = \"glass\"", "target.model = \"glas\"");
    std::fs::copy(
        project.path().join("configs/pick.toml"),
        project.path().join("regressions/pick.toml"),
    )
    .unwrap();
    let printed = refused(project.path(), &arguments);
    assert!(
        printed.contains("C015") && printed.contains(&format!("{run}.toml:")),
        "{printed}"
    );
    assert!(refused(project.path(), &["check", "configs/lone_glass.toml"]).contains("C015"));
    edit(&file, "target.model = \"glas\"", "target.model = \"glass\"");
    let printed = refused(project.path(), &arguments);
    assert!(
        printed.contains("regressions/pick.toml") && printed.contains("S0"),
        "{printed}"
    );
}

#[test]
fn regressions_of_a_standalone_configuration_are_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    copy(&root().join("configs"), &folder.path().join("mine"));
    let config = folder.path().join("mine/clutter.toml");
    edit(
        &config,
        "ontology = \"../ontology/actions.ttl\"\nmodel_dir = \"../models\"\n",
        "",
    );
    let output = actcheck(
        folder.path(),
        &["run", "mine/clutter.toml", "--runs", "1", "--format", "csv"],
    );
    let table = stdout(&output);
    let run = table.lines().nth(1).unwrap().split(',').next().unwrap();
    let added = actcheck(folder.path(), &["export", "run", run, "--regression"]);
    assert!(
        stdout(&added).starts_with(&format!("mine/regressions/{run}.toml holds")),
        "{}{}",
        stdout(&added),
        stderr(&added)
    );
    let output = actcheck(folder.path(), &["run", "mine/clutter.toml", "--runs", "1"]);
    assert!(
        stdout(&output).starts_with("regressions: 1 ran, 1 fails again: "),
        "{}",
        stdout(&output)
    );
}

#[test]
fn only_the_first_shard_runs_the_regressions() {
    let project = project();
    let run = failing(project.path());
    actcheck(
        project.path(),
        &["export", "run", &run, "--regression", "--history", "h"],
    );
    for (part, cases) in [("1/2", 1), ("2/2", 0)] {
        let history = format!("part{}", &part[..1]);
        let arguments = [
            "run",
            "configs/lone_glass.toml",
            "--runs",
            "2",
            "--shard",
            part,
            "--history",
            &history,
        ];
        let output = actcheck(
            project.path(),
            &[&arguments[..], &["--format", "json"]].concat(),
        );
        let json: Value = serde_json::from_str(&stdout(&output))
            .unwrap_or_else(|_| panic!("{}", stderr(&output)));
        assert_eq!(
            json["regressions"].as_array().unwrap().len(),
            cases,
            "{part}: {json:#}"
        );
    }
    let merged = actcheck(
        project.path(),
        &["merge", "part2", "part1", "--into", "whole"],
    );
    assert_eq!(merged.status.code(), Some(0), "{}", stderr(&merged));
    let list = stdout(&actcheck(
        project.path(),
        &["list", "--history", "whole", "--format", "csv"],
    ));
    assert_eq!(list.lines().count(), 4, "two runs and the case: {list}");
}

/// A case pinned the skills with which it was recorded: a program that can't start was reported as
/// "1 fails again".
#[test]
fn regressions_test_the_skills_of_the_campaign() {
    let project = project();
    let folder = project.path();
    let run = failing(folder);
    actcheck(
        folder,
        &["export", "run", &run, "--regression", "--history", "h"],
    );
    script(
        &folder.join("configs/no_skill.sh"),
        "#!/bin/sh\necho no robot here\nexit 3\n",
    );
    let pick = std::fs::read_to_string(folder.join("configs/lone_glass.toml")).unwrap();
    let text = pick.replace(
        "test_launcher = \"reference\"",
        "test_launcher = \"./no_skill.sh\"",
    );
    assert_ne!(text, pick);
    std::fs::write(folder.join("configs/mine.toml"), text).unwrap();
    let output = actcheck(
        folder,
        &[
            "run",
            "configs/mine.toml",
            "--runs",
            "1",
            "--history",
            "h4",
            "--jobs",
            "1",
        ],
    );
    let told = stdout(&output);
    assert_eq!(output.status.code(), Some(2), "{told}{}", stderr(&output));
    assert!(
        told.starts_with(&format!(
            "regressions: 1 ran, 1 could not be decided: {run}.toml (the program"
        )),
        "{told}"
    );

    // The run of the case is stored with the program that performed it.
    let list = stdout(&actcheck(
        folder,
        &["list", "--history", "h4", "--format", "csv"],
    ));
    let case = list.lines().nth(1).unwrap().split(',').next().unwrap();
    let shown = stdout(&actcheck(folder, &["show", case, "--history", "h4"]));
    assert!(
        shown.contains("the program printed last:\n  no robot here"),
        "{shown}"
    );
    let again = actcheck(
        folder,
        &["export", "run", case, "-o", "-", "--history", "h4"],
    );
    assert!(
        stdout(&again).contains("no_skill.sh"),
        "{}{}",
        stdout(&again),
        stderr(&again)
    );
}

/// The cases of a campaign ran again whenever it was resumed.
#[test]
fn a_resumed_campaign_keeps_the_results_of_its_regressions() {
    let project = project();
    let folder = project.path();
    let run = failing(folder);
    actcheck(
        folder,
        &["export", "run", &run, "--regression", "--history", "h"],
    );
    let arguments = [
        "run",
        "configs/lone_glass.toml",
        "--runs",
        "2",
        "--history",
        "h5",
        "--format",
        "json",
    ];
    let whole: Value = serde_json::from_str(&stdout(&actcheck(folder, &arguments))).unwrap();
    let id = whole["campaign"].as_str().unwrap();
    let history = History::open(&folder.join("h5")).unwrap();
    history.reopen_campaign(id).unwrap();
    drop(history);
    let resumed = actcheck(
        folder,
        &["run", "--resume", "--history", "h5", "--format", "json"],
    );
    let resumed: Value =
        serde_json::from_str(&stdout(&resumed)).unwrap_or_else(|_| panic!("{}", stderr(&resumed)));
    assert_eq!(resumed["regressions"], whole["regressions"], "{resumed:#}");
    assert_eq!(resumed["exit_code"], whole["exit_code"]);
    let list = stdout(&actcheck(
        folder,
        &["list", "--history", "h5", "--format", "csv"],
    ));
    assert_eq!(list.lines().count(), 4, "two runs and one case: {list}");
}
