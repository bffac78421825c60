//! Patterns: planted ones are found, and none is found without a planted one.

use actcheck::analysis::{Condition, Pattern, PatternInput, PatternOptions, Patterns, mine};

use crate::support::planted::{input, kind, plantings, range, shuffled};

/// One step of the cuts is a seventh of a bound's range; the bound itself must be much nearer.
const NEAR: f64 = 0.02;

fn same(found: &Condition, planted: &Condition) -> bool {
    let near = |found: Option<f64>, planted: Option<f64>| match (found, planted) {
        (Some(found), Some(planted)) => (found - planted).abs() <= NEAR,
        (found, planted) => found == planted,
    };
    match (found, planted) {
        (
            Condition::Range {
                parameter: a,
                low: low_a,
                high: high_a,
            },
            Condition::Range {
                parameter: b,
                low: low_b,
                high: high_b,
            },
        ) => a == b && near(*low_a, *low_b) && near(*high_a, *high_b),
        (
            Condition::Arc {
                parameter: a,
                from: from_a,
                to: to_a,
            },
            Condition::Arc {
                parameter: b,
                from: from_b,
                to: to_b,
            },
        ) => a == b && near(Some(*from_a), Some(*from_b)) && near(Some(*to_a), Some(*to_b)),
        _ => found == planted,
    }
}

fn is(found: &Pattern, planted: &[Condition]) -> bool {
    found.conditions.len() == planted.len()
        && planted.iter().all(|wanted| {
            found
                .conditions
                .iter()
                .any(|condition| same(condition, wanted))
        })
}

fn conditions(found: &Patterns) -> Vec<&Vec<Condition>> {
    found
        .patterns
        .iter()
        .map(|pattern| &pattern.conditions)
        .collect()
}

#[test]
fn only_planted_patterns_are_found_in_ten_thousand_runs() {
    for (name, planted) in plantings() {
        for seed in 1..=3 {
            let found = mine(&input(10_000, seed, &planted), &PatternOptions::default());
            for wanted in &planted {
                let confirmed = found.confirmed().any(|pattern| is(pattern, wanted));
                assert!(
                    confirmed,
                    "{name}, seed {seed}: {wanted:?} is not in {:#?}",
                    conditions(&found)
                );
            }
            assert_eq!(
                found.patterns.len(),
                planted.len(),
                "{name}, seed {seed}: {:#?}",
                conditions(&found)
            );
        }
    }
}

#[test]
fn the_figures_of_a_pattern_agree_with_the_runs() {
    let planted = vec![vec![kind(0, "Bottle"), range(4, None, Some(0.35))]];
    let input = input(10_000, 5, &planted);
    let found = mine(&input, &PatternOptions::default());
    let pattern = &found.patterns[0];
    let holds: Vec<Vec<bool>> = pattern
        .conditions
        .iter()
        .map(|condition| condition.holds(&input))
        .collect();
    let runs: Vec<usize> = (0..input.len())
        .filter(|run| holds.iter().all(|holds| holds[*run]))
        .collect();
    assert_eq!(pattern.runs, runs);
    let failed = runs.iter().filter(|run| input.failed[**run]).count() as u64;
    assert_eq!(
        (pattern.all.failed_in, pattern.all.passed_in),
        (failed, runs.len() as u64 - failed)
    );
    assert_eq!(pattern.all.failed_in + pattern.all.failed_out, found.failed);
    let overall = found.failed as f64 / 10_000.0;
    assert!((pattern.lift - pattern.rate.rate / overall).abs() < 1e-12);
    assert!(
        (pattern.wracc - runs.len() as f64 / 10_000.0 * (pattern.rate.rate - overall)).abs()
            < 1e-12
    );
    assert!(
        pattern.p < pattern.q && pattern.q < 1e-30 && pattern.p_held_out < 1e-10,
        "{pattern:?}"
    );
    let searched = pattern.searched;
    let looked_at =
        searched.failed_in + searched.passed_in + searched.failed_out + searched.passed_out;
    assert_eq!(
        looked_at,
        10_000 - found.held_out,
        "the first pattern is searched in all runs that are not held out"
    );
    let kept = (0..input.len()).filter(|run| input.held_out[*run] && pattern.runs.contains(run));
    assert_eq!(
        pattern.held_out.failed_in + pattern.held_out.passed_in,
        kept.count() as u64
    );
    assert!(
        (3_200..3_500).contains(&found.held_out),
        "{}",
        found.held_out
    );
}

#[test]
fn shuffled_failures_have_no_pattern() {
    let planted = plantings().pop().unwrap().1;
    for runs in [300, 1_000, 4_000] {
        let input = input(runs, 9, &planted);
        let alarms = (0..100)
            .filter(|seed| {
                !mine(&shuffled(&input, *seed), &PatternOptions::default())
                    .patterns
                    .is_empty()
            })
            .count();
        assert!(alarms <= 5, "{alarms} of 100 with {runs} runs");
    }
}

#[test]
fn too_few_runs_are_not_an_error() {
    let empty = mine(&PatternInput::default(), &PatternOptions::default());
    assert_eq!((empty.runs, empty.patterns.len(), empty.tried), (0, 0, 0));
    for runs in [1, 2, 7, 30] {
        let mut input = input(runs, 1, &[]);
        for failed in [true, false] {
            input.failed.fill(failed);
            assert!(mine(&input, &PatternOptions::default()).patterns.is_empty());
        }
        input.parameters.clear();
        assert!(mine(&input, &PatternOptions::default()).patterns.is_empty());
    }
}
