//! Files of others that were once read wrongly: every folder of `tests/models/cases` is a case.
//!
//! A case has a configuration `c.toml`, the files that it names, and `expected.toml`: the
//! words that `new robot` and `check` must print, and the values that must be read. A new case needs no Rust.

use std::collections::BTreeMap;
use std::path::Path;

use actcheck::campaign::Env;
use actcheck::config::Overrides;
use serde::Deserialize;
use serde_json::Value;

use crate::support::{actcheck, copy, root, stderr, stdout};

/// The content of `expected.toml`.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Expected {
    /// Arguments of `new robot`, which writes `robot.toml`; without any, it isn't run.
    new_robot: Vec<String>,
    /// Exit code of `new robot`.
    new_robot_exit: i32,
    /// Exit code of `check`.
    exit: i32,
    /// Codes that both commands together must print, and must not print.
    codes: Vec<String>,
    codes_not: Vec<String>,
    /// Texts that they must print, and must not print; white space counts as one space.
    says: Vec<String>,
    says_not: Vec<String>,
    /// Number of runs that pass; without it, nothing is run.
    passed: Option<u64>,
    models: BTreeMap<String, Model>,
    robot: Robot,
    furniture: BTreeMap<String, Piece>,
}

/// Values of a model. Units: kilograms and metres.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Model {
    mass_kg: Option<f64>,
    size_m: Option<[f64; 3]>,
    friction: Option<f64>,
    fixed: Option<bool>,
    /// Names of the parts that joints move.
    moving: Option<Vec<String>>,
}

/// Values of the robot. Units: newtons or newton metres, and kilograms.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Robot {
    arm: Option<Vec<String>>,
    fingers: Option<Vec<String>>,
    grip_force_n: Option<f64>,
    /// By joint.
    effort: BTreeMap<String, f64>,
    /// Of the whole robot.
    mass_kg: Option<f64>,
}

/// Place of a piece of furniture. Unit: metres. Frame: the map.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Piece {
    at_m: [f64; 2],
}

#[test]
fn files_of_others_are_read_as_their_formats_say() {
    let mut cases: Vec<_> = std::fs::read_dir(root().join("tests/models/cases"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    cases.sort();
    assert!(cases.len() >= 36, "only {} cases", cases.len());
    let faults: Vec<String> = cases.iter().flat_map(|case| faults_of(case)).collect();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// The ways in which a case is not as expected.
fn faults_of(case: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(case.join("expected.toml")).unwrap();
    let expected: Expected =
        toml::from_str(&text).unwrap_or_else(|fault| panic!("{}: {fault}", case.display()));
    let folder = tempfile::tempdir().unwrap();
    copy(case, folder.path());
    let mut faults = said_wrongly(&expected, folder.path());
    if expected.exit == 0 && faults.is_empty() {
        faults.extend(wrong_values(&expected, folder.path()));
        faults.extend(wrong_runs(&expected, folder.path()));
    }
    let name = case.file_name().unwrap().display().to_string();
    faults
        .iter()
        .map(|fault| format!("{name}: {fault}"))
        .collect()
}

/// Runs `new robot` and `check`, and compares their words.
fn said_wrongly(expected: &Expected, folder: &Path) -> Vec<String> {
    let mut faults = Vec::new();
    let mut said = String::new();
    let mut command = |args: &[&str], exit: i32| {
        let output = actcheck(folder, args);
        let words = (stdout(&output) + &stderr(&output)).replace('│', " ");
        said += &words.split_whitespace().collect::<Vec<_>>().join(" ");
        if output.status.code() != Some(exit) {
            faults.push(format!(
                "{} ends with {:?}, not {exit}: {words}",
                args[0], output.status
            ));
        }
    };
    if !expected.new_robot.is_empty() {
        let mut args = vec!["new", "robot", "--out", "robot.toml"];
        args.extend(expected.new_robot.iter().map(String::as_str));
        command(&args, expected.new_robot_exit);
    }
    command(&["check", "c.toml"], expected.exit);
    let (wanted, unwanted) = (
        expected.codes.iter().chain(&expected.says),
        expected.codes_not.iter().chain(&expected.says_not),
    );
    faults.extend(
        wanted
            .filter(|text| !said.contains(*text))
            .map(|text| format!("nothing says {text}: {said}")),
    );
    faults.extend(
        unwanted
            .filter(|text| said.contains(*text))
            .map(|text| format!("something says {text}: {said}")),
    );
    faults
}

/// Compares the values that were read.
fn wrong_values(expected: &Expected, folder: &Path) -> Vec<String> {
    let env = Env::prepare(&folder.join("c.toml"), &Overrides::default())
        .unwrap_or_else(|faults| panic!("{faults}"));
    let mut faults = Vec::new();
    for (name, wanted) in &expected.models {
        let found = env.campaign.models.get(name);
        let found = found.unwrap_or_else(|| panic!("there is no model {name}"));
        let mass = wanted.mass_kg.map(|kg| [kg; 3]);
        compare(&mut faults, (name, "mass"), mass, [found.mass_kg; 3]);
        compare(&mut faults, (name, "size"), wanted.size_m, found.size_m);
        let friction = wanted.friction.map(|friction| [friction; 3]);
        compare(
            &mut faults,
            (name, "friction"),
            friction,
            [found.friction; 3],
        );
        let moving: Vec<&str> = found.moving.iter().map(|part| &*part.name).collect();
        if wanted.fixed.is_some_and(|fixed| fixed != found.fixed)
            || wanted.moving.as_ref().is_some_and(|names| *names != moving)
        {
            faults.push(format!("{name}: fixed {}, moving {moving:?}", found.fixed));
        }
    }
    for (name, wanted) in &expected.furniture {
        let worlds = env.campaign.worlds.values();
        let piece = worlds
            .flat_map(|world| &world.furniture)
            .find(|piece| piece.name == *name)
            .unwrap_or_else(|| panic!("there is no furniture {name}"));
        let at = [piece.pose.position[0], piece.pose.position[1], 0.0];
        let [x, y] = wanted.at_m;
        compare(&mut faults, (name, "place"), Some([x, y, 0.0]), at);
    }
    faults.extend(wrong_robot(&expected.robot, &env));
    faults
}

fn wrong_robot(wanted: &Robot, env: &Env) -> Vec<String> {
    let robot = &env.robot.profile;
    let mut faults = Vec::new();
    for (wanted, found) in [
        (&wanted.arm, &robot.arm_joints),
        (&wanted.fingers, &robot.hand.finger_joints),
    ] {
        if wanted.as_ref().is_some_and(|wanted| wanted != found) {
            faults.push(format!("the robot has {found:?}"));
        }
    }
    let of = "the robot";
    let force = wanted.grip_force_n.map(|force| [force; 3]);
    compare(
        &mut faults,
        (of, "grip force"),
        force,
        [robot.hand.grip_force_n; 3],
    );
    let measured = env.robot.measures();
    let mass = wanted.mass_kg.map(|kg| [kg; 3]);
    compare(&mut faults, (of, "mass"), mass, [measured.mass_kg; 3]);
    for (name, effort) in &wanted.effort {
        let joint = robot.core.tree.joint(name);
        let joint = joint.unwrap_or_else(|| panic!("there is no joint {name}"));
        compare(
            &mut faults,
            (of, name),
            Some([*effort; 3]),
            [joint.effort; 3],
        );
    }
    faults
}

/// Reports a value of a thing that differs by more than 1e-4.
fn compare(
    faults: &mut Vec<String>,
    (of, value): (&str, &str),
    wanted: Option<[f64; 3]>,
    found: [f64; 3],
) {
    let Some(wanted) = wanted else { return };
    if wanted.iter().zip(found).any(|(a, b)| (a - b).abs() > 1e-4) {
        faults.push(format!("{value} of {of} is {found:?}, not {wanted:?}"));
    }
}

/// Runs the campaign, if a number of passed runs is expected.
fn wrong_runs(expected: &Expected, folder: &Path) -> Option<String> {
    let wanted = expected.passed?;
    let output = actcheck(
        folder,
        &["run", "c.toml", "--history", "h", "--format", "json"],
    );
    let json: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    let passed = json["runs_passed"]["count"].as_u64();
    (passed != Some(wanted)).then(|| format!("{passed:?} runs pass, not {wanted}"))
}
