//! Assembles the page of a comparison.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use crate::formats::flip_words;
use crate::html::pack::Pack;
use crate::html::page::assembled;
use crate::html::scripts::REVIEW_SCRIPT;
use crate::html::{PropertyWords, Replays};
use crate::json::compare_json;
use crate::summary::outcomes_of;
use crate::{FlipGroup, Review, ReviewPair, ReviewRun};
use actcheck_base::names;

/// The content of a page that compares two campaigns.
#[derive(Debug)]
pub struct ReviewPage<'a> {
    /// Version of the program that generates it.
    pub version: &'a str,
    /// Generation time (RFC 3339).
    pub made: &'a str,
    /// The comparison with its flipped runs.
    pub review: &'a Review<'a>,
    /// Names of properties, by IRI.
    pub words: &'a BTreeMap<String, PropertyWords>,
    /// Units of margins, by the IRI of the property.
    pub units: &'a BTreeMap<String, String>,
    /// The flipped runs that can be played back, by their keys.
    pub replays: &'a Replays,
}

/// Returns the comparison as one page that loads no external resources.
///
/// The same comparison gives the same page. Its markup has no user text: see the module.
pub fn review_html(page: &ReviewPage<'_>) -> String {
    let data = [("review", content(page))];
    assembled(&REVIEW_SCRIPT, &data, page.replays, false)
}

fn content(page: &ReviewPage<'_>) -> String {
    let review = page.review;
    let mut pack = Pack::default();
    pack.set("version", page.version);
    pack.set("made", page.made);
    pack.set("headline", review.headline());
    pack.set("answer", review.answer());
    pack.set("compared", compare_json(review.summary));
    let groups = review.summary.flip_groups();
    pack.set(
        "groups",
        groups
            .iter()
            .map(|group| group_of(review, group))
            .collect::<Vec<Value>>(),
    );
    pack.set(
        "replays",
        page.replays
            .runs()
            .map(|(run, _)| run)
            .collect::<Vec<&str>>(),
    );
    let slot = |(iri, words): (&String, &PropertyWords)| {
        let bounds = words.bounds.iter();
        json!({
            "iri": iri, "label": words.label, "comment": words.comment, "unit": page.units.get(iri),
            "bounds": bounds.map(|bound| json!({ "at": bound.at, "below": bound.below })).collect::<Vec<_>>(),
        })
    };
    pack.set("slots", page.words.iter().map(slot).collect::<Vec<Value>>());
    pack.finish()
}

fn group_of(review: &Review<'_>, group: &FlipGroup<'_>) -> Value {
    let pairs = group.runs.iter().map(|pair| {
        let known = review.pairs.get(pair);
        json!({ "a": pair.0, "b": pair.1, "known": known.map(pair_of) })
    });
    json!({
        "words": flip_words(group), "is_worse": !group.worse.is_empty(), "origin": review.origin(group),
        "pairs": pairs.collect::<Vec<Value>>(),
    })
}

fn pair_of(pair: &ReviewPair) -> Value {
    let [a, b] = pair.runs.each_ref().map(run_of);
    json!({
        "runs": [a, b],
        "differ": pair.divergence.as_ref().map(|found| json!({ "secs": found.secs, "words": found.sentence() })),
    })
}

fn run_of(run: &ReviewRun) -> Value {
    let detail = &run.detail;
    let judged = outcomes_of(detail).map(|(step, action, judgement)| {
        json!({
            "step": step, "action": action, "property": names::local(&judgement.property),
            "outcome": judgement.outcome.word(), "margin": judgement.margin, "witness": judgement.witness,
        })
    });
    json!({
        "key": run.key, "run": detail.row.run, "status": detail.row.status.word(), "reason": detail.reason,
        "output": detail.program_output, "judged": judged.collect::<Vec<Value>>(),
    })
}
