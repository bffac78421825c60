//! Quality of shrinking, on test functions whose smallest failing lists are known.

use std::sync::atomic::{AtomicBool, Ordering};

use actcheck::campaign::shrink::{
    ShrinkPlan, TrialLimits, TrialSearch, Tried, TryResult, explain, reduce,
};
use actcheck::data::{Choice, ChoiceGroup, ChoiceKind, ChoiceName, Choices};

/// Objects in the initial list.
const THINGS: usize = 12;

fn removal(thing: usize) -> Choice {
    Choice {
        name: format!("thing.{thing}.left_out").into(),
        kind: ChoiceKind::Index { of: 2 },
        value: 1.0,
    }
}

/// The draws of a test function: which things exist, two numbers for each, and one number of noise.
fn draw(choices: &mut Choices) -> (Vec<(usize, f64, f64)>, f64) {
    let mut things = Vec::new();
    for thing in 0..THINGS {
        if choices.exception(format!("thing.{thing}.left_out").into(), 2) == 0 {
            let x = choices.real(format!("thing.{thing}.x").into(), -1.0, 1.0, 0.0);
            things.push((
                thing,
                x,
                choices.real(format!("thing.{thing}.mass").into(), 0.5, 1.5, 1.0),
            ));
        }
    }
    (things, choices.normal("noise".into(), 0.1))
}

fn group(_: &[Choice], name: &ChoiceName) -> Option<ChoiceGroup> {
    match name.to_string().rsplit('.').next() {
        Some("noise") => Some(ChoiceGroup::Noise),
        Some("left_out") => None,
        Some("mass") => Some(ChoiceGroup::Physics),
        _ => Some(ChoiceGroup::OtherPoses),
    }
}

type Fails = fn(&[(usize, f64, f64)], f64) -> bool;

fn value(things: &[(usize, f64, f64)], wanted: usize) -> f64 {
    things
        .iter()
        .find(|(thing, ..)| *thing == wanted)
        .map_or(0.0, |(_, x, _)| *x)
}

/// A name, the failure condition, the smallest possible numbers of things and of special choices,
/// and the allowed tries.
const CASES: [(&str, Fails, usize, usize, u64); 6] = [
    ("always", |_, _| true, 0, 0, 4),
    (
        "one thing far out",
        |things, _| value(things, 7) > 0.2,
        1,
        1,
        30,
    ),
    (
        "two things apart",
        |things, _| value(things, 2) > 0.2 && value(things, 9) < -0.2,
        2,
        2,
        45,
    ),
    ("noise alone", |_, noise| noise.abs() > 0.02, 0, 1, 15),
    (
        "a thing and noise",
        |things, noise| value(things, 7) > 0.2 && noise.abs() > 0.02,
        1,
        2,
        40,
    ),
    ("any three things", |things, _| things.len() >= 3, 3, 0, 20),
];

/// A failing list, found at random.
fn failing(fails: Fails) -> Vec<Choice> {
    (0..)
        .find_map(|index| {
            let mut choices = Choices::random(5, index);
            let (things, noise) = draw(&mut choices);
            fails(&things, noise).then(|| choices.into_made())
        })
        .unwrap()
}

/// A try that either fails or passes.
fn tried(made: Option<Vec<Choice>>) -> Tried {
    Tried {
        result: made.map_or_else(|| TryResult::Passes(Vec::new()), TryResult::Fails),
        simulations: 1,
    }
}

fn shrunk(fails: Fails, jobs: usize, simulations: u64) -> (Vec<Choice>, bool, u64) {
    let test = |list: &[Choice]| {
        let mut choices = Choices::recorded(list);
        let (things, noise) = draw(&mut choices);
        tried(fails(&things, noise).then(|| choices.into_made()))
    };
    let never = || false;
    let mut search = TrialSearch::new(
        &test,
        TrialLimits {
            simulations,
            jobs,
            stop: &never,
        },
    );
    let plan = ShrinkPlan {
        removals: (0..THINGS).map(removal).collect(),
        ends: Vec::new(),
        group: &group,
    };
    let (list, minimal) = reduce(&mut search, failing(fails), &plan, &mut |_| {});
    (list, minimal, search.simulations())
}

fn things(list: &[Choice]) -> usize {
    THINGS
        - list
            .iter()
            .filter(|choice| choice.name.to_string().ends_with("left_out") && choice.value == 1.0)
            .count()
}

fn special(list: &[Choice]) -> usize {
    let movable = list
        .iter()
        .filter(|choice| group(list, &choice.name).is_some());
    movable
        .filter(|choice| choice.value != choice.kind.nominal())
        .count()
}

#[test]
fn known_failures_shrink_to_their_minimum() {
    for (name, fails, least_things, least_special, tries) in CASES {
        let (list, minimal, simulations) = shrunk(fails, 1, 1000);
        assert!(minimal, "{name}");
        assert_eq!(
            (things(&list), special(&list)),
            (least_things, least_special),
            "{name}: {list:?}"
        );
        assert!(
            simulations <= tries,
            "{name}: {simulations} tries, at most {tries}"
        );
        let (drawn, noise) = draw(&mut Choices::recorded(&list));
        assert!(fails(&drawn, noise), "{name} fails still");
    }
}

#[test]
fn shrinking_is_the_same_with_any_number_of_workers() {
    for (name, fails, ..) in CASES {
        for limit in [3, 10, 1000] {
            assert_eq!(
                shrunk(fails, 1, limit),
                shrunk(fails, 3, limit),
                "{name}, at most {limit}"
            );
        }
    }
}

#[test]
fn a_limit_ends_shrinking_with_the_best_so_far() {
    for (name, fails, ..) in CASES {
        let (list, _, simulations) = shrunk(fails, 2, 5);
        assert!(simulations <= 5, "{name}");
        let (drawn, noise) = draw(&mut Choices::recorded(&list));
        assert!(fails(&drawn, noise), "{name} fails still");
    }
    let asked = AtomicBool::new(true);
    let stop = || asked.load(Ordering::Relaxed);
    let test = |list: &[Choice]| tried(Some(list.to_vec()));
    let mut search = TrialSearch::new(
        &test,
        TrialLimits {
            simulations: 100,
            jobs: 1,
            stop: &stop,
        },
    );
    let start = failing(|_, _| true);
    let plan = ShrinkPlan {
        removals: (0..THINGS).map(removal).collect(),
        ends: Vec::new(),
        group: &group,
    };
    assert_eq!(
        reduce(&mut search, start.clone(), &plan, &mut |_| {}),
        (start, false)
    );
    assert_eq!(search.simulations(), 0);
}

#[test]
fn the_range_of_a_failure_and_its_nearest_pass_are_found() {
    let fails: Fails = |things, _| (0.2..0.6).contains(&value(things, 7));
    let (list, ..) = shrunk(fails, 1, 1000);
    let test = |list: &[Choice]| {
        let (things, noise) = draw(&mut Choices::recorded(list));
        tried(fails(&things, noise).then(|| list.to_vec()))
    };
    let never = || false;
    let mut search = TrialSearch::new(
        &test,
        TrialLimits {
            simulations: 100,
            jobs: 2,
            stop: &never,
        },
    );
    let plan = ShrinkPlan {
        removals: Vec::new(),
        ends: Vec::new(),
        group: &group,
    };
    let explained = explain(&mut search, &list, &plan);
    let [influence] = explained.influences.as_slice() else {
        panic!("{explained:?}")
    };
    assert_eq!(
        (influence.id.name.to_string().as_str(), influence.matters),
        ("thing.7.x", Some(true))
    );
    let [below, above] =
        [&influence.passes.0, &influence.passes.1].map(|at| at.as_ref().unwrap().value);
    assert!(
        below < 0.2 && 0.2 <= influence.fails.0 && influence.fails.1 < 0.6 && 0.6 <= above,
        "{influence:?}"
    );
    assert!(
        influence.fails.0 - below < 0.1 && above - influence.fails.1 < 0.1,
        "{influence:?}"
    );
    let neighbour = explained.neighbour.unwrap();
    assert!(
        [below, above].contains(&neighbour.passing.value),
        "{neighbour:?}"
    );
}

/// Regression: a value with which a run failed in another way, or broke, was said to pass.
#[test]
fn only_a_value_that_was_tried_and_passed_passes() {
    let fails: Fails = |things, _| value(things, 7) > 0.4;
    let (list, ..) = shrunk(fails, 1, 1000);
    for (other_from, passes_from) in [
        (f64::NEG_INFINITY, None),
        (0.1, Some(0.1)),
        (0.35, Some(0.35)),
    ] {
        let test = |list: &[Choice]| {
            let x = value(&draw(&mut Choices::recorded(list)).0, 7);
            let result = match x {
                x if x > 0.4 => TryResult::Fails(list.to_vec()),
                x if x > other_from => TryResult::Otherwise,
                _ => TryResult::Passes(Vec::new()),
            };
            Tried {
                result,
                simulations: 1,
            }
        };
        let never = || false;
        let mut search = TrialSearch::new(
            &test,
            TrialLimits {
                simulations: 100,
                jobs: 1,
                stop: &never,
            },
        );
        let plan = ShrinkPlan {
            removals: Vec::new(),
            ends: Vec::new(),
            group: &group,
        };
        let explained = explain(&mut search, &list, &plan);
        let below = explained.influences[0].passes.0.as_ref().map(|at| at.value);
        assert_eq!(below.is_some(), passes_from.is_some(), "{explained:?}");
        assert!(
            below.is_none_or(|below| below <= other_from),
            "{explained:?}"
        );
        assert_eq!(
            explained.neighbour.is_some(),
            passes_from.is_some(),
            "{explained:?}"
        );
        // The printed value is the one that was tried.
        assert!(
            below.is_none_or(|below| format!("{below:.4}").parse() == Ok(below)),
            "{explained:?}"
        );
    }
}
