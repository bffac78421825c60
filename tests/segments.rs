//! The segments of a history: runs in them can be read at once, survive a kill, take few bytes, and
//! are saved when others are damaged.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use actcheck::base::Term;
use actcheck::history::merge::{MergeOptions, carry_out, plan};
use actcheck::history::{CampaignEnd, History, QueryAnswer, RunFilter, RunStatus};
use tempfile::TempDir;

use crate::facts::sample_trace;
use crate::fuzz_corpus::entrances::frames;
use crate::history::{left_by_a_kill, run_ids, sample_campaign, sample_run};
use crate::support::exported::{Exported, statements};
use crate::support::{actcheck, copy, stderr, stdout};

/// The columns of a segment in which every run has a frame.
const COLUMNS: [&str; 4] = ["runs", "details", "states", "motion"];

/// A history of runs that are kept whole in the state in which a killed process left it.
fn killed(runs: u64) -> (TempDir, PathBuf) {
    left_by_a_kill(runs, |history, run| history.commit(run).unwrap())
}

fn end() -> CampaignEnd {
    CampaignEnd {
        ended: "2026-08-01T13:00:00Z".to_owned(),
        ..CampaignEnd::default()
    }
}

/// A column of the first segment of the campaign `k`.
fn column(history: &Path, extension: &str) -> PathBuf {
    history.join("campaigns/k/0001").with_extension(extension)
}

/// The ids of the first runs of the campaign `k`.
fn first(count: usize) -> Vec<String> {
    (1..=count).map(|number| format!("k-{number}")).collect()
}

fn is_warned(history: &History) -> bool {
    let warning = history.tail_warning().unwrap();
    assert!(
        warning
            .as_ref()
            .is_none_or(|warning| warning.code == "H029")
    );
    warning.is_some()
}

/// The content of every file of the campaign `k`.
fn contents(history: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let entries = std::fs::read_dir(history.join("campaigns/k")).unwrap();
    let paths = entries.map(|entry| entry.unwrap().path());
    paths
        .map(|path| (path.clone(), std::fs::read(&path).unwrap()))
        .collect()
}

/// Adds frames to a column, which repeat its last one, and leaves off some bytes at the end.
fn add_frames(file: &Path, count: usize, missing: usize) {
    let whole = std::fs::read(file).unwrap();
    let mut contents = frames::contents(&whole);
    let last = *contents.last().unwrap();
    contents.extend(vec![last; count]);
    let written = frames::file(&whole, &contents);
    assert!(written.starts_with(&whole));
    std::fs::write(file, &written[..written.len() - missing]).unwrap();
}

/// Otherwise the tests of other contents would test damage.
#[test]
fn the_program_and_the_tests_agree_on_the_form_of_frames() {
    let (_folder, left) = killed(3);
    for extension in COLUMNS {
        let bytes = std::fs::read(column(&left, extension)).unwrap();
        let contents = frames::contents(&bytes);
        assert_eq!(contents.len(), 3, "{extension}");
        assert_eq!(&bytes[..6], b"actseg", "{extension}");
        assert!(bytes == frames::file(&bytes, &contents), "{extension}");
        let rows = std::fs::read(column(&left, "runs")).unwrap();
        if extension != "runs" {
            // Each run has the place of its frame.
            let other = frames::file(&bytes, &[b"other"; 3]);
            let repointed = frames::repointed(&rows, &bytes, &other);
            let (own, new) = (frames::contents(&rows), frames::contents(&repointed));
            assert!(own.len() == 3 && own.iter().zip(new).all(|(own, new)| *own != new));
            assert!(frames::repointed(&repointed, &other, &bytes) == rows);
        }
    }
    let campaign = std::fs::read(left.join("campaigns/k/campaign")).unwrap();
    assert!(campaign == frames::file(&campaign, &frames::contents(&campaign)));
}

#[test]
fn the_next_owner_has_the_runs_of_a_killed_one_and_writes_a_segment_of_its_own() {
    let (_folder, left) = killed(3);
    let before = statements(&History::open_to_read(&left).unwrap());
    // It was killed while it wrote the fourth run.
    add_frames(&column(&left, "motion"), 1, 0);
    add_frames(&column(&left, "states"), 1, 0);
    add_frames(&column(&left, "details"), 1, 5);
    let files = contents(&left);
    let reader = History::open_to_read(&left).unwrap();
    assert_eq!((run_ids(&reader), is_warned(&reader)), (first(3), false));
    assert_eq!(statements(&reader), before);
    drop(reader);
    let history = History::open(&left).unwrap();
    assert_eq!(run_ids(&history), first(3));
    assert_eq!(statements(&history), before);
    history.commit(&sample_run("k", 3)).unwrap();
    history.commit_outcomes(&sample_run("k", 4)).unwrap();
    assert_eq!(run_ids(&history), first(5));
    drop(history);
    // Nothing that was written before has changed, except the campaign itself.
    let now = contents(&left);
    for (file, before) in &files {
        assert!(
            now[file] == *before || file.ends_with("campaign"),
            "{}",
            file.display()
        );
    }
    assert!(now.contains_key(&left.join("campaigns/k/0002.runs")));
    let history = History::open(&left).unwrap();
    history
        .begin_campaign(&sample_campaign("later", 1))
        .unwrap();
    history.finish_campaign("k", &end()).unwrap();
    assert_eq!(run_ids(&history), first(5));
    for index in 0..4 {
        let trace = history.traces().whole(&format!("k-{}", index + 1)).unwrap();
        assert_eq!(trace, sample_trace(index));
    }
    assert!(!history.is_whole("k-5").unwrap());
    drop(history);
    let (found, history) = History::examine(&left).unwrap();
    assert_eq!((found.damage, found.runs), (Vec::new(), 5));
    // Half a run in other columns is not worth a word.
    assert_eq!(found.unfinished, Vec::<PathBuf>::new());
    assert!(!is_warned(&history));
}

/// Wherever a kill cuts the list of runs, the runs before are read, and a lost run that was reported
/// is noticed.
#[test]
fn a_torn_tail_is_not_a_run() {
    let (_folder, left) = killed(3);
    let file = column(&left, "runs");
    let whole = std::fs::read(&file).unwrap();
    let ends = frames::ends(&whole);
    let near = |length: usize| {
        ends.iter()
            .chain([&0, &frames::HEAD])
            .any(|end| length.abs_diff(*end) < frames::HEADER + 2)
    };
    for length in (0..=whole.len()).filter(|length| near(*length) || length % 7 == 0) {
        std::fs::write(&file, &whole[..length]).unwrap();
        let complete = ends.iter().filter(|end| **end <= length).count();
        let is_border = length == frames::HEAD || ends.contains(&length);
        let reader = History::open_to_read(&left).unwrap();
        assert_eq!(run_ids(&reader), first(complete), "{length} bytes");
        // A process that is killed between two files leaves one run without a frame in the list.
        let is_lost = !is_border || complete < 2;
        assert_eq!(is_warned(&reader), is_lost, "{length} bytes");
        for index in 0..complete as u64 {
            let run = format!("k-{}", index + 1);
            assert_eq!(reader.traces().whole(&run).unwrap(), sample_trace(index));
        }
    }
    // The same for the next owner, who makes the lost run again.
    let length = ends[2] - 1;
    std::fs::write(&file, &whole[..length]).unwrap();
    let history = History::open_existing(&left).unwrap();
    assert_eq!((run_ids(&history), is_warned(&history)), (first(2), true));
    history.commit(&sample_run("k", 2)).unwrap();
    history.finish_campaign("k", &end()).unwrap();
    assert_eq!(run_ids(&history), first(3));
    drop(history);
    let (found, history) = History::examine(&left).unwrap();
    assert_eq!((found.damage, found.runs), (Vec::new(), 3));
    // The campaign is complete without it: half a run is not worth a word.
    assert_eq!(found.unfinished, Vec::<PathBuf>::new());
    assert!(!is_warned(&history));
}

/// While an owner writes, a torn tail is a run that it is writing.
#[test]
fn a_torn_tail_of_a_running_process_gives_no_warning() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("h");
    let owner = History::open(&dir).unwrap();
    owner.begin_campaign(&sample_campaign("k", 0)).unwrap();
    (0..3).for_each(|index| owner.commit(&sample_run("k", index)).unwrap());
    let file = column(&dir, "runs");
    let whole = std::fs::read(&file).unwrap();
    std::fs::write(&file, &whole[..whole.len() - 3]).unwrap();
    let reader = History::open_to_read(&dir).unwrap();
    assert_eq!((run_ids(&reader), is_warned(&reader)), (first(2), false));
    drop(owner);
    let reader = History::open_to_read(&dir).unwrap();
    assert_eq!((run_ids(&reader), is_warned(&reader)), (first(2), true));
}

/// A process that is killed leaves one run of which only some columns have a frame. Two such runs
/// have been reported, and lost from the list.
#[test]
fn frames_without_a_run_are_harmless_or_a_lost_run() {
    for (count, is_lost) in [(1, false), (2, true)] {
        let (_folder, left) = killed(3);
        for extension in ["motion", "states", "details"] {
            add_frames(&column(&left, extension), count, 0);
        }
        let before = contents(&left);
        let reader = History::open_to_read(&left).unwrap();
        assert_eq!((run_ids(&reader), is_warned(&reader)), (first(3), is_lost));
        let (found, _) = History::examine(&left).unwrap();
        assert_eq!(found.damage.is_empty(), !is_lost, "{found:?}");
        let unfinished = [PathBuf::from("campaigns/k/0001.runs")];
        assert!(is_lost || found.unfinished == unfinished, "{found:?}");
        assert_eq!(contents(&left), before, "readers change nothing");
        let owner = History::open_existing(&left).unwrap();
        assert_eq!((run_ids(&owner), is_warned(&owner)), (first(3), is_lost));
    }
}

/// The campaign's own file is replaced as a whole, so that a kill leaves the state before. It has
/// the state twice: one damaged copy loses nothing.
#[test]
fn a_damaged_campaign_is_reported_and_one_copy_saves_it() {
    let (folder, left) = killed(3);
    let history = History::open_existing(&left).unwrap();
    history.finish_campaign("k", &end()).unwrap();
    let record = history.campaign("k").unwrap();
    drop(history);
    let file = left.join("campaigns/k/campaign");
    // The process that ended it has left nothing else.
    let names = |folder: &Path| contents(folder).into_keys().collect::<Vec<PathBuf>>();
    assert_eq!(names(&left).len(), 5, "{:?}", names(&left));
    let whole = std::fs::read(&file).unwrap();
    let ends = frames::ends(&whole);
    let copies = frames::contents(&whole);
    assert!(copies.len() == 2 && copies[0] == copies[1]);
    let flipped = |at: usize| {
        let mut bytes = whole.clone();
        bytes[at] ^= 1;
        bytes
    };
    for (damaged, is_saved) in [
        (flipped(2), true),
        (flipped(frames::HEAD + 1), true),
        (flipped(ends[0] - 1), true),
        (flipped(whole.len() - 1), true),
        (whole[..whole.len() - 1].to_vec(), true),
        (whole[..ends[0]].to_vec(), true),
        (whole[..ends[0] - 1].to_vec(), false),
        (whole[..frames::HEAD].to_vec(), false),
        (Vec::new(), false),
    ] {
        std::fs::write(&file, damaged).unwrap();
        for opened in [History::open_to_read(&left), History::open_existing(&left)] {
            let fault = opened
                .and_then(|history| history.campaigns())
                .unwrap_err()
                .to_string();
            assert!(
                fault.starts_with("H007") && fault.contains("campaigns/k/campaign"),
                "{fault}"
            );
        }
        let (found, _) = History::examine(&left).unwrap();
        let named =
            |damage: &actcheck::history::Damage| damage.file == Path::new("campaigns/k/campaign");
        assert!(found.damage.iter().any(named), "{found:?}");
        if is_saved {
            let (ids, is_whole, _) = salvaged(folder.path(), &left);
            assert_eq!((ids, is_whole), (first(3), Some(true)));
            let saved = History::open_to_read(&folder.path().join("saved")).unwrap();
            assert_eq!(saved.campaign("k").unwrap(), record);
            assert!(saved.campaigns().unwrap()[0].ended.is_some());
        } else {
            // Its runs have no rules and no configuration: they are named.
            let (_, lost) = History::open_to_salvage(&left).unwrap();
            assert_eq!(lost, first(3));
        }
    }
}

/// A kill at the very start of a campaign leaves a folder without it.
#[test]
fn a_campaign_that_was_never_recorded_is_none() {
    let (_folder, left) = killed(3);
    let other = left.join("campaigns/q");
    for leftover in [None, Some("campaign.1-7.tmp")] {
        let _ = std::fs::remove_dir_all(&other);
        std::fs::create_dir(&other).unwrap();
        if let Some(leftover) = leftover {
            std::fs::write(other.join(leftover), "half").unwrap();
        }
        let reader = History::open_to_read(&left).unwrap();
        assert_eq!(reader.campaigns().unwrap().len(), 1, "{leftover:?}");
        assert_eq!(run_ids(&reader), first(3), "{leftover:?}");
        assert_eq!(History::count_runs(&left), 3);
        let owner = History::open_existing(&left).unwrap();
        owner.begin_campaign(&sample_campaign("q", 3)).unwrap();
        owner.commit(&sample_run("q", 0)).unwrap();
        drop(owner);
        let reader = History::open_to_read(&left).unwrap();
        assert_eq!(reader.campaigns().unwrap().len(), 2, "{leftover:?}");
        assert_eq!(run_ids(&reader).len(), 4, "{leftover:?}");
        let (found, _) = History::examine(&left).unwrap();
        assert!(found.damage.is_empty(), "{leftover:?}: {found:?}");
    }
}

/// A campaign that is continued has no torn tails any more.
#[test]
fn reopening_a_campaign_removes_a_torn_tail() {
    let (_folder, left) = killed(3);
    let file = column(&left, "runs");
    let whole = std::fs::read(&file).unwrap();
    let ends = frames::ends(&whole);
    std::fs::write(&file, &whole[..ends[2] - 1]).unwrap();
    let owner = History::open_existing(&left).unwrap();
    owner.reopen_campaign("k").unwrap();
    assert_eq!(std::fs::read(&file).unwrap(), whole[..ends[1]]);
    owner.commit(&sample_run("k", 2)).unwrap();
    drop(owner);
    let reader = History::open_to_read(&left).unwrap();
    assert_eq!((run_ids(&reader), is_warned(&reader)), (first(3), false));
    assert_eq!(reader.traces().whole("k-3").unwrap(), sample_trace(2));
}

#[test]
fn an_empty_history_has_empty_lists() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("h");
    drop(History::open(&dir).unwrap());
    let version = std::fs::read_to_string(dir.join("VERSION")).unwrap();
    assert_eq!(version, "actcheck history 7\n");
    let reader = History::open_to_read(&dir).unwrap();
    let all = RunFilter::default();
    assert_eq!((run_ids(&reader).len(), History::count_runs(&dir)), (0, 0));
    assert!(reader.campaigns().unwrap().is_empty() && reader.outcomes(&all).unwrap().is_empty());
    assert!(statements(&reader).is_empty() && !is_warned(&reader));
    assert_eq!(
        reader.query("ASK { ?s ?p ?o }").unwrap(),
        QueryAnswer::Boolean(false)
    );
    let (found, _) = History::examine(&dir).unwrap();
    assert_eq!((found.damage, found.runs), (Vec::new(), 0));
    assert_eq!(History::count_runs(&folder.path().join("none")), 0);
}

/// The salvaged runs, whether the run `k-3` is whole then, and the diagnostics.
fn salvaged(folder: &Path, left: &Path) -> (Vec<String>, Option<bool>, String) {
    let _ = std::fs::remove_dir_all(folder.join("saved"));
    let name = left.display().to_string();
    let output = actcheck(folder, &["merge", "--salvage", &name, "--into", "saved"]);
    assert!(
        output.status.code().is_some_and(|code| code < 2),
        "{}",
        stderr(&output)
    );
    let saved = History::open_to_read(&folder.join("saved")).unwrap();
    let ids = run_ids(&saved);
    for run in &ids {
        let index = saved.run(run).unwrap().row.index;
        assert_eq!(saved.run(run).unwrap().actions[0].judgements.len(), 5);
        if saved.is_whole(run).unwrap() {
            assert_eq!(saved.traces().whole(run).unwrap(), sample_trace(index));
        }
        assert_eq!(
            saved.traces().choices(run).unwrap(),
            sample_run("k", index).choices
        );
    }
    let is_whole = ids
        .contains(&"k-3".to_owned())
        .then(|| saved.is_whole("k-3").unwrap());
    drop(saved);
    let (found, _) = History::examine(&folder.join("saved")).unwrap();
    assert!(found.damage.is_empty(), "{found:?}");
    (ids, is_whole, stderr(&output))
}

#[test]
fn damage_to_a_column_is_reported_and_the_other_runs_are_saved() {
    // In the content and in the header of the last frame.
    for extension in COLUMNS {
        for in_header in [false, true] {
            let (folder, left) = killed(3);
            let place = format!("campaigns/k/0001.{extension}");
            let file = column(&left, extension);
            let mut bytes = std::fs::read(&file).unwrap();
            let at = if in_header {
                frames::ends(&bytes)[1] + 5
            } else {
                bytes.len() - 1
            };
            bytes[at] ^= 4;
            std::fs::write(&file, bytes).unwrap();
            for opened in [History::open_to_read(&left), History::open_existing(&left)] {
                // A column is read when its values are asked for.
                let fault = opened
                    .and_then(|history| {
                        history.runs(&RunFilter::default())?;
                        history.run("k-3")?;
                        history.traces().whole("k-3")
                    })
                    .map(drop)
                    .unwrap_err()
                    .to_string();
                assert!(
                    fault.starts_with("H007") && fault.contains(&place),
                    "{fault}"
                );
            }
            // Others are not concerned.
            if extension != "runs" {
                let history = History::open_to_read(&left).unwrap();
                assert_eq!(run_ids(&history), first(3));
                assert_eq!(history.traces().whole("k-2").unwrap(), sample_trace(1));
                assert_eq!(history.run("k-2").unwrap().actions.len(), 1);
            }
            let name = left.display().to_string();
            let output = actcheck(
                folder.path(),
                &["health", "--integrity", "--history", &name],
            );
            assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
            assert!(
                stdout(&output).contains(&place)
                    && (extension == "runs" || stdout(&output).contains("k-3")),
                "{}",
                stdout(&output)
            );
            let (ids, is_whole, said) = salvaged(folder.path(), &left);
            match extension {
                "runs" => assert_eq!((ids, is_whole), (first(3), Some(true))),
                "motion" => assert_eq!((ids, is_whole), (first(3), Some(false))),
                _ => {
                    assert_eq!((ids, is_whole), (first(2), None));
                    assert!(said.contains("k-3"), "{said}");
                }
            }
        }
    }
}

/// A column that has lost its end or is missing: each run says where its frames are.
#[test]
fn runs_whose_frames_are_missing_are_reported() {
    for extension in ["details", "states", "motion"] {
        let (folder, left) = killed(3);
        let place = format!("campaigns/k/0001.{extension}");
        let file = column(&left, extension);
        let whole = std::fs::read(&file).unwrap();
        let ends = frames::ends(&whole);
        for length in [Some(ends[2] - 1), Some(ends[1]), Some(0), None] {
            match length {
                Some(length) => std::fs::write(&file, &whole[..length]).unwrap(),
                None => std::fs::remove_file(&file).unwrap(),
            }
            let history = History::open_to_read(&left).unwrap();
            assert_eq!(run_ids(&history), first(3));
            let read = history
                .run("k-3")
                .map(drop)
                .and_then(|()| history.traces().whole("k-3").map(drop));
            let fault = read.unwrap_err().to_string();
            assert!(
                ["H007", "H009"].iter().any(|code| fault.starts_with(code))
                    && fault.contains(&place),
                "{fault}"
            );
            let (found, _) = History::examine(&left).unwrap();
            assert!(
                found
                    .damage
                    .iter()
                    .any(|damage| damage.file == Path::new(&place)),
                "{found:?}"
            );
            let (ids, is_whole, _) = salvaged(folder.path(), &left);
            let is_lost = extension != "motion";
            let saved = match length {
                _ if !is_lost => first(3),
                Some(length) if length > 0 => first(2),
                _ => first(0),
            };
            assert_eq!((ids, is_whole), (saved, (!is_lost).then_some(false)));
        }
    }
}

/// A frame of another place, with right checksums of its own, is not taken for the one that a run
/// has.
#[test]
fn spliced_frames_are_found() {
    let (_folder, left) = killed(3);
    for extension in COLUMNS {
        let file = column(&left, extension);
        let whole = std::fs::read(&file).unwrap();
        let contents = frames::contents(&whole);
        let swapped = [contents[0], contents[2], contents[1]];
        let ends = frames::ends(&whole);
        let moved = [
            &whole[..ends[0]],
            &whole[ends[1]..],
            &whole[ends[0]..ends[1]],
        ]
        .concat();
        for written in [frames::file(&whole, &swapped), moved] {
            assert_ne!(written, whole);
            std::fs::write(&file, written).unwrap();
            let (found, _) = History::examine(&left).unwrap();
            // Rows that are in another order, with right checksums, are the same rows.
            assert!(
                extension == "runs" || !found.damage.is_empty(),
                "{extension}: {found:?}"
            );
            let read = History::open_to_read(&left).and_then(|history| {
                history.runs(&RunFilter::default())?;
                for index in 0..3 {
                    let run = format!("k-{}", index + 1);
                    history.run(&run)?;
                    assert_eq!(
                        history.traces().whole(&run)?,
                        sample_trace(index),
                        "{extension}"
                    );
                }
                Ok(())
            });
            match read {
                Ok(()) => assert_eq!(extension, "runs"),
                Err(faults) => assert!(faults.iter().all(|fault| fault.code == "H007")),
            }
        }
        std::fs::write(&file, whole).unwrap();
    }
}

/// Runs of a campaign are much alike.
#[test]
fn a_run_takes_few_bytes() {
    const RUNS: u64 = 60;
    let folder = tempfile::tempdir().unwrap();
    let size = |is_whole: bool| {
        let dir = folder.path().join(format!("{is_whole}"));
        let history = History::open(&dir).unwrap();
        history.begin_campaign(&sample_campaign("k", 0)).unwrap();
        for index in 0..RUNS {
            let run = sample_run("k", index);
            if is_whole {
                history.commit(&run).unwrap()
            } else {
                history.commit_outcomes(&run).unwrap()
            }
        }
        let before = statements(&History::open_to_read(&dir).unwrap());
        history.finish_campaign("k", &end()).unwrap();
        drop(history);
        let after = statements(&History::open_to_read(&dir).unwrap());
        assert!(before.is_subset(&after) && after.len() > 5_000);
        assert!(
            (1..20).contains(&(after.len() - before.len())),
            "{}",
            after.len() - before.len()
        );
        let sizes: BTreeMap<String, u64> = contents(&dir)
            .iter()
            .map(|(file, bytes)| {
                let kind = file.extension().or(file.file_name()).unwrap();
                (
                    kind.to_string_lossy().into_owned(),
                    bytes.len() as u64 / RUNS,
                )
            })
            .collect();
        println!("{sizes:?} bytes a run");
        sizes
    };
    let [whole, outcomes] = [true, false].map(size);
    let sum = |sizes: &BTreeMap<String, u64>| sizes.values().sum::<u64>();
    assert!(outcomes["runs"] < 400, "{outcomes:?}");
    assert!(sum(&outcomes) < 4_000, "{outcomes:?}");
    assert!(sum(&whole) < 12_000, "{whole:?}");
    assert!(!outcomes.contains_key("motion") && outcomes["states"] == whole["states"]);
}

/// The lines of an answer, in any order.
fn lines(answer: QueryAnswer) -> Vec<String> {
    match answer {
        QueryAnswer::Boolean(value) => vec![value.to_string()],
        QueryAnswer::Table { columns, rows } => {
            let mut rows: Vec<String> = rows.iter().map(|row| format!("{row:?}")).collect();
            rows.sort();
            rows.insert(0, columns.join(" "));
            rows
        }
        QueryAnswer::Graph(triples) => triples.iter().map(|triple| format!("{triple:?}")).collect(),
    }
}

fn answer(history: &History, query: &str) -> Vec<String> {
    let answer = history.query(query);
    lines(answer.unwrap_or_else(|fault| panic!("{query}: {fault}")))
}

/// The statements that queries needed before follow the history, also if it lost some.
#[test]
fn a_view_follows_a_history_that_grows_and_shrinks() {
    let (_folder, left) = killed(3);
    let rows = std::fs::read(column(&left, "runs")).unwrap();
    let reader = History::open_to_read(&left).unwrap();
    let count = |query: &str| match reader.query(query).unwrap() {
        QueryAnswer::Table { rows, .. } => format!("{:?}", rows[0][0]),
        other => panic!("{other:?}"),
    };
    let counts = || {
        reader.refresh().unwrap();
        [
            count("SELECT (COUNT(*) AS ?n) { ?run a act:Run }"),
            count("SELECT (COUNT(*) AS ?n) { ?campaign prov:endedAtTime ?at }"),
        ]
    };
    let are = |runs: i64, ends: i64| [runs, ends].map(|n| format!("{:?}", Some(Term::Integer(n))));
    assert_eq!(counts(), are(3, 0));
    let owner = History::open(&left).unwrap();
    (3..5).for_each(|index| owner.commit(&sample_run("k", index)).unwrap());
    assert_eq!(counts(), are(5, 0));
    owner.finish_campaign("k", &end()).unwrap();
    assert_eq!(counts(), are(5, 1));
    owner.reopen_campaign("k").unwrap();
    assert_eq!(counts(), are(5, 0));
    drop(owner);
    // Damage from outside: the file of the campaign knows of no run yet.
    let (_other, alone) = killed(3);
    std::fs::remove_dir_all(left.join("campaigns/k")).unwrap();
    assert_eq!(counts(), are(0, 0));
    copy(&alone.join("campaigns"), &left.join("campaigns"));
    assert_eq!(counts(), are(3, 0));
    std::fs::write(column(&left, "runs"), &rows[..rows.len() - 1]).unwrap();
    assert_eq!(counts(), are(2, 0));
}

/// Queries with every kind of pattern.
const QUERIES: [&str; 25] = [
    "SELECT ?run ?score { ?run a act:Run ; act:score ?score ; act:index 2 }",
    "SELECT ?p ?o { run:k-2 ?p ?o }",
    "SELECT ?s ?p { ?s ?p run:k-2 }",
    "SELECT ?p (COUNT(*) AS ?n) { ?s ?p ?o } GROUP BY ?p",
    "SELECT ?g (COUNT(*) AS ?n) { GRAPH ?g { ?s ?p ?o } } GROUP BY ?g",
    "SELECT ?g { GRAPH ?g {} }",
    "SELECT ?g { GRAPH ?g { FILTER NOT EXISTS { ?s w:touches ?o } } }",
    "SELECT ?x { run:k-1 ^act:ofRun ?e . ?e act:after ?g . GRAPH ?g { obj:glass_1 w:x ?x } }",
    "ASK { GRAPH <https://w3id.org/actcheck/run/k-1/state/0> {} }",
    "SELECT ?p ?o { GRAPH <https://w3id.org/actcheck/run/k-1/state/0> { obj:glass_1 ?p ?o } }",
    "SELECT ?s { ?s earl:result/act:outcome 'failed' }",
    "SELECT ?a ?b { ?a (earl:subject/act:ofRun)|act:campaign ?b }",
    "SELECT ?b { run:k-1 act:campaign+ ?b }",
    "SELECT ?b { run:k-1 act:campaign* ?b }",
    "SELECT (COUNT(*) AS ?n) { ?a act:campaign? ?b }",
    "SELECT (COUNT(*) AS ?n) { ?a !(act:campaign|rdf:type) ?b }",
    "SELECT ?run { ?run act:score ?score FILTER NOT EXISTS { ?run act:weight ?w } FILTER EXISTS { ?run act:index 1 } }",
    "SELECT ?run ?weight { ?run act:score ?score OPTIONAL { ?run act:weight ?weight FILTER EXISTS { ?run a act:Run } } }",
    "SELECT ?run { { ?run act:index 0 } UNION { ?run act:index 1 } MINUS { ?run act:status 'broken' } }",
    "SELECT ?run { ?run act:index ?index FILTER(act:counts(?run)) }",
    "SELECT ?run { ?run a act:Run } ORDER BY (EXISTS { ?run act:index 1 }) ?run",
    "SELECT (SUM(IF(EXISTS { ?run act:index 1 }, 1, 0)) AS ?n) { ?run a act:Run }",
    "SELECT ?s (COUNT(*) AS ?n) FROM <https://w3id.org/actcheck/run/k-1/state/0> { ?s w:x ?x } GROUP BY ?s",
    "CONSTRUCT { ?run act:x ?score } { ?run act:score ?score }",
    "DESCRIBE run:k-2",
];

/// Each answer is that of a store that has the exported statements: for a reader beside the owner,
/// for a reader that was not asked before, for the owner, and after the end of the campaign.
#[test]
fn answers_are_those_of_the_exported_statements() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("h");
    // An earlier campaign, and one of which two processes have made runs.
    let with = |campaign: &str, minute| {
        let history = History::open(&dir).unwrap();
        history
            .begin_campaign(&sample_campaign(campaign, minute))
            .unwrap();
        history
    };
    let first = with("a", 0);
    (0..3).for_each(|index| first.commit(&sample_run("a", index)).unwrap());
    first.finish_campaign("a", &end()).unwrap();
    drop(first);
    let second = with("k", 1);
    second.commit(&sample_run("k", 2)).unwrap();
    drop(second);
    let owner = History::open(&dir).unwrap();
    owner.commit_outcomes(&sample_run("k", 1)).unwrap();
    owner.commit(&sample_run("k", 0)).unwrap();
    let compare = |reader: &History, place: &str| {
        let exported = Exported::of(reader);
        for query in QUERIES {
            let expected = lines(exported.query(query));
            assert_eq!(answer(reader, query), expected, "{place}: {query}");
            let alone = History::open_to_read(&dir).unwrap();
            assert_eq!(answer(&alone, query), expected, "{place}, alone: {query}");
        }
    };
    compare(&History::open_to_read(&dir).unwrap(), "a reader");
    compare(&owner, "the owner");
    owner.finish_campaign("k", &end()).unwrap();
    compare(&owner, "the owner after the end");
    drop(owner);
    compare(&History::open_to_read(&dir).unwrap(), "after the end");
}

/// A value that several histories have.
fn same<T: PartialEq + std::fmt::Debug>(histories: [History; 3], of: impl Fn(&History) -> T) -> T {
    let [one, copied, owner] = histories;
    let value = of(&one);
    assert_eq!(of(&copied), value);
    assert_eq!(of(&owner), value);
    value
}

/// A killed campaign has the same lists for readers, for the next owner, and for a copy in other
/// segments.
#[test]
fn every_list_is_the_same_for_readers_owners_and_copies() {
    let (folder, left) = killed(3);
    let [whole, copied] = ["whole", "copied"].map(|name| folder.path().join(name));
    copy(&left, &whole);
    let sources = [History::open_to_read(&left).unwrap()];
    let into = History::open(&copied).unwrap();
    let planned = plan(&sources, Some(&into), &MergeOptions::default()).unwrap();
    carry_out(&planned, &sources, &into, &AtomicBool::new(false), || ()).unwrap();
    drop(into);
    let open = || {
        [
            History::open_to_read(&left).unwrap(),
            History::open_to_read(&copied).unwrap(),
            History::open_existing(&whole).unwrap(),
        ]
    };
    for run in ["k-1", "k-2", "k-3", "@last", "@last-failed"] {
        same(open(), |history| history.newest_run(run).unwrap());
    }
    same(open(), |history| {
        ["k-3", "k-2", "k-1"].map(|run| history.newest_run(run).unwrap())
    });
    same(open(), statements);
    same(open(), |history| {
        (
            history.campaigns().unwrap(),
            history.counted_runs().unwrap(),
        )
    });
    let (_, rows) = same(open(), |history| {
        let rows = history.runs(&RunFilter::default()).unwrap();
        (history.scenes(&rows).unwrap(), rows)
    });
    assert_eq!(rows.len(), 3);
    let newest = same(open(), |history| {
        history.newest_outcomes(&RunFilter::default()).unwrap()
    });
    assert!(newest.rows.len() > 5);
    for campaign in [None, Some("k"), Some("none")] {
        let expected = if campaign == Some("none") {
            0
        } else {
            newest.rows.len()
        };
        for status in [RunStatus::Completed, RunStatus::Broken] {
            let filter = RunFilter {
                campaign: campaign.map(str::to_owned),
                status: Some(status),
                ..RunFilter::default()
            };
            let (found, all) = same(open(), |history| {
                (
                    history.outcomes(&filter).unwrap(),
                    history.runs(&filter).unwrap(),
                )
            });
            assert!(
                found
                    .iter()
                    .all(|row| all.iter().any(|run| run.run == row.run))
            );
            let is_completed = status == RunStatus::Completed;
            assert_eq!(found.len(), if is_completed { expected } else { 0 });
        }
    }
    let vitals = same(open(), |history| {
        let mut vitals = Vec::new();
        history
            .each_vitals("k", |run| vitals.push(run.clone()))
            .unwrap();
        vitals
    });
    assert_eq!(vitals.len(), 3);
    same(open(), |history| {
        (history.campaign("k").unwrap(), history.run_ids().unwrap())
    });
}
