//! Statistics against values computed with scipy and statsmodels (by `tests/data/statistics.py`).

use actcheck::analysis::{PairedTable, TwoByTwo, benjamini_hochberg, holm, wilson};
use serde_json::Value;

use crate::support::root;

const CLOSE: f64 = 1e-9;

fn known(kind: &str) -> Vec<Value> {
    let text = std::fs::read_to_string(root().join("tests/data/statistics.json")).unwrap();
    let mut all: Value = serde_json::from_str(&text).unwrap();
    let cases = all[kind].take().as_array().unwrap().clone();
    assert!(cases.len() >= 8, "{kind}");
    cases
}

fn count(value: &Value) -> u64 {
    value.as_u64().unwrap()
}

fn counts(case: &Value) -> [u64; 4] {
    [0, 1, 2, 3].map(|at| count(&case["table"][at]))
}

#[track_caller]
fn close(found: f64, wanted: &Value, case: &Value) {
    let wanted = wanted.as_f64().unwrap();
    assert!(
        (found - wanted).abs() <= CLOSE,
        "{found} instead of {wanted}: {case}"
    );
}

/// Small probabilities must be accurate in their relative error too.
#[track_caller]
fn close_relatively(found: f64, wanted: &Value, case: &Value) {
    close(found, wanted, case);
    let wanted = wanted.as_f64().unwrap();
    if wanted > 1e-290 {
        assert!(
            (found / wanted - 1.0).abs() <= 1e-8,
            "{found:e} instead of {wanted:e}: {case}"
        );
    }
}

#[test]
fn wilsons_interval_equals_statsmodels() {
    for case in known("wilson") {
        let interval = wilson(count(&case["passed"]), count(&case["runs"])).unwrap();
        close(interval.low, &case["low"], &case);
        close(interval.high, &case["high"], &case);
    }
}

#[test]
fn fishers_test_equals_scipys() {
    for case in known("fisher") {
        let [failed_in, passed_in, failed_out, passed_out] = counts(&case);
        let test = TwoByTwo {
            failed_in,
            passed_in,
            failed_out,
            passed_out,
        }
        .fisher();
        close_relatively(test.greater, &case["greater"], &case);
        close_relatively(test.less, &case["less"], &case);
        close_relatively(test.two_sided, &case["two_sided"], &case);
    }
    let nothing = TwoByTwo::default().fisher();
    assert_eq!(
        (nothing.greater, nothing.less, nothing.two_sided),
        (1.0, 1.0, 1.0)
    );
}

#[test]
fn mcnemars_test_equals_statsmodels() {
    for case in known("paired") {
        let [both, only_first, only_second, neither] = counts(&case);
        let test = PairedTable {
            both,
            only_first,
            only_second,
            neither,
        }
        .test();
        close(test.two_sided, &case["two_sided"], &case);
    }
}

#[test]
fn corrections_equal_statsmodels() {
    for case in known("corrected") {
        let numbers = |key: &str| -> Vec<f64> {
            case[key]
                .as_array()
                .unwrap()
                .iter()
                .map(|number| number.as_f64().unwrap())
                .collect()
        };
        let given = numbers("probabilities");
        let found = benjamini_hochberg(&given, given.len() as u64);
        assert_eq!(found.len(), given.len());
        for (found, wanted) in found
            .into_iter()
            .zip(case["benjamini_hochberg"].as_array().unwrap())
        {
            close(found, wanted, &case);
        }
        for (found, wanted) in holm(&given)
            .into_iter()
            .zip(case["holm"].as_array().unwrap())
        {
            close(found, wanted, &case);
        }
    }
}
