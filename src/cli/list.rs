//! `actcheck list`

use serde_json::Value;

use crate::base::Diagnostics;
use crate::cli::args::ListArgs;
use crate::cli::{history_dir, output};
use crate::history::RunFilter;
use crate::report::Table;

/// Prints one line for each run.
pub fn list(args: &ListArgs) -> Result<(), Diagnostics> {
    let history = history_dir::open(&args.history)?;
    let mut table = Table::new(["run", "index", "test", "status", "score", "trace_hash"]);
    for row in history.runs(&RunFilter { campaign: args.campaign.clone(), ..RunFilter::default() })? {
        table.rows.push(vec![
            row.run.into(),
            row.index.into(),
            row.test.into(),
            row.status.word().into(),
            Value::from(row.score),
            row.trace_hash.into(),
        ]);
    }
    output::print(&table.render(args.format.into()));
    Ok(())
}
