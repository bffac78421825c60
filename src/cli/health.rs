//! `actcheck health`

use std::collections::BTreeMap;
use std::sync::Arc;

use clap::Args;

use crate::options::{Format, HistoryArgs};
use crate::work::both;
use crate::{compare, history_dir, integrity, output};
use actcheck_analysis::HealthMeter;
use actcheck_base::{Diagnostic, Diagnostics, Outcome};
use actcheck_history::{History, JudgedRun, RunFilter, Wish};
use actcheck_report::{HealthSummary, health_json, health_table, health_text};

/// `actcheck health`
#[derive(Debug, Args)]
pub struct HealthArgs {
    /// Id of the campaign [default: the newest]
    pub campaign: Option<String>,
    /// Compare the files of the whole history with their checksums and with each other, and name
    /// the damaged ones; a damaged mirror (the folder `tables`) is written anew
    #[arg(long, conflicts_with = "campaign")]
    pub integrity: bool,
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
    /// How it is printed (csv: the table of parameters, or of damage)
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
}

/// Prints the health of a campaign. Returns the exit code.
pub fn health(args: &HealthArgs) -> Result<u8, Diagnostics> {
    if args.integrity {
        return integrity::examine(&args.history, args.format);
    }
    let history = history_dir::open_to_read(&args.history)?;
    let campaign = match &args.campaign {
        Some(id) => id.clone(),
        None => compare::newest(&history)?,
    };
    let summary = examine(&history, &campaign)?;
    if summary.health.runs == 0 {
        return Err(Diagnostic::error(
            "X057",
            format!("campaign {campaign} has no runs to examine"),
        )
        .help("`actcheck list` shows the runs of all campaigns")
        .into());
    }
    output::print(&match args.format {
        Format::Text => health_text(&summary, output::page()),
        Format::Csv => health_table(&summary).render(Format::Csv.into(), output::page()),
        Format::Json => format!("{:#}\n", health_json(&summary)),
    });
    output::print_diagnostics(&summary.warnings());
    Ok(summary.exit_code())
}

/// Examines the health of a campaign.
///
/// # Errors
/// `H014` the campaign does not exist; or the history can't be read.
pub(super) fn examine(history: &History, campaign: &str) -> Result<HealthSummary, Diagnostics> {
    // Traces and statements are read side by side.
    let (vitals, outcomes) = both(
        || {
            let mut meter = HealthMeter::default();
            history
                .each_vitals(campaign, |run| meter.add(run))
                .map(|_| meter)
        },
        || {
            let mut outcomes: BTreeMap<(Arc<str>, Outcome), u64> = BTreeMap::new();
            let filter = RunFilter {
                campaign: Some(campaign.to_owned()),
                ..RunFilter::default()
            };
            let add = &mut |run: JudgedRun| {
                for own in run.outcomes {
                    *outcomes.entry((own.property, own.outcome)).or_default() += 1;
                }
            };
            history
                .each_judged(&filter, Wish::default(), add)
                .map(|_| outcomes)
        },
    );
    let mut meter = vitals?;
    for ((property, outcome), count) in outcomes? {
        meter.add_outcomes(&property, outcome, count);
    }
    Ok(HealthSummary {
        campaign: campaign.to_owned(),
        history: history.dir().display().to_string(),
        program: std::env::args()
            .next()
            .unwrap_or_else(|| "actcheck".to_owned()),
        health: meter.finish(),
    })
}
