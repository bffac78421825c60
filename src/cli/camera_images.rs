//! Draws colour images of stored runs, for tables and reports.

use std::collections::BTreeMap;

use crate::trust;
use actcheck_analysis::DatasetImage;
use actcheck_base::Diagnostics;
use actcheck_campaign::{CampaignPictures, Env};
use actcheck_data::Trace;
use actcheck_history::{History, RunDetail};

/// Draws images of runs. Each campaign is prepared once.
pub(super) struct CameraImages<'a> {
    history: &'a History,
    is_trusted: bool,
    known: BTreeMap<String, Option<CampaignPictures>>,
}

impl<'a> CameraImages<'a> {
    /// `is_trusted`: whether the program that expands a robot's file may be started.
    pub(super) fn new(history: &'a History, is_trusted: bool) -> Self {
        Self {
            history,
            is_trusted,
            known: BTreeMap::new(),
        }
    }

    /// Draws some frames of a run's trace; nothing if its campaign can't be prepared any more.
    ///
    /// # Errors
    /// The choices of the run can't be read.
    pub(super) fn draw(
        &mut self,
        run: &RunDetail,
        trace: &Trace,
        frames: &[usize],
    ) -> Result<Vec<DatasetImage>, Diagnostics> {
        let campaign = &run.row.campaign;
        if !self.known.contains_key(campaign) {
            let read = self.prepare(campaign)?;
            self.known.insert(campaign.clone(), read);
        }
        let Some(Some(pictures)) = self.known.get(campaign) else {
            return Ok(Vec::new());
        };
        let (choices, _) = self.history.traces().recorded(&run.row.run)?;
        let drawn = pictures.run(run, trace, &choices).frames(frames);
        let image = |picture: actcheck_campaign::RunPicture| DatasetImage {
            width: picture.image.width,
            height: picture.image.height,
            camera: picture.camera,
            png: picture.image.png(),
            rgb: picture.image.bytes,
        };
        Ok(drawn.into_iter().map(image).collect())
    }

    fn prepare(&self, campaign: &str) -> Result<Option<CampaignPictures>, Diagnostics> {
        let starts = Env::starts_from_history(self.history, campaign);
        // An imported campaign has no camera of ours.
        let may_read =
            starts.is_ok_and(|starts| self.is_trusted || trust::expands_none(campaign, &starts));
        match may_read {
            true => CampaignPictures::of(self.history, campaign),
            false => Ok(None),
        }
    }
}
