//! The cases of a project, which run before each of its campaigns.

use std::path::{Path, PathBuf};

use crate::work::quietly;
use crate::{case, clock};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_campaign as campaign;
use actcheck_campaign::{Env, RunContext, run_cases};
use actcheck_history::{CampaignRecord, CampaignRow, History, RunDetail, RunFilter};
use actcheck_report::CaseSummary;
use actcheck_rules::Budget;

/// Prepares the cases of a campaign, sorted by file name. The campaign's own skills perform them,
/// so no program that a case names is started. Of a campaign in parts, only the first part gets
/// them. Their runs go into the campaign's history.
///
/// # Errors
/// All faults of all cases at once: those of any configuration, or `S065` if a file is not a case.
pub fn prepare(env: &Env, budget: &Budget) -> Result<Vec<(String, Env)>, Diagnostics> {
    let folder = campaign::regressions_folder(&env.campaign.source)?;
    let mut faults = Diagnostics::new();
    let mut cases = Vec::new();
    for file in files(&folder)? {
        match Env::prepare_case(&file, &env.campaign, budget.clone()) {
            Ok(case) if case.campaign.case.is_some() => cases.push((name_of(&file), case)),
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
    let entries =
        std::fs::read_dir(folder).and_then(|entries| entries.collect::<Result<Vec<_>, _>>());
    let entries = entries.map_err(|error| {
        Diagnostic::error(
            "X041",
            format!(
                "the regressions in {} can't be listed: {error}",
                folder.display()
            ),
        )
        .help("make the folder readable, or move it away")
    })?;
    let mut files: Vec<PathBuf> = entries.into_iter().map(|entry| entry.path()).collect();
    files.retain(|file| file.extension().is_some_and(|ending| ending == "toml"));
    files.sort();
    Ok(files)
}

fn name_of(file: &Path) -> String {
    file.file_name()
        .map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// Runs each case as its own campaign. Before a campaign that is resumed, only those that did not
/// run before it began.
///
/// # Errors
/// A scene can no longer be generated, or writing failed.
pub fn run(
    cases: Vec<(String, Env)>,
    history: &History,
    resumed: Option<&CampaignRecord>,
    jobs: usize,
) -> Result<Vec<CaseSummary>, Diagnostics> {
    let mut done = Vec::new();
    let mut new = Vec::new();
    for (file, env) in cases {
        match resumed
            .map(|campaign| made_before(&file, &env, history, campaign))
            .transpose()?
            .flatten()
        {
            Some(run) => done.push(case::summarise_stored(&file, &env, &run)),
            None => new.push((file, env)),
        }
    }
    let context = RunContext {
        clock: clock::system(),
        disturb: None,
    };
    quietly(|| {
        run_cases(&new, history, jobs, &context, &mut |at, made| {
            let (file, env) = &new[at];
            done.push(case::summarise(file, env, made));
        })
    })?;
    done.sort_by(|a, b| a.file.cmp(&b.file));
    Ok(done)
}

/// The newest run of an unchanged case that began before a campaign did.
fn made_before(
    file: &str,
    env: &Env,
    history: &History,
    campaign: &CampaignRecord,
) -> Result<Option<RunDetail>, Diagnostics> {
    let digest = env
        .record(String::new(), file.to_owned(), String::new())
        .config_digest;
    let is_of_case = |row: &CampaignRow| {
        row.name == file
            && row.config_digest == digest
            && row.started <= campaign.started
            && row.ended.is_some()
    };
    let Some(found) = history.campaigns()?.into_iter().rfind(is_of_case) else {
        return Ok(None);
    };
    let rows = history.runs(&RunFilter {
        campaign: Some(found.id),
        ..RunFilter::default()
    })?;
    rows.first().map(|row| history.run(&row.run)).transpose()
}
