//! Episodes that MuJoCo itself computes: human demonstrations of robosuite, and a recording of a
//! simulation that runs here.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::support::{actcheck, foreign, root, stderr, stdout};

/// The folder of robosuite in an environment.
fn robosuite(python: &Path) -> PathBuf {
    let code = "import importlib.util; print(importlib.util.find_spec('robosuite').submodule_search_locations[0])";
    let output = Command::new(python).args(["-c", code]).output().unwrap();
    PathBuf::from(stdout(&output).trim())
}

fn client(python: &Path, arguments: &[&str]) -> std::process::Output {
    let mut command = Command::new(python);
    command
        .args(arguments)
        .current_dir(root().join("clients/python"))
        .env("PYTHONPATH", "src")
        .env("PYTHONDONTWRITEBYTECODE", "1");
    command.output().unwrap()
}

/// The failed properties of each imported episode, by its key.
fn failed(folder: &Path) -> BTreeMap<String, Vec<String>> {
    let runs = actcheck(folder, &["list", "--history", "h", "--format", "json"]);
    let runs: Value = serde_json::from_str(&stdout(&runs)).unwrap();
    let mut found = BTreeMap::new();
    for run in runs.as_array().unwrap() {
        let run = run["run"].as_str().unwrap();
        let query = format!(
            "SELECT ?file ?property ?outcome WHERE {{ run:{run} act:episodeFile ?file . \
             ?step act:ofRun run:{run} . ?a earl:subject ?step ; earl:test ?property ; earl:result/act:outcome ?outcome }}"
        );
        let rows = actcheck(
            folder,
            &["query", &query, "--history", "h", "--format", "json"],
        );
        let rows: Value = serde_json::from_str(&stdout(&rows)).unwrap();
        let rows = rows.as_array().unwrap();
        let file = rows[0]["file"].as_str().unwrap().to_owned();
        let failed = rows.iter().filter(|row| row["outcome"] == "failed");
        let failed = failed.map(|row| {
            let property = row["property"].as_str().unwrap();
            property.rsplit('#').next().unwrap().to_owned()
        });
        let mut failed: Vec<String> = failed.collect();
        failed.sort();
        found.insert(file, failed);
    }
    found
}

/// Three human demonstrations pass; the same with the cube teleported, dropped at the end, or with
/// an idle robot fail for their own reasons.
#[test]
fn human_demonstrations_pass_and_faulty_ones_fail() {
    let Some(python) = foreign::mujoco() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let good = robosuite(python).join("models/assets/demonstrations/lift/demo.hdf5");
    let (good, faulty) = (
        good.display().to_string(),
        folder.path().join("faulty.hdf5").display().to_string(),
    );
    let made = client(python, &["-m", "tests.lift_faults", &good, "--to", &faulty]);
    assert!(made.status.success(), "{}", stderr(&made));
    let program = python.display().to_string();
    let imported = actcheck(
        folder.path(),
        &[
            "import",
            &good,
            &faulty,
            "--python",
            &program,
            "--history",
            "h",
        ],
    );
    assert_eq!(imported.status.code(), Some(1), "{}", stderr(&imported));
    let failed = failed(folder.path());
    assert_eq!(failed.len(), 12, "{failed:?}");
    for (file, failed) in failed {
        let expected: &[&str] = if file.contains("teleport") {
            &["CloseObject", "ObjectInGripper"]
        } else if file.contains("drop") {
            &["MovedObject", "ObjectInGripper"]
        } else if file.contains("idle") {
            &["CloseObject", "MovedObject", "ObjectInGripper"]
        } else {
            &[]
        };
        assert_eq!(failed, expected, "{file}");
    }
}

/// A box that falls on a table, recorded from MuJoCo: it touches and rests on the table with its
/// weight.
#[test]
fn a_recording_of_mujoco_has_its_contacts() {
    let Some(python) = foreign::mujoco() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fall.mcap");
    let code = format!(
        "import mujoco, actcheck\n\
         model = mujoco.MjModel.from_xml_string('<mujoco><worldbody><geom type=\"plane\" size=\"1 1 .1\"/>\
         <body name=\"box\" pos=\"0 0 .1\"><freejoint/><geom type=\"box\" size=\".05 .05 .05\" mass=\"0.5\"/></body></worldbody></mujoco>')\n\
         data = mujoco.MjData(model)\n\
         with actcheck.record(model, data, {path:?}) as recorder:\n\
         \x20   recorder.step()\n\
         \x20   recorder.mark('Pick', 'begin', pickObject='box')\n\
         \x20   for _ in range(500):\n\
         \x20       mujoco.mj_step(model, data)\n\
         \x20       recorder.step()\n\
         \x20   recorder.mark('Pick', 'end')\n"
    );
    let recorded = client(python, &["-c", &code]);
    assert!(recorded.status.success(), "{}", stderr(&recorded));
    let files: Vec<PathBuf> = fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    let (episode, _) = actcheck::episodes::Episode::read(&files[0]).unwrap();
    assert!(episode.states.len() > 400, "{}", episode.states.len());
    let mapping = actcheck::base::Source::new("mapping.toml", "[objects.box]\nbody = \"box\"\n");
    let mapping = actcheck::episodes::Mapping::parse(&mapping).unwrap();
    let cast = mapping.cast(&episode).unwrap();
    let trace = actcheck::episodes::trace(&episode, &cast, &[]);
    let last = &trace.snapshots.last().unwrap().bodies[0];
    assert_eq!(
        (last.id.as_str(), &last.rests_on[..]),
        ("box", &["floor".to_owned()][..])
    );
    let contact = &trace.actions[0].contacts[0];
    assert_eq!(contact.pair, ["box", "floor"]);
    // At rest, the floor carries its weight: 0.5 kg · 9.81 m/s².
    let force: f64 = episode
        .states
        .last()
        .unwrap()
        .contacts
        .iter()
        .map(|contact| contact.normal_n)
        .sum();
    assert!((force - 4.905).abs() < 0.05, "{force} N");
}
