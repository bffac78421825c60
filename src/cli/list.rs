//! `actcheck list`

use serde_json::Value;

use crate::args::ListArgs;
use crate::{history_dir, output};
use actcheck_base::Diagnostics;
use actcheck_history::{RunFilter, RunRow};
use actcheck_report::Table;

/// Returns a run's value in a column.
type Cell = fn(&RunRow) -> Value;

/// Prints one line for each run.
pub fn list(args: &ListArgs) -> Result<(), Diagnostics> {
    let history = history_dir::open_to_read(&args.history)?;
    let runs = history.runs(&RunFilter { campaign: args.campaign.clone(), ..RunFilter::default() })?;
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
    let mut table = Table::new(shown.iter().map(|(name, ..)| *name));
    table.rows = runs.iter().map(|row| shown.iter().map(|(.., cell)| cell(row)).collect()).collect();
    output::print(&table.render(args.format.into()));
    Ok(())
}
