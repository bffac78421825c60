//! The runs whose verdicts another physics engine confirms or contests.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::{History, beside};
use actcheck_base::{Below, Diagnostics};

/// Folder of the cross-checks in a history.
const FOLDER: &str = "cross-checks";

/// The comparison of runs of a campaign with the same runs in another engine.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct CrossCheck {
    /// Id of the campaign.
    pub campaign: String,
    /// The other engine with its version.
    pub engine: String,
    /// Id of the campaign with its courses.
    pub imported: Option<String>,
    /// Each compared run with the local names of its properties that the other engine, or one of
    /// its settings, decides otherwise.
    pub runs: BTreeMap<String, BTreeSet<String>>,
}

impl History {
    /// Stores the cross-check of a campaign. It replaces an earlier one.
    ///
    /// # Errors
    /// `H006` if it can't be written.
    pub fn store_cross_check(&self, check: &CrossCheck) -> Result<(), Diagnostics> {
        beside::store(self.dir(), &file_of(&check.campaign), check)
    }

    /// Returns the cross-check of a campaign, or `None` if there is none.
    ///
    /// # Errors
    /// `H007` if its file is damaged.
    pub fn cross_check(&self, campaign: &str) -> Result<Option<CrossCheck>, Diagnostics> {
        let help = "remove it, and give `actcheck cross-check` again";
        beside::read(self.dir(), &file_of(campaign), help)
    }

    /// Returns the contested runs of all cross-checks, each with the local names of its properties
    /// that another engine, or one of its settings, decides otherwise.
    ///
    /// # Errors
    /// `H007` if a file is damaged.
    pub fn contested(&self) -> Result<BTreeMap<String, BTreeSet<String>>, Diagnostics> {
        let below = Below::new(self.dir());
        let folder = self.dir().join(FOLDER);
        if below.kind(&folder).is_none() {
            return Ok(BTreeMap::new());
        }
        let mut found = BTreeMap::new();
        for file in below.files(&folder) {
            let name = file.file_stem().and_then(|name| name.to_str());
            if let Some(check) = name.map(|id| self.cross_check(id)).transpose()?.flatten() {
                let contested = check.runs.into_iter();
                found.extend(contested.filter(|(_, properties)| !properties.is_empty()));
            }
        }
        Ok(found)
    }
}

fn file_of(campaign: &str) -> PathBuf {
    PathBuf::from(FOLDER).join(format!("{campaign}.json"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_damaged_file_is_named_and_another_campaign_has_none() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let history = History::open(&folder.path().join("h")).expect("it is new");
        let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        let check = CrossCheck {
            campaign: "k7f3".to_owned(),
            engine: "MuJoCo 4.0.0".to_owned(),
            imported: None,
            runs: [
                ("k7f3-1".to_owned(), names(&["Held"])),
                ("k7f3-2".to_owned(), names(&[])),
            ]
            .into(),
        };
        history.store_cross_check(&check).expect("it is written");
        assert_eq!(
            history.cross_check("k7f3").expect("it is there"),
            Some(check)
        );
        assert_eq!(history.cross_check("other").expect("none is needed"), None);
        let contested = history.contested().expect("it is there");
        assert_eq!(contested.keys().collect::<Vec<_>>(), ["k7f3-1"]);
        std::fs::write(history.dir().join(file_of("k7f3")), "{").expect("it is writable");
        let faults = history.contested().expect_err("it is cut off").to_string();
        assert!(faults.contains("k7f3.json"), "{faults}");
    }
}
