//! Margins agree with outcomes and vary with the measured quantities, for thousands of outcomes of
//! the shipped properties.

use std::collections::{BTreeMap, BTreeSet};

use actcheck::base::{Outcome, RunFacts, Term, Triple, names};
use actcheck::rules::{Budget, RuleBook};

use crate::rules::{TESTED, cases, facts_of, ontology_of};
use crate::support::planted::Dice;
use crate::support::{actcheck, shipped, stdout};

/// Variations of the facts of each rule case.
const VARIATIONS: u64 = 120;

/// Returns the facts with some numbers shifted, by up to a micrometre or a metre, and some contacts
/// or percepts left out.
fn varied(facts: &RunFacts, dice: &mut Dice) -> RunFacts {
    let mut facts = facts.clone();
    let share = 0.5 * dice.share();
    let largest = 10f64.powf(-6.0 * dice.share());
    let RunFacts {
        terms,
        snapshots,
        during,
        ..
    } = &mut facts;
    let subjects: BTreeSet<_> = during[0].iter().map(|triple| triple[0]).collect();
    let left_out: BTreeSet<_> = subjects
        .into_iter()
        .filter(|_| dice.share() < 0.1)
        .collect();
    during[0].retain(|triple| !left_out.contains(&triple[0]));
    let clearance = Term::iri(names::w("clearance"));
    let mut vary = |triple: &mut Triple| {
        if let Term::Double(value) = terms.term(triple[2])
            && dice.share() < share
        {
            let value = value + largest * (2.0 * dice.share() - 1.0);
            // The smallest distance to a thing is never negative.
            let is_distance = terms.id(&clearance) == Some(triple[1]);
            let value = if is_distance { value.max(0.0) } else { value };
            triple[2] = terms.intern(Term::Double(value));
        }
    };
    for triples in snapshots.iter_mut().chain(during) {
        triples.iter_mut().for_each(&mut vary);
        triples.sort_unstable();
    }
    facts
}

/// A report is right or wrong; an object is in the hand or not: their properties have no margin.
const WITHOUT_MARGIN: [&str; 5] = [
    "goal_reported.rq",
    "object_grasped.rq",
    "object_in_gripper.rls",
    "place_reported.rq",
    "plane_reported.rq",
];

#[test]
fn margins_are_negative_if_failed_positive_if_passed_and_never_all_equal() {
    let mut dice = Dice::new(18);
    let mut n_outcomes = BTreeMap::new();
    let mut passing: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for case in cases() {
        let Ok(rule) = std::fs::read_to_string(case.join("shipped")) else {
            continue;
        };
        let rule = rule.trim().to_owned();
        let book = RuleBook::prepare(&ontology_of(&case)).unwrap();
        let facts = facts_of(&case);
        for variation in 0..VARIATIONS {
            let varied = if variation == 0 {
                facts.clone()
            } else {
                varied(&facts, &mut dice)
            };
            let mut found = book.judge(
                &varied.action(0).unwrap(),
                &[TESTED.to_owned()],
                &Budget::default(),
            );
            let found = found.remove(TESTED).unwrap().unwrap();
            let context = format!("{}, variation {variation}: {found:?}", case.display());
            *n_outcomes
                .entry((rule.clone(), found.outcome()))
                .or_insert(0) += 1;
            match (found.outcome(), found.margin) {
                (_, margin) if WITHOUT_MARGIN.contains(&rule.as_str()) => {
                    assert_eq!(margin, None, "{context}")
                }
                (Outcome::Failed, margin) => {
                    assert!(margin.is_some_and(|margin| margin < 0.0), "{context}")
                }
                (Outcome::Passed, Some(margin)) => {
                    assert!(margin > 0.0, "{context}");
                    passing.entry(rule.clone()).or_default().push(margin);
                }
                _ => {}
            }
        }
    }
    assert!(n_outcomes.values().sum::<u64>() > 8000, "{n_outcomes:?}");
    for (rule, margins) in &passing {
        let different: BTreeSet<i64> = margins
            .iter()
            .map(|margin| (margin * 1e6).round() as i64)
            .collect();
        assert!(
            different.len() > margins.len() / 10,
            "{rule}: {} of {}",
            different.len(),
            margins.len()
        );
    }
    let shipped: BTreeSet<&String> = n_outcomes.keys().map(|(rule, _)| rule).collect();
    assert_eq!(
        passing.len() + WITHOUT_MARGIN.len(),
        shipped.len(),
        "{:?}",
        passing.keys()
    );
    for rule in shipped {
        for outcome in [Outcome::Passed, Outcome::Failed] {
            assert!(
                n_outcomes.contains_key(&(rule.clone(), outcome)),
                "{rule} is never {outcome:?}"
            );
        }
    }
}

#[test]
fn margins_of_the_shipped_campaign_differ_from_run_to_run() {
    let project = shipped("pick").copied();
    let query = "SELECT ?property ?outcome ?margin WHERE { ?a earl:test ?property ; earl:result ?r . \
        ?r act:outcome ?outcome ; act:margin ?margin }";
    let table = stdout(&actcheck(
        project.path(),
        &["query", "--history", "h", "--format", "csv", query],
    ));
    let mut passing: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    let mut n_passed: BTreeMap<&str, usize> = BTreeMap::new();
    for line in table.lines().skip(1) {
        let [property, outcome, margin] = line.split(',').collect::<Vec<_>>()[..] else {
            panic!("{line}")
        };
        let negative = margin.starts_with('-');
        assert_eq!(outcome == "failed", negative, "{line}");
        if outcome == "passed" {
            passing.entry(property).or_default().insert(margin);
            *n_passed.entry(property).or_default() += 1;
        }
    }
    let with_margin = ["CloseObject", "MovedObject", "NoGraspCollisions"].map(names::act);
    assert!(
        passing
            .keys()
            .copied()
            .eq(with_margin.iter().map(String::as_str)),
        "{passing:?}"
    );
    for (property, margins) in &passing {
        assert!(
            margins.len() * 10 > n_passed[property] * 9,
            "{property}: {margins:?}"
        );
    }
}
