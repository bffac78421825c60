//! Export of a dataset to a folder: its tables, and a description of their columns.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::dataset::columns::{ACTIONS, IMAGES, JOINTS, OBJECTS, PERCEPTS, ROBOT, TableSpec};
use crate::dataset::fact_columns::{
    BODIES, CONTACTS, EXTREMES, INTERVALS, JOINT_EXTREMES, LINKS, PLACES, PLANES, SELF_CONTACTS,
    SHAPES, STATES,
};
use crate::dataset::images::DrawImages;
use crate::dataset::sheets::Sheets;
use crate::dataset::{course, fact_source, images, source};
use crate::tables::{new_text, outcomes_schema, pending_parquet, unwritten};
use crate::{Hierarchy, Mirror, TableFilter};
use actcheck_base::{Below, Diagnostics};
use actcheck_history::{History, RunDetail};

/// Tables with the facts from which outcomes follow.
const FACTS: [&TableSpec; 13] = [
    &ACTIONS,
    &PERCEPTS,
    &PLANES,
    &STATES,
    &BODIES,
    &LINKS,
    &CONTACTS,
    &SELF_CONTACTS,
    &EXTREMES,
    &INTERVALS,
    &JOINT_EXTREMES,
    &SHAPES,
    &PLACES,
];
/// Tables of motion over time.
const COURSES: [&TableSpec; 3] = [&JOINTS, &ROBOT, &OBJECTS];

/// A written dataset.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Dataset {
    /// Number of runs.
    pub runs: usize,
    /// Number of runs without motion, because simulating them again would start a program without
    /// consent.
    pub withheld: usize,
    /// Paths of the tables with their numbers of rows.
    pub tables: Vec<(PathBuf, usize)>,
    /// Path of the description of the columns.
    pub schema: PathBuf,
}

/// The runs of an export and the source of their outcomes.
#[derive(Clone, Copy)]
pub struct DatasetRuns<'a> {
    /// The history with the traces.
    pub history: &'a History,
    /// Its outcomes.
    pub mirror: &'a Mirror,
    /// Selects the runs.
    pub filter: &'a TableFilter,
    /// Superclasses of the objects' classes.
    pub hierarchy: &'a Hierarchy,
}

/// Writes observations, commands, percepts, ground truth and outcomes of runs into a folder,
/// creating it if needed. `with_course`: also the course of each action at the control rate.
/// `images`: also the camera's colour images, which it draws.
///
/// # Errors
/// `A001` if it can't be written; errors of reading the history or a trace.
pub fn export_dataset(
    runs: &DatasetRuns<'_>,
    folder: &Path,
    with_course: bool,
    mut images: Option<&mut DrawImages<'_>>,
) -> Result<Dataset, Diagnostics> {
    let further = course::COURSE.into_iter().filter(|_| with_course);
    let of_images = images.iter().map(|_| &IMAGES);
    let tables: Vec<&TableSpec> = FACTS
        .into_iter()
        .chain(COURSES)
        .chain(further)
        .chain(of_images)
        .collect();
    export(runs, &tables, folder, |run, sheets| {
        let Some(trace) = runs.history.traces().whole_if_allowed(&run.row.run)? else {
            return add_facts(runs, run, sheets).map(|()| Motion::Withheld);
        };
        source::add(run, &trace, sheets);
        fact_source::add(run, &trace, runs.hierarchy, sheets);
        source::add_courses(&run.row.run, &trace, sheets);
        if with_course {
            course::add(&run.row.run, &trace, sheets);
        }
        if let Some(draw) = &mut images {
            images::add(run, &trace, *draw, sheets)?;
        }
        Ok(Motion::Written)
    })
}

/// Writes the outcomes of runs and the facts from which they follow into a folder, creating it if
/// needed.
///
/// # Errors
/// As [`export_dataset`].
pub fn export_facts(runs: &DatasetRuns<'_>, folder: &Path) -> Result<Dataset, Diagnostics> {
    export(runs, &FACTS, folder, |run, sheets| {
        add_facts(runs, run, sheets).map(|()| Motion::Written)
    })
}

/// Adds the tables of a run that need no motion.
fn add_facts(
    runs: &DatasetRuns<'_>,
    run: &RunDetail,
    sheets: &mut Sheets,
) -> Result<(), Diagnostics> {
    let trace = runs.history.traces().states(&run.row.run)?;
    source::add(run, &trace, sheets);
    fact_source::add(run, &trace, runs.hierarchy, sheets);
    Ok(())
}

/// Whether a run's motion is in the dataset, if tables of motion were asked for.
enum Motion {
    /// It is.
    Written,
    /// Simulating it again would start a program without consent.
    Withheld,
}

/// Writes tables whose rows come from `add`.
fn export(
    runs: &DatasetRuns<'_>,
    tables: &[&TableSpec],
    folder: &Path,
    mut add: impl FnMut(&RunDetail, &mut Sheets) -> Result<Motion, Diagnostics>,
) -> Result<Dataset, Diagnostics> {
    let outcomes = pending_parquet(runs.mirror, runs.filter, runs.hierarchy, folder)?;
    let mut dataset = Dataset {
        schema: folder.join("schema.json"),
        ..Dataset::default()
    };
    let mut sheets = Sheets::begin(tables, folder)?;
    for (campaign, ids) in runs.history.run_ids()? {
        for run in ids.iter().filter(|_| runs.filter.takes_campaign(&campaign)) {
            let detail = runs.history.newest_run(run)?;
            if runs
                .filter
                .since
                .as_ref()
                .is_some_and(|since| detail.row.started < *since)
            {
                continue;
            }
            dataset.runs += 1;
            match add(&detail, &mut sheets)? {
                Motion::Written => {}
                Motion::Withheld => dataset.withheld += 1,
            }
            sheets.make_room()?;
        }
    }
    sheets.complete()?;
    let described = new_text(
        &Below::new(folder),
        &dataset.schema,
        &format!("{:#}\n", schema(tables)),
    )?;
    // Everything is on the disk: from here on, files only get their names.
    dataset.tables = sheets.finish()?;
    dataset.tables.push(outcomes.finish_table()?);
    described
        .finish()
        .map_err(|error| unwritten(&dataset.schema, &error))?;
    Ok(dataset)
}

/// Returns the description of the tables and their columns. `rows` and `columns` describe the table
/// of outcomes, as in an export of only that table.
fn schema(tables: &[&TableSpec]) -> Value {
    let mut schema = outcomes_schema();
    let mut outcomes = schema.clone();
    outcomes["file"] = json!("outcomes.parquet");
    let frames = "positions are in the world frame, Z up; those of percepts, planes, the base's joints, base_* of \
                  robot.parquet and believed_* are the robot's estimates, all others are ground truth";
    schema["frames"] = json!(frames);
    schema["tables"] = tables
        .iter()
        .map(|table| json!(table))
        .chain([outcomes])
        .collect();
    schema
}
