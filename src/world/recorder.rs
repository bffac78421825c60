//! Records a run tick by tick: state digest, frames, contact episodes, extremes.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Vector3};
use rapier3d::prelude::RigidBodyHandle;

use crate::bodies::Bodies;
use crate::clearance::ClearanceMeter;
use crate::contacts::Touches;
use crate::drive::{Command, Drive};
use crate::engine::Engine;
use crate::motion::{MotionMeter, grain};
use crate::physics::Owner;
use crate::playback::Playback;
use crate::quality::{QualityMeter, free_energies};
use crate::reach::Reach;
use crate::robot_course::RobotMeter;
use crate::samples::SampleMeter;
use actcheck_base::Digest;
use actcheck_data::{Pose, Quality, RobotCourse};
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

/// The data recorded since [`World::begin_record`](crate::World::begin_record).
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

/// A body that can move.
struct Tracked {
    /// Its name in traces.
    name: String,
    body: RigidBodyHandle,
    /// Whether it is furniture, which slides when it is pushed hard.
    is_furniture: bool,
}

/// Returns the bodies that can move: objects, then links with shapes.
fn tracked(bodies: &Bodies) -> Vec<Tracked> {
    let objects = bodies
        .objects
        .iter()
        .filter(|object| !object.fixed || object.slides)
        .map(|object| Tracked {
            name: object.id.clone(),
            body: object.body,
            is_furniture: object.slides,
        });
    let links = bodies
        .robot
        .model
        .links
        .iter()
        .zip(&bodies.robot.bodies)
        .skip(1)
        .filter(|(link, _)| !link.solids.is_empty())
        .map(|(link, body)| Tracked {
            name: format!("robot/{}", link.name),
            body: *body,
            is_furniture: false,
        });
    objects.chain(links).collect()
}

/// The recorder of a world.
pub struct Recorder {
    digest: Digest,
    tick_secs: f64,
    ticks_per_frame: u64,
    n_ticks: u64,
    began: u64,
    tracked: Vec<Tracked>,
    rows: Vec<Vec<f32>>,
    begin_poses: Vec<Isometry3<f64>>,
    extremes: Vec<[f64; 4]>,
    base: Option<[[f64; 2]; 2]>,
    open: BTreeMap<(Owner, Owner), Episode>,
    closed: Vec<((Owner, Owner), Episode)>,
    quality: QualityMeter,
    robot: RobotMeter,
    motion: MotionMeter,
    clearance: ClearanceMeter,
    samples: SampleMeter,
    /// The playback for another engine, if it is kept.
    playback: Option<Playback>,
}

impl Recorder {
    /// Creates an empty recorder.
    pub(super) fn new(bodies: &Bodies) -> Self {
        let tick_secs = bodies.tick_secs();
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
            tracked: tracked(bodies),
            rows: Vec::new(),
            begin_poses: Vec::new(),
            extremes: vec![[0.0; 4]; bodies.objects.len()],
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

    /// Returns the time of a tick since the record began. Unit: seconds.
    pub(super) fn secs_since_begin(&self, tick: u64) -> f64 {
        tick.saturating_sub(self.began) as f64 * self.tick_secs
    }

    /// Begins a record: resets contacts and extremes; frames continue.
    pub(super) fn begin(&mut self, engine: &Engine, drive: &Drive) {
        let bodies = engine.bodies();
        self.began = self.n_ticks;
        self.begin_poses = bodies
            .objects
            .iter()
            .map(|object| bodies.pose_of(object))
            .collect();
        self.extremes = vec![[0.0; 4]; bodies.objects.len()];
        self.base = None;
        self.open.clear();
        self.closed.clear();
        if self.rows.is_empty() {
            self.frame(bodies);
        }
        self.robot.begin(bodies.robot.model.joints.len());
        self.clearance.begin(bodies);
        self.motion
            .begin(engine, drive, self.secs_since_begin(self.n_ticks));
        self.samples = SampleMeter::begin(engine, drive, &engine.touches());
    }

    /// Ends the record and returns it.
    pub(super) fn end(&mut self, bodies: &Bodies) -> Record {
        let mut closed = std::mem::take(&mut self.closed);
        closed.extend(std::mem::take(&mut self.open));
        let secs = |tick: u64| self.secs_since_begin(tick);
        let mut contacts: Vec<Contact> = closed
            .iter()
            .map(|((first, second), episode)| {
                let mut pair = [bodies.name_of(*first), bodies.name_of(*second)];
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
        let courses = bodies.objects.iter().zip(&self.extremes);
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
        let samples = self.samples.end(bodies);
        Record {
            contacts,
            courses,
            base: self.base,
            robot: RobotCourse {
                clearances: self.clearance.clearances(bodies),
                motion: self.motion.end(bodies),
                intervals: samples.intervals(),
                samples,
                ..self
                    .robot
                    .course(bodies, |tick| self.secs_since_begin(tick))
            },
        }
    }

    /// Returns the poses of all moving bodies since the first record began. Furniture is among them
    /// if it moved.
    pub fn tracks(&self) -> Tracks {
        let Self { tracked, rows, .. } = self;
        let poses =
            |row: &[f32], idx: usize| row.get(7 * idx..7 * idx + 7).unwrap_or_default().to_vec();
        let stayed = |idx: &usize| {
            rows.windows(2)
                .all(|pair| poses(&pair[0], *idx) == poses(&pair[1], *idx))
        };
        let kept: Vec<usize> = (0..tracked.len())
            .filter(|idx| !(tracked[*idx].is_furniture && stayed(idx)))
            .collect();
        Tracks {
            period_secs: self.ticks_per_frame as f64 * self.tick_secs,
            names: kept.iter().map(|idx| tracked[*idx].name.clone()).collect(),
            rows: rows
                .iter()
                .map(|row| kept.iter().flat_map(|idx| poses(row, *idx)).collect())
                .collect(),
        }
    }

    /// Returns the worst errors of physics since the first record began.
    pub fn quality(&self) -> Quality {
        self.quality.quality()
    }

    /// Returns a digest over the bits of all states so far.
    pub fn state_digest(&self) -> String {
        self.digest.clone().finish()
    }

    /// Starts a playback for another engine.
    pub(super) fn keep_playback(&mut self, engine: &Engine) {
        self.playback = Some(Playback::begin(engine));
    }

    /// Returns the robot's part of the run since [`keep_playback`](crate::keep_playback), for
    /// another engine; `None` if it is not kept.
    pub fn playback(&self) -> Option<&Playback> {
        self.playback.as_ref()
    }

    /// Stores a command, which is part of the record.
    pub(super) fn tell(&mut self, command: &Command) {
        self.motion.tell(command);
    }

    /// Records the state after a tick in which the robot could touch this. Returns the contacts, or
    /// `None` before the first record begins.
    pub(super) fn record(
        &mut self,
        engine: &Engine,
        drive: &Drive,
        reach: Reach,
    ) -> Option<Touches> {
        let bodies = engine.bodies();
        self.n_ticks += 1;
        self.digest_state(bodies);
        if let Some(playback) = &mut self.playback {
            playback.record(&bodies.robot);
        }
        if self.rows.is_empty() {
            return None;
        }
        self.record_extremes(bodies);
        self.record_base(bodies);
        let touches = engine.touches();
        self.record_contacts(&touches);
        self.quality
            .record(&touches, free_energies(bodies, engine.sealed()));
        self.robot.record(engine, reach, self.n_ticks, &touches);
        self.samples.record(engine, drive, &touches);
        self.clearance.record_touched(&touches);
        Some(touches)
    }

    /// Records the quantities of frames, if this tick has a frame.
    pub(super) fn record_frame(&mut self, engine: &Engine, drive: &Drive) {
        if (self.n_ticks - self.began).is_multiple_of(self.ticks_per_frame) {
            self.frame(engine.bodies());
            self.clearance.record(engine.bodies());
            self.motion
                .record(engine, drive, self.secs_since_begin(self.n_ticks));
        }
    }

    fn digest_state(&mut self, bodies: &Bodies) {
        let handles = bodies
            .objects
            .iter()
            .map(|object| object.body)
            .chain(bodies.robot.bodies.iter().copied());
        let mut bits: Vec<f32> =
            Vec::with_capacity(13 * (bodies.objects.len() + bodies.robot.bodies.len()));
        for handle in handles {
            let Some(body) = bodies.physics.bodies.get(handle) else {
                continue;
            };
            bits.extend(body.translation().to_array());
            bits.extend(body.rotation().to_array());
            bits.extend(body.linvel().to_array());
            bits.extend(body.angvel().to_array());
        }
        self.digest.update_bits(&bits);
    }

    fn record_extremes(&mut self, bodies: &Bodies) {
        for (idx, object) in bodies.objects.iter().enumerate() {
            let Some(body) = bodies.physics.bodies.get(object.body) else {
                continue;
            };
            if body.is_fixed() {
                continue;
            }
            let pose = from_pose(body.position());
            let way: Vector3<f64> =
                pose.translation.vector - self.begin_poses[idx].translation.vector;
            let speed = from_vector(body.velocity_at_point(body.translation())).norm();
            let now = [Pose::from_isometry(&pose).tilt(), speed, way.z, way.norm()];
            for (extreme, value) in self.extremes[idx].iter_mut().zip(now) {
                *extreme = extreme.max(value);
            }
        }
    }

    fn record_base(&mut self, bodies: &Bodies) {
        if bodies.robot.layout.base.is_none() {
            return;
        }
        let [x, y, _] = bodies.base_true();
        let [low, high] = self.base.get_or_insert([[x, y], [x, y]]);
        (*low, *high) = (
            [low[0].min(x), low[1].min(y)],
            [high[0].max(x), high[1].max(y)],
        );
    }

    fn record_contacts(&mut self, touches: &Touches) {
        let now = self.n_ticks;
        let patience = SAME_CONTACT_SECS / self.tick_secs;
        for (pair, touch) in touches {
            let episode = self.open.entry(*pair).or_insert(Episode::begin(now));
            if (now - episode.latest) as f64 > patience {
                self.closed.push((*pair, *episode));
                *episode = Episode::begin(now);
            }
            episode.latest = now;
            if touch.normal_n > episode.max_force_n {
                (episode.max_force_n, episode.point_m) = (touch.normal_n, touch.point_m);
            }
        }
    }

    fn frame(&mut self, bodies: &Bodies) {
        let mut row = Vec::with_capacity(7 * self.tracked.len());
        for Tracked { body, .. } in &self.tracked {
            let Some(body) = bodies.physics.bodies.get(*body) else {
                continue;
            };
            let Pose { position, rotation } = Pose::from_isometry(&from_pose(body.position()));
            row.extend(position.map(|value| grain(value, FRAME_GRAIN_M)));
            row.extend(rotation.map(|value| grain(value, FRAME_GRAIN_TURN)));
        }
        self.rows.push(row);
    }
}
