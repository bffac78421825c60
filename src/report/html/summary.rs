//! Packs the summary of all runs of a page.

use std::collections::{BTreeMap, BTreeSet};

use rustc_hash::FxHashMap;
use serde_json::{Value, json};

use crate::html::HtmlReport;
use crate::html::columns::{Slot, Slots};
use crate::html::pack::Pack;
use crate::json::findings_with;
use crate::summary::RelationSummary;
use crate::{RateBounds, RelationsSummary, scene_rule};
use actcheck_analysis::{FailureMode, Sampling, score_interval};
use actcheck_base::{Outcome, ShellLine, names};
use actcheck_history::{CampaignRow, RelatedPair, SkillRecord};
use actcheck_verdict::mean;

/// Maximum number of pairs of each relation on the page; `actcheck relate --format json` has all.
const MOST_PAIRS: usize = 5;

/// Packs findings, campaigns and properties. Runs are referred to by index.
pub(super) fn summary(report: &HtmlReport<'_>, slots: &Slots) -> String {
    let runs = &report.table.text("run").texts;
    let places: FxHashMap<&str, usize> = runs.iter().map(String::as_str).zip(0..).collect();
    let mut findings = findings_with(report.findings, modes(report, &places));
    number_runs(&mut findings, &places);
    let mut pack = Pack::default();
    pack.set("served", report.served);
    pack.set("version", report.version);
    pack.set("made", report.made);
    pack.set("history", report.findings.history.as_str());
    pack.set(
        "program",
        ShellLine::new(&report.findings.program).to_string(),
    );
    pack.set(
        "of_history",
        ShellLine::default()
            .option("--history", &report.findings.history)
            .to_string(),
    );
    pack.set("outcomes", Outcome::ALL.map(Outcome::word).to_vec());
    pack.set("privileged", SkillRecord::PRIVILEGED);
    pack.set("scores", scores(report));
    sentences(&mut findings, report);
    pack.set("findings", findings);
    let shown = report
        .campaigns
        .iter()
        .filter(|row| report.findings.campaigns.contains(&row.id));
    let contested: BTreeMap<&String, _> = report
        .contested
        .iter()
        .filter(|(run, _)| places.contains_key(run.as_str()))
        .collect();
    pack.set("contested", json!(contested));
    let relations = report.relations.iter();
    pack.set(
        "relations",
        relations
            .flat_map(|of_campaign| relations_of(of_campaign, &places))
            .collect::<Vec<Value>>(),
    );
    pack.set("campaigns", shown.map(campaign).collect::<Vec<Value>>());
    pack.set(
        "slots",
        slots
            .slots
            .iter()
            .map(|slot| property_slot(slot, report))
            .collect::<Vec<Value>>(),
    );
    pack.set(
        "replays",
        report
            .replays
            .runs()
            .map(|(run, _)| run)
            .collect::<Vec<&str>>(),
    );
    pack.finish()
}

/// The relations of a campaign, each with the first pairs in which it does not hold. A run is its
/// index, or its id if it is not in the page.
fn relations_of(of: &RelationsSummary, places: &FxHashMap<&str, usize>) -> Vec<Value> {
    let shown = |relation: &RelationSummary<'_>| {
        let pairs = relation.violated.iter().take(MOST_PAIRS);
        let pair = |pair: &&RelatedPair| {
            json!({
                "run": pair.run, "place": places.get(pair.run.as_str()), "second": pair.second,
                "because": pair.witness, "shrink": of.shrink(pair).to_string(),
            })
        };
        let holds = relation.kept.interval().map(|interval| {
            let rate = relation.kept.agree as f64 / relation.kept.of as f64;
            json!({ "rate": rate, "low": interval.low, "high": interval.high })
        });
        json!({
            "campaign": of.related.campaign, "relation": relation.name, "holds": holds,
            "kept": relation.kept.agree, "of": relation.kept.of,
            "inapplicable": relation.inapplicable, "violated": relation.violated.len(),
            "pairs": pairs.map(pair).collect::<Vec<Value>>(),
        })
    };
    of.relations().iter().map(shown).collect()
}

/// The failure modes, each with the number of its runs and an example, with a replay if there is
/// one. The mode of each run is in the other part of the page.
fn modes(report: &HtmlReport<'_>, places: &FxHashMap<&str, usize>) -> Vec<Value> {
    let replayed: BTreeSet<&str> = report.replays.runs().map(|(run, _)| run).collect();
    let shown = |mode: &FailureMode| {
        let example = mode
            .runs
            .iter()
            .find(|run| replayed.contains(run.as_str()))
            .or(mode.runs.first());
        let example = example.and_then(|run| places.get(run.as_str()));
        json!({ "failed": mode.failed, "share": mode.share, "count": mode.runs.len(), "example": example })
    };
    report.findings.modes.iter().map(shown).collect()
}

/// Replaces run ids by indices, which take a tenth of the space.
fn number_runs(findings: &mut Value, places: &FxHashMap<&str, usize>) {
    let number = |runs: &mut Value| {
        let known = runs
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(|run| places.get(run.as_str()?));
        *runs = known.copied().collect();
    };
    for property in findings["properties"].as_array_mut().into_iter().flatten() {
        for causes in ["patterns", "effects"] {
            let patterns = property[causes]["found"]
                .as_array_mut()
                .into_iter()
                .flatten();
            patterns.for_each(|pattern| number(&mut pattern["runs"]));
        }
    }
    for action in findings["collisions"].as_array_mut().into_iter().flatten() {
        action["kinds"]
            .as_array_mut()
            .into_iter()
            .flatten()
            .for_each(|kind| number(&mut kind["runs"]));
        for thing in action["things"].as_array_mut().into_iter().flatten() {
            thing["run"] = json!(thing["run"].as_str().and_then(|run| places.get(run)));
        }
    }
}

/// Adds to each pattern the command that generates more of its scenes, if its conditions are on
/// scenes.
fn sentences(findings: &mut Value, report: &HtmlReport<'_>) {
    let summary = report.findings;
    let properties = findings["properties"].as_array_mut().into_iter().flatten();
    for (property, told) in properties.zip(&summary.properties) {
        let found = &told.findings;
        let patterns = property["patterns"]["found"]
            .as_array_mut()
            .into_iter()
            .flatten();
        let confirmed = patterns
            .zip(&found.patterns.patterns)
            .filter(|(_, pattern)| pattern.confirmed);
        for (number, (shown, pattern)) in (1..).zip(confirmed) {
            if scene_rule(&pattern.conditions, &found.input.parameters, "").is_ok() {
                shown["more"] = json!(summary.scene_rule(told.name(), number).to_string());
            }
        }
    }
}

/// Computes T over all runs and over those that are not broken, and the number of runs in which
/// everything passed. Of bit-identical runs only the newest counts.
fn scores(report: &HtmlReport<'_>) -> Value {
    let table = report.table;
    let (runs, status, score) = (
        table.text("run"),
        table.text("status"),
        table.number("score"),
    );
    let counted = table.counted_runs();
    let mut rows: Vec<Option<usize>> = vec![None; runs.texts.len()];
    for (row, run) in runs.of_row.iter().enumerate() {
        if let Some(run) = run
            && counted[*run as usize]
        {
            rows[*run as usize].get_or_insert(row);
        }
    }
    let first: Vec<usize> = rows.into_iter().flatten().collect();
    let of = |row: &usize| score.get(*row).copied().filter(|score| score.is_finite());
    let whole = first
        .iter()
        .filter(|row| status.get(**row) != Some("broken"));
    let modes = &report.findings.modes;
    let passed: u64 = modes
        .iter()
        .filter(|mode| mode.failed.is_empty())
        .map(|mode| mode.runs.len() as u64)
        .sum();
    let tested: u64 = modes.iter().map(|mode| mode.runs.len() as u64).sum();
    let sampling = report.findings.sampling;
    // Without the runs that failed before they were lost.
    let lost = first
        .iter()
        .filter(|row| status.get(**row) != Some("completed"))
        .count() as u64;
    let lost = lost.min((first.len() as u64).saturating_sub(tested));
    let bounds = RateBounds::new(passed, first.len() as u64 - lost, lost, sampling);
    let mut statuses: BTreeMap<&str, u64> = BTreeMap::new();
    first
        .iter()
        .filter_map(|row| status.get(*row))
        .for_each(|word| *statuses.entry(word).or_default() += 1);
    json!({
        "T": mean(first.iter().filter_map(of)), "T_interval": score_interval(first.iter().filter_map(of)),
        "without_broken": mean(whole.clone().filter_map(of)), "without_broken_interval": score_interval(whole.filter_map(of)),
        "runs": first.len(), "all_passed": sampling.interval(passed, tested), "stopped": sampling == Sampling::Stopped,
        "bounds": bounds.map(|bounds| json!({
            "lost": bounds.lost, "as_failures": bounds.as_failures.interval, "as_passes": bounds.as_passes.interval,
        })), "passed": passed, "tested": tested,
        "statuses": statuses, "twins": report.findings.twins,
    })
}

fn campaign(row: &CampaignRow) -> Value {
    json!({
        "id": row.id, "name": row.name, "started": row.started, "ended": row.ended, "ended_by": row.ended_by,
        "interrupted": row.interrupted, "seed": row.seed, "planned": row.planned_runs, "runs": row.runs,
        "score": row.score, "without_broken": row.score_without_broken, "version": row.program_version,
        "config": row.config_digest, "ontology": row.ontology_digest,
        "skill": row.skill.as_ref().map(|skill| &skill.command),
        "privileged": row.skill.as_ref().is_some_and(|skill| skill.privileged),
    })
}

fn property_slot(slot: &Slot, report: &HtmlReport<'_>) -> Value {
    let words = report.words.get(&slot.property);
    let of =
        report.findings.properties.iter().position(|of| {
            of.findings.action == slot.action && of.findings.property == slot.property
        });
    json!({
        "step": slot.step, "action": names::local(&slot.action), "property": names::local(&slot.property),
        "iri": slot.property, "label": words.map(|words| &words.label),
        "comment": words.and_then(|words| words.comment.as_ref()), "rule": words.map(|words| &words.rule),
        "bounds": words.map(|words| words.bounds.iter().map(|bound| json!({ "at": bound.at, "below": bound.below })).collect::<Vec<_>>()),
        "of": of,
    })
}
