//! A campaign as a flat table with one row for each property of each action of each run.

use serde_json::Value;

use crate::{CampaignSummary, Table};
use actcheck_base::names;

/// Builds the flat table.
pub fn campaign_table(summary: &CampaignSummary) -> Table {
    let mut table = Table::new([
        "run", "index", "test", "status", "action", "property", "outcome", "margin", "witness",
    ]);
    for run in &summary.runs {
        for action in &run.actions {
            for judgement in &action.judgements {
                table.rows.push(vec![
                    run.id.clone().into(),
                    run.index.into(),
                    run.test.clone().into(),
                    run.status.word().into(),
                    action.name.clone().into(),
                    names::local(&judgement.property).into(),
                    judgement.outcome.word().into(),
                    judgement.margin.map_or(Value::Null, Value::from),
                    judgement.witness.clone().into(),
                ]);
            }
        }
    }
    table
}
