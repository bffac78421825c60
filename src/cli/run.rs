//! `actcheck run`

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use indicatif::ProgressBar;

use crate::gate::Gate;
use crate::live_failures::LiveFailures;
use crate::options::Format;
use crate::progress::Progress;
use crate::run_args::{RunArgs, Verbosity};
use crate::session::{self, Opened, Session};
use crate::work::{all_cores, quietly};
use crate::{case, clock, health, output, relate, shrink, stop};
use actcheck_analysis as analysis;
use actcheck_analysis::{Interval, Mirror, Sampling};
use actcheck_base::{Diagnostic, Diagnostics, Outcome};
use actcheck_campaign::{
    CampaignOptions, CampaignResult, Ending, Env, ExhaustedBudget, LineSink, RunContext,
    StoredRuns, WeightedRate, resume_until,
};
use actcheck_history as history;
use actcheck_history::{History, RunFilter, RunRecord, RunRow, newest_of_alike};
use actcheck_report::{
    CampaignSummary, EndedBy, GuidedSearch, HealthSummary, RelationsSummary, RunSummary,
    WeightedLine, campaign_json, campaign_result_text, campaign_runs_text, campaign_table,
    campaign_text, compare_text, health_json, health_lines, relations_json, relations_text,
    shrunk_json, shrunk_text, with_shrunk,
};
use actcheck_rules::Budget;
use actcheck_verdict::{Counts, mean};

/// The tables beside the history are updated each time this many runs were stored, or soon after.
const MIRROR_EVERY: usize = 1_000;

/// Runs a campaign and prints its results. Returns the exit code.
pub fn run(args: &RunArgs) -> Result<u8, Diagnostics> {
    let (stop, shown) = interrupt();
    let budget = Budget {
        stop: Arc::clone(&stop),
        ..Budget::default()
    };
    let jobs = args.jobs.map_or_else(all_cores, usize::from);
    let session = match session::open(args, &budget, jobs)? {
        Opened::Case(env) => {
            output::print_diagnostics(&env.findings());
            return case::run(args, *env);
        }
        Opened::Campaign(session) => *session,
        Opened::NoneFailed(campaign) => {
            output::print_diagnostics(&none_failed(&campaign).into());
            return Ok(0);
        }
    };
    output::print_diagnostics(&session.env.warnings());
    // From here on, an interrupt must end the campaign properly.
    campaign(args, session, &stop, |bar| {
        shown.get_or_init(|| bar);
    })
}

/// Makes the runs that a campaign lacks, and prints its results. `on_bar` gets the bar before the
/// first run. Returns the exit code.
pub(super) fn campaign(
    args: &RunArgs,
    mut session: Session,
    stop: &AtomicBool,
    on_bar: impl FnOnce(ProgressBar),
) -> Result<u8, Diagnostics> {
    let jobs = args.jobs.map_or_else(all_cores, usize::from);
    let clock = clock::system();
    let planned = session.runs_to_make();
    let verbosity = args.verbosity();
    let mut progress = match verbosity {
        Verbosity::Quiet => Progress::hidden(),
        _ => Progress::new(planned, session.env.campaign.limits.time_secs),
    };
    on_bar(progress.bar());
    if verbosity == Verbosity::Verbose {
        let bar = progress.bar();
        session.env.stream_output(LineSink::new(move |run, line| {
            bar.suspend(|| output::print_error_text(&format!("{run} │ {line}\n")));
        }));
    }
    let mut gate = Gate::open(args, &session.env, &session.history, &session.id)?;
    session.begin((clock.now)())?;
    let options = CampaignOptions {
        jobs,
        context: RunContext {
            clock,
            disturb: None,
        },
    };
    let mut runs: Vec<RunSummary> = session.kept.iter().map(RunSummary::from_history).collect();
    runs.iter().for_each(|run| progress.run(run));
    let mut failures = LiveFailures::new(&session.env);
    let mut mirrored = runs.len();
    let mut gate_faults = Diagnostics::new();
    let (end, mut faults) = make_runs(&session, &options, stop, |record| {
        let summary = RunSummary::of(record);
        if verbosity == Verbosity::Verbose
            && let Some(text) = failures.text(&summary)
        {
            progress.tell(&text);
        }
        progress.run(&summary);
        runs.push(summary);
        if runs.len() >= mirrored + MIRROR_EVERY {
            mirror(&session.history);
            mirrored = runs.len();
        }
        match gate.as_mut().map_or(Ok(false), Gate::decides) {
            Ok(true) => ControlFlow::Break(ExhaustedBudget::Comparison),
            Ok(false) => ControlFlow::Continue(()),
            Err(found) => {
                gate_faults = found;
                ControlFlow::Break(ExhaustedBudget::Comparison)
            }
        }
    });
    progress.finish();
    faults.extend(gate_faults);
    if failures.any() && args.format == Format::Text {
        output::print_error_text("\n");
    }
    let Session {
        env,
        history,
        id,
        failed,
        regressions,
        ..
    } = session;
    // Sums are taken in the order of indices, so that a campaign merged from parts gets
    // bit-identical results.
    runs.sort_by_key(|run| run.index);
    let finished = finish(&history, &id, &runs, &end, (clock.now)());
    let mut summary = summarise(&env, id.clone(), runs, &end);
    (summary.planned, summary.regressions) = (planned, regressions);
    if finished.is_ok() {
        mirror(&history);
        summary.failure_modes = failure_modes(&history, id, summary.sampling())?;
    }
    // If the history failed, only that fault is reported. Failed runs are a biased sample, so their
    // health means little.
    let health = if finished.is_ok() && failed.is_none() {
        Some(health::examine(&history, &summary.campaign)?)
    } else {
        None
    };
    let relates = finished.is_ok() && is_whole(&end) && failed.is_none();
    let relate = || -> Result<Option<RelationsSummary>, Diagnostics> {
        if !relates || env.campaign.relations.is_empty() {
            return Ok(None);
        }
        let of = (summary.campaign.as_str(), None);
        let related = relate::pairs_of(&env, &history, of, options.jobs, stop)?;
        Ok(Some(relate::summary(&history, related)))
    };
    // CSV and JSON are one document; otherwise, users need not wait for the pairs.
    let mut relations = match args.format {
        Format::Text => None,
        Format::Csv | Format::Json => relate()?,
    };
    let results = Results {
        summary: &summary,
        health: health.as_ref(),
        relations: relations.as_ref(),
        format: args.format,
        verbosity,
    };
    let shrinks = args.shrink && finished.is_ok() && is_whole(&end);
    if shrinks {
        results.print_with(|| {
            shrink::shrink_modes(&env, &history, &examples(&summary), options.jobs, stop)
        })?;
    } else {
        results.print();
    }
    if args.format == Format::Text {
        relations = relate()?;
        if let Some(relations) = &relations {
            output::print(&format!("\n{}", relations_text(relations, output::page())));
        }
    }
    let interrupted =
        (shrinks || relations.is_some()) && is_whole(&end) && stop.load(Ordering::Relaxed);
    let code = exit_code(end.ending, faults, &summary)?;
    let code = relations.map_or(code, |relations| code.max(relations.exit_code()));
    finished?;
    if interrupted {
        return Ok(stop::INTERRUPTED);
    }
    match gate {
        Some(gate) if code != stop::INTERRUPTED => compared(&gate, args.format),
        _ => Ok(code),
    }
}

/// Prints the comparison with the baseline. Returns the exit code: 1 if this campaign is worse.
fn compared(gate: &Gate, format: Format) -> Result<u8, Diagnostics> {
    let summary = gate.summary()?;
    if format == Format::Text {
        output::print(&format!("\n{}", compare_text(&summary, output::page())));
    }
    Ok(summary.exit_code())
}

/// Makes the runs of a campaign, or those of `--last-failed`. Returns also the faults of runs that
/// can't be made again.
fn make_runs(
    session: &Session,
    options: &CampaignOptions,
    stop: &AtomicBool,
    mut on_run: impl FnMut(&RunRecord) -> ControlFlow<ExhaustedBudget>,
) -> (CampaignResult, Diagnostics) {
    let Session {
        env,
        history,
        id,
        failed,
        kept,
        ..
    } = session;
    quietly(|| match failed {
        Some(failed) => failed.run((env, history, id), options, stop, |record| {
            // These have no budget and no baseline.
            _ = on_run(record);
        }),
        None => {
            let stored = StoredRuns::of(kept);
            (
                resume_until(env, history, id, stored, options, stop, &mut on_run),
                Diagnostics::new(),
            )
        }
    })
}

/// The exit code of a campaign, unless an error ended it or runs could not be made again.
fn exit_code(
    ending: Ending,
    faults: Diagnostics,
    summary: &CampaignSummary,
) -> Result<u8, Diagnostics> {
    match ending {
        Ending::Stopped(faults) => Err(faults),
        Ending::Interrupted => Ok(stop::INTERRUPTED),
        Ending::Finished | Ending::Budget(_) if faults.has_errors() => Err(faults),
        Ending::Finished | Ending::Budget(_) => Ok(summary.exit_code()),
    }
}

/// X039: `--last-failed` has nothing to run.
fn none_failed(campaign: &str) -> Diagnostic {
    Diagnostic::warning(
        "X039",
        format!("no run failed in campaign {campaign}, the last one of this configuration"),
    )
    .help("run the configuration without `--last-failed` to try all its scenes")
}

/// Updates the tables beside the history. They can be rebuilt at any time, so a fault is only
/// reported.
fn mirror(history: &History) {
    if let Err(faults) = Mirror::update(history) {
        output::print_diagnostics(&faults);
    }
}

/// The flag that Ctrl-C sets, and a cell for the bar that then shows it; while the cell is empty,
/// Ctrl-C ends the process.
fn interrupt() -> (Arc<AtomicBool>, Arc<OnceLock<ProgressBar>>) {
    let shown = Arc::new(OnceLock::<ProgressBar>::new());
    let bar = Arc::clone(&shown);
    let stop = stop::on_interrupt(move || {
        match bar.get() {
        Some(bar) => bar.println(
            "stopping after the runs in flight; `actcheck run --resume` makes the others later; Ctrl-C again stops at once",
        ),
        None => stop::end_now(),
    }
    });
    (stop, shown)
}

/// The results of a campaign, for printing.
struct Results<'a> {
    summary: &'a CampaignSummary,
    /// The campaign's health: part of text and JSON, printed to the error stream beside CSV.
    health: Option<&'a HealthSummary>,
    /// The relations between pairs of runs: part of JSON, printed to the error stream beside CSV.
    relations: Option<&'a RelationsSummary>,
    format: Format,
    verbosity: Verbosity,
}

impl Results<'_> {
    fn print(&self) {
        output::print(&match self.format {
            Format::Text => {
                let page = output::page();
                let text = match self.verbosity {
                    Verbosity::Quiet => campaign_result_text,
                    Verbosity::Usual => campaign_text,
                    Verbosity::Verbose => campaign_runs_text,
                }(self.summary, page);
                text + &self
                    .health
                    .map(|health| health_lines(health, page))
                    .unwrap_or_default()
            }
            Format::Csv => campaign_table(self.summary).render(self.format.into(), output::page()),
            Format::Json => format!("{:#}\n", self.json()),
        });
        self.warn();
    }

    fn json(&self) -> serde_json::Value {
        let mut campaign = campaign_json(self.summary);
        campaign["health"] = self.health.map(health_json).into();
        if let Some(relations) = self.relations {
            campaign["relations"] = relations_json(relations);
        }
        campaign
    }

    fn warn(&self) {
        if self.format == Format::Csv {
            output::print_diagnostics(
                &self.health.map(HealthSummary::warnings).unwrap_or_default(),
            );
            if let Some(relations) = self.relations {
                output::print_error_text(&relations_text(relations, output::page()));
            }
        }
    }

    /// Prints the results with the shrunk runs. The table is printed before shrinking, so that
    /// users need not wait for it; CSV and JSON are one document.
    fn print_with(&self, shrink: impl FnOnce() -> shrink::ShrunkModes) -> Result<(), Diagnostics> {
        if self.format == Format::Text {
            self.print();
        }
        let shrunk = shrink();
        output::print(&match self.format {
            Format::Text => shrunk
                .done
                .iter()
                .map(|one| format!("\n{}", shrunk_text(one, output::page())))
                .collect(),
            Format::Csv => with_shrunk(campaign_table(self.summary), &shrunk.done)
                .render(self.format.into(), output::page()),
            Format::Json => {
                let mut json = self.json();
                json["shrunk"] = shrunk.done.iter().map(shrunk_json).collect();
                format!("{json:#}\n")
            }
        });
        self.warn();
        shrunk.faults.or(())
    }
}

/// The first run of each failure mode, with its index in the campaign.
fn examples(summary: &CampaignSummary) -> Vec<(String, u64)> {
    let failing = summary
        .failure_modes
        .iter()
        .filter(|mode| !mode.failed.is_empty());
    let first = failing.filter_map(|mode| mode.runs.first());
    first
        .filter_map(|id| summary.runs.iter().find(|run| run.id == *id))
        .map(|run| (run.id.clone(), run.index))
        .collect()
}

/// How the user invoked this program.
pub(super) fn program() -> String {
    std::env::args()
        .next()
        .unwrap_or_else(|| "actcheck".to_owned())
}

/// The budget that ended a campaign.
fn spent(end: &CampaignResult) -> Option<ExhaustedBudget> {
    match end.ending {
        Ending::Budget(spent) => Some(spent),
        _ => None,
    }
}

/// Whether a campaign ended on its own, without an interrupt or a fault.
fn is_whole(end: &CampaignResult) -> bool {
    matches!(end.ending, Ending::Finished | Ending::Budget(_))
}

/// Writes the campaign's end into the history, which has the runs already.
fn finish(
    history: &History,
    id: &str,
    runs: &[RunSummary],
    end: &CampaignResult,
    ended: String,
) -> Result<(), Diagnostics> {
    let whole = runs
        .iter()
        .filter(|run| run.status != history::RunStatus::Broken);
    let counts = Counts::of(runs.iter().flat_map(RunSummary::outcomes));
    let record = history::CampaignEnd {
        ended,
        score: mean(runs.iter().map(|run| run.score)),
        score_without_broken: mean(whole.map(|run| run.score)),
        outcomes: Outcome::ALL
            .into_iter()
            .map(|outcome| (outcome, counts.get(outcome)))
            .collect(),
        discards: end.discards.len() as u64,
        ended_by: spent(end).map(|spent| spent.word().to_owned()),
        interrupted: !is_whole(end),
    };
    history.finish_campaign(id, &record)
}

fn failure_modes(
    history: &History,
    id: String,
    sampling: Sampling,
) -> Result<Vec<analysis::FailureMode>, Diagnostics> {
    let filter = RunFilter {
        campaign: Some(id),
        ..RunFilter::default()
    };
    let rows = history.outcomes(&filter)?;
    let runs = history.runs(&filter)?;
    Ok(analysis::failure_modes(&rows, &scenes(runs), sampling))
}

/// The scene of each run: its number if scenes are repeated, or the position of the first run with
/// the same trace. Empty if all scenes were run once.
fn scenes(runs: Vec<RunRow>) -> BTreeMap<String, u64> {
    if runs.iter().any(|run| run.repetition.is_some()) {
        return runs
            .into_iter()
            .filter_map(|run| Some((run.run, run.repetition?.scene)))
            .collect();
    }
    let alike = newest_of_alike(&runs).len() < runs.len();
    let mut first: BTreeMap<String, u64> = BTreeMap::new();
    let mut scenes = BTreeMap::new();
    for run in runs.into_iter().filter(|_| alike) {
        let scene = if run.trace_hash.is_empty() {
            run.index
        } else {
            *first.entry(run.trace_hash).or_insert(run.index)
        };
        scenes.insert(run.run, scene);
    }
    scenes
}

fn summarise(
    env: &Env,
    campaign: String,
    runs: Vec<RunSummary>,
    end: &CampaignResult,
) -> CampaignSummary {
    let mut properties: Vec<(String, String, Option<String>)> = Vec::new();
    for action in env
        .campaign
        .tests
        .iter()
        .flatten()
        .filter_map(|step| env.ontology.actions.get(&step.action))
    {
        for iri in &action.success_properties {
            if let Some(property) = env.ontology.properties.get(iri)
                && !properties.iter().any(|(known, ..)| known == iri)
            {
                properties.push((iri.clone(), property.name.clone(), property.unit.clone()));
            }
        }
    }
    let mut summary = CampaignSummary {
        campaign,
        search: None,
        config: env.campaign.source.name.to_string(),
        history: env.campaign.history.display().to_string(),
        program: program(),
        properties,
        failure_modes: Vec::new(),
        regressions: Vec::new(),
        runs,
        privileged: env.is_privileged(),
        planned: env.runs_to_make(),
        discards: end.discards.len() as u64,
        ended_by: spent(end).map(|spent| EndedBy {
            budget: spent.word(),
            description: spent.to_string(),
        }),
        interrupted: !is_whole(end),
    };
    summary.search = guided_search(env, &summary, end);
    summary
}

/// The failure rates of a guided search. Returns `None` if another strategy chose the scenes.
fn guided_search(
    env: &Env,
    summary: &CampaignSummary,
    end: &CampaignResult,
) -> Option<GuidedSearch> {
    let line = |found: &WeightedRate| WeightedLine {
        test: found.test.clone(),
        property: found.property.clone(),
        label: env
            .ontology
            .properties
            .get(&found.property)
            .map_or_else(String::new, |known| known.name.clone()),
        failing: Interval {
            rate: found.failing.rate,
            low: found.failing.low,
            high: found.failing.high,
        },
        scenes: found.scenes,
        raw: summary.raw_failures(&found.test, &found.property),
    };
    let strategy = env.campaign.search;
    strategy.is_guided().then(|| GuidedSearch {
        strategy: strategy.name().to_owned(),
        lines: end.rates.iter().map(line).collect(),
    })
}
