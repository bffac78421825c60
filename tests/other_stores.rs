//! Histories in other SPARQL stores: sent completely and once, whatever happens on the way, and
//! asked there.
//!
//! `ACTCHECK_KILLS` sets the number of kills.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;
use std::time::Duration;

use actcheck::history::{CampaignEnd, History};
use oxigraph::io::{RdfFormat, RdfParser};
use oxigraph::model::{NamedNode, NamedOrBlankNode, Term};
use tempfile::TempDir;

use crate::history::{sample_campaign, sample_run};
use crate::support::planted::Dice;
use crate::support::triple_store::{Faults, TripleStore};
use crate::support::{
    actcheck, copy, copy_made_history, edit, project_with, root, signal, started, stderr, stdout,
};

const NODE: &str = "https://w3id.org/.well-known/genid/actcheck/";

/// A private copy of a history with runs kept whole and as outcomes, and judgements made later about
/// both.
fn history() -> TempDir {
    static MADE: OnceLock<PathBuf> = OnceLock::new();
    let made = MADE.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("history-for-other-stores");
        let _ = std::fs::remove_dir_all(&folder);
        copy_made_history(&folder);
        let project = project_with(crate::support::COARSEST);
        let config = project.path().join("configs/quick.toml");
        let text = std::fs::read_to_string(&config).unwrap();
        std::fs::write(&config, format!("{text}\n[history]\nkeep = \"outcomes\"\n")).unwrap();
        let name = folder.display().to_string();
        let run = actcheck(
            project.path(),
            &[
                "run",
                "configs/quick.toml",
                "--runs",
                "3",
                "--history",
                &name,
            ],
        );
        assert!(
            run.status.code().is_some_and(|code| code < 2),
            "{}",
            stderr(&run)
        );
        edit(
            &project.path().join("rules/moved_object.rls"),
            "?d > 0.02",
            "?d > 0.4",
        );
        let recheck = actcheck(
            project.path(),
            &["recheck", "MovedObject", "--history", &name],
        );
        assert!(
            recheck.status.code().is_some_and(|code| code < 2),
            "{}",
            stderr(&recheck)
        );
        folder
    });
    let copied = tempfile::tempdir().unwrap();
    copy(made, copied.path());
    copied
}

/// The statements of `export rdf`, with IRIs in place of blank nodes.
fn exported(history: &Path, options: &[&str]) -> BTreeSet<String> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("all.nq");
    let (file_name, name) = (file.display().to_string(), history.display().to_string());
    let output = actcheck(
        root(),
        &[&["export", "rdf", &file_name, "--history", &name], options].concat(),
    );
    assert!(output.status.success(), "{}", stderr(&output));
    let named = |label: &str| NamedNode::new(format!("{NODE}{label}")).unwrap();
    let quads =
        RdfParser::from_format(RdfFormat::NQuads).for_reader(std::fs::File::open(file).unwrap());
    let statements = quads.map(|quad| {
        let mut quad = quad.unwrap();
        if let NamedOrBlankNode::BlankNode(node) = &quad.subject {
            quad.subject = named(node.as_str()).into();
        }
        if let Term::BlankNode(node) = &quad.object {
            quad.object = named(node.as_str()).into();
        }
        format!("{quad} .")
    });
    statements.collect()
}

fn send(history: &Path, url: &str, options: &[&str]) -> Output {
    let name = history.display().to_string();
    actcheck(
        root(),
        &[&["export", "store", url, "--history", &name], options].concat(),
    )
}

fn sent(history: &Path, url: &str, options: &[&str]) -> String {
    let output = send(history, url, options);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}{}",
        stdout(&output),
        stderr(&output)
    );
    stdout(&output)
}

/// The code of a command's only fault, and its message.
fn fault(output: &Output) -> (String, String) {
    assert_eq!(output.status.code(), Some(2), "{}", stdout(output));
    let text = stderr(output);
    (
        text.lines().next().unwrap_or_default().trim().to_owned(),
        text,
    )
}

#[test]
fn every_protocol_sends_the_statements_of_the_export() {
    let history = history();
    let right = exported(history.path(), &[]);
    assert!(
        right
            .iter()
            .any(|statement| statement.contains("supersedes")),
        "a later judgement"
    );
    let store = TripleStore::start();
    for (path, protocol, batch) in [
        ("update", "update", "700"),
        ("graphs", "graph-store", "5000"),
        ("quads", "quads", "1"),
    ] {
        store.clear();
        let options = ["--protocol", protocol, "--batch", batch];
        let told = sent(history.path(), &store.url(path), &options);
        assert!(
            told.contains(&format!("accepted {} statements", right.len())),
            "{told}"
        );
        assert_eq!(store.statements(), right, "{protocol}");
        // Nothing is sent twice, unless it is asked for.
        let before = store.requests();
        let told = sent(history.path(), &store.url(path), &options);
        assert!(
            told.contains("since earlier uploads") && store.requests() == before,
            "{told}"
        );
        store.clear();
        sent(
            history.path(),
            &store.url(path),
            &[&options[..], &["--from-start"]].concat(),
        );
        assert_eq!(store.statements(), right, "{protocol}");
    }
    store.clear();
    sent(
        history.path(),
        &store.url("update"),
        &["--complete", "--from-start"],
    );
    assert_eq!(
        store.statements(),
        exported(history.path(), &["--complete"])
    );
}

#[test]
fn later_only_new_runs_are_sent_and_the_end_of_a_campaign_is_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let history = folder.path().join("h");
    let end = |ended: &str| CampaignEnd {
        ended: ended.to_owned(),
        ..CampaignEnd::default()
    };
    let store = TripleStore::start();
    let first = History::open(&history).unwrap();
    first.begin_campaign(&sample_campaign("k", 0)).unwrap();
    first.commit(&sample_run("k", 0)).unwrap();
    first
        .finish_campaign("k", &end("2026-08-01T13:00:00Z"))
        .unwrap();
    drop(first);
    sent(&history, &store.url("update"), &[]);
    let resumed = History::open_existing(&history).unwrap();
    resumed.reopen_campaign("k").unwrap();
    resumed.commit(&sample_run("k", 1)).unwrap();
    resumed
        .finish_campaign("k", &end("2026-08-01T14:00:00Z"))
        .unwrap();
    drop(resumed);
    let told = sent(&history, &store.url("update"), &[]);
    assert!(told.contains("since earlier uploads"), "{told}");
    assert_eq!(store.statements(), exported(&history, &[]));
}

#[test]
fn a_store_that_fails_every_tenth_request_gets_everything_once() {
    let history = history();
    let right = exported(history.path(), &[]);
    let store = TripleStore::start();
    store.set(Faults {
        every_tenth: true,
        ..Faults::default()
    });
    for (path, protocol, batch) in [("update", "update", "1"), ("graphs", "graph-store", "5000")] {
        store.clear();
        sent(
            history.path(),
            &store.url(path),
            &["--protocol", protocol, "--batch", batch],
        );
        assert_eq!(store.statements(), right, "{protocol}");
    }
    assert!(
        store.requests()[1] >= 4,
        "each kind of failure: {:?}",
        store.requests()
    );
    // Too large a request is divided.
    store.clear();
    store.set(Faults {
        most_bytes: Some(20_000),
        ..Faults::default()
    });
    sent(history.path(), &store.url("update"), &["--from-start"]);
    assert_eq!(store.statements(), right);
}

#[test]
fn an_upload_that_is_killed_or_interrupted_continues() {
    let kills: u64 = std::env::var("ACTCHECK_KILLS")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(6);
    let (history, store) = (history(), TripleStore::start());
    let right = exported(history.path(), &[]);
    let url = store.url("update");
    let name = history.path().display().to_string();
    let words = ["export", "store", &url, "--batch", "1", "--history", &name];
    let mut dice = Dice::new(11);
    let (mut running, mut resumed) = (0, 0);
    for kill in 0..kills {
        store.set(Faults {
            delay: Duration::from_millis(40),
            ..Faults::default()
        });
        let mut child = started(root(), &words);
        std::thread::sleep(Duration::from_millis(20 + dice.below(450)));
        let is_running = child.try_wait().unwrap().is_none();
        running += u64::from(is_running);
        if kill % 2 == 0 {
            child.kill().unwrap();
            child.wait().unwrap();
        } else {
            if is_running {
                signal(child.id(), "INT");
            }
            let code = child.wait().unwrap().code();
            assert!([Some(130), Some(0), None].contains(&code), "{code:?}");
        }
        store.set(Faults {
            every_tenth: true,
            ..Faults::default()
        });
        let told = sent(history.path(), &url, &["--batch", "1"]);
        resumed += u64::from(told.contains("since earlier uploads"));
        assert_eq!(store.statements(), right, "kill {kill}");
        std::fs::remove_dir_all(history.path().join("sent")).unwrap();
        store.clear();
    }
    println!(
        "{running} of {kills} were running when they were killed or interrupted; {resumed} found accepted batches"
    );
    assert!(running > 0 && resumed > 0);
}

/// A line of CSV with its numbers to twelve digits: the order of a sum is not defined.
fn rounded(line: &str) -> String {
    let cell = |cell: &str| match cell.parse::<f64>() {
        Ok(number) if cell.contains('.') => format!("{number:.11e}"),
        _ => cell.to_owned(),
    };
    line.split(',').map(cell).collect::<Vec<_>>().join(",")
}

#[test]
fn queries_have_the_same_answers_in_another_store() {
    let (history, store) = (history(), TripleStore::start());
    sent(history.path(), &store.url("update"), &[]);
    let name = history.path().display().to_string();
    let sorted = |output: &Output| {
        let text = stdout(output);
        let mut lines: Vec<String> = text.lines().map(rounded).collect();
        lines.sort();
        lines
    };
    let both = |words: &[&str], path: &str| {
        let local = actcheck(root(), &[&["query", "--history", &name], words].concat());
        let there = actcheck(
            root(),
            &[&["query", "--endpoint", &store.url(path)], words].concat(),
        );
        // 2: a term that the vocabulary does not have.
        let code = if words[0].contains("act:Nothing") {
            2
        } else {
            0
        };
        assert_eq!(
            [&there, &local].map(|output| output.status.code()),
            [Some(code); 2],
            "{words:?}: {}",
            stderr(&there)
        );
        assert_eq!(sorted(&there), sorted(&local), "{words:?}");
        assert_eq!(stderr(&there), stderr(&local), "{words:?}");
    };
    for entry in std::fs::read_dir(root().join("ontology/queries")).unwrap() {
        let path = entry.unwrap().path();
        both(
            &[
                "--named",
                path.file_stem().unwrap().to_str().unwrap(),
                "--format",
                "csv",
            ],
            "query",
        );
    }
    let query = "SELECT ?run ?index ?x { ?run a act:Run ; act:index ?index OPTIONAL { ?run act:shrunkFrom ?x } } ORDER BY ?run";
    for format in ["text", "csv", "json"] {
        both(&[query, "--format", format], "query");
        both(&[query, "--format", format], "query-tsv");
        both(
            &[
                "SELECT ?nothing { ?nothing a act:Nothing }",
                "--format",
                format,
            ],
            "query",
        );
        both(
            &["ASK { ?run a act:Run }", "--format", format],
            "moved/query",
        );
    }
    let graph = "CONSTRUCT { ?run act:index ?index } WHERE { ?run act:index ?index }";
    for format in ["text", "csv", "json", "turtle"] {
        both(&[graph, "--format", format], "query");
    }
}

#[test]
fn faults_of_servers_have_codes_and_their_words() {
    let (history, store) = (history(), TripleStore::start());
    let ask = |url: &str, query: &str| actcheck(root(), &["query", "--endpoint", url, query]);
    let run = "SELECT ?run { ?run a act:Run }";
    // No program listens here: a port that the system gives and takes back may be another test's a
    // moment later.
    let unused = "http://127.0.0.1:1/";
    for (output, code, words) in [
        (
            send(history.path(), &store.url("nowhere"), &[]),
            "X092",
            &["status 404", "no such service", "--protocol"][..],
        ),
        (
            send(history.path(), &store.url("elsewhere"), &[]),
            "X093",
            &["http://localhost:1/login"],
        ),
        (
            send(history.path(), &store.url("circle"), &[]),
            "X091",
            &["circle"],
        ),
        (send(history.path(), unused, &[]), "X091", &["3 tries"]),
        (
            send(history.path(), "http://me:secret@127.0.0.1/", &[]),
            "X090",
            &["ACTCHECK_SPARQL_USER"],
        ),
        (
            send(history.path(), "https://127.0.0.1/", &[]),
            "X090",
            &["--features https"],
        ),
        (ask(&store.url("page"), run), "H040", &["text/html"]),
        (ask(&store.url("cut"), run), "H040", &["malformed"]),
        (
            ask(&store.url("query"), "SELECT ?run { ?run a act:Run"),
            "H010",
            &["query"],
        ),
        (
            ask(&store.url("query"), "INSERT DATA { act:a act:b 1 }"),
            "H011",
            &["INSERT"],
        ),
        (
            ask(&store.url("query"), "SELECT ?a { ?a my:own ?b }"),
            "H010",
            &["my"],
        ),
    ] {
        let (found, text) = fault(&output);
        assert_eq!(found, code, "{text}");
        assert!(
            words.iter().all(|words| text.contains(words)) && !text.contains("secret"),
            "{text}"
        );
    }
    assert!(store.statements().is_empty());
    let output = actcheck(
        root(),
        &[
            "query",
            "--endpoint",
            &store.url("query"),
            run,
            "--format",
            "turtle",
        ],
    );
    assert_eq!(fault(&output).0, "X004");
}

#[test]
fn credentials_come_from_the_environment() {
    let (history, store) = (history(), TripleStore::start());
    let with = |variables: &[(&str, &str)]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_actcheck"));
        command
            .args([
                "export",
                "store",
                &store.url("moved/update"),
                "--from-start",
                "--history",
            ])
            .arg(history.path());
        command
            .envs(variables.iter().copied())
            .env("NO_COLOR", "1")
            .output()
            .unwrap()
    };
    // `printf me:secret | base64`.
    store.set(Faults {
        authorization: Some("Basic bWU6c2VjcmV0".to_owned()),
        ..Faults::default()
    });
    let (code, text) = fault(&with(&[]));
    assert!(
        code == "X092" && text.contains("who are you?") && text.contains("ACTCHECK_SPARQL_TOKEN"),
        "{text}"
    );
    assert_eq!(
        with(&[
            ("ACTCHECK_SPARQL_USER", "me"),
            ("ACTCHECK_SPARQL_PASSWORD", "secret")
        ])
        .status
        .code(),
        Some(0)
    );
    store.set(Faults {
        authorization: Some("Bearer abc".to_owned()),
        ..Faults::default()
    });
    assert_eq!(
        with(&[("ACTCHECK_SPARQL_TOKEN", "abc")]).status.code(),
        Some(0)
    );
    assert_eq!(
        fault(&with(&[("ACTCHECK_SPARQL_PASSWORD", "abc")])).0,
        "X096"
    );
}
