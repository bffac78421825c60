//! A simulation fault ends its run as broken, with the reason, and never ends the campaign.

use std::sync::atomic::AtomicBool;

use actcheck::base::Outcome;
use actcheck::campaign::{CampaignOptions, Clock, Ending, Env, RunContext, run_all};
use actcheck::config::Overrides;
use actcheck::history::{History, RunFilter, RunStatus};
use actcheck::report::RunSummary;
use actcheck::world::{Poison, World};

use crate::support::root;

/// Run 1 gets a pose that is not a number, run 2 a body far outside the world, run 3 a panic; the
/// other runs are unchanged.
fn disturb(index: u64, world: &mut World) {
    match index {
        1 => assert!(world.poison("glass_1", Poison::NotFinite)),
        2 => assert!(world.poison("glass_1", Poison::Teleport([0.0, 0.0, -500.0]))),
        3 => panic!("a fault in the engine"),
        _ => {}
    }
}

#[test]
fn simulation_faults_break_single_runs_and_the_campaign_continues() {
    let folder = tempfile::tempdir().unwrap();
    let overrides = Overrides {
        runs: Some(5),
        history: Some(folder.path().join("h")),
        ..Overrides::default()
    };
    let env = Env::prepare(&root().join("configs/pick.toml"), &overrides).unwrap();
    let history = History::open(&env.campaign.history).unwrap();
    let clock = Clock {
        now: || "2026-01-01T00:00:00Z".to_owned(),
        secs: || 0.0,
    };
    history
        .begin_campaign(&env.record("test".into(), "pick".into(), (clock.now)()))
        .unwrap();
    let options = CampaignOptions {
        jobs: 2,
        context: RunContext {
            clock,
            disturb: Some(disturb),
        },
    };
    let mut runs = Vec::new();
    let end = run_all(
        &env,
        &history,
        "test",
        &options,
        &AtomicBool::new(false),
        |record| {
            runs.push(RunSummary::of(record));
        },
    );
    assert!(matches!(end.ending, Ending::Finished), "{:?}", end.ending);
    runs.sort_by_key(|run| run.index);
    assert_eq!(runs.len(), 5);
    let reasons = [
        (1, "not a number"),
        (2, "left the world"),
        (3, "a fault in the engine"),
    ];
    for (idx, words) in reasons {
        let run = &runs[idx];
        assert_eq!(run.status, RunStatus::Broken, "run {idx}: {run:?}");
        assert!(
            run.reason.as_ref().unwrap().contains(words),
            "run {idx}: {:?}",
            run.reason
        );
        assert!(
            run.outcomes().all(|outcome| outcome == Outcome::Broken),
            "run {idx}: {run:?}"
        );
        assert!(!run.failed() && !run.passed());
    }
    assert_eq!([runs[0].status, runs[4].status], [RunStatus::Completed; 2]);
    let kept = history.runs(&RunFilter::default()).unwrap();
    assert_eq!(
        kept.iter()
            .filter(|row| row.status == RunStatus::Broken)
            .count(),
        3
    );
    for row in kept {
        assert_eq!(
            history.run(&row.run).unwrap().reason.is_some(),
            row.status == RunStatus::Broken
        );
    }
}

/// Every run of a campaign ended with the same fault, thousands of times.
#[test]
fn a_campaign_whose_first_runs_all_break_for_the_same_reason_stops() {
    let folder = tempfile::tempdir().unwrap();
    let overrides = Overrides {
        runs: Some(9),
        history: Some(folder.path().join("h")),
        ..Overrides::default()
    };
    let env = Env::prepare(&root().join("configs/lone_glass.toml"), &overrides).unwrap();
    let history = History::open(&env.campaign.history).unwrap();
    let clock = Clock {
        now: || "2026-01-01T00:00:00Z".to_owned(),
        secs: || 0.0,
    };
    for (id, disturb, runs) in [
        ("all", all as fn(u64, &mut World), 5),
        ("others", all_but_the_third, 9),
    ] {
        history
            .begin_campaign(&env.record(id.into(), "pick".into(), (clock.now)()))
            .unwrap();
        let options = CampaignOptions {
            jobs: 2,
            context: RunContext {
                clock,
                disturb: Some(disturb),
            },
        };
        let end = run_all(
            &env,
            &history,
            id,
            &options,
            &AtomicBool::new(false),
            |_| (),
        );
        assert_eq!(end.committed, runs, "{id}: {:?}", end.ending);
        match end.ending {
            Ending::Stopped(faults) => {
                let fault = faults.iter().next().unwrap();
                assert_eq!((id, fault.code), ("all", "S034"));
                assert!(
                    fault
                        .message
                        .starts_with("the first 5 runs were all broken for the same reason: "),
                    "{fault}"
                );
            }
            ending => assert_eq!(id, "others", "{ending:?}"),
        }
    }
}

fn all(_: u64, world: &mut World) {
    assert!(world.poison("glass_1", Poison::NotFinite));
}

fn all_but_the_third(index: u64, world: &mut World) {
    if index != 2 {
        all(index, world);
    }
}
