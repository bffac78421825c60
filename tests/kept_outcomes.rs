//! Runs that are kept as outlines: every command answers as if they were kept whole, and their
//! motion comes back bit for bit.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use actcheck::history::{CampaignEnd, History, RunFilter, RunRecord};
use tempfile::TempDir;

use crate::history::{sample_campaign, sample_run};
use crate::support::{actcheck, copy, copy_open, edit, project, stderr, stdout};

/// A file of many runs, and some single ones.
const RUNS: u64 = 140;

/// Two histories with the same runs: kept whole, and as outlines. `ended`: whether the campaign has
/// its end.
fn both(folder: &Path, ended: bool) -> [PathBuf; 2] {
    let make = |name: &str, commit: &dyn Fn(&History, &RunRecord)| {
        let dir = folder.join(name);
        let history = History::open(&dir).unwrap();
        history.begin_campaign(&sample_campaign("k", 0)).unwrap();
        (0..RUNS).for_each(|index| commit(&history, &sample_run("k", index)));
        if ended {
            let ended = "2026-08-01T13:00:00Z".to_owned();
            history
                .finish_campaign(
                    "k",
                    &CampaignEnd {
                        ended,
                        ..CampaignEnd::default()
                    },
                )
                .unwrap();
        }
        dir
    };
    [
        make("whole", &|history, run| history.commit(run).unwrap()),
        make("outlines", &|history, run| {
            history.commit_outline(run).unwrap()
        }),
    ]
}

fn statements(history: &History) -> BTreeSet<String> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("all.nq");
    history.write_nquads(&file).unwrap();
    std::fs::read_to_string(file)
        .unwrap()
        .lines()
        .map(str::to_owned)
        .collect()
}

fn vitals(history: &History) -> Vec<String> {
    let mut all = Vec::new();
    history
        .each_vitals("k", |run| all.push(format!("{run:?}")))
        .unwrap();
    all
}

fn assert_equal(whole: &History, outlines: &History) {
    let all = RunFilter::default();
    let rows = whole.runs(&all).unwrap();
    assert_eq!(rows.len(), RUNS as usize);
    assert_eq!(outlines.runs(&all).unwrap(), rows);
    assert_eq!(outlines.campaigns().unwrap(), whole.campaigns().unwrap());
    assert_eq!(outlines.run_ids().unwrap(), whole.run_ids().unwrap());
    assert_eq!(
        outlines.outcomes(&all).unwrap(),
        whole.outcomes(&all).unwrap()
    );
    assert_eq!(
        outlines.newest_outcomes(&all).unwrap(),
        whole.newest_outcomes(&all).unwrap()
    );
    assert_eq!(
        outlines.counted_runs().unwrap(),
        whole.counted_runs().unwrap()
    );
    assert_eq!(
        outlines.scenes(&rows).unwrap(),
        whole.scenes(&rows).unwrap()
    );
    assert_eq!(vitals(outlines), vitals(whole));
    for run in ["k-1", "k-128", "k-129", "k-140", "@last", "@last-failed"] {
        assert_eq!(
            outlines.newest_run(run).unwrap(),
            whole.newest_run(run).unwrap(),
            "{run}"
        );
        assert_eq!(
            outlines.recorded(run).unwrap(),
            whole.recorded(run).unwrap(),
            "{run}"
        );
        assert_eq!(
            outlines.choices(run).unwrap(),
            whole.choices(run).unwrap(),
            "{run}"
        );
    }
    for missing in ["k-141", "k-0", "x-1"] {
        let of = |history: &History| {
            history
                .run(missing)
                .unwrap_err()
                .iter()
                .next()
                .unwrap()
                .code
        };
        assert_eq!((of(outlines), of(whole)), ("H008", "H008"));
    }
}

#[test]
fn outlines_answer_as_whole_runs_do() {
    for ended in [false, true] {
        let folder = tempfile::tempdir().unwrap();
        let [whole, outlines] = both(folder.path(), ended);
        assert_eq!(
            std::fs::read_to_string(outlines.join("VERSION")).unwrap(),
            "actcheck history 4\n"
        );
        let files = std::fs::read_dir(outlines.join("outlines"))
            .unwrap()
            .count();
        assert_eq!(files, if ended { 2 } else { 1 + (RUNS as usize - 128) });
        assert_eq!(
            std::fs::read_dir(outlines.join("traces")).unwrap().count(),
            0
        );
        // Readers, and owners.
        assert_equal(
            &History::open_to_read(&whole).unwrap(),
            &History::open_to_read(&outlines).unwrap(),
        );
        let [whole, outlines] = [whole, outlines].map(|dir| History::open_existing(&dir).unwrap());
        assert_equal(&whole, &outlines);
        assert_eq!(statements(&outlines), statements(&whole));
        let fault = outlines.trace("k-1").unwrap_err();
        assert_eq!(fault.iter().next().unwrap().code, "H031");
    }
}

#[test]
fn queries_see_outlines_and_their_facts() {
    let folder = tempfile::tempdir().unwrap();
    let [whole, outlines] =
        both(folder.path(), true).map(|dir| History::open_to_read(&dir).unwrap());
    for query in [
        "SELECT ?run ?score { ?run a act:Run ; act:score ?score } ORDER BY ?run",
        "SELECT ?p ?o (COUNT(*) AS ?n) { ?a earl:test ?p ; earl:result/act:outcome ?o } GROUP BY ?p ?o ORDER BY ?p ?o",
        "SELECT ?t ?s (COUNT(*) AS ?n) { GRAPH ?g { ?t w:restsOn ?s } } GROUP BY ?t ?s ORDER BY ?t ?s",
        "SELECT (COUNT(DISTINCT ?g) AS ?n) { GRAPH ?g {} }",
        "SELECT (SUM(IF(act:counts(?run), 1, 0)) AS ?n) { ?run a act:Run }",
        "ASK { <https://w3id.org/actcheck/run/k-120> act:score ?s }",
    ] {
        let answers =
            [&outlines, &whole].map(|history| format!("{:?}", history.query(query).unwrap()));
        assert_eq!(answers[0], answers[1], "{query}");
    }
    // Statements that queries loaded are not counted twice.
    assert_eq!(
        outlines.runs(&RunFilter::default()).unwrap().len(),
        RUNS as usize
    );
}

/// A history of outlines in the state in which a killed process left it.
fn killed(runs: u64) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let (live, left) = (folder.path().join("live"), folder.path().join("left"));
    let history = History::open(&live).unwrap();
    history.begin_campaign(&sample_campaign("k", 0)).unwrap();
    (0..runs).for_each(|index| history.commit_outline(&sample_run("k", index)).unwrap());
    copy_open(&live, &left);
    (folder, left)
}

fn ids(dir: &Path) -> Vec<String> {
    let history = History::open_to_read(dir).unwrap();
    history
        .runs(&RunFilter::default())
        .unwrap()
        .into_iter()
        .map(|run| run.run)
        .collect()
}

#[test]
fn a_kill_at_any_moment_loses_no_outline_and_has_none_twice() {
    for runs in [1, 127, 130] {
        let (_folder, left) = killed(runs);
        let wanted: Vec<String> = (1..=runs).map(|number| format!("k-{number}")).collect();
        assert_eq!(ids(&left), wanted);
        // It was killed while it put files together: after it wrote the large one, and removed some
        // of the single ones.
        let shelf = left.join("outlines");
        let singles = |shelf: &Path| -> Vec<PathBuf> {
            let files = std::fs::read_dir(shelf)
                .unwrap()
                .map(|entry| entry.unwrap().path());
            files
                .filter(|file| file.extension().is_some_and(|ending| ending == "outline"))
                .collect()
        };
        let before = tempfile::tempdir().unwrap();
        copy(&shelf, before.path());
        std::fs::write(shelf.join("k-9.outline.1-1.tmp"), "half").unwrap();
        let end = CampaignEnd {
            ended: "2026-08-01T13:00:00Z".to_owned(),
            ..CampaignEnd::default()
        };
        History::open_existing(&left)
            .unwrap()
            .finish_campaign("k", &end)
            .unwrap();
        assert!(singles(&shelf).is_empty());
        for file in singles(before.path()).iter().step_by(2) {
            std::fs::copy(file, shelf.join(file.file_name().unwrap())).unwrap();
        }
        assert_eq!(ids(&left), wanted);
        let history = History::open_existing(&left).unwrap();
        history.reopen_campaign("k").unwrap();
        assert!(!shelf.join("k-9.outline.1-1.tmp").exists());
        history.commit_outline(&sample_run("k", runs)).unwrap();
        history.finish_campaign("k", &end).unwrap();
        assert!(singles(&shelf).is_empty());
        drop(history);
        assert_eq!(ids(&left).len() as u64, runs + 1);
        assert_eq!(
            History::open_to_read(&left).unwrap().campaigns().unwrap()[0].runs,
            runs + 1
        );
    }
}

#[test]
fn every_damaged_file_of_outlines_is_named() {
    let (_folder, left) = killed(130);
    let shelf = left.join("outlines");
    for name in ["k.000000000-000000127.outlines", "k-130.outline"] {
        let file = shelf.join(name);
        let whole = std::fs::read(&file).unwrap();
        for at in (0..whole.len())
            .step_by(whole.len() / 60 + 1)
            .chain([whole.len() - 1])
        {
            let mut bytes = whole.clone();
            bytes[at] ^= 4;
            std::fs::write(&file, &bytes).unwrap();
            let (found, history) = History::examine(&left).unwrap();
            let named: Vec<&Path> = found
                .damage
                .iter()
                .map(|damage| damage.file.as_path())
                .collect();
            assert_eq!(named, [Path::new("outlines").join(name)], "byte {at}");
            // Reading either does not need the damaged part, or reports it.
            let read = || {
                history
                    .runs(&RunFilter::default())
                    .and_then(|_| history.recorded("k-1"))
            };
            if let Err(faults) = read() {
                assert!(
                    faults
                        .iter()
                        .all(|fault| fault.code == "H007" || fault.code == "H008"),
                    "{faults}"
                );
            }
        }
        for length in [0, 7, 43, 44, whole.len() / 2] {
            std::fs::write(&file, &whole[..length]).unwrap();
            assert_eq!(
                History::examine(&left).unwrap().0.damage.len(),
                1,
                "{length}"
            );
        }
        std::fs::write(&file, &whole).unwrap();
    }
    assert!(History::examine(&left).unwrap().0.damage.is_empty());
}

fn keep(folder: &Path, name: &str, lines: &str) {
    let text = std::fs::read_to_string(folder.join("configs/pick.toml")).unwrap();
    std::fs::write(
        folder.join(format!("configs/{name}.toml")),
        format!("{text}\n[history]\n{lines}\n"),
    )
    .unwrap();
}

fn printed(folder: &Path, args: &[&str], history: &str) -> String {
    let output = actcheck(folder, &[args, &["--history", history]].concat());
    assert!(
        matches!(output.status.code(), Some(0 | 1)),
        "{}",
        stderr(&output)
    );
    stdout(&output)
}

/// Lines without the ids of campaigns, which depend on the configuration's text.
fn without_ids(text: &str) -> Vec<String> {
    text.lines()
        .map(|line| {
            line.split_once('-')
                .map_or(line, |(_, rest)| rest)
                .to_owned()
        })
        .collect()
}

#[test]
fn the_motion_of_outlines_comes_back_bit_for_bit() {
    let project = project();
    let folder = project.path();
    keep(folder, "outlines", "keep = \"outcomes\"");
    keep(folder, "some", "keep = \"failures\"\nkeep_whole = 0.3");
    let run = |name: &str| {
        printed(
            folder,
            &[
                "run",
                &format!("configs/{name}.toml"),
                "--runs",
                "6",
                "--seed",
                "5",
            ],
            name,
        )
    };
    for name in ["pick", "outlines", "some"] {
        run(name);
    }
    let listed = |name: &str| without_ids(&printed(folder, &["list", "--format", "csv"], name));
    assert_eq!(listed("outlines"), listed("pick"));
    assert_eq!(listed("some"), listed("pick"));
    let [whole, outlines, some] =
        ["pick", "outlines", "some"].map(|name| History::open_to_read(&folder.join(name)).unwrap());
    let rows = |history: &History| history.runs(&RunFilter::default()).unwrap();
    let is_outline = |history: &History| -> Vec<bool> {
        rows(history)
            .iter()
            .map(|row| history.is_outline(&row.run).unwrap())
            .collect()
    };
    assert_eq!(is_outline(&whole), [false; 6]);
    assert_eq!(is_outline(&outlines), [true; 6]);
    let kept = is_outline(&some);
    assert!(kept.contains(&true) && kept.contains(&false), "{kept:?}");
    for (row, is_outline) in rows(&some).iter().zip(kept) {
        assert!(!is_outline || row.score == 1.0, "{row:?}");
    }
    // Quantities over time are not in outlines, so all runs are simulated again.
    let recheck = [
        "recheck",
        "HeldWhileLifted",
        "--ontology",
        "ontology/time.ttl",
        "--format",
        "csv",
    ];
    let rechecked = |name: &str| without_ids(&printed(folder, &recheck, name));
    assert_eq!(rechecked("outlines"), rechecked("pick"));
    let judged = |name: &str| {
        let history = History::open_to_read(&folder.join(name)).unwrap();
        let rows = history.newest_outcomes(&RunFilter::default()).unwrap().rows;
        rows.into_iter()
            .map(|row| {
                (
                    row.index,
                    row.property,
                    row.outcome,
                    row.margin.map(f64::to_bits),
                )
            })
            .collect::<Vec<_>>()
    };
    assert_eq!(judged("outlines"), judged("pick"));
    let replayed = printed(folder, &["replay", "@last"], "outlines");
    assert!(
        replayed.contains("the same, every bit of every state"),
        "{replayed}"
    );
    // A changed model changes the run: nothing is made up.
    edit(
        &folder.join("models/objects/glass.toml"),
        "mass_kg = 0.",
        "mass_kg = 1.",
    );
    let output = actcheck(folder, &[&recheck[..], &["--history", "outlines"]].concat());
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("H031"), "{}", stderr(&output));
}

#[test]
fn a_misspelt_way_to_keep_runs_is_reported() {
    let project = project();
    let folder = project.path();
    keep(folder, "wrong", "keep = \"outcome\"\nkeep_whole = 1.5");
    let output = actcheck(folder, &["check", "configs/wrong.toml"]);
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        text.contains("C017") && text.contains("did you mean `outcomes`?") && text.contains("1.5"),
        "{text}"
    );
}
