//! Exports a stored run as a configuration of its own.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::shrink::drop_rejected_tries;
use crate::{Env, StoredCampaign};
use actcheck_base::{Diagnostics, Outcome, Source, names};
use actcheck_config as config;
use actcheck_config::{CaseText, Launcher, Overrides, WrittenPaths};
use actcheck_data::{Choice, ChoiceName};
use actcheck_history::{CampaignRecord, History, RunDetail};

/// Name of the folder in which a project keeps its cases.
const REGRESSIONS: &str = "regressions";

/// Returns the text of a configuration, for a file in `folder`, that runs a stored run again.
///
/// Inside the project (the folder that holds the configuration, its ontology and its models) it
/// names these by relative paths, so that it follows their edits. Elsewhere it leaves them out if
/// the built-in ones are the same, so that it runs anywhere.
///
/// # Errors
/// The trace can't be read, `S040` the configuration no longer has the test, or it is no longer
/// valid TOML.
pub fn export(
    history: &History,
    (env, record): &StoredCampaign,
    run: &RunDetail,
    folder: &Path,
) -> Result<String, Diagnostics> {
    let (choices, trace) = history.traces().recorded(&run.row.run)?;
    let index = env.index_of(&run.row.test, &choices)?;
    let test = &env.campaign.tests[env.test_of(index)];
    let performed = run.actions.len().min(test.len());
    // Only performed actions are written, so the number of those left out is not needed. Of each
    // placement, only the accepted try is kept.
    let choices = drop_rejected_tries(&choices);
    let choices: Vec<Choice> = choices
        .into_iter()
        .filter(|choice| choice.name != ChoiceName::ActionsLeftOut)
        .collect();
    let failed = failed(run);
    let folder = absolute(folder);
    let mut case = CaseText {
        run: &run.row.run,
        test: &test[..performed],
        failed: &failed,
        trace: &trace.hash,
        choices: &choices,
        paths: WrittenPaths::default(),
        skill: skill_seen_from(&folder, &env.campaign.launcher),
    };
    let source = &env.campaign.source;
    let (home, written) = (home(source), config::written_paths(source)?);
    let project = project(&home, &written);
    if !folder.starts_with(&project) {
        let bare = config::case_text(&env.campaign, &case)?;
        if carried_is_the_same(&bare, &folder, env, record) {
            return Ok(bare);
        }
    }
    case.paths = written.map(|path| seen_from(&folder, &absolute(&home.join(path))));
    config::case_text(&env.campaign, &case)
}

/// The program that performs actions and its working folder, as a configuration in `folder` names
/// them.
pub(crate) fn skill_seen_from(
    folder: &Path,
    launcher: &Launcher,
) -> Option<(Option<String>, String)> {
    let Launcher::Program(skill) = launcher else {
        return None;
    };
    let folder = absolute(folder);
    let seen = |path: &Path| seen_from(&folder, &absolute(path));
    Some((skill.launcher(seen), seen(&skill.dir)))
}

/// Returns the folder for a configuration's regressions: `regressions` beside it or in its parent
/// folder, whichever exists. If neither does, it is in the parent folder if the project is exactly
/// that folder, else beside the configuration.
///
/// # Errors
/// The configuration is not valid TOML.
pub fn regressions_folder(source: &Source) -> Result<PathBuf, Diagnostics> {
    let own = Path::new(&*source.name).parent().unwrap_or(Path::new(""));
    let (beside, above) = (
        own.join(REGRESSIONS),
        config::resolve_path(own, &format!("../{REGRESSIONS}")),
    );
    if beside.is_dir() {
        return Ok(beside);
    }
    let home = home(source);
    let is_above =
        above.is_dir() || home.parent() == Some(&project(&home, &config::written_paths(source)?));
    Ok(if is_above { above } else { beside })
}

/// The absolute path of a configuration's folder.
fn home(source: &Source) -> PathBuf {
    absolute(Path::new(&*source.name).parent().unwrap_or(Path::new("")))
}

/// The smallest folder that holds a configuration and all files that it names.
fn project(home: &Path, written: &WrittenPaths) -> PathBuf {
    let named = written.all().map(|path| absolute(&home.join(path)));
    named.fold(home.to_path_buf(), |common, path| {
        common_folder(&common, &path)
    })
}

/// Names of the failed properties, without duplicates.
fn failed(run: &RunDetail) -> Vec<String> {
    let judgements = run.actions.iter().flat_map(|action| &action.judgements);
    let failed = judgements.filter(|judgement| judgement.outcome == Outcome::Failed);
    let names: BTreeSet<&str> = failed
        .map(|judgement| names::local(&judgement.property))
        .collect();
    names.into_iter().map(str::to_owned).collect()
}

/// Whether the built-in ontology, rules and models, which `text` gets because it names none, are
/// those of the campaign.
fn carried_is_the_same(text: &str, folder: &Path, env: &Env, record: &CampaignRecord) -> bool {
    let overrides = Overrides {
        history: Some(env.campaign.history.clone()),
        ..Overrides::default()
    };
    let Ok(carried) = Env::prepare_text(Source::new("case", text), folder, &overrides) else {
        return false;
    };
    let carried = carried.record(String::new(), record.name.clone(), String::new());
    let today = env.record(String::new(), record.name.clone(), String::new());
    let digests = |record: &CampaignRecord| {
        let rules = record
            .rules
            .iter()
            .map(|(property, _, digest)| (property.clone(), digest.clone()));
        (
            record.models.clone(),
            record.ontology_digest.clone(),
            rules.collect::<Vec<_>>(),
        )
    };
    digests(&carried) == digests(&today)
}

/// The absolute path, without `.` and `..`.
fn absolute(path: &Path) -> PathBuf {
    let path = if path.as_os_str().is_empty() {
        Path::new(".")
    } else {
        path
    };
    let whole = std::fs::canonicalize(path).or_else(|_| std::path::absolute(path));
    whole.unwrap_or_else(|_| path.to_path_buf())
}

fn common_folder(one: &Path, other: &Path) -> PathBuf {
    one.components()
        .zip(other.components())
        .take_while(|(a, b)| a == b)
        .map(|(a, _)| a)
        .collect()
}

/// The path relative to `folder`, with forward slashes: TOML needs no escapes for them and every
/// system accepts them.
fn seen_from(folder: &Path, path: &Path) -> String {
    let seen = pathdiff::diff_paths(path, folder).unwrap_or_else(|| path.to_path_buf());
    seen.display().to_string().replace('\\', "/")
}
