//! `actcheck show`

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;

use crate::appearance::AppearanceReader;
use crate::options::{Format, HistoryArgs};
use crate::picture::Picture;
use crate::trust::TrustArgs;
use crate::{history_dir, output, restore};
use actcheck_analysis::perceived_sentences;
use actcheck_base::{Diagnostics, names};
use actcheck_campaign::made_by_other_physics;
use actcheck_data::Trace;
use actcheck_history::{CampaignRecord, FindingRecord, History, RunDetail};
use actcheck_report::{Table, run_json, run_text, skill_json, skill_text};

/// `actcheck show`
#[derive(Debug, Args)]
pub struct ShowArgs {
    /// Id of the run, or a unique prefix
    pub run: String,
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
    /// The consent to start programs.
    #[command(flatten)]
    pub trust: TrustArgs,
    /// Draw the scene before and after the run into this file, as a raster (.png) or vector image
    /// (.svg)
    #[arg(long, value_name = "FILE.png")]
    pub picture: Option<PathBuf>,
    /// The ontology whose rules explain failures in the picture [default: ontology/actions.ttl
    /// here, or the shipped one]
    #[arg(long, value_name = "FILE")]
    pub ontology: Option<PathBuf>,
    /// How it is printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
}

/// Prints one run, and draws it if a picture is requested.
pub fn show(args: &ShowArgs) -> Result<(), Diagnostics> {
    let picture = args.picture.as_deref().map(Picture::new).transpose()?;
    let history = history_dir::open_to_read(&args.history)?;
    restore::allow(&history, args.trust.trust);
    let run = history.newest_run(&args.run)?;
    // The store has the outcomes, also those of a run whose trace is damaged.
    let (trace, damage) = match trace_of(&history, &run, args.trust.trust) {
        Ok(trace) => (trace, None),
        Err(faults) => (None, Some(faults)),
    };
    let perceived = trace
        .as_ref()
        .map(|trace| perceived_sentences(&run, trace))
        .unwrap_or_default();
    output::print(&match args.format {
        Format::Text => {
            let page = output::page();
            let again = judged_again(&history.run(&run.row.run)?, &run);
            let campaign = history.campaign(&run.row.campaign)?;
            let notes = again + &made_by(&campaign) + &findings(&campaign);
            run_text(&run, &perceived, page)
                + &trace
                    .as_ref()
                    .map_or_else(String::new, |trace| skill_text(trace, page))
                + &page.set(&notes)
        }
        Format::Json => {
            let mut json = run_json(&run, &perceived);
            json["skill"] = trace.as_ref().map(skill_json).into();
            format!("{json:#}\n")
        }
        Format::Csv => outcomes(&run).render(Format::Csv.into(), output::page()),
    });
    if let Some(faults) = damage {
        return Err(faults);
    }
    match picture {
        Some(picture) => {
            let looks = AppearanceReader::new(&history, args.trust.trust);
            picture.draw(&history, &run, args.ontology.as_deref(), looks)
        }
        None => Ok(()),
    }
}

/// Says that the run was made by other physics than this program's. Empty if it was not.
fn made_by(campaign: &CampaignRecord) -> String {
    made_by_other_physics(campaign)
        .map(|made| format!("{made}: a replay has other states\n"))
        .unwrap_or_default()
}

/// Names the warnings about the rules that its campaign keeps.
fn findings(campaign: &CampaignRecord) -> String {
    let line = |found: &FindingRecord| {
        let place = found
            .place
            .as_ref()
            .map(|place| format!(" {place}"))
            .unwrap_or_default();
        format!(
            "finding about the rules of its campaign: {}{place}: {}\n",
            found.code, found.message
        )
    };
    campaign.findings.iter().map(line).collect()
}

/// The trace of a run: with its motion if a program took part, whose joints are then shown, and if
/// it is kept or may be simulated again. `None` if the trace is missing.
///
/// # Errors
/// `H007` it is damaged.
fn trace_of(
    history: &History,
    run: &RunDetail,
    is_trusted: bool,
) -> Result<Option<Trace>, Diagnostics> {
    let id = &run.row.run;
    let states = history_dir::unless_damaged(history.traces().states(id))?;
    match states {
        Some(trace) if !trace.skill.is_empty() && (is_trusted || history.is_whole(id)?) => {
            let whole = history.traces().whole_if_allowed(id)?;
            Ok(Some(whole.unwrap_or(trace)))
        }
        states => Ok(states),
    }
}

/// Sentences about the perceived targets of a run's actions that failed, by their positions. Empty
/// if its trace is missing.
///
/// # Errors
/// `H007` its trace is damaged.
pub(super) fn perceived(
    history: &History,
    run: &RunDetail,
) -> Result<BTreeMap<u32, String>, Diagnostics> {
    let trace = history_dir::unless_damaged(history.traces().states(&run.row.run))?;
    Ok(trace
        .map(|trace| perceived_sentences(run, &trace))
        .unwrap_or_default())
}

/// Names the outcomes that differ from those of the campaign. Empty if all are the same.
fn judged_again(own: &RunDetail, newest: &RunDetail) -> String {
    let mut notes = Vec::new();
    for (own, newest) in own.actions.iter().zip(&newest.actions) {
        for judgement in &newest.judgements {
            let name = names::local(&judgement.property);
            match own
                .judgements
                .iter()
                .find(|own| own.property == judgement.property)
            {
                None => notes.push(format!("{name} is new")),
                Some(own) if own.outcome != judgement.outcome => {
                    notes.push(format!("{name} was {}", own.outcome))
                }
                Some(_) => {}
            }
        }
    }
    if notes.is_empty() {
        String::new()
    } else {
        format!("judged again by `actcheck recheck`: {}\n", notes.join(", "))
    }
}

/// One row for each property of each action of a run.
pub(super) fn outcomes(run: &RunDetail) -> Table {
    let mut table = Table::new([
        "run", "step", "action", "property", "outcome", "margin", "witness",
    ]);
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
