//! The cases of a project, which each of its campaigns runs first

use std::path::{Path, PathBuf};

use crate::base::{Diagnostic, Diagnostics};
use crate::campaign::{self, Env, Manner, run_cases};
use crate::cli::run::quietly;
use crate::cli::{case, clock};
use crate::config::Overrides;
use crate::history::History;
use crate::report::CaseSummary;
use crate::rules::Budget;

/// The cases of a campaign's folder, by name of their files, sorted; none for a part of a campaign that is not its first.
/// Runs are kept in the campaign's history.
///
/// # Errors
/// Every fault of every case at once: as of any configuration, or `S065` a file is no case.
pub fn prepare(env: &Env, budget: &Budget) -> Result<Vec<(String, Env)>, Diagnostics> {
    let folder = campaign::regressions_folder(&env.campaign.source)?;
    let overrides = Overrides { history: Some(env.campaign.history.clone()), ..Overrides::default() };
    let mut faults = Diagnostics::new();
    let mut cases = Vec::new();
    for file in files(&folder)? {
        match Env::prepare_within(&file, &overrides, budget.clone()) {
            Ok(case) if case.campaign.case.is_some() => cases.push((name_of(&file), case)),
            Ok(other) => faults.push(
                Diagnostic::error("S065", "this is no case: it has no `[case]`")
                    .in_source(&other.campaign.source)
                    .help(
                        "only what `actcheck export` writes belongs into this folder, which every campaign runs first",
                    ),
            ),
            Err(found) => faults.extend(found),
        }
    }
    // Of a campaign in parts, the first part runs them for all; faults are told by every part.
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
            .help("allow it to be read, or move it away")
    })?;
    let mut files: Vec<PathBuf> = entries.into_iter().map(|entry| entry.path()).collect();
    files.retain(|file| file.extension().is_some_and(|ending| ending == "toml"));
    files.sort();
    Ok(files)
}

fn name_of(file: &Path) -> String {
    file.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// Runs the cases, each as a campaign of its own.
///
/// # Errors
/// A scene can't be made any more, or writing failed.
pub fn run(cases: &[(String, Env)], history: &History, jobs: usize) -> Result<Vec<CaseSummary>, Diagnostics> {
    let manner = Manner { clock: clock::system(), disturb: None };
    let mut done = Vec::new();
    quietly(|| {
        run_cases(cases, history, jobs, &manner, &mut |at, made| {
            let (file, env) = &cases[at];
            done.push(case::summarise(file, env, made));
        })
    })?;
    Ok(done)
}
