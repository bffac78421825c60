//! Shards of a campaign, and merging of histories: no run is lost or duplicated, in any order;
//! conflicts are reported and change nothing.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use actcheck::base::{Outcome, Term};
use actcheck::history::merge::{MergeOptions, Merged, carry_out, plan};
use actcheck::history::{CampaignEnd, CampaignRecord, History, QueryAnswer, RunFilter};
use serde_json::Value;

use crate::history::{sample_campaign, sample_run};
use crate::support::look::looking;
use crate::support::{actcheck, copy, edit, project, stderr, stdout};

const END: &str = "SELECT ?p ?o WHERE { ?c a act:Campaign ; ?p ?o
    FILTER (?p IN (act:score, act:scoreWithoutBroken, act:discards, act:interrupted, act:passedCount, act:failedCount,
        act:inapplicableCount, act:brokenCount, act:timeoutCount, act:untestedCount, act:plannedRuns, act:seed,
        act:configDigest, act:ontologyDigest, act:program, rdfs:label)) } ORDER BY ?p";
/// All data except times, shards and paths.
const ALL: &str = "SELECT ?g ?s ?p ?o WHERE { { ?s ?p ?o } UNION { GRAPH ?g { ?s ?p ?o } }
    FILTER (?p NOT IN (prov:startedAtTime, prov:endedAtTime, act:wallSeconds, act:elapsedSeconds, act:shard, act:configPath)) }";

fn table(history: &History, query: &str) -> Vec<Vec<Option<Term>>> {
    match history.query(query) {
        Ok(QueryAnswer::Table { rows, .. }) => rows,
        other => panic!("{other:?}"),
    }
}

fn all(history: &History) -> BTreeSet<String> {
    table(history, ALL)
        .iter()
        .map(|row| format!("{row:?}"))
        .collect()
}

/// Columns of `actcheck list` without the ids.
fn listed(folder: &Path, history: &str) -> Vec<String> {
    let output = actcheck(folder, &["list", "--history", history, "--format", "csv"]);
    assert!(output.status.success(), "{}", stderr(&output));
    stdout(&output)
        .lines()
        .skip(1)
        .map(|line| line.split_once(',').unwrap().1.to_owned())
        .collect()
}

fn open(folder: &Path, name: &str) -> History {
    History::open_existing(&folder.join(name)).unwrap()
}

fn run(folder: &Path, arguments: &[&str]) {
    let output = actcheck(
        folder,
        &[&["run", "configs/look.toml", "--runs", "8"], arguments].concat(),
    );
    assert!(
        matches!(output.status.code(), Some(0 | 1)),
        "{}",
        stderr(&output)
    );
}

fn merged(sources: &[History], into: &History) -> Merged {
    let plan = plan(sources, Some(into), &MergeOptions::default()).unwrap();
    carry_out(&plan, sources, into, &AtomicBool::new(false), || ()).unwrap()
}

fn permutations(of: usize) -> Vec<Vec<usize>> {
    let mut all = vec![Vec::new()];
    for next in 0..of {
        all = all
            .into_iter()
            .flat_map(|order: Vec<usize>| {
                (0..=order.len()).map(move |at| {
                    let mut order = order.clone();
                    order.insert(at, next);
                    order
                })
            })
            .collect();
    }
    all
}

#[test]
fn four_shards_merged_in_any_order_equal_the_campaign() {
    let project = looking();
    let folder = project.path();
    run(folder, &["--history", "whole"]);
    for part in 1..=4 {
        run(
            folder,
            &[
                "--shard",
                &format!("{part}/4"),
                "--history",
                &format!("s{part}"),
            ],
        );
        // All shards in one history, where each has its own id.
        run(
            folder,
            &["--shard", &format!("{part}/4"), "--history", "together"],
        );
    }
    let wanted = listed(folder, "whole");
    assert_eq!(wanted.len(), 8);
    let (wanted_all, wanted_end) = {
        let whole = open(folder, "whole");
        (all(&whole), table(&whole, END))
    };
    assert!(wanted_end.len() > 10, "{wanted_end:?}");

    let output = actcheck(
        folder,
        &[
            "merge", "s3", "s1", "s4", "s2", "--into", "cli", "--format", "json",
        ],
    );
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let json: Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(
        (
            json.as_array().unwrap().len(),
            &json[0]["runs"],
            &json[0]["added"]
        ),
        (1, &8.into(), &8.into())
    );
    assert_eq!(listed(folder, "cli"), wanted);
    let output = actcheck(
        folder,
        &[
            "merge", "together", "--into", "from one", "--format", "json",
        ],
    );
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(listed(folder, "from one"), wanted);
    let one = open(folder, "from one");
    assert_eq!(
        (table(&one, END), table(&one, ALL).len()),
        (wanted_end.clone(), wanted_all.len())
    );
    drop(one);

    let part =
        |part: usize| History::open_existing(&folder.join(format!("s{}", part + 1))).unwrap();
    let (mut sources, mut places): (Vec<History>, Vec<usize>) =
        (0..4).map(|at| (part(at), at)).unzip();
    for (number, order) in permutations(4).into_iter().enumerate() {
        for (at, wanted) in order.iter().enumerate() {
            let found = places.iter().position(|place| place == wanted).unwrap();
            places.swap(at, found);
            sources.swap(at, found);
        }
        let into = History::open(&folder.join(format!("order {number}"))).unwrap();
        assert_eq!(merged(&sources, &into).runs, 8);
        assert_eq!(table(&into, END), wanted_end, "{order:?}");
        assert!(all(&into) == wanted_all, "{order:?}");
        for row in into.runs(&RunFilter::default()).unwrap() {
            assert_eq!(into.traces().whole(&row.run).unwrap().hash, row.trace_hash);
        }
    }

    drop(sources);

    // A shard merged again counts once, also as a part of an existing campaign.
    let output = actcheck(
        folder,
        &[
            "merge", "cli", "s2", "from one", "--into", "order 0", "--format", "csv",
        ],
    );
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(
        (
            listed(folder, "order 0"),
            all(&open(folder, "order 0")) == wanted_all
        ),
        (wanted, true)
    );

    // The merged campaign can be run again from the configuration that it names.
    let id = open(folder, "cli").campaigns().unwrap()[0].id.clone();
    let output = actcheck(
        folder,
        &["replay", &format!("{id}-3"), "--history", "cli", "--exact"],
    );
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}{}",
        stdout(&output),
        stderr(&output)
    );
}

#[test]
fn invalid_shards_are_refused() {
    let project = project();
    for wrong in ["0/4", "5/4", "4", "1/0", "-1/2", "a/b"] {
        let output = actcheck(
            project.path(),
            &["run", "configs/pick.toml", &format!("--shard={wrong}")],
        );
        assert_eq!(output.status.code(), Some(2), "{wrong}");
        assert!(
            stderr(&output).contains("expected a shard such as 1/4"),
            "{}",
            stderr(&output)
        );
    }
    assert!(!project.path().join("configs/.actcheck").exists());
}

/// One shard of a campaign of sample runs.
fn part(
    folder: &Path,
    name: &str,
    id: &str,
    shard: &str,
    change: impl Fn(&mut CampaignRecord),
) -> History {
    let history = History::open(&folder.join(name)).unwrap();
    let mut record = CampaignRecord {
        planned_runs: 8,
        ..sample_campaign(id, 0)
    };
    record.shards = vec![shard.parse().unwrap()];
    change(&mut record);
    history.begin_campaign(&record).unwrap();
    for index in (0..8).filter(|index| record.shards.iter().all(|shard| shard.has(*index))) {
        history.commit(&sample_run(id, index)).unwrap();
    }
    history
        .finish_campaign(
            id,
            &CampaignEnd {
                ended: "2026-08-01T13:00:00Z".to_owned(),
                ..CampaignEnd::default()
            },
        )
        .unwrap();
    history
}

fn fails(folder: &Path, arguments: &[&str], wanted: &[&str]) {
    let output = actcheck(folder, &[&["merge"], arguments].concat());
    // Undoes line wrapping.
    let text = stderr(&output)
        .replace('│', "")
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ");
    assert_eq!(output.status.code(), Some(2), "{arguments:?} {text}");
    wanted
        .iter()
        .for_each(|wanted| assert!(text.contains(wanted), "no `{wanted}` in {text}"));
}

#[test]
fn a_missing_shard_is_reported_and_can_be_merged_later() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (name, id, shard) in [
        ("a", "k", "1/4"),
        ("b", "m", "3/4"),
        ("c", "k", "2/4"),
        ("d", "p", "4/4"),
    ] {
        drop(part(folder, name, id, shard, |_| ()));
    }
    let output = actcheck(
        folder,
        &["merge", "b", "a", "--into", "all", "--format", "json"],
    );
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(
        stderr(&output).contains("campaign k lacks 4 of its 8 runs: 2, 4, 6, 8"),
        "{}",
        stderr(&output)
    );
    let json: Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!(json[0]["missing"], serde_json::json!([2, 4, 6, 8]));
    let row = open(folder, "all").campaigns().unwrap().remove(0);
    assert!(row.interrupted && row.runs == 4, "{row:?}");
    let output = actcheck(folder, &["merge", "d", "c", "--into", "all"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let all = open(folder, "all");
    let row = all.campaigns().unwrap().remove(0);
    assert!(!row.interrupted && row.runs == 8, "{row:?}");
    // Every third sample run has one failure in five properties.
    assert_eq!(
        (
            row.outcomes[&Outcome::Passed],
            row.outcomes[&Outcome::Failed]
        ),
        (37, 3)
    );
    let score = row.score.unwrap();
    assert!((score - (3.0 * 0.8 + 5.0) / 8.0).abs() < 1e-12, "{score}");
    assert_eq!(
        table(
            &all,
            "SELECT ?e WHERE { ?c a act:Campaign ; prov:endedAtTime ?e }"
        )
        .len(),
        1
    );
    assert_eq!(all.campaign("k").unwrap().shards.len(), 4);
    for index in 0..8 {
        let run = sample_run("k", index);
        assert_eq!(all.traces().whole(&run.id).unwrap(), run.trace);
    }
}

#[test]
fn conflicts_are_reported_with_a_solution_and_write_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    drop(part(folder, "a", "k", "1/2", |_| ()));
    drop(part(folder, "rules", "k", "2/2", |record| {
        record.rules[0].2 = "other".to_owned()
    }));
    let other = part(folder, "other", "m", "1/2", |_| ());
    let mut record = sample_run("m", 0);
    record.score = 0.1;
    drop(other);
    let differing = History::open(&folder.join("differing")).unwrap();
    let mut campaign = CampaignRecord {
        planned_runs: 8,
        ..sample_campaign("m", 0)
    };
    campaign.shards = vec!["1/2".parse().unwrap()];
    differing.begin_campaign(&campaign).unwrap();
    differing.commit(&record).unwrap();
    drop(differing);
    let whole = History::open(&folder.join("whole")).unwrap();
    whole
        .begin_campaign(&CampaignRecord {
            seed: 8,
            ..sample_campaign("k", 3)
        })
        .unwrap();
    whole.commit(&sample_run("k", 0)).unwrap();
    drop(whole);

    fails(
        folder,
        &["a", "rules", "--into", "new"],
        &["H021", "CloseObject.rls`", "--leave-out rules#k"],
    );
    fails(
        folder,
        &["differing", "a", "--into", "new"],
        &["H020", "of a run: 1", "--leave-out"],
    );
    fails(
        folder,
        &["a", "whole", "--into", "new"],
        &["H022", "`a#k`", "`whole#k`", "--rename"],
    );
    fails(
        folder,
        &["a", "--into", "new", "--leave-out", "a#m"],
        &["H025", "did you mean `a#k`?"],
    );
    fails(
        folder,
        &["a", "nowhere", "--into", "new"],
        &["H003", "nowhere"],
    );
    std::fs::create_dir(folder.join("full")).unwrap();
    std::fs::write(folder.join("full/thing"), "").unwrap();
    fails(
        folder,
        &["a", "--into", "full"],
        &["H003", "holds other files"],
    );
    fails(folder, &["--into", "new"], &["<DIR>"]);
    assert!(!folder.join("new").exists());
    drop(part(folder, "together", "k", "1/2", |_| ()));
    drop(part(folder, "together", "m", "2/2", |_| ()));
    fails(
        folder,
        &["a", "--into", "together"],
        &["H023", "`k` and `m`", "--into"],
    );

    let output = actcheck(
        folder,
        &[
            "merge",
            "a",
            "rules",
            "--into",
            "new",
            "--leave-out",
            "rules#k",
        ],
    );
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let output = actcheck(
        folder,
        &[
            "merge", "whole", "--into", "new", "--rename", "--format", "json",
        ],
    );
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let new = open(folder, "new");
    let ids: Vec<String> = new
        .campaigns()
        .unwrap()
        .into_iter()
        .map(|row| row.id)
        .collect();
    assert_eq!((ids.len(), ids[0].as_str()), (2, "k"), "{ids:?}");
    let (run, renamed) = (sample_run("k", 0), format!("{}-1", ids[1]));
    assert_eq!(new.traces().whole(&renamed).unwrap(), run.trace);
    let detail = new.run(&renamed).unwrap();
    assert_eq!(
        (detail.row.campaign.as_str(), &detail.actions[0].judgements),
        (ids[1].as_str(), &run.judgements[0])
    );
    assert_eq!(
        new.run("k-1").unwrap().actions[0].judgements,
        run.judgements[0]
    );
    drop(new);
    // The renamed campaign is recognised when it is merged again.
    let output = actcheck(folder, &["merge", "whole", "--into", "new"]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert_eq!(open(folder, "new").campaigns().unwrap().len(), 2);
}

#[test]
fn an_interrupted_merge_is_completed_by_the_next() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let sources = [
        part(folder, "a", "k", "1/2", |_| ()),
        part(folder, "b", "k", "2/2", |_| ()),
    ];
    let whole = History::open(&folder.join("whole")).unwrap();
    merged(&sources, &whole);
    let wanted = (all(&whole), table(&whole, END));
    let into = History::open(&folder.join("into")).unwrap();
    // A segment is copied as a whole.
    for (at_once, added) in [(false, 4), (true, 0)] {
        let stop = AtomicBool::new(at_once);
        let plan = plan(&sources, Some(&into), &MergeOptions::default()).unwrap();
        let progress = || stop.store(true, Ordering::Relaxed);
        let merged = carry_out(&plan, &sources, &into, &stop, progress).unwrap();
        assert!(merged.interrupted && merged.runs == added, "{merged:?}");
        let row = into.campaigns().unwrap().remove(0);
        assert!(row.interrupted && row.ended.is_none(), "{row:?}");
    }
    assert_eq!(merged(&sources, &into).runs, 4);
    assert!((all(&into), table(&into, END)) == wanted);
    assert_eq!(merged(&sources, &into).runs, 0);
    assert!((all(&into), table(&into, END)) == wanted);
}

/// Every history of a project contains its regressions, under the same id and with another time.
#[test]
fn runs_with_equal_results_are_kept_once() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (name, minute) in [("a", 1), ("b", 2)] {
        let history = History::open(&folder.join(name)).unwrap();
        history
            .begin_campaign(&sample_campaign("k", minute))
            .unwrap();
        history.commit(&sample_run("k", 0)).unwrap();
        let end = CampaignEnd {
            ended: format!("2026-08-01T13:0{minute}:00Z"),
            ..CampaignEnd::default()
        };
        history.finish_campaign("k", &end).unwrap();
    }
    for (order, into) in [(["a", "b"], "ab"), (["b", "a"], "ba")] {
        let output = actcheck(folder, &["merge", order[0], order[1], "--into", into]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let row = open(folder, into).campaigns().unwrap().remove(0);
        assert_eq!(
            (row.runs, row.started.as_str(), row.ended.as_deref()),
            (1, "2026-08-01T12:01:00Z", Some("2026-08-01T13:01:00Z"))
        );
    }
}

#[test]
fn an_incomplete_copy_is_completed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let history = History::open(&folder.join("a")).unwrap();
    history.begin_campaign(&sample_campaign("k", 0)).unwrap();
    history.commit(&sample_run("k", 0)).unwrap();
    drop(history);
    actcheck(folder, &["merge", "a", "--into", "early"]);
    let history = open(folder, "a");
    (1..6).for_each(|index| history.commit(&sample_run("k", index)).unwrap());
    let end = CampaignEnd {
        ended: "2026-08-01T13:00:00Z".to_owned(),
        score: Some(0.5),
        ..CampaignEnd::default()
    };
    history.finish_campaign("k", &end).unwrap();
    let wanted = all(&history);
    drop(history);
    let output = actcheck(folder, &["merge", "a", "--into", "early"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(all(&open(folder, "early")) == wanted);
}

#[test]
fn later_judgements_and_shrunk_runs_are_merged_under_new_names() {
    merge_of_judgements("");
}

#[test]
fn runs_kept_as_outcomes_are_merged_as_whole_runs_are() {
    merge_of_judgements("\n[history]\nkeep = \"outcomes\"\n");
}

fn merge_of_judgements(keeping: &str) {
    let project = looking();
    let folder = project.path();
    let config = folder.join("configs/look.toml");
    std::fs::write(&config, std::fs::read_to_string(&config).unwrap() + keeping).unwrap();
    for part in 1..=2 {
        run(
            folder,
            &["--shard", &format!("{part}/2"), "--history", "together"],
        );
    }
    let rule = folder.join("rules/plane_found.rls");
    edit(
        &rule,
        "off(\"height\", ?off, 0.01)",
        "off(\"height\", ?off, 0.0001)",
    );
    actcheck(folder, &["recheck", "--history", "together", "PlaneFound"]);
    edit(
        &rule,
        "off(\"height\", ?off, 0.0001)",
        "off(\"height\", ?off, 0.0002)",
    );
    actcheck(folder, &["recheck", "--history", "together", "PlaneFound"]);
    let history = open(folder, "together");
    let failing = history.outcomes(&RunFilter::default()).unwrap();
    let failing = failing
        .iter()
        .find(|row| row.outcome == Outcome::Failed)
        .map(|row| (row.run.clone(), row.index));
    drop(history);
    if let Some((run, _)) = &failing {
        let output = actcheck(
            folder,
            &["shrink", run, "--history", "together", "--trials", "5"],
        );
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    }
    let output = actcheck(folder, &["merge", "together", "--into", "all"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let newest = |history: &History, of: &str| {
        let filter = RunFilter {
            campaign: Some(of.to_owned()),
            ..RunFilter::default()
        };
        history.newest_outcomes(&filter).unwrap()
    };
    let (old, new) = (open(folder, "together"), open(folder, "all"));
    let shrunk = new.selected_campaigns().unwrap();
    let id = new
        .campaigns()
        .unwrap()
        .into_iter()
        .map(|row| row.id)
        .find(|id| !shrunk.contains(id))
        .unwrap();
    let mut rows: Vec<_> = old
        .campaigns()
        .unwrap()
        .iter()
        .filter(|row| row.planned_runs == 8)
        .flat_map(|row| newest(&old, &row.id).rows)
        .map(|row| {
            (
                row.index,
                row.property,
                row.outcome,
                row.margin.map(f64::to_bits),
            )
        })
        .collect();
    rows.sort_by(|a, b| (a.0, &a.1).cmp(&(b.0, &b.1)));
    let joined = newest(&new, &id);
    let found: Vec<_> = joined
        .rows
        .into_iter()
        .map(|row| {
            (
                row.index,
                row.property,
                row.outcome,
                row.margin.map(f64::to_bits),
            )
        })
        .collect();
    assert_eq!((found.len(), joined.rules.len()), (8 * 3, 1));
    assert_eq!(found, rows);
    // Each judgement names an earlier one that exists, down to the campaign's own.
    let loose = "SELECT ?a WHERE { GRAPH act:rechecked { ?a act:supersedes ?b }
        FILTER NOT EXISTS { ?b earl:test ?p } FILTER NOT EXISTS { GRAPH act:rechecked { ?b earl:test ?p } } }";
    assert_eq!(table(&new, loose), Vec::<Vec<Option<Term>>>::new());
    if let Some((_, index)) = failing {
        let query = "SELECT ?original ?label WHERE { ?r act:shrunkFrom ?original ; act:campaign ?c . ?c rdfs:label ?label }";
        let rows = table(&new, query);
        let text = format!("{rows:?}");
        assert_eq!(rows.len(), 1, "{text}");
        assert!(
            text.matches(&format!("{id}-{}", index + 1)).count() == 2,
            "{text} {id} {index}"
        );
    }
}

#[test]
fn a_single_history_is_copied_completely() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let history = History::open(&folder.join("a")).unwrap();
    for (id, minute) in [("z2", 1), ("a1", 2)] {
        history
            .begin_campaign(&sample_campaign(id, minute))
            .unwrap();
        (0..3).for_each(|index| history.commit(&sample_run(id, index)).unwrap());
    }
    let everything = "SELECT ?g ?s ?p ?o WHERE { { ?s ?p ?o } UNION { GRAPH ?g { ?s ?p ?o } } }";
    let quads = |history: &History| {
        table(history, everything)
            .iter()
            .map(|row| format!("{row:?}"))
            .collect::<BTreeSet<_>>()
    };
    let wanted = quads(&history);
    drop(history);
    std::fs::create_dir(folder.join("elsewhere")).unwrap();
    copy(&folder.join("a"), &folder.join("b"));
    let output = actcheck(folder, &["merge", "a", "b", "a", "--into", "all"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(quads(&open(folder, "all")) == wanted);
    // No run is lost in silence.
    for extension in ["details", "states", "motion"] {
        let file = folder.join("b/campaigns/z2/0001").with_extension(extension);
        let column = std::fs::read(&file).unwrap();
        std::fs::remove_file(&file).unwrap();
        let output = actcheck(folder, &["merge", "b", "--into", "lossy"]);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{extension}: {said}");
        assert!(
            (said.contains("H007") || said.contains("H009")) && said.contains(extension),
            "{extension}: {said}"
        );
        std::fs::write(&file, column).unwrap();
        if folder.join("lossy").exists() {
            let (found, _) = History::examine(&folder.join("lossy")).unwrap();
            assert!(found.damage.is_empty(), "{extension}: {found:?}");
            std::fs::remove_dir_all(folder.join("lossy")).unwrap();
        }
    }
}
