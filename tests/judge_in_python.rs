//! `actcheck.Judge`: the same outcomes as `recheck`, in Rust and in Python.

use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};

use actcheck::base::{Files, Judgement, names};
use actcheck::campaign::{RuleSet, judge_stored};
use actcheck::data::Trace;
use actcheck::history::{History, RunFilter, RunRow};
use actcheck_judge::{Call, Judge};
use serde_json::{Value, json};

use crate::names::rust_files;
use crate::support::{actcheck, copy, foreign, judge_values, project, root, stderr, stdout};

/// Number of outcomes to compare. Without it, small campaigns are compared.
const OUTCOMES: &str = "ACTCHECK_JUDGE_OUTCOMES";
/// Ontologies whose rules are compared: with those about time and about the robot itself.
const ONTOLOGIES: [&str; 3] = ["actions.ttl", "time.ttl", "extra.ttl"];

/// Shipped configurations, each with a number of outcomes that every run has at least on average.
const CONFIGS: [(&str, usize); 8] = [
    ("pick_and_place", 30),
    ("pick", 10),
    ("clutter", 10),
    ("perceive", 10),
    ("move_to", 10),
    ("fixed_arm", 10),
    ("suction_arm", 10),
    ("lone_glass", 10),
];

/// One performed action with the outcomes that `recheck` gives it.
struct Judged {
    ontology: &'static str,
    /// Shared by all ontologies: the course of an action takes megabytes.
    values: Arc<Value>,
    outcomes: Vec<Judgement>,
}

/// The actions of several campaigns, judged by `recheck`.
fn judged() -> &'static [Judged] {
    static JUDGED: OnceLock<Vec<Judged>> = OnceLock::new();
    JUDGED.get_or_init(|| {
        let wanted = std::env::var(OUTCOMES).ok();
        let wanted: usize = wanted.map_or(400, |wanted| wanted.parse().unwrap());
        let share = wanted.div_ceil(CONFIGS.len());
        let judged: Vec<Judged> = CONFIGS
            .iter()
            .flat_map(|(config, of_run)| of_campaign(config, share / of_run + 1, share))
            .collect();
        let outcomes: usize = judged.iter().map(|action| action.outcomes.len()).sum();
        assert!(outcomes >= wanted, "{outcomes}");
        judged
    })
}

/// The actions of one campaign, which must have a number of outcomes.
fn of_campaign(config: &str, runs: usize, wanted: usize) -> Vec<Judged> {
    let folder = project();
    let path = format!("configs/{config}.toml");
    let runs = runs.to_string();
    let ran = actcheck(
        folder.path(),
        &["run", &path, "--runs", &runs, "--history", "h"],
    );
    assert!(
        ran.status.code().is_some_and(|code| code < 2),
        "{config}: {}",
        stderr(&ran)
    );
    let history = History::open_existing(&folder.path().join("h")).unwrap();
    let rows = history.runs(&RunFilter::default()).unwrap();
    let traces: Vec<Trace> = rows
        .iter()
        .map(|row| history.traces().of(row, true).unwrap())
        .collect();
    let values: Vec<Vec<Arc<Value>>> = traces.iter().map(values_of).collect();
    let judged: Vec<Judged> = ONTOLOGIES
        .iter()
        .flat_map(|ontology| of_ontology(&history, &rows, (&traces, &values), ontology))
        .collect();
    let outcomes: usize = judged.iter().map(|action| action.outcomes.len()).sum();
    eprintln!("{config}: {runs} runs, {outcomes} outcomes");
    assert!(outcomes >= wanted, "{config}: {outcomes}");
    judged
}

/// The values of each action of a run, for the judge.
fn values_of(trace: &Trace) -> Vec<Arc<Value>> {
    let steps = 0..trace.actions.len();
    steps
        .map(|step| {
            // An action that was not performed has no states.
            let is_performed = trace.actions[step].end.was_begun();
            Arc::new(
                is_performed
                    .then(|| judge_values::action(trace, step))
                    .into(),
            )
        })
        .collect()
}

fn of_ontology(
    history: &History,
    rows: &[RunRow],
    (traces, values): (&[Trace], &[Vec<Arc<Value>>]),
    ontology: &'static str,
) -> Vec<Judged> {
    let path = root().join("ontology").join(ontology);
    let rules = RuleSet::prepare(&Files::Disk, &path).unwrap();
    let stop = AtomicBool::new(false);
    let (rechecks, faults) = judge_stored(history, rows, &rules, 2, &stop).unwrap();
    assert!(faults.is_empty(), "{faults}");
    let mut judged = Vec::new();
    for ((row, trace), values) in rows.iter().zip(traces).zip(values) {
        for (step, action) in trace.actions.iter().enumerate() {
            if !action.end.was_begun() {
                continue;
            }
            let of_action = rechecks
                .iter()
                .filter(|it| it.run == row.run && it.step as usize == step + 1);
            judged.push(Judged {
                ontology,
                values: Arc::clone(&values[step]),
                outcomes: of_action.map(|it| it.now.clone()).collect(),
            });
        }
    }
    judged
}

fn shipped(ontology: &str) -> String {
    format!("built-in:ontology/{ontology}")
}

#[test]
fn the_judge_gives_every_outcome_that_recheck_gives() {
    let mut judge: Option<(&str, Judge)> = None;
    for action in judged() {
        let ready = judge.take().filter(|(of, _)| *of == action.ontology);
        let (_, judge) = judge.insert(ready.unwrap_or_else(|| {
            let path = shipped(action.ontology);
            (
                action.ontology,
                Judge::new(Some(Path::new(&path)), &[]).unwrap(),
            )
        }));
        let part = |name: &str| judge_values::plain(&action.values[name]);
        let verdict = judge.judge(&Call {
            action: action.values["action"].as_str().unwrap(),
            before: &part("before"),
            after: &part("after"),
            during: &part("during"),
            parameters: &part("parameters"),
        });
        let verdict = verdict.unwrap_or_else(|faults| panic!("{faults}"));
        assert_eq!(verdict.judgements().len(), action.outcomes.len());
        for (found, wanted) in verdict.judgements().iter().zip(&action.outcomes) {
            assert!(found.same_as(wanted), "{found:?}\n{wanted:?}");
        }
    }
}

/// A copy of the package with the compiled rules of `make judge`. Returns `None` without them: they
/// take as long to compile as the program.
pub fn package() -> Option<&'static Path> {
    static PACKAGE: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    let package = PACKAGE.get_or_init(|| {
        let sources = root().join("clients/python/src/actcheck");
        let written = |file: &Path| std::fs::metadata(file).and_then(|it| it.modified()).ok();
        let Some(compiled) = written(&sources.join("_judge.abi3.so")) else {
            return Err("`make judge` was not run".to_owned());
        };
        let changed = rust_files(&root().join("src"))
            .into_iter()
            .find(|file| written(file) > Some(compiled));
        if let Some(file) = changed {
            let file = file.display();
            return Err(format!("`make judge` was run before {file} was changed"));
        }
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("package_with_judge");
        copy(&sources, &folder.join("actcheck"));
        Ok(folder)
    });
    let package = package.as_ref();
    package
        .map_err(|why| foreign::left_out("the compiled rules for Python", why))
        .ok()
        .map(PathBuf::as_path)
}

/// Reads actions, one a line, and prints their judgements.
const SCRIPT: &str = r#"
import json, sys
import actcheck, numpy

def plain(value):
    if isinstance(value, dict):
        return {tuple(key.split("|")) if "|" in key else key: plain(it) for key, it in value.items()}
    if isinstance(value, list):
        numbers = value and all(type(it) in (int, float) for it in value)
        return numpy.array(value, dtype=float) if numbers else [plain(it) for it in value]
    return value

judges = {}
for line in open(sys.argv[1]):
    ontology, action = json.loads(line)
    action = plain(action)
    judge = judges.get(ontology) or judges.setdefault(ontology, actcheck.Judge(ontology))
    verdict = judge(action["action"], action["before"], action["after"], action["during"], action["parameters"])
    print(json.dumps([[it.iri, it.outcome, it.margin, it.witness, it.held_before, it.vacuous, it.rule_digest]
                      for it in verdict.values()]))
"#;

#[test]
fn judge_in_python_gives_every_outcome_that_recheck_gives() {
    let Some(package) = package() else { return };
    let folder = tempfile::tempdir().unwrap();
    let actions = folder.path().join("actions.jsonl");
    let mut lines = BufWriter::new(File::create(&actions).unwrap());
    for action in judged() {
        serde_json::to_writer(&mut lines, &(shipped(action.ontology), &*action.values)).unwrap();
        lines.write_all(b"\n").unwrap();
    }
    lines.into_inner().unwrap();
    let output = Command::new(foreign::client_python())
        .args(["-c", SCRIPT])
        .arg(&actions)
        .env("PYTHONPATH", package)
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let text = stdout(&output);
    let mut compared = 0;
    for (line, action) in text.lines().zip(judged()) {
        let found: Vec<Value> = serde_json::from_str(line).unwrap();
        let wanted = action.outcomes.iter().map(|it| {
            json!([
                it.property,
                it.outcome.word(),
                it.margin,
                it.witness,
                it.held_before,
                it.vacuous,
                it.rule_digest,
            ])
        });
        compared += found.len();
        assert_eq!(
            found,
            wanted.collect::<Vec<Value>>(),
            "{}",
            action.values["action"]
        );
    }
    let wanted: usize = judged().iter().map(|action| action.outcomes.len()).sum();
    assert_eq!(compared, wanted);
    eprintln!("{compared} outcomes are equal");
    assert!(judged()[0].outcomes[0].property.starts_with(names::ACT));
}

#[test]
fn the_tests_of_judge_pass_with_the_compiled_rules() {
    let Some(package) = package() else { return };
    let output = Command::new(foreign::client_python())
        .args(["-W", "error", "-m", "unittest", "-v", "tests.test_judge"])
        .current_dir(root().join("clients/python"))
        .env("PYTHONPATH", package)
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap();
    let text = stderr(&output);
    assert!(
        output.status.success() && !text.contains("skipped"),
        "{text}"
    );
}
