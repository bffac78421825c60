//! Colour images of stored runs, drawn from their traces at any of their frames.

use std::collections::BTreeMap;

use nalgebra::Isometry3;
use rayon::prelude::*;

use crate::Env;
use actcheck_base::Diagnostics;
use actcheck_data::{Camera, Choice, Decor, Form, ObjectModel, Part, Pose, Role, Trace, bounds};
use actcheck_history::{History, RunDetail};
use actcheck_world::{Mount, RgbImage, Stage, StagedObject};

/// Draws images of the runs of a campaign.
pub struct CampaignPictures(Env);

/// Draws images of one run.
pub struct RunPictures<'a> {
    stage: Stage,
    camera: Camera,
    eye: (Option<Place>, Isometry3<f64>),
    objects: Vec<Option<Place>>,
    links: Vec<Option<Place>>,
    rows: &'a [Vec<f32>],
}

/// Where the pose of a body is.
#[derive(Debug, Clone, Copy)]
enum Place {
    /// The number of its track.
    Track(usize),
    /// It does not move.
    Fixed(Isometry3<f64>),
}

/// A colour image of a run and the camera's true pose. Frame: world.
#[derive(Debug, Clone)]
pub struct RunPicture {
    /// x looks forwards, z up in the image.
    pub camera: Pose,
    /// The image.
    pub image: RgbImage,
}

impl CampaignPictures {
    /// Prepares the images of a campaign with its configuration and its present models. `None` if
    /// it can't be prepared any more, or has another robot now.
    ///
    /// # Errors
    /// `H014` if the history has no such campaign.
    pub fn of(history: &History, campaign: &str) -> Result<Option<Self>, Diagnostics> {
        let record = history.campaign(campaign)?;
        let Ok((env, _)) = Env::from_history(history, campaign, None) else {
            return Ok(None);
        };
        let core = &env.campaign.robot.core;
        let robot = (core.name.clone(), core.digest.clone());
        Ok(record.models.contains(&robot).then_some(Self(env)))
    }

    /// Prepares the images of a run with its trace and choices.
    pub fn run<'a>(
        &'a self,
        run: &RunDetail,
        trace: &'a Trace,
        choices: &[Choice],
    ) -> RunPictures<'a> {
        let places = Places::of(trace);
        let Self(env) = self;
        let models = &env.campaign.models;
        let objects: Vec<(ShownObject<'_>, Option<Place>)> = run
            .objects
            .iter()
            .map(|object| {
                let form = trace.forms.iter().find(|form| form.name == object.id);
                let model = models.get(&object.model).map(AsRef::as_ref);
                let shown = ShownObject {
                    id: &object.id,
                    model: &object.model,
                    height_m: height_m(model, form),
                    form,
                    is_fixed: !trace.frames.names.contains(&object.id),
                    has_surface: model.is_some_and(|model| model.surface.is_some()),
                    is_part: object.role == Role::Part,
                };
                (shown, places.of_body(&object.id))
            })
            .collect();
        let staged = objects.iter().map(|(object, _)| object.staged());
        let model = &env.robot.model;
        let decor = Decor::of(choices);
        let stage = Stage::new(env.skins(), &decor, staged, model);
        let links = model.links.iter();
        let links: Vec<Option<Place>> = links
            .map(|link| places.of_body(&format!("robot/{}", link.name)))
            .collect();
        let eye = match env.robot.named.camera {
            Mount::Link(link, pose) => (links.get(link).copied().flatten(), pose),
            Mount::World(pose) => (Some(Place::Fixed(Isometry3::identity())), pose),
        };
        RunPictures {
            stage,
            camera: env.campaign.sensing.camera.clone(),
            eye,
            objects: objects.into_iter().map(|(_, place)| place).collect(),
            links,
            rows: &trace.frames.rows,
        }
    }
}

impl RunPictures<'_> {
    /// Draws the images of several frames, in this order, on all cores; nothing if one can't be
    /// drawn.
    pub fn frames(&self, frames: &[usize]) -> Vec<RunPicture> {
        let drawn: Option<Vec<RunPicture>> =
            frames.par_iter().map(|frame| self.frame(*frame)).collect();
        drawn.unwrap_or_default()
    }

    /// Lets the images be at most so wide, with the same field of view. Unit: pixels.
    #[must_use]
    pub fn at_most(mut self, width: u32) -> Self {
        if self.camera.width > width {
            self.camera.height = (self.camera.height * width / self.camera.width).max(1);
            self.camera.width = width;
        }
        self
    }

    /// Draws the image of a frame of the trace. `None` if the trace lacks this frame, or has
    /// no pose of the camera.
    pub fn frame(&self, frame: usize) -> Option<RunPicture> {
        let row = self.rows.get(frame)?;
        let (on, pose) = self.eye;
        let eye = on?.at(row)? * pose;
        let at = |place: &Option<Place>| place.and_then(|place| place.at(row));
        let image = self.stage.draw(
            &self.camera,
            &eye,
            self.objects.iter().map(at),
            self.links.iter().map(at),
        );
        let camera = Pose::from_isometry(&eye);
        Some(RunPicture { camera, image })
    }
}

impl Place {
    fn at(self, row: &[f32]) -> Option<Isometry3<f64>> {
        match self {
            Self::Fixed(pose) => Some(pose),
            Self::Track(number) => {
                let values: [f32; 7] = row.get(7 * number..)?.first_chunk().copied()?;
                let [x, y, z, qx, qy, qz, qw] = values.map(f64::from);
                let pose = Pose {
                    position: [x, y, z],
                    rotation: [qx, qy, qz, qw],
                };
                values
                    .iter()
                    .all(|value| value.is_finite())
                    .then(|| pose.to_isometry())
            }
        }
    }
}

/// The places of all bodies of a trace.
struct Places<'a> {
    tracks: BTreeMap<&'a str, usize>,
    fixed: BTreeMap<String, Pose>,
}

impl<'a> Places<'a> {
    fn of(trace: &'a Trace) -> Self {
        let tracks = trace.frames.names.iter().map(String::as_str).zip(0..);
        let first = trace.snapshots.first();
        let bodies = first.into_iter().flat_map(|state| {
            let objects = state.bodies.iter().map(|body| (body.id.clone(), body.pose));
            let links = state.robot.links.iter();
            objects.chain(links.map(|link| (format!("robot/{}", link.name), link.pose)))
        });
        Self {
            tracks: tracks.collect(),
            fixed: bodies.collect(),
        }
    }

    fn of_body(&self, name: &str) -> Option<Place> {
        match self.tracks.get(name) {
            Some(track) => Some(Place::Track(*track)),
            None => Some(Place::Fixed(self.fixed.get(name)?.to_isometry())),
        }
    }
}

/// An object of a stored run.
struct ShownObject<'a> {
    id: &'a str,
    model: &'a str,
    height_m: f64,
    form: Option<&'a Form>,
    is_fixed: bool,
    has_surface: bool,
    is_part: bool,
}

impl ShownObject<'_> {
    fn staged(&self) -> StagedObject<'_> {
        StagedObject {
            id: self.id,
            model: self.model,
            height_m: self.height_m,
            parts: self.form.map_or(&[], |form| &form.parts),
            is_fixed: self.is_fixed,
            has_surface: self.has_surface,
            is_part: self.is_part,
        }
    }
}

/// The height of a model at the scale of a scene: that of its shapes in the trace.
fn height_m(model: Option<&ObjectModel>, form: Option<&Form>) -> f64 {
    let Some(model) = model else {
        return 0.0;
    };
    let height = |parts: &[Part]| {
        let (low, high) = bounds(parts);
        high[2] - low[2]
    };
    let scale = form.map_or(1.0, |form| height(&form.parts) / height(&model.parts));
    model.size_m[2] * if scale.is_finite() { scale } else { 1.0 }
}
