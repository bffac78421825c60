//! Shrinks a failing run: a list of a scene's choices is tested by running it.

use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::finished_run::RunPlace;
use crate::line::simulate;
use crate::relations::{judge_related, relation_called};
use crate::run_cases::end_of;
use crate::shrink::list::{drop_rejected_tries, has, with_value};
use crate::shrink::{
    Explained, Id, Passing, ShrinkPlan, TrialLimits, TrialSearch, Tried, TryResult, explain, reduce,
};
use crate::{Env, RunContext, RunInput, run_line};
use actcheck_actions::Interference;
use actcheck_base::{Diagnostic, Diagnostics, Judgement, Outcome, did_you_mean, names};
use actcheck_config::SceneChange;
use actcheck_data::{
    Choice, ChoiceGroup, ChoiceKind, ChoiceName, Choices, ObjectAxis, PlacedObject, Role,
};
use actcheck_history::{History, RunRecord, RunStatus};
use actcheck_scenario as scenario;
use actcheck_verdict::Counts;

/// Repetitions of the shrunk scene with fresh noise, to estimate how often it fails.
const FRESH: u32 = 5;
/// Smaller movements come from settling and rounding. Unit: metres.
const MOVED_M: f64 = 1e-3;

/// The share of repetitions with fresh noise that must fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Repeat {
    /// Minimum number of failures.
    pub least: u32,
    /// Number of repetitions.
    pub of: u32,
}

/// Options of [`shrink`].
pub struct ShrinkOptions<'a> {
    /// The property that must still fail; `None`: exactly the properties that failed in the run.
    pub property: Option<&'a str>,
    /// Maximum number of simulations, including those of the explanation.
    pub trials: u64,
    /// Workers; the result does not depend on their number.
    pub jobs: usize,
    /// Test with fresh noise; `None`: the noise is as recorded, and is shrunk like the other
    /// choices.
    pub repeat: Option<Repeat>,
    /// How runs are made.
    pub context: RunContext,
    /// Whether the time is up or the user has interrupted.
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

/// The smallest failing scene found.
#[derive(Debug, Clone)]
pub struct Shrunk {
    /// Its choices, including noise.
    pub choices: Vec<Choice>,
    /// IRIs of the properties that failed in the run. All of them, or the requested one, still
    /// fail.
    pub failed: BTreeSet<String>,
    /// Number of other objects in the original run.
    pub others_before: usize,
    /// Number of its choices that were not nominal.
    pub special_before: usize,
    /// Whether nothing more can be removed; `false` if limits ended the search.
    pub minimal: bool,
    /// Number of simulations for shrinking.
    pub simulations: u64,
    /// Number of simulations for the explanation.
    pub explaining: u64,
    /// The choices that matter.
    pub explained: Explained,
    /// Number of failures with fresh noise, and of repetitions; `None` if there is no noise or the
    /// time is up.
    pub fresh: Option<(u32, u32)>,
    /// Whether recorded noise was used, because with fresh noise the run does not fail often
    /// enough.
    pub noise_kept: bool,
    /// The change of the relation that is broken, if one was asked for.
    pub relation: Option<SceneChange>,
}

/// Finds the smallest scene that fails as a run did. `recorded` are the run's choices, `index` is
/// its position in its campaign.
///
/// The result does not depend on the number of workers, but may depend on a time limit. `on_better`
/// is called with each smaller scene.
///
/// # Errors
/// `S050` if nothing fails when the run is repeated, or not the requested property; `S051` if its
/// scene can't be built, for example because one of its candidates was removed.
pub fn shrink(
    env: &Env,
    index: u64,
    recorded: &[Choice],
    options: &ShrinkOptions<'_>,
    on_better: &mut dyn FnMut(&[Choice]),
) -> Result<Shrunk, Diagnostics> {
    check_candidates(env, index, recorded)?;
    let recorded = drop_rejected_tries(recorded);
    let relation = options.property.and_then(|name| relation_called(env, name));
    let first = remake(env, index, &recorded, options)?;
    let first = with_relation(env, index, relation, first, &options.context);
    let mut choices = Choices::recorded(&first.choices);
    let scene = scenario::draw(&env.space, env.test_of(index), &mut choices);
    let may_block =
        env.campaign.nav_may_block || scene.is_ok_and(|scene| scenario::is_blocked(&scene));
    let subject = Subject {
        env,
        index,
        failed: signature(&first),
        may_block,
        relation,
        options,
    };
    subject.check_property()?;
    let removals = removals(&first, &recorded);
    let others_before = removals.len();
    let ends = ends(env, index);
    let plan = ShrinkPlan {
        removals,
        ends,
        group: &group,
    };
    let start = drop_rejected_tries(&first.choices);
    let fresh_noise = |list: &[Choice]| subject.with_fresh_noise(list);
    let as_recorded = |list: &[Choice]| subject.as_recorded(list);
    let noisy = start
        .iter()
        .any(|choice| choice.name.is_noise() && choice.value != 0.0);
    let repeated = options.repeat.is_some()
        && noisy
        && matches!(fresh_noise(&start).result, TryResult::Fails(_));
    let test: &(dyn Fn(&[Choice]) -> Tried + Sync) =
        if repeated { &fresh_noise } else { &as_recorded };
    let limits = TrialLimits {
        simulations: options.trials,
        jobs: options.jobs,
        stop: options.stop,
    };
    let mut search = TrialSearch::new(test, limits);
    let special_before = special(&start);
    let start = if repeated {
        start
            .into_iter()
            .filter(|choice| !choice.name.is_noise())
            .collect()
    } else {
        start
    };
    let (choices, minimal) = reduce(&mut search, start, &plan, on_better);
    let simulations = search.simulations();
    let mut explained = explain(&mut search, &choices, &plan);
    let mut explaining = search.simulations() - simulations;
    let fresh = (noisy && !(options.stop)()).then(|| subject.fresh_failures(&choices));
    let choices = if repeated {
        subject.with_failing_noise(&choices)
    } else {
        choices
    };
    if repeated {
        // Tried with fresh noise, but replayed with that of the stored run.
        let left = options.trials.saturating_sub(simulations + explaining);
        let (confirmed, replays) = subject.confirmed(explained, &choices, left);
        (explained, explaining) = (confirmed, explaining + replays);
    }
    Ok(Shrunk {
        relation,
        fresh,
        choices,
        failed: subject.failed,
        others_before,
        special_before,
        minimal,
        simulations,
        explaining,
        explained,
        noise_kept: options.repeat.is_some() && noisy && !repeated,
    })
}

/// Name prefix of campaigns that hold a shrunk run.
pub(crate) const SHRUNK: &str = "shrunk ";

/// Runs the shrunk scene again and stores it in the history, in a campaign of its own. Returns the
/// run, which names the `original` run, from which it was shrunk. `index` is the original's
/// position in its campaign.
///
/// # Errors
/// Writing failed; or `S051` if the scene can't be built, for example because the program changed.
pub fn store(
    env: &Env,
    history: &History,
    original: &str,
    index: u64,
    shrunk: &Shrunk,
    context: &RunContext,
) -> Result<RunRecord, Diagnostics> {
    let id = history.next_campaign_id(
        &actcheck_base::digest_of(&env.campaign.source.text),
        env.campaign.seed,
    )?;
    let mut campaign = env.record(
        id.clone(),
        format!("{SHRUNK}{original}"),
        (context.clock.now)(),
    );
    (campaign.planned_runs, campaign.repeat) = (1, 1);
    campaign.shards.clear();
    let input = RunInput {
        campaign: &id,
        index,
        choices: Choices::recorded(&shrunk.choices),
    };
    let run = simulate(
        env,
        input,
        context,
        context.clock.start(),
        Interference::default(),
    )
    .map_err(|failure| {
        Diagnostic::error(
            "S051",
            format!("the shrunk scene can't be built again: {failure}"),
        )
    })?;
    let record = run.into_record(RunPlace {
        shrunk_from: Some(original.to_owned()),
        ..RunPlace::alone(&id)
    });
    history.begin_campaign(&campaign)?;
    history.commit(&record)?;
    history.finish_campaign(&id, &end_of(&record, (context.clock.now)()))?;
    Ok(record)
}

/// The run to shrink, and the properties that must still fail.
struct Subject<'a> {
    env: &'a Env,
    index: u64,
    failed: BTreeSet<String>,
    /// Whether obstacles may be in the way: the run's own are, or the configuration allows it.
    may_block: bool,
    /// The change of the relation that must still be broken, instead of a property.
    relation: Option<SceneChange>,
    options: &'a ShrinkOptions<'a>,
}

impl Subject<'_> {
    fn check_property(&self) -> Result<(), Diagnostics> {
        let failed = || self.failed.iter().map(|iri| names::local(iri));
        match self.options.property {
            _ if self.failed.is_empty() => Err(Diagnostic::error(
                "S050",
                "no property fails in this run: there is nothing to shrink",
            )
            .help("rules or models may have changed since then; `actcheck list` shows scores")
            .into()),
            Some(property) if !self.failed.iter().any(|iri| is_named(iri, property)) => {
                let message = format!("the property `{property}` does not fail in this run");
                let help = format!(
                    "{}; failing: {}",
                    did_you_mean(property, failed()),
                    failed().collect::<Vec<_>>().join(", ")
                );
                Err(Diagnostic::error("S050", message).help(help).into())
            }
            _ => Ok(()),
        }
    }

    /// Makes one run. Returns `None` if its scene can't be built, or if it does not complete.
    fn complete(&self, choices: Choices) -> Option<RunRecord> {
        if !self.may_block && self.is_blocked(choices.clone()) {
            return None;
        }
        let run = || {
            run_line(
                self.env,
                "shrink",
                self.index,
                choices,
                &self.options.context,
            )
            .ok()
        };
        let related = || {
            let record = run().filter(|record| record.status == RunStatus::Completed)?;
            let context = &self.options.context;
            Some(with_relation(
                self.env,
                self.index,
                self.relation,
                record,
                context,
            ))
        };
        catch_unwind(AssertUnwindSafe(related)).ok().flatten()
    }

    /// Whether a run fails as required.
    fn fails(&self, record: &RunRecord) -> bool {
        let failed = signature(record);
        match self.options.property {
            Some(property) => failed.iter().any(|iri| is_named(iri, property)),
            None => failed == self.failed,
        }
    }

    /// Returns the names of the properties that failed in a run that passes: none, unless a single
    /// property was asked for and passes. Returns `None` if the run does not pass.
    fn passes(&self, record: &RunRecord) -> Option<Vec<String>> {
        let asked = |judgement: &&Judgement| {
            self.options
                .property
                .is_none_or(|name| is_named(&judgement.property, name))
        };
        let judgements = record.judgements.iter().flatten().filter(asked);
        let counts = Counts::of(judgements.map(|judgement| judgement.outcome));
        let passes = counts.passed > 0 && counts.passed + counts.inapplicable == counts.total();
        passes.then(|| {
            signature(record)
                .iter()
                .map(|iri| names::local(iri).to_owned())
                .collect()
        })
    }

    /// Keeps the passing values with which a run of these choices passes when it is replayed, at
    /// most `most` of them. Returns also the number of replays.
    fn confirmed(&self, explained: Explained, choices: &[Choice], most: u64) -> (Explained, u64) {
        let mut replays = 0;
        let mut confirm = |id: &Id, passing: Option<Passing>| {
            let passing = passing.filter(|_| replays < most)?;
            replays += 1;
            let record = self.complete(Choices::recorded(&with_value(
                choices.to_vec(),
                id,
                passing.value,
            )))?;
            self.passes(&record)
                .map(|others| Passing { others, ..passing })
        };
        let mut influences = explained.influences;
        for influence in &mut influences {
            let (below, above) = (influence.passes.0.take(), influence.passes.1.take());
            influence.passes = (confirm(&influence.id, below), confirm(&influence.id, above));
        }
        (Explained::of(influences), replays)
    }

    /// Whether an obstacle of the scene is in the way of the robot. Such a scene would fail for
    /// another reason.
    fn is_blocked(&self, mut choices: Choices) -> bool {
        let scene = scenario::draw(&self.env.space, self.env.test_of(self.index), &mut choices);
        scene.is_ok_and(|scene| scenario::is_blocked(&scene))
    }

    fn as_recorded(&self, list: &[Choice]) -> Tried {
        let result = match self.complete(Choices::recorded(list)) {
            Some(record) if self.fails(&record) => {
                TryResult::Fails(drop_rejected_tries(&record.choices))
            }
            Some(record) => self
                .passes(&record)
                .map_or(TryResult::Otherwise, TryResult::Passes),
            None => TryResult::Otherwise,
        };
        Tried {
            result,
            simulations: 1,
        }
    }

    /// Runs the scene of a list with the noise of a repetition. The noise does not depend on the
    /// scene.
    fn repetition(&self, list: &[Choice], number: u32) -> Option<RunRecord> {
        self.repeated(list, number)
            .filter(|record| self.fails(record))
    }

    /// As [`Self::repetition`], whether the run fails or not.
    fn repeated(&self, list: &[Choice], number: u32) -> Option<RunRecord> {
        let scene: Vec<Choice> = list
            .iter()
            .filter(|choice| !choice.name.is_noise())
            .cloned()
            .collect();
        // The campaign uses the streams from 0 up; these count down from the maximum.
        self.complete(Choices::partly_recorded(
            &scene,
            self.env.campaign.seed,
            u64::MAX - u64::from(number),
        ))
    }

    fn with_fresh_noise(&self, list: &[Choice]) -> Tried {
        let Some(Repeat { least, of }) = self.options.repeat else {
            return self.as_recorded(list);
        };
        let mut made = None;
        let (mut failures, mut simulations) = (0, 0);
        let mut others: Option<BTreeSet<String>> = Some(BTreeSet::new());
        for number in 0..of {
            simulations += 1;
            let record = self.repeated(list, number);
            // It passes if all of its repetitions do.
            others = others.and_then(|mut others| {
                others.extend(self.passes(record.as_ref()?)?);
                Some(others)
            });
            if let Some(record) = record.filter(|record| self.fails(record)) {
                failures += 1;
                made.get_or_insert(record.choices);
            }
            let left = of - number - 1;
            if failures >= least || (failures + left < least && others.is_none()) {
                break;
            }
        }
        let scene = |made: Vec<Choice>| {
            drop_rejected_tries(&made)
                .into_iter()
                .filter(|choice| !choice.name.is_noise())
                .collect::<Vec<_>>()
        };
        let result = match (made.filter(|_| failures >= least), others) {
            (Some(made), _) => TryResult::Fails(scene(made)),
            (None, Some(others)) => TryResult::Passes(others.into_iter().collect()),
            (None, None) => TryResult::Otherwise,
        };
        Tried {
            result,
            simulations,
        }
    }

    fn fresh_failures(&self, list: &[Choice]) -> (u32, u32) {
        let of = self.options.repeat.map_or(FRESH, |repeat| repeat.of);
        let failures = (0..of)
            .filter(|number| self.repetition(list, *number).is_some())
            .count();
        (u32::try_from(failures).unwrap_or(of), of)
    }

    /// Adds the first noise with which the scene fails to its choices, so that a single run
    /// reproduces the failure.
    fn with_failing_noise(&self, list: &[Choice]) -> Vec<Choice> {
        let of = self.options.repeat.map_or(1, |repeat| repeat.of);
        let failing = (0..of).find_map(|number| self.repetition(list, number));
        failing.map_or_else(
            || list.to_vec(),
            |record| drop_rejected_tries(&record.choices),
        )
    }
}

/// Checks that the run's candidates still exist.
fn check_candidates(env: &Env, index: u64, recorded: &[Choice]) -> Result<(), Diagnostics> {
    let mut choices = Choices::recorded(recorded);
    // Whether the scene can be built is checked by making the run again.
    let _ = scenario::draw(&env.space, env.test_of(index), &mut choices);
    let mut faults = Diagnostics::new();
    for made in choices.made() {
        let was = recorded
            .iter()
            .find(|choice| choice.name == made.name)
            .and_then(Choice::candidate);
        if let (Some(was), ChoiceKind::Candidate { names }) = (was, &made.kind)
            && made.candidate() != Some(was)
        {
            let message = format!(
                "the run's scene can no longer be built: `{}` can't be `{was}` now",
                made.name
            );
            let help = format!(
                "add it to the configuration again; candidates there: {}",
                names.join(", ")
            );
            faults.push(Diagnostic::error("S051", message).help(help));
        }
    }
    faults.or(())
}

/// Makes the run again.
fn remake(
    env: &Env,
    index: u64,
    recorded: &[Choice],
    options: &ShrinkOptions<'_>,
) -> Result<RunRecord, Diagnostics> {
    run_line(
        env,
        "shrink",
        index,
        Choices::recorded(recorded),
        &options.context,
    )
    .map_err(|failure| {
        Diagnostic::error(
            "S051",
            format!("the run's scene can no longer be built: {failure}"),
        )
        .help("models, robot or program have changed since the run was made")
        .into()
    })
}

/// The run with the judgement of a relation instead of its own, if one is asked for.
fn with_relation(
    env: &Env,
    index: u64,
    relation: Option<SceneChange>,
    mut record: RunRecord,
    context: &RunContext,
) -> RunRecord {
    if let Some(change) = relation {
        let judgement = judge_related(env, &record, index, change, context);
        record.judgements = vec![judgement.into_iter().collect()];
    }
    record
}

fn signature(record: &RunRecord) -> BTreeSet<String> {
    let failed = record
        .judgements
        .iter()
        .flatten()
        .filter(|judgement| judgement.outcome == Outcome::Failed);
    failed.map(|judgement| judgement.property.clone()).collect()
}

fn is_named(iri: &str, name: &str) -> bool {
    iri == name || names::local(iri) == name
}

/// Number of choices that are not nominal, without those that only set the number of objects.
fn special(list: &[Choice]) -> usize {
    list.iter()
        .filter(|choice| {
            choice.value != choice.kind.nominal() && group(list, &choice.name).is_some()
        })
        .count()
}

fn left_out(object: PlacedObject) -> Choice {
    let name = ChoiceName::Object(object, ObjectAxis::LeftOut);
    Choice {
        name,
        kind: ChoiceKind::Index { of: 2 },
        value: 1.0,
    }
}

/// Removals of each object except target and platform: first the objects that moved, farthest
/// first, then those nearest to the target.
fn removals(record: &RunRecord, recorded: &[Choice]) -> Vec<Choice> {
    let models = recorded
        .iter()
        .filter(|choice| matches!(choice.name, ChoiceName::Object(_, ObjectAxis::Model)));
    let left = models
        .filter_map(|choice| choice.name.numbered_object())
        .map(left_out)
        .filter(|removal| !has(recorded, removal));
    let objects = &record.scene.objects;
    let target = objects
        .iter()
        .find(|object| object.role == Role::Target)
        .map(|object| object.pose.position);
    let others = objects.iter().filter(|object| object.role.is_bystander());
    let mut ranked: Vec<(f64, f64, Choice)> = left
        .zip(others)
        .map(|(removal, object)| {
            let courses = record
                .trace
                .actions
                .iter()
                .flat_map(|action| &action.extremes);
            let moved = courses
                .filter(|course| course.id == object.id)
                .map(|course| course.max_displacement_m);
            let moved = Some(moved.fold(0.0, f64::max))
                .filter(|moved| *moved > MOVED_M)
                .unwrap_or(0.0);
            let [x, y, _] = object.pose.position;
            let away = target.map_or(0.0, |target| libm::hypot(x - target[0], y - target[1]));
            (moved, away, removal)
        })
        .collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.total_cmp(&b.1)));
    ranked.into_iter().map(|(.., removal)| removal).collect()
}

/// Choices that leave out the last actions, most actions first.
fn ends(env: &Env, index: u64) -> Vec<Choice> {
    let of = env.campaign.tests[env.test_of(index)].len();
    let end = |left_out: usize| Choice {
        name: ChoiceName::ActionsLeftOut,
        kind: ChoiceKind::Index { of },
        value: left_out as f64,
    };
    (1..of).rev().map(end).collect()
}

/// Group of choices that become nominal together. Returns `None` for numbers of objects, and for
/// the choices of objects that are left out.
fn group(list: &[Choice], name: &ChoiceName) -> Option<ChoiceGroup> {
    let gone = name
        .numbered_object()
        .is_some_and(|object| has(list, &left_out(object)));
    if gone { None } else { name.group() }
}
