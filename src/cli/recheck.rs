//! `actcheck recheck`

use std::path::{Path, PathBuf};

use clap::Args;

use crate::options::{Format, HistoryArgs};
use crate::progress::Progress;
use crate::trust::TrustArgs;
use crate::why::ontology_file;
use crate::work::all_cores;
use crate::{clock, history_dir, output, restore, stop};
use actcheck_base::{Diagnostic, Diagnostics, Files, did_you_mean};
use actcheck_campaign::{Ending, RecheckOptions, RuleSet, recheck as judge_anew, side_by_side};
use actcheck_history::{History, RunFilter, RunRow};
use actcheck_report::{RecheckSummary, recheck_json, recheck_table, recheck_text};

/// Maximum number of faults that are reported; the rest are counted.
const MAX_LISTED: usize = 5;

/// `actcheck recheck`
#[derive(Debug, Args)]
pub struct RecheckArgs {
    /// Only these properties, by their names in the ontology [default: all success properties]
    #[arg(value_name = "PROPERTY")]
    pub properties: Vec<String>,
    /// Only the runs of this campaign; may be given several times [default: all]
    #[arg(long = "campaign", value_name = "ID")]
    pub campaigns: Vec<String>,
    /// The ontology with the rules, or a folder with it (`ontology/actions.ttl` or `actions.ttl`)
    /// and its rules, such as an older checkout [default: ontology/actions.ttl here, or the shipped
    /// one]
    #[arg(long, value_name = "FILE|DIR")]
    pub ontology: Option<PathBuf>,
    /// Number of workers; does not affect results [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
    /// The consent to start programs.
    #[command(flatten)]
    pub trust: TrustArgs,
    /// How it is printed (csv: one line for each outcome that changed or is new)
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
}

/// Judges stored runs by the current rules, stores new and changed outcomes, and prints them.
/// Returns the exit code.
pub fn recheck(args: &RecheckArgs) -> Result<u8, Diagnostics> {
    let (files, path) = ontology(args)?;
    let jobs = args.jobs.map_or_else(all_cores, usize::from);
    let (rules, listed) = side_by_side(
        jobs,
        || RuleSet::prepare(&files, &path)?.only(&args.properties),
        || {
            let history = history_dir::open_with(&args.history, jobs)?;
            restore::allow(&history, args.trust.trust);
            let runs = runs(&history, &args.campaigns)?;
            Ok((history, runs))
        },
    )?;
    let (rules, (history, runs)) = both(rules, listed)?;
    output::print_diagnostics(rules.warnings());
    let progress = Progress::new(runs.len() as u64, None);
    let bar = progress.bar();
    let stop = stop::on_interrupt(move || {
        bar.println("stopping after the runs in flight; judgements so far are kept")
    });
    let options = RecheckOptions {
        jobs,
        batch: RecheckOptions::BATCH,
        at: (clock::system().now)(),
    };
    if rules.reads_course() {
        restore::announce(&history, &runs, options.jobs)?;
    }
    let mut summary = RecheckSummary::default();
    let end = judge_anew(
        &history,
        &runs,
        |_| &rules,
        &options,
        &stop,
        |judged, rechecks| {
            summary.runs += judged;
            rechecks.iter().for_each(|recheck| summary.add(recheck));
            progress.judged(judged, summary.now().failed);
        },
    );
    progress.finish();
    output::print(&match args.format {
        Format::Text => recheck_text(&summary, output::page()),
        Format::Csv => recheck_table(&summary).render(args.format.into(), output::page()),
        Format::Json => format!("{:#}\n", recheck_json(&summary)),
    });
    match end.ending {
        Ending::Stopped(faults) => Err(faults),
        Ending::Interrupted => Ok(stop::INTERRUPTED),
        Ending::Finished if !end.faults.is_empty() => {
            let first = output::first_of(end.faults, MAX_LISTED, |more| {
                Diagnostic::error("X035", format!("{more} more runs could not be judged"))
            });
            Err(first)
        }
        Ending::Finished | Ending::Budget(_) => Ok(summary.exit_code()),
    }
}

/// Both results, or the faults of both.
fn both<A, B>(
    first: Result<A, Diagnostics>,
    second: Result<B, Diagnostics>,
) -> Result<(A, B), Diagnostics> {
    match (first, second) {
        (Ok(first), Ok(second)) => Ok((first, second)),
        (Err(mut faults), Err(others)) => {
            faults.extend(others);
            Err(faults)
        }
        (Err(faults), Ok(_)) | (Ok(_), Err(faults)) => Err(faults),
    }
}

/// The named ontology, the one of another version, or the default one.
fn ontology(args: &RecheckArgs) -> Result<(Files, PathBuf), Diagnostics> {
    let Some(folder) = args.ontology.as_ref().filter(|path| path.is_dir()) else {
        return Ok(ontology_file(args.ontology.as_deref()));
    };
    let places = ["ontology/actions.ttl", "actions.ttl"];
    match places
        .map(|place| folder.join(place))
        .into_iter()
        .find(|path| path.is_file())
    {
        Some(path) => Ok((Files::Disk, path)),
        None => Err(no_rules(folder).into()),
    }
}

fn no_rules(folder: &Path) -> Diagnostic {
    Diagnostic::error(
        "X032",
        format!(
            "{} has neither `ontology/actions.ttl` nor `actions.ttl`",
            folder.display()
        ),
    )
    .help("name a folder such as an older checkout of the project, with its ontology and rules")
}

/// The runs of the named campaigns, or all runs if none is named.
fn runs(history: &History, campaigns: &[String]) -> Result<Vec<RunRow>, Diagnostics> {
    let known: Vec<String> = history.campaigns()?.into_iter().map(|row| row.id).collect();
    let mut faults = Diagnostics::new();
    for id in campaigns.iter().filter(|id| !known.contains(id)) {
        let fault = format!(
            "the history `{}` has no campaign `{id}`",
            history.dir().display()
        );
        faults.push(
            Diagnostic::error("X033", fault)
                .help(did_you_mean(id, known.iter().map(String::as_str))),
        );
    }
    let mut runs = faults.or(history.runs(&RunFilter::default())?)?;
    runs.retain(|run| campaigns.is_empty() || campaigns.contains(&run.campaign));
    if runs.is_empty() {
        return Err(Diagnostic::error(
            "X034",
            format!(
                "the history `{}` has no runs to judge",
                history.dir().display()
            ),
        )
        .help("`actcheck run CONFIG` creates some")
        .into());
    }
    Ok(runs)
}
