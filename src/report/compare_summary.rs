//! A comparison with what people have to know of its sides.

use crate::analysis::{Compared, Comparison};
use crate::base::names;

/// One side of a comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct ComparedSide {
    /// As it was named: `k7f3`, `old/.actcheck#k7f3` or `k7f3@rechecked`.
    pub name: String,
    /// Id of the campaign.
    pub campaign: String,
    /// Name of its configuration.
    pub config: String,
    /// How many runs it has.
    pub runs: u64,
    /// How many were asked for.
    pub planned: u64,
    /// RFC 3339.
    pub started: String,
    /// Text of its configuration.
    pub config_text: String,
}

/// One thing that the sides do not share.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SideChange {
    /// Such as "model".
    pub kind: String,
    /// Its name.
    pub name: String,
    /// Digest or version of the first side; nothing where it lacks it.
    pub first: Option<String>,
    /// Digest or version of the second side; nothing where it lacks it.
    pub second: Option<String>,
}

/// Two campaigns, compared, for the printers.
#[derive(Debug, Clone, PartialEq)]
pub struct CompareSummary {
    /// The first and the second.
    pub sides: [ComparedSide; 2],
    /// What the numbers say.
    pub comparison: Comparison,
    /// Configuration, program, models, ontology and rules that differ.
    pub changes: Vec<SideChange>,
    /// The level at which the second must not be worse, where that was asked.
    pub level: Option<f64>,
}

impl CompareSummary {
    /// 1 where the second is worse at the level that was asked for, otherwise 0.
    pub fn exit_code(&self) -> u8 {
        u8::from(self.level.is_some_and(|level| !self.comparison.worse_at(level).is_empty()))
    }

    /// The lines of the configurations that only the first, and only the second has, without comments.
    pub fn config_lines(&self) -> [Vec<String>; 2] {
        let [first, second] = self.sides.each_ref().map(|side| settings(&side.config_text));
        [without(&first, &second), without(&second, &first)]
    }
}

/// What a line is about, in words.
pub(super) fn compared_name(of: &Compared) -> String {
    match of {
        Compared::WholeRun => "whole run".to_owned(),
        Compared::Property { action, property } => format!("{} {}", names::local(action), names::local(property)),
    }
}

/// Lines of a configuration, each behind its table's name, without what stands behind `#`.
fn settings(text: &str) -> Vec<String> {
    let (mut found, mut table) = (Vec::new(), String::new());
    for line in text.lines() {
        // A `#` within quotes is cut too: on both sides, so that only what is told gets shorter.
        let line = line.split('#').next().unwrap_or_default().trim();
        if line.starts_with('[') && line.ends_with(']') && !line.contains('=') {
            table = format!("{line} ");
        } else if !line.is_empty() {
            found.push(format!("{table}{line}"));
        }
    }
    found
}

/// The lines of one list that another lacks, as often as it lacks them.
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
    fn settings_are_told_with_their_table_and_without_comments() {
        let first = settings("seed = 7 # any\n[sensing]\nyaw = 0.1\n\n# nothing\nsize = 1");
        let second = settings("seed = 7\n[sensing]\nyaw = 0.2\nsize = 1\n");
        assert_eq!(without(&first, &second), ["[sensing] yaw = 0.1"]);
        assert_eq!(without(&second, &first), ["[sensing] yaw = 0.2"]);
    }
}
