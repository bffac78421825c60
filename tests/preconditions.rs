//! Preconditions of actions: where one fails, the action is not performed, and its properties are
//! inapplicable.

use actcheck::base::{Judgement, Outcome, names};
use actcheck::campaign::Env;
use actcheck::data::{ActionEnd, Choices};
use actcheck::history::{RunRecord, RunStatus};
use actcheck::world::{Perturbation, World};
use serde_json::Value;

use crate::support::line::{env_of, nominal, report, run};
use crate::support::{COARSE, actcheck, project, stderr, stdout};

/// A glass with two tables.
fn env(test: &str) -> Env {
    env_of(&format!(
        "tests = [{test}]\ntest_count = 1\nseed = 5\n[objectSurface]\nobject_surfaces = [\"coffee_table\"]\n\
        [placeSurface]\nplace_object_surfaces = [\"table\"]\n[pickObject]\nmodel_list = [\"glass\"]\n"
    ))
}

/// Asserts that an action was not performed, for this reason, and changed nothing.
fn not_performed(run: &RunRecord, step: usize, reason: &str) {
    let action = &run.trace.actions[step];
    assert_eq!(action.end, ActionEnd::NotPerformed(reason.to_owned()));
    assert_eq!(
        (
            action.duration_secs,
            action.contacts.len(),
            action.report.as_ref()
        ),
        (0.0, 0, None)
    );
    assert_eq!(
        run.trace.snapshots[step],
        run.trace.snapshots[step + 1],
        "the state changed"
    );
    let is_inapplicable = |judgement: &Judgement| {
        judgement.outcome == Outcome::Inapplicable
            && judgement.witness == reason
            && judgement.margin.is_none()
    };
    assert!(
        run.judgements[step].iter().all(is_inapplicable),
        "{:?}",
        run.judgements[step]
    );
    assert!(!run.judgements[step].is_empty());
    assert_eq!(
        run.action_scores[step], 0.0,
        "an action that is not performed scores 0"
    );
}

fn all_passed(run: &RunRecord, step: usize) {
    let passed = run.judgements[step]
        .iter()
        .all(|judgement| judgement.outcome == Outcome::Passed);
    assert!(
        passed,
        "{}: {:?}",
        report(run, step).message,
        run.judgements[step]
    );
}

const FULL: &str = "the precondition `the hand is empty` does not hold: the gripper holds glass_1";
const EMPTY: &str = "the precondition `the hand holds the object to place` does not hold: the gripper holds nothing instead of glass_1";

#[test]
fn a_full_hand_picks_nothing_and_keeps_its_object() {
    let run = nominal(
        &env("[\"PerceivePlane\", \"Pick\", \"Pick\", \"Place\"]"),
        None,
    );
    all_passed(&run, 0);
    all_passed(&run, 1);
    not_performed(&run, 2, FULL);
    // The action after it is judged as if the refused one had not been asked for.
    all_passed(&run, 3);
    assert_eq!((run.status, run.score), (RunStatus::Completed, 0.75));
    let without = nominal(&env("[\"PerceivePlane\", \"Pick\", \"Place\"]"), None);
    assert_eq!(
        without.trace.hash, run.trace.hash,
        "the refused action took no step of the simulation"
    );
    assert_eq!(without.score, 1.0);
}

#[test]
fn an_empty_hand_places_nothing() {
    let run = nominal(&env("[\"Place\"]"), None);
    not_performed(&run, 0, EMPTY);
    assert_eq!((run.status, run.score), (RunStatus::Completed, 0.0));
}

/// The glass has no friction.
fn oil(_: u64, world: &mut World) {
    assert!(world.perturb("glass_1", Perturbation::Friction(0.0)));
}

#[test]
fn a_placement_after_a_failed_pick_is_not_charged_to_the_robot() {
    let run = nominal(&env("[\"Pick\", \"Place\", \"Pick\"]"), Some(oil));
    assert!(!report(&run, 0).succeeded);
    not_performed(&run, 1, EMPTY);
    // The hand is empty: it may try again.
    assert_eq!(run.trace.actions[2].end, ActionEnd::Completed);
}

#[test]
fn runs_with_refused_actions_are_simulated_again_with_the_same_bits() {
    let env = env("[\"Pick\", \"Pick\", \"Place\", \"Place\"]");
    let first = run(&env, Choices::random(3, 0), None);
    let refused = |run: &RunRecord| {
        run.trace
            .actions
            .iter()
            .filter(|action| matches!(action.end, ActionEnd::NotPerformed(_)))
            .count()
    };
    assert_eq!(
        refused(&first),
        2,
        "{:?}",
        first
            .trace
            .actions
            .iter()
            .map(|action| &action.end)
            .collect::<Vec<_>>()
    );
    let again = run(&env, Choices::recorded(&first.choices), None);
    assert_eq!(first.trace, again.trace);
    assert_eq!(first.judgements, again.judgements);
}

/// A rule of a precondition that can't be evaluated keeps no action from being performed, but its
/// outcomes are not the robot's.
#[test]
fn a_precondition_that_can_not_be_decided_breaks_the_outcomes() {
    let mut env = env("[\"Pick\"]");
    env.ontology.actions.get_mut("Pick").unwrap().preconditions =
        vec![names::act("NoSuchProperty")];
    let run = nominal(&env, None);
    assert_eq!(run.trace.actions[0].end, ActionEnd::Completed);
    assert!(
        run.judgements[0]
            .iter()
            .all(|judgement| judgement.outcome == Outcome::Broken),
        "{:?}",
        run.judgements
    );
}

fn json(folder: &std::path::Path, arguments: &[&str]) -> Value {
    let output = actcheck(folder, &[arguments, &["--format", "json"]].concat());
    serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)))
}

/// `PerceivePlane`, then two picks, in a history of a project without the preconditions, or with
/// them.
fn two_picks(with: bool) -> tempfile::TempDir {
    let project = project();
    let text = "tests = [[\"Pick\", \"Pick\"]]\ntest_count = 2\nseed = 7\nontology = \"ontology/actions.ttl\"\n\
        [objectSurface]\nobject_surfaces = [\"coffee_table\"]\n[pickObject]\nmodel_list = [\"can\"]\n\
        ";
    std::fs::write(project.path().join("two.toml"), format!("{text}{COARSE}")).unwrap();
    let ontology = project.path().join("ontology/actions.ttl");
    let shipped = std::fs::read_to_string(&ontology).unwrap();
    let stated = "act:Pick act:precondition act:HandEmpty .\n";
    assert!(shipped.contains(stated));
    if !with {
        std::fs::write(&ontology, shipped.replace(stated, "")).unwrap();
    }
    let ran = actcheck(
        project.path(),
        &["run", "two.toml", "--jobs", "1", "--history", "h"],
    );
    assert!(
        ran.status.code().is_some_and(|code| code < 2),
        "{}",
        stderr(&ran)
    );
    std::fs::write(&ontology, shipped).unwrap();
    project
}

#[test]
fn reports_say_why_an_action_was_not_performed() {
    let project = two_picks(true);
    let listed = json(project.path(), &["list", "--history", "h"]);
    let run = listed[0]["run"].as_str().unwrap();
    let shown = stdout(&actcheck(project.path(), &["show", run, "--history", "h"]));
    let line = shown
        .lines()
        .find(|line| line.starts_with("2. Pick"))
        .unwrap_or_else(|| panic!("{shown}"));
    assert!(
        line.contains("inapplicable, 0.0 s simulated, A = 0.00, not performed: the precondition"),
        "{line}"
    );
    assert!(shown.contains("the gripper holds can_1"), "{shown}");
    // A judgement with the same rules agrees.
    let rechecked = json(project.path(), &["recheck", "--history", "h"]);
    assert_eq!(
        rechecked["changes"],
        Value::Array(Vec::new()),
        "{rechecked:#}"
    );
    let replayed = actcheck(project.path(), &["replay", run, "--history", "h"]);
    assert!(
        replayed.status.success(),
        "{}{}",
        stdout(&replayed),
        stderr(&replayed)
    );
}

/// Stored runs in which the second pick was performed with a full hand are judged anew: it says
/// nothing about the robot.
#[test]
fn a_stored_action_whose_precondition_did_not_hold_becomes_inapplicable() {
    let project = two_picks(false);
    let rechecked = json(project.path(), &["recheck", "--history", "h"]);
    let changes = rechecked["changes"].as_array().unwrap();
    assert!(!changes.is_empty(), "{rechecked:#}");
    for change in changes {
        assert_eq!(
            (&change["step"], &change["now"]),
            (&2.into(), &"inapplicable".into()),
            "{change}"
        );
        let witness = "the precondition `the hand is empty` does not hold: the gripper holds can_1";
        assert_eq!(change["witness"], witness, "{change}");
    }
}
