//! Shrunk runs as a column of a campaign's table.

use serde_json::Value;

use crate::{ShrunkSummary, Table};

/// Adds a column to a campaign's table: the id of the shrunk run, if the row's run was shrunk.
pub fn with_shrunk(mut table: Table, shrunk: &[ShrunkSummary]) -> Table {
    let of = table.columns.iter().position(|column| column == "run");
    table.columns.push("shrunk_to".to_owned());
    for row in &mut table.rows {
        let run = of.and_then(|of| row[of].as_str());
        let small = shrunk.iter().find(|one| run == Some(one.original.as_str()));
        row.push(small.map_or(Value::Null, |one| one.run.row.run.clone().into()));
    }
    table
}
