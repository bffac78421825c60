//! Damage to any file of a history is found or harmless, and readable data is saved.
//!
//! `ACTCHECK_FLIPS` sets the number of flipped bits; `ACTCHECK_DAMAGED` the number of flips and of
//! truncations of each kind of file, of which `ACTCHECK_KIND` chooses one, such as `details`, and
//! `ACTCHECK_SEED` the places.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use actcheck::base::{Outcome, names};
use actcheck::history::{CampaignEnd, History, NewestJudgements, Recheck, RunFilter};

use crate::fuzz_corpus::entrances::frames;
use crate::history::{sample_campaign, sample_run};
use crate::support::planted::Dice;
use crate::support::{actcheck, copy, copy_made_history, stderr, stdout};

/// Time limit of one command: it takes about a second, or is in an endless loop. Unit: seconds.
const MOST_SECS: u64 = 60;

/// Questions whose answers must not change.
const QUESTIONS: [&[&str]; 5] = [
    &["list", "--format", "csv", "--history", "h"],
    &[
        "query",
        "--named",
        "failure-rates",
        "--format",
        "csv",
        "--history",
        "h",
    ],
    &[
        "query",
        "--format",
        "csv",
        "SELECT ?p (COUNT(*) AS ?n) WHERE { ?s ?p ?o } GROUP BY ?p ORDER BY ?p",
        "--history",
        "h",
    ],
    &["analyse", "--format", "json", "--history", "h"],
    &["export", "rdf", "all.ttl", "--history", "h"],
];

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let path = entry.path();
        if path.is_dir() {
            found.extend(files(&path))
        } else {
            found.push(path)
        }
    }
    found.sort();
    found
}

/// Exit code and output of a command; `None` if it took too long.
fn asked(folder: &Path, arguments: &[&str]) -> Option<(Option<i32>, String, String)> {
    let mut child = Command::new(env!("CARGO_BIN_EXE_actcheck"))
        .args(arguments)
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut streams = (child.stdout.take().unwrap(), child.stderr.take().unwrap());
    let output = std::thread::spawn(move || {
        let mut text = String::new();
        streams.0.read_to_string(&mut text).map(|_| text)
    });
    let errors = std::thread::spawn(move || {
        let mut text = String::new();
        streams.1.read_to_string(&mut text).map(|_| text)
    });
    let started = Instant::now();
    let status = loop {
        match child.try_wait().unwrap() {
            Some(status) => break status,
            None if started.elapsed() > Duration::from_secs(MOST_SECS) => {
                child.kill().unwrap();
                child.wait().unwrap();
                return None;
            }
            None => std::thread::sleep(Duration::from_millis(5)),
        }
    };
    Some((
        status.code(),
        output.join().unwrap().unwrap(),
        errors.join().unwrap().unwrap(),
    ))
}

/// The answers to all questions; the export's file is read back.
fn answers(folder: &Path) -> Vec<Option<(Option<i32>, String, String)>> {
    QUESTIONS
        .iter()
        .map(|question| {
            let _ = std::fs::remove_file(folder.join("all.ttl"));
            let mut answer = asked(folder, question)?;
            if let Ok(text) = std::fs::read_to_string(folder.join("all.ttl")) {
                let mut lines: Vec<&str> = text.lines().collect();
                lines.sort_unstable();
                answer.1 = lines.join("\n");
            }
            Some(answer)
        })
        .collect()
}

fn flip(file: &Path, dice: &mut Dice) -> (u64, u64) {
    let mut bytes = std::fs::read(file).unwrap();
    let (at, bit) = (dice.below(bytes.len() as u64), dice.below(8));
    bytes[at as usize] ^= 1 << bit;
    std::fs::write(file, bytes).unwrap();
    (at, bit)
}

/// A copy of the made history in `h`.
fn copied() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    copy_made_history(&folder.path().join("h"));
    folder
}

#[test]
fn an_intact_history_passes_its_examination() {
    let folder = copied();
    let output = actcheck(folder.path(), &["health", "--integrity", "--history", "h"]);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}{}",
        stdout(&output),
        stderr(&output)
    );
    assert_eq!(stdout(&output), "h: 4 runs and mirror are intact\n");
}

/// A history with every kind of file: runs that are kept whole and as outcomes, in campaigns that
/// have ended and in one of a killed process, later judgements, and tables.
fn every_kind(folder: &Path) {
    let dir = folder.join("h");
    copy_made_history(&dir);
    let history = History::open(&dir).unwrap();
    history.begin_campaign(&sample_campaign("o", 1)).unwrap();
    (0..3).for_each(|index| history.commit_outcomes(&sample_run("o", index)).unwrap());
    let end = CampaignEnd {
        ended: "2026-08-01T13:00:00Z".to_owned(),
        ..CampaignEnd::default()
    };
    history.finish_campaign("o", &end).unwrap();
    drop(history);
    let history = History::open(&dir).unwrap();
    history.begin_campaign(&sample_campaign("k", 2)).unwrap();
    (0..3).for_each(|index| history.commit(&sample_run("k", index)).unwrap());
    drop(history);
    let history = History::open(&dir).unwrap();
    judge_again(&history, &["o-1", "o-2", "k-1"]);
    drop(history);
    let made = asked(folder, &["analyse", "--history", "h"]).unwrap();
    assert_eq!(made.0, Some(0), "{}", made.2);
    let kinds: BTreeSet<String> = files(&dir).iter().map(|file| kind_of(file)).collect();
    for kind in [
        "campaign",
        "runs",
        "details",
        "states",
        "motion",
        "judgements",
        "VERSION",
        "parquet",
    ] {
        assert!(kinds.contains(kind), "no {kind} in {kinds:?}");
    }
}

/// Stores a failed outcome of a property of runs, which a later judgement found.
fn judge_again(history: &History, runs: &[&str]) {
    let property = names::act("MovedObject");
    let recheck = |run: &&str| {
        let before = NewestJudgements::of(history)
            .read(run, 1, std::slice::from_ref(&property))
            .unwrap()
            .remove(0);
        let mut now = before.judgement.clone();
        (now.outcome, now.margin) = (Outcome::Failed, Some(-0.25));
        Recheck {
            run: (*run).to_owned(),
            step: 1,
            action: names::act("Pick"),
            before: Some(before),
            now,
        }
    };
    let rechecks: Vec<Recheck> = runs.iter().map(recheck).collect();
    history
        .commit_rechecks(&rechecks, "2026-08-09T00:00:00Z")
        .unwrap();
    history.finish_rechecks().unwrap();
}

/// Questions that are asked after the damage. The tables are deleted before the second analysis,
/// which makes them anew from it.
const ASKED: [&[&str]; 6] = [
    &["list", "--format", "csv", "--history", "h"],
    &["analyse", "--format", "json", "--history", "h"],
    &["analyse", "--format", "json", "--history", "h"],
    &["export", "tables", "out", "--csv", "--history", "h"],
    &["show", "k-2", "--format", "json", "--history", "h"],
    &["show", "o-2", "--format", "json", "--history", "h"],
];

/// The answers; that of an export is its table. `show` is also asked for a run of a simulation.
fn asked_anew(folder: &Path, first: &str, damage: &str) -> Vec<(Option<i32>, String, String)> {
    let _ = std::fs::remove_dir_all(folder.join("out"));
    let show = ["show", first, "--format", "json", "--history", "h"];
    let all = ASKED.into_iter().chain([&show[..]]);
    all.enumerate()
        .map(|(number, question)| {
            if number == 2 {
                let _ = std::fs::remove_dir_all(folder.join("h/tables"));
            }
            let mut answer = asked(folder, question)
                .unwrap_or_else(|| panic!("{damage}: {question:?} does not end"));
            if question.contains(&"--csv") {
                let table =
                    std::fs::read_to_string(folder.join("out/outcomes.csv")).unwrap_or_default();
                let mut lines: Vec<&str> = table.lines().collect();
                lines.sort_unstable();
                answer.1 = lines.join("\n");
            }
            answer
        })
        .collect()
}

/// The kind of a file of a history: its extension, or its name without one.
fn kind_of(file: &Path) -> String {
    let kind = file.extension().or(file.file_name());
    kind.unwrap().to_string_lossy().into_owned()
}

/// One flipped bit in the states of a run, and tables made anew from them, gave other numbers with exit code 0.
#[test]
fn numbers_made_anew_from_damaged_files_are_the_same_or_refused() {
    let number = |name: &str, default| {
        std::env::var(name)
            .ok()
            .and_then(|n| n.parse().ok())
            .unwrap_or(default)
    };
    let (of_kind, only) = (
        number("ACTCHECK_DAMAGED", 0usize),
        std::env::var("ACTCHECK_KIND").ok(),
    );
    let whole = tempfile::tempdir().unwrap();
    every_kind(whole.path());
    let first = runs(&whole.path().join("h"))
        .into_iter()
        .find(|run| !run.starts_with("k-") && !run.starts_with("o-"))
        .unwrap();
    let keep = tempfile::tempdir().unwrap();
    copy(&whole.path().join("h"), &keep.path().join("h"));
    let right = asked_anew(whole.path(), &first, "no damage");
    assert!(right.iter().all(|(code, ..)| *code == Some(0)), "{right:?}");
    let relative = |file: PathBuf| file.strip_prefix(keep.path()).unwrap().to_path_buf();
    let all: Vec<PathBuf> = files(&keep.path().join("h"))
        .into_iter()
        .filter(|file| file.metadata().unwrap().len() > 0)
        .map(relative)
        .collect();
    let mut kinds: Vec<String> = all.iter().map(|file| kind_of(file)).collect();
    kinds.sort();
    kinds.dedup();
    kinds.retain(|kind| only.as_ref().is_none_or(|only| only == kind));
    let mut dice = Dice::new(number("ACTCHECK_SEED", 63) as u64);
    // By default, some kinds are damaged in one way and some in the other.
    let cases: Vec<(usize, bool)> = match of_kind {
        0 => (0..kinds.len())
            .map(|place| (place, place % 2 == 0))
            .collect(),
        many => (0..kinds.len())
            .flat_map(|place| (0..2 * many).map(move |n| (place, n % 2 == 0)))
            .collect(),
    };
    let mut table: BTreeMap<(String, &str, &str), usize> = BTreeMap::new();
    for (place, is_flip) in cases {
        let kind = &kinds[place];
        let folder = tempfile::tempdir().unwrap();
        copy(&keep.path().join("h"), &folder.path().join("h"));
        let of_kind: Vec<&PathBuf> = all.iter().filter(|file| kind_of(file) == *kind).collect();
        let file = folder
            .path()
            .join(of_kind[dice.below(of_kind.len() as u64) as usize]);
        let damage = if is_flip {
            let (at, bit) = flip(&file, &mut dice);
            format!("bit {bit} of byte {at} of {}", file.display())
        } else {
            let length = dice.below(file.metadata().unwrap().len());
            std::fs::File::options()
                .write(true)
                .open(&file)
                .unwrap()
                .set_len(length)
                .unwrap();
            format!("{} cut to {length} bytes", file.display())
        };
        let mut is_noticed = false;
        for (idx, (answer, right)) in asked_anew(folder.path(), &first, &damage)
            .into_iter()
            .zip(&right)
            .enumerate()
        {
            let place = format!("{damage}: {:?}", ASKED.get(idx));
            let (code, output, errors) = answer;
            let code = code.unwrap_or_else(|| panic!("{place}: crashed: {errors}"));
            assert!(
                code <= 2 && !errors.contains("panicked"),
                "{place}: {errors}"
            );
            let same = code == 0 && output == right.1;
            let said = code > 0 || errors.contains("H029");
            assert!(
                same || said,
                "{place}: another answer with exit code 0 and no warning\n{output}\n{}",
                right.1
            );
            is_noticed |= said;
        }
        let result = if is_noticed { "found" } else { "harmless" };
        *table
            .entry((kind.clone(), if is_flip { "flip" } else { "cut" }, result))
            .or_default() += 1;
    }
    for ((kind, way, result), times) in table {
        println!("{kind:24} {way:5} {times:4} {result}");
    }
}

/// No answer after a flipped bit may differ from the right one without an error, take for ever, or
/// come from a crash.
#[test]
fn a_flipped_bit_in_any_file_is_found_or_harmless() {
    let flips: usize = std::env::var("ACTCHECK_FLIPS")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(8);
    let whole = copied();
    let right = answers(whole.path());
    assert!(
        right
            .iter()
            .all(|answer| answer.as_ref().is_some_and(|(code, ..)| *code == Some(0))),
        "{right:?}"
    );
    let mut dice = Dice::new(19);
    let mut table: BTreeMap<(String, &str), usize> = BTreeMap::new();
    for number in 0..flips {
        let folder = copied();
        let all: Vec<PathBuf> = files(&folder.path().join("h"))
            .into_iter()
            .filter(|file| file.metadata().unwrap().len() > 0)
            .collect();
        // Each kind of file comes up as often as the others.
        let mut kinds: Vec<String> = all.iter().map(|file| kind_of(file)).collect();
        kinds.sort();
        kinds.dedup();
        let chosen = &kinds[number % kinds.len()];
        let of_kind: Vec<&PathBuf> = all.iter().filter(|file| kind_of(file) == *chosen).collect();
        let file = of_kind[dice.below(of_kind.len() as u64) as usize];
        let (at, bit) = flip(file, &mut dice);
        let place = format!("bit {bit} of byte {at} of {}", file.display());
        let examined = asked(folder.path(), &["health", "--integrity", "--history", "h"]);
        let (code, told, errors) =
            examined.unwrap_or_else(|| panic!("{place}: the examination does not end"));
        assert!(
            code.is_some_and(|code| code <= 2),
            "{place}: {code:?} {errors}"
        );
        let found = code != Some(0);
        let mut is_same = true;
        for (idx, (answer, right)) in answers(folder.path()).into_iter().zip(&right).enumerate() {
            let place = format!("{place}: {:?}", QUESTIONS[idx]);
            let (code, output, errors) =
                answer.unwrap_or_else(|| panic!("{place}: no answer after {MOST_SECS} s"));
            let code = code.unwrap_or_else(|| panic!("{place}: crashed: {errors}"));
            assert!(
                code <= 2 && !errors.contains("panicked"),
                "{place}: {errors}"
            );
            let same = code == 0 && output == right.as_ref().unwrap().1;
            assert!(
                same || code == 2,
                "{place}: another answer with exit code 0"
            );
            // The states of a run are read by few commands; the examination reads all.
            is_same &= same;
        }
        assert!(is_same || found, "{place}: {told}");
        let result = match (found, is_same) {
            (true, true) => "found, answers unchanged",
            (true, false) => "found, answers refused",
            (false, _) => "harmless",
        };
        *table.entry((chosen.clone(), result)).or_default() += 1;
    }
    for ((kind, result), times) in table {
        println!("{kind:24} {times:4} {result}");
    }
}

/// The ids of all runs.
fn runs(history: &Path) -> Vec<String> {
    let history = History::open_to_read(history).unwrap();
    let rows = history.runs(&RunFilter::default()).unwrap();
    rows.into_iter().map(|row| row.run).collect()
}

/// The files of the only campaign of the made history with an extension.
fn column(history: &Path, extension: &str) -> PathBuf {
    files(&history.join("campaigns"))
        .into_iter()
        .find(|file| file.extension().is_some_and(|own| own == extension))
        .unwrap()
}

/// A file that was restored from a backup under a wrong name showed the outcomes of another run.
#[test]
fn a_file_of_another_campaign_does_not_change_outcomes() {
    let whole = tempfile::tempdir().unwrap();
    let history = History::open(&whole.path().join("h")).unwrap();
    for (campaign, minute, first) in [("a", 1, 0), ("b", 2, 1)] {
        history
            .begin_campaign(&sample_campaign(campaign, minute))
            .unwrap();
        // Each has three runs of equal size; the failed ones are others.
        (0..3).for_each(|index| {
            let mut run = sample_run(campaign, index + first);
            (run.id, run.index) = (format!("{campaign}-{}", index + 1), index);
            history.commit(&run).unwrap();
        });
        history
            .finish_campaign(
                campaign,
                &CampaignEnd {
                    ended: "2026-08-01T13:00:00Z".to_owned(),
                    ..CampaignEnd::default()
                },
            )
            .unwrap();
    }
    drop(history);
    let show = |folder: &Path, run: &str| {
        asked(folder, &["show", run, "--history", "h", "--format", "json"]).unwrap()
    };
    let ids = ["a-1", "a-2", "a-3"];
    let right = ids.map(|run| show(whole.path(), run).1);
    for extension in ["details", "states", "motion"] {
        let folder = tempfile::tempdir().unwrap();
        copy(&whole.path().join("h"), &folder.path().join("h"));
        let [own, other] = ["a", "b"].map(|campaign| {
            folder
                .path()
                .join(format!("h/campaigns/{campaign}/0001.{extension}"))
        });
        assert_ne!(std::fs::read(&own).unwrap(), std::fs::read(&other).unwrap());
        std::fs::copy(&other, &own).unwrap();
        for (run, right) in ids.iter().zip(&right) {
            let (code, shown, said) = show(folder.path(), run);
            assert!(
                shown == *right || code == Some(2) && said.contains("H007"),
                "{extension} {run}: {code:?} {shown}{said}"
            );
        }
        let (code, said, _) =
            asked(folder.path(), &["health", "--integrity", "--history", "h"]).unwrap();
        assert!(
            code == Some(1) && said.contains(&format!("campaigns/a/0001.{extension}")),
            "{extension}: {said}"
        );
    }
}

#[test]
fn a_damaged_mirror_is_written_anew_and_the_numbers_are_the_same() {
    let folder = copied();
    let question = ["analyse", "--format", "json", "--history", "h"];
    let right = actcheck(folder.path(), &question);
    let tables = folder.path().join("h/tables");
    let mirror = || {
        files(&tables)
            .into_iter()
            .find(|file| file.extension().is_some_and(|e| e == "parquet"))
            .unwrap()
    };
    let middle = std::fs::metadata(mirror()).unwrap().len() as usize / 2;
    for examine in [false, true] {
        let mut bytes = std::fs::read(mirror()).unwrap();
        bytes[middle] ^= 1;
        std::fs::write(mirror(), bytes).unwrap();
        if examine {
            let output = actcheck(folder.path(), &["health", "--integrity", "--history", "h"]);
            assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
            assert!(
                stdout(&output).contains("it differs from the runs"),
                "{}",
                stdout(&output)
            );
            assert!(
                stderr(&output).contains("written anew"),
                "{}",
                stderr(&output)
            );
        }
        let output = actcheck(folder.path(), &question);
        assert_eq!(stdout(&output), stdout(&right), "{}", stderr(&output));
        let output = actcheck(folder.path(), &["health", "--integrity", "--history", "h"]);
        assert_eq!(output.status.code(), Some(0), "{}", stdout(&output));
    }
}

/// The listed runs.
fn listed(folder: &Path, history: &str) -> Vec<String> {
    let output = actcheck(folder, &["list", "--format", "csv", "--history", history]);
    let text = stdout(&output);
    text.lines().map(str::to_owned).collect()
}

/// Rows are made again from details.
#[test]
fn a_history_without_a_readable_list_of_runs_is_saved_completely() {
    let folder = copied();
    let right = listed(folder.path(), "h");
    let file = column(&folder.path().join("h"), "runs");
    let mut bytes = std::fs::read(&file).unwrap();
    // In the header of the first frame, so that no frame can be found by the one before it.
    bytes[frames::HEAD] ^= 1;
    std::fs::write(&file, &bytes).unwrap();
    let output = actcheck(folder.path(), &["list", "--history", "h"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr(&output).contains("H007") && stderr(&output).contains("0001.runs"),
        "{}",
        stderr(&output)
    );
    // A process that writes must not touch it: runs would get the numbers of others.
    let opened = History::open_existing(&folder.path().join("h"))
        .and_then(|history| history.runs(&RunFilter::default()).map(drop));
    assert!(opened.is_err());
    assert_eq!(std::fs::read(&file).unwrap(), bytes);
    let output = actcheck(folder.path(), &["merge", "--salvage", "h", "--into", "new"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(listed(folder.path(), "new"), right);
}

#[test]
fn the_runs_that_a_damaged_column_loses_are_named_and_made_again() {
    for extension in ["details", "states"] {
        let folder = copied();
        let right = listed(folder.path(), "h");
        let file = column(&folder.path().join("h"), extension);
        let mut bytes = std::fs::read(&file).unwrap();
        // In the last frame: the first one is needed to read the others.
        let at = bytes.len() - 10;
        bytes[at] ^= 0x10;
        std::fs::write(&file, bytes).unwrap();
        let output = actcheck(folder.path(), &["health", "--integrity", "--history", "h"]);
        assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
        assert!(
            stdout(&output).contains(&*file.file_name().unwrap().to_string_lossy()),
            "{}",
            stdout(&output)
        );
        assert!(
            stderr(&output).contains("merge --salvage"),
            "{}",
            stderr(&output)
        );
        let output = actcheck(folder.path(), &["merge", "--salvage", "h", "--into", "new"]);
        assert!(
            output.status.code().is_some_and(|code| code < 2),
            "{}",
            stderr(&output)
        );
        let saved = runs(&folder.path().join("new"));
        assert_eq!(saved.len(), 3, "{extension}: {}", stderr(&output));
        let lost = runs(&folder.path().join("h"));
        let lost = lost.iter().find(|run| !saved.contains(run)).unwrap();
        assert!(
            stderr(&output).contains(lost),
            "{lost}: {}",
            stderr(&output)
        );
        let config = crate::support::root()
            .join("configs/quick.toml")
            .display()
            .to_string();
        let resumed = actcheck(
            folder.path(),
            &[
                "run",
                &config,
                "--resume",
                "--history",
                "new",
                "--jobs",
                "1",
            ],
        );
        let resumed = stderr(&resumed);
        assert_eq!(runs(&folder.path().join("new")).len(), 4, "{resumed}");
        assert_eq!(listed(folder.path(), "new"), right, "{extension}");
    }
}

/// A run without its motion has all outcomes; the motion comes back when it is simulated again.
#[test]
fn a_run_whose_motion_is_damaged_is_saved_as_outcomes() {
    let folder = copied();
    let right = listed(folder.path(), "h");
    let file = column(&folder.path().join("h"), "motion");
    let mut bytes = std::fs::read(&file).unwrap();
    let at = bytes.len() - 10;
    bytes[at] ^= 0x10;
    std::fs::write(&file, bytes).unwrap();
    assert_eq!(listed(folder.path(), "h"), right);
    let output = actcheck(folder.path(), &["health", "--integrity", "--history", "h"]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(
        stdout(&output).contains("0001.motion"),
        "{}",
        stdout(&output)
    );
    let output = actcheck(folder.path(), &["merge", "--salvage", "h", "--into", "new"]);
    assert!(
        output.status.code().is_some_and(|code| code < 2),
        "{}",
        stderr(&output)
    );
    assert_eq!(listed(folder.path(), "new"), right);
    let saved = History::open_to_read(&folder.path().join("new")).unwrap();
    let ids = runs(&folder.path().join("new"));
    let whole = ids
        .iter()
        .filter(|run| saved.is_whole(run).unwrap())
        .count();
    assert_eq!(whole, 3);
    assert!(
        History::examine(&folder.path().join("new"))
            .unwrap()
            .0
            .damage
            .is_empty()
    );
}

/// A campaign's end says how many runs each segment has: without it, a file that lost its last
/// frames would look like one with fewer runs.
#[test]
fn runs_that_are_missing_after_the_end_of_a_campaign_are_reported() {
    let keep = copied();
    let file = column(&keep.path().join("h"), "runs");
    let bytes = std::fs::read(&file).unwrap();
    let ends = frames::ends(&bytes);
    assert_eq!(ends.last(), Some(&bytes.len()));
    // Fewer frames, within a frame, no frame, an empty file, and none.
    let lengths = [ends[2], ends[0], ends[3] - 1, frames::HEAD, 3, 0];
    for length in lengths.into_iter().map(Some).chain([None]) {
        match length {
            Some(length) => std::fs::write(&file, &bytes[..length]).unwrap(),
            None => std::fs::remove_file(&file).unwrap(),
        }
        let output = actcheck(keep.path(), &["list", "--history", "h"]);
        assert_eq!(
            output.status.code(),
            Some(2),
            "{length:?}: {}",
            stdout(&output)
        );
        assert!(stderr(&output).contains("H007"), "{}", stderr(&output));
        let output = actcheck(keep.path(), &["health", "--integrity", "--history", "h"]);
        assert!(
            output.status.code() == Some(1) && stdout(&output).contains("0001.runs"),
            "{length:?}: {}{}",
            stdout(&output),
            stderr(&output)
        );
    }
    let output = actcheck(keep.path(), &["merge", "--salvage", "h", "--into", "new"]);
    assert!(
        output.status.code().is_some_and(|code| code < 2),
        "{}",
        stderr(&output)
    );
    std::fs::write(&file, &bytes).unwrap();
    assert_eq!(listed(keep.path(), "new"), listed(keep.path(), "h"));
}

/// Runs a test on a file system with little space, which is removed afterwards.
fn on_small_disk(megabytes: u32, test: impl FnOnce(&Path) + std::panic::UnwindSafe) {
    let folder = tempfile::tempdir().unwrap();
    let (path, size) = (
        folder.path().display().to_string(),
        format!("size={megabytes}m"),
    );
    let mounted = Command::new("mount")
        .args(["-t", "tmpfs", "-o", &size, "tmpfs", &path])
        .status();
    if !mounted.is_ok_and(|status| status.success()) {
        crate::support::foreign::left_out(
            "a test on a small file system",
            "it can't be mounted here",
        );
        return;
    }
    let outcome = std::panic::catch_unwind(|| test(folder.path()));
    assert!(
        Command::new("umount")
            .arg(&path)
            .status()
            .unwrap()
            .success()
    );
    if let Err(panic) = outcome {
        std::panic::resume_unwind(panic);
    }
}

/// An export to a full disk left half a file under the final name, which other programs took for
/// the whole one.
#[test]
fn an_export_to_a_full_disk_leaves_no_partial_file() {
    let folder = copied();
    let history = folder.path().join("h").display().to_string();
    let exports: [&[&str]; 7] = [
        &["export", "rdf", "out.nq"],
        &["export", "rdf", "out.nq", "--complete"],
        &["export", "rdf", "out.ttl"],
        &["export", "tables", "out", "--csv"],
        &["export", "tables", "out"],
        &["export", "tables", "out", "--dataset"],
        &["report", "--html", "out"],
    ];
    on_small_disk(1, |disk| {
        for export in exports {
            // 20 kB are left: less than each of these takes.
            std::fs::write(disk.join("ballast"), vec![1; (1 << 20) - 20_480]).unwrap();
            let output = actcheck(disk, &[export, &["--history", &history]].concat());
            assert_eq!(
                output.status.code(),
                Some(2),
                "{export:?}: {}",
                stdout(&output)
            );
            let left: Vec<PathBuf> = files(disk)
                .into_iter()
                .filter(|file| file.file_name().unwrap() != "ballast")
                .collect();
            assert!(left.is_empty(), "{export:?}: {left:?}");
            let _ = std::fs::remove_dir_all(disk.join("out"));
        }
        // The old file is kept.
        std::fs::remove_file(disk.join("ballast")).unwrap();
        std::fs::write(disk.join("out.nq"), "old").unwrap();
        std::fs::write(disk.join("ballast"), vec![1; (1 << 20) - 24_576]).unwrap();
        let output = actcheck(disk, &["export", "rdf", "out.nq", "--history", &history]);
        assert_eq!(output.status.code(), Some(2), "{}", stdout(&output));
        assert_eq!(std::fs::read(disk.join("out.nq")).unwrap(), b"old");
    });
}
