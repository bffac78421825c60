//! The cases of a project, which run before each of its campaigns.

use std::path::{Path, PathBuf};

use crate::work::quietly;
use crate::{case, clock, trust};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_campaign as campaign;
use actcheck_campaign::{Env, RunContext, run_cases};
use actcheck_config::Overrides;
use actcheck_history::History;
use actcheck_report::CaseSummary;
use actcheck_rules::Budget;

/// Prepares the cases of a campaign, sorted by file name. Of a campaign in parts, only the first part gets them.
/// Their runs go into the campaign's history. Unless `trusted`, they must not start a program of their own.
///
/// # Errors
/// All faults of all cases at once: those of any configuration, `S065` if a file is not a case, or `X059` if it starts a
/// program other than the campaign's.
pub fn prepare(env: &Env, budget: &Budget, trusted: bool) -> Result<Vec<(String, Env)>, Diagnostics> {
    let folder = campaign::regressions_folder(&env.campaign.source)?;
    let overrides = Overrides { history: Some(env.campaign.history.clone()), ..Overrides::default() };
    let mut faults = Diagnostics::new();
    let mut cases = Vec::new();
    for file in files(&folder)? {
        match Env::prepare_within(&file, &overrides, budget.clone()) {
            Ok(case) if case.campaign.case.is_some() => {
                if !trusted && let Err(fault) = trust::check_case(&case, Some(&env.campaign.launcher)) {
                    faults.extend(fault);
                }
                cases.push((name_of(&file), case));
            }
            Ok(other) => faults.push(
                Diagnostic::error("S065", "this file is not a case: it has no `[case]`")
                    .in_source(&other.campaign.source)
                    .help("keep only files from `actcheck export` in this folder: every campaign runs them first"),
            ),
            Err(found) => faults.extend(found),
        }
    }
    // The first part of a campaign runs them for all parts; every part reports their faults.
    let is_first = env.campaign.shard.is_none_or(|shard| shard.number() == 1);
    faults.or(if is_first { cases } else { Vec::new() })
}

fn files(folder: &Path) -> Result<Vec<PathBuf>, Diagnostics> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let entries = std::fs::read_dir(folder).and_then(|entries| entries.collect::<Result<Vec<_>, _>>());
    let entries = entries.map_err(|error| {
        Diagnostic::error("X041", format!("the regressions in {} can't be listed: {error}", folder.display()))
            .help("make the folder readable, or move it away")
    })?;
    let mut files: Vec<PathBuf> = entries.into_iter().map(|entry| entry.path()).collect();
    files.retain(|file| file.extension().is_some_and(|ending| ending == "toml"));
    files.sort();
    Ok(files)
}

fn name_of(file: &Path) -> String {
    file.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// Runs each case as its own campaign.
///
/// # Errors
/// A scene can no longer be generated, or writing failed.
pub fn run(cases: &[(String, Env)], history: &History, jobs: usize) -> Result<Vec<CaseSummary>, Diagnostics> {
    let context = RunContext { clock: clock::system(), disturb: None };
    let mut done = Vec::new();
    quietly(|| {
        run_cases(cases, history, jobs, &context, &mut |at, made| {
            let (file, env) = &cases[at];
            done.push(case::summarise(file, env, made));
        })
    })?;
    Ok(done)
}
