//! A stored run as a configuration of its own.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::base::{Choice, Diagnostics, Source, names};
use crate::campaign::line::TEST_LEFT_OUT;
use crate::campaign::shrink::{accepted_places, unit_of};
use crate::campaign::{Env, Recalled};
use crate::config::{self, CaseText, Launcher, Overrides};
use crate::history::{CampaignRecord, History, RunDetail};
use crate::verdict::Outcome;

/// Name of the folder in which a project keeps its cases.
const REGRESSIONS: &str = "regressions";

/// A configuration that makes a stored run again, as it is to be written into `folder`.
///
/// Inside the project (the folder that holds the configuration, its ontology and its models) it names these by paths
/// from there, so that it follows their edits. Elsewhere it leaves them out where the ones that the program carries are
/// the same, and so runs anywhere.
///
/// # Errors
/// The trace can't be read, `S040` the configuration has no such test any more, or it is no longer TOML.
pub fn export(
    history: &History,
    (env, record): &Recalled,
    run: &RunDetail,
    folder: &Path,
) -> Result<String, Diagnostics> {
    let (choices, trace) = (history.choices(&run.row.run)?, history.trace(&run.row.run)?);
    let test = &env.campaign.tests[env.test_of(env.index_of(&run.row.test, &choices)?)];
    let performed = run.actions.len().min(test.len());
    // What is not performed is not written, so nothing is left to leave out; of a place, only the try that was accepted.
    let choices: Vec<Choice> =
        accepted_places(&choices).into_iter().filter(|choice| choice.name != TEST_LEFT_OUT).collect();
    let failed = failed(run);
    let folder = absolute(folder);
    let mut case = CaseText {
        run: &run.row.run,
        test: &test[..performed],
        failed: &failed,
        trace: &trace.hash,
        choices: &choices,
        unit: unit_of,
        paths: [None, None, None],
        skill: skill_seen_from(&folder, env),
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
    case.paths = written.map(|path| path.map(|path| seen_from(&folder, &absolute(&home.join(path)))));
    config::case_text(&env.campaign, &case)
}

/// How a configuration in a folder names the program that performs actions, and its working folder.
fn skill_seen_from(folder: &Path, env: &Env) -> Option<(Option<String>, String)> {
    let Launcher::Program(skill) = &env.campaign.launcher else { return None };
    let seen = |path: &Path| seen_from(folder, &absolute(path));
    Some((skill.launcher(seen), seen(&skill.dir)))
}

/// The folder for a configuration's regressions: `regressions` beside it or in the folder above, whichever is there; where
/// neither is, in the one of these two that holds all that the configuration names.
///
/// # Errors
/// The configuration is not TOML.
pub fn regressions_folder(source: &Source) -> Result<PathBuf, Diagnostics> {
    let own = Path::new(&*source.name).parent().unwrap_or(Path::new(""));
    let (beside, above) = (own.join(REGRESSIONS), config::beside(own, &format!("../{REGRESSIONS}")));
    if beside.is_dir() {
        return Ok(beside);
    }
    let home = home(source);
    let is_above = above.is_dir() || home.parent() == Some(&project(&home, &config::written_paths(source)?));
    Ok(if is_above { above } else { beside })
}

/// The folder of a configuration, from the root.
fn home(source: &Source) -> PathBuf {
    absolute(Path::new(&*source.name).parent().unwrap_or(Path::new("")))
}

/// The smallest folder that holds a configuration and all that it names by paths.
fn project(home: &Path, written: &[Option<String>; 3]) -> PathBuf {
    let named = written.iter().flatten().map(|path| absolute(&home.join(path)));
    named.fold(home.to_path_buf(), |common, path| common_folder(&common, &path))
}

/// Names of the properties that failed, each once.
fn failed(run: &RunDetail) -> Vec<String> {
    let judgements = run.actions.iter().flat_map(|action| &action.judgements);
    let failed = judgements.filter(|judgement| judgement.outcome == Outcome::Failed);
    let names: BTreeSet<&str> = failed.map(|judgement| names::local(&judgement.property)).collect();
    names.into_iter().map(str::to_owned).collect()
}

/// Whether a text that names neither ontology nor models gets the same ones from the program.
fn carried_is_the_same(text: &str, folder: &Path, env: &Env, record: &CampaignRecord) -> bool {
    let overrides = Overrides { history: Some(env.campaign.history.clone()), ..Overrides::default() };
    let Ok(carried) = Env::prepare_text(Source::new("case", text), folder, &overrides) else { return false };
    let carried = carried.record(String::new(), record.name.clone(), String::new());
    let today = env.record(String::new(), record.name.clone(), String::new());
    let digests = |record: &CampaignRecord| {
        let rules = record.rules.iter().map(|(property, _, digest)| (property.clone(), digest.clone()));
        (record.models.clone(), record.ontology_digest.clone(), rules.collect::<Vec<_>>())
    };
    digests(&carried) == digests(&today)
}

/// The path without `.` and `..`, from the root.
fn absolute(path: &Path) -> PathBuf {
    let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
    let whole = std::fs::canonicalize(path).or_else(|_| std::path::absolute(path));
    whole.unwrap_or_else(|_| path.to_path_buf())
}

fn common_folder(one: &Path, other: &Path) -> PathBuf {
    one.components().zip(other.components()).take_while(|(a, b)| a == b).map(|(a, _)| a).collect()
}

/// With slashes, which TOML needs no escapes for and every system understands.
fn seen_from(folder: &Path, path: &Path) -> String {
    let seen = pathdiff::diff_paths(path, folder).unwrap_or_else(|| path.to_path_buf());
    seen.display().to_string().replace('\\', "/")
}
