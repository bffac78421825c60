//! Findings about one property of one action.

use crate::findings::judged::{JudgedProperty, failed, outcomes};
use crate::findings::margins::{Quantiles, quantiles};
use crate::findings::parameters::{conditions, effects};
use crate::findings::scenes::Scenes;
use crate::{Hierarchy, Interval, OutcomeTable, PatternInput, PatternOptions, Patterns, mine};
use actcheck_base::{Outcome, digest_of};
use actcheck_verdict::Counts;

/// One of this many runs is held out to confirm the patterns of the others.
const HELD_OUT_EVERY: u64 = 3;

/// Maximum number of effects that a pattern combines.
const MOST_EFFECTS: usize = 2;

/// Findings from a property's outcomes.
#[derive(Debug, Clone, PartialEq)]
pub struct PropertyFindings {
    /// IRI of the action.
    pub action: String,
    /// IRI of the property.
    pub property: String,
    /// How often each outcome occurred; of bit-identical runs only the newest counts.
    pub counts: Counts,
    /// Share of failed among passed and failed. The interval accounts for runs of the same scene.
    pub failing: Option<Interval>,
    /// Margins of its decided outcomes.
    pub margins: Option<Quantiles>,
    /// Decided runs from which patterns were mined, with the conditions of their scenes and their
    /// realised noise.
    pub input: PatternInput,
    /// IDs and rows of these runs.
    pub examples: Vec<Example>,
    /// Number of decided runs that don't count because a later run is bit-identical.
    pub twins: u64,
    /// Number of decided runs that were left out because another run of the same scene is used.
    pub repeated: u64,
    /// Number of used runs whose scene a search chose.
    pub weighted_runs: u64,
    /// Patterns of its failures: when it fails.
    pub patterns: Patterns,
    /// Effects, with the patterns of its failures: how it fails.
    pub effects: Mined,
}

impl PropertyFindings {
    /// Returns the runs with both conditions and effects.
    pub fn everything(&self) -> PatternInput {
        let mut all = self.input.clone();
        all.parameters
            .extend(self.effects.input.parameters.iter().cloned());
        all
    }
}

/// Runs and the patterns that were mined from them.
#[derive(Debug, Clone, PartialEq)]
pub struct Mined {
    /// The decided runs.
    pub input: PatternInput,
    /// Patterns of their failures.
    pub patterns: Patterns,
}

/// A run of the input.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Example {
    /// ID of the run.
    pub run: String,
    /// Index of its row in the table.
    pub row: u32,
}

/// Mines patterns in the decided runs of a property.
///
/// Runs must be independent: of bit-identical runs only the newest is used, and of the runs of one
/// scene only the first. Held-out runs are selected by a hash of their ID (or their scene's), so
/// that the selection is reproducible.
pub fn property_findings(
    table: &OutcomeTable,
    of: &JudgedProperty,
    hierarchy: &Hierarchy,
    options: &PatternOptions,
) -> PropertyFindings {
    let rates = Rates::of(table, of);
    let outcomes = outcomes(table);
    let rows = &rates.scenes;
    let input = PatternInput {
        failed: rows
            .iter()
            .map(|row| failed(outcomes[*row as usize]) == Some(true))
            .collect(),
        held_out: rows
            .iter()
            .map(|row| is_held_out(table, *row as usize))
            .collect(),
        parameters: conditions(table, rows, hierarchy),
        sampling: table.sampling,
    };
    let happened = PatternInput {
        parameters: effects(table, rows, hierarchy),
        ..input.clone()
    };
    let simple = PatternOptions {
        most_conditions: options.most_conditions.min(MOST_EFFECTS),
        ..*options
    };
    let run = table.text("run");
    PropertyFindings {
        action: of.action.clone(),
        property: of.property.clone(),
        counts: of.counts,
        failing: rates.failing,
        margins: rates.margins,
        examples: rows
            .iter()
            .map(|row| Example {
                run: run.get(*row as usize).unwrap_or_default().to_owned(),
                row: *row,
            })
            .collect(),
        twins: rates.twins,
        repeated: rates.repeated,
        weighted_runs: rates.weighted_runs,
        patterns: mine(&input, options),
        effects: Mined {
            patterns: mine(&happened, &simple),
            input: happened,
        },
        input,
    }
}

impl PropertyFindings {
    /// Replaces the counts, rates and margins, which come from a sample, by those of all rows.
    /// Patterns remain those of the sample.
    #[must_use]
    pub fn with_rates_of(self, table: &OutcomeTable, of: &JudgedProperty) -> Self {
        let Rates {
            failing,
            margins,
            twins,
            repeated,
            weighted_runs,
            ..
        } = Rates::of(table, of);
        Self {
            counts: of.counts,
            failing,
            margins,
            twins,
            repeated,
            weighted_runs,
            ..self
        }
    }
}

/// Rates and margins over all rows of a property.
struct Rates {
    failing: Option<Interval>,
    margins: Option<Quantiles>,
    twins: u64,
    repeated: u64,
    weighted_runs: u64,
    /// The decided rows, one for each scene.
    scenes: Vec<u32>,
}

impl Rates {
    fn of(table: &OutcomeTable, of: &JudgedProperty) -> Self {
        let outcomes = outcomes(table);
        let is_decided = |row: &u32| failed(outcomes[*row as usize]).is_some();
        let decided: Vec<u32> = of.rows.iter().copied().filter(is_decided).collect();
        let scenes = Scenes::of(table);
        let rows = scenes.first_rows(&decided);
        let (weight, margin) = (table.number("weight"), table.number("margin"));
        Self {
            failing: match scenes.runs(decided.iter().map(|row| *row as usize)) {
                Some(runs) => {
                    let failed = |at: &usize| outcomes[decided[*at] as usize] == Outcome::Failed;
                    runs.share((0..decided.len()).filter(failed), table.sampling)
                }
                None => table
                    .sampling
                    .interval(of.counts.failed, of.counts.decided()),
            },
            margins: quantiles(
                decided
                    .iter()
                    .filter_map(|row| margin.get(*row as usize).copied()),
            ),
            twins: (of.every_row.iter().filter(|row| is_decided(row)).count() - decided.len())
                as u64,
            repeated: (decided.len() - rows.len()) as u64,
            weighted_runs: rows
                .iter()
                .filter(|row| {
                    weight
                        .get(**row as usize)
                        .is_some_and(|weight| !weight.is_nan())
                })
                .count() as u64,
            scenes: rows,
        }
    }
}

fn is_held_out(table: &OutcomeTable, row: usize) -> bool {
    let run = table.text("run").get(row).unwrap_or_default();
    let key = match table.number("scene").get(row) {
        Some(scene) if !scene.is_nan() => {
            format!(
                "{} scene {scene}",
                table.text("campaign").get(row).unwrap_or_default()
            )
        }
        _ => run.to_owned(),
    };
    let digest = digest_of(&key);
    u64::from_str_radix(&digest[..digest.len().min(12)], 16)
        .unwrap_or_default()
        .is_multiple_of(HELD_OUT_EVERY)
}
