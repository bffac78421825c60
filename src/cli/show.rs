//! `actcheck show`

use std::path::Path;

use crate::base::{Diagnostic, Diagnostics};
use crate::cli::args::{Format, ShowArgs};
use crate::cli::{history_dir, output};
use crate::history::{History, Role, RunDetail};
use crate::report::{Table, run_json, run_picture, run_text};

/// Prints one run, and draws it where a picture is asked for.
pub fn show(args: &ShowArgs) -> Result<(), Diagnostics> {
    let history = history_dir::open(&args.history)?;
    let run = history.run(&args.run)?;
    output::print(&match args.format {
        Format::Table => run_text(&run),
        Format::Json => format!("{:#}\n", run_json(&run)),
        Format::Csv => outcomes(&run).render(Format::Csv.into()),
    });
    match &args.picture {
        Some(file) => draw(&history, &run, file),
        None => Ok(()),
    }
}

/// One row for each property of each action of a run.
pub(super) fn outcomes(run: &RunDetail) -> Table {
    let mut table = Table::new(["run", "step", "action", "property", "outcome", "margin", "witness"]);
    for action in &run.actions {
        for judgement in &action.judgements {
            table.rows.push(vec![
                run.row.run.clone().into(),
                action.step.into(),
                action.action.clone().into(),
                judgement.property.clone().into(),
                judgement.outcome.word().into(),
                judgement.margin.into(),
                judgement.witness.clone().into(),
            ]);
        }
    }
    table
}

pub(super) fn draw(history: &History, run: &RunDetail, file: &Path) -> Result<(), Diagnostics> {
    let trace = history.trace(&run.row.run)?;
    let target = run.objects.iter().find(|object| object.role == Role::Target).map(|object| object.id.as_str());
    let title = format!("{} ({}): {}, S = {:.2}", run.row.run, run.row.test, run.row.status.word(), run.row.score);
    let picture = run_picture(&trace, target, &title).ok_or_else(|| {
        Diagnostic::error("X006", format!("run {} has no state to draw", run.row.run))
            .help("it was broken before its first action; `actcheck show` says why")
    })?;
    std::fs::write(file, picture).map_err(|error| {
        Diagnostic::error("X007", format!("{} can't be written: {error}", file.display()))
            .help("name a file in a folder that exists and may be written")
            .into()
    })
}
