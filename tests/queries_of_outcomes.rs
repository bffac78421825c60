//! Queries over runs kept as outcomes have the answers of the same runs kept whole, and of another
//! program to which the history is exported: every named query, and many others.
//!
//! `ACTCHECK_QUERIES` sets the number of queries that are composed at random.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use actcheck::base::{Outcome, Term, names};
use actcheck::history::{
    CampaignEnd, History, NewestJudgements, QueryAnswer, Recheck, Repetition, RunRecord, RunStatus,
};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use crate::history::{sample_campaign, sample_run};
use crate::support::exported::Exported;

const RUNS: u64 = 150;

/// Runs with different outcomes, margins, scenes and times; some are twins, repetitions, broken or
/// shrunk.
fn run(campaign: &str, index: u64) -> RunRecord {
    let mut run = sample_run(campaign, index);
    let mut dice = ChaCha8Rng::seed_from_u64(index / 2 + u64::from(campaign == "m"));
    let mut next = || f64::from(dice.next_u32()) / f64::from(u32::MAX);
    run.started = format!(
        "2026-08-0{}T12:{:02}:{:02}.{:03}Z",
        1 + index % 3,
        index % 7,
        index % 60,
        index * 100 % 1000
    );
    run.repetition = (campaign == "k").then_some(Repetition {
        scene: index / 2,
        number: index % 2,
    });
    run.weight = index.is_multiple_of(4).then(&mut next);
    for object in &mut run.scene.objects {
        object.mass_kg *= 0.5 + next();
        object.friction *= 0.5 + next();
    }
    for judgement in run.judgements.iter_mut().flatten() {
        judgement.outcome = if next() < 0.3 {
            Outcome::Failed
        } else {
            Outcome::Passed
        };
        judgement.margin = (next() < 0.8).then(|| {
            if judgement.outcome == Outcome::Failed {
                -next()
            } else {
                next()
            }
        });
    }
    // Twins have the same trace.
    run.trace.hash = format!(
        "{:032x}",
        7 + u128::from(index % 40) + if campaign == "m" { 20 } else { 0 }
    );
    if index % 11 == 5 {
        (run.status, run.reason) = (
            RunStatus::Timeout,
            Some(format!("took over {} s", index % 2)),
        );
    }
    if campaign == "s" {
        run.shrunk_from = Some(format!("k-{}", index + 2));
    }
    run
}

/// A history in which `is_whole` says which runs are kept whole.
fn history(dir: &Path, is_whole: &dyn Fn(u64) -> bool) -> History {
    let history = History::open(dir).unwrap();
    for (campaign, minute, runs) in [("k", 1, RUNS), ("m", 2, 40), ("s", 3, 3)] {
        let mut record = sample_campaign(campaign, minute);
        if campaign == "m" {
            record
                .rules
                .iter_mut()
                .for_each(|(_, _, digest)| *digest = format!("{digest}2"));
        }
        history.begin_campaign(&record).unwrap();
        for index in 0..runs {
            let run = run(campaign, index);
            if is_whole(index) {
                history.commit(&run).unwrap()
            } else {
                history.commit_outcomes(&run).unwrap()
            }
        }
        if campaign == "k" {
            let ended = "2026-08-05T13:00:00Z".to_owned();
            history
                .finish_campaign(
                    campaign,
                    &CampaignEnd {
                        ended,
                        ..CampaignEnd::default()
                    },
                )
                .unwrap();
        }
    }
    let property = names::act("ObjectInGripper");
    let mut rechecks = Vec::new();
    for index in [3, 4, 90] {
        let id = format!("k-{index}");
        let before = NewestJudgements::of(&history)
            .read(&id, 1, std::slice::from_ref(&property))
            .unwrap()
            .remove(0);
        let mut now = before.judgement.clone();
        now.outcome = if now.outcome == Outcome::Passed {
            Outcome::Failed
        } else {
            Outcome::Passed
        };
        rechecks.push(Recheck {
            run: id,
            step: 1,
            action: names::act("Pick"),
            before: Some(before),
            now,
        });
    }
    history
        .commit_rechecks(&rechecks, "2026-08-09T00:00:00Z")
        .unwrap();
    drop(history);
    History::open_to_read(dir).unwrap()
}

fn named() -> Vec<(String, String)> {
    let mut files: Vec<PathBuf> = std::fs::read_dir("ontology/queries")
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    files
        .into_iter()
        .map(|file| {
            (
                file.display().to_string(),
                std::fs::read_to_string(&file).unwrap(),
            )
        })
        .collect()
}

/// An answer in which numbers that differ by rounding are equal, and rows have no order unless the
/// query sorts them.
fn comparable(answer: &QueryAnswer, text: &str) -> Vec<String> {
    let value = |term: &Option<Term>| match term {
        Some(Term::Double(number)) => format!("{number:.7e}"),
        // Of a mean of integers, the digits end at the same place, and the order of joined texts is
        // not defined.
        Some(Term::String(text)) => {
            let mut words: Vec<&str> = text.split(' ').collect();
            words.sort_unstable();
            words.join(" ")
        }
        other => format!("{other:?}"),
    };
    let mut rows: Vec<String> = match answer {
        QueryAnswer::Table { columns, rows } => {
            assert!(!columns.is_empty());
            rows.iter()
                .map(|row| row.iter().map(value).collect::<Vec<_>>().join(" | "))
                .collect()
        }
        other => vec![format!("{other:?}")],
    };
    if !text.contains("ORDER BY") {
        rows.sort();
    }
    rows
}

const QUERIES: [&str; 65] = [
    // Nodes of results, and values that only an outer part has.
    "SELECT (COUNT(?r) AS ?n) { ?a earl:result ?r }",
    "SELECT (COUNT(*) AS ?n) { ?a earl:result ?r }",
    "SELECT (COUNT(DISTINCT ?r) AS ?n) { ?a earl:result ?r }",
    "SELECT ?p (COUNT(?a) AS ?n) { ?a earl:test ?p ; earl:result/act:outcome ?o } GROUP BY ?p",
    "SELECT (MAX(?p) AS ?n) { ?run act:campaign ?c OPTIONAL { ?c act:plannedRuns ?p } }",
    // Facts, and the names of their graphs.
    "SELECT (COUNT(*) AS ?n) { GRAPH ?g { ?s ?p ?o } }",
    "SELECT ?p (COUNT(*) AS ?n) { GRAPH ?g { ?s ?p ?o } } GROUP BY ?p ORDER BY ?p",
    "SELECT ?o (AVG(?z) AS ?mean) { ?e act:ofRun ?run ; act:after ?g . GRAPH ?g { ?o w:z ?z } } GROUP BY ?o ORDER BY ?o",
    "SELECT ?run ?t { ?e act:ofRun ?run ; act:during ?g . ?run act:index ?i FILTER(?i < 12) GRAPH ?g { ?o w:maxTilt ?t } } ORDER BY ?run ?t",
    "SELECT (COUNT(DISTINCT ?g) AS ?n) { GRAPH ?g { ?a w:restsOn ?b } MINUS { GRAPH ?g { ?a w:touches w:robot } } }",
    "SELECT ?g { GRAPH ?g { ?s w:maxForce ?f FILTER(?f > 30) } } ORDER BY ?g LIMIT 9",
    "SELECT ?run (COUNT(?later) AS ?n) { ?run a act:Run OPTIONAL { ?e act:ofRun ?run . GRAPH act:rechecked { ?later earl:subject ?e } } } GROUP BY ?run HAVING(COUNT(?later) > 0) ORDER BY ?run",
    "SELECT ?run ?outcome { ?a earl:subject/act:ofRun ?run ; earl:result/act:outcome ?outcome MINUS { GRAPH act:rechecked { ?later act:supersedes ?a } } MINUS { ?run act:status 'timeout' } } ORDER BY ?run ?outcome LIMIT 50",
    "SELECT ?c (COUNT(?w) AS ?weighted) (COUNT(?f) AS ?from) { ?run act:campaign ?c OPTIONAL { ?run act:weight ?w } OPTIONAL { ?run act:shrunkFrom ?f } } GROUP BY ?c ORDER BY ?c",
    "SELECT ?c (SUM(?m) AS ?sum) { ?run act:campaign ?c OPTIONAL { ?a earl:subject/act:ofRun ?run ; earl:test act:MovedObject ; earl:result/act:margin ?m FILTER(?m < 0) } } GROUP BY ?c ORDER BY ?c",
    "SELECT ?p (COUNT(?a) AS ?n) { ?a earl:test ?p ; earl:result/act:outcome ?o } GROUP BY ?p HAVING(COUNT(?a) > 3) ORDER BY ?p",
    "SELECT (COUNT(DISTINCT ?r) AS ?n) (COUNT(?r) AS ?all) { ?a earl:result ?r OPTIONAL { ?r act:margin ?m } }",
    "SELECT (COUNT(COALESCE(?r, 1)) AS ?n) (COUNT(IF(BOUND(?m), ?r, 1)) AS ?all) { ?a earl:result ?r OPTIONAL { ?r act:margin ?m } }",
    // A value that only the first of several optional parts has.
    "SELECT (MAX(?p) AS ?n) { ?run act:campaign ?c OPTIONAL { ?c act:plannedRuns ?p } OPTIONAL { ?run act:score ?s } }",
    "SELECT ?c (SUM(?p) AS ?n) (MIN(?s) AS ?least) { ?run act:campaign ?c OPTIONAL { ?c act:plannedRuns ?p } OPTIONAL { ?run act:score ?s } OPTIONAL { ?run act:weight ?w } } GROUP BY ?c ORDER BY ?c",
    "SELECT (COUNT(?w) AS ?n) (AVG(?p) AS ?mean) { ?run act:campaign ?c OPTIONAL { ?run act:weight ?w } OPTIONAL { ?c act:plannedRuns ?p } OPTIONAL { ?run act:reason ?s } }",
    "SELECT ?run ?score { ?run a act:Run ; act:score ?score }",
    "SELECT ?run { ?run act:status ?status FILTER(?status != 'completed') } ORDER BY ?run",
    "SELECT ?run ?reason { ?run a act:Run OPTIONAL { ?run act:reason ?reason } } ORDER BY ?run",
    "SELECT (COUNT(?reason) AS ?n) (COUNT(*) AS ?all) { ?run a act:Run OPTIONAL { ?run act:reason ?reason } }",
    "SELECT ?reason (COUNT(*) AS ?n) { ?run a act:Run OPTIONAL { ?run act:reason ?reason FILTER(?reason != 'took over 1 s') } } GROUP BY ?reason ORDER BY ?reason",
    "SELECT ?p (MIN(?m) AS ?least) (MAX(?m) AS ?most) (SUM(?m) AS ?sum) { ?a earl:test ?p ; earl:result/act:margin ?m } GROUP BY ?p ORDER BY ?p",
    "SELECT ?p (AVG(?m) AS ?mean) { ?a earl:test ?p ; earl:result ?r OPTIONAL { ?r act:margin ?m } } GROUP BY ?p ORDER BY ?p",
    "SELECT ?p (COUNT(?m) AS ?n) (SUM(COALESCE(?m, 0)) AS ?sum) { ?a earl:test ?p ; earl:result ?r OPTIONAL { ?r act:margin ?m } } GROUP BY ?p ORDER BY ?p",
    "SELECT ?name (COUNT(?run) AS ?n) (AVG(?i) AS ?mean) { ?run act:campaign ?c ; act:index ?i . ?c rdfs:label ?name } GROUP BY ?name",
    "SELECT DISTINCT ?status ?test { ?run act:status ?status ; act:test ?test }",
    "SELECT (COUNT(DISTINCT ?status) AS ?n) (COUNT(DISTINCT ?run) AS ?runs) { ?run act:status ?status }",
    "SELECT ?run ?m { ?a earl:subject/act:ofRun ?run ; earl:result/act:margin ?m } ORDER BY DESC(?m) ?run LIMIT 7",
    "SELECT ?run ?m { ?a earl:subject/act:ofRun ?run ; earl:result/act:margin ?m } ORDER BY ?m ?run LIMIT 5 OFFSET 3",
    "ASK { ?run act:status 'timeout' }",
    "ASK { ?run act:status 'broken' }",
    "ASK { <https://w3id.org/actcheck/run/k-120> act:score ?s }",
    "SELECT ?p ?o { <https://w3id.org/actcheck/run/k-120> act:index ?o . ?e act:ofRun <https://w3id.org/actcheck/run/k-120> ; act:action ?p }",
    "SELECT (COUNT(*) AS ?n) { ?run act:index 3 }",
    "SELECT ?c (COUNT(*) AS ?n) { ?x act:category ?c ; act:ofRun ?run . ?y act:category ?c ; act:ofRun ?run } GROUP BY ?c",
    "SELECT (COUNT(*) AS ?n) { { ?run act:status 'timeout' } UNION { ?run act:index ?i FILTER(?i < 10) } }",
    "SELECT ?run { ?run act:index ?i MINUS { ?run act:status 'timeout' } FILTER(?i < 20) } ORDER BY ?run",
    "SELECT ?from ?m { ?run act:shrunkFrom ?from . ?e act:ofRun ?from . ?a earl:subject ?e ; earl:result/act:margin ?m } ORDER BY ?from ?m",
    "SELECT ?s (SUM(?k * 2) AS ?n) { ?run act:status ?s ; act:objectCount ?k } GROUP BY ?s HAVING(COUNT(*) > 5) ORDER BY ?s",
    "SELECT (SUM(IF(act:counts(?run), 1, 0)) AS ?n) { ?run a act:Run }",
    "SELECT ?i { ?run act:index ?i ; act:campaign ?c FILTER(act:counts(?run)) } ORDER BY ?i",
    "SELECT ?c (MIN(?t) AS ?first) (MAX(?t) AS ?last) { ?run act:campaign ?c ; prov:startedAtTime ?t } GROUP BY ?c ORDER BY ?c",
    "SELECT ?run { ?run prov:startedAtTime ?t ; act:index ?i FILTER(?t > '2026-08-02T12:04:00Z'^^xsd:dateTime && ?i < 60) } ORDER BY ?run",
    "SELECT ?word (COUNT(*) AS ?n) { ?a earl:test ?p BIND(REPLACE(STR(?p), '^.*#', '') AS ?word) } GROUP BY ?word ORDER BY ?word",
    "SELECT ?run ?w { ?run act:campaign ?c ; act:index ?i VALUES ?i { 1 2 3 } OPTIONAL { ?run act:weight ?w } } ORDER BY ?run",
    "CONSTRUCT { ?run act:was ?status } WHERE { ?run act:status ?status ; act:index ?i FILTER(?i IN (1, 5, 16)) }",
    "SELECT (COUNT(*) AS ?n) (SAMPLE(?t) AS ?test) { ?run act:test ?t }",
    "SELECT ?p (COUNT(*) AS ?n) { GRAPH act:rechecked { ?a earl:test ?p } ?b earl:test ?p } GROUP BY ?p",
    // Lists whose order does not show.
    "SELECT ?p (GROUP_CONCAT('x') AS ?all) { ?a earl:test ?p ; earl:result/act:outcome 'failed' } GROUP BY ?p ORDER BY ?p",
    "SELECT ?k (GROUP_CONCAT(STR(?k); SEPARATOR = '; ') AS ?all) { ?run act:objectCount ?k } GROUP BY ?k ORDER BY ?k",
    "SELECT ?k (GROUP_CONCAT(?k) AS ?all) { ?run act:objectCount ?k } GROUP BY ?k ORDER BY ?k",
    "SELECT ?s (GROUP_CONCAT(REPLACE(?s, '[aeiou]', '')) AS ?all) (COUNT(?s) AS ?n) { ?run act:status ?s } GROUP BY ?s ORDER BY ?s",
    "SELECT ?s (GROUP_CONCAT(REPLACE(?s, '[aeiou]', '-$0')) AS ?all) { ?run act:status ?s } GROUP BY ?s ORDER BY ?s",
    "SELECT ?s (GROUP_CONCAT(?s) AS ?all) { ?run act:status ?s ; act:objectCount ?k . ?other act:objectCount ?k ; act:index 3 } GROUP BY ?s ORDER BY ?s",
    "SELECT (GROUP_CONCAT(?s) AS ?all) { ?run act:status ?s ; act:index 1000000 }",
    "SELECT ?run (COUNT(*) AS ?n) (AVG(?m) AS ?mean) (MIN(?m) AS ?least) (SUM(?m) AS ?sum) { ?a earl:subject/act:ofRun ?run ; earl:result/act:margin ?m } GROUP BY ?run ORDER BY ?run",
    "SELECT ?run (COUNT(*) AS ?n) (MAX(?m) AS ?most) { ?a earl:subject/act:ofRun ?run ; earl:test ?p ; earl:result/act:margin ?m FILTER(STRLEN(STR(?p)) > 40) } GROUP BY ?run ORDER BY ?run",
    "SELECT ?run (COUNT(DISTINCT ?p) AS ?n) (MAX(?m) AS ?most) { ?a earl:subject/act:ofRun ?run ; earl:test ?p ; earl:result/act:margin ?m } GROUP BY ?run ORDER BY ?run",
    "SELECT ?held (COUNT(*) AS ?n) { ?r act:outcome 'passed' OPTIONAL { ?r act:heldBefore ?held } } GROUP BY ?held ORDER BY ?held",
    "SELECT (COUNT(*) AS ?n) { ?run act:index ?i ; act:discards ?d FILTER(?d > 0 || ?i = 4) }",
];

/// A query of patterns about runs, outcomes and objects, with conditions, groups and aggregates.
fn composed(dice: &mut ChaCha8Rng) -> String {
    let mut of = |all: &[&'static str]| all[dice.next_u32() as usize % all.len()];
    let patterns = [
        "?run act:status ?status ; act:index ?i ; act:campaign ?c .",
        "?e act:ofRun ?run ; act:action ?action . ?a earl:subject ?e ; earl:test ?p ; earl:result ?r . ?r act:outcome ?o .",
        "?x act:ofRun ?run ; act:role ?role ; w:mass ?kg .",
    ];
    let two = [of(&patterns), of(&patterns)].join(" ");
    let has = |name: &str| two.contains(name);
    let keys: Vec<&str> = ["?status", "?c", "?o", "?p", "?role"]
        .into_iter()
        .filter(|name| has(name) && of(&["0", "1"]) == "1")
        .collect();
    let numbers: Vec<&str> = ["?i", "?kg", "?m"]
        .into_iter()
        .filter(|name| has(name))
        .collect();
    let mut conditions = String::new();
    if has("?i") && of(&["0", "1"]) == "1" {
        conditions.push_str(of(&[
            "FILTER(?i < 50)",
            "FILTER(?i >= 20 && ?i != 31)",
            "FILTER(act:counts(?run))",
        ]));
    }
    if has("?o") && of(&["0", "1"]) == "1" {
        conditions.push_str(of(&[
            "FILTER(?o = 'failed')",
            "OPTIONAL { ?r act:margin ?m }",
            "FILTER(?o IN ('passed', 'failed'))",
        ]));
    }
    let mut counted: Vec<&str> = ["?run", "?e", "?a", "?r", "?x"]
        .into_iter()
        .filter(|name| has(name))
        .collect();
    let mut further: Vec<(&str, &str)> = Vec::new();
    for optional in [
        ("?c", "OPTIONAL { ?c act:plannedRuns ?planned }", "?planned"),
        ("?status", "OPTIONAL { ?run act:score ?score }", "?score"),
        (
            "?status",
            "OPTIONAL { ?run act:weight ?weight FILTER(?weight > 0.3) }",
            "?weight",
        ),
        ("?r", "OPTIONAL { ?r act:margin ?margin }", "?margin"),
        (
            "?c",
            "OPTIONAL { ?c rdfs:label ?label . ?c act:seed ?seed }",
            "?seed",
        ),
    ] {
        let (needs, text, value) = optional;
        if has(needs) && of(&["0", "0", "1"]) == "1" {
            further.insert(
                if of(&["0", "1"]) == "1" {
                    0
                } else {
                    further.len()
                },
                (text, value),
            );
        }
    }
    further
        .iter()
        .for_each(|(text, _)| conditions.push_str(text));
    let mut selected: Vec<String> = keys.iter().map(|key| (*key).to_owned()).collect();
    selected.push("(COUNT(*) AS ?n)".to_owned());
    for (at, number) in numbers.iter().enumerate() {
        selected.push(format!(
            "({}({number}) AS ?v{at})",
            of(&["SUM", "AVG", "MIN", "MAX", "COUNT"])
        ));
    }
    for (at, (_, value)) in further.iter().enumerate() {
        selected.push(format!(
            "({}({value}) AS ?f{at})",
            of(&["SUM", "AVG", "MIN", "MAX", "COUNT", "COUNT"])
        ));
    }
    counted.retain(|_| of(&["0", "0", "1"]) == "1");
    for (at, node) in counted.iter().enumerate() {
        selected.push(format!(
            "(COUNT({}{node}) AS ?c{at})",
            of(&["", "", "DISTINCT "])
        ));
    }
    let group = if keys.is_empty() {
        String::new()
    } else {
        format!("GROUP BY {}", keys.join(" "))
    };
    format!(
        "SELECT {} {{ {two} {conditions} }} {group}",
        selected.join(" ")
    )
}

#[test]
fn queries_over_outcomes_have_the_answers_of_whole_runs_and_of_their_export() {
    let composed_queries = std::env::var("ACTCHECK_QUERIES")
        .ok()
        .and_then(|number| number.parse().ok())
        .unwrap_or(120);
    let folder = tempfile::tempdir().unwrap();
    let histories = [
        ("whole", history(&folder.path().join("whole"), &|_| true)),
        (
            "outcomes",
            history(&folder.path().join("outcomes"), &|_| false),
        ),
        (
            "mixed",
            history(&folder.path().join("mixed"), &|index| index % 3 == 0),
        ),
    ];
    let exported = Exported::of(&histories[0].1);
    let mut queries = named();
    queries.extend(
        QUERIES
            .iter()
            .map(|text| ((*text).to_owned(), (*text).to_owned())),
    );
    let mut dice = ChaCha8Rng::seed_from_u64(25);
    queries.extend(
        (0..composed_queries)
            .map(|_| composed(&mut dice))
            .map(|text| (text.clone(), text)),
    );
    let mut sizes: BTreeMap<&str, usize> = BTreeMap::new();
    for (name, text) in &queries {
        let wanted = comparable(&exported.query(text), text);
        sizes.insert(name, wanted.len());
        for (kept, history) in &histories {
            let found = history
                .query(text)
                .unwrap_or_else(|faults| panic!("{kept}: {name}: {faults}"));
            assert_eq!(comparable(&found, text), wanted, "{kept}: {name}");
        }
    }
    let empty = sizes.values().filter(|size| **size == 0).count();
    assert!(empty < 10 + composed_queries / 40, "{sizes:?}");
}
