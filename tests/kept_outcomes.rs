//! Runs that are kept as outcomes: every command answers as if they were kept whole, and their
//! motion comes back bit for bit.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use actcheck::history::{CampaignEnd, History, RunFilter, RunRecord};
use tempfile::TempDir;

use crate::fuzz_corpus::entrances::frames;
use crate::history::{left_by_a_kill, run_ids, sample_campaign, sample_run};
use crate::support::exported::{Exported, statements};
use crate::support::{actcheck, edit, project, stderr, stdout};

const RUNS: u64 = 140;

/// Two histories with the same runs: kept whole, and as outcomes. `ended`: whether the campaign has
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
        make("outcomes", &|history, run| {
            history.commit_outcomes(run).unwrap()
        }),
    ]
}

fn vitals(history: &History) -> Vec<String> {
    let mut all = Vec::new();
    history
        .each_vitals("k", |run| all.push(format!("{run:?}")))
        .unwrap();
    all
}

fn assert_equal(whole: &History, outcomes: &History) {
    let all = RunFilter::default();
    let rows = whole.runs(&all).unwrap();
    assert_eq!(rows.len(), RUNS as usize);
    assert_eq!(outcomes.runs(&all).unwrap(), rows);
    assert_eq!(outcomes.campaigns().unwrap(), whole.campaigns().unwrap());
    assert_eq!(outcomes.run_ids().unwrap(), whole.run_ids().unwrap());
    assert_eq!(
        outcomes.outcomes(&all).unwrap(),
        whole.outcomes(&all).unwrap()
    );
    assert_eq!(
        outcomes.newest_outcomes(&all).unwrap(),
        whole.newest_outcomes(&all).unwrap()
    );
    assert_eq!(
        outcomes.counted_runs().unwrap(),
        whole.counted_runs().unwrap()
    );
    assert_eq!(
        outcomes.scenes(&rows).unwrap(),
        whole.scenes(&rows).unwrap()
    );
    assert_eq!(vitals(outcomes), vitals(whole));
    for run in ["k-1", "k-128", "k-129", "k-140", "@last", "@last-failed"] {
        assert_eq!(
            outcomes.newest_run(run).unwrap(),
            whole.newest_run(run).unwrap(),
            "{run}"
        );
        assert_eq!(
            outcomes.traces().recorded(run).unwrap(),
            whole.traces().recorded(run).unwrap(),
            "{run}"
        );
        assert_eq!(
            outcomes.traces().choices(run).unwrap(),
            whole.traces().choices(run).unwrap(),
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
        assert_eq!((of(outcomes), of(whole)), ("H008", "H008"));
    }
}

/// The names of the files of a folder, sorted.
fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn runs_kept_as_outcomes_answer_as_whole_runs_do() {
    for ended in [false, true] {
        let folder = tempfile::tempdir().unwrap();
        let [whole, outcomes] = both(folder.path(), ended);
        assert_eq!(
            std::fs::read_to_string(outcomes.join("VERSION")).unwrap(),
            "actcheck history 7\n"
        );
        assert!(whole.join("campaigns/k/0001.motion").exists());
        assert_eq!(
            names(&outcomes.join("campaigns/k")),
            ["0001.details", "0001.runs", "0001.states", "campaign"]
        );
        // Readers, and owners.
        assert_equal(
            &History::open_to_read(&whole).unwrap(),
            &History::open_to_read(&outcomes).unwrap(),
        );
        let [whole, outcomes] = [whole, outcomes].map(|dir| History::open_existing(&dir).unwrap());
        assert_equal(&whole, &outcomes);
        assert_eq!(statements(&outcomes), statements(&whole));
        let fault = outcomes.traces().whole("k-1").unwrap_err();
        assert_eq!(fault.iter().next().unwrap().code, "H031");
    }
}

#[test]
fn queries_see_kept_outcomes_and_their_facts() {
    let folder = tempfile::tempdir().unwrap();
    let [whole, outcomes] =
        both(folder.path(), true).map(|dir| History::open_to_read(&dir).unwrap());
    let exported = Exported::of(&outcomes);
    for query in [
        "SELECT ?run ?score { ?run a act:Run ; act:score ?score } ORDER BY ?run",
        "SELECT ?p ?o (COUNT(*) AS ?n) { ?a earl:test ?p ; earl:result/act:outcome ?o } GROUP BY ?p ?o ORDER BY ?p ?o",
        "SELECT ?t ?s (COUNT(*) AS ?n) { GRAPH ?g { ?t w:restsOn ?s } } GROUP BY ?t ?s ORDER BY ?t ?s",
        "SELECT (COUNT(DISTINCT ?g) AS ?n) { GRAPH ?g {} }",
        "SELECT (SUM(IF(act:counts(?run), 1, 0)) AS ?n) { ?run a act:Run }",
        "ASK { <https://w3id.org/actcheck/run/k-120> act:score ?s }",
    ] {
        let answers =
            [&outcomes, &whole].map(|history| format!("{:?}", history.query(query).unwrap()));
        assert_eq!(answers[0], answers[1], "{query}");
        assert_eq!(
            answers[0],
            format!("{:?}", exported.query(query)),
            "{query}"
        );
    }
    // Statements that queries made are not counted twice.
    assert_eq!(
        outcomes.runs(&RunFilter::default()).unwrap().len(),
        RUNS as usize
    );
}

/// A history of runs kept as outcomes in the state in which a killed process left it.
fn killed(runs: u64) -> (TempDir, PathBuf) {
    left_by_a_kill(runs, |history, run| history.commit_outcomes(run).unwrap())
}

fn ids(dir: &Path) -> Vec<String> {
    run_ids(&History::open_to_read(dir).unwrap())
}

#[test]
fn a_kill_at_any_moment_loses_no_outcome_and_has_none_twice() {
    for runs in [1, 127, 130] {
        let (_folder, left) = killed(runs);
        let wanted: Vec<String> = (1..=runs).map(|number| format!("k-{number}")).collect();
        assert_eq!(ids(&left), wanted);
        // It was killed while it wrote another run: its states are complete, its details half.
        let campaign = left.join("campaigns/k");
        for (extension, is_half) in [("states", false), ("details", true)] {
            let file = campaign.join("0001").with_extension(extension);
            let whole = std::fs::read(&file).unwrap();
            let mut contents = frames::contents(&whole);
            contents.push(contents[contents.len() - 1]);
            let mut written = frames::file(&whole, &contents);
            let added = written.len() - whole.len();
            written.truncate(written.len() - if is_half { added / 2 } else { 0 });
            std::fs::write(&file, written).unwrap();
        }
        assert_eq!(ids(&left), wanted);
        // So was the next process, in a segment of its own.
        let history = History::open_existing(&left).unwrap();
        history.commit_outcomes(&sample_run("k", runs)).unwrap();
        drop(history);
        assert_eq!(ids(&left).len() as u64, runs + 1);
        let runs_file = campaign.join("0002.runs");
        let whole = std::fs::read(&runs_file).unwrap();
        std::fs::write(&runs_file, &whole[..whole.len() - 1]).unwrap();
        assert_eq!(ids(&left), wanted);
        let history = History::open_existing(&left).unwrap();
        history.commit_outcomes(&sample_run("k", runs)).unwrap();
        let end = CampaignEnd {
            ended: "2026-08-01T13:00:00Z".to_owned(),
            ..CampaignEnd::default()
        };
        history.finish_campaign("k", &end).unwrap();
        drop(history);
        // A campaign that is continued.
        let history = History::open_existing(&left).unwrap();
        history.reopen_campaign("k").unwrap();
        history.commit_outcomes(&sample_run("k", runs + 1)).unwrap();
        history.finish_campaign("k", &end).unwrap();
        drop(history);
        let (found, history) = History::examine(&left).unwrap();
        assert_eq!((found.damage, found.runs as u64), (Vec::new(), runs + 2));
        assert!(history.tail_warning().unwrap().is_none());
        let row = &history.campaigns().unwrap()[0];
        assert_eq!((row.runs, row.interrupted), (runs + 2, false));
        let again: Vec<String> = (1..=runs + 2).map(|number| format!("k-{number}")).collect();
        assert_eq!(ids(&left), again);
        assert_eq!(History::count_runs(&left), runs + 2);
    }
}

#[test]
fn every_damaged_column_of_outcomes_is_named() {
    let (_folder, left) = killed(130);
    for extension in ["runs", "details", "states"] {
        let name = Path::new("campaigns/k/0001").with_extension(extension);
        let file = left.join(&name);
        let whole = std::fs::read(&file).unwrap();
        for at in (0..whole.len())
            .step_by(whole.len() / 60 + 1)
            .chain([whole.len() - 1])
        {
            let mut bytes = whole.clone();
            bytes[at] ^= 4;
            std::fs::write(&file, &bytes).unwrap();
            let (found, history) = History::examine(&left).unwrap();
            let named: BTreeSet<&Path> = found
                .damage
                .iter()
                .map(|damage| damage.file.as_path())
                .collect();
            assert_eq!(
                named,
                BTreeSet::from([name.as_path()]),
                "byte {at} of {}",
                name.display()
            );
            // Reading either does not need the damaged part, or reports it.
            for run in [1, 70, 130] {
                let read = || {
                    history
                        .runs(&RunFilter::default())
                        .and_then(|_| history.traces().recorded(&format!("k-{run}")))
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
        }
        // A file that has lost more than the run that a killed process was writing.
        for length in [0, 7, 43, 44, whole.len() / 2] {
            std::fs::write(&file, &whole[..length]).unwrap();
            let (found, _) = History::examine(&left).unwrap();
            assert!(
                found.damage.iter().any(|damage| damage.file == name),
                "{length}: {found:?}"
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
fn the_motion_of_kept_outcomes_comes_back_bit_for_bit() {
    let project = project();
    let folder = project.path();
    keep(folder, "outcomes", "keep = \"outcomes\"");
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
    for name in ["pick", "outcomes", "some"] {
        run(name);
    }
    let listed = |name: &str| without_ids(&printed(folder, &["list", "--format", "csv"], name));
    assert_eq!(listed("outcomes"), listed("pick"));
    assert_eq!(listed("some"), listed("pick"));
    let [whole, outcomes, some] =
        ["pick", "outcomes", "some"].map(|name| History::open_to_read(&folder.join(name)).unwrap());
    let rows = |history: &History| history.runs(&RunFilter::default()).unwrap();
    let is_whole = |history: &History| -> Vec<bool> {
        rows(history)
            .iter()
            .map(|row| history.is_whole(&row.run).unwrap())
            .collect()
    };
    assert_eq!(is_whole(&whole), [true; 6]);
    assert_eq!(is_whole(&outcomes), [false; 6]);
    let kept = is_whole(&some);
    assert!(kept.contains(&true) && kept.contains(&false), "{kept:?}");
    for (row, is_whole) in rows(&some).iter().zip(kept) {
        assert!(is_whole || row.score == 1.0, "{row:?}");
    }
    // Quantities over time are not kept with outcomes, so all runs are simulated again.
    let recheck = [
        "recheck",
        "HeldWhileLifted",
        "--ontology",
        "ontology/time.ttl",
        "--format",
        "csv",
    ];
    let rechecked = |name: &str| without_ids(&printed(folder, &recheck, name));
    assert_eq!(rechecked("outcomes"), rechecked("pick"));
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
    assert_eq!(judged("outcomes"), judged("pick"));
    let replayed = printed(folder, &["replay", "@last"], "outcomes");
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
    let output = actcheck(folder, &[&recheck[..], &["--history", "outcomes"]].concat());
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
