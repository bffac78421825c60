//! Checks episodes instead of keeping them: is the first state the one that the task is about, and does
//! the environment's own check agree with the rules?

use actcheck_base::{ActionFacts, Diagnostics, Judgement, Outcome, RunFacts, names};
use actcheck_data::Trace;
use actcheck_facts as facts;
use actcheck_rules::Budget;

use crate::RuleSet;
use crate::episode::{EpisodeFile, ReadEpisode, judged, read, task_of};

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
pub fn check_premises(file: &EpisodeFile<'_>) -> Result<CheckedPremises, Diagnostics> {
    let ReadEpisode { trace, about, .. } = read(file)?;
    let premises = premises_of(file.rules, &trace, &facts::extract(&trace));
    Ok(CheckedPremises {
        task: task_of(&about),
        file: file.named.clone(),
        premises,
    })
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
pub fn audit_episode(file: &EpisodeFile<'_>) -> Result<AuditedEpisode, Diagnostics> {
    let read = read(file)?;
    let counted = read.counted;
    let about = read.about.clone();
    let run = judged(file, read, "", &Budget::default())?;
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
    let broken_premise = premises_of(file.rules, &run.trace, &run.facts)
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
