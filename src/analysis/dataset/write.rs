//! A dataset in a folder: its tables, and the description of their columns.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::analysis::dataset::columns::{ACTIONS, JOINTS, OBJECTS, PERCEPTS, ROBOT};
use crate::analysis::dataset::sheet::Sheet;
use crate::analysis::dataset::source::Sheets;
use crate::analysis::tables::{outcomes_schema, unwritten};
use crate::analysis::{Hierarchy, Mirror, TableFilter, export_parquet};
use crate::base::Diagnostics;
use crate::history::History;

/// What was written.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Dataset {
    /// Runs that it holds.
    pub runs: usize,
    /// Of them those whose traces hold no course of the robot, since an earlier version kept them.
    pub without_course: usize,
    /// Its tables, each with how many rows it has.
    pub tables: Vec<(PathBuf, usize)>,
    /// The description of their columns.
    pub schema: PathBuf,
}

/// Writes observations, commands, percepts, the truth and outcomes of runs into a folder, which is made.
///
/// # Errors
/// `A001` it can't be written; the history or a trace can't be read.
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

/// What every table and column says.
fn schema() -> Value {
    let mut outcomes = outcomes_schema();
    if let Some(outcomes) = outcomes.as_object_mut() {
        outcomes.insert("file".to_owned(), json!("outcomes.parquet"));
    }
    let frames = "positions are in the world's frame, Z up: those of percepts, of the base's joints and of base_* as the robot \
                  believes it to lie, those of objects and of true_base_* as it does";
    json!({ "frames": frames, "tables": [json!(ACTIONS), json!(JOINTS), json!(ROBOT), json!(OBJECTS), json!(PERCEPTS), outcomes] })
}
