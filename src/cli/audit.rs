//! `actcheck check-oracles --episodes`: which faults does an environment's own success check notice,
//! and which do the properties?

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::json;

use crate::convert::{self, Converted};
use crate::import::{Mappings, first_of_episodes, found};
use crate::options::Format;
use crate::output;
use actcheck_base::Diagnostics;
use actcheck_campaign::{AuditedEpisode, audit_episode};
use actcheck_report::Table;

/// What to audit, and how.
pub(super) struct Audit<'a> {
    /// Files or folders of episodes, or names of suites.
    pub episodes: &'a [String],
    pub mapping: Option<&'a Path>,
    pub python: &'a Path,
    pub format: Format,
}

/// Judges faulty episodes and prints, for each fault, how many the environment's check counts as
/// successes and how many the properties notice. Returns the exit code.
pub(super) fn audit(asked: &Audit<'_>) -> Result<u8, Diagnostics> {
    let mappings = Mappings::load(asked.mapping, None)?;
    let mut faults = Diagnostics::new();
    let mut audited: Vec<AuditedEpisode> = Vec::new();
    let mut left_out = Vec::new();
    for episodes in asked.episodes {
        let converted = made_or_found(episodes, asked.python)?;
        let (files, more) = mappings.choose(&converted);
        faults.extend(more);
        left_out.extend(converted.left_out.clone());
        for file in &files {
            match audit_episode(file) {
                Ok(episode) => audited.push(episode),
                Err(found) => faults.extend(found),
            }
        }
    }
    output::print(&printed(&audited, asked.format));
    output::tell(&left_out, asked.format != Format::Text);
    let missed = audited
        .iter()
        .any(|episode| !episode.fault.is_empty() && !is_noticed(episode));
    if faults.is_empty() {
        return Ok(u8::from(missed));
    }
    output::print_diagnostics(&first_of_episodes(faults));
    Ok(2)
}

/// Returns the episodes of a file or a folder, or makes those of a suite.
fn made_or_found(episodes: &str, python: &Path) -> Result<Converted, Diagnostics> {
    let path = PathBuf::from(episodes);
    if path.exists() || path.extension().is_some() {
        return convert::episodes(&found(&[path])?, python, None);
    }
    convert::faulty_episodes(episodes, python)
}

/// Whether a property failed, or the scene is not the one that the task is about.
fn is_noticed(episode: &AuditedEpisode) -> bool {
    !episode.failed.is_empty() || episode.broken_premise.is_some()
}

fn printed(audited: &[AuditedEpisode], format: Format) -> String {
    if format != Format::Text {
        let mut table = Table::new([
            "task",
            "fault",
            "episode",
            "counted_as_success",
            "noticed",
            "property",
            "words",
        ]);
        for episode in audited {
            let (property, words) = episode
                .failed
                .first()
                .cloned()
                .or_else(|| episode.broken_premise.clone())
                .unwrap_or_else(|| (String::new(), episode.undecided.clone()));
            table.rows.push(vec![
                json!(episode.task),
                json!(episode.fault),
                json!(episode.file),
                json!(episode.counted),
                json!(is_noticed(episode)),
                json!(property),
                json!(words),
            ]);
        }
        return table.render(format.into(), output::page());
    }
    let mut by_fault: BTreeMap<&str, Vec<&AuditedEpisode>> = BTreeMap::new();
    for episode in audited {
        by_fault.entry(&episode.fault).or_default().push(episode);
    }
    let mut table = Table::new([
        "fault",
        "episodes",
        "their check counts as success",
        "the properties notice",
        "by a broken premise",
        "undecided",
        "by",
    ]);
    for (fault, episodes) in by_fault {
        let count = |is: &dyn Fn(&AuditedEpisode) -> bool| {
            episodes.iter().filter(|episode| is(episode)).count()
        };
        let mut by: BTreeMap<&str, usize> = BTreeMap::new();
        for (property, _) in episodes.iter().flat_map(|episode| &episode.failed) {
            *by.entry(property).or_default() += 1;
        }
        let mut by: Vec<(&str, usize)> = by.into_iter().collect();
        by.sort_by_key(|(property, count)| (std::cmp::Reverse(*count), *property));
        let by: Vec<String> = by
            .iter()
            .take(3)
            .map(|(property, count)| format!("{property} {count}"))
            .collect();
        let said = episodes.iter().any(|episode| episode.counted.is_some());
        table.rows.push(vec![
            json!(if fault.is_empty() { "none" } else { fault }),
            json!(episodes.len()),
            if said {
                json!(count(&|episode| episode.counted == Some(true)))
            } else {
                json!(null)
            },
            json!(count(&is_noticed)),
            json!(count(&|episode| episode.broken_premise.is_some())),
            json!(count(
                &|episode| episode.decided == 0 && episode.broken_premise.is_none()
            )),
            json!(by.join(", ")),
        ]);
    }
    table.render(format.into(), output::page())
}
