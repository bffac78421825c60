//! Imports episodes of other simulators and robots as runs, judged by the same rules.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::prelude::*;

use crate::workers::workers;
use crate::{Ending, RuleSet};
use actcheck_base::{
    ActionFacts, Diagnostic, Diagnostics, Judgement, Outcome, RunFacts, did_you_mean, digest_of,
    names, program_digest,
};
use actcheck_data::{Role, Trace};
use actcheck_episodes::{Episode, Mapping, trace};
use actcheck_facts as facts;
use actcheck_history::{
    CampaignEnd, CampaignRecord, Entry, EpisodeRecord, History, RunObject, RunRecord, RunScene,
    RunStatus,
};
use actcheck_rules::Budget;
use actcheck_verdict::{action_score, judge_action, mean, run_score};
use actcheck_world::PHYSICS_VERSION;

/// Episodes that are imported together before they are written. Few enough that an interrupt ends
/// soon.
const BATCH: usize = 64;

/// An episode file and the mapping for it.
#[derive(Debug, Clone)]
pub struct EpisodeFile<'m> {
    /// Path of the episode file.
    pub path: PathBuf,
    /// The file that it was converted from, as given; the same path if it was not converted.
    pub named: String,
    /// Which body is which thing.
    pub mapping: &'m Mapping,
}

/// Designators whose values are not things of the scene.
const NOT_THINGS: [&str; 2] = ["objectLocation", "world"];

/// Options of [`import`].
#[derive(Debug, Clone)]
pub struct ImportOptions {
    /// Workers; they do not change the result.
    pub jobs: usize,
    /// Name of the campaign.
    pub name: String,
    /// Path of the mapping; empty for a shipped one.
    pub mapping: String,
}

/// The result of [`import`].
#[derive(Debug)]
pub struct ImportEnd {
    /// Why it ended.
    pub ending: Ending,
    /// Id of the campaign; `None` if no episode could be imported.
    pub campaign: Option<String>,
    /// Number of imported episodes.
    pub imported: u64,
    /// Faults of the other ones, in the order of the files.
    pub faults: Diagnostics,
}

/// Imports episodes into a history as the runs of one campaign.
///
/// An episode with a fault is left out and does not stop the others; if all have faults, the history
/// is left unchanged. `now` returns the present time as RFC 3339, and `on_run` is called for each
/// stored run with its outcomes.
pub fn import(
    history: &History,
    rules: &RuleSet,
    files: &[EpisodeFile<'_>],
    options: &ImportOptions,
    (now, stop): (fn() -> String, &AtomicBool),
    mut on_run: impl FnMut(&RunRecord),
) -> ImportEnd {
    let mut end = ImportEnd {
        ending: Ending::Finished,
        campaign: None,
        imported: 0,
        faults: Diagnostics::new(),
    };
    let pool = match workers(options.jobs) {
        Ok(pool) => pool,
        Err(faults) => {
            end.ending = Ending::Stopped(faults);
            return end;
        }
    };
    let budget = Budget::default();
    let mut totals = Totals::default();
    for batch in files.chunks(BATCH) {
        if stop.load(Ordering::Relaxed) {
            end.ending = Ending::Interrupted;
            break;
        }
        let made: Vec<Result<RunRecord, Diagnostics>> = pool.install(|| {
            batch
                .par_iter()
                .map(|file| run_of(rules, file, &now(), &budget))
                .collect()
        });
        for made in made {
            let mut record = match made {
                Ok(record) => record,
                Err(faults) => {
                    end.faults.extend(faults);
                    continue;
                }
            };
            let campaign = match begun(history, rules, files, &record, options, &mut end, now) {
                Ok(campaign) => campaign,
                Err(faults) => {
                    end.ending = Ending::Stopped(faults);
                    return end;
                }
            };
            record.index = end.imported;
            record.id = format!("{campaign}-{}", end.imported + 1);
            record.campaign = campaign;
            if let Err(faults) = Entry::whole(&record).and_then(|entry| history.write(&entry)) {
                end.ending = Ending::Stopped(faults);
                return end;
            }
            end.imported += 1;
            totals.add(&record);
            on_run(&record);
        }
    }
    if let Some(campaign) = &end.campaign {
        let is_interrupted = matches!(end.ending, Ending::Interrupted);
        if let Err(faults) = history.finish_campaign(campaign, &totals.end(now(), is_interrupted)) {
            end.ending = Ending::Stopped(faults);
        }
    }
    end
}

/// Returns the id of the campaign, which begins with the first run.
fn begun(
    history: &History,
    rules: &RuleSet,
    files: &[EpisodeFile<'_>],
    first: &RunRecord,
    options: &ImportOptions,
    end: &mut ImportEnd,
    now: fn() -> String,
) -> Result<String, Diagnostics> {
    if let Some(campaign) = &end.campaign {
        return Ok(campaign.clone());
    }
    let text = files
        .first()
        .map_or("", |file| &*file.mapping.source.text)
        .to_owned();
    let digest = digest_of(&text);
    let id = history.next_campaign_id(&digest, 0)?;
    let about = |name: &str| {
        let episode = first.episode.as_ref();
        episode.and_then(|episode| episode.about.get(name)).cloned()
    };
    let engine = [about("engine"), about("engine_version")]
        .into_iter()
        .flatten()
        .filter(|text| !text.is_empty())
        .collect::<Vec<String>>()
        .join(" ");
    history.begin_campaign(&CampaignRecord {
        id: id.clone(),
        name: options.name.clone(),
        config_text: text,
        config_digest: digest,
        config_path: options.mapping.clone(),
        ontology_digest: rules.ontology.digest.clone(),
        rules: rules
            .ontology
            .properties
            .values()
            .map(|property| {
                let digest = rules.rules.digest(&property.iri).to_owned();
                (property.iri.clone(), property.rule.path.clone(), digest)
            })
            .collect(),
        findings: Vec::new(),
        models: Vec::new(),
        skill: None,
        seed: 0,
        planned_runs: files.len() as u64,
        repeat: 1,
        time_secs: None,
        until_width: None,
        max_failures: None,
        shards: Vec::new(),
        strategy: "imported".to_owned(),
        started: now(),
        program_version: env!("CARGO_PKG_VERSION").to_owned(),
        program_digest: program_digest().to_owned(),
        physics: PHYSICS_VERSION,
        imported_from: Some(if engine.is_empty() {
            "an unknown engine".to_owned()
        } else {
            engine
        }),
    })?;
    end.campaign = Some(id.clone());
    Ok(id)
}

/// An episode as far as it is needed for its verdicts.
struct Read {
    trace: Trace,
    about: BTreeMap<String, String>,
    digest: String,
    /// Whether the environment counted a state as a success; `None` if it did not say.
    counted: Option<bool>,
}

/// Reads an episode and finds its things and actions.
fn read(rules: &RuleSet, file: &EpisodeFile<'_>) -> Result<Read, Diagnostics> {
    let (episode, digest) = Episode::read(&file.path)?;
    let named = |faults: Diagnostics| {
        let mut found = Diagnostics::new();
        for mut fault in faults {
            fault.message = format!("{}: {}", file.named, fault.message);
            found.push(fault);
        }
        found
    };
    let cast = file.mapping.cast(&episode).map_err(named)?;
    let actions = file.mapping.actions_of(&episode).map_err(named)?;
    let trace = trace(&episode, &cast, &actions);
    check_actions(rules, file, &trace)?;
    let said = episode
        .states
        .iter()
        .filter_map(|state| state.outcome?.success);
    let counted = said.reduce(|any, success| any || success);
    let mut about = episode.about;
    about.remove("format");
    Ok(Read {
        trace,
        about,
        digest,
        counted,
    })
}

/// The premises of an episode.
#[derive(Debug, Clone)]
pub struct CheckedPremises {
    /// Its environment, or else its task; empty if neither is known.
    pub task: String,
    /// The file that was named.
    pub file: String,
    /// Label of each premise, with its outcome and words.
    pub premises: Vec<(String, Outcome, String)>,
}

/// Returns the premises of a trace's actions, over its first state: each with its outcome and words.
fn premises_of(rules: &RuleSet, trace: &Trace, facts: &RunFacts) -> Vec<(String, Outcome, String)> {
    let mut premises = Vec::new();
    for (step, performed) in trace.actions.iter().enumerate() {
        let action = &rules.actions[&performed.action];
        let Some(seen) = facts.action(step) else {
            continue;
        };
        let first = ActionFacts {
            before: facts.start(),
            ..seen
        };
        let found = rules
            .rules
            .held_before(&first, &action.premises, &Budget::default());
        for (iri, found) in found {
            let label = names::local(&iri).to_owned();
            premises.push(match found {
                Ok(found) => (label, found.outcome(), found.because.join("; ")),
                Err(fault) => (label, fault.outcome(), fault.reason().to_owned()),
            });
        }
    }
    premises
}

/// Judges the premises of an episode's actions over its first state.
///
/// # Errors
/// The episode can't be read or mapped.
pub fn check_premises(
    rules: &RuleSet,
    file: &EpisodeFile<'_>,
) -> Result<CheckedPremises, Diagnostics> {
    let Read { trace, about, .. } = read(rules, file)?;
    let premises = premises_of(rules, &trace, &facts::extract(&trace));
    Ok(CheckedPremises {
        task: task_of(&about),
        file: file.named.clone(),
        premises,
    })
}

/// Reads and judges an episode. Its place in a campaign is not known yet.
fn run_of(
    rules: &RuleSet,
    file: &EpisodeFile<'_>,
    started: &str,
    budget: &Budget,
) -> Result<RunRecord, Diagnostics> {
    judged(rules, file, read(rules, file)?, started, budget)
}

/// A faulty episode with two verdicts: of the environment's own check, and of the rules.
#[derive(Debug, Clone)]
pub struct AuditedEpisode {
    /// The fault that was put into it; empty if none was.
    pub fault: String,
    /// Its environment, or else its task; empty if neither is known.
    pub task: String,
    /// The file that was named.
    pub file: String,
    /// Whether the environment's own check counted a state as a success; `None` if it did not say.
    pub counted: Option<bool>,
    /// Local names of the failed properties, each with its words.
    pub failed: Vec<(String, String)>,
    /// The premise that does not hold, with its words: the scene is not the task's.
    pub broken_premise: Option<(String, String)>,
    /// Number of passed and failed outcomes.
    pub decided: usize,
    /// Why nothing was decided: the words of the first property.
    pub undecided: String,
}

/// Judges an episode, and compares with the environment's own check.
///
/// # Errors
/// The episode can't be read or mapped.
pub fn audit_episode(
    rules: &RuleSet,
    file: &EpisodeFile<'_>,
) -> Result<AuditedEpisode, Diagnostics> {
    let read = read(rules, file)?;
    let counted = read.counted;
    let about = read.about.clone();
    let run = judged(rules, file, read, "", &Budget::default())?;
    let outcomes: Vec<&Judgement> = run.judgements.iter().flatten().collect();
    let failed = outcomes
        .iter()
        .filter(|judgement| judgement.outcome == Outcome::Failed)
        .map(|judgement| {
            let name = names::local(&judgement.property).to_owned();
            (name, judgement.witness.clone())
        });
    let is_decided =
        |judgement: &&&Judgement| matches!(judgement.outcome, Outcome::Passed | Outcome::Failed);
    let broken_premise = premises_of(rules, &run.trace, &run.facts)
        .into_iter()
        .find(|(_, outcome, _)| *outcome == Outcome::Failed)
        .map(|(premise, _, words)| (premise, words));
    Ok(AuditedEpisode {
        broken_premise,
        fault: about.get("fault").cloned().unwrap_or_default(),
        task: task_of(&about),
        file: file.named.clone(),
        counted,
        failed: failed.collect(),
        decided: outcomes.iter().filter(is_decided).count(),
        undecided: outcomes
            .first()
            .map(|judgement| judgement.witness.clone())
            .unwrap_or_default(),
    })
}

/// The environment of an episode, or else its task in words.
fn task_of(about: &BTreeMap<String, String>) -> String {
    let stated = |name: &str| about.get(name).filter(|text| !text.is_empty()).cloned();
    stated("environment")
        .or_else(|| stated("task"))
        .unwrap_or_default()
}

/// Judges an episode that was read.
fn judged(
    rules: &RuleSet,
    file: &EpisodeFile<'_>,
    read: Read,
    started: &str,
    budget: &Budget,
) -> Result<RunRecord, Diagnostics> {
    let Read {
        trace,
        mut about,
        digest,
        ..
    } = read;
    let facts = facts::extract(&trace);
    let mut judgements: Vec<Vec<Judgement>> = Vec::new();
    let mut iris = Vec::new();
    for (step, performed) in trace.actions.iter().enumerate() {
        let action = &rules.actions[&performed.action];
        iris.push(action.iri.clone());
        let judged = judge_action(
            &rules.ontology,
            &rules.rules,
            action,
            &performed.end,
            (facts.start(), facts.action(step)),
            budget,
        );
        judgements.push(judged.map_err(|failure| {
            Diagnostics::from(Diagnostic::error(
                "X035",
                format!("{}: {failure}", file.named),
            ))
        })?);
    }
    let action_scores: Vec<f64> = judgements
        .iter()
        .map(|list| action_score(list.iter().map(|judgement| judgement.outcome)))
        .collect();
    Ok(RunRecord {
        id: String::new(),
        campaign: String::new(),
        shrunk_from: None,
        index: 0,
        repetition: None,
        weight: None,
        test: trace
            .actions
            .iter()
            .map(|action| action.action.as_str())
            .collect::<Vec<&str>>()
            .join(" "),
        seed: 0,
        status: RunStatus::Completed,
        reason: None,
        program_output: None,
        score: run_score(&action_scores),
        action_scores,
        discards: Vec::new(),
        choices: Vec::new(),
        scene: scene_of(&trace, &about),
        facts,
        actions: iris,
        judgements,
        quality: None,
        episode: Some(EpisodeRecord {
            file: file.named.clone(),
            key: about.remove("source_episode").unwrap_or_default(),
            digest,
            about,
        }),
        trace,
        started: started.to_owned(),
        wall_secs: 0.0,
        elapsed_secs: 0.0,
    })
}

/// Checks that there are actions, and that the ontology has them.
fn check_actions(
    rules: &RuleSet,
    file: &EpisodeFile<'_>,
    trace: &Trace,
) -> Result<(), Diagnostics> {
    let mut faults = Diagnostics::new();
    if trace.actions.is_empty() {
        faults.push(
            Diagnostic::error("E016", format!("{}: no action is known", file.named))
                .help("add `[[actions]]` with `action = \"Pick\"` to the mapping, or mark it where you record: `recorder.mark(\"Pick\", \"begin\")`"),
        );
    }
    let things: BTreeSet<&str> = trace
        .snapshots
        .iter()
        .flat_map(|snapshot| &snapshot.bodies)
        .map(|body| body.id.as_str())
        .collect();
    for action in &trace.actions {
        for (designator, values) in &action.parameters {
            if things.is_empty() || NOT_THINGS.contains(&designator.as_str()) {
                continue;
            }
            for value in values
                .iter()
                .filter(|value| !things.contains(value.as_str()))
            {
                faults.push(
                    Diagnostic::error(
                        "E021",
                        format!(
                            "{}: the episode has no object `{value}` (`{designator}` of `{}`)",
                            file.named, action.action
                        ),
                    )
                    .help(did_you_mean(value, things.iter().copied())),
                );
            }
        }
        if !rules.actions.contains_key(&action.action) {
            let known = rules.actions.keys().map(String::as_str);
            let fault = Diagnostic::error(
                "E017",
                format!(
                    "{}: the ontology has no action `{}`",
                    file.named, action.action
                ),
            )
            .help(did_you_mean(&action.action, known));
            let written = file
                .mapping
                .actions
                .iter()
                .find(|written| written.name == action.action);
            faults.push(match written {
                Some(written) => fault.at(&file.mapping.source, written.span.clone()),
                None => fault,
            });
        }
    }
    faults.or(())
}

/// The scene of an episode: its first state.
fn scene_of(trace: &Trace, about: &BTreeMap<String, String>) -> RunScene {
    let mut designators: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (name, values) in trace.actions.iter().flat_map(|action| &action.parameters) {
        designators
            .entry(name.clone())
            .or_insert_with(|| values.clone());
    }
    let targets: BTreeSet<&String> = designators
        .iter()
        .filter(|(name, _)| name.starts_with("pick") || name.ends_with("Object"))
        .flat_map(|(_, values)| values)
        .collect();
    let Some(first) = trace.snapshots.first() else {
        return RunScene::default();
    };
    let objects = first.bodies.iter().map(|body| RunObject {
        id: body.id.clone(),
        model: body.model.clone(),
        category: body.category.clone(),
        role: if body.fixed {
            Role::Platform
        } else if targets.contains(&body.id) {
            Role::Target
        } else if body.part.is_some() {
            Role::Part
        } else {
            Role::Other
        },
        pose: body.pose,
        mass_kg: body.mass_kg,
        friction: body.friction,
        restitution: body.restitution,
    });
    RunScene {
        world: about.get("environment").cloned().unwrap_or_default(),
        robot: about.get("robot").cloned().unwrap_or_default(),
        base: first.robot.base_true,
        noise: Vec::new(),
        objects: objects.collect(),
        designators,
    }
}

/// The outcomes and scores of the imported runs.
#[derive(Default)]
struct Totals {
    outcomes: BTreeMap<Outcome, u64>,
    scores: Vec<f64>,
}

impl Totals {
    fn add(&mut self, record: &RunRecord) {
        self.scores.push(record.score);
        for judgement in record.judgements.iter().flatten() {
            *self.outcomes.entry(judgement.outcome).or_default() += 1;
        }
    }

    fn end(self, ended: String, interrupted: bool) -> CampaignEnd {
        let score = mean(self.scores);
        CampaignEnd {
            ended,
            score,
            score_without_broken: score,
            outcomes: self.outcomes,
            discards: 0,
            ended_by: None,
            interrupted,
        }
    }
}

/// Returns a name for the campaign of some files: that of the folder or of the only file.
pub fn name_of_import(files: &[PathBuf]) -> String {
    let name = match files {
        [only] => only.file_stem(),
        _ => files
            .first()
            .and_then(|first| first.parent())
            .and_then(Path::file_name),
    };
    name.map_or_else(
        || "episodes".to_owned(),
        |name| names::escaped(&name.to_string_lossy()),
    )
}
