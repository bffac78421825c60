//! Runs a stored run again from its recorded choices, and compares the two.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::attempt::Attempt;
use crate::difference::first_difference;
use crate::finished_run::FinishedRun;
use crate::workers::workers;
use crate::{Env, InputChange, RunContext, TraceDifference, changes};
use actcheck_actions::Cut;
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_data::{ActionEnd, Choice, Choices, Trace};
use actcheck_history::{CampaignRecord, History, RunDetail};

/// Maximum number of choices named in a message.
const MOST_NAMED: usize = 8;

/// A run's campaign as prepared today, and its record.
pub type StoredCampaign = (Env, CampaignRecord);

/// How exactly the recorded choices must fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fit {
    /// Every choice must be recorded and of the same kind, and none may be left over. Candidates
    /// may be added.
    Exact,
    /// Values are clamped to their bounds, and missing choices are nominal.
    Nearest,
}

/// Options of [`replay_all`]. Neither the number of workers nor the clock changes the results.
#[derive(Debug, Clone, Copy)]
pub struct ReplayOptions {
    /// How exactly the recorded choices must fit.
    pub fit: Fit,
    /// Workers, one simulation each.
    pub jobs: usize,
    /// How each run is made.
    pub context: RunContext,
}

/// The result of replaying a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Replay {
    /// Id of the stored run.
    pub run: String,
    /// Names of its actions.
    pub test: String,
    /// Whether all states are bitwise identical.
    pub same: bool,
    /// Simulated time at which the wall-clock limit cut the run off; runs are compared up to then.
    /// Unit: seconds.
    pub cut_secs: Option<f64>,
    /// Digests of all states, then and now.
    pub hashes: [String; 2],
    /// Reasons why it did not complete, then and now.
    pub reasons: [Option<String>; 2],
    /// The first difference of the traces; `None` if they are identical or differ by less than the
    /// stored precision.
    pub difference: Option<TraceDifference>,
    /// Recorded choices that did not fit.
    pub misfits: Vec<Misfit>,
    /// Outcomes that differ under the present rules.
    pub outcomes: Vec<OutcomeChange>,
    /// Inputs that changed since.
    pub changes: Vec<InputChange>,
}

/// A recorded choice that did not fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Misfit {
    /// Name of the choice; with a number if it is not the first one of that name.
    pub name: String,
    /// Why it does not fit.
    pub kind: MisfitKind,
}

/// Reasons why a recorded choice does not fit.
#[derive(Debug, Clone, PartialEq)]
pub enum MisfitKind {
    /// It is needed but not recorded; the nominal value was used.
    Missing,
    /// It is recorded but not needed.
    LeftOver,
    /// Its kind changed: other bounds, another number of options, or another standard deviation.
    OtherKind,
    /// Its candidate was removed.
    Replaced {
        /// The recorded candidate.
        was: String,
        /// The candidate that was used.
        is: String,
    },
    /// Its value was changed.
    Moved {
        /// The recorded value.
        was: f64,
        /// The value that was used.
        is: f64,
    },
}

/// A changed outcome of a property; `None` on the side where it was not judged.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutcomeChange {
    /// Position of the action in the test, from 1.
    pub step: usize,
    /// IRI of the property.
    pub property: String,
    /// The outcome then.
    pub was: Option<String>,
    /// The outcome now.
    pub is: Option<String>,
}

/// Replays stored runs on several workers and calls `on_done` after each. `campaigns` has their
/// campaigns by id.
///
/// The results are in the order of `runs`. They depend neither on the number of workers nor on the
/// clock.
///
/// # Errors
/// `X010` if the workers can't be started. Each result has the faults of its own replay.
pub fn replay_all(
    history: &History,
    campaigns: &BTreeMap<String, StoredCampaign>,
    runs: &[RunDetail],
    options: &ReplayOptions,
    on_done: impl Fn() + Sync,
) -> Result<Vec<Result<Replay, Diagnostics>>, Diagnostics> {
    let pool = workers(options.jobs)?;
    let one = |detail: &RunDetail| {
        let replayed = match campaigns.get(&detail.row.campaign) {
            Some(stored) => replay(history, stored, detail, options),
            None => Err(refused(detail, "its campaign is not known").into()),
        };
        on_done();
        replayed
    };
    Ok(pool.install(|| runs.par_iter().map(one).collect()))
}

/// Replays one stored run.
///
/// # Errors
/// `S040` if the configuration has no such test, `S041` if the scene can no longer be built, `S042`
/// if the choices must fit exactly and do not; or the stored trace can't be read.
fn replay(
    history: &History,
    (env, record): &StoredCampaign,
    detail: &RunDetail,
    options: &ReplayOptions,
) -> Result<Replay, Diagnostics> {
    let run = &detail.row.run;
    // Without kept motion, its states and the digest over all states are compared.
    let is_whole = history.is_whole(run)?;
    let (choices, was) = if !is_whole {
        history.traces().recorded(run)?
    } else {
        (history.traces().choices(run)?, history.traces().whole(run)?)
    };
    let index = env.index_of(&detail.row.test, &choices)?;
    // The wall clock is not part of a run's choices: the replay is cut off at the same simulated
    // time.
    let cut_secs = cut_secs(&was);
    let cut = cut_secs.map_or(Cut::Never, |at_secs| Cut::Simulated { at_secs });
    let attempt = Attempt {
        campaign: &record.id,
        index,
        choices: &|| Choices::recorded(&choices),
        cut,
    };
    let mut is = attempt.make(env, &options.context).map_err(|why| {
        refused(detail, &why.to_string()).help(
            "a model, the configuration or the program changed: see the digests in the history",
        )
    })?;
    let misfits = misfits(&choices, &is.choices);
    if options.fit == Fit::Exact && !misfits.is_empty() {
        return Err(unfit(detail, &misfits).into());
    }
    if !is_whole {
        is.trace.frames.rows.clear();
    }
    let (now, difference) = (
        env.record(String::new(), record.name.clone(), String::new()),
        first_difference(&was, &is.trace),
    );
    Ok(Replay {
        run: run.clone(),
        test: detail.row.test.clone(),
        same: was.hash == is.trace.hash && detail.row.status == is.status && difference.is_none(),
        cut_secs,
        hashes: [was.hash, is.trace.hash.clone()],
        reasons: [detail.reason.clone(), is.reason.clone()],
        difference,
        misfits,
        outcomes: outcome_changes(detail, &is),
        changes: changes(record, &now),
    })
}

/// Simulated time at which the wall-clock limit cut a run off.
pub(super) fn cut_secs(trace: &Trace) -> Option<f64> {
    let cut = trace
        .actions
        .iter()
        .any(|action| matches!(action.end, ActionEnd::Cut(_)));
    trace
        .snapshots
        .last()
        .filter(|_| cut)
        .map(|last| last.time_secs)
}

pub(super) fn refused(detail: &RunDetail, why: &str) -> Diagnostic {
    Diagnostic::error(
        "S041",
        format!("run {} can't be run again: {why}", detail.row.run),
    )
}

/// Compares the recorded choices with those made from them.
fn misfits(recorded: &[Choice], made: &[Choice]) -> Vec<Misfit> {
    let mut pairs: BTreeMap<String, [Vec<&Choice>; 2]> = BTreeMap::new();
    for (side, choices) in [recorded, made].into_iter().enumerate() {
        for choice in choices {
            pairs.entry(choice.name.to_string()).or_default()[side].push(choice);
        }
    }
    let mut found = Vec::new();
    for (name, [was, is]) in pairs {
        for number in 0..was.len().max(is.len()) {
            let kind = match (was.get(number), is.get(number)) {
                (None, _) => Some(MisfitKind::Missing),
                (_, None) => Some(MisfitKind::LeftOver),
                (Some(was), Some(is)) => misfit(was, is),
            };
            let name = if number == 0 {
                name.clone()
            } else {
                format!("{name} ({})", number + 1)
            };
            found.extend(kind.map(|kind| Misfit { name, kind }));
        }
    }
    found
}

/// Compares a recorded choice with the one made from it; `None` if they are the same.
fn misfit(was: &Choice, is: &Choice) -> Option<MisfitKind> {
    match (was.candidate(), is.candidate()) {
        (Some(was), Some(is)) => (was != is).then(|| MisfitKind::Replaced {
            was: was.to_owned(),
            is: is.to_owned(),
        }),
        _ if was.value.to_bits() != is.value.to_bits() => Some(MisfitKind::Moved {
            was: was.value,
            is: is.value,
        }),
        _ if was.kind == is.kind => None,
        _ => Some(MisfitKind::OtherKind),
    }
}

fn unfit(detail: &RunDetail, misfits: &[Misfit]) -> Diagnostic {
    let named: Vec<String> = misfits
        .iter()
        .take(MOST_NAMED)
        .map(Misfit::to_string)
        .collect();
    let more = misfits.len().saturating_sub(MOST_NAMED);
    let rest = if more > 0 {
        format!(", and {more} more")
    } else {
        String::new()
    };
    Diagnostic::error(
        "S042",
        format!(
            "the choices of run {} don't fit exactly: {}{rest}",
            detail.row.run,
            named.join(", ")
        ),
    )
    .help("without `--exact`, values are clamped to their bounds, and missing choices are nominal")
}

impl std::fmt::Display for Misfit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let name = &self.name;
        match &self.kind {
            MisfitKind::Missing => write!(f, "`{name}` is missing"),
            MisfitKind::LeftOver => write!(f, "`{name}` is no longer needed"),
            MisfitKind::OtherKind => write!(f, "`{name}` has another kind or range now"),
            MisfitKind::Replaced { was, is } => {
                write!(f, "`{name}` was `{was}`, which it can't be now, is `{is}`")
            }
            MisfitKind::Moved { was, is } => write!(f, "`{name}` was {was}, is {is}"),
        }
    }
}

/// Changed outcomes, sorted by action and property.
fn outcome_changes(was: &RunDetail, is: &FinishedRun) -> Vec<OutcomeChange> {
    let mut both: BTreeMap<(usize, &str), [Option<&'static str>; 2]> = BTreeMap::new();
    for (idx, action) in was.actions.iter().enumerate() {
        for judgement in &action.judgements {
            both.entry((idx + 1, &judgement.property)).or_default()[0] =
                Some(judgement.outcome.word());
        }
    }
    for (idx, judgements) in is.judgements.iter().enumerate() {
        for judgement in judgements {
            both.entry((idx + 1, &judgement.property)).or_default()[1] =
                Some(judgement.outcome.word());
        }
    }
    both.into_iter()
        .filter(|(_, [was, is])| was != is)
        .map(|((step, property), [was, is])| OutcomeChange {
            step,
            property: property.to_owned(),
            was: was.map(str::to_owned),
            is: is.map(str::to_owned),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::{ChoiceKind, ChoiceName};

    fn real(name: &str, high: f64, value: f64) -> Choice {
        Choice {
            name: name.into(),
            kind: ChoiceKind::Real {
                low: 0.0,
                high,
                nominal: 0.0,
            },
            value,
        }
    }

    #[test]
    fn every_kind_of_mismatch_is_named() {
        let recorded = [
            real("a", 1.0, 0.5),
            real("b", 1.0, 0.9),
            real("b", 1.0, 0.1),
            real("c", 1.0, 0.2),
        ];
        let made = [
            real("a", 2.0, 0.5),
            real("b", 0.8, 0.8),
            real("d", 1.0, 0.0),
            real("c", 1.0, 0.2),
        ];
        let found: Vec<String> = misfits(&recorded, &made)
            .iter()
            .map(Misfit::to_string)
            .collect();
        assert_eq!(
            found,
            [
                "`a` has another kind or range now",
                "`b` was 0.9, is 0.8",
                "`b (2)` is no longer needed",
                "`d` is missing",
            ]
        );
        assert!(misfits(&recorded, &recorded).is_empty());
    }

    fn candidate(names: &[&str], value: f64) -> Choice {
        let names = names.iter().map(|name| (*name).to_owned()).collect();
        Choice {
            name: ChoiceName::SurfaceName,
            kind: ChoiceKind::Candidate { names },
            value,
        }
    }

    #[test]
    fn candidates_may_be_added_but_not_removed() {
        let misfit_text =
            |was: Choice, is: Choice| misfits(&[was], &[is]).first().map(Misfit::to_string);
        assert_eq!(
            misfit_text(candidate(&["a"], 0.0), candidate(&["b", "a"], 1.0)),
            None
        );
        let gone = misfit_text(candidate(&["a"], 0.0), candidate(&["b"], 0.0));
        assert_eq!(
            gone.as_deref(),
            Some("`surface.name` was `a`, which it can't be now, is `b`")
        );
    }
}
