//! `actcheck report --html`: gathers what the page shows.

use std::collections::BTreeMap;

use crate::base::Diagnostics;
use crate::cli::analyse::{Analysed, Question, analysed};
use crate::cli::clock;
use crate::cli::report::ReportArgs;
use crate::history::{History, RunDetail, Trace};
use crate::ontology::Ontology;
use crate::report::{Explained, HTML_COLUMNS, HtmlReport, PropertyWords, Replays, html, replay_order};
use crate::rules::{Budget, RuleBook};
use crate::verdict::Outcome;

/// Patterns have at most so many conditions, and a chance of so much to be false, as `actcheck analyse` has them by default.
const DEPTH: u8 = 3;
const LEVEL: f64 = 0.05;
/// Letters that stand for bytes take a third more room.
const BYTES_IN_A_MB: f64 = 1e6;

/// Runs that a worker reads before they are packed.
const RUNS_OF_A_WORKER: usize = 8;

/// A run with its trace and what explains its failures.
type Watched = (RunDetail, Option<Trace>, Vec<Explained>);

/// The whole page.
///
/// # Errors
/// The history has no such runs, or can't be read.
pub(super) fn page(args: &ReportArgs, history: &History) -> Result<String, Diagnostics> {
    let asked = Question {
        chosen: &args.chosen,
        property: &args.property,
        by: &[],
        usual_maps: true,
        depth: DEPTH,
        level: LEVEL,
    };
    let Analysed { table, summary, ontology } = analysed(&asked, history, &HTML_COLUMNS)?;
    let order = replay_order(&summary, &table);
    let replays = replays(history, &ontology, &order, args.replay_mb * BYTES_IN_A_MB)?;
    Ok(html(&HtmlReport {
        version: env!("CARGO_PKG_VERSION"),
        made: &(clock::system().now)(),
        findings: &summary,
        table: &table,
        campaigns: &history.campaigns()?,
        words: &words(&ontology),
        replays: &replays,
    }))
}

fn words(ontology: &Ontology) -> BTreeMap<String, PropertyWords> {
    let told = |property: &crate::ontology::Property| PropertyWords {
        label: property.label.clone(),
        comment: property.comment.clone(),
        rule: property.rule.path.clone(),
    };
    ontology.properties.iter().map(|(iri, property)| (iri.clone(), told(property))).collect()
}

/// As many runs as there is room for: what they are read and explained with takes most of the time, so it is shared out.
fn replays(history: &History, ontology: &Ontology, order: &[String], room: f64) -> Result<Replays, Diagnostics> {
    let mut replays = Replays::default();
    if room <= 0.0 || order.is_empty() {
        return Ok(replays);
    }
    let budget = Budget::default();
    // Rules that can't be read today explain nothing; the outcomes are those of the history.
    let rules = RuleBook::prepare_within(ontology, &budget).ok();
    let read = |id: &String| -> Result<Watched, Diagnostics> {
        let run = history.run(id)?;
        // A run that was broken before its first state has no trace; all else is told of it.
        let trace = history.trace(id).ok();
        let explained = rules.as_ref().map(|rules| explained(history, rules, &run, &budget)).unwrap_or_default();
        Ok((run, trace, explained))
    };
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    for runs in order.chunks(workers * RUNS_OF_A_WORKER) {
        let shares: Vec<Vec<Result<Watched, Diagnostics>>> = std::thread::scope(|scope| {
            let share = |runs: &'_ [String]| runs.iter().map(read).collect();
            let started: Vec<_> = runs.chunks(RUNS_OF_A_WORKER).map(|runs| scope.spawn(move || share(runs))).collect();
            started
                .into_iter()
                .map(|share| share.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
                .collect()
        });
        for watched in shares.into_iter().flatten() {
            if replays.bytes() as f64 >= room {
                return Ok(replays);
            }
            let (run, trace, explained) = watched?;
            replays.add(&run, trace.as_ref(), &explained);
        }
    }
    Ok(replays)
}

/// Why the failed properties of a run failed. What today's rules can't explain is left out.
pub(super) fn explained(history: &History, rules: &RuleBook, run: &RunDetail, budget: &Budget) -> Vec<Explained> {
    let Ok(facts) = history.facts(&run.row.run) else { return Vec::new() };
    let mut found = Vec::new();
    for (idx, action) in run.actions.iter().enumerate() {
        let Some(seen) = facts.action(idx) else { continue };
        for judgement in action.judgements.iter().filter(|judgement| judgement.outcome == Outcome::Failed) {
            if let Ok(explanation) = rules.explain(&seen, &judgement.property, budget) {
                let (step, property) = (action.step, judgement.property.clone());
                found.push(Explained { step, property, text: explanation.to_text() });
            }
        }
    }
    found
}
