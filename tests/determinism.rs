//! Every shipped campaign gives the same outcomes, scores and body states with one worker and with
//! two. Runs have the same bits on another processor.

use std::path::Path;
use std::process::Command;

use crate::support::foreign::left_out;
use crate::support::{COARSEST, actcheck, project_with, root, stderr, stdout};

/// Its physics is replaced by the coarsest, since the robot does not need to succeed.
#[test]
fn every_shipped_campaign_is_the_same_with_one_and_two_workers() {
    let project = project_with(COARSEST);
    let mut configs: Vec<String> = std::fs::read_dir(root().join("configs"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .filter(|name| name.ends_with(".toml"))
        .collect();
    configs.sort();
    assert!(configs.len() >= 5, "{configs:?}");
    for name in configs {
        let config = format!("configs/{name}");
        let file = project.path().join(&config);
        let text = std::fs::read_to_string(&file).unwrap();
        if !text.contains("[physics]") {
            std::fs::write(&file, text + COARSEST).unwrap();
        }
        let [one, two] = ["1", "2"].map(|jobs| {
            let history = format!("{name}-{jobs}");
            let run = [
                "run",
                &config,
                "--runs",
                "2",
                "--jobs",
                jobs,
                "--history",
                &history,
                "--format",
                "csv",
            ];
            let outcomes = actcheck(project.path(), &run);
            assert!(
                outcomes.status.code() < Some(2),
                "{name}: {}",
                stderr(&outcomes)
            );
            // Scores and the digests over all states.
            let list = actcheck(
                project.path(),
                &["list", "--history", &history, "--format", "csv"],
            );
            (stdout(&outcomes), stdout(&list))
        });
        // A head, the runs, and those of pairs.
        assert!(one.1.lines().count() >= 3, "{name}: {}", one.1);
        assert_eq!(one, two, "{name}");
    }
}

/// A processor of 2008 (Nehalem), emulated: without fused multiplication and addition, which rounds
/// once instead of twice.
#[test]
fn runs_on_an_older_processor_have_the_same_bits() {
    const EMULATOR: &str = "qemu-x86_64";
    if cfg!(not(target_arch = "x86_64"))
        || Command::new(EMULATOR).arg("--version").output().is_err()
    {
        left_out(
            "runs on an older processor",
            "qemu-x86_64 (Debian's package qemu-user) is needed, on x86-64",
        );
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let program = env!("CARGO_BIN_EXE_actcheck");
    for (config, runs) in [("pick.toml", "3"), ("fixed_arm.toml", "2")] {
        let digests = |history: &str, mut command: Command| {
            let history = folder
                .path()
                .join(history)
                .join(config)
                .display()
                .to_string();
            command.current_dir(root()).env("NO_COLOR", "1");
            let config = Path::new("configs").join(config).display().to_string();
            let output = command
                .args(["run", &config, "--runs", runs, "--history", &history])
                .output()
                .unwrap();
            assert!(output.status.code() < Some(2), "{}", stderr(&output));
            let query = "SELECT ?index ?hash { ?run act:index ?index ; act:traceHash ?hash } ORDER BY ?index";
            stdout(&actcheck(
                root(),
                &["query", query, "--history", &history, "--format", "csv"],
            ))
        };
        let mut emulated = Command::new(EMULATOR);
        emulated.args(["-cpu", "Nehalem", program]);
        let [here, there] = [
            digests("here", Command::new(program)),
            digests("there", emulated),
        ];
        assert!(here.lines().count() > 2, "{here}");
        assert_eq!(here, there, "{config}");
    }
}
