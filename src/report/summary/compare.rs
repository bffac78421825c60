//! A comparison of two campaigns, with a description of each side.

use std::collections::BTreeMap;

use actcheck_analysis::{Answer, Compared, Comparison};
use actcheck_base::names;

/// One side of a comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct ComparedSide {
    /// As given on the command line: `k7f3`, `old/.actcheck#k7f3` or `k7f3@rechecked`.
    pub name: String,
    /// Id of the campaign.
    pub campaign: String,
    /// Name of its configuration.
    pub config: String,
    /// Number of its runs in the history.
    pub runs: u64,
    /// Number of planned runs.
    pub planned: u64,
    /// When it started (RFC 3339).
    pub started: String,
    /// Text of its configuration.
    pub config_text: String,
}

/// One difference between the sides.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SideChange {
    /// Such as "model".
    pub kind: String,
    /// Its name.
    pub name: String,
    /// Digest or version in the first side; `None` if it is absent there.
    pub first: Option<String>,
    /// Digest or version in the second side; `None` if it is absent there.
    pub second: Option<String>,
}

/// A known issue, with the runs that it excuses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KnownIssueRuns {
    /// The properties that fail, and no others.
    pub fails: Vec<String>,
    /// The reason why it is accepted.
    pub reason: String,
    /// The last day on which it is accepted.
    pub until: String,
    /// Whether that day is over: its runs count again.
    pub is_expired: bool,
    /// Ids of the runs with this failure mode in the first and in the second side.
    pub runs: [Vec<String>; 2],
}

/// Scenes in which the same properties flipped.
#[derive(Debug, Clone, PartialEq)]
pub struct FlipGroup<'a> {
    /// Subjects that passed in the first side and failed in the second.
    pub worse: Vec<&'a Compared>,
    /// Subjects that failed in the first side and passed in the second.
    pub better: Vec<&'a Compared>,
    /// Runs of both sides.
    pub runs: Vec<(String, String)>,
}

/// Two compared campaigns, ready to print.
#[derive(Debug, Clone, PartialEq)]
pub struct CompareSummary {
    /// First and second side.
    pub sides: [ComparedSide; 2],
    /// The statistical comparison.
    pub comparison: Comparison,
    /// Configuration, program, models, ontology and rules that differ.
    pub changes: Vec<SideChange>,
    /// Significance level at which the second side must not be worse, if one was given.
    pub level: Option<f64>,
    /// Rates that differ by less count as equal.
    pub margin: f64,
    /// Whether the exit code is the answer.
    pub decide: bool,
    /// Whether tests that are valid at any look were asked for.
    pub sequential: bool,
    /// The comparison without the runs that another engine contests; `None` if there are none.
    pub without_contested: Option<Comparison>,
    /// The known issues. Scenes with one that is not expired are not compared.
    pub known: Vec<KnownIssueRuns>,
}

/// Significance level of the answer if none was given.
const USUAL_LEVEL: f64 = 0.05;

impl CompareSummary {
    /// Significance level of the answers.
    pub fn answer_level(&self) -> f64 {
        self.level.unwrap_or(USUAL_LEVEL)
    }

    /// The answer over all lines.
    pub fn answer(&self) -> Answer {
        self.comparison.answer(self.answer_level(), self.margin)
    }

    /// The code of the answer, if it was asked for: 0 same or no difference, 1 worse, 3 better, 4
    /// underpowered. Otherwise 1 if the second side is significantly worse at the given level, and
    /// 0 if not.
    pub fn exit_code(&self) -> u8 {
        if self.decide {
            return match self.answer() {
                Answer::Same | Answer::NoDifference => 0,
                Answer::Worse => 1,
                Answer::Better => 3,
                Answer::Underpowered { .. } => 4,
            };
        }
        u8::from(
            self.level
                .is_some_and(|level| !self.comparison.worse_at(level).is_empty()),
        )
    }

    /// The scenes that flipped, by the properties that did: those that got worse first, then the most
    /// frequent. Whole runs are named only if no property of theirs flipped.
    pub fn flip_groups(&self) -> Vec<FlipGroup<'_>> {
        type Flips<'a> = [Vec<&'a Compared>; 2];
        let mut pairs: BTreeMap<&(String, String), Flips<'_>> = BTreeMap::new();
        for line in &self.comparison.lines {
            for (side, runs) in [&line.worse, &line.better].into_iter().enumerate() {
                for pair in runs {
                    pairs.entry(pair).or_default()[side].push(&line.of);
                }
            }
        }
        let is_property = |of: &&Compared| matches!(of, Compared::Property { .. });
        let mut groups: BTreeMap<Flips<'_>, Vec<(String, String)>> = BTreeMap::new();
        for (pair, mut flips) in pairs {
            if flips.iter().flatten().any(is_property) {
                flips.iter_mut().for_each(|of| of.retain(is_property));
            }
            groups.entry(flips).or_default().push(pair.clone());
        }
        let mut found: Vec<FlipGroup<'_>> = groups
            .into_iter()
            .map(|([worse, better], mut runs)| {
                runs.sort_by_key(|(run, _)| (run.len(), run.clone()));
                FlipGroup {
                    worse,
                    better,
                    runs,
                }
            })
            .collect();
        found.sort_by_key(|group| (group.worse.is_empty(), std::cmp::Reverse(group.runs.len())));
        found
    }

    /// Configuration lines that only the first side has, and those that only the second has.
    /// Comments are ignored.
    pub fn config_lines(&self) -> [Vec<String>; 2] {
        let [first, second] = self
            .sides
            .each_ref()
            .map(|side| settings(&side.config_text));
        [without(&first, &second), without(&second, &first)]
    }
}

/// The subject of a comparison line, in words.
pub(crate) fn compared_name(of: &Compared) -> String {
    match of {
        Compared::WholeRun => "whole run".to_owned(),
        Compared::Completion => "run completes".to_owned(),
        Compared::Property { action, property } => {
            format!("{} {}", names::local(action), names::local(property))
        }
    }
}

/// Action and property; `(None, None)` for whole runs, and no action for their completion.
pub(crate) fn compared_parts(of: &Compared) -> (Option<String>, Option<String>) {
    match of {
        Compared::WholeRun => (None, None),
        Compared::Completion => (None, Some("run completes".to_owned())),
        Compared::Property { action, property } => (Some(action.clone()), Some(property.clone())),
    }
}

/// Lines of a configuration, each prefixed with its table's name. Comments are removed.
fn settings(text: &str) -> Vec<String> {
    let (mut found, mut table) = (Vec::new(), String::new());
    for line in text.lines() {
        // A `#` inside quotes is cut too. Both sides are cut alike, so only the printed line gets
        // shorter.
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.starts_with('[') && line.ends_with(']') && !line.contains('=') {
            table = format!("{line} ");
        } else if !line.is_empty() {
            found.push(format!("{table}{line}"));
        }
    }
    found
}

/// Multiset difference: the lines of `lines` that `others` lacks, counting repetitions.
fn without(lines: &[String], others: &[String]) -> Vec<String> {
    let mut left: Vec<&String> = others.iter().collect();
    let mut found = Vec::new();
    for line in lines {
        match left.iter().position(|other| *other == line) {
            Some(at) => {
                left.swap_remove(at);
            }
            None => found.push(line.clone()),
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_shown_with_their_table_and_without_comments() {
        let first = settings("seed = 7 # any\n[sensing]\nyaw = 0.1\n\n# nothing\nsize = 1");
        let second = settings("seed = 7\n[sensing]\nyaw = 0.2\nsize = 1\n");
        assert_eq!(without(&first, &second), ["[sensing] yaw = 0.1"]);
        assert_eq!(without(&second, &first), ["[sensing] yaw = 0.2"]);
    }
}
