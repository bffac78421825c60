//! Runs the scenes of a campaign a second time with a change, and judges both runs together by the
//! configuration's relations (metamorphic properties).

mod change;
mod rules;

use std::collections::{BTreeMap, BTreeSet};

use crate::run_cases::end_of_all;
use crate::{Env, Failure, RunContext, on_workers, run_line};
use actcheck_base::{Diagnostics, Judgement, Outcome, names};
use actcheck_config::SceneChange;
use actcheck_data::Choice;
use actcheck_history::{
    History, RELATED, RelatedPair, RelatedRuns, RunFilter, RunRecord, RunRow, RunStatus,
};
pub(super) use rules::{RelationRules, Verdict};

/// Pairs that are made before the first of them is stored.
const AT_ONCE: usize = 64;

/// How pairs are made.
pub struct RelateOptions<'a> {
    /// Number of runs with partners, the first ones of the campaign; `None`: all.
    pub runs: Option<usize>,
    /// The only relation whose pairs are made; `None`: all.
    pub only: Option<&'a str>,
    /// Number of workers; does not affect results.
    pub jobs: usize,
    /// How runs are made.
    pub context: RunContext,
    /// Whether the user has interrupted.
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

/// A pair whose second run is to be made.
struct PairToMake<'a> {
    row: &'a RunRow,
    change: SceneChange,
}

/// A second run, or why there is none.
type SecondRun = Result<Box<RunRecord>, String>;

/// Makes the missing second runs of a campaign's runs, stores them in a campaign of their own,
/// judges all pairs by the present rules, and stores the results beside the campaign.
///
/// The results do not depend on the number of workers. `on_pair` is called for each pair that was
/// made. After an interrupt, the pairs made so far are judged and stored.
///
/// # Errors
/// The history can't be read or written, or a run's choices were not kept.
pub fn relate(
    env: &Env,
    history: &History,
    campaign: &str,
    options: &RelateOptions<'_>,
    on_pair: impl Fn() + Sync,
) -> Result<RelatedRuns, Diagnostics> {
    let filter = RunFilter {
        campaign: Some(campaign.to_owned()),
        status: Some(RunStatus::Completed),
        ..RunFilter::default()
    };
    let mut rows = history.runs(&filter)?;
    rows.sort_by_key(|row| row.index);
    rows.truncate(options.runs.unwrap_or(usize::MAX));
    let known = history
        .related(campaign)?
        .map_or_else(Vec::new, |known| known.pairs);
    let is_known = |run: &str, change: SceneChange| {
        known
            .iter()
            .any(|pair| pair.run == run && pair.relation == change.word())
    };
    let orders: Vec<PairToMake<'_>> = rows
        .iter()
        .flat_map(|row| {
            let changes = env
                .campaign
                .relations
                .iter()
                .map(|relation| relation.change);
            changes.map(move |change| PairToMake { row, change })
        })
        .filter(|order| options.only.is_none_or(|only| only == order.change.word()))
        .filter(|order| !is_known(&order.row.run, order.change))
        .collect();
    let mut pairs = known;
    if !orders.is_empty() {
        make(
            env,
            history,
            (campaign, &orders),
            options,
            &on_pair,
            &mut pairs,
        )?;
    }
    let wanted: BTreeSet<&str> = rows.iter().map(|row| row.run.as_str()).collect();
    let related = RelatedRuns {
        campaign: campaign.to_owned(),
        pairs: judged(env, history, campaign, pairs)?,
    };
    history.store_related(&related)?;
    let pairs = related.pairs.into_iter();
    Ok(RelatedRuns {
        pairs: pairs
            .filter(|pair| wanted.contains(pair.run.as_str()))
            .filter(|pair| is_of(env, pair).is_some())
            .collect(),
        ..related
    })
}

/// Makes second runs, and adds their pairs.
fn make(
    env: &Env,
    history: &History,
    (campaign, orders): (&str, &[PairToMake<'_>]),
    options: &RelateOptions<'_>,
    on_pair: &(impl Fn() + Sync),
    pairs: &mut Vec<RelatedPair>,
) -> Result<(), Diagnostics> {
    let clock = options.context.clock;
    let digest = actcheck_base::digest_of(&env.campaign.source.text);
    let id = history.next_campaign_id(&digest, env.campaign.seed)?;
    let mut record = env.record(id.clone(), format!("{RELATED}{campaign}"), (clock.now)());
    (record.planned_runs, record.repeat) = (orders.len() as u64, 1);
    record.shards.clear();
    let mut stored: Vec<RunRecord> = Vec::new();
    let mut n_made = 0;
    for some in orders.chunks(AT_ONCE) {
        if (options.stop)() {
            break;
        }
        let made = on_workers(options.jobs, some, |order| {
            let made = second_run(env, history, &id, order, &options.context);
            on_pair();
            made
        })?;
        for (order, made) in some.iter().zip(made) {
            let mut pair = RelatedPair {
                relation: order.change.word().to_owned(),
                run: order.row.run.clone(),
                second: None,
                outcome: Outcome::Inapplicable,
                margin: None,
                witness: String::new(),
            };
            match made? {
                Some(Ok(mut run)) => {
                    if stored.is_empty() {
                        history.begin_campaign(&record)?;
                    }
                    run.index = stored.len() as u64;
                    run.id = format!("{id}-{}", run.index + 1);
                    history.commit(&run)?;
                    pair.second = Some(run.id.clone());
                    stored.push(without_motion(*run));
                }
                Some(Err(reason)) => pair.witness = reason,
                // Interrupted: it is made the next time.
                None => continue,
            }
            n_made += 1;
            pairs.push(pair);
        }
    }
    if !stored.is_empty() {
        let end = end_of_all(&stored, (clock.now)(), n_made < orders.len());
        history.finish_campaign(&id, &end)?;
    }
    Ok(())
}

/// The run without its motion: a campaign's end counts only its outcomes.
fn without_motion(run: RunRecord) -> RunRecord {
    RunRecord {
        trace: Default::default(),
        facts: Default::default(),
        ..run
    }
}

/// Makes the second run of a pair; `None` if it was interrupted.
fn second_run(
    env: &Env,
    history: &History,
    id: &str,
    order: &PairToMake<'_>,
    context: &RunContext,
) -> Result<Option<SecondRun>, Diagnostics> {
    let recorded = history.traces().choices(&order.row.run)?;
    let index = env.index_of(&order.row.test, &recorded)?;
    Ok(made(env, id, (index, &recorded), order.change, context))
}

fn made(
    env: &Env,
    id: &str,
    (index, recorded): (u64, &[Choice]),
    change: SceneChange,
    context: &RunContext,
) -> Option<SecondRun> {
    let list = match change::changed(env, index, recorded, change) {
        Ok(list) => list,
        Err(reason) => return Some(Err(reason)),
    };
    let choices = actcheck_data::Choices::recorded(&list);
    match run_line(env, id, index, choices, context) {
        Ok(run) => Some(Ok(Box::new(run))),
        Err(Failure::Interrupted) => None,
        Err(failure) => Some(Err(format!("the changed scene can't be built: {failure}"))),
    }
}

/// Judges all pairs by the present rules and the newest outcomes of both runs.
fn judged(
    env: &Env,
    history: &History,
    campaign: &str,
    mut pairs: Vec<RelatedPair>,
) -> Result<Vec<RelatedPair>, Diagnostics> {
    let Some(rules) = &env.relations else {
        return Ok(pairs);
    };
    let second = pairs.iter().filter_map(|pair| pair.second.as_deref());
    let campaigns: BTreeSet<String> = second
        .filter_map(|run| Some(run.rsplit_once('-')?.0.to_owned()))
        .chain([campaign.to_owned()])
        .collect();
    let mut verdicts: BTreeMap<String, Vec<Verdict>> = BTreeMap::new();
    for campaign in campaigns {
        let filter = RunFilter {
            campaign: Some(campaign),
            ..RunFilter::default()
        };
        for row in history.outcomes(&filter)? {
            let verdict = Verdict {
                step: row.step,
                property: row.property,
                outcome: row.outcome,
                margin: row.margin,
            };
            verdicts.entry(row.run).or_default().push(verdict);
        }
    }
    let of = |run: &str| verdicts.get(run).map_or(&[][..], Vec::as_slice);
    for pair in &mut pairs {
        let (Some(second), Some(change)) = (&pair.second, is_of(env, pair)) else {
            continue;
        };
        if let Some(judgement) = rules.judge(change, [of(&pair.run), of(second)]) {
            pair.outcome = judgement.outcome;
            pair.margin = judgement.margin;
            pair.witness = judgement.witness;
        }
    }
    Ok(pairs)
}

/// The change of a pair, if the configuration still has its relation.
fn is_of(env: &Env, pair: &RelatedPair) -> Option<SceneChange> {
    let change = SceneChange::by_word(&pair.relation)?;
    let relations = &env.campaign.relations;
    relations
        .iter()
        .any(|relation| relation.change == change)
        .then_some(change)
}

/// Returns the change of the relation with this name, if the configuration has it.
pub(super) fn relation_called(env: &Env, name: &str) -> Option<SceneChange> {
    let mut changes = env
        .campaign
        .relations
        .iter()
        .map(|relation| relation.change);
    changes.find(|change| change.word() == name || names::act(change.word()) == name)
}

/// Makes the second run of a run that is not stored, and judges the pair. Returns `None` if it was
/// interrupted or can't be made.
pub(super) fn judge_related(
    env: &Env,
    first: &RunRecord,
    index: u64,
    change: SceneChange,
    context: &RunContext,
) -> Option<Judgement> {
    let rules = env.relations.as_ref()?;
    let second = made(
        env,
        &first.campaign,
        (index, &first.choices),
        change,
        context,
    )?
    .ok()?;
    rules.judge(change, [&verdicts_of(first), &verdicts_of(&second)])
}

fn verdicts_of(run: &RunRecord) -> Vec<Verdict> {
    let steps = (1..).zip(&run.judgements);
    let verdicts = steps.flat_map(|(step, judgements)| {
        judgements.iter().map(move |judgement| Verdict {
            step,
            property: judgement.property.clone(),
            outcome: judgement.outcome,
            margin: judgement.margin,
        })
    });
    verdicts.collect()
}
