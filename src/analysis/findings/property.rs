//! When one property of one action fails.

use std::collections::BTreeSet;

use crate::analysis::findings::judged::{JudgedProperty, failed, outcomes};
use crate::analysis::findings::margins::{Quantiles, quantiles};
use crate::analysis::findings::parameters::parameters;
use crate::analysis::findings::scenes::Scenes;
use crate::analysis::{Hierarchy, Interval, OutcomeTable, PatternOptions, Patterns, Subject, mine, wilson};
use crate::base::digest_of;
use crate::verdict::{Counts, Outcome};

/// One run of so many is kept aside to confirm what the others show.
const HELD_OUT_EVERY: u64 = 3;

/// What a property's outcomes say.
#[derive(Debug, Clone, PartialEq)]
pub struct PropertyFindings {
    /// IRI of the action.
    pub action: String,
    /// IRI of the property.
    pub property: String,
    /// How often each outcome occurred.
    pub counts: Counts,
    /// Share of failed among passed and failed. Its interval knows which runs are of one scene.
    pub failing: Option<Interval>,
    /// Margins of its decided outcomes.
    pub margins: Option<Quantiles>,
    /// Decided runs that patterns were looked for in.
    pub subject: Subject,
    /// What these runs are.
    pub examples: Vec<Example>,
    /// Decided runs that went bit for bit like a later one, and count once.
    pub twins: u64,
    /// Decided runs of a scene that another run stands for.
    pub repeated: u64,
    /// Of the runs looked at, those whose scene a search chose.
    pub steered: u64,
    /// When it fails more often than elsewhere.
    pub patterns: Patterns,
}

/// A run of a subject.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Example {
    /// Id of the run.
    pub run: String,
    /// Its row in the table.
    pub row: u32,
}

/// Looks for patterns in the decided runs of a property.
///
/// Runs have to be independent of each other: of those that went bit for bit alike the newest counts, and of those of one scene the
/// first. Which runs are kept aside follows from their ids (or that of their scene), and so is the same every time.
pub fn property_findings(
    table: &OutcomeTable,
    of: &JudgedProperty,
    hierarchy: &Hierarchy,
    options: &PatternOptions,
) -> PropertyFindings {
    let outcomes = outcomes(table);
    let decided: Vec<u32> = of.rows.iter().copied().filter(|row| failed(outcomes[*row as usize]).is_some()).collect();
    let newest = newest_of_alike(table, &decided);
    let scenes = Scenes::of(table);
    let rows = scenes.first_rows(&newest);
    let weight = table.number("weight");
    let subject = Subject {
        failed: rows.iter().map(|row| failed(outcomes[*row as usize]) == Some(true)).collect(),
        held_out: rows.iter().map(|row| is_held_out(table, *row as usize)).collect(),
        parameters: parameters(table, &rows, hierarchy),
    };
    let run = table.text("run");
    let margin = table.number("margin");
    PropertyFindings {
        action: of.action.clone(),
        property: of.property.clone(),
        counts: of.counts,
        failing: match scenes.runs(decided.iter().map(|row| *row as usize)) {
            Some(runs) => {
                runs.share((0..decided.len()).filter(|at| outcomes[decided[*at] as usize] == Outcome::Failed))
            }
            None => wilson(of.counts.failed, of.counts.decided()),
        },
        margins: quantiles(decided.iter().filter_map(|row| margin.get(*row as usize).copied())),
        examples: rows
            .iter()
            .map(|row| Example { run: run.get(*row as usize).unwrap_or_default().to_owned(), row: *row })
            .collect(),
        twins: (decided.len() - newest.len()) as u64,
        repeated: (newest.len() - rows.len()) as u64,
        steered: rows.iter().filter(|row| weight.get(**row as usize).is_some_and(|weight| !weight.is_nan())).count()
            as u64,
        patterns: mine(&subject, options),
        subject,
    }
}

/// Of rows whose runs went bit for bit alike the last one, at the same step.
fn newest_of_alike(table: &OutcomeTable, rows: &[u32]) -> Vec<u32> {
    let (hash, step) = (table.text("trace_hash"), table.number("step"));
    let mut seen = BTreeSet::new();
    let mut kept: Vec<u32> = rows
        .iter()
        .rev()
        .copied()
        .filter(|row| {
            let at = *row as usize;
            // A run that has none (it was broken before its first state) is like no other.
            match (hash.of_row.get(at).copied().flatten(), step.get(at)) {
                (Some(hash), Some(step)) => seen.insert((hash, step.to_bits())),
                _ => true,
            }
        })
        .collect();
    kept.reverse();
    kept
}

fn is_held_out(table: &OutcomeTable, row: usize) -> bool {
    let run = table.text("run").get(row).unwrap_or_default();
    let key = match table.number("scene").get(row) {
        Some(scene) if !scene.is_nan() => {
            format!("{} scene {scene}", table.text("campaign").get(row).unwrap_or_default())
        }
        _ => run.to_owned(),
    };
    let digest = digest_of(&key);
    u64::from_str_radix(&digest[..digest.len().min(12)], 16).unwrap_or_default().is_multiple_of(HELD_OUT_EVERY)
}
