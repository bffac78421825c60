//! Tries lists of choices within limits, on several workers, each list once.

use std::collections::{BTreeMap, BTreeSet};

use rayon::ThreadPool;
use rayon::prelude::{IntoParallelRefIterator, ParallelIterator};

use crate::workers::workers;
use actcheck_data::{Choice, ChoiceName};

/// The result of a try.
#[derive(Debug, Clone, PartialEq)]
pub struct Tried {
    /// The result.
    pub result: TryResult,
    /// Number of simulations.
    pub simulations: u64,
}

/// How a tried list ended. A list that does not fail as required does not pass for that reason
/// alone: it may fail in another way, or not be a run at all.
#[derive(Debug, Clone, PartialEq)]
pub enum TryResult {
    /// It failed as required; the choices that the run made, without unused ones.
    Fails(Vec<Choice>),
    /// It passed. The names of properties that failed although they are not asked for.
    Passes(Vec<String>),
    /// It failed in another way, broke, timed out, tested nothing, or its scene can't be built.
    Otherwise,
}

impl TryResult {
    /// Returns the choices of a run that failed as required.
    pub fn made(self) -> Option<Vec<Choice>> {
        match self {
            Self::Fails(made) => Some(made),
            Self::Passes(_) | Self::Otherwise => None,
        }
    }
}

/// Limits of a search.
pub struct TrialLimits<'a> {
    /// Maximum number of simulations; the last try may exceed it.
    pub simulations: u64,
    /// Workers; the result does not depend on their number.
    pub jobs: usize,
    /// Whether the time is up or the user has interrupted.
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

/// Names and value bits of a list.
type Key = Vec<(ChoiceName, u64)>;

/// Tries lists and caches the results. Results that a single worker would not have computed count
/// only once they are used.
pub struct TrialSearch<'a> {
    test: &'a (dyn Fn(&[Choice]) -> Tried + Sync),
    limits: TrialLimits<'a>,
    pool: Option<ThreadPool>,
    known: BTreeMap<Key, Tried>,
    counted: BTreeSet<Key>,
    simulations: u64,
}

impl<'a> TrialSearch<'a> {
    /// Creates a search with an empty cache.
    pub fn new(test: &'a (dyn Fn(&[Choice]) -> Tried + Sync), limits: TrialLimits<'a>) -> Self {
        let several = limits.jobs > 1;
        // Without a thread pool, this thread does the work: slower, but with the same result.
        let pool = several.then(|| workers(limits.jobs).ok()).flatten();
        Self {
            test,
            limits,
            pool,
            known: BTreeMap::new(),
            counted: BTreeSet::new(),
            simulations: 0,
        }
    }

    /// Number of simulations so far.
    pub fn simulations(&self) -> u64 {
        self.simulations
    }

    /// Whether a limit is reached.
    pub fn spent(&self) -> bool {
        self.simulations >= self.limits.simulations || (self.limits.stop)()
    }

    /// Returns the position of the first failing list and the choices that its run made, or `None`
    /// if no list fails or a limit is reached.
    pub fn first(&mut self, lists: &[Vec<Choice>]) -> Option<(usize, Vec<Choice>)> {
        for (number, batch) in lists.chunks(self.limits.jobs.max(1)).enumerate() {
            if !self.learn(batch) {
                return None;
            }
            for (at, list) in batch.iter().enumerate() {
                if let Some(made) = self.count(list)?.made() {
                    return Some((number * self.limits.jobs.max(1) + at, made));
                }
            }
        }
        None
    }

    /// Returns the result of each list; `None` for lists beyond the limits.
    pub fn each(&mut self, lists: &[Vec<Choice>]) -> Vec<Option<TryResult>> {
        let mut answers = Vec::with_capacity(lists.len());
        for batch in lists.chunks(self.limits.jobs.max(1)) {
            let learned = self.learn(batch);
            for list in batch {
                answers.push(if learned { self.count(list) } else { None });
            }
        }
        answers
    }

    /// Tries the unknown lists of a batch. Returns `false` if a limit is reached.
    fn learn(&mut self, batch: &[Vec<Choice>]) -> bool {
        let unknown: BTreeMap<Key, &Vec<Choice>> = batch
            .iter()
            .map(|list| (key(list), list))
            .filter(|(key, _)| !self.known.contains_key(key))
            .collect();
        if unknown.is_empty() {
            return true;
        }
        if self.spent() {
            return false;
        }
        let unknown: Vec<(Key, &Vec<Choice>)> = unknown.into_iter().collect();
        let test = self.test;
        let tried: Vec<Tried> = match &self.pool {
            Some(pool) => pool.install(|| unknown.par_iter().map(|(_, list)| test(list)).collect()),
            None => unknown.iter().map(|(_, list)| test(list)).collect(),
        };
        self.known
            .extend(unknown.into_iter().map(|(key, _)| key).zip(tried));
        true
    }

    /// Returns the result of a known list and counts it. Returns `None` if the limit was reached
    /// before.
    fn count(&mut self, list: &[Choice]) -> Option<TryResult> {
        let key = key(list);
        let tried = self.known.get(&key)?;
        if !self.counted.contains(&key) {
            if self.simulations >= self.limits.simulations {
                return None;
            }
            self.simulations += tried.simulations;
            self.counted.insert(key);
        }
        Some(tried.result.clone())
    }
}

fn key(list: &[Choice]) -> Key {
    list.iter()
        .map(|choice| (choice.name.clone(), choice.value.to_bits()))
        .collect()
}
