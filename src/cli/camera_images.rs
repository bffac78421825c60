//! Draws colour images of stored runs, for tables and reports.

use std::collections::BTreeMap;

use crate::trust;
use actcheck_analysis::DatasetImage;
use actcheck_base::Diagnostics;
use actcheck_campaign::{CampaignPictures, Env, RunPicture};
use actcheck_data::Trace;
use actcheck_history::{History, RunDetail};
use actcheck_report::{FilmImage, film_times};

/// Width of an image in a report. Unit: pixels.
const FILM_WIDTH: u32 = 160;
/// Most images in the films of a report, together some megabytes.
const MOST_FILM_IMAGES: usize = 160;

/// Draws images of runs. Each campaign is prepared once.
pub(super) struct CameraImages<'a> {
    history: &'a History,
    is_trusted: bool,
    known: BTreeMap<String, Option<CampaignPictures>>,
    /// Number of images of films so far.
    n_drawn: usize,
}

impl<'a> CameraImages<'a> {
    /// `is_trusted`: whether the program that expands a robot's file may be started.
    pub(super) fn new(history: &'a History, is_trusted: bool) -> Self {
        Self {
            history,
            is_trusted,
            known: BTreeMap::new(),
            n_drawn: 0,
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
        let history = self.history;
        let Some(pictures) = self.pictures(&run.row.campaign)? else {
            return Ok(Vec::new());
        };
        let (choices, _) = history.traces().recorded(&run.row.run)?;
        let drawn = pictures.run(run, trace, &choices).frames(frames);
        let image = |picture: RunPicture| DatasetImage {
            width: picture.image.width,
            height: picture.image.height,
            camera: picture.camera,
            png: picture.image.png(),
            rgb: picture.image.bytes,
        };
        Ok(drawn.into_iter().map(image).collect())
    }

    /// Draws the colour images that a run's program asked for, few and small.
    ///
    /// # Errors
    /// The choices of the run can't be read.
    pub(super) fn film(
        &mut self,
        run: &RunDetail,
        trace: &Trace,
    ) -> Result<Vec<FilmImage>, Diagnostics> {
        let times = film_times(trace);
        if times.is_empty() || self.n_drawn >= MOST_FILM_IMAGES {
            return Ok(Vec::new());
        }
        let history = self.history;
        let Some(pictures) = self.pictures(&run.row.campaign)? else {
            return Ok(Vec::new());
        };
        let (choices, _) = history.traces().recorded(&run.row.run)?;
        let last = trace.frames.rows.len().saturating_sub(1);
        let frame = |secs: &f64| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a frame of the trace"
            )]
            let frame = (secs / trace.frames.period_secs).round().max(0.0) as usize;
            frame.min(last)
        };
        let frames: Vec<usize> = times.iter().map(frame).collect();
        let small = pictures.run(run, trace, &choices).at_most(FILM_WIDTH);
        let drawn = small.frames(&frames);
        self.n_drawn += drawn.len();
        let image = |(secs, picture): (f64, RunPicture)| FilmImage {
            secs,
            png: picture.image.png(),
        };
        Ok(times.into_iter().zip(drawn).map(image).collect())
    }

    /// Returns the images of a campaign, which is prepared once; `None` if it can't be prepared any
    /// more.
    fn pictures(&mut self, campaign: &str) -> Result<Option<&CampaignPictures>, Diagnostics> {
        if !self.known.contains_key(campaign) {
            let read = self.prepare(campaign)?;
            self.known.insert(campaign.to_owned(), read);
        }
        Ok(self.known.get(campaign).and_then(Option::as_ref))
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
