//! The record of the last submitted job, `job.json` in the folder of the launch: with it, the same
//! command follows the job again.

use serde_json::{Value, json};

use crate::launch::args::On;
use crate::launch::plan::{Plan, read_below};
use actcheck_base::{Diagnostic, Diagnostics};

/// A job, from before its submission until it has ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Record {
    /// The scheduler's name.
    pub on: String,
    /// Number of the job in this launch, from 1.
    pub round: u64,
    /// The scheduler's id; `None` until it has answered.
    pub id: Option<String>,
    /// The command that ends the job.
    pub cancel: Option<String>,
    pub has_ended: bool,
}

impl Record {
    /// Reads the record of a launch; `None` if it has submitted no job.
    pub fn read(plan: &Plan) -> Option<Self> {
        let text = read_below(&plan.folder, "job.json")?;
        let value: Value = serde_json::from_slice(&text).ok()?;
        let text = |key: &str| value[key].as_str().map(str::to_owned);
        Some(Self {
            on: text("on")?,
            round: value["round"].as_u64()?,
            id: text("id"),
            cancel: text("cancel"),
            has_ended: value["ended"].as_bool()?,
        })
    }

    /// # Errors
    /// `X074` it can't be written.
    pub fn write(&self, plan: &Plan) -> Result<(), Diagnostics> {
        let Self {
            on,
            round,
            id,
            cancel,
            has_ended,
        } = self;
        let value =
            json!({"on": on, "round": round, "id": id, "cancel": cancel, "ended": has_ended});
        let written = plan.below().write_atomic(
            &plan.folder.join("job.json"),
            format!("{value:#}\n").as_bytes(),
        );
        written.map_err(|error| plan.unwritable(&error))
    }

    /// The name of a job, the same after an interrupted submission.
    pub fn name(plan: &Plan, round: u64) -> String {
        format!("actcheck-{}-{round}", plan.id)
    }
}

/// Checks that no other scheduler has the shards of a launch.
///
/// # Errors
/// `X073` one has.
pub(super) fn check_place(plan: &Plan, on: On) -> Result<(), Diagnostics> {
    let Some(record) =
        Record::read(plan).filter(|record| record.on != on.name() && !record.has_ended)
    else {
        return Ok(());
    };
    let id = record
        .id
        .unwrap_or_else(|| Record::name(plan, record.round));
    let message = format!(
        "the shards in `{}` belong to job {id} of {}",
        plan.folder.display(),
        record.on
    );
    let end = record.cancel.map_or_else(String::new, |command| {
        format!("end the job with `{command}` and ")
    });
    let help = format!(
        "give the command with `--on {}` again; to run the rest elsewhere, {end}remove `{}`",
        record.on,
        plan.folder.join("job.json").display()
    );
    Err(Diagnostic::error("X073", message).help(help).into())
}
