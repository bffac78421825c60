//! The health of campaigns: the shipped ones are healthy, and each warning comes from a campaign
//! that has the fault.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use actcheck::analysis::{Coverage, Health, HealthMeter, HealthProblem};
use actcheck::campaign::{CampaignOptions, Clock, Ending, Env, RunContext, run_all};
use actcheck::config::Overrides;
use actcheck::data::Choices;
use actcheck::history::{History, RunFilter};
use actcheck::scenario;
use actcheck::world::{Perturbation, World};
use serde_json::Value;

use crate::support::{actcheck, edit, project, root, shipped, stderr, stdout};

const STILL: Clock = Clock {
    now: || "2026-01-01T00:00:00Z".to_owned(),
    secs: || 0.0,
};

/// Runs a campaign of a configuration into a history of its own and examines it.
fn health(config: &Path, runs: u32, context: RunContext) -> Health {
    let folder = tempfile::tempdir().unwrap();
    let overrides = Overrides {
        runs: Some(runs),
        history: Some(folder.path().join("h")),
        ..Overrides::default()
    };
    let env = Env::prepare(config, &overrides).unwrap();
    let history = History::open(&env.campaign.history).unwrap();
    history
        .begin_campaign(&env.record("k".into(), "test".into(), (context.clock.now)()))
        .unwrap();
    // One worker, so that its clock is that of all runs.
    let options = CampaignOptions { jobs: 1, context };
    let end = run_all(
        &env,
        &history,
        "k",
        &options,
        &AtomicBool::new(false),
        |_| {},
    );
    assert!(matches!(end.ending, Ending::Finished), "{:?}", end.ending);
    examined(&history, "k")
}

fn examined(history: &History, campaign: &str) -> Health {
    let mut meter = HealthMeter::default();
    history.each_vitals(campaign, |run| meter.add(run)).unwrap();
    let outcomes = history.outcomes(&RunFilter::default()).unwrap();
    outcomes
        .iter()
        .for_each(|row| meter.add_outcomes(&row.property, row.outcome, 1));
    meter.finish()
}

#[test]
fn the_shipped_campaigns_are_healthy() {
    let made = |config| {
        let folder = shipped(config).copied();
        let history = History::open_existing(&folder.path().join("h")).unwrap();
        examined(&history, &history.campaigns().unwrap()[0].id)
    };
    let begun = |config| {
        let path = root().join(format!("configs/{config}.toml"));
        health(
            &path,
            15,
            RunContext {
                clock: STILL,
                disturb: None,
            },
        )
    };
    let all = [
        ("pick", made("pick")),
        ("lone_glass", made("lone_glass")),
        ("clutter", begun("clutter")),
    ];
    for (config, mut health) in all {
        // The duration of runs depends on the machine as well.
        health
            .problems
            .retain(|problem| !matches!(problem, HealthProblem::Slow(..)));
        assert_eq!(health.problems, [], "{config}");
        assert!(
            health.runs >= 15 && !health.parameters.is_empty(),
            "{config}: {health:?}"
        );
        let depth = health.deepest.unwrap().0;
        assert!(
            depth > 0.0,
            "{config}: bodies in contact penetrate a little"
        );
    }
}

/// So many objects do not fit on a coffee table, and a property about absent objects never applies.
#[test]
fn a_crowded_table_and_an_idle_property_are_reported() {
    let project = project();
    edit(
        &project.path().join("configs/pick.toml"),
        "count = [1, 5]",
        "count = [16, 20]",
    );
    std::fs::write(
        project.path().join("rules/idle.rls"),
        "applicable(?o) :- after(?o, w:knockedOver, true), after(?o, w:z, ?z), ?z > 1000.0 .\n\
         success(?o) :- after(?o, w:upright, true) .\n",
    )
    .unwrap();
    let ontology = project.path().join("ontology/actions.ttl");
    edit(
        &ontology,
        "act:CloseObject, act:ObjectGrasped",
        "act:Idle, act:CloseObject, act:ObjectGrasped",
    );
    let text = std::fs::read_to_string(&ontology).unwrap();
    std::fs::write(
        &ontology,
        text + "\nact:Idle a act:Property ; act:verifiedBy <../rules/idle.rls> .\n",
    )
    .unwrap();
    let run = ["run", "configs/pick.toml", "--runs", "10", "--history", "h"];
    let output = actcheck(project.path(), &run);
    let text = stdout(&output);
    assert!(
        text.contains("warning S032: ")
            && text.contains("warning Q001: Idle was inapplicable in 10 of 10"),
        "{text}"
    );

    let output = actcheck(
        project.path(),
        &["health", "--history", "h", "--format", "json"],
    );
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let printed: Value = serde_json::from_str(&stdout(&output)).unwrap();
    let codes: Vec<&str> = printed["warnings"]
        .as_array()
        .unwrap()
        .iter()
        .map(|warning| warning["code"].as_str().unwrap())
        .collect();
    assert_eq!(codes[..2], ["S032", "Q001"]);
    assert!(
        stderr(&output).contains("larger surface"),
        "no help:\n{}",
        stderr(&output)
    );
    let table = stdout(&actcheck(
        project.path(),
        &["health", "--history", "h", "--format", "csv"],
    ));
    assert!(
        table.starts_with("parameter,draws,bins,hit,expected_hit,least,most\n"),
        "{table}"
    );
    assert!(table.contains("\nother.count,10,5,"), "{table}");
    let text = stdout(&actcheck(project.path(), &["health", "--history", "h"]));
    assert!(
        text.contains("deepest penetration: ") && text.contains("warnings"),
        "{text}"
    );
    let missing = actcheck(project.path(), &["health", "zzzz", "--history", "h"]);
    assert_eq!(missing.status.code(), Some(2));
}

/// A crowded scene is rejected and drawn again, so the accepted scenes have fewer objects.
#[test]
fn object_counts_that_rarely_fit_are_reported_as_neglected() {
    let project = project();
    edit(
        &project.path().join("configs/pick.toml"),
        "count = [1, 5]",
        "count = [1, 20]",
    );
    let env = Env::prepare(
        &project.path().join("configs/pick.toml"),
        &Overrides::default(),
    )
    .unwrap();
    let mut coverage = Coverage::default();
    for index in 0..1000 {
        let drawn = (0..50u64).find_map(|attempt| {
            let mut choices = Choices::random(env.campaign.seed, index | (attempt << 48));
            scenario::draw(&env.space, 0, &mut choices)
                .ok()
                .map(|_| choices.into_made())
        });
        coverage.add(&drawn.unwrap());
    }
    let neglected: Vec<String> = coverage
        .parameters()
        .into_iter()
        .filter(|parameter| parameter.neglected.is_some())
        .map(|parameter| parameter.name)
        .collect();
    assert!(
        neglected.contains(&"other.count".to_owned()),
        "{neglected:?}"
    );
}

/// The times that the fake clock below returns.
static LATER_SECS: AtomicU64 = AtomicU64::new(0);

#[test]
fn a_run_far_longer_than_the_others_is_reported() {
    let clock = Clock {
        secs: || LATER_SECS.load(Ordering::Relaxed) as f64,
        ..STILL
    };
    let disturb = |index: u64, _: &mut World| {
        LATER_SECS.fetch_add(if index == 3 { 500 } else { 2 }, Ordering::Relaxed);
    };
    let config = root().join("configs/lone_glass.toml");
    let health = health(
        &config,
        6,
        RunContext {
            clock,
            disturb: Some(disturb),
        },
    );
    assert_eq!(
        health.problems,
        [HealthProblem::Slow("k-4".into(), 500.0, 2.0)]
    );
}

/// A solid body is moved into another after everything came to rest.
#[test]
fn bad_simulation_quality_is_reported() {
    let disturb = |index: u64, world: &mut World| {
        let bodies = world.snapshot().bodies;
        let solid = |id: &str| {
            ["box_", "can_", "bottle_", "salt_shaker_"]
                .iter()
                .any(|name| id.starts_with(name))
        };
        let solids: Vec<_> = bodies.iter().filter(|body| solid(&body.id)).collect();
        if index == 1 {
            assert!(world.perturb(&solids[1].id, Perturbation::Pose(solids[0].pose)));
        }
    };
    let config = root().join("configs/clutter.toml");
    let health = health(
        &config,
        2,
        RunContext {
            clock: STILL,
            disturb: Some(disturb),
        },
    );
    let Some(HealthProblem::Penetration(deep, metres)) = health.problems.first() else {
        panic!("{:?}", health.problems)
    };
    assert_eq!(deep, "k-2");
    assert!(*metres > 0.02, "{metres} m");
}
