//! Compares verdicts with people's labels, and finds the limits that fit these best.

use std::collections::BTreeMap;

use crate::{Agreement, PairedTable, PairedTest};
use actcheck_base::digest_of;

/// A labelled verdict of a property in a run.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelledRun {
    /// Id of the run.
    pub run: String,
    /// Whether the rules let it pass.
    pub passed: bool,
    /// Its margin: positive if it passed. `None` if the property has none.
    pub margin: Option<f64>,
    /// Whether people say that it passed.
    pub label: bool,
}

/// The agreement of a property with labels.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// How often the rules agree with the labels.
    pub agreement: Agreement,
    /// Runs that pass by the rules and fail by their label.
    pub only_rules: u64,
    /// Runs that fail by the rules and pass by their label.
    pub only_labels: u64,
    /// The limit that fits better; `None` if the property has no margin, or none does.
    pub fitted: Option<FittedLimit>,
    /// Runs whose label contradicts the verdict at the fitted limit, or at the present one: the
    /// surest verdicts first, which are the likeliest wrong labels.
    pub contradicting: Vec<LabelledRun>,
}

/// A limit that fits labels better than the present one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FittedLimit {
    /// The margin from which on the property should pass; 0 is the present limit.
    pub margin: f64,
    /// Agreeing labels of those that it was fitted to: now, and with the limit.
    pub fitted: [u64; 2],
    /// Number of labels that it was fitted to.
    pub fitted_to: u64,
    /// The same for the other labels, which only confirm it.
    pub confirmed: [u64; 2],
    /// Number of the other labels.
    pub held_out: u64,
    /// The test on the other labels: whether the new limit agrees more often by chance.
    pub test: PairedTest,
}

/// Fewest labels on each side of a fit.
const FEWEST: usize = 10;
/// A limit is proposed if its better agreement on held-out labels has at most this probability.
const LEVEL: f64 = 0.05;

/// Compares the verdicts of a property with labels.
///
/// A limit is fitted to one half of the runs, chosen by their ids, and proposed only if the other
/// half confirms it.
pub fn calibrate(runs: &[LabelledRun]) -> Calibration {
    let fitted = fit(runs);
    let from = fitted.map_or(0.0, |limit| limit.margin);
    let says = |run: &LabelledRun| match run.margin {
        Some(margin) if fitted.is_some() => margin > from,
        _ => run.passed,
    };
    let mut contradicting: Vec<LabelledRun> = runs
        .iter()
        .filter(|run| says(run) != run.label)
        .cloned()
        .collect();
    let sureness = |run: &LabelledRun| run.margin.map_or(0.0, |margin| (margin - from).abs());
    contradicting.sort_by(|a, b| {
        let order = sureness(b).total_cmp(&sureness(a));
        order.then_with(|| a.run.cmp(&b.run))
    });
    let count = |wanted: [bool; 2]| {
        let is = |run: &&LabelledRun| [run.passed, run.label] == wanted;
        runs.iter().filter(is).count() as u64
    };
    let (only_rules, only_labels) = (count([true, false]), count([false, true]));
    Calibration {
        agreement: Agreement {
            agree: runs.len() as u64 - only_rules - only_labels,
            of: runs.len() as u64,
        },
        only_rules,
        only_labels,
        fitted,
        contradicting,
    }
}

/// Whether a run is among those that a limit is fitted to: about half of them are, whatever their
/// order.
fn is_fitted_to(run: &str) -> bool {
    digest_of(run)
        .bytes()
        .last()
        .is_some_and(|digit| digit.is_multiple_of(2))
}

fn fit(runs: &[LabelledRun]) -> Option<FittedLimit> {
    let known: Vec<(&LabelledRun, f64)> = runs
        .iter()
        .filter_map(|run| Some((run, run.margin.filter(|margin| margin.is_finite())?)))
        .collect();
    let (own, others): (Vec<_>, Vec<_>) = known
        .into_iter()
        .partition(|(run, _)| is_fitted_to(&run.run));
    if own.len() < FEWEST || others.len() < FEWEST {
        return None;
    }
    let margin = best_margin(&own)?;
    let agrees = |of: &[(&LabelledRun, f64)], from: Option<f64>| {
        let passes = |(run, margin): &&(&LabelledRun, f64)| {
            from.map_or(run.passed, |from| *margin > from) == run.label
        };
        of.iter().filter(passes).count() as u64
    };
    let mut table = PairedTable::default();
    for (run, value) in &others {
        table.add((*value > margin) == run.label, run.passed == run.label);
    }
    let test = table.test();
    // The first side of the table is the new limit: the present one must be worse.
    (test.second_worse <= LEVEL).then(|| FittedLimit {
        margin,
        fitted: [agrees(&own, None), agrees(&own, Some(margin))],
        fitted_to: own.len() as u64,
        confirmed: [agrees(&others, None), agrees(&others, Some(margin))],
        held_out: others.len() as u64,
        test,
    })
}

/// Returns the margin from which on passing agrees with most labels: the middle between two
/// margins, and of several the one that is nearest to 0.
fn best_margin(runs: &[(&LabelledRun, f64)]) -> Option<f64> {
    let mut values: BTreeMap<u64, (f64, [i64; 2])> = BTreeMap::new();
    // Keys in the order of the numbers.
    let key = |value: f64| {
        let bits = value.to_bits();
        if bits >> 63 == 1 {
            !bits
        } else {
            bits | 1 << 63
        }
    };
    for (run, margin) in runs {
        let (_, counts) = values.entry(key(*margin)).or_insert((*margin, [0, 0]));
        counts[usize::from(run.label)] += 1;
    }
    let sorted: Vec<(f64, [i64; 2])> = values.into_values().collect();
    // Below all values everything passes: the labels that say so agree.
    let mut agreeing: i64 = sorted.iter().map(|(_, [_, passes])| passes).sum();
    let mut best: Option<(i64, f64)> = None;
    for pair in sorted.windows(2) {
        let (low, [fails, passes]) = pair[0];
        agreeing += fails - passes;
        let middle = f64::midpoint(low, pair[1].0);
        let is_better = best.is_none_or(|(most, at)| {
            agreeing > most || agreeing == most && middle.abs() < at.abs()
        });
        if is_better {
            best = Some((agreeing, middle));
        }
    }
    best.map(|(_, middle)| middle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::Stream;

    /// Runs with values between 0 and 8 cm; the rule demands more than 2 cm, and people 3 cm. One
    /// label in `wrong_in` is wrong.
    fn labelled(runs: u64, wrong_in: u64) -> (Vec<LabelledRun>, Vec<String>) {
        let stream = Stream::new(11);
        let mut wrong = Vec::new();
        let runs = (0..runs)
            .map(|number| {
                let value = 0.08 * stream.unit(number);
                let id = format!("k7f3-{}", number + 1);
                let is_wrong = number % wrong_in == 0;
                if is_wrong {
                    wrong.push(id.clone());
                }
                LabelledRun {
                    run: id,
                    passed: value > 0.02,
                    margin: Some(value - 0.02),
                    label: (value > 0.03) != is_wrong,
                }
            })
            .collect();
        (runs, wrong)
    }

    #[test]
    fn a_planted_limit_is_found_and_wrong_labels_come_first() {
        let (runs, wrong) = labelled(600, 20);
        let found = calibrate(&runs);
        let fitted = found.fitted.expect("the labels have another limit");
        let limit = 0.02 + fitted.margin;
        assert!((limit / 0.03 - 1.0).abs() < 0.03, "{limit}");
        assert!(
            fitted.confirmed[1] > fitted.confirmed[0],
            "{:?}",
            fitted.confirmed
        );
        // All that contradict a sure verdict are wrong labels, and most wrong labels are among
        // them.
        let first: Vec<&String> = found
            .contradicting
            .iter()
            .take(wrong.len() - 2)
            .map(|run| &run.run)
            .collect();
        assert!(first.iter().all(|run| wrong.contains(run)), "{first:?}");
    }

    #[test]
    fn a_limit_that_fits_is_left_alone() {
        let (mut runs, _) = labelled(400, 20);
        for (number, run) in runs.iter_mut().enumerate() {
            run.label = run.passed != (number % 20 == 0);
        }
        let found = calibrate(&runs);
        assert_eq!(found.fitted, None);
        assert_eq!(
            found.agreement,
            Agreement {
                agree: 380,
                of: 400
            }
        );
        assert_eq!(found.contradicting.len(), 20);
        assert_eq!(calibrate(&runs[..5]).fitted, None, "too few");
    }
}
