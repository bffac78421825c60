//! Readers of a history neither wait for a process that writes it nor disturb it, and need no
//! permission to write.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use actcheck::base::Term;
use actcheck::history::{CampaignEnd, History, NewestJudgements, QueryAnswer, RunFilter};

use crate::history::{sample_campaign, sample_run};
use crate::support::foreign::left_out;
use crate::support::{actcheck, copy_made_history, root, stderr, stdout};

fn runs(history: &History) -> usize {
    history.runs(&RunFilter::default()).unwrap().len()
}

/// All files below a folder.
fn files(folder: &Path) -> BTreeSet<PathBuf> {
    let mut found = BTreeSet::new();
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let path = entry.path();
        if path.is_dir() {
            found.extend(files(&path))
        } else {
            found.extend([path])
        }
    }
    found
}

/// Commands that only read the history in `h`; each prints or writes into the folder `out`.
fn reading(run: &str) -> Vec<Vec<String>> {
    let commands = [
        "list --history h".to_owned(),
        format!("show {run} --history h"),
        "query --named failure-rates --history h".to_owned(),
        format!("why {run} --history h"),
        "health --history h".to_owned(),
        "health --integrity --history h".to_owned(),
        "analyse --history h".to_owned(),
        "report --html out/report.html --history h".to_owned(),
        "export rdf out/all.nq --history h".to_owned(),
        "export tables out/table --history h".to_owned(),
        format!("replay {run} --history h"),
        "merge h --into out/merged".to_owned(),
    ];
    commands
        .iter()
        .map(|command| command.split(' ').map(str::to_owned).collect())
        .collect()
}

fn ran(folder: &Path, command: &[String]) -> Output {
    let words: Vec<&str> = command.iter().map(String::as_str).collect();
    let _ = std::fs::remove_dir_all(folder.join("out"));
    std::fs::create_dir_all(folder.join("out")).unwrap();
    actcheck(folder, &words)
}

fn read_by_all(folder: &Path, run: &str) {
    for command in reading(run) {
        let output = ran(folder, &command);
        assert!(
            output.status.code().is_some_and(|code| code < 2),
            "{command:?}: {}",
            stderr(&output)
        );
        assert!(
            !output.stdout.is_empty(),
            "{command:?}: {}",
            stderr(&output)
        );
    }
}

#[test]
fn a_reader_sees_the_state_of_its_opening_while_the_history_grows() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("h");
    let owner = History::open(&dir).unwrap();
    owner.begin_campaign(&sample_campaign("a1", 1)).unwrap();
    for index in 0..3 {
        owner.commit(&sample_run("a1", index)).unwrap();
    }
    let reader = History::open_to_read(&dir).unwrap();
    assert_eq!(runs(&reader), 3);
    assert!(!reader.refresh().unwrap());
    // The owner writes and flushes; the reader still reads its own state.
    for round in 0..6 {
        owner.commit(&sample_run("a1", 3 + round)).unwrap();
        owner.flush().unwrap();
        let during = History::open_to_read(&dir).unwrap();
        assert_eq!(runs(&during), 4 + round as usize);
    }
    owner
        .finish_campaign("a1", &CampaignEnd::default())
        .unwrap();
    drop(owner);
    drop(History::open_existing(&dir).unwrap());
    assert_eq!(runs(&reader), 3);
    let stored =
        |history: &History| match history.query("SELECT (COUNT(*) AS ?n) { ?run a act:Run }") {
            Ok(QueryAnswer::Table { rows, .. }) => rows[0][0].clone(),
            other => panic!("{other:?}"),
        };
    assert_eq!(stored(&reader), Some(Term::Integer(3)));
    reader
        .rdf()
        .write_nquads(&folder.path().join("all.nq"))
        .unwrap();
    assert!(
        std::fs::read_to_string(folder.path().join("all.nq"))
            .unwrap()
            .lines()
            .count()
            > 100
    );
    assert!(reader.is_stale() && reader.refresh().unwrap() && !reader.is_stale());
    assert_eq!(
        (runs(&reader), stored(&reader)),
        (9, Some(Term::Integer(9)))
    );
}

/// Each answer is of a moment at which the owner had stored so many runs, and no part is of another.
#[test]
fn a_reader_beside_a_writing_thread_sees_whole_runs() {
    const RUNS: u64 = 60;
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("h");
    let owner = History::open(&dir).unwrap();
    owner.begin_campaign(&sample_campaign("a1", 1)).unwrap();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            for index in 0..RUNS {
                let run = sample_run("a1", index);
                if index % 2 == 0 {
                    owner.commit(&run).unwrap()
                } else {
                    owner.commit_outcomes(&run).unwrap()
                }
            }
            owner
                .finish_campaign("a1", &CampaignEnd::default())
                .unwrap();
        });
        let mut before = 0;
        while before < RUNS as usize {
            let reader = History::open_to_read(&dir).unwrap();
            let rows = reader.runs(&RunFilter::default()).unwrap();
            assert!(rows.len() >= before && reader.tail_warning().unwrap().is_none());
            before = rows.len();
            let outcomes = reader.outcomes(&RunFilter::default()).unwrap();
            assert_eq!(outcomes.len(), 5 * before);
            if let Some(row) = rows.last() {
                assert_eq!(reader.run(&row.run).unwrap().actions[0].judgements.len(), 5);
                assert!(reader.traces().recorded(&row.run).is_ok());
            }
        }
    });
}

#[test]
fn a_reader_does_not_keep_others_from_writing() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("h");
    drop(History::open(&dir).unwrap());
    let reader = History::open_to_read(&dir).unwrap();
    let owner = History::open(&dir).unwrap();
    owner.begin_campaign(&sample_campaign("a1", 1)).unwrap();
    owner.commit(&sample_run("a1", 0)).unwrap();
    assert_eq!(runs(&reader), 0);
    assert!(reader.refresh().unwrap());
    assert_eq!(runs(&reader), 1);
}

/// Readers that met a half-created history called it damaged.
#[test]
fn a_reader_waits_until_a_new_history_is_created() {
    let folder = tempfile::tempdir().unwrap();
    for number in 0..5 {
        let dir = folder.path().join(format!("h{number}"));
        let (owner, opened) = std::thread::scope(|scope| {
            let creating = scope.spawn(|| History::open(&dir));
            let opened = loop {
                match History::open_to_read(&dir) {
                    // Not even begun.
                    Err(faults) if faults.iter().all(|fault| fault.code == "H003") => {
                        std::thread::yield_now()
                    }
                    other => break other,
                }
            };
            (creating.join().unwrap(), opened)
        });
        assert_eq!((runs(&owner.unwrap()), runs(&opened.unwrap())), (0, 0));
    }
}

#[test]
fn every_reading_command_answers_while_another_process_owns_the_history() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("h");
    copy_made_history(&dir);
    let owner = History::open_existing(&dir).unwrap();
    let run = owner.runs(&RunFilter::default()).unwrap().remove(0).run;
    read_by_all(folder.path(), &run);
    drop(owner);
    // Writing commands are still refused while another process writes.
    let owner = History::open_existing(&dir).unwrap();
    let output = actcheck(folder.path(), &["recheck", "--history", "h"]);
    assert!(stderr(&output).contains("H002"), "{}", stderr(&output));
    drop(owner);
}

/// Root may write anywhere, so the folder is on a file system that is mounted read-only.
#[test]
fn a_read_only_history_can_be_read_by_every_reading_command() {
    let folder = tempfile::tempdir().unwrap();
    let (dir, kept) = (folder.path().join("h"), folder.path().join("kept"));
    copy_made_history(&kept);
    let run = History::open_to_read(&kept)
        .unwrap()
        .runs(&RunFilter::default())
        .unwrap()
        .remove(0)
        .run;
    // Without its mirror, which commands can't write there.
    std::fs::remove_dir_all(kept.join("tables")).unwrap();
    let before = files(&kept);
    std::fs::create_dir(&dir).unwrap();
    let mount = |arguments: &[&str]| {
        Command::new("mount")
            .args(arguments)
            .status()
            .is_ok_and(|status| status.success())
    };
    let (from, to) = (kept.display().to_string(), dir.display().to_string());
    if !mount(&["--bind", &from, &to]) || !mount(&["-o", "remount,bind,ro", &to]) {
        let _ = Command::new("umount").arg(&to).status();
        left_out("a test of a read-only folder", "it can't be mounted here");
        return;
    }
    let outcome = std::panic::catch_unwind(|| read_by_all(folder.path(), &run));
    assert!(Command::new("umount").arg(&to).status().unwrap().success());
    if let Err(panic) = outcome {
        std::panic::resume_unwind(panic);
    }
    assert_eq!(files(&kept), before);
}

#[test]
fn a_run_starts_and_ends_beside_readers_in_a_loop() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("h");
    copy_made_history(&dir);
    let name = dir.display().to_string();
    let arguments = [
        "run",
        "configs/quick.toml",
        "--runs",
        "3",
        "--jobs",
        "1",
        "--history",
        &name,
    ];
    let mut writer = Command::new(env!("CARGO_BIN_EXE_actcheck"))
        .args(arguments)
        .current_dir(root())
        .env("NO_COLOR", "1")
        .stdout(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let mut seen = Vec::new();
    let status = loop {
        let listed = actcheck(
            folder.path(),
            &["list", "--history", "h", "--format", "csv"],
        );
        assert!(listed.status.success(), "{}", stderr(&listed));
        seen.push(stdout(&listed).lines().count() - 1);
        if let Some(status) = writer.try_wait().unwrap() {
            break status;
        }
    };
    assert!(status.code().is_some_and(|code| code < 2), "{status}");
    assert!(seen.is_sorted() && seen.first() == Some(&4), "{seen:?}");
    assert_eq!(runs(&History::open_to_read(&dir).unwrap()), 7);
}

/// Judgements were looked for only under the properties of the first run.
#[test]
fn a_property_that_only_some_runs_have_is_found_in_these() {
    let folder = tempfile::tempdir().unwrap();
    let writer = History::open(folder.path()).unwrap();
    writer.begin_campaign(&sample_campaign("k", 2)).unwrap();
    let property = sample_run("k", 0).judgements[0][0].property.clone();
    for index in 0..2 {
        let mut run = sample_run("k", index);
        if index == 0 {
            run.judgements[0].retain(|judgement| judgement.property != property);
        }
        writer.commit(&run).unwrap();
    }
    let reader = History::open_to_read(folder.path()).unwrap();
    let newest = NewestJudgements::of(&reader);
    let found = |id: &str| newest.read(id, 1, std::slice::from_ref(&property)).unwrap();
    assert_eq!(found(&sample_run("k", 0).id), []);
    assert_eq!(
        found(&sample_run("k", 1).id)[0].judgement,
        sample_run("k", 1).judgements[0][0]
    );
}
