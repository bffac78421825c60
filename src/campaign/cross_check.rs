//! Judges the recordings of runs that another physics engine played.

use std::path::Path;

use crate::Env;
use crate::episode::{EpisodeFile, run_of};
use crate::playable::PlayableRun;
use crate::rule_set::RuleSet;
use actcheck_base::{Diagnostics, Source};
use actcheck_data::Role;
use actcheck_episodes::Mapping;
use actcheck_history::RunRecord;
use actcheck_rules::Budget;

/// Returns the mapping of the recordings of a run. Its text is that of all runs: recordings of one
/// campaign stay together.
///
/// # Errors
/// A name of a body can't be written.
pub fn mapping_of(run: &PlayableRun, campaign: &str) -> Result<Mapping, Diagnostics> {
    let quoted = actcheck_config::quoted;
    let list = |names: &[String]| {
        let names: Vec<String> = names.iter().map(|name| quoted(name)).collect();
        format!("[{}]", names.join(", "))
    };
    let [left, right] = &run.fingers;
    let mut text = format!(
        "[robot]\nbodies = \"robot/*\"\nbase = {}\nhand = \"robot/grasp\"\nleft_finger = {}\nright_finger = {}\n",
        quoted(&run.base),
        list(left),
        list(right)
    );
    let objects = &run.record.scene.objects;
    for object in objects.iter().filter(|object| object.role != Role::Part) {
        text += &format!(
            "[objects.{}]\nbody = {}\ncategory = {}\nup = \"z\"\n",
            object.id,
            quoted(&object.id),
            quoted(&object.category)
        );
    }
    let mut mapping = Mapping::parse(&Source::new("cross-check.toml", text))?;
    mapping.source = Source::new(
        "cross-check.toml",
        format!("# The runs of campaign {campaign}, played by `actcheck cross-check`.\n"),
    );
    Ok(mapping)
}

/// Judges the recording of a run by the present rules.
///
/// # Errors
/// The recording can't be read.
pub fn judge_played(
    file: &Path,
    mapping: &Mapping,
    rules: &RuleSet,
    here: &RunRecord,
) -> Result<RunRecord, Diagnostics> {
    let file = EpisodeFile {
        path: file.to_path_buf(),
        named: file.display().to_string(),
        mapping,
        rules,
        repeats: Some(&here.trace),
    };
    run_of(&file, "", &Budget::default())
}

/// Prepares the present rules of a campaign.
///
/// # Errors
/// The ontology or a rule has faults.
pub fn rules_of(env: &Env) -> Result<RuleSet, Diagnostics> {
    let (files, path) = &env.campaign.ontology;
    RuleSet::prepare(files, path)
}
