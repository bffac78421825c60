//! The appearance of the bodies of campaigns, for pictures and reports.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::{output, trust};
use actcheck_base::Diagnostics;
use actcheck_campaign::{Env, appearances, stored_robot};
use actcheck_data::{Appearances, RobotCore};
use actcheck_history::History;

/// Reads the appearance of bodies. Campaigns of the same configuration share it.
pub(super) struct AppearanceReader<'a> {
    history: &'a History,
    is_trusted: bool,
    /// By the path and the digest of the configuration.
    known: BTreeMap<[String; 2], Arc<Appearances>>,
}

impl<'a> AppearanceReader<'a> {
    /// `is_trusted`: whether the program that expands a robot's file may be started.
    pub(super) fn new(history: &'a History, is_trusted: bool) -> Self {
        Self {
            history,
            is_trusted,
            known: BTreeMap::new(),
        }
    }

    /// Returns the appearance of the bodies of a campaign; nothing if that can't be read any more. Warns
    /// of visual shapes that can't be read, and of a program that is not started.
    ///
    /// # Errors
    /// `H014` if the history has no such campaign.
    pub(super) fn of(&mut self, campaign: &str) -> Result<Arc<Appearances>, Diagnostics> {
        let record = self.history.campaign(campaign)?;
        let key = [record.config_path.clone(), record.config_digest.clone()];
        if let Some(known) = self.known.get(&key) {
            return Ok(Arc::clone(known));
        }
        let read = if self.may_read(campaign) {
            let mut found = Diagnostics::new();
            let read = appearances(self.history, campaign, &mut found)?;
            if !found.is_empty() {
                output::print_diagnostics(&found);
            }
            read
        } else {
            Appearances::default()
        };
        let read = Arc::new(read);
        self.known.insert(key, Arc::clone(&read));
        Ok(read)
    }

    /// Returns the robot of a campaign; `None` if that can't be read any more.
    ///
    /// # Errors
    /// `H014` if the history has no such campaign.
    pub(super) fn robot(&self, campaign: &str) -> Result<Option<RobotCore>, Diagnostics> {
        match self.may_read(campaign) {
            true => stored_robot(self.history, campaign),
            false => Ok(None),
        }
    }

    /// Whether the robot's file may be read. An imported campaign has no robot of ours.
    fn may_read(&self, campaign: &str) -> bool {
        let starts = Env::starts_from_history(self.history, campaign);
        starts.is_ok_and(|starts| self.is_trusted || trust::expands_none(campaign, &starts))
    }
}
