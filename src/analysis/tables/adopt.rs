//! Takes over the files of the mirrors of merged histories: making them again takes a millisecond a
//! run.

use std::collections::{BTreeMap, HashSet};
use std::path::PathBuf;

use crate::Mirror;
use crate::tables::checked::Checked;
use crate::tables::mirror::{SCHEMA, is_current, runs_of, schema_digest, unwritten};
use crate::tables::table_files::{is_whole, named, tables_in, tables_of};
use actcheck_base::{Below, Diagnostics};
use actcheck_history::History;
use actcheck_history::merge::MergePlan;

impl Mirror {
    /// Links or copies the files of the sources' mirrors into that of the destination, after a
    /// merge: those of campaigns that keep their ids, from histories without later judgements.
    /// [`Mirror::update`] adds missing runs. Returns the number of files.
    ///
    /// # Errors
    /// `A001` if the mirror can't be written. A mirror that another process is writing is left
    /// alone.
    pub fn adopt(
        plan: &MergePlan,
        sources: &[History],
        into: &History,
    ) -> Result<usize, Diagnostics> {
        let (tables, below) = (tables_of(into), Below::new(into.dir()));
        below
            .create_folder(&tables)
            .map_err(|error| unwritten(&tables, &error))?;
        let lock = below
            .open_folder(&tables)
            .ok()
            .filter(|lock| lock.try_lock().is_ok());
        let Some(_lock) = lock else { return Ok(0) };
        if !is_current(&tables) {
            // The next update writes all files anew.
            if !tables_in(&tables).is_empty() {
                return Ok(0);
            }
            let schema = tables.join(SCHEMA);
            below
                .write_atomic(&schema, schema_digest().as_bytes())
                .map_err(|error| unwritten(&schema, &error))?;
        }
        let mut checked = Checked::read(&tables);
        let mut next: BTreeMap<String, usize> = BTreeMap::new();
        let mut files = tables_in(&tables);
        for name in files.iter().filter_map(|file| named(file)) {
            let next = next.entry(name.campaign).or_default();
            *next = name.number.max(*next) + 1;
        }
        let before = files.len();
        for (number, source) in sources.iter().enumerate() {
            let kept: HashSet<&str> = plan.kept_ids(number).collect();
            let found = files_of(source)?;
            let known = Checked::read(&tables_of(source));
            for (campaign, digest, file) in found
                .into_iter()
                .filter(|(campaign, ..)| kept.contains(campaign.as_str()))
            {
                if !is_whole(&file) {
                    continue;
                }
                let Some(runs) = known.get(&file).cloned().or_else(|| runs_of(&file).ok()) else {
                    continue;
                };
                let number = next.entry(campaign.clone()).or_default();
                let new = tables.join(format!("{campaign}.{number:06}.{digest}.parquet"));
                *number += 1;
                below
                    .link(&Below::new(source.dir()), &file, &new)
                    .map_err(|error| unwritten(&new, &error))?;
                checked.set(&new, runs);
                files.push(new);
            }
        }
        // Without the list, the files are read again.
        let _ = checked.write(&below, &tables, &files);
        Ok(files.len() - before)
    }
}

/// The files of a history's mirror that are up to date, in order, each with its campaign and
/// digest.
fn files_of(history: &History) -> Result<Vec<(String, String, PathBuf)>, Diagnostics> {
    let tables = tables_of(history);
    if !is_current(&tables) || !history.later_counts()?.is_empty() {
        return Ok(Vec::new());
    }
    let known = tables_in(&tables).into_iter().filter_map(|file| {
        let name = named(&file)?;
        Some((name.campaign, name.digest, file))
    });
    Ok(known.collect())
}
