//! Campaigns whose scenes are chosen by a search.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use serde_json::Value;

use actcheck::base::Outcome;
use actcheck::campaign::{Env, Planned, PropertyOutcome, RunResult, Schedule, schedule_of};
use actcheck::config::Overrides;
use actcheck::data::{Choice, ChoiceKind, ChoiceName, StartAxis};
use actcheck::history::History;
use actcheck::scenario;
use actcheck::search::{GENERATION, Strategy};

use crate::support::look::looking;
use crate::support::{actcheck, edit, project, stderr, stdout};

fn pick(runs: u32, seed: u64, repeat: u32, strategy: Strategy) -> Env {
    let overrides = Overrides {
        runs: Some(runs),
        seed: Some(seed),
        repeat: Some(repeat),
        search: Some(strategy),
        history: Some(PathBuf::from("none")),
        ..Overrides::default()
    };
    Env::prepare(Path::new("configs/pick.toml"), &overrides).unwrap()
}

/// The quantile of a recorded choice in its range.
fn quantile(choice: &Choice) -> f64 {
    match &choice.kind {
        ChoiceKind::Index { of } => (choice.value + 0.5) / *of as f64,
        ChoiceKind::Candidate { names } => (choice.value + 0.5) / names.len() as f64,
        ChoiceKind::Real { low, high, .. } => (choice.value - low) / (high - low),
        ChoiceKind::Normal { sigma } => choice.value / sigma,
    }
}

/// The result of a made-up robot in a planned run: it fails in the most crowded fifth of the scenes
/// with the base in the nearer quarter. If the base is far to one side, the scene can't be built
/// and is not simulated.
fn made_up(env: &Env, planned: &Planned) -> RunResult {
    for attempt in 0.. {
        let mut choices = planned.choices(env.campaign.seed, attempt);
        if scenario::draw(&env.space, 0, &mut choices).is_err() {
            continue;
        }
        let at = |name: ChoiceName| {
            quantile(
                choices
                    .made()
                    .iter()
                    .find(|choice| choice.name == name)
                    .unwrap(),
            )
        };
        if at(ChoiceName::Robot(StartAxis::Side)) > 0.7 {
            continue;
        }
        let margin =
            (0.8 - at(ChoiceName::OtherCount)).max(at(ChoiceName::Robot(StartAxis::Gap)) - 0.25);
        let outcome = if margin < 0.0 {
            Outcome::Failed
        } else {
            Outcome::Passed
        };
        let said = |property: &str| PropertyOutcome {
            property: property.to_owned(),
            outcome,
            margin: Some(margin),
        };
        let outcomes =
            ["CloseObject", "MovedObject"].map(|name| said(&format!("http://actions#{name}")));
        return RunResult {
            index: planned.index,
            discards: attempt,
            outcomes: outcomes.to_vec(),
        };
    }
    unreachable!("some scenes can be built")
}

/// Every batch of a schedule, with the results of the made-up robot.
fn made_up_campaign(env: &Env) -> (Vec<Vec<Planned>>, Box<dyn Schedule>) {
    let mut schedule = schedule_of(env);
    let (mut batches, mut results) = (Vec::new(), Vec::new());
    loop {
        let batch = schedule.next_batch(&results);
        if batch.is_empty() {
            return (batches, schedule);
        }
        results = batch.iter().map(|planned| made_up(env, planned)).collect();
        batches.push(batch);
    }
}

#[test]
fn chosen_scenes_depend_on_the_seed_and_the_results() {
    for strategy in Strategy::ALL {
        let env = pick(90, 3, 1, strategy);
        let (batches, _) = made_up_campaign(&env);
        assert_eq!(batches, made_up_campaign(&env).0, "{strategy:?}");
        let indices: Vec<u64> = batches
            .iter()
            .flatten()
            .map(|planned| planned.index)
            .collect();
        assert_eq!(indices, (0..90).collect::<Vec<_>>(), "{strategy:?}");
        if strategy != Strategy::Random {
            assert!(
                batches.iter().all(|batch| batch.len() <= GENERATION),
                "{strategy:?}"
            );
            // Random scenes are not planned but drawn from the seed, when they are made.
            assert_ne!(
                batches,
                made_up_campaign(&pick(90, 4, 1, strategy)).0,
                "{strategy:?}"
            );
        }
        // A robot that never fails, with margins, leads to other scenes.
        let mut other = schedule_of(&env);
        let mut results = Vec::new();
        let mut same = true;
        for batch in &batches {
            let asked = other.next_batch(&results);
            same &= asked == *batch;
            results = asked
                .iter()
                .map(|planned| {
                    let mut result = made_up(&env, planned);
                    result.outcomes.iter_mut().for_each(|outcome| {
                        (outcome.outcome, outcome.margin) =
                            (Outcome::Passed, Some(1.0 + planned.index as f64));
                    });
                    result
                })
                .collect();
        }
        assert_eq!(same, !strategy.is_guided(), "{strategy:?}");
    }
}

/// Of the scenes that can be built, 0.2 · 0.25 fail, whichever were sampled and however many can't
/// be built.
#[test]
fn weighted_rates_estimate_the_configured_distribution() {
    const SEEDS: u64 = 60;
    for strategy in [Strategy::CrossEntropy, Strategy::Bandit, Strategy::Boundary] {
        let (mut mean, mut held, mut failing) = (0.0, 0, 0);
        for seed in 0..SEEDS {
            let env = pick(110, seed, 1, strategy);
            let (batches, schedule) = made_up_campaign(&env);
            let rates = schedule.rates();
            let moved = rates
                .iter()
                .find(|rate| rate.property.ends_with("MovedObject"))
                .unwrap();
            assert_eq!((moved.test.as_str(), moved.scenes), ("Pick", 110));
            mean += moved.failing.rate / SEEDS as f64;
            held += u64::from((moved.failing.low..=moved.failing.high).contains(&0.05));
            let all = batches
                .iter()
                .flatten()
                .map(|planned| made_up(&env, planned).outcomes[0].outcome);
            failing += all.filter(|outcome| *outcome == Outcome::Failed).count();
            let weights = batches
                .iter()
                .flatten()
                .map(|planned| planned.steering.as_ref().unwrap().weight.unwrap());
            assert!(weights.into_iter().all(|weight| weight > 0.0));
        }
        assert!((mean - 0.05).abs() < 0.012, "{strategy:?}: {mean}");
        assert!(held * 100 >= SEEDS * 93, "{strategy:?}: {held} of {SEEDS}");
        // Random search would find 0.05 · 110 · 60 = 330, with a standard deviation of 18.
        assert!(failing > 390, "{strategy:?}: {failing}");
    }
}

#[test]
fn repetitions_of_a_searched_scene_share_it_and_differ_in_noise() {
    let env = pick(30, 5, 3, Strategy::Bandit);
    let (batches, schedule) = made_up_campaign(&env);
    let planned: Vec<&Planned> = batches.iter().flatten().collect();
    assert_eq!(planned.len(), 90);
    for scene in planned.chunks(3) {
        let steering = scene[0].steering.as_ref().unwrap();
        assert!(
            scene
                .iter()
                .all(|run| run.steering.as_ref().unwrap() == steering)
        );
        assert!(
            steering.quantiles.keys().all(|name| !name.is_noise()),
            "{steering:?}"
        );
        assert_eq!(
            scene.iter().map(|run| run.repetition).collect::<Vec<_>>(),
            [Some(0), Some(1), Some(2)]
        );
    }
    // Counts scenes, not runs.
    assert!(schedule.rates().iter().all(|rate| rate.scenes == 30));
}

fn json(folder: &Path, arguments: &[&str]) -> Value {
    let output = actcheck(folder, &[arguments, &["--format", "json"]].concat());
    serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)))
}

/// Real runs: a whole generation and the beginning of the next, with one worker and with two, and
/// from the file.
#[test]
fn a_guided_campaign_is_the_same_with_any_number_of_workers() {
    let project = looking();
    let folder = project.path();
    let run = ["run", "configs/look.toml", "--runs", "22"];
    let results = json(
        folder,
        &[
            &run[..],
            &["--strategy", "boundary", "--jobs", "1", "--history", "one"],
        ]
        .concat(),
    );
    edit(
        &folder.join("configs/look.toml"),
        "[camera]",
        "[search]\nstrategy = \"boundary\"\n\n[camera]",
    );
    let text = stdout(&actcheck(
        folder,
        &[&run[..], &["--jobs", "2", "--history", "two"]].concat(),
    ));
    let list = |history: &str| {
        json(folder, &["list", "--history", history])
            .as_array()
            .unwrap()
            .clone()
    };
    let (one, two) = (list("one"), list("two"));
    let of =
        |rows: &[Value], key: &str| rows.iter().map(|row| row[key].clone()).collect::<Vec<_>>();
    assert_eq!(of(&one, "trace_hash"), of(&two, "trace_hash"));
    assert_eq!(of(&one, "weight"), of(&two, "weight"));
    assert_eq!(
        of(&one, "weight")
            .iter()
            .map(Value::to_string)
            .collect::<BTreeSet<_>>()
            .len(),
        22
    );

    // Killed and resumed: earlier results are given to the search again.
    let mut child = Command::new(env!("CARGO_BIN_EXE_actcheck"))
        .args([&run[..], &["--jobs", "1", "--history", "three"]].concat())
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    while History::count_runs(&folder.join("three")) < 8 {
        assert!(
            child.try_wait().unwrap().is_none(),
            "it must not end before it is killed"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let resumed = json(folder, &["run", "--resume", "--history", "three"]);
    let three = list("three");
    assert_eq!(of(&one, "trace_hash"), of(&three, "trace_hash"));
    assert_eq!(of(&one, "weight"), of(&three, "weight"));
    assert_eq!(resumed["search"], results["search"]);

    assert!(
        text.contains("are not failure rates") && text.contains("weighted, 22 scenes"),
        "{text}"
    );
    assert_eq!(
        (
            &results["search"]["strategy"],
            &results["search"]["counts_are_rates"]
        ),
        (&"boundary".into(), &false.into())
    );
    let rates = results["search"]["weighted_failure_rates"]
        .as_array()
        .unwrap();
    assert_eq!(rates.len(), 3);
    let weights: BTreeMap<String, f64> = results["runs"]
        .as_array()
        .unwrap()
        .iter()
        .map(|run| {
            (
                run["run"].as_str().unwrap().to_owned(),
                run["weight"].as_f64().unwrap(),
            )
        })
        .collect();
    for rate in rates {
        // The weights are those of the runs: the rate is their sum over the failed runs.
        let failing = results["runs"].as_array().unwrap().iter().filter(|run| {
            let outcomes = run["actions"][0]["outcomes"].as_array().unwrap();
            outcomes.iter().any(|outcome| {
                outcome["property"] == rate["property"] && outcome["outcome"] == "failed"
            })
        });
        let sum: f64 = failing
            .map(|run| weights[run["run"].as_str().unwrap()])
            .sum();
        assert!(
            (rate["rate"].as_f64().unwrap() - (sum / 22.0).min(1.0)).abs() < 1e-9,
            "{rate}"
        );
    }
    let some: Vec<&str> = one
        .iter()
        .step_by(7)
        .map(|row| row["run"].as_str().unwrap())
        .collect();
    let replayed = actcheck(
        folder,
        &[&["replay", "--history", "one"], &some[..]].concat(),
    );
    assert_eq!(
        replayed.status.code(),
        Some(0),
        "{}{}",
        stdout(&replayed),
        stderr(&replayed)
    );
    let shown = stdout(&actcheck(folder, &["show", some[0], "--history", "one"]));
    assert!(shown.contains("importance weight"), "{shown}");
}

#[test]
fn an_unknown_strategy_is_refused_with_the_known_names() {
    let refused = actcheck(
        Path::new("."),
        &["run", "configs/pick.toml", "--strategy", "boundry"],
    );
    assert_eq!(refused.status.code(), Some(2));
    assert!(
        stderr(&refused).contains("did you mean `boundary`"),
        "{}",
        stderr(&refused)
    );
}

/// Shards do not share results, and the interval width of counted runs does not apply here.
#[test]
fn options_that_conflict_with_a_search_are_refused() {
    let project = project();
    for other in [["--shard", "1/2"], ["--until-width", "0.2"]] {
        let refused = actcheck(
            project.path(),
            &[
                &["run", "configs/pick.toml", "--strategy", "bandit"],
                &other[..],
            ]
            .concat(),
        );
        assert_eq!(refused.status.code(), Some(2), "{other:?}");
        assert!(stderr(&refused).contains("S024"), "{}", stderr(&refused));
    }
    let allowed = [
        "run",
        "configs/pick.toml",
        "--runs",
        "2",
        "--strategy",
        "halton",
        "--shard",
        "1/2",
        "--history",
        "h",
    ];
    assert_ne!(actcheck(project.path(), &allowed).status.code(), Some(2));
    let refused = actcheck(
        project.path(),
        &["run", "--resume", "--strategy", "bandit", "--history", "h"],
    );
    assert_eq!(
        refused.status.code(),
        Some(2),
        "a campaign resumes with its strategy"
    );
}
