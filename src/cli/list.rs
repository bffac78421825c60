//! `actcheck list`

use std::collections::BTreeMap;

use clap::Args;
use serde_json::Value;

use crate::chosen::{self, is_meant};
use crate::options::{Format, HistoryArgs};
use crate::where_rows::{Condition, matching_runs};
use crate::{history_dir, output};
use actcheck_base::{Diagnostics, Outcome, did_you_mean, names};
use actcheck_history::{History, OutcomeRow, RunFilter, RunRow};
use actcheck_report::Table;

/// `actcheck list`
#[derive(Debug, Args)]
pub struct ListArgs {
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
    /// Only the runs of this campaign
    #[arg(long, value_name = "ID")]
    pub campaign: Option<String>,
    /// Only runs in which a property failed
    #[arg(long)]
    pub failed: bool,
    /// Only runs in which this property was judged, by its name in the ontology, and a column with its outcomes; with
    /// `--failed` or `--outcome`, only those in which it has that outcome (may be given several times)
    #[arg(long, value_name = "P")]
    pub property: Vec<String>,
    /// Only runs in which a property has this outcome: passed, failed, inapplicable, broken, timeout or untested
    #[arg(long, value_name = "OUTCOME", value_parser = outcome, conflicts_with = "failed")]
    pub outcome: Option<Outcome>,
    /// Only runs with an outcome that satisfies this condition on a column of the table of outcomes, such as
    /// `target_mass_kg > 0.3` or `target_category = Glass` (may be given several times; `actcheck export --csv` writes
    /// the table and describes its columns). With `--property`, `--failed` or `--outcome`, one of these outcomes must
    /// satisfy it. Shrunk runs, cases and failed runs that ran again are not in the table
    #[arg(long = "where", value_name = "COLUMN<VALUE", value_parser = Condition::parse)]
    pub conditions: Vec<Condition>,
    /// How the table is printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
}

impl ListArgs {
    /// The outcome that a run must have.
    fn wanted(&self) -> Option<Outcome> {
        if self.failed { Some(Outcome::Failed) } else { self.outcome }
    }
}

/// Returns a run's value in a column.
type Cell = fn(&RunRow) -> Value;

/// Prints one line for each run.
pub fn list(args: &ListArgs) -> Result<(), Diagnostics> {
    let history = history_dir::open_to_read(&args.history)?;
    if let Some(campaign) = &args.campaign {
        history.campaign(campaign)?;
    }
    let filter = RunFilter { campaign: args.campaign.clone(), ..RunFilter::default() };
    let mut runs = history.runs(&filter)?;
    let judged = Judged::read(args, &history, &filter)?;
    runs.retain(|row| judged.as_ref().is_none_or(|judged| judged.has(&row.run)));
    if !args.conditions.is_empty() {
        let campaign = args.campaign.as_ref();
        let found = matching_runs(&history, campaign, &args.property, args.wanted(), &args.conditions)?;
        runs.retain(|row| found.contains(&row.run));
    }
    // Most campaigns have neither, so empty columns are hidden.
    let repeated = runs.iter().any(|row| row.repetition.is_some());
    let weighted = runs.iter().any(|row| row.weight.is_some());
    let columns: [(&str, bool, Cell); 9] = [
        ("run", true, |row| row.run.as_str().into()),
        ("index", true, |row| row.index.into()),
        ("scene", repeated, |row| row.repetition.map(|repetition| repetition.scene).into()),
        ("repetition", repeated, |row| row.repetition.map(|repetition| repetition.number).into()),
        ("test", true, |row| row.test.as_str().into()),
        ("status", true, |row| row.status.word().into()),
        ("score", true, |row| row.score.into()),
        ("weight", weighted, |row| row.weight.into()),
        ("trace_hash", true, |row| row.trace_hash.as_str().into()),
    ];
    let shown: Vec<_> = columns.into_iter().filter(|(_, shown, _)| *shown).collect();
    let mut table =
        Table::new(shown.iter().map(|(name, ..)| *name)).with_expendable(["trace_hash", "index", "weight", "test"]);
    table.columns.extend(args.property.iter().map(|name| names::local(name).to_owned()));
    let row = |row: &RunRow| {
        let outcomes =
            args.property.iter().map(|name| judged.as_ref().map(|judged| judged.words(&row.run, name)).into());
        shown.iter().map(|(.., cell)| cell(row)).chain(outcomes).collect()
    };
    table.rows = runs.iter().map(row).collect();
    output::print(&table.render(args.format.into(), output::page()));
    if runs.is_empty() {
        output::print_none("no run matches; `actcheck list` without options lists all");
    }
    Ok(())
}

fn outcome(word: &str) -> Result<Outcome, String> {
    Outcome::from_word(word).ok_or_else(|| did_you_mean(word, Outcome::ALL.map(Outcome::word)))
}

/// The outcomes by which runs are chosen.
struct Judged {
    /// The outcomes of the named properties, or of all, in each run.
    outcomes: BTreeMap<String, Vec<OutcomeRow>>,
    /// The outcome that a run must have.
    wanted: Option<Outcome>,
}

impl Judged {
    /// Reads the outcomes that the options name. Returns `None` if no option chooses runs by outcome.
    fn read(args: &ListArgs, history: &History, filter: &RunFilter) -> Result<Option<Self>, Diagnostics> {
        let wanted = args.wanted();
        if wanted.is_none() && args.property.is_empty() {
            return Ok(None);
        }
        let rows = history.newest_outcomes(filter)?.rows;
        chosen::all_judged(&args.property, rows.iter().map(|row| row.property.as_str()))?;
        let is_named = |row: &OutcomeRow| args.property.iter().any(|name| is_meant(&row.property, name));
        let mut outcomes: BTreeMap<String, Vec<OutcomeRow>> = BTreeMap::new();
        for row in rows.into_iter().filter(|row| args.property.is_empty() || is_named(row)) {
            outcomes.entry(row.run.clone()).or_default().push(row);
        }
        Ok(Some(Self { outcomes, wanted }))
    }

    /// Whether a run is chosen.
    fn has(&self, run: &str) -> bool {
        let is_wanted = |row: &OutcomeRow| self.wanted.is_none_or(|wanted| row.outcome == wanted);
        self.outcomes.get(run).is_some_and(|rows| rows.iter().any(is_wanted))
    }

    /// The outcomes of a property in a run, one for each action that has it.
    fn words(&self, run: &str, property: &str) -> String {
        let rows = self.outcomes.get(run).into_iter().flatten().filter(|row| is_meant(&row.property, property));
        rows.map(|row| row.outcome.word()).collect::<Vec<_>>().join(", ")
    }
}
