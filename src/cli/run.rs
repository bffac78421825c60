//! `actcheck run`

use std::num::NonZero;
use std::path::Path;

use crate::base::{Diagnostic, Diagnostics};
use crate::campaign::{CampaignEnd, Ending, Env, Options, run_all};
use crate::cli::args::{Format, RunArgs};
use crate::cli::progress::Progress;
use crate::cli::{clock, output, stop};
use crate::config::Overrides;
use crate::history::History;
use crate::report::{CampaignSummary, RunSummary, campaign_json, campaign_table, campaign_text};

/// Runs a campaign and prints what came of it. Returns the exit code.
pub fn run(args: &RunArgs) -> Result<u8, Diagnostics> {
    let overrides = Overrides { runs: args.runs, seed: args.seed, history: args.history.clone() };
    let env = Env::prepare(&args.config, &overrides)?;
    let history = History::open(&env.campaign.history)?;
    let clock = clock::system();
    let id = history.next_campaign_id(&crate::base::digest_of(&env.campaign.source.text), env.campaign.seed)?;
    let name = args.config.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    history.begin_campaign(&env.record(id.clone(), name, (clock.now)()))?;

    let mut progress = Progress::new(env.planned_runs());
    let bar = progress.bar();
    let stop = stop::on_interrupt(move || bar.println("stopping after the runs in flight; Ctrl-C again stops at once"));
    let options = Options { jobs: args.jobs.map_or_else(all_cores, usize::from), clock };
    let mut runs = Vec::new();
    let end = quietly(|| {
        run_all(&env, &history, &id, &options, &stop, |record| {
            let summary = RunSummary::of(record);
            progress.run(&summary);
            runs.push(summary);
        })
    });
    progress.finish();
    history.finish_campaign(&id, &(clock.now)(), end.discards.len() as u64)?;
    let summary = summarise(&env, &args.config, id, runs, &end);
    output::print(&match args.format {
        Format::Table => campaign_text(&summary, output::colour()),
        Format::Csv => campaign_table(&summary).render(args.format.into()),
        Format::Json => format!("{:#}\n", campaign_json(&summary)),
    });
    warn_of_discards(&end);
    match end.ending {
        Ending::Finished => Ok(summary.exit_code()),
        Ending::Interrupted => Ok(stop::INTERRUPTED),
        Ending::Stopped(faults) => Err(faults),
    }
}

fn all_cores() -> usize {
    std::thread::available_parallelism().map_or(1, NonZero::get)
}

/// A crash of simulation is kept with its run; the panic's own message must not tear the progress bar.
fn quietly<T>(work: impl FnOnce() -> T) -> T {
    let before = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let result = work();
    std::panic::set_hook(before);
    result
}

fn summarise(env: &Env, config: &Path, campaign: String, mut runs: Vec<RunSummary>, end: &CampaignEnd) -> CampaignSummary {
    runs.sort_by_key(|run| run.index);
    let mut properties: Vec<(String, String, Option<String>)> = Vec::new();
    for action in env.campaign.tests.iter().flatten().filter_map(|name| env.ontology.actions.get(name)) {
        for iri in &action.success_properties {
            if let Some(property) = env.ontology.properties.get(iri)
                && !properties.iter().any(|(known, ..)| known == iri)
            {
                properties.push((iri.clone(), property.name.clone(), property.unit.clone()));
            }
        }
    }
    CampaignSummary {
        campaign,
        config: config.display().to_string(),
        history: env.campaign.history.display().to_string(),
        properties,
        runs,
        planned: env.planned_runs(),
        discards: end.discards.len() as u64,
        interrupted: matches!(end.ending, Ending::Interrupted | Ending::Stopped(_)),
    }
}

fn warn_of_discards(end: &CampaignEnd) {
    // Up to a tenth is what a crowded table does; more than that skews what is tested.
    let drawn = end.committed + end.discards.len() as u64;
    if let Some((index, reason)) = end.discards.first()
        && end.discards.len() as u64 * 10 > drawn
    {
        let fault = Diagnostic::warning(
            "S032",
            format!("{} of {drawn} scenes were discarded; the first, for run {}: {reason}", end.discards.len(), index + 1),
        )
        .help("fewer or smaller objects, or a larger surface, waste less and bias the sample less");
        output::print_diagnostics(&fault.into());
    }
}
