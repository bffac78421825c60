//! Export of a dataset to a folder: its tables, and a description of their columns.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::dataset::columns::{ACTIONS, JOINTS, OBJECTS, PERCEPTS, ROBOT};
use crate::dataset::sheet::Sheet;
use crate::dataset::source::Sheets;
use crate::tables::{outcomes_schema, unwritten};
use crate::{Hierarchy, Mirror, TableFilter, export_parquet};
use actcheck_base::Diagnostics;
use actcheck_history::History;

/// A written dataset.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Dataset {
    /// Number of runs.
    pub runs: usize,
    /// Number of runs whose traces lack the robot's motion, because an earlier version stored them.
    pub without_course: usize,
    /// Paths of the tables with their numbers of rows.
    pub tables: Vec<(PathBuf, usize)>,
    /// Path of the description of the columns.
    pub schema: PathBuf,
}

/// Writes observations, commands, percepts, ground truth and outcomes of runs into a folder, creating it if needed.
///
/// # Errors
/// `A001` if it can't be written; errors of reading the history or a trace.
pub fn export_dataset(
    history: &History,
    mirror: &Mirror,
    filter: &TableFilter,
    hierarchy: &Hierarchy,
    folder: &Path,
) -> Result<Dataset, Diagnostics> {
    let (_, outcomes) = export_parquet(mirror, filter, hierarchy, folder)?;
    let mut dataset = Dataset { schema: folder.join("schema.json"), ..Dataset::default() };
    let mut sheets = Sheets {
        actions: Sheet::begin(ACTIONS, folder)?,
        joints: Sheet::begin(JOINTS, folder)?,
        robot: Sheet::begin(ROBOT, folder)?,
        objects: Sheet::begin(OBJECTS, folder)?,
        percepts: Sheet::begin(PERCEPTS, folder)?,
    };
    for (campaign, runs) in history.run_ids()? {
        for run in runs.iter().filter(|_| filter.takes_campaign(&campaign)) {
            let detail = history.run(run)?;
            if filter.since.as_ref().is_some_and(|since| detail.row.started < *since) {
                continue;
            }
            dataset.runs += 1;
            dataset.without_course += usize::from(!sheets.add(&detail, &history.trace(run)?));
            for sheet in [&mut sheets.joints, &mut sheets.robot, &mut sheets.objects, &mut sheets.percepts] {
                sheet.make_room()?;
            }
        }
    }
    let Sheets { actions, joints, robot, objects, percepts } = sheets;
    for sheet in [actions, joints, robot, objects, percepts] {
        dataset.tables.push(sheet.finish()?);
    }
    dataset.tables.push((folder.join("outcomes.parquet"), outcomes));
    fs::write(&dataset.schema, format!("{:#}\n", schema())).map_err(|error| unwritten(&dataset.schema, &error))?;
    Ok(dataset)
}

/// Returns the description of every table and column.
fn schema() -> Value {
    let mut outcomes = outcomes_schema();
    if let Some(outcomes) = outcomes.as_object_mut() {
        outcomes.insert("file".to_owned(), json!("outcomes.parquet"));
    }
    let frames = "positions are in the world frame, Z up; those of percepts, the base's joints and base_* are the \
                  robot's estimates, those of objects and true_base_* are ground truth";
    json!({ "frames": frames, "tables": [json!(ACTIONS), json!(JOINTS), json!(ROBOT), json!(OBJECTS), json!(PERCEPTS), outcomes] })
}
