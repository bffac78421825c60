//! Exports results as JUnit XML, in the dialect that Jenkins, GitLab and GitHub Actions read.

use std::fmt::Write as _;

use crate::xml::{attribute, text};
use actcheck_base::{Judgement, Outcome, names};
use actcheck_history::{ActionDetail, RunDetail};
use actcheck_verdict::Counts;

/// One suite for each campaign and test, one case for each property of each action of each run.
///
/// JUnit has four results: passed, failure, error and skipped. Broken and timeout become errors
/// with the outcome as their type; inapplicable and untested become skipped with the outcome in
/// their text. Times are wall times.
#[derive(Debug, Clone, Default)]
pub struct JunitReport {
    suites: Vec<Suite>,
}

#[derive(Debug, Clone, Default)]
struct Suite {
    campaign: String,
    test: String,
    started: String,
    counts: Counts,
    /// Wall time of its runs.
    secs: f64,
    /// Simulated time of their actions.
    simulated_secs: f64,
    runs: u64,
    cases: String,
}

impl JunitReport {
    /// Creates an empty report.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a run.
    pub fn add(&mut self, run: &RunDetail) {
        let (campaign, test) = (&run.row.campaign, &run.row.test);
        let known = self
            .suites
            .iter()
            .position(|suite| suite.campaign == *campaign && suite.test == *test);
        let at = known.unwrap_or_else(|| {
            let (campaign, test, started) =
                (campaign.clone(), test.clone(), run.row.started.clone());
            self.suites.push(Suite {
                campaign,
                test,
                started,
                ..Suite::default()
            });
            self.suites.len() - 1
        });
        self.suites[at].add(run);
    }

    /// Returns the whole file.
    pub fn text(&self) -> String {
        let mut out = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n".to_owned();
        self.suites
            .iter()
            .enumerate()
            .for_each(|(idx, suite)| suite.write(idx, &mut out));
        out.push_str("</testsuites>\n");
        out
    }
}

impl Suite {
    fn add(&mut self, run: &RunDetail) {
        self.runs += 1;
        let judged = || {
            run.actions
                .iter()
                .filter(|action| !action.judgements.is_empty())
        };
        self.secs += if judged().next().is_some() {
            run.wall_secs
        } else {
            0.0
        };
        let simulated: f64 = judged().map(|action| action.duration_secs).sum();
        self.simulated_secs += simulated;
        let actions = judged().count() as f64;
        for action in judged() {
            let share = if simulated > 0.0 {
                action.duration_secs / simulated
            } else {
                1.0 / actions
            };
            for judgement in &action.judgements {
                self.counts.add(judgement.outcome);
                // Sums over cases are correct: actions share the wall time of the run by their
                // simulated durations, the properties of an action equally.
                let secs = run.wall_secs * share / action.judgements.len() as f64;
                self.case(run, (action, secs), judgement);
            }
        }
    }

    fn case(
        &mut self,
        run: &RunDetail,
        (action, secs): (&ActionDetail, f64),
        judgement: &Judgement,
    ) {
        let class = format!(
            "{}.{}",
            run.row.test.replace(' ', "-"),
            names::local(&action.action)
        );
        let name = format!("{} ({})", names::local(&judgement.property), run.row.run);
        let (class, name) = (attribute(&class), attribute(&name));
        let _ = write!(
            self.cases,
            "    <testcase classname=\"{class}\" name=\"{name}\" time=\"{secs:.6}\""
        );
        let _ = match element(judgement.outcome) {
            None => writeln!(self.cases, "/>"),
            Some("skipped") => {
                let why = text(&format!("{}: {}", judgement.outcome, judgement.witness));
                writeln!(
                    self.cases,
                    ">\n      <skipped>{why}</skipped>\n    </testcase>"
                )
            }
            Some(element) => {
                let (kind, message) = (judgement.outcome.word(), attribute(&judgement.witness));
                let body = text(&body(run, action, judgement));
                writeln!(
                    self.cases,
                    ">\n      <{element} type=\"{kind}\" message=\"{message}\">{body}</{element}>\n    </testcase>"
                )
            }
        };
    }

    fn write(&self, idx: usize, out: &mut String) {
        let count = |outcome| self.counts.get(outcome);
        let _ = writeln!(
            out,
            "  <testsuite id=\"{idx}\" name=\"{}\" package=\"{}\" hostname=\"localhost\" timestamp=\"{}\" tests=\"{}\" failures=\"{}\" errors=\"{}\" skipped=\"{}\" time=\"{:.6}\">",
            attribute(&format!("{} {}", self.campaign, self.test)),
            attribute(&self.campaign),
            // The schema does not allow a time zone here; times are in UTC.
            attribute(self.started.get(..19).unwrap_or_default()),
            self.counts.total(),
            count(Outcome::Failed),
            count(Outcome::Broken) + count(Outcome::Timeout),
            count(Outcome::Inapplicable) + count(Outcome::Untested),
            self.secs,
        );
        out.push_str("    <properties>\n");
        let mut property = |name: &str, value: String| {
            let _ = writeln!(
                out,
                "      <property name=\"{name}\" value=\"{}\"/>",
                attribute(&value)
            );
        };
        property("campaign", self.campaign.clone());
        property("runs", self.runs.to_string());
        property("simulated seconds", format!("{:.3}", self.simulated_secs));
        for outcome in Outcome::ALL {
            property(outcome.word(), count(outcome).to_string());
        }
        out.push_str("    </properties>\n");
        out.push_str(&self.cases);
        out.push_str("    <system-out/>\n    <system-err/>\n  </testsuite>\n");
    }
}

/// JUnit's element for an outcome. Returns `None` for passed.
fn element(outcome: Outcome) -> Option<&'static str> {
    match outcome {
        Outcome::Passed => None,
        Outcome::Failed => Some("failure"),
        Outcome::Broken | Outcome::Timeout => Some("error"),
        Outcome::Inapplicable | Outcome::Untested => Some("skipped"),
    }
}

fn body(run: &RunDetail, action: &ActionDetail, judgement: &Judgement) -> String {
    let mut out = format!("{}: {}\n", judgement.outcome, judgement.witness);
    if let Some(margin) = judgement.margin {
        let _ = writeln!(out, "margin {margin:+.4}");
    }
    if let Some(message) = &action.message {
        let _ = writeln!(out, "{} said: {message}", names::local(&action.action));
    }
    let _ = write!(out, "more: actcheck show {}", run.row.run);
    out
}
