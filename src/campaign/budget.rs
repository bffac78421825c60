//! Budgets that end a campaign before all its runs are made: time, interval width, failures.

use std::fmt;

use actcheck_config::Overrides;
use actcheck_verdict::trials_for_width;

/// Runs per test of a campaign that only time ends: more than any campaign makes.
const MOST_RUNS: u32 = 10_000_000;

/// Without `--runs`, a campaign that waits for narrow intervals makes at most this many times the
/// runs that a property decided in every run needs. That is enough for properties that are decided
/// in every fourth run.
const WIDTH_RESERVE: u64 = 4;

/// The budget that ended a campaign.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ExhaustedBudget {
    /// The time limit. Unit: seconds.
    Time(f64),
    /// The maximum interval width, which all properties have reached.
    Width(f64),
    /// The number of failed runs.
    Failures(u64),
    /// A comparison with another campaign, which is decided.
    Comparison,
}

impl ExhaustedBudget {
    /// Its name in the history.
    pub fn word(self) -> &'static str {
        match self {
            Self::Time(_) => "time",
            Self::Width(_) => "width",
            Self::Failures(_) => "failures",
            Self::Comparison => "comparison",
        }
    }
}

impl fmt::Display for ExhaustedBudget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Time(secs) => write!(f, "its time of {secs} s is up (--time)"),
            Self::Width(width) => {
                write!(
                    f,
                    "the 95 % interval of every property is at most {width} wide (--until-width)"
                )
            }
            Self::Comparison => write!(
                f,
                "the comparison with the baseline is decided (--until-decided)"
            ),
            Self::Failures(1) => write!(f, "a run failed (--max-failures 1)"),
            Self::Failures(most) => write!(f, "{most} runs failed (--max-failures)"),
        }
    }
}

/// Returns the runs of each test if the command line sets a budget but no number of runs, and
/// `None` if the configuration decides.
pub(super) fn runs_per_test(overrides: &Overrides) -> Option<u32> {
    match (overrides.runs, overrides.until_width, overrides.time_secs) {
        (None, Some(width), _) => {
            let enough = trials_for_width(width).saturating_mul(WIDTH_RESERVE);
            Some(
                u32::try_from(enough)
                    .unwrap_or(MOST_RUNS)
                    .clamp(1, MOST_RUNS),
            )
        }
        (None, None, Some(_)) => Some(MOST_RUNS),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_without_a_run_count_has_a_maximum() {
        let asked = |runs, until_width, time_secs| {
            runs_per_test(&Overrides {
                runs,
                until_width,
                time_secs,
                ..Overrides::default()
            })
        };
        assert_eq!(asked(None, None, None), None);
        assert_eq!(asked(Some(3), Some(0.1), Some(1.0)), None);
        assert_eq!(asked(None, None, Some(60.0)), Some(MOST_RUNS));
        assert_eq!(asked(None, Some(0.05), Some(60.0)), Some(4 * 1_533));
        assert_eq!(asked(None, Some(1e-9), None), Some(MOST_RUNS));
    }
}
