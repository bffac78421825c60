//! Tries lists of choices: each one once, within limits, on several workers.

use std::collections::{BTreeMap, BTreeSet};

use rayon::ThreadPool;
use rayon::prelude::{IntoParallelRefIterator, ParallelIterator};

use crate::base::Choice;

/// What came of one try.
#[derive(Debug, Clone, PartialEq)]
pub struct Tried {
    /// Where it failed as it should: the choices that were made, those that nobody asked for left out.
    pub made: Option<Vec<Choice>>,
    /// What it cost.
    pub simulations: u64,
}

/// When to stop.
pub struct Limits<'a> {
    /// Simulations, the last try's excess aside.
    pub simulations: u64,
    /// Workers; what is found does not depend on it.
    pub jobs: usize,
    /// Whether time is up or somebody asked to stop.
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

/// Names and bits of the values of a list.
type Key = Vec<(String, u64)>;

/// Tries and remembers. Tries that a single worker would not have made are kept for later, and count only then.
pub struct Search<'a> {
    test: &'a (dyn Fn(&[Choice]) -> Tried + Sync),
    limits: Limits<'a>,
    workers: Option<ThreadPool>,
    known: BTreeMap<Key, Tried>,
    counted: BTreeSet<Key>,
    simulations: u64,
}

impl<'a> Search<'a> {
    /// A search that has tried nothing yet.
    pub fn new(test: &'a (dyn Fn(&[Choice]) -> Tried + Sync), limits: Limits<'a>) -> Self {
        let several = limits.jobs > 1;
        // Where no workers can be started, the work is done here: only slower.
        let workers = several.then(|| rayon::ThreadPoolBuilder::new().num_threads(limits.jobs).build().ok()).flatten();
        Self { test, limits, workers, known: BTreeMap::new(), counted: BTreeSet::new(), simulations: 0 }
    }

    /// What all tries have cost.
    pub fn simulations(&self) -> u64 {
        self.simulations
    }

    /// Whether nothing more may be tried.
    pub fn spent(&self) -> bool {
        self.simulations >= self.limits.simulations || (self.limits.stop)()
    }

    /// The first list, in order, that fails, with the choices that it made. Nothing where none does or limits end it.
    pub fn first(&mut self, lists: &[Vec<Choice>]) -> Option<(usize, Vec<Choice>)> {
        for (number, batch) in lists.chunks(self.limits.jobs.max(1)).enumerate() {
            if !self.learn(batch) {
                return None;
            }
            for (at, list) in batch.iter().enumerate() {
                if let Some(made) = self.count(list)? {
                    return Some((number * self.limits.jobs.max(1) + at, made));
                }
            }
        }
        None
    }

    /// For each list whether it fails; nothing for those that limits left out.
    pub fn each(&mut self, lists: &[Vec<Choice>]) -> Vec<Option<bool>> {
        let mut answers = Vec::with_capacity(lists.len());
        for batch in lists.chunks(self.limits.jobs.max(1)) {
            let learned = self.learn(batch);
            for list in batch {
                answers.push(if learned { self.count(list).map(|made| made.is_some()) } else { None });
            }
        }
        answers
    }

    /// Tries what is not known of a batch. False where limits forbid it.
    fn learn(&mut self, batch: &[Vec<Choice>]) -> bool {
        let unknown: BTreeMap<Key, &Vec<Choice>> =
            batch.iter().map(|list| (key(list), list)).filter(|(key, _)| !self.known.contains_key(key)).collect();
        if unknown.is_empty() {
            return true;
        }
        if self.spent() {
            return false;
        }
        let unknown: Vec<(Key, &Vec<Choice>)> = unknown.into_iter().collect();
        let test = self.test;
        let tried: Vec<Tried> = match &self.workers {
            Some(workers) => workers.install(|| unknown.par_iter().map(|(_, list)| test(list)).collect()),
            None => unknown.iter().map(|(_, list)| test(list)).collect(),
        };
        self.known.extend(unknown.into_iter().map(|(key, _)| key).zip(tried));
        true
    }

    /// What a known list did, counted as tried. Nothing where the limit was reached before it.
    fn count(&mut self, list: &[Choice]) -> Option<Option<Vec<Choice>>> {
        let key = key(list);
        let tried = self.known.get(&key)?;
        if !self.counted.contains(&key) {
            if self.simulations >= self.limits.simulations {
                return None;
            }
            self.simulations += tried.simulations;
            self.counted.insert(key);
        }
        Some(tried.made.clone())
    }
}

fn key(list: &[Choice]) -> Key {
    list.iter().map(|choice| (choice.name.clone(), choice.value.to_bits())).collect()
}
