//! Takes over the files of the mirrors of merged histories: making them again takes a millisecond a run.

use std::collections::{BTreeMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

use crate::Mirror;
use crate::tables::checked::Checked;
use crate::tables::mirror::{SCHEMA, runs_of, schema_digest, unwritten};
use crate::tables::table_files::{entries, is_table, is_whole, named, tables_of};
use actcheck_base::{Diagnostics, write_atomic};
use actcheck_history::History;
use actcheck_history::merge::MergePlan;

impl Mirror {
    /// Links or copies the files of the sources' mirrors into that of the destination, after a merge: those of campaigns that
    /// keep their ids, from histories without later judgements. [`Mirror::update`] adds missing runs. Returns the number of
    /// files.
    ///
    /// # Errors
    /// `A001` if the mirror can't be written. A mirror that another process is writing is left alone.
    pub fn adopt(plan: &MergePlan, sources: &[History], into: &History) -> Result<usize, Diagnostics> {
        let tables = tables_of(into);
        fs::create_dir_all(&tables).map_err(|error| unwritten(&tables, &error))?;
        let Some(_lock) = fs::File::open(&tables).ok().filter(|lock| lock.try_lock().is_ok()) else { return Ok(0) };
        let schema = tables.join(SCHEMA);
        match fs::read_to_string(&schema) {
            Ok(text) if text == schema_digest() => {}
            // The next update writes all files anew.
            Ok(_) => return Ok(0),
            Err(_) => {
                write_atomic(&schema, schema_digest().as_bytes()).map_err(|error| unwritten(&schema, &error))?;
            }
        }
        let mut checked = Checked::read(&tables);
        let mut next: BTreeMap<String, usize> = BTreeMap::new();
        let present = entries(&tables);
        for name in present.iter().filter_map(|file| named(file)) {
            let next = next.entry(name.campaign).or_default();
            *next = name.number.max(*next) + 1;
        }
        let mut files: Vec<PathBuf> = present.into_iter().filter(|file| is_table(file)).collect();
        let before = files.len();
        for (number, source) in sources.iter().enumerate() {
            let kept: HashSet<&str> = plan.kept_ids(number).collect();
            let found = files_of(source)?;
            source.rest();
            let known = Checked::read(&tables_of(source));
            for (campaign, digest, file) in found.into_iter().filter(|(campaign, ..)| kept.contains(campaign.as_str()))
            {
                let runs = match known.get(&file) {
                    Some(runs) => runs.clone(),
                    None if is_whole(&file) => match runs_of(&file) {
                        Ok(runs) => runs,
                        Err(_) => continue,
                    },
                    None => continue,
                };
                let number = next.entry(campaign.clone()).or_default();
                let new = tables.join(format!("{campaign}.{number:06}.{digest}.parquet"));
                *number += 1;
                link(&file, &new).map_err(|error| unwritten(&new, &error))?;
                checked.set(&new, runs);
                files.push(new);
            }
        }
        // Without the list, the files are read again.
        let _ = checked.write(&tables, &files);
        Ok(files.len() - before)
    }
}

/// The files of a history's mirror that are up to date, in order, each with its campaign and digest.
fn files_of(history: &History) -> Result<Vec<(String, String, PathBuf)>, Diagnostics> {
    let tables = tables_of(history);
    let is_current = fs::read_to_string(tables.join(SCHEMA)).is_ok_and(|text| text == schema_digest());
    if !is_current || !history.later_counts()?.is_empty() {
        return Ok(Vec::new());
    }
    let mut files = entries(&tables);
    files.sort();
    let known = files.into_iter().filter_map(|file| {
        let name = named(&file)?;
        Some((name.campaign, name.digest?, file))
    });
    Ok(known.collect())
}

/// Links a file, which takes no space, or copies it. Files of a mirror are never changed, only replaced.
fn link(from: &Path, to: &Path) -> std::io::Result<()> {
    fs::hard_link(from, to).or_else(|_| fs::copy(from, to).map(drop))
}
