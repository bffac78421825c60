//! `actcheck compare --html` and `--markdown`: a comparison with its flipped runs.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;

use crate::appearance::AppearanceReader;
use crate::compare::{CompareArgs, Histories, Side};
use crate::options::BYTES_IN_A_MB;
use crate::report_html::words;
use crate::why::ontology_file;
use crate::{clock, output_file, replayed_runs, restore};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_data::Role;
use actcheck_history::{History, RunDetail};
use actcheck_ontology::{self as ontology, Ontology};
use actcheck_report::{
    CompareSummary, ReplayedRun, Replays, Review, ReviewPage, ReviewPair, ReviewRun, divergence,
    review_html, review_markdown,
};

/// Maximum number of flipped scenes that are shown in detail.
const MOST_PAIRS: usize = 40;
/// Number of scenes that are read at once.
const AT_ONCE: usize = 8;

/// Writes the requested files. Returns the text to print in place of the usual one, if one was
/// requested.
///
/// # Errors
/// A history or the ontology can't be read, or a file can't be written.
pub(super) fn write(
    args: &CompareArgs,
    summary: &CompareSummary,
    sides: [&Side; 2],
    histories: &Histories,
) -> Result<Option<String>, Diagnostics> {
    if args.html.is_none() && args.markdown.is_none() {
        return Ok(None);
    }
    let printed = [&args.html, &args.markdown].into_iter().flatten();
    if printed.filter(|file| file.as_os_str() == "-").count() > 1 {
        let fault = Diagnostic::error("X058", "both `--html` and `--markdown` would be printed");
        return Err(fault.help("name a file for one of them").into());
    }
    let (files, path) = ontology_file(None);
    let ontology = ontology::load(&files, &path)?;
    let mut flips = Flips {
        pairs: BTreeMap::new(),
        replays: Replays::default(),
        room: args
            .html
            .as_ref()
            .map_or(0.0, |_| args.replay_mb * BYTES_IN_A_MB),
        is_trusted: args.trust.trust,
    };
    let read = sides.map(|side| histories.of(side));
    if let [Some(first), Some(second)] = read {
        flips.read(&ontology, [first, second], &examples(summary))?;
    }
    let review = Review {
        summary,
        pairs: &flips.pairs,
    };
    if let Some(file) = &args.html {
        let properties = ontology.properties.iter();
        let units = properties
            .filter_map(|(iri, property)| Some((iri.clone(), property.unit.clone()?)))
            .collect();
        let page = review_html(&ReviewPage {
            version: env!("CARGO_PKG_VERSION"),
            made: &(clock::system().now)(),
            review: &review,
            words: &words(&ontology),
            units: &units,
            replays: &flips.replays,
        });
        if file.as_os_str() == "-" {
            return Ok(Some(page));
        }
        output_file::write(file, page)?;
    }
    let Some(file) = &args.markdown else {
        return Ok(None);
    };
    let text = review_markdown(&review);
    if file.as_os_str() == "-" {
        return Ok(Some(text));
    }
    output_file::write(file, text)?;
    Ok(None)
}

/// The scenes to show in detail: those of each group in turn, so that no group is without one.
fn examples(summary: &CompareSummary) -> Vec<(String, String)> {
    let groups = summary.flip_groups();
    let longest = groups
        .iter()
        .map(|group| group.runs.len())
        .max()
        .unwrap_or(0);
    let in_turn =
        (0..longest).flat_map(|at| groups.iter().filter_map(move |group| group.runs.get(at)));
    in_turn.take(MOST_PAIRS).cloned().collect()
}

/// The flipped scenes that were read.
struct Flips {
    pairs: BTreeMap<(String, String), ReviewPair>,
    replays: Replays,
    /// Maximum size of the replays. Unit: bytes.
    room: f64,
    is_trusted: bool,
}

impl Flips {
    fn read(
        &mut self,
        ontology: &Ontology,
        histories: [&History; 2],
        chosen: &[(String, String)],
    ) -> Result<(), Diagnostics> {
        let mut looks = histories.map(|history| {
            restore::allow(history, self.is_trusted);
            AppearanceReader::new(history, self.is_trusted)
        });
        for pairs in chosen.chunks(AT_ONCE) {
            let [first, second] = [
                runs(histories[0], ontology, pairs.iter().map(|(run, _)| run))?,
                runs(histories[1], ontology, pairs.iter().map(|(_, run)| run))?,
            ];
            for pair in pairs {
                let (Some(a), Some(b)) = (first.get(&pair.0), second.get(&pair.1)) else {
                    continue;
                };
                let traces = a.1.as_ref().zip(b.1.as_ref());
                let known = ReviewPair {
                    divergence: traces
                        .and_then(|(one, other)| divergence(one, other, &targets(&a.0))),
                    runs: [
                        self.side("a", a, &mut looks[0])?,
                        self.side("b", b, &mut looks[1])?,
                    ],
                };
                self.pairs.insert(pair.clone(), known);
            }
        }
        Ok(())
    }

    /// A run of one side, whose replay is added while there is room.
    fn side(
        &mut self,
        side: &str,
        (detail, trace, explained): &ReplayedRun,
        looks: &mut AppearanceReader<'_>,
    ) -> Result<ReviewRun, Diagnostics> {
        // Runs and campaigns of two histories can have the same ids.
        let mut named = detail.clone();
        named.row.run = format!("{side}/{}", detail.row.run);
        named.row.campaign = format!("{side}/{}", detail.row.campaign);
        if (self.replays.bytes() as f64) < self.room {
            if !self.replays.knows(&named.row.campaign) {
                let of_it = looks.of(&detail.row.campaign)?;
                self.replays.set_appearances(&named.row.campaign, of_it);
            }
            self.replays.add(&named, trace.as_ref(), explained);
        }
        Ok(ReviewRun {
            key: named.row.run,
            detail: detail.clone(),
        })
    }
}

/// The ids of the objects that the robot is to handle.
fn targets(run: &RunDetail) -> Vec<&str> {
    let objects = run.objects.iter();
    objects
        .filter(|object| object.role == Role::Target)
        .map(|object| object.id.as_str())
        .collect()
}

/// Reads runs of a history, by their ids.
fn runs<'a>(
    history: &History,
    ontology: &Ontology,
    ids: impl Iterator<Item = &'a String>,
) -> Result<BTreeMap<String, ReplayedRun>, Diagnostics> {
    let wanted: BTreeSet<&String> = ids.collect();
    let wanted: Vec<String> = wanted.into_iter().cloned().collect();
    let mut found = BTreeMap::new();
    replayed_runs::for_each_batch(history, ontology, &wanted, |batch| {
        found.extend(batch.into_iter().map(|run| (run.0.row.run.clone(), run)));
        Ok(ControlFlow::Continue(()))
    })?;
    Ok(found)
}
