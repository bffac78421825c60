//! Runs as models for MuJoCo, and the same runs in both engines.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use actcheck::history::History;
use serde_json::Value;

use crate::support::{actcheck, foreign, root, stderr, stdout};

/// Largest difference of poses in both engines at the first frame. Units: metres; for quaternions,
/// of their components.
const NEAR: f64 = 1e-6;

/// Prints the pose of each body of a model as it is loaded.
const LOADED: &str = "
import json, sys, mujoco
model = mujoco.MjModel.from_xml_path(sys.argv[1])
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
poses = {model.body(i).name: [*data.xpos[i], *data.xquat[i][[1, 2, 3, 0]]] for i in range(1, model.nbody)}
print(json.dumps({'poses': poses, 'masses': {model.body(i).name: model.body_mass[i] for i in range(1, model.nbody)}}))
";

/// Makes runs of a shipped configuration and returns the id of the campaign.
fn campaign(folder: &Path, config: &str, runs: &str) -> String {
    let config = root().join("configs").join(config);
    let made = actcheck(
        folder,
        &[
            "run",
            config.to_str().unwrap(),
            "--runs",
            runs,
            "--seed",
            "5",
            "-q",
            "--history",
            "h",
        ],
    );
    assert!(
        matches!(made.status.code(), Some(0 | 1)),
        "{}",
        stderr(&made)
    );
    let history = History::open_to_read(&folder.join("h")).unwrap();
    history.campaigns().unwrap()[0].id.clone()
}

#[test]
fn a_run_is_written_as_a_model_with_its_setpoints() {
    let folder = tempfile::tempdir().unwrap();
    let id = campaign(folder.path(), "pick.toml", "1");
    let run = format!("{id}-1");
    let written = actcheck(
        folder.path(),
        &[
            "export",
            &run,
            "--mjcf",
            "d",
            "--setpoints",
            "--history",
            "h",
        ],
    );
    assert!(written.status.success(), "{}", stderr(&written));
    let history = History::open_to_read(&folder.path().join("h")).unwrap();
    let trace = history.traces().whole(&run).unwrap();
    let text = std::fs::read_to_string(folder.path().join("d/scene.xml")).unwrap();
    let model = roxmltree::Document::parse(&text).unwrap();
    let bodies: BTreeMap<&str, roxmltree::Node<'_, '_>> = model
        .descendants()
        .filter(|node| node.has_tag_name("body"))
        .map(|node| (node.attribute("name").unwrap(), node))
        .collect();
    for body in &trace.snapshots[0].bodies {
        let numbers = |name: &str| -> Vec<f64> {
            let text = bodies[body.id.as_str()].attribute(name).unwrap();
            text.split(' ')
                .map(|number| number.parse().unwrap())
                .collect()
        };
        assert_eq!(numbers("pos"), body.pose.position, "{}", body.id);
        let [x, y, z, w] = body.pose.rotation;
        assert_eq!(numbers("quat"), [w, x, y, z], "{}", body.id);
        let inertial = bodies[body.id.as_str()]
            .children()
            .find(|child| child.has_tag_name("inertial"));
        let mass = inertial.map(|node| node.attribute("mass").unwrap().parse::<f64>().unwrap());
        assert_eq!(mass, (!body.fixed).then_some(body.mass_kg), "{}", body.id);
    }
    // As many rows as control ticks, 60 per second; the first joints are the base's, in the world.
    let table = std::fs::read_to_string(folder.path().join("d/setpoints.csv")).unwrap();
    let rows: Vec<Vec<f64>> = table
        .lines()
        .skip(1)
        .map(|line| {
            line.split(',')
                .map(|cell| cell.parse().unwrap_or(f64::NAN))
                .collect()
        })
        .collect();
    let secs: f64 = trace
        .actions
        .iter()
        .map(|action| action.duration_secs)
        .sum();
    assert_eq!(rows.len() as f64, (secs * 60.0).round());
    assert!((rows[59][0] - 1.0).abs() < 1e-12, "{}", rows[59][0]);
    let joints = &trace.snapshots[0].robot.joints;
    assert_eq!(rows[0].len(), 1 + 4 * joints.len());
    let end = &trace.snapshots[1].robot.base_true;
    let last = &rows[rows.len() - 1];
    assert!(
        (last[1] - end[0]).abs() < 2e-3 && (last[5] - end[1]).abs() < 2e-3,
        "the base reached its last setpoint: {end:?}"
    );
    // The folder is not overwritten.
    let again = actcheck(
        folder.path(),
        &["export", "run", &run, "--mjcf", "d", "--history", "h"],
    );
    assert_eq!(again.status.code(), Some(2));
    assert!(stderr(&again).contains("X042"), "{}", stderr(&again));
}

#[test]
fn a_cup_has_no_model_for_mujoco() {
    let folder = tempfile::tempdir().unwrap();
    let id = campaign(folder.path(), "suction_arm.toml", "1");
    let refused = actcheck(
        folder.path(),
        &[
            "export",
            &format!("{id}-1"),
            "--mjcf",
            "d",
            "--history",
            "h",
        ],
    );
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("S053"), "{}", stderr(&refused));
    assert!(!folder.path().join("d").exists());
}

/// MuJoCo loads the models as they are: in the state of the first frame.
#[test]
fn mujoco_loads_the_first_frame() {
    let Some(python) = foreign::mujoco() else {
        return;
    };
    for config in ["pick_and_place.toml", "fixed_arm.toml", "clutter.toml"] {
        let folder = tempfile::tempdir().unwrap();
        let id = campaign(folder.path(), config, "2");
        let history = History::open_to_read(&folder.path().join("h")).unwrap();
        for number in 1..=2 {
            let run = format!("{id}-{number}");
            let model = format!("d{number}");
            let written = actcheck(
                folder.path(),
                &["export", &run, "--mjcf", &model, "--history", "h"],
            );
            assert!(written.status.success(), "{}", stderr(&written));
            let loaded = Command::new(python)
                .args(["-c", LOADED])
                .arg(folder.path().join(&model).join("scene.xml"))
                .output()
                .unwrap();
            assert!(loaded.status.success(), "{config}: {}", stderr(&loaded));
            let loaded: Value = serde_json::from_str(&stdout(&loaded)).unwrap();
            let trace = history.traces().whole(&run).unwrap();
            let first = &trace.snapshots[0];
            let links = first.robot.links.iter();
            let links = links.map(|link| (format!("robot/{}", link.name), link.pose));
            let bodies = first.bodies.iter().map(|body| (body.id.clone(), body.pose));
            for (name, pose) in links.chain(bodies) {
                let found: Vec<f64> = loaded["poses"][&name]
                    .as_array()
                    .unwrap_or_else(|| panic!("{config}: {name} is missing"))
                    .iter()
                    .map(|number| number.as_f64().unwrap())
                    .collect();
                let turned: f64 = (0..4).map(|idx| found[3 + idx] * pose.rotation[idx]).sum();
                let shift = (0..3).map(|axis| (found[axis] - pose.position[axis]).abs());
                assert!(
                    shift.fold(0.0, f64::max) < NEAR && (turned.abs() - 1.0).abs() < NEAR,
                    "{config}: {name} is at {found:?} instead of {pose:?}"
                );
            }
        }
    }
}

/// The same picks in both engines: most agree, and the courses are runs of their own.
#[test]
fn runs_are_judged_in_both_engines() {
    let Some(python) = foreign::mujoco() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let id = campaign(folder.path(), "pick.toml", "4");
    let python = python.to_str().unwrap();
    let checked = actcheck(
        folder.path(),
        &[
            "cross-check",
            &id,
            "--python",
            python,
            "--history",
            "h",
            "--format",
            "json",
        ],
    );
    assert!(
        matches!(checked.status.code(), Some(0 | 1)),
        "{}",
        stderr(&checked)
    );
    let found: Value = serde_json::from_str(&stdout(&checked)).unwrap();
    assert_eq!(found["all_properties"]["of"], 4, "{found:#}");
    assert!(
        found["all_properties"]["agree"].as_u64().unwrap() >= 3,
        "{found:#}"
    );
    assert_eq!(
        found["properties"].as_array().unwrap().len(),
        5,
        "all are decided"
    );
    assert_eq!(found["settings"].as_array().unwrap().len(), 5);
    let history = History::open_to_read(&folder.path().join("h")).unwrap();
    let check = history.cross_check(&id).unwrap().unwrap();
    assert_eq!(check.runs.len(), 4);
    let imported = history
        .campaign(check.imported.as_deref().unwrap())
        .unwrap();
    assert!(imported.imported_from.unwrap().starts_with("MuJoCo "));
    // Imported runs can't be played again.
    let again = actcheck(
        folder.path(),
        &[
            "cross-check",
            &imported.id,
            "--python",
            python,
            "--history",
            "h",
        ],
    );
    assert_eq!(again.status.code(), Some(2));
    assert!(stderr(&again).contains("S054"), "{}", stderr(&again));
}

/// A skill runs in MuJoCo anew and gets its observations, at one worker and at two alike.
#[test]
fn a_skill_runs_in_mujoco_in_a_closed_loop() {
    let Some(python) = foreign::mujoco() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let id = campaign(folder.path(), "pick.toml", "3");
    let python = python.to_str().unwrap();
    let check = |jobs: &str| {
        let arguments = [
            "cross-check",
            &id,
            "--closed-loop",
            "--python",
            python,
            "--history",
            "h",
            "--jobs",
            jobs,
            "--format",
            "json",
        ];
        let checked = actcheck(folder.path(), &arguments);
        let found: Value = serde_json::from_str(&stdout(&checked))
            .unwrap_or_else(|_| panic!("{}", stderr(&checked)));
        found
    };
    let [one, two] = ["1", "2"].map(check);
    assert_eq!(one["runs"], two["runs"]);
    assert_eq!(one["all_properties"]["of"], 3, "{one:#}");
    assert!(
        one["all_properties"]["agree"].as_u64().unwrap() >= 2,
        "{one:#}"
    );
    assert_eq!(one["settings"].as_array().unwrap().len(), 1, "{one:#}");
    assert_eq!(one["closed_loop"], true);
}

/// A whole task in MuJoCo: preconditions are decided by its contacts.
#[test]
fn a_whole_task_runs_in_mujoco_in_a_closed_loop() {
    let Some(python) = foreign::mujoco() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let id = campaign(folder.path(), "pick_and_place.toml", "1");
    let arguments = [
        "cross-check",
        &id,
        "--closed-loop",
        "--python",
        python.to_str().unwrap(),
        "--history",
        "h",
        "--format",
        "json",
    ];
    let checked = actcheck(folder.path(), &arguments);
    let found: Value =
        serde_json::from_str(&stdout(&checked)).unwrap_or_else(|_| panic!("{}", stderr(&checked)));
    assert_eq!(found["all_properties"]["of"], 1, "{found:#}");
}

/// Without MuJoCo the command says so, and nothing is stored.
#[test]
fn a_python_without_mujoco_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let id = campaign(folder.path(), "pick.toml", "1");
    let refused = actcheck(
        folder.path(),
        &[
            "cross-check",
            &id,
            "--python",
            "no-such-python",
            "--history",
            "h",
        ],
    );
    assert_eq!(refused.status.code(), Some(2));
    assert!(
        stderr(&refused).contains("no-such-python"),
        "{}",
        stderr(&refused)
    );
    let arguments = [
        "cross-check",
        &id,
        "--closed-loop",
        "--python",
        "no-such-python",
        "--history",
        "h",
    ];
    let refused = actcheck(folder.path(), &arguments);
    assert_eq!(refused.status.code(), Some(2));
    let said = stderr(&refused);
    assert!(
        said.contains("no-such-python") && said.contains("pip install"),
        "{said}"
    );
    let history = History::open_to_read(&folder.path().join("h")).unwrap();
    assert_eq!(history.campaigns().unwrap().len(), 1);
    assert_eq!(history.cross_check(&id).unwrap(), None);
}
