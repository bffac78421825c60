//! Skills that are ROS 2 action servers, kept in step with the simulation. Without a ROS 2 from PyPI
//! these tests are left out.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use serde::Deserialize;
use serde_json::Value;

use crate::support::checkout::{Checkout, blocks};
use crate::support::{actcheck, edit, foreign, project, root, stderr, stdout};

/// A campaign of picks in `configs/ros.toml` whose skill is the mapping file `mapping`.
fn with_nodes(mapping: &Path) -> Option<tempfile::TempDir> {
    let python = foreign::ros2()?;
    let folder = project();
    let config = folder.path().join("configs/ros.toml");
    std::fs::copy(folder.path().join("configs/pick.toml"), &config).unwrap();
    let launcher = format!(
        "{} -m actcheck.ros2 {}",
        python.display(),
        mapping.display()
    );
    edit(
        &config,
        "test_launcher = \"reference\"",
        &format!("test_launcher = {launcher:?}"),
    );
    let mut text = std::fs::read_to_string(&config).unwrap();
    text.push_str("\n[skill]\nstartup_s = 120\ntimeout_s = 120\nmax_broken = 1000\n");
    std::fs::write(&config, text).unwrap();
    Some(folder)
}

/// Runs `configs/ros.toml`. Returns the runs of the history, in order.
fn campaign(folder: &Path, arguments: &[&str], history: &str) -> Vec<Value> {
    let run = ["run", "configs/ros.toml", "--history", history];
    let output = actcheck(folder, &[&run, arguments].concat());
    assert!(
        matches!(output.status.code(), Some(0 | 1)),
        "{}",
        stderr(&output)
    );
    let list = ["list", "--history", history, "--format", "json"];
    let output = actcheck(folder, &list);
    assert!(output.status.success(), "{}", stderr(&output));
    let listed: Value = serde_json::from_str(&stdout(&output)).unwrap();
    let mut runs = listed
        .as_array()
        .unwrap_or_else(|| panic!("{listed}"))
        .clone();
    runs.sort_by_key(|run| run["index"].as_u64());
    runs
}

/// How a run must end whose node has a fault.
#[derive(Deserialize)]
struct Fault {
    name: String,
    status: String,
    words: String,
}

#[derive(Deserialize)]
struct Faults {
    fault: Vec<Fault>,
}

/// Files in shared memory that belong to the middleware.
fn shared_memory() -> BTreeSet<String> {
    let Ok(entries) = std::fs::read_dir("/dev/shm") else {
        return BTreeSet::new();
    };
    entries
        .filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned()))
        .filter(|name| name.contains("fast"))
        .collect()
}

/// Command lines of nodes with faults that still run.
fn nodes_left() -> Vec<String> {
    let processes = std::fs::read_dir("/proc").unwrap().flatten();
    processes
        .filter_map(|entry| std::fs::read_to_string(entry.path().join("cmdline")).ok())
        .filter(|command| command.contains("tests/ros2/faulty.py"))
        .collect()
}

#[test]
fn nodes_with_faults_break_their_runs_only() {
    let Some(folder) = with_nodes(&root().join("tests/ros2/faulty.toml")) else {
        return;
    };
    let text = std::fs::read_to_string(root().join("tests/ros2/faults.toml")).unwrap();
    let faults: Faults = toml::from_str(&text).unwrap();
    let config = folder.path().join("configs/ros.toml");
    edit(&config, "action_secs = 60", "action_secs = 3");
    let before = shared_memory();
    let count = faults.fault.len().to_string();
    let runs = campaign(folder.path(), &["--runs", &count, "--jobs", "2"], "faults");
    assert_eq!(runs.len(), faults.fault.len());
    for (run, fault) in runs.iter().zip(&faults.fault) {
        let id = run["run"].as_str().unwrap_or_else(|| panic!("{run}"));
        let shown = actcheck(
            folder.path(),
            &["show", id, "--history", "faults", "--format", "json"],
        );
        let shown = stdout(&shown);
        assert_eq!(run["status"], *fault.status, "{}: {shown}", fault.name);
        assert!(shown.contains(&fault.words), "{}: {shown}", fault.name);
    }
    assert_eq!(shared_memory(), before, "the middleware left files behind");
    assert_eq!(nodes_left(), Vec::<String>::new());
}

#[test]
fn an_action_server_picks_and_its_runs_repeat() {
    let mapping = root().join("clients/python/examples/ros2/pick.toml");
    let Some(folder) = with_nodes(&mapping) else {
        return;
    };
    let hashes = |runs: Vec<Value>| -> Vec<(String, Value)> {
        let of = |run: &Value| {
            assert_eq!(run["status"], "completed", "{run}");
            (run["trace_hash"].to_string(), run["score"].clone())
        };
        runs.iter().map(of).collect()
    };
    let one = hashes(campaign(
        folder.path(),
        &["--runs", "2", "--jobs", "1"],
        "one",
    ));
    let two = hashes(campaign(
        folder.path(),
        &["--runs", "2", "--jobs", "2"],
        "two",
    ));
    assert_eq!(one, two);
    assert!(
        one.iter().any(|(_, score)| score.as_f64() >= Some(0.8)),
        "{one:?}"
    );
}

/// Three processes with both kinds of executors: timers, services, nested actions, waiting threads.
#[test]
fn chains_of_nodes_give_one_trace() {
    let Some(python) = foreign::ros2() else {
        return;
    };
    let bench = root().join("benches/ros2");
    let mut command = Command::new(python);
    command.current_dir(&bench).args(["lockstep.py", "4"]);
    for (role, executor, style) in [
        ("tools", "single", "async"),
        ("motion", "multi", "async"),
        ("executive", "multi", "blocking"),
    ] {
        command.args(["--", "python3", "chain.py", role, executor, style, "0.0005"]);
    }
    let output = command.output().unwrap();
    let said = stdout(&output);
    assert!(
        said.contains("4 repetitions, 1 different traces"),
        "{said}{}",
        stderr(&output)
    );
    assert!(
        said.contains("1 different results, 0 goals did not end"),
        "{said}"
    );
}

/// The commands of README, with the environment of these tests in place of a new one.
#[test]
fn readmes_commands_test_an_action_server() {
    let Some(python) = foreign::ros2() else {
        return;
    };
    let checkout = Checkout::fresh();
    let made = python.parent().and_then(Path::parent).unwrap();
    std::os::unix::fs::symlink(made, checkout.path().join("ros2")).unwrap();
    let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
    let blocks = blocks(&readme, "bash");
    assert_eq!(blocks.len(), 1);
    // Other tests use this environment, too, and need it longer than the checkout lives.
    let script = root().join("clients/python/src/actcheck/ros2/environment.py");
    let commands = blocks[0].replace(
        "clients/python/src/actcheck/ros2/environment.py",
        script.to_str().unwrap(),
    );
    assert_ne!(commands, blocks[0]);
    checkout.run(&commands, &[]);
}

#[test]
fn a_mapping_with_faults_is_refused_with_their_lines() {
    let folder = project();
    let file = folder.path().join("skill.toml");
    std::fs::write(
        &file,
        "test_launcher = 3\n[actions.Pick]\nserver = \"/pick\"\n",
    )
    .unwrap();
    let Some(python) = foreign::ros2() else {
        return;
    };
    let output = Command::new(python)
        .args(["-m", "actcheck.ros2"])
        .arg(&file)
        .output()
        .unwrap();
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    for words in [
        "skill.toml:1: `test_launcher`",
        "skill.toml:2: `actions.Pick.type`",
    ] {
        assert!(said.contains(words), "{said}");
    }
}
