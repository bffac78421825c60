//! Comparison of two campaigns: the rates of false alarms and of findings agree with theory in
//! simulation; and with real skills.

use std::collections::BTreeMap;
use std::path::Path;

use actcheck::analysis::{
    Answer, Compared, ComparedRun, Comparison, PairedTable, Sampling, compare, compared_runs,
};
use actcheck::base::{Outcome, names};
use actcheck::data::Choices;
use actcheck::history::{CampaignEnd, History, OutcomeRow, RunRow, RunStatus, SceneDigest};
use serde_json::Value;

use crate::history::{sample_campaign, sample_run};
use crate::support::look::looking;
use crate::support::{actcheck, edit, project, stderr, stdout};

const LEVEL: f64 = 0.05;
const CAMPAIGNS: u64 = 200;

/// A campaign of coin flips: each property passes with its own probability, independently in each
/// scene.
fn flipped(choices: &mut Choices, scenes: u64, rates: &[f64]) -> Vec<ComparedRun> {
    let (mut rows, mut outcomes, mut digests) = (Vec::new(), Vec::new(), BTreeMap::new());
    for index in 0..scenes {
        let run = format!("k-{}", index + 1);
        digests.insert(
            run.clone(),
            SceneDigest {
                arrangement: format!("scene {index}"),
                physics: String::new(),
            },
        );
        rows.push(RunRow {
            run: run.clone(),
            campaign: "k".to_owned(),
            index,
            repetition: None,
            weight: None,
            test: "Pick".to_owned(),
            status: RunStatus::Completed,
            score: 1.0,
            trace_hash: String::new(),
            started: String::new(),
        });
        outcomes.extend(rates.iter().enumerate().map(|(property, rate)| OutcomeRow {
            run: run.clone(),
            campaign: "k".to_owned(),
            index,
            test: "Pick".to_owned(),
            step: 1,
            action: "Pick".to_owned(),
            property: format!("p{property}"),
            outcome: if choices.real("flip".into(), 0.0, 1.0, 0.0) < *rate {
                Outcome::Passed
            } else {
                Outcome::Failed
            },
            margin: None,
        }));
    }
    compared_runs(&rows, &digests, &outcomes)
}

/// Generates pairs of campaigns with the given rates; returns the number of pairs that raise an
/// alarm.
fn alarms(seed: u64, scenes: u64, first: &[f64], second: &[f64]) -> u64 {
    (0..CAMPAIGNS)
        .filter(|index| {
            let mut choices = Choices::random(seed, *index);
            let first = flipped(&mut choices, scenes, first);
            let second = flipped(&mut choices, scenes, second);
            !compare(&first, &second, Sampling::Fixed)
                .worse_at(LEVEL)
                .is_empty()
        })
        .count() as u64
}

/// Probability of each number of successes.
fn binomial(trials: u64, probability: f64) -> Vec<f64> {
    (0..trials).fold(vec![1.0], |row, _| {
        let mut next = vec![0.0; row.len() + 1];
        for (successes, share) in row.iter().enumerate() {
            next[successes] += share * (1.0 - probability);
            next[successes + 1] += share * probability;
        }
        next
    })
}

/// Probability of an alarm with one property, by enumerating all tables: the number of discordant
/// scenes, and their direction.
///
/// A campaign of one property has two identical lines, so each is tested at half the level.
fn theory(scenes: u64, first: f64, second: f64) -> f64 {
    let (down, up) = (first * (1.0 - second), (1.0 - first) * second);
    let mut power = 0.0;
    for (differing, share) in (0u64..).zip(binomial(scenes, down + up)) {
        for (only_first, chance) in (0u64..).zip(binomial(differing, down / (down + up))) {
            let table = PairedTable {
                only_first,
                only_second: differing - only_first,
                ..PairedTable::default()
            };
            power += if 2.0 * table.test().second_worse <= LEVEL {
                share * chance
            } else {
                0.0
            };
        }
    }
    power
}

#[test]
fn false_alarms_for_equal_skills_are_at_most_the_level() {
    for (seed, scenes, rates) in [
        (1, 30, &[0.5][..]),
        (2, 100, &[0.8]),
        (3, 60, &[0.9, 0.7, 0.5]),
        (4, 200, &[0.95, 0.6, 0.4, 0.2]),
    ] {
        let found = alarms(seed, scenes, rates, rates);
        assert!(
            found as f64 <= LEVEL * CAMPAIGNS as f64,
            "{found} false alarms of {CAMPAIGNS} with {rates:?}"
        );
    }
    // Not by chance: the exact probability is at most the level for any number of scenes and any
    // rate.
    for scenes in [1, 5, 10, 30, 60, 100] {
        for rate in [0.1, 0.5, 0.8, 0.99] {
            let probability = theory(scenes, rate, rate);
            assert!(
                probability <= LEVEL,
                "{scenes} scenes, rate {rate}: {probability}"
            );
        }
    }
}

#[test]
fn a_better_skill_raises_even_fewer_alarms() {
    assert_eq!(alarms(5, 60, &[0.6, 0.6], &[0.9, 0.9]), 0);
}

#[test]
fn a_worse_skill_is_found_with_the_theoretical_power() {
    for (seed, scenes, first, second) in [
        (11, 40, 0.9, 0.6),
        (12, 60, 0.8, 0.65),
        (13, 100, 0.7, 0.5),
        (14, 100, 0.95, 0.85),
        (15, 30, 0.95, 0.3),
    ] {
        let power = theory(scenes, first, second);
        let found = alarms(seed, scenes, &[first], &[second]);
        // Three and a half standard deviations: one seed in two thousand falls outside.
        let expected = power * CAMPAIGNS as f64;
        let spread = 3.5 * (expected * (1.0 - power)).sqrt() + 0.5;
        assert!(
            (found as f64 - expected).abs() <= spread,
            "{scenes} scenes, {first} → {second}: {found} of {CAMPAIGNS} found, {expected:.1} ± {spread:.1} expected"
        );
    }
}

#[test]
fn the_interval_covers_the_true_difference() {
    let (mut covered, truth) = (0, 0.6 - 0.75);
    for index in 0..1000 {
        let mut choices = Choices::random(21, index);
        let first = flipped(&mut choices, 80, &[0.75]);
        let second = flipped(&mut choices, 80, &[0.6]);
        let difference = compare(&first, &second, Sampling::Fixed).lines[0]
            .difference
            .unwrap();
        covered += u64::from(difference.low <= truth && truth <= difference.high);
    }
    // 95 % of a thousand, less three and a half standard deviations of that.
    assert!((926..=974).contains(&covered), "{covered} of 1000");
}

fn run(folder: &Path, config: &str, history: &str) -> String {
    let arguments = [
        "run",
        config,
        "--runs",
        "12",
        "--history",
        history,
        "--format",
        "json",
    ];
    let output = actcheck(folder, &arguments);
    let json: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    json["campaign"].as_str().unwrap().to_owned()
}

fn compared(folder: &Path, arguments: &[&str]) -> (i32, Value) {
    let output = actcheck(
        folder,
        &[&["compare", "--format", "json"], arguments].concat(),
    );
    let json =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    (output.status.code().unwrap(), json)
}

fn whole(json: &Value) -> &Value {
    json["lines"]
        .as_array()
        .unwrap()
        .iter()
        .find(|line| line["property"].is_null())
        .unwrap()
}

#[test]
fn a_skill_with_worse_perception_is_found_worse_and_an_equal_one_is_not() {
    let project = looking();
    let folder = project.path();
    let look = std::fs::read_to_string(folder.join("configs/look.toml")).unwrap();
    let with_camera = |range_noise: &str| {
        let (before, rest) = look.split_once("[camera]").unwrap();
        let (_, after) = rest.split_once("[sensing]").unwrap();
        format!(
            "{before}[camera]\nwidth = 320\nheight = 240\nrange_noise_m = {range_noise}\n\n[sensing]{after}"
        )
    };
    std::fs::write(folder.join("configs/sharp.toml"), with_camera("0.0")).unwrap();
    std::fs::write(folder.join("configs/blind.toml"), with_camera("0.1")).unwrap();
    let [good, again] = ["a", "a"].map(|history| run(folder, "configs/sharp.toml", history));
    let bad = run(folder, "configs/blind.toml", "b");

    let (code, json) = compared(
        folder,
        &[&good, &again, "--history", "a", "--fail-if-worse", "0.05"],
    );
    assert_eq!(
        (
            code,
            &json["pairs"],
            json["worse"].as_array().unwrap().len()
        ),
        (0, &Value::from(12), 0),
        "{json:#}"
    );
    assert_eq!(
        (
            json["changes"].as_array().unwrap().len(),
            &whole(&json)["p"]
        ),
        (0, &Value::from(1.0))
    );

    let (code, json) = compared(
        folder,
        &["a", &format!("b#{bad}"), "--fail-if-worse", "0.05"],
    );
    assert_eq!((code, &json["pairs"]), (1, &Value::from(12)), "{json:#}");
    assert_eq!(
        json["config_only_in_b"],
        serde_json::json!(["[camera] range_noise_m = 0.1"])
    );
    assert_eq!(json["changes"].as_array().unwrap().len(), 1, "{json:#}");
    assert!(!json["worse"].as_array().unwrap().is_empty(), "{json:#}");
    let whole = whole(&json);
    assert!(
        whole["difference"]["high"].as_f64().unwrap() < 0.0,
        "{whole:#}"
    );
    let flipped = whole["worse"].as_array().unwrap();
    assert_eq!(
        flipped.len() as u64,
        whole["table"]["only_first"].as_u64().unwrap()
    );
    let same_number = |pair: &Value| {
        let [a, b] = [0, 1].map(|side| {
            pair[side]
                .as_str()
                .unwrap()
                .rsplit_once('-')
                .unwrap()
                .1
                .to_owned()
        });
        a == b
    };
    assert!(flipped.iter().all(same_number), "{flipped:?}");
    // The other way round, the skill is better: no alarm.
    assert_eq!(
        compared(
            folder,
            &[&format!("b#{bad}"), "a", "--fail-if-worse", "0.05"]
        )
        .0,
        0
    );
}

/// A history of sample runs. Those with an index in `failing` fail `MovedObject`; all other
/// outcomes are passes.
fn samples(folder: &Path, name: &str, campaign: &str, runs: u64, failing: &[u64]) -> History {
    let history = History::open(&folder.join(name)).unwrap();
    history
        .begin_campaign(&sample_campaign(campaign, 0))
        .unwrap();
    for index in 0..runs {
        let mut record = sample_run(campaign, index);
        for judgement in record.judgements.iter_mut().flatten() {
            let fails = failing.contains(&index) && judgement.property == names::act("MovedObject");
            judgement.outcome = if fails {
                Outcome::Failed
            } else {
                Outcome::Passed
            };
        }
        history.commit(&record).unwrap();
    }
    history
        .finish_campaign(
            campaign,
            &CampaignEnd {
                ended: "2026-08-01T13:00:00Z".to_owned(),
                ..CampaignEnd::default()
            },
        )
        .unwrap();
    history
}

#[test]
fn every_format_shows_the_flips_and_the_verdict() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    drop(samples(folder, "a", "k", 12, &[3]));
    drop(samples(folder, "b", "k", 10, &[0, 1, 2, 4, 5, 6, 7, 8]));
    let text = stdout(&actcheck(
        folder,
        &["compare", "a", "b", "--fail-if-worse", "0.05"],
    ));
    for wanted in [
        "10 scenes in both",
        "2 only in A: k-11, k-12",
        "Pick MovedObject, passed in A, failed in B (8): k-1/k-1, k-2/k-2",
        "failed in A, passed in B (1): k-4/k-4",
    ] {
        assert!(text.contains(wanted), "no `{wanted}` in\n{text}");
    }
    // 9 scenes differ, 8 of them in one direction: (1 + 9) / 2⁹ = 0.0195, multiplied by six for the
    // six lines.
    assert!(text.contains("B is not shown to be worse"), "{text}");
    let csv = stdout(&actcheck(folder, &["compare", "a", "b", "--format", "csv"]));
    let moved = csv
        .lines()
        .find(|line| line.contains("MovedObject"))
        .unwrap();
    assert!(moved.contains(",10,1,8,1,0,-0.7,"), "{csv}");
    assert!(
        moved.contains(",0.0390625") && moved.contains(",0.01953125"),
        "{csv}"
    );
    let output = actcheck(folder, &["compare", "a", "b", "--fail-if-worse", "0.2"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        stdout(&output).contains("Pick MovedObject: p = 0.1172"),
        "{}",
        stdout(&output)
    );
}

#[test]
fn later_judgements_can_be_compared_as_a_side() {
    let project = project();
    let folder = project.path();
    actcheck(
        folder,
        &["run", "configs/pick.toml", "--runs", "5", "--history", "h"],
    );
    let id = History::open(&folder.join("h"))
        .unwrap()
        .campaigns()
        .unwrap()[0]
        .id
        .clone();
    edit(
        &folder.join("rules/moved_object.rls"),
        "?d > 0.02",
        "?d > 0.45",
    );
    let output = actcheck(folder, &["recheck", "--history", "h"]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let (code, json) = compared(folder, &[&id, &format!("{id}@rechecked"), "--history", "h"]);
    assert_eq!((code, &json["pairs"]), (0, &Value::from(5)));
    let lines = json["lines"].as_array().unwrap();
    let flips = |name: &str| {
        let line = lines
            .iter()
            .find(|line| line["property"] == names::act(name))
            .unwrap();
        line["worse"].as_array().unwrap().len()
    };
    assert!(flips("MovedObject") > 0, "{json:#}");
    assert_eq!(flips("CloseObject"), 0);
    let changes = json["changes"].as_array().unwrap();
    assert_eq!(changes.len(), 1, "{json:#}");
    assert_eq!(changes[0]["kind"], "rule");
    let (_, json) = compared(
        folder,
        &[
            &format!("{id}@rechecked"),
            &format!("{id}@rechecked"),
            "--history",
            "h",
        ],
    );
    assert_eq!(json["changes"].as_array().unwrap().len(), 0);
}

#[test]
fn impossible_comparisons_are_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    drop(samples(folder, "a", "k", 2, &[]));
    let empty = History::open(&folder.join("empty")).unwrap();
    empty.begin_campaign(&sample_campaign("k", 0)).unwrap();
    drop(empty);
    let other = History::open(&folder.join("seed")).unwrap();
    other
        .begin_campaign(&actcheck::history::CampaignRecord {
            seed: 8,
            ..sample_campaign("k", 0)
        })
        .unwrap();
    let mut record = sample_run("k", 0);
    record.scene.base = [0.0; 3];
    other.commit(&record).unwrap();
    drop(other);
    drop(History::open(&folder.join("none")).unwrap());
    let fails = |arguments: &[&str], wanted: &[&str]| {
        let output = actcheck(folder, &[&["compare"], arguments].concat());
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?} {text}");
        wanted
            .iter()
            .for_each(|wanted| assert!(text.contains(wanted), "no `{wanted}` in {text}"));
    };
    fails(&["a", "empty"], &["X071", "`empty` has no runs"]);
    fails(&["a", "seed"], &["X071", "seeds differ"]);
    fails(&["a", "none"], &["X070", "no campaign"]);
    fails(&["a#kk", "a"], &["H014", "did you mean `k`?"]);
    fails(&["k", "a"], &["X002"]);
    fails(&["a", "nowhere#k"], &["H003", "nowhere"]);
    fails(
        &["a", "a", "--fail-if-worse", "5"],
        &["a probability above 0 and below 1"],
    );
    fails(&["a"], &["<B>"]);
}

/// Regression: if a campaign began in the same second as its regressions, the last id in the
/// alphabet counted as the newest campaign.
#[test]
fn a_campaign_is_newer_than_its_regressions() {
    let project = looking();
    let folder = project.path();
    let ran = |history: &str| {
        let run = [
            "run",
            "configs/look.toml",
            "--runs",
            "1",
            "--history",
            history,
            "--format",
            "json",
        ];
        let output = actcheck(folder, &run);
        let json: Value = serde_json::from_str(&stdout(&output))
            .unwrap_or_else(|_| panic!("{}", stderr(&output)));
        json["campaign"].clone()
    };
    let run = format!("{}-1", ran("old").as_str().unwrap());
    let exported = actcheck(
        folder,
        &["export", "run", &run, "--regression", "--history", "old"],
    );
    assert!(exported.status.success(), "{}", stderr(&exported));
    for history in ["a", "b", "c", "d"] {
        // Another text gives the campaign another id.
        edit(
            &folder.join("configs/look.toml"),
            "\ntests =",
            &format!("\n# {history}\ntests ="),
        );
        let campaign = ran(history);
        let (_, json) = compared(folder, &["old", history]);
        assert_eq!(json["b"]["campaign"], campaign, "{json:#}");
    }
}

#[test]
fn a_campaign_compared_with_itself_is_the_same() {
    let mut runs = flipped(&mut Choices::random(31, 0), 20, &[0.5, 0.5]);
    // Without known states, equal outcomes decide nothing.
    let open = compare(&runs, &runs, Sampling::Fixed).answer(LEVEL, 0.05);
    assert!(matches!(open, Answer::Underpowered { .. }), "{open:?}");
    runs.iter_mut().for_each(|run| run.states = Some(1));
    let found = compare(&runs, &runs, Sampling::Fixed);
    assert_eq!(found.answer(LEVEL, 0.05), Answer::Same);
    let fewer = compare(&runs, &runs[1..], Sampling::Fixed);
    assert_ne!(fewer.answer(LEVEL, 0.05), Answer::Same);
    let mut others = runs.clone();
    others[3].states = Some(2);
    assert!(!compare(&runs, &others, Sampling::Fixed).is_same);
    let Comparison { pairs, lines, .. } = found;
    assert_eq!(
        (pairs, lines.len(), &lines[0].of),
        (20, 3, &Compared::WholeRun)
    );
    assert!(
        lines.iter().all(|line| line.test.two_sided == 1.0
            && line.worse.is_empty()
            && line.better.is_empty())
    );
}
