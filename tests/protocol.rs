//! Actions performed by a user's program: the messages, the records, and every possible fault of
//! the program.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::support::{actcheck, edit, processes_in, root, script, signal, started, stderr, stdout};

/// A glass alone on a table.
const SCENE: &str = "
seed = 7
[objectSurface]
object_surfaces = [\"coffee_table\"]
[pickObject]
model_list = [\"glass\"]
";

/// A folder with a configuration `c.toml` whose program is one of `tests/protocol/`.
pub fn project(program: &str, tests: &str, runs: u32, skill: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for file in ["wire.py", program] {
        std::fs::copy(
            root().join("tests/protocol").join(file),
            folder.path().join(file),
        )
        .unwrap();
    }
    let mut text =
        format!("tests = {tests}\ntest_count = {runs}\ntest_launcher = \"{program}\"\n{SCENE}");
    write!(text, "[skill]\n{skill}\n").unwrap();
    std::fs::write(folder.path().join("c.toml"), text).unwrap();
    folder
}

pub fn run(folder: &Path, arguments: &[&str]) -> (i32, Value, String) {
    let mut all = vec!["run", "c.toml", "--format", "json"];
    all.extend(arguments);
    let output = actcheck(folder, &all);
    let (text, complaints) = (stdout(&output), unwrapped(&stderr(&output)));
    let json =
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text}\n{complaints}"));
    (output.status.code().unwrap(), json, complaints)
}

/// Joins wrapped output into one line.
fn unwrapped(text: &str) -> String {
    text.split_whitespace()
        .filter(|word| *word != "│")
        .collect::<Vec<_>>()
        .join(" ")
}

fn runs(json: &Value) -> &[Value] {
    json["runs"].as_array().unwrap()
}

fn of<'a>(run: &'a Value, key: &str) -> &'a str {
    run[key].as_str().unwrap_or_default()
}

/// The system's words ("exec format error", "no such file" about a file that exists) name no way out.
#[test]
fn a_program_that_the_system_does_not_start_is_refused_with_its_cause() {
    for (text, cause) in [
        ("print('hello')\n", "its first line names no interpreter"),
        (
            "#!/usr/bin/no-such-python\n",
            "the interpreter or loader that it names does not exist",
        ),
    ] {
        let folder = project("well_behaved.py", "[[\"Pick\"]]", 1, "");
        script(&folder.path().join("skill"), text);
        let config = folder.path().join("c.toml");
        edit(&config, "\"well_behaved.py\"", "\"./skill\"");
        let (_, json, complaints) = run(folder.path(), &[]);
        let reason = of(&runs(&json)[0], "reason");
        assert!(reason.contains(cause), "{reason}\n{complaints}");
    }
}

/// The output of `show` for a run.
fn shown(folder: &Path, run: &str) -> Value {
    let output = actcheck(
        folder,
        &["show", run, "--history", ".actcheck", "--format", "json"],
    );
    serde_json::from_str(&stdout(&output))
        .unwrap_or_else(|error| panic!("{error}: {}", stderr(&output)))
}

/// Checks that no process of a program with this working folder is left.
fn nothing_is_left(folder: &Path) {
    let here = std::fs::canonicalize(folder).unwrap();
    let alive = || -> Vec<String> {
        let processes = std::fs::read_dir("/proc").unwrap().flatten();
        let held = processes.filter(|entry| {
            std::fs::read_link(entry.path().join("cwd")).is_ok_and(|cwd| cwd == here)
        });
        held.map(|entry| std::fs::read_to_string(entry.path().join("cmdline")).unwrap_or_default())
            .collect()
    };
    let patience = Instant::now() + Duration::from_secs(10);
    while !alive().is_empty() && Instant::now() < patience {
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(alive(), [""; 0], "these are left");
}

/// Trace hash of each run, by index, with the message that its action reported.
fn courses(folder: &Path, json: &Value) -> Vec<(String, String)> {
    let shown = runs(json).iter().map(|run| shown(folder, of(run, "run")));
    shown
        .map(|run| {
            (
                of(&run, "trace_hash").to_owned(),
                of(&run["actions"][0], "message").to_owned(),
            )
        })
        .collect()
}

/// Output, commands and questions of every run are kept, bounded, and at simulated times: the same
/// with any number of workers.
#[test]
fn the_side_of_a_program_is_kept_with_any_number_of_workers() {
    let folder = project("talks.py", "[[\"Pick\"]]", 4, "");
    let sides = |jobs: &str| -> Vec<Value> {
        let (_, json, complaints) = run(folder.path(), &["--jobs", jobs]);
        assert_eq!(json["counts"]["broken"].as_u64(), Some(0), "{complaints}");
        let shown = runs(&json)
            .iter()
            .map(|run| shown(folder.path(), of(run, "run")));
        shown.map(|mut run| run["skill"].take()).collect()
    };
    let alone = sides("1");
    assert_eq!(alone, sides("2"));
    for side in &alone {
        let entries = side["entries"].as_array().unwrap();
        let printed: Vec<&str> = entries
            .iter()
            .filter_map(|entry| entry["printed"].as_str())
            .collect();
        assert!(
            !printed.iter().any(|line| line.contains("process")),
            "{side}"
        );
        assert!(printed[0].starts_with("sees glass_1"), "{side}");
        assert_eq!(printed[1], "half way");
        let left_out = side["lines_left_out"].as_u64().unwrap();
        assert!(printed.len() <= 200 && (left_out == 0 || printed.len() == 200));
        assert_eq!(entries[0]["asked"], "objects");
        let stretches: Vec<(u64, f64)> = entries
            .iter()
            .filter_map(|entry| {
                let secs = entry["until"].as_f64()? - entry["secs"].as_f64()?;
                Some((entry["commands"].as_u64()?, (secs * 10.0).round() / 10.0))
            })
            .collect();
        assert_eq!(stretches, [(30, 0.5), (1, 0.5)]);
    }
    let text = stdout(&actcheck(
        folder.path(),
        &["show", "@last", "--history", ".actcheck"],
    ));
    for words in [
        "the program's side",
        "│ half way",
        "30 commands, at last arm_flex_joint -0.29",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let (_, _, streamed) = run(folder.path(), &["--jobs", "2", "-v", "--runs", "2"]);
    assert_eq!(streamed.matches("half way").count(), 2, "{streamed}");
    assert!(
        streamed.contains("starts"),
        "the start is streamed, too: {streamed}"
    );
}

/// Ranges of light, for colour images.
const LIGHT: &str = "
[camera]
width = 96
height = 72
image_noise = 0.01
light_azimuth_rad = [0.0, 6.2]
light_elevation_rad = [0.5, 1.4]
light_brightness = [0.2, 0.9]
ambient = [0.2, 0.5]
table_textures = [\"plain\", \"checker\", \"wood\"]
table_colours = [\"#b0865c\", \"#6c7a89\"]
random_object_colours = true
";

/// A program's images of each scene, and the scene's objects and robot.
fn images_of(folder: &Path, light: &str, jobs: &str) -> Vec<(String, [String; 2])> {
    let config = folder.join("c.toml");
    let text = std::fs::read_to_string(&config).unwrap();
    let plain = text.split("\n[camera]").next().unwrap().to_owned();
    std::fs::write(&config, plain + light).unwrap();
    let history = format!("h{jobs}{}", light.len());
    let (_, json, _) = run(folder, &["--jobs", jobs, "--history", &history]);
    let image = |run: &Value| {
        let id = of(run, "run");
        let shown = actcheck(
            folder,
            &["show", id, "--history", &history, "--format", "json"],
        );
        let shown: Value = serde_json::from_str(&stdout(&shown)).unwrap();
        let scene = [&shown["objects"], &shown["robot_base"]];
        let message = shown["actions"][0]["message"].as_str().unwrap();
        (message.to_owned(), scene.map(ToString::to_string))
    };
    runs(&json).iter().map(image).collect()
}

/// Images depend on the run only. Each scene has its own light, and is the same with and without
/// ranges of light.
#[test]
fn colour_images_have_the_same_bits_with_any_number_of_workers() {
    let folder = project("sees.py", "[[\"Pick\"]]", 4, "");
    let folder = folder.path();
    let lit = images_of(folder, LIGHT, "1");
    assert_eq!(lit, images_of(folder, LIGHT, "2"));
    let plain = images_of(folder, "\n[camera]\nwidth = 96\nheight = 72\n", "2");
    for (idx, (with, without)) in lit.iter().zip(&plain).enumerate() {
        assert_ne!(with.0, without.0, "run {idx}");
        assert_eq!(with.1, without.1, "run {idx}");
        assert!(lit.iter().filter(|(image, _)| *image == with.0).count() == 1);
    }
}

#[test]
fn a_program_gives_the_same_results_with_any_number_of_workers() {
    let folder = project(
        "well_behaved.py",
        "[[\"Pick\"]]",
        5,
        "env = { WIRE_LOG = \"log\" }",
    );
    let (code, one, complaints) = run(folder.path(), &["--jobs", "1"]);
    assert_eq!(
        (code, one["counts"]["broken"].as_u64(), runs(&one).len()),
        (1, Some(0), 5),
        "{complaints}\n{one:#}"
    );
    let alone = courses(folder.path(), &one);
    assert!(
        alone
            .iter()
            .all(|(hash, message)| !hash.is_empty() && message == "only waved"),
        "{alone:?}"
    );
    let (_, two, _) = run(folder.path(), &["--jobs", "2"]);
    assert_eq!(alone, courses(folder.path(), &two));
    nothing_is_left(folder.path());
    described(folder.path());
    let replayed = actcheck(
        folder.path(),
        &[
            "replay",
            of(&runs(&one)[3], "run"),
            "--history",
            ".actcheck",
        ],
    );
    assert!(
        replayed.status.success(),
        "{}\n{}",
        stdout(&replayed),
        stderr(&replayed)
    );
    std::fs::OpenOptions::new()
        .append(true)
        .open(folder.path().join("well_behaved.py"))
        .and_then(|mut file| std::io::Write::write_all(&mut file, b"# Other words.\n"))
        .unwrap();
    let replayed = actcheck(
        folder.path(),
        &[
            "replay",
            of(&runs(&one)[3], "run"),
            "--history",
            ".actcheck",
        ],
    );
    assert!(
        stdout(&replayed).contains("skill"),
        "{}\n{}",
        stdout(&replayed),
        stderr(&replayed)
    );
}

/// Every message in either direction conforms to `clients/protocol.schema.json`.
fn described(folder: &Path) {
    let logs = std::fs::read_dir(folder)
        .unwrap()
        .flatten()
        .map(|entry| entry.path());
    let logs: Vec<_> = logs
        .filter(|path| path.to_string_lossy().contains("log."))
        .collect();
    assert!(!logs.is_empty());
    let output = Command::new("python3")
        .arg(root().join("tests/protocol/validate.py"))
        .arg(root().join("clients/protocol.schema.json"))
        .args(logs)
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}{}",
        stdout(&output),
        stderr(&output)
    );
}

/// The reference skill picks up the program's percept; without it, the skill would draw its own
/// errors.
#[test]
fn reference_skills_perform_other_actions_with_the_programs_percepts() {
    let folder = project(
        "mixed.py",
        "[[\"PerceivePlane\", \"Pick\"]]",
        2,
        "privileged = true",
    );
    let (_, json, complaints) = run(folder.path(), &[]);
    for one in runs(&json) {
        let run = shown(folder.path(), of(one, "run"));
        let message = |step: usize| of(&run["actions"][step], "message").to_owned();
        assert_eq!(
            (of(&run, "status"), message(0).as_str()),
            ("completed", "perceived 1"),
            "{complaints}\n{run:#}"
        );
        assert!(message(1).starts_with("holds glass_1"), "{run:#}");
    }
    nothing_is_left(folder.path());
}

#[test]
fn ground_truth_is_sent_only_on_request_and_reports_mention_it() {
    for privileged in [false, true] {
        let folder = project(
            "truth.py",
            "[[\"Pick\"]]",
            1,
            &format!("privileged = {privileged}"),
        );
        let (_, json, complaints) = run(folder.path(), &[]);
        let message = of(
            &shown(folder.path(), of(&runs(&json)[0], "run"))["actions"][0],
            "message",
        )
        .to_owned();
        let expected = if privileged {
            "received coffee_table_1, glass_1"
        } else {
            "received nothing"
        };
        assert_eq!(
            (message.as_str(), json["privileged"].as_bool()),
            (expected, Some(privileged)),
            "{complaints}"
        );
        let report = |format: &str| {
            stdout(&actcheck(
                folder.path(),
                &["report", format, "--history", ".actcheck"],
            ))
        };
        assert_eq!(
            report("--markdown").contains("the ground truth"),
            privileged
        );
        let text = stdout(&actcheck(folder.path(), &["run", "c.toml"]));
        assert_eq!(text.contains("the ground truth"), privileged, "{text}");
    }
}

/// The fault of the first run, its status, and its message.
const FAULTS: [(&str, &str, &str); 38] = [
    (
        "exit_at_start",
        "broken",
        "it exited with code 1 before it connected to the address in ACTCHECK_ADDRESS; its last output: can't find my weights",
    ),
    (
        "never_connects",
        "timeout",
        "it did not connect to the address in ACTCHECK_ADDRESS within 4 s",
    ),
    ("silent_at_start", "timeout", "it did not answer within"),
    (
        "other_version",
        "broken",
        "it uses protocol version 2, but version 1 is required",
    ),
    (
        "no_action",
        "broken",
        "it performs none of the tests' actions: it offers Pikc, the tests use Pick",
    ),
    ("odd_hello", "broken", "unknown field `colour`"),
    (
        "bye_at_start",
        "broken",
        "it sent `bye`, but `hello` was expected",
    ),
    (
        "exit",
        "broken",
        "it exited with code 3; its last output: the last words",
    ),
    (
        "children",
        "broken",
        "it exited with code 0; its last output: the last words",
    ),
    (
        "runaway",
        "broken",
        "it exited with code 3; its last output: the last words",
    ),
    ("silent", "timeout", "it did not answer within 2 s"),
    (
        "raise",
        "broken",
        "it exited with code 1; its last output: ValueError: no idea what to do",
    ),
    ("killed", "broken", "it was killed by SIGSEGV"),
    ("shut", "broken", "it closed the connection"),
    (
        "garbage",
        "broken",
        "which is not a JSON frame: its fifth byte must be `J`",
    ),
    ("short_garbage", "timeout", "it did not answer within 2 s"),
    ("not_json", "broken", "that can't be parsed: expected"),
    ("not_object", "broken", "that can't be parsed: invalid"),
    (
        "unknown_type",
        "broken",
        "it sent `dance`, but `command`, `ask` or `end` was expected",
    ),
    (
        "unknown_key",
        "broken",
        "unknown field `postions`, expected one of",
    ),
    (
        "wrong_kind",
        "broken",
        "which is not a JSON frame: its fifth byte must be `J`",
    ),
    (
        "long_frame",
        "broken",
        "it sent a message of 2147483647 bytes; the limit is 1048576",
    ),
    ("two", "broken", "it sent more than one message at a time"),
    ("drip", "timeout", "within 2 s"),
    (
        "unknown_joint",
        "broken",
        "the robot has no joint `arm_lift_jointt`: did you mean `arm_lift_joint`?",
    ),
    (
        "finger",
        "broken",
        "is a finger joint; command it with `gripper`",
    ),
    (
        "joint_twice",
        "broken",
        "its command has two targets for the joint `arm_lift_joint`",
    ),
    (
        "joint_in_two_lists",
        "broken",
        "its command has two targets for the joint `arm_lift_joint`",
    ),
    ("no_ticks", "broken", "its command lasts 0 ticks"),
    ("not_a_number", "broken", "that can't be parsed"),
    ("infinite", "broken", "number out of range"),
    (
        "zero_quaternion",
        "broken",
        "whose quaternion [0.0, 0.0, 0.0, 0.0] is not a rotation",
    ),
    (
        "degrees",
        "broken",
        "has the target -45 rad for `arm_flex_joint`, whose limits are",
    ),
    (
        "millimetres",
        "broken",
        "has the target 80 m for the gripper's opening, whose limits are 0.0000 and",
    ),
    ("chatter", "broken", "bytes in one run"),
    (
        "memory",
        "broken",
        "it exited with code 1; its last output: MemoryError",
    ),
    ("busy", "broken", "it was killed by SIG"),
    ("stays", "completed", ""),
];

/// Compares the ends of the first two runs of a campaign with a fault. Returns the difference, or
/// `None`.
fn wrong_about((fault, status, words): (&str, &str, &str)) -> Option<String> {
    // A busy machine starts interpreters slowly: only programs that must time out get a short
    // limit.
    let startup_secs = if ["never_connects", "silent_at_start"].contains(&fault) {
        4.0
    } else {
        60.0
    };
    let timeout_secs = if ["silent", "short_garbage", "drip"].contains(&fault) {
        2.0
    } else {
        60.0
    };
    let limits = match fault {
        "memory" => "memory_mb = 1024",
        "busy" => "cpu_s = 2",
        _ => "",
    };
    let skill = format!(
        "startup_s = {startup_secs:?}\ntimeout_s = {timeout_secs:?}\n{limits}\n\
         env = {{ FAULT = \"{fault}\", FAULT_ONCE = \"once\" }}"
    );
    let folder = project("faulty.py", "[[\"Pick\"]]", 2, &skill);
    std::fs::write(folder.path().join("once"), "").unwrap();
    let (_, json, complaints) = run(folder.path(), &["--jobs", "1"]);
    let [first, second] = runs(&json) else {
        panic!("{fault}: {json:#}\n{complaints}")
    };
    nothing_is_left(folder.path());
    if fault == "raise" {
        let all = stdout(&actcheck(
            folder.path(),
            &["show", of(first, "run"), "--history", ".actcheck"],
        ));
        assert!(
            all.contains("the program printed last:\n  Traceback (most recent call last)"),
            "{all}"
        );
    }
    let reason = of(first, "reason");
    let right = of(first, "status") == status
        && reason.contains(words)
        && of(second, "status") == "completed";
    (!right).then(|| {
        format!(
            "{fault}: {} ({reason}), then {}",
            of(first, "status"),
            of(second, "status")
        )
    })
}

#[test]
fn each_program_fault_ends_one_run_and_the_next_starts_a_new_program() {
    // Runs several campaigns at a time: most of the time is spent waiting for programs that do not
    // answer.
    let next = Mutex::new(FAULTS.into_iter());
    let tried = || -> Vec<String> {
        let mut wrong = Vec::new();
        loop {
            let Some(fault) = next.lock().unwrap().next() else {
                return wrong;
            };
            wrong.extend(wrong_about(fault));
        }
    };
    let wrong: Vec<String> = std::thread::scope(|scope| {
        let workers = [(); 4].map(|()| scope.spawn(tried));
        workers
            .into_iter()
            .flat_map(|worker| worker.join().unwrap())
            .collect()
    });
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_hundred_runs_with_random_faults_all_end_and_are_kept() {
    let folder = project(
        "faulty.py",
        "[[\"Pick\"]]",
        100,
        "timeout_s = 4.0\nmax_broken = 100",
    );
    let (code, json, complaints) = run(folder.path(), &["--jobs", "8"]);
    assert!(code <= 1, "{complaints}");
    let counted = |status: &str| {
        runs(&json)
            .iter()
            .filter(|run| of(run, "status") == status)
            .count()
    };
    let [completed, broken, timeout] = ["completed", "broken", "timeout"].map(counted);
    assert_eq!(
        (json["finished_runs"].as_u64(), completed + broken + timeout),
        (Some(100), 100)
    );
    assert!(
        completed > 20 && broken > 20,
        "{completed} completed, {broken} broken, {timeout} too late"
    );
    let kept = actcheck(
        folder.path(),
        &["list", "--history", ".actcheck", "--format", "json"],
    );
    let kept: Vec<Value> = serde_json::from_str(&stdout(&kept)).unwrap();
    assert_eq!(kept.len(), 100);
    let listed = |status: &str| {
        kept.iter()
            .filter(|run| of(run, "status") == status)
            .count()
    };
    assert_eq!(
        [listed("completed"), listed("broken"), listed("timeout")],
        [completed, broken, timeout]
    );
    nothing_is_left(folder.path());
    // A program's behaviour depends on its given seed, so the number of workers changes nothing.
    let (_, again, _) = run(folder.path(), &["--jobs", "4", "--runs", "20"]);
    let statuses = |json: &Value| {
        runs(json)
            .iter()
            .map(|run| of(run, "status").to_owned())
            .collect::<Vec<_>>()
    };
    assert_eq!(statuses(&again), statuses(&json)[..20]);
}

#[test]
fn a_program_that_breaks_every_run_stops_the_campaign_with_one_error() {
    for jobs in ["1", "4"] {
        let folder = project(
            "faulty.py",
            "[[\"Pick\"]]",
            50,
            "max_broken = 3\nenv = { FAULT = \"raise\" }",
        );
        let (code, json, complaints) = run(folder.path(), &["--jobs", jobs]);
        assert_eq!(
            (code, json["finished_runs"].as_u64()),
            (2, Some(3)),
            "{complaints}"
        );
        assert_eq!(complaints.matches("S033").count(), 1, "{complaints}");
        assert!(
            complaints.contains("ValueError: no idea what to do"),
            "{complaints}"
        );
        nothing_is_left(folder.path());
    }
}

/// `ros2` and `roslaunch` are found on the search path; otherwise the message says so.
#[test]
fn launch_files_are_started_with_ros_if_it_is_installed() {
    for (file, program, words) in [
        ("x.launch.py", "ros2", "launch "),
        ("x.launch", "roslaunch", ""),
    ] {
        let folder = project(
            "well_behaved.py",
            "[[\"Pick\"]]",
            1,
            "args = [\"speed:=0.5\"]",
        );
        let config = folder.path().join("c.toml");
        let text = std::fs::read_to_string(&config).unwrap();
        std::fs::write(
            &config,
            text.replace("\"well_behaved.py\"", &format!("{file:?}")),
        )
        .unwrap();
        std::fs::write(folder.path().join(file), "").unwrap();
        let with_path = |path: &str, arguments: &[&str]| {
            let mut command = Command::new(env!("CARGO_BIN_EXE_actcheck"));
            command
                .args(arguments)
                .current_dir(folder.path())
                .env("PATH", path)
                .env("NO_COLOR", "1")
                .output()
                .unwrap()
        };
        let refused = with_path("/nowhere", &["check", "c.toml"]);
        assert_eq!(refused.status.code(), Some(2));
        let message = unwrapped(&stderr(&refused));
        assert!(
            message.contains("C033") && message.contains(&format!("{file} needs `{program}`")),
            "{message}"
        );
        let tools = folder.path().join("tools");
        std::fs::create_dir(&tools).unwrap();
        let script = "#!/bin/sh\necho \"$@\" > arguments\nexec python3 well_behaved.py\n";
        std::fs::write(tools.join(program), script).unwrap();
        std::fs::set_permissions(
            tools.join(program),
            std::os::unix::fs::PermissionsExt::from_mode(0o755),
        )
        .unwrap();
        let path = format!("{}:{}", tools.display(), std::env::var("PATH").unwrap());
        let ran = with_path(&path, &["run", "c.toml", "--format", "csv"]);
        assert_eq!(ran.status.code(), Some(1), "{}", stderr(&ran));
        let arguments = std::fs::read_to_string(folder.path().join("arguments")).unwrap();
        let here = std::fs::canonicalize(folder.path()).unwrap();
        assert_eq!(
            arguments,
            format!("{words}{} speed:=0.5\n", here.join(file).display())
        );
    }
}

/// A case exported from a program's run is in another folder, and finds the program.
#[test]
fn an_exported_run_finds_its_program() {
    let folder = project("well_behaved.py", "[[\"Pick\"]]", 1, "");
    let (_, json, _) = run(folder.path(), &[]);
    let id = of(&runs(&json)[0], "run");
    std::fs::create_dir(folder.path().join("cases")).unwrap();
    let exported = actcheck(
        folder.path(),
        &[
            "export",
            "run",
            id,
            "--history",
            ".actcheck",
            "-o",
            "cases/one.toml",
        ],
    );
    assert!(exported.status.success(), "{}", stderr(&exported));
    let again = actcheck(
        folder.path(),
        &[
            "run",
            "cases/one.toml",
            "--trust",
            "--history",
            "h",
            "--format",
            "json",
        ],
    );
    let replayed: Value =
        serde_json::from_str(&stdout(&again)).unwrap_or_else(|_| panic!("{}", stderr(&again)));
    assert!(
        replayed.to_string().contains("\"same_trace\":true"),
        "{replayed:#}"
    );
}

#[test]
fn an_action_over_its_budget_also_ends_for_the_program() {
    let folder = project("endless.py", "[[\"Pick\"]]", 2, "");
    let config = folder.path().join("c.toml");
    let text = std::fs::read_to_string(&config).unwrap();
    std::fs::write(&config, text + "[budget]\naction_secs = 2\n").unwrap();
    let (_, json, complaints) = run(folder.path(), &["--jobs", "1"]);
    for run in runs(&json) {
        let end = (of(run, "status"), of(run, "reason"));
        assert_eq!(
            end,
            ("timeout", "the action took longer than its budget of 2 s"),
            "{complaints}"
        );
    }
    // The same process performed both runs.
    assert_eq!(
        std::fs::read_to_string(folder.path().join("starts"))
            .unwrap()
            .lines()
            .count(),
        1
    );
    nothing_is_left(folder.path());
}

#[test]
fn no_process_is_left_after_the_simulator_ends() {
    for name in ["INT", "KILL"] {
        let folder = project(
            "faulty.py",
            "[[\"Pick\"]]",
            50,
            "timeout_s = 60.0\nenv = { FAULT = \"silent\" }",
        );
        let mut simulator = started(folder.path(), &["run", "c.toml", "--jobs", "2"]);
        let here = std::fs::canonicalize(folder.path()).unwrap();
        let has_program = || processes_in(&here).len() > 1;
        let patience = Instant::now() + Duration::from_secs(30);
        while !has_program() && Instant::now() < patience {
            std::thread::sleep(Duration::from_millis(20));
        }
        // A second interrupt forces the end if the first has not ended it.
        for _ in 0..2 {
            if simulator.try_wait().unwrap().is_none() {
                signal(simulator.id(), name);
            }
            std::thread::sleep(Duration::from_millis(300));
        }
        simulator.wait().unwrap();
        nothing_is_left(folder.path());
    }
}

/// Status and reason of each run of a program with a fault after its actions.
fn ends_after(kind: &str, of_seeds: bool, tests: &str, jobs: &str) -> Vec<(String, String)> {
    let seeds = if of_seeds { ", AFTER_SEED = \"1\"" } else { "" };
    let folder = project(
        "after.py",
        tests,
        6,
        &format!("max_broken = 100\nenv = {{ AFTER = \"{kind}\"{seeds} }}"),
    );
    let (_, json, _) = run(folder.path(), &["--jobs", jobs]);
    nothing_is_left(folder.path());
    runs(&json)
        .iter()
        .map(|run| (of(run, "status").to_owned(), of(run, "reason").to_owned()))
        .collect()
}

/// The death of a program after its action was charged to the next run of the same worker: with one
/// worker every second run was broken, with six none. A second `end` was sometimes a fault, and
/// sometimes the end of the next action.
#[test]
fn a_fault_after_an_action_breaks_the_run_of_that_action() {
    let exits = "it exited with code 0";
    let talks = "it sent more than one message at a time: it has to wait for each answer";
    for (kind, reason) in [
        ("exit", exits),
        ("late exit", exits),
        ("second end", talks),
        ("late message", talks),
        ("command", talks),
    ] {
        for tests in ["[[\"Pick\"]]", "[[\"Pick\", \"Pick\"]]"] {
            for jobs in ["1", "6"] {
                let ends = ends_after(kind, false, tests, jobs);
                assert_eq!(ends.len(), 6);
                let is_right =
                    |(status, said): &(String, String)| status == "broken" && said.contains(reason);
                // A second message may be taken for the first of the next action.
                let is_broken = |(status, _): &(String, String)| status == "broken";
                let alone = tests.matches("Pick").count() == 1;
                assert!(
                    ends.iter()
                        .all(|end| is_right(end) || (!alone && is_broken(end))),
                    "{kind}, {jobs}: {ends:?}"
                );
            }
        }
    }
    let [one, six] = ["1", "6"].map(|jobs| ends_after("exit", true, "[[\"Pick\"]]", jobs));
    assert_eq!(one, six);
    let broken = one.iter().filter(|(status, _)| status == "broken").count();
    assert!((1..6).contains(&broken), "{one:?}");
}

/// A program that is gone between two runs belongs to none: a new one is started.
#[test]
fn a_program_that_ends_between_runs_breaks_none() {
    for jobs in ["1", "3"] {
        let ends = ends_after("exit when ready", false, "[[\"Pick\"]]", jobs);
        assert!(
            ends.len() == 6 && ends.iter().all(|(status, _)| status == "completed"),
            "{jobs}: {ends:?}"
        );
    }
}

/// A skill that answers slowly went on for hours after the time of its campaign.
#[test]
fn the_time_of_a_campaign_ends_a_slow_skill() {
    let folder = project("after.py", "[[\"Pick\"]]", 3, "timeout_s = 600.0");
    let slow = "import time, wire\ndef perform(link, begin):\n    while True:\n        time.sleep(2)\n        \
                if link.ask({'type': 'command', 'ticks': 1})['type'] == 'abort':\n            return None\nwire.serve(perform)\n";
    std::fs::write(folder.path().join("after.py"), slow).unwrap();
    let began = std::time::Instant::now();
    let run = actcheck(
        folder.path(),
        &["run", "c.toml", "--time", "3s", "--jobs", "1"],
    );
    let took = began.elapsed().as_secs_f64();
    assert!((3.0..60.0).contains(&took), "{took} s: {}", stderr(&run));
    assert_eq!(
        run.status.code(),
        Some(2),
        "no run could be judged: {}",
        stderr(&run)
    );
    nothing_is_left(folder.path());
}

/// A process that a program started in a session of its own, without its environment, stayed for
/// ever.
#[test]
fn a_process_without_the_environment_ends_with_its_program() {
    let folder = project("after.py", "[[\"Pick\"]]", 2, "");
    let skill = "import os, subprocess, wire\ndef perform(link, begin):\n    \
                 subprocess.Popen(['env', '-i', '/usr/bin/setsid', '/bin/sleep', '600'])\n    \
                 return {'type': 'end', 'succeeded': True, 'message': ''}\nwire.serve(perform)\n";
    std::fs::write(folder.path().join("after.py"), skill).unwrap();
    let (_, json, complaints) = run(folder.path(), &["--jobs", "1"]);
    assert_eq!(runs(&json).len(), 2, "{complaints}");
    nothing_is_left(folder.path());
}

/// The path of a socket has at most 107 bytes.
#[test]
fn a_long_path_of_temporary_files_breaks_no_run() {
    let folder = project(
        "after.py",
        "[[\"Pick\"]]",
        1,
        "env = { AFTER = \"nothing\" }",
    );
    let long = folder.path().join("a".repeat(90));
    std::fs::create_dir(&long).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_actcheck"))
        .args(["run", "c.toml", "--format", "json"])
        .current_dir(folder.path())
        .env("TMPDIR", &long)
        .output()
        .unwrap();
    let json: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    assert_eq!(of(&runs(&json)[0], "status"), "completed", "{json:#}");
}
