//! The journal of a history: its statements can be read at once, survives a kill, and ends in
//! compressed tables.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use actcheck::history::{CampaignEnd, History, QueryAnswer, RunFilter, RunStatus};
use tempfile::TempDir;

use crate::history::{sample_campaign, sample_run};
use crate::support::{actcheck, copy, copy_open, stderr, stdout};

/// The folder of a history with a campaign that has not ended, as its owner left it when it was
/// killed.
fn killed(runs: u64) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let (live, left) = (folder.path().join("live"), folder.path().join("left"));
    let history = History::open(&live).unwrap();
    history.begin_campaign(&sample_campaign("k", 0)).unwrap();
    (0..runs).for_each(|index| history.commit(&sample_run("k", index)).unwrap());
    copy_open(&live, &left);
    (folder, left)
}

fn runs(history: &History) -> Vec<String> {
    history
        .runs(&RunFilter::default())
        .unwrap()
        .into_iter()
        .map(|run| run.run)
        .collect()
}

/// All statements of a history as lines.
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

fn size_of(folder: &Path, ending: &str) -> u64 {
    let files = std::fs::read_dir(folder).unwrap().map(Result::unwrap);
    let wanted = files.filter(|file| file.file_name().to_string_lossy().ends_with(ending));
    wanted.map(|file| file.metadata().unwrap().len()).sum()
}

#[test]
fn the_next_owner_takes_over_the_runs_of_a_killed_one() {
    let (_folder, left) = killed(3);
    assert!(left.join("journal").metadata().unwrap().len() > 0);
    // It was killed while it wrote tables.
    std::fs::write(left.join("store/bulk-7.sst"), "half").unwrap();
    let before = statements(&History::open_to_read(&left).unwrap());
    let history = History::open(&left).unwrap();
    assert!(!left.join("store/bulk-7.sst").exists());
    assert_eq!(runs(&history), ["k-1", "k-2", "k-3"]);
    assert_eq!(statements(&history), before);
    assert!(!left.join("journal").exists());
    // Traces of runs in the journal are not leftovers.
    history
        .begin_campaign(&sample_campaign("later", 1))
        .unwrap();
    assert!((0..3).all(|index| history.trace(&format!("k-{}", index + 1)).is_ok()));
}

#[test]
fn a_kill_between_the_store_and_the_journal_stores_nothing_twice() {
    let (_folder, left) = killed(2);
    let journal = std::fs::read(left.join("journal")).unwrap();
    let before = statements(&History::open_existing(&left).unwrap());
    std::fs::write(left.join("journal"), journal).unwrap();
    assert_eq!(statements(&History::open_to_read(&left).unwrap()), before);
    assert_eq!(statements(&History::open_existing(&left).unwrap()), before);
}

#[test]
fn half_a_record_at_the_end_of_a_journal_is_not_a_run() {
    let (_folder, left) = killed(3);
    let journal = std::fs::read(left.join("journal")).unwrap();
    std::fs::write(left.join("journal"), &journal[..journal.len() - 1]).unwrap();
    assert_eq!(runs(&History::open_to_read(&left).unwrap()), ["k-1", "k-2"]);
    assert_eq!(
        runs(&History::open_existing(&left).unwrap()),
        ["k-1", "k-2"]
    );
}

#[test]
fn damage_to_a_journal_is_reported_and_the_other_runs_are_saved() {
    let (folder, left) = killed(3);
    let mut journal = std::fs::read(left.join("journal")).unwrap();
    // In the content of the last record.
    let last = journal.len() - 1;
    journal[last] ^= 4;
    std::fs::write(left.join("journal"), journal).unwrap();
    for opened in [History::open_to_read(&left), History::open_existing(&left)] {
        let fault = opened.err().unwrap().to_string();
        assert!(
            fault.starts_with("H007") && fault.contains("journal"),
            "{fault}"
        );
    }
    let name = left.display().to_string();
    let output = actcheck(
        folder.path(),
        &["health", "--integrity", "--history", &name],
    );
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(
        stdout(&output).contains("journal") && stdout(&output).contains("k-3"),
        "{}",
        stdout(&output)
    );
    let output = actcheck(
        folder.path(),
        &["merge", "--salvage", &name, "--into", "saved"],
    );
    assert!(
        output.status.code().is_some_and(|code| code < 2),
        "{}",
        stderr(&output)
    );
    assert_eq!(
        runs(&History::open_to_read(&folder.path().join("saved")).unwrap()),
        ["k-1", "k-2"]
    );
}

/// A statement takes about 240 bytes in tables that are not compressed, and 500 in the store's own
/// log.
#[test]
fn a_campaign_ends_in_compressed_tables_with_the_same_statements() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("h");
    let history = History::open(&dir).unwrap();
    history.begin_campaign(&sample_campaign("k", 0)).unwrap();
    (0..60).for_each(|index| history.commit(&sample_run("k", index)).unwrap());
    let before = statements(&History::open_to_read(&dir).unwrap());
    let journal = dir.join("journal").metadata().unwrap().len();
    let end = CampaignEnd {
        ended: "2026-08-01T13:00:00Z".to_owned(),
        ..CampaignEnd::default()
    };
    history.finish_campaign("k", &end).unwrap();
    drop(history);
    let after = statements(&History::open_to_read(&dir).unwrap());
    assert!(before.is_subset(&after) && !dir.join("journal").exists());
    assert!(
        (1..20).contains(&(after.len() - before.len())),
        "{}",
        after.len() - before.len()
    );
    let [tables, logs] = [".sst", ".log"].map(|ending| size_of(&dir.join("store"), ending));
    let count = after.len() as u64;
    assert!(
        count > 5_000 && tables < 150 * count && logs == 0 && journal < 40 * count,
        "{count} {tables} {journal}"
    );
}

/// Otherwise a lost journal would not be noticed.
#[test]
fn a_history_is_marked_while_it_has_a_journal() {
    let (_folder, left) = killed(2);
    let version = || std::fs::read_to_string(left.join("VERSION")).unwrap();
    assert_eq!(version(), "actcheck history 4 journal\n");
    drop(History::open_to_read(&left).unwrap());
    assert_eq!(version(), "actcheck history 4 journal\n");
    drop(History::open(&left).unwrap());
    assert_eq!(version(), "actcheck history 4\n");
    drop(History::open(&left).unwrap());
    assert_eq!(runs(&History::open_to_read(&left).unwrap()), ["k-1", "k-2"]);
}

/// The lines of an answer, in any order: those of unsorted rows, with numbers for blank nodes.
fn answer(history: &History, query: &str) -> Vec<String> {
    match history
        .query(query)
        .unwrap_or_else(|fault| panic!("{query}: {fault}"))
    {
        QueryAnswer::Boolean(value) => vec![value.to_string()],
        QueryAnswer::Table { rows, .. } => {
            let mut rows: Vec<String> = rows.iter().map(|row| format!("{row:?}")).collect();
            rows.sort();
            rows
        }
        QueryAnswer::Graph(triples) => triples.iter().map(|triple| format!("{triple:?}")).collect(),
    }
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

/// A reader takes from the journal the statements that a question needs, and each answer is that of
/// the whole history.
#[test]
fn answers_from_a_journal_are_those_after_the_end() {
    compare_with_end(&killed(3).1);
}

#[test]
fn answers_from_tables_and_a_journal_are_those_after_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let (live, left) = (folder.path().join("live"), folder.path().join("left"));
    let with = |campaign, minute| {
        let history = History::open(&live).unwrap();
        history
            .begin_campaign(&sample_campaign(campaign, minute))
            .unwrap();
        (0..3).for_each(|index| history.commit(&sample_run(campaign, index)).unwrap());
        history
    };
    drop(with("a", 0));
    let _owner = with("k", 1);
    copy_open(&live, &left);
    compare_with_end(&left);
}

fn compare_with_end(left: &Path) {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole");
    copy(left, &whole);
    drop(History::open(&whole).unwrap());
    assert!(left.join("journal").exists() && !whole.join("journal").exists());
    let open = || [left, &whole].map(|dir| History::open_to_read(dir).unwrap());
    let [reader, after] = open();
    for query in QUERIES {
        let expected = answer(&after, query);
        let alone = answer(&open()[0], query);
        assert_eq!(
            (&alone, &answer(&reader, query)),
            (&expected, &expected),
            "{query}"
        );
    }
    for run in ["k-1", "k-2", "k-3", "@last", "@last-failed"] {
        let [one, other] = open().map(|history| history.newest_run(run).unwrap());
        assert_eq!(one, other);
    }
    let [one, other] = open();
    for run in ["k-3", "k-2", "k-1"] {
        assert_eq!(one.newest_run(run).unwrap(), other.newest_run(run).unwrap());
    }
    assert_eq!(statements(&one), statements(&other));
    let [one, other] = open().map(|history| {
        (
            history.campaigns().unwrap(),
            history.counted_runs().unwrap(),
        )
    });
    assert_eq!(one, other);
    let [one, other] = open().map(|history| {
        let rows = history.runs(&RunFilter::default()).unwrap();
        (history.scenes(&rows).unwrap(), rows)
    });
    assert!(one.1.len() >= 3 && one == other);
    // The campaign has all runs, half of them, or few: each is read in another way.
    for campaign in [None, Some("k"), Some("none")] {
        let all = after.newest_outcomes(&RunFilter::default()).unwrap().rows;
        let expected: Vec<_> = all
            .iter()
            .filter(|row| campaign.is_none_or(|id| row.campaign == id))
            .collect();
        for status in [RunStatus::Completed, RunStatus::Broken] {
            let campaign = campaign.map(str::to_owned);
            let filter = RunFilter {
                campaign,
                status: Some(status),
                ..RunFilter::default()
            };
            let found = after.outcomes(&filter).unwrap();
            let all_runs: Vec<_> = after
                .runs(&filter)
                .unwrap()
                .into_iter()
                .map(|run| run.run)
                .collect();
            assert!(found.iter().all(|row| all_runs.contains(&row.run)));
            assert_eq!(
                found.len(),
                if status == RunStatus::Completed {
                    expected.len()
                } else {
                    0
                }
            );
        }
    }
    let [one, other] =
        open().map(|history| history.newest_outcomes(&RunFilter::default()).unwrap());
    assert!(one.rows.len() > 5 && one == other);
    let [one, other] = open().map(|history| {
        let mut vitals = Vec::new();
        history
            .each_vitals("k", |run| vitals.push(run.clone()))
            .unwrap();
        vitals
    });
    assert!(one.len() == 3 && one == other);
    let [one, other] =
        open().map(|history| (history.campaign("k").unwrap(), history.run_ids().unwrap()));
    assert_eq!(one, other);
}
