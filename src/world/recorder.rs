//! Records a run tick by tick: state digest, frames, contact episodes, extremes.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Vector3};
use rapier3d::prelude::RigidBodyHandle;

use crate::World;
use crate::clearance::ClearanceMeter;
use crate::contacts::Touch;
use crate::engine::Owner;
use crate::motion::MotionMeter;
use crate::playback::Playback;
use crate::quality::QualityMeter;
use crate::robot_course::RobotMeter;
use crate::samples::SampleMeter;
use actcheck_base::Digest;
use actcheck_data::{Pose, RobotCourse};
use actcheck_geometry::{from_pose, from_vector};

/// Time between two frames. Unit: seconds. Enough for images and replays, and it keeps traces
/// small.
const FRAME_SECS: f64 = 0.1;
/// Shorter gaps between contacts of a pair are ignored. Unit: seconds.
const SAME_CONTACT_SECS: f64 = 0.05;
/// Positions in frames are rounded to multiples of this, for compression. Unit: metres.
const FRAME_GRAIN_M: f64 = 1e-4;
/// As [`FRAME_GRAIN_M`], for the components of quaternions.
const FRAME_GRAIN_TURN: f64 = 2e-4;

/// One uninterrupted contact. Times since the record began. Unit: seconds.
#[derive(Debug, Clone, PartialEq)]
pub struct Contact {
    /// The pair, sorted.
    pub pair: [String; 2],
    /// Start of the contact.
    pub start_secs: f64,
    /// End of the contact or of the record.
    pub end_secs: f64,
    /// Largest normal force. Unit: newtons.
    pub max_force_n: f64,
    /// Position of the contact at its largest force. Unit: metres. Frame: world.
    pub point_m: [f64; 3],
}

/// Extremes of one object's motion. See the fields of the same names in a trace.
#[derive(Debug, Clone, PartialEq)]
pub struct Course {
    /// Id of the object.
    pub id: String,
    /// Largest angle from the vertical. Unit: radians.
    pub max_tilt_rad: f64,
    /// Largest speed of its origin. Unit: m/s.
    pub max_speed: f64,
    /// Largest height gained. Unit: metres.
    pub max_rise_m: f64,
    /// Largest distance from its initial position. Unit: metres.
    pub max_displacement_m: f64,
}

/// The data recorded since [`World::begin_record`].
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// Contacts, sorted by start and pair.
    pub contacts: Vec<Contact>,
    /// One course per object, in scene order.
    pub courses: Vec<Course>,
    /// Smallest and largest true x and y of the base; `None` if it is fixed. Unit: metres.
    pub base: Option<[[f64; 2]; 2]>,
    /// The robot's course.
    pub robot: RobotCourse,
}

/// Poses over time; see the fields of the same names in a trace.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tracks {
    /// Unit: seconds.
    pub period_secs: f64,
    /// Names of the tracked bodies.
    pub names: Vec<String>,
    /// Shape: frames × (7 · names).
    pub rows: Vec<Vec<f32>>,
}

/// A contact episode: its first and latest tick, and its largest force with the position.
#[derive(Debug, Clone, Copy)]
struct Episode {
    start: u64,
    latest: u64,
    max_force_n: f64,
    point_m: [f64; 3],
}

impl Episode {
    fn begin(tick: u64) -> Self {
        Self {
            start: tick,
            latest: tick,
            max_force_n: 0.0,
            point_m: [0.0; 3],
        }
    }
}

/// The recorder of a world.
pub struct Recorder {
    digest: Digest,
    tick_secs: f64,
    ticks_per_frame: u64,
    n_ticks: u64,
    began: u64,
    tracked: Vec<(String, RigidBodyHandle)>,
    rows: Vec<Vec<f32>>,
    begin_poses: Vec<Isometry3<f64>>,
    extremes: Vec<[f64; 4]>,
    base: Option<[[f64; 2]; 2]>,
    open: BTreeMap<(Owner, Owner), Episode>,
    closed: Vec<((Owner, Owner), Episode)>,
    pub(super) quality: QualityMeter,
    pub(super) robot: RobotMeter,
    pub(super) motion: MotionMeter,
    pub(super) clearance: ClearanceMeter,
    pub(super) samples: SampleMeter,
    /// The playback for another engine, if it is kept.
    pub(super) playback: Option<Playback>,
}

impl Recorder {
    /// Creates an empty recorder for `n_objects` objects and the tracked bodies.
    pub fn new(n_objects: usize, tracked: Vec<(String, RigidBodyHandle)>, tick_secs: f64) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a handful of ticks"
        )]
        let ticks_per_frame = (FRAME_SECS / tick_secs).round().max(1.0) as u64;
        Self {
            digest: Digest::new(),
            tick_secs,
            ticks_per_frame,
            n_ticks: 0,
            began: 0,
            tracked,
            rows: Vec::new(),
            begin_poses: Vec::new(),
            extremes: vec![[0.0; 4]; n_objects],
            base: None,
            open: BTreeMap::new(),
            closed: Vec::new(),
            quality: QualityMeter::default(),
            robot: RobotMeter::default(),
            motion: MotionMeter::default(),
            clearance: ClearanceMeter::default(),
            samples: SampleMeter::default(),
            playback: None,
        }
    }

    /// Returns the number of control ticks since the world was built.
    pub(super) fn n_ticks(&self) -> u64 {
        self.n_ticks
    }

    /// Returns the time of a tick since the record began. Unit: seconds.
    pub(super) fn secs_since_begin(&self, tick: u64) -> f64 {
        tick.saturating_sub(self.began) as f64 * self.tick_secs
    }
}

impl World {
    /// Begins a record: resets contacts and extremes; frames continue.
    pub fn begin_record(&mut self) {
        let poses = self
            .objects
            .iter()
            .map(|object| self.pose_of(object))
            .collect();
        let recorder = &mut self.recorder;
        recorder.began = recorder.n_ticks;
        recorder.begin_poses = poses;
        recorder.extremes = vec![[0.0; 4]; self.objects.len()];
        recorder.base = None;
        recorder.open.clear();
        recorder.closed.clear();
        if recorder.rows.is_empty() {
            self.frame();
        }
        self.begin_robot_course();
        self.begin_clearance();
        self.begin_motion();
        self.begin_samples();
    }

    /// Ends the record and returns it.
    pub fn end_record(&mut self) -> Record {
        let mut closed = std::mem::take(&mut self.recorder.closed);
        closed.extend(std::mem::take(&mut self.recorder.open));
        let secs = |tick: u64| self.recorder.secs_since_begin(tick);
        let mut contacts: Vec<Contact> = closed
            .iter()
            .map(|((first, second), episode)| {
                let mut pair = [self.name_of(*first), self.name_of(*second)];
                pair.sort();
                // A contact is detected at the end of its tick.
                let start_secs = secs(episode.start.saturating_sub(1));
                let Episode {
                    latest,
                    max_force_n,
                    point_m,
                    ..
                } = *episode;
                Contact {
                    pair,
                    start_secs,
                    end_secs: secs(latest),
                    max_force_n,
                    point_m,
                }
            })
            .collect();
        contacts.sort_by(|a, b| {
            a.start_secs
                .total_cmp(&b.start_secs)
                .then_with(|| a.pair.cmp(&b.pair))
        });
        let courses = self.objects.iter().zip(&self.recorder.extremes);
        let courses = courses
            .map(
                |(object, [max_tilt_rad, max_speed, max_rise_m, max_displacement_m])| Course {
                    id: object.id.clone(),
                    max_tilt_rad: *max_tilt_rad,
                    max_speed: *max_speed,
                    max_rise_m: *max_rise_m,
                    max_displacement_m: *max_displacement_m,
                },
            )
            .collect();
        let samples = self.end_samples();
        Record {
            contacts,
            courses,
            base: self.recorder.base,
            robot: RobotCourse {
                clearances: self.clearances(),
                motion: self.end_motion(),
                intervals: samples.intervals(),
                samples,
                ..self.end_robot_course()
            },
        }
    }

    /// Returns the poses of all moving bodies since the first record began. Furniture is among them
    /// if it moved.
    pub fn tracks(&self) -> Tracks {
        let Recorder { tracked, rows, .. } = &self.recorder;
        let poses =
            |row: &[f32], idx: usize| row.get(7 * idx..7 * idx + 7).unwrap_or_default().to_vec();
        let stayed = |idx: &usize| {
            rows.windows(2)
                .all(|pair| poses(&pair[0], *idx) == poses(&pair[1], *idx))
        };
        let is_furniture = |name: &str| {
            self.objects
                .iter()
                .any(|object| object.slides && object.id == name)
        };
        let kept: Vec<usize> = (0..tracked.len())
            .filter(|idx| !(is_furniture(&tracked[*idx].0) && stayed(idx)))
            .collect();
        Tracks {
            period_secs: self.recorder.ticks_per_frame as f64 * self.recorder.tick_secs,
            names: kept.iter().map(|idx| tracked[*idx].0.clone()).collect(),
            rows: rows
                .iter()
                .map(|row| kept.iter().flat_map(|idx| poses(row, *idx)).collect())
                .collect(),
        }
    }

    /// Returns a digest over the bits of all states so far.
    pub fn state_digest(&self) -> String {
        self.recorder.digest.clone().finish()
    }

    /// Returns the name of an owner in contacts.
    pub(super) fn name_of(&self, owner: Owner) -> String {
        match owner {
            Owner::Floor => "floor".to_owned(),
            Owner::Object(idx) => self
                .objects
                .get(idx)
                .map_or_else(String::new, |object| object.id.clone()),
            Owner::Link(idx) => {
                let link = self
                    .robot
                    .model
                    .links
                    .get(idx)
                    .map_or("", |link| link.name.as_str());
                format!("robot/{link}")
            }
        }
    }

    /// Records the state after a tick.
    pub(super) fn record(&mut self) {
        self.recorder.n_ticks += 1;
        self.record_playback();
        self.digest_state();
        let recording = !self.recorder.rows.is_empty();
        if recording {
            self.record_extremes();
            self.record_base();
            let touches = self.touches();
            self.record_contacts(&touches);
            self.record_robot(&touches);
            self.record_samples(&touches);
            self.record_touched(&touches);
            self.record_motions(&touches);
            self.move_furniture(&touches);
            if (self.recorder.n_ticks - self.recorder.began)
                .is_multiple_of(self.recorder.ticks_per_frame)
            {
                self.frame();
                self.record_clearance();
                self.record_motion();
            }
        }
    }

    fn digest_state(&mut self) {
        let handles = self
            .objects
            .iter()
            .map(|object| object.body)
            .chain(self.robot.bodies.iter().copied());
        let mut bits: Vec<f32> =
            Vec::with_capacity(13 * (self.objects.len() + self.robot.bodies.len()));
        for handle in handles {
            let Some(body) = self.engine.bodies.get(handle) else {
                continue;
            };
            bits.extend(body.translation().to_array());
            bits.extend(body.rotation().to_array());
            bits.extend(body.linvel().to_array());
            bits.extend(body.angvel().to_array());
        }
        self.recorder.digest.update_bits(&bits);
    }

    fn record_extremes(&mut self) {
        for (idx, object) in self.objects.iter().enumerate() {
            let Some(body) = self.engine.bodies.get(object.body) else {
                continue;
            };
            if body.is_fixed() {
                continue;
            }
            let pose = from_pose(body.position());
            let way: Vector3<f64> =
                pose.translation.vector - self.recorder.begin_poses[idx].translation.vector;
            let speed = from_vector(body.velocity_at_point(body.translation())).norm();
            let now = [Pose::from_isometry(&pose).tilt(), speed, way.z, way.norm()];
            for (extreme, value) in self.recorder.extremes[idx].iter_mut().zip(now) {
                *extreme = extreme.max(value);
            }
        }
    }

    fn record_base(&mut self) {
        if self.robot.layout.base.is_none() {
            return;
        }
        let [x, y, _] = self.base_true();
        let [low, high] = self.recorder.base.get_or_insert([[x, y], [x, y]]);
        (*low, *high) = (
            [low[0].min(x), low[1].min(y)],
            [high[0].max(x), high[1].max(y)],
        );
    }

    fn record_contacts(&mut self, touches: &BTreeMap<(Owner, Owner), Touch>) {
        let now = self.recorder.n_ticks;
        let patience = SAME_CONTACT_SECS / self.recorder.tick_secs;
        let mut deepest_m = 0.0f64;
        for (pair, touch) in touches {
            deepest_m = deepest_m.max(touch.depth_m);
            let episode = self
                .recorder
                .open
                .entry(*pair)
                .or_insert(Episode::begin(now));
            if (now - episode.latest) as f64 > patience {
                self.recorder.closed.push((*pair, *episode));
                *episode = Episode::begin(now);
            }
            episode.latest = now;
            if touch.normal_n > episode.max_force_n {
                (episode.max_force_n, episode.point_m) = (touch.normal_n, touch.point_m);
            }
        }
        let energies = self.free_energies();
        self.recorder.quality.tick(deepest_m, energies);
    }

    fn frame(&mut self) {
        let mut row = Vec::with_capacity(7 * self.recorder.tracked.len());
        for (_, handle) in &self.recorder.tracked {
            let Some(body) = self.engine.bodies.get(*handle) else {
                continue;
            };
            let Pose { position, rotation } = Pose::from_isometry(&from_pose(body.position()));
            row.extend(position.map(|value| grain(value, FRAME_GRAIN_M)));
            row.extend(rotation.map(|value| grain(value, FRAME_GRAIN_TURN)));
        }
        self.recorder.rows.push(row);
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "frames are kept in 32 bits"
)]
pub(super) fn grain(value: f64, grain: f64) -> f32 {
    ((value / grain).round() * grain) as f32
}
