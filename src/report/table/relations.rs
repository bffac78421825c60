//! The relations between pairs of runs as flat tables.

use crate::table::percent_interval;
use crate::{RelationsSummary, Table};

/// One row for each relation.
pub fn relations_table(summary: &RelationsSummary) -> Table {
    let mut table = Table::new([
        "relation",
        "holds",
        "interval",
        "broken",
        "inapplicable",
        "unjudged",
    ]);
    for relation in summary.relations() {
        table.rows.push(vec![
            relation.name.into(),
            format!("{} of {}", relation.kept.agree, relation.kept.of).into(),
            percent_interval(relation.kept).into(),
            relation.violated.len().into(),
            relation.inapplicable.into(),
            relation.broken.into(),
        ]);
    }
    table
}
