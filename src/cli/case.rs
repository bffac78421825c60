//! `actcheck run` with a case: one scene, run again

use std::path::Path;

use serde_json::json;

use crate::options::Format;
use crate::run_args::RunArgs;
use crate::work::quietly;
use crate::{clock, output, show};
use actcheck_base::{Diagnostic, Diagnostics, printable_in_colour};
use actcheck_campaign::{CaseRun, Env, RunContext, run_cases};
use actcheck_history::{History, RunDetail};
use actcheck_report::{CaseSummary, case_json, case_text, run_json, run_text};
use actcheck_verdict::Recurrence;

/// Runs a case and prints whether it still fails in the same way. Returns the exit code.
pub fn run(args: &RunArgs, env: Env) -> Result<u8, Diagnostics> {
    refuse_campaign_options(args, &env.campaign.source.name)?;
    let history = History::open(&env.campaign.history)?;
    let file = env.campaign.source.name.to_string();
    let stem = Path::new(&file).file_stem();
    let name = stem.map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let cases = [(name, env)];
    let context = RunContext {
        clock: clock::system(),
        disturb: None,
    };
    let mut summary = None;
    quietly(|| {
        run_cases(&cases, &history, 1, &context, &mut |_, made| {
            summary = Some(summarise(&file, &cases[0].1, made));
        })
    })?;
    let Some(summary) = summary else { return Ok(2) };
    let run = history.run(&summary.run)?;
    let perceived = show::perceived(&history, &run)?;
    match args.format {
        Format::Text => {
            output::print(&run_text(&run, &perceived, output::page()));
            output::print_prose(&format!("\n{}", case_text(&summary)));
        }
        Format::Json => {
            let both = json!({"case": case_json(&summary), "run": run_json(&run, &perceived)});
            output::print(&format!("{both:#}\n"));
        }
        Format::Csv => {
            output::print(&show::outcomes(&run).render(Format::Csv.into(), output::page()));
            eprint!("{}", printable_in_colour(&case_text(&summary)));
        }
    }
    Ok(summary.exit_code())
}

/// Summarises the run of a case.
pub(super) fn summarise(file: &str, env: &Env, made: CaseRun) -> CaseSummary {
    CaseSummary {
        file: file.to_owned(),
        run: made.record.id,
        expected: env
            .campaign
            .case
            .as_ref()
            .map_or_else(Vec::new, |case| case.expect.clone()),
        recurrence: made.recurrence,
        same_trace: made.same_trace,
        reason: made.record.reason,
    }
}

/// Summarises the stored run of a case.
pub(super) fn summarise_stored(file: &str, env: &Env, run: &RunDetail) -> CaseSummary {
    let case = env.campaign.case.clone().unwrap_or_default();
    let judgements = run.actions.iter().flat_map(|action| &action.judgements);
    CaseSummary {
        file: file.to_owned(),
        run: run.row.run.clone(),
        recurrence: Recurrence::of(&case.expect.iter().cloned().collect(), judgements),
        expected: case.expect,
        same_trace: case.trace.map(|trace| trace == run.row.trace_hash),
        reason: run.reason.clone(),
    }
}

/// Rejects the options of whole campaigns: a case has one scene and samples nothing.
fn refuse_campaign_options(args: &RunArgs, file: &str) -> Result<(), Diagnostics> {
    let given = [
        ("--runs", args.runs.is_some()),
        ("--time", args.time.is_some()),
        ("--until-width", args.until_width.is_some()),
        ("--max-failures", args.max_failures.is_some()),
        ("--seed", args.seed.is_some()),
        ("--strategy", args.strategy.is_some()),
        ("--repeat", args.repeat.is_some()),
        ("--shard", args.shard.is_some()),
        ("--shrink", args.shrink),
        ("--last-failed", args.last_failed),
    ];
    let mut found = Diagnostics::new();
    for (option, _) in given.into_iter().filter(|(_, given)| *given) {
        let message =
            format!("`{option}` can't be used with {file}: it is a case, which has one scene");
        found.push(Diagnostic::error("X040", message).help(
            "remove the option; `actcheck shrink` and `actcheck replay` accept the id of the run that the case makes",
        ));
    }
    found.or(())
}
