//! Launches on schedulers: their files, and substitutes for their commands that run the shards as
//! processes. The substitutes are in `tests/data/launch/schedulers`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use regex::Regex;
use serde_json::Value;
use tempfile::TempDir;

use crate::support::expected::assert_expected;
use crate::support::look::looking;
use crate::support::{actcheck, root, signal, stderr, stdout};

const LAUNCH: [&str; 8] = [
    "launch",
    "configs/look.toml",
    "--runs",
    "12",
    "--shards",
    "4",
    "--history",
    "parts",
];
const SLURM: [&str; 4] = ["--on", "slurm", "--resources", "cpus=1"];
const KUBERNETES: [&str; 4] = [
    "--on",
    "kubernetes",
    "--resources",
    "image=actcheck:0.1.0,volume=projects",
];
const RAY: [&str; 4] = ["--on", "ray", "--resources", "cpus=1"];

fn data() -> PathBuf {
    root().join("tests/data/launch")
}

/// A project and a place for the substitutes' state.
struct Site {
    project: TempDir,
    state: TempDir,
}

impl Site {
    fn new() -> Self {
        let state = tempfile::tempdir().unwrap();
        // The image of the pods has actcheck on its search path.
        std::os::unix::fs::symlink(
            env!("CARGO_BIN_EXE_actcheck"),
            state.path().join("actcheck"),
        )
        .unwrap();
        Self {
            project: looking(),
            state,
        }
    }

    fn folder(&self) -> &Path {
        self.project.path()
    }

    fn command(&self, on: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_actcheck"));
        let fakes = data().join("schedulers");
        let path = format!(
            "{}:{}:{}",
            fakes.display(),
            self.state.path().display(),
            std::env::var("PATH").unwrap()
        );
        command
            .args(LAUNCH)
            .args(on)
            .current_dir(self.folder())
            .env("NO_COLOR", "1")
            .env("PATH", path);
        command
            .env("SCHEDULER", self.state.path())
            .env("PYTHONPATH", fakes.join("ray"));
        command.env("PYTHONDONTWRITEBYTECODE", "1");
        command
    }

    fn launch(&self, on: &[&str]) -> Output {
        self.command(on).output().unwrap()
    }

    fn start(&self, on: &[&str]) -> Child {
        self.command(on)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    }

    /// Loses a task in its middle.
    fn lose(&self, task: &str) {
        fs::write(self.state.path().join("lose"), format!("{task}\n")).unwrap();
    }

    fn state(&self, name: &str) -> String {
        fs::read_to_string(self.state.path().join(name)).unwrap_or_default()
    }

    /// Columns of `actcheck list` without the ids: trace digests, scores and counts of outcomes.
    fn listed(&self, history: &str) -> Vec<String> {
        let output = actcheck(
            self.folder(),
            &["list", "--history", history, "--format", "csv"],
        );
        assert!(output.status.success(), "{}", stderr(&output));
        stdout(&output)
            .lines()
            .skip(1)
            .map(|line| line.split_once(',').unwrap().1.to_owned())
            .collect()
    }

    /// The launch must give the results of one campaign.
    fn must_equal_whole(&self, output: &Output) {
        let whole = actcheck(
            self.folder(),
            &[
                "run",
                "configs/look.toml",
                "--runs",
                "12",
                "--history",
                "whole",
            ],
        );
        assert_eq!(
            output.status.code(),
            whole.status.code(),
            "{}",
            stderr(output)
        );
        assert_eq!(self.listed("parts"), self.listed("whole"));
        assert_eq!(self.listed("parts").len(), 12);
        assert!(!self.folder().join("parts.launch").exists());
    }
}

fn until(condition: impl Fn() -> bool) {
    let began = Instant::now();
    while !condition() {
        assert!(
            began.elapsed() < Duration::from_secs(60),
            "nothing happened"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Interrupts a launch, and returns its messages.
fn interrupted(child: Child) -> String {
    signal(child.id(), "INT");
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
    stderr(&output)
}

#[test]
fn a_slurm_array_equals_one_campaign_and_a_lost_task_runs_again() {
    let site = Site::new();
    site.lose("2");
    let output = site.launch(&SLURM);
    site.must_equal_whole(&output);
    let said = stderr(&output);
    assert!(
        said.contains("4 shards are job 101 of Slurm; `scancel 101` ends it"),
        "{said}"
    );
    if said.contains("job 101 ended with 1 incomplete shards") {
        assert!(
            site.state("102.sh").contains("#SBATCH --array=2\n"),
            "{}",
            site.state("102.sh")
        );
    }
}

/// Ctrl-C leaves the job alone. The same command follows it, also if the answer to its submission
/// was not recorded.
#[test]
fn an_interrupted_launch_follows_its_job_again() {
    let site = Site::new();
    let child = site.start(&SLURM);
    let record = site.folder().join("parts.launch/job.json");
    until(|| fs::read_to_string(&record).is_ok_and(|text| text.contains("\"101\"")));
    let said = interrupted(child);
    assert!(said.contains("job 101 of Slurm goes on"), "{said}");
    let elsewhere = site.launch(&["--on", "local"]);
    assert!(
        stderr(&elsewhere).contains("X073"),
        "{}",
        stderr(&elsewhere)
    );
    let text = fs::read_to_string(&record)
        .unwrap()
        .replace("\"101\"", "null");
    fs::write(&record, text).unwrap();
    let output = site.launch(&SLURM);
    site.must_equal_whole(&output);
    assert_eq!(site.state("last").trim(), "101", "{}", stderr(&output));
}

#[test]
fn an_indexed_job_equals_one_campaign_and_a_lost_pod_runs_again() {
    let site = Site::new();
    site.lose("1");
    let output = site.launch(&KUBERNETES);
    site.must_equal_whole(&output);
    let pods = site.state("pods");
    assert_eq!(
        pods.lines().filter(|line| line.ends_with(" 0")).count(),
        4,
        "{pods}"
    );
}

/// A pod that ends with a lasting diagnostic is not started again, and the others are completed.
#[test]
fn a_lasting_diagnostic_in_a_pod_is_reported_once() {
    let site = Site::new();
    let child = site.start(&KUBERNETES);
    until(|| site.state("pods").lines().count() >= 1);
    interrupted(child);
    let launch = site.folder().join("parts.launch");
    // The fourth shard's history is damaged.
    fs::create_dir_all(launch.join("shards/4")).unwrap();
    let is_early = !launch.join("shards/4/VERSION").exists();
    fs::write(launch.join("shards/4/VERSION"), "from the future").unwrap();
    let output = site.launch(&KUBERNETES);
    let (said, pods) = (stderr(&output), site.state("pods"));
    if is_early {
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(
            said.contains("X075") && said.contains("shard 4/4 could not be completed"),
            "{said}"
        );
        assert_eq!(
            pods.lines().filter(|line| line.ends_with(" 3 2")).count(),
            1,
            "{pods}"
        );
        fs::remove_dir_all(launch.join("shards/4")).unwrap();
        site.must_equal_whole(&site.launch(&KUBERNETES));
        // Only the missing shard is in the second job.
        assert_eq!(
            site.state("pods")
                .lines()
                .filter(|line| line.contains("-2 "))
                .count(),
            1,
            "{}",
            site.state("pods")
        );
    }
}

#[test]
fn tasks_of_ray_equal_one_campaign_and_a_lost_task_runs_again() {
    let site = Site::new();
    site.lose("3");
    let output = site.launch(&RAY);
    site.must_equal_whole(&output);
    assert_eq!(site.state("lose"), "");
}

/// The tasks of Ray end with the launch, however it ends, and the same command continues.
#[test]
fn a_killed_launch_on_ray_continues() {
    let site = Site::new();
    let mut child = site.start(&RAY);
    until(|| site.folder().join("parts.launch/shards/1/VERSION").exists());
    child.kill().unwrap();
    child.wait().unwrap();
    site.must_equal_whole(&site.launch(&RAY));
}

#[test]
fn faults_of_schedulers_are_reported() {
    let site = Site::new();
    let refused = |output: Output, code: &str, text: &str| {
        assert_eq!(output.status.code(), Some(2), "{code}: {}", stderr(&output));
        let said = stderr(&output)
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ");
        assert!(
            said.contains(code) && said.contains(text),
            "{code} {text}: {said}"
        );
    };
    fs::write(
        site.state.path().join("refusal"),
        "error: invalid partition specified: shrt\n",
    )
    .unwrap();
    refused(
        site.launch(&SLURM),
        "X078",
        "invalid partition specified: shrt",
    );
    refused(
        site.launch(&KUBERNETES),
        "X078",
        "invalid partition specified: shrt",
    );
    refused(
        site.launch(&["--on", "ray", "--resources", "address=10.0.0.1:1"]),
        "X078",
        "any running Ray instance",
    );
    for (on, program) in [
        (&SLURM, "sbatch"),
        (&KUBERNETES, "kubectl"),
        (&RAY, "python3"),
    ] {
        let output = site
            .command(on)
            .env("PATH", site.state.path())
            .output()
            .unwrap();
        refused(output, "X077", &format!("`{program}` of"));
    }
    fs::write(
        site.state.path().join("ray.py"),
        "raise ImportError('No module named ray')\n",
    )
    .unwrap();
    let output = site
        .command(&RAY)
        .env("PYTHONPATH", site.state.path())
        .output()
        .unwrap();
    refused(output, "X077", "No module named ray");

    let wrong = |on: &str, resources: &str| {
        let output = site.launch(&["--dry-run", "--on", on, "--resources", resources]);
        assert_eq!(output.status.code(), Some(2), "{on} {resources}");
        stderr(&output)
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ")
    };
    for (on, resources, text) in [
        ("slurm", "cpu=2", "did you mean `cpus`?"),
        ("slurm", "cpus=0", "expected 1 to 1024"),
        ("slurm", "memory=4", "expected a size"),
        ("slurm", "time=soon", "is not a duration"),
        ("slurm", "partition=", "the value is missing"),
        ("slurm", "cpus=1,cpus=2", "has `cpus` twice"),
        ("slurm", "image=x", "use `--on kubernetes`"),
        ("local", "memory=4G", "has no meaning with `--on local`"),
        ("kubernetes", "image=x", "needs the key `volume`"),
        (
            "kubernetes",
            "image=x,volume=y,mount=/nowhere",
            "is not on the volume",
        ),
    ] {
        let said = wrong(on, resources);
        assert!(
            said.contains("X076") && said.contains(text),
            "{on} {resources}: {said}"
        );
    }
}

/// A shard refuses to run with another program than the launch was planned with.
#[test]
fn another_program_is_refused() {
    let site = Site::new();
    let mut child = site.start(&["--on", "local"]);
    let plan = site.folder().join("parts.launch/plan.json");
    until(|| plan.exists());
    child.kill().unwrap();
    child.wait().unwrap();
    let text = fs::read_to_string(&plan).unwrap();
    fs::write(
        &plan,
        Regex::new("\"program\": \"[0-9a-f]*\"")
            .unwrap()
            .replace(&text, "\"program\": \"0\"")
            .as_bytes(),
    )
    .unwrap();
    let output = actcheck(site.folder(), &["launch-task", "parts.launch", "4"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("X082"), "{}", stderr(&output));
    assert!(site.folder().join("parts.launch/faults/4").exists());
}

/// Everything that a scheduler receives, without names that differ from run to run.
fn dry_run(site: &Site, on: &[&str]) -> String {
    let output = site.launch(&[on, &["--dry-run", "--jobs", "2"]].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(!site.folder().join("parts.launch").exists());
    let text = stdout(&output).replace(
        &site.folder().canonicalize().unwrap().display().to_string(),
        "/project",
    );
    let text = text.replace(env!("CARGO_BIN_EXE_actcheck"), "/bin/actcheck");
    let text = Regex::new("\"program\": \"[0-9a-f]+\"")
        .unwrap()
        .replace_all(&text, "\"program\": \"DIGEST\"")
        .into_owned();
    let text = Regex::new("\"config_digest\": \"[0-9a-f]+\"")
        .unwrap()
        .replace_all(&text, "\"config_digest\": \"DIGEST\"")
        .into_owned();
    let id = Regex::new("\"id\": \"([0-9a-f]{8})\"")
        .unwrap()
        .captures(&text)
        .unwrap()[1]
        .to_owned();
    text.replace(&id, "ID")
}

#[test]
fn files_of_schedulers_are_printed() {
    let site = Site::new();
    let few = ["--on", "slurm"];
    let slurm = [
        "--on",
        "slurm",
        "--resources",
        "cpus=2,memory=4G,time=90m,partition=short,account=robots",
    ];
    let more = "image=actcheck:0.1.0,volume=projects,cpus=2,memory=4G,time=90m,namespace=robots";
    let kubernetes = ["--on", "kubernetes", "--resources", more];
    let ray = [
        "--on",
        "ray",
        "--resources",
        "cpus=2,memory=4G,address=10.0.0.1:6379,python=/opt/ray/bin/python3",
    ];
    let file = |name: &str| data().join(format!("{name}.txt"));
    assert_expected([
        (file("slurm_few"), dry_run(&site, &few)),
        (file("slurm"), dry_run(&site, &slurm)),
        (file("kubernetes_few"), dry_run(&site, &KUBERNETES)),
        (file("kubernetes"), dry_run(&site, &kubernetes)),
        (
            file("ray"),
            dry_run(&site, &ray)
                .split("# parts.launch/run_on_ray.py")
                .next()
                .unwrap()
                .to_owned(),
        ),
    ]);
}

/// The manifests keep the rules of the published schema of `batch/v1`: `kubernetes_job.json` has
/// the keys and types of the objects that a manifest may use. The further rules are those that the
/// server checks.
#[test]
fn manifests_keep_the_rules_of_indexed_jobs() {
    let schema: Value =
        serde_json::from_str(&fs::read_to_string(data().join("kubernetes_job.json")).unwrap())
            .unwrap();
    let dns = Regex::new("^[a-z0-9]([-a-z0-9]*[a-z0-9])?$").unwrap();
    for name in ["kubernetes_few", "kubernetes"] {
        let text = fs::read_to_string(data().join(format!("{name}.txt"))).unwrap();
        let manifest = text
            .split("kubernetes.json\n")
            .nth(1)
            .unwrap()
            .split("\n# submitted")
            .next()
            .unwrap();
        let job: Value = serde_json::from_str(manifest).unwrap();
        has_type(&job, &Value::from("Job"), &schema, "Job");

        assert_eq!(
            (&job["apiVersion"], &job["kind"]),
            (&Value::from("batch/v1"), &Value::from("Job"))
        );
        let spec = &job["spec"];
        let pod = &spec["template"]["spec"];
        let container = &pod["containers"][0];
        // Retries by index need indices, and a failure policy needs pods that are not restarted in
        // place.
        assert_eq!(spec["completionMode"], "Indexed");
        assert!(spec["backoffLimitPerIndex"].is_u64());
        assert_eq!(pod["restartPolicy"], "Never");
        // With a failure policy, this must be absent or `Failed`.
        assert!(spec["podReplacementPolicy"].is_null());
        for rule in spec["podFailurePolicy"]["rules"].as_array().unwrap() {
            assert!(
                ["FailIndex", "FailJob", "Ignore", "Count"]
                    .contains(&rule["action"].as_str().unwrap())
            );
            let has = [&rule["onExitCodes"], &rule["onPodConditions"]].map(|part| !part.is_null());
            assert!(has[0] != has[1], "{rule}");
            if has[0] {
                assert_eq!(rule["onExitCodes"]["containerName"], container["name"]);
                assert!(
                    !rule["onExitCodes"]["values"]
                        .as_array()
                        .unwrap()
                        .contains(&Value::from(0))
                );
            }
        }
        let mounts: Vec<&Value> = container["volumeMounts"]
            .as_array()
            .unwrap()
            .iter()
            .map(|mount| &mount["name"])
            .collect();
        let volumes: Vec<&Value> = pod["volumes"]
            .as_array()
            .unwrap()
            .iter()
            .map(|volume| &volume["name"])
            .collect();
        assert_eq!(mounts, volumes);
        // A pod's host name is the job's with its index, at most 63 characters of DNS.
        let name = job["metadata"]["name"]
            .as_str()
            .unwrap()
            .replace("ID", "01234567");
        assert!(dns.is_match(&name) && name.len() <= 55, "{name}");
    }
}

/// Checks a value against a type of the schema: the name of a basic type or an object, a list, or a
/// map.
fn has_type(value: &Value, kind: &Value, schema: &Value, place: &str) {
    match kind {
        Value::Array(kinds) => {
            for (idx, item) in value
                .as_array()
                .unwrap_or_else(|| panic!("{place}"))
                .iter()
                .enumerate()
            {
                has_type(item, &kinds[0], schema, &format!("{place}[{idx}]"));
            }
        }
        Value::Object(map) => {
            for (key, item) in value.as_object().unwrap_or_else(|| panic!("{place}")) {
                has_type(item, &map["*"], schema, &format!("{place}.{key}"));
            }
        }
        kind if kind == "string" => assert!(value.is_string(), "{place}"),
        kind if kind == "integer" => assert!(value.is_i64() || value.is_u64(), "{place}"),
        kind if kind == "boolean" => assert!(value.is_boolean(), "{place}"),
        kind => {
            let object = &schema[kind.as_str().unwrap()];
            let has = value.as_object().unwrap_or_else(|| panic!("{place}"));
            for key in object["required"].as_array().unwrap() {
                assert!(
                    has.contains_key(key.as_str().unwrap()),
                    "{place} lacks {key}"
                );
            }
            for (key, item) in has {
                let kind = &object["properties"][key];
                assert!(!kind.is_null(), "{place} has no {key}");
                has_type(item, kind, schema, &format!("{place}.{key}"));
            }
        }
    }
}
