//! The runs that count in rates, of the store and of outlines together: see [`crate::counted`].

use std::collections::{BTreeMap, BTreeSet, HashMap};

use oxigraph::model::Term;

use crate::RunRow;
use crate::read::id_of;
use crate::statements::iri;
use crate::vertical::column::{Column, Value};
use crate::vertical::join::FileColumns;
use crate::vertical::sheet::Pairs;
use crate::vertical::stop::Stop;
use actcheck_base::{Digest, names};

/// A set of numbers of runs.
#[derive(Debug, Default)]
pub(crate) struct RunBits(Vec<u64>);

impl RunBits {
    pub(super) fn has(&self, number: u64) -> bool {
        let word = usize::try_from(number / 64)
            .ok()
            .and_then(|word| self.0.get(word));
        word.is_some_and(|word| word >> (number % 64) & 1 == 1)
    }

    fn insert(&mut self, number: u64) {
        // Numbers of runs are below the number of runs that a campaign can have.
        let Ok(word) = usize::try_from(number / 64) else {
            return;
        };
        if word >= self.0.len() {
            self.0.resize(word + 1, 0);
        }
        self.0[word] |= 1 << (number % 64);
    }
}

/// The runs that count.
#[derive(Debug, Default)]
pub(crate) struct Counts {
    /// Outlines, by the IRI of the run without its number.
    outlines: HashMap<String, RunBits>,
    /// Ids of other runs.
    stored: BTreeSet<String>,
}

impl Counts {
    pub(super) fn of_base(&self, base: &str) -> Option<&RunBits> {
        self.outlines.get(base)
    }

    /// Whether a run counts, by its id.
    pub(crate) fn has(&self, id: &str) -> bool {
        let outlined = || {
            let (campaign, number) = id.rsplit_once('-')?;
            Some(
                self.outlines
                    .get(&format!("{}{campaign}-", names::RUN))?
                    .has(number.parse().ok()?),
            )
        };
        self.stored.contains(id) || outlined() == Some(true)
    }
}

/// The properties that are read.
pub(super) fn properties() -> [String; 3] {
    ["act:campaign", "act:index", "act:traceHash"].map(|name| iri(name).into_string())
}

/// A run with its trace.
pub(super) struct Traced {
    hash: u128,
    campaign: String,
    index: u64,
    base: String,
    number: u64,
}

/// The digest of a trace as a number; `None` for a run without one.
fn hash(text: &str) -> Option<u128> {
    if text.is_empty() {
        return None;
    }
    u128::from_str_radix(text, 16)
        .ok()
        .filter(|_| text.len() == 32)
        .or_else(|| {
            let mut digest = Digest::new();
            digest.update(text.as_bytes());
            u128::from_str_radix(&digest.finish(), 16).ok()
        })
}

/// The runs of a file with their traces.
pub(super) fn traced(
    file: &FileColumns,
    is_left_out: impl Fn(u64) -> bool,
) -> Result<Vec<Traced>, Stop> {
    let [campaign, index, trace] = properties();
    let mut rows: BTreeMap<u32, [Option<Value>; 3]> = BTreeMap::new();
    for (at, property) in [campaign, index, trace].iter().enumerate() {
        let Some((
            _,
            Pairs {
                subjects,
                column: Column::Values { values, codes },
            },
        )) = file.column(property)
        else {
            continue;
        };
        for (subject, code) in subjects.iter().zip(codes) {
            rows.entry(*subject).or_default()[at] = values.get(*code as usize).cloned();
        }
    }
    let mut found = Vec::new();
    for (node, row) in rows {
        let run = file.run_of(node);
        let number = file.nodes.numbers[run];
        if file.node_of_run(run) != Some(node) || is_left_out(number) {
            continue;
        }
        if let [
            Some(Value::Term(campaign)),
            Some(Value::Integer(index)),
            Some(Value::Term(Term::Literal(trace))),
        ] = row
        {
            found.push(Traced {
                hash: hash(trace.value()).unwrap_or_default(),
                campaign: id_of(&campaign),
                index: u64::try_from(index).unwrap_or_default(),
                base: file.nodes.base.clone(),
                number,
            });
        }
    }
    Ok(found)
}

/// Finds the runs that count.
pub(super) struct Counter<'a> {
    selected: &'a BTreeSet<String>,
    /// Position of each campaign in the order of their starts.
    ranks: HashMap<&'a str, i64>,
    bases: Vec<String>,
    entries: Vec<Entry>,
}

/// A run: by digest, campaign and index; and which it is.
type Entry = (u128, i64, u64, Which);

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Which {
    Outline { base: u32, number: u64 },
    Stored(u32),
}

impl<'a> Counter<'a> {
    /// `campaigns`: sorted by their start.
    pub(super) fn new(selected: &'a BTreeSet<String>, campaigns: &'a [String]) -> Self {
        let ranks = campaigns.iter().map(String::as_str).zip(0..).collect();
        Self {
            selected,
            ranks,
            bases: Vec::new(),
            entries: Vec::new(),
        }
    }

    pub(super) fn add(&mut self, runs: Vec<Traced>) {
        for run in runs {
            if self.selected.contains(&run.campaign) {
                continue;
            }
            if self.bases.last() != Some(&run.base) {
                self.bases.push(run.base);
            }
            let rank = self.ranks.get(run.campaign.as_str()).copied().unwrap_or(-1);
            let which = Which::Outline {
                base: self.bases.len() as u32 - 1,
                number: run.number,
            };
            self.entries.push((run.hash, rank, run.index, which));
        }
    }

    /// The runs that count, with those of the store.
    pub(super) fn finish(mut self, stored: &[RunRow]) -> Counts {
        for (at, run) in (0..).zip(stored) {
            if !self.selected.contains(&run.campaign) {
                let rank = self.ranks.get(run.campaign.as_str()).copied().unwrap_or(-1);
                self.entries.push((
                    hash(&run.trace_hash).unwrap_or_default(),
                    rank,
                    run.index,
                    Which::Stored(at),
                ));
            }
        }
        self.entries.sort_unstable();
        let mut counts = Counts::default();
        for (at, (hash, _, _, which)) in self.entries.iter().enumerate() {
            let is_last = self
                .entries
                .get(at + 1)
                .is_none_or(|(next, ..)| next != hash);
            // A run without a trace is never a duplicate.
            if !is_last && *hash != 0 {
                continue;
            }
            match which {
                Which::Outline { base, number } => {
                    counts
                        .outlines
                        .entry(self.bases[*base as usize].clone())
                        .or_default()
                        .insert(*number);
                }
                Which::Stored(at) => drop(counts.stored.insert(stored[*at as usize].run.clone())),
            }
        }
        counts
    }
}
