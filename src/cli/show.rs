//! `actcheck show`

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;

use crate::options::{Format, HistoryArgs};
use crate::picture::Picture;
use crate::{history_dir, output};
use actcheck_analysis::perceived_sentences;
use actcheck_base::Diagnostics;
use actcheck_history::{History, RunDetail};
use actcheck_report::{Table, run_json, run_text};

/// `actcheck show`
#[derive(Debug, Args)]
pub struct ShowArgs {
    /// Id of the run, or a unique prefix
    pub run: String,
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
    /// Draw the scene before and after the run into this file, as a raster (.png) or vector image (.svg)
    #[arg(long, value_name = "FILE.png")]
    pub picture: Option<PathBuf>,
    /// How it is printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
}

/// Prints one run, and draws it if a picture is requested.
pub fn show(args: &ShowArgs) -> Result<(), Diagnostics> {
    let picture = args.picture.as_deref().map(Picture::new).transpose()?;
    let history = history_dir::open_to_read(&args.history)?;
    let run = history.run(&args.run)?;
    output::print(&match args.format {
        Format::Text => run_text(&run, &perceived(&history, &run)),
        Format::Json => format!("{:#}\n", run_json(&run, &perceived(&history, &run))),
        Format::Csv => outcomes(&run).render(Format::Csv.into()),
    });
    match picture {
        Some(picture) => picture.draw(&history, &run),
        None => Ok(()),
    }
}

/// Sentences about the perceived targets of a run's actions that failed, by their positions. Empty if its trace can't be
/// read.
pub(super) fn perceived(history: &History, run: &RunDetail) -> BTreeMap<u32, String> {
    history.states(&run.row.run).map(|trace| perceived_sentences(run, &trace)).unwrap_or_default()
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
