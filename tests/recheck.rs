//! Judging stored runs again: equal to simulating them again, without duplicates, partial writes or
//! losses.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use actcheck::base::{Files, Outcome, Term, names};
use actcheck::campaign::{Ending, RecheckEnd, RecheckOptions, RuleSet, judge_stored, recheck};
use actcheck::data::ActionEnd;
use actcheck::facts::extract;
use actcheck::history::{History, QueryAnswer, Recheck, RunFilter, RunStatus};
use serde_json::Value;
use tempfile::TempDir;

use crate::fuzz_corpus::entrances::frames;
use crate::history::{sample_campaign, sample_run};
use crate::support::{actcheck, copy, edit, project, root, stderr, stdout};

const NEW_RULE: &str = "
@prefix act: <http://actions#> .
@prefix w: <https://w3id.org/actcheck/world#> .
success(?o) :- parameter(act:pickObject, ?o), during(?o, w:maxTilt, ?tilt), ?tilt < 0.05 .
margin(?m)  :- parameter(act:pickObject, ?o), during(?o, w:maxTilt, ?tilt), ?m = 0.05 - ?tilt .
";

const NEW_ENTRY: &str = "
act:StaysUpright a act:Property ; rdfs:label \"stays upright\" ; act:unit \"rad\" ;
    act:needsParameter act:pickObject ; act:verifiedBy <../rules/stays_upright.rls> .
act:Pick act:successProperty act:StaysUpright .
";

/// The newest outcomes, as in the query of `ontology/history.ttl`, with the other compared values.
const NEWEST: &str = "SELECT ?index ?property ?outcome ?margin ?witness WHERE {
    { ?a earl:subject ?e ; earl:test ?property ; earl:result ?r . ?r act:outcome ?outcome ; act:witness ?witness .
      OPTIONAL { ?r act:margin ?margin } }
    UNION
    { GRAPH act:rechecked { ?a earl:subject ?e ; earl:test ?property ; earl:result ?r . ?r act:outcome ?outcome ;
        act:witness ?witness . OPTIONAL { ?r act:margin ?margin } } }
    FILTER NOT EXISTS { GRAPH act:rechecked { ?later act:supersedes ?a } }
    ?e act:ofRun/act:index ?index } ORDER BY ?index ?property";
const OWN: &str = "SELECT ?index ?property ?outcome ?margin ?witness WHERE {
    ?a earl:subject ?e ; earl:test ?property ; earl:result ?r . ?r act:outcome ?outcome ; act:witness ?witness .
    OPTIONAL { ?r act:margin ?margin } ?e act:ofRun/act:index ?index } ORDER BY ?index ?property";
const RECHECKED: &str =
    "SELECT (COUNT(*) AS ?n) WHERE { GRAPH act:rechecked { ?a a earl:Assertion } }";

fn add_property(folder: &Path) {
    std::fs::write(folder.join("rules/stays_upright.rls"), NEW_RULE).unwrap();
    let ontology = folder.join("ontology/actions.ttl");
    std::fs::write(
        &ontology,
        std::fs::read_to_string(&ontology).unwrap() + NEW_ENTRY,
    )
    .unwrap();
}

/// The object must move farther than in any pick.
fn change_rule(folder: &Path) {
    edit(
        &folder.join("rules/moved_object.rls"),
        "?d > 0.02",
        "?d > 0.45",
    );
    edit(
        &folder.join("rules/moved_object.rls"),
        "?d - 0.02",
        "?d - 0.45",
    );
}

fn ask(folder: &Path, history: &str, query: &str) -> String {
    let output = actcheck(
        folder,
        &["query", "--history", history, "--format", "csv", query],
    );
    assert!(output.status.success(), "{}", stderr(&output));
    stdout(&output)
}

fn recheck_json(folder: &Path, arguments: &[&str]) -> (i32, Value) {
    let output = actcheck(
        folder,
        &[
            &["recheck", "--history", "h", "--format", "json"],
            arguments,
        ]
        .concat(),
    );
    let text = stdout(&output);
    let json =
        serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}\n{}", stderr(&output)));
    (output.status.code().unwrap(), json)
}

#[test]
fn a_recheck_equals_a_new_simulation() {
    let project = project();
    let folder = project.path();
    actcheck(
        folder,
        &["run", "configs/pick.toml", "--runs", "6", "--history", "h"],
    );
    let own = ask(folder, "h", OWN);
    let listed = stdout(&actcheck(folder, &["list", "--history", "h"]));
    add_property(folder);
    change_rule(folder);
    let (code, json) = recheck_json(folder, &[]);
    assert_eq!((code, &json["runs"]), (1, &Value::from(6)));
    let line = |name: &str| {
        let lines = json["properties"].as_array().unwrap();
        lines
            .iter()
            .find(|line| line["property"] == names::act(name))
            .unwrap()
            .clone()
    };
    assert_eq!(line("StaysUpright")["new"], 6);
    assert_eq!(line("CloseObject")["before"], line("CloseObject")["now"]);
    let changed = line("MovedObject")["changed"].as_u64().unwrap();
    assert!(changed > 0, "{json:#}");
    let changes = json["changes"].as_array().unwrap();
    assert_eq!(changes.len() as u64, 6 + changed);
    let moved = changes
        .iter()
        .find(|change| change["before"] == "passed")
        .unwrap();
    assert_eq!(
        (&moved["now"], &moved["property"]),
        (
            &Value::from("failed"),
            &Value::from(names::act("MovedObject"))
        )
    );
    assert!(
        moved["why"].as_str().unwrap().starts_with("rule changed "),
        "{moved}"
    );

    actcheck(
        folder,
        &[
            "run",
            "configs/pick.toml",
            "--runs",
            "6",
            "--history",
            "again",
        ],
    );
    let newest = ask(folder, "h", NEWEST);
    assert_eq!(newest.lines().count(), 1 + 6 * 6);
    assert_eq!(newest, ask(folder, "again", OWN));
    assert_eq!(
        ask(folder, "h", OWN),
        own,
        "the campaign's own outcomes changed"
    );
    assert_eq!(
        stdout(&actcheck(folder, &["list", "--history", "h"])),
        listed
    );
}

/// Rules about time read the samples that the campaign judged, bit for bit.
#[test]
fn a_recheck_by_formulas_equals_a_campaign_that_judges_them() {
    let project = project();
    let folder = project.path();
    actcheck(
        folder,
        &["run", "configs/pick.toml", "--runs", "4", "--history", "h"],
    );
    let judged = actcheck(
        folder,
        &[
            "recheck",
            "--history",
            "h",
            "--ontology",
            "ontology/time.ttl",
        ],
    );
    assert!(judged.status.code() < Some(2), "{}", stderr(&judged));
    edit(
        &folder.join("configs/pick.toml"),
        "../ontology/actions.ttl",
        "../ontology/time.ttl",
    );
    actcheck(
        folder,
        &[
            "run",
            "configs/pick.toml",
            "--runs",
            "4",
            "--history",
            "again",
        ],
    );
    let newest = ask(folder, "h", NEWEST);
    assert!(newest.lines().count() > 4 * 15, "{newest}");
    assert_eq!(newest, ask(folder, "again", OWN));
}

/// Holds, motions and phases come from the same samples, although a recheck by them reads no
/// samples.
#[test]
fn a_recheck_by_intervals_equals_a_campaign_that_judges_them() {
    let project = project();
    let folder = project.path();
    actcheck(
        folder,
        &["run", "configs/pick.toml", "--runs", "3", "--history", "h"],
    );
    let rules =
        "success(?h, ?from, ?to) :- parameter(act:pickObject, ?o), hold_interval(?h, ?o), interval(?h, ?from, ?to),
        phase_interval(?lift, \"lift\"), interval_within(?lift, ?h) .";
    std::fs::write(folder.join("rules/held_in_lift.rls"), rules).unwrap();
    let query = "SELECT ?i ?object ?start ?end WHERE { ?i w:movedObject ?object ; w:start ?start ; w:end ?end }";
    let prefix = "PREFIX w: <https://w3id.org/actcheck/world#>\n";
    std::fs::write(folder.join("rules/moves.rq"), format!("{prefix}{query}")).unwrap();
    let property = |name: &str, file: &str| {
        format!(
            "act:{name} a act:Property ; rdfs:label \"{name}\" ; act:verifiedBy <../rules/{file}> .\n"
        )
    };
    let entries = property("HeldInLift", "held_in_lift.rls") + &property("Moves", "moves.rq");
    let ontology = folder.join("ontology/actions.ttl");
    let text = std::fs::read_to_string(&ontology).unwrap() + &entries;
    std::fs::write(
        &ontology,
        text + "act:Pick act:successProperty act:HeldInLift, act:Moves .\n",
    )
    .unwrap();
    let judged = actcheck(folder, &["recheck", "--history", "h"]);
    assert!(judged.status.code() < Some(2), "{}", stderr(&judged));
    actcheck(
        folder,
        &[
            "run",
            "configs/pick.toml",
            "--runs",
            "3",
            "--history",
            "again",
        ],
    );
    let newest = ask(folder, "h", NEWEST);
    assert!(
        newest.contains("Moves") && newest.contains("start ="),
        "{newest}"
    );
    assert_eq!(newest, ask(folder, "again", OWN));
}

#[test]
fn a_recheck_uses_current_or_older_rules_and_writes_no_duplicates() {
    let project = project();
    let folder = project.path();
    actcheck(
        folder,
        &["run", "configs/pick.toml", "--runs", "4", "--history", "h"],
    );
    let own = ask(folder, "h", OWN);
    let (_, json) = recheck_json(folder, &[]);
    assert_eq!(
        (
            json["changes"].as_array().unwrap().len(),
            ask(folder, "h", RECHECKED)
        ),
        (0, "n\n0\n".to_owned())
    );
    for name in ["ontology", "rules"] {
        copy(&folder.join(name), &folder.join("old").join(name));
    }
    change_rule(folder);
    let (_, json) = recheck_json(folder, &["MovedObject"]);
    assert_eq!(json["properties"].as_array().unwrap().len(), 1);
    let count = ask(folder, "h", RECHECKED);
    assert_eq!(count, "n\n4\n");
    let (_, json) = recheck_json(folder, &["MovedObject"]);
    assert_eq!(
        (
            json["changes"].as_array().unwrap().len(),
            ask(folder, "h", RECHECKED)
        ),
        (0, count)
    );
    assert_ne!(ask(folder, "h", NEWEST), own);
    for _ in 0..2 {
        recheck_json(folder, &["--ontology", "old"]);
        assert_eq!(ask(folder, "h", NEWEST), own);
        assert_eq!(ask(folder, "h", RECHECKED), "n\n8\n");
    }
    // All judgements are made within a second or two: no two may share a key.
    recheck_json(folder, &[]);
    assert_ne!(ask(folder, "h", NEWEST), own);
    assert_eq!(ask(folder, "h", RECHECKED), "n\n12\n");
}

/// Only `compare` and queries knew the results of `recheck`.
#[test]
fn every_command_knows_a_property_and_an_outcome_after_a_recheck() {
    let project = project();
    let folder = project.path();
    let said = |arguments: &[&str]| {
        let output = actcheck(folder, &[arguments, &["--history", "h"]].concat());
        assert!(
            output.status.success(),
            "{arguments:?}: {}",
            stderr(&output)
        );
        stdout(&output)
    };
    let output = actcheck(
        folder,
        &[
            "run",
            "configs/lone_glass.toml",
            "--runs",
            "2",
            "--history",
            "h",
        ],
    );
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    // The tables beside the history are made before it is judged again.
    said(&["analyse"]);
    add_property(folder);
    change_rule(folder);
    recheck_json(folder, &[]);
    let ontology = ["--ontology", "ontology/actions.ttl"];
    let rules: Value = serde_json::from_str(&said(
        &[&["list", "--rules", "--format", "json"], &ontology[..]].concat(),
    ))
    .unwrap();
    let counts = |name: &str| {
        let row = rules
            .as_array()
            .unwrap()
            .iter()
            .find(|row| row["property"] == name)
            .unwrap();
        [&row["passed"], &row["failed"]].map(|count| count.as_u64().unwrap())
    };
    let (upright, moved) = (counts("StaysUpright"), counts("MovedObject"));
    assert_eq!(
        (upright[0] + upright[1], moved[0] + moved[1]),
        (2, 2),
        "{rules:#}"
    );
    assert!(
        moved[1] > 0,
        "every pick moves its object so far: {rules:#}"
    );

    let list = said(&[
        "list",
        "--property",
        "MovedObject",
        "--failed",
        "--format",
        "csv",
    ]);
    assert_eq!(list.lines().count() as u64, moved[1] + 1, "{list}");
    let run = list.lines().nth(1).unwrap().split(',').next().unwrap();
    let shown = said(&["show", run]);
    assert!(
        shown.contains("StaysUpright") && shown.contains("MovedObject"),
        "{shown}"
    );
    assert!(
        shown.contains(
            "judged again by `actcheck recheck`: MovedObject was passed, StaysUpright is new"
        ),
        "{shown}"
    );
    assert!(said(&["why", run, "StaysUpright"]).contains("StaysUpright"));
    let markdown = said(&["report", "--markdown"]);
    assert!(
        markdown.contains("| StaysUpright |")
            && markdown.contains(&format!(" ({} of 2) |", moved[0])),
        "{markdown}"
    );
    for name in ["StaysUpright", "MovedObject"] {
        let [passed, failed] = counts(name);
        let found: Value =
            serde_json::from_str(&said(&["analyse", "--property", name, "--format", "json"]))
                .unwrap();
        let outcomes = &found["properties"][0]["outcomes"];
        assert_eq!(
            [&outcomes["passed"], &outcomes["failed"]],
            [passed, failed],
            "{found:#}"
        );
    }
    assert!(said(&["health", "--integrity"]).contains("intact"));
}

#[test]
fn impossible_rechecks_are_refused_without_writes() {
    let project = project();
    let folder = project.path();
    let history = History::open(&folder.join("h")).unwrap();
    history.begin_campaign(&sample_campaign("k", 0)).unwrap();
    history.commit(&sample_run("k", 0)).unwrap();
    drop(history);
    let fails = |arguments: &[&str], wanted: &[&str]| {
        let output = actcheck(folder, &[&["recheck"], arguments].concat());
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?} {text}");
        wanted
            .iter()
            .for_each(|wanted| assert!(text.contains(wanted), "no `{wanted}` in {text}"));
    };
    fails(
        &["MovedObjekt", "Banana", "--history", "h"],
        &["X037", "did you mean `MovedObject`?", "`Banana`"],
    );
    fails(
        &["--campaign", "kk", "--history", "h"],
        &["X033", "did you mean `k`?"],
    );
    fails(
        &["--ontology", "models", "--history", "h"],
        &["X032", "models"],
    );
    edit(
        &folder.join("rules/close_object.rls"),
        "success(",
        "success((",
    );
    fails(&["MovedObject", "--history", "h"], &["close_object.rls"]);
    assert_eq!(ask(folder, "h", RECHECKED), "n\n0\n");
    drop(History::open(&folder.join("empty")).unwrap());
    std::fs::remove_dir_all(folder.join("rules")).unwrap();
    copy(&root().join("rules"), &folder.join("rules"));
    fails(&["--history", "empty"], &["X034", "no runs"]);
}

/// A history of sample runs, in each of which a new property can be judged.
fn filled(runs: u64) -> (TempDir, History, RuleSet) {
    let project = project();
    add_property(project.path());
    let history = History::open(&project.path().join("h")).unwrap();
    history.begin_campaign(&sample_campaign("k", 0)).unwrap();
    (0..runs).for_each(|index| history.commit(&sample_run("k", index)).unwrap());
    let rules =
        RuleSet::prepare(&Files::Disk, &project.path().join("ontology/actions.ttl")).unwrap();
    (project, history, rules)
}

/// Judges everything in batches of four; stops after a given number of batches.
fn judge(
    history: &History,
    rules: &RuleSet,
    jobs: usize,
    batches: usize,
) -> (RecheckEnd, Vec<Recheck>) {
    let stop = AtomicBool::new(false);
    let runs = history.runs(&RunFilter::default()).unwrap();
    let options = RecheckOptions {
        jobs,
        batch: 4,
        at: "2026-08-02T12:00:00Z".to_owned(),
    };
    let (mut judged, mut seen) = (Vec::new(), 0);
    let end = recheck(
        history,
        &runs,
        |_| rules,
        &options,
        &stop,
        |_, batch| {
            judged.extend(batch.to_vec());
            seen += 1;
            stop.store(seen >= batches, Ordering::Relaxed);
        },
    );
    (end, judged)
}

fn kept(history: &History) -> u64 {
    match history.query("SELECT ?a WHERE { GRAPH act:rechecked { ?a a earl:Assertion } }") {
        Ok(QueryAnswer::Table { rows, .. }) => rows.len() as u64,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_stopped_recheck_keeps_whole_batches_and_can_continue() {
    let (_folder, history, rules) = filled(14);
    let rules = rules.only(&["StaysUpright".to_owned()]).unwrap();
    let (end, judged) = judge(&history, &rules, 2, 1);
    assert!(matches!(end.ending, Ending::Interrupted), "{end:?}");
    assert!(end.judged >= 4 && end.judged < 14, "{end:?}");
    assert_eq!(
        (judged.len() as u64, kept(&history)),
        (end.judged, end.judged)
    );
    let (end, again) = judge(&history, &rules, 1, usize::MAX);
    assert!(
        matches!(end.ending, Ending::Finished) && end.judged == 14,
        "{end:?}"
    );
    assert_eq!(kept(&history), 14);
    assert_eq!(
        again.iter().filter(|recheck| recheck.is_news()).count() as u64,
        14 - judged.len() as u64
    );
    let order: Vec<&str> = again.iter().map(|recheck| recheck.run.as_str()).collect();
    assert_eq!(
        order,
        (1..=14)
            .map(|number| format!("k-{number}"))
            .collect::<Vec<_>>()
    );
}

/// Readers see new judgements at once, and so does the next owner if this one is killed.
#[test]
fn judgements_are_read_at_once_and_survive_a_kill() {
    let (folder, history, rules) = filled(6);
    let rules = rules.only(&["StaysUpright".to_owned()]).unwrap();
    let runs = history.runs(&RunFilter::default()).unwrap();
    let judged = |history: &History| {
        judge_stored(history, &runs, &rules, 1, &AtomicBool::new(false))
            .unwrap()
            .0
    };
    history
        .commit_rechecks(&judged(&history), "2026-08-02T12:00:00Z")
        .unwrap();
    assert_eq!(kept(&History::open_to_read(history.dir()).unwrap()), 6);
    let left = folder.path().join("left");
    copy(history.dir(), &left);
    let next = History::open(&left).unwrap();
    for history in [next, history] {
        assert!(!judged(&history).iter().any(Recheck::is_news));
        assert_eq!(kept(&history), 6);
        history.finish_rechecks().unwrap();
        let dir = history.dir().to_owned();
        drop(history);
        assert_eq!(kept(&History::open_to_read(&dir).unwrap()), 6);
        assert!(History::examine(&dir).unwrap().0.damage.is_empty());
    }
}

/// A batch of judgements is stored completely or not at all, and the next process makes it again.
#[test]
fn half_a_batch_of_judgements_is_none() {
    let (folder, history, rules) = filled(6);
    let rules = rules.only(&["StaysUpright".to_owned()]).unwrap();
    let runs = history.runs(&RunFilter::default()).unwrap();
    let (judged, _) = judge_stored(&history, &runs, &rules, 1, &AtomicBool::new(false)).unwrap();
    for batch in judged.chunks(4) {
        history
            .commit_rechecks(batch, "2026-08-02T12:00:00Z")
            .unwrap();
    }
    assert_eq!(kept(&history), 6);
    // Its process is killed.
    let dir = folder.path().join("killed");
    copy(history.dir(), &dir);
    drop(history);
    let files = Files::Disk.list(&dir.join("campaigns/k"));
    let file = files
        .into_iter()
        .find(|file| file.extension().is_some_and(|own| own == "judgements"))
        .unwrap();
    let whole = std::fs::read(&file).unwrap();
    let ends = frames::ends(&whole);
    assert_eq!((ends.len(), ends.last()), (2, Some(&whole.len())));
    for length in [ends[1] - 1, ends[0] + 3] {
        std::fs::write(&file, &whole[..length]).unwrap();
        let reader = History::open_to_read(&dir).unwrap();
        assert_eq!(kept(&reader), 4, "{length}");
        // They may have been reported.
        assert!(reader.tail_warning().unwrap().is_some(), "{length}");
        let (found, _) = History::examine(&dir).unwrap();
        assert!(found.damage.is_empty(), "{length}: {found:?}");
        let left = folder.path().join(format!("left {length}"));
        copy(&dir, &left);
        let next = History::open_existing(&left).unwrap();
        let (end, again) = judge(&next, &rules, 2, usize::MAX);
        assert!(matches!(end.ending, Ending::Finished), "{end:?}");
        assert_eq!(again.iter().filter(|recheck| recheck.is_news()).count(), 2);
        assert_eq!(kept(&next), 6);
        drop(next);
        assert_eq!(kept(&History::open_to_read(&left).unwrap()), 6);
    }
    // A flipped bit is damage, and salvaging loses no run.
    for at in [
        2,
        frames::HEAD + 1,
        ends[0] - 1,
        ends[0] + 5,
        whole.len() - 1,
    ] {
        let mut bytes = whole.clone();
        bytes[at] ^= 2;
        std::fs::write(&file, bytes).unwrap();
        let (found, _) = History::examine(&dir).unwrap();
        let name = file.strip_prefix(&dir).unwrap();
        assert!(
            found.damage.iter().any(|damage| damage.file == name),
            "byte {at}: {found:?}"
        );
        let read = History::open_to_read(&dir)
            .and_then(|history| history.newest_outcomes(&RunFilter::default()));
        let fault = read.map(drop).unwrap_err().to_string();
        assert!(
            fault.starts_with("H007") && fault.contains(".judgements"),
            "byte {at}: {fault}"
        );
        let (salvaged, lost) = History::open_to_salvage(&dir).unwrap();
        assert!(lost.is_empty(), "byte {at}: {lost:?}");
        assert_eq!(salvaged.runs(&RunFilter::default()).unwrap().len(), 6);
        if at >= ends[0] {
            assert_eq!(kept(&salvaged), 4, "byte {at}");
        }
    }
}

#[test]
fn a_recheck_is_the_same_with_any_number_of_workers() {
    let (_folder, history, rules) = filled(9);
    let (_other_folder, other, _) = filled(9);
    let judged = |history, jobs| judge(history, &rules, jobs, usize::MAX).1;
    assert_eq!(judged(&history, 1), judged(&other, 3));
    assert_eq!(kept(&history), kept(&other));
}

#[test]
fn broken_and_timed_out_actions_keep_their_outcomes() {
    let (_folder, history, rules) = filled(1);
    let mut record = sample_run("k", 7);
    record.trace.snapshots.clear();
    record.trace.actions[0].end = ActionEnd::Broken("a pose is not a number".to_owned());
    record.facts = extract(&record.trace);
    record.status = RunStatus::Broken;
    record.judgements[0]
        .iter_mut()
        .for_each(|judgement| judgement.outcome = Outcome::Broken);
    history.commit(&record).unwrap();
    let (_, judged) = judge(&history, &rules, 1, usize::MAX);
    let broken: Vec<&Recheck> = judged
        .iter()
        .filter(|recheck| recheck.run == "k-8")
        .collect();
    assert_eq!(broken.len(), 6);
    assert!(
        broken
            .iter()
            .all(|recheck| recheck.now.outcome == Outcome::Broken)
    );
    let news: Vec<&&Recheck> = broken.iter().filter(|recheck| recheck.is_news()).collect();
    assert_eq!(news.len(), 1, "{news:?}");
    assert_eq!(news[0].now.property, names::act("StaysUpright"));
    assert_eq!(news[0].now.witness, "a pose is not a number");
}

#[test]
fn an_unreadable_run_does_not_stop_the_others() {
    let (_folder, history, rules) = filled(6);
    // Frames of other runs are readable, unless the first one is damaged.
    let file = history.dir().join("campaigns/k/0001.states");
    let mut bytes = std::fs::read(&file).unwrap();
    let ends = frames::ends(&bytes);
    for run in [3, 5] {
        bytes[ends[run - 1] - 1] ^= 1;
    }
    std::fs::write(&file, bytes).unwrap();
    let (end, judged) = judge(&history, &rules, 2, usize::MAX);
    assert!(
        matches!(end.ending, Ending::Finished) && end.judged == 4,
        "{end:?}"
    );
    let codes: Vec<&str> = end.faults.iter().map(|fault| fault.code).collect();
    assert_eq!(codes, ["H007", "H007"]);
    assert!(
        judged
            .iter()
            .all(|recheck| !["k-3", "k-5"].contains(&recheck.run.as_str()))
    );
    let project = history.dir().parent().unwrap().to_owned();
    drop(history);
    let output = actcheck(&project, &["recheck", "--history", "h", "--format", "csv"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr(&output).contains("k-3") && stderr(&output).contains("k-5"),
        "{}",
        stderr(&output)
    );
}

#[test]
fn each_judgement_records_its_rules_and_time() {
    let (_folder, history, rules) = filled(1);
    judge(&history, &rules, 1, usize::MAX);
    let query = "SELECT ?property ?at ?digest ?old WHERE { GRAPH act:rechecked { ?a earl:test ?property ;
        act:recheckedAt ?at ; earl:result/act:ruleDigest ?digest }
        OPTIONAL { GRAPH act:rechecked { ?a act:supersedes ?b } ?b earl:result/act:ruleDigest ?old } } ORDER BY ?property";
    let Ok(QueryAnswer::Table { rows, .. }) = history.query(query) else {
        panic!("no table")
    };
    assert_eq!(rows.len(), 6);
    for row in &rows {
        let property = row[0].as_ref().and_then(Term::as_iri).unwrap().to_owned();
        assert!(
            row[1]
                .as_ref()
                .is_some_and(|at| at.to_string().contains("2026-08-02T12:00:00Z")),
            "{row:?}"
        );
        assert_eq!(
            row[3].is_some(),
            property != names::act("StaysUpright"),
            "{row:?}"
        );
        assert_ne!(row[2], row[3]);
    }
}
