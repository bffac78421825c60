//! A pattern as a rule that selects more scenes of its kind.

use std::collections::BTreeMap;
use std::path::Path;

use actcheck::analysis::{Column, ColumnKind, Condition, Parameter, Values, columns};
use actcheck::campaign::{Clock, Env, Failure, RunContext, run_line};
use actcheck::config::Overrides;
use actcheck::data::Choices;
use actcheck::report::scene_rule;

use crate::support::planted::{arc, kind, range};
use crate::support::{actcheck, project, stderr};

const CONTEXT: RunContext = RunContext {
    clock: Clock {
        now: String::new,
        secs: || 0.0,
    },
    disturb: None,
};

/// Objects move less than this while they settle, in metres and radians.
const SETTLED: f64 = 0.01;

fn parameter(name: &str) -> Parameter {
    Parameter {
        name: name.to_owned(),
        unit: None,
        values: Values::Numbers(Vec::new()),
    }
}

/// The rows of a history's table.
fn rows(project: &Path) -> Vec<BTreeMap<String, String>> {
    assert!(
        actcheck(
            project,
            &["export", "tables", "t", "--csv", "--history", "h"]
        )
        .status
        .success()
    );
    csv::Reader::from_path(project.join("t/outcomes.csv"))
        .unwrap()
        .deserialize()
        .map(Result::unwrap)
        .collect()
}

/// A rule for a pattern accepts exactly the scenes with that pattern.
#[test]
fn more_scenes_of_a_pattern_can_be_requested() {
    let names = [
        "target_category",
        "others",
        "neighbour_distance_m",
        "surface_y_m",
        "target_turned_rad",
        "target_ahead_m",
    ];
    let parameters: Vec<Parameter> = names.into_iter().map(parameter).collect();
    let conditions = [
        kind(0, "Cup"),
        range(1, Some(2.0), None),
        range(2, Some(0.12), None),
        range(3, Some(0.0), None),
        range(4, Some(-2.5), Some(2.5)),
        range(5, Some(0.0), Some(2.0)),
    ];
    let rule = scene_rule(&conditions, &parameters, "a made-up pattern").unwrap();
    let project = project();
    std::fs::write(project.path().join("configs/more.rls"), rule).unwrap();
    let config = project.path().join("configs/pick.toml");
    let text = std::fs::read_to_string(&config).unwrap();
    std::fs::write(&config, text + "\n[scene]\nrequire = \"more.rls\"\n").unwrap();
    let output = actcheck(
        project.path(),
        &["run", "configs/pick.toml", "--runs", "4", "--history", "h"],
    );
    assert!(
        output.status.code().is_some_and(|code| code < 2),
        "{}",
        stderr(&output)
    );
    let rows = rows(project.path());
    assert_eq!(rows.len(), 20);
    for row in rows {
        let number = |name: &str| row[name].parse::<f64>().unwrap();
        assert!(
            number("others") >= 2.0 && number("neighbour_distance_m") > 0.12 - SETTLED,
            "{row:?}"
        );
        assert!(
            number("surface_y_m") > -SETTLED && number("target_turned_rad").abs() < 2.5 + SETTLED,
            "{row:?}"
        );
        assert!(
            number("target_ahead_m") > 0.0 && number("target_ahead_m") < 2.0 + SETTLED,
            "{row:?}"
        );
        assert!(row["target_kinds"].contains("Cup"));
    }
}

/// A condition that holds in a scene, by its row in the table; and one that does not.
fn conditions(column: &Column, row: &BTreeMap<String, String>) -> [Condition; 2] {
    let value = &row[column.name];
    assert!(
        !value.is_empty(),
        "the scene has no {}: use another scene",
        column.name
    );
    match column.kind {
        _ if column.wraps => {
            let value: f64 = value.parse().unwrap();
            [
                arc(0, value - SETTLED, value - 2.0 * SETTLED),
                arc(0, value + SETTLED, value - SETTLED),
            ]
        }
        ColumnKind::Text => [
            kind(0, value.rsplit(['#', '/']).next().unwrap()),
            kind(0, "nothing"),
        ],
        _ => {
            let value: f64 = value.parse().unwrap();
            [
                range(0, Some(value - SETTLED), Some(value + SETTLED)),
                range(0, Some(value + SETTLED), None),
            ]
        }
    }
}

/// For every parameter of the table, a rule gives the same value as the table.
#[test]
fn rules_have_every_parameter_of_the_tables() {
    let project = project();
    let folder = project.path();
    let output = actcheck(
        folder,
        &[
            "run",
            "configs/pick_and_place.toml",
            "--runs",
            "1",
            "--seed",
            "3",
            "--history",
            "h",
        ],
    );
    assert!(
        output.status.code().is_some_and(|code| code < 2),
        "{}",
        stderr(&output)
    );
    let row = rows(folder)
        .into_iter()
        .find(|row| row["action"].ends_with("#Pick"))
        .unwrap();
    let config = folder.join("configs/pick_and_place.toml");
    let text = std::fs::read_to_string(&config).unwrap();
    std::fs::write(
        &config,
        format!("{text}\n[scene]\nrequire = \"more.rls\"\n"),
    )
    .unwrap();
    let asked = |conditions: &[Condition], parameters: &[Parameter]| {
        let rule = scene_rule(conditions, parameters, "made up").unwrap();
        std::fs::write(folder.join("configs/more.rls"), rule).unwrap();
        let env = Env::prepare(&config, &Overrides::default())
            .unwrap_or_else(|faults| panic!("{faults}"));
        run_line(&env, "k", 0, Choices::random(3, 0), &CONTEXT)
    };
    let mut held = Vec::new();
    let mut parameters = Vec::new();
    for (idx, column) in columns()
        .iter()
        .filter(|column| column.parameter)
        .enumerate()
    {
        let [holds, fails] = conditions(column, &row);
        let discard = asked(&[fails], &[parameter(column.name)]).err();
        assert!(
            matches!(&discard, Some(Failure::Discard(why)) if why.starts_with("does not satisfy")),
            "{}: {discard:?}",
            column.name
        );
        held.push(match holds {
            Condition::Kind { kind: name, .. } => kind(idx, &name),
            Condition::Range { low, high, .. } => range(idx, low, high),
            Condition::Arc { from, to, .. } => arc(idx, from, to),
        });
        parameters.push(parameter(column.name));
    }
    assert!(parameters.len() > 40);
    let unknown = scene_rule(
        &[range(0, None, Some(1.0))],
        &[parameter("phase_of_the_moon")],
        "",
    );
    assert_eq!(unknown, Err(vec!["phase_of_the_moon".to_owned()]));
    let record = asked(&held, &parameters).unwrap_or_else(|failure| panic!("{failure}"));
    assert_eq!(record.trace.hash, row["trace_hash"]);
}

/// Counts are 0 if there are no objects to count.
#[test]
fn a_rule_can_request_scenes_without_objects() {
    let project = project();
    let config = project.path().join("configs/pick.toml");
    let text = std::fs::read_to_string(&config).unwrap();
    std::fs::write(&config, text + "\n[scene]\nrequire = \"more.rls\"\n").unwrap();
    let names = ["others", "obstacles", "place_others"];
    for (bounds, stands) in [((None, Some(1.0)), true), ((Some(1.0), None), false)] {
        let conditions: Vec<Condition> = (0..2)
            .map(|idx| range(idx + 1, bounds.0, bounds.1))
            .collect();
        let rule = scene_rule(&conditions, &names.map(parameter), "made up").unwrap();
        std::fs::write(project.path().join("configs/more.rls"), rule).unwrap();
        let env = Env::prepare(&config, &Overrides::default())
            .unwrap_or_else(|faults| panic!("{faults}"));
        assert_eq!(
            run_line(&env, "k", 0, Choices::random(3, 0), &CONTEXT).is_ok(),
            stands
        );
    }
}
