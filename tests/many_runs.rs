//! Histories of many runs: merged shards take the same space, lists are read a part at a time, and
//! reports have a sample.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use actcheck::analysis::{
    Mirror, OutcomeTable, PatternOptions, RATE_COLUMNS, TableFilter, finding_columns, judged,
    property_findings,
};
use actcheck::base::Shard;
use actcheck::history::merge::{MergeOptions, carry_out, plan};
use actcheck::history::{CampaignEnd, History, RunFilter, RunRecord};
use actcheck::report::{HTML_COLUMNS, HtmlReport, PackedRuns, Replays, html};
use serde_json::Value;

use crate::findings::runs as made_up;
use crate::history::{sample_campaign, sample_run};
use crate::support::chromium::Chromium;
use crate::support::{actcheck, paged, stderr, stdout};

const SHARDS: u64 = 3;
const RUNS: u64 = 600;

/// One of this many runs is kept whole.
const WHOLE: u64 = 50;

fn end() -> CampaignEnd {
    CampaignEnd {
        ended: "2026-08-01T13:00:00Z".to_owned(),
        ..CampaignEnd::default()
    }
}

/// A history with the runs of a shard, or of all.
fn make(dir: &Path, shard: Option<Shard>) -> History {
    let history = History::open(dir).unwrap();
    let mut campaign = sample_campaign("k", 0);
    (campaign.planned_runs, campaign.shards) = (RUNS, shard.into_iter().collect());
    history.begin_campaign(&campaign).unwrap();
    let own: Vec<u64> = (0..RUNS)
        .filter(|index| shard.is_none_or(|shard| shard.has(*index)))
        .collect();
    let (whole, others): (Vec<u64>, Vec<u64>) =
        own.into_iter().partition(|index| index % WHOLE == 7);
    whole
        .into_iter()
        .for_each(|index| history.commit(&sample_run("k", index)).unwrap());
    for indices in others.chunks(128) {
        let runs: Vec<RunRecord> = indices
            .iter()
            .map(|index| sample_run("k", *index))
            .collect();
        runs.iter()
            .for_each(|run| history.commit_outcomes(run).unwrap());
    }
    history.finish_campaign("k", &end()).unwrap();
    history
}

/// Size of the columns of all runs. Unit: bytes.
fn size(history: &Path) -> u64 {
    let files = std::fs::read_dir(history.join("campaigns/k")).unwrap();
    files
        .map(|entry| entry.unwrap().metadata().unwrap().len())
        .sum()
}

#[test]
fn runs_of_shards_become_runs_of_the_merged_history() {
    let folder = tempfile::tempdir().unwrap();
    let alone = make(&folder.path().join("alone"), None);
    let mut sizes = 0;
    for number in 1..=SHARDS {
        let dir = folder.path().join(number.to_string());
        let shard = make(&dir, Shard::new(number, SHARDS));
        Mirror::update(&shard).unwrap();
        sizes += size(&dir);
    }
    let open =
        |number: u64| History::open_to_read(&folder.path().join(number.to_string())).unwrap();
    let sources: Vec<History> = (1..=SHARDS).map(open).collect();
    let into = History::open(&folder.path().join("all")).unwrap();
    let planned = plan(&sources, Some(&into), &MergeOptions::default()).unwrap();
    let merged = carry_out(&planned, &sources, &into, &AtomicBool::new(false), || ()).unwrap();
    assert_eq!((merged.runs, merged.interrupted), (RUNS, false));
    let merged_size = size(&folder.path().join("all"));
    assert!(merged_size < sizes + sizes / 10, "{merged_size} of {sizes}");
    assert_eq!(
        Mirror::adopt(&planned, &sources, &into).unwrap() as u64,
        SHARDS
    );
    let (mirror, change) = Mirror::update(&into).unwrap();
    assert_eq!(
        (change.kept as u64, change.added, change.damaged),
        (RUNS, 0, 0)
    );
    assert_eq!(
        mirror.rows(&TableFilter::default()),
        into.outcomes(&RunFilter::default()).unwrap().len()
    );

    let all = RunFilter::default();
    let [runs, wanted] = [&into, &alone].map(|history| history.runs(&all).unwrap());
    assert_eq!(runs, wanted);
    assert_eq!(into.outcomes(&all).unwrap(), alone.outcomes(&all).unwrap());
    assert_eq!(
        into.newest_outcomes(&all).unwrap(),
        alone.newest_outcomes(&all).unwrap()
    );
    assert_eq!(into.scenes(&runs).unwrap(), alone.scenes(&runs).unwrap());
    for run in ["k-1", "k-2", "k-8", "k-599", "@last"] {
        assert_eq!(
            into.newest_run(run).unwrap(),
            alone.newest_run(run).unwrap(),
            "{run}"
        );
    }
    for index in [7, 57, 58] {
        let run = format!("k-{}", index + 1);
        assert_eq!(into.is_whole(&run).unwrap(), index % WHOLE == 7);
        assert_eq!(
            into.traces().recorded(&run).unwrap(),
            alone.traces().recorded(&run).unwrap()
        );
    }
    assert_eq!(History::count_runs(into.dir()), RUNS);

    // Once more: nothing is added, and nothing is lost.
    drop(mirror);
    let again = plan(&sources, Some(&into), &MergeOptions::default()).unwrap();
    assert_eq!(
        carry_out(&again, &sources, &into, &AtomicBool::new(false), || ())
            .unwrap()
            .runs,
        0
    );
    assert_eq!(into.runs(&all).unwrap(), wanted);
}

#[test]
fn a_damaged_run_of_a_shard_is_not_copied() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("1");
    drop(make(&dir, Shard::new(1, SHARDS)));
    for extension in ["details", "states", "motion", "runs"] {
        let file = dir.join("campaigns/k/0001").with_extension(extension);
        let whole = std::fs::read(&file).unwrap();
        let mut bytes = whole.clone();
        let last = bytes.len() - 1;
        bytes[last] ^= 1;
        std::fs::write(&file, bytes).unwrap();
        let all = folder.path().join(format!("all but {extension}"));
        let into = History::open(&all).unwrap();
        let merged = History::open_to_read(&dir).and_then(|source| {
            let sources = [source];
            let planned = plan(&sources, Some(&into), &MergeOptions::default())?;
            carry_out(&planned, &sources, &into, &AtomicBool::new(false), || ())
        });
        let faults = merged.unwrap_err();
        assert_eq!(faults.iter().next().unwrap().code, "H007", "{faults}");
        drop(into);
        // Whatever was copied before is intact, and the campaign has no end.
        let (found, into) = History::examine(&all).unwrap();
        assert!(found.damage.is_empty(), "{extension}: {found:?}");
        let campaigns = into.campaigns().unwrap();
        assert!(campaigns.iter().all(|campaign| campaign.ended.is_none()));
        std::fs::write(&file, whole).unwrap();
    }
}

#[test]
fn lists_of_many_runs_are_printed_in_parts() {
    const MANY: u64 = 10_050;
    let folder = tempfile::tempdir().unwrap();
    let history = History::open(&folder.path().join("h")).unwrap();
    history.begin_campaign(&sample_campaign("k", 0)).unwrap();
    let indices: Vec<u64> = (0..MANY).collect();
    for indices in indices.chunks(128) {
        let runs: Vec<RunRecord> = indices
            .iter()
            .map(|index| sample_run("k", *index))
            .collect();
        runs.iter()
            .for_each(|run| history.commit_outcomes(run).unwrap());
    }
    history.finish_campaign("k", &end()).unwrap();
    drop(history);
    let printed = |format: &str| {
        let output = actcheck(
            folder.path(),
            &["list", "--history", "h", "--format", format],
        );
        assert!(output.status.success(), "{}", stderr(&output));
        stdout(&output)
    };
    let wanted: Vec<String> = (1..=MANY).map(|number| format!("k-{number}")).collect();
    let csv = printed("csv");
    assert_eq!(
        csv.lines()
            .skip(1)
            .map(|line| line.split_once(',').unwrap().0)
            .collect::<Vec<_>>(),
        wanted
    );
    let json: Value = serde_json::from_str(&printed("json")).unwrap();
    let ids: Vec<&str> = json
        .as_array()
        .unwrap()
        .iter()
        .map(|run| run["run"].as_str().unwrap())
        .collect();
    assert_eq!(ids, wanted);
    let text = printed("text");
    let words = text
        .lines()
        .filter_map(|line| line.split_whitespace().next());
    assert_eq!(
        words
            .filter(|word| word.starts_with("k-"))
            .collect::<Vec<_>>(),
        wanted
    );
}

/// A mirror of ten files.
fn mirror(folder: &Path) -> Mirror {
    let mut runs = Vec::new();
    for _ in 0..10 {
        runs.extend(made_up("k", 2_000, 0.05));
    }
    for (index, run) in (0..).zip(&mut runs) {
        run.row.run = format!("k-{}", index + 1);
        run.row.index = index;
        run.row.trace_hash = format!("{index:x}");
    }
    paged::mirror(folder, "k", runs)
}

#[test]
fn a_sample_has_files_at_equal_distances_and_rates_are_of_all_runs() {
    let folder = tempfile::tempdir().unwrap();
    let mirror = mirror(folder.path());
    let filter = TableFilter::default();
    let rows = mirror.rows(&filter);
    let all = OutcomeTable::read(&mirror, &filter, &finding_columns()).unwrap();
    let rates = OutcomeTable::read(&mirror, &filter, &RATE_COLUMNS).unwrap();
    let sample = OutcomeTable::read_sample(&mirror, &filter, &finding_columns(), rows / 5).unwrap();
    assert_eq!(
        (all.len(), rates.len(), sample.len()),
        (rows, rows, rows / 5)
    );
    let indices: BTreeSet<u64> = sample
        .text("run")
        .texts
        .iter()
        .map(|run| (run.rsplit_once('-').unwrap().1.parse::<u64>().unwrap() - 1) / 2_000)
        .collect();
    assert_eq!(indices.into_iter().collect::<Vec<_>>(), [4, 9]);
    let whole = OutcomeTable::read_sample(&mirror, &filter, &finding_columns(), rows).unwrap();
    assert_eq!((whole.len(), whole.text("run")), (rows, all.text("run")));

    let options = PatternOptions::default();
    let (of_all, of_sample) = (judged(&rates), judged(&sample));
    let exact = property_findings(&all, &judged(&all)[0], &Default::default(), &options);
    let found = property_findings(&sample, &of_sample[0], &Default::default(), &options)
        .with_rates_of(&rates, &of_all[0]);
    assert_eq!((found.counts, found.failing), (exact.counts, exact.failing));
    assert_eq!(
        (&found.margins, found.twins, found.repeated),
        (&exact.margins, exact.twins, exact.repeated)
    );
    assert!(found.patterns.runs < exact.patterns.runs);
}

/// A text without the spaces between its words and digits.
fn digits(text: &Value) -> String {
    text.as_str()
        .unwrap()
        .chars()
        .filter(|letter| !letter.is_whitespace())
        .collect()
}

/// The page of a sample counts and filters all runs, and shows the parameters of the sampled ones.
#[test]
fn a_report_with_a_sample_filters_all_runs() {
    let folder = tempfile::tempdir().unwrap();
    let mirror = mirror(folder.path());
    let filter = TableFilter::default();
    let names: Vec<&str> = finding_columns().into_iter().chain(HTML_COLUMNS).collect();
    let rates: Vec<&str> = RATE_COLUMNS
        .into_iter()
        .chain(["index", "repetition", "test", "score"])
        .collect();
    let all = OutcomeTable::read(&mirror, &filter, &rates).unwrap();
    let sample = OutcomeTable::read_sample(&mirror, &filter, &names, all.len() / 10).unwrap();
    let findings = paged::findings(&sample, "h");
    let modes = paged::findings(&all, "h").modes;
    let findings = actcheck::report::FindingsSummary {
        modes,
        sampled_runs: Some(2_000),
        ..findings
    };
    let page = html(&HtmlReport {
        version: "0.1.0",
        made: "2026-01-01T00:00:00Z",
        findings: &findings,
        table: &all,
        runs: &PackedRuns::of(&findings, &all, Some(&sample)),
        campaigns: &[],
        words: &Default::default(),
        replays: &Replays::default(),
        contested: &Default::default(),
        relations: &[],
        served: false,
    });
    let file = folder.path().join("report.html");
    std::fs::write(&file, page).unwrap();
    let mut browser = Chromium::start();
    browser.size(1280, 860);
    browser.open(&file, "/");
    let lead = browser.value("document.querySelector('main').textContent");
    assert!(
        digits(&lead).contains("20000runs") && digits(&lead).contains("ofasampleof2000runs"),
        "{lead}"
    );
    browser.open(&file, "/runs");
    let told = "document.querySelector('.told').textContent";
    assert_eq!(digits(&browser.value(told)), "20000of20000runs");
    browser.open(&file, "/runs?q=k-19999");
    assert_eq!(digits(&browser.value(told)), "1of20000runs");
    browser.open(&file, "/runs?outcome=failed");
    let failed = digits(&browser.value(told));
    let failures = judged(&all)
        .iter()
        .map(|of| of.counts.failed)
        .max()
        .unwrap_or_default();
    let shown: u64 = failed.split("of").next().unwrap().parse().unwrap();
    assert!(shown >= failures && shown < 20_000, "{failed}");
    // The last row can be reached.
    browser.open(&file, "/runs");
    browser.value("document.querySelector('.list').dispatchEvent(new KeyboardEvent('keydown', { key: 'End' }))");
    browser.until("document.querySelector('.row.active .id a')?.textContent === 'k-20000'");
    // A run of the sample has its parameters; another has its outcomes.
    browser.open(&file, "/run/k-20000");
    assert_ne!(
        browser.value("document.querySelectorAll('.parameters div').length"),
        0
    );
    browser.open(&file, "/run/k-1");
    assert_eq!(
        browser.value("document.querySelectorAll('.parameters div').length"),
        0
    );
    assert_ne!(
        browser.value("document.querySelectorAll('.outcomes li').length"),
        0
    );
    for view in ["/properties", "/modes", "/patterns", "/map", "/history"] {
        browser.open(&file, view);
    }
    assert!(browser.complaints.is_empty(), "{:#?}", browser.complaints);
}
