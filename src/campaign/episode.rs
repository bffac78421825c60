//! One episode of another simulator or robot: read, and judged by the rules as a run.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use crate::RuleSet;
use actcheck_base::{Diagnostic, Diagnostics, Judgement, did_you_mean};
use actcheck_data::{ActionTrace, Role, Trace};
use actcheck_episodes::{Episode, Mapping, repeat, trace};
use actcheck_facts as facts;
use actcheck_history::{EpisodeRecord, RunObject, RunRecord, RunScene, RunStatus};
use actcheck_rules::Budget;
use actcheck_verdict::{action_score, judge_action, run_score};

/// The designator whose values are neither things nor places of the scene.
const WORLD: &str = "world";
/// The designator whose values are places on the map.
const LOCATION: &str = "objectLocation";

/// An episode file, with the mapping and the rules for it.
#[derive(Clone)]
pub struct EpisodeFile<'m> {
    /// Path of the episode file.
    pub path: PathBuf,
    /// The file that it was converted from, as given; the same path if it was not converted.
    pub named: String,
    /// Which body is which thing.
    pub mapping: &'m Mapping,
    /// The rules that judge it.
    pub rules: &'m RuleSet,
    /// The run that it repeats in another engine: its map and its percepts are also the episode's.
    pub repeats: Option<&'m Trace>,
}

/// An episode as far as it is needed for its verdicts.
pub(crate) struct ReadEpisode {
    pub trace: Trace,
    /// The recorder's metadata.
    pub about: BTreeMap<String, String>,
    digest: String,
    /// Whether the environment counted a state as a success; `None` if it did not say.
    pub counted: Option<bool>,
}

/// Reads an episode and finds its things and actions.
pub(crate) fn read(file: &EpisodeFile<'_>) -> Result<ReadEpisode, Diagnostics> {
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
    let mut trace = trace(&episode, &cast, &actions);
    if let Some(run) = file.repeats {
        repeat(run, &mut trace);
    }
    check_actions(file, &trace)?;
    let said = episode
        .states
        .iter()
        .filter_map(|state| state.outcome?.success);
    let counted = said.reduce(|any, success| any || success);
    let mut about = episode.about;
    about.remove("format");
    Ok(ReadEpisode {
        trace,
        about,
        digest,
        counted,
    })
}

/// Reads and judges an episode. Its place in a campaign is not known yet.
pub(crate) fn run_of(
    file: &EpisodeFile<'_>,
    started: &str,
    budget: &Budget,
) -> Result<RunRecord, Diagnostics> {
    judged(file, read(file)?, started, budget)
}

/// The environment of an episode, or else its task in words.
pub(crate) fn task_of(about: &BTreeMap<String, String>) -> String {
    let stated = |name: &str| about.get(name).filter(|text| !text.is_empty()).cloned();
    stated("environment")
        .or_else(|| stated("task"))
        .unwrap_or_default()
}

/// Judges an episode that was read.
pub(crate) fn judged(
    file: &EpisodeFile<'_>,
    read: ReadEpisode,
    started: &str,
    budget: &Budget,
) -> Result<RunRecord, Diagnostics> {
    let ReadEpisode {
        trace,
        mut about,
        digest,
        ..
    } = read;
    let rules = file.rules;
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
                "R091",
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
fn check_actions(file: &EpisodeFile<'_>, trace: &Trace) -> Result<(), Diagnostics> {
    let rules = file.rules;
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
            if designator == LOCATION {
                faults.extend(unknown_places(file, trace, action));
                continue;
            }
            if things.is_empty() || designator == WORLD {
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

/// E021: places that are not on the episode's map. Recordings have no map, and rules about places
/// would fail without one.
fn unknown_places(file: &EpisodeFile<'_>, trace: &Trace, action: &ActionTrace) -> Diagnostics {
    let mut faults = Diagnostics::new();
    let is_known = |place: &String| {
        let mut locations = trace.map.locations.iter();
        locations.any(|location| location.name == *place)
    };
    for place in action.parameters[LOCATION]
        .iter()
        .filter(|place| !is_known(place))
    {
        let message = format!(
            "{}: the place `{place}` (`{LOCATION}` of `{}`) is on no map: recordings have none",
            file.named, action.action
        );
        faults.push(
            Diagnostic::error("E021", message)
                .help("leave the action out, or judge where the robot arrives by an action and rules of your own"),
        );
    }
    faults
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
